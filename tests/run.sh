#!/usr/bin/env bash
# Every check and test of the noise observatory, from a clean checkout.
#
# Needs rustup with its default toolchain, a C compiler, and Node.js 20 with npm; installs what is missing with rustup, and
# with apt-get the QEMU that counts instructions, and says so. Fails, and never skips, if something cannot be had. The
# emulators that the images run in are the crate rigless, compiled here, which asks for a newer Rust than it needs,
# hence --ignore-rust-version, and rp2040js, which npm brings.
set -euo pipefail
cd "$(dirname "$0")/.."

step() { printf '\n== %s\n' "$*"; }
run() {
    printf '+ %s\n' "$*"
    "$@"
}

MCU=thumbv7em-none-eabihf  # Cortex-M4F: the firmware
SMALL=thumbv6m-none-eabi   # Cortex-M0+: the two libraries

step "tools"
command -v rustup >/dev/null || { echo "rustup is missing: install Rust with rustup" >&2; exit 1; }
command -v cc >/dev/null || { echo "a C compiler is missing: install it with: apt-get install gcc libc6-dev" >&2; exit 1; }
if ! command -v qemu-system-arm >/dev/null; then
    run apt-get update -qq
    run apt-get install -y -qq --no-install-recommends qemu-system-arm
fi
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "$tool is missing: install Node.js 20 with npm (the Pico's emulator)" >&2; exit 1; }
done
for target in "$MCU" "$SMALL"; do
    rustup target list --installed | grep -qx "$target" || run rustup target add "$target"
done
for component in rustfmt clippy; do
    rustup component list --installed | grep -q "^$component" || run rustup component add "$component"
done
run cargo --version

step "format"
run cargo fmt --all --check

step "lints and builds for microcontrollers"
run cargo clippy --locked --package firmware --bin observatory-f405 --features board-f405 --target "$MCU" --profile image -- -D warnings
run cargo clippy --locked --package firmware --bin observatory-pico --features board-pico --target "$SMALL" --profile image -- -D warnings
for target in "$MCU" "$SMALL"; do
    run cargo clippy --locked --package adis16405-driver --package allan-core --features allan-core/serde --target "$target" -- -D warnings
    run cargo clippy --locked --package adis16405-driver --all-features --target "$target" -- -D warnings
done

step "lints for the host"
run cargo clippy --locked --workspace --all-targets --ignore-rust-version -- -D warnings

step "documentation"
RUSTDOCFLAGS="-D warnings" run cargo doc --locked --no-deps --package adis16405-driver --package allan-core
RUSTDOCFLAGS="-D warnings" run cargo doc --locked --no-deps --package adis16405-driver --all-features

step "the driver with all its features"
run cargo test --locked --package adis16405-driver --all-features

step "tests, the images in emulators among them; ten emulated minutes at full speed go on beside the others"
run cargo test --locked --workspace --ignore-rust-version --no-run
TEN_MINUTES=no_sample_is_lost_or_doubled_while_everything_is_going_on
log=$(mktemp)
set -m # a process group of its own
# --workspace, so that nothing is built again with other features
OBSERVATORY_SECONDS=600 cargo test --locked --workspace --ignore-rust-version --test image -- --nocapture \
    "$TEN_MINUTES" >"$log" 2>&1 &
beside=$!
set +m
trap 'kill -- -"$beside" 2>/dev/null || true; rm -f "$log"' EXIT
run cargo test --locked --workspace --ignore-rust-version -- --skip "$TEN_MINUTES"
step "ten emulated minutes"
wait "$beside" || { cat "$log"; exit 1; }
cat "$log"

step "all passed"
