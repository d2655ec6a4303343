//! Procedures of the real driver on the virtual part: results, side effects, and a silent bus if the part needs one.
//! Every script runs through the blocking and the asynchronous driver.

use std::num::NonZeroU8;
use std::pin::pin;
use std::task::{Context, Poll, Waker};

use adis16405_driver::{
    Adis16405, Alarm, AlarmNumber, AlarmThreshold, AlarmWatch, BurstValidator, Channel, Config, DacLevel, Diagnosis,
    Dio, DioLine, DioSignal, Error, Faults, Gpio, GyroBias, OnChipCompensation, Polarity, Product, Register, Sleep,
    Stimulus,
};

use virtual_sensor::{BusyAnswers, EmulatedBus, NoiseModel, OutputRegister, Strictness, VirtualAdis16405};

/// Runs a future that is ready at once, as all futures of the emulated bus are.
fn block_on<T>(future: impl Future<Output = T>) -> T {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(output) => output,
        Poll::Pending => panic!("the future is pending"),
    }
}

/// A part that starts up from time 0 and answers garbage until then, needs 1 µs of chip select high between frames, and
/// refreshes its slow words with every fourth sample.
fn demanding_part(model: NoiseModel) -> VirtualAdis16405 {
    let mut part = VirtualAdis16405::cold(model, 1);
    part.set_busy_answers(BusyAnswers::Garbage);
    part.set_strictness(Strictness::Pedantic { least_high_ns: 1_000 });
    part.set_slow_refresh(4);
    part
}

/// Runs a script through both fronts. `$imu` has started up on the part behind `$bus`. Lines are `expect call =>
/// value;` or `take name = call;`, where the call is awaited in the asynchronous run, `given name = value;`, `then
/// action;`, or `fails call => error => check;`.
macro_rules! both_shells {
    ($model:expr, |$bus:ident, $imu:ident| $($script:tt)*) => {{
        {
            let $bus = EmulatedBus::new(demanding_part($model));
            let mut $imu = Adis16405::new($bus.clone(), $bus.delay(), Config::default());
            both_shells!(@run [] expect $imu.start_up() => Ok(Product::Adis16405); $($script)*);
            assert_eq!($bus.part().violations(), []);
        }
        block_on(async {
            let $bus = EmulatedBus::new(demanding_part($model));
            let mut $imu = Adis16405::new_async($bus.clone(), $bus.delay(), Config::default());
            both_shells!(@run [.await] expect $imu.start_up() => Ok(Product::Adis16405); $($script)*);
            assert_eq!($bus.part().violations(), []);
        });
    }};
    (@run [$($wait:tt)*]) => {};
    (@run [$($wait:tt)*] expect $call:expr => $value:expr; $($rest:tt)*) => {
        assert_eq!($call $($wait)*, $value);
        both_shells!(@run [$($wait)*] $($rest)*);
    };
    (@run [$($wait:tt)*] take $name:ident = $call:expr; $($rest:tt)*) => {
        let $name = $call $($wait)*.unwrap();
        both_shells!(@run [$($wait)*] $($rest)*);
    };
    (@run [$($wait:tt)*] given $name:ident = $value:expr; $($rest:tt)*) => {
        let $name = $value;
        both_shells!(@run [$($wait)*] $($rest)*);
    };
    (@run [$($wait:tt)*] fails $call:expr => $error:pat => $check:expr; $($rest:tt)*) => {
        match $call $($wait)* {
            Err($error) => $check,
            other => panic!("{other:?}"),
        }
        both_shells!(@run [$($wait)*] $($rest)*);
    };
    (@run [$($wait:tt)*] then $action:expr; $($rest:tt)*) => {
        $action;
        both_shells!(@run [$($wait)*] $($rest)*);
    };
}

fn with_rates(rates: [f64; 3]) -> NoiseModel {
    let mut model = NoiseModel::noiseless();
    for (channel, rate) in OutputRegister::GYROS.into_iter().zip(rates) {
        model.channel_mut(channel).bias = rate;
    }
    model
}

