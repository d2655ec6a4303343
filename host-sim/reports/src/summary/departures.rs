//! Places at which nothing with a name explains the data.

use crate::finding_text::{channel_list, departure, excess_percent, shown_effects};
use crate::formatting::counted_places;
use noise_analysis::effects::{Effect, Unexplained};
use noise_analysis::report::Report;

struct Departure<'a> {
    of: &'a Unexplained,
    /// In words, without its size.
    place: String,
    is_above: Option<bool>,
    channels: Vec<String>,
    excesses: Vec<f64>,
}

impl Departure<'_> {
    fn largest(&self) -> f64 {
        self.excesses.iter().map(|of| of.abs()).fold(0.0, f64::max)
    }

    fn text(&self) -> String {
        format!("{}: {}", channel_list(&self.channels), departure(self.of, &self.excesses))
    }
}

/// Departures from every model; equal places of one sign are merged, and told once per channel.
fn departures(report: &Report) -> Vec<Departure<'_>> {
    let mut departures: Vec<Departure<'_>> = Vec::new();
    for (number, finding) in report.findings.iter().enumerate() {
        let Effect::Unexplained(of) = &finding.effect else { continue };
        let mut excesses = excess_percent(&shown_effects(report, number));
        if excesses.is_empty() {
            excesses.extend(of.excess_percent.map(|of| of.value));
        }
        let (place, is_above) = (departure(of, &[]), of.excess_percent.map(|of| of.value >= 0.0));
        let is_same = |of: &Departure<'_>| of.place == place && of.is_above == is_above;
        let is_told = |of: &Departure<'_>| finding.channels.iter().all(|name| of.channels.contains(name));
        if departures.iter().any(|of| is_same(of) && is_told(of)) {
            continue;
        }
        let is_of_others = |of: &Departure<'_>| finding.channels.iter().all(|name| !of.channels.contains(name));
        match departures.iter_mut().find(|of| is_same(of) && is_of_others(of)) {
            Some(known) => {
                known.channels.extend(finding.channels.iter().cloned());
                known.excesses.extend(excesses);
            }
            None => departures.push(Departure { of, place, is_above, channels: finding.channels.clone(), excesses }),
        }
    }
    departures
}

pub fn unexplained(report: &Report) -> Vec<String> {
    departures(report).iter().map(Departure::text).collect()
}

pub(crate) fn unexplained_in_short(report: &Report) -> Option<String> {
    let departures = departures(report);
    let largest = departures.iter().max_by(|a, b| a.largest().total_cmp(&b.largest()))?;
    Some(counted_places(departures.len(), &largest.text()))
}
