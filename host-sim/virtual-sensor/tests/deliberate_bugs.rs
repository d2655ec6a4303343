//! Deliberate bugs, seeded into a copy of the driver one at a time. The driver's tests on the virtual part must find
//! each. This shows that the tests can fail, and that the part does not share the driver's errors.
//!
//! A bug replaces one piece of source text. A bug that does not apply any more is an error, also without `--long`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The test modules in which the driver reads the part.
const TESTS: [&str; 3] = ["driver", "procedures", "misbehaving_part"];

/// A bug in a file of the driver: the original text, its replacement, the meaning, and a test that finds it.
struct Bug {
    meaning: &'static str,
    file: &'static str,
    right: &'static str,
    wrong: &'static str,
    found_by: &'static str,
}

const fn bug(
    meaning: &'static str,
    file: &'static str,
    right: &'static str,
    wrong: &'static str,
    found_by: &'static str,
) -> Bug {
    Bug { meaning, file, right, wrong, found_by }
}

#[rustfmt::skip]
const BUGS: [Bug; 34] = [
    bug("a burst is requested with 0x3C00", "burst.rs",
        "request[0] = 0x3E;", "request[0] = 0x3C;",
        "the_driver_reads_what_the_part_sampled"),
    bug("the words of a burst are taken a byte early", "burst.rs",
        "bytes[2..].chunks_exact(2)", "bytes[1..].chunks_exact(2)",
        "the_driver_reads_what_the_part_sampled"),
    bug("counts are not sign-extended", "burst.rs",
        "Channel::ALL[index].signed());", "false);",
        "the_driver_reads_what_the_part_sampled"),
    bug("the temperature has 14 bits", "channel.rs",
        "Channel::Temp | Channel::AuxAdc => 12,", "Channel::AuxAdc => 12,",
        "values_are_those_that_the_part_senses"),
    bug("an accelerometer count is 3.333 mg", "sample.rs",
        "i32::from(count) * 3_330", "i32::from(count) * 3_333",
        "values_are_those_that_the_part_senses"),
    bug("the codes of ±150 °/s and ±75 °/s are exchanged", "channel.rs",
        "GyroRange::Dps150 => 0b010,\n            GyroRange::Dps75 => 0b001,", "GyroRange::Dps150 => 0b001,\n            GyroRange::Dps75 => 0b010,",
        "the_range_scales_the_gyros_only"),
    bug("a read takes the answer of its own frame", "protocol.rs",
        "self.frame(register.read_frame()).await;\n        self.frame(Register::FlashCnt.read_frame()).await", "self.frame(register.read_frame()).await",
        "the_driver_configures_the_part_without_a_violation"),
    bug("the upper byte is written to the address of the lower one", "register.rs",
        "0x80 | (self.address() + 1)", "0x80 | self.address()",
        "the_driver_configures_the_part_without_a_violation"),
    bug("SENS_AVG has 8 bits", "register.rs",
        "SensAvg \"SENS_AVG\" 0x38 ReadWrite 11", "SensAvg \"SENS_AVG\" 0x38 ReadWrite 8",
        "the_driver_configures_the_part_without_a_violation"),
    bug("the filter is written before the range", "commands.rs",
        "config.sens_avg(), WriteOrder::HighByteFirst", "config.sens_avg(), WriteOrder::LowByteFirst",
        "no_sample_is_taken_between_range_and_filter_of_a_new_configuration"),
    bug("the start-up is not waited for", "commands.rs",
        "self.pause(self.state.timing.start_up_us).await;", "",
        "a_cold_part_is_left_alone_until_it_has_started_up"),
    bug("the recovery from a reset is not waited for", "commands.rs",
        "self.pause(self.state.timing.reset_us).await;", "",
        "a_flash_update_outlives_a_reset"),
    bug("the stall is 8 µs", "clock.rs",
        "PerClockMode { normal: 16_000,", "PerClockMode { normal: 8_000,",
        "the_new_data_flag_shows_once"),
    bug("chip select rises between frames, but the stall is not kept", "spacing.rs",
        "high_ns: stall_ns.max(least_high_ns)", "high_ns: least_high_ns",
        "the_default_keeps_chip_select_high_for_the_whole_stall"),
    bug("a stall that a dropped future cut short is forgotten", "fronts.rs",
        "pause(bus)$($await)*;\n            bus.pending_pause_ns = pauses.high_ns;", "bus.pending_pause_ns = pauses.high_ns;",
        "a_stall_that_a_dropped_future_cut_short_is_kept_before_the_next_frame"),
    bug("low-power mode begins above SMPL_PRD = 0x0F", "clock.rs",
        "normal_mode_max_smpl_prd: 0x08,", "normal_mode_max_smpl_prd: 0x0F,",
        "low_power_mode_needs_a_slow_clock"),
    bug("new data is demanded of all twelve words", "validity.rs",
        "let inertial = words[INERTIAL_WORDS].iter()", "let inertial = words.iter()",
        "samples_are_usable_although_the_slow_words_refresh_slowly"),
    bug("the error/alarm flag is ignored", "validity.rs",
        "OutputWord(any).error_alarm()", "false",
        "each_latched_flag_is_a_warning_until_its_diagnosis_is_read"),
    bug("gyro x has the flag of gyro y", "error.rs",
        "const GYRO_X = 1 << 10;", "const GYRO_X = 1 << 11;",
        "self_tests_name_the_failed_sensor_and_keep_the_configuration"),
    bug("a negative offset of gyro x is written to the part", "calibration.rs",
        "let part = [x.max(0), y, z];", "let part = [x, y, z];",
        "a_factory_restore_returns_the_calibration_it_erased"),
    bug("the bias on the host is not added to the x rate", "sample.rs",
        "[x + i32::from(self.host_bias_x) * BIAS_UDPS, y, z]", "[x + i32::from(self.host_bias_x) * 0 * BIAS_UDPS, y, z]",
        "auto_null_zeroes_the_rates_and_keeps_a_negative_x_bias_on_the_host"),
    bug("a factory restore sends the bit of the DAC latch", "commands.rs",
        "const FACTORY_RESTORE: u16 = 1 << 1;", "const FACTORY_RESTORE: u16 = 1 << 2;",
        "a_factory_restore_returns_the_calibration_it_erased"),
    bug("the source of an alarm is one too low", "alarms.rs",
        "(self.source as u16 + 1) << number.source_shift()", "(self.source as u16) << number.source_shift()",
        "alarms_are_raised_by_level_and_by_change_and_show_on_their_pin"),
    bug("the reset line is left low", "fronts.rs",
        "line.set_high().map_err", "line.set_low().map_err",
        "the_reset_line_revives_a_part_that_hears_no_command"),
    // The following bugs violate rows of the data sheet.
    bug("a frame does not wait for the read rate", "clock.rs",
        "self.read_rate_ns.get(mode).saturating_sub(", "0u32.saturating_sub(",
        "the_driver_keeps_the_read_rate_at_every_clock"),
    bug("the read rate of low-power mode is 100 µs", "clock.rs",
        "normal: 40_000, low_power: 150_000", "normal: 40_000, low_power: 100_000",
        "the_driver_keeps_the_read_rate_at_every_clock"),
    bug("normal mode ends at SMPL_PRD = 0x09", "clock.rs",
        "normal_mode_max_smpl_prd: 0x08,", "normal_mode_max_smpl_prd: 0x09,",
        "at_0x09_the_driver_takes_the_safe_side"),
    bug("the wake-up pulse is 10 µs", "clock.rs",
        "wake_pulse_ns: 25_000,", "wake_pulse_ns: 10_000,",
        "a_sleep_lasts_as_long_as_requested_or_until_the_part_is_woken"),
    bug("the precision auto-null is given 30 s, without its flash update", "clock.rs",
        "precision_auto_null_us: 31_000_000,", "precision_auto_null_us: 30_000_000,",
        "the_precision_auto_null_averages_for_thirty_silent_seconds"),
    bug("a negative offset of gyro x that a reset loads from flash stays in the part", "commands.rs",
        "self.keep_negative_x_bias_on_host().await?;\n        Ok(product)", "self.gyro_offsets().await?;\n        Ok(product)",
        "auto_null_zeroes_the_rates_and_keeps_a_negative_x_bias_on_the_host"),
    bug("an offset of gyro x that a reset loads from flash is added to that on the host", "calibration.rs",
        "self.state.host_bias_x = x.min(0);\n        }", "self.state.host_bias_x += x.min(0);\n        }",
        "auto_null_zeroes_the_rates_and_keeps_a_negative_x_bias_on_the_host"),
    bug("DIO4 may stay an output where it is to be the sample clock", "commands.rs",
        "self.update_register(Register::GpioCtrl, DIO4_IS_OUTPUT, 0)", "self.update_register(Register::GpioCtrl, 0 & DIO4_IS_OUTPUT, 0)",
        "an_external_clock_triggers_the_samples"),
    bug("a supply outside its window refuses a sample", "validity.rs",
        "Faults::REPEATED.union(Faults::SUPPLY).union(Faults::ERROR_ALARM)", "Faults::REPEATED.union(Faults::ERROR_ALARM)",
        "a_supply_outside_its_window_refuses_a_sample_only_if_that_is_asked_for"),
    bug("an error flag in some words alone is a warning", "validity.rs",
        "faults.set(Faults::MIXED_ALARM, in_some_words &&", "faults.set(Faults::MIXED_ALARM, false & in_some_words &&",
        "an_error_flag_in_one_word_alone_refuses_the_burst"),
];

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().expect("the repository")
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn write(path: &Path, text: &str) {
    fs::create_dir_all(path.parent().expect("a folder")).expect("the folder is made");
    fs::write(path, text).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
}

