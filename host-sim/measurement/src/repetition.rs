//! Distinguishes repeated samples from samples that are equal by chance.

/// The fraction f of repeated samples, the solution of `all = f + (1 − f)·Π (share − f)/(1 − f)`; `all` and `shares`
/// are fractions of equal samples in all channels and in each.
#[must_use]
pub fn repeated_fraction(all: f64, shares: &[f64]) -> f64 {
    let (mut low, mut high) = (0.0, all);
    for _ in 0..50 {
        let repeated = 0.5 * (low + high);
        let by_chance: f64 = shares.iter().map(|share| ((share - repeated) / (1.0 - repeated)).max(0.0)).product();
        if repeated + (1.0 - repeated) * by_chance < all { low = repeated } else { high = repeated }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::repeated_fraction;

    /// A fraction of 0.3 is equal by chance, and none or half are read again.
    #[test]
    fn equal_samples_are_told_from_those_that_are_read_again() {
        let by_chance = 0.3_f64.powi(3);
        assert!(repeated_fraction(by_chance, &[0.3; 3]) < 1e-9);
        let halves = 0.5 + 0.5 * by_chance;
        assert!((repeated_fraction(halves, &[0.65; 3]) - 0.5).abs() < 1e-9);
    }
}
