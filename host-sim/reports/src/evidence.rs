//! The evidence of an effect in words: measured value, threshold, usual causes.

use crate::formatting::enumerated;
use crate::rounding::{probability, quantity_digits, significant};
use noise_analysis::effects::{
    BandMismatch, ClockDeviation, CurveEvidence, Effect, LineEvidence, LineSource, LinearDriftEvidence, LowPassDesign,
    MarkovEvidence, ModulatedLine, ModulationEvidence, MotionScale, Multiples, Observation, OutputFilter, Refutation,
    TelegraphEvidence, Unexplained,
};
use noise_analysis::report::Finding;

/// A sentence on the evidence of an effect: measured value, threshold, usual causes.
pub(crate) fn of_effect(effect: &Effect) -> String {
    displayed(of_kind(effect))
}

/// The evidence in the channel that shows a finding most clearly.
pub(crate) fn of_finding(finding: &Finding) -> String {
    let evidence = of_kind(&finding.effect);
    match finding.channels.len() {
        0 | 1 => displayed(evidence),
        count => {
            displayed(format!("{}: {evidence}; one cause in {count} channels", finding.channels[finding.clearest]))
        }
    }
}

/// A time in s with three decimals, below 0.1 s with four.
fn seconds(tau: f64) -> String {
    if tau < 0.1 { format!("{tau:.4}") } else { format!("{tau:.3}") }
}

fn excess(curve: &CurveEvidence) -> String {
    format!("{:+.1} % at τ = {} s ({:.0} σ)", 100.0 * curve.excess, seconds(curve.tau_s), curve.sigmas.abs())
}

/// A term that was added, with its usual cause.
fn added(curve: &CurveEvidence, meaning: &str) -> String {
    let gain = curve.gain_sigmas;
    format!("{} before it was added, which takes {gain:.0} σ off the fit; {meaning}", excess(curve))
}

fn counted(count: u64, one: &str) -> String {
    format!("{count} {one}{}", if count == 1 { "" } else { "s" })
}

/// Names and signs of the evidence, and of screen and page.
const DISPLAYED: [(&str, &str); 4] = [("gyro_", "gyro "), ("accl_", "accel "), ("magn_", "magn "), (" -", " −")];

/// Usual cause of a Markov process.
const CORRELATED: &str = "a correlated fluctuation: thermal or electronic";

/// Likelihood ratio from which no number is given.
const MILLION: f64 = 1e6;

fn chance(p_value: f64) -> String {
    probability(p_value).replace('<', "below")
}

/// Likelihood ratio exp(`gain`).
fn likelier(gain: f64) -> String {
    if gain > MILLION.ln() { "more than a million".to_owned() } else { significant(gain.exp(), 2) }
}

fn displayed(text: String) -> String {
    let text = text.strip_prefix('-').map_or_else(|| text.clone(), |number| format!("−{number}"));
    DISPLAYED.iter().fold(text, |text, (name, shown)| text.replace(name, shown))
}

fn amount(value: f64, unit: &str) -> String {
    quantity_digits(value, unit, 3)
}

