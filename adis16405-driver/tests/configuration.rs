//! Configurations: sample rates, ranges with their filters, the filter, serialisation.

use adis16405_driver::{BartlettFilter, ClockMode, Config, ConfigError, GyroRange, SamplePeriod, TimeBase};

/// Integers and `f32` find the period that `f64` finds, and return its rate: for the rate of every period, for rates just
/// off the middle between two, and beyond both ends.
#[test]
fn rates_in_f32_and_in_integers_are_those_in_f64() {
    let rates = (0x01..=0xFF).map(|smpl_prd| SamplePeriod::from_register(smpl_prd).unwrap().millihz());
    let others = [1, 412, 413, 1_000, 12_850, 12_851, 50_000, 100_000, 200_000, 682_000, 683_000, 819_201, u32::MAX];
    for millihz in rates.chain(others) {
        let expected = SamplePeriod::nearest(f64::from(millihz) * 1e-3).unwrap();
        assert_eq!(SamplePeriod::nearest_millihz(millihz).unwrap().ticks(), expected.ticks(), "{millihz}");
        assert_eq!(SamplePeriod::nearest_f32(millihz as f32 * 1e-3).unwrap().ticks(), expected.ticks(), "{millihz}");
        assert_eq!(f64::from(expected.millihz()), (expected.hz() * 1e3).round());
        assert!((f64::from(expected.hz_f32()) / expected.hz() - 1.0).abs() < 1e-7);
    }
    const PERIOD: SamplePeriod = match SamplePeriod::nearest_millihz(204_800) {
        Ok(period) => period,
        Err(_) => panic!("a rate above 0"),
    };
    assert_eq!((PERIOD.register(), PERIOD.millihz(), PERIOD.hz_f32()), (7, 204_800, 204.8));
    assert_eq!(SamplePeriod::nearest_millihz(0), Err(ConfigError::Rate));
    for hz in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(SamplePeriod::nearest_f32(hz), Err(ConfigError::Rate));
    }
}

#[test]
fn sample_periods_are_those_of_the_data_sheet_and_nearest_finds_them() {
    // 0.61035 ms · (NS + 1) and 18.921 ms · (NS + 1); 819.2 SPS after reset. The printed periods have five digits.
    for (base, divisor, register, period_ms) in [
        (TimeBase::Fast, 2, 0x01, 2.0 * 0.61035),
        (TimeBase::Fast, 8, 0x07, 8.0 * 0.61035),
        (TimeBase::Fast, 128, 0x7F, 128.0 * 0.61035),
        (TimeBase::Slow, 1, 0x80, 18.921),
        (TimeBase::Slow, 128, 0xFF, 128.0 * 18.921),
    ] {
        let period = SamplePeriod::from_divisor(base, divisor).unwrap();
        assert_eq!(period.register(), register);
        assert!((1000.0 / period.hz() / period_ms - 1.0).abs() < 1e-5, "{register:#04x}: {}", period.hz());
        assert_eq!(SamplePeriod::from_register(register), Some(period));
        // One slow period is 31 fast ones, so two registers may give the same rate.
        assert_eq!(SamplePeriod::nearest(period.hz()).unwrap().ticks(), period.ticks());
    }
    assert_eq!(SamplePeriod::nearest(204.8).unwrap().register(), 7);
    assert_eq!(SamplePeriod::nearest(100.0).unwrap().register(), 15, "102.4 SPS is nearer than 96.4");
    assert_eq!(SamplePeriod::nearest(1e9).unwrap().register(), 1);
    assert_eq!(SamplePeriod::nearest(1e-9).unwrap().register(), 0xFF);
    for hz in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(SamplePeriod::nearest(hz), Err(ConfigError::Rate));
    }
    for (base, divisor) in [(TimeBase::Fast, 0), (TimeBase::Fast, 1), (TimeBase::Fast, 129), (TimeBase::Slow, 0)] {
        assert_eq!(SamplePeriod::from_divisor(base, divisor), Err(ConfigError::Divisor { base, divisor }));
    }
    assert_eq!(SamplePeriod::from_register(0), None, "0 selects the external clock");
}

