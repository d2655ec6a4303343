//! Which explanation stands where two claim the same variance and the likelihood does not decide: one table, in the order in which
//! its rows are applied. A row sees what the rows before it have left.

use crate::bounds::BoundedEstimate;
use crate::detectors::random_telegraph::explains_spikes;
use crate::effects::{
    AddedVariance, AveragingTime, CommonMode, Effect, MarkovProcess, Observation, Refutation, TelegraphEvidence,
    TelegraphNoise, Unexplained,
};
use crate::fit::channel_fit::FREQUENCY_BY_OCTAVES;
use crate::fit::noise_terms::{is_filter, is_line, is_same_time, line_frequency};
use crate::rivals::cause::{Cause, Shown};
use crate::rivals::proposal::{ChannelFacts, Origin, Proposal, Signal};
use crate::rivals::signals::{SpectrumClaim, SpectrumProposals};
use crate::samples::rounding::NEIGHBOURING_COUNTS;
use crate::spectra::decaying_disturbances::DecayingDisturbances;
use crate::spectra::frequency_track::FrequencyTrack;
use crate::spectra::periodic_signal::PeriodicSignal;
use crate::spectra::spectral_lines::{MergedLine, is_alias};
use allan_core::NoiseTerm;
use std::f64::consts::{PI, TAU};

#[cfg(test)]
mod tests;

/// Shortest time constant of a process, in periods of a periodic signal, that may be the signal's: its jumps and slopes have the
/// spectrum of one with its time scale.
const LEAST_OF_PERIOD: f64 = 0.02;
/// Longest time constant of two levels of a periodic signal, in periods: that of levels for half a period each.
const LARGEST_OF_PERIOD: f64 = 0.25;
/// Time constants of a process, in periods of a line, that may be the line's: the Allan deviation of the process is largest at 1.89 time
/// constants, that of the line at 0.37 periods, and octaves tell either to a factor of 4.
const OF_TRACK_PERIOD: [f64; 2] = [0.05, 0.8];
/// Frequency of a line, in units of `1/(2πT)` of a common-mode drift with the time constant T, at which the drift has a tenth of
/// its density at low frequencies: 1/(1 + 3²).
const WITHIN_COMMON_MODE: f64 = 3.0;

/// A line of the channel itself keeps more than this part of its deviation when the covariates are subtracted.
const MIN_OWN_DEVIATION: f64 = 0.5;
/// Power gain of a filter below which the spectrum holds leakage from other frequencies.
const LEAKAGE_GAIN: f64 = 0.1;

/// One row of the table.
pub struct Rivalry {
    /// The claim that stands.
    pub stands: &'static str,
    /// The claim that is not reported beside it.
    pub instead_of: &'static str,
    pub condition: &'static str,
    pub reason: &'static str,
    rule: Rule,
}

/// The condition under which a claim loses.
enum Rule {
    /// Decides on a line of the spectrum, before the model is fitted with it.
    Line(fn(&LineClaim) -> bool),
    /// Decides on lines and signals, before the model takes the lines.
    Spectrum(fn(&SpectrumClaim, &SpectrumProposals) -> bool),
    /// Decides on the effects of one channel.
    Channel(fn(&Claim) -> bool),
    /// Decides on one channel's part in a cause.
    Cause(fn(&CauseClaim) -> bool),
}

/// A line of the spectrum of a series, beside what else is known of the series.
pub(crate) struct LineClaim<'a> {
    pub line: &'a MergedLine,
    pub period_s: f64,
    /// Lines above the frequencies that the series shows.
    pub faster: &'a [MergedLine],
    /// Lines of the series less its covariates; `None` where it has none.
    pub left: Option<&'a [MergedLine]>,
    /// Least power gain of a filter of the model at the line; 1 where there is none.
    pub gain: f64,
}

impl<'a> LineClaim<'a> {
    /// A line of which nothing else is known.
    pub(crate) const fn new(line: &'a MergedLine, period_s: f64) -> Self {
        Self { line, period_s, faster: &[], left: None, gain: 1.0 }
    }
}

/// A proposal for a channel, beside the others that stand.
struct Claim<'a> {
    at: usize,
    all: &'a [Proposal],
    facts: &'a ChannelFacts,
}

pub(super) struct CauseClaim<'a> {
    pub effect: &'a Effect,
    pub channel: usize,
    /// Number of channels that show the cause; `None` if it is not known.
    pub shown_by: Option<usize>,
    /// The causes that have lines.
    pub periodic: &'a [Cause],
}

