//! State as data: resumed to the bit, refused when damaged, merged in any grouping.

use allan_core::{Between, Cascade, Coupling, Hadamard};
use proptest::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

const OCTAVES: usize = 7;

/// Everything that learns from two channels.
#[derive(Debug, Clone, PartialEq)]
struct Estimators {
    a: Cascade<OCTAVES, 8>,
    b: Cascade<OCTAVES, 8>,
    coupling: Coupling<OCTAVES>,
    hadamard: Hadamard<OCTAVES, 8>,
    between: Between<OCTAVES, 8>,
}

impl Estimators {
    fn new() -> Self {
        Self {
            a: Cascade::new(),
            b: Cascade::new(),
            coupling: Coupling::new(),
            hadamard: Hadamard::new(),
            between: Between::new(),
        }
    }

    fn of(samples: &[(i32, i32)]) -> Self {
        let mut all = Self::new();
        all.extend(samples);
        all
    }

    fn extend(&mut self, samples: &[(i32, i32)]) {
        for &(a, b) in samples {
            self.a.push(a);
            self.b.push(b);
            self.coupling.observe(&self.a, &self.b);
            self.hadamard.observe(&self.a);
            self.between.observe(&self.a);
        }
    }

    fn merge(&mut self, later: &Self) {
        self.a.merge(&later.a);
        self.b.merge(&later.b);
        self.coupling.merge(&later.coupling);
        self.hadamard.merge(&later.hadamard);
        self.between.merge(&later.between);
    }

    fn merged(mut self, later: &Self) -> Self {
        self.merge(later);
        self
    }

    fn kept_and_resumed(&self) -> Self {
        Self {
            a: through_postcard(&self.a),
            b: through_postcard(&self.b),
            coupling: through_postcard(&self.coupling),
            hadamard: through_postcard(&self.hadamard),
            between: through_postcard(&self.between),
        }
    }
}

fn through_postcard<T: Serialize + DeserializeOwned>(state: &T) -> T {
    postcard::from_bytes(&postcard::to_stdvec(state).unwrap()).unwrap()
}

fn samples(most: usize) -> impl Strategy<Value = Vec<(i32, i32)>> {
    let shifted = (any::<(i32, i32)>(), 0..32_u32).prop_map(|((a, b), shift)| (a >> shift, b >> shift));
    prop::collection::vec(shifted, 0..most)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn resumes_to_the_bit_at_every_split(samples in samples(300)) {
        let whole = Estimators::of(&samples);
        for split in 0..=samples.len() {
            let mut resumed = Estimators::of(&samples[..split]).kept_and_resumed();
            resumed.extend(&samples[split..]);
            prop_assert!(resumed == whole, "split at {}", split);
        }
    }

    #[test]
    fn merges_at_every_split_as_if_nothing_were_missing_but_a_gap(samples in samples(300)) {
        for split in 0..=samples.len() {
            let mut gapped = Estimators::of(&samples[..split]);
            gapped.a.gap(1);
            gapped.b.gap(1);
            gapped.extend(&samples[split..]);
            let merged = Estimators::of(&samples[..split]).merged(&Estimators::of(&samples[split..]));
            for octave in 0..OCTAVES {
                prop_assert_eq!(merged.a.sum_of_squares(octave), gapped.a.sum_of_squares(octave));
            }
            prop_assert!(merged.a.curve(1.0) == gapped.a.curve(1.0), "kurtosis too");
            prop_assert_eq!(&merged.coupling, &gapped.coupling);
            prop_assert_eq!(&merged.hadamard, &gapped.hadamard);
            prop_assert_eq!(&merged.between, &gapped.between);
        }
    }

    #[test]
    fn merging_is_associative_and_goes_on_where_the_last_one_stands(
        first in samples(200), second in samples(200), third in samples(200), more in samples(100)
    ) {
        let [a, b, c] = [&first, &second, &third].map(|samples| Estimators::of(samples));
        let mut from_left = a.clone().merged(&b).merged(&c);
        let mut from_right = a.merged(&b.merged(&c));
        prop_assert!(from_left == from_right);
        from_left.extend(&more);
        from_right.extend(&more);
        prop_assert!(from_left == from_right);
    }

    #[test]
    fn any_changed_byte_is_noticed(samples in samples(100), at in any::<prop::sample::Index>(), flip in 1..=255_u8) {
        let mut bytes = postcard::to_stdvec(&Estimators::of(&samples).a).unwrap();
        let at = at.index(bytes.len());
        bytes[at] ^= flip;
        // A variable-length integer may be written in more bytes than it needs: then nothing has changed.
        if let Ok(found) = postcard::from_bytes::<Cascade<OCTAVES, 8>>(&bytes) {
            prop_assert!(found == Estimators::of(&samples).a);
        }
    }
}

fn refusal<T: DeserializeOwned>(state: &impl Serialize) -> String {
    let Err(error) = serde_json::from_str::<T>(&serde_json::to_string(state).unwrap()) else {
        panic!("taken for good");
    };
    error.to_string()
}

#[test]
fn another_type_or_size_is_named() {
    let cascade = Cascade::<7, 8>::new();
    let error = refusal::<Cascade<7, 4>>(&cascade);
    assert!(error.starts_with("version 1, type 65, 7 octaves, 8-fold overlap where there should be"), "{error}");
    assert!(error.contains("7 octaves, 4-fold overlap"), "{error}");
    assert!(refusal::<Hadamard<7, 8>>(&cascade).contains("type 65"));
}

/// The words of a state, one of them replaced, with a checksum that fits.
fn forged(words: &[u64], at: usize, word: u64) -> Vec<u64> {
    let mut words = words.to_vec();
    words[at] = word;
    let (header, body) = (words[0] as u32, &words[1..words.len() - 1]);
    let bytes = header.to_be_bytes().into_iter().chain(body.iter().flat_map(|word| word.to_le_bytes()));
    *words.last_mut().unwrap() =
        u64::from(crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&bytes.collect::<Vec<_>>()));
    words
}

#[test]
fn what_no_samples_lead_to_is_refused_by_name() {
    let cascade = Estimators::of(&[(5, 0), (-3, 0), (9, 0)]).a;
    let words: Vec<u64> = serde_json::from_str(&serde_json::to_string(&cascade).unwrap()).unwrap();
    assert!(serde_json::from_value::<Cascade<OCTAVES, 8>>(forged(&words, 2, 7).into()).is_ok(), "7 were missing");
    let flaw = |at: usize, word: u64| {
        let found = serde_json::from_value::<Cascade<OCTAVES, 8>>(forged(&words, at, word).into());
        found.expect_err("no samples lead to this").to_string()
    };
    // Header, samples before the last gap, missing, elapsed, sum, 8 recent sums, checksum, and for each octave 4 words
    // of moments, the oldest sum, 8 in the line and the count.
    assert_eq!(words.len(), 5 + 8 + OCTAVES * 14 + 1);
    let octave = |k: usize| 5 + 8 + 14 * k;
    assert!(flaw(1, u64::MAX).contains("more samples than can be counted"));
    assert!(flaw(4, 1).contains("the newest running sum is not the running sum"));
    assert!(flaw(octave(4) + 5 + 3, 1).contains("running sums from before the first sample"));
    assert!(flaw(octave(0) + 13, 4).contains("more differences than samples"));
    assert!(flaw(octave(5), 1).contains("a sum over no differences that is not 0"));
    let short = serde_json::from_value::<Cascade<OCTAVES, 8>>(words[..20].into()).unwrap_err().to_string();
    assert!(short.contains("invalid length"), "{short}");
}
