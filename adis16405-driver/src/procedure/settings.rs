//! Rate, range and filter, one at a time.

use crate::clock::SamplePeriod;
use crate::config::GyroRange;
use crate::error::Error;
use crate::session::{Refusal, Session};

impl Session<'_> {
    pub(crate) async fn set_sample_rate(&mut self, hz: f64) -> Result<f64, Refusal> {
        let period = SamplePeriod::nearest(hz).map_err(Error::Config)?;
        self.configure(self.state.config.with_sample_period(period)).await?;
        Ok(period.hz())
    }

    pub(crate) async fn set_range(&mut self, range: GyroRange) -> Result<(), Refusal> {
        let config = self.state.config.with_range(range).map_err(Error::Config)?;
        self.configure(config).await
    }

    pub(crate) async fn set_filter_taps_log2(&mut self, filter_taps_log2: u8) -> Result<(), Refusal> {
        let config = self.state.config.with_filter_taps_log2(filter_taps_log2).map_err(Error::Config)?;
        self.configure(config).await
    }
}
