//! The real driver reads the virtual part: configuration, samples, timing and violations. Numbers are from the data sheet.

use adis16405_driver::{
    Adis16405, BurstValidator, Channel, Config, Counts, Faults, GyroRange, PerClockMode, Register, SamplePeriod, Timing,
};

use virtual_sensor::{
    Activity, EmulatedBus, NoiseModel, OutputRegister, Strictness, ViolationKind, VirtualAdis16405, VirtualDelay,
};

fn config(range: GyroRange, taps: u8, smpl_prd: u8) -> Config {
    Config::new(range, taps, SamplePeriod::from_register(smpl_prd).unwrap()).unwrap()
}

fn on_bus(model: NoiseModel, config: Config) -> (EmulatedBus, Adis16405<EmulatedBus, VirtualDelay>) {
    let bus = EmulatedBus::new(VirtualAdis16405::new(model, 1));
    let mut imu = Adis16405::new(bus.clone(), bus.delay(), config);
    imu.init().unwrap();
    (bus, imu)
}

#[test]
fn the_driver_configures_the_part_without_a_violation() {
    for config in [config(GyroRange::Dps300, 2, 1), config(GyroRange::Dps75, 6, 7), config(GyroRange::Dps150, 3, 8)] {
        let (bus, mut imu) = on_bus(NoiseModel::paper(), config);
        assert_eq!(imu.read_register(Register::ProdId), Ok(16405));
        assert_eq!(imu.read_register(Register::SmplPrd), Ok(u16::from(config.sample_period().register())));
        assert_eq!(imu.read_register(Register::SensAvg), Ok(config.sens_avg()));
        assert_eq!(bus.part().violations(), []);
    }
}

#[test]
fn low_power_mode_needs_a_slow_clock() {
    let slow = config(GyroRange::Dps300, 2, 15);
    let bus = EmulatedBus::with_sck_hz(VirtualAdis16405::new(NoiseModel::paper(), 1), 300_000);
    let mut imu = Adis16405::new(bus.clone(), bus.delay(), slow);
    imu.init().unwrap();
    bus.wait_for_data();
    imu.burst().unwrap();
    assert_eq!(bus.part().violations(), []);

    let bus = EmulatedBus::new(VirtualAdis16405::new(NoiseModel::paper(), 1));
    assert!(Adis16405::new(bus.clone(), bus.delay(), slow).init().is_err(), "garbled");
    let clock = ViolationKind::Clock { sck_hz: 1_000_000, most_hz: 300_000 };
    assert!(bus.part().violations().iter().any(|violation| violation.kind == clock));
}

/// Data sheet Rev. B, Table 2: the time from one falling edge of chip select to the next is at least 40 µs in normal mode and 150 µs in
/// low-power mode. The driver keeps it at every clock that the mode allows.
#[test]
fn the_driver_keeps_the_read_rate_at_every_clock() {
    for (smpl_prd, clocks_hz) in
        [(0x01, &[2_000_000, 1_000_000, 656_250, 300_000, 10_000][..]), (0x0F, &[300_000, 100_000])]
    {
        for &sck_hz in clocks_hz {
            for known in [false, true] {
                let config = config(GyroRange::Dps300, 2, smpl_prd);
                let bus = EmulatedBus::with_sck_hz(VirtualAdis16405::new(NoiseModel::noiseless(), 1), sck_hz);
                let mut imu = Adis16405::new(bus.clone(), bus.delay(), config).with_stall_ns(9_000);
                if known {
                    imu = imu.with_sck_hz(sck_hz);
                }
                let mut timing = imu.timing();
                timing.stall_ns = PerClockMode { normal: 9_000, low_power: 75_000 };
                let mut imu = imu.with_timing(timing);
                imu.init().unwrap();
                let registers = [Register::ProdId, Register::SmplPrd, Register::SensAvg];
                assert_eq!(imu.read_registers(registers), Ok([16405, u16::from(smpl_prd), 0x0402]), "{sck_hz} Hz");
                assert_eq!(bus.part().violations(), [], "{sck_hz} Hz, known: {known}");
            }
        }
    }
}

/// The data sheet contradicts itself at SMPL_PRD = 0x09. The driver requires the slow clock (Table 7).
#[test]
fn at_0x09_the_driver_takes_the_safe_side() {
    let config = config(GyroRange::Dps300, 2, 0x09);
    let sck_hz = Timing::DEFAULT.clock_mode(0x09).max_sck_hz();
    let bus = EmulatedBus::with_sck_hz(VirtualAdis16405::new(NoiseModel::noiseless(), 1), sck_hz);
    let mut imu = Adis16405::new(bus.clone(), bus.delay(), config);
    imu.init().unwrap();
    bus.wait_for_data();
    assert!(imu.read().is_ok());
    assert_eq!((bus.part().violations(), bus.part().notes()), (&[][..], &[][..]));
}

