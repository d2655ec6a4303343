#!/usr/bin/env bash
# Prints the time that the estimator and its peers take per sample and channel, in ns, on this machine.
#
# Installs allantools into a virtual environment and builds two crates, all below target/peers. numpy uses the
# vector instructions of the machine, and so the crates are compiled for it too.
set -euo pipefail
cd "$(dirname "$0")/speed"

target=${CARGO_TARGET_DIR:-$PWD/../../../target}/peers
if [ ! -x "$target/venv/bin/python" ]; then
    python3 -m venv "$target/venv"
fi
"$target/venv/bin/pip" install --quiet --requirement requirements.txt
RUSTFLAGS="-C target-cpu=native" cargo build --release --locked --quiet --target-dir "$target"

{
    "$target/release/speed"
    "$target/venv/bin/python" peers.py
} | awk -F '\t' '
    NR == 1 { push = $2 }
    NR == 2 { slice = $2 }
    { printf "%-28s %9.2f ns", $1, $2 }
    NR > 2 { printf "   %6.1f times push, %6.1f times push_slice", $2 / push, $2 / slice }
    { print "" }'
