//! Serialisation of an estimator's whole state: a header (version, type, parameters), its 64-bit words in the order of
//! the fields, and a CRC-32.
//!
//! Deserialising refuses another version, type or size, a wrong checksum, and words that no samples lead to.

use crate::math::is_finite;
use core::convert::Infallible;
use core::fmt;
use core::marker::PhantomData;
use crc::{CRC_32_ISO_HDLC, Crc, Digest};
use serde::de::{self, SeqAccess, Visitor};
use serde::ser::SerializeTuple;
use serde::{Deserialize, Deserializer, Serializer};

const VERSION: u8 = 2;
static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// An estimator whose state is a fixed number of 64-bit words.
pub(crate) trait StateWords: Clone {
    const EMPTY: Self;
    /// Identifies the type in the header.
    const KIND: u8;
    const OCTAVES: usize;
    /// Const parameter `OVERLAP`; 0 if the type has none.
    const OVERLAP: usize;
    const WORDS: usize;

    /// Calls `visit` with every word in order, for reading or for writing.
    fn visit_words<E>(&mut self, visit: impl FnMut(&mut u64) -> Result<(), E>) -> Result<(), E>;

    /// A property of the state that no sequence of samples leads to, if there is one.
    fn inconsistency(&self) -> Option<&'static str>;
}

const fn header<S: StateWords>() -> [u8; 4] {
    [VERSION, S::KIND, S::OCTAVES as u8, S::OVERLAP as u8]
}

pub(crate) fn serialize<S: StateWords, Z: Serializer>(state: &S, serializer: Z) -> Result<Z::Ok, Z::Error> {
    let mut tuple = serializer.serialize_tuple(S::WORDS + 2)?;
    let mut digest = started_digest::<S>();
    tuple.serialize_element(&u32::from_be_bytes(header::<S>()))?;
    state.clone().visit_words(|word| {
        digest.update(&word.to_le_bytes());
        tuple.serialize_element(word)
    })?;
    tuple.serialize_element(&digest.finalize())?;
    tuple.end()
}

pub(crate) fn deserialize<'de, S: StateWords, D: Deserializer<'de>>(deserializer: D) -> Result<S, D::Error> {
    let mut state = S::EMPTY;
    deserialize_in_place(deserializer, &mut state)?;
    Ok(state)
}

/// Replaces `state` without a second one on the stack; after an error it is empty.
pub(crate) fn deserialize_in_place<'de, S: StateWords, D: Deserializer<'de>>(
    deserializer: D,
    state: &mut S,
) -> Result<(), D::Error> {
    deserializer.deserialize_tuple(S::WORDS + 2, StateVisitor(Some(&mut *state))).inspect_err(|_| {
        // All words are set to 0 in place: `EMPTY` would be built on the stack first.
        let Ok(()) = state.visit_words(|word| {
            *word = 0;
            Ok::<_, Infallible>(())
        });
    })
}

/// Checks everything except the meaning of the words, and keeps none of them.
pub(crate) fn check<'de, S: StateWords, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    deserializer.deserialize_tuple(S::WORDS + 2, StateVisitor::<S>(None))
}

fn started_digest<S: StateWords>() -> Digest<'static, u32> {
    let mut digest = CRC.digest();
    digest.update(&header::<S>());
    digest
}

/// Reads a state, and keeps it if there is a place for it.
struct StateVisitor<'a, S>(Option<&'a mut S>);

