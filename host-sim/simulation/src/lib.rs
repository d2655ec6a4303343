//! The driver, or the whole firmware, on the virtual sensor or on a replayed recording.

mod device;
mod fault_injector;
mod logged_bus;
mod replay;
mod simulation;

pub use device::Device;
pub use fault_injector::{FaultEnd, FaultyBus, FrameFault, InjectedFaults};
pub use replay::{Replay, replay, replay_log, replay_table};
pub use simulation::{HostClock, LONGEST_S, SAMPLE_RATE_HZ, Simulation, SimulationError};

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
