//! Runs libFuzzer on the target that `FUZZ_TARGET` names; `tests/fuzz.sh` builds and runs it.
#![no_main]

use fuzz::TARGETS;
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

static TARGET: LazyLock<fn(&[u8])> = LazyLock::new(|| {
    let name = std::env::var("FUZZ_TARGET").expect("FUZZ_TARGET names a target");
    TARGETS.iter().find(|(target, _)| *target == name).expect("a target of this name").1
});

fuzz_target!(|bytes: &[u8]| TARGET(bytes));
