//! Evidence in the samples of a channel, independent of its curve: the lines of their spectrum, and signals.

use crate::rivals::signals::SampleSignals;
use crate::samples::rounding::Rounding;
use crate::samples::series::Series;
use crate::samples::uniform_series::UniformSeries;
use crate::spectra::spectral_lines::{self, MergedLine};
use allan_core::Model;
use measurement::SensorProfile;

pub(crate) struct ShownBySamples {
    /// The samples, and the same less the covariates, if the channel depends on any.
    pub series: Series,
    rounding: Rounding,
    rate_error: f64,
    /// Values of the sensor for each of the samples.
    read_every: u32,
    /// Lines of the spectrum of the samples, and of that of the rest.
    pub lines: Vec<MergedLine>,
    pub lines_of_rest: Option<Vec<MergedLine>>,
    pub signals: SampleSignals,
}

impl ShownBySamples {
    /// Searches a `series` of samples, or of means over so many of them; the `rest` of it, less the covariates, is `uniform`.
    pub(crate) fn find(
        series: &Series,
        rest: Option<&Series>,
        uniform: &UniformSeries,
        (profile, samples_per_mean): (&SensorProfile, u64),
    ) -> Self {
        let rate_error = profile.sample_rate_error;
        let read_every = if samples_per_mean > 1 { 1 } else { profile.read_every(1.0 / series.period_s) };
        let lines = |of: &Series| spectral_lines::find(of, uniform.rounding(), None, rate_error, read_every);
        Self {
            lines: lines(series),
            lines_of_rest: rest.map(lines),
            signals: SampleSignals::find(uniform),
            series: series.clone(),
            rounding: uniform.rounding().clone(),
            rate_error,
            read_every,
        }
    }

    /// Lines of the spectrum of the samples over the background of a model.
    pub(crate) fn lines_over(&self, model: &Model) -> Vec<MergedLine> {
        spectral_lines::find(&self.series, &self.rounding, Some(model), self.rate_error, self.read_every)
    }
}
