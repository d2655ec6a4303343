//! A warm reset: settings and statistics go on where they were kept last.

use crate::bench::{Event, Outcome, Scenario, run};
use crate::decoded::{Decoded, in_stretches};
use crate::{image, sensor};
use link::BootCause;

const RESET_S: f64 = 4.0;

#[test]
fn a_reset_costs_a_second_of_statistics_and_no_more() {
    let keys = vec![(0.5, b"i 0\re 3600\r".to_vec()), (3.9, b"r".to_vec()), (6.0, b"r".to_vec())];
    let events = vec![(RESET_S, Event::ResetPin)];
    let scenario = Scenario { sensor: Some(sensor(4)), keys, events, seconds: 8.0 };
    let Outcome { sensor, received, complaints, .. } = run(image(), scenario);
    assert!(complaints.iter().all(|complaint| complaint.starts_with("reset")), "{complaints:?}");
    let sensor = sensor.expect("a sensor");
    let decoded = Decoded::of(&received);
    let hello = decoded.hellos()[decoded.hellos().len() - 1].clone();
    assert_eq!((hello.boot.cause, hello.boot.starts, hello.boot.restored_channels), (BootCause::Pin, 2, 8));
    assert_eq!(hello.epoch_s, 3600, "settings are kept");

    // The statistics are those of the first stretch, up to where they were kept, and of the second one.
    let restarted = sensor.bursts.windows(2).rposition(|pair| pair[1].0 != pair[0].0 + 1).expect("a gap") + 1;
    let (before, after) = sensor.bursts.split_at(restarted);
    let used = decoded.healths()[decoded.healths().len() - 1].used as usize;
    let channels = decoded.channels();
    for report in &channels[channels.len() - 8..] {
        // The report is made channel by channel while samples come: some of the second stretch's last may be missing.
        let kept = (0..used).map(|fewer| report.samples as usize - (used - fewer)).find(|&kept| {
            let stretches = [&before[..kept.min(before.len())], after];
            kept <= before.len() && in_stretches(&stretches, 204.8, report).octaves == report.octaves
        });
        let kept = kept.expect("the sums of two stretches");
        assert!((before.len() - kept) as f64 <= 1.2 * 204.8, "{kept} of {} samples kept", before.len());
        println!("channel {}: {kept} of {} samples kept over the reset", report.channel, before.len());
    }
}