#[test]
fn self_tests_name_the_failed_sensor_and_keep_the_configuration() {
    both_shells!(NoiseModel::noiseless(), |bus, imu|
        expect imu.set_data_ready(None) => Ok(());
        expect imu.set_compensation(OnChipCompensation { linear_acceleration: true, origin_alignment: false }) => Ok(());
        // Bit 7, the compensation, is set; data ready is off, so bits 2, 1 and 0 are clear.
        expect imu.read_register(Register::MscCtrl) => Ok(0x0080);
        take test = imu.self_test();
        then assert!(test.passed() && test.ran && test.before.is_empty());
        take flash = imu.flash_test();
        then assert!(flash.passed() && flash.ran);

        then bus.part_mut().break_sensor(OutputRegister::GyroX);
        then bus.part_mut().break_sensor(OutputRegister::AcclZ);
        then bus.part_mut().damage_flash();
        take test = imu.self_test();
        then assert!(!test.passed());
        // DIAG_STAT 0x8420: bit 15 z accelerometer, bit 10 x gyro, bit 5 self-test.
        then assert_eq!(test.diagnosis.bits(), 0x8420);
        then assert!(test.diagnosis.failed_sensors().eq([Channel::GyroX, Channel::AcclZ]));
        take flash = imu.flash_test();
        then assert_eq!((flash.passed(), flash.diagnosis), (false, Diagnosis::FLASH_CHECKSUM));
        expect imu.diagnosis() => Ok(Diagnosis::empty());
        expect imu.read_register(Register::MscCtrl) => Ok(0x0080);
    );
}

#[test]
fn a_self_test_keeps_the_diagnosis_from_before() {
    let mut model = NoiseModel::noiseless();
    model.channel_mut(OutputRegister::Supply).bias = 5.5;
    both_shells!(model.clone(), |bus, imu|
        take test = imu.self_test();
        then assert_eq!(test.before, Diagnosis::SUPPLY_HIGH);
        then assert!(test.passed());
        // The cause persists, so the flag comes back with the next sample.
        then bus.wait_for_data();
        expect imu.diagnosis() => Ok(Diagnosis::SUPPLY_HIGH);
    );
}

#[test]
fn a_stimulus_moves_the_gyros_both_ways_and_the_accelerometers_one() {
    // The stimulus moves the virtual part by 40 °/s and 0.5 g: 800 and 150.15 counts. The negative stimulus is for
    // gyros only (Table 22).
    let expected = [800, 800, 800, 150, 150, 150];
    both_shells!(NoiseModel::noiseless(), |bus, imu|
        expect imu.stimulus_response(Stimulus::Positive) => Ok(expected);
        expect imu.stimulus_response(Stimulus::Negative) => Ok([-800, -800, -800, 0, 0, 0]);
        expect imu.read_register(Register::MscCtrl) => Ok(0x0006);
    );
}

#[test]
fn auto_null_zeroes_the_rates_and_keeps_a_negative_x_bias_on_the_host() {
    // 0.5 °/s is 40 counts of 0.0125 °/s.
    both_shells!(with_rates([0.5, 0.5, -0.5]), |bus, imu|
        expect imu.auto_null() => Ok(GyroBias { part: [0, -40, 40], host_x: -40 });
        then assert!(!imu.x_sign_at_risk());
        then bus.wait_for_data();
        take sample = imu.read();
        then assert_eq!(sample.counts().gyro(), [10, 0, 0]);
        then assert_eq!(sample.gyro_udps(), [0, 0, 0]);
        then assert_eq!(sample.accl_ug(), [0, 0, -999_000]);
        expect imu.gyro_offsets() => Ok(GyroBias { part: [0, -40, 40], host_x: -40 });
        // The part has written its flash (page 13). A reset loads the negative correction of x, which must neither stay
        // there nor be applied twice.
        expect imu.flash_writes() => Ok(1);
        expect imu.software_reset() => Ok(Product::Adis16405);
        expect imu.gyro_offsets() => Ok(GyroBias { part: [0, -40, 40], host_x: -40 });
        then assert!(!imu.x_sign_at_risk());
        then for _ in 0..8 { bus.wait_for_data(); };
        take sample = imu.read();
        then assert_eq!(sample.gyro_udps(), [0, 0, 0]);
    );
}

