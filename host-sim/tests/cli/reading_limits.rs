//! Files that ask for far more than a recording of their size needs: one line of error, in bounded memory and time.

use crate::program::write;
use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use rusqlite::Connection;
use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::tempdir;

/// Processor time and memory that any command on a file below 1 MB may take.
const MOST_TIME: Duration = Duration::from_secs(20);
const MOST_KILOBYTES: u64 = 500 * 1024;

/// The only line of error of a command, which has to end within the time and the memory.
fn refusal(arguments: &[&str]) -> String {
    let (code, text) = bounded(arguments);
    assert_eq!(code, Some(1), "{arguments:?}: {text}");
    let errors: Vec<&str> = text.lines().filter(|line| !line.starts_with("note: ")).collect();
    assert!(matches!(errors[..], [error] if error.len() < 1000), "{arguments:?}: {text}");
    errors[0].to_owned()
}

/// The exit code and the errors of a command, which has to end within the time and the memory.
fn bounded(arguments: &[&str]) -> (Option<i32>, String) {
    let started = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let status = format!("/proc/{}/status", child.id());
    let mut most = 0;
    while child.try_wait().expect("a child").is_none() {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let peak = text.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse().ok());
        most = most.max(peak.unwrap_or(0u64));
        let time = processor_time(child.id());
        // A command that waits takes no processor time.
        if time > MOST_TIME || started.elapsed() > 10 * MOST_TIME || most > MOST_KILOBYTES {
            child.kill().expect("a child");
            panic!("{arguments:?}: {most} kB, {time:?} of processor time in {:?}", started.elapsed());
        }
        thread::sleep(Duration::from_millis(2));
    }
    let output = child.wait_with_output().expect("a child");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// What a process has used so far; Linux tells it in 1/100 s.
fn processor_time(process: u32) -> Duration {
    let text = fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    // Behind the name, which ends with the last bracket: ten fields after the state come user and system time.
    let fields = text.rsplit(')').next().unwrap_or_default().split_whitespace();
    let ticks: u64 = fields.skip(11).take(2).filter_map(|field| field.parse::<u64>().ok()).sum();
    Duration::from_millis(10 * ticks)
}

fn zlib(parts: impl Iterator<Item = Vec<u8>>) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    parts.for_each(|part| encoder.write_all(&part).expect("memory"));
    encoder.finish().expect("memory")
}

/// So many bytes of zeros, in parts.
fn zeros(bytes: usize) -> impl Iterator<Item = Vec<u8>> {
    (0..bytes / 1_000_000).map(|_| vec![0; 1_000_000])
}

