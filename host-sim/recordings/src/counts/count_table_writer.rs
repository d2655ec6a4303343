//! Tables of register counts, as [`count_table`](crate::reading::count_table) reads them.

use crate::recording::Recording;
use adis16405_driver::Channel;
use flate2::Compression;
use flate2::write::GzEncoder;
use readers::delimited_text;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

const COUNTS: &str = "_counts";

pub(crate) fn is_header(header: &str) -> bool {
    let is_channel = |name: &str| {
        let channel = delimited_text::field(name).strip_suffix(COUNTS);
        channel.is_some_and(|name| Channel::ALL.iter().any(|channel| channel.name() == name))
    };
    header.split([',', ';', '\t', ' ']).any(is_channel)
}

/// Writes a table, gzip for a name in `.gz`.
///
/// Columns: `sample` and `time_s`, if every sample has them, and counts. Faults and the gyroscopes' range are left out.
pub fn write(recording: &Recording, file: &Path) -> io::Result<()> {
    write_text(file, |out| write_rows(recording, out))
}

/// Writes a text, gzip if the name of `file` ends in `.gz`.
pub(crate) fn write_text<T, E: From<io::Error>>(
    file: &Path,
    write: impl FnOnce(&mut dyn Write) -> Result<T, E>,
) -> Result<T, E> {
    let mut out = BufWriter::new(File::create(file)?);
    if file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gz")) {
        let mut gzip = GzEncoder::new(out, Compression::default());
        let written = write(&mut gzip)?;
        gzip.finish()?.flush()?;
        Ok(written)
    } else {
        let written = write(&mut out)?;
        out.flush()?;
        Ok(written)
    }
}

fn write_rows(recording: &Recording, out: &mut dyn Write) -> io::Result<()> {
    let has_index = recording.samples.iter().all(|sample| sample.time_stamp.index.is_some());
    let has_time = recording.samples.iter().all(|sample| sample.time_stamp.time_s.is_some());
    let counts = recording.channels.iter().map(|channel| format!("{}_counts", channel.name()));
    let stamps = [("sample", has_index), ("time_s", has_time)];
    let stamps = stamps.into_iter().filter(|(_, has)| *has).map(|(name, _)| name.to_owned());
    writeln!(out, "{}", stamps.chain(counts).collect::<Vec<_>>().join(","))?;
    let mut row = String::new();
    for sample in &recording.samples {
        row.clear();
        // `{}` of a float reads back to the same value.
        let index = sample.time_stamp.index.filter(|_| has_index).map(|index| index.to_string());
        let time = sample.time_stamp.time_s.filter(|_| has_time).map(|time| time.to_string());
        let counts = recording.channels.iter().map(|channel| sample.counts.get(*channel).to_string());
        for field in index.into_iter().chain(time).chain(counts) {
            if !row.is_empty() {
                row.push(',');
            }
            row.push_str(&field);
        }
        writeln!(out, "{row}")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::write;
    use crate::reading::count_table;
    use crate::recording::{Recorder, TimeStamp};
    use adis16405_driver::{Burst, Channel, Counts, GyroRange};

    #[test]
    fn a_table_is_read_back_as_it_was() {
        let dir = tempfile::tempdir().expect("a folder");
        for (name, stamp) in [
            ("indexed.csv", (|row| TimeStamp { index: Some(row), time_s: None }) as fn(u64) -> TimeStamp),
            // A third is not a decimal fraction.
            ("timed.csv.gz", |row| TimeStamp::from_time(row as f64 / 3.0)),
            ("neither.csv", |_| TimeStamp::default()),
        ] {
            let mut recorder = Recorder::new(vec![Channel::GyroZ, Channel::Supply], GyroRange::Dps300);
            for row in 0..50_u64 {
                let mut counts = crate::recording::NOT_RECORDED;
                counts[Channel::GyroZ as usize] = 37 * row as i16 - 900;
                recorder.push(stamp(row), &Burst::from_counts(&Counts::new(counts)));
            }
            let recording = recorder.finish();
            let file = dir.path().join(name);
            write(&recording, &file).expect("written");
            assert_eq!(count_table::read(&file, GyroRange::Dps300).expect(name), recording, "{name}");
        }
    }
}
