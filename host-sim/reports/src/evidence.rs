//! The evidence of an effect in words: measured value, threshold, usual causes.

use crate::finding_text::{Label, Sentences};
use noise_analysis::effects::Effect;
use noise_analysis::report::Finding;

/// Names and signs of the evidence, and of screen and page.
const DISPLAYED: [(&str, &str); 4] = [("gyro_", "gyro "), ("accl_", "accel "), ("magn_", "magn "), (" -", " −")];

pub(crate) fn of_effect(effect: &Effect) -> String {
    displayed(&of_kind(effect))
}

/// The evidence in the channel that shows a finding most clearly.
pub(crate) fn of_finding(finding: &Finding) -> String {
    let evidence = of_kind(&finding.effect);
    match finding.channels.len() {
        0 | 1 => displayed(&evidence),
        count => {
            displayed(&format!("{}: {evidence}; one cause in {count} channels", finding.channels[finding.clearest]))
        }
    }
}

fn of_kind(effect: &Effect) -> String {
    Sentences::new(effect, &[], Label::Nothing, false).sentence(2).unwrap_or_default()
}

fn displayed(text: &str) -> String {
    let text = text.strip_prefix('-').map_or_else(|| text.to_owned(), |number| format!("−{number}"));
    DISPLAYED.iter().fold(text, |text, (name, shown)| text.replace(name, shown))
}
