//! Bias and coverage of N, B and K behind each filter.

use serde::Serialize;
use std::collections::BTreeMap;
use std::io::{self, Write};

/// An estimate with 95 % bounds; the value and the lower bound are 0 if it is not significant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FilteredCoefficient {
    pub truth: f64,
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

/// One channel of a report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FilteredChannel {
    pub seed: u64,
    pub channel: &'static str,
    /// Taps and decimation in the model.
    pub filter: Option<[f64; 2]>,
    /// N, B and K with their truth, if the model has them.
    pub coefficients: [Option<FilteredCoefficient>; 3],
    /// Named effects other than the filter itself.
    pub named: Vec<String>,
}

/// The channels of one filter and decimation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FilterCell {
    /// Taps of each of the two averages.
    pub taps: usize,
    /// Decimation: 1 if every value is read.
    pub every: usize,
    pub channels: Vec<FilteredChannel>,
}

/// The result of the benchmark.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FilteredNoiseTable {
    pub cells: Vec<FilterCell>,
}

impl FilterCell {
    fn estimates(&self, at: usize) -> impl Iterator<Item = FilteredCoefficient> + '_ {
        self.channels.iter().filter_map(move |channel| channel.coefficients[at])
    }

    /// Mean ratio to the truth less 1, and its standard error, in percent, over the channels that have the coefficient.
    fn bias_percent(&self, at: usize) -> Option<(f64, f64)> {
        let shown = self.estimates(at).filter(|estimate| estimate.value > 0.0);
        let errors: Vec<f64> = shown.map(|estimate| 100.0 * (estimate.value / estimate.truth - 1.0)).collect();
        let count = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / count;
        let square: f64 = errors.iter().map(|error| (error - mean).powi(2)).sum();
        (errors.len() > 1).then(|| (mean, (square / (count - 1.0) / count).sqrt()))
    }

    fn covered(&self, at: usize) -> (usize, usize) {
        let covered = self.estimates(at).filter(|of| (of.low..=of.high).contains(&of.truth)).count();
        (covered, self.estimates(at).count())
    }

    fn named(&self) -> usize {
        self.channels.iter().filter(|channel| !channel.named.is_empty()).count()
    }
}

impl FilteredNoiseTable {
    /// Writes the table as text.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "Noise behind the part's filter: bias with its standard error, 95 % intervals that hold the truth, channels in which"
        )?;
        writeln!(out, "something is named\n")?;
        write!(out, "{:<22}{:>8}", "", "filter")?;
        for symbol in ["N", "B", "K"] {
            write!(out, "{:>20}{:>9}", format!("bias of {symbol}"), "held")?;
        }
        writeln!(out, "{:>10}   names", "named")?;
        for cell in &self.cells {
            let nth = match cell.every {
                1 => "every value".to_owned(),
                2 => "every 2nd".to_owned(),
                every => format!("every {every}th"),
            };
            let is_right =
                |channel: &&FilteredChannel| channel.filter.is_some_and(|[taps, _]| taps == cell.taps as f64);
            let all = cell.channels.len();
            let told = cell.channels.iter().filter(is_right).count();
            let taps = if cell.taps == 1 { "1 tap".to_owned() } else { format!("{} taps", cell.taps) };
            write!(out, "{:<22}{:>8}", format!("{taps}, {nth}"), format!("{told}/{all}"))?;
            for at in 0..3 {
                let bias = cell
                    .bias_percent(at)
                    .map_or("–".to_owned(), |(mean, error)| format!("{mean:+.2} ± {error:.2} %"));
                let (held, all) = cell.covered(at);
                write!(out, "{bias:>20}{:>9}", format!("{held}/{all}"))?;
            }
            let mut names: BTreeMap<&str, usize> = BTreeMap::new();
            let kinds = cell.channels.iter().flat_map(|channel| &channel.named);
            kinds.for_each(|kind| *names.entry(kind).or_insert(0) += 1);
            let names: Vec<String> = names.into_iter().map(|(name, count)| format!("{name} × {count}")).collect();
            writeln!(out, "{:>10}   {}", format!("{}/{all}", cell.named()), names.join(", "))?;
        }
        Ok(())
    }
}
