//! Reads an ADIS16405 on a Linux host, such as a Raspberry Pi, through spidev.
//!
//! | Raspberry Pi header | signal | sensor pin |
//! |---|---|---|
//! | 24, GPIO 8 | CE0 | CS |
//! | 23, GPIO 11 | SCLK | SCLK |
//! | 21, GPIO 9 | MISO | DOUT |
//! | 19, GPIO 10 | MOSI | DIN |
//! | 2 (5 V), 6 (ground) | supply | VCC, GND |
//!
//! The sensor runs from 5 V and drives its outputs from an internal 3.3 V: connect every signal directly, without a divider
//! or a level shifter (data sheet Rev. B, page 5).
//!
//! ```console
//! $ cargo run -p adis16405-driver --example spidev -- /dev/spidev0.0
//! ```

#[cfg(target_os = "linux")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    use adis16405_driver::{Adis16405, Config, Error, Faults, GyroRange, SamplePeriod};
    use linux_embedded_hal::spidev::{SpiModeFlags, SpidevOptions};
    use linux_embedded_hal::{Delay, SpidevDevice};
    use std::time::Duration;

    let device = std::env::args().nth(1).unwrap_or_else(|| "/dev/spidev0.0".into());
    let config = Config::new(GyroRange::Dps300, 4, SamplePeriod::nearest(204.8)?)?;
    let sck_hz = config.sample_period().clock_mode().max_burst_sck_hz();
    let mut spi = SpidevDevice::open(&device)?;
    spi.configure(&SpidevOptions::new().max_speed_hz(sck_hz).mode(SpiModeFlags::SPI_MODE_3).build())?;

    let mut imu = Adis16405::new(spi, Delay, config);
    let product = imu.start_up()?;
    let test = imu.self_test()?;
    println!("{product:?}, self-test {}: {:?}", if test.passed() { "passed" } else { "failed" }, test.diagnosis);

    for _ in 0..100 {
        // The data-ready line is not used here: reads are slower than the sensor's sampling, so each sample is new.
        std::thread::sleep(Duration::from_millis(10));
        match imu.read() {
            Ok(sample) => {
                println!("{:8.3?} °/s {:7.4?} g {:.1} °C", sample.gyro_dps(), sample.accl_g(), sample.temp_degc());
                if sample.warnings().contains(Faults::ERROR_ALARM) {
                    println!("{:?}", imu.diagnosis()?);
                }
            }
            Err(Error::Unusable(faults)) => {
                println!("not usable: {}", faults.causes().collect::<Vec<_>>().join(", "));
            }
            Err(error) => return Err(error.into()),
        }
    }
    for (cause, count) in imu.fault_counters().by_cause().filter(|(_, count)| *count > 0) {
        println!("{count} × {cause}");
    }
    Ok(())
}

#[cfg(not(target_os = "linux"))]
fn main() {
    eprintln!("This example needs Linux: spidev is a Linux interface.");
}
