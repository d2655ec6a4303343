#!/usr/bin/env bash
# Checks that the two published libraries are complete: the files and the tests of their packages, and that they build with the oldest
# Rust and the oldest direct dependencies: ./tests/publish.sh
#
# Needs rustup, which installs the toolchains 1.85, 1.88 and nightly if they are missing (only nightly resolves minimal versions).
set -euo pipefail
cd "$(dirname "$0")/.."

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
TARGET=$(realpath "${CARGO_TARGET_DIR:-target}")/publish
run() { printf '+ %s\n' "$*"; "$@"; }

check() { # PACKAGE OLDEST_RUST
    local package=$1 oldest=$2 directory
    run cargo package --locked --allow-dirty --no-verify --quiet --package "$package" --target-dir "$TARGET"
    tar -xzf "$TARGET/package/$package"-*.crate -C "$work"
    directory=$(echo "$work/$package"-*)
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
        run cargo test --quiet --no-run --all-features --target-dir "$TARGET/tests"
        run cargo "+$oldest" check --quiet --all-features --target-dir "$TARGET/$oldest"
        # Tests need newer versions of their dependencies than the library.
        sed -i '/^\[dev-dependencies/,/^$/d; /^\[target.*dev-dependencies/,/^$/d; /^\[\[\(test\|bench\|example\)\]\]/,/^$/d' Cargo.toml
        rm -rf Cargo.lock tests benches examples
        run cargo +nightly update --quiet -Z direct-minimal-versions
        run cargo +nightly check --quiet --lib --all-features --target-dir "$TARGET/minimal"
    )
}

grep -q '^repository' Cargo.toml || echo "before a release: state the public address, repository in Cargo.toml and in those of both libraries"
check adis16405-driver 1.85
check allan-core 1.88

# The interfaces must be compatible with the last release.
last=$(git describe --tags --abbrev=0 --match 'v[0-9]*' 2>/dev/null || true)
if [ -z "$last" ]; then
    echo "the interfaces are not compared: no release is tagged v…"
else
    cargo semver-checks --version >/dev/null 2>&1 || run cargo install --locked cargo-semver-checks
    run cargo semver-checks --package adis16405-driver --package allan-core --all-features --baseline-rev "$last"
fi
echo "both packages are complete"