/// Copies a folder with its subfolders.
fn copy(from: &Path, to: &Path) {
    for entry in fs::read_dir(from).unwrap_or_else(|error| panic!("{}: {error}", from.display())) {
        let path = entry.expect("an entry").path();
        let target = to.join(path.file_name().expect("a name"));
        if path.is_dir() { copy(&path, &target) } else { write(&target, &read(&path)) }
    }
}

impl Bug {
    /// The source file with the bug in it.
    fn seeded(&self, source: &str) -> String {
        let places = source.matches(self.right).count();
        assert_eq!(places, 1, "{}: {:?} must be there once to seed: {}", self.file, self.right, self.meaning);
        source.replace(self.right, self.wrong)
    }
}

#[test]
fn every_bug_applies_and_is_in_the_docs() {
    let sources: String =
        TESTS.iter().map(|name| read(&repository().join(format!("host-sim/virtual-sensor/tests/{name}.rs")))).collect();
    for bug in &BUGS {
        bug.seeded(&read(&repository().join("adis16405-driver/src").join(bug.file)));
        assert!(sources.contains(&format!("fn {}()", bug.found_by)), "no such test: {}", bug.found_by);
    }
    system_tests::generated("docs/driver.md", "deliberate-bugs", &format!("{} bugs", BUGS.len()));
}

