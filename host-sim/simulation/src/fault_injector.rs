//! Faults between the virtual sensor and the application: a bus that damages frames and answers, and switches of the board.

use crate::line_fault::{LineFault, RandomFault};
use adis16405_driver::BURST_BYTES;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use std::cell::RefCell;
use std::convert::Infallible;
use std::rc::Rc;
use virtual_sensor::{DiagnosisFlag, EmulatedBus};

/// Read of DIAG_STAT, register 0x3C.
const READ_DIAG_STAT: u8 = 0x3C;
/// Write to the lower byte of GLOB_CMD, register 0x3E, and its bit for a software reset.
const WRITE_GLOB_CMD: u8 = 0xBE;
const SOFTWARE_RESET: u8 = 1 << 7;
/// Read of GLOB_CMD: a burst.
const READ_BURST: u8 = 0x3E;
/// Bit 15 and bit 14 of an output word.
const NEW_DATA: u8 = 0x80;
const ERROR_ALARM: u8 = 0x40;
/// 7,500 counts in 14 bits with new data: a rate that no range reaches.
const IMPOSSIBLE_RATE: [u8; 2] = [0x9D, 0x4C];
/// SUPPLY_OUT of 4.70 V in counts of 2.418 mV, with new data.
const LOW_SUPPLY: [u8; 2] = [0x87, 0x98];
/// DIAG_STAT, supply below 4.75 V.
const SUPPLY_LOW: u16 = 1;

/// How frames are damaged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameFault {
    /// Gyro x has an impossible rate.
    ImpossibleRate,
    /// Every bit of a burst comes one clock early.
    Shifted,
    /// The data line is stuck low or high, for all frames.
    Stuck {
        /// Whether it reads ones.
        high: bool,
    },
    /// Every burst has the words of the first one, with new data.
    Frozen,
    /// No word has new data.
    Stale,
    /// The supply is at 4.70 V, and DIAG_STAT says so. Nothing is damaged.
    LowSupply,
}

/// When a frame fault ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultEnd {
    /// After so many bursts.
    Bursts(u32),
    /// With a pulse on chip select without a clock.
    Pulse,
    /// With a software reset.
    Reset,
    /// With a pulse on the RST line.
    ResetLine,
    /// With longer times on the bus.
    CarefulBus,
    /// Not by itself.
    Never,
}

/// The faults that are present; all can be changed at any time.
#[derive(Debug, Clone, Default)]
pub struct InjectedFaults {
    /// The frame fault and its end.
    pub frames: Option<(FrameFault, FaultEnd)>,
    /// Bits of DIAG_STAT that are set until it is read, beside the sensor's own.
    pub status: u16,
    /// Bursts damaged so far, usable or not.
    pub damaged: u64,
    /// The data-ready line is interrupted.
    pub no_data_ready: bool,
    /// The data-ready line oscillates: a thousand edges for every one.
    pub oscillates: bool,
    /// The estimators' interrupt does not come.
    pub no_estimators: bool,
    /// The serial port sends nothing.
    pub no_transmission: bool,
    /// A fault that comes at random.
    pub random: Option<RandomFault>,
}

impl InjectedFaults {
    /// Whether the random fault has the transfer of a burst fail.
    pub(crate) fn fails_transfer(&mut self) -> bool {
        self.random.as_mut().is_some_and(|random| random.meets(LineFault::Failed))
    }

    /// Number of data-ready edges that come in the place of one.
    pub(crate) fn edges(&mut self) -> u32 {
        let mut meets = |fault| self.random.as_mut().is_some_and(|random| random.meets(fault));
        if self.no_data_ready || meets(LineFault::LostEdge) { 0 } else { 1 + u32::from(meets(LineFault::DoubledEdge)) }
    }

    /// Whether an observer who knew everything could not use the sensor's present samples.
    pub(crate) fn hide_samples(&self) -> bool {
        let harmless = |fault| fault == FrameFault::LowSupply;
        self.no_data_ready
            || self.oscillates
            || self.no_estimators
            || self.frames.is_some_and(|(fault, _)| !harmless(fault))
    }
}

/// The emulated bus with [`InjectedFaults`]. Clones are handles on the same bus and the same faults.
#[derive(Debug, Clone)]
pub struct FaultyBus {
    bus: EmulatedBus,
    faults: Rc<RefCell<InjectedFaults>>,
    /// First byte of the latest frame, whose answer comes with the next one.
    latest: Rc<RefCell<u8>>,
    /// The burst that a frozen sensor repeats.
    frozen: Rc<RefCell<Option<[u8; BURST_BYTES]>>>,
    /// The latest burst as the sensor sent it.
    sent: Rc<RefCell<[u8; BURST_BYTES]>>,
}

impl FaultyBus {
    /// A bus without faults.
    pub(crate) fn new(bus: EmulatedBus) -> Self {
        Self { bus, faults: Rc::default(), latest: Rc::default(), frozen: Rc::default(), sent: Rc::default() }
    }

    /// The bus and the part on it.
    pub(crate) fn bus(&self) -> &EmulatedBus {
        &self.bus
    }

    /// The faults.
    pub(crate) fn faults(&self) -> &Rc<RefCell<InjectedFaults>> {
        &self.faults
    }

    /// A pulse on the RST line of the part, which then starts up.
    pub(crate) fn reset_part(&self) {
        let mut part = self.bus.part_mut();
        part.power_off();
        part.power_on();
        let mut faults = self.faults.borrow_mut();
        faults.status = 0;
        faults.frames = faults.frames.filter(|(_, end)| !matches!(end, FaultEnd::Reset | FaultEnd::ResetLine));
    }

