//! Faults of the lines between sensor and microcontroller: a table of kinds, rates and seeds, from the virtual sensor to the decoded
//! report. Counted are wrong words, used wrong words, refused right words, the longest time without a used sample, and the shifts of N, B
//! and K. Damage on the serial port is tested too.

use link::{ChannelMessage, Decoder, Message, Received};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use simulation::LineFault::{self, *};
use simulation::{Device, RandomFault, SampleAudit};
use statrs::distribution::{ContinuousCDF, Normal};
use virtual_sensor::{DiagnosisFlag, NoiseModel, VirtualAdis16405};

const RATE_HZ: f64 = 204.8;
/// Channel and bits of the temperature; the other words have 14 bits.
const TEMPERATURE: (u8, i32) = (10, 12);
/// Bursts after a start that depend on earlier ones: two for the filter of one tap, and those within 6.2 ms, in which the poles of 330 Hz
/// settle.
const SETTLING: u64 = 2 + 2;
/// Length of the short runs, s. No fault of bursts moves N, B and K out of their bounds in this time.
const SHORT_S: f64 = 960.0;

fn device(seed: u64) -> Device {
    // The random walk hides flicker noise of longer times.
    let model = NoiseModel { longest_tau_s: 300.0, ..NoiseModel::paper() };
    Device::new(VirtualAdis16405::new(model, seed), Device::blank_memory()).with_restarts()
}

fn run_until(device: &mut Device, end_s: f64) -> Vec<u8> {
    device.run_until((end_s * 1e6) as u64)
}

/// Result of a run.
struct Run {
    audit: SampleAudit,
    longest_gap_s: f64,
    recoveries: u32,
    /// Number of bursts with the error flag.
    marked: u32,
    restarts: u32,
    channels: Vec<ChannelMessage>,
}

/// Runs a device with the fault for `seconds`, then without it for three seconds; in the third one all samples are
/// used.
fn run(fault: Option<RandomFault>, seconds: f64, seed: u64) -> Run {
    run_with(device(seed), seconds, |device, is_on| device.faults().random = if is_on { fault.clone() } else { None })
}

/// Runs a device with a condition that `switch` turns on and off.
fn run_with(mut device: Device, seconds: f64, switch: impl Fn(&mut Device, bool)) -> Run {
    device.press(b"i0\r");
    run_until(&mut device, 10.0); // the sensor settles, and the gate learns the noise
    device.take_audit();
    switch(&mut device, true);
    run_until(&mut device, seconds);
    switch(&mut device, false);
    run_until(&mut device, seconds + 2.0);
    let audit = device.take_audit();
    let longest_gap_s = audit.longest_gap_us(device.bus().part().now() / 1000) as f64 * 1e-6;
    run_until(&mut device, seconds + 3.0);
    let after = device.take_audit();
    assert!(after.words as f64 > 8.0 * 0.98 * RATE_HZ, "{after:?} in the third second after the fault");
    assert_eq!((after.wrong, after.needless), (0, 0));
    device.press(b"r");
    let mut decoder = Decoder::new();
    let (mut channels, mut recoveries, mut marked) = (Vec::new(), 0, 0);
    let sent = run_until(&mut device, seconds + 4.0);
    for message in sent.into_iter().filter_map(|byte| decoder.push(byte)).filter_map(Received::message) {
        match message {
            Message::Channel(channel) => channels.push(channel),
            Message::Health(health) => (recoveries, marked) = (health.recoveries, health.marked),
            _ => {}
        }
    }
    assert_eq!(channels.len(), 8);
    Run { audit, longest_gap_s, recoveries, marked, restarts: device.restarts(), channels }
}

