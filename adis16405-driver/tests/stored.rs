//! Values survive being stored, and what is loaded is checked.
#![cfg(feature = "serde")]

use adis16405_driver::{
    Alarm, Burst, Channel, Config, Counts, DacLevel, Diagnosis, Faults, GyroRange, SamplePeriod, Threshold, TimeBase,
    Timing, Watch,
};

fn survives<T>(value: T)
where
    T: serde::Serialize + serde::de::DeserializeOwned + PartialEq + std::fmt::Debug,
{
    let text = serde_json::to_string(&value).unwrap();
    assert_eq!(serde_json::from_str::<T>(&text).unwrap(), value, "{text}");
}

#[test]
fn values_survive() {
    let period = SamplePeriod::from_divisor(TimeBase::Slow, 7).unwrap();
    survives(Config::new(GyroRange::Dps75, 5, period).unwrap().with_external_clock());
    survives(Timing::DEFAULT);
    survives(Burst::fresh(&Counts::new([2068, -1, 2, -3, 4, -5, 6, -7, 8, -9, 10, 11])));
    survives(Faults::SUPPLY | Faults::SHIFTED);
    survives(Diagnosis::ALARM_2);
    survives(DacLevel::from_counts(4095).unwrap());
    survives(Alarm { source: Channel::MagnY, watch: Watch::RateOfChange(3), threshold: Threshold::Below(-7) });
}

#[test]
fn what_the_part_would_refuse_is_not_loaded() {
    let good = serde_json::to_string(&Config::default()).unwrap();
    let narrow = good.replace("Dps300", "Dps75");
    assert_ne!(narrow, good);
    let error = serde_json::from_str::<Config>(&narrow).unwrap_err().to_string();
    assert!(error.contains("filter taps 2^2 are outside 2^4 to 2^6 for Dps75"), "{error}");
    assert!(serde_json::from_str::<SamplePeriod>("0").is_err());
    assert!(serde_json::from_str::<DacLevel>("4096").is_err());
}