#[test]
fn the_precision_auto_null_averages_for_thirty_silent_seconds() {
    let mut model = with_rates([-0.5, 0.25, 0.0]);
    for channel in OutputRegister::GYROS {
        model.channel_mut(channel).angle_random_walk = 0.05;
    }
    both_shells!(model.clone(), |bus, imu|
        given before = bus.part().now();
        given samples = bus.part().samples();
        take bias = imu.precision_auto_null();
        then assert!(bus.part().now() - before >= 30_050_000_000);
        // The procedure takes 30 s offline, then a flash update (page 13).
        // In 31 s the part has sampled for 0.95 s: 778 times.
        then assert!((770..790).contains(&(bus.part().samples() - samples)));
        expect imu.flash_writes() => Ok(1);
        // White noise of 0.05 °/√s over 30 s leaves 0.0091 °/s, 0.73 counts; the tolerance is five of these.
        then for (offset, expected) in bias.total().into_iter().zip([40, -20, 0]) { assert!((offset - expected).abs() <= 4) };
    );
}

#[test]
fn a_factory_restore_returns_the_calibration_it_erased() {
    let (gyro, accl, hard_iron) = (GyroBias { part: [0, 1, -2], host_x: -3 }, [4, -5, 6], [-7, 8, -9]);
    let soft_iron = [0x0801, 0x0000, 0x0FFF];
    both_shells!(NoiseModel::noiseless(), |bus, imu|
        expect imu.set_gyro_offsets([-3, 1, -2]) => Ok(gyro);
        expect imu.set_accl_offsets(accl) => Ok(());
        expect imu.set_hard_iron(hard_iron) => Ok(());
        expect imu.set_soft_iron(soft_iron) => Ok(());
        take lost = imu.factory_restore();
        then assert_eq!((lost.gyro, lost.accl, lost.hard_iron), (gyro, accl, hard_iron));
        take lost = imu.factory_restore();
        then assert_eq!((lost.gyro, lost.accl, lost.hard_iron), (GyroBias::default(), [0; 3], [0; 3]));
        expect imu.soft_iron() => Ok(soft_iron);
        expect imu.flash_writes() => Ok(2);
    );
}

#[test]
fn a_flash_update_outlives_a_reset() {
    both_shells!(NoiseModel::noiseless(), |bus, imu|
        expect imu.flash_writes() => Ok(0);
        expect imu.set_accl_offsets([1, 2, 3]) => Ok(());
        // An earlier failed update left its flag in DIAG_STAT.
        then bus.part_mut().damage_flash();
        expect imu.write_register(Register::GlobCmd, 1 << 3) => Ok(());
        then { let now = bus.part().now(); bus.advance_to(now + 100_000_000) };
        then bus.part_mut().repair_flash();
        given failed = Diagnosis::FLASH_UPDATE;
        take update = imu.flash_update();
        then assert_eq!((update.before, update.writes_before), (failed, 0));
        then assert_eq!((update.writes, update.diagnosis), (1, Diagnosis::empty()));
        expect imu.set_accl_offsets([0, 0, 0]) => Ok(());
        expect imu.set_filter_taps_log2(5) => Ok(());
        expect imu.set_sample_rate(200.0) => Ok(204.8);
        expect imu.software_reset() => Ok(Product::Adis16405);
        expect imu.accl_offsets() => Ok([1, 2, 3]);
        expect imu.read_registers([Register::SmplPrd, Register::SensAvg]) => Ok([0x0007, 0x0405]);

        then bus.part_mut().damage_flash();
        fails imu.flash_update() => Error::FlashUpdate(update) => assert_eq!(
            (update.before, update.writes_before, update.writes, update.diagnosis),
            (Diagnosis::empty(), 1, 1, failed)
        );
    );
}

