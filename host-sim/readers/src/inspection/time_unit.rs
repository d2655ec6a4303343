//! Units of times by the sample rate.

use crate::columns::unit::Unit;
use crate::rows::batch::usual_unit;

/// The likeliest first, Hz.
const LIKELY_HZ: [std::ops::RangeInclusive<f64>; 2] = [10.0..=10_000.0, 0.2..=40_000.0];

pub(crate) fn time_unit(times: &[f64]) -> Option<(Unit, String)> {
    let finite: Vec<f64> = times.iter().copied().filter(|time| time.is_finite()).collect();
    let (origin, last) = (*finite.first()?, *finite.last()?);
    let since: Vec<f64> = finite.iter().map(|time| time - origin).collect();
    if let Some(unit) = usual_unit(&since, origin) {
        return Some((unit, String::new()));
    }
    let interval = (last - origin) / (finite.len().max(2) - 1) as f64;
    let units = ["ms", "us", "ns"].into_iter().filter_map(Unit::parse);
    let unit_of = |rates: &std::ops::RangeInclusive<f64>| {
        units.clone().find(|unit| rates.contains(&(interval * unit.factor).recip()))
    };
    let unit = LIKELY_HZ.iter().find_map(unit_of)?;
    let hz = (interval * unit.factor).recip();
    Some((unit, format!("a step of {interval:.4} in {} is {hz:.2} Hz", unit.name)))
}
