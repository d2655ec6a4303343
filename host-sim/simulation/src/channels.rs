//! The driver's channels and the virtual sensor's output registers: both count in the order of a burst read.

use adis16405_driver::Channel;
use virtual_sensor::OutputRegister;

/// The driver's channel of an output register.
pub const fn channel(output: OutputRegister) -> Channel {
    Channel::ALL[output as usize]
}

/// The output register that the driver reads as `channel`.
pub const fn output_register(channel: Channel) -> OutputRegister {
    OutputRegister::ALL[channel as usize]
}

#[cfg(test)]
mod tests {
    use super::{Channel, OutputRegister, channel, output_register};

    #[test]
    fn each_output_register_is_the_channel_of_its_name() {
        for (index, output) in OutputRegister::ALL.into_iter().enumerate() {
            assert_eq!(format!("{output:?}"), format!("{:?}", channel(output)));
            assert_eq!(output_register(Channel::ALL[index]), output);
        }
    }
}
