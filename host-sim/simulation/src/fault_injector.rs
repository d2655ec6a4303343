//! Faults between the virtual sensor and the application: damaged frames and answers, and faults of the board.

use crate::line_fault::{LineFault, RandomFault};
use adis16405_driver::BURST_BYTES;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use firmware::FrameTimes;
use std::cell::{Cell, RefCell};
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

/// The damage of frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameFault {
    /// Gyro x has an impossible rate.
    ImpossibleRate,
    /// Every bit of a burst comes one clock early.
    Shifted,
    /// The data line is stuck low or high, for all frames.
    Stuck {
        /// True if it reads ones.
        high: bool,
    },
    /// Every burst has the words of the first one, with new data.
    Frozen,
    /// No word has new data.
    Stale,
    /// The supply is at 4.70 V and DIAG_STAT shows it. No word is damaged.
    LowSupply,
    /// A bit of every word is stuck, for all frames.
    StuckBit {
        /// Number of the bit, 0 for the last one.
        bit: u8,
        /// True if it reads one.
        high: bool,
    },
    /// Every bit of all frames comes one clock late, as with another SPI mode.
    Late,
    /// One of this many ones reads zero in all frames, as with a level that is too low.
    OnesLost(u32),
    /// Bits that are 0 in this mask are stuck low in every word to the sensor.
    Requests(u16),
}

/// The event that ends a frame fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultEnd {
    /// This number of bursts has been damaged.
    Bursts(u32),
    /// A pulse on chip select comes without a clock.
    Pulse,
    /// The sensor is reset by its command.
    Reset,
    /// The sensor is reset by its RST line.
    ResetLine,
    /// The bus gets longer times.
    SlowBus,
    /// The fault does not end by itself.
    Never,
}

/// The faults that are present; all can be changed at any time.
#[derive(Debug, Clone, Default)]
pub struct InjectedFaults {
    /// The frame fault and its end.
    pub frames: Option<(FrameFault, FaultEnd)>,
    /// Bits of DIAG_STAT that are set until it is read, in addition to the sensor's own.
    pub status: u16,
    /// Bursts damaged so far, usable or not.
    pub damaged: u64,
    /// True if the data-ready line is interrupted.
    pub no_data_ready: bool,
    /// True if the data-ready line oscillates: a thousand edges for each one.
    pub oscillates: bool,
    /// True if the estimators' interrupt does not come.
    pub no_estimators: bool,
    /// True if the serial port sends nothing.
    pub no_transmission: bool,
    /// A fault that comes at random.
    pub random: Option<RandomFault>,
}

impl InjectedFaults {
    /// True if the random fault makes the transfer of a burst fail.
    pub(crate) fn fails_transfer(&mut self) -> bool {
        self.random.as_mut().is_some_and(|random| random.meets(LineFault::Failed))
    }

    /// Number of data-ready edges that come instead of one.
    pub(crate) fn edges(&mut self) -> u32 {
        let mut meets = |fault| self.random.as_mut().is_some_and(|random| random.meets(fault));
        if self.no_data_ready || meets(LineFault::LostEdge) { 0 } else { 1 + u32::from(meets(LineFault::DoubledEdge)) }
    }

    /// True if the faults hide the sensor's present samples, so that they could not be used.
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
    /// First byte of the latest frame; its answer comes with the next one.
    latest: Rc<RefCell<u8>>,
    /// The burst that a frozen sensor repeats.
    frozen: Rc<RefCell<Option<[u8; BURST_BYTES]>>>,
    /// The latest burst as the sensor sent it.
    sent: Rc<RefCell<[u8; BURST_BYTES]>>,
    /// Number of ones sent so far.
    ones: Rc<Cell<u32>>,
    times: Rc<Cell<SelectTimes>>,
}

/// Times of chip select.
#[derive(Debug, Clone, Copy)]
struct SelectTimes {
    fell_ns: u64,
    rose_ns: u64,
    frames: FrameTimes,
}

impl FaultyBus {
    /// A bus without faults.
    pub(crate) fn new(bus: EmulatedBus) -> Self {
        let times = Rc::new(Cell::new(SelectTimes { fell_ns: 0, rose_ns: 0, frames: FrameTimes::NONE }));
        let (faults, latest, frozen) = (Rc::default(), Rc::default(), Rc::default());
        Self { bus, faults, latest, frozen, sent: Rc::default(), ones: Rc::default(), times }
    }