#[test]
fn a_sleep_lasts_as_long_as_requested_or_until_the_part_is_woken() {
    both_shells!(NoiseModel::noiseless(), |bus, imu|
        expect imu.sleep(Sleep::HalfSeconds(NonZeroU8::new(3).unwrap())) => Ok(());
        given slept = bus.part().now();
        // The part sleeps for 1.5 s, recovers for 4 ms, and takes its first sample a period later.
        then assert_eq!(bus.wait_for_data(), None);
        then bus.advance_to(slept + 1_504_500_000);
        then assert!(bus.wait_for_data().unwrap() <= slept + 1_506_000_000);

        expect imu.sleep(Sleep::Indefinite) => Ok(());
        given now = bus.part().now();
        then bus.advance_to(now + 3_600_000_000_000);
        then assert_eq!(bus.wait_for_data(), None);
        expect imu.wake() => Ok(Product::Adis16405);
        then assert!(bus.wait_for_data().is_some());
    );
}

#[test]
fn alarms_are_raised_by_level_and_by_change_and_show_on_their_pin() {
    let above = Alarm { source: Channel::AcclZ, watch: AlarmWatch::Level, threshold: AlarmThreshold::Above(-301) };
    let cold = Alarm { source: Channel::Temp, watch: AlarmWatch::Level, threshold: AlarmThreshold::Below(-10) };
    let change =
        Alarm { source: Channel::GyroY, watch: AlarmWatch::RateOfChange(4), threshold: AlarmThreshold::Above(99) };
    both_shells!(NoiseModel::noiseless(), |bus, imu|
        // The period of 4.9 ms is long enough that no sample is taken before the alarms are set.
        expect imu.set_sample_rate(204.8) => Ok(204.8);
        expect imu.set_alarm_output(Some(DioSignal { line: DioLine::Dio2, polarity: Polarity::ActiveLow })) => Ok(());
        expect imu.set_alarm(AlarmNumber::One, Some(above)) => Ok(());
        expect imu.set_alarm(AlarmNumber::Two, Some(cold)) => Ok(());
        expect imu.alarm(AlarmNumber::One) => Ok(Some(above));
        expect imu.alarm(AlarmNumber::Two) => Ok(Some(cold));
        then assert!(bus.part().pin(2));
        then bus.wait_for_data();
        then assert!(!bus.part().pin(2));
        take burst = imu.burst();
        then assert_eq!(burst.faults(), Faults::ERROR_ALARM);
        expect imu.diagnosis() => Ok(Diagnosis::ALARM_1);

        expect imu.set_alarm(AlarmNumber::One, None) => Ok(());
        expect imu.alarm(AlarmNumber::One) => Ok(None);
        expect imu.set_alarm(AlarmNumber::Two, Some(change)) => Ok(());
        expect imu.diagnosis() => Ok(Diagnosis::empty());
        then for _ in 0..8 { bus.wait_for_data(); };
        expect imu.diagnosis() => Ok(Diagnosis::empty());
        // The offset makes a step of 100 counts of 0.05 °/s: 400 counts of 0.0125 °/s.
        expect imu.set_gyro_offsets([0, 400, 0]) => Ok(GyroBias { part: [0, 400, 0], host_x: 0 });
        then for _ in 0..2 { bus.wait_for_data(); };
        expect imu.diagnosis() => Ok(Diagnosis::ALARM_2);
        then for _ in 0..8 { bus.wait_for_data(); };
        expect imu.diagnosis() => Ok(Diagnosis::ALARM_2);
        expect imu.diagnosis() => Ok(Diagnosis::empty());

        given beyond = Alarm { threshold: AlarmThreshold::Above(2048), ..cold };
        expect imu.set_alarm(AlarmNumber::One, Some(beyond))
            => Err(Error::Value { register: Register::AlmMag1, value: 2048 });
    );
}

#[test]
fn lines_show_data_ready_and_gpio_levels() {
    both_shells!(NoiseModel::noiseless(), |bus, imu|
        expect imu.data_ready() => Ok(Some(DioSignal { line: DioLine::Dio1, polarity: Polarity::ActiveHigh }));
        then bus.wait_for_data();
        then assert!(bus.part().pin(1));
        given now = bus.part().now();
        then bus.advance_to(now + 200_000);
        then assert!(!bus.part().pin(1));
        expect imu.set_data_ready(None) => Ok(());
        then assert_eq!(bus.wait_for_data(), None);

        then bus.part_mut().drive_pin(4, true);
        expect imu.set_gpio(Gpio { outputs: Dio::DIO1 | Dio::DIO3, high: Dio::DIO3 }) => Ok(());
        then assert_eq!([1, 2, 3, 4].map(|line| bus.part().pin(line)), [false, false, true, true]);
        expect imu.gpio() => Ok(Gpio { outputs: Dio::DIO1 | Dio::DIO3, high: Dio::DIO3 | Dio::DIO4 });

        expect imu.set_aux_dac(DacLevel::from_millivolts(1650).unwrap()) => Ok(());
        then assert!((bus.part().aux_output_v() - 1.65).abs() < 0.5e-3);
    );
}

