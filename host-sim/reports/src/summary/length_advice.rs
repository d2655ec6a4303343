//! The coefficients that a record of this length gives, and the length that the others need.

use super::channels::inertial;
use super::condition::report_length_s;
use crate::coefficients::{KINDS, LETTERS, coefficient};
use crate::finding_text::channel_list;
use crate::formatting::enumerated;
use crate::rounding::{is_upper_bound, significant, span};
use noise_analysis::report::{ChannelReport, Parameter, Report};

/// Largest relative half-width called ±20 %.
const KNOWN: f64 = 0.205;

/// Largest extrapolation, in record lengths.
const FARTHEST: f64 = 10.0;

/// Shortest record, s, that may lack B and K without a remark.
const SHORT_S: f64 = 600.0;

/// Coefficients within ±20 %, recording time for others, and limits.
#[derive(Default)]
pub(super) struct LengthAdvice {
    pub known: Option<String>,
    pub except: Vec<String>,
    pub longer: Option<String>,
    pub limits: Option<String>,
}

enum Knowledge {
    Known,
    /// Wider; the additional recording time, s, may be infinite.
    Wide(f64),
    Bounded,
}

/// Larger side of the interval, relative.
fn relative_error(of: &Parameter) -> f64 {
    (of.high - of.value).max(of.value - of.low) / of.value
}

fn knowledge(report: &Report, kind: &str) -> Vec<(String, Knowledge)> {
    let of = |channel: &ChannelReport| {
        let value = coefficient(channel, kind)?;
        let record = channel.assessment.record.iter().find(|record| record.kind == kind);
        let known = match record {
            _ if is_upper_bound(value.value, value.low) => Knowledge::Bounded,
            _ if relative_error(&value) <= KNOWN => Knowledge::Known,
            Some(record) => Knowledge::Wide(record.more_hours.map_or(f64::INFINITY, |hours| 3600.0 * hours)),
            None => Knowledge::Wide(0.0),
        };
        Some((channel.name.clone(), known))
    };
    inertial(report).filter(|channel| !channel.assessment.record.is_empty()).filter_map(of).collect()
}

/// Too short: most channels have only limits for B and K.
pub(super) fn is_short(report: &Report) -> bool {
    let shows = |channel: &ChannelReport| {
        KINDS[1..].iter().filter_map(|kind| coefficient(channel, kind)).any(|of| !is_upper_bound(of.value, of.low))
    };
    report_length_s(report) < SHORT_S && {
        let (showing, all) = (inertial(report).filter(|channel| shows(channel)).count(), inertial(report).count());
        all > 0 && 2 * showing < all
    }
}

fn use_of_short_record(report: &Report) -> String {
    let length = span(report_length_s(report));
    let is_known = |(_, n): &(String, Parameter)| !is_upper_bound(n.value, n.low) && relative_error(n).is_finite();
    let all = inertial(report).filter_map(|channel| Some((channel.name.clone(), coefficient(channel, KINDS[0])?)));
    let (known, bounded): (Vec<_>, Vec<_>) = all.partition(is_known);
    if known.is_empty() {
        return format!("{length}: too short for N, B, K and a filter.");
    }
    let percent = 100.0 * known.iter().map(|(_, n)| relative_error(n)).fold(0.0, f64::max);
    let names: Vec<String> = bounded.into_iter().map(|(name, _)| name).collect();
    let except = if names.is_empty() { String::new() } else { format!(" except in {}", channel_list(&names)) };
    let rough = if percent < 5.0 { "" } else { "a rough " };
    format!(
        "{length}: good for {rough}N (±{} %){except} and for strong lines; not for B, K or a filter.",
        significant(percent, 1)
    )
}

/// Empty without an inertial channel.
pub(super) fn length_advice(report: &Report) -> LengthAdvice {
    if is_short(report) {
        return LengthAdvice { known: Some(use_of_short_record(report)), ..LengthAdvice::default() };
    }
    let [mut known, mut except, mut longer, mut much_longer, mut bounded, mut in_some] =
        [(); 6].map(|()| Vec::<String>::new());
    for (kind, letter) in KINDS.into_iter().zip(LETTERS) {
        let all = knowledge(report, kind);
        let named = |is_one: &dyn Fn(&Knowledge) -> bool| -> Vec<String> {
            all.iter().filter(|(_, of)| is_one(of)).map(|(name, _)| name.clone()).collect()
        };
        let unknown = named(&|of| !matches!(of, Knowledge::Known));
        let limited = named(&|of| matches!(of, Knowledge::Bounded));
        let seconds = |(_, of): &(String, Knowledge)| if let Knowledge::Wide(seconds) = of { *seconds } else { 0.0 };
        let most = all.iter().map(seconds).fold(0.0, f64::max);
        match unknown.len() {
            _ if all.is_empty() => continue,
            0 => known.push(letter.to_owned()),
            some if some == limited.len() && some == all.len() => bounded.push(letter.to_owned()),
            some if 2 * some <= all.len() => {
                except.push(format!("{letter} is known to ±20 % except in {}.", channel_list(&unknown)));
            }
            _ if !limited.is_empty() => in_some.push(format!("for {letter} in {}", channel_list(&limited))),
            _ => {}
        }
        if most > FARTHEST * report_length_s(report) {
            much_longer.push(letter.to_owned());
        } else if most > 0.0 {
            longer.push(format!("{letter} needs {} more", hours(most / 3600.0)));
        }
    }
    let told = |parts: &[String], text: fn(&str, bool) -> String| {
        (!parts.is_empty()).then(|| text(&enumerated(parts), parts.len() == 1))
    };
    longer.extend(told(&much_longer, |letters, is_one| {
        format!("{letters} {} a much longer record", if is_one { "needs" } else { "need" })
    }));
    in_some.splice(0..0, told(&bounded, |letters, _| format!("for {letters}")));
    LengthAdvice {
        known: told(&known, |letters, is_one| {
            format!("{letters} {} known to ±20 %.", if is_one { "is" } else { "are" })
        }),
        except,
        longer: told(&longer, |needs, _| format!("For ±20 %, {needs}.")),
        limits: told(&in_some, |places, _| format!("The record gives only an upper limit {places}.")),
    }
}

fn hours(hours: f64) -> String {
    match hours {
        hours if hours < 1.0 => span(3600.0 * hours),
        hours if hours < 10.0 => format!("{} h", significant(hours, 2)),
        hours if hours < 72.0 => format!("{hours:.0} h"),
        hours => format!("{:.0} days", hours / 24.0),
    }
}
