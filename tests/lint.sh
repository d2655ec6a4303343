#!/usr/bin/env bash
# Cargo calls this in the place of rustc for the crates of the workspace (RUSTC_WORKSPACE_WRAPPER): clippy reads the crate first, and only what
# it has nothing to say about is compiled. So the dependencies are compiled once for lints and tests, and clippy, which switches off
# optimisations of its own process, does not make the program.
# In bash: dash drops variables such as CARGO_BIN_EXE_imunoise.
set -eu
rustc=$1
shift
case " $* " in *" --emit="*) ;; *) exec "$rustc" "$@" ;; esac # a question about the compiler

# The arguments for clippy: no code, no file that stays, and no message to cargo that a file is there.
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
# A library of the host is read by clippy as it is compiled for its own tests, which have all of its code. Code that only they use is
# found by rustc, here.
case " $* " in
    *" --test "* | *" --target "* | *" --crate-type bin "*) ;;
    *) grep -q '^test = false' "$CARGO_MANIFEST_DIR/Cargo.toml" || exec "$rustc" "$@" -D warnings ;;
esac
lint "$@"
rm -rf "$scratch"
exec "$rustc" "$@" --cap-lints allow
