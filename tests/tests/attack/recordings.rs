//! Recordings of white noise with known truth, in every format: the clean ones, and the base of the damaged ones.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::io::{Cursor, Write as _};
use system_tests::FlightLog;

/// Names of the files in which the noise is written; the first ones are text.
pub(crate) const FORMS: [&str; 12] = [
    "counts.csv",
    "units.csv",
    "comma.csv",
    "rows.txt",
    "objects.jsonl",
    "sketch.txt",
    "sentences.txt",
    "matrix.npy",
    "arrays.npz",
    "log.ulg",
    "log.bin",
    "bag.mcap",
];
/// Number of names that are text.
pub(crate) const TEXTS: usize = 7;

/// White noise of three rates.
pub(crate) struct Noise {
    pub(crate) rate_hz: f64,
    /// Numbers of the samples that arrived.
    pub(crate) kept: Vec<u64>,
    /// A row of counts of [`LSB`](Self::LSB) for each of these samples.
    pub(crate) counts: Vec<[i16; 3]>,
    /// Standard deviation, deg/s.
    pub(crate) sigma: f64,
}

impl Noise {
    /// Size of a count, deg/s; also of the register counts of an ADIS16405.
    pub(crate) const LSB: f64 = 0.05;

    pub(crate) fn draw(rng: &mut ChaCha8Rng, rows: usize, lost: f64) -> Self {
        let deviation: f64 = rng.random_range(10.0..200.0);
        let rate_hz = [50.0, 100.0, 200.0, 819.2, 1000.0][rng.random_range(0..5)];
        let count = |rng: &mut ChaCha8Rng| {
            let sum: f64 = (0..12).map(|_| rng.random_range(-0.5..0.5)).sum();
            (deviation * sum).round() as i16
        };
        let (mut kept, mut counts) = (Vec::new(), Vec::new());
        for sample in 0..rows as u64 {
            if sample == 0 || rng.random::<f64>() >= lost {
                kept.push(sample);
                counts.push([count(rng), count(rng), count(rng)]);
            }
        }
        Self { rate_hz, kept, counts, sigma: deviation * Self::LSB }
    }

    /// Samples missing between the first and the last.
    pub(crate) fn missing(&self) -> u64 {
        self.kept.last().map_or(0, |last| last + 1 - self.kept.len() as u64)
    }

    /// Angle random walk, deg/sqrt(s).
    pub(crate) fn angle_random_walk(&self) -> f64 {
        self.sigma / self.rate_hz.sqrt()
    }

    fn rates(&self, row: usize) -> [f64; 3] {
        self.counts[row].map(|count| f64::from(count) * Self::LSB)
    }

    fn times_us(&self) -> impl Iterator<Item = u64> {
        self.kept.iter().map(|&sample| 1_000_000 + (sample as f64 * 1e6 / self.rate_hz).round() as u64)
    }

    /// The recording in a random one of the [forms](FORMS).
    pub(crate) fn drawn(&self, rng: &mut ChaCha8Rng) -> Recorded {
        self.recorded(FORMS[rng.random_range(0..FORMS.len())])
    }

    /// The recording in the form with this file name.
    pub(crate) fn recorded(&self, name: &'static str) -> Recorded {
        const TEXT: &str = "time=0,gyro_x=1,gyro_y=2,gyro_z=3";
        let rate = self.rate_hz.to_string();
        let times: Vec<u64> = self.times_us().collect();
        let [axes, stamped] = ["gyro_x_counts,gyro_y_counts,gyro_z_counts", "gyro_x_deg_s,gyro_y_deg_s,gyro_z_deg_s"];
        let decimals = |at: usize| self.rates(at).map(|rate| format!("{rate:.2}"));
        let (bytes, options): (Vec<u8>, &[&str]) = match name {
            "counts.csv" => {
                let line = |at: usize| {
                    format!("{},{}", self.kept[at], self.counts[at].map(|count| count.to_string()).join(","))
                };
                (self.text(&format!("sample,{axes}"), line), &["--rate", &rate])
            }
            "units.csv" => {
                let line = |at: usize| format!("{},{}", times[at], decimals(at).join(","));
                (self.text(&format!("time_us,{stamped}"), line), &[])
            }
            "comma.csv" => {
                let line = |at: usize| format!("{};{}", times[at], decimals(at).join(";").replace('.', ","));
                (self.text("t_us;wx [deg/s];wy [deg/s];wz [deg/s]", line), &[])
            }
            "rows.txt" => {
                let line = |at: usize| {
                    format!(
                        "{} {}",
                        times[at],
                        self.rates(at).map(|rate| format!("{:.7}", rate.to_radians())).join(" ")
                    )
                };
                (self.text("", line), &["--columns", TEXT, "--units", "us,rad/s"])
            }
            "objects.jsonl" => {
                let line = |at: usize| format!("{{\"t_us\": {}, \"gyro\": [{}]}}", times[at], decimals(at).join(", "));
                (self.text("", line), &["--units", "deg/s"])
            }
            "sketch.txt" => {
                let line = |at: usize| {
                    let [x, y, z] = decimals(at);
                    format!("t: {}, gx: {x}, gy: {y}, gz: {z}", times[at])
                };
                (self.text("", line), &["--units", "us,deg/s"])
            }
            "sentences.txt" => {
                let line = |at: usize| {
                    let body = format!("PIMU,{},{}", times[at], decimals(at).join(","));
                    format!("${body}*{:02X}", body.bytes().fold(0, |sum, byte| sum ^ byte))
                };
                (self.text("", line), &["--columns", "time=1,gyro_x=2,gyro_y=3,gyro_z=4", "--units", "us,deg/s"])
            }
            "matrix.npy" => (self.npy(), &["--columns", TEXT, "--units", "us,rad/s"]),
            "arrays.npz" => (zipped(&[("imu.npy", &self.npy())]), &["--columns", TEXT, "--units", "us,rad/s"]),
            "log.ulg" => (self.ulog(), &[]),
            "log.bin" => (self.dataflash(), &[]),
            _ => (self.mcap(), &["--units", "rad/s"]),
        };
        let options = options.iter().map(|&option| option.to_owned()).collect();
        Recorded { name, bytes, options }
    }