fn of_kind(effect: &Effect) -> String {
    match effect {
        Effect::OutputFilter(of) => added(&of.evidence, &filter_meaning(of)),
        Effect::LowPassFilter(of) => match of.design {
            LowPassDesign::OneStage { time_constant_s } => format!(
                "{}; all the white noise is correlated over {} s and none is left: a low-pass filter of the first order",
                excess(&of.evidence),
                seconds(time_constant_s)
            ),
            LowPassDesign::TwoStages => {
                added(&of.evidence, "neighbours correlate as behind two equal low-pass stages of the first order")
            }
            LowPassDesign::Butterworth => {
                added(&of.evidence, "neighbours correlate as behind a Butterworth filter of the second order")
            }
        },
        Effect::SinusoidalLine(of) => harmonic(of.multiples.as_ref(), &of.evidence),
        Effect::ResonantLine(of) => harmonic(of.multiples.as_ref(), &of.evidence),
        Effect::ModulatedLine(of) => modulated(of),
        Effect::Chirp(of) => format!(
            "a line whose frequency runs from {:.2} to {:.2} Hz over the record, {:+.0} % of the noise of short spectra, by chance \
             anywhere {}; a speed that changes",
            of.start_hz.value,
            of.end_hz.value,
            100.0 * of.excess,
            chance(of.p_value)
        ),
        Effect::Periodic(of) => format!(
            "the same every {:.1} s, but no sinusoid: the harmonics have {:.0} % of the deviation of the fundamental, {:.0} times the \
             noise, by chance at any period {}; something that is switched by a clock or a thermostat",
            1.0 / of.frequency_hz.value,
            of.harmonics_percent.value,
            of.sum,
            chance(of.p_value)
        ),
        Effect::SquareWave(of) => format!(
            "{} of a square wave at {:.4} Hz: amplitudes fall with the number of the harmonic; {}",
            harmonics(&of.multiples),
            of.frequency_hz.value,
            of_line(&of.line)
        ),
        Effect::ShotNoise(of) => format!(
            "the third moment behind a filter for disturbances {} that decay within {:.2} s is {:.1} standard deviations from that of \
             a Gaussian process, by chance {}, and {:.1} behind the same filter in reversed time; shocks, or a load that comes on at \
             random times",
            if of.sum > 0.0 { "upwards" } else { "downwards" },
            of.time_constant_s.value,
            of.sum.abs(),
            chance(of.p_value),
            of.reversed.abs()
        ),
        Effect::TelegraphNoise(of) => match &of.evidence {
            TelegraphEvidence::Kurtosis { ratio, error, curve } => format!(
                "two levels: excess kurtosis {ratio:.2} ± {error:.2} of that of a telegraph signal, a Gaussian process has 0; {}",
                added(curve, CORRELATED)
            ),
            TelegraphEvidence::Levels { jumps, gain } => format!(
                "two levels {} apart with {jumps:.0} jumps between them, {} times as likely as a Gaussian process of any correlation \
                 time; charges that are caught and let go in a transistor or a crystal",
                amount(of.amplitude.value, of.amplitude.unit),
                likelier(*gain)
            ),
        },
        Effect::MarkovProcess(of) => match &of.evidence {
            MarkovEvidence::Curve(curve) => added(curve, CORRELATED),
            MarkovEvidence::Spectrum { corner_hz, gain } => format!(
                "the spectrum is flat below {} Hz, where a random walk would rise: {} times as likely; {CORRELATED}",
                seconds(*corner_hz),
                likelier(*gain)
            ),
        },
        Effect::CommonMode(of) => format!(
            "moves with {}: their spectra are {} times as likely as those of channels with nothing in common, and no measured cause \
             explains it; a shared reference, supply or temperature gradient",
            of.others.join(" and "),
            likelier(of.gain)
        ),
        Effect::SharedDrift(of) => format!(
            "moves with {} at {}, {:.0} σ, which is more than {:.0} times the data sheet's sensitivity: both share a drift whose \
             cause was not measured",
            of.with,
            amount(of.ratio.value, &format!("{}/{}", of.ratio.unit, of.per)),
            of.sigmas,
            of.largest_multiple
        ),
        Effect::LinearDrift(of) => match &of.evidence {
            LinearDriftEvidence::Curve(curve) => added(curve, "a steady drift: warming up, or ageing"),
            LinearDriftEvidence::Regression { p_value } => format!(
                "the level moves by {} throughout, by chance {} in white, flicker and walking noise of any mixture; warm-up that no \
                 sensor shows, or aging",
                amount(of.slope.value, &of.slope_parameter().unit),
                chance(*p_value)
            ),
        },
        Effect::LevelStep(of) => format!(
            "the level changes by {} at {:.1} s and stays, by chance anywhere {} in white, flicker and walking noise of any mixture; \
             a mechanical or thermal shock, or a fault that begins",
            amount(of.size.value, of.size.unit),
            of.time_s.value,
            chance(of.p_value)
        ),
        Effect::LevelChange(of) => format!(
            "the deviation of neighbours' differences changes by the factor {:.3} at {:.1} s and stays, which explains {:.0} % of the \
             changes of its level, by chance anywhere {}; a machine that is switched on, or a setting of the sensor",
            of.ratio.value,
            of.time_s.value,
            100.0 * of.explained,
            chance(of.p_value)
        ),
        Effect::WanderingLevel(of) => format!(
            "the deviation of neighbours' differences is like that some time before, by chance {}; its logarithm varies by {:.3} (1 σ) \
             and forgets in {} s; a vibration, a supply or a temperature that changes",
            chance(of.p_value),
            of.deviation.value,
            significant(of.time_constant_s.value, 2)
        ),
        Effect::TemperatureSensitivity(of) => {
            format!("follows the measured temperature, {:.0} σ; a bias that drifts with temperature", of.sigmas)
        }
        Effect::TemperatureCurvature(of) => format!(
            "follows the square of the measured temperature, by chance {} in white, flicker and walking noise of any mixture; a \
             sensitivity that itself changes with temperature",
            chance(of.p_value)
        ),
        Effect::TurnOnTransient(of) => format!(
            "the means decay exponentially from the first sample on, with a time constant of {:.0} s, by chance {} in white, flicker \
             and walking noise of any mixture; a part that warms itself after it was turned on",
            of.time_constant_s.value,
            chance(of.p_value)
        ),
        Effect::ThermalLag(of) => format!(
            "follows the measured temperature behind a lag of {:.0} s, by chance {}, and better than without a lag; the sensing \
             element warms up later than the thermometer",
            of.time_constant_s.value,
            chance(of.p_value)
        ),
        Effect::SupplySensitivity(of) => {
            format!("follows the measured supply, {:.0} σ; a bias that is not regulated", of.sigmas)
        }
        Effect::AccelerationSensitivity(of) => {
            format!("follows the measured specific force, {:.0} σ; g-sensitivity of the gyro", of.sigmas)
        }
        Effect::VibrationRectification(of) => format!(
            "follows the variance of {}, whose vibration reaches {} rms, by chance {} in white, flicker and walking noise of any \
             mixture",
            of.accelerometer,
            amount(of.strongest, of.per),
            chance(of.p_value)
        ),
        Effect::AngleQuantization(of) => {
            added(&of.evidence, "steps of the angle: a counter or an integrator before the output")
        }
        Effect::EffectiveLsb(of) => format!(
            "all {} values lie {} counts or a multiple of that apart, {} changes without an exception; a converter of fewer bits, or \
             rounding on the way",
            of.values, of.counts, of.changes
        ),
        Effect::NoiseBelowCount(of) if of.deviation.value == 0.0 => {
            "the value never changes; nothing is known of its noise but that it is below a count".to_owned()
        }
        Effect::NoiseBelowCount(of) => format!(
            "the Allan deviation at the shortest averaging times is {:.2} counts where it is nearest to the {:.2} counts from which \
             on rounding adds white noise alone; N, B and K are those of the rounded values",
            of.counts, of.dithered_counts
        ),
        Effect::Spikes(of) => format!(
            "{} off by more than {:.1} σ from what their neighbours tell, the largest by {:.1} σ; an electrical disturbance or a \
             damaged word",
            counted(of.count as u64, "sample"),
            of.threshold_sigmas,
            of.largest_sigmas
        ),
        Effect::NoisyInterval(of) => {
            let shown = match of.channels.len() {
                0 | 1 => "this channel alone".to_owned(),
                count => format!("{count} channels ({})", of.channels.join(", ")),
            };
            format!(
                "from {:.1} s to {:.1} s the noise at τ = {:.3} s is {:.2} times that of the stretches around it, by chance {}, in \
                 {shown}; a blow, a vehicle that passes, or work at the bench; kept out of the coefficients",
                of.from_s.value,
                of.to_s.value,
                of.tau_s,
                of.level.value,
                chance(of.p_value)
            )
        }
        Effect::MotionInterval(of) => format!(
            "the mean of a second leaves the median by up to {:.3} {unit}, {}, in {} {} s: the platform was moved",
            of.size.value,
            match of.scale {
                MotionScale::BiasError(error) =>
                    format!("more than three times the {error:.3} {} by which the biases of parts differ", of.size.unit),
                MotionScale::Scatter(scatter) =>
                    format!("where such means scatter by {} {}", significant(scatter, 2), of.size.unit),
            },
            if of.stretches == 1 {
                "one stretch of".to_owned()
            } else {
                format!("{} stretches of together", of.stretches)
            },
            of.moved_s,
            unit = of.size.unit
        ),
        Effect::Saturation(of) => format!(
            "{} of {} samples lie at {}, {:.4} {}, no other value occurs more than {} times: what is beyond is cut off, and N, B and \
             K are lower limits",
            of.cut_off,
            of.samples,
            if of.is_end_of_range { "the end of the range" } else { "a limit" },
            of.level.value,
            of.level.unit,
            of.most_of_others
        ),
        Effect::MissingCodes(of) => format!(
            "{} without a sample, beside {:.0} in their rarer neighbours",
            counted(of.codes.into(), "code"),
            of.expected
        ),
        Effect::StuckOutput(of) => format!(
            "{} of {} samples are in {} of equal values that noise does not make, the longest from {:.2} s to {:.2} s; they are left \
             out",
            of.stuck,
            of.samples,
            counted(of.runs, "run"),
            of.from_s.value,
            of.to_s.value
        ),
        Effect::DroppedSamples(of) => format!(
            "{} of {} samples never arrived, in {}; a reader that comes too late, or a full queue",
            of.missing,
            of.samples,
            counted(of.gaps as u64, "gap")
        ),
        Effect::RepeatedSamples(of) => format!(
            "{} of {} samples equal the one before in all {} channels, {:.1} at most by chance; a register that is read before it is \
             renewed",
            of.equal, of.samples, of.channels, of.by_chance
        ),
        Effect::ClockDeviation(ClockDeviation { change: Some(of), .. }) => format!(
            "{:.4} Hz by the time stamps up to {:.0} s and {:.4} Hz from then on, {:.1} σ apart; neither wanders",
            of.before_hz.value, of.time_s.value, of.after_hz.value, of.sigmas
        ),
        Effect::ClockDeviation(of) => format!(
            "{:.4} Hz by the time stamps, {:+.1} ppm from the nominal {:.4} Hz, {:.1} σ of an ordinary host's clock; the tolerance of \
             the part's oscillator",
            of.rate_hz.value,
            1e6 * (of.rate_hz.value / of.nominal_hz - 1.0),
            of.nominal_hz,
            of.sigmas
        ),
        Effect::Unexplained(of) => unexplained(of),
    }
}