const fn row(
    stands: &'static str,
    instead_of: &'static str,
    condition: &'static str,
    reason: &'static str,
    rule: Rule,
) -> Rivalry {
    Rivalry { stands, instead_of, condition, reason, rule }
}

#[rustfmt::skip]
pub static RIVALRIES: [Rivalry; 51] = [
    // Lines and signals of the spectrum.
    row("line above half the rate of the means", "line of the means", "at its alias, and as wide", "means sample it too slowly",
        Rule::Line(|of| of.faster.iter().any(|faster| is_alias(of.line, faster, of.period_s)))),
    row("covariate", "line of the spectrum", "without the covariate less than half of its deviation is left", "the covariate has the line",
        Rule::Line(|of| of.left.is_some_and(|left| !left.iter().any(|left|
            of.line.is_same(left) && left.deviation.value > MIN_OWN_DEVIATION * of.line.deviation.value)))),
    row("filter", "band of the spectrum", "a filter of the model passes less than a tenth of the power there",
        "the taper leaks from other frequencies into a null",
        Rule::Line(|of| !of.line.is_sinusoid() && of.gain < LEAKAGE_GAIN)),
    row("slow periodic signal", "line of the spectrum", "at one of its multiples, within the resolution",
        "it has the power of its harmonics",
        Rule::Spectrum(|claim, all| matches!((claim, &all.periodic),
            (SpectrumClaim::Line(line), Some(of)) if of.has(line.frequency.value, all.resolution_hz)))),
    row("band", "chirp", "in the range of the chirp, half the band's statistic above the chirp's energy",
        "a frequency that wanders is a band, of which a straight track holds a part",
        Rule::Spectrum(|claim, all| matches!(claim, SpectrumClaim::Chirp(track)
            if all.bands().any(|(frequency, statistic)| track.passes(frequency) && 0.5 * statistic > track.energy)))),
    row("chirp", "line of the spectrum", "in the range of the chirp, half the line's statistic not above the chirp's energy",
        "a frequency that runs leaves peaks all along its range",
        Rule::Spectrum(|claim, all| matches!((claim, &all.track),
            (SpectrumClaim::Line(line), Some(of)) if of.passes(line.frequency.value) && 0.5 * line.statistic <= of.energy))),
    row("slow periodic signal", "shot noise", "always", "its falls begin at once, as they do",
        Rule::Spectrum(|claim, all| matches!(claim, SpectrumClaim::Decays) && all.periodic.is_some())),

    // Rows on the samples of one channel.
    row("irreversible changes", "telegraph noise of the samples", "the samples change upwards as they do not change downwards",
        "two levels are the same when time runs backwards",
        Rule::Channel(|of| matches!(of.origin(), Origin::Levels { is_reversible: false }))),
    row("drift of the bias", "motion", "in one channel, and not sudden",
        "a turn changes two axes, and begins at some time; a bias drifts in one channel",
        Rule::Channel(|of| matches!(of.origin(), Origin::Motion { is_shared: false, is_sudden: false }))),
    row("telegraph noise of the samples", "motion", "in one channel, no farther than its levels", "its jumps are as sudden",
        Rule::Channel(|of| match (of.origin(), of.effect()) {
            (Origin::Motion { is_shared: false, .. }, Effect::MotionInterval(motion)) => of.levels()
                .is_some_and(|levels| least(motion.size.estimate()) < levels.amplitude.value),
            _ => false,
        })),
    row("sensitivity", "shared drift", "no larger than the largest plausible multiple of the data sheet's, or not told from 0",
        "the sensor is known to have it",
        Rule::Channel(|of| matches!((of.origin(), of.effect()),
            (Origin::Covariate { is_plausible: true, .. }, Effect::SharedDrift(_))))),
    row("shared drift", "sensitivity", "otherwise", "physics forbids the sensitivity",
        Rule::Channel(|of| matches!(of.origin(), Origin::Covariate { is_plausible: false, .. })
            && !matches!(of.effect(), Effect::SharedDrift(_)))),
    row("chance", "line of the spectrum", "the interval of its size includes 0", "95 % bounds",
        Rule::Channel(|of| matches!(of.origin(), Origin::Line { .. }) && !is_shown(of.effect(), of.facts.duration_s))),

    // Rounding.
    row("rounding to counts", "telegraph noise of the samples", "levels closer than 1.5 counts, not dithered at the shortest averaging time",
        "two neighbouring counts",
        Rule::Channel(|of| matches!((of.origin(), of.effect()), (Origin::Levels { .. }, Effect::TelegraphNoise(found))
            if !of.facts.is_dithered_at_once && found.amplitude.value < NEIGHBOURING_COUNTS * of.facts.resolution))),
    row("rounding to counts", "every term of the curve but a filter", "not dithered at any short averaging time",
        "without dither the rounding error is no white noise, and the curve shows its steps",
        Rule::Channel(|of| !of.facts.is_dithered && of.kind().is_some_and(|kind| !is_filter(&kind)))),
    row("line of the spectrum", "line of the curve", "within a fifth of the frequency or half the bandwidth",
        "the spectrum resolves it better",
        Rule::Channel(|of| of.line_of_curve().is_some_and(|frequency| of.spectrum_has(frequency)))),

    // Several effects of one term of the curve.
    row("unexplained octave of few periods", "line of the curve", "fewer than 8 periods in the record",
        "the curve does not tell it from a drift",
        Rule::Channel(|of| of.loses_to(|effect| matches!(refutation(effect), Some(Refutation::FewPeriods))))),
    row("harmonic of a line of the spectrum", "line of the curve",
        "above a line of the spectrum, without a line there and without a width that the record bounds",
        "the spectrum lists the lowest harmonics alone",
        Rule::Channel(|of| of.line_of_curve().is_some_and(|frequency| of.has_line_below(frequency))
            && of.term_has(is_absent_in_spectrum))),
    row("unexplained octave without a line", "line of the curve", "no line of the spectrum there and no width that the record bounds",
        "a line would stand out of the spectrum",
        Rule::Channel(|of| of.loses_to(is_absent_in_spectrum))),
    row("unexplained octave of another spectrum", "quantization",
        "the spectrum shows less of it, or has another shape where it has a tenth of the density or more: 2·10⁻⁴",
        "the density of quantization rises with the square of the frequency",
        Rule::Channel(|of| of.loses_to(|effect| matches!(refutation(effect), Some(Refutation::ShapeOfSpectrum { .. }))))),
    row("telegraph noise of the samples", "shot noise",
        "time constants within a factor of 4, and a gain in ln likelihood above half the square of the shot noise's sum",
        "either says how much more likely it is than a Gaussian process",
        Rule::Channel(|of| match of.origin() {
            Origin::Signal(Signal::Decays(decays)) => of.levels().is_some_and(|levels| are_likelier(levels, decays)),
            _ => false,
        })),
    row("telegraph noise of the samples", "Markov process or ramp of the curve", "always",
        "the samples show the levels; the curve is that of a Markov process",
        Rule::Channel(|of| of.is_slow_term() && of.levels().is_some())),
    row("drift in common", "Markov process or ramp of the curve", "always", "the cross spectra show it in several channels",
        Rule::Channel(|of| of.is_slow_term() && of.others().any(|other| matches!(other.effect, Effect::CommonMode(_))))),
    row("first-order filter", "Markov process of the curve", "below 64 samples, with no white noise left but rounding",
        "white noise is never absent, filtered it is such a process",
        Rule::Channel(|of| of.loses_to(|effect| matches!(effect, Effect::LowPassFilter(_))))),
    row("low-pass filter of the second order", "quantization, or unexplained line of the curve",
        "always; the line above half of its bandwidth", "the form of the filter is known to a part of what it leaves there, and rounding behind it is white",
        Rule::Channel(|of| of.bandwidth_hz().is_some_and(|bandwidth| of.kind() == Some(NoiseTerm::Quantization)
            || is_absent_in_spectrum(of.effect()) && of.line_of_curve().is_some_and(|frequency| frequency > 0.5 * bandwidth)))),
    row("unexplained octave of irreversible changes", "Markov process of the curve", "the changes up and down differ by 2·10⁻⁴",
        "a Gaussian process is the same when time runs backwards",
        Rule::Channel(|of| of.loses_to(|effect| matches!(refutation(effect), Some(Refutation::Irreversible { .. }))))),
    row("telegraph noise by the kurtosis of a stronger term", "telegraph noise or an unexplained octave by the kurtosis of a Markov process",
        "always", "the kurtosis of the curve is that of both",
        Rule::Channel(|of| is_by_kurtosis(of.effect()) && of.term().is_some() && of.others().any(|other|
            matches!(other.effect, Effect::TelegraphNoise(_)) && other.term().is_some_and(|term| Some(term) < of.term())))),
    row("telegraph noise or an unexplained octave by the kurtosis", "Markov process of the curve",
        "the kurtosis is nearer to that of two levels, or neither it nor the samples are 19 times as likely of a Gaussian process",
        "a Gaussian process has no excess kurtosis",
        Rule::Channel(|of| of.loses_to(is_by_kurtosis))),
    row("first unexplained octave", "further ones", "always, except for lines", "of one thing that has no name the clearest octave is enough",
        Rule::Channel(|of| is_octave(of.effect()) && of.term().is_some_and(|own| of.others().any(|other|
            is_octave(&other.effect) && other.term().is_some_and(|term| term < own))))),
    row("chance", "sensitivity, term of the curve but a filter, telegraph noise, drift in common",
        "the interval of its size includes 0, or its time constant is longer than the record", "95 % bounds; a filter is told by all channels",
        Rule::Channel(|of| matches!(of.origin(),
                Origin::Covariate { .. } | Origin::Term { .. } | Origin::Levels { .. } | Origin::CrossSpectra)
            && !of.kind().is_some_and(|kind| is_filter(&kind)) && !is_shown(of.effect(), of.facts.duration_s))),

    // Rows on one thing that several stages see.
    row("lag or curvature of the temperature", "sensitivity to temperature", "always", "the response that is not proportional has it",
        Rule::Channel(|of| matches!(of.effect(), Effect::TemperatureSensitivity(_)) && of.others().any(|other|
            matches!(other.effect, Effect::ThermalLag(_) | Effect::TemperatureCurvature(_))))),
    row("ramp of the samples", "ramp of the curve", "always", "the regression on block means knows it better",
        Rule::Channel(|of| of.kind() == Some(NoiseTerm::RateRamp) && of.others().any(|other|
            matches!((&other.effect, &other.origin), (Effect::LinearDrift(_), Origin::Samples))))),
    row("line of the spectrum", "ramp of the curve", "the line has fewer than 8 periods in the record",
        "the longest octaves see it as a ramp",
        Rule::Channel(|of| of.kind() == Some(NoiseTerm::RateRamp) && of.others().any(|other|
            matches!(other.origin, Origin::Line { is_slow: true })))),
    row("slow oscillation", "ramp of the curve", "the ends of the record are less than half as far apart as the ramp would take them",
        "the longest octaves see it as a ramp",
        Rule::Channel(|of| matches!((of.kind(), of.effect(), of.facts.slope_of_ends),
            (Some(NoiseTerm::RateRamp), Effect::LinearDrift(drift), Some(of_ends)) if of_ends < 0.5 * drift.slope.value))),
    row("unexplained point of the curve", "Markov process", "within two octaves of 1.89 of its time constants",
        "the model with the process does not describe the curve there",
        Rule::Channel(|of| match of.effect() {
            Effect::MarkovProcess(markov) => of.others().any(|other| matches!((&other.origin, &other.effect),
                (Origin::Residual, Effect::Unexplained(point)) if point.tau_s()
                    .is_some_and(|tau_s| is_same_time(tau_s.value, MarkovProcess::PEAK * markov.time_constant_s.value)))),
            _ => false,
        })),
    row("slow periodic signal", "Markov process, telegraph noise", "a time constant above a fiftieth of its period",
        "its jumps and slopes have such a spectrum",
        Rule::Channel(|of| of.process_s().zip(of.periodic())
            .is_some_and(|(time_constant_s, of)| time_constant_s > LEAST_OF_PERIOD * of.period_s()))),
    row("chirp", "Markov process, telegraph noise", "a time constant from 0.05 to 0.8 of its periods", "the curve has its hump there",
        Rule::Channel(|of| of.process_s().zip(of.track()).is_some_and(|(time_constant_s, track)| {
            let ([shortest, longest], [first, last]) = (OF_TRACK_PERIOD, track.frequencies);
            (shortest / first.max(last)..=longest / first.min(last)).contains(&time_constant_s)
        }))),
    row("shot noise", "Markov process, telegraph noise, unexplained octave", "time constants within a factor of 4",
        "an exponential decay has the spectrum of a Markov process",
        Rule::Channel(|of| of.decays().is_some_and(|decays| {
            let own_s = decays.time_constant.value;
            let is_octave_of = |octave: &Unexplained| octave.tau_s()
                .is_some_and(|tau_s| is_same_time(tau_s.value, MarkovProcess::PEAK * own_s));
            match of.effect() {
                Effect::Unexplained(octave) => matches!(of.origin(), Origin::Term { .. } | Origin::Residual) && is_octave_of(octave),
                _ => of.process_s().is_some_and(|time_constant_s| is_same_time(time_constant_s, own_s)),
            }
        }))),
    row("slow periodic signal", "line of the curve", "from half an octave below its fundamental to its highest harmonic",
        "the curve does not resolve the harmonics",
        Rule::Channel(|of| of.reported_line_of_curve().zip(of.periodic()).is_some_and(|(frequency, of)| of.reaches(frequency)))),
    row("chirp", "line of the curve", "in the range of the chirp", "the curve does not resolve the frequencies",
        Rule::Channel(|of| of.reported_line_of_curve().zip(of.track()).is_some_and(|(frequency, of)| of.passes(frequency)))),
    row("slow periodic signal", "ramp, step", "every ramp, and a step below π of its amplitudes",
        "a sawtooth falls by π times the amplitude of its fundamental",
        Rule::Channel(|of| of.periodic().is_some_and(|periodic| match of.effect() {
            Effect::LinearDrift(_) => true,
            Effect::LevelStep(step) => least(step.size.estimate()) < PI * periodic.amplitude.value,
            _ => false,
        }))),
    row("level of the noise by temperature", "change of the level of the noise", "where it explains more of its changes",
        "a temperature that rises once takes the level with it",
        Rule::Channel(|of| matches!((of.effect(), of.level_by_temperature()), (Effect::LevelChange(change), Some(by_temperature))
            if change.explained <= by_temperature))),
    row("change of the level of the noise", "level of the noise by temperature", "otherwise",
        "a temperature that differs before and after it follows by chance",
        Rule::Channel(|of| of.others().any(|other| matches!(other.effect, Effect::LevelChange(_)))
            && matches!((of.origin(), of.effect()), (Origin::Level, Effect::Unexplained(_))))),
    row("level of the noise by temperature, motion", "wandering level of the noise", "always", "either changes the level",
        Rule::Channel(|of| matches!(of.effect(), Effect::WanderingLevel(_)) && (of.level_by_temperature().is_some()
            || of.others().any(|other| matches!(other.effect, Effect::MotionInterval(_)))))),
    row("lines and signals", "wandering level of the noise", "less than 0.64 of their part of the variance of neighbours' differences",
        "the logarithm of the amplitude of a narrow band has the deviation π/√24",
        Rule::Channel(|of| matches!(of.effect(), Effect::WanderingLevel(level)
            if level.deviation.low < PI / 24.0_f64.sqrt() * of.part_of_signals()))),
    row("rounding to counts", "wandering level of the noise", "not dithered at the shortest averaging time",
        "the bias decides how often two counts alternate",
        Rule::Channel(|of| matches!(of.effect(), Effect::WanderingLevel(_)) && !of.facts.is_dithered_at_once)),
    row("level of the noise that changes", "spikes", "always, but for a level that wanders", "the limit of a spike is that of a constant level",
        Rule::Channel(|of| matches!(of.effect(), Effect::Spikes(_)) && of.others().any(|other|
            matches!(other.origin, Origin::Level) && !matches!(other.effect, Effect::WanderingLevel(_))))),
    row("telegraph noise", "spikes", "no more frequent than visits of one sample to a level, and no larger",
        "a visit to a level that lasts a sample is a spike",
        Rule::Channel(|of| match (of.effect(), of.others().find_map(|other| telegraph(&other.effect))) {
            (Effect::Spikes(spikes), Some(telegraph)) => explains_spikes(telegraph, spikes, of.facts.period_s),
            _ => false,
        })),

    // Across channels.
    row("line in common", "drift in common", "a line of several channels below 3/(2πT) of the drift's time constant T",
        "there the drift has most of its power",
        Rule::Cause(|of| matches!(of.effect, Effect::CommonMode(drift) if of.is_line_within(drift)))),
    row("line in common", "rest of a drift in common", "in one channel alone",
        "it is in common with a channel that shows the line",
        Rule::Cause(|of| matches!(of.effect, Effect::CommonMode(_)) && of.shown_by == Some(1))),
    row("periodic signal", "telegraph noise", "a time constant of a fiftieth to a quarter of its period",
        "two levels for the parts p and 1 − p of a period have the time constant p(1 − p) of it",
        Rule::Cause(|of| matches!(of.effect, Effect::TelegraphNoise(telegraph) if of.is_of_period(telegraph)))),
];

