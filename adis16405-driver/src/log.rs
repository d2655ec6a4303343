//! Sets of flags in defmt logs: by their bits, which defmt's decoder need not know.

use crate::diagnosis::Diagnosis;
use crate::fault::Faults;
use crate::pin::Dio;

impl defmt::Format for Faults {
    fn format(&self, formatter: defmt::Formatter<'_>) {
        defmt::write!(formatter, "Faults({=u16:#x})", self.bits());
    }
}

impl defmt::Format for Diagnosis {
    fn format(&self, formatter: defmt::Formatter<'_>) {
        defmt::write!(formatter, "Diagnosis({=u16:#x})", self.bits());
    }
}

impl defmt::Format for Dio {
    fn format(&self, formatter: defmt::Formatter<'_>) {
        defmt::write!(formatter, "Dio({=u8:#x})", self.bits());
    }
}