#[test]
fn an_external_clock_triggers_the_samples() {
    both_shells!(NoiseModel::noiseless(), |bus, imu|
        // DIO4 must be an input (page 14).
        expect imu.set_gpio(Gpio { outputs: Dio::DIO4, high: Dio::empty() }) => Ok(());
        expect imu.configure(Config::default().with_external_clock()) => Ok(());
        given taken = bus.part().samples();
        given now = bus.part().now();
        then bus.advance_to(now + 1_000_000_000);
        then assert_eq!(bus.part().samples(), taken);
        // Data ready comes 600 µs after the rising edge (Table 2, t2).
        then bus.part_mut().drive_pin(4, true);
        given rose = bus.part().now();
        then bus.advance_to(rose + 5_000);
        then bus.part_mut().drive_pin(4, false);
        then assert_eq!(bus.wait_for_data(), Some(rose + 600_000));
        then assert_eq!(bus.part().samples(), taken + 1);
        take burst = imu.burst();
        then assert_eq!(burst.faults(), Faults::empty());
    );
}

#[test]
fn another_product_or_a_missing_part_is_an_error() {
    both_shells!(NoiseModel::noiseless(), |bus, imu|
        then bus.part_mut().set_prod_id(16400);
        expect imu.identity() => Ok(Product::Adis16400);
        then bus.part_mut().set_prod_id(16448);
        expect imu.init() => Err(Error::Product { answer: 16448 });
        then bus.part_mut().set_prod_id(16405);
        then bus.part_mut().power_off();
        expect imu.init() => Err(Error::Product { answer: 0xFFFF });
        expect imu.self_test() => Err(Error::Product { answer: 0xFFFF });
        take burst = imu.burst();
        then assert_eq!(burst.faults().cause(), Some("stuck_high"));
        then bus.part_mut().power_on();
        expect imu.start_up() => Ok(Product::Adis16405);
    );
}

/// EngineerZone, thread 81805: −8 was read as 0x9FF8 instead of 0xBFF8, in a burst and in single reads after it.
#[test]
fn the_x_gyro_erratum_occurs_and_is_avoided() {
    both_shells!(with_rates([-0.2, -0.2, -0.2]), |bus, imu|
        // The offset is −16 counts of 0.0125 °/s. With −0.2 °/s the rate is −0.4 °/s, −8 counts.
        expect imu.write_register(Register::XgyroOff, 0xFFF0) => Ok(());
        then bus.wait_for_data();
        expect imu.read_register(Register::XgyroOut) => Ok(0xBFF8);
        take _burst = imu.burst();
        then bus.wait_for_data();
        expect imu.read_register(Register::XgyroOut) => Ok(0x9FF8);
        then bus.wait_for_data();
        take burst = imu.burst();
        then assert_eq!(burst.words[1].0, 0x9FF8);
        then assert_eq!(burst.words[2].0, 0xBFFC);
        then assert!(BurstValidator::default().validate(&burst).faults.contains(Faults::IMPOSSIBLE_RATE));
        take _bias = imu.gyro_offsets();
        then assert!(imu.x_sign_at_risk());

        expect imu.keep_negative_x_bias_on_host() => Ok(GyroBias { part: [0; 3], host_x: -16 });
        then assert!(!imu.x_sign_at_risk());
        then for _ in 0..8 { bus.wait_for_data(); };
        take sample = imu.read();
        then assert_eq!(sample.counts().gyro(), [-4, -4, -4]);
        then assert_eq!(sample.gyro_udps(), [-400_000, -200_000, -200_000]);
    );
}
