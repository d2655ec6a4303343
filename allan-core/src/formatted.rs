//! Compact `defmt::Format` of the estimators: numbers of samples and differences instead of all sums.

use crate::{Cascade, Coupling, FractionalOctaves, Hadamard, Snapshot};
use defmt::{Format, Formatter, write};

impl<const OCTAVES: usize, const OVERLAP: usize> Format for Cascade<OCTAVES, OVERLAP> {
    fn format(&self, f: Formatter) {
        write!(f, "Cascade<{}, {}> of {} samples, {} missing", OCTAVES, OVERLAP, self.len(), self.missing());
    }
}

impl<const OCTAVES: usize, const OVERLAP: usize> Format for Snapshot<OCTAVES, OVERLAP> {
    fn format(&self, f: Formatter) {
        write!(f, "Snapshot<{}, {}> of {} samples, {} missing", OCTAVES, OVERLAP, self.len(), self.missing());
    }
}

impl<const OCTAVES: usize> Format for Coupling<OCTAVES> {
    fn format(&self, f: Formatter) {
        let products = self.sum_of_products(0).map(|(_, count)| count);
        write!(f, "Coupling<{}> of {} products, {} samples out of step", OCTAVES, products, self.out_of_step());
    }
}

impl<const OCTAVES: usize, const OVERLAP: usize> Format for Hadamard<OCTAVES, OVERLAP> {
    fn format(&self, f: Formatter) {
        let differences = self.sum_of_squares(0).map(|(_, count)| count);
        write!(f, "Hadamard<{}, {}> of {} differences", OCTAVES, OVERLAP, differences);
    }
}

impl<const OCTAVES: usize, const OVERLAP: usize> Format for FractionalOctaves<OCTAVES, OVERLAP> {
    fn format(&self, f: Formatter) {
        let differences = self.sum_of_squares(5).map(|(_, count)| count);
        write!(f, "FractionalOctaves<{}, {}> of {} differences", OCTAVES, OVERLAP, differences);
    }
}