fn modulated(of: &ModulatedLine) -> String {
    let (frequency_hz, period_s) = (of.frequency_hz.value, of.period_s.value);
    match &of.evidence {
        ModulationEvidence::Envelope { sigmas } => {
            let (changes, depth) = if of.of_phase {
                ("its phase goes to and fro", format!("{:.2} rad", of.depth.value))
            } else {
                ("its amplitude swells and fades", format!("{:.0} %", 100.0 * of.depth.value))
            };
            format!(
                "a line at {frequency_hz:.4} Hz, {sigmas:.0} σ, whose sidebands are {:.4} Hz away: {changes} by {depth} every \
                 {period_s:.0} s, which no sinusoid does",
                1.0 / period_s
            )
        }
        ModulationEvidence::Sidebands(line) => format!(
            "a line at {frequency_hz:.4} Hz between two equal ones {:.4} Hz away: its amplitude swells and fades every {period_s:.0} \
             s, which no sinusoid of one amplitude does; {}",
            1.0 / period_s,
            of_line(line)
        ),
    }
}

fn of_line(line: &LineEvidence) -> String {
    let meaning = if line.has_width {
        "a narrow band: a mechanical resonance or an unsteady vibration"
    } else {
        "a steady line: a vibration, or an interference folded into the band"
    };
    match &line.source {
        LineSource::Curve(curve) => added(curve, meaning),
        LineSource::Spectrum(of) => {
            let meaning =
                if of.is_at_half_rate { "half of the sample rate: every second sample has an offset" } else { meaning };
            let width = of.width_hz.map_or_else(
                || "no wider than the record resolves".to_owned(),
                |width_hz| format!("{width_hz:.4} Hz wide"),
            );
            format!(
                "line at {:.4} Hz in the spectrum, {width}, {:.0} σ, by chance anywhere {}; {meaning}",
                of.frequency_hz,
                of.sigmas,
                chance(of.p_value)
            )
        }
    }
}

