//! The methods of the driver, written down once for both shells: name, arguments, result and documentation. What they do
//! is in the procedure of the same name.

/// Hands the table to `$shell`, which makes a blocking or an asynchronous method of each row. `framed` procedures are frames
/// only; `paced` ones contain pauses and take a delay.
macro_rules! procedures {
    ($shell:ident) => {
        $shell! {
            /// Asks which part answers.
            ///
            /// # Errors
            /// [`Error::Product`] if PROD_ID is that of another part, or of none.
            framed fn identity() -> Product;

            /// Checks that an ADIS16405 or ADIS16400 answers, then configures it and looks at XGYRO_OFF
            /// ([`x_sign_at_risk`](Self::x_sign_at_risk)).
            ///
            /// Only bytes that differ are written, the lower byte first, and a register that was written is read back.
            ///
            /// # Errors
            /// [`Error::Product`] if something else answers, [`Error::Verify`] if a register did not take its value.
            framed fn init() -> Product;

            /// Waits as long as the part needs after power-on ([`Timing::start_up_us`]), then as [`init`](Self::init).
            ///
            /// # Errors
            /// Those of [`init`](Self::init).
            paced fn start_up() -> Product;

            /// Resets the part (GLOB_CMD bit 7), leaves the bus alone while it recovers ([`Timing::reset_us`]) and
            /// configures it again as [`init`](Self::init) does.
            ///
            /// Registers start from what is in flash; volatile ones (GPIO, sleep, auxiliary DAC) from their reset value.
            ///
            /// # Errors
            /// Those of [`init`](Self::init).
            paced fn software_reset() -> Product;

            /// Changes rate, range and filter.
            ///
            /// When a sample period above SMPL_PRD = 0x08 is set, SCK must not exceed 300 kHz from then on.
            ///
            /// # Errors
            /// [`Error::Verify`] if a register did not take its value.
            framed fn configure(config: Config) -> ();

            /// Sets the sample rate nearest to `hz` and returns the one that was set, in samples per second.
            ///
            /// # Errors
            /// [`Error::Config`] if `hz` is not finite and positive, [`Error::Verify`].
            framed fn set_sample_rate(hz: f64) -> f64;

            /// Sets the gyro range.
            ///
            /// # Errors
            /// [`Error::Config`] if it needs more filter taps than are set, [`Error::Verify`].
            framed fn set_range(range: GyroRange) -> ();

            /// Sets the filter: two cascaded averages of 2^M samples.
            ///
            /// # Errors
            /// [`Error::Config`] if M is above 6 or too small for the range, [`Error::Verify`].
            framed fn set_filter_taps_log2(filter_taps_log2: u8) -> ();

            /// Reads a register: two frames, the answer comes in the second. Bits outside the register's width are as
            /// the part sends them.
            ///
            /// # Errors
            /// [`Error::WriteOnly`] for GLOB_CMD (reading it would start a burst) and SLP_CNT.
            framed fn read_register(register: Register) -> u16;

            /// Reads `N` registers in `N` + 1 frames, each of which brings the answer to the one before.
            ///
            /// # Errors
            /// [`Error::WriteOnly`] as for [`read_register`](Self::read_register); nothing is sent then.
            framed fn read_registers[const N: usize](registers: [Register; N]) -> [u16; N];

            /// Writes a register, the lower byte first; the upper byte only if the register has one. Does not read it
            /// back.
            ///
            /// # Errors
            /// [`Error::ReadOnly`] if it cannot be written.
            framed fn write_register(register: Register, value: u16) -> ();

            /// Gives the bits of `mask` the value that they have in `value`, and leaves the others. Reads first, writes
            /// only bytes that change, the lower one first, and reads back ([`with_verified_writes`]).
            ///
            /// [`with_verified_writes`]: Self::with_verified_writes
            ///
            /// # Errors
            /// [`Error::ReadOnly`], [`Error::WriteOnly`], [`Error::Verify`] if the bits did not take their value.
            framed fn update_register(register: Register, mask: u16, value: u16) -> ();

            /// Reads DIAG_STAT, which clears it.
            ///
            /// # Errors
            /// Only of the bus.
            framed fn diagnosis() -> Diagnosis;

            /// Runs the internal self-test (MSC_CTRL bit 10) and waits for its end. The rest of MSC_CTRL is left as it
            /// was, except that a manual self-test is interrupted and taken up again.
            ///
            /// # Errors
            /// [`Error::Deadline`] if it does not end in twice its usual time, [`Error::Product`] if the part does not
            /// answer, [`Error::Verify`].
            paced fn self_test() -> SelfTest;

            /// Runs the flash memory test (MSC_CTRL bit 11) and waits for its end.
            ///
            /// # Errors
            /// As [`self_test`](Self::self_test).
            paced fn flash_test() -> FlashTest;

            /// Deflects the sensors (MSC_CTRL bit 8 or 9) and returns by how many counts the gyros and accelerometers
            /// x, y, z moved, as means over eight samples. The part must be still. What response is right is for the
            /// user's data sheet to say.
            ///
            /// # Errors
            /// [`Error::Verify`] if the stimulus was not taken.
            paced fn stimulus_response(stimulus: Stimulus) -> [i16; 6];

            /// Where the bias correction of the gyros is applied now.
            ///
            /// # Errors
            /// Only of the bus.
            framed fn gyro_offsets() -> GyroBias;

            /// Sets the bias correction of the gyros in counts of 0.0125 °/s, −4096 to 4095, that are added to the
            /// outputs. A negative one for x is kept on the host: see [`GyroBias`].
            ///
            /// # Errors
            /// [`Error::Value`] if an offset does not fit, [`Error::Verify`].
            framed fn set_gyro_offsets(offsets: [i16; 3]) -> GyroBias;

            /// If XGYRO_OFF is negative, takes its value over and sets it to 0: see [`GyroBias`].
            ///
            /// # Errors
            /// [`Error::Verify`].
            framed fn keep_negative_x_bias_on_host() -> GyroBias;

            /// Bias correction of the accelerometers in counts of 3.33 mg.
            ///
            /// # Errors
            /// Only of the bus.
            framed fn accl_offsets() -> [i16; 3];

            /// Sets the bias correction of the accelerometers in counts of 3.33 mg, −2048 to 2047.
            ///
            /// # Errors
            /// [`Error::Value`] if an offset does not fit, [`Error::Verify`].
            framed fn set_accl_offsets(offsets: [i16; 3]) -> ();

            /// Hard-iron correction in counts of 0.5 mgauss.
            ///
            /// # Errors
            /// Only of the bus.
            framed fn hard_iron() -> [i16; 3];

            /// Sets the hard-iron correction in counts of 0.5 mgauss, −8192 to 8191.
            ///
            /// # Errors
            /// [`Error::Value`] if a correction does not fit, [`Error::Verify`].
            framed fn set_hard_iron(offsets: [i16; 3]) -> ();

            /// Soft-iron factors in units of 1/2048.
            ///
            /// # Errors
            /// Only of the bus.
            framed fn soft_iron() -> [u16; 3];

            /// Sets the soft-iron factors in units of 1/2048 (0x0800 = 1), 0 to 4095.
            ///
            /// # Errors
            /// [`Error::Value`] if a factor does not fit, [`Error::Verify`].
            framed fn set_soft_iron(factors: [u16; 3]) -> ();

            /// Has the part null the gyro offsets from its present outputs (GLOB_CMD bit 0). It must be still. A
            /// negative offset for x is then taken over: see [`GyroBias`].
            ///
            /// # Errors
            /// [`Error::Product`] if the part does not answer afterwards, [`Error::Verify`].
            paced fn auto_null() -> GyroBias;

            /// As [`auto_null`](Self::auto_null) from an average over 30 s ([`Timing::precision_auto_null_us`]), while
            /// the part must be still and the bus silent. On a sibling part it left a mean residual of 0.05 °/s.
            ///
            /// A delay that feeds a watchdog may be passed.
            ///
            /// # Errors
            /// As [`auto_null`](Self::auto_null).
            paced fn precision_auto_null() -> GyroBias;

            /// Restores the factory calibration (GLOB_CMD bit 1), leaves the bus alone while that lasts, configures the
            /// part again, and returns the corrections that were lost.
            ///
            /// # Errors
            /// Those of [`init`](Self::init).
            paced fn factory_restore() -> FactoryRestore;

            /// Number of flash writes so far.
            ///
            /// # Errors
            /// Only of the bus.
            framed fn flash_writes() -> u16;

            /// Writes the present settings to flash (GLOB_CMD bit 3), leaves the bus alone while that lasts, and
            /// returns the number of flash writes.
            ///
            /// # Errors
            /// [`Error::FlashUpdate`] if DIAG_STAT says that it failed, or if FLASH_CNT did not move.
            paced fn flash_update() -> u16;

            /// Where data ready appears; `None` if nowhere.
            ///
            /// # Errors
            /// Only of the bus.
            framed fn data_ready() -> Option<Signal>;

            /// Where data ready appears from now on; `None` for nowhere.
            ///
            /// # Errors
            /// [`Error::Verify`].
            framed fn set_data_ready(signal: Option<Signal>) -> ();

            /// The corrections that the part makes by itself.
            ///
            /// # Errors
            /// Only of the bus.
            framed fn compensation() -> Compensation;

            /// Sets the corrections that the part makes by itself.
            ///
            /// # Errors
            /// [`Error::Verify`].
            framed fn set_compensation(compensation: Compensation) -> ();

            /// An alarm as it is set; `None` if it has no source.
            ///
            /// # Errors
            /// Only of the bus.
            framed fn alarm(number: AlarmNumber) -> Option<Alarm>;

            /// Sets an alarm, or switches it off. It is off while its threshold changes.
            ///
            /// # Errors
            /// [`Error::Value`] if the threshold is outside the limits of the source, [`Error::Verify`].
            framed fn set_alarm(number: AlarmNumber, alarm: Option<Alarm>) -> ();

            /// Where alarms appear; `None` for nowhere.
            ///
            /// # Errors
            /// [`Error::Verify`].
            framed fn set_alarm_output(signal: Option<Signal>) -> ();

            /// Whether alarms compare filtered data.
            ///
            /// # Errors
            /// [`Error::Verify`].
            framed fn set_alarm_filtering(filtered: bool) -> ();

            /// Direction and level of the general-purpose lines.
            ///
            /// # Errors
            /// Only of the bus.
            framed fn gpio() -> Gpio;

            /// Sets directions, and the levels of outputs.
            ///
            /// # Errors
            /// [`Error::Verify`].
            framed fn set_gpio(gpio: Gpio) -> ();

            /// Sets the auxiliary analog output: writes AUX_DAC, then latches it (GLOB_CMD bit 2).
            ///
            /// # Errors
            /// [`Error::Verify`].
            framed fn set_aux_dac(level: DacLevel) -> ();

            /// Sends the part to sleep. Leave the bus alone until it is over, or call [`wake`](Self::wake).
            ///
            /// # Errors
            /// Only of the bus: SLP_CNT is not read back.
            framed fn sleep(sleep: Sleep) -> ();

            /// Wakes the part by a low pulse on chip select ([`Timing::wake_pulse_ns`]), waits while it recovers and
            /// asks who it is. One source has this, untested; a reset wakes the part too.
            ///
            /// # Errors
            /// [`Error::Product`] if it does not answer.
            paced fn wake() -> Product;
        }
    };
}

pub(crate) use procedures;