/// The driver passes without any tolerance.
#[test]
fn a_pedantic_part_has_nothing_to_note() {
    let mut part = VirtualAdis16405::new(NoiseModel::paper(), 1);
    part.set_strictness(Strictness::Pedantic { least_high_ns: 1_000 });
    let bus = EmulatedBus::new(part);
    let mut imu = Adis16405::new(bus.clone(), bus.delay(), config(GyroRange::Dps75, 4, 7));
    imu.init().unwrap();
    imu.software_reset().unwrap();
    bus.wait_for_data();
    imu.read().unwrap();
    assert_eq!((bus.part().violations(), bus.part().notes()), (&[][..], &[][..]));
}

/// The positive stimulus, 40 °/s in the gyros, is switched on. The outputs then follow the sum of the filter's weights of the samples
/// since, the triangle of two averages over 8 samples. An internal self-test applies the same stimulus, and the filter contains its samples
/// afterwards.
#[test]
fn a_step_passes_the_filter_with_a_triangle_of_weights() {
    let config = config(GyroRange::Dps300, 3, 1);
    let (bus, mut imu) = on_bus(NoiseModel::noiseless(), config);
    bus.wait_for_data();
    imu.write_register(Register::MscCtrl, 0x0106).unwrap();
    let mut expected = 0.0;
    for age in 0_i32..20 {
        expected += 800.0 * f64::from(age.min(16 - age).max(0)) / 64.0;
        bus.wait_for_data();
        let x = imu.burst().unwrap().counts().gyro()[0];
        assert!((f64::from(x) - expected).abs() <= 0.5 + 1e-9, "sample {age}: {x}, expected {expected}");
    }
    assert_eq!(expected.round(), 800.0);

    let (bus, mut imu) = on_bus(NoiseModel::noiseless(), config);
    assert!(imu.self_test().unwrap().passed());
    let x = || {
        bus.wait_for_data();
        bus.part().counts()[1]
    };
    assert!(x() > 400, "the filter mixes the samples of the self-test");
    for _ in 0..config.filter().length() + 2 {
        x();
    }
    assert_eq!(x(), 0);
}

#[test]
fn the_driver_reads_what_the_part_sampled() {
    let (bus, mut imu) = on_bus(NoiseModel::paper(), config(GyroRange::Dps300, 0, 7));
    let mut validator = BurstValidator::default();
    let mut negative = 0;
    for _ in 0..5000 {
        bus.wait_for_data();
        let sampled = Counts::new(*bus.part().counts());
        let burst = imu.burst().unwrap();
        assert_eq!(burst.counts(), sampled);
        assert!(validator.validate(&burst).is_usable());
        negative += sampled.as_array().iter().filter(|count| **count < 0).count();
    }
    assert!(negative > 5000, "z senses −1 g, gyros are often below 0: {negative}");
    assert_eq!(bus.part().samples(), 5000);
    assert_eq!(bus.part().violations(), []);
}

#[test]
fn samples_come_at_the_programmed_instants() {
    // SMPL_PRD keeps its reset value 1, so sample k is at k·2/1638.4 s = k·1220703.125 ns.
    let (bus, _) = on_bus(NoiseModel::noiseless(), config(GyroRange::Dps300, 2, 1));
    let taken = bus.part().samples();
    for k in taken + 1..=100_000 {
        let expected = (u128::from(k) * 2_000_000_000 * 10).div_ceil(16_384);
        assert_eq!(u128::from(bus.wait_for_data().unwrap()), expected);
    }
}

#[test]
fn a_new_period_counts_from_the_write() {
    let mut part = VirtualAdis16405::new(NoiseModel::noiseless(), 1);
    for (smpl_prd, period_ns) in [(0x07, 4_882_812.5), (0x81, 2.0 * 31.0 * 610_351.562_5)] {
        part.select();
        part.transfer(0xB600 | smpl_prd);
        part.deselect();
        assert!(((part.next_data_ready() - part.now()) as f64 - period_ns).abs() <= 1.0, "{smpl_prd:#04x}");
        part.advance_to(part.now() + 150_000);
    }
    part.select();
    part.transfer(0xB600);
    part.deselect();
    assert_eq!(part.next_data_ready(), u64::MAX, "SMPL_PRD = 0 waits for an external clock");
}

