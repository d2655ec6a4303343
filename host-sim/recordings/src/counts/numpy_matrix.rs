//! NumPy arrays of doubles in SI units.

use crate::recording::Recording;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

/// Standard gravity, m/s².
const GRAVITY: f64 = 9.806_65;

/// Writes a row per sample: time in s, if every sample has one, then channels in the order of the burst; rad/s, m/s²,
/// others in their unit. Returns the names of the columns.
pub fn write(recording: &Recording, file: &Path) -> io::Result<Vec<String>> {
    let has_time = recording.samples.iter().all(|sample| sample.time_stamp.time_s.is_some());
    let units: Vec<SiUnit> = recording.channels.iter().map(|channel| SiUnit::of(channel.unit())).collect();
    let mut names: Vec<String> = if has_time { vec!["time_s".to_owned()] } else { Vec::new() };
    names.extend(
        recording.channels.iter().zip(&units).map(|(channel, unit)| format!("{}_{}", channel.name(), unit.suffix)),
    );
    let mut matrix = MatrixWriter::create(file)?;
    for sample in &recording.samples {
        let channels = recording.channels.iter().zip(&units).map(|(&channel, unit)| {
            let count = f64::from(sample.counts.get(channel));
            (count * channel.lsb(recording.range) + channel.offset()) * unit.factor
        });
        matrix.write_row(sample.time_stamp.time_s.filter(|_| has_time).into_iter().chain(channels))?;
    }
    matrix.finish(names.len())?;
    Ok(names)
}

const HEADER: usize = 128;

/// Row-major NumPy format 1.0; the header is written at the end.
pub(crate) struct MatrixWriter {
    out: BufWriter<File>,
    rows: u64,
}

impl MatrixWriter {
    pub(crate) fn create(file: &Path) -> io::Result<Self> {
        let mut out = BufWriter::new(File::create(file)?);
        out.write_all(&[b' '; HEADER])?;
        Ok(Self { out, rows: 0 })
    }

    pub(crate) fn write_row(&mut self, values: impl Iterator<Item = f64>) -> io::Result<()> {
        for value in values {
            self.out.write_all(&value.to_le_bytes())?;
        }
        self.rows += 1;
        Ok(())
    }

    /// `columns` per row.
    pub(crate) fn finish(mut self, columns: usize) -> io::Result<()> {
        let start = [&b"\x93NUMPY\x01\x00"[..], &(HEADER as u16 - 10).to_le_bytes()].concat();
        let shape = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, {columns}), }}", self.rows);
        self.out.seek(SeekFrom::Start(0))?;
        self.out.write_all(&start)?;
        writeln!(self.out, "{shape:<width$}", width = HEADER - start.len() - 1)?;
        self.out.flush()
    }
}

pub(crate) struct SiUnit {
    pub(crate) suffix: &'static str,
    /// From the channel's unit.
    pub(crate) factor: f64,
}

impl SiUnit {
    /// Only rates and specific forces are converted.
    pub(crate) fn of(unit: &'static str) -> Self {
        let (suffix, factor) = match unit {
            "deg/s" => ("rad_s", std::f64::consts::PI / 180.0),
            "g" => ("m_s2", GRAVITY),
            unit => (unit, 1.0),
        };
        Self { suffix, factor }
    }
}

#[cfg(test)]
mod tests {
    use super::write;
    use crate::recording::{NOT_RECORDED, Recorder, TimeStamp};
    use adis16405_driver::{Burst, Channel, Counts, GyroRange};

    #[test]
    fn the_matrix_is_in_si_units() {
        let mut recorder = Recorder::new(vec![Channel::GyroX, Channel::AcclZ, Channel::Temp], GyroRange::Dps150);
        for row in 0..3 {
            let mut counts = NOT_RECORDED;
            counts[Channel::GyroX as usize] = 100 * row;
            counts[Channel::AcclZ as usize] = -300;
            counts[Channel::Temp as usize] = 10;
            recorder.push(TimeStamp::from_time(f64::from(row) / 100.0), &Burst::from_counts(&Counts::new(counts)));
        }
        let dir = tempfile::tempdir().expect("a folder");
        let file = dir.path().join("x.npy");
        let names = write(&recorder.finish(), &file).expect("written");
        assert_eq!(names, ["time_s", "gyro_x_rad_s", "accl_z_m_s2", "temp_degC"]);
        let bytes = std::fs::read(&file).expect("a file");
        // Magic, version, length, header; numbers aligned to 64 bytes.
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }";
        assert_eq!(bytes[..10], *b"\x93NUMPY\x01\x00\x76\x00");
        assert_eq!(std::str::from_utf8(&bytes[10..128]).expect("text").trim_end(), header);
        assert_eq!((bytes[127], bytes.len()), (b'\n', 128 + 3 * 4 * 8));
        let values: Vec<f64> =
            bytes[128..].chunks_exact(8).map(|of| f64::from_le_bytes(of.try_into().expect("eight"))).collect();
        // 0.025 °/s, 3.33 mg, 0.14 °C per count; 25 °C at 0.
        let expected = [0.02, (200.0 * 0.025_f64).to_radians(), -300.0 * 3.33e-3 * 9.806_65, 25.0 + 10.0 * 0.14];
        for (found, expected) in values[8..].iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
        }
    }
}
