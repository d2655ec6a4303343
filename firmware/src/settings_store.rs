//! A record in flash that survives a loss of power at any time: it is appended with a checksum before the old one is
//! erased.

use core::future::Future;
use core::ops::Range;
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage, SerializationError, Value};

const KEY: u8 = 1;
/// Most bytes of a record.
pub const MAX_RECORD: usize = 3072;
#[repr(align(8))]
struct RecordBuffer([u8; MAX_RECORD + 8]);

/// The bytes of an item after a byte of the key: `sequential-storage` panics on an item of no bytes.
struct Item<'a>(&'a [u8]);

impl<'a> Value<'a> for Item<'a> {
    fn serialize_into(&self, buffer: &mut [u8]) -> Result<usize, SerializationError> {
        let (key, record) = buffer.split_first_mut().ok_or(SerializationError::BufferTooSmall)?;
        *key = KEY;
        Ok(1 + self.0.serialize_into(record)?)
    }

    fn deserialize_from(buffer: &'a [u8]) -> Result<(Self, usize), SerializationError> {
        let record = buffer.strip_prefix(&[KEY]).ok_or(SerializationError::InvalidFormat)?;
        Ok((Self(record), buffer.len()))
    }
}

/// Failure of a write; the previous record is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoreError {
    /// The board has no memory for settings.
    NoMemory,
    /// The record is longer than [`MAX_RECORD`].
    TooLong,
    /// The flash was not written, or is damaged.
    Flash,
}

impl core::fmt::Display for StoreError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::NoMemory => "this board keeps no settings without power",
            Self::TooLong => "they take too many bytes",
            Self::Flash => "the flash memory does not take them",
        })
    }
}

/// A record in a range of flash memory.
pub struct SettingsStore<F: NorFlash> {
    map: MapStorage<(), F, Cache<Uncached, Uncached, Uncached, ()>>,
}

impl<F: NorFlash> SettingsStore<F> {
    /// A store in `range`; `None` unless it has two or more whole pages.
    pub fn new(flash: F, range: Range<u32>) -> Option<Self> {
        let config = MapConfig::try_new(range).ok()?;
        Some(Self { map: MapStorage::new(flash, config, Cache::new_uncached()) })
    }

    /// Copies the record to `record` and returns its length; `None` if there is none.
    pub fn read(&mut self, record: &mut [u8]) -> Option<usize> {
        let mut buffer = RecordBuffer([0; _]);
        let found = self.find(&mut buffer)?;
        record.get_mut(..found.len())?.copy_from_slice(found);
        Some(found.len())
    }

    /// Replaces the record, or erases it if `record` is empty, and reads it back. Pages with other content are erased
    /// first.
    ///
    /// # Errors
    /// [`StoreError`]: the record is too long, or the flash does not take it.
    pub fn replace(&mut self, record: &[u8]) -> Result<(), StoreError> {
        if record.len() > MAX_RECORD {
            return Err(StoreError::TooLong);
        }
        if record.is_empty() {
            return self.erase();
        }
        let mut buffer = RecordBuffer([0; _]);
        for was_erased in [false, true] {
            let written = complete(self.map.store_item(&mut buffer.0, &(), &Item(record)));
            let found = self.find(&mut buffer);
            // Erasing does not help if the flash refuses the write: it keeps the old record, or stays blank.
            let erasing_helps = match written {
                Some(Ok(())) if found == Some(record) => return Ok(()),
                Some(Ok(())) => found.is_none() && !self.is_blank(&mut buffer),
                Some(Err(sequential_storage::Error::Storage { .. })) | None => false,
                Some(Err(_)) => !self.is_blank(&mut buffer),
            };
            if !erasing_helps || was_erased {
                break;
            }
            self.erase()?;
        }
        Err(StoreError::Flash)
    }

    fn find<'b>(&mut self, buffer: &'b mut RecordBuffer) -> Option<&'b [u8]> {
        complete(self.map.fetch_item::<Item<'b>>(&mut buffer.0, &()))?.ok()?.map(|item| item.0)
    }

    /// True if the memory is blank: erasing it would take seconds without samples.
    fn is_blank(&mut self, buffer: &mut RecordBuffer) -> bool {
        const CHUNK: usize = 256;
        let (range, chunk) = (self.map.flash_range(), &mut buffer.0[..CHUNK]);
        range.step_by(CHUNK).all(|at| {
            complete(self.map.flash().read(at, chunk)).is_some_and(|read| read.is_ok())
                && chunk.iter().all(|byte| *byte == 0xFF)
        })
    }

    fn erase(&mut self) -> Result<(), StoreError> {
        complete(self.map.erase_all()).and_then(Result::ok).ok_or(StoreError::Flash)
    }
}

/// The result of a future; `None` if it waits.
fn complete<T>(future: impl Future<Output = T>) -> Option<T> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(result) => Some(result),
        Poll::Pending => None,
    }
}
