//! What sampling takes: start, burst, verdict, values.

use crate::bus::Bus;
use adis16405_driver::{Adis16405, BurstValidator, Config, Error};
use core::convert::Infallible;
use core::hint::black_box;

pub(crate) fn sample(bus: Bus) -> Result<(), Error<Infallible>> {
    let mut imu = Adis16405::new(bus, black_box(Config::default()));
    let mut validator = BurstValidator::default();
    imu.init()?;
    let burst = imu.burst()?;
    black_box(validator.validate(&burst));
    let sample = imu.sample_from(burst);
    black_box((sample.gyro_udps(), sample.accl_ug(), sample.magn_ugauss(), sample.temp_mdegc(), sample.supply_uv()));
    Ok(())
}