#[test]
fn low_power_mode_begins_above_smpl_prd_8() {
    let mode = |register| SamplePeriod::from_register(register).unwrap().clock_mode();
    assert_eq!((mode(0x08), mode(0x09), mode(0x80)), (ClockMode::Normal, ClockMode::LowPower, ClockMode::LowPower));
}

#[test]
fn narrow_ranges_need_more_filter_taps() {
    for (range, least, field) in
        [(GyroRange::Dps300, 0, 0x0400), (GyroRange::Dps150, 2, 0x0200), (GyroRange::Dps75, 4, 0x0100)]
    {
        for taps in 0..=7 {
            let config = Config::new(range, taps, SamplePeriod::RESET);
            if (least..=6).contains(&taps) {
                assert_eq!(config.unwrap().sens_avg(), field | u16::from(taps));
            } else {
                assert_eq!(config, Err(ConfigError::FilterTaps { range, filter_taps_log2: taps }));
            }
        }
    }
    assert_eq!(Config::default().sens_avg(), 0x0402, "reset value of SENS_AVG");
}

/// 2N + 1 taps with a phase of N samples (data sheet Rev. B, Figure 15).
#[test]
fn the_filter_has_the_taps_of_the_data_sheet() {
    for (taps_log2, taps) in [(0, 1), (1, 2), (2, 4), (3, 8), (4, 16), (5, 32), (6, 64)] {
        let filter = BartlettFilter::new(taps_log2);
        assert_eq!((filter.taps(), filter.length(), filter.group_delay()), (taps, 2 * taps + 1, taps));
    }
}

#[test]
fn a_configuration_returns_its_filter_of_at_most_64_taps() {
    let config = Config::new(GyroRange::Dps75, 5, SamplePeriod::RESET).unwrap();
    assert_eq!(config.filter().taps(), 32);
    assert_eq!(BartlettFilter::new(200).taps(), 64, "M is 6 at most");
}

#[cfg(feature = "serde")]
mod serialisation {
    use adis16405_driver::{
        Alarm, AlarmThreshold, AlarmWatch, Burst, Channel, Config, Counts, DacLevel, Diagnosis, Faults, GyroRange,
        SamplePeriod, TimeBase, Timing,
    };

    fn assert_round_trip<T>(value: T)
    where
        T: serde::Serialize + serde::de::DeserializeOwned + PartialEq + std::fmt::Debug,
    {
        let text = serde_json::to_string(&value).unwrap();
        assert_eq!(serde_json::from_str::<T>(&text).unwrap(), value, "{text}");
    }

    #[test]
    fn values_survive_serialisation() {
        let period = SamplePeriod::from_divisor(TimeBase::Slow, 7).unwrap();
        assert_round_trip(Config::new(GyroRange::Dps75, 5, period).unwrap().with_external_clock());
        assert_round_trip(Timing::DEFAULT);
        assert_round_trip(Burst::from_counts(&Counts::new([2068, -1, 2, -3, 4, -5, 6, -7, 8, -9, 10, 11])));
        assert_round_trip(Faults::SUPPLY | Faults::SHIFTED);
        assert_round_trip(Diagnosis::ALARM_2);
        assert_round_trip(DacLevel::from_counts(4095).unwrap());
        assert_round_trip(Alarm {
            source: Channel::MagnY,
            watch: AlarmWatch::RateOfChange(3),
            threshold: AlarmThreshold::Below(-7),
        });
    }

    #[test]
    fn values_that_the_part_does_not_accept_are_not_deserialised() {
        let good = serde_json::to_string(&Config::default()).unwrap();
        let narrow = good.replace("Dps300", "Dps75");
        assert_ne!(narrow, good);
        let error = serde_json::from_str::<Config>(&narrow).unwrap_err().to_string();
        assert!(error.contains("filter taps 2^2 are outside 2^4 to 2^6 for Dps75"), "{error}");
        assert!(serde_json::from_str::<SamplePeriod>("0").is_err());
        assert!(serde_json::from_str::<DacLevel>("4096").is_err());
    }
}
