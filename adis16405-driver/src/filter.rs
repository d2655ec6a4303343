//! What the part's digital filter does to a signal, as pure functions.

/// The Bartlett filter of gyros, accelerometers and magnetometers: two cascaded averages of N = 2^M samples each.
///
/// That the stages are plain averages is confirmed by the −3 dB frequencies that Linux has for this part, to the digits
/// that it gives. Analog poles at 404 Hz and 757 Hz (0.48 ms more delay; a figure for a sibling) come before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Filter {
    taps_log2: u8,
}

/// Bisections that a −3 dB frequency takes to be exact in `f64`.
const BISECTIONS: u32 = 52;

impl Filter {
    /// `taps_log2` is M, 0 (no filter) to 6; greater ones count as 6.
    pub const fn new(taps_log2: u8) -> Self {
        Self { taps_log2: if taps_log2 > 6 { 6 } else { taps_log2 } }
    }

    /// N, samples that each stage averages.
    pub const fn taps(self) -> u32 {
        1 << self.taps_log2
    }

    /// Samples that an output depends on, 2N − 1. A reply of Analog Devices says 2N + 1 (EngineerZone, thread 17231).
    pub const fn length(self) -> u32 {
        2 * self.taps() - 1
    }

    /// Group delay in samples, N − 1, at every frequency. By the reply cited for
    /// [`length`](Self::length) it would be (2N + 1)/2; sources at hand do not settle it.
    pub const fn group_delay(self) -> u32 {
        self.taps() - 1
    }

    /// Amplitude response at `frequency` in cycles per sample (that is f/fs; 0.5 is the Nyquist frequency):
    /// |sin(πNf/fs) / (N·sin(πf/fs))|².
    pub fn gain(self, frequency: f64) -> f64 {
        // sin(Nx)/(N·sin x) is the product of cos(2ᵏx) over k < M.
        let mut cosine = cos_pi(frequency);
        let mut stage = 1.0;
        for _ in 0..self.taps_log2 {
            stage *= cosine;
            cosine = 2.0 * cosine * cosine - 1.0;
        }
        stage * stage
    }

    /// The −3 dB frequency in cycles per sample: times the sample rate it is in Hz. `None` without a filter.
    pub fn cutoff(self) -> Option<f64> {
        if self.taps_log2 == 0 {
            return None;
        }
        // The gain falls from 1 to 0 before 1/N.
        let (mut low, mut high) = (0.0, 1.0 / f64::from(self.taps()));
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            let gain = self.gain(middle);
            if gain * gain > 0.5 { low = middle } else { high = middle }
        }
        Some(low)
    }

    /// What becomes of the variance of white noise, (2N² + 1)/(3N³): the sum of the squared weights.
    pub fn white_noise_gain(self) -> f64 {
        let n = f64::from(self.taps());
        (2.0 * n * n + 1.0) / (3.0 * n * n * n)
    }

    /// Weight of the sample `age` samples ago, a triangle whose weights sum to 1.
    pub fn weight(self, age: u32) -> f64 {
        let n = self.taps();
        let height = if age < n { age + 1 } else { (2 * n - 1).saturating_sub(age) };
        f64::from(height) / f64::from(n * n)
    }
}

/// cos(πx), by its series after folding x into 0…1/2.
fn cos_pi(x: f64) -> f64 {
    let turn = x.abs() % 2.0;
    let half = if turn > 1.0 { 2.0 - turn } else { turn };
    let (sign, folded) = if half > 0.5 { (-1.0, 1.0 - half) } else { (1.0, half) };
    let square = (core::f64::consts::PI * folded) * (core::f64::consts::PI * folded);
    // Horner's scheme from the term of degree 22, which is below 2⁻⁵³ at π/2.
    let mut sum = 1.0;
    for k in (1..=11).rev() {
        sum = 1.0 - square * sum / f64::from((2 * k - 1) * (2 * k));
    }
    sign * sum
}
