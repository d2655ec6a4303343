//! Unknown properties of the sensor's clock and filter, in sentences.

use crate::finding_text::channel_list;
use crate::formatting::{capital, enumerated};
use crate::rounding::{estimate, plain, quantity, significant};
use noise_analysis::report::PartNote;

const NOT_CORRELATED: &str =
    "No low-pass filter found: consecutive samples are uncorrelated, so N is valid from one sample on.";
const SCALES: &str = "Every τ and N scale with it.";

/// The sentence of the page, `--full` and the JSON.
pub(crate) fn sentence(note: &PartNote) -> String {
    match note {
        PartNote::NotSought => "A quick report does not look for the part's clock and filter.".to_owned(),
        PartNote::CountsTooCoarse => {
            "The part's filter does not show: the noise of every gyro and accelerometer is smaller than a count, and rounding hides it."
                .to_owned()
        }
        PartNote::NotCorrelated { period_s } => format!(
            "{NOT_CORRELATED} There is no filter, or it is shorter than the sample period of {}.",
            quantity(*period_s, "s")
        ),
        PartNote::Minority(channels) if channels.is_empty() => {
            "The channels together look as if behind a low-pass filter, but none of them alone: it is not taken for one of the part."
                .to_owned()
        }
        PartNote::Minority(channels) => {
            let each: Vec<String> = channels.iter().map(|channel| channel_list([channel])).collect();
            format!(
                "Only {} {} correlated as behind a low-pass filter; most channels are not, so it is not the part's own filter.",
                enumerated(&each),
                if each.len() == 1 { "is" } else { "are" }
            )
        }
        PartNote::StatedClock { sample_rate_hz } => format!(
            "The sample rate is the part's clock, as every value of the filter is recorded. Without time stamps it is not measured: \
             it is the stated {} Hz. {SCALES}",
            plain(*sample_rate_hz, 6)
        ),
        // Without a data sheet no clock is known.
        PartNote::NoTimeStamps { nominal_hz, stated_hz, .. } if *nominal_hz <= 0.0 => {
            format!("Without time stamps the sample rate is the stated {} Hz. {SCALES}", plain(*stated_hz, 6))
        }
        PartNote::NoTimeStamps { nominal_hz, sample_rate_hz, stated_hz } => format!(
            "Without time stamps the sample rate is the stated {} Hz; by the part's nominal clock of {} Hz it \
             would be {} Hz. {SCALES}",
            plain(*stated_hz, 6),
            plain(*nominal_hz, 4),
            estimate(sample_rate_hz.value, sample_rate_hz.low, sample_rate_hz.high)
        ),
        PartNote::LengthAlone { length, taps, other_taps, nominal_hz } => format!(
            "The spectra give the length of the filter, {} samples, and not its taps. {taps} taps are nearest to the nominal clock of {} \
             Hz; {} taps at another clock have the same length.",
            significant(*length, 3),
            plain(*nominal_hz, 4),
            other_taps.iter().map(u16::to_string).collect::<Vec<_>>().join(" or ")
        ),
        PartNote::Contradicted { channel, decimation } => format!(
            "{} alone would have its filter read every {} values, farther from the common figure than chance explains.",
            capital(&channel_list([channel])),
            significant(*decimation, 4)
        ),
        PartNote::NotInAll { showing, able } => {
            format!("The filter shows in {showing} of the {able} channels whose noise is larger than a count.")
        }
    }
}

/// Shorter sentences for the screen; a stated rate only if it contradicts the nominal clock.
pub(crate) fn in_short(notes: &[PartNote]) -> Vec<String> {
    let of = |note: &PartNote| match note {
        PartNote::CountsTooCoarse => {
            Some("The noise is smaller than a count, which hides the part's filter.".to_owned())
        }
        PartNote::NotCorrelated { .. } => Some(NOT_CORRELATED.to_owned()),
        PartNote::StatedClock { .. } => {
            Some(format!("Without time stamps the sample rate is the stated one. {SCALES}"))
        }
        PartNote::NoTimeStamps { sample_rate_hz: of, stated_hz, nominal_hz } => {
            (*nominal_hz <= 0.0 || !(of.low..=of.high).contains(stated_hz)).then(|| sentence(note))
        }
        PartNote::NotSought
        | PartNote::Minority(_)
        | PartNote::LengthAlone { .. }
        | PartNote::Contradicted { .. }
        | PartNote::NotInAll { .. } => None,
    };
    notes.iter().filter_map(of).collect()
}