pub(crate) fn stands_as_line(claim: &LineClaim) -> bool {
    !RIVALRIES.iter().any(|row| row.applies_to_line(claim))
}

pub(crate) fn standing_in_spectrum(mut proposals: SpectrumProposals) -> SpectrumProposals {
    for row in &RIVALRIES {
        proposals = row.applied_to_spectrum(proposals);
    }
    proposals
}

/// The effects of a channel that stand, in the order of the proposals.
pub(crate) fn standing(proposals: Vec<Proposal>, facts: &ChannelFacts) -> Vec<Effect> {
    let standing = RIVALRIES.iter().fold(proposals, |proposals, row| row.applied_to_channel(proposals, facts));
    merged_axes(standing.into_iter().map(|proposal| proposal.effect))
}

pub(super) fn stands_as_cause(claim: &CauseClaim) -> bool {
    !RIVALRIES.iter().any(|row| row.applies_to_cause(claim))
}

/// The sensitivities to the specific force along several axes as one effect.
fn merged_axes(effects: impl Iterator<Item = Effect>) -> Vec<Effect> {
    let mut merged: Vec<Effect> = Vec::new();
    for effect in effects {
        if let Effect::AccelerationSensitivity(of) = &effect {
            let known = merged.iter_mut().find_map(|known| match known {
                Effect::AccelerationSensitivity(known) => Some(known),
                _ => None,
            });
            if let Some(known) = known {
                for (known, of) in known.sensitivity.iter_mut().zip(of.sensitivity) {
                    *known = known.or(of);
                }
                known.sigmas = known.sigmas.max(of.sigmas);
                continue;
            }
        }
        merged.push(effect);
    }
    merged
}

