//! The summary of several recordings: whether they agree, and how much noisier one is that was recorded while motors
//! ran.

use crate::output::{self, print};
use crate::output_files::{OutputFiles, is_standard_stream};
use anyhow::Result;
use measurement::Measurement;
use noise_analysis::report::several::{self, NoiseAgreement, NoiseInflation};
use serde::Serialize;
use std::path::Path;

/// The JSON of several recordings.
#[derive(Serialize)]
struct SeveralRecordings<'a> {
    agreement: Option<&'a NoiseAgreement>,
    inflation: Option<&'a NoiseInflation>,
}

/// Prints whether recordings agree, and how much noisier one with running motors is, or writes both as JSON.
///
/// # Errors
/// The recordings cannot be compared, or the file cannot be written.
pub(crate) fn write_several(
    still: &[Measurement],
    running: Option<&Measurement>,
    json: Option<&Path>,
    is_quiet: bool,
    outputs: &OutputFiles,
) -> Result<()> {
    let agreement = (still.len() > 1).then(|| several::compare(still)).transpose()?;
    let inflation = running.map(|running| several::inflation(still, running)).transpose()?;
    if let Some(file) = json {
        let several = SeveralRecordings { agreement: agreement.as_ref(), inflation: inflation.as_ref() };
        output::write_json(&several, file, outputs)?;
    }
    if is_quiet || json.is_some_and(is_standard_stream) {
        return Ok(());
    }
    print(|out| {
        agreement.as_ref().map_or(Ok(()), |agreement| reports::several::write_agreement(agreement, out))?;
        inflation.as_ref().map_or(Ok(()), |inflation| reports::several::write_inflation(inflation, out))
    })
}