/// The largest shifts of N, B and K of gyros and accelerometers relative to the same sensor without the fault, in half-widths of their 95 %
/// bounds.
fn shifts(run: &Run, sound: &Run) -> [f64; 3] {
    std::array::from_fn(|term| {
        let shift = |(found, sound): (&ChannelMessage, &ChannelMessage)| {
            let (found, sound) = (found.coefficients.get(term)?, sound.coefficients.get(term)?);
            assert_eq!(found.term, sound.term);
            Some((found.value - sound.value) / ((sound.high - sound.low) / 2.0))
        };
        let larger = |most: f64, shift: f64| if shift.abs() > most.abs() { shift } else { most };
        let shifts: Vec<f64> = run.channels.iter().zip(&sound.channels).filter_map(shift).collect();
        assert_eq!(shifts.len(), 6);
        shifts.into_iter().fold(0.0, larger)
    })
}

/// The fraction of inverted data bits that plausibility and neighbouring samples cannot distinguish from noise. A bit changes a sample by a
/// power of two. A sample is used if it differs from the one before by less than seven times the rms difference of two samples and three
/// counts. The mean squared difference of two samples is that of the second differences of their sum at one sample.
fn undetectable_share(sound: &Run) -> f64 {
    let (mut undetectable, mut bits) = (0.0, 0);
    for channel in &sound.channels {
        let first = channel.octaves.first().expect("a curve");
        assert_eq!(first.n, 1);
        let rms = (first.sum as f64 / first.count as f64).sqrt();
        let (limit, noise) = (7.0 * rms + 3.0, Normal::new(0.0, rms).expect("noise"));
        let passes = |bit: i32| noise.cdf(limit - f64::from(1 << bit)) - noise.cdf(-limit - f64::from(1 << bit));
        let width = if channel.channel == TEMPERATURE.0 { TEMPERATURE.1 } else { 14 };
        undetectable += (0..width).map(passes).sum::<f64>();
        bits += width;
    }
    assert_eq!(bits, 110);
    undetectable / f64::from(bits)
}

/// Runs and prints the cells with the seeds `1..=seeds`, each for `seconds`, and checks the properties of their kind.
fn grid(cells: &[(LineFault, f64)], seeds: u64, seconds: f64) {
    for seed in 1..=seeds {
        let (sound, runs) = std::thread::scope(|scope| {
            let sound = scope.spawn(move || run(None, seconds, seed));
            let start = |&(fault, rate): &(LineFault, f64)| {
                scope.spawn(move || run(Some(RandomFault::new(fault, rate, 1000 + seed)), seconds, seed))
            };
            let threads: Vec<_> = cells.iter().map(start).collect();
            let runs = threads.into_iter().map(|thread| thread.join().expect("no panic"));
            (sound.join().expect("no panic"), runs.collect::<Vec<_>>())
        });
        // Without a fault no sample is refused: the gate's false alarms are 1e-11 of the samples.
        assert_eq!((sound.audit.wrong, sound.audit.needless, sound.recoveries), (0, 0, 0), "{:?}", sound.audit);
        let undetectable = undetectable_share(&sound);
        println!("seed {seed}: {undetectable:.3} of the inverted bits are within the noise");
        println!(
            "fault                     rate     words   wrong   used  worst gyro  refused right  longest gap  losses  shift of N       B       K"
        );
        for (&(fault, rate), run) in cells.iter().zip(&runs) {
            let (audit, [n, b, k]) = (&run.audit, shifts(run, &sound));
            println!(
                "{:<24} {rate:5.0e}  {:8}  {:6}  {:5}  {:10}  {:13}  {:9.3} s  {:6}  {n:10.2}  {b:6.2}  {k:6.2}",
                format!("{fault:?}"),
                audit.words,
                audit.wrong,
                audit.undetected,
                audit.worst_gyro,
                audit.needless,
                run.longest_gap_s,
                run.recoveries,
            );
            check(fault, rate, seconds, run, [n, b, k], undetectable);
        }
    }
}

