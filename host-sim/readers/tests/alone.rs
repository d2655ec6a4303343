//! The crate as a program uses it that has no other of these.

use readers::{
    InputFile, MemoryArray, MemoryColumn, MemoryTable, Number, ReadMonitor, RowOptions, SensorChannel, SensorChannels,
    WantedRows,
};
use std::path::Path;
use std::sync::Arc;

fn values(text: &str, sensor: SensorChannels) -> (Vec<&'static str>, Vec<f64>, Vec<Vec<f64>>) {
    let file = InputFile::in_memory(Path::new("rows.csv"), text.as_bytes()).expect("text");
    let mut rows = file.rows(&RowOptions::of_sensor(sensor), &|_| None).expect("columns");
    let columns = rows.columns().to_vec();
    let (mut times, mut values) = (Vec::new(), vec![Vec::new(); columns.len()]);
    let read = rows.read(WantedRows::all(None), &mut |batch| {
        times.extend(batch.times);
        for ((own, column), next) in values.iter_mut().zip(&columns).zip(batch.values) {
            own.extend(next.into_iter().map(|value| value * column.factor));
        }
        true
    });
    assert!(read.expect("rows").is_complete());
    (columns.into_iter().map(|column| column.channel.name).collect(), times, values)
}

#[test]
fn columns_are_read_in_the_units_of_their_channels() {
    let rows = "t_ms,wx [mrad/s],ay [m/s^2]\n0,0,9.80665\n10,1000,0\n20,-1000,-9.80665\n30,0,0\n";
    let (names, times, values) = values(rows, SensorChannels::generic());
    assert_eq!((names, times), (vec!["gyro_x", "accl_y"], vec![0.0, 0.01, 0.02, 0.03]));
    // 1 rad/s is 57.29578 deg/s.
    assert!((values[0][1] - 57.295_78).abs() < 1e-4 && (values[1][0] - 1.0).abs() < 1e-12);
}

#[test]
fn counts_have_the_size_that_the_sensor_states() {
    let channel = SensorChannel { name: "gyro_z", unit: "deg/s", lsb: Some(0.05) };
    let sensor = SensorChannels { name: "of a shop", channels: vec![channel] };
    let (names, _, values) = values("gyro_z_counts\n1\n-2\n3\n4\n", sensor);
    assert_eq!((names, values), (vec!["gyro_z"], vec![[1.0, -2.0, 3.0, 4.0].map(|count| count * 0.05).to_vec()]));
}

/// A column of doubles that the program holds.
#[derive(Debug)]
struct Doubles(Vec<f64>);

impl MemoryColumn for Doubles {
    fn rows(&self) -> usize {
        self.0.len()
    }

    fn read(&self, first: usize, numbers: &mut [Number]) {
        numbers.iter_mut().zip(&self.0[first..]).for_each(|(number, value)| *number = Number::Real(*value));
    }
}

#[test]
fn arrays_of_one_length_are_a_table_of_several_batches() {
    let rows = 100_005;
    let column = |offset: f64| -> Arc<dyn MemoryColumn> {
        Arc::new(Doubles((0..rows).map(|row| row as f64 + offset).collect()))
    };
    let array =
        |name: &str, unit: &str, columns| MemoryArray { name: name.to_owned(), unit: Some(unit.to_owned()), columns };
    let gyro = array("gyro", "rad/s", [0.1, 0.2, 0.3].map(column).into());
    let table = MemoryTable { arrays: vec![array("time", "s", vec![column(0.0)]), gyro] };
    let file = InputFile::of_arrays(Path::new("arrays"), Arc::new(table), &ReadMonitor::default());
    let mut reader = file.rows(&RowOptions::of_sensor(SensorChannels::generic()), &|_| None).expect("columns by name");
    let names: Vec<&str> = reader.columns().iter().map(|column| column.channel.name).collect();
    assert_eq!(names, ["gyro_x", "gyro_y", "gyro_z"]);
    let (mut batches, mut times, mut last) = (0, Vec::new(), Vec::<f64>::new());
    let read = reader.read(WantedRows::all(None), &mut |batch| {
        batches += 1;
        times.extend(batch.times);
        last.extend(&batch.values[2]);
        true
    });
    assert_eq!(read.expect("numbers").rows, rows as u64);
    assert!(batches > 1 && times.iter().copied().eq((0..rows).map(|row| row as f64)));
    assert_eq!(last[rows - 1], (rows - 1) as f64 + 0.3);
}
