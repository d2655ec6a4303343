//! The findings in their order, and what there is to do.

use super::channels::is_inertial;
use super::condition::{longest_at_rest, time_options};
use crate::finding_text::{FindingText, channel_list, describe, largest, shown_effects};
use noise_analysis::effects::Effect;
use noise_analysis::report::{Finding, Report, Stretch};

/// Largest relative difference of a finding's and a followed line's frequency: half the step of the ratios.
const SAME_LINE: f64 = 0.1;

const MOST_STEPS: usize = 3;

/// Order of the findings: motion, causes in inertial channels, in conditions, unexplained; then by what they cost: their share of the variance
/// of an angle or a velocity after a minute, and then the largest share at any time.
pub(crate) fn finding_order(report: &Report) -> Vec<usize> {
    let rank = |&index: &usize| {
        let Finding { effect, channels, .. } = &report.findings[index];
        match effect {
            Effect::MotionInterval(_) => 0,
            Effect::Unexplained(_) => 3,
            _ => 1 + u8::from(!channels.iter().any(|name| is_inertial(name))),
        }
    };
    let shares = |index: &usize| {
        let Finding { share_percent, minute_percent, .. } = &report.findings[*index];
        [minute_percent, share_percent].map(largest)
    };
    let by_cost = |a: &usize, b: &usize| {
        let ([a_minute, a_largest], [b_minute, b_largest]) = (shares(a), shares(b));
        b_minute.total_cmp(&a_minute).then(b_largest.total_cmp(&a_largest))
    };
    let mut order: Vec<usize> = (0..report.findings.len()).collect();
    order.sort_by(|a, b| rank(a).cmp(&rank(b)).then_with(|| by_cost(a, b)));
    order
}

fn named_findings(report: &Report) -> Vec<usize> {
    let is_named = |&index: &usize| !matches!(report.findings[index].effect, Effect::Unexplained(_));
    finding_order(report).into_iter().filter(is_named).collect()
}

pub(crate) fn finding_text(report: &Report, index: usize) -> FindingText {
    let finding = &report.findings[index];
    let mut text = describe(finding, &shown_effects(report, index));
    if let Some(related) = related_line(report, finding) {
        text.weight = [text.weight, related].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("; ");
    }
    text
}

/// Findings in words in their order, and the unexplained ones.
pub fn findings(report: &Report) -> (Vec<FindingText>, Vec<FindingText>) {
    let named = named_findings(report).len();
    let mut texts: Vec<FindingText> =
        finding_order(report).into_iter().map(|index| finding_text(report, index)).collect();
    let unexplained = texts.split_off(named);
    (texts, unexplained)
}

fn related_line(report: &Report, finding: &Finding) -> Option<String> {
    let frequency = finding.effect.frequency_hz()?.value;
    let of = finding.channels.iter().find_map(|name| {
        let channel = report.channels.iter().find(|channel| channel.name == *name)?;
        let related = channel.nonstationarity.as_ref()?.related_line.as_ref()?;
        let followed = related.line_hz.iter().sum::<f64>() / related.line_hz.len().max(1) as f64;
        ((frequency / followed - 1.0).abs() < SAME_LINE).then_some(related)
    })?;
    let other = channel_list([&of.channel]);
    let at = match of.ratio {
        (1, 1) => "at the same frequency".to_owned(),
        (above, below) => format!("at {above}/{below} of the frequency"),
    };
    Some(format!("a line of {other} moves with it, {at}"))
}

/// Advice in the order of the findings, with their numbers; rest comes first.
pub(crate) fn advice(report: &Report) -> Vec<(String, Vec<usize>)> {
    let is_motion = |index: usize| matches!(report.findings[index].effect, Effect::MotionInterval(_));
    let at_rest = longest_at_rest(report);
    let mut steps: Vec<(String, Vec<usize>)> = Vec::new();
    for (position, index) in named_findings(report).into_iter().enumerate() {
        let step = match at_rest.filter(|_| is_motion(index)) {
            Some(Stretch { from_s, to_s }) => {
                Some(format!("Analyse the part at rest alone: add {}.", time_options(from_s, to_s)))
            }
            None => finding_text(report, index).step,
        };
        let Some(step) = step else { continue };
        match steps.iter_mut().find(|(known, _)| *known == step) {
            Some((_, numbers)) => numbers.push(position + 1),
            None => steps.push((step, vec![position + 1])),
        }
    }
    steps.truncate(MOST_STEPS);
    steps
}

/// Advice with the numbers of its findings: `Look for a fan, a motor or the mains (2, 5).`
pub fn numbered_steps(report: &Report) -> Vec<String> {
    let numbered = |(step, numbers): (String, Vec<usize>)| {
        let numbers: Vec<String> = numbers.iter().map(usize::to_string).collect();
        format!("{} ({}).", step.trim_end_matches('.'), numbers.join(", "))
    };
    advice(report).into_iter().map(numbered).collect()
}
