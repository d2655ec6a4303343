#!/usr/bin/env bash
# Builds all files of a release into one folder: ./tests/release.sh [FOLDER]
#
# These are the packages of the libraries (with `cargo publish --dry-run`), the Python wheel, the image of every board as an ELF and
# as the file for its boot loader, the program, the page for browsers as one file, and SHA256SUMS of all of them. Publishes nothing. The
# default folder is target/release-VERSION. Needs the tools that tests/run.sh installs, and a tree without uncommitted changes, since a
# package contains only committed files.
set -euo pipefail
cd "$(dirname "$0")/.."

[ -z "$(git status --porcelain)" ] || { echo "the tree has changes: commit them first" >&2; exit 1; }
version=$(sed -n '/^\[workspace.package\]/,/^$/s/^version = "\(.*\)"/\1/p' Cargo.toml)
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
out=$(realpath -m "${1:-$target/release-$version}")
rm -rf "$out"
mkdir -p "$out"
run() { printf '+ %s\n' "$*"; "$@"; }

# The libraries; readers needs time-base.
packages=(adis16405-driver allan-core time-base readers)
run cargo publish --dry-run --locked "${packages[@]/#/--package=}" --target-dir "$target/publish"
# A dry run does not print the path of its package.
run cargo package --quiet --locked --no-verify "${packages[@]/#/--package=}" --target-dir "$target/publish"
for package in "${packages[@]}"; do cp "$target/publish/package/$package-$version.crate" "$out"; done

# The Python module and the command are in one wheel.
python=$target/python/bin
[ -x "$python/pip" ] || { echo "no $python: run ./tests/run.sh once, which installs it" >&2; exit 1; }
# maturin tags the wheel with the oldest C library that has the symbols that it needs (manylinux).
PATH=$python:$PATH run "$python/maturin" build --quiet --release --locked --manifest-path host-sim/python/Cargo.toml \
    --target-dir "$target" --out "$out"

# The release profile optimises the program across all crates; the profile of the tests does not.
run cargo build --locked --release --package host-sim --target-dir "$target"
cp "$target/release/imunoise" "$out"

# The images
image() { # BOARD TARGET ENDING
    run cargo run --locked --quiet --package image-file -- "$1" "$out/observatory-$1.$3"
    cp "$target/image/$2/image/observatory-$1" "$out/observatory-$1.elf"
}
image h405 thumbv7em-none-eabihf bin
image feather thumbv7em-none-eabihf bin
image pico thumbv6m-none-eabi uf2

# The page
run cargo run --locked --quiet --package browser -- "$target/browser" "$out/observatory-pico.uf2"
cp "$target/browser/observatory.html" "$out"

cd "$out"
sha256sum -- * >SHA256SUMS
cat SHA256SUMS
echo "the release is in $out"
