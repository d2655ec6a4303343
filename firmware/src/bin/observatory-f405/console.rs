//! The serial port to the host: two byte queues, emptied and filled by its interrupt.

use core::cell::RefCell;
use critical_section::Mutex;
use firmware::Sink;
use heapless::spsc::{Consumer, Producer, Queue};
use stm32f4xx_hal::serial::{Rx, RxListen, Serial, Tx, TxISR, TxListen};
use stm32f4xx_hal::{interrupt, pac, prelude::*};

/// Two of the longest frames, and the slot that the queue needs.
type Outgoing = Queue<u8, 4096>;
type Incoming = Queue<u8, 64>;

struct Port {
    tx: Tx<pac::USART2>,
    rx: Rx<pac::USART2>,
    outgoing: Consumer<'static, u8>,
    incoming: Producer<'static, u8>,
}

/// On its way from the main program to the interrupt.
static HANDOVER: Mutex<RefCell<Option<Port>>> = Mutex::new(RefCell::new(None));

/// Above the sampling: a handful of instructions, and a byte waits no longer than 21 µs.
const PRIORITY: u8 = 1 << 4;

/// The main program's end of the serial port.
pub(crate) struct Console {
    outgoing: Producer<'static, u8>,
    incoming: Consumer<'static, u8>,
}

impl Console {
    pub(crate) fn start(usart: Serial<pac::USART2>, nvic: &mut pac::NVIC) -> Self {
        let outgoing = cortex_m::singleton!(: Outgoing = Queue::new()).expect("the console starts once");
        let incoming = cortex_m::singleton!(: Incoming = Queue::new()).expect("the console starts once");
        let (to_port, outgoing) = outgoing.split();
        let (incoming, from_port) = incoming.split();
        let (tx, mut rx) = usart.split();
        rx.listen();
        critical_section::with(|section| {
            HANDOVER.borrow_ref_mut(section).replace(Port { tx, rx, outgoing, incoming });
        });
        // SAFETY: no critical section relies on priorities, and the interrupt finds its data in place.
        unsafe {
            nvic.set_priority(pac::Interrupt::USART2, PRIORITY);
            pac::NVIC::unmask(pac::Interrupt::USART2);
        }
        Self { outgoing: to_port, incoming: from_port }
    }

    /// The next byte that arrived.
    pub(crate) fn received(&mut self) -> Option<u8> {
        self.incoming.dequeue()
    }

    /// Waits until there is room for the frame; for the time before sampling starts.
    pub(crate) fn say(&mut self, frame: &[u8]) {
        while !self.offer(frame) {
            cortex_m::asm::wfi();
        }
    }
}

impl Sink for Console {
    fn offer(&mut self, frame: &[u8]) -> bool {
        if self.outgoing.capacity() - self.outgoing.len() < frame.len() {
            return false;
        }
        for &byte in frame {
            let _room_was_checked = self.outgoing.enqueue(byte);
        }
        pac::NVIC::pend(pac::Interrupt::USART2);
        true
    }
}

#[interrupt]
fn USART2() {
    static mut PORT: Option<Port> = None;
    if PORT.is_none() {
        *PORT = critical_section::with(|section| HANDOVER.borrow_ref_mut(section).take());
    }
    let Some(port) = PORT else { return };
    // Read whatever the flags say: an overrun raises the interrupt too, and only a read clears it.
    if let Ok(byte) = port.rx.read() {
        let _full = port.incoming.enqueue(byte);
    }
    if port.tx.is_tx_empty() {
        match port.outgoing.dequeue() {
            Some(byte) => {
                let _empty_was_checked = port.tx.write(byte);
                port.tx.listen();
            }
            None => port.tx.unlisten(),
        }
    }
}
