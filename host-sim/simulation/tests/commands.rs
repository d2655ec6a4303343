//! Attacks on the device through its port: seeded sequences of commands, valid, invalid and damaged, at every rate and in any order. None
//! stops the device or writes the sensor's flash without being armed. Afterwards the device accepts settings.

use link::{BootCause, Decoder, Health, Hello, Message, Received};
use simulation::Device;
use std::fmt::Write as _;
use virtual_sensor::{NoiseModel, VirtualAdis16405};

/// Number of sequences of commands.
const SEQUENCES: u64 = 60;
/// Commands per sequence.
const COMMANDS: u32 = 40;

/// A linear congruential generator (Knuth's MMIX constants).
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % end
    }

    fn pick<'a>(&mut self, from: &[&'a str]) -> &'a str {
        from[self.below(from.len() as u64) as usize]
    }
}

/// Numbers at and beyond the limits of the commands.
const NUMBERS: [&str; 20] = [
    "0",
    "1",
    "2",
    "6",
    "7",
    "75",
    "150",
    "300",
    "0.41",
    "0.4",
    "51.2",
    "163.84",
    "819.2",
    "1e9",
    "-1",
    "65535",
    "4294967",
    "4294967.295",
    "4294968",
    ".",
];
/// Words that act, without those that arm a write to the sensor's flash, restart the device, or start the boot loader.
const WORDS: [&str; 13] = [
    "check",
    "deflect",
    "autonull",
    "clear",
    "persist",
    "forget",
    "dump",
    "measure",
    "bus slow",
    "bus usual",
    "help",
    "brownout",
    "armautonul",
];
const REGISTERS: [&str; 24] = [
    "flash_cnt",
    "supply_out",
    "xgyro_out",
    "xgyro_off",
    "ygyro_off",
    "xaccl_off",
    "xmagn_hif",
    "xmagn_sif",
    "gpio_ctrl",
    "msc_ctrl",
    "smpl_prd",
    "sens_avg",
    "slp_cnt",
    "diag_stat",
    "glob_cmd",
    "alm_mag1",
    "alm_smpl1",
    "alm_ctrl",
    "aux_dac",
    "prod_id",
    "0",
    "3e",
    "57",
    "ff",
];

/// A command, a damaged one, or random bytes.
fn command(random: &mut Random) -> Vec<u8> {
    let mut text = String::new();
    let _ = match random.below(10) {
        0..=2 => write!(text, "{} {}\r", random.pick(&["f", "g", "n", "e", "i", "w", "p"]), random.pick(&NUMBERS)),
        3 | 4 => write!(text, "{}\r", random.pick(&WORDS)),
        5 => write!(text, "poke {} {:x}\r", random.pick(&REGISTERS), random.below(1 << 17)),
        6 => write!(text, "peek {}\r", random.pick(&REGISTERS)),
        7 => write!(text, "{}", random.pick(&["r", "t", "s", "k", "v", "?", "rtskv?", "\u{8}\u{8}\u{7f}"])),
        8 => write!(text, "poke glob_cmd {:x}\r", random.below(1 << 5)),
        _ => Ok(()),
    };
    let mut bytes = text.into_bytes();
    match random.below(8) {
        // Random bytes, which end with the line.
        0 => bytes.extend((0..random.below(80)).map(|_| random.below(256) as u8).chain([b'\r'])),
        // A byte is lost or damaged.
        1 if !bytes.is_empty() => drop(bytes.remove(random.below(bytes.len() as u64) as usize)),
        2 if !bytes.is_empty() => {
            let at = random.below(bytes.len() as u64) as usize;
            bytes[at] ^= 1 << random.below(8);
        }
        _ => {}
    }
    bytes
}

/// Hello, health and the lines that the device has sent since the last call; the stream must be undamaged.
fn hear(bytes: &[u8]) -> (Option<Hello>, Option<Health>, Vec<String>) {
    let (mut decoder, mut hello, mut health, mut lines) = (Decoder::new(), None, None, Vec::new());
    for received in bytes.iter().filter_map(|&byte| decoder.push(byte)) {
        match received {
            Received::Message { message: Message::Hello(message), .. } => hello = Some(message),
            Received::Message { message: Message::Health(message), .. } => health = Some(message),
            Received::Message { .. } => {}
            Received::Text(line) => lines.push(line.as_str().to_owned()),
        }
    }
    let counters = decoder.counters();
    assert_eq!((counters.bad_frames, counters.discarded_bytes), (0, 0), "the stream is damaged");
    (hello, health, lines)
}

/// A device that receives commands at times.
struct Session {
    device: Device,
    now_us: u64,
}

