//! Recordings that are read in blocks: logs, and as many rows as a table may have.

use super::harness::gzip;
use adis16405_driver::{Burst, Channel, Counts, GyroRange};
use measurement::SampleBlock;
use recordings::count_table;
use recordings::file_format::RecordedInput;
use recordings::frame_log::{Frame, FrameLogWriter};
use recordings::recorded_file::FrameReader;
use recordings::recording::{Recorder, TimeStamp};
use recordings::sample_stream::{KeptInMemory, Reading, SampleStream};
use recordings::{Reason, count_table_writer};
use std::path::Path;

#[test]
fn a_recording_has_the_blocks_of_its_table() {
    const KEPT: KeptInMemory = KeptInMemory { rows: 1 << 14, rows_with_losses: 1 << 14, most_lost: 1.0 };
    let mut recorder = Recorder::new(vec![Channel::GyroX, Channel::AcclZ], GyroRange::Dps150);
    for row in (0..100_000_u64).filter(|row| row % 1000 < 998) {
        let mut counts = [0; 12];
        counts[Channel::GyroX as usize] = (row * 7919 % 41) as i16 - 20;
        counts[Channel::AcclZ as usize] = (row * 104_729 % 37) as i16 + 280;
        counts[Channel::Supply as usize] = 2068;
        recorder.push(TimeStamp::from_time(row as f64 / 204.8), &Burst::from_counts(&Counts::new(counts)));
    }
    let recording = recorder.finish();
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("table.csv");
    count_table_writer::write(&recording, &file).expect("a table");
    let table = RecordedInput::open(&file).expect("a table");
    let [(recorded, recorded_samples), (read, read_samples)] = [
        SampleStream::recorded(recording, Reading::new(None, KEPT)).expect("a time base"),
        SampleStream::counts(table, GyroRange::Dps150, Reading::new(None, KEPT)).expect("a time base"),
    ]
    .map(|mut stream| {
        assert!(!stream.is_in_memory());
        let description = stream.description().clone();
        let mut samples = Vec::new();
        assert!(stream.read(|block: SampleBlock| samples.push(block)).expect("samples"));
        (description, flat(samples))
    });
    assert_eq!(recorded_samples, read_samples);
    assert_eq!((recorded.samples, recorded.dropped), (read.samples, read.dropped));
    assert_eq!((recorded.periods, recorded.channels), (read.periods, read.channels));
    // Two least-squares slopes, whose sums of 10⁵ stamps are rounded to 10⁵·2⁻⁵³ of them.
    assert!((recorded.sample_rate_hz / read.sample_rate_hz - 1.0).abs() < 2e-11);
}

/// Sample periods, and the counts of each channel.
fn flat(blocks: Vec<SampleBlock>) -> (Vec<u64>, Vec<Vec<i32>>) {
    let channels = blocks.first().map_or(0, |block| block.channels.len());
    let counts = |channel: usize| blocks.iter().flat_map(|block| block.channels[channel].counts.clone()).collect();
    (blocks.iter().flat_map(|block| block.slots.clone()).collect(), (0..channels).map(counts).collect())
}

#[test]
fn frames_are_read_back_as_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let frames: Vec<Frame> = [0.0, 1e-9, 0.1 + 0.2, 1.0 / 3.0, 123_456_789.123_456_79, 1e300]
        .into_iter()
        .enumerate()
        .map(|(at, time_s)| Frame {
            time_s,
            mosi: (0..=255u8).skip(at).take(2 * at + 2).collect(),
            miso: (0..=255u8).rev().take(2 * at + 2).collect(),
        })
        .collect();
    for name in ["frames", "frames.gz"] {
        let file = folder.path().join(name);
        let mut log = FrameLogWriter::create(&file).expect("created");
        for frame in &frames {
            log.write(frame).expect("written");
        }
        log.finish().expect("closed");
        assert_eq!(std::fs::read(&file).expect("a log")[0] == 0x1f, name.ends_with(".gz"));
        let mut reader = FrameReader::open(&(&file).into()).expect("opened").expect("a log");
        for frame in &frames {
            assert_eq!(reader.next().expect("a line").map(|captured| captured.frame).as_ref(), Some(frame));
        }
        assert_eq!(reader.next().expect("the end"), None);
    }
}

#[test]
fn more_rows_than_are_held_in_memory_are_refused() {
    let mut rows = b"gyro_x_counts\n".to_vec();
    rows.resize(rows.len() + 2 * ((1 << 25) + 1), b'\n');
    rows[14..].chunks_exact_mut(2).for_each(|row| row[0] = b'1');
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("ones.csv");
    std::fs::write(&file, &rows).expect("written");
    let refusal = |file: &Path| {
        count_table::for_each_row(file, GyroRange::default(), |_, _, _| Ok(())).expect_err("too many rows")
    };
    let error = refusal(&file);
    assert!(matches!(error.reason, Reason::TooManySamples), "{error}");
    assert_eq!(error.row, Some((1 << 25) + 1));
    let file = folder.path().join("ones.csv.gz");
    std::fs::write(&file, gzip(&rows)).expect("written");
    let error = refusal(&file);
    assert!(matches!(error.reason, Reason::Limit(_)), "{error}");
}
