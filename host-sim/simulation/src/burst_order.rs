//! The driver's channels and the virtual sensor's output registers, which both count in the order of a burst read.

use adis16405_driver::Channel;
use virtual_sensor::OutputRegister;

/// The driver's channel of an output register; both count in the order of a burst read.
pub const fn channel(output: OutputRegister) -> Channel {
    Channel::ALL[output as usize]
}

/// The output register that the driver reads as `channel`.
pub const fn output_register(channel: Channel) -> OutputRegister {
    OutputRegister::ALL[channel as usize]
}