fn name(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// The parser of the header takes twice the time for each level: 2²⁴ steps, and 2⁶⁰.
#[test]
fn brackets_in_the_header_of_an_array_have_a_limit() {
    let dir = tempdir().expect("a folder");
    for levels in [24, 60, 10_000] {
        let header = format!(
            "{{'descr': {}{}, 'fortran_order': False, 'shape': (3,), }}\n",
            "[".repeat(levels),
            "]".repeat(levels)
        );
        let length = u32::try_from(header.len()).expect("short").to_le_bytes();
        let file = write(&dir, "deep.npy", &[b"\x93NUMPY\x02\x00", &length[..], header.as_bytes()].concat());
        let error = refusal(&["analyze", name(&file), "--rate", "100", "--columns", "gyro_x=0", "--units", "deg/s"]);
        assert!(error.contains("levels deep"), "{error}");
    }
}

/// Definitions that use each other: a chain of any length, and one that each time uses the next twice.
#[test]
fn definitions_within_definitions_have_a_limit() {
    let dir = tempdir().expect("a folder");
    let record =
        |kind: u8, body: &[u8]| [&u16::try_from(body.len()).expect("short").to_le_bytes()[..], &[kind], body].concat();
    let log = |fields: &dyn Fn(usize) -> String, levels: usize| {
        let mut log = [&b"ULog\x01\x12\x35\x01"[..], &[0; 8]].concat();
        for level in 0..levels {
            log.extend(record(b'F', format!("a{level}:{}", fields(level)).as_bytes()));
        }
        log.extend(record(b'F', format!("a{levels}:uint64_t timestamp;float x;float y;float z;").as_bytes()));
        log.extend(record(b'A', &[&[0, 0, 0][..], b"a0"].concat()));
        log.extend(record(b'D', &[0; 40]));
        write(&dir, "deep.ulg", &log)
    };
    let chain = |level: usize| format!("a{} x;", level + 1);
    for levels in [6_000, 50_000] {
        let error = refusal(&["analyze", name(&log(&chain, levels))]);
        assert!(error.contains("levels deep"), "{levels}: {error}");
    }
    let twice = |level: usize| format!("a{0} x;a{0} y;", level + 1);
    let error = refusal(&["analyze", name(&log(&twice, 30))]);
    assert!(error.contains("fields"), "{error}");
    // An array without an element is a field without a number; it is no reason to refuse the others.
    let mut empty = [&b"ULog\x01\x12\x35\x01"[..], &[0; 8]].concat();
    empty.extend(record(b'F', b"sensor_gyro:uint64_t timestamp;float[0] w;float x;float y;float z;"));
    empty.extend(record(b'A', &[&[0, 0, 0][..], b"sensor_gyro"].concat()));
    for row in 0..100u64 {
        let values = [0.1f32, 0.2, 0.3].map(|value| value * ((row * 7919) % 13) as f32).map(f32::to_le_bytes).concat();
        empty.extend(record(b'D', &[&[0, 0][..], &(row * 10_000).to_le_bytes(), &values].concat()));
    }
    let (code, text) = bounded(&["analyze", name(&write(&dir, "empty.ulg", &empty))]);
    assert_eq!(code, Some(0), "{text}");
}

/// Six arrays of 33 million equal values in 200 kB, as numpy writes them.
#[test]
fn arrays_of_constants_in_an_archive_have_a_limit() {
    let dir = tempdir().expect("a folder");
    let file = dir.path().join("constant.npz");
    let mut archive = zip::ZipWriter::new(fs::File::create(&file).expect("a file"));
    for channel in ["gx", "gy", "gz", "ax", "ay", "az"] {
        archive.start_file(format!("{channel}.npy"), zip::write::SimpleFileOptions::default()).expect("room");
        let header = "{'descr': '|i1', 'fortran_order': False, 'shape': (33000000,), }";
        let header = format!("{header:<117}\n");
        archive.write_all(&[b"\x93NUMPY\x01\x00\x76\x00", header.as_bytes()].concat()).expect("room");
        zeros(33_000_000).for_each(|part| archive.write_all(&part).expect("room"));
    }
    archive.finish().expect("room");
    assert!(file.metadata().expect("a file").len() < 1_000_000);
    let error = refusal(&["analyze", name(&file), "--rate", "100", "--units", "deg/s,g"]);
    assert!(error.contains("far more than a recording of this size"), "{error}");
}

/// Three arrays of 30 million equal values in 88 kB, and a header of MATLAB with zeros after it.
#[test]
fn compressed_arrays_of_matlab_have_a_limit() {
    let dir = tempdir().expect("a folder");
    let element = |kind: u32, body: &[u8]| {
        let length = u32::try_from(body.len()).expect("short");
        let mut element = [&kind.to_le_bytes()[..], &length.to_le_bytes(), body].concat();
        element.resize(element.len().next_multiple_of(8), 0);
        element
    };
    let header = [&b"MATLAB 5.0 MAT-file".to_vec()[..], &[b' '; 105], &[0, 1], b"IM"].concat();
    let mut file = header.clone();
    let rows = 30_000_000;
    for channel in ["gyro_x", "gyro_y", "gyro_z"] {
        let flags = element(6, &[&[8, 0, 0, 0][..], &[0; 4]].concat());
        let sides = element(5, &[u32::to_le_bytes(rows), u32::to_le_bytes(1)].concat());
        let inner =
            [flags, sides, element(1, channel.as_bytes()), 1u32.to_le_bytes().to_vec(), rows.to_le_bytes().to_vec()];
        let inner = inner.concat();
        let length = u32::try_from(inner.len()).expect("short") + rows;
        let start = [&14u32.to_le_bytes()[..], &length.to_le_bytes(), &inner].concat();
        let compressed = zlib(std::iter::once(start).chain(zeros(rows as usize)));
        file.extend(
            [&15u32.to_le_bytes()[..], &u32::try_from(compressed.len()).expect("short").to_le_bytes(), &compressed]
                .concat(),
        );
    }
    assert!(file.len() < 1_000_000);
    let constant = write(&dir, "constant.mat", &file);
    let error = refusal(&["analyze", name(&constant), "--rate", "100", "--units", "deg/s"]);
    assert!(error.contains("far more than a recording of this size"), "{error}");
    let mut gzip = GzEncoder::new(Vec::new(), Compression::best());
    gzip.write_all(&header).expect("memory");
    zeros(1_500_000_000 / 4).for_each(|part| gzip.write_all(&part).expect("memory"));
    let zeros = write(&dir, "zeros.mat.gz", &gzip.finish().expect("memory"));
    let error = refusal(&["analyze", name(&zeros)]);
    assert!(error.contains("far more than a recording of this size"), "{error}");
}

/// A gigabyte of lines in a megabyte.
#[test]
fn compressed_lines_have_a_limit() {
    let dir = tempdir().expect("a folder");
    let mut gzip = GzEncoder::new(Vec::new(), Compression::best());
    gzip.write_all(b"gyro_x_deg_s\n").expect("memory");
    let part = b"0\n".repeat(500_000);
    (0..900).for_each(|_| gzip.write_all(&part).expect("memory"));
    let file = gzip.finish().expect("memory");
    assert!(file.len() < 1_000_000, "{}", file.len());
    let error = refusal(&["analyze", name(&write(&dir, "lines.csv.gz", &file)), "--rate", "100"]);
    assert!(error.contains("far more than a recording of this size"), "{error}");
}

/// Structures within structures.
#[test]
fn structures_of_matlab_have_a_limit() {
    let dir = tempdir().expect("a folder");
    let element = |kind: u32, body: &[u8]| {
        let length = u32::try_from(body.len()).expect("short");
        let mut element = [&kind.to_le_bytes()[..], &length.to_le_bytes(), body].concat();
        element.resize(element.len().next_multiple_of(8), 0);
        element
    };
    let start = [
        element(6, &[&[2, 0, 0, 0][..], &[0; 4]].concat()),
        element(5, &[u32::to_le_bytes(1), u32::to_le_bytes(1)].concat()),
        element(1, b"s"),
        element(5, &8u32.to_le_bytes()),
        element(1, b"inner\0\0\0"),
    ]
    .concat();
    let mut inner = element(14, &[]);
    for _ in 0..5_000 {
        inner = element(14, &[&start[..], &inner].concat());
    }
    let header = [&b"MATLAB 5.0 MAT-file".to_vec()[..], &[b' '; 105], &[0, 1], b"IM"].concat();
    let file = write(&dir, "deep.mat", &[header, inner].concat());
    let error = refusal(&["analyze", name(&file)]);
    assert!(error.contains("levels deep"), "{error}");
}

/// A bag whose messages are a view that never ends, and one whose blobs are a computation that never ends.
#[test]
fn a_database_that_never_ends_has_a_limit() {
    let dir = tempdir().expect("a folder");
    let endless = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c)";
    let view = dir.path().join("view.db3");
    let database = Connection::open(&view).expect("a database");
    let topics = "CREATE TABLE topics(id INTEGER, name TEXT, type TEXT);
        INSERT INTO topics VALUES (1, '/imu', 'sensor_msgs/msg/Imu');";
    database
        .execute_batch(&format!(
            "{topics} CREATE VIEW messages AS {endless} SELECT x AS id, 1 AS topic_id, x AS timestamp, x'0001' AS data FROM c;"
        ))
        .expect("written");
    drop(database);
    let error = refusal(&["analyze", name(&view)]);
    assert!(error.contains("messages"), "{error}");
    let view = dir.path().join("topics.db3");
    let database = Connection::open(&view).expect("a database");
    database
        .execute_batch(&format!(
            "CREATE VIEW topics AS {endless} SELECT x AS id, 'a' AS name, 'b' AS type FROM c;
             CREATE TABLE messages(id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB);"
        ))
        .expect("written");
    drop(database);
    let error = refusal(&["analyze", name(&view)]);
    assert!(error.contains("topics"), "{error}");
}

