#!/usr/bin/env bash
# Changes single operators and values of what decodes, estimates and fits, and lists the changes that no test notices:
# tests/mutants.sh [SEED [NUMBER [AREA...]]], without arguments by seed 1, 40 in each of the areas driver, cascade, gaps, fit and wire.
#
# Needs cargo-mutants (`cargo install cargo-mutants`). The tests are those of the changed crate: first those that are about the area, then,
# for what they do not notice, all. Prints a line for each change that is left; `target/mutants/AREA` has the others. cargo-mutants tries the
# deletions of fields in a chosen file whether they are chosen or not.
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
    export CARGO_TARGET_DIR=$TARGET/mutants/build-$crate # dependencies are compiled once
    out=$TARGET/mutants/$area
    rm -rf "$out"
    mkdir -p "$out"
    cargo mutants --package $crate "${files[@]/#/--file=}" --list | sort >"$out/all.txt"
    python3 -c 'import random, sys
lines = sys.stdin.read().splitlines()
print(*random.Random(int(sys.argv[1])).sample(lines, min(int(sys.argv[2]), len(lines))), sep="\n")' "$seed" "$number" <"$out/all.txt" >"$out/drawn.txt"
    # Tries the changes that stand in a file, with these arguments of `cargo test`; 2 and 3 say that changes or timeouts are left.
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
