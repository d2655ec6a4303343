//! Recordings that are read in blocks: for the report of the curves alone, and for that of a recording that is too long to be kept.

use measurement::SampleBlock;
use noise_analysis::parallel;
use noise_analysis::quick::CurveEstimators;
use noise_analysis::record::condensed_record::CondensedRecord;
use noise_analysis::record::long_record::LongRecordReader;
use recordings::sample_stream::{SampleStream, StreamError};
use std::sync::mpsc;
use std::thread;

/// Blocks that wait for the estimators.
const WAITING: usize = 2;

/// The estimators of the curves with all samples of `stream`.
///
/// # Errors
/// The recording is damaged.
pub fn curves(stream: &mut SampleStream) -> Result<CurveEstimators, StreamError> {
    read(stream, |stream| CurveEstimators::new(stream.description().clone()), CurveEstimators::push)
}

/// Condensed form of a long recording.
pub(crate) fn long_record(stream: &mut SampleStream) -> Result<CondensedRecord<'static>, StreamError> {
    let begin = |stream: &SampleStream| LongRecordReader::new(stream.description().clone(), stream.beginning());
    Ok(read(stream, begin, LongRecordReader::push)?.finish())
}

/// Pushes all samples of `stream` into the value that `begin` makes of its description.
fn read<T: Send>(
    stream: &mut SampleStream,
    begin: impl Fn(&SampleStream) -> T,
    push: impl Fn(&mut T, &SampleBlock) + Sync,
) -> Result<T, StreamError> {
    loop {
        let mut taken = begin(stream);
        let is_complete = if parallel::threads() == 1 {
            stream.read(|block| push(&mut taken, &block))?
        } else {
            read_beside(stream, |block| push(&mut taken, block))?
        };
        if is_complete {
            return Ok(taken);
        }
    }
}

/// Reads while another thread takes what was read.
fn read_beside(stream: &mut SampleStream, mut take: impl FnMut(&SampleBlock) + Send) -> Result<bool, StreamError> {
    thread::scope(|scope| {
        let (sender, blocks) = mpsc::sync_channel(WAITING);
        scope.spawn(move || {
            for block in blocks {
                take(&block);
            }
        });
        // A block is not taken where the other thread has panicked, which ends this one too.
        stream.read(|block| drop(sender.send(block)))
    })
}
