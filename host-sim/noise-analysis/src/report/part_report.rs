//! The sensor's clock and its low-pass filter in a report.

use crate::bounds::{BoundedEstimate, MeasuredValue, Parameter};
use crate::distributions::NORMAL_975;
use crate::fit::part_filter::{PartFilter, Unidentified};
use crate::record::sampling_faults::rate_by_time_stamps;
use crate::report::{PartNote, PartReport};
use allan_core::NoiseTerm;
use allan_core::term::MovingAverageFilter;
use measurement::Measurement;

/// The report on the filter that the inertial channels of a recording have in common; `measurement` has its first samples, or all of them.
pub(crate) fn report(measurement: &Measurement, common: &Result<PartFilter, Unidentified>) -> PartReport {
    let name = measurement.profile.name.to_owned();
    match common {
        Ok(common) => match common.term {
            NoiseTerm::Filtered(filter) => averages(measurement, (common, filter), name),
            // It says nothing of the sensor's clock.
            _ => PartReport { name, filter: Some(common.term.name().to_owned()), ..PartReport::default() },
        },
        Err(unidentified) => {
            PartReport { name, notes: vec![reason(measurement, unidentified)], ..PartReport::default() }
        }
    }
}

fn averages(
    measurement: &Measurement,
    (common, filter): (&PartFilter, MovingAverageFilter),
    name: String,
) -> PartReport {
    let decimation = &common.adjusted;
    let taps = f64::from(filter.taps);
    let BoundedEstimate { value, low, high } = *decimation;
    let window = if filter.stages == 2 { "bartlett" } else { "moving_average" };
    let rate = rate_by_time_stamps(measurement);
    let clock = rate.map(|MeasuredValue { value: rate, error }| {
        // Relative half-widths of two independent factors.
        let half = |bound: f64| (bound / value - 1.0).hypot(NORMAL_975 * error / rate);
        let clock = value * rate;
        Parameter::new(clock, clock * (1.0 - half(low)), clock * (1.0 + half(high)), "Hz")
    });
    let without_stamps = clock.is_none().then(|| without_stamps(measurement, *decimation));
    let length = taps_by_clock(measurement, (common, filter));
    PartReport {
        name,
        clock,
        filter: Some(window.to_owned()),
        taps: Some(Parameter::new(taps, taps, taps, "")),
        decimation: Some(Parameter::new(value, low, high, "")),
        notes: without_stamps.into_iter().chain(length).chain(contradictions(common)).collect(),
    }
}

/// Why there is no clock, and the sample rate that the nominal clock would mean.
fn without_stamps(measurement: &Measurement, decimation: BoundedEstimate) -> PartNote {
    let stated_hz = measurement.sample_rate_hz;
    if decimation.value == 1.0 {
        return PartNote::StatedClock { sample_rate_hz: stated_hz };
    }
    let nominal_hz = measurement.profile.internal_rate_hz;
    let [value, low, high] =
        [decimation.value, decimation.high, decimation.low].map(|decimation| nominal_hz / decimation);
    PartNote::NoTimeStamps { nominal_hz, sample_rate_hz: BoundedEstimate { value, low, high }, stated_hz }
}

/// The note that the taps follow from the nominal clock, if the curves allow others.
fn taps_by_clock(measurement: &Measurement, (common, filter): (&PartFilter, MovingAverageFilter)) -> Option<PartNote> {
    let PartFilter { other_taps, .. } = common;
    (!other_taps.is_empty() && filter.decimation != 1.0).then(|| PartNote::LengthAlone {
        length: f64::from(filter.stages) * f64::from(filter.taps) / filter.decimation,
        taps: filter.taps,
        other_taps: other_taps.clone(),
        nominal_hz: measurement.profile.internal_rate_hz,
    })
}

/// Which channels one filter for all does not describe.
fn contradictions(common: &PartFilter) -> impl Iterator<Item = PartNote> {
    let &PartFilter { ref contradicting, shown: (showing, able), .. } = common;
    let alone = contradicting.iter().map(|&(channel, decimation)| PartNote::Contradicted { channel, decimation });
    alone.chain((showing < able).then_some(PartNote::NotInAll { showing, able }))
}

fn reason(measurement: &Measurement, unidentified: &Unidentified) -> PartNote {
    match unidentified {
        Unidentified::NotDithered => PartNote::CountsTooCoarse,
        Unidentified::NotCorrelated => PartNote::NotCorrelated { period_s: measurement.period_s() },
        Unidentified::NotSought => PartNote::NotSought,
        Unidentified::Minority(names) => PartNote::Minority(names.clone()),
    }
}
