#!/usr/bin/env bash
# Makes what a release consists of, in one folder: ./tests/release.sh [FOLDER]
#
# The packages of both libraries (each with `cargo publish --dry-run`), the Python wheel, the image of every board as an ELF and as
# the file that its boot loader takes, the program, the page for browsers as one file, and SHA256SUMS over all of them. Publishes nothing. The folder is
# target/release-VERSION if none is named. Needs what tests/run.sh installs, and a tree without changes: a package is made of what is
# committed.
set -euo pipefail
cd "$(dirname "$0")/.."

[ -z "$(git status --porcelain)" ] || { echo "the tree has changes: commit them first" >&2; exit 1; }
version=$(sed -n '/^\[workspace.package\]/,/^$/s/^version = "\(.*\)"/\1/p' Cargo.toml)
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
out=$(realpath -m "${1:-$target/release-$version}")
rm -rf "$out"
mkdir -p "$out"
run() { printf '+ %s\n' "$*"; "$@"; }

# The libraries; neither needs the other.
for package in adis16405-driver allan-core; do
    run cargo publish --dry-run --locked --package "$package" --target-dir "$target/publish"
    # A dry run does not say where its package is.
    run cargo package --quiet --locked --no-verify --package "$package" --target-dir "$target/publish"
    cp "$target/publish/package/$package-$version.crate" "$out"
done

# Python: the module and the command in one wheel.
python=$target/python/bin
[ -x "$python/pip" ] || { echo "no $python: run ./tests/run.sh once, which installs it" >&2; exit 1; }
# For every Linux with a C library as old as that of the build, or older than what the wheel needs (manylinux).
PATH=$python:$PATH run "$python/maturin" build --quiet --release --locked --manifest-path host-sim/python/Cargo.toml \
    --target-dir "$target" --out "$out"

# The program, optimised over all crates, which the everyday build is not.
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
