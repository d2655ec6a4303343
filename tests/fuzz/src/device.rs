//! Commands to the device.

use link::{BootCause, Decoder, Message, Received};
use simulation::Device;
use virtual_sensor::{NoiseModel, VirtualAdis16405};

/// The device continues after any bytes at its port: it sends undamaged frames and has not crashed.
pub(crate) fn commands(bytes: &[u8]) {
    let part = VirtualAdis16405::new(NoiseModel::paper(), 1);
    let mut device = Device::new(part, Device::blank_memory()).with_restarts();
    let mut now_us = 600_000;
    let mut sent = device.run_until(now_us);
    for keys in bytes.chunks(16) {
        device.press(keys);
        now_us = now_us.max(device.bus().part().now() / 1000) + 10_000;
        sent.extend(device.run_until(now_us));
    }
    device.press(b"\rr");
    now_us = now_us.max(device.bus().part().now() / 1000) + 1_500_000;
    sent.extend(device.run_until(now_us));
    let mut decoder = Decoder::new();
    for received in sent.iter().filter_map(|&byte| decoder.push(byte)) {
        if let Received::Message { message: Message::Hello(hello), .. } = received {
            assert!(hello.boot.cause != BootCause::Watchdog && hello.boot.crash_record.is_empty(), "{hello:?}");
        }
    }
    let counters = decoder.counters();
    assert_eq!((counters.bad_frames, counters.discarded_bytes), (0, 0), "the stream is damaged");
}
