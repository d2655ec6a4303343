//! The rate and the losses that coarse, late, drifting or repeated time stamps show, against a known truth.

use adis16405_driver::{Burst, Channel, Counts, GyroRange};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recordings::recording::{Recorder, Recording, TimeStamp};
use recordings::time_base::{StampQuality, time_base};

/// How a host stamps and loses the samples.
#[derive(Debug, Clone, Copy)]
struct Host {
    /// Samples that the part takes, and its rate by an exact clock, Hz.
    samples: u64,
    rate_hz: f64,
    /// A stamp is rounded down to a multiple of this, s; 0 for stamps that are not rounded.
    tick_s: f64,
    /// A read is late by 0 to this, uniform, s.
    jitter_s: f64,
    loss: f64,
    repeats: f64,
    /// Seconds between stalls, in which the samples of 20 to 60 periods queue up; 0 for none.
    stall_every_s: f64,
    /// Seconds between outages in which 5 to 200 samples are lost; 0 for none.
    outage_every_s: f64,
    /// The host's clock runs fast by this part of its time times a sine of 100 s.
    drift: f64,
}

const HOST: Host = Host {
    samples: 60_000,
    rate_hz: 819.2,
    tick_s: 0.001,
    jitter_s: 0.0,
    loss: 0.0,
    repeats: 0.0,
    stall_every_s: 0.0,
    outage_every_s: 0.0,
    drift: 0.0,
};

fn record(host: Host, seed: u64) -> (Recording, u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut recorder = Recorder::new(Channel::ALL.to_vec(), GyroRange::Dps300);
    let phase: f64 = rng.random();
    let every = |seconds: f64| (seconds * host.rate_hz) as u64;
    let (mut busy_until, mut last, mut outage_until, mut first, mut kept, mut newest) =
        (0.0f64, f64::MIN, 0, None, 0, 0);
    for sample in 0..host.samples {
        let taken = (sample as f64 + phase) / host.rate_hz;
        if host.outage_every_s > 0.0 && sample % every(host.outage_every_s) == every(host.outage_every_s) / 2 {
            outage_until = sample + rng.random_range(5..=200);
        }
        if host.stall_every_s > 0.0 && sample % every(host.stall_every_s) == every(host.stall_every_s) / 3 {
            busy_until = taken + rng.random_range(20.0..60.0) / host.rate_hz;
        }
        let (late, lost, again): (f64, f64, f64) = (rng.random(), rng.random(), rng.random());
        let differing: u64 = rng.random();
        let counts: [i16; 12] = std::array::from_fn(|channel| (differing >> (5 * channel) & 63) as i16 - 32);
        if lost < host.loss || sample < outage_until {
            continue;
        }
        let read = (taken + late * host.jitter_s).max(busy_until).max(last + 0.1 / host.rate_hz);
        last = read;
        let clock = read + host.drift * 100.0 / std::f64::consts::TAU * (read * std::f64::consts::TAU / 100.0).sin();
        let stamp = if host.tick_s > 0.0 { (clock / host.tick_s).floor() * host.tick_s } else { clock };
        let mut counts = counts;
        counts[Channel::Supply as usize] = 2068;
        counts[Channel::AuxAdc as usize] = 0;
        let copies = if again < host.repeats { 2 } else { 1 };
        for _ in 0..copies {
            recorder.push(TimeStamp::from_time(stamp), &Burst::from_counts(&Counts::new(counts)));
        }
        first.get_or_insert(sample);
        (kept, newest) = (kept + 1, sample);
    }
    (recorder.finish(), newest - first.expect("a sample") + 1 - kept)
}

struct Found {
    rate_hz: f64,
    quality: StampQuality,
    lost: u64,
    repeated: u64,
}

fn examine(recording: &Recording) -> Found {
    let base = time_base(recording, None).expect("a time base");
    let measured = base.measurement;
    let dropped = |cause| measured.dropped.get(cause).copied().unwrap_or(0);
    Found {
        rate_hz: measured.sample_rate_hz,
        quality: base.stamps.expect("stamps"),
        lost: dropped("gap"),
        repeated: dropped("repeated"),
    }
}

