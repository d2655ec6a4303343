//! Several recordings of one sensor: agreement, and inflation while a machine runs.

use crate::finding_text::channel_list;
use crate::formatting::{count, plain_table, words};
use crate::rounding::{bounded_quantity, estimate, p_value, plain, probability, quantity_digits, significant, span};
use noise_analysis::report::several::{NoiseAgreement, NoiseInflation, OctaveAgreement};
use std::io::{self, Write};

/// One row per channel: verdict, p-value, largest difference, joint coefficients. Recordings have their numbers from 1 on.
pub fn write_agreement(agreement: &NoiseAgreement, out: &mut impl Write) -> io::Result<()> {
    let [least, most] =
        [agreement.samples.iter().min(), agreement.samples.iter().max()].map(|of| of.copied().unwrap_or(0));
    let samples = if least == most { count(most) } else { format!("{} to {}", count(least), count(most)) };
    let rate = plain(agreement.sample_rate_hz, 6);
    writeln!(out, "{} recordings of {samples} samples at {rate} Hz", agreement.samples.len())?;
    let mut table = plain_table(["channel", "noise", "p", "largest difference of σ", "joint model"]);
    for channel in &agreement.channels {
        let worst = channel.octaves.iter().min_by(|a, b| a.p_value.total_cmp(&b.p_value));
        let joint = channel.joint.iter().flat_map(|term| {
            term.parameters().into_iter().map(move |(name, of)| {
                let name = if name == "value" { term.kind() } else { name };
                format!("{} {}", words(name), bounded_quantity(&of))
            })
        });
        table.add_row([
            channel_list([&channel.name]),
            match (channel.p_value, channel.agree) {
                (None, _) => "too few samples",
                (_, true) => "the same",
                (_, false) => "differs",
            }
            .to_owned(),
            channel.p_value.map_or_else(String::new, probability),
            worst.map_or_else(String::new, largest_difference),
            joint.collect::<Vec<_>>().join("\n"),
        ]);
    }
    writeln!(out, "{table}")
}

/// The recordings with the largest and the smallest deviation of an octave, and their ratio.
fn largest_difference(octave: &OctaveAgreement) -> String {
    let numbered = || octave.adev.iter().zip(1..);
    let by_size = |a: &(&f64, usize), b: &(&f64, usize)| a.0.total_cmp(b.0);
    let Some(((high, loudest), (low, quietest))) = numbered().max_by(by_size).zip(numbered().min_by(by_size)) else {
        return String::new();
    };
    let ratio = significant(high / low, 3);
    format!("number {loudest} {ratio} times number {quietest}, at {} ({})", span(octave.tau_s), p_value(octave.p_value))
}

/// One row per channel and octave.
pub fn write_inflation(inflation: &NoiseInflation, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "\ninflation: Allan deviation while running over that at rest, with 95 % bounds")?;
    let mut table = plain_table(["channel", "averaging time", "at rest", "running", "factor"]);
    for channel in &inflation.channels {
        for octave in &channel.octaves {
            table.add_row([
                channel_list([&channel.name]),
                span(octave.tau_s),
                quantity_digits(octave.still, &channel.unit, 4),
                quantity_digits(octave.running, &channel.unit, 4),
                estimate(octave.factor, octave.low, octave.high),
            ]);
        }
    }
    writeln!(out, "{table}")
}

#[cfg(test)]
mod tests {
    use super::write_agreement;
    use noise_analysis::report::several::{ChannelAgreement, NoiseAgreement, OctaveAgreement};

    #[test]
    fn the_recordings_that_differ_most_are_named() {
        let octave = |tau_s, adev: [f64; 3], p_value| OctaveAgreement { tau_s, adev: adev.to_vec(), p_value };
        let octaves = vec![octave(0.01, [0.1, 0.35, 0.2], 1e-9), octave(0.02, [0.1, 0.1, 0.9], 0.2)];
        let channel = ChannelAgreement {
            name: "gyro_x".to_owned(),
            unit: "deg/s".to_owned(),
            p_value: Some(1e-8),
            agree: false,
            octaves,
            joint: Vec::new(),
        };
        let agreement =
            NoiseAgreement { schema: 2, sample_rate_hz: 100.0, samples: vec![24_000; 3], channels: vec![channel] };
        let mut out = Vec::new();
        write_agreement(&agreement, &mut out).expect("a vector can be written");
        let text = String::from_utf8(out).expect("text");
        assert!(text.starts_with("3 recordings of 24,000 samples at 100 Hz\n"), "{text}");
        assert!(text.contains("number 2 3.50 times number 1, at 10 ms (p < 0.001)"), "{text}");
    }
}