impl Rivalry {
    fn applies_to_line(&self, claim: &LineClaim) -> bool {
        matches!(self.rule, Rule::Line(loses) if loses(claim))
    }

    fn applied_to_spectrum(&self, mut of: SpectrumProposals) -> SpectrumProposals {
        let Rule::Spectrum(loses) = self.rule else { return of };
        let stands: Vec<bool> = of.lines.iter().map(|line| !loses(&SpectrumClaim::Line(line), &of)).collect();
        let track = of.track.filter(|track| !loses(&SpectrumClaim::Chirp(track), &of));
        if loses(&SpectrumClaim::Decays, &of) {
            of.decays = None;
        }
        let mut stands = stands.into_iter();
        of.lines.retain(|_| stands.next().unwrap_or(true));
        SpectrumProposals { track, ..of }
    }

    fn applied_to_channel(&self, proposals: Vec<Proposal>, facts: &ChannelFacts) -> Vec<Proposal> {
        let Rule::Channel(loses) = self.rule else { return proposals };
        let claims = 0..proposals.len();
        let stands: Vec<bool> = claims.map(|at| !loses(&Claim { at, all: &proposals, facts })).collect();
        proposals.into_iter().zip(stands).filter(|(_, stands)| *stands).map(|(proposal, _)| proposal).collect()
    }

