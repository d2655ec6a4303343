#!/usr/bin/env bash
# Cargo calls this instead of rustc for the crates of the workspace (RUSTC_WORKSPACE_WRAPPER). Clippy checks a crate first, and rustc
# compiles it only if clippy finds nothing. So the dependencies are compiled once for lints and tests, and the program is not built by
# clippy, which disables optimisations in its own process.
# This is a bash script, since dash drops variables such as CARGO_BIN_EXE_imunoise.
set -eu
rustc=$1
shift
case " $* " in *" --emit="*) ;; *) exec "$rustc" "$@" ;; esac # a query of the compiler's properties

# Runs clippy with changed arguments: it generates no code, leaves no file, and reports no file to cargo.
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
lint() {
    skip=
    for argument; do
        shift
        case $skip$argument in
            out*) skip= && set -- "$@" "$scratch" && continue ;;
            --out-dir) skip=out ;;
            --emit=*) argument=--emit=metadata ;;
            --json=*) argument=$(printf %s "$argument" | sed 's/,artifacts//') ;;
            incremental=*) argument=debuginfo=0 ;;
        esac
        set -- "$@" "$argument"
    done
    clippy-driver "$rustc" "$@" -D warnings
}
# Clippy checks a library of the host when it is compiled for its own tests, which include all of its code. Without its tests
# it is compiled by rustc alone, which finds code that only the tests use.
case " $* " in
    *" --test "* | *" --target "* | *" --crate-type bin "*) ;;
    *) grep -q '^test = false' "$CARGO_MANIFEST_DIR/Cargo.toml" || exec "$rustc" "$@" -D warnings ;;
esac
lint "$@"
rm -rf "$scratch"
exec "$rustc" "$@" --cap-lints allow