/// A line, perhaps one of several of one signal.
fn harmonic(multiples: Option<&Multiples>, line: &LineEvidence) -> String {
    match multiples {
        None => of_line(line),
        Some(multiples) => {
            format!("{} of one periodic signal; {}", harmonics(multiples), of_line(line))
        }
    }
}

fn unexplained(of: &Unexplained) -> String {
    let percent = of.excess_percent.map_or(0.0, |of| of.value);
    let frequency_hz = of.frequency_hz().map_or(0.0, |of| of.value);
    match &of.observation {
        Observation::PointOfCurve { p_value } => format!(
            "{percent:+.0} % of the model's Allan deviation at τ = {:.3} s, by chance anywhere in the curve {}; no effect that is \
             known here explains it",
            of.tau_s().map_or(0.0, |of| of.value),
            chance(*p_value)
        ),
        Observation::RefutedTerm { curve, by } => format!("{} {}", excess(curve), refutation(by)),
        Observation::Band { width_hz, sigmas, mismatch } => {
            let why = match mismatch {
                BandMismatch::Shape { p_value } => format!(
                    "has not the spectrum of a resonance, by chance {}: a frequency or a strength that changes",
                    chance(*p_value)
                ),
                BandMismatch::Curve => "the Allan deviation contradicts a resonance there".to_owned(),
            };
            format!(
                "a band around {frequency_hz:.4} Hz, {width_hz:.4} Hz wide, stands out of the noise ({sigmas:.0} σ) and {why}"
            )
        }
        Observation::LevelByTemperature { range_degc: [coldest, warmest], explained } => format!(
            "the level of the noise changes by {percent:+.0} % from {coldest:.1} to {warmest:.1} degC: {:.0} % of its changes follow \
             the measured temperature, and no effect that is known here changes it",
            100.0 * explained
        ),
    }
}

