#!/usr/bin/env bash
# Writes the generated parts of the documentation, and shows the changes: ./tests/docs.sh [ARGUMENTS OF CARGO, such as --package reports]
#
# A generated part is in a page between `<!-- begin NAME -->` and `<!-- end NAME -->` (tests/src/generated.rs). The tests whose names
# contain `in_the_docs` generate it. Without this script they fail if a part differs from the generated text.
set -euo pipefail
cd "$(dirname "$0")/.."

[ $# -gt 0 ] || set -- --workspace
status=0
WRITE_DOCS=1 cargo test --locked --no-fail-fast "$@" in_the_docs -- --include-ignored || status=$?
git --no-pager diff --stat
exit $status
