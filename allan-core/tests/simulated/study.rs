//! Many records of one noise, through every overlap.

use crate::noise::{self, Noise};
use allan_core::{Cascade, Curve};
use std::sync::LazyLock;

pub(crate) const RECORDS: u64 = 4_000;
const SAMPLES: usize = 1 << 12;
pub(crate) const OCTAVES: usize = 11;
/// P = 1, 2, 4, 8, 16.
pub(crate) const OVERLAPS: usize = 5;

pub(crate) static WHITE: LazyLock<Study> = LazyLock::new(|| Study::of(noise::WHITE, 0));
pub(crate) static FLICKER: LazyLock<Study> = LazyLock::new(|| Study::of(noise::FLICKER, 10_000));
pub(crate) static WALK: LazyLock<Study> = LazyLock::new(|| Study::of(noise::WALK, 20_000));
pub(crate) static MIXTURE: LazyLock<Study> = LazyLock::new(|| Study::of(noise::MIXTURE, 30_000));

/// What came out, octave by octave.
pub(crate) struct Study {
    /// Degrees of freedom by calculation, P = 8.
    pub(crate) dof: [f64; OCTAVES],
    /// Intervals that cover the truth, for the noise that it is and for the one that the curve found.
    pub(crate) covered: [u32; OCTAVES],
    pub(crate) covered_as_identified: [u32; OCTAVES],
    /// How often the curve named which noise.
    pub(crate) named: [[u32; 4]; OCTAVES],
    /// Sum and sum of squares of the variances that each overlap measured, over the true variance.
    measured: [[(f64, f64); OVERLAPS]; OCTAVES],
}

impl Study {
    fn of(noise: Noise, seed: u64) -> Self {
        let truth: Vec<_> = (0..OCTAVES).map(|octave| (noise.avar(1 << octave), noise.shares(1 << octave))).collect();
        let octave = |n: u64| n.trailing_zeros() as usize;
        let mut study = Self {
            dof: [0.0; OCTAVES],
            covered: [0; OCTAVES],
            covered_as_identified: [0; OCTAVES],
            named: [[0; 4]; OCTAVES],
            measured: [[(0.0, 0.0); OVERLAPS]; OCTAVES],
        };
        for record in 0..RECORDS {
            let record = noise.record(SAMPLES, seed + record);
            let curves = [
                curve::<1>(&record),
                curve::<2>(&record),
                curve::<4>(&record),
                curve::<8>(&record),
                curve::<16>(&record),
            ];
            for (overlap, curve) in curves.iter().enumerate() {
                for point in curve.points() {
                    let ratio = point.avar / truth[octave(point.n)].0;
                    let (sum, squares) = &mut study.measured[octave(point.n)][overlap];
                    (*sum, *squares) = (*sum + ratio, *squares + ratio * ratio);
                }
            }
            let [.., identified, _] = curves;
            for point in identified.points() {
                let octave = octave(point.n);
                study.named[octave][point.noise as usize] += 1;
                study.covered_as_identified[octave] += u32::from((point.low..=point.high).contains(&truth[octave].0));
            }
            for point in identified.with_confidence(|point| truth[octave(point.n)].1).points() {
                let octave = octave(point.n);
                study.dof[octave] = point.edf;
                study.covered[octave] += u32::from((point.low..=point.high).contains(&truth[octave].0));
            }
        }
        study
    }

    /// Degrees of freedom that the scatter of the records shows, by overlap.
    pub(crate) fn equivalent_dof(&self, octave: usize) -> [f64; OVERLAPS] {
        self.measured[octave].map(|(sum, squares)| {
            let mean = sum / RECORDS as f64;
            2.0 * mean * mean / (squares / RECORDS as f64 - mean * mean)
        })
    }
}

fn curve<const OVERLAP: usize>(record: &[i32]) -> Curve<OCTAVES> {
    let mut cascade = Cascade::<OCTAVES, OVERLAP>::new();
    cascade.push_slice(record);
    cascade.curve(1.0)
}
