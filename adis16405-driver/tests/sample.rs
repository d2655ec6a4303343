//! Samples with units: every count of every field, against the scales of the data sheet.

use adis16405_driver::{Channel, Counts, GyroRange, OutputWord, Sample};

/// What all twelve channels read when every word is `word`.
fn sample(word: u16, range: GyroRange) -> Sample {
    let counts = Channel::ALL.map(|channel| OutputWord(word).counts(channel));
    Sample::new(Counts::new(counts), range)
}

/// An `f32` holds 24 bits; three roundings are made on the way.
fn close(value: f32, expected: f64) -> bool {
    (f64::from(value) - expected).abs() <= expected.abs() * 3.0 / f64::from(1 << 24)
}

#[test]
fn every_count_has_the_unit_of_the_data_sheet() {
    for (range, lsb_dps) in [(GyroRange::Dps300, 0.05), (GyroRange::Dps150, 0.025), (GyroRange::Dps75, 0.0125)] {
        for word in 0..1 << 14 {
            let sample = sample(word, range);
            let signed = f64::from(word) - if word >= 1 << 13 { f64::from(1 << 14) } else { 0.0 };
            for axis in 0..3 {
                assert!(close(sample.gyro_dps()[axis], signed * lsb_dps), "{word:#06x} in {range:?}");
                assert_eq!(f64::from(sample.gyro_udps()[axis]), (signed * lsb_dps * 1e6).round());
                assert!(close(sample.accl_g()[axis], signed * 0.00333), "{word:#06x}");
                assert_eq!(f64::from(sample.accl_ug()[axis]), (signed * 3330.0).round());
                assert!(close(sample.magn_gauss()[axis], signed * 0.0005), "{word:#06x}");
                assert_eq!(f64::from(sample.magn_ugauss()[axis]), (signed * 500.0).round());
            }
            let field = f64::from(word & 0x0FFF);
            assert!(close(sample.supply_v(), field * 0.002418), "{word:#06x}");
            assert_eq!(f64::from(sample.supply_uv()), field * 2418.0);
            assert!(close(sample.aux_adc_v(), field * 0.000806), "{word:#06x}");
            assert_eq!(f64::from(sample.aux_adc_uv()), field * 806.0);
            let signed = field - if field >= 2048.0 { 4096.0 } else { 0.0 };
            // The sum is exact in thousandths: three roundings of at most 312 °C.
            assert!((f64::from(sample.temp_degc()) - (25.0 + 0.14 * signed)).abs() < 1e-4, "{word:#06x}");
            assert_eq!(f64::from(sample.temp_mdegc()), 25_000.0 + 140.0 * signed);
            assert_eq!(
                f64::from(sample.temp_udegc(135_700)),
                25e6 + 135_700.0 * signed,
                "Analog Devices' register map"
            );
        }
    }
}

#[test]
fn the_bias_that_the_host_keeps_is_added_to_x_alone() {
    let still = sample(0x8000, GyroRange::Dps75).with_host_bias_x(-40);
    assert_eq!(still.gyro_udps(), [-500_000, 0, 0], "40 counts of 0.0125 °/s");
    assert_eq!(still.counts().gyro(), [0, 0, 0]);
    assert_eq!(still.host_bias_x(), -40);
    // The extremes stay inside an i32.
    let extreme = sample(0xA000, GyroRange::Dps300).with_host_bias_x(i16::MIN);
    assert_eq!(extreme.gyro_udps()[0], -8192 * 50_000 - 32_768 * 12_500);
}
