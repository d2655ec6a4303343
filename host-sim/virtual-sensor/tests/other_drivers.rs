//! Words that drivers of other authors send, and the answers of the part. These drivers work on real parts, so their
//! decoding is right. If they violate the data sheet (Rev. B), they fail as on a real part.
//!
//! Each row is a transaction: its source, its words, the pause after each word with chip select low, and the pause after the transaction
//! with chip select high. The sources are public repositories:
//!
//! | driver | repository, commit | files |
//! |---|---|---|
//! | Linux | torvalds/linux, frames and pauses of 100bfa38 (`adis.c`), values of 1253eedf (`adis16400.c`) | `drivers/iio/imu/` |
//! | PSAS | psas/stm32, 85a3bd59 | `common/devices/ADIS16405.c` |
//! | Canopus | satellogic/canopus, 2fd2caaf | `src/lib/canopus/subsystem/aocs/` |

use virtual_sensor::{Activity, DiagnosisFlag, NoiseModel, NoteKind, OutputRegister, ViolationKind, VirtualAdis16405};

const MS: u64 = 1_000_000;

/// A transaction.
struct Row<'a> {
    source: &'a str,
    words: &'a [u16],
    /// Pause after each word, with chip select low, ns.
    low_ns: u64,
    /// Pause after the transaction, with chip select high, ns.
    high_ns: u64,
}

