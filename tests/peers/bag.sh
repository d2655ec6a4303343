#!/usr/bin/env bash
# Prints what this program and its peers state of one ROS 1 bag, in which processor time and memory:
#
#     tests/peers/bag.sh [SECONDS]   (three hours by default: 1.1 million messages, 400 MB)
#
# The bag is simulated, so the truth is known. allan_variance_ros takes part if ALLAN_VARIANCE_ROS names a folder with its built program
# `allan_variance` and its `scripts`; `rosmaster` must be installed then. Installs the Python packages into target/peers. IMUNOISE names
# another program than that of the release profile.
set -euo pipefail
cd "$(dirname "$0")/../.."

target=${CARGO_TARGET_DIR:-$PWD/target}
python=$target/peers/bag/bin/python
if [ ! -x "$python" ]; then
    python3 -m venv "$target/peers/bag"
    "$target/peers/bag/bin/pip" install --quiet --constraint tests/requirements.txt --requirement tests/peers/accuracy/requirements.txt \
        allantools rosbags
fi
if [ -z "${IMUNOISE:-}" ]; then
    cargo build --release --locked --quiet --package host-sim
    IMUNOISE=$target/release/imunoise
fi
"$python" tests/peers/bag/compare.py "$IMUNOISE" "$target/peers/imu-${1:-10800}" "${1:-10800}"
