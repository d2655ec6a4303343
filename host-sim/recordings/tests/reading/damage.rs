//! Damaged files: what is left of them, or one line of error. `tests/tests/attack` does the same to the program, in bounded memory.

use super::harness::{gzip, normal, read, read_file, rows};
use super::other_programs::{Sample, samples};
use adis16405_driver::{BURST_REQUEST, Burst, Counts};
use flate2::read::GzDecoder;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recordings::ColumnSelection;
use recordings::file_format::RecordedInput;
use recordings::frame_log::{Frame, FrameLogWriter};
use recordings::recording::NOT_RECORDED;
use ruzstd::decoding::StreamingDecoder;
use ruzstd::encoding::{CompressionLevel, compress_to_vec};
use std::io::Read;
use std::path::Path;

#[test]
fn damaged_files_of_every_format_end_in_a_result_or_one_line() {
    let Some(samples) = samples("damaged_files_of_every_format_end_in_a_result_or_one_line") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let no_columns = ColumnSelection::parse(&[], &[]).expect("nothing");
    let mut rng = ChaCha8Rng::seed_from_u64(18);
    let (mut refused, mut read) = (0, 0);
    for Sample { name, file, options, .. } in &samples {
        let whole = std::fs::read(file).expect("written");
        let ending = Path::new(name).extension().expect("an ending").to_str().expect("UTF-8");
        let file = folder.path().join(format!("damaged.{ending}"));
        for case in 0..12 {
            let mut bytes = whole.clone();
            let length = bytes.len();
            match case {
                0 => bytes.truncate(rng.random_range(1..length.min(200))),
                1..4 => bytes.truncate(rng.random_range(1..length)),
                4..9 => (0..1 << (case - 4)).for_each(|_| bytes[rng.random_range(0..length.min(2000))] = rng.random()),
                _ => (0..1 << (2 * (case - 8)))
                    .for_each(|_| bytes[rng.random_range(0..length)] ^= 1 << rng.random_range(0..8)),
            }
            std::fs::write(&file, &bytes).expect("written");
            // Most are read whole, as they are converted; some on their time base, and some as their columns are shown.
            let error = match case {
                5 | 10 => read_file(&file, options).err().map(|error| error.to_string()),
                3 | 8 => RecordedInput::open(&file)
                    .and_then(|file| file.inspect(None, &no_columns))
                    .err()
                    .map(|e| e.to_string()),
                _ => rows(&file, options).err().map(|error| error.to_string()),
            };
            match error {
                None => read += 1,
                Some(line) => {
                    let is_line = !line.contains(char::is_control) && line.len() < 2000;
                    assert!(
                        is_line && (line.contains("damaged.") || case == 5 || case == 10),
                        "{name}, case {case}: {line:?}"
                    );
                    refused += 1;
                }
            }
        }
    }
    assert!(refused > 50 && read > 50, "{refused} refused, {read} read");
}