/// No cell restarts the microcontroller or goes without samples for longer than two steps of recovery. None moves N, B and K out of their
/// bounds, except by the noise of a restarted sensor, or if bits are inverted so often that one burst in forty has an error. Repeated
/// bursts cannot be detected and change the noise itself; in units of the bounds, which shrink with the root of the time, this grows.
fn check(fault: LineFault, rate: f64, seconds: f64, run: &Run, shifts: [f64; 3], undetectable: f64) {
    assert_eq!(run.restarts, 0, "{fault:?} at {rate:e}");
    assert!(run.longest_gap_s < 2.5, "{fault:?} at {rate:e}: {} s", run.longest_gap_s);
    // A sensor that was reset has other noise than one that was not.
    if fault != Reset && (!fault.is_of_bits() || rate <= 1e-5) {
        let most = if fault == Repeated { (seconds / SHORT_S).sqrt() } else { 1.0 };
        assert!(shifts.iter().all(|shift| shift.abs() < most), "{fault:?} at {rate:e}: {shifts:?}");
    }
    // A lost frame, and a line that reads ones from some bit on, are detected each time.
    if matches!(fault, LostEdge | DoubledEdge | Failed | ShortSelect) {
        assert_eq!(run.audit.undetected, 0, "{fault:?} at {rate:e}");
    }
    if fault == AnswerBits && rate <= 1e-5 {
        let (used, wrong) = (run.audit.undetected as f64, run.audit.wrong as f64);
        // The tolerance is four standard deviations.
        let tolerance = 4.0 * (wrong * undetectable * (1.0 - undetectable)).sqrt();
        assert!((used - wrong * undetectable).abs() <= tolerance, "{used} of {wrong} used, {undetectable} expected");
    }
}

/// Every fault at each of the rates for its kind. A start takes a third of a second, so the supply dips in at most one burst of 10,000.
fn cells(bit_rates: &[f64], burst_rates: &[f64]) -> Vec<(LineFault, f64)> {
    let of = |fault: LineFault| {
        let rates = if fault.is_of_bits() { bit_rates } else { burst_rates };
        rates.iter().map(move |&rate| (fault, rate))
    };
    LineFault::ALL.into_iter().flat_map(of).filter(|&(fault, rate)| fault != Reset || rate <= 1e-4).collect()
}

#[test]
fn sixteen_minutes_with_each_fault() {
    grid(&cells(&[1e-6, 1e-5], &[1e-4, 1e-2]), 1, SHORT_S);
}

#[test]
#[ignore = "long: 150 simulated hours take minutes; run with --long"]
fn an_hour_with_each_fault() {
    grid(&cells(&[1e-7, 1e-6, 1e-5, 1e-4], &[1e-5, 1e-4, 1e-3, 1e-2]), 3, 3_600.0);
}