#[test]
fn the_new_data_flag_shows_once() {
    let (bus, mut imu) = on_bus(NoiseModel::paper(), Config::default());
    bus.wait_for_data();
    assert_eq!(imu.burst().unwrap().faults(), Faults::empty());
    assert_eq!(imu.burst().unwrap().faults(), Faults::NO_NEW_DATA);
    bus.wait_for_data();
    assert!(imu.read_register(Register::TempOut).unwrap() >= 0x8000);
    let burst = imu.burst().unwrap();
    assert!(!burst.words[Channel::Temp as usize].new_data(), "read singly before");
    assert!(burst.words[Channel::AuxAdc as usize].new_data());
}

/// No source gives the rate at which the part refreshes its supply, magnetometer, temperature and auxiliary words.
#[test]
fn samples_are_usable_although_the_slow_words_refresh_slowly() {
    let (bus, mut imu) = on_bus(NoiseModel::paper(), config(GyroRange::Dps300, 0, 7));
    bus.part_mut().set_slow_refresh(8);
    let mut validator = BurstValidator::default();
    let mut new_supplies = 0;
    for _ in 0..4000 {
        bus.wait_for_data();
        let burst = imu.burst().unwrap();
        let validity = validator.validate(&burst);
        assert!(validity.is_usable() && Faults::REPEATED.contains(validity.faults), "{:?}", validity.faults);
        assert_eq!(burst.counts(), Counts::new(*bus.part().counts()));
        new_supplies += u32::from(burst.words[Channel::Supply as usize].new_data());
        // If the inertial words are read twice within a sample, they are not new.
        assert_eq!(imu.burst().unwrap().faults(), Faults::NO_NEW_DATA);
    }
    assert_eq!(new_supplies, 500);
    assert_eq!(bus.part().violations(), []);
}

#[test]
fn answers_come_one_frame_later() {
    let mut part = VirtualAdis16405::new(NoiseModel::noiseless(), 1);
    let mut answers = Vec::new();
    for word in [0x5600, 0x3800, 0x5700, 0x0000] {
        part.select();
        answers.push(part.transfer(word));
        part.deselect();
        part.advance_to(part.now() + 40_000);
    }
    assert_eq!(answers[1..], [0x4015, 0x0402, 0x4015]);
    assert_eq!(part.violations(), []);
}

#[test]
fn offsets_read_back_sign_extended_and_act_on_the_output() {
    let (bus, mut imu) = on_bus(NoiseModel::noiseless(), Config::default());
    imu.write_register(Register::YgyroOff, (-56i16) as u16).unwrap();
    imu.write_register(Register::ZacclOff, 10).unwrap();
    assert_eq!(imu.read_register(Register::YgyroOff), Ok(0xFFC8));
    bus.wait_for_data();
    let counts = imu.burst().unwrap().counts();
    assert_eq!(counts.gyro(), [0, -14, 0], "−56 · 0.0125 deg/s");
    assert_eq!(counts.accl(), [0, 0, -290], "−1 g is −300 counts");
}

#[test]
fn a_software_reset_restores_the_flash_values_and_takes_time() {
    let (bus, mut imu) = on_bus(NoiseModel::noiseless(), config(GyroRange::Dps75, 4, 7));
    imu.write_register(Register::GlobCmd, 0x80).unwrap();
    imu.read_register(Register::ProdId).unwrap();
    let at = bus.part().now();
    assert!(
        bus.part()
            .violations()
            .iter()
            .all(|violation| violation.kind == ViolationKind::Busy { activity: Activity::Reset })
    );
    assert_eq!(bus.part().violation_count(), 2);
    bus.advance_to(at + 100_000_000);
    assert_eq!(imu.read_register(Register::SmplPrd), Ok(0x0001));
    assert_eq!(imu.read_register(Register::SensAvg), Ok(0x0402));
    assert_eq!(bus.part().violation_count(), 2);
}

#[test]
fn a_supply_alarm_sets_diag_stat_which_clears_on_read() {
    let mut model = NoiseModel::noiseless();
    model.channel_mut(OutputRegister::Supply).bias = 4.5;
    let (bus, mut imu) = on_bus(model, Config::default());
    bus.wait_for_data();
    assert_eq!(imu.burst().unwrap().faults(), Faults::SUPPLY | Faults::ERROR_ALARM);
    assert_eq!(imu.read_register(Register::DiagStat), Ok(0x0001));
    assert_eq!(imu.read_register(Register::DiagStat), Ok(0x0000));
    bus.wait_for_data();
    assert_eq!(imu.read_register(Register::DiagStat), Ok(0x0001), "it persists, so the next sample brings it back");
}

