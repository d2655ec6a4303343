//! Reads a burst from a simulated part and prints its values. Needs no hardware.
//!
//! ```console
//! $ cargo run -p adis16405-driver --example mock
//! ```

use std::convert::Infallible;

use adis16405_driver::{Adis16405, Burst, Config, Counts, Product, Register};
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};

/// A part at rest, level, at 5 V and 25 °C, which ignores writes: register reads and bursts only.
#[derive(Default)]
struct MockPart {
    /// Answer to the frame before.
    answer: u16,
}

impl MockPart {
    fn register(address: u8) -> u16 {
        match Register::ALL.iter().find(|register| register.address() == address) {
            Some(Register::ProdId) => Product::Adis16405.prod_id(),
            Some(Register::SmplPrd) => u16::from(Config::default().smpl_prd()),
            Some(Register::SensAvg) => Config::default().sens_avg(),
            _ => 0,
        }
    }
}

impl ErrorType for MockPart {
    type Error = Infallible;
}

impl SpiDevice for MockPart {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        for operation in operations {
            match operation {
                Operation::Transfer(answer, request) if answer.len() == 2 => {
                    answer.copy_from_slice(&self.answer.to_be_bytes());
                    self.answer = Self::register(request[0]);
                }
                // Supply, gyros, accelerometers, magnetometers, temperature, auxiliary input, in counts.
                Operation::Transfer(answer, _) => answer.copy_from_slice(
                    &Burst::from_counts(&Counts::new([2068, 3, -2, 1, 4, -5, 300, 120, -40, 500, 0, 1000])).to_bytes(),
                ),
                _ => (),
            }
        }
        Ok(())
    }
}

struct NoDelay;

impl DelayNs for NoDelay {
    fn delay_ns(&mut self, _: u32) {}
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut imu = Adis16405::new(MockPart::default(), NoDelay, Config::default());
    let product = imu.start_up()?;
    let sample = imu.read()?;
    println!("{product:?}");
    println!("{:8.3?} °/s, {:8.5?} g, {:7.4?} gauss", sample.gyro_dps(), sample.accl_g(), sample.magn_gauss());
    println!("{:.1} °C, supply {:.3} V", sample.temp_degc(), sample.supply_v());
    Ok(())
}
