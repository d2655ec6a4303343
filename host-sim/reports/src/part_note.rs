//! What a record does not tell of the part's clock and filter, in sentences.

use crate::finding_text::channel_list;
use crate::formatting::capital;
use crate::rounding::{estimate, plain, quantity, significant};
use noise_analysis::report::PartNote;

/// What the record does not tell, and why: for the page, `--full` and the JSON.
pub(crate) fn sentence(note: &PartNote) -> String {
    match note {
        PartNote::NotSought => "A quick report does not look for the part's clock and filter.".to_owned(),
        PartNote::CountsTooCoarse => {
            "The part's filter does not show: the noise of every gyro and accelerometer is smaller than a count, and rounding hides it."
                .to_owned()
        }
        PartNote::NotCorrelated { period_s } => format!(
            "No low-pass filter shows: neighbouring samples are not correlated. There is none, or it is shorter than the sample period \
             of {}.",
            quantity(*period_s, "s")
        ),
        PartNote::Minority(channels) if channels.is_empty() => {
            "The channels together look as if behind a low-pass filter, but none of them alone: it is not taken for one of the part."
                .to_owned()
        }
        PartNote::Minority(channels) => format!(
            "{} alone is correlated as behind a low-pass filter. Most channels are not, so that it is none of the part.",
            capital(&names(channels))
        ),
        PartNote::StatedClock { sample_rate_hz } => format!(
            "The sample rate is the part's clock, as every value of the filter is recorded. Without time stamps it is not measured: \
             {} Hz is what was stated.",
            plain(*sample_rate_hz, 6)
        ),
        PartNote::NoTimeStamps { nominal_hz, sample_rate_hz, stated_hz } => format!(
            "Without time stamps the part's clock is not measured. At its nominal {} Hz the sample rate would be {} Hz; {} Hz \
             was stated.",
            plain(*nominal_hz, 4),
            estimate(sample_rate_hz.value, sample_rate_hz.low, sample_rate_hz.high),
            plain(*stated_hz, 6)
        ),
        PartNote::LengthAlone { length, taps, other_taps, nominal_hz } => format!(
            "The curves give the length of the filter, {} samples, and not its taps. {taps} taps are nearest to the nominal clock of {} \
             Hz; {} taps at another clock have the same length.",
            significant(*length, 3),
            plain(*nominal_hz, 4),
            other_taps.iter().map(u16::to_string).collect::<Vec<_>>().join(" or ")
        ),
        PartNote::Contradicted { channel, decimation } => format!(
            "{} alone would have its filter read every {} values, farther from the common figure than chance explains.",
            capital(&names(&[*channel])),
            significant(*decimation, 4)
        ),
        PartNote::NotInAll { showing, able } => {
            format!("The filter shows in {showing} of the {able} channels whose noise is larger than a count.")
        }
    }
}

/// The notes in short, for the screen, without what that does without.
pub(crate) fn in_short(notes: &[PartNote]) -> Vec<String> {
    let mut told: Vec<String> = Vec::new();
    let mut contradicting = Vec::new();
    for note in notes {
        match note {
            PartNote::CountsTooCoarse => {
                told.push("The noise is smaller than a count, which hides the part's filter.".to_owned());
            }
            PartNote::NotCorrelated { .. } => {
                told.push("No low-pass filter shows: neighbouring samples are not correlated.".to_owned());
            }
            PartNote::StatedClock { .. } | PartNote::NoTimeStamps { .. } => {
                told.push("Without time stamps the part's clock is not measured.".to_owned());
            }
            PartNote::Contradicted { channel, .. } => contradicting.push(*channel),
            PartNote::NotSought | PartNote::Minority(_) | PartNote::LengthAlone { .. } | PartNote::NotInAll { .. } => {}
        }
    }
    if !contradicting.is_empty() {
        told.push(format!("The filter of {} differs from that of the other channels.", names(&contradicting)));
    }
    told
}

fn names(channels: &[&str]) -> String {
    channel_list(&channels.iter().map(|&name| name.to_owned()).collect::<Vec<_>>())
}
