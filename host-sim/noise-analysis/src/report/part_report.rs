//! What a report says of the sensor's clock and of its low-pass filter.

use crate::bounds::{BoundedEstimate, MeasuredValue, Parameter};
use crate::distributions::NORMAL_975;
use crate::fit::part_filter::{PartFilter, Unidentified};
use crate::record::sampling_faults::rate_by_time_stamps;
use crate::report::PartReport;
use measurement::Measurement;

/// Why there is neither clock nor filter where the samples are not used.
pub(crate) const NOT_SOUGHT: &str = "clock and filter of the part are not estimated in a quick report";

/// The report on the filter that the inertial channels of a recording of so many samples have in common; `measurement` has its first
/// samples, or all of them.
pub(crate) fn report(measurement: &Measurement, samples: u64, common: &Result<PartFilter, Unidentified>) -> PartReport {
    let name = measurement.profile.name.to_owned();
    match common {
        Ok(common) => identified(measurement, common, name),
        Err(unidentified) => {
            PartReport { name, note: Some(reason(measurement, samples, unidentified)), ..PartReport::default() }
        }
    }
}

fn identified(measurement: &Measurement, common: &PartFilter, name: String) -> PartReport {
    let PartFilter { filter, decimation, .. } = common;
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
    let notes = [
        (clock.is_none()).then(|| without_stamps(measurement, *decimation)),
        taps_by_clock(measurement, common),
        contradiction(common),
    ];
    let note = notes.into_iter().flatten().collect::<Vec<_>>().join("; ");
    PartReport {
        name,
        clock,
        filter: Some(window.to_owned()),
        taps: Some(Parameter::new(taps, taps, taps, "")),
        decimation: Some(Parameter::new(value, low, high, "")),
        note: (!note.is_empty()).then_some(note),
    }
}

/// Why there is no clock, and the sample rate that the nominal clock would mean.
fn without_stamps(measurement: &Measurement, decimation: BoundedEstimate) -> String {
    if decimation.value == 1.0 {
        return format!(
            "every value of the filter is recorded, so that the clock is the sample rate; without time stamps that is known as \
             stated, {} Hz, and not measured",
            measurement.sample_rate_hz,
        );
    }
    let clock = measurement.profile.internal_rate_hz;
    let [rate, low, high] = [decimation.value, decimation.high, decimation.low].map(|decimation| clock / decimation);
    format!(
        "without time stamps the clock is not measured: with the nominal {clock} Hz of the part the samples are {rate:.2} Hz \
         [{low:.2}, {high:.2}], where {} Hz is stated",
        measurement.sample_rate_hz,
    )
}

/// That the taps follow from the nominal clock, where the curves allow others.
fn taps_by_clock(measurement: &Measurement, common: &PartFilter) -> Option<String> {
    let PartFilter { filter, other_taps, .. } = common;
    if other_taps.is_empty() || filter.decimation == 1.0 {
        return None;
    }
    let others = other_taps.iter().map(u16::to_string).collect::<Vec<_>>().join(", ");
    Some(format!(
        "the curves tell the filter's length in samples, {:.4}; of the settings that have it, {} taps are nearest to the \
         nominal clock of {} Hz, and {others} taps would have a decimation in proportion",
        f64::from(filter.stages) * f64::from(filter.taps) / filter.decimation,
        filter.taps,
        measurement.profile.internal_rate_hz,
    ))
}

/// Which channels one filter for all does not describe.
fn contradiction(common: &PartFilter) -> Option<String> {
    let PartFilter { contradicting, shown: (showing, dithered), .. } = common;
    let alone: Vec<String> = contradicting
        .iter()
        .map(|(name, decimation)| format!("{name} alone has a decimation of {decimation:.3}"))
        .collect();
    let alone = (!alone.is_empty()).then(|| {
        let all = alone.join(", ");
        format!("{all}: farther from the common one than chance explains, and its bounds are wider by that")
    });
    let missing =
        (showing < dithered).then(|| format!("{} of {dithered} dithered channels do not show it", dithered - showing));
    let parts: Vec<String> = alone.into_iter().chain(missing).collect();
    (!parts.is_empty()).then(|| parts.join("; "))
}

/// Why no filter is identified.
fn reason(measurement: &Measurement, samples: u64, unidentified: &Unidentified) -> String {
    match unidentified {
        Unidentified::NotDithered => {
            "no inertial channel is dithered: its noise is smaller than a step of its counts, whose rounding hides the \
             filter and the clock"
                .to_owned()
        }
        Unidentified::NotCorrelated => format!(
            "in {} samples the neighbours of the inertial channels are not correlated: there is no filter, or one that is shorter than \
             the sample period of {:.3} ms, and nothing tells its taps and its clock",
            samples,
            1e3 * measurement.period_s(),
        ),
        Unidentified::NotSought => NOT_SOUGHT.to_owned(),
        Unidentified::Minority(names) => format!(
            "only {} is correlated as behind a filter, which the other channels contradict: it is no filter of the part",
            names.join(" and "),
        ),
    }
}
