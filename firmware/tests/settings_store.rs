//! Settings in flash memory, with the power cut at every word of every write: what is read afterwards is the record of before or
//! the new one, never neither.

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use firmware::settings_store::{MAX_RECORD, SettingsStore};

const PAGE: usize = 4096;
const PAGES: usize = 4;
const WORD: usize = 4;
const RANGE: std::ops::Range<u32> = 0..(PAGES * PAGE) as u32;

/// A NOR flash: programming clears bits, erasing sets all of a page. It loses power after a number of words.
#[derive(Clone)]
struct MockFlash {
    bytes: Vec<u8>,
    /// Words left until power is lost; an erased page counts as one.
    words_left: usize,
    erased: [u32; PAGES],
}

#[derive(Debug)]
struct PowerLost;

impl NorFlashError for PowerLost {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl ErrorType for MockFlash {
    type Error = PowerLost;
}

impl MockFlash {
    fn new() -> Self {
        Self { bytes: vec![0xFF; PAGES * PAGE], words_left: usize::MAX, erased: [0; PAGES] }
    }

    fn cut_after(&self, words_left: usize) -> Self {
        Self { words_left, ..self.clone() }
    }

    fn consume(&mut self) -> Result<(), PowerLost> {
        self.words_left = self.words_left.checked_sub(1).ok_or(PowerLost)?;
        Ok(())
    }

    fn store(self) -> SettingsStore<Self> {
        SettingsStore::new(self, RANGE).expect("whole pages")
    }

    fn read_record(&self) -> Option<Vec<u8>> {
        let mut record = vec![0; MAX_RECORD];
        let length = self.cut_after(usize::MAX).store().read(&mut record)?;
        record.truncate(length);
        Some(record)
    }

    /// Writes a record and returns the flash afterwards, and whether the store says that it is written.
    fn write_record(&self, record: &[u8]) -> (Self, bool) {
        let mut store = self.clone().store();
        let done = store.write(record).is_ok();
        (store.into_flash(), done)
    }
}

impl ReadNorFlash for MockFlash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), PowerLost> {
        bytes.copy_from_slice(&self.bytes[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl NorFlash for MockFlash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), PowerLost> {
        for page in from as usize / PAGE..to as usize / PAGE {
            let bytes = &mut self.bytes[page * PAGE..(page + 1) * PAGE];
            if self.words_left == 0 {
                // An erase that was cut short leaves some bits set that were clear.
                bytes.iter_mut().enumerate().for_each(|(index, byte)| *byte |= (index * 151 % 256) as u8);
                return Err(PowerLost);
            }
            bytes.fill(0xFF);
            self.erased[page] += 1;
            self.consume()?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), PowerLost> {
        for (index, word) in bytes.chunks(WORD).enumerate() {
            let at = offset as usize + index * WORD;
            if self.words_left == 0 {
                // A word that was cut short has some of its bits.
                self.bytes[at] &= word[0];
                return Err(PowerLost);
            }
            self.bytes[at..at + WORD].iter_mut().zip(word).for_each(|(old, new)| *old &= new);
            self.consume()?;
        }
        Ok(())
    }
}

/// A record as long as settings with learned models; no two are alike.
fn record(number: usize) -> Vec<u8> {
    let length = [40, 900, 1500, 2600][number % 4];
    (0..length).map(|index| (number * 31 + index * 7 % 251) as u8).collect()
}

#[test]
fn power_cut_at_every_word_leaves_the_old_or_the_new_record() {
    let mut flash = MockFlash::new();
    assert_eq!(flash.read_record(), None);
    println!("write  bytes  words  cuts   old   new  pages erased");
    let (mut cuts, mut migrations) = (0, 0);
    for number in 0..40 {
        let (before, new) = (flash.read_record(), record(number));
        let (whole, done) = flash.write_record(&new);
        assert!(done);
        let words = usize::MAX - whole.words_left;
        let [mut old_found, mut new_found] = [0; 2];
        for words_left in 0..words {
            let (cut, done) = flash.cut_after(words_left).write_record(&new);
            assert!(!done, "write {number} was cut after {words_left} of {words} words");
            let cut = cut.cut_after(usize::MAX);
            match cut.read_record() {
                found if found.as_ref() == Some(&new) => new_found += 1,
                found if found == before => old_found += 1,
                found => panic!("write {number} cut after {words_left} words left {:?} bytes", found.map(|r| r.len())),
            }
            // The next write, after power has come back, finds its place.
            let (again, done) = cut.write_record(&new);
            assert!(
                done && again.read_record().as_ref() == Some(&new),
                "after a cut at {words_left} of write {number}"
            );
        }
        let erased: u32 = whole.erased.iter().sum::<u32>() - flash.erased.iter().sum::<u32>();
        println!("{number:5}  {:5}  {words:5}  {words:4}  {old_found:4}  {new_found:4}  {erased}", new.len());
        cuts += words;
        migrations += erased;
        flash = whole.cut_after(usize::MAX);
        assert_eq!(flash.read_record(), Some(new));
    }
    println!("{cuts} cuts, {migrations} pages erased");
    assert!(migrations >= 2 * PAGES as u32, "the ring has come round twice");
}

/// Memory that holds something else, as that of another program, is no record, and takes one.
#[test]
fn foreign_contents_are_no_record() {
    let mut flash = MockFlash::new();
    flash.bytes.iter_mut().enumerate().for_each(|(index, byte)| *byte = (index * index % 253) as u8);
    assert_eq!(flash.read_record(), None);
    let (flash, done) = flash.write_record(&record(1));
    assert!(done);
    assert_eq!(flash.read_record(), Some(record(1)));
    let mut store = flash.store();
    store.erase().expect("erased");
    assert_eq!(store.into_flash().read_record(), None);
}

/// Wear, by the number of erasures that writes cost: the figures that the documentation gives.
#[test]
fn pages_are_erased_evenly_and_rarely() {
    let mut flash = MockFlash::new();
    const WRITES: usize = 2000;
    for number in 0..WRITES {
        flash = flash.write_record(&record(4 * number + 1)).0;
    }
    println!("{WRITES} records of 900 bytes: pages erased {:?} times", flash.erased);
    let [least, most] = [flash.erased.iter().min(), flash.erased.iter().max()].map(|count| *count.expect("pages"));
    assert!(most - least <= 1);
    // Four records fill a page.
    assert!(most as usize <= WRITES / 4 / PAGES + 2, "{most}");
}
