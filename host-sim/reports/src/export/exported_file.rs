//! An exported file, its axes, its numbers.

/// The number that stands for three axes, where a format has one number a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum AxisChoice {
    /// The root mean square over the axes.
    #[default]
    Rms,
    /// The largest of the axes.
    Worst,
}

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    #[error("no gyroscope and no accelerometer in the report")]
    NoInertialChannel,
    #[error("{channel} is not in the report, and the format has a number for each axis")]
    NoAxis { channel: String },
    #[error(
        "no channel of the {0}s shows bias instability, random walk or a Markov process, from which the Gauss-Markov process \
         of the format is made: the record is too short"
    )]
    NoSlowNoise(&'static str),
    /// Negative, or beyond 10³⁰.
    #[error("{channel}: {term}, {parameter}: {value} is no coefficient of noise: the report is damaged")]
    NoCoefficient { channel: String, term: String, parameter: String, value: String },
    #[error(
        "parts at {0} Hz: the format has noise of samples at one rate; kalibr, openvins, orbslam3 and csv have densities"
    )]
    SeveralRates(String),
    #[error("{0:?} is no name of a channel, a term or a unit: the report is damaged")]
    NoName(String),
}

/// The text of a file, and what it lacks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Export {
    pub text: String,
    /// Fields of the format that the report lacks; comments in the file.
    pub missing: Vec<String>,
}

/// Nine digits: the last bits of a measured rate are rounding.
pub(super) fn rate(hz: f64) -> f64 {
    format!("{hz:.8e}").parse().unwrap_or(hz)
}

/// Four digits and an exponent with its sign: YAML 1.1 takes `4.7e1` for a text.
pub(super) fn scientific(value: f64) -> String {
    let text = format!("{value:.3e}");
    if text.contains("e-") { text } else { text.replace('e', "e+") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_has_nine_digits() {
        for (hz, text) in [(200.000_000_000_000_14, "200"), (199.999_993_310_439_78, "199.999993"), (819.2, "819.2")] {
            assert_eq!(format!("{}", rate(hz)), text);
        }
    }
}