    fn applies_to_cause(&self, claim: &CauseClaim) -> bool {
        matches!(self.rule, Rule::Cause(loses) if loses(claim))
    }
}

impl<'a> Claim<'a> {
    fn effect(&self) -> &'a Effect {
        &self.all[self.at].effect
    }

    fn origin(&self) -> &'a Origin {
        &self.all[self.at].origin
    }

    fn others(&self) -> impl Iterator<Item = &'a Proposal> {
        let at = self.at;
        self.all.iter().enumerate().filter(move |(other, _)| *other != at).map(|(_, other)| other)
    }

    fn term(&self) -> Option<usize> {
        self.all[self.at].term()
    }

    fn kind(&self) -> Option<NoiseTerm> {
        match self.origin() {
            Origin::Term { kind, .. } => Some(*kind),
            _ => None,
        }
    }

    /// True if one of the effects of the same term, this one among them, is such.
    fn term_has(&self, is_such: impl Fn(&Effect) -> bool) -> bool {
        self.term().is_some_and(|term| self.all.iter().any(|of| of.term() == Some(term) && is_such(&of.effect)))
    }

    /// True if it is not such an effect, and another one of the same term is.
    fn loses_to(&self, is_such: impl Fn(&Effect) -> bool) -> bool {
        !is_such(self.effect()) && self.term_has(is_such)
    }

    /// True if it is of a Markov process or a ramp of the curve.
    fn is_slow_term(&self) -> bool {
        matches!(self.kind(), Some(NoiseTerm::Markov(_) | NoiseTerm::RateRamp))
    }

    /// Bandwidth of the low-pass filter of the second order that the channel has, Hz.
    fn bandwidth_hz(&self) -> Option<f64> {
        self.others().find_map(|other| match &other.effect {
            Effect::LowPassFilter(filter) if filter.design.is_second_order() => Some(filter.bandwidth_hz.value),
            _ => None,
        })
    }

    /// Frequency of the term of the curve, if that is a line, Hz.
    fn line_of_curve(&self) -> Option<f64> {
        line_frequency(&self.kind()?)
    }

    /// The same as it is reported, where it is reported as a line.
    fn reported_line_of_curve(&self) -> Option<f64> {
        let is_of_curve = self.kind().is_some_and(|kind| is_line(&kind)) && self.effect().is_line();
        is_of_curve.then(|| self.effect().frequency_hz())?.map(|of| of.value)
    }

    fn process_s(&self) -> Option<f64> {
        match self.effect() {
            Effect::MarkovProcess(of) => Some(of.time_constant_s.value),
            Effect::TelegraphNoise(of) => Some(of.time_constant_s.value),
            _ => None,
        }
    }

    /// Telegraph noise of the samples.
    fn levels(&self) -> Option<&'a TelegraphNoise> {
        let is_of_samples = |other: &&Proposal| matches!(other.origin, Origin::Levels { .. });
        self.others().filter(is_of_samples).find_map(|other| telegraph(&other.effect))
    }

    /// Effects by the lines of the spectrum.
    fn lines(&self) -> impl Iterator<Item = &'a Effect> {
        self.others().filter(|other| matches!(other.origin, Origin::Line { .. })).map(|other| &other.effect)
    }

    /// True if the spectrum has the line of the curve at a frequency, Hz, which its octaves tell to some tenths.
    fn spectrum_has(&self, frequency: f64) -> bool {
        self.lines().any(|line| {
            let bandwidth = if let Effect::ResonantLine(of) = line { of.bandwidth_hz.value } else { 0.0 };
            let reach = (FREQUENCY_BY_OCTAVES * frequency).max(0.5 * bandwidth);
            line.frequency_hz().is_some_and(|of| (of.value - frequency).abs() < reach)
        })
    }

    /// True if the spectrum has a line below the one of the curve at a frequency, Hz.
    fn has_line_below(&self, frequency: f64) -> bool {
        let limit = (1.0 + FREQUENCY_BY_OCTAVES) * frequency;
        self.lines().any(|line| line.frequency_hz().is_some_and(|of| of.value < limit))
    }

    fn signal<T>(&self, of: impl Fn(&'a Signal) -> Option<T>) -> Option<T> {
        self.others().find_map(|other| match &other.origin {
            Origin::Signal(signal) => of(signal),
            _ => None,
        })
    }

    fn periodic(&self) -> Option<&'a PeriodicSignal> {
        self.signal(|signal| if let Signal::Periodic(of) = signal { Some(of) } else { None })
    }

    /// The part of the changes of the noise's level that the temperature explains.
    fn level_by_temperature(&self) -> Option<f64> {
        self.others().find_map(|other| match &other.effect {
            Effect::Unexplained(Unexplained {
                observation: Observation::LevelByTemperature { explained, .. }, ..
            }) => Some(*explained),
            _ => None,
        })
    }

    /// The part of lines and signals in the Allan variance of neighbouring samples.
    fn part_of_signals(&self) -> f64 {
        let ChannelFacts { period_s, avar, .. } = *self.facts;
        let at = AveragingTime { n: 1, period_s, samples: 1, model_avar: 0.0, adev_of: &|_, _| None };
        let of_signal = |effect: &Effect| match effect {
            Effect::ModulatedLine(_) | Effect::Chirp(_) | Effect::Periodic(_) | Effect::ShotNoise(_) => true,
            other => other.is_line(),
        };
        let signals = self.others().filter(|other| of_signal(&other.effect));
        let added: AddedVariance = signals.map(|other| other.effect.kind().avar(&at)).sum();
        ((added.modelled + added.corrected) / avar).min(1.0)
    }

    fn track(&self) -> Option<&'a FrequencyTrack> {
        self.signal(|signal| if let Signal::Chirp(of) = signal { Some(of) } else { None })
    }

    fn decays(&self) -> Option<&'a DecayingDisturbances> {
        self.signal(Signal::decays)
    }
}

