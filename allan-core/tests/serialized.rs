//! Serialised state: continued to the bit, refused when damaged; merging in any grouping.

use allan_core::{Cascade, Coupling, FractionalOctaves, Hadamard};
use proptest::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

const OCTAVES: usize = 7;

/// All estimators, for two channels.
#[derive(Debug, Clone, PartialEq)]
struct Estimators {
    a: Cascade<OCTAVES, 8>,
    b: Cascade<OCTAVES, 8>,
    coupling: Coupling<OCTAVES>,
    hadamard: Hadamard<OCTAVES, 8>,
    fractional: FractionalOctaves<OCTAVES, 8>,
}

impl Estimators {
    fn new() -> Self {
        Self {
            a: Cascade::new(),
            b: Cascade::new(),
            coupling: Coupling::new(),
            hadamard: Hadamard::new(),
            fractional: FractionalOctaves::new(),
        }
    }

    fn from_samples(samples: &[(i32, i32)]) -> Self {
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
            self.fractional.observe(&self.a);
        }
    }

    fn merge(&mut self, later: &Self) {
        self.a.merge(&later.a);
        self.b.merge(&later.b);
        self.coupling.merge(&later.coupling);
        self.hadamard.merge(&later.hadamard);
        self.fractional.merge(&later.fractional);
    }

    fn merged(mut self, later: &Self) -> Self {
        self.merge(later);
        self
    }

    fn serialised_and_restored(&self) -> Self {
        Self {
            a: through_postcard(&self.a),
            b: through_postcard(&self.b),
            coupling: through_postcard(&self.coupling),
            hadamard: through_postcard(&self.hadamard),
            fractional: through_postcard(&self.fractional),
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
    fn a_deserialised_estimator_continues_to_the_bit(samples in samples(300)) {
        let whole = Estimators::from_samples(&samples);
        for split in 0..=samples.len() {
            let mut resumed = Estimators::from_samples(&samples[..split]).serialised_and_restored();
            resumed.extend(&samples[split..]);
            prop_assert!(resumed == whole, "split at {}", split);
        }
    }

    #[test]
    fn merging_two_stretches_equals_a_gap_between_them(samples in samples(300)) {
        for split in 0..=samples.len() {
            let mut gapped = Estimators::from_samples(&samples[..split]);
            // Too long for every octave to bridge, and up to a multiple of all strides.
            let missing = split.next_multiple_of(1 << OCTAVES) - split + (1 << OCTAVES);
            gapped.a.gap(missing as u32);
            gapped.b.gap(missing as u32);
            gapped.extend(&samples[split..]);
            let merged = Estimators::from_samples(&samples[..split]).merged(&Estimators::from_samples(&samples[split..]));
            for octave in 0..OCTAVES {
                prop_assert_eq!(merged.a.sum_of_squares(octave), gapped.a.sum_of_squares(octave));
            }
            prop_assert!(merged.a.curve(1.0) == gapped.a.curve(1.0), "kurtosis too");
            prop_assert_eq!(&merged.coupling, &gapped.coupling);
            prop_assert_eq!(&merged.hadamard, &gapped.hadamard);
            prop_assert_eq!(&merged.fractional, &gapped.fractional);
        }
    }

    #[test]
    fn merging_is_associative_and_continues_the_last_stretch(
        first in samples(200), second in samples(200), third in samples(200), more in samples(100)
    ) {
        let [a, b, c] = [&first, &second, &third].map(|samples| Estimators::from_samples(samples));
        let mut from_left = a.clone().merged(&b).merged(&c);
        let mut from_right = a.merged(&b.merged(&c));
        prop_assert!(from_left == from_right);
        from_left.extend(&more);
        from_right.extend(&more);
        prop_assert!(from_left == from_right);
    }

    #[test]
    fn a_changed_byte_is_refused(samples in samples(100), at in any::<prop::sample::Index>(), flip in 1..=255_u8) {
        let mut bytes = postcard::to_stdvec(&Estimators::from_samples(&samples).a).unwrap();
        let at = at.index(bytes.len());
        bytes[at] ^= flip;
        // A variable-length integer may be encoded in more bytes than necessary: then the value is unchanged.
        if let Ok(found) = postcard::from_bytes::<Cascade<OCTAVES, 8>>(&bytes) {
            prop_assert!(found == Estimators::from_samples(&samples).a);
        }
    }
}

fn refusal<T: DeserializeOwned>(state: &impl Serialize) -> String {
    let Err(error) = serde_json::from_str::<T>(&serde_json::to_string(state).unwrap()) else {
        panic!("accepted");
    };
    error.to_string()
}

#[test]
fn the_error_states_the_type_and_size_of_another_state() {
    let cascade = Cascade::<7, 8>::new();
    let error = refusal::<Cascade<7, 4>>(&cascade);
    assert!(error.starts_with("version 2, type 65, 7 octaves, 8-fold overlap where there should be"), "{error}");
    assert!(error.contains("7 octaves, 4-fold overlap"), "{error}");
    assert!(refusal::<Hadamard<7, 8>>(&cascade).contains("type 65"));
}

#[test]
fn an_estimator_without_samples_is_all_zeros() {
    fn words(state: impl Serialize) -> Vec<u64> {
        let words: Vec<u64> = serde_json::from_str(&serde_json::to_string(&state).unwrap()).unwrap();
        words[1..words.len() - 1].to_vec()
    }
    // A firmware's statics then lie in memory that is cleared at the start, and take no flash.
    for words in [
        words(Cascade::<24, 8>::new()),
        words(Coupling::<OCTAVES>::new()),
        words(Hadamard::<OCTAVES, 8>::new()),
        words(FractionalOctaves::<OCTAVES, 8>::new()),
    ] {
        assert!(!words.is_empty() && words.iter().all(|&word| word == 0), "{words:?}");
    }
}

#[test]
fn a_state_that_is_deserialised_in_place_replaces_the_one_before_or_leaves_an_empty_one() {
    let read = |bytes: &[u8], place: &mut Cascade<OCTAVES, 8>| {
        place.read_serialized(&mut postcard::Deserializer::from_bytes(bytes))
    };
    let check = |bytes: &[u8]| Cascade::<OCTAVES, 8>::check_serialized(&mut postcard::Deserializer::from_bytes(bytes));
    let saved = Estimators::from_samples(&[(5, 0), (-3, 0), (9, 0)]).a;
    let mut place = Estimators::from_samples(&[(1, 0); 200]).a;
    let bytes = postcard::to_stdvec(&saved).unwrap();
    assert_eq!((check(&bytes), read(&bytes, &mut place)), (Ok(()), Ok(())));
    assert_eq!(place, saved);
    let last = bytes.len() - 1;
    let changed = [&bytes[..last], &[bytes[last] ^ 1]].concat();
    for wrong in [&bytes[..last], &changed[..], &[], &bytes[1..]] {
        let mut place = saved.clone();
        assert!(check(wrong).is_err() && read(wrong, &mut place).is_err());
        assert_eq!(place, Cascade::new());
    }
}

/// The words of a state with one of them replaced and a correct checksum.
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
fn a_state_that_no_samples_lead_to_is_refused_with_the_reason() {
    let cascade = Estimators::from_samples(&[(5, 0), (-3, 0), (9, 0)]).a;
    let words: Vec<u64> = serde_json::from_str(&serde_json::to_string(&cascade).unwrap()).unwrap();
    assert!(serde_json::from_value::<Cascade<OCTAVES, 8>>(forged(&words, 5, 7).into()).is_ok(), "7 were missing");
    let reason = |at: usize, word: u64| {
        let found = serde_json::from_value::<Cascade<OCTAVES, 8>>(forged(&words, at, word).into());
        found.expect_err("no samples lead to this").to_string()
    };
    // Header, three times (now, settling, end of the last gap), four numbers of samples (before the start, missing, absent,
    // pending), sum, 8 recent sums, checksum, and for each octave 4 words of moments, the oldest sum, 8 in the line, the end
    // of the last gap, the count before it and 3 words on bridged gaps.
    assert_eq!(words.len(), 9 + 8 + OCTAVES * 18 + 1);
    let octave = |k: usize| 9 + 8 + 18 * k;
    assert!(reason(4, u64::MAX).contains("more samples than can be counted"));
    assert!(reason(3, 4).contains("a gap after the newest sample"));
    assert!(reason(6, 1).contains("a gap after the newest sample"));
    assert!(reason(2, 5).contains("octaves that leave out other differences than the gaps say"));
    assert!(reason(7, 1).contains("octaves that leave out other differences than the gaps say"));
    assert!(reason(8, 1).contains("the newest running sum is not the running sum"));
    assert!(reason(octave(4) + 5 + 3, 1).contains("running sums from before the first sample"));
    assert!(reason(octave(0) + 13, 2).contains("a gap after the newest sample"));
    assert!(reason(octave(0) + 14, 4).contains("more differences than samples"));
    assert!(reason(octave(5), 1).contains("a sum over no differences that is not 0"));
    let short = serde_json::from_value::<Cascade<OCTAVES, 8>>(words[..20].into()).unwrap_err().to_string();
    assert!(short.contains("invalid length"), "{short}");
}

/// Samples of both channels, the same in every version: a linear congruential generator (Knuth's MMIX constants).
fn kept_samples() -> Vec<(i32, i32)> {
    let mut state = 1_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 48) as i32 - 32_768
    };
    (0..1000).map(|_| (next(), next() / 64)).collect()
}

/// A state that was written with version 2 of the format, in postcard, is read as ever and written as ever: a change of the layout needs
/// another version.
#[test]
fn a_kept_state_is_read_and_written_as_ever() {
    const KEPT: &[u8] = include_bytes!("serialized/version-2.bin");
    let Estimators { a, coupling, hadamard, fractional, .. } = Estimators::from_samples(&kept_samples());
    let state = (a, coupling, hadamard, fractional);
    let written = postcard::to_stdvec(&state).expect("bytes");
    let read: (Cascade<OCTAVES, 8>, Coupling<OCTAVES>, Hadamard<OCTAVES, 8>, FractionalOctaves<OCTAVES, 8>) =
        postcard::from_bytes(KEPT).expect("a state of this version");
    assert_eq!(read, state);
    assert!(written == KEPT, "the layout has changed");
}
