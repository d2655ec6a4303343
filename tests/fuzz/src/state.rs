//! Stored records: the state of estimators, and the settings in flash memory.

use allan_core::{Cascade, Coupling, FractionalOctaves, Hadamard};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use firmware::settings_store::{MAX_RECORD, SettingsStore};
use std::convert::Infallible;

/// An accepted state can be used and stored again.
pub(crate) fn estimators(bytes: &[u8]) {
    if let Ok(mut cascade) = postcard::from_bytes::<Cascade<12, 8>>(bytes) {
        let kept = postcard::to_stdvec(&cascade).expect("room");
        assert_eq!(postcard::from_bytes::<Cascade<12, 8>>(&kept).as_ref(), Ok(&cascade));
        cascade.merge(&cascade.clone());
        cascade.gap(3);
        (0..100).for_each(|sample| cascade.push(sample));
        let _curve = cascade.curve(0.01);
        if let Ok(mut hadamard) = postcard::from_bytes::<Hadamard<12, 8>>(bytes) {
            hadamard.observe(&cascade);
        }
    }
    let _any = postcard::from_bytes::<Coupling<12>>(bytes).map(|coupling| coupling.points());
    let _any = postcard::from_bytes::<FractionalOctaves<12, 8>>(bytes);
}

/// A flash memory of two sectors; programming clears bits, erasing sets all of a sector.
struct Flash(Vec<u8>);

const SECTOR: usize = 4096;

impl ErrorType for Flash {
    type Error = Infallible;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Infallible> {
        bytes.copy_from_slice(&self.0[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.len()
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Infallible> {
        self.0[from as usize..to as usize].fill(0xFF);
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Infallible> {
        self.0[offset as usize..].iter_mut().zip(bytes).for_each(|(old, new)| *old &= new);
        Ok(())
    }
}

/// Any content of the flash memory can be read, and a record that is written afterwards is read back.
pub(crate) fn settings(bytes: &[u8]) {
    let mut contents = vec![0xFF; 2 * SECTOR];
    // Both sectors begin with bytes of the fuzzer.
    let (first, second) = bytes.split_at(bytes.len() / 2);
    for (sector, bytes) in contents.chunks_mut(SECTOR).zip([first, second]) {
        sector.iter_mut().zip(bytes).for_each(|(old, new)| *old = *new);
    }
    let mut store = SettingsStore::new(Flash(contents), 0..2 * SECTOR as u32).expect("whole sectors");
    let mut record = [0; MAX_RECORD];
    let _any = store.read(&mut record);
    let new = [0x5A; 16];
    store.replace(&new).expect("a memory without faults");
    let length = store.read(&mut record).expect("a record");
    assert_eq!(&record[..length], new);
}