/// Lasting states that falsify no word: flags of DIAG_STAT that every sample sets again (weak supply, overload, flash memory, failed
/// self-test), a sensor without power or in reset for a second, and a USB port whose host does not read. All but the second and third last
/// for 110 s.
#[test]
fn a_lasting_state_costs_no_sample_that_the_sensor_delivers() {
    fn hold(device: &mut Device, flag: DiagnosisFlag, is_on: bool) {
        device.bus().part_mut().hold_flag(flag, is_on);
    }
    type Switch = fn(&mut Device, bool);
    const UNREAD: &str = "host does not read";
    const STATES: [(&str, f64, Switch); 8] = [
        ("nothing", 120.0, |_, _| {}),
        ("supply low flag", 120.0, |device, is_on| hold(device, DiagnosisFlag::SupplyLow, is_on)),
        ("over-range flag", 120.0, |device, is_on| hold(device, DiagnosisFlag::OverRange, is_on)),
        ("flash checksum flag", 120.0, |device, is_on| hold(device, DiagnosisFlag::FlashChecksum, is_on)),
        ("self-test flag", 120.0, |device, is_on| hold(device, DiagnosisFlag::SelfTest, is_on)),
        ("sensor without power", 11.1, |device, is_on| {
            if is_on {
                run_until(device, 10.1); // the gap begins after some samples
                device.bus().part_mut().power_off();
            } else {
                device.bus().part_mut().power_on();
            }
        }),
        ("sensor held in reset", 11.1, |device, is_on| {
            if is_on {
                run_until(device, 10.1);
            }
            device.bus().part_mut().drive_reset(!is_on);
        }),
        (UNREAD, 120.0, |_, _| {}),
    ];
    let runs: Vec<Run> = std::thread::scope(|scope| {
        let start = |&(name, end_s, switch): &(&'static str, f64, Switch)| {
            scope.spawn(move || {
                let device = device(1);
                run_with(if name == UNREAD { device.with_unread_usb() } else { device }, end_s, switch)
            })
        };
        let threads: Vec<_> = STATES.iter().map(start).collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    println!(
        "state                     words  marked  wrong  used  refused right  longest gap  losses  shift of N       B       K"
    );
    for ((name, end_s, _), run) in STATES.iter().zip(&runs) {
        let (audit, stops) = (&run.audit, *end_s < 12.0);
        // A restarted sensor has other noise, and a run of 15 s another curve.
        let shift = if stops { [0.0; 3] } else { shifts(run, &runs[0]) };
        println!(
            "{name:<22} {:8}  {:6}  {:5}  {:4}  {:13}  {:9.3} s  {:6}  {:10.2}  {:6.2}  {:6.2}",
            audit.words,
            run.marked,
            audit.wrong,
            audit.undetected,
            audit.needless,
            run.longest_gap_s,
            run.recoveries,
            shift[0],
            shift[1],
            shift[2]
        );
        // Each sample has the flag, also those between two reads of DIAG_STAT.
        assert_eq!(run.marked > 20_000, name.ends_with("flag"), "{name}: {} marked", run.marked);
        assert_eq!((run.restarts, audit.undetected), (0, 0), "{name}: {audit:?}");
        // The first bursts after a start are refused while the channels settle.
        assert!(audit.needless <= if stops { 8 * SETTLING } else { 0 }, "{name}: {audit:?}");
        assert!(shift.iter().all(|shift| shift.abs() < 0.01), "{name}: {shift:?}");
        // Start-up and configuration take 0.3 s, and the first steps of recovery 2 s.
        let longest_s = if stops { 1.0 + 2.5 } else { 0.1 };
        assert!(run.longest_gap_s < longest_s, "{name}: {} s", run.longest_gap_s);
    }
}

/// Bytes of the serial port are lost, or have an inverted bit. A byte between two frames belongs to both, so an error costs at most two
/// messages. No message arrives with other content: the checksum has 32 bits.
#[test]
fn damage_on_the_serial_port_costs_messages_and_falsifies_none() {
    let mut device = device(1);
    device.press(b"i 1\r");
    let sent = run_until(&mut device, 120.0);
    let decode = |bytes: &[u8]| -> Vec<(u16, Message)> {
        let mut decoder = Decoder::new();
        let message = |received| match received {
            Received::Message { sequence, message } => Some((sequence, message)),
            Received::Text(_) => None,
        };
        bytes.iter().filter_map(|&byte| decoder.push(byte)).filter_map(message).collect()
    };
    let messages = decode(&sent);
    assert!(
        messages.len() > 1_000 && messages.iter().enumerate().all(|(at, (sequence, _))| at == usize::from(*sequence))
    );
    println!("serial port      rate  bytes damaged  messages  received");
    for (loses, rate, seed) in
        [false, true].into_iter().flat_map(|loses| [(loses, 1e-5, 1), (loses, 1e-4, 2), (loses, 1e-3, 3)])
    {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (mut damaged, mut received) = (0, Vec::new());
        for &byte in &sent {
            let hit = random.random_bool(rate);
            damaged += usize::from(hit);
            match (hit, loses) {
                (false, _) => received.push(byte),
                (true, false) => received.push(byte ^ 1 << random.random_range(0..8)),
                (true, true) => {}
            }
        }
        let found = decode(&received);
        let kind = if loses { "lost bytes" } else { "inverted bits" };
        println!("{kind:<13} {rate:7.0e}  {damaged:13}  {:8}  {:8}", messages.len(), found.len());
        assert!(found.iter().all(|(sequence, message)| messages[usize::from(*sequence)].1 == *message));
        assert!(damaged > 0 && found.len() + 2 * damaged >= messages.len());
    }
}
