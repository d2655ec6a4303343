//! One channel of one part: what it follows, and what its model lacks.

use super::parts::Part;
use super::repairs::is_slow;
use crate::OCTAVES;
use crate::detectors::bias::BiasSensitivity;
use allan_core::regression::{CovarianceCurve, Covariate, CovariateRegression, Sensitivity};
use allan_core::term::{Markov, MovingAverageFilter};
use allan_core::trace::{LineCandidates, Trace, trace};
use allan_core::{Curve, NoiseTerm};
use measurement::{ChannelProfile, Quantity};

/// Probability of the residual under a model below which another one is tried.
const UNEXPLAINED: f64 = 1e-3;

/// Degrees of freedom of a course: the stretches that a record is cut into, nearly.
const FREE: f64 = crate::detectors::block_means::BLOCKS as f64;

/// The covariates of a channel in a part, ready for the regression.
pub(super) struct Surroundings {
    channel: Curve<OCTAVES>,
    /// Where the covariates stand in the part.
    members: Vec<usize>,
    covariates: Vec<Covariate<OCTAVES>>,
    with_channel: Vec<CovarianceCurve<OCTAVES>>,
    mutual: Vec<CovarianceCurve<OCTAVES>>,
}

/// What a channel follows in one part.
pub(super) struct Following {
    surroundings: Surroundings,
    /// In the order of [`Surroundings`].
    pub followed: Vec<Sensitivity>,
    /// The channel without what it follows.
    pub curve: Curve<OCTAVES>,
}

/// What was learnt of a channel from one part.
pub(super) struct Study {
    pub following: Following,
    pub trace: Trace,
}

impl Surroundings {
    fn of(part: &Part, channel: usize, known: Option<&Self>) -> Self {
        let members: Vec<usize> = causes(part.channels[channel], part).collect();
        let covariate = |(index, &member): (usize, &usize)| match known {
            Some(known) => known.covariates[index].continued(&part.curve(member), 1),
            None => Covariate::new(&part.curve(member), part.step(member), 1),
        };
        let pairs = members.iter().enumerate().flat_map(|(i, &a)| members[..i].iter().map(move |&b| (a, b)));
        Self {
            channel: part.curve(channel),
            covariates: members.iter().enumerate().map(covariate).collect(),
            with_channel: members.iter().map(|&member| part.shared(channel, member)).collect(),
            mutual: pairs.map(|(a, b)| part.shared(a, b)).collect(),
            members,
        }
    }

    /// What `work` makes of the channel beside its covariates.
    fn beside<T>(&self, work: impl FnOnce(&CovariateRegression<OCTAVES>) -> T) -> T {
        let covariance = |with: Option<usize>, covariate: usize, n: u64| {
            let shared = match with {
                None => &self.with_channel[covariate],
                Some(other) => {
                    let (high, low) = (covariate.max(other), covariate.min(other));
                    &self.mutual[high * (high - 1) / 2 + low]
                }
            };
            shared.iter().find(|point| point.n == n).map(|point| point.covariance)
        };
        work(&CovariateRegression { channel: &self.channel, covariates: &self.covariates, covariance: &covariance })
    }
}

impl Following {
    /// From the differences that `part` has summed, and from the courses of slow causes: `slow` tells how the channel
    /// follows one of them. Of the two the one counts that is clearer. Where the channel `ramps`, the differences follow
    /// whatever else drifts, and the course alone counts.
    pub(super) fn of(
        part: &Part,
        channel: usize,
        ramps: bool,
        slow: impl Fn(ChannelProfile) -> Option<BiasSensitivity>,
    ) -> Self {
        let surroundings = Surroundings::of(part, channel, None);
        let mut followed: Vec<Sensitivity> = surroundings.beside(|beside| beside.sensitivities()).into_iter().collect();
        for (covariate, &member) in surroundings.members.iter().enumerate() {
            let cause = part.channels[member];
            let Some(BiasSensitivity { sensitivity: value, error }) = slow(cause) else {
                followed.retain(|known| known.covariate != covariate || !ramps || !is_slow(cause));
                continue;
            };
            match followed.iter_mut().find(|known| known.covariate == covariate) {
                Some(known) if known.error <= error => {}
                Some(known) => *known = Sensitivity { covariate, value, error, degrees_of_freedom: FREE },
                None => followed.push(Sensitivity { covariate, value, error, degrees_of_freedom: FREE }),
            }
        }
        let curve = surroundings.beside(|beside| beside.compensated(&followed));
        Self { surroundings, followed, curve }
    }

    /// The curve of the same channel in another part, compensated with what was learnt here.
    pub(super) fn compensated(&self, part: &Part, channel: usize) -> Curve<OCTAVES> {
        let surroundings = Surroundings::of(part, channel, Some(&self.surroundings));
        surroundings.beside(|beside| beside.compensated(&self.followed))
    }

    /// What the channel follows: each covariate's place in the part, with the sensitivity.
    pub(super) fn causes(&self) -> impl Iterator<Item = (usize, &Sensitivity)> {
        self.followed.iter().map(|followed| (self.surroundings.members[followed.covariate], followed))
    }
}

impl Study {
    /// Leaves it at the declared model.
    pub(super) fn declared(following: Following) -> Self {
        let trace = Trace::baseline(&following.curve);
        Self { following, trace }
    }

    /// Traces what the channel lacks; `lines` are those that a spectrum has shown.
    pub(super) fn traced(following: Following, lines: &[NoiseTerm], filters: &[MovingAverageFilter]) -> Self {
        let trace = traced(&following.curve, lines, filters);
        Self { following, trace }
    }

    /// What the channel follows: each covariate's place in the part, with the sensitivity.
    pub(super) fn causes(&self) -> impl Iterator<Item = (usize, &Sensitivity)> {
        self.following.causes()
    }

    /// Correlation times of the Markov processes that were found, s.
    pub(super) fn correlation_times(&self) -> impl Iterator<Item = f64> {
        self.trace.after.terms().iter().filter_map(|term| match term.kind {
            NoiseTerm::Markov(Markov { time_constant }) => Some(time_constant),
            _ => None,
        })
    }
}

/// With the lines of the spectrum, or, where these do not explain the curve, with what the curve itself shows: a line that
/// wanders is many in the spectrum of a long record and one in the curve.
fn traced(curve: &Curve<OCTAVES>, lines: &[NoiseTerm], filters: &[MovingAverageFilter]) -> Trace {
    let known = trace(curve, LineCandidates::Spectrum(lines), filters);
    if lines.is_empty() || known.after_goodness.p_value > UNEXPLAINED {
        return known;
    }
    let own = trace(curve, LineCandidates::Curve, filters);
    if own.after_goodness.deviance < known.after_goodness.deviance { own } else { known }
}

/// Channels of `part` that `channel` may follow: temperature, supply, and for a gyroscope the specific force.
fn causes(channel: ChannelProfile, part: &Part) -> impl Iterator<Item = usize> {
    let quantities: &[Quantity] = match channel.quantity {
        Quantity::AngularRate => &[Quantity::Temperature, Quantity::SupplyVoltage, Quantity::SpecificForce],
        Quantity::SpecificForce => &[Quantity::Temperature, Quantity::SupplyVoltage],
        _ => &[],
    };
    let of = move |&quantity: &Quantity| {
        (0..part.channels.len()).filter(move |&place| part.channels[place].quantity == quantity)
    };
    quantities.iter().flat_map(of)
}
