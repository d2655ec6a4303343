//! Conversion between the driver's channels and the virtual sensor's output registers. Both count in the order of a
//! burst read.

use adis16405_driver::Channel;
use virtual_sensor::OutputRegister;

/// The driver's channel of an output register.
pub const fn channel(output: OutputRegister) -> Channel {
    Channel::ALL[output as usize]
}

/// The output register of the driver's `channel`.
pub const fn output_register(channel: Channel) -> OutputRegister {
    OutputRegister::ALL[channel as usize]
}
