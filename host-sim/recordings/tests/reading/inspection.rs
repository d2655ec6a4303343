//! The content that is found in a file, and the options that are proposed for it.

use super::harness::{inspect, normal, read_file};
use recordings::inspection::{InspectedTable, Proposal};
use std::path::PathBuf;
use tempfile::TempDir;

const ROWS: u32 = 6000;

fn inspected(folder: &TempDir, text: &str) -> (PathBuf, InspectedTable) {
    let file = folder.path().join("rows.csv");
    std::fs::write(&file, text).expect("written");
    let mut tables = inspect(&file);
    assert_eq!(tables.len(), 1);
    (file, tables.remove(0))
}

fn only(table: &InspectedTable) -> &Proposal {
    let [proposal] = &table.proposals[..] else { panic!("{:?}", table.proposals) };
    proposal
}

fn options(proposal: &Proposal) -> Vec<String> {
    let [columns, units] = [&proposal.columns, &proposal.units].map(|list| list.join(","));
    let options = [("--columns", columns), ("--units", units)].into_iter().filter(|(_, value)| !value.is_empty());
    options.flat_map(|(name, value)| [name.to_owned(), value]).collect()
}

/// Rows `t x y z x y z` without a heading at 100 Hz: an accelerometer at rest, and a gyroscope of 131 LSB per deg/s.
#[test]
fn columns_without_names_are_proposed_by_their_numbers() {
    const MPU_RAD_S: f64 = 1.0 / 131.0 * std::f64::consts::PI / 180.0;
    let folder = tempfile::tempdir().expect("a folder");
    for (gravity, force_unit, step, rate_unit, between, [accl, gyro]) in
        [(9.81, "m/s^2", MPU_RAD_S, "rad/s", ["", ""], [1, 4]), (1.0, "g", 1.0 / 131.0, "deg/s", ["3 ", "4 "], [2, 6])]
    {
        let mut normal = normal(11);
        let row = |row: u32| {
            let force = [0.1, -0.2, 0.97].map(|part| gravity * (part + 0.002 * normal()));
            let rate = [3.0, -2.0, 1.0].map(|bias: f64| step * (bias + 9.0 * normal()).round());
            let [force, rate] = [force, rate].map(|axes| axes.map(|value| format!("{value:.9}")).join(" "));
            format!("{:.2} {}{force} {}{rate}\n\n", f64::from(row) / 100.0, between[0], between[1])
        };
        let (file, table) = inspected(&folder, &(0..ROWS).map(row).collect::<String>());
        let columns = |channel: &str, first: usize| {
            let axes = ["x", "y", "z"].into_iter().zip(first..);
            axes.map(|(axis, at)| format!("{channel}_{axis}={at}")).collect::<Vec<_>>()
        };
        let proposal = only(&table);
        let expected = [vec!["time=0".to_owned()], columns("gyro", gyro), columns("accl", accl)].concat();
        assert_eq!((&proposal.columns, proposal.units.join(",")), (&expected, format!("{rate_unit},{force_unit}")));
        assert!(proposal.is_safe() && proposal.is_guessed);
        let guesses = table.columns.iter().filter_map(|column| column.guess.as_ref());
        assert!(guesses.into_iter().any(|guess| guess.reason.contains("131.0 LSB per deg/s")), "{:?}", table.columns);
        assert_eq!((table.rows as u32, table.missing), (ROWS, 0));
        assert!((table.rate.expect("a rate").hz / 100.0 - 1.0).abs() < 1e-6);
        let steady = table.steady.as_ref().expect("a sensor");
        assert!(steady.is_rest && steady.rows == (0..table.rows), "{steady:?}");
        let read = read_file(&file, &options(proposal)).expect("as proposed");
        assert_eq!((read.samples.len() as u32, read.missing()), (ROWS, 0));
    }
}

