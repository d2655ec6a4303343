//! The part's digital filter: two cascaded averages of 2^M samples each (Bartlett window).

/// The filter of one channel.
#[derive(Clone, Debug)]
pub struct Bartlett {
    stages: [Average; 2],
}

impl Bartlett {
    /// `taps_log2` is M, up to 6 in the part; M = 0 does not filter.
    pub fn new(taps_log2: u8) -> Self {
        let stage = Average { window: vec![0.0; 1 << taps_log2], position: 0, filled: false };
        Self { stages: [stage.clone(), stage] }
    }

    /// Filters one value. The first one is taken for the past as well, so that there is no transient from zero.
    pub fn filter(&mut self, value: f64) -> f64 {
        let [first, second] = &mut self.stages;
        second.push(first.push(value))
    }
}

#[derive(Clone, Debug)]
struct Average {
    window: Vec<f64>,
    position: usize,
    filled: bool,
}

impl Average {
    fn push(&mut self, value: f64) -> f64 {
        if !self.filled {
            self.window.fill(value);
            self.filled = true;
        }
        self.window[self.position] = value;
        self.position = (self.position + 1) % self.window.len();
        // Not a running sum: its rounding would build up over a long simulation.
        self.window.iter().sum::<f64>() / self.window.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::Bartlett;

    #[test]
    fn the_impulse_response_is_a_triangle() {
        let mut filter = Bartlett::new(2);
        filter.filter(0.0);
        let response: Vec<f64> = (0..8).map(|k| 16.0 * filter.filter(if k == 0 { 1.0 } else { 0.0 })).collect();
        assert_eq!(response, [1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0, 0.0]);
    }

    #[test]
    fn without_taps_nothing_changes() {
        let mut filter = Bartlett::new(0);
        assert_eq!([3.0, -1.0, 0.25].map(|value| filter.filter(value)), [3.0, -1.0, 0.25]);
    }

    #[test]
    fn a_constant_passes_from_the_first_sample() {
        let mut filter = Bartlett::new(6);
        assert_eq!([0.1; 200].map(|value| (filter.filter(value) - 0.1).abs() < 1e-15), [true; 200]);
    }
}