/// Without what is cut, the rows are those before it, and the damage is told.
#[test]
fn a_recording_that_ends_early_is_read_up_to_there() {
    const ROWS: usize = 20_000;
    let mut noise = normal(5);
    let mut row = |at: usize| format!("{:.2},{:.4},{:.4}\n", at as f64 / 100.0, noise(), noise());
    let rows: String = (0..ROWS).map(&mut row).collect();
    let text = format!("time_s,gx [deg/s],gy [deg/s]\n{rows}");
    let objects: String = rows
        .lines()
        .map(|row| {
            let [t, gx, gy] = row.split(',').collect::<Vec<_>>().try_into().expect("three");
            format!("{{\"time_s\": {t}, \"gyro_x_deg_s\": {gx}, \"gyro_y_deg_s\": {gy}}}\n")
        })
        .collect();
    let (gz, zst) = (gzip(text.as_bytes()), compress_to_vec(text.as_bytes(), CompressionLevel::Fastest));
    let mut array = b"\x93NUMPY\x01\0\x76\0".to_vec();
    array.extend(
        format!("{:<117}\n", format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({ROWS}, 2), }}")).bytes(),
    );
    array.extend((0..2 * ROWS).flat_map(|_| noise().to_le_bytes()));
    let array_gz = gzip(&array);
    let mut log = Vec::new();
    let mut frames = FrameLogWriter::new(&mut log);
    for at in 0..ROWS {
        let mut counts = NOT_RECORDED;
        counts[1..7].iter_mut().zip(3..).for_each(|(count, axis)| *count = (7919 * axis * at % 41) as i16);
        let miso = Burst::from_counts(&Counts::new(counts)).to_bytes().to_vec();
        let frame = Frame { time_s: at as f64 / 100.0, mosi: BURST_REQUEST.to_vec(), miso };
        frames.write(&frame).expect("memory");
    }
    frames.finish().expect("memory");
    let cut = |bytes: &[u8], by: usize| bytes[..bytes.len() - by].to_vec();
    let with = |end: &str| [text.as_bytes(), end.as_bytes()].concat();
    let lines = |text: Vec<u8>| text.iter().filter(|byte| **byte == b'\n').count() - 1;
    let (half_gz, half_zst) = (cut(&gz, gz.len() / 2), cut(&zst, zst.len() / 3));
    let gunzipped = started(GzDecoder::new(&half_gz[..]));
    let unzstd = started(StreamingDecoder::new(&half_zst[..]).expect("a frame"));
    let of_array = started(GzDecoder::new(&array_gz[..array_gz.len() / 2]));
    let columns = ["--rate", "100", "--columns", "gyro_x=0,gyro_y=1", "--units", "deg/s"];
    for (name, bytes, options, rows, damage) in [
        ("whole.csv", text.clone().into_bytes(), &[][..], ROWS, None),
        ("no_end.csv", cut(text.as_bytes(), 1), &[], ROWS, None),
        // It may be a shorter number.
        ("in_number.csv", cut(text.as_bytes(), 3), &[], ROWS, None),
        ("remark.csv", with("# end"), &[], ROWS, None),
        ("words.csv", with("The end"), &[], ROWS, None),
        ("few_cells.csv", with("200.00,0.1"), &[], ROWS, Some("truncated text")),
        ("no_number.csv", with("200.00,0.1,-0.2e"), &[], ROWS, Some("truncated text")),
        ("quoted.csv", with("200.00,0.1,\"0.2"), &[], ROWS, Some("truncated text")),
        ("objects.jsonl", cut(objects.as_bytes(), 8), &[], ROWS - 1, Some("truncated text")),
        ("half.csv.gz", half_gz.clone(), &[], lines(gunzipped), Some("truncated gzip")),
        ("no_trailer.csv.gz", cut(&gz, 3), &[], ROWS, Some("truncated gzip")),
        ("half.csv.zst", half_zst.clone(), &[], lines(unzstd), Some("truncated Zstandard")),
        ("cut.npy", cut(&array, 8 * 2001), &columns, ROWS - 1001, Some("truncated NumPy array")),
        (
            "half.npy.gz",
            cut(&array_gz, array_gz.len().div_ceil(2)),
            &columns,
            (of_array.len() - 128) / 16,
            Some("truncated"),
        ),
        ("log.csv", cut(&log, 20), &[], ROWS - 1, Some("truncated text")),
        ("log.csv.gz", cut(&gzip(&log), 3), &[], ROWS, Some("truncated gzip")),
    ] {
        let read = read(name, &bytes, options).unwrap_or_else(|error| panic!("{name}: {error}"));
        let used = read.samples.slots.len() as u64
            + read.samples.dropped.iter().filter(|(cause, _)| **cause != "gap").map(|(_, count)| count).sum::<u64>();
        assert_eq!(used, rows as u64, "{name}: {:?}", read.notes);
        let told = read.damage.unwrap_or_default();
        assert!(damage.map_or(told.is_empty(), |words| told.contains(words)), "{name}: {told:?}");
    }
}

/// Bytes of any value in the middle, as of a lost sector, and a line without an end, as of a lost line feed. What is not a row costs itself.
#[test]
fn damage_within_a_table_costs_its_own_rows() {
    const ROWS: usize = 3_000;
    let mut noise = normal(6);
    let mut row = |at: usize| format!("{:.2},{:.4},{:.4}\n", at as f64 / 100.0, noise(), noise());
    let rows: Vec<String> = (0..ROWS).map(&mut row).collect();
    let head = "time_s,gx [deg/s],gy [deg/s]\n";
    let with = |middle: &[u8]| {
        [head.as_bytes(), rows[..1_500].concat().as_bytes(), middle, rows[1_540..].concat().as_bytes()].concat()
    };
    let mut random = ChaCha8Rng::seed_from_u64(7);
    // No line feed: the row behind the damage is part of it.
    let mut sector = |length: usize| -> Vec<u8> { (0..length).map(|_| random.random_range(14..=255)).collect() };
    for (name, middle) in
        [("sector.csv", sector(512)), ("long.csv", sector(200_000)), ("controls.csv", vec![0x02; 100])]
    {
        let read = read(name, &with(&middle), &[""; 0]).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(read.samples.slots.len(), ROWS - 41, "{name}: {:?}", read.notes);
        assert!(read.notes_contain("damaged rows are left out"), "{name}: {:?}", read.notes);
        assert!(
            read.notes.iter().all(|note| note.len() < 400 && !note.contains(char::is_control)),
            "{name}: {:?}",
            read.notes
        );
        assert_eq!((read.missing(), read.damage), (41, None), "{name}");
    }
    // A file that is no text is still refused.
    let binary = read("binary.csv", &sector(4_000), &[""; 0]);
    assert!(binary.is_err());
}

/// All that is decompressed before the end.
fn started(mut input: impl Read) -> Vec<u8> {
    let mut bytes = Vec::new();
    input.read_to_end(&mut bytes).expect_err("a cut file");
    bytes
}