    /// A heading, if any, and a line for each sample.
    fn text(&self, heading: &str, line: impl Fn(usize) -> String) -> Vec<u8> {
        let heading = if heading.is_empty() { String::new() } else { format!("{heading}\n") };
        (heading + &(0..self.kept.len()).map(|at| line(at) + "\n").collect::<String>()).into_bytes()
    }

    /// Times in µs and rates in rad/s in the format of `numpy.save` for doubles (NEP 1).
    fn npy(&self) -> Vec<u8> {
        let shape = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, 4), }}", self.kept.len());
        let mut bytes = b"\x93NUMPY\x01\0\x76\0".to_vec();
        bytes.extend(format!("{shape:<117}\n").bytes());
        for (at, time) in self.times_us().enumerate() {
            let row = [time as f64].into_iter().chain(self.rates(at).map(f64::to_radians));
            bytes.extend(row.flat_map(f64::to_le_bytes));
        }
        bytes
    }

    /// A log of PX4 with `sensor_gyro`, in rad/s (ULog file format).
    fn ulog(&self) -> Vec<u8> {
        let mut log = FlightLog::empty();
        log.add(b'B', &[0; 40]);
        log.add(
            b'F',
            b"sensor_gyro:uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float x;float y;float z;",
        );
        log.add(b'A', b"\0\0\0sensor_gyro");
        for (at, time) in self.times_us().enumerate() {
            let mut payload = vec![0, 0];
            payload.extend((time + 50).to_le_bytes());
            payload.extend(time.to_le_bytes());
            payload.extend([1, 0, 0, 0]);
            payload.extend(self.rates(at).iter().flat_map(|rate| (rate.to_radians() as f32).to_le_bytes()));
            log.add(b'D', &payload);
        }
        log.0
    }

    /// A log of ArduPilot with messages `IMU`, in rad/s.
    fn dataflash(&self) -> Vec<u8> {
        const MAGIC: [u8; 2] = [0xA3, 0x95];
        fn padded(text: &str, size: usize) -> impl Iterator<Item = u8> {
            text.bytes().chain(std::iter::repeat(0)).take(size)
        }
        let mut log = Vec::new();
        let mut format = |kind: u8, length: u8, name: &str, types: &str, labels: &str| {
            log.extend(MAGIC);
            log.extend([0x80, kind, length]);
            log.extend(padded(name, 4).chain(padded(types, 16)).chain(padded(labels, 64)));
        };
        format(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns");
        format(130, 24, "IMU", "QBfff", "TimeUS,I,GyrX,GyrY,GyrZ");
        for (at, time) in self.times_us().enumerate() {
            log.extend(MAGIC);
            log.push(130);
            log.extend(time.to_le_bytes());
            log.push(0);
            log.extend(self.rates(at).iter().flat_map(|rate| (rate.to_radians() as f32).to_le_bytes()));
        }
        log
    }

    /// A file with messages of a new type in CDR, in rad/s.
    fn mcap(&self) -> Vec<u8> {
        let definition = "builtin_interfaces/Time stamp\ngeometry_msgs/Vector3 angular_velocity\n\
            ================================================================================\n\
            MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n\
            ================================================================================\n\
            MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n";
        let mut bytes = Cursor::new(Vec::new());
        let mut out = mcap::Writer::new(&mut bytes).expect("memory");
        let schema = out.add_schema("pkg/msg/Rates", "ros2msg", definition.as_bytes()).expect("a schema");
        let channel_id = out.add_channel(schema, "/rates", "cdr", &BTreeMap::new()).expect("a channel");
        for (at, time) in self.times_us().enumerate() {
            let mut data = vec![0, 1, 0, 0];
            data.extend(((time / 1_000_000) as u32).to_le_bytes());
            data.extend(((time % 1_000_000 * 1000) as u32).to_le_bytes());
            data.extend(self.rates(at).iter().flat_map(|rate| rate.to_radians().to_le_bytes()));
            let header = mcap::records::MessageHeader {
                channel_id,
                sequence: at as u32,
                log_time: 1000 * time,
                publish_time: 1000 * time,
            };
            out.write_to_known_channel(&header, &data).expect("memory");
        }
        out.finish().expect("memory");
        drop(out);
        bytes.into_inner()
    }
}

/// The bytes of a file, and the options for reading it.
pub(crate) struct Recorded {
    pub(crate) name: &'static str,
    pub(crate) bytes: Vec<u8>,
    pub(crate) options: Vec<String>,
}

impl Recorded {
    /// The arguments of a command that reads `file`.
    pub(crate) fn reading<'a>(&'a self, command: &'a str, file: &'a str) -> Vec<&'a str> {
        [command, file].into_iter().chain(self.options.iter().map(String::as_str)).collect()
    }
}

/// An archive of these files.
pub(crate) fn zipped(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
        archive.start_file(*name, options).expect("memory");
        archive.write_all(bytes).expect("memory");
    }
    archive.finish().expect("memory").into_inner()
}
