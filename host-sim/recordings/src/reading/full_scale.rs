//! Counts rows with a channel at full scale by the data sheet, else at 16 bits if reached but not exceeded.

use crate::batch_source::ProfiledColumn;
use readers::ColumnQuantizer;
use std::collections::BTreeMap;

const MAX_16_BITS: i32 = i16::MAX as i32;
const MIN_16_BITS: i32 = i16::MIN as i32;
const MOST_COLUMNS: usize = 64;
/// Relative to the range.
const HALF_COUNT: f64 = 1.0 / 65_536.0;

#[derive(Debug, Clone, Copy)]
struct Extreme {
    value: f64,
    first_row: u64,
    count: u64,
}

pub(crate) struct FullScale {
    /// Largest and smallest number by column.
    extremes: Vec<[Extreme; 2]>,
    rows: BTreeMap<u128, u64>,
}

impl FullScale {
    pub(crate) fn new(columns: &[ProfiledColumn]) -> Self {
        let none = |value: f64| Extreme { value, first_row: 0, count: 0 };
        let of_column = |column: &ProfiledColumn| {
            // Larger numbers are at full scale too.
            let range = column.channel.range.map(|range| range * (1.0 - HALF_COUNT) / column.factor);
            [none(range.unwrap_or(f64::NEG_INFINITY)), none(range.map_or(f64::INFINITY, |range| -range))]
        };
        Self { extremes: columns.iter().take(MOST_COLUMNS).map(of_column).collect(), rows: BTreeMap::new() }
    }

    /// Rows from `first` on, by column; refused numbers are NaN.
    pub(crate) fn add_rows(&mut self, columns: &[ProfiledColumn], first_row: u64, values: &[Vec<f64>]) {
        let is_candidate = |(values, [most, least]): (&Vec<f64>, &[Extreme; 2])| {
            values.iter().any(|value| *value >= most.value || *value <= least.value)
        };
        let watched = columns.iter().zip(values).zip(&self.extremes);
        // Hardly any row has an extreme.
        let has_candidate = watched
            .filter(|((column, _), _)| is_watched(column))
            .any(|((_, values), extremes)| is_candidate((values, extremes)));
        if !has_candidate {
            return;
        }
        for row in 0..values.first().map_or(0, Vec::len) {
            self.add(columns, first_row + row as u64, values.iter().map(|column| column[row]));
        }
    }

    fn add(&mut self, columns: &[ProfiledColumn], row: u64, numbers: impl Iterator<Item = f64>) {
        let mut mask = 0u128;
        for (at, (number, column)) in numbers.zip(columns).take(MOST_COLUMNS).enumerate() {
            if !is_watched(column) {
                continue;
            }
            for side in 0..2 {
                let extreme = &mut self.extremes[at][side];
                let is_beyond = if side == 0 { number > extreme.value } else { number < extreme.value };
                let bit = 1u128 << (2 * at + side);
                if is_beyond && column.channel.range.is_none() {
                    *extreme = Extreme { value: number, first_row: row, count: 1 };
                    mask |= bit;
                    forget(&mut self.rows, bit);
                } else if is_beyond || number == extreme.value {
                    if extreme.count == 0 {
                        extreme.first_row = row;
                    }
                    extreme.count += 1;
                    mask |= bit;
                }
            }
        }
        if mask != 0 {
            *self.rows.entry(mask).or_insert(0) += 1;
        }
    }

    /// Rows at full scale, and a note per channel.
    pub(crate) fn finish(
        &self,
        columns: &[ProfiledColumn],
        quantizers: &[Option<ColumnQuantizer>],
    ) -> (u64, Vec<String>) {
        let (mut mask, mut notes) = (0u128, Vec::new());
        for (at, (extremes, column)) in self.extremes.iter().zip(columns).enumerate() {
            let Some(quantizer) = &quantizers[at] else { continue };
            let counts = extremes.map(|extreme| quantizer.count(extreme.value));
            let is_in_16_bits =
                counts[0].is_none_or(|most| most <= MAX_16_BITS) && counts[1].is_none_or(|least| least >= MIN_16_BITS);
            let is_full = |side: usize| {
                let of_16_bits = [MAX_16_BITS, MIN_16_BITS][side];
                let is_at_end = is_in_16_bits && counts[side] == Some(of_16_bits);
                extremes[side].count > 0 && (column.channel.range.is_some() || is_at_end)
            };
            let full: Vec<usize> = (0..2).filter(|side| is_full(*side)).collect();
            full.iter().for_each(|side| mask |= 1 << (2 * at + side));
            let count: u64 = full.iter().map(|side| extremes[*side].count).sum();
            if let Some(first) = full.iter().map(|side| extremes[*side].first_row).min() {
                notes.push(format!(
                    "{}: {count} samples at full scale, the first of them row {}",
                    column.channel.name,
                    first + 1
                ));
            }
        }
        let rows = self.rows.iter().filter(|(of, _)| **of & mask != 0).map(|(_, rows)| rows).sum();
        (rows, notes)
    }
}

/// Supply and temperature without a range are often constant.
fn is_watched(column: &ProfiledColumn) -> bool {
    column.channel.range.is_some() || column.channel.quantity.is_inertial()
}

fn forget(rows: &mut BTreeMap<u128, u64>, bit: u128) {
    let had: Vec<u128> = rows.keys().copied().filter(|mask| mask & bit != 0).collect();
    for mask in had {
        let count = rows.remove(&mask).unwrap_or(0);
        if mask != bit {
            *rows.entry(mask & !bit).or_insert(0) += count;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::FullScale;
    use crate::batch_source::ProfiledColumn;
    use measurement::{ChannelProfile, Quantity};
    use readers::ColumnQuantizer;

    fn found(range: Option<f64>, rows: &[[f64; 2]]) -> (u64, Vec<String>) {
        let channel = ChannelProfile { range, ..ChannelProfile::generic("gyro_x", Quantity::AngularRate) };
        let column = ProfiledColumn { channel, factor: 1.0, label: String::new(), register: None };
        let columns = [column.clone(), column];
        let mut scale = FullScale::new(&columns);
        for (row, numbers) in rows.iter().enumerate() {
            scale.add(&columns, row as u64, numbers.iter().copied());
        }
        scale.finish(&columns, &[Some(ColumnQuantizer::COUNTS); 2])
    }

    fn counts() -> Vec<[f64; 2]> {
        (0..50_000).map(|at| [f64::from(at * 7919 % 50), 1.0]).collect()
    }

    #[test]
    fn rows_at_full_scale_are_counted_once_whatever_channels_have_it() {
        assert_eq!(found(None, &counts()), (0, Vec::new()));
        let mut seen = counts();
        seen[100..140].fill([32_767.0, 3.0]);
        seen[130..150].iter_mut().for_each(|row| row[1] = -32_768.0);
        let (rows, notes) = found(None, &seen);
        assert_eq!(rows, 50);
        assert_eq!(notes[0], "gyro_x: 40 samples at full scale, the first of them row 101");
        assert_eq!(notes[1], "gyro_x: 20 samples at full scale, the first of them row 131");
        // Beyond 16 bits it is no full scale.
        seen[7][0] = 40_000.0;
        assert_eq!(found(None, &seen).0, 20);
    }

    #[test]
    fn a_range_of_the_data_sheet_is_the_full_scale() {
        let largest = counts().iter().filter(|row| row[0] == 49.0).count() as u64;
        assert_eq!(found(Some(49.0), &counts()).0, largest);
        assert_eq!(found(Some(60.0), &counts()).0, 0);
    }
}