#[test]
fn violations_of_the_bus_timing_are_recorded() {
    let bus = EmulatedBus::new(VirtualAdis16405::new(NoiseModel::noiseless(), 1));
    let mut timing = Timing::DEFAULT;
    timing.read_rate_ns = PerClockMode { normal: 0, low_power: 0 };
    timing.stall_ns = PerClockMode { normal: 8_999, low_power: 8_999 };
    let mut too_fast = Adis16405::new(bus.clone(), bus.delay(), Config::default()).with_timing(timing);
    assert_ne!(too_fast.read_register(Register::ProdId), Ok(0x4015), "garbled");
    let kind = ViolationKind::Stall { stall_ns: 8_999, least_ns: 9_000 };
    assert_eq!(bus.part().violations().iter().map(|violation| violation.kind).collect::<Vec<_>>(), [kind]);

    let mut part = VirtualAdis16405::new(NoiseModel::noiseless(), 1);
    part.transfer(0x5600);
    part.select();
    part.transfer_byte(0x56);
    part.deselect();
    part.advance_to(part.now() + 40_000);
    part.select();
    part.transfer(0x3E00);
    part.transfer(0x0000);
    part.deselect();
    part.set_sck_hz(Some(2_000_001));
    part.advance_to(1_000_000);
    part.select();
    part.transfer(0x5600);
    part.deselect();
    let kinds: Vec<_> = part.violations().iter().map(|violation| violation.kind).collect();
    assert_eq!(
        kinds,
        [
            ViolationKind::NotSelected,
            ViolationKind::NotSelected,
            ViolationKind::FrameLength { bytes: 1 },
            ViolationKind::FrameLength { bytes: 4 },
            ViolationKind::Clock { sck_hz: 2_000_001, most_hz: 2_000_000 },
        ]
    );
}

#[test]
fn a_sample_with_an_invalid_range_and_filter_is_a_violation() {
    let mut part = VirtualAdis16405::new(NoiseModel::noiseless(), 1);
    // The range raises the taps to its minimum (page 14); a filter that is written later does not.
    for (word, sens_avg) in [(0xB901, 0x0104), (0xB802, 0x0102)] {
        part.advance_to(part.now() + 40_000);
        part.select();
        part.transfer(word);
        part.deselect();
        assert_eq!(part.violations(), [], "{sens_avg:#06x}");
    }
    part.advance_to(part.next_data_ready());
    assert_eq!(part.violations()[0].kind, ViolationKind::Configuration { sens_avg: 0x0102 });
}

#[test]
fn the_range_scales_the_gyros_only() {
    let mut model = NoiseModel::noiseless();
    model.channel_mut(OutputRegister::GyroZ).bias = -12.5;
    for (range, expected) in [(GyroRange::Dps300, -250), (GyroRange::Dps150, -500), (GyroRange::Dps75, -1000)] {
        let (bus, mut imu) = on_bus(model.clone(), config(range, 4, 1));
        bus.wait_for_data();
        // The values are 5 V, 36 °C and 0.5 V in counts of 2.418 mV, 0.14 °C from 25 °C, and 0.806 mV.
        let still = [2068, 0, 0, expected, 0, 0, -300, 400, 0, 860, 79, 620];
        assert_eq!(imu.burst().unwrap().counts(), Counts::new(still));
    }
}

#[test]
fn white_noise_has_the_declared_variance() {
    let mut model = NoiseModel::noiseless();
    for channel in OutputRegister::GYROS {
        model.channel_mut(channel).angle_random_walk = 0.0368;
    }
    const SAMPLES: u32 = 200_000;
    for (taps, shrink) in [(0, 1.0), (2, 44.0 / 256.0)] {
        let (bus, mut imu) = on_bus(model.clone(), config(GyroRange::Dps300, taps, 7));
        let mut squares = [0.0; 3];
        for _ in 0..SAMPLES {
            bus.wait_for_data();
            for (sum, count) in squares.iter_mut().zip(imu.burst().unwrap().counts().gyro()) {
                *sum += f64::from(count).powi(2);
            }
        }
        // The variance is (N·√fs)² in counts². Two averages of four weigh 1 2 3 4 3 2 1 of 16, and rounding adds a
        // twelfth of a count squared.
        let expected = shrink * (0.0368 / 0.05f64).powi(2) * 204.8 + 1.0 / 12.0;
        // The variance of n independent values is known to √(2/n). At most seven neighbours are correlated.
        let tolerance = 5.0 * (2.0 * if taps == 0 { 1.0 } else { 7.0 } / f64::from(SAMPLES)).sqrt();
        for square in squares {
            let variance = square / f64::from(SAMPLES);
            assert!((variance / expected - 1.0).abs() < tolerance, "{variance} counts², expected {expected}");
        }
    }
}

