#!/bin/sh
# Draws the pictures of the documentation anew, as `-o NAME.svg` draws them:
#
#     docs/pictures.sh
#
#   docs/report.svg       gyro x of the simulated hour of `demo` (seed 1); no recording
#   docs/run1-gyro_z.svg  gyro z of adis16405-static/run1.csv.gz in the folder that ADIS_RECORDINGS names (docs/measured.md); left
#                         as it is without
set -eu
cd "$(dirname "$0")/.."
drawn=$(mktemp -d)
trap 'rm -rf "$drawn"' EXIT

cargo run --release -- demo --quiet -o "$drawn/simulated.svg"
cp "$drawn/simulated-gyro_x-allan.svg" docs/report.svg

if [ -n "${ADIS_RECORDINGS:-}" ]; then
    cargo run --release -- analyze "$ADIS_RECORDINGS/adis16405-static/run1.csv.gz" --rate 100 --quiet -o "$drawn/run1.svg"
    cp "$drawn/run1-gyro_z-allan.svg" docs/run1-gyro_z.svg
else
    echo "docs/run1-gyro_z.svg is left as it was: ADIS_RECORDINGS names no folder" >&2
fi
