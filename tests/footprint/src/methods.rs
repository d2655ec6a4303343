//! Calls of every method of the driver, with arguments and results that the compiler must not optimise away.

use crate::bus::Bus;
use adis16405_driver::{
    Adis16405, AlarmNumber, Config, DacLevel, Error, Gpio, GyroRange, OnChipCompensation, Register, Sleep, Stimulus,
};
use core::convert::Infallible;
use core::hint::black_box;

#[cfg(feature = "everything")]
pub(crate) fn blocking(bus: Bus) -> Result<(), Error<Infallible>> {
    let mut imu = Adis16405::new(bus, bus, Config::default());
    black_box(imu.start_up()?);
    black_box(imu.software_reset()?);
    black_box(imu.configure(black_box(Config::default()))?);
    black_box(imu.set_sample_rate(black_box(204.8))?);
    black_box(imu.set_range(black_box(GyroRange::Dps75))?);
    black_box(imu.set_filter_taps_log2(black_box(3))?);
    black_box(imu.read_register(black_box(Register::TempOut))?);
    black_box(imu.write_register(black_box(Register::AuxDac), black_box(1))?);
    black_box(imu.update_register(black_box(Register::AuxDac), black_box(1), black_box(1))?);
    black_box(imu.diagnosis()?);
    black_box(imu.self_test()?);
    black_box(imu.flash_test()?);
    black_box(imu.stimulus_response(black_box(Stimulus::Positive))?);
    black_box(imu.set_gyro_offsets(black_box([0; 3]))?);
    black_box(imu.keep_negative_x_bias_on_host()?);
    black_box(imu.set_accl_offsets(black_box([0; 3]))?);
    black_box(imu.set_hard_iron(black_box([0; 3]))?);
    black_box(imu.set_soft_iron(black_box([0; 3]))?);
    black_box(imu.auto_null()?);
    black_box(imu.precision_auto_null()?);
    black_box(imu.factory_restore()?);
    black_box(imu.flash_update()?);
    black_box(imu.data_ready()?);
    black_box(imu.set_data_ready(black_box(None))?);
    black_box(imu.compensation()?);
    black_box(imu.set_compensation(black_box(OnChipCompensation::default()))?);
    black_box(imu.alarm(black_box(AlarmNumber::One))?);
    black_box(imu.set_alarm(black_box(AlarmNumber::Two), black_box(None))?);
    black_box(imu.set_alarm_output(black_box(None))?);
    black_box(imu.set_alarm_filtering(black_box(true))?);
    black_box(imu.gpio()?);
    black_box(imu.set_gpio(black_box(Gpio::default()))?);
    black_box(imu.set_aux_dac(black_box(DacLevel::default()))?);
    black_box(imu.sleep(black_box(Sleep::Indefinite))?);
    black_box(imu.wake()?);
    black_box(imu.read()?);
    Ok(())
}

/// Polls [`call_all`] once; no operation on this bus is ever pending.
#[cfg(feature = "asynchronous")]
pub(crate) fn asynchronous(bus: Bus) -> bool {
    use core::{pin::pin, task};
    pin!(call_all(bus)).poll(&mut task::Context::from_waker(task::Waker::noop())).is_ready()
}

#[cfg(feature = "asynchronous")]
async fn call_all(bus: Bus) -> Result<(), Error<Infallible>> {
    let mut imu = Adis16405::new_async(bus, bus, Config::default());
    black_box(imu.start_up().await?);
    black_box(imu.software_reset().await?);
    black_box(imu.configure(black_box(Config::default())).await?);
    black_box(imu.set_sample_rate(black_box(204.8)).await?);
    black_box(imu.set_range(black_box(GyroRange::Dps75)).await?);
    black_box(imu.set_filter_taps_log2(black_box(3)).await?);
    black_box(imu.read_register(black_box(Register::TempOut)).await?);
    black_box(imu.write_register(black_box(Register::AuxDac), black_box(1)).await?);
    black_box(imu.update_register(black_box(Register::AuxDac), black_box(1), black_box(1)).await?);
    black_box(imu.diagnosis().await?);
    black_box(imu.self_test().await?);
    black_box(imu.flash_test().await?);
    black_box(imu.stimulus_response(black_box(Stimulus::Positive)).await?);
    black_box(imu.set_gyro_offsets(black_box([0; 3])).await?);
    black_box(imu.keep_negative_x_bias_on_host().await?);
    black_box(imu.set_accl_offsets(black_box([0; 3])).await?);
    black_box(imu.set_hard_iron(black_box([0; 3])).await?);
    black_box(imu.set_soft_iron(black_box([0; 3])).await?);
    black_box(imu.auto_null().await?);
    black_box(imu.precision_auto_null().await?);
    black_box(imu.factory_restore().await?);
    black_box(imu.flash_update().await?);
    black_box(imu.data_ready().await?);
    black_box(imu.set_data_ready(black_box(None)).await?);
    black_box(imu.compensation().await?);
    black_box(imu.set_compensation(black_box(OnChipCompensation::default())).await?);
    black_box(imu.alarm(black_box(AlarmNumber::One)).await?);
    black_box(imu.set_alarm(black_box(AlarmNumber::Two), black_box(None)).await?);
    black_box(imu.set_alarm_output(black_box(None)).await?);
    black_box(imu.set_alarm_filtering(black_box(true)).await?);
    black_box(imu.gpio().await?);
    black_box(imu.set_gpio(black_box(Gpio::default())).await?);
    black_box(imu.set_aux_dac(black_box(DacLevel::default())).await?);
    black_box(imu.sleep(black_box(Sleep::Indefinite)).await?);
    black_box(imu.wake().await?);
    black_box(imu.read().await?);
    Ok(())
}
