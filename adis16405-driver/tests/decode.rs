//! Output words: every one of the 65,536 against plain arithmetic, with the fields as the data sheet has them.

use adis16405_driver::{BURST_BYTES, Burst, Channel, Counts, Faults, GyroRange, Judge, OutputWord};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// Channel, bits, two's complement, unit per count: data sheet and register map, written down again.
const FIELDS: [(Channel, u32, bool, f64); 12] = [
    (Channel::Supply, 12, false, 0.002418),
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
fn every_word_of_every_channel() {
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
fn known_words() {
    assert_eq!(OutputWord(0x8814).counts(Channel::Supply), 2068, "5 V");
    assert_eq!(OutputWord(0xBFF8).counts(Channel::GyroX), -8);
    assert_eq!(OutputWord(16382).counts(Channel::GyroY), -2);
    assert_eq!(OutputWord(0x8FFF).counts(Channel::Temp), -1);
}

#[test]
fn fields_and_scales() {
    for (index, (channel, bits, signed, lsb)) in FIELDS.into_iter().enumerate() {
        assert_eq!(Channel::ALL[index], channel);
        assert_eq!(channel as usize, index);
        let limits = match (bits, signed) {
            (14, true) => (-8192, 8191),
            (12, true) => (-2048, 2047),
            _ => (0, 4095),
        };
        assert_eq!(channel.limits(), limits, "{channel:?}");
        assert_eq!(channel.lsb(GyroRange::Dps300), lsb, "{channel:?}");
    }
    assert_eq!(Channel::GyroZ.lsb(GyroRange::Dps150), 0.025);
    assert_eq!(Channel::GyroZ.lsb(GyroRange::Dps75), 0.0125);
    assert_eq!(Channel::Temp.zero(), 25.0);
}

proptest! {
    #![proptest_config(ProptestConfig {
        rng_seed: RngSeed::Fixed(16405),
        failure_persistence: None,
        ..ProptestConfig::with_cases(4096)
    })]

    #[test]
    fn any_bytes_are_decoded_into_their_fields(first: [u8; BURST_BYTES], second: [u8; BURST_BYTES]) {
        let mut judge = Judge::default();
        for bytes in [&first, &second] {
            let burst = Burst::from_bytes(bytes);
            let verdict = judge.judge(&burst);
            prop_assert_eq!(verdict.usable, (verdict.faults - Faults::REPEATED).is_empty());
            for channel in Channel::ALL {
                let (low, high) = channel.limits();
                prop_assert!((low..=high).contains(&burst.counts().get(channel)));
            }
            prop_assert_eq!(&burst.to_bytes()[2..], &bytes[2..]);
        }
        prop_assert_eq!(judge.counters().bursts, 2);
    }

    #[test]
    fn counts_inside_their_fields_survive_the_wire(raw: [i16; 12]) {
        let mut counts = raw;
        for (count, channel) in counts.iter_mut().zip(Channel::ALL) {
            let (low, high) = channel.limits();
            *count = (*count).clamp(low, high);
        }
        let counts = Counts::new(counts);
        let burst = Burst::from_bytes(&Burst::fresh(&counts).to_bytes());
        prop_assert_eq!(burst.counts(), counts);
        prop_assert!(burst.words.iter().all(|word| word.new_data() && !word.error_alarm()));
    }
}
