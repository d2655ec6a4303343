//! Limits on the reading of a file, which grow with its size: bytes, numbers, nesting, time.

use crate::input::{FileBytes, Reason};
use std::borrow::BorrowMut;
use std::io::{self, Read};
use std::time::{Duration, Instant};

const BYTES_PER_BYTE: u64 = 50;
const BYTES_OF_ANY: u64 = 1 << 24;
const VALUES_PER_BYTE: u64 = 8;
const VALUES_OF_ANY: u64 = 1 << 20;
const NANOSECONDS_PER_BYTE: u64 = 1_000;
const TIME_OF_ANY: Duration = Duration::from_secs(10);
const MOST_LEVELS: usize = 32;

/// `None` in a browser, which has no clock.
fn deadline(time: Duration) -> Option<Instant> {
    if cfg!(target_family = "wasm") { None } else { Instant::now().checked_add(time) }
}

/// For one file; a [`Meter`] per pass.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Budget {
    bytes: u64,
    values: u64,
    time: Duration,
    /// `None` is no limit.
    #[cfg_attr(not(feature = "sqlite"), expect(dead_code, reason = "a query alone may never end"))]
    end: Option<Instant>,
}

impl Budget {
    pub(crate) fn new(bytes: u64) -> Self {
        let time = TIME_OF_ANY + Duration::from_nanos(bytes.saturating_mul(NANOSECONDS_PER_BYTE));
        Self {
            bytes: BYTES_OF_ANY.saturating_add(bytes.saturating_mul(BYTES_PER_BYTE)),
            values: VALUES_OF_ANY.saturating_add(bytes.saturating_mul(VALUES_PER_BYTE)),
            time,
            end: deadline(time),
        }
    }

    pub(crate) fn of_file(file: &FileBytes) -> io::Result<Self> {
        Ok(Self::new(file.length()?.unwrap_or(u64::MAX)))
    }

    pub(crate) fn joined(budgets: impl IntoIterator<Item = Self>) -> Self {
        budgets.into_iter().fold(Self::new(0), |all, of| Self {
            bytes: all.bytes.saturating_add(of.bytes),
            values: all.values.saturating_add(of.values),
            time: all.time.saturating_add(of.time),
            ..all
        })
    }

    #[cfg(test)]
    pub(crate) fn spent() -> Self {
        let budget = Self::new(0);
        Self { end: budget.end.and_then(|end| end.checked_sub(budget.time)), ..budget }
    }

    pub(crate) fn again(self) -> Self {
        Self { end: deadline(self.time), ..self }
    }

    pub(crate) fn meter(self) -> Meter {
        Meter { budget: self, bytes: 0, values: 0 }
    }

    pub(crate) fn check_depth(levels: usize) -> Result<(), Reason> {
        if levels > MOST_LEVELS { Err(too_deep(MOST_LEVELS)) } else { Ok(()) }
    }

    #[cfg(any(feature = "sqlite", test))]
    pub(crate) fn check_time(self) -> Result<(), Reason> {
        let seconds = self.time.as_secs();
        let told = || format!("not read within {seconds} s, far longer than a recording of this size takes");
        let is_late = self.end.is_some_and(|end| Instant::now() > end);
        if is_late { Err(Reason::Limit(told())) } else { Ok(()) }
    }
}

pub(crate) fn too_deep(most: usize) -> Reason {
    Reason::Limit(format!("nested more than {most} levels deep"))
}

#[derive(Debug)]
pub(crate) struct Meter {
    budget: Budget,
    bytes: u64,
    values: u64,
}

impl Meter {
    pub(crate) fn budget(&self) -> Budget {
        self.budget
    }

    pub(crate) fn add_bytes(&mut self, bytes: u64) -> Result<(), Reason> {
        self.bytes = self.bytes.saturating_add(bytes);
        let most = self.budget.bytes;
        if self.bytes > most {
            return Err(Reason::Limit(format!(
                "its data are more than {most} bytes, far more than a recording of this size has; decompress it or save it uncompressed"
            )));
        }
        Ok(())
    }

    pub(crate) fn add_values(&mut self, values: u64) -> Result<(), Reason> {
        self.values = self.values.saturating_add(values);
        let most = self.budget.values;
        if self.values > most {
            return Err(Reason::Limit(format!(
                "more than {most} numbers, far more than a recording of this size has; save it uncompressed"
            )));
        }
        Ok(())
    }
}

/// Counts decompressed bytes; refusals come back by [`Reason::from_io`].
pub(crate) struct Metered<R, M = Meter> {
    input: R,
    meter: M,
}

impl<R, M> Metered<R, M> {
    pub(crate) fn new(input: R, meter: M) -> Self {
        Self { input, meter }
    }

    pub(crate) fn into_meter(self) -> M {
        self.meter
    }
}

impl<R: Read, M: BorrowMut<Meter>> Read for Metered<R, M> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.input.read(buffer)?;
        self.meter.borrow_mut().add_bytes(count as u64).map_err(io::Error::other)?;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::{BYTES_OF_ANY, BYTES_PER_BYTE, Budget, MOST_LEVELS, Metered, VALUES_OF_ANY, VALUES_PER_BYTE};
    use crate::input::Reason;
    use std::io::Read;

    #[test]
    fn every_amount_ends_where_it_says_and_a_second_reading_begins_anew() {
        let budget = Budget::new(1_000);
        let (bytes, values) = (BYTES_OF_ANY + 1_000 * BYTES_PER_BYTE, VALUES_OF_ANY + 1_000 * VALUES_PER_BYTE);
        let mut meter = budget.meter();
        meter.add_bytes(bytes).expect("within the budget");
        assert!(matches!(meter.add_bytes(1), Err(Reason::Limit(told)) if told.contains(&bytes.to_string())));
        meter.add_values(values).expect("within the budget");
        assert!(matches!(meter.add_values(1), Err(Reason::Limit(told)) if told.contains(&values.to_string())));
        budget.meter().add_bytes(bytes).expect("a second reading");
        Budget::check_depth(MOST_LEVELS).expect("within the budget");
        assert!(matches!(Budget::check_depth(MOST_LEVELS + 1), Err(Reason::Limit(_))));
    }

    #[test]
    fn what_a_decompressor_gives_is_counted_and_the_reason_comes_back() {
        let mut endless = Metered::new(std::io::repeat(0), Budget::new(0).meter());
        let error = std::io::copy(&mut endless.by_ref().take(u64::MAX), &mut std::io::sink()).unwrap_err();
        assert!(matches!(Reason::from_io(error), Reason::Limit(told) if told.contains(&BYTES_OF_ANY.to_string())));
    }
}
