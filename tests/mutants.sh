#!/usr/bin/env bash
# Changes single operators and values in the code that decodes, estimates and fits, and lists the changes that no test notices:
# tests/mutants.sh [SEED [NUMBER [AREA...]]]. The default is seed 1, and 40 changes in each area: driver, cascade, gaps, fit, wire.
#
# Needs cargo-mutants (`cargo install cargo-mutants`). A change is tested by the tests of its crate for its area and, if they do not notice
# it, by all tests of the crate. Prints a line for each unnoticed change; `target/mutants/AREA` has the others. cargo-mutants tries all
# deletions of fields in a selected file, even if they are not drawn.
set -euo pipefail
cd "$(dirname "$0")/.."

seed=${1-1} number=${2-40}
areas=("${@:3}")
[ ${#areas[@]} -gt 0 ] || areas=(driver cascade gaps fit wire)
TARGET=$(realpath "${CARGO_TARGET_DIR:-target}")

for area in "${areas[@]}"; do
    case $area in
        driver) crate=adis16405-driver files=(adis16405-driver/src/{burst,channel,sample,validity}.rs) about=(decoding validity) ;;
        cascade) crate=allan-core files=(allan-core/src/cascade.rs allan-core/src/cascade/{block,checkpoint,snapshot}.rs) about=(cascade range) ;;
        gaps) crate=allan-core files=(allan-core/src/{cascade/gap,interpolation,time_stamps}.rs) about=(cascade gaps) ;;
        fit) crate=allan-core files=(allan-core/src/curve.rs allan-core/src/fit.rs "allan-core/src/fit/*.rs") about=(cascade fit) ;;
        wire) crate=link files=("firmware/link/src/*.rs") about=(frames) ;;
        *) echo "no area $area" >&2; exit 2 ;;
    esac
    case $crate in
        adis16405-driver) features=(--features async,serde) ;;
        allan-core) features=(--features host,serde) ;;
        *) features=() ;;
    esac
    export CARGO_TARGET_DIR=$TARGET/mutants/build-$crate # compiles dependencies once
    out=$TARGET/mutants/$area
    rm -rf "$out"
    mkdir -p "$out"
    cargo mutants --package $crate "${files[@]/#/--file=}" --list | sort >"$out/all.txt"
    python3 -c 'import random, sys
lines = sys.stdin.read().splitlines()
print(*random.Random(int(sys.argv[1])).sample(lines, min(int(sys.argv[2]), len(lines))), sep="\n")' "$seed" "$number" <"$out/all.txt" >"$out/drawn.txt"
    # Tries the changes listed in a file, with these arguments of `cargo test`. Exit codes 2 and 3 report unnoticed changes or timeouts.
    try() {
        local name=$1 list=$2 status=0
        sed 's/[][\.*^$+?(){}|]/\\&/g; s/.*/--re=^&$/' "$list" >"$out/$name.patterns"
        mapfile -t patterns <"$out/$name.patterns"
        cargo mutants --package $crate "${files[@]/#/--file=}" "${patterns[@]}" --no-shuffle --timeout 60 --output "$out/$name" \
            "${features[@]}" --cargo-arg=--locked -- "${@:3}" >"$out/$name.log" 2>&1 || status=$?
        [[ $status = [023] ]] || { tail "$out/$name.log"; exit 1; }
    }
    try first "$out/drawn.txt" --test suite -- "${about[@]/%/::}"
    left=$out/first/mutants.out/missed.txt
    [ ! -s "$left" ] || { try second "$left" && left=$out/second/mutants.out/missed.txt; }
    count() { sort -u "$out"/*/mutants.out/"$1".txt | wc -l; }
    printf '%s: %d drawn from %d: %d noticed, %d do not compile, %d do not end, %d left\n' "$area" "$(wc -l <"$out/drawn.txt")" \
        "$(wc -l <"$out/all.txt")" "$(count caught)" "$(count unviable)" "$(count timeout)" "$(wc -l <"$left")"
    sed 's/^/    /' "$left"
done
