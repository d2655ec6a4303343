//! A recording over a serial link: the device restarts or hangs up, or the log cannot be written.

use link::{Encoder, MessageRef, RawBurst, RawMessage};
use recordings::recorded_file::FrameReader;
use recordings::serial::{SerialLink, SerialRecordingError, record};
use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;

/// A port that answers with these bytes, then is closed; it keeps what was sent to it.
struct Port<'a> {
    answers: VecDeque<u8>,
    sent: &'a mut Vec<u8>,
}

impl Read for Port<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.answers.is_empty() {
            return Err(ErrorKind::BrokenPipe.into());
        }
        let count = self.answers.len().min(buffer.len()).min(100);
        self.answers.drain(..count).zip(buffer).for_each(|(byte, place)| *place = byte);
        Ok(count)
    }
}

impl Write for Port<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.sent.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Messages of one burst every 10 ms, of which the first has this number and time.
fn messages(encoder: &mut Encoder, first: u64, at_us: u64, count: u64) -> VecDeque<u8> {
    let mut bytes = VecDeque::new();
    for number in 0..count {
        let mut bursts = heapless::Vec::new();
        bursts.push(RawBurst { after_us: 0, periods: 0, words: [[0x80, 1]; 12] }).expect("room");
        let raw = RawMessage { first: first + number, at_us: at_us + 10_000 * number, sens_avg: 0x0402, bursts };
        encoder.encode(MessageRef::Raw(&raw), &mut |sent| bytes.extend(sent));
    }
    bytes
}

fn times(log: &Path) -> Vec<f64> {
    let mut reader = FrameReader::open(&log.into()).expect("opened").expect("a log");
    let mut times = Vec::new();
    while let Some(captured) = reader.next().expect("a line that can be read") {
        let frame = captured.frame;
        if frame.mosi.len() == 26 {
            times.push(frame.time_s);
        }
    }
    times
}

#[test]
fn time_goes_on_where_the_device_restarts() {
    let dir = tempfile::tempdir().expect("a folder");
    let log = dir.path().join("device.csv");
    let mut encoder = Encoder::default();
    // 1 s from 100 s on, of which one sample is missing; then the device starts anew, for 4.5 s.
    let mut answers = messages(&mut encoder, 10_000, 100_000_000, 50);
    answers.extend(messages(&mut encoder, 10_051, 100_510_000, 49));
    answers.extend(messages(&mut encoder, 20, 200_000, 450));
    let mut sent = Vec::new();
    let mut link = SerialLink::new(Port { answers, sent: &mut sent });
    let summary = record(&mut link, &log, 5.0, || false).expect("a recording");
    assert_eq!((summary.restarts, summary.missing, summary.interrupted), (1, 1, false));
    let times = times(&log);
    assert_eq!(times.len() as u64, summary.bursts);
    assert!(times.is_sorted_by(|a, b| a < b), "time goes on");
    // 5 s from the first burst, by the device's clock before and after the restart.
    let seconds = times[times.len() - 1] - times[0];
    assert!((5.0..5.02).contains(&seconds), "{seconds}");
    assert_eq!(sent, b"w 1\rw 0\r");
}

#[test]
fn what_came_until_a_device_hung_up_is_a_recording() {
    let dir = tempfile::tempdir().expect("a folder");
    let log = dir.path().join("device.csv.gz");
    let mut sent = Vec::new();
    let answers = messages(&mut Encoder::default(), 0, 0, 100);
    let mut link = SerialLink::new(Port { answers, sent: &mut sent });
    let summary = record(&mut link, &log, 5.0, || false).expect("a hundred bursts");
    assert_eq!((summary.bursts, summary.interrupted, summary.lost_after), (100, true, Some(100)));
    assert_eq!(times(&log).len(), 100);
    let mut link = SerialLink::new(Port { answers: Default::default(), sent: &mut sent });
    let error = record(&mut link, &log, 5.0, || false).expect_err("it hung up");
    assert!(matches!(error, SerialRecordingError::Disconnected(0)), "{error}");
}

#[test]
fn the_device_is_told_where_the_log_cannot_be_written() {
    let mut sent = Vec::new();
    let answers = messages(&mut Encoder::default(), 0, 0, 100);
    let mut link = SerialLink::new(Port { answers, sent: &mut sent });
    let error = record(&mut link, Path::new("/dev/full"), 0.5, || false).expect_err("a full disk");
    assert!(matches!(error, SerialRecordingError::Log(_)), "{error}");
    assert_eq!(sent, b"w 1\rw 0\r");
}

/// Lines stay in memory for a second at most while others follow, and 4 MiB of them.
#[test]
fn an_unfinished_log_can_be_read() {
    const BUFFERED: u32 = 4 << 20;
    let dir = tempfile::tempdir().expect("a folder");
    for name in ["log.csv", "log.csv.gz"] {
        let log = dir.path().join(name);
        let mut writer = recordings::frame_log::FrameLogWriter::create(&log).expect("created");
        let mut written = 0_u32;
        while log.metadata().expect("a log").len() == 0 {
            let time_s = f64::from(written);
            let frame = recordings::frame_log::Frame { time_s, mosi: vec![0x3E; 26], miso: vec![0; 26] };
            writer.write(&frame).expect("written");
            written += 1;
            // So slowly that the memory is not full within the second; two bytes are four digits.
            assert!(written < BUFFERED / (4 * 26 + 10), "{name}: nothing is in the file");
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        std::mem::forget(writer);
        assert_eq!(times(&log).len() as u32, written, "{name}");
    }
}