#[test]
fn a_guess_in_doubt_is_not_safe() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut normal = normal(12);
    let mut table = |heading: &str, mut row: Box<dyn FnMut(u32, f64) -> String>| {
        let rows: String = (0..1000).map(|at| row(at, normal())).collect();
        inspected(&folder, &format!("{heading}\n{rows}"))
    };
    let (_, unknown) = table("p,q", Box::new(|_, value| format!("{value:.4},{:.4}\n", value * value)));
    assert_eq!(unknown.proposals, []);
    // Noise of 0.002 may be that of a rate in rad/s or of a good one in deg/s.
    let (_, rate) = table("t,gyro_x", Box::new(|row, value| format!("{row},{:.6}\n", 0.002 * value)));
    assert!(only(&rate).units.contains(&"rad/s".to_owned()) && !only(&rate).doubts.is_empty(), "{:?}", only(&rate));
    // Counts of an unknown size.
    let (file, counts) = table("t,gyro_x", Box::new(|row, value| format!("{row},{:.0}\n", 32768.0 + 5.0 * value)));
    assert!(only(&counts).doubts.iter().any(|doubt| doubt.contains("deg/s/131")), "{:?}", only(&counts));
    assert!(read_file(&file, &["--units", "deg/s/131"]).is_ok());
    let (_, no_rate) = table("gyro_x_deg_s", Box::new(|_, value| format!("{:.4}\n", 5.0 * value)));
    assert!(only(&no_rate).lacks_rate && !only(&no_rate).is_safe());
}

#[test]
fn a_bias_of_1_is_not_taken_for_gravity_beside_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut normal = normal(13);
    let row = |row: u32| {
        let rate = [0.6, -0.7, 0.4].map(|bias| bias + 0.1 * normal());
        let force = [0.0, 0.0, 9.81].map(|part| part + 0.02 * normal());
        let values = rate.iter().chain(&force).map(|value| format!("{value:.7}")).collect::<Vec<_>>().join(",");
        format!("{},{values}\n", 1_700_000_000_000u64 + u64::from(row) * 5)
    };
    let (_, table) = inspected(&folder, &(0..2000).map(row).collect::<String>());
    let columns = only(&table).columns.join(",");
    assert!(columns.contains("gyro_x=1,gyro_y=2,gyro_z=3,accl_x=4,accl_y=5,accl_z=6"), "{columns}");
    assert!((table.rate.expect("a rate").hz / 200.0 - 1.0).abs() < 1e-6);
}

/// The part at rest is found in blocks of 128 rows; the one beside the movement is left out.
#[test]
fn the_part_at_rest_is_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut normal = normal(14);
    let row = |row: u32| {
        let moved = if (2560..3840).contains(&row) { 40.0 } else { 0.0 };
        let rate = [0, 1, 2].map(|_| format!("{:.5}", moved * normal() + 0.05 * normal()));
        format!("{:.3},{}\n", f64::from(row) * 0.01, rate.join(","))
    };
    let rows: String = (0..10_000).map(row).collect();
    let (_, table) = inspected(&folder, &format!("time_s,gx [dps],gy [dps],gz [dps]\n{rows}"));
    let part = table.part_at_rest().expect("a part");
    assert_eq!(table.steady.as_ref().map(|steady| steady.rows.clone()), Some(3840 + 128..10_000));
    assert!((part.from_s - 39.68).abs() < 1e-9 && (part.to_s - 100.0).abs() < 1e-6, "{part:?}");
}

#[test]
fn sensors_whose_names_begin_differently_have_a_proposal_each_in_the_order_of_the_table() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut normal = normal(15);
    let names = |imu: &str| ["x", "y", "z"].map(|axis| format!("{imu}_gyro_{axis} [rad/s]")).join(",");
    let row = |row: u32| {
        let values = [(); 6].map(|()| format!("{:.6}", 0.002 * normal()));
        format!("{:.3},{}\n", f64::from(row) * 0.01, values.join(","))
    };
    let rows: String = (0..1000).map(row).collect();
    let (file, table) = inspected(&folder, &format!("time_s,{},{}\n{rows}", names("imu2"), names("imu10")));
    let proposals: Vec<String> = table.proposals.iter().map(|proposal| proposal.columns.join(",")).collect();
    let expected =
        ["imu2", "imu10"].map(|imu| format!("time=time,gyro_x={imu}_gyro_x,gyro_y={imu}_gyro_y,gyro_z={imu}_gyro_z"));
    assert_eq!(proposals, expected);
    for proposal in &table.proposals {
        assert_eq!(read_file(&file, &options(proposal)).expect("as proposed").samples.len(), 1000);
    }
}