/// Contradiction of a term that fits an octave of the curve.
fn refutation(by: &Refutation) -> String {
    let forgets = |time_constant_s: f64| {
        format!("with the spectrum of a process that forgets within {} s", seconds(time_constant_s))
    };
    match *by {
        Refutation::FewPeriods => {
            "as by a line of a few periods in the record, which its curve does not tell from a drift".to_owned()
        }
        Refutation::NotInSpectrum { frequency_hz } => {
            format!("as by a line at {frequency_hz:.4} Hz, where the spectrum has none")
        }
        Refutation::ShapeOfSpectrum { p_value } => format!(
            "as by quantization, whose density rises with the square of the frequency; the spectrum has another shape, by chance {}",
            chance(p_value)
        ),
        Refutation::Irreversible { time_constant_s } => format!(
            "{}, but its changes up and down differ: disturbances that begin at once and decay",
            forgets(time_constant_s)
        ),
        Refutation::RareDisturbances { time_constant_s, kurtosis: [ratio, error] } => format!(
            "{}, but an excess kurtosis {ratio:.1} ± {error:.1} times that of a telegraph signal: rare disturbances",
            forgets(time_constant_s)
        ),
        Refutation::UndecidedLevels { time_constant_s, kurtosis: [ratio, error] } => format!(
            "{}: its excess kurtosis, {ratio:.1} ± {error:.1} times that of a telegraph signal, does not tell whether that has two \
             levels",
            forgets(time_constant_s)
        ),
    }
}

fn filter_meaning(of: &OutputFilter) -> String {
    let window = if of.stages == 2 { "Bartlett window" } else { "moving average" };
    let (taps, decimation) = (of.taps.value, of.decimation.value);
    if decimation == 1.0 {
        return format!("neighbours correlate as behind a {window} of {taps} taps a stage");
    }
    format!(
        "neighbours correlate as behind a {window} of {taps} taps a stage that is read every {decimation:.2} values; at the part's \
         own {} Hz that is a sample rate of {:.1} Hz",
        of.internal_rate_hz,
        of.internal_rate_hz / decimation
    )
}

fn harmonics(of: &Multiples) -> String {
    let numbers: Vec<String> = of.harmonics.iter().map(u32::to_string).collect();
    let harmonics = match numbers.len() {
        0 => String::new(),
        1 => format!("harmonic {}", numbers[0]),
        _ => format!("harmonics {}", enumerated(&numbers)),
    };
    match of.sidebands {
        0 => harmonics,
        count if numbers.is_empty() => format!("{count} sidebands"),
        count => format!("{harmonics} with {count} sidebands"),
    }
}
