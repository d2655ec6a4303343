#!/usr/bin/env bash
# Prints time and memory of this program and of a script with pandas and allantools, from a file to its curves:
# - on a table, plain and gzip;
# - on run 1 of the measured recordings, if ADIS_RECORDINGS names their folder;
# - on one virtual hour;
# - on a table of a million rows, and on the same rows as recordings of a minute.
#
#     tests/peers/recording.sh [--quick-only] [ROWS…]   (a million rows by default, of six channels)
#
# allantools computes only the curves. `analyze --quick` computes curves, models, errors and the findings of the trace of the curves;
# `analyze` computes the whole report. With --quick-only only `analyze --quick` runs, and only on the tables; the script's memory does not
# suffice for the largest ones. A table of a hundred million rows takes 1.6 GB. Installs the script's packages into target/peers.
set -euo pipefail
cd "$(dirname "$0")/../.."

only_quick=false
if [ "${1:-}" = --quick-only ]; then
    only_quick=true
    shift
fi
target=${CARGO_TARGET_DIR:-$PWD/target}
folder=$target/peers/recording
mkdir -p "$folder"
if [ ! -x "$target/peers/python/bin/python" ]; then
    python3 -m venv "$target/peers/python"
    "$target/peers/python/bin/pip" install --quiet --requirement tests/requirements.txt
fi
python=$target/peers/python/bin/python
cargo build --release --locked --quiet --package host-sim

# Prints wall time, processor time, largest memory, and processor time per row of a command.
measure() {
    local name=$1 rows=$2
    shift 2
    "$python" - "$name" "$rows" "$@" <<'MEASURE'
import os, subprocess, sys, time

name, rows, command = sys.argv[1], float(sys.argv[2]), sys.argv[3:]
began = time.perf_counter()
process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
messages = process.stderr.read()
_, status, usage = os.wait4(process.pid, 0)
if status:
    sys.exit(f"{name}: {messages.decode()}")
wall, work = time.perf_counter() - began, usage.ru_utime + usage.ru_stime
memory = usage.ru_maxrss / 1024
print(f"{name:<36} {wall:8.2f} s {work:8.2f} s of processor {memory:7.0f} MB {1e6 * work / rows:8.3f} us a row", flush=True)
MEASURE
}
# Prints the path of a table with this number of rows, which is written once.
table_of() {
    [ -f "$folder/$1.csv" ] || "$python" tests/peers/recording/table.py "$1" "$folder/$1.csv"
    echo "$folder/$1.csv"
}

for rows in "${@:-1000000}"; do
    table=$(table_of "$rows")
    [ -f "$table.gz" ] || gzip --keep --fast "$table"
    for file in "$table" "$table.gz"; do
        echo "$(basename "$file")"
        if ! $only_quick; then
            measure "pandas and allantools.oadev" "$rows" "$python" tests/peers/recording/curves.py "$file" 100
        fi
        measure "imunoise analyze --quick" "$rows" "$target/release/imunoise" analyze "$file" --rate 100 --quick --quiet
        if ! $only_quick; then
            measure "imunoise analyze" "$rows" "$target/release/imunoise" analyze "$file" --rate 100 --quiet
        fi
    done
done

if $only_quick; then
    exit
fi
run=${ADIS_RECORDINGS:-}/adis16405-static/run1.csv.gz
if [ -f "$run" ]; then
    echo "a measured run of a million rows with a dozen findings, thrice in turn"
    for _ in 1 2 3; do
        measure "pandas and allantools.oadev" 1000000 "$python" tests/peers/recording/curves.py "$run" 100
        measure "imunoise analyze" 1000000 "$target/release/imunoise" analyze "$run" --rate 100 --quiet
    done
fi
echo "virtual hour"
hour=$((3600 * 2048 / 10))
measure "imunoise" "$hour" "$target/release/imunoise" demo -o "$folder/page.html" --force --quiet
# The table is divided into 166 recordings of a minute at 100 Hz.
rows=996000 minute=6000
table=$(table_of "$rows")
minutes=$folder/minutes
if [ ! -d "$minutes" ]; then
    mkdir -p "$minutes"
    header=$(head -n 1 "$table")
    export header
    # shellcheck disable=SC2016 # the shell of the filter expands it
    tail -n +2 "$table" | split --lines "$minute" --filter='{ echo "$header"; cat; } > "$FILE.csv"' - "$minutes/minute-"
fi
echo "$((rows / minute)) recordings of a minute, and one of their length"
for option in --quick ""; do
    measure "imunoise analyze $option, one" "$rows" "$target/release/imunoise" analyze "$table" --rate 100 --quiet $option
    measure "imunoise batch $option, minutes" "$rows" "$target/release/imunoise" batch "$minutes"/*.csv --rate 100 \
        -o "$folder/reports" --force --quiet $option
done
