//! Damaged bursts on their way into the statistics, a table of faults and rates: how many words arrive wrong, how many of them are used
//! all the same, how many sound ones are refused with them, and what that does to N.

use adis16405_driver::{BURST_BYTES, Burst, Config, Counts, GyroRange, SamplePeriod};
use firmware::{CHANNELS, ChannelSums, Estimators, Statistics, TimedBurst};

const RATE_HZ: f64 = 204.8;
const PERIOD_US: f64 = 1e6 / RATE_HZ;
/// 16 minutes.
const SAMPLES: u32 = 200_000;
const BURST_BITS: usize = 8 * BURST_BYTES;
/// Samples until the sensor is probed after the statistics have called it suspect: a second.
const PROBE_AFTER: u32 = 205;
/// Noise of the published characterisation in counts, gyros and accelerometers: 0.0368 °/√s·√(204.8 Hz) in 0.05 °/s, 0.34 mg/√Hz in
/// 3.33 mg.
const NOISE: [f64; 2] = [10.5, 1.46];

/// Uniform and normal numbers (Knuth's MMIX generator).
struct Random(u64);

impl Random {
    /// Between 0 and 1.
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    fn below(&mut self, end: usize) -> usize {
        (self.uniform() * end as f64) as usize
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// What happens to a burst.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    None,
    /// Single bits are flipped, each with this probability.
    Flips(f64),
    /// A run of 2 to 16 bits is inverted.
    FlippedRun,
    /// From a bit on the data line is low or high.
    StuckFrom(bool),
    /// A clock is missing, or there is one too many: from a bit on all come one early or late.
    MissingClock,
    ExtraClock,
    /// The burst before is sent again.
    Repeated,
    /// Its transfer fails, or its data-ready edge does not come.
    Failed,
    LostEdge,
}

fn bit(bytes: &[u8; BURST_BYTES], index: usize) -> bool {
    bytes[index / 8] << (index % 8) & 0x80 != 0
}

fn set_bit(bytes: &mut [u8; BURST_BYTES], index: usize, value: bool) {
    let mask = 0x80 >> (index % 8);
    bytes[index / 8] = if value { bytes[index / 8] | mask } else { bytes[index / 8] & !mask };
}

impl Fault {
    /// The bytes that arrive in the place of `sent`.
    fn damage(self, sent: [u8; BURST_BYTES], before: [u8; BURST_BYTES], random: &mut Random) -> [u8; BURST_BYTES] {
        let (mut bytes, from) = (sent, random.below(BURST_BITS));
        match self {
            Self::None | Self::Failed | Self::LostEdge => {}
            Self::Flips(_) => set_bit(&mut bytes, from, !bit(&sent, from)),
            Self::FlippedRun => {
                let length = 2 + random.below(15);
                (from..BURST_BITS.min(from + length)).for_each(|index| set_bit(&mut bytes, index, !bit(&sent, index)));
            }
            Self::StuckFrom(high) => (from..BURST_BITS).for_each(|index| set_bit(&mut bytes, index, high)),
            Self::MissingClock => (from..BURST_BITS)
                .for_each(|index| set_bit(&mut bytes, index, index + 1 < BURST_BITS && bit(&sent, index + 1))),
            Self::ExtraClock => {
                (from.max(1)..BURST_BITS).for_each(|index| set_bit(&mut bytes, index, bit(&sent, index - 1)));
            }
            Self::Repeated => bytes = before,
        }
        bytes
    }
}

/// What became of a fault in some share of the bursts.
#[derive(Debug, Default)]
struct Cell {
    /// Words of the estimated channels that were sent.
    words: u64,
    /// Of them, those that arrived with another count.
    wrong: u64,
    /// Wrong, and used.
    undetected: u64,
    /// Largest difference of such a gyro word from what was sent, in counts.
    worst: i32,
    /// Right, and refused.
    needless: u64,
    /// Most samples in a row of which none was used.
    longest_gap: u32,
    /// Probes of the sensor.
    probes: u32,
    /// N of the gyros with its bounds, deg/√s.
    random_walk: Vec<(f64, f64, f64)>,
}

/// Runs a fault that meets `share` of the bursts.
fn run(fault: Fault, share: f64, seed: u64) -> Cell {
    let config = Config::new(GyroRange::Dps300, 0, SamplePeriod::nearest(RATE_HZ).expect("a rate")).expect("valid");
    let mut statistics = Statistics::new();
    let mut estimators = Estimators::new(&mut statistics, config);
    let (mut noise, mut random) = (Random(seed), Random(seed + 1000));
    let (mut cell, mut before, mut suspect_for, mut gap) = (Cell::default(), [0; BURST_BYTES], 0, 0);
    estimators.mark_probed(0);
    for period in 0..SAMPLES {
        let mut counts = [2068, 0, 0, 0, 0, 0, 300, 100, -200, 300, 0, 500];
        for (index, count) in counts[1..7].iter_mut().enumerate() {
            *count += (NOISE[index / 3] * noise.normal()).round() as i16;
        }
        let sent = Burst::from_counts(&Counts::new(counts)).to_bytes();
        let met = random.uniform() < share;
        let arrived = if met { fault.damage(sent, before, &mut random) } else { sent };
        before = sent;
        if met && fault == Fault::LostEdge {
            continue;
        }
        let burst = (!(met && fault == Fault::Failed)).then(|| Burst::from_bytes(&arrived));
        let lengths = |estimators: &Estimators<'_>| {
            std::array::from_fn::<u64, { CHANNELS.len() }, _>(|index| estimators.channel(index).map_or(0, |e| e.len()))
        };
        let lengths_before = lengths(&estimators);
        let at_us = (f64::from(period) * PERIOD_US) as u64;
        estimators.process(TimedBurst { at_us, dropped: 0, burst }, 0);
        if estimators.health().bursts == 0 {
            continue; // the sensor settles, and the gate learns the noise
        }
        let used: Vec<bool> = lengths(&estimators).iter().zip(lengths_before).map(|(now, then)| *now > then).collect();
        let (right, found) = (Burst::from_bytes(&sent).counts(), Burst::from_bytes(&arrived).counts());
        for (channel, &used) in CHANNELS.iter().zip(&used) {
            let error = i32::from(found.get(*channel)) - i32::from(right.get(*channel));
            cell.words += 1;
            cell.wrong += u64::from(error != 0);
            cell.undetected += u64::from(error != 0 && used);
            cell.needless += u64::from(error == 0 && !used);
            if used && *channel as usize <= 3 {
                cell.worst = cell.worst.max(error.abs());
            }
        }
        gap = if used.contains(&true) { 0 } else { gap + 1 };
        cell.longest_gap = cell.longest_gap.max(gap);
        suspect_for = if estimators.is_suspect() { suspect_for + 1 } else { 0 };
        if suspect_for == PROBE_AFTER {
            estimators.mark_probed(at_us + 1);
            cell.probes += 1;
        }
    }
    cell.random_walk = (0..3)
        .map(|index| {
            let sums = ChannelSums::from_estimator(estimators.channel(index).expect("a gyro"));
            let n = sums.fit_baseline(CHANNELS[index], estimators.scale()).terms()[0];
            (n.value, n.low, n.high)
        })
        .collect();
    cell
}

