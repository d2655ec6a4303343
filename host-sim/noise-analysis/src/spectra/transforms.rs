//! Plans of Fourier transforms of real numbers, which are made once for each length.

use realfft::{RealFftPlanner, RealToComplex};
use std::sync::{Arc, Mutex, PoisonError};

type Plan = Arc<dyn RealToComplex<f64>>;

/// Plans that are kept: those of one analysis are of the whole record, of its half, of its means and of stretches.
const KEPT: usize = 6;

/// The lengths that were asked for last, the latest first, with their plans.
static PLANS: Mutex<Vec<(usize, Plan)>> = Mutex::new(Vec::new());

/// The transform of `length` real numbers, 2 or more.
pub(super) fn forward(length: usize) -> Plan {
    let mut plans = PLANS.lock().unwrap_or_else(PoisonError::into_inner);
    let kept = plans.iter().position(|(of, _)| *of == length).map(|at| plans.remove(at).1);
    let plan = kept.unwrap_or_else(|| RealFftPlanner::new().plan_fft_forward(length));
    plans.insert(0, (length, Arc::clone(&plan)));
    plans.truncate(KEPT);
    plan
}
