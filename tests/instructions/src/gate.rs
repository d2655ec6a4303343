//! Instructions of the firmware's gate against gross errors, per sample and channel.

use crate::channels::{CHANNELS, ChannelSet};
use crate::emulator::instructions;
use crate::gross_error_gate::GrossErrorGate;
use core::hint::black_box;
use cortex_m_semihosting::hprintln;

/// Number of noise samples, which are repeated.
const NOISE: usize = 64;
/// Repetitions for sixteen blocks, each of which ends with an estimate of the noise.
const REPETITIONS: usize = 16 * 256 / NOISE;

/// Counts samples of noise; each channel lacks one in 64.
pub(crate) fn count() {
    let mut gate = black_box(<GrossErrorGate>::new());
    let mut state = 1_u64;
    let mut samples = [([0; CHANNELS.len()], ChannelSet::EMPTY); NOISE];
    for (k, (counts, refused)) in samples.iter_mut().enumerate() {
        for count in counts {
            state = state * 16_807 % 2_147_483_647;
            *count = (state % 41) as i32 - 20;
        }
        refused.insert_if(k / CHANNELS.len(), k % CHANNELS.len() == 0);
    }
    let mut run = || {
        for (counts, refused) in (0..REPETITIONS).flat_map(|_| black_box(&samples)) {
            black_box(gate.find(counts, *refused));
        }
    };
    run(); // the gate learns the noise
    let tenths = 10 * instructions(run) / (REPETITIONS * NOISE * CHANNELS.len()) as u64;
    hprintln!("count gate {}.{}", tenths / 10, tenths % 10);
}
