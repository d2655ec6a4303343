#!/usr/bin/env bash
# Checks that the four published libraries are complete: the files and the tests of their packages, and that they build with the oldest
# Rust and the oldest direct dependencies: ./tests/publish.sh
#
# Needs rustup, which installs the toolchains 1.85, 1.88, 1.95 and nightly if they are missing (only nightly resolves minimal versions).
set -euo pipefail
cd "$(dirname "$0")/.."

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
TARGET=$(realpath "${CARGO_TARGET_DIR:-target}")/publish
run() { printf '+ %s\n' "$*"; "$@"; }

check() { # PACKAGE OLDEST_RUST [PACKAGE_ON_WHICH_IT_DEPENDS]
    local package=$1 oldest=$2 directory needed=()
    directory=$(echo "$work/$package"-[0-9]*)
    # No registry has the other package before the release.
    [ -z "${3:-}" ] || needed=(--config "patch.crates-io.$3.path=\"$(echo "$work/$3"-[0-9]*)\"")
    for file in Cargo.toml README.md CHANGELOG.md LICENSE-MIT LICENSE-APACHE src/lib.rs; do
        [ -s "$directory/$file" ] || { echo "$package: the package lacks $file" >&2; exit 1; }
    done
    for field in description documentation readme keywords categories license rust-version; do
        grep -q "^$field = " "$directory/Cargo.toml" || { echo "$package: the package has no $field" >&2; exit 1; }
    done
    for version in "$oldest" nightly; do
        rustup toolchain list | grep -q "^$version-" || run rustup toolchain install --profile minimal "$version"
    done
    (
        cd "$directory"
        # The package is built as by a user: alone, with all features, with its own tests.
        run cargo test "${needed[@]}" --quiet --no-run --all-features --target-dir "$TARGET/tests"
        run cargo "+$oldest" check "${needed[@]}" --quiet --all-features --target-dir "$TARGET/$oldest"
        # Tests need newer versions of their dependencies than the library.
        sed -i '/^\[dev-dependencies/,/^$/d; /^\[target.*dev-dependencies/,/^$/d; /^\[\[\(test\|bench\|example\)\]\]/,/^$/d' Cargo.toml
        rm -rf Cargo.lock tests benches examples
        run cargo +nightly update "${needed[@]}" --quiet -Z direct-minimal-versions
        run cargo +nightly check "${needed[@]}" --quiet --lib --all-features --target-dir "$TARGET/minimal"
    )
}

grep -q '^repository' Cargo.toml || echo "before a release: state the public address, repository in Cargo.toml and in those of the libraries"
PACKAGES=(--package adis16405-driver --package allan-core --package time-base --package readers)
run cargo package --locked --allow-dirty --no-verify --quiet "${PACKAGES[@]}" --target-dir "$TARGET"
version=$(sed -n '/^\[workspace.package\]/,/^$/s/^version = "\(.*\)"/\1/p' Cargo.toml)
for package in "$TARGET/package"/*-"$version".crate; do tar -xzf "$package" -C "$work"; done
RUSTDOCFLAGS="-D warnings" run cargo doc --quiet --locked --no-deps --all-features "${PACKAGES[@]}" --target-dir "$TARGET/doc"
check adis16405-driver 1.85
check allan-core 1.88
check time-base 1.95
check readers 1.95 time-base

# The interfaces must be compatible with the last release.
last=$(git describe --tags --abbrev=0 --match 'v[0-9]*' 2>/dev/null || true)
if [ -z "$last" ]; then
    echo "the interfaces are not compared: no release is tagged v…"
else
    cargo semver-checks --version >/dev/null 2>&1 || run cargo install --locked cargo-semver-checks
    run cargo semver-checks "${PACKAGES[@]}" --all-features --baseline-rev "$last"
fi
echo "all packages are complete"