/// A workspace of only the driver and the virtual part, in the target folder.
struct Copy {
    root: PathBuf,
}

impl Copy {
    fn new() -> Self {
        let (from, root) = (repository(), Path::new(env!("CARGO_TARGET_TMPDIR")).join("deliberate-bugs"));
        let manifest = read(&from.join("Cargo.toml"));
        let members = "members = [\"adis16405-driver\", \"host-sim/virtual-sensor\"]";
        let kept = manifest.lines().filter(|line| !line.starts_with("exclude") && !line.starts_with("default-members"));
        let lines = kept.map(|line| if line.starts_with("members") { members } else { line });
        write(&root.join("Cargo.toml"), &lines.collect::<Vec<_>>().join("\n"));
        write(&root.join("Cargo.lock"), &read(&from.join("Cargo.lock")));
        // The driver's manifest names its tests.
        for folder in [
            "adis16405-driver/src",
            "adis16405-driver/tests",
            "host-sim/virtual-sensor/src",
            "host-sim/virtual-sensor/tests",
        ] {
            let _absent_before_the_first_run = fs::remove_dir_all(root.join(folder));
            copy(&from.join(folder), &root.join(folder));
        }
        for file in ["adis16405-driver/Cargo.toml", "adis16405-driver/README.md", "host-sim/virtual-sensor/Cargo.toml"]
        {
            write(&root.join(file), &read(&from.join(file)));
        }
        // This module does not run there, and its own dependencies are not in that workspace.
        for (file, line) in [("Cargo.toml", "system-tests = "), ("tests/suite.rs", "mod deliberate_bugs;")] {
            let path = root.join("host-sim/virtual-sensor").join(file);
            let text = read(&path);
            let kept: Vec<&str> = text.lines().filter(|each| !each.starts_with(line)).collect();
            write(&path, &(kept.join("\n") + "\n"));
        }
        Self { root }
    }

    fn source(&self, bug: &Bug) -> PathBuf {
        self.root.join("adis16405-driver/src").join(bug.file)
    }

    /// Runs the driver's tests on the virtual part; returns the names of those that fail.
    fn failures(&self) -> Vec<String> {
        let output = Command::new(env!("CARGO"))
            .current_dir(&self.root)
            .args(["test", "--offline", "--quiet", "--no-fail-fast", "--package", "virtual-sensor", "--target-dir"])
            .arg(self.root.join("target"))
            .args(["--test", "suite", "--", "--format", "pretty"])
            .args(TESTS.map(|module| format!("{module}::")))
            .env_remove("CARGO_TARGET_DIR")
            .output()
            .expect("cargo starts");
        let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        let ran = TESTS.iter().all(|module| out.contains(&format!("\ntest {module}::")));
        assert!(ran && out.contains("\ntest result: "), "the tests do not run:\n{out}\n{err}");
        let failed = |line: &str| {
            let name = line.strip_prefix("test ")?.strip_suffix(" ... FAILED")?;
            Some(name.split_once("::").map_or(name, |(_, name)| name).to_owned())
        };
        out.lines().filter_map(failed).collect()
    }
}

#[test]
#[ignore = "long: builds the driver 36 times, three minutes; run with --long"]
fn each_bug_is_found_by_the_drivers_tests_on_the_virtual_part() {
    let copy = Copy::new();
    assert_eq!(copy.failures(), [""; 0], "without a bug");
    let mut missed = Vec::new();
    for bug in &BUGS {
        let path = copy.source(bug);
        let right = read(&path);
        write(&path, &bug.seeded(&right));
        let failures = copy.failures();
        write(&path, &right);
        println!("{}: {} tests fail", bug.meaning, failures.len());
        if !failures.iter().any(|name| name == bug.found_by) {
            missed.push(format!("{} ({}), found by {failures:?}", bug.meaning, bug.found_by));
        }
    }
    assert!(missed.is_empty(), "not found by the test that is named:\n{}", missed.join("\n"));
}
