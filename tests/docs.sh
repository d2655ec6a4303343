#!/usr/bin/env bash
# Writes what is generated in the documentation, and shows what has changed: ./tests/docs.sh [ARGUMENTS OF CARGO, such as --package reports]
#
# A generated part stands in a page between `<!-- begin NAME -->` and `<!-- end NAME -->` (tests/src/generated.rs). The tests whose names
# have the words `in_the_docs` make it; run without this script, they fail where a part is not what they make of it.
set -euo pipefail
cd "$(dirname "$0")/.."

[ $# -gt 0 ] || set -- --workspace
status=0
WRITE_DOCS=1 cargo test --locked --no-fail-fast "$@" in_the_docs || status=$?
git --no-pager diff --stat
exit $status