    /// Ends a frame fault by what the controller has sent.
    fn note_transaction(&self, sent: Option<[u8; 2]>) {
        let mut faults = self.faults.borrow_mut();
        let reset = sent.is_some_and(|[address, value]| address == WRITE_GLOB_CMD && value & SOFTWARE_RESET != 0);
        let ended = match faults.frames {
            Some((_, FaultEnd::Pulse)) => sent.is_none(),
            Some((_, FaultEnd::Reset)) => reset,
            _ => false,
        };
        if ended {
            faults.frames = None;
        }
        if reset {
            faults.status = 0;
        }
    }

    fn damage_burst(&self, answer: &mut [u8]) {
        let mut faults = self.faults.borrow_mut();
        let fault = faults.frames;
        if let Some((FrameFault::LowSupply, _)) = fault {
            faults.status |= SUPPLY_LOW;
        }
        if faults.status != 0 {
            answer[2..].iter_mut().step_by(2).for_each(|byte| *byte |= ERROR_ALARM);
        }
        let Some((fault, end)) = fault else {
            *self.frozen.borrow_mut() = None;
            return;
        };
        faults.damaged += u64::from(fault != FrameFault::LowSupply);
        match fault {
            FrameFault::ImpossibleRate => answer[4..6].copy_from_slice(&IMPOSSIBLE_RATE),
            FrameFault::Shifted => {
                let bits = answer.to_vec();
                let next = |k: usize| bits.get(k + 1).map_or(0, |byte| byte >> 7);
                for (k, byte) in answer.iter_mut().enumerate() {
                    *byte = bits[k] << 1 | next(k);
                }
            }
            FrameFault::Stuck { high } => answer.fill(if high { 0xFF } else { 0 }),
            FrameFault::Frozen => {
                let mut frozen = self.frozen.borrow_mut();
                let repeated = frozen.get_or_insert_with(|| std::array::from_fn(|k| answer[k]));
                answer.copy_from_slice(repeated);
            }
            FrameFault::Stale => answer[2..].iter_mut().step_by(2).for_each(|byte| *byte &= !NEW_DATA),
            FrameFault::LowSupply => {
                let flags = answer[2] & ERROR_ALARM;
                answer[2..4].copy_from_slice(&LOW_SUPPLY);
                answer[2] |= flags;
            }
        }
        if let FaultEnd::Bursts(left) = end {
            faults.frames = (left > 1).then_some((fault, FaultEnd::Bursts(left - 1)));
        }
    }

    /// The transaction on the bus, with the random fault if it meets it.
    fn transact(&mut self, operations: &mut [Operation<'_, u8>]) {
        let mut faults = self.faults.borrow_mut();
        let Some(random) = faults.random.as_mut() else {
            let Ok(()) = self.bus.transaction(operations);
            return;
        };
        if let [Operation::Transfer(answer, request)] = operations {
            let (mut request, mut sent) = (request.to_vec(), self.sent.borrow_mut());
            random.damage_request(&mut request);
            let is_burst = answer.len() == BURST_BYTES;
            let ended_after = if is_burst { random.shortened() } else { None };
            let (taken, rest) = answer.split_at_mut(ended_after.unwrap_or(request.len()));
            let Ok(()) = self.bus.transaction(&mut [Operation::Transfer(taken, &request[..taken.len()])]);
            rest.fill(0xFF); // no part drives the line
            if ended_after.is_some() && random.fault() == LineFault::Reset {
                self.bus.part_mut().power_off();
                self.bus.part_mut().power_on();
            }
            let before = *sent;
            if let Ok(burst) = <&[u8; BURST_BYTES]>::try_from(&**answer) {
                *sent = *burst;
            }
            if random.damage_answer(answer, is_burst.then_some(&before)) {
                self.bus.part_mut().latch_flag(DiagnosisFlag::SpiCommunication);
            }
        } else {
            let Ok(()) = self.bus.transaction(operations);
        }
    }

    fn damage_frame(&self, answer: &mut [u8; 2], requested: u8) {
        let mut faults = self.faults.borrow_mut();
        if requested == READ_DIAG_STAT {
            let status = std::mem::take(&mut faults.status) | u16::from_be_bytes(*answer);
            *answer = status.to_be_bytes();
        }
        if let Some((FrameFault::Stuck { high }, _)) = faults.frames {
            *answer = if high { [0xFF; 2] } else { [0; 2] };
        }
    }
}

impl ErrorType for FaultyBus {
    type Error = Infallible;
}

impl SpiDevice<u8> for FaultyBus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        let sent = operations.iter().find_map(|operation| match operation {
            Operation::Transfer(_, write) | Operation::Write(write) => Some([write[0], write[1]]),
            _ => None,
        });
        self.transact(operations);
        let requested = std::mem::replace(&mut *self.latest.borrow_mut(), sent.map_or(0, |[address, _]| address));
        for operation in operations.iter_mut() {
            match operation {
                Operation::Transfer(answer, [READ_BURST, ..]) if answer.len() == BURST_BYTES => {
                    self.damage_burst(answer)
                }
                Operation::Transfer(answer, _) => {
                    if let Ok(answer) = <&mut [u8; 2]>::try_from(&mut **answer) {
                        self.damage_frame(answer, requested);
                    }
                }
                _ => {}
            }
        }
        self.note_transaction(sent);
        Ok(())
    }
}
