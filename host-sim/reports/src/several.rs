//! Several recordings of one sensor: agreement, and inflation while a machine runs.

use crate::formatting::{number, plain_table};
use crate::rounding::probability;
use noise_analysis::report::several::{NoiseAgreement, NoiseInflation};
use std::io::{self, Write};

/// One row per channel: verdict, p-value, largest difference, joint coefficients.
pub fn write_agreement(agreement: &NoiseAgreement, out: &mut impl Write) -> io::Result<()> {
    let samples: Vec<String> = agreement.samples.iter().map(u64::to_string).collect();
    writeln!(
        out,
        "{} recordings of {} samples at {:.3} Hz",
        samples.len(),
        samples.join(", "),
        agreement.sample_rate_hz
    )?;
    let mut table = plain_table(["channel", "noise", "p", "largest ratio", "joint model"]);
    for channel in &agreement.channels {
        let ratios = channel.octaves.iter().map(|octave| {
            let (low, high) =
                octave.adev.iter().fold((f64::MAX, 0.0_f64), |(low, high), &adev| (low.min(adev), high.max(adev)));
            (high / low, octave)
        });
        let worst = ratios.min_by(|(_, a), (_, b)| a.p_value.total_cmp(&b.p_value));
        let joint = channel.joint.iter().flat_map(|term| {
            term.parameters().into_iter().map(move |(name, of)| {
                let name = if name == "value" { term.kind() } else { name }.replace('_', " ");
                format!("{name} {} [{}, {}] {}", number(of.value), number(of.low), number(of.high), of.unit)
            })
        });
        table.add_row([
            channel.name.clone(),
            match (channel.p_value, channel.agree) {
                (None, _) => "too few samples",
                (_, true) => "the same",
                (_, false) => "differs",
            }
            .to_owned(),
            channel.p_value.map_or_else(String::new, probability),
            worst.map_or_else(String::new, |(ratio, octave)| {
                format!("{ratio:.3} at {} s (p {})", number(octave.tau_s), probability(octave.p_value))
            }),
            joint.collect::<Vec<_>>().join("\n"),
        ]);
    }
    writeln!(out, "{table}")
}

/// One row per channel and octave.
pub fn write_inflation(inflation: &NoiseInflation, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "\ninflation: Allan deviation while running over that at rest, with 95 % bounds")?;
    let mut table = plain_table(["channel", "averaging time", "at rest", "running", "unit", "factor"]);
    for channel in &inflation.channels {
        for octave in &channel.octaves {
            table.add_row([
                channel.name.clone(),
                format!("{} s", number(octave.tau_s)),
                number(octave.still),
                number(octave.running),
                channel.unit.clone(),
                format!("{:.3} [{:.3}, {:.3}]", octave.factor, octave.low, octave.high),
            ]);
        }
    }
    writeln!(out, "{table}")
}
