//! Periodic causes: lines of several channels at one frequency, harmonics and sidebands of a fundamental, lines whose amplitude changes.
//!
//! ```text
//! effects of every channel ─► line (by frequency) ─► comb (which belong together) ─► waveform (what it is)
//! ```

use super::comb::Comb;
use super::line::{Frequency, Tooth};
use super::waveform::{by_channel, is_no_sinusoid, is_square, modulated_line, no_sinusoid, periodic, square_wave};
use crate::effects::Effect;
use crate::rivals::cause::{Cause, Shown};

/// The periodic causes of the effects of all channels, each with its unit.
pub(super) fn causes(channels: &[(&str, &[Effect])], duration_s: f64) -> Vec<Cause> {
    let mut frequencies = Frequency::all(channels, duration_s);
    let mut causes = Vec::new();
    while let Some(comb) = Comb::find(&frequencies, duration_s) {
        let (mut members, mut others) = (Vec::new(), Vec::new());
        for (number, frequency) in frequencies.into_iter().enumerate() {
            match comb.teeth.iter().find(|(member, _)| *member == number) {
                Some(&(_, tooth)) => members.push((tooth, frequency)),
                None => others.push(frequency),
            }
        }
        causes.push(cause(&members));
        frequencies = others;
    }
    causes.extend(frequencies.into_iter().map(|frequency| cause(&[(Tooth::FUNDAMENTAL, frequency)])));
    causes
}

/// The cause with these lines: a modulated line, or a square wave or another wave if the amplitudes of a channel say so, else its
/// fundamental line with the number of its harmonics.
fn cause(members: &[(Tooth, Frequency)]) -> Cause {
    let modulated = modulated_line(members);
    let by_channel = by_channel(members.iter().map(|(tooth, frequency)| (*tooth, frequency)));
    let is_square = by_channel.values().any(|lines| is_square(lines));
    let is_no_sinusoid = by_channel.values().any(|lines| is_no_sinusoid(lines));
    let shown = by_channel.into_iter().map(|(channel, mut lines)| {
        lines.sort_by(|a, b| a.1.frequency.total_cmp(&b.1.frequency));
        let parts = lines.iter().map(|(_, line)| line.effect.clone()).collect();
        let named = match (is_square, is_no_sinusoid) {
            (true, _) => square_wave(&lines),
            (_, true) => no_sinusoid(&lines),
            _ => modulated.clone(),
        };
        let effect = named.unwrap_or_else(|| periodic(&lines));
        Shown { channel, effect, parts }
    });
    Cause { shown: shown.collect() }
}
