//! Files that ask for far more than a recording of their size needs: one line of error, in bounded memory and processor time.

use crate::program::write;
use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use rusqlite::Connection;
use std::fs;
use std::io::Write;
use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;
use system_tests::FlightLog;
use tempfile::tempdir;

/// Processor time, s, and memory that any command on a file below 1 MB may take.
const MOST_SECONDS: u32 = 20;
const MOST_KILOBYTES: u64 = 500 * 1024;

/// The only line of error of a command, which the system ends after its time, and this function beyond its memory.
fn refusal(arguments: &[&str]) -> String {
    let mut child = Command::new("sh")
        .args(["-c", &format!("ulimit -t {MOST_SECONDS}; exec \"$@\""), "sh", env!("CARGO_BIN_EXE_imunoise")])
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("a shell");
    let status = format!("/proc/{}/status", child.id());
    while child.try_wait().expect("a child").is_none() {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let peak = text.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse().ok());
        let peak = peak.unwrap_or(0u64);
        if peak > MOST_KILOBYTES {
            child.kill().expect("a child");
            panic!("{arguments:?}: {peak} kB");
        }
        // Between two looks at the memory.
        thread::sleep(Duration::from_millis(2));
    }
    let output = child.wait_with_output().expect("a child");
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {:?} {text}", output.status);
    let errors: Vec<&str> = text.lines().filter(|line| !line.starts_with("note: ")).collect();
    assert!(matches!(errors[..], [error] if error.len() < 1000), "{arguments:?}: {text}");
    errors[0].to_owned()
}

/// So many bytes of zeros, in parts.
fn zeros(bytes: usize) -> impl Iterator<Item = Vec<u8>> {
    (0..bytes / 1_000_000).map(|_| vec![0; 1_000_000])
}

/// A gzip stream of these parts.
fn gzip_of(parts: impl Iterator<Item = Vec<u8>>) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    parts.for_each(|part| encoder.write_all(&part).expect("memory"));
    encoder.finish().expect("memory")
}

/// The parser of the header takes twice the time for each level: 2²⁴ steps, and 2⁶⁰.
fn brackets_in_the_header_of_an_array(levels: usize) -> Vec<u8> {
    let descr = format!("{}{}", "[".repeat(levels), "]".repeat(levels));
    let header = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': (3,), }}\n");
    let length = u32::try_from(header.len()).expect("short").to_le_bytes();
    [b"\x93NUMPY\x02\x00", &length[..], header.as_bytes()].concat()
}

/// A ULog with definitions that use each other.
fn definitions(fields: impl Fn(usize) -> String, levels: usize) -> Vec<u8> {
    let mut log = FlightLog::empty();
    for level in 0..levels {
        log.add(b'F', format!("a{level}:{}", fields(level)).as_bytes());
    }
    log.add(b'F', format!("a{levels}:uint64_t timestamp;float x;float y;float z;").as_bytes());
    log.add(b'A', b"\0\0\0a0");
    log.add(b'D', &[0; 40]);
    log.0
}

fn one_definition(level: usize) -> String {
    format!("a{} x;", level + 1)
}

fn two_definitions(level: usize) -> String {
    format!("a{0} x;a{0} y;", level + 1)
}

/// Six arrays of 33 million equal values in 200 kB, as numpy writes them.
fn arrays_of_constants() -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for channel in ["gx", "gy", "gz", "ax", "ay", "az"] {
        archive.start_file(format!("{channel}.npy"), zip::write::SimpleFileOptions::default()).expect("room");
        let header = "{'descr': '|i1', 'fortran_order': False, 'shape': (33000000,), }";
        let header = format!("{header:<117}\n");
        archive.write_all(&[b"\x93NUMPY\x01\x00\x76\x00", header.as_bytes()].concat()).expect("room");
        zeros(33_000_000).for_each(|part| archive.write_all(&part).expect("room"));
    }
    archive.finish().expect("room").into_inner()
}

fn matlab_header() -> Vec<u8> {
    [&b"MATLAB 5.0 MAT-file".to_vec()[..], &[b' '; 105], &[0, 1], b"IM"].concat()
}

/// An element of a MATLAB file.
fn element(kind: u32, body: &[u8]) -> Vec<u8> {
    let length = u32::try_from(body.len()).expect("short");
    let mut element = [&kind.to_le_bytes()[..], &length.to_le_bytes(), body].concat();
    element.resize(element.len().next_multiple_of(8), 0);
    element
}

