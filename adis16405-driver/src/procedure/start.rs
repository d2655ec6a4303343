//! From power-on or reset to a part that is configured.

use crate::clock::ClockMode;
use crate::config::{Config, GyroRange};
use crate::error::Error;
use crate::product::Product;
use crate::register::Register;
use crate::session::{Order, Refusal, Session};

const SOFTWARE_RESET: u16 = 1 << 7;

impl Session<'_> {
    pub(crate) async fn identity(&self) -> Result<Product, Refusal> {
        let answer = self.read(Register::ProdId).await;
        Product::from_prod_id(answer).ok_or(Error::Product { answer })
    }

    pub(crate) async fn init(&mut self) -> Result<Product, Refusal> {
        let product = self.identity().await?;
        self.configure(self.state.config).await?;
        self.gyro_offsets().await?;
        Ok(product)
    }

    pub(crate) async fn start_up(&mut self) -> Result<Product, Refusal> {
        self.pause(self.state.timing.start_up_us).await;
        self.init().await
    }

    pub(crate) async fn software_reset(&mut self) -> Result<Product, Refusal> {
        self.write_low(Register::GlobCmd, SOFTWARE_RESET).await;
        self.pause(self.state.timing.reset_us).await;
        self.init().await
    }

    pub(crate) async fn configure(&mut self, config: Config) -> Result<(), Refusal> {
        let mode = self.state.timing.clock_mode(config.smpl_prd());
        if mode == ClockMode::LowPower {
            self.state.mode = mode;
        }
        self.set(Register::SmplPrd, u16::from(config.smpl_prd())).await?;
        self.state.mode = mode;

        // The lower byte of SENS_AVG is the filter, the upper one the range. Where the present range needs more taps than
        // the new filter has, the range goes first, so that no sample is taken with a pair that the part does not allow.
        let before = self.read(Register::SensAvg).await;
        let needed = GyroRange::from_sens_avg(before).map_or(0, GyroRange::min_filter_taps_log2);
        let order = if needed > config.filter_taps_log2() { Order::UpperFirst } else { Order::LowerFirst };
        self.change(Register::SensAvg, before, u16::MAX, config.sens_avg(), order).await?;
        self.state.config = config;
        Ok(())
    }
}
