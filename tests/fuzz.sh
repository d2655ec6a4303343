#!/usr/bin/env bash
# Searches with libFuzzer for bytes that break a guarantee: tests/fuzz.sh [SECONDS] [TARGET...]. The default is all targets, each for 10 s.
#
# Each run tries the same bytes. SEED=2 selects others, and SEED=0 a seed from the clock.
# Needs a C++ compiler. The crates of this workspace are compiled with counters of the edges of their code, by flags of stable Rust; other
# crates are compiled as for the tests. Each target starts with the bytes in `tests/fuzz/corpus`. Bytes that reach new code are written to
# `target/fuzz/TARGET/`, and bytes that break a guarantee to `target/fuzz/TARGET-crash-…`. The exit code is not 0 if there are such bytes.
set -euo pipefail
cd "$(dirname "$0")/.."

seconds=${1-10}
shift $(($# ? 1 : 0))
targets=("$@")
[ $# -gt 0 ] || mapfile -t targets < <(ls tests/fuzz/corpus)
TARGET=$(realpath "${CARGO_TARGET_DIR:-target}")
mkdir -p "$TARGET/fuzz"

# Cargo calls this instead of rustc for the crates of the workspace. Build scripts and procedural macros get no counters.
cat >"$TARGET/fuzz/rustc" <<'WRAPPER'
#!/bin/sh
case " $* " in *" --crate-name build_script_"* | *" proc-macro "*) exec "$@" ;; esac
exec "$@" -C passes=sancov-module -C llvm-args=-sanitizer-coverage-level=3 -C llvm-args=-sanitizer-coverage-inline-8bit-counters \
    -C llvm-args=-sanitizer-coverage-pc-table -C llvm-args=-sanitizer-coverage-trace-compares
WRAPPER
chmod +x "$TARGET/fuzz/rustc"
RUSTC_WRAPPER='' RUSTC_WORKSPACE_WRAPPER=$TARGET/fuzz/rustc cargo build --locked --workspace --example fuzz --features \
    fuzz/libfuzzer,adis16405-driver/async,adis16405-driver/serde,allan-core/serde
cp "$TARGET/debug/examples/fuzz" "$TARGET/fuzz/fuzz"

# libFuzzer writes only to its first folder, so the corpus is not changed. Each simulated device leaks 0.1 MB of static variables.
fuzz() {
    local found=$TARGET/fuzz/$1 limit_mb=1000
    [ "$1" != commands ] || limit_mb=$((limit_mb + 20 * seconds))
    rm -rf "$found" "$found"-*
    mkdir -p "$found"
    FUZZ_TARGET=$1 "$TARGET/fuzz/fuzz" -seed="$SEED" -max_total_time="$seconds" -timeout=20 -rss_limit_mb=$limit_mb -malloc_limit_mb=1000 \
        -max_len=8192 -print_final_stats=1 -artifact_prefix="$found-" "$found" "tests/fuzz/corpus/$1" >"$found.log" 2>&1 ||
        { tail -n 40 "$found.log"; echo "$1: a finding"; return 1; }
    printf '%-10s %9s runs, %5s edges\n' "$1" "$(sed -n 's/^stat::number_of_executed_units: *//p' "$found.log")" \
        "$(sed -n 's/.* cov: \([0-9]*\) .*/\1/p' "$found.log" | tail -n 1)"
}
export -f fuzz
export TARGET seconds SEED=${SEED-1}
printf '%s\n' "${targets[@]}" | xargs -P 2 -I{} bash -c 'fuzz {}'
