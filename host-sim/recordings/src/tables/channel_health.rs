//! Channels whose samples are no measurements: at full scale, or not changing.

/// Magnitudes of the largest counts of 16 bits: 32767 and -32768.
const FULL_SCALE_16_BITS: [i64; 2] = [i16::MAX as i64, i16::MIN as i64];

/// Probability that a run of equal counts of a sound channel anywhere in the record is taken for a stuck output.
const FALSE_ALARM: f64 = 1e-6;

/// What the counts of a channel show, as positions in ascending order.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct ChannelHealth {
    /// Samples at full scale.
    pub(crate) saturated: Vec<usize>,
    /// Samples in runs of equal counts that are longer than chance makes them.
    pub(crate) stuck: Vec<usize>,
}

impl ChannelHealth {
    /// Examines `counts`, `None` where a sample is refused. `range_counts` is the full scale where it is known; elsewhere it is
    /// that of 16 bits if the counts reach it and do not exceed it.
    pub(crate) fn examine(counts: &[Option<i32>], range_counts: Option<f64>) -> Self {
        let known = || counts.iter().flatten().copied().map(i64::from);
        let reaches_16_bits = known().map(i64::abs).max().is_some_and(|largest| (32_767..=32_768).contains(&largest));
        let is_saturated = |count: i64| match range_counts {
            Some(range) => count.abs() as f64 >= range - 0.5,
            None => reaches_16_bits && FULL_SCALE_16_BITS.contains(&count),
        };
        let at = |count: &Option<i32>| count.is_some_and(|count| is_saturated(i64::from(count)));
        let saturated = (0..counts.len()).filter(|&position| at(&counts[position])).collect();
        Self { saturated, stuck: stuck(counts) }
    }
}

/// Positions in runs of `L` equal counts or more, where `L` is such that a sound channel with the same share `p` of equal
/// neighbours has one in `n` samples with a probability of [`FALSE_ALARM`]: `n·p^(L-1)`.
fn stuck(counts: &[Option<i32>]) -> Vec<usize> {
    let pairs = || counts.windows(2).filter_map(|pair| Some((pair[0]?, pair[1]?)));
    let (all, equal) = (pairs().count() as f64, pairs().filter(|(one, other)| one == other).count() as f64);
    let mut runs: Vec<std::ops::Range<usize>> = Vec::new();
    let mut first = 0;
    for at in 1..=counts.len() {
        if counts.get(at) != Some(&counts[at - 1]) {
            if counts[at - 1].is_some() && at - first > 1 {
                runs.push(first..at);
            }
            first = at;
        }
    }
    // The equal neighbours of the longest run say nothing of the others.
    let longest = runs.iter().map(|run| run.len()).max().unwrap_or(0) as f64;
    if longest < 2.0 {
        return Vec::new();
    }
    let others = (all - (longest - 1.0)).max(1.0);
    let share = ((equal - (longest - 1.0)) / others).clamp(1.0 / (others + 1.0), 1.0);
    let length =
        if share < 1.0 { 1.0 + (FALSE_ALARM / (counts.len() as f64)).ln() / share.ln() } else { f64::INFINITY };
    runs.into_iter().filter(|run| run.len() as f64 >= length.max(3.0)).flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::ChannelHealth;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn counts(seed: u64, levels: i32) -> Vec<Option<i32>> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        (0..50_000).map(|_| Some(random.random_range(0..levels))).collect()
    }

    #[test]
    fn a_sound_channel_is_neither() {
        for (seed, levels) in [(1, 2), (2, 3), (3, 50), (4, 10_000)] {
            assert_eq!(
                ChannelHealth::examine(&counts(seed, levels), None),
                ChannelHealth::default(),
                "{levels} levels"
            );
        }
    }

    #[test]
    fn full_scale_and_a_frozen_output_are_found() {
        let mut seen = counts(5, 50);
        seen[100..140].fill(Some(32_767));
        seen[20_000..20_030].fill(Some(7));
        let health = ChannelHealth::examine(&seen, None);
        assert_eq!(health.saturated, (100..140).collect::<Vec<_>>());
        assert!((20_000..20_030).all(|at| health.stuck.contains(&at)) && health.stuck.len() <= 40 + 30 + 4);
        // With a known range.
        assert_eq!(ChannelHealth::examine(&counts(6, 10), Some(9.0)).saturated.len(), {
            counts(6, 10).iter().filter(|count| **count == Some(9)).count()
        });
    }

    #[test]
    fn a_missing_sample_ends_a_run() {
        let mut seen = counts(7, 1000);
        seen[10..12].fill(Some(1));
        seen[12] = None;
        assert_eq!(ChannelHealth::examine(&seen, None).stuck, Vec::<usize>::new());
        assert_eq!(ChannelHealth::examine(&[None; 5], None), ChannelHealth::default());
        assert_eq!(ChannelHealth::examine(&[], None), ChannelHealth::default());
    }
}
