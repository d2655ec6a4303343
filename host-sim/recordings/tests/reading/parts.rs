//! Parts of a recording by time.

use super::harness::{normal, read};

#[test]
fn a_part_is_what_a_file_of_it_would_be() {
    let mut normal = normal(13);
    let rows: Vec<(u32, i32)> = (0..20_000)
        .map(|row| (row, (40.0 * normal()).round() as i32))
        .filter(|(row, _)| ![100, 8000, 8001, 19_000].contains(row))
        .collect();
    let of_index: fn(&(u32, i32)) -> String = |(row, count)| format!("{row},{count}\n");
    let of_time: fn(&(u32, i32)) -> String = |(row, count)| format!("{}.{:02},{count}\n", row / 100, row % 100);
    let of_row: fn(&(u32, i32)) -> String = |(_, count)| format!("{count}\n");
    for (heading, line, rate, samples, lost) in [
        ("sample,gyro_x_counts", of_index, &["--rate", "100"][..], 9998, 2),
        ("time_s,gyro_x_counts", of_time, &[], 9998, 2),
        ("time_s,gyro_x [dps]", of_time, &[], 9998, 2),
        ("gyro_x_deg_s", of_row, &["--rate", "100"], 10_000, 0),
    ] {
        let is_inside = |(position, (row, _)): &(usize, (u32, i32))| match lost {
            0 => (5000..15_000).contains(position),
            _ => (5000..15_000).contains(row),
        };
        let all = rows.iter().copied().enumerate();
        let table = |rows: Vec<(u32, i32)>| format!("{heading}\n{}", rows.iter().map(line).collect::<String>());
        let part = table(all.filter(is_inside).map(|(_, row)| row).collect());
        let cut = [&["--from", "50", "--to", "150"], rate].concat();
        let cut = read("whole.csv", table(rows.clone()).as_bytes(), &cut).expect(heading);
        let part = read("part.csv", part.as_bytes(), rate).expect(heading);
        assert_eq!((cut.samples.len(), cut.missing()), (samples, lost), "{heading}");
        assert_eq!(cut.samples.slots, part.samples.slots, "{heading}");
        assert_eq!(cut.channel("gyro_x").counts, part.channel("gyro_x").counts, "{heading}");
    }
}

#[test]
fn a_part_without_enough_samples_is_refused() {
    let rows: String = (0..2000).map(|row| format!("{}\n", row * 7919 % 41)).collect();
    let table = format!("gyro_x_counts\n{rows}");
    for (options, words) in [
        (&["--rate", "100", "--from", "500"][..], "the recording has 19.990 s"),
        (&["--rate", "100", "--from", "5", "--to", "5"], "no sample from 5 to 5 s"),
        (&["--rate", "100", "--from", "5", "--to", "5.02"], "record too short: 2 usable samples"),
        // Without a rate nothing says where 5 s are.
        (&["--from", "5"], "no sample rate"),
    ] {
        let error = read("rows.csv", table.as_bytes(), options).err().expect(words).to_string();
        assert!(error.contains(words), "{error}");
    }
}
