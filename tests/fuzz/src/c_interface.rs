//! The interface for C: samples, numbers, terms, a stored state and a model, each of which a caller may pass wrongly.

use allan_core_c as _;
use std::ffi::c_void;
use std::ptr::null_mut;

/// Memory for an object in C: its size is that of `allan_core.h`, its content arbitrary.
#[repr(C, align(8))]
struct Memory<const BYTES: usize>([u8; BYTES]);

type Estimator = Memory<3592>;
type Curve = Memory<2720>;
/// Memory of an `allan_model`: three words before eight terms.
type Model = Memory<{ 24 + 8 * TERM }>;
/// Memory of an `allan_trace_result`: two models, a number, and five added terms of four words.
type Traced = Memory<{ 2 * (24 + 8 * TERM) + 8 + 5 * 32 }>;
/// Bytes of an `allan_term`: two words of 32 bits, and nine numbers.
const TERM: usize = 80;
/// Bytes of a saved state, `ALLAN_24_8_SAVED_SIZE`.
const SAVED: usize = 4500;
/// Status of a panic, `ALLAN_ERROR_INTERNAL`.
const INTERNAL: i32 = 11;

unsafe extern "C" {
    fn allan_24_8_init(estimator: *mut Estimator, bytes: usize) -> i32;
    fn allan_24_8_push_slice(estimator: *mut Estimator, samples: *const i32, count: usize) -> i32;
    fn allan_24_8_gap(estimator: *mut Estimator, missing: u32) -> i32;
    fn allan_24_8_merge(estimator: *mut Estimator, later: *const Estimator) -> i32;
    fn allan_24_8_len(estimator: *const Estimator) -> u64;
    fn allan_24_8_curve(estimator: *const Estimator, sample_period: f64, lsb: f64, curve: *mut Curve) -> i32;
    fn allan_24_8_save(estimator: *const Estimator, buffer: *mut u8, capacity: usize, length: *mut usize) -> i32;
    fn allan_24_8_restore(estimator: *mut Estimator, state: *const u8, length: usize) -> i32;
    fn allan_fit(curve: *const Curve, terms: *const Memory<TERM>, count: usize, shapes: bool, model: *mut Model)
    -> i32;
    fn allan_trace(
        curve: *const Curve,
        filters: *const Memory<TERM>,
        count: usize,
        keep_on: Option<unsafe extern "C" fn(context: *mut c_void) -> bool>,
        context: *mut c_void,
        result: *mut Traced,
    ) -> i32;
    fn allan_model_avar(model: *const Model, n: u64) -> f64;
    fn allan_count(value: f64, origin: f64, lsb: f64, count: *mut i32) -> i32;
}

/// Cancels a trace after the baseline.
unsafe extern "C" fn stop(_: *mut c_void) -> bool {
    false
}

/// The next bytes as an array, filled with zeros after the last byte.
fn next<const BYTES: usize>(bytes: &mut &[u8]) -> [u8; BYTES] {
    let mut array = [0; BYTES];
    let (first, rest) = bytes.split_at(bytes.len().min(BYTES));
    array[..first.len()].copy_from_slice(first);
    *bytes = rest;
    array
}

/// No call panics for any arguments, and a restored state equals the saved one.
pub(crate) fn calls(mut bytes: &[u8]) {
    let bytes = &mut bytes;
    let [sample_period, lsb, value] = [(); 3].map(|()| f64::from_le_bytes(next(bytes)));
    let [missing, terms, samples, shapes] = next(bytes);
    let terms: Vec<Memory<TERM>> = (0..terms % 10).map(|_| Memory(next(bytes))).collect();
    let samples: Vec<i32> = (0..samples).map(|_| i32::from_le_bytes(next(bytes))).collect();
    let mut model = Memory(next(bytes));
    // This memory is not an estimator, since it lacks the mark of one.
    let mut estimator: Estimator = Memory([0xAA; _]);
    let (mut curve, mut count): (Curve, i32) = (Memory([0xAA; _]), 0);
    let mut traced = Memory([0; _]);
    let status = |status: i32| assert!((0..INTERNAL).contains(&status), "status {status}");
    // SAFETY: every pointer is to memory of its type, which nothing else uses.
    unsafe {
        status(allan_count(value, sample_period, lsb, &raw mut count));
        status(allan_24_8_push_slice(&raw mut estimator, samples.as_ptr(), samples.len()));
        status(allan_24_8_init(&raw mut estimator, missing.into()));
        status(allan_24_8_init(&raw mut estimator, size_of::<Estimator>()));
        status(allan_24_8_push_slice(&raw mut estimator, samples.as_ptr(), samples.len()));
        status(allan_24_8_gap(&raw mut estimator, missing.into()));
        status(allan_24_8_push_slice(&raw mut estimator, samples.as_ptr(), samples.len()));

        let (mut saved, mut length) = ([0_u8; SAVED], 0);
        status(allan_24_8_save(&raw const estimator, saved.as_mut_ptr(), missing.into(), &raw mut length));
        assert_eq!(allan_24_8_save(&raw const estimator, saved.as_mut_ptr(), SAVED, &raw mut length), 0);
        let mut other: Estimator = Memory([0; _]);
        assert_eq!(allan_24_8_init(&raw mut other, size_of::<Estimator>()), 0);
        status(allan_24_8_restore(&raw mut other, bytes.as_ptr(), bytes.len()));
        assert_eq!(allan_24_8_restore(&raw mut other, saved.as_ptr(), length), 0);
        assert_eq!(allan_24_8_len(&raw const other), 2 * samples.len() as u64);
        // A changed byte must be detected.
        saved[usize::from(missing) % length] ^= 1;
        assert_ne!(allan_24_8_restore(&raw mut other, saved.as_ptr(), length), 0);
        status(allan_24_8_merge(&raw mut estimator, &raw const other));

        status(allan_24_8_curve(&raw const estimator, sample_period, lsb, &raw mut curve));
        status(allan_fit(&raw const curve, terms.as_ptr(), terms.len(), shapes & 1 == 1, &raw mut model));
        status(allan_trace(&raw const curve, terms.as_ptr(), terms.len(), Some(stop), null_mut(), &raw mut traced));
        let _any = allan_model_avar(&raw const model, missing.into());
    }
}
