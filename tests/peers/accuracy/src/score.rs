//! Bias, root mean square error and coverage over many series.

use crate::case::Coefficients;

/// The estimates of one coefficient by one method.
#[derive(Debug, Clone, Default)]
pub(crate) struct Score {
    /// Relative errors in the series for which the method gave a value.
    errors: Vec<f64>,
    refused: usize,
    covered: usize,
    bounded: usize,
}

impl Score {
    pub(crate) fn add(&mut self, estimate: Option<f64>, truth: f64) {
        match estimate {
            Some(value) => self.errors.push(value / truth - 1.0),
            None => self.refused += 1,
        }
    }

    pub(crate) fn add_bounds(&mut self, covered: bool) {
        self.bounded += 1;
        self.covered += usize::from(covered);
    }

    /// Mean of the relative error; `None` if the method never gave a value.
    pub(crate) fn bias(&self) -> Option<f64> {
        (!self.errors.is_empty()).then(|| self.errors.iter().sum::<f64>() / self.errors.len() as f64)
    }

    /// Root mean square of the relative error; `None` if the method never gave a value.
    pub(crate) fn rmse(&self) -> Option<f64> {
        let square = self.errors.iter().map(|error| error * error).sum::<f64>() / self.errors.len() as f64;
        (!self.errors.is_empty()).then(|| square.sqrt())
    }

    /// Fraction of the series whose 95 % interval contains the true value.
    pub(crate) fn coverage(&self) -> Option<f64> {
        (self.bounded > 0).then(|| self.covered as f64 / self.bounded as f64)
    }

    /// The cell of a table in percent: error, bias, refusals, coverage.
    pub(crate) fn cell(&self) -> String {
        let series = self.errors.len() + self.refused;
        let mut parts = vec![match (self.rmse(), self.bias()) {
            (Some(rmse), Some(bias)) => format!("{} ({})", percent(rmse), signed(bias)),
            _ => "–".to_owned(),
        }];
        if self.refused > 0 && !self.errors.is_empty() {
            parts.push(format!("refuses {}/{series}", self.refused));
        }
        if let Some(coverage) = self.coverage() {
            parts.push(format!("covers {:.0} %", 100.0 * coverage));
        }
        parts.join("\n")
    }
}

/// The scores of a method for N, B, K.
#[derive(Debug, Clone, Default)]
pub(crate) struct Scores(pub(crate) [Score; 3]);

impl Scores {
    pub(crate) fn add(&mut self, estimates: Coefficients, truth: [f64; 3]) {
        for ((score, estimate), truth) in self.0.iter_mut().zip(estimates).zip(truth) {
            if truth > 0.0 {
                score.add(estimate, truth);
            }
        }
    }

    pub(crate) fn add_bounds(&mut self, covered: [Option<bool>; 3]) {
        for (score, covered) in self.0.iter_mut().zip(covered) {
            if let Some(covered) = covered {
                score.add_bounds(covered);
            }
        }
    }
}

/// A fraction in percent.
pub(crate) fn percent(value: f64) -> String {
    let value = 100.0 * value;
    if value < 1.0 { format!("{value:.3} %") } else { format!("{value:.1} %") }
}

fn signed(value: f64) -> String {
    let value = 100.0 * value;
    if value.abs() < 1.0 { format!("{value:+.3}") } else { format!("{value:+.1}") }
}