/// The largest shift of N of a gyro against the same noise without the fault, in half-widths of its 95 % bounds.
fn shift(cell: &Cell, sound: &Cell) -> f64 {
    let shift =
        |((n, _, _), (truth, low, high)): (&(f64, f64, f64), &(f64, f64, f64))| (n - truth) / ((high - low) / 2.0);
    cell.random_walk
        .iter()
        .zip(&sound.random_walk)
        .map(shift)
        .fold(0.0, |most, shift| if shift.abs() > f64::abs(most) { shift } else { most })
}

/// With a bit error rate of 10⁻⁵, and with any fault in 1 % of the bursts, N stays within its bounds; no fault ends the sampling.
#[test]
fn damaged_bursts_are_refused_or_small() {
    let flips = |rate: f64| (Fault::Flips(rate), 1.0 - (1.0 - rate).powi(BURST_BITS as i32));
    let of_bursts = |fault| [(fault, 1e-4), (fault, 1e-2)];
    let cells = [flips(1e-6), flips(1e-5), flips(1e-4)].into_iter().chain(
        [
            Fault::FlippedRun,
            Fault::StuckFrom(false),
            Fault::StuckFrom(true),
            Fault::MissingClock,
            Fault::ExtraClock,
            Fault::Repeated,
            Fault::Failed,
            Fault::LostEdge,
        ]
        .into_iter()
        .flat_map(of_bursts),
    );
    println!(
        "fault               bursts      words   wrong  undetected  worst gyro  refused right  longest gap  probes  shift of N"
    );
    for (fault, share) in cells {
        for seed in [1, 2] {
            let (cell, sound) = (run(fault, share, seed), run(Fault::None, 0.0, seed));
            let shift = shift(&cell, &sound);
            println!(
                "{:<18} {share:7.1e}  {:9}  {:6}  {:10}  {:10}  {:13}  {:11}  {:6}  {shift:10.2}",
                format!("{fault:?}"),
                cell.words,
                cell.wrong,
                cell.undetected,
                cell.worst,
                cell.needless,
                cell.longest_gap,
                cell.probes
            );
            // Without damage nothing is refused but what follows a refused sample: the gate's false alarms are 1e-11 of the samples.
            assert_eq!((sound.wrong, sound.needless, sound.probes), (0, 0, 0));
            // Flips at 10⁻⁴ add 0.5 counts² to a variance of 110, a quarter per cent of N, below the limit of the gate.
            let asked = share <= 1e-2;
            assert!(!asked || shift.abs() < 1.0, "{fault:?} in {share:.1e}: N shifted by {shift} half-widths");
            // Of the flips of data bits the gate lets through those by less than its limit, seven times the rms difference of two samples
            // and three counts: by 2^0 to 2^6 of 14 bits in a gyro, to 2^4 in an accelerometer, and 2^0 and 2^1 in the supply and in the
            // 12 bits of the temperature, whose counts are constant here: 40 of 110. Four standard deviations.
            if fault == flips(1e-5).0 {
                let (passed, wrong) = (cell.undetected as f64, cell.wrong as f64);
                let expected = 40.0 / 110.0;
                let deviation = (wrong * expected * (1.0 - expected)).sqrt();
                assert!((passed - wrong * expected).abs() < 4.0 * deviation, "{cell:?}");
            }
            assert!(cell.probes == 0 && cell.longest_gap < 16, "{cell:?}");
        }
    }
}