impl CauseClaim<'_> {
    /// True if the channel has a line in common with others within the band of a drift.
    fn is_line_within(&self, drift: &CommonMode) -> bool {
        let is_within = |shown: &Shown| {
            let frequency_hz = shown.effect.frequency_hz();
            shown.channel == self.channel
                && frequency_hz.is_some_and(|of| TAU * of.value * drift.time_constant_s.value < WITHIN_COMMON_MODE)
        };
        self.periodic.iter().any(|cause| cause.shown.len() > 1 && cause.shown.iter().any(is_within))
    }

    /// True if the channel has a periodic signal that may have the two levels.
    fn is_of_period(&self, levels: &TelegraphNoise) -> bool {
        let BoundedEstimate { low, high, .. } = levels.time_constant_s;
        let has_levels = |shown: &Shown| match &shown.effect {
            Effect::Periodic(of) if shown.channel == self.channel => {
                let turns = |time_constant_s: f64| time_constant_s * of.frequency_hz.value;
                turns(high) > LEAST_OF_PERIOD && turns(low) < LARGEST_OF_PERIOD
            }
            _ => false,
        };
        self.periodic.iter().any(|cause| cause.shown.iter().any(has_levels))
    }
}

/// True if the data shows an effect: the interval of its size excludes 0, and it lasts no longer than the record's `duration_s`.
fn is_shown(effect: &Effect, duration_s: f64) -> bool {
    let time_constant_s = match effect {
        Effect::MarkovProcess(of) => Some(of.time_constant_s),
        Effect::TelegraphNoise(of) => Some(of.time_constant_s),
        Effect::CommonMode(of) => Some(of.time_constant_s),
        _ => None,
    };
    let excludes_0 = |of: BoundedEstimate| of.low > 0.0 || of.high < 0.0;
    // One of several axes may be 0, and an unexplained departure is reported with the size that it has.
    let may_be_0 = matches!(effect, Effect::AccelerationSensitivity(_) | Effect::Unexplained(_));
    time_constant_s.is_none_or(|of| of.value < duration_s) && (may_be_0 || effect.sizes().all(excludes_0))
}

