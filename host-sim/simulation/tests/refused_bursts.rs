//! The device at 819.2 samples a second with one refused burst per second, compared with the same sensor without
//! faults. The curves reach the same averaging time, and the coefficients agree.

use link::{ChannelMessage, Decoder, Message, Received, ReportedTerm};
use simulation::{Device, FaultEnd, FrameFault};
use virtual_sensor::{NoiseModel, VirtualAdis16405};

/// The channels of the device after `seconds` at 819.2 samples a second. With `refusals`, one burst every second has the second half of its
/// frames a clock early.
fn channels(seconds: u32, refusals: bool) -> Vec<ChannelMessage> {
    // The random walk hides flicker noise of longer times.
    let model = NoiseModel { longest_tau_s: 300.0, ..NoiseModel::paper() };
    let mut device = Device::new(VirtualAdis16405::new(model, 14), Device::blank_memory());
    device.press(b"i0\rf819.2\r");
    for second in 1..=seconds {
        device.run_until(u64::from(second) * 1_000_000);
        if refusals {
            device.faults().frames = Some((FrameFault::Shifted, FaultEnd::Bursts(1)));
        }
    }
    device.press(b"r");
    let sent = device.run_until(u64::from(seconds + 5) * 1_000_000);
    let mut decoder = Decoder::new();
    let received = sent.iter().filter_map(|&byte| decoder.push(byte));
    received
        .filter_map(|received| match received {
            Received::Message { message: Message::Channel(channel), .. } => Some(channel),
            _ => None,
        })
        .collect()
}

fn assert_curves_agree(seconds: u32) {
    let complete = std::thread::spawn(move || channels(seconds, false));
    let refused = channels(seconds, true);
    let complete = complete.join().expect("the sensor without faults");
    assert_eq!((refused.len(), complete.len()), (8, 8));
    for (refused, complete) in refused.iter().zip(&complete) {
        let longest = |channel: &ChannelMessage| channel.octaves.last().map(|octave| octave.n);
        assert_eq!(longest(refused), longest(complete), "{refused:?}");
        let missing = u64::from(seconds) - 10..=u64::from(seconds) + 10;
        assert!(missing.contains(&refused.missing) && missing.contains(&refused.replaced), "{refused:?}");
        assert_eq!(complete.replaced, 0);
        for (found, expected) in refused.coefficients.iter().zip(&complete.coefficients) {
            println!(
                "{:?}: {:.4e}, without faults {:.4e} ({:.4e} to {:.4e})",
                found.term, found.value, expected.value, expected.low, expected.high
            );
            assert_eq!(found.term, expected.term);
            if matches!(found.term, ReportedTerm::BiasInstability | ReportedTerm::RateRandomWalk) {
                assert!((expected.low..=expected.high).contains(&found.value), "{found:?}, {expected:?}");
            }
        }
    }
}

#[test]
fn a_refused_burst_every_second_changes_neither_the_longest_averaging_time_nor_the_coefficients() {
    assert_curves_agree(240);
}

#[test]
#[ignore = "long: a simulated hour at 819.2 samples a second takes minutes; run with --long"]
fn an_hour_with_a_refused_burst_every_second() {
    assert_curves_agree(3_600);
}
