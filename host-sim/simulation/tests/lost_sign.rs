//! The part's erratum on the device: a negative bias of gyro x in the sensor, which would cost every burst the sign of
//! negative rates, is taken out of it before its samples are used.

use link::{Decoder, Health, Message};
use simulation::device::Device;
use virtual_sensor::{NoiseModel, VirtualAdis16405};

/// XGYRO_OFF = −100, byte by byte (data sheet Rev. B, table 8: address 0x1A, 13 bits).
const NEGATIVE_BIAS: [u16; 2] = [0x9A9C, 0x9B1F];

fn health(part: VirtualAdis16405) -> Health {
    let mut device = Device::new(part, Device::blank_memory());
    let mut decoder = Decoder::new();
    let messages = device.run_until(11_000_000).into_iter().filter_map(move |byte| decoder.push(byte)?.message());
    let health = messages.filter_map(|message| if let Message::Health(health) = message { Some(health) } else { None });
    health.reduce(|_, later| later).expect("a report after 10 s")
}

#[test]
fn a_negative_bias_in_the_sensor_costs_no_sample() {
    let mut part = VirtualAdis16405::new(NoiseModel::paper(), 11);
    for (k, word) in (1..).zip(NEGATIVE_BIAS) {
        part.advance_to(k * 100_000);
        part.select();
        part.transfer(word);
        part.deselect();
    }
    let health = health(part);
    assert!(health.bursts > 2_000, "{health:?}");
    assert_eq!(health.used, health.bursts, "{health:?}");
}
