//! A rate ramp: the level moves at a constant pace from the first sample to the last.

use super::block::Blocks;
use super::evidence::Estimate;
use super::level::Claim;
use crate::distributions::NORMAL_975;
use crate::findings::{Effect, Finding, Parameter};
use crate::series::Series;

/// A ramp as it is reported; `estimate` is by block.
pub(super) fn finding(series: &Series, blocks: &Blocks, estimate: &Estimate, claim: &Claim) -> Finding {
    let block_s = blocks.width as f64 * series.period_s;
    let (slope, half) = (estimate.size / block_s, NORMAL_975 * estimate.error / block_s);
    let evidence = format!(
        "the level moves by {slope:.3e} {}/s throughout, by chance {:.0e} in white, flicker and walking noise of any \
         mixture; warm-up that no sensor shows, or aging",
        series.unit, claim.p_value,
    );
    let unit = format!("{}/s", series.unit);
    Finding {
        effect: Effect::new(
            "rate_ramp",
            [("slope", Parameter::new(slope, slope - half, slope + half, &unit))],
            evidence,
        ),
        repair: None,
    }
}
