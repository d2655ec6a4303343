//! Unknown properties of the sensor's clock and filter, in sentences.

use crate::finding_text::Sentences;
use noise_analysis::report::PartNote;

/// The sentence of the page, `--full` and the JSON.
pub(crate) fn sentence(note: &PartNote) -> String {
    Sentences::of("note", note).sentence(0).unwrap_or_default()
}

/// Shorter sentences for the screen; a stated rate only if it contradicts the nominal clock.
pub(crate) fn in_short(notes: &[PartNote]) -> Vec<String> {
    let of = |note: &PartNote| match note {
        PartNote::NoTimeStamps { sample_rate_hz: of, stated_hz, nominal_hz } => {
            (*nominal_hz <= 0.0 || !(of.low..=of.high).contains(stated_hz)).then(|| sentence(note))
        }
        _ => Sentences::of("note", note).sentence(1),
    };
    notes.iter().filter_map(of).collect()
}
