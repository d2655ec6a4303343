#!/usr/bin/env bash
# Time and memory of this program and of a script of pandas and allantools on the same table, from the file to the curves, in
# one run: tests/peers/recording.sh [ROWS]   (a million by default; six channels)
#
# allantools gives the curves alone; this program everything that a report has. Installs the script's packages into
# target/peers.
set -euo pipefail
cd "$(dirname "$0")/../.."

rows=${1:-1000000}
target=${CARGO_TARGET_DIR:-$PWD/target}
folder=$target/peers/recording
mkdir -p "$folder"
if [ ! -x "$target/peers/python/bin/python" ]; then
    python3 -m venv "$target/peers/python"
    "$target/peers/python/bin/pip" install --quiet --requirement tests/requirements.txt
fi
python=$target/peers/python/bin/python
cargo build --release --locked --quiet --package host-sim
table=$folder/$rows.csv
[ -f "$table" ] || "$python" tests/peers/recording/table.py "$rows" "$table"

# Prints wall time, processor time and the largest memory of a command.
measure() {
    local name=$1
    shift
    "$python" - "$name" "$@" <<'MEASURE'
import os, subprocess, sys, time

began = time.perf_counter()
process = subprocess.Popen(sys.argv[2:], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
messages = process.stderr.read()
_, status, usage = os.wait4(process.pid, 0)
if status:
    sys.exit(f"{sys.argv[1]}: {messages.decode()}")
wall, work = time.perf_counter() - began, usage.ru_utime + usage.ru_stime
print(f"{sys.argv[1]:<32} {wall:8.2f} s {work:8.2f} s of processor time {usage.ru_maxrss / 1024:7.0f} MB")
MEASURE
}
measure "pandas and allantools.oadev" "$python" tests/peers/recording/curves.py "$table" 100
measure "host-sim analyze" "$target/release/host-sim" analyze "$table" --rate 100 --quiet
