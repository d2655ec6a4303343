//! Recordings read in blocks: for a report of the curves alone, or because they are too long to be kept.

use measurement::SampleBlock;
use noise_analysis::parallel;
use noise_analysis::quick::CurveEstimators;
use noise_analysis::record::condensed_record::CondensedRecord;
use noise_analysis::record::long_record::LongRecordReader;
use recordings::sample_stream::{SampleStream, StreamError};
use std::sync::mpsc;
use std::thread;

/// Number of blocks that may wait for the estimators.
const WAITING: usize = 2;

/// Reads all samples of `stream` into the estimators of the curves.
///
/// # Errors
/// The recording is damaged.
pub fn curves(stream: &mut SampleStream) -> Result<CurveEstimators, StreamError> {
    read(stream, |stream| CurveEstimators::new(stream.description().clone()), CurveEstimators::push)
}

/// Reads a long recording into its condensed form.
pub(crate) fn long_record(stream: &mut SampleStream) -> Result<CondensedRecord<'static>, StreamError> {
    let begin = |stream: &SampleStream| LongRecordReader::new(stream.description().clone(), stream.beginning());
    Ok(read(stream, begin, LongRecordReader::push)?.finish())
}

/// Reads all samples of `stream` and pushes them into the value that `begin` makes of its description.
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

/// Reads the stream while another thread processes the blocks.
fn read_beside(stream: &mut SampleStream, mut take: impl FnMut(&SampleBlock) + Send) -> Result<bool, StreamError> {
    thread::scope(|scope| {
        let (sender, blocks) = mpsc::sync_channel(WAITING);
        scope.spawn(move || {
            for block in blocks {
                take(&block);
            }
        });
        // If the other thread has panicked, the block is dropped; the scope then ends this thread too.
        stream.read(|block| drop(sender.send(block)))
    })
}
