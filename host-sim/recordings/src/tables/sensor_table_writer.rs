//! The rows of any sensor written as a table with units in its header, and as a NumPy array.

use crate::counts::count_table_writer::write_text;
use crate::counts::numpy_matrix::{SiUnit, write_matrix};
use crate::tables::sensor_table::{SensorTable, TableColumn};
use std::io;
use std::path::Path;

/// Writes CSV, gzip if the name of `file` ends in `.gz`: `sample` and `time_s`, where the recording has them, and the channels in
/// the units of the analysis, as in `gyro_x [deg/s]`. Times count from the first sample; a missing value is `NaN`.
pub(crate) fn write_table(table: &SensorTable, file: &Path) -> io::Result<()> {
    let SensorTable { times_s, indices, columns, .. } = table;
    let stamps = [("sample", indices.is_some()), ("time_s", times_s.is_some())];
    let stamps = stamps.into_iter().filter(|(_, has)| *has).map(|(name, _)| name.to_owned());
    let channels = columns.iter().map(|column| format!("{} [{}]", column.profile.name, column.profile.unit));
    let header: Vec<String> = stamps.chain(channels).collect();
    write_text(file, |out| {
        writeln!(out, "{}", header.join(","))?;
        for row in 0..rows(table) {
            // `{}` of a float is the shortest text that reads back to the same value.
            let index = indices.as_ref().and_then(|indices| indices.get(row)).map(u64::to_string);
            let time = times_s.as_ref().and_then(|times| times.get(row)).map(f64::to_string);
            let values = columns.iter().map(|column| value(column, row).to_string());
            writeln!(out, "{}", index.into_iter().chain(time).chain(values).collect::<Vec<_>>().join(","))?;
        }
        Ok(())
    })
}

/// Writes a matrix of doubles, a row a sample: its time in s, if the recording has times, then the channels, angular rates in
/// rad/s, specific forces in m/s², others in the unit of the analysis. Returns the names of the columns.
pub(crate) fn write_array(table: &SensorTable, file: &Path) -> io::Result<Vec<String>> {
    let units: Vec<SiUnit> = table.columns.iter().map(|column| SiUnit::of(column.profile.unit)).collect();
    let time = table.times_s.iter().map(|_| "time_s".to_owned());
    let channels =
        table.columns.iter().zip(&units).map(|(column, unit)| format!("{}_{}", column.profile.name, unit.suffix));
    let names: Vec<String> = time.chain(channels).collect();
    let values = (0..rows(table)).flat_map(|row| {
        let time = table.times_s.as_ref().and_then(|times| times.get(row)).copied();
        let channels = table.columns.iter().zip(&units).map(move |(column, unit)| value(column, row) * unit.factor);
        time.into_iter().chain(channels)
    });
    write_matrix(file, rows(table), names.len(), values)?;
    Ok(names)
}

fn rows(table: &SensorTable) -> usize {
    table.columns.first().map_or(0, |column| column.values.len())
}

/// In the unit of the channel's profile.
fn value(column: &TableColumn, row: usize) -> f64 {
    column.values.get(row).map_or(f64::NAN, |value| value * column.factor)
}
