//! A self-test displaces the outputs (data sheet Rev. B, page 15), and the sensor's filter contains the displacement for 2N samples (Fig.
//! 15). Compared are the curve with these samples, the curve without them as the device reports it, and that of an untested part.

use adis16405_driver::{Channel, Config, GyroRange, OutputWord, SamplePeriod};
use allan_core::Curve;
use firmware::{ChannelEstimator, ChannelSums, OCTAVES, ReportScale};
use link::{ChannelMessage, Decoder, Message, RawMessage, Received};
use simulation::Device;
use virtual_sensor::{NoiseModel, VirtualAdis16405};

const RATE_HZ: f64 = 819.2;
const SECONDS: u64 = 200;
const CHECK_EVERY_S: u64 = 10;
const SECOND: u64 = 1_000_000;

/// Output of a device with a filter of 2^`taps_log2` taps a stage after [`SECONDS`]: raw bursts, and the last report of
/// gyro x.
fn run(taps_log2: u8, tested: bool) -> (Vec<RawMessage>, ChannelMessage) {
    let part = VirtualAdis16405::new(NoiseModel::paper(), 3);
    let mut device = Device::new(part, Device::blank_memory());
    device.press(format!("i 0\rf {RATE_HZ}\rn {taps_log2}\rw 1\r").as_bytes());
    let mut sent = Vec::new();
    for at_s in (CHECK_EVERY_S..SECONDS).step_by(CHECK_EVERY_S as usize) {
        sent.extend(device.run_until(at_s * SECOND));
        device.press(if tested { b"check\r" } else { b"" });
    }
    sent.extend(device.run_until(SECONDS * SECOND));
    device.press(b"w 0\rr");
    sent.extend(device.run_until((SECONDS + 1) * SECOND));
    assert_eq!(device.bus().part().violations(), []);
    let (mut decoder, mut raws, mut reports, mut passed) = (Decoder::new(), vec![], vec![], 0);
    for received in sent.into_iter().filter_map(|byte| decoder.push(byte)) {
        match received {
            Received::Message { message: Message::Raw(raw), .. } => raws.push(raw),
            Received::Message { message: Message::Channel(report), .. } if report.channel == 1 => reports.push(report),
            Received::Message { message: Message::Health(health), .. } => assert_eq!(health.raw_dropped, 0),
            Received::Message { message: Message::Log(log), .. } => passed += u64::from(log.contains("check: passed")),
            _ => {}
        }
    }
    assert_eq!((decoder.counters().missing, decoder.counters().bad_frames), (0, 0));
    assert_eq!(passed, if tested { (SECONDS - 1) / CHECK_EVERY_S } else { 0 });
    let [report] = &reports[..] else { panic!("{} reports", reports.len()) };
    (raws, report.clone())
}

/// The curve of gyro x over every burst of a raw stream, including those in which the filter contains the displacement.
fn with_all_samples(raws: &[RawMessage], scale: ReportScale) -> Curve<OCTAVES> {
    let mut estimator = Box::new(ChannelEstimator::new());
    let mut next = None;
    for raw in raws {
        let mut at = raw.first;
        for burst in &raw.bursts {
            at += u64::from(burst.periods);
            estimator.gap((at - next.unwrap_or(at)) as u32);
            estimator.push(i32::from(
                OutputWord(u16::from_be_bytes(burst.words[Channel::GyroX as usize])).counts(Channel::GyroX),
            ));
            next = Some(at + 1);
        }
    }
    ChannelSums::from_estimator(&estimator).curve(Channel::GyroX, scale)
}

/// The Allan deviation of a report at averaging factor `n`, and the number of its differences.
fn reported(report: &ChannelMessage, n: u64, scale: ReportScale) -> (f64, f64) {
    let octave = report.octaves.iter().find(|octave| octave.n == n).expect("an octave");
    let mean = octave.sum as f64 / (2.0 * (n * n) as f64 * octave.count as f64);
    ((mean - f64::from(octave.interpolation)).sqrt() * scale.lsb(Channel::GyroX), octave.count as f64)
}

/// With the gap the curve is that of an untested part, within four standard errors of the ratio of two independent estimates. With the
/// displaced samples it is several times as high at averaging times of the filter's length.
#[test]
fn the_filter_mixes_a_self_test_into_the_curve_unless_its_samples_are_a_gap() {
    for taps_log2 in [4, 6] {
        let config = Config::new(GyroRange::Dps300, taps_log2, SamplePeriod::nearest(RATE_HZ).unwrap()).unwrap();
        let scale = ReportScale::new(config, None);
        let ((raws, report), (_, untested)) = (run(taps_log2, true), run(taps_log2, false));
        let before = with_all_samples(&raws, scale);
        println!("{} taps a stage, a self-test every {CHECK_EVERY_S} s: gyro x, deg/s", 1 << taps_log2);
        println!("| tau, s | with the mixed samples | as reported | without self-tests |");
        println!("|---|---|---|---|");
        let mut worst: f64 = 0.0;
        for n in (0..15).map(|octave| 1 << octave) {
            let all = before.points().iter().find(|point| point.n == n).expect("an octave").avar.sqrt();
            let ((gap, differences), (truth, _)) = (reported(&report, n, scale), reported(&untested, n, scale));
            println!("| {:.4} | {all:.4} | {gap:.4} | {truth:.4} |", n as f64 / RATE_HZ);
            // Differences overlap for 2n samples, and samples behind the filter are correlated over 2N.
            let independent = differences / (2 * n.max(2 << taps_log2)) as f64;
            let bound = 4.0 * (1.0 / independent).sqrt();
            assert!((gap / truth - 1.0).abs() < bound, "{n}: {gap}, {truth} within {bound}");
            worst = worst.max(all / truth);
        }
        println!("at worst {worst:.1} times as high");
        // The delay of one sample contains the displacement at N = 1 too.
        assert!(worst > 3.0, "{worst}");
    }
}
