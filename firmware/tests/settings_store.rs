//! Settings in flash memory, with the power cut at every word of every write. Afterwards either the old record or the new one is read.

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use firmware::settings_store::{MAX_RECORD, SettingsStore};

const WORD: usize = 4;

/// A NOR flash of some pages: programming clears bits, erasing sets all of a page. It loses power after a number of words.
#[derive(Clone)]
struct MockFlash<const PAGE: usize, const PAGES: usize> {
    bytes: Vec<u8>,
    /// Words left until power is lost; an erased page counts as one.
    words_left: usize,
    erased: [u32; PAGES],
    ignores_writes: bool,
}

/// Four sectors of the size of the Pico's flash.
type SmallFlash = MockFlash<4096, 4>;
/// The memories that the memory maps leave for the settings on a Pico and on an STM32F405.
type PicoFlash = MockFlash<4096, 16>;
type Stm32Flash = MockFlash<{ 128 << 10 }, 2>;

#[derive(Debug)]
struct PowerLost;

impl NorFlashError for PowerLost {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl<const PAGE: usize, const PAGES: usize> ErrorType for MockFlash<PAGE, PAGES> {
    type Error = PowerLost;
}

impl<const PAGE: usize, const PAGES: usize> MockFlash<PAGE, PAGES> {
    fn new() -> Self {
        Self { bytes: vec![0xFF; PAGES * PAGE], words_left: usize::MAX, erased: [0; PAGES], ignores_writes: false }
    }

    fn cut_after(&self, words_left: usize) -> Self {
        Self { words_left, ..self.clone() }
    }

    fn consume(&mut self) -> Result<(), PowerLost> {
        self.words_left = self.words_left.checked_sub(1).ok_or(PowerLost)?;
        Ok(())
    }

    fn store(&mut self) -> SettingsStore<&mut Self> {
        SettingsStore::new(self, 0..(PAGES * PAGE) as u32).expect("whole pages")
    }

    fn read_record(&self) -> Option<Vec<u8>> {
        let mut record = vec![0; MAX_RECORD];
        let length = self.cut_after(usize::MAX).store().read(&mut record)?;
        record.truncate(length);
        Some(record)
    }

    /// Writes a record and returns the flash afterwards, and whether the store says that it is written.
    fn write_record(&self, record: &[u8]) -> (Self, bool) {
        let mut flash = self.clone();
        let done = flash.store().replace(record).is_ok();
        (flash, done)
    }
}

impl<const PAGE: usize, const PAGES: usize> ReadNorFlash for MockFlash<PAGE, PAGES> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), PowerLost> {
        bytes.copy_from_slice(&self.bytes[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const PAGE: usize, const PAGES: usize> NorFlash for MockFlash<PAGE, PAGES> {
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
        if self.ignores_writes {
            return Ok(());
        }
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
    let mut flash = SmallFlash::new();
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
            // The next write, after power has come back, finds a place.
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
    assert!(migrations >= 2 * flash.erased.len() as u32, "the ring has come round twice");
}

/// Memory with other content, as of another program, has no record, and a record can be written to it.
#[test]
fn foreign_contents_are_no_record() {
    let mut flash = SmallFlash::new();
    flash.bytes.iter_mut().enumerate().for_each(|(index, byte)| *byte = (index * index % 253) as u8);
    assert_eq!(flash.read_record(), None);
    let (mut flash, done) = flash.write_record(&record(1));
    assert!(done);
    assert_eq!(flash.read_record(), Some(record(1)));
    flash.store().replace(&[]).expect("erased");
    assert_eq!(flash.read_record(), None);
}

/// Some pages look like a full ring, in which a written record is not found again.
#[test]
fn contents_that_hide_what_is_written_are_erased() {
    let contents = include_bytes!("../../tests/fuzz/corpus/settings/item-that-hides-others");
    let mut flash = MockFlash::<4096, 2>::new();
    let (first, second) = contents.split_at(contents.len() / 2);
    for (page, bytes) in flash.bytes.chunks_mut(4096).zip([first, second]) {
        page.iter_mut().zip(bytes).for_each(|(old, new)| *old = *new);
    }
    let (flash, done) = flash.write_record(&record(1));
    assert!(done);
    assert_eq!(flash.read_record(), Some(record(1)));
}

/// The damage has valid checksums: an item of no bytes follows the record (crate `sequential-storage`: checksum of the data, their length,
/// checksum of the length).
#[test]
fn an_item_of_no_bytes_is_no_record() {
    let (mut flash, _) = SmallFlash::new().write_record(&record(1));
    let used = flash.bytes[..4096 - WORD].iter().rposition(|byte| *byte != 0xFF).expect("a record") + 1;
    let behind = used.next_multiple_of(WORD);
    flash.bytes[behind..behind + 8].copy_from_slice(&[0x11, 0x11, 0x11, 0x11, 0, 0, 0x03, 0xE2]);
    assert_eq!(flash.read_record(), None);
    let (flash, done) = flash.write_record(&record(2));
    assert!(done);
    assert_eq!(flash.read_record(), Some(record(2)));
}

/// The flash does not take what is written, as when a debugger has locked it, or in an emulator.
#[test]
fn a_record_that_is_not_read_back_is_not_called_written() {
    let mut flash = SmallFlash::new();
    flash.ignores_writes = true;
    let (flash, done) = flash.write_record(&record(1));
    assert!(!done);
    assert_eq!(flash.read_record(), None);
    // An erasure would take seconds, in which samples are lost.
    assert_eq!(flash.erased, [0; 4]);
}

/// Erasures that a sector survives: 100,000 (Winbond, W25Q16JV), and 10,000 (STM32F405 data sheet, endurance of the flash memory).
const PICO_ENDURANCE: f64 = 100_000.0;
const STM32_ENDURANCE: f64 = 10_000.0;

/// Wear as the number of erasures by writes of the longest record; the documentation gives these figures.
#[test]
fn sectors_are_erased_evenly_and_rarely() {
    println!(
        "memory         records  erasures of a sector  records until one is worn  years, one a minute  one an hour"
    );
    let pico = records_until_worn(PicoFlash::new(), "Pico", PICO_ENDURANCE, 2000);
    let stm32 = records_until_worn(Stm32Flash::new(), "STM32F405", STM32_ENDURANCE, 2000);
    assert!((1.5e6..1.7e6).contains(&pico), "{pico}");
    assert!((0.9e6..1.1e6).contains(&stm32), "{stm32}");
}

fn records_until_worn<const PAGE: usize, const PAGES: usize>(
    mut flash: MockFlash<PAGE, PAGES>,
    name: &str,
    endurance: f64,
    records: usize,
) -> f64 {
    for number in 0..records {
        flash = flash.write_record(&record(4 * number + 3)).0;
    }
    let [least, most] = [flash.erased.iter().min(), flash.erased.iter().max()].map(|count| *count.expect("pages"));
    assert!(most - least <= 1, "{name}: {:?}", flash.erased);
    let worn = endurance * records as f64 / f64::from(most);
    let years = |a_year: f64| worn / a_year;
    const HOURS: f64 = 24.0 * 365.25;
    println!("{name:<14} {records:7}  {most:20}  {worn:25.0}  {:19.1}  {:11.0}", years(60.0 * HOURS), years(HOURS));
    worn
}