impl Session {
    fn new(seed: u64) -> Self {
        let part = VirtualAdis16405::new(NoiseModel::paper(), seed);
        let device = Device::new(part, Device::blank_memory()).with_restarts().with_reset_line();
        Self { device, now_us: 0 }
    }

    fn send(&mut self, keys: &[u8], wait_us: u64) -> Vec<u8> {
        self.device.press(keys);
        // Commands take time on the bus, so the wait begins after they were executed.
        self.now_us = self.now_us.max(self.device.bus().part().now() / 1000) + wait_us;
        self.device.run_until(self.now_us)
    }

    /// Number of flash writes of the sensor so far, by its register FLASH_CNT.
    fn flash_writes(&mut self) -> u16 {
        let (_, _, lines) = hear(&self.send(b"\rpeek flash_cnt\r", 200_000));
        let line = lines.iter().rev().find(|line| line.starts_with("FLASH_CNT")).expect("the sensor answers");
        line.split_whitespace().last().and_then(|count| count.parse().ok()).expect("a number")
    }
}

/// Commands that restore the settings of a first start.
const SETTINGS: &[u8] = b"\rbus usual\re 0\ri 0\rw 0\rforget\rg 300\rn 0\rf 204.8\rp 0\r";

#[test]
fn no_sequence_of_commands_stops_or_misconfigures_the_device() {
    let mut commands = 0;
    for seed in 0..SEQUENCES {
        let (mut random, mut session) = (Random(seed), Session::new(seed));
        session.send(b"", 1_000_000);
        let before = session.flash_writes();
        for _ in 0..COMMANDS {
            let wait_us = [0, 1_000, 50_000, 400_000][random.below(4) as usize];
            let keys = command(&mut random);
            session.send(&keys, wait_us);
            commands += 1;
        }
        // A sensor that was put to sleep, or to another pin, is recovered by one step per second.
        session.send(SETTINGS, 12_000_000);
        let sent = session.send(b"clear\r", 2_000_000);
        hear(&sent);
        let (hello, health, _) = hear(&session.send(b"r", 1_000_000));
        let (hello, health) = (hello.expect("a report"), health.expect("a report"));
        assert!(hello.sampling, "seed {seed}: {hello:?}");
        assert_eq!(
            (hello.sample_rate_hz, hello.gyro_full_scale, hello.filter_taps_log2, hello.epoch_s),
            (204.8, 300, 0, 0),
            "seed {seed}"
        );
        assert!((hello.measured_rate_hz.expect("64 edges") / 204.8 - 1.0).abs() < 1e-3, "seed {seed}: {hello:?}");
        assert!(f64::from(health.used) > 1.8 * 204.8 && health.used == health.bursts, "seed {seed}: {health:?}");
        assert!(
            hello.boot.cause != BootCause::Watchdog && hello.boot.crash_record.is_empty(),
            "seed {seed}: {hello:?}"
        );
        assert_eq!(session.device.restarts(), 0, "seed {seed}: nothing asked for a restart");
        assert_eq!(session.flash_writes(), before, "seed {seed}: a write to the sensor's flash was not armed");
    }
    println!("{commands} commands in {SEQUENCES} sequences");
}

/// Each bit of GLOB_CMD that writes the sensor's flash needs `arm`, which is valid for one write and ten seconds.
#[test]
fn a_write_to_the_flash_of_the_sensor_needs_arming() {
    // Auto-null, factory restore and flash update (data sheet Rev. B, pages 10 and 13), also with other bits.
    for value in ["1", "2", "8", "0009"] {
        let mut session = Session::new(3);
        session.send(b"i 0\r", 1_000_000);
        let poke = format!("poke glob_cmd {value}\r");
        let refused = |session: &mut Session, keys: &[u8]| {
            let (_, _, lines) = hear(&session.send(keys, 500_000));
            lines.iter().any(|line| line.starts_with("not armed"))
        };
        assert!(refused(&mut session, poke.as_bytes()), "{value}");
        assert_eq!(session.flash_writes(), 0, "{value}");
        session.send(b"arm\r", 11_000_000);
        assert!(refused(&mut session, poke.as_bytes()), "{value}: too late");
        assert!(!refused(&mut session, format!("arm\r{poke}").as_bytes()), "{value}");
        session.send(b"", 2_000_000);
        assert_eq!(session.flash_writes(), 1, "{value}");
        assert!(refused(&mut session, poke.as_bytes()), "{value}: one write for each arming");
        assert!(refused(&mut session, b"autonull\r"), "{value}");
        assert_eq!(session.flash_writes(), 1, "{value}");
    }
}
