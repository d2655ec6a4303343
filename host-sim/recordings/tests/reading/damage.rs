//! Damaged files: what is left of them, or one line of error. `tests/tests/attack` does the same to the program, in bounded memory.

use super::harness::{read_file, rows};
use super::other_programs::{Sample, samples};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recordings::ColumnSelection;
use recordings::file_format::RecordedInput;
use std::path::Path;

#[test]
fn damaged_files_of_every_format_end_in_a_result_or_one_line() {
    let Some(samples) = samples("damaged_files_of_every_format_end_in_a_result_or_one_line") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let no_columns = ColumnSelection::parse(&[], &[]).expect("nothing");
    let mut rng = ChaCha8Rng::seed_from_u64(18);
    let (mut refused, mut read) = (0, 0);
    for Sample { name, file, options, .. } in &samples {
        let whole = std::fs::read(file).expect("written");
        let ending = Path::new(name).extension().expect("an ending").to_str().expect("UTF-8");
        let file = folder.path().join(format!("damaged.{ending}"));
        for case in 0..12 {
            let mut bytes = whole.clone();
            let length = bytes.len();
            match case {
                0 => bytes.truncate(rng.random_range(1..length.min(200))),
                1..4 => bytes.truncate(rng.random_range(1..length)),
                4..9 => (0..1 << (case - 4)).for_each(|_| bytes[rng.random_range(0..length.min(2000))] = rng.random()),
                _ => (0..1 << (2 * (case - 8)))
                    .for_each(|_| bytes[rng.random_range(0..length)] ^= 1 << rng.random_range(0..8)),
            }
            std::fs::write(&file, &bytes).expect("written");
            // Most are read whole, as they are converted; some on their time base, and some as their columns are shown.
            let error = match case {
                5 | 10 => read_file(&file, options).err().map(|error| error.to_string()),
                3 | 8 => RecordedInput::open(&file)
                    .and_then(|file| file.inspect(None, &no_columns))
                    .err()
                    .map(|e| e.to_string()),
                _ => rows(&file, options).err().map(|error| error.to_string()),
            };
            match error {
                None => read += 1,
                Some(line) => {
                    let is_line = !line.contains(char::is_control) && line.len() < 2000;
                    assert!(
                        is_line && (line.contains("damaged.") || case == 5 || case == 10),
                        "{name}, case {case}: {line:?}"
                    );
                    refused += 1;
                }
            }
        }
    }
    assert!(refused > 50 && read > 50, "{refused} refused, {read} read");
}