    /// The times of the frames since the last call.
    pub(crate) fn take_frame_times(&self) -> FrameTimes {
        let times = self.times.get();
        self.times.set(SelectTimes { frames: FrameTimes { low_us: times.frames.low_us, ..FrameTimes::NONE }, ..times });
        times.frames
    }

    /// Notes a frame that began at `fell_ns` and has ended now.
    fn note_times(&self, fell_ns: u64) {
        let SelectTimes { fell_ns: before_ns, rose_ns, frames } = self.times.get();
        let now_ns = self.bus.part().now();
        let us = |ns: u64| u32::try_from(ns / 1000).unwrap_or(u32::MAX);
        let frames = FrameTimes {
            low_us: us(now_ns - fell_ns),
            shortest_high_us: frames.shortest_high_us.min(us(fell_ns - rose_ns)),
            shortest_period_us: frames.shortest_period_us.min(us(fell_ns - before_ns)),
        };
        self.times.set(SelectTimes { fell_ns, rose_ns: now_ns, frames });
    }

    /// Damages the answer of the sensor in any frame.
    fn damage_line(&self, answer: &mut [u8]) {
        let Some((fault, _)) = self.faults.borrow().frames else { return };
        match fault {
            FrameFault::StuckBit { bit, high } => {
                for byte in answer.iter_mut().skip(usize::from(bit < 8)).step_by(2) {
                    let mask = 1 << (bit % 8);
                    *byte = if high { *byte | mask } else { *byte & !mask };
                }
            }
            FrameFault::Late => {
                let mut before = 0;
                for byte in answer {
                    let sent = *byte;
                    *byte = sent >> 1 | before << 7;
                    before = sent;
                }
            }
            FrameFault::OnesLost(every) => {
                for byte in answer {
                    for mask in (0..8).map(|bit| 1 << bit) {
                        self.ones.set(self.ones.get().wrapping_add(u32::from(*byte & mask != 0)));
                        if *byte & mask != 0 && self.ones.get().is_multiple_of(every) {
                            *byte &= !mask;
                        }
                    }
                }
            }
            _ => {}
        }
    }

    /// The bus and the part on it.
    pub(crate) fn bus(&self) -> &EmulatedBus {
        &self.bus
    }

    /// The faults.
    pub(crate) fn faults(&self) -> &Rc<RefCell<InjectedFaults>> {
        &self.faults
    }

    /// Pulses the RST line of the part, which then starts up.
    pub(crate) fn reset_part(&self) {
        let mut part = self.bus.part_mut();
        part.power_off();
        part.power_on();
        let mut faults = self.faults.borrow_mut();
        faults.status = 0;
        faults.frames = faults.frames.filter(|(_, end)| !matches!(end, FaultEnd::Reset | FaultEnd::ResetLine));
    }

    /// Ends a frame fault if the transaction of the controller is its end.
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
            _ => {}
        }
        if let FaultEnd::Bursts(left) = end {
            faults.frames = (left > 1).then_some((fault, FaultEnd::Bursts(left - 1)));
        }
    }

    /// Runs the transaction on the bus, with the random fault if it occurs.
    fn transact(&mut self, operations: &mut [Operation<'_, u8>]) {
        let mut faults = self.faults.borrow_mut();
        if let Some((FrameFault::Requests(mask), _)) = faults.frames
            && let [Operation::Transfer(answer, request)] = operations
        {
            let damaged: Vec<u8> =
                request.iter().zip(mask.to_be_bytes().into_iter().cycle()).map(|(a, b)| a & b).collect();
            let Ok(()) = self.bus.transaction(&mut [Operation::Transfer(answer, &damaged)]);
            return;
        }
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
        let fell_ns = self.bus.part().now();
        self.transact(operations);
        self.note_times(fell_ns);
        let requested = std::mem::replace(&mut *self.latest.borrow_mut(), sent.map_or(0, |[address, _]| address));
        for operation in operations.iter_mut() {
            if let Operation::Transfer(answer, _) = operation {
                self.damage_line(answer);
            }
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