/// Each sensed value is returned in its unit to half a count, both as an integer and as `f32`.
#[test]
fn values_are_those_that_the_part_senses() {
    // The order is supply, gyros, accelerometers, magnetometers, temperature, auxiliary input.
    let sensed = [5.1, 60.0, -33.3, 0.7, 10.0, -7.5, 3.0, 0.9, -1.2, 0.3, -39.9, 1.23];
    let mut model = NoiseModel::noiseless();
    for (channel, value) in OutputRegister::ALL.into_iter().zip(sensed) {
        model.channel_mut(channel).bias = value;
    }
    let counts = [2.418e-3, 0.0, 0.0, 0.0, 3.33e-3, 3.33e-3, 3.33e-3, 5e-4, 5e-4, 5e-4, 0.14, 0.806e-3];
    for (range, gyro_count) in [(GyroRange::Dps300, 0.05), (GyroRange::Dps150, 0.025), (GyroRange::Dps75, 0.0125)] {
        let (bus, mut imu) = on_bus(model.clone(), config(range, 4, 1));
        // These samples fill the filter of 2·16 − 1 samples.
        for _ in 0..40 {
            bus.wait_for_data();
        }
        let burst = imu.burst().unwrap();
        let sample = imu.sample_from(burst);
        let [gx, gy, gz] = sample.gyro_udps();
        let [ax, ay, az] = sample.accl_ug();
        let [mx, my, mz] = sample.magn_ugauss();
        let temp = sample.temp_mdegc() * 1000;
        let integers = [sample.supply_uv(), gx, gy, gz, ax, ay, az, mx, my, mz, temp, sample.aux_adc_uv()];
        let [gx, gy, gz] = sample.gyro_dps();
        let [ax, ay, az] = sample.accl_g();
        let [mx, my, mz] = sample.magn_gauss();
        let floats = [sample.supply_v(), gx, gy, gz, ax, ay, az, mx, my, mz, sample.temp_degc(), sample.aux_adc_v()];
        for (index, value) in sensed.into_iter().enumerate() {
            let half = if (1..=3).contains(&index) { gyro_count } else { counts[index] } / 2.0;
            let got = [f64::from(integers[index]) * 1e-6, f64::from(floats[index])];
            for got in got {
                assert!((got - value).abs() <= half + 1e-5, "{:?}: {got}, sensed {value}", OutputRegister::ALL[index]);
            }
        }
        assert_eq!(bus.part().violations(), []);
    }
}

/// The range changes from ±75 °/s, which needs 2⁴ taps, to ±300 °/s without a filter and back, at every phase of the
/// sample clock. Whichever byte of SENS_AVG is written when a sample is taken, range and filter must be a valid
/// combination.
#[test]
fn no_sample_is_taken_between_range_and_filter_of_a_new_configuration() {
    let (narrow, wide) = (config(GyroRange::Dps75, 4, 1), config(GyroRange::Dps300, 0, 1));
    let (bus, mut imu) = on_bus(NoiseModel::noiseless(), narrow);
    let mut taken_between = 0;
    for phase_us in (0..1220).step_by(10) {
        for next in [wide, narrow] {
            let ready_ns = bus.wait_for_data().unwrap();
            bus.advance_to(ready_ns + phase_us * 1000);
            let samples = bus.part().samples();
            imu.configure(next).unwrap();
            taken_between += bus.part().samples() - samples;
        }
    }
    assert!(taken_between > 10, "the phases must meet the time of the writes: {taken_between}");
    assert_eq!(bus.part().violations(), []);
}

/// Data sheet Rev. B, Table 9: SUPPLY_OUT has 14 bits of 2.418 mV. 4500 counts, 10.881 V, do not fit 12 bits.
#[test]
fn the_supply_has_14_bits() {
    let mut model = NoiseModel::noiseless();
    model.channel_mut(OutputRegister::Supply).bias = 10.881;
    let (bus, mut imu) = on_bus(model, Config::default());
    bus.wait_for_data();
    assert_eq!(imu.burst().unwrap().counts().get(Channel::Supply), 4500);
}
