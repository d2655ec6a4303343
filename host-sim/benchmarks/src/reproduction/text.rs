//! The results as text.

use super::bias_and_scatter::{OctaveScatter, ReproductionResult};
use super::four_methods::FourMethods;
use super::published_gyro::{INTERVALS, SYMBOLS, TRUTH};
use reports::formatting::{TextTable, number, optional};
use std::io::{self, Write};

impl ReproductionResult {
    /// Writes the tables of the coefficients, of the scatter of the octaves and of the four methods as text.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        writeln!(out, "{} simulated hours of gyro z at 204.8 SPS, default filter, ±300 °/s\n", self.seeds)?;
        writeln!(out, "bias ± scatter of the coefficients, % of the truth")?;
        let row = |term: usize| {
            let errors = [&self.plain, &self.overlapped, &self.fitted].map(|errors| errors[term]);
            let [plain, overlapped, fitted] =
                errors.map(|error| format!("{:+.1} ± {:.1}", 100.0 * error.bias, 100.0 * error.scatter));
            vec![
                SYMBOLS[term].to_owned(),
                number(TRUTH[term]),
                format!("{} … {}", INTERVALS[term].start(), INTERVALS[term].end()),
                format!("{:+.1}", 100.0 * self.inherent[term]),
                plain,
                overlapped,
                fitted,
                format!("{:.0} %", 100.0 * self.covered[term]),
            ]
        };
        let header = ["", "truth", "interval, s", "true curve", "slopes", "overlapped", "fit", "fit covers"];
        writeln!(out, "{}", TextTable::new(header, 1, (0..3).map(row)))?;
        writeln!(
            out,
            "true curve: slope method on the true curve, without estimation noise. It attributes the curve to"
        )?;
        writeln!(out, "one term, but N, B and K add up: their fractions of the variance are below.\n")?;
        writeln!(out, "standard deviation of the Allan deviation at an octave, %: predicted, and over the seeds")?;
        let percent = |value: f64, decimals: usize| format!("{:.decimals$}", 100.0 * value);
        let row = |octave: &OctaveScatter| {
            let scatter = [octave.formula, octave.plain, octave.confidence, octave.overlapped];
            let cells =
                scatter.map(|value| percent(value, 2)).into_iter().chain(octave.shares.map(|part| percent(part, 1)));
            std::iter::once(number(octave.tau_s)).chain(cells).collect()
        };
        let header = ["τ, s", "formula (6)", "not overlapped", "by edf", "overlapped", "N, %", "B, %", "K, %"];
        writeln!(out, "{}\n", TextTable::new(header, 0, self.scatter.iter().map(row)))?;
        self.four_methods.write(out)
    }
}

impl FourMethods {
    /// Writes three tables as text.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        writeln!(out, "four methods on one record (seed {})\n", self.seed)?;
        let cell = |value: Option<f64>, bounds: Option<(f64, f64)>| match bounds {
            Some((low, high)) => format!("{} ({}…{})", optional(value), number(low), number(high)),
            None => optional(value),
        };
        let truth = ["truth".to_owned()].into_iter().chain(TRUTH.map(number)).collect();
        let rows = self.coefficients.iter().map(|row| {
            let cells = row.values.iter().zip(&row.bounds).map(|(&value, &bounds)| cell(value, bounds));
            [row.method.to_owned()].into_iter().chain(cells).collect()
        });
        let header = ["", SYMBOLS[0], SYMBOLS[1], SYMBOLS[2]];
        writeln!(out, "coefficients in °/√s, °/s, °/s^1.5, with 95 % bounds")?;
        writeln!(out, "{}", TextTable::new(header, 1, std::iter::once(truth).chain(rows)))?;
        let found = &self.autocorrelation;
        let [variance, white] = [found.variance, found.white_variance].map(number);
        let [whole, quarters] = [found.decay_s, found.decay_in_quarters_s].map(optional);
        writeln!(out, "autocorrelation: variance {variance} (°/s)², white part {white} (°/s)²")?;
        writeln!(out, "decay to 1/e: {whole} s in the record, {quarters} s in its quarters: flicker noise and walk")?;
        writeln!(out, "have no correlation time\n")?;
        writeln!(out, "Allan deviation, °/s: measured, and by equation (5) from Welch's spectrum")?;
        writeln!(out, "segments of {} s resolve τ up to {} s", number(self.segment_s), number(self.resolved_s))?;
        let rows = self.spectrum.iter().map(|octave| {
            let percent = |value: f64| format!("{:.2}", 100.0 * value);
            vec![
                number(octave.tau_s),
                number(octave.measured),
                number(octave.by_spectrum),
                format!("{:.4}", octave.by_spectrum / octave.measured),
                percent(octave.measured_error),
                percent(octave.by_spectrum_error),
                if octave.resolved { "yes" } else { "no" }.to_owned(),
            ]
        });
        let header = ["τ, s", "measured", "by (5)", "ratio", "±, %", "± by (5), %", "resolved"];
        writeln!(out, "{}\n", TextTable::new(header, 0, rows))?;
        writeln!(out, "Kalman innovations on the second half, models fitted to the first half")?;
        let rows = self.innovations.iter().map(|test| {
            let (low, high) = test.consistent;
            let [normalised, correlation] = [test.normalised, test.correlation].map(|value| format!("{value:.3}"));
            let bounds = format!("{low:.3} … {high:.3}");
            vec![test.model.to_owned(), normalised, bounds, correlation, format!("{:.1e}", test.whiteness_p)]
        });
        let header = ["model", "normalised variance", "95 % if true", "correlation", "p (white)"];
        writeln!(out, "{}", TextTable::new(header, 1, rows))
    }
}
