//! Random losses of samples.

use measurement::Measurement;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const STREAM: u64 = u64::MAX - 2;

/// Removes samples with the probability `share` in every channel, as `gap`; the first and the last sample are kept.
pub(super) fn lose_samples(measurement: &mut Measurement, share: f64, seed: u64) {
    if share <= 0.0 || measurement.is_empty() {
        return;
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(STREAM);
    let last = measurement.len() - 1;
    let is_kept: Vec<bool> =
        (0..=last).map(|at| at == 0 || at == last || !random.random_bool(share.min(1.0))).collect();
    let lost = is_kept.iter().filter(|kept| !**kept).count() as u64;
    keep(&mut measurement.slots, &is_kept);
    let mut kept_before = 0;
    let position = |kept: &bool| {
        let position = kept.then_some(kept_before);
        kept_before += usize::from(*kept);
        position
    };
    let moved: Vec<Option<usize>> = is_kept.iter().map(position).collect();
    for channel in &mut measurement.channels {
        keep(&mut channel.counts, &is_kept);
        for refused in channel.refused.values_mut() {
            *refused = refused.iter().filter_map(|&position| moved[position]).collect();
        }
    }
    if let Some(times) = &mut measurement.times_s {
        keep(times, &is_kept);
    }
    *measurement.dropped.entry("gap").or_insert(0) += lost;
}

fn keep<T>(values: &mut Vec<T>, is_kept: &[bool]) {
    let mut kept = is_kept.iter();
    values.retain(|_| kept.next().copied().unwrap_or(true));
}

#[cfg(test)]
mod tests {
    use super::lose_samples;
    use measurement::Measurement;
    use simulation::Simulation;

    #[test]
    fn the_share_is_lost_in_all_channels_and_leaves_gaps() {
        let recording = Simulation::paper(100.0, 1).run(|_| ()).unwrap();
        let mut whole = recordings::time_base::measurement(&recording, None).unwrap();
        whole.channels[0].refused.insert("spikes", vec![100, 101, 15_000]);
        let whole = whole;
        let mut lossy = whole.clone();
        lose_samples(&mut lossy, 0.02, 7);
        let lost = whole.len() - lossy.len();
        // 409.6 ± 20 of 20,480 samples are expected.
        assert!((330..490).contains(&lost), "{lost}");
        assert_eq!(lossy.dropped["gap"], whole.dropped["gap"] + lost as u64);
        assert_eq!(lossy.periods(), whole.periods());
        for (before, after) in whole.channels.iter().zip(&lossy.channels) {
            assert_eq!(after.counts.len(), lossy.len());
            let at = lossy.len() / 2;
            let of_whole = whole.slots.binary_search(&lossy.slots[at]).unwrap();
            assert_eq!(after.counts[at], before.counts[of_whole]);
        }
        let slot_of = |of: &Measurement, position: &usize| of.slots[*position];
        let refused = |of: &Measurement| -> Vec<u64> {
            of.channels[0].refused["spikes"].iter().map(|position| slot_of(of, position)).collect()
        };
        let expected: Vec<u64> = refused(&whole).into_iter().filter(|slot| lossy.slots.contains(slot)).collect();
        assert_eq!(refused(&lossy), expected);
        assert!(!expected.is_empty());
        let mut untouched = whole.clone();
        lose_samples(&mut untouched, 0.0, 7);
        assert_eq!(untouched, whole);
    }
}
