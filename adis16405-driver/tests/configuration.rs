//! Configurations: which exist, and what rate they give.

use adis16405_driver::{ClockMode, Config, ConfigError, GyroRange, SamplePeriod, TimeBase};

#[test]
fn sample_rates() {
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
    assert_eq!(SamplePeriod::from_register(0), None, "the external clock is not chosen by accident");
}

#[test]
fn slow_sampling_slows_the_bus() {
    let mode = |register| SamplePeriod::from_register(register).unwrap().clock_mode();
    assert_eq!((mode(0x08), mode(0x09), mode(0x80)), (ClockMode::Normal, ClockMode::LowPower, ClockMode::LowPower));
}

#[test]
fn narrow_ranges_need_taps() {
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