/// Runs the transactions at `sck_hz`; returns the words received.
fn run(part: &mut VirtualAdis16405, sck_hz: u32, rows: &[Row<'_>]) -> Vec<u16> {
    part.set_sck_hz(Some(sck_hz));
    let mut answers = Vec::new();
    for row in rows {
        assert!(!row.source.is_empty());
        part.select();
        for word in row.words {
            answers.push(part.transfer(*word));
            part.advance_to(part.now() + row.low_ns);
        }
        part.deselect();
        part.advance_to(part.now() + row.high_ns);
    }
    answers
}

fn wait(part: &mut VirtualAdis16405, ns: u64) {
    part.advance_to(part.now() + ns);
}

fn violations(part: &VirtualAdis16405) -> Vec<ViolationKind> {
    part.violations().iter().map(|violation| violation.kind).collect()
}

fn notes(part: &VirtualAdis16405) -> Vec<NoteKind> {
    part.notes().iter().map(|note| note.kind).collect()
}

/// A part that senses a different value in every channel, and its counts by Table 9 of the data sheet (2.418 mV, 0.05 °/s, 3.33 mg, 0.5
/// mgauss, 0.14 °C from 25 °C, 806 µV).
fn sensing() -> (VirtualAdis16405, [i32; 12]) {
    let sensed = [5.0, 60.0, -60.3, 0.7, 1.0, -7.5, 3.0, 0.9, -1.2, 0.3, -39.9, 1.0];
    let counts = [2068, 1200, -1206, 14, 300, -2252, 901, 1800, -2400, 600, -464, 1241];
    let mut model = NoiseModel::noiseless();
    for (channel, value) in OutputRegister::ALL.into_iter().zip(sensed) {
        model.channel_mut(channel).bias = value;
    }
    let mut part = VirtualAdis16405::new(model, 1);
    wait(&mut part, 100 * MS);
    (part, counts)
}

/// The two's complement number in the lowest `bits`, as Linux's `sign_extend32` gives it.
fn sign_extended(word: u16, bits: u32) -> i32 {
    i32::from(word) << (32 - bits) >> (32 - bits)
}

/// The outputs as the drivers decode them: Linux by `adis16400_channels`, PSAS by `buffer_to_burst_data` (`ADIS16405.c:133`), Canopus by
/// `RAW2LSB14`.
fn decoded(words: &[u16]) -> Vec<i32> {
    let bits = [14, 14, 14, 14, 14, 14, 14, 14, 14, 14, 12, 12];
    let output = |(index, word): (usize, &u16)| match index {
        0 | 11 => i32::from(word & ((1 << bits[index]) - 1)),
        _ => sign_extended(*word, bits[index]),
    };
    words.iter().enumerate().map(output).collect()
}

mod linux {
    use super::*;

    /// `ADIS16400_SPI_SLOW`, `_BURST` and `_FAST`.
    const SLOW_HZ: u32 = 300_000;
    const BURST_HZ: u32 = 1_000_000;
    const FAST_HZ: u32 = 2_000_000;
    /// `read_delay` and `write_delay` of `ADIS16400_DATA`, before chip select rises.
    const DELAY_NS: u64 = 50_000;
    /// Time for which the SPI core keeps chip select high between the transfers of a message without a `cs_change_delay`.
    const CS_CHANGE_NS: u64 = 10_000;
    /// Least time of the SPI core from one message to the next.
    const MESSAGE_NS: u64 = 30_000;
    /// Time of the SPI core and its controller around each transfer in low-power mode. Without it the delays, 60 µs of stall and 113 µs
    /// from frame to frame, would violate the 75 µs and 150 µs of Table 2.
    const SLOW_OVERHEAD_NS: u64 = 40_000;

    const fn row<'a>(source: &'a str, words: &'a [u16], high_ns: u64) -> Row<'a> {
        Row { source, words, low_ns: DELAY_NS, high_ns }
    }

    fn overhead_ns(sck_hz: u32) -> u64 {
        if sck_hz == SLOW_HZ { SLOW_OVERHEAD_NS } else { 0 }
    }

    pub(super) fn read(part: &mut VirtualAdis16405, sck_hz: u32, address: u8) -> u16 {
        let overhead_ns = overhead_ns(sck_hz);
        let request = [u16::from(address) << 8];
        let rows = [
            row("adis.c:154", &request, CS_CHANGE_NS + overhead_ns),
            row("adis.c:163", &[0x0000], MESSAGE_NS + overhead_ns),
        ];
        run(part, sck_hz, &rows)[1]
    }

    pub(super) fn write_8(part: &mut VirtualAdis16405, sck_hz: u32, address: u8, value: u8) {
        let word = [0x8000 | u16::from(address) << 8 | u16::from(value)];
        run(part, sck_hz, &[row("adis.c:99", &word, MESSAGE_NS + overhead_ns(sck_hz))]);
    }

    pub(super) fn write_16(part: &mut VirtualAdis16405, sck_hz: u32, address: u8, value: u16) {
        let [upper, lower] = value.to_be_bytes();
        let frame = |address: u8, byte: u8| [0x8000 | u16::from(address) << 8 | u16::from(byte)];
        let (low, high) = (frame(address, lower), frame(address + 1, upper));
        let overhead_ns = overhead_ns(sck_hz);
        let rows =
            [row("adis.c:99", &low, CS_CHANGE_NS + overhead_ns), row("adis.c:95", &high, MESSAGE_NS + overhead_ns)];
        run(part, sck_hz, &rows);
    }

    /// `adis16400_probe`: `adis_init` at the clock of the device tree, `adis16400_initial_setup` at the slow one. Returns the status after
    /// the self-test, and PROD_ID.
    fn probe(part: &mut VirtualAdis16405) -> (u16, u16) {
        // adis_enable_irq(false): data ready off, active high, DIO1.
        let control = read(part, FAST_HZ, 0x34);
        write_16(part, FAST_HZ, 0x34, (control | 0x0002) & !0x0005);
        // adis_self_test: ADIS16400_MSC_CTRL_MEM_TEST, 12 ms (adis16400_timeouts), DIAG_STAT.
        write_16(part, SLOW_HZ, 0x34, 0x0800);
        wait(part, 12 * MS);
        let status = read(part, SLOW_HZ, 0x3C);
        let identity = read(part, SLOW_HZ, 0x56);
        assert!(read(part, SLOW_HZ, 0x36) & 0x7F < 0x0A, "the fast clock is kept");
        (status, identity)
    }

    fn set_rate(part: &mut VirtualAdis16405, millihertz: u32) -> u32 {
        // adis16400_set_freq sets the clock before it sends the word.
        let mut divisor = 1_638_404 / millihertz;
        let mut base = 0;
        if divisor >= 128 {
            (base, divisor) = (0x80, (52_851 / millihertz).min(127));
        } else {
            divisor = divisor.saturating_sub(1);
        }
        let sck_hz = if divisor >= 0x0A || base != 0 { SLOW_HZ } else { FAST_HZ };
        write_8(part, sck_hz, 0x36, (base | divisor) as u8);
        sck_hz
    }

    #[test]
    fn probe_and_reset_succeed_and_all_channels_read_as_sensed() {
        let (mut part, counts) = sensing();
        assert_eq!(probe(&mut part), (0x0000, 0x4015));
        // adis_reset, sw_reset_ms = 170.
        write_8(&mut part, FAST_HZ, 0x3E, 0x80);
        wait(&mut part, 170 * MS);
        // adis16400_read_raw reads each of the twelve channels in a message of two frames.
        wait(&mut part, 50 * MS);
        let words: Vec<u16> = (0x02..=0x18).step_by(2).map(|address| read(&mut part, FAST_HZ, address)).collect();
        assert_eq!(decoded(&words), counts);
        assert_eq!((violations(&part), notes(&part)), (vec![], vec![]));
    }

    /// `adis16400_trigger_handler` sends two transfers in one message, at the clock for bursts.
    #[test]
    fn a_burst_reads_the_sensed_values() {
        let (mut part, counts) = sensing();
        let words = [[0x3E00].as_slice(), &[0; 12]].concat();
        let burst = Row { source: "adis_buffer.c:47", words: &words, low_ns: 0, high_ns: MESSAGE_NS };
        let answers = run(&mut part, BURST_HZ, &[burst]);
        assert_eq!(decoded(&answers[1..]), counts);
        assert_eq!((violations(&part), notes(&part)), (vec![], vec![]));
    }

    /// `adis16400_set_freq`: at 12.8 and 4 SPS it omits the −1 of the slow time base, so the rates are 10.57 and 3.78
    /// SPS.
    #[test]
    fn each_rate_has_its_register_value_and_its_sample_period() {
        for (millihertz, smpl_prd, hz) in [
            (819_200, 0x01, 819.2),
            (409_600, 0x03, 409.6),
            (204_800, 0x07, 204.8),
            (163_840, 0x09, 163.84),
            (102_400, 0x0F, 102.4),
            (50_000, 0x1F, 51.2),
            (25_600, 0x3F, 25.6),
            (12_850, 0x7E, 1638.4 / 127.0),
            (12_800, 0x84, 1638.4 / 31.0 / 5.0),
            (4_000, 0x8D, 1638.4 / 31.0 / 14.0),
        ] {
            let (mut part, _) = sensing();
            set_rate(&mut part, millihertz);
            let sck_hz = if smpl_prd > 0x09 { SLOW_HZ } else { FAST_HZ };
            assert_eq!(read(&mut part, sck_hz, 0x36), smpl_prd, "{millihertz}");
            let first = part.next_data_ready();
            part.advance_to(first);
            let measured = 1e9 / (part.next_data_ready() - first) as f64;
            assert!((measured / hz - 1.0).abs() < 1e-6, "{millihertz}: {measured}");
            assert_eq!(violations(&part), [], "{millihertz}");
            // Table 7 ends normal mode at 0x08, Tables 1 and 2 at 0x09, as Linux does.
            let at_0x09 = notes(&part).contains(&NoteKind::FastClockAt0x09 { sck_hz: FAST_HZ });
            assert_eq!(at_0x09, smpl_prd == 0x09);
        }
    }

    #[test]
    fn a_filter_is_read_changed_and_written_by_bytes() {
        for (taps, bits) in [(2, 0x0402), (4, 0x0404), (6, 0x0406)] {
            let (mut part, _) = sensing();
            let before = read(&mut part, FAST_HZ, 0x38);
            write_16(&mut part, FAST_HZ, 0x38, before & !0x07 | taps);
            assert_eq!(read(&mut part, FAST_HZ, 0x38), bits);
            assert_eq!((violations(&part), notes(&part)), (vec![], vec![]));
        }
    }

    /// `adis16400_stop_device` writes SLP_CNT = 0x0100. The first frame of the next probe has chip select low for 8 µs and its delay of 50
    /// µs, which wakes the part (20 µs, Table 1). The part answers 4 ms later, during the wait for the self-test.
    #[test]
    fn a_part_that_was_put_to_sleep_answers_the_next_probe() {
        let (mut part, counts) = sensing();
        probe(&mut part);
        write_16(&mut part, FAST_HZ, 0x3A, 0x0100);
        wait(&mut part, 3_600_000 * MS);
        let (_, identity) = probe(&mut part);
        assert_eq!(identity, 0x4015);
        wait(&mut part, 50 * MS);
        let words: Vec<u16> = (0x02..=0x18).step_by(2).map(|address| read(&mut part, FAST_HZ, address)).collect();
        assert_eq!(decoded(&words), counts);
        // Words sent while the part slept and woke up are lost.
        let lost =
            |kind: &ViolationKind| matches!(kind, ViolationKind::Busy { activity: Activity::Sleep | Activity::WakeUp });
        assert!(violations(&part).iter().all(lost), "{:?}", violations(&part));
    }

    /// debugfs writes 16 bits to registers of 8 bits: a command with its upper byte while the part is busy, and unused
    /// bytes.
    #[test]
    fn unused_bytes_are_tolerated() {
        let (mut part, _) = sensing();
        write_16(&mut part, FAST_HZ, 0x36, 0x0003);
        write_16(&mut part, FAST_HZ, 0x44, 0x0008);
        write_16(&mut part, FAST_HZ, 0x3E, 0x0008);
        wait(&mut part, 50 * MS);
        assert_eq!([0x00, 0x36, 0x44].map(|address| read(&mut part, FAST_HZ, address)), [1, 3, 8]);
        assert_eq!(violations(&part), []);
        let unused = |address| NoteKind::UnusedByte { address };
        assert_eq!(notes(&part), [unused(0x37), unused(0x45), NoteKind::SecondCommandByte]);
    }

    /// The flash test takes 17 ms (Table 1), but `self_test_ms` is 12, so damaged flash is not detected.
    #[test]
    fn its_flash_test_is_read_too_soon() {
        let (mut part, _) = sensing();
        part.damage_flash();
        assert_eq!(probe(&mut part), (0x0000, 0x4015));
        wait(&mut part, 5 * MS);
        assert_eq!(read(&mut part, FAST_HZ, 0x3C), 1 << DiagnosisFlag::FlashChecksum as u8);
    }

    /// `adis16400_read_raw` reads XGYRO_OFF with 12 bits instead of 13.
    #[test]
    fn its_calibbias_loses_a_bit() {
        let (mut part, _) = sensing();
        write_16(&mut part, FAST_HZ, 0x1A, (-3000i16) as u16);
        let word = read(&mut part, FAST_HZ, 0x1A);
        assert_eq!((sign_extended(word, 13), sign_extended(word, 12)), (-3000, 1096));
        assert_eq!(violations(&part), []);
    }

    /// Below 4.1 Hz at 819.2 SPS `__adis16400_set_filter` selects M = 7, which Table 17 does not have.
    #[test]
    fn its_filter_of_4_hz_is_no_setting() {
        let (mut part, _) = sensing();
        write_16(&mut part, FAST_HZ, 0x38, 0x0407);
        part.advance_to(part.next_data_ready());
        let invalid = ViolationKind::Configuration { sens_avg: 0x0407 };
        assert!(!violations(&part).is_empty() && violations(&part).iter().all(|kind| *kind == invalid));
    }

    /// Above 1638 Hz `adis16400_set_freq` writes 0, which selects the external clock: no sample follows.
    #[test]
    fn its_rate_above_1638_hz_is_the_external_clock() {
        let (mut part, _) = sensing();
        set_rate(&mut part, 2_000_000);
        assert_eq!(part.next_data_ready(), u64::MAX);
    }

    /// `adis16400_set_freq` raises the clock to 2 MHz before the frame that ends low-power mode, in which at most 300 kHz are allowed.
    #[test]
    fn its_return_to_a_fast_rate_is_not_heard() {
        let (mut part, _) = sensing();
        set_rate(&mut part, 50_000);
        wait(&mut part, MS);
        assert_eq!(set_rate(&mut part, 819_200), FAST_HZ);
        let clock = ViolationKind::Clock { sck_hz: FAST_HZ, most_hz: SLOW_HZ };
        assert!(violations(&part).contains(&clock), "{:?}", violations(&part));
        wait(&mut part, MS);
        assert_eq!(read(&mut part, SLOW_HZ, 0x36), 0x1F);
    }
}

mod psas {
    use super::*;

    /// The clock is 84 MHz of the peripheral bus over 128 (`ADIS16405.c:76`).
    const SCK_HZ: u32 = 656_250;

    /// `adis_get`: `spiSend`, then `spiReceive`, which sends ones, with chip select low throughout. The pause between the two is the time
    /// of the operating system.
    fn get(part: &mut VirtualAdis16405, address: u8, system_ns: u64) -> u16 {
        let words = [u16::from(address) << 8, 0xFFFF];
        let row = Row { source: "ADIS16405.c:102", words: &words, low_ns: system_ns, high_ns: 20_000 };
        run(part, SCK_HZ, &[row])[1]
    }

    /// `adis_set` sends both bytes in one `spiSend`, without a stall.
    fn set(part: &mut VirtualAdis16405, address: u8, value: u16) {
        let [upper, lower] = value.to_be_bytes();
        let frame = |address: u8, byte: u8| 0x8000 | u16::from(address) << 8 | u16::from(byte);
        let words = [frame(address + 1, upper), frame(address, lower)];
        run(part, SCK_HZ, &[Row { source: "ADIS16405.c:119", words: &words, low_ns: 0, high_ns: 20_000 }]);
    }

    #[test]
    fn a_burst_reads_the_sensed_values() {
        let (mut part, counts) = sensing();
        let words = [[0x3E00].as_slice(), &[0; 12]].concat();
        let burst = Row { source: "ADIS16405.c:47", words: &words, low_ns: 0, high_ns: 20_000 };
        let answers = run(&mut part, SCK_HZ, &[burst]);
        assert_eq!(decoded(&answers[1..]), counts);
        assert_eq!((violations(&part), notes(&part)), (vec![], vec![]));
    }

    /// Chip select stays low between the frames. A read works if the operating system takes the 9 µs of the stall.
    #[test]
    fn a_read_needs_the_stall_although_chip_select_stays_low() {
        let (mut part, _) = sensing();
        assert_eq!(get(&mut part, 0x56, 9_000), 0x4015);
        assert_eq!((violations(&part), notes(&part)), (vec![], vec![NoteKind::SelectLow, NoteKind::DummyFrame]));
        wait(&mut part, 100_000);
        assert_ne!(get(&mut part, 0x56, 5_000), 0x4015);
        assert_eq!(violations(&part), [ViolationKind::Stall { stall_ns: 5_000, least_ns: 9_000 }]);
    }

    /// The second frame comes without a stall and is lost. Of MSC_CTRL = 0x0406 (`adis_self_test`) the part receives only the upper byte,
    /// so the self-test runs.
    #[test]
    fn the_second_byte_of_a_write_is_lost() {
        let (mut part, _) = sensing();
        set(&mut part, 0x34, 0x0405);
        assert_eq!(violations(&part), [ViolationKind::Stall { stall_ns: 0, least_ns: 9_000 }]);
        assert_eq!(get(&mut part, 0x34, 10_000), 0x0406, "the self-test runs, and data ready stays on DIO1");
        wait(&mut part, 12 * MS);
        assert_eq!(get(&mut part, 0x34, 10_000), 0x0006);
    }

    /// `adis_reset` holds the reset line low for 500 ms.
    #[test]
    fn the_part_answers_after_its_reset_line_was_low() {
        let (mut part, _) = sensing();
        part.drive_reset(false);
        wait(&mut part, 500 * MS);
        part.drive_reset(true);
        wait(&mut part, 100 * MS);
        assert_eq!(get(&mut part, 0x56, 10_000), 0x4015);
        assert_eq!(violations(&part), []);
    }
}

mod canopus {
    use super::*;

    /// The clock is 12.5 MHz over 63 (`drivers/tms570/spi.c:61`).
    const SCK_HZ: u32 = 198_413;
    /// `vTaskDelay(1)` is assumed to be 1 ms.
    const TICK_NS: u64 = MS;

    fn read(part: &mut VirtualAdis16405, address: u8) -> u16 {
        let request = [u16::from(address) << 8];
        let rows = [
            Row { source: "adis_imu.c:31", words: &request, low_ns: 0, high_ns: TICK_NS },
            Row { source: "adis_imu.c:40", words: &[0x0000], low_ns: 0, high_ns: TICK_NS },
        ];
        run(part, SCK_HZ, &rows)[1]
    }

    fn write(part: &mut VirtualAdis16405, address: u8, value: u16) {
        let [upper, lower] = value.to_be_bytes();
        let frame = |address: u8, byte: u8| [0x8000 | u16::from(address) << 8 | u16::from(byte)];
        let (low, high) = (frame(address, lower), frame(address + 1, upper));
        let rows = [
            Row { source: "adis_imu.c:71", words: &low, low_ns: 0, high_ns: TICK_NS },
            Row { source: "adis_imu.c:77", words: &high, low_ns: 0, high_ns: TICK_NS },
        ];
        run(part, SCK_HZ, &rows);
    }

    /// `aocs.c:160, 632`, then `configure_imu` (`aocs.c:270`) with the values of `aocs.h`; the registers are read back. SENS_AVG is written
    /// with the filter first, and the range of ±75 °/s keeps it at 64 taps.
    #[test]
    fn identity_configuration_and_burst_read_as_written_and_sensed() {
        let (mut part, counts) = sensing();
        part.power_off();
        part.power_on();
        wait(&mut part, 220 * MS);
        assert_eq!(read(&mut part, 0x56), 0x4015);
        write(&mut part, 0x38, 0x0106);
        write(&mut part, 0x34, 0x0006);
        write(&mut part, 0x26, 199);
        assert_eq!([0x38, 0x34, 0x26].map(|address| read(&mut part, address)), [0x0106, 0x0006, 199]);
        wait(&mut part, 300 * MS);
        // adis_imu.c:95 is one transaction.
        let words = [[0x3E00].as_slice(), &[0; 12]].concat();
        let burst = Row { source: "adis_imu.c:95", words: &words, low_ns: 0, high_ns: TICK_NS };
        let decoded = decoded(&run(&mut part, SCK_HZ, &[burst])[1..]);
        // At ±75 °/s a count is 0.0125 °/s (Table 1): the sensed values are 60 °/s, −60.3 °/s and 0.7 °/s.
        assert_eq!(decoded[1..4], [4800, -4824, 56]);
        assert_eq!(decoded[4..7], counts[4..7]);
        assert_eq!(decoded[7], counts[7] + 199);
        assert_eq!(violations(&part), []);
    }

    #[test]
    fn a_register_is_written_read_and_restored() {
        // The steps are those of aocs_tests.c:28 to 39.
        let (mut part, _) = sensing();
        let before = read(&mut part, 0x20);
        write(&mut part, 0x20, 0x075A);
        assert_eq!(read(&mut part, 0x20), 0x075A);
        write(&mut part, 0x20, before);
        assert_eq!(read(&mut part, 0x20), before);
        assert_eq!((violations(&part), notes(&part)), (vec![], vec![]));
    }

    /// `portTICK_RATE_MS / 100` is 0 ticks (`aocs_tests.c:55`). DIAG_STAT is read before the 12 ms of the self-test are over, so a broken
    /// sensor is not detected.
    #[test]
    fn its_self_test_is_read_too_soon() {
        let (mut part, _) = sensing();
        part.break_sensor(OutputRegister::GyroY);
        let control = read(&mut part, 0x34);
        write(&mut part, 0x34, control | 1 << 10);
        assert_eq!(read(&mut part, 0x3C), 0);
        wait(&mut part, 12 * MS);
        assert_eq!(read(&mut part, 0x3C), 0x0820, "bit 11 gyro y, bit 5 self-test (Table 23)");
    }
}

/// Owners report failures of bursts above 1 MHz (Table 2); Spalax and others clock them at 1.3 to 2.6 MHz.
#[test]
fn a_burst_above_1_mhz_is_garbled() {
    for (sck_hz, right) in [(1_000_000, true), (1_312_500, false), (2_000_000, false), (2_625_000, false)] {
        let (mut part, counts) = sensing();
        let words = [[0x3E00].as_slice(), &[0; 12]].concat();
        let burst = Row { source: "any", words: &words, low_ns: 0, high_ns: 20_000 };
        let answers = run(&mut part, sck_hz, &[burst]);
        assert_eq!(decoded(&answers[1..]) == counts, right, "{sck_hz} Hz");
    }
}