/// Checks the rate against its interval and returns the relative error of the rate and the losses found and true.
fn check(host: Host, seed: u64) -> (f64, u64, u64) {
    let (recording, lost) = record(host, seed);
    let found = examine(&recording);
    let error = found.rate_hz / host.rate_hz - 1.0;
    let rate = found.quality.rate.expect("a rate");
    assert!(
        (rate.low_hz..=rate.high_hz).contains(&host.rate_hz),
        "{host:?}, seed {seed}: {rate:?}, {} of {lost} lost",
        found.lost
    );
    (error, found.lost, lost)
}

#[test]
fn millisecond_stamps_of_819_2_hz_show_the_rate_and_no_loss() {
    for seed in 0..5 {
        let (error, found, lost) = check(Host { samples: 20_000, ..HOST }, seed);
        assert_eq!((found, lost), (0, 0));
        assert!(error.abs() < 2e-6, "{error}");
    }
}

#[test]
fn complete_records_of_any_rate_and_tick_show_no_loss() {
    for rate_hz in [50.0, 99.7, 204.8, 512.3, 700.0, 819.2, 950.0, 2000.0] {
        for periods in [0.1, 0.37, 0.7, 0.93, 1.22, 1.5, 2.45, 4.1, 8.19, 20.3] {
            for jitter in [0.0, 0.2] {
                let host = Host { rate_hz, tick_s: periods / rate_hz, jitter_s: jitter / rate_hz, ..HOST };
                let (error, found, lost) = check(host, 1);
                assert_eq!((found, lost), (0, 0), "{host:?}");
                assert!(error.abs() < 1e-5, "{host:?}: {error}");
            }
        }
    }
}

#[test]
fn usual_ticks_show_no_loss() {
    for rate_hz in [50.0, 100.0, 200.0, 400.0, 700.0, 750.0, 800.0, 819.2, 900.0, 950.0, 1000.0, 1600.0, 2000.0] {
        for tick_s in [1e-6, 1e-4, 1e-3, 1.0 / 128.0, 0.01] {
            let host = Host { rate_hz: rate_hz * 1.000_05, tick_s, samples: 120_000, ..HOST };
            let (error, found, lost) = check(host, 2);
            assert_eq!((found, lost), (0, 0), "{host:?}");
            assert!(error.abs() < 1e-5, "{host:?}: {error}");
        }
    }
}

/// Ten or more ticks between losses find all but a few in a hundred; fewer are reported as not told apart.
#[test]
fn losses_are_found_and_none_is_invented() {
    for rate_hz in [50.0, 819.2] {
        for periods in [0.0, 0.1, 0.37, 0.7, 1.22, 2.45, 4.1, 8.19, 20.3] {
            for loss in [0.0005, 0.005, 0.02, 0.05] {
                let host = Host { rate_hz, tick_s: periods / rate_hz, jitter_s: 0.1 / rate_hz, loss, ..HOST };
                let (recording, lost) = record(host, 3);
                let found = examine(&recording);
                let rate = found.quality.rate.expect("a rate");
                let context = format!("{host:?}: {rate:?}, {} of {lost} lost", found.lost);
                assert!((rate.low_hz..=rate.high_hz).contains(&rate_hz), "{context}");
                let error = (found.rate_hz / rate_hz - 1.0).abs();
                let off = found.lost.abs_diff(lost);
                if periods < 0.6 {
                    assert!(off == 0 && error < 1e-6 && found.quality.resolved, "{context}");
                } else if periods * loss < 0.03 {
                    assert!(off <= 1 + lost / 50 && error < 5e-4 && found.quality.resolved, "{context}");
                } else if periods * loss < 0.11 {
                    assert!(off <= 3 + lost / 8 && error < 3e-3, "{context}");
                } else {
                    assert!(!found.quality.resolved, "{context}");
                }
            }
        }
    }
}

