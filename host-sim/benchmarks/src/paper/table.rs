//! The outcome as text.

use super::{INTERVALS, Outcome, SYMBOLS, TRUTH};
use comfy_table::{CellAlignment, Table, presets};
use reports::formatting::number;
use std::io::{self, Write};

impl Outcome {
    /// Two tables: the coefficients, and the confidence of the octaves.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        writeln!(out, "{} simulated hours of gyro z at 204.8 SPS, default filter, ±300 °/s\n", self.seeds)?;
        writeln!(out, "bias ± scatter of the coefficients, % of the truth")?;
        let mut table =
            table(["", "truth", "interval, s", "terms alone", "read off", "overlapped", "fit", "fit covers"]);
        for term in 0..3 {
            let errors = [&self.plain, &self.overlapped, &self.fitted].map(|errors| errors[term]);
            let [plain, overlapped, fitted] =
                errors.map(|error| format!("{:+.1} ± {:.1}", 100.0 * error.bias, 100.0 * error.scatter));
            table.add_row([
                SYMBOLS[term].to_owned(),
                number(TRUTH[term]),
                format!("{} … {}", INTERVALS[term].start(), INTERVALS[term].end()),
                format!("{:+.1}", 100.0 * self.inherent[term]),
                plain,
                overlapped,
                fitted,
                format!("{:.0} %", 100.0 * self.covered[term]),
            ]);
        }
        writeln!(out, "{table}")?;
        writeln!(out, "terms alone: read off the true curve, without any noise. Each line stands for one term, but")?;
        writeln!(out, "everywhere three add up: see their shares of the variance below.\n")?;
        writeln!(out, "standard deviation of an octave, %: claimed and over the seeds")?;
        let mut table =
            self::table(["τ, s", "formula (6)", "not overlapped", "by edf", "overlapped", "N, %", "B, %", "K, %"]);
        for row in &self.scatter {
            let percent = |value: f64| format!("{:.1}", 100.0 * value);
            let [n, b, k] = row.shares.map(percent);
            let [formula, confidence] = [row.formula, row.confidence].map(|value| format!("{:.2}", 100.0 * value));
            let [plain, overlapped] = [row.plain, row.overlapped].map(|value| format!("{:.2}", 100.0 * value));
            table.add_row([number(row.tau_s), formula, plain, confidence, overlapped, n, b, k]);
        }
        writeln!(out, "{table}")
    }
}

fn table<const COLUMNS: usize>(header: [&str; COLUMNS]) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::UTF8_FULL_CONDENSED).set_header(header);
    for column in table.column_iter_mut() {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
