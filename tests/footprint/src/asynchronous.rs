//! Every method of the asynchronous driver.

use crate::bus::Bus;
use adis16405_driver::{
    Adis16405, AlarmNumber, Config, DacLevel, Error, Gpio, GyroRange, OnChipCompensation, Register, Sleep, Stimulus,
};
use core::convert::Infallible;
use core::hint::black_box;
use core::pin::pin;
use core::task::{Context, Waker};

pub(crate) fn use_all(bus: Bus) -> bool {
    // Nothing on this bus is ever pending.
    pin!(all(bus)).poll(&mut Context::from_waker(Waker::noop())).is_ready()
}

async fn all(bus: Bus) -> Result<(), Error<Infallible>> {
    let mut delay = bus;
    let mut imu = Adis16405::new_async(bus, Config::default());
    black_box(imu.start_up(&mut delay).await?);
    black_box(imu.software_reset(&mut delay).await?);
    black_box(imu.configure(black_box(Config::default())).await?);
    black_box(imu.set_sample_rate(black_box(204.8)).await?);
    black_box(imu.set_range(black_box(GyroRange::Dps75)).await?);
    black_box(imu.set_filter_taps_log2(black_box(3)).await?);
    black_box(imu.read_register(black_box(Register::TempOut)).await?);
    black_box(imu.write_register(black_box(Register::AuxDac), black_box(1)).await?);
    black_box(imu.update_register(black_box(Register::AuxDac), black_box(1), black_box(1)).await?);
    black_box(imu.diagnosis().await?);
    black_box(imu.self_test(&mut delay).await?);
    black_box(imu.flash_test(&mut delay).await?);
    black_box(imu.stimulus_response(black_box(Stimulus::Positive), &mut delay).await?);
    black_box(imu.set_gyro_offsets(black_box([0; 3])).await?);
    black_box(imu.keep_negative_x_bias_on_host().await?);
    black_box(imu.set_accl_offsets(black_box([0; 3])).await?);
    black_box(imu.set_hard_iron(black_box([0; 3])).await?);
    black_box(imu.set_soft_iron(black_box([0; 3])).await?);
    black_box(imu.auto_null(&mut delay).await?);
    black_box(imu.precision_auto_null(&mut delay).await?);
    black_box(imu.factory_restore(&mut delay).await?);
    black_box(imu.flash_update(&mut delay).await?);
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
    black_box(imu.wake(&mut delay).await?);
    black_box(imu.sample().await?);
    Ok(())
}
