//! `analyze --quick`: the report of the curves alone, of a recording that is read in blocks.

use anyhow::Result;
use noise_analysis::parallel;
use noise_analysis::quick::CurveEstimators;
use recordings::sample_stream::{SampleStream, StreamError};
use std::sync::mpsc;
use std::thread;

/// Blocks that wait for the estimators.
const WAITING: usize = 2;

/// The estimators with all samples of `stream`.
pub(crate) fn estimate(stream: &mut SampleStream) -> Result<CurveEstimators> {
    loop {
        let mut estimators = CurveEstimators::new(stream.description().clone());
        let is_complete = if parallel::threads() == 1 {
            stream.read(|block| estimators.push(&block))?
        } else {
            read_beside(stream, &mut estimators)?
        };
        if is_complete {
            return Ok(estimators);
        }
    }
}

/// Reads while another thread takes what was read.
fn read_beside(stream: &mut SampleStream, estimators: &mut CurveEstimators) -> Result<bool, StreamError> {
    thread::scope(|scope| {
        let (sender, blocks) = mpsc::sync_channel(WAITING);
        scope.spawn(move || {
            for block in blocks {
                estimators.push(&block);
            }
        });
        // A block is not taken where the other thread has panicked, which ends this one too.
        stream.read(|block| drop(sender.send(block)))
    })
}