/// Three arrays of 30 million equal values in 88 kB.
fn compressed_arrays_of_matlab() -> Vec<u8> {
    let mut file = matlab_header();
    let rows = 30_000_000;
    for channel in ["gyro_x", "gyro_y", "gyro_z"] {
        let flags = element(6, &[&[8, 0, 0, 0][..], &[0; 4]].concat());
        let sides = element(5, &[u32::to_le_bytes(rows), u32::to_le_bytes(1)].concat());
        let values = [1u32, rows].map(u32::to_le_bytes).concat();
        let inner = [flags, sides, element(1, channel.as_bytes()), values].concat();
        let length = u32::try_from(inner.len()).expect("short") + rows;
        let start = [&14u32.to_le_bytes()[..], &length.to_le_bytes(), &inner].concat();
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
        std::iter::once(start).chain(zeros(rows as usize)).for_each(|part| encoder.write_all(&part).expect("memory"));
        let compressed = encoder.finish().expect("memory");
        let length = u32::try_from(compressed.len()).expect("short").to_le_bytes();
        file.extend([&15u32.to_le_bytes()[..], &length, &compressed].concat());
    }
    file
}

/// Structures within structures.
fn structures_of_matlab() -> Vec<u8> {
    let start = [
        element(6, &[&[2, 0, 0, 0][..], &[0; 4]].concat()),
        element(5, &[u32::to_le_bytes(1), u32::to_le_bytes(1)].concat()),
        element(1, b"s"),
        element(5, &8u32.to_le_bytes()),
        element(1, b"inner\0\0\0"),
    ]
    .concat();
    let inner = (0..5_000).fold(element(14, &[]), |inner, _| element(14, &[&start[..], &inner].concat()));
    [matlab_header(), inner].concat()
}

/// A bag in SQLite.
fn database(statements: &str) -> Vec<u8> {
    let folder = tempdir().expect("a folder");
    let file = folder.path().join("bag.db3");
    Connection::open(&file).and_then(|database| database.execute_batch(statements)).expect("written");
    fs::read(&file).expect("written")
}

const ENDLESS: &str = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c)";

/// Messages that are a view that never ends.
fn endless_messages() -> Vec<u8> {
    database(&format!(
        "CREATE TABLE topics(id INTEGER, name TEXT, type TEXT);
         INSERT INTO topics VALUES (1, '/imu', 'sensor_msgs/msg/Imu');
         CREATE VIEW messages AS {ENDLESS} SELECT x AS id, 1 AS topic_id, x AS timestamp, x'0001' AS data FROM c;"
    ))
}

fn endless_topics() -> Vec<u8> {
    database(&format!(
        "CREATE VIEW topics AS {ENDLESS} SELECT x AS id, 'a' AS name, 'b' AS type FROM c;
         CREATE TABLE messages(id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB);"
    ))
}

/// Lines of one digit behind a heading.
fn lines(heading: &str, millions: usize) -> Vec<u8> {
    let part = b"1\n".repeat(1_000_000);
    gzip_of(std::iter::once(heading.into()).chain(std::iter::repeat_n(part, millions)))
}

/// A file below 1 MB, the options of its analysis, and words of its refusal.
type Case = (&'static str, fn() -> Vec<u8>, &'static [&'static str], &'static str);

const GYRO_X: &[&str] = &["--rate", "100", "--columns", "gyro_x=0", "--units", "deg/s"];
const EXPANDS: &str = "far more than a recording of this size";
const CASES: &[Case] = &[
    ("deep24.npy", || brackets_in_the_header_of_an_array(24), GYRO_X, "levels deep"),
    ("deep60.npy", || brackets_in_the_header_of_an_array(60), GYRO_X, "levels deep"),
    ("deep10000.npy", || brackets_in_the_header_of_an_array(10_000), GYRO_X, "levels deep"),
    ("chain6000.ulg", || definitions(one_definition, 6_000), &[], "levels deep"),
    ("chain50000.ulg", || definitions(one_definition, 50_000), &[], "levels deep"),
    ("twice.ulg", || definitions(two_definitions, 30), &[], "fields"),
    ("structures.mat", structures_of_matlab, &[], "levels deep"),
    ("constant.npz", arrays_of_constants, &["--rate", "100", "--units", "deg/s,g"], EXPANDS),
    ("constant.mat", compressed_arrays_of_matlab, &["--rate", "100", "--units", "deg/s"], EXPANDS),
    ("zeros.mat.gz", || gzip_of(std::iter::once(matlab_header()).chain(zeros(375_000_000))), &[], EXPANDS),
    ("lines.csv.gz", || lines("gyro_x_deg_s\n", 450), &["--rate", "100"], EXPANDS),
    ("messages.db3", endless_messages, &[], "messages"),
    ("topics.db3", endless_topics, &[], "topics"),
];

#[test]
fn a_small_file_takes_bounded_memory_and_time() {
    let dir = tempdir().expect("a folder");
    for (name, content, options, words) in CASES {
        let content = content();
        assert!(content.len() < 1_000_000, "{name}: {} bytes", content.len());
        let file = write(&dir, name, &content);
        let error = refusal(&[&["analyze", file.to_str().expect("UTF-8")], *options].concat());
        assert!(error.contains(words), "{name}: {error}");
    }
}
