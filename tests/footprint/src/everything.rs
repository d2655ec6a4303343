//! Every method of the blocking driver.

use crate::bus::Bus;
use adis16405_driver::{
    Adis16405, AlarmNumber, Config, DacLevel, Error, Gpio, GyroRange, OnChipCompensation, Register, Sleep, Stimulus,
};
use core::convert::Infallible;
use core::hint::black_box;

pub(crate) fn use_all(bus: Bus) -> Result<(), Error<Infallible>> {
    let mut delay = bus;
    let mut imu = Adis16405::new(bus, Config::default());
    black_box(imu.start_up(&mut delay)?);
    black_box(imu.software_reset(&mut delay)?);
    black_box(imu.configure(black_box(Config::default()))?);
    black_box(imu.set_sample_rate(black_box(204.8))?);
    black_box(imu.set_range(black_box(GyroRange::Dps75))?);
    black_box(imu.set_filter_taps_log2(black_box(3))?);
    black_box(imu.read_register(black_box(Register::TempOut))?);
    black_box(imu.write_register(black_box(Register::AuxDac), black_box(1))?);
    black_box(imu.update_register(black_box(Register::AuxDac), black_box(1), black_box(1))?);
    black_box(imu.diagnosis()?);
    black_box(imu.self_test(&mut delay)?);
    black_box(imu.flash_test(&mut delay)?);
    black_box(imu.stimulus_response(black_box(Stimulus::Positive), &mut delay)?);
    black_box(imu.set_gyro_offsets(black_box([0; 3]))?);
    black_box(imu.keep_negative_x_bias_on_host()?);
    black_box(imu.set_accl_offsets(black_box([0; 3]))?);
    black_box(imu.set_hard_iron(black_box([0; 3]))?);
    black_box(imu.set_soft_iron(black_box([0; 3]))?);
    black_box(imu.auto_null(&mut delay)?);
    black_box(imu.precision_auto_null(&mut delay)?);
    black_box(imu.factory_restore(&mut delay)?);
    black_box(imu.flash_update(&mut delay)?);
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
    black_box(imu.wake(&mut delay)?);
    black_box(imu.sample()?);
    Ok(())
}