/// A device that gives bytes for ever.
#[test]
fn a_profile_has_a_limit() {
    let dir = tempdir().expect("a folder");
    let file = write(&dir, "table.csv", b"t,gx\n0,1\n0.01,2\n");
    let error = refusal(&["analyze", name(&file), "--sensor", "/dev/zero"]);
    assert!(error.contains("/dev/zero") && error.contains("not longer than 1048576 bytes"), "{error}");
}

/// Any binary: what it looks like, and how to convert it.
#[test]
fn an_unknown_binary_is_named_with_a_way_to_convert_it() {
    let dir = tempdir().expect("a folder");
    let gzip = |bytes: &[u8]| {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(bytes).expect("memory");
        encoder.finish().expect("memory")
    };
    let words = |bytes: &[u8], words: &[&str]| {
        let error = refusal(&["analyze", name(&write(&dir, "file.dat", bytes))]);
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    };
    // As `save` of R writes it, compressed.
    words(&gzip(b"RDX3\nX\n\0\0\0\x03\0\x04\x02\x01"), &["R workspace", "write.csv("]);
    words(b"\x01\x02\x03\x04\x05\0\0\0sensor", &["01 02 03 04 05 00", "HDF5", "numpy.save"]);
    words(b"\xFF\xFEt\0,\0x\0\n\0", &["UTF-16", "iconv"]);
    words(b"\x80\x05\x95\xAA\0\0\0", &["pickle", "read_pickle"]);
    words(b"[{\"gx\": 1}, {\"gx\": 2}]", &["JSON document", "lines=True"]);
    words(b"{\n  \"schema\": 1,\n  \"samples\": 9\n}\n", &["report of this program", "`compare` and `export`"]);
    words(b"{\n \"gx\": [1, 2, 3]\n}\n", &["JSON document", "lines=True"]);
    // As numpy writes a dict.
    let header = format!("{:<117}\n", "{'descr': '|O', 'fortran_order': False, 'shape': (), }");
    words(&[b"\x93NUMPY\x01\0\x76\0", header.as_bytes(), b"\x80\x04\x95"].concat(), &["Python objects", "numpy.savez"]);
    // Two messages of MAVLink 2 behind their times.
    let message = [&[0, 6, 10, 36, 24, 30, 64, 0, 0xFD, 4, 0, 0, 0, 1, 1, 0, 0, 0][..], &[0; 6]].concat();
    words(&[message.clone(), message].concat(), &["MAVLink", "mavlogdump.py"]);
}