fn refutation(effect: &Effect) -> Option<&Refutation> {
    match effect {
        Effect::Unexplained(Unexplained { observation: Observation::RefutedTerm { by, .. }, .. }) => Some(by),
        _ => None,
    }
}

fn is_absent_in_spectrum(effect: &Effect) -> bool {
    matches!(refutation(effect), Some(Refutation::NotInSpectrum { .. }))
}

/// True if the kurtosis of the curve decides that it is no Gaussian process.
fn is_by_kurtosis(effect: &Effect) -> bool {
    let is_refuted =
        matches!(refutation(effect), Some(Refutation::RareDisturbances { .. } | Refutation::UndecidedLevels { .. }));
    is_refuted || matches!(effect, Effect::TelegraphNoise(_))
}

/// True if it is an octave of the curve, and no line.
fn is_octave(effect: &Effect) -> bool {
    matches!(effect, Effect::Unexplained(of) if of.frequency_hz().is_none())
}

fn telegraph(effect: &Effect) -> Option<&TelegraphNoise> {
    if let Effect::TelegraphNoise(of) = effect { Some(of) } else { None }
}

/// True if two levels explain more than disturbances that decay as slowly, each over a Gaussian process: a normal sum of `z` standard
/// deviations has a ln likelihood ratio of z²/2.
fn are_likelier(levels: &TelegraphNoise, decays: &DecayingDisturbances) -> bool {
    let is_as_slow = is_same_time(levels.time_constant_s.value, decays.time_constant.value);
    matches!(levels.evidence, TelegraphEvidence::Levels { gain, .. } if is_as_slow && gain > 0.5 * decays.sum.powi(2))
}

/// The end of an interval that is nearer to 0.
fn least(size: BoundedEstimate) -> f64 {
    size.low.abs().min(size.high.abs())
}
