//! Bursts by a transport of one's own, on the parts of the driver that need no bus: the interrupt of data ready starts a transfer by
//! DMA, the interrupt of its end validates the burst. Here the interrupts are calls and the DMA copies, so that it runs without hardware.
//!
//! ```console
//! $ cargo run -p adis16405-driver --example own_transport
//! ```
//!
//! `Adis16405` configures the part first, and `release` returns its SPI device. Sampling then keeps three rules of the data sheet:
//! chip select is low for the whole transfer, SCK is at most 1 MHz, and 16 µs pass before the next frame.

use adis16405_driver::{BURST_BYTES, BURST_REQUEST, Burst, BurstValidator, Config, Counts, GyroRange, ImuSample};

/// The SPI peripheral with its DMA channels.
struct Dma {
    /// The part's next answer.
    part: [u8; BURST_BYTES],
    received: Option<[u8; BURST_BYTES]>,
}

impl Dma {
    /// Selects the part and starts to send; what comes meanwhile is stored.
    fn start(&mut self, _request: &'static [u8; BURST_BYTES]) {
        self.received = Some(self.part);
    }
}

/// State that both interrupts share.
struct Sampler {
    dma: Dma,
    validator: BurstValidator,
    range: GyroRange,
    /// Pulses that came while a burst was under way: missing samples.
    lost: u32,
}

impl Sampler {
    /// The rising edge of DIO1.
    fn data_ready(&mut self) {
        match self.dma.received {
            None => self.dma.start(&BURST_REQUEST),
            Some(_) => self.lost += 1,
        }
    }

    /// The end of the transfer, with which chip select rises; the sample if it is usable.
    fn transfer_ended(&mut self) -> Option<ImuSample> {
        let burst = Burst::from_bytes(&self.dma.received.take()?);
        let validity = self.validator.validate(&burst);
        validity.is_usable().then(|| ImuSample::new(burst.counts(), self.range).with_warnings(validity.faults))
    }
}

fn main() {
    // Supply, gyros, accelerometers, magnetometers, temperature, auxiliary input, in counts.
    let sound = Burst::from_counts(&Counts::new([2068, 3, -2, 1, 4, -5, 300, 120, -40, 500, 0, 1000])).to_bytes();
    let dma = Dma { part: sound, received: None };
    let mut sampler = Sampler { dma, validator: BurstValidator::default(), range: Config::default().range(), lost: 0 };
    for answer in [sound, [0; BURST_BYTES], sound] {
        sampler.dma.part = answer;
        sampler.data_ready();
        match sampler.transfer_ended() {
            Some(sample) => println!("{:.3?} °/s", sample.gyro_dps()),
            None => println!("refused"),
        }
    }
    let counters = sampler.validator.counters();
    println!("{} bursts, {} refused, {} lost", counters.bursts, counters.unusable, sampler.lost);
}
