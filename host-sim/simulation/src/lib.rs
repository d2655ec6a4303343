//! The driver, or the whole firmware, with the virtual sensor or with a replayed recording.

mod burst_order;
mod bus_timing;
mod device;
mod fault_injector;
mod line_fault;
mod logged_bus;
mod replay;
mod sample_audit;
mod scenario_text;
mod simulation;

pub use burst_order::{channel, output_register};
pub use bus_timing::CapturedBusTiming;
pub use device::Device;
pub use fault_injector::{FaultEnd, FaultyBus, FrameFault, InjectedFaults};
pub use line_fault::{LineFault, RandomFault};
pub use replay::{Replay, replay};
pub use sample_audit::SampleAudit;
pub use scenario_text::ScenarioTextError;
pub use simulation::{HostClock, LONGEST_S, SAMPLE_RATE_HZ, Simulation, SimulationError, TimedFault};
