//! Equal rows at either end: erased memory or a held value.

use crate::rows::{Batch, RowBefore};

/// Fewest rows, and ratio to equal rows within.
const LEAST_ROWS: u64 = 64;
const TIMES_AS_MANY: u64 = 8;

/// Rows between the padding, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unpadded {
    pub first: u64,
    pub end: u64,
}

impl Unpadded {
    pub const ALL: Self = Self { first: 0, end: u64::MAX };

    pub fn note(self, rows: u64) -> String {
        let (before, after) = (self.first, rows - self.end);
        format!(
            "{} rows that are all equal, {before} at the start and {after} at the end, are padding and left out",
            before + after
        )
    }

    /// A batch that begins with this row.
    pub fn apply<V>(self, first_row: u64, batch: &mut Batch<V>) {
        if self != Self::ALL {
            let rows = first_row..first_row + batch.rows as u64;
            batch.retain(&rows.map(|row| (self.first..self.end).contains(&row)).collect::<Vec<_>>());
        }
    }
}

#[derive(Debug, Default)]
pub struct PaddingFinder {
    rows: u64,
    leading: Option<u64>,
    run: u64,
    longest: u64,
    before: RowBefore,
}

impl PaddingFinder {
    pub fn add<V>(&mut self, batch: &Batch<V>) {
        for is_equal in self.before.equals(batch) {
            if is_equal {
                self.run += 1;
            } else {
                match self.leading {
                    _ if self.rows == 0 => {}
                    None => self.leading = Some(self.run),
                    Some(_) => self.longest = self.longest.max(self.run),
                }
                self.run = 1;
            }
            self.rows += 1;
        }
    }

    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// `None` without padding.
    pub fn finish(&self) -> Option<Unpadded> {
        let is_padding = |run: &u64| *run >= LEAST_ROWS.max(TIMES_AS_MANY * self.longest);
        let leading = self.leading.filter(is_padding).unwrap_or(0);
        // Constant.
        let trailing = Some(self.run).filter(|run| self.leading.is_some() && is_padding(run)).unwrap_or(0);
        (leading + trailing > 0).then_some(Unpadded { first: leading, end: self.rows - trailing })
    }
}

#[cfg(test)]
mod tests {
    use super::{PaddingFinder, Unpadded};
    use crate::rows::Batch;

    fn found(values: &[f64], batch_rows: usize) -> Option<Unpadded> {
        let mut finder = PaddingFinder::default();
        for part in values.chunks(batch_rows) {
            let values = vec![part.to_vec(), part.iter().map(|value| 2.0 * value).collect()];
            finder.add::<()>(&Batch { rows: part.len(), values, ..Batch::default() });
        }
        finder.finish()
    }

    #[test]
    fn equal_rows_at_either_end_are_padding_in_batches_of_any_size() {
        let noise: Vec<f64> = (0..5000).map(|row| f64::from(row * 7919 % 101)).collect();
        let held = |before: usize, after: usize| [vec![0.0; before], noise[1..].to_vec(), vec![-1.0; after]].concat();
        for batch_rows in [1, 7, 100, 10_000] {
            assert_eq!(found(&noise, batch_rows), None);
            assert_eq!(found(&held(0, 240), batch_rows), Some(Unpadded { first: 0, end: 4999 }));
            assert_eq!(found(&held(1500, 100), batch_rows), Some(Unpadded { first: 1500, end: 6499 }));
            assert_eq!(found(&held(30, 30), batch_rows), None);
            assert_eq!(found(&vec![3.0; 5000], batch_rows), None);
        }
    }
}
