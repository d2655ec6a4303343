//! Sending the part to sleep and waking it.

use crate::product::Product;
use crate::register::Register;
use crate::session::{Refusal, Session};
use crate::sleep::Sleep;

const INDEFINITE: u16 = 1 << 8;

impl Session<'_> {
    pub(crate) async fn sleep(&self, sleep: Sleep) -> Result<(), Refusal> {
        match sleep {
            Sleep::HalfSeconds(count) => self.write_low(Register::SlpCnt, u16::from(count.get())).await,
            Sleep::Indefinite => self.write_high(Register::SlpCnt, INDEFINITE).await,
        }
        Ok(())
    }

    pub(crate) async fn wake(&self) -> Result<Product, Refusal> {
        self.select(self.state.timing.wake_pulse_ns).await;
        self.pause(self.state.timing.wake_us.get(self.state.mode)).await;
        self.identity().await
    }
}
