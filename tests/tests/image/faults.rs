//! What can happen to a device in the field: each fault is recovered from and counted.

use crate::bench::{Event, Outcome, Scenario, run};
use crate::decoded::Decoded;
use crate::{image, sensor};
use link::Message;

/// The rate is set after half a second, which takes 50 ms.
const CONFIGURED_S: f64 = 0.55;

/// Bytes from a linear congruential generator (Knuth's MMIX constants): noise on the line.
fn noise(count: usize) -> Vec<u8> {
    let mut state = 1_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    };
    (0..count).map(|_| next()).collect()
}

#[test]
fn every_fault_is_recovered_from_and_counted() {
    recovers_from_everything(204.8, 3);
}

#[test]
fn every_fault_is_recovered_from_and_counted_at_full_speed() {
    recovers_from_everything(819.2, 8);
}

fn recovers_from_everything(rate_hz: f64, seed: u64) {
    let report = |at: f64| (at, b"\rr".to_vec());
    let mut keys: Vec<(f64, Vec<u8>)> = vec![(0.5, format!("i 0\rf {rate_hz}\r").into_bytes())];
    keys.extend([1.5, 6.0, 8.5, 11.0, 12.8, 17.5].map(report));
    keys.push((19.0, noise(20_000)));
    keys.push(report(20.5));
    let events = vec![
        (3.5, Event::PartReset),
        (8.0, Event::Stuck(Some(0x00))),
        (8.3, Event::Stuck(None)),
        (10.5, Event::Stuck(Some(0xFF))),
        (10.8, Event::Stuck(None)),
        (12.5, Event::LoseEdges(3)),
        (14.5, Event::Unplugged(true)),
        (15.7, Event::Unplugged(false)),
    ];
    let scenario = Scenario { sensor: Some(sensor(seed)), keys, events, seconds: 24.0 };
    let Outcome { sensor, received, complaints, .. } = run(image(), scenario);
    assert_eq!(complaints, [""; 0], "no reset, no access that is none");
    let sensor = sensor.expect("a sensor");
    let decoded = Decoded::of(&received);
    assert_eq!(decoded.counters.missing, 0);
    let healths = decoded.healths();
    let logs = decoded.logs();
    println!("{logs:#?}");
    let [quiet, reset, low, high, lost, unplugged, .., flood] = healths[..] else { panic!("{healths:?}") };
    let clean = |health: &link::Health| (health.lost_edges, health.unchecked, health.recoveries);
    assert_eq!(clean(quiet), (0, 0, 0));

    // The part was reset: 100 ms of silence at least; it was configured again before its samples were used.
    assert_eq!(reset.recoveries, 1);
    assert!(f64::from(reset.lost_edges) >= 0.1 * rate_hz, "{reset:?}");
    assert_eq!(reset.used, reset.bursts);

    // Stuck: 16 bursts raise the alarm, then the sensor is sought until it answers.
    assert_eq!((low.stuck_low, low.recoveries), (16, 2), "{low:?}");
    assert_eq!((high.stuck_high, high.recoveries), (16, 3), "{high:?}");
    assert!(logs.iter().any(|log| log.contains("PROD_ID answered 0 ")) && logs.iter().any(|log| log.contains("65535")));

    // Three lost edges are a gap of three samples and nothing else.
    assert_eq!((lost.lost_edges - high.lost_edges, lost.recoveries), (3, 3), "{lost:?}");

    // Unplugged for 1.2 s.
    assert_eq!(unplugged.recoveries, 4);
    assert!(f64::from(unplugged.lost_edges - lost.lost_edges) >= 1.2 * rate_hz - 1.0, "{unplugged:?}");

    // A flood of noise costs no sample and changes no setting; lost bytes and what was no command are counted.
    assert_eq!(flood.lost_edges, unplugged.lost_edges, "{flood:?}");
    assert!(flood.bad_commands > unplugged.bad_commands);
    assert_eq!(decoded.hellos().iter().filter(|hello| hello.sample_rate_hz != rate_hz).count(), 0);
    assert_eq!(flood.queue_full, 0);

    // Every period since sampling began is accounted for. The counters end the report that the time begins, two seconds
    // later at most: the noise asks for tables too.
    let health_at = decoded.messages.iter().rposition(|message| matches!(message, Message::Health(_)));
    let before = &decoded.messages[..health_at.expect("a report")];
    let begun =
        before.iter().rev().find_map(|message| if let Message::Hello(hello) = message { Some(hello) } else { None });
    let periods = (begun.expect("a report begins").uptime_us as f64 * 1e-6 - CONFIGURED_S) * rate_hz;
    let accounted = f64::from(flood.bursts + flood.lost_edges + flood.unchecked);
    assert!(
        (periods - 0.07 * rate_hz..periods + 2.0 * rate_hz).contains(&accounted),
        "{accounted} of {periods}: {flood:?}"
    );
    assert!(sensor.bursts.len() as u32 >= flood.bursts);
}