#[test]
fn bursts_stalls_repeats_and_a_drifting_clock_are_told_apart() {
    for periods in [0.0, 0.1, 0.82, 1.22, 4.1, 8.19, 20.3] {
        let host = Host { tick_s: periods / HOST.rate_hz, jitter_s: 0.1 / HOST.rate_hz, ..HOST };
        for (name, host) in [
            ("outages", Host { outage_every_s: 7.0, ..host }),
            ("stalls", Host { stall_every_s: 3.0, ..host }),
            ("repeats", Host { repeats: 0.003, ..host }),
            ("drift", Host { drift: 1e-4, samples: 200_000, ..host }),
            (
                "all",
                Host { outage_every_s: 7.0, stall_every_s: 3.0, repeats: 0.001, loss: 0.0005, drift: 1e-4, ..host },
            ),
        ] {
            let (recording, lost) = record(host, 4);
            let rows = recording.samples.len() as u64;
            let repeats = rows - (host.samples - lost);
            let found = examine(&recording);
            let context =
                format!("{name}, {periods}: {} of {lost} lost, {} of {repeats} repeats", found.lost, found.repeated);
            let off = match (periods < 1.0, name) {
                (true, _) => 0,
                (false, "all") => 8,
                (false, _) => 1,
            };
            assert!(found.lost.abs_diff(lost) <= off && found.repeated.abs_diff(repeats) <= off, "{context}");
            let error = found.rate_hz / host.rate_hz - 1.0;
            assert!(error.abs() < if name == "all" { 3e-4 } else { 1e-5 }, "{context}: {error}");
            let stalls = if host.stall_every_s > 0.0 { 500 } else { 0 };
            assert!(found.quality.late >= stalls, "{context}: {} late", found.quality.late);
            if host.stall_every_s == 0.0 {
                assert_eq!(found.quality.late, 0, "{context}");
            }
        }
    }
}

/// A logger that writes the time with so many decimals, in s, and loses 2 % or, with `few`, three samples.
fn logged(rate_hz: f64, decimals: usize, few: bool) -> Vec<f64> {
    let mut state = 1_u64;
    let mut lost = |at: usize| {
        state = state * 16_807 % 2_147_483_647;
        if few { [5_000, 21_000, 22_500].contains(&at) } else { at > 0 && state.is_multiple_of(50) }
    };
    let written = |at: usize| format!("{:.decimals$}", at as f64 / rate_hz).parse().expect("a number");
    (0..30_000).filter(|&at| !lost(at)).map(written).collect()
}

#[test]
fn losses_between_exact_time_stamps_are_certain() {
    // Scattered losses are not rounding; nor are few ones where the last decimal shows that stamps are finer.
    for (rate_hz, decimals, few) in
        [(204.8, 6, false), (200.0, 6, false), (100.0, 2, false), (204.8, 6, true), (819.2, 9, true)]
    {
        let times = logged(rate_hz, decimals, few);
        let mut recorder = Recorder::new(Channel::ALL.to_vec(), GyroRange::Dps300);
        for (at, &time) in times.iter().enumerate() {
            let mut counts = [(at % 100) as i16; 12];
            counts[Channel::Supply as usize] = 2068;
            recorder.push(TimeStamp::from_time(time), &Burst::from_counts(&Counts::new(counts)));
        }
        let base = time_base(&recorder.finish(), None).expect("a time base");
        let stamps = base.stamps.expect("time stamps");
        let lost: u64 = stamps.losses.iter().map(|loss| loss.missing).sum();
        assert_eq!(times.len() as u64 + lost, 30_000, "{rate_hz} Hz");
        assert_eq!(stamps.uncertain, 0, "{rate_hz} Hz, {decimals} decimals");
    }
}

#[test]
fn losses_that_lie_within_a_tick_of_each_other_widen_the_interval_of_the_rate() {
    for periods in [1.22, 2.45] {
        for loss in [0.05, 0.1] {
            for seed in 0..4 {
                let tick_s = periods / HOST.rate_hz;
                check(Host { tick_s, jitter_s: 0.1 / HOST.rate_hz, loss, ..HOST }, seed);
            }
        }
    }
}