impl<'de, S: StateWords> Visitor<'de> for StateVisitor<'_, S> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        fmt::Display::fmt(&Expected::<S>(PhantomData), f)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut words: A) -> Result<(), A::Error> {
        let expected = Expected::<S>(PhantomData);
        let short = |at: usize| <A::Error as de::Error>::invalid_length(at, &expected);
        let found = words.next_element::<u32>()?.ok_or_else(|| short(0))?;
        if found != u32::from_be_bytes(header::<S>()) {
            let [version, kind, octaves, overlap] = found.to_be_bytes();
            return Err(de::Error::custom(format_args!(
                "version {version}, type {kind}, {octaves} octaves, {overlap}-fold overlap where there should be {expected}"
            )));
        }
        let Self(mut state) = self;
        let mut digest = started_digest::<S>();
        let mut at = 1;
        let mut next = || -> Result<u64, A::Error> {
            let word: u64 = words.next_element()?.ok_or_else(|| short(at))?;
            digest.update(&word.to_le_bytes());
            at += 1;
            Ok(word)
        };
        match &mut state {
            Some(state) => state.visit_words(|word| next().map(|next| *word = next))?,
            None => (0..S::WORDS).try_for_each(|_| next().map(drop))?,
        }
        let checksum: u32 = words.next_element()?.ok_or_else(|| short(at))?;
        if checksum != digest.finalize() {
            return Err(de::Error::custom("an estimator's state with a wrong checksum"));
        }
        match state.and_then(|state| state.inconsistency()) {
            Some(reason) => {
                Err(de::Error::custom(format_args!("an estimator's state that no samples lead to: {reason}")))
            }
            None => Ok(()),
        }
    }
}

struct Expected<S>(PhantomData<S>);

impl<S: StateWords> fmt::Display for Expected<S> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let [version, kind, octaves, overlap] = header::<S>();
        write!(f, "an estimator's state: version {version}, type {kind}, {octaves} octaves, {overlap}-fold overlap")
    }
}

impl<S: StateWords> de::Expected for Expected<S> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Visits a signed word as the same bits.
pub(crate) fn visit_signed<E>(word: &mut i64, mut visit: impl FnMut(&mut u64) -> Result<(), E>) -> Result<(), E> {
    let mut bits = *word as u64;
    visit(&mut bits)?;
    *word = bits as i64;
    Ok(())
}

/// Visits the two halves of a wide sum, the lower one first.
pub(crate) fn visit_wide<E>(sum: &mut u128, mut visit: impl FnMut(&mut u64) -> Result<(), E>) -> Result<(), E> {
    let (mut low, mut high) = (*sum as u64, (*sum >> 64) as u64);
    visit(&mut low)?;
    visit(&mut high)?;
    *sum = u128::from(high) << 64 | u128::from(low);
    Ok(())
}

/// Implements serde's traits for a type with these const parameters through its [`StateWords`].
macro_rules! serde_by_words {
    ($($parameter:ident),+ for $type:ty) => {
        impl<$(const $parameter: usize),+> serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                crate::serialized::serialize(self, serializer)
            }
        }

        impl<'de, $(const $parameter: usize),+> serde::Deserialize<'de> for $type {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                crate::serialized::deserialize(deserializer)
            }
        }
    };
}
pub(crate) use serde_by_words;

/// Deserialises a number and checks it.
fn checked<'de, T: Deserialize<'de> + Copy, D: Deserializer<'de>>(
    deserializer: D,
    is_valid: impl Fn(T) -> bool,
    expected: &'static str,
) -> Result<T, D::Error> {
    let value = T::deserialize(deserializer)?;
    if is_valid(value) { Ok(value) } else { Err(de::Error::custom(expected)) }
}

pub(crate) fn positive<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, |x: f64| x > 0.0 && is_finite(x), "a shape parameter that is not positive and finite")
}

pub(crate) fn damping<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, |x: f64| x > 0.0 && x < 1.0, "a damping that is not between 0 and 1")
}

pub(crate) fn not_negative<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, |x: f64| x >= 0.0 && is_finite(x), "a sample period that is negative or not finite")
}

pub(crate) fn at_least_one<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, |x: f64| x >= 1.0 && is_finite(x), "a decimation below 1 or not finite")
}

pub(crate) fn stages<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u8, D::Error> {
    checked(deserializer, |stages| matches!(stages, 1 | 2), "a filter that has neither 1 nor 2 stages")
}

pub(crate) fn taps<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u16, D::Error> {
    checked(deserializer, |taps| (1..=128).contains(&taps), "a filter that has not 1 to 128 taps")
}
