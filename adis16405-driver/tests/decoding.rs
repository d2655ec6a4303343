//! Output words, bursts and samples: every word and every count against plain arithmetic, with the fields and scale
//! factors of the data sheet.

use adis16405_driver::{BURST_BYTES, Burst, BurstValidator, Channel, Counts, Faults, GyroRange, ImuSample, OutputWord};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// Channel, bits, two's complement, units per count: copied from data sheet and register map, not from the driver.
const FIELDS: [(Channel, u32, bool, f64); 12] = [
    (Channel::Supply, 14, false, 0.002418),
    (Channel::GyroX, 14, true, 0.05),
    (Channel::GyroY, 14, true, 0.05),
    (Channel::GyroZ, 14, true, 0.05),
    (Channel::AcclX, 14, true, 0.00333),
    (Channel::AcclY, 14, true, 0.00333),
    (Channel::AcclZ, 14, true, 0.00333),
    (Channel::MagnX, 14, true, 0.0005),
    (Channel::MagnY, 14, true, 0.0005),
    (Channel::MagnZ, 14, true, 0.0005),
    (Channel::Temp, 12, true, 0.14),
    (Channel::AuxAdc, 12, false, 0.000806),
];

#[test]
fn every_word_of_every_channel_decodes_to_flags_and_a_sign_extended_count() {
    for (channel, bits, signed, _) in FIELDS {
        let modulus = 2i64.pow(bits);
        for word in 0..=u16::MAX {
            let field = i64::from(word) % modulus;
            let expected = if signed && field >= modulus / 2 { field - modulus } else { field };
            let output = OutputWord(word);
            assert_eq!(i64::from(output.counts(channel)), expected, "{channel:?} {word:#06x}");
            assert_eq!(output.new_data(), word >= 32_768, "{word:#06x}");
            assert_eq!(output.error_alarm(), word % 32_768 >= 16_384, "{word:#06x}");
        }
    }
}

#[test]
fn words_of_known_meaning_decode_to_it() {
    assert_eq!(OutputWord(0x8814).counts(Channel::Supply), 2068, "5 V");
    assert_eq!(OutputWord(0xBFF8).counts(Channel::GyroX), -8);
    assert_eq!(OutputWord(16382).counts(Channel::GyroY), -2);
    assert_eq!(OutputWord(0x8FFF).counts(Channel::Temp), -1);
}

#[test]
fn channels_have_the_limits_scales_and_offsets_of_the_data_sheet() {
    for (index, (channel, bits, signed, lsb)) in FIELDS.into_iter().enumerate() {
        assert_eq!(Channel::ALL[index], channel);
        assert_eq!(channel as usize, index);
        let limits = match (bits, signed) {
            (14, true) => (-8192, 8191),
            (12, true) => (-2048, 2047),
            (14, false) => (0, 16_383),
            _ => (0, 4095),
        };
        assert_eq!(channel.limits(), limits, "{channel:?}");
        assert_eq!(channel.lsb(GyroRange::Dps300), lsb, "{channel:?}");
    }
    assert_eq!(Channel::GyroZ.lsb(GyroRange::Dps150), 0.025);
    assert_eq!(Channel::GyroZ.lsb(GyroRange::Dps75), 0.0125);
    assert_eq!(Channel::Temp.offset(), 25.0);
}

/// The sample of a burst whose twelve words are all `word`.
fn sample(word: u16, range: GyroRange) -> ImuSample {
    let counts = Channel::ALL.map(|channel| OutputWord(word).counts(channel));
    ImuSample::new(Counts::new(counts), range)
}

/// True within three roundings of an `f32`, which holds 24 bits.
fn close(value: f32, expected: f64) -> bool {
    (f64::from(value) - expected).abs() <= expected.abs() * 3.0 / f64::from(1 << 24)
}

#[test]
fn every_count_has_the_value_of_the_data_sheet() {
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
            assert!(close(sample.supply_v(), f64::from(word) * 0.002418), "{word:#06x}");
            assert_eq!(f64::from(sample.supply_uv()), f64::from(word) * 2418.0);
            let field = f64::from(word & 0x0FFF);
            assert!(close(sample.aux_adc_v(), field * 0.000806), "{word:#06x}");
            assert_eq!(f64::from(sample.aux_adc_uv()), field * 806.0);
            let signed = field - if field >= 2048.0 { 4096.0 } else { 0.0 };
            // The sum is exact in 10⁻³ °C: the error is that of three roundings of at most 312 °C.
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
fn the_host_side_bias_is_added_to_the_x_rate_only() {
    let still = sample(0x8000, GyroRange::Dps75).with_host_bias_x(-40);
    assert_eq!(still.gyro_udps(), [-500_000, 0, 0], "40 counts of 0.0125 °/s");
    assert_eq!(still.counts().gyro(), [0, 0, 0]);
    assert_eq!(still.host_bias_x(), -40);
    // The most negative rate and bias do not overflow an i32.
    let extreme = sample(0xA000, GyroRange::Dps300).with_host_bias_x(i16::MIN);
    assert_eq!(extreme.gyro_udps()[0], -8192 * 50_000 - 32_768 * 12_500);
}

proptest! {
    #![proptest_config(ProptestConfig {
        rng_seed: RngSeed::Fixed(16405),
        failure_persistence: None,
        ..ProptestConfig::with_cases(4096)
    })]

    #[test]
    fn any_bytes_decode_to_counts_inside_their_limits(first: [u8; BURST_BYTES], second: [u8; BURST_BYTES]) {
        let mut validator = BurstValidator::default();
        for bytes in [&first, &second] {
            let burst = Burst::from_bytes(bytes);
            let validity = validator.validate(&burst);
            prop_assert_eq!(validity.is_usable(), (validity.faults - Faults::WARNINGS).is_empty());
            for channel in Channel::ALL {
                let (low, high) = channel.limits();
                prop_assert!((low..=high).contains(&burst.counts().get(channel)));
            }
            prop_assert_eq!(&burst.to_bytes()[2..], &bytes[2..]);
        }
        prop_assert_eq!(validator.counters().bursts, 2);
    }

    #[test]
    fn counts_inside_their_limits_survive_encoding_and_decoding(raw: [i16; 12]) {
        let mut counts = raw;
        for (count, channel) in counts.iter_mut().zip(Channel::ALL) {
            let (low, high) = channel.limits();
            *count = (*count).clamp(low, high);
        }
        let counts = Counts::new(counts);
        let burst = Burst::from_bytes(&Burst::from_counts(&counts).to_bytes());
        prop_assert_eq!(burst.counts(), counts);
        prop_assert!(burst.words.iter().all(|word| word.new_data() && !word.error_alarm()));
    }
}
