//! The application's main loop: commands, checkpoints, epochs and learning, reports.

use crate::bench_console;
use crate::board::{Board, BrownOutLevel, BusTiming};
use crate::command::{Command, CommandError, CommandParser};
use crate::console::{Console, SAFE_MODE, VERSION_LINE};
use crate::counters::{CounterLog, add};
use crate::device::{DeviceState, FIRST_CONFIG, FIRST_SETTINGS, START_UP_US, SensorRecovery, SensorState, log};
use crate::epoch::{EpochChannel, FinishedEpoch, Regressors};
use crate::event::event;
use crate::learner::{EpochFit, Learner};
use crate::receive::HostPort;
use crate::report_frames::{ReportPart, ReportProgress, running_sums, send};
use crate::retained::{RetainedRam, RetainedSettings};
use crate::scale::ReportScale;
use crate::sensor::{BURST_LIMIT_HZ, LOW_POWER_LIMIT_HZ, auto_null};
use crate::settings_store::{MAX_RECORD, StoreError};
use crate::statistics::CHANNELS;
use crate::status_flags::StatusFlags;
use crate::stored_state::{self, StoredSettings};
use crate::watchdog::TaskMonitor;
use adis16405_driver::{Config, ConfigError, SamplePeriod};
use link::{Boot, BootCause, Health, MessageRef, TextLine, text};

/// The start-up data of a board for the application.
pub struct Start {
    /// The reason for the start, and the crash record.
    pub boot: Boot,
    /// The retained RAM.
    pub retained: RetainedRam,
    /// Memory for the finished epoch.
    pub finished: &'static mut FinishedEpoch,
}

/// Time for which a write to the sensor's flash stays armed, µs.
const ARMED_US: u64 = 10_000_000;
/// Least time between two writes of models without a command, µs.
const KEEP_US: u64 = 3_600_000_000;
/// Time between two checkpoints of one channel each, µs.
const CHECKPOINT_US: u64 = 100_000;

/// The application.
pub struct App {
    state: DeviceState,
    retained: RetainedRam,
    /// One parser for each port, so that lines are not mixed.
    parsers: [CommandParser; HostPort::COUNT],
    console: Console,
    report: ReportProgress,
    next_report_us: u64,
    next_checkpoint_us: u64,
    checkpoint_channel: usize,
    noted_us: u64,
    armed_until_us: u64,
    /// Earliest time of the next write of models.
    next_kept_us: u64,
    tasks: TaskMonitor,
    counter_log: CounterLog,
}

/// Runs the application on a board, without end.
pub fn run(mut board: impl Board, start: Start) -> ! {
    let mut app = App::new(start, &mut board);
    loop {
        if !app.turn(&mut board) {
            board.sleep();
        }
    }
}

fn interval_us(settings: RetainedSettings) -> u64 {
    u64::from(settings.user.interval_s) * 1_000_000
}

impl App {
    /// Restores settings and statistics from retained RAM. After three crashes within ten minutes it restores nothing,
    /// since stored data may be the cause.
    pub fn new(start: Start, board: &mut impl Board) -> Self {
        let Start { mut boot, mut retained, finished } = start;
        let has_crashed = boot.cause == BootCause::Watchdog || !boot.crash_record.is_empty();
        boot.safe_mode = has_crashed && retained.note_crash();
        let starts = retained.settings().map_or(0, |settings| settings.starts);
        if boot.safe_mode {
            retained.clear_statistics();
            event!(error, "safe mode");
            log(board, format_args!("{SAFE_MODE}"));
        }
        let with_config = |settings: RetainedSettings| Some((settings, settings.user.config()?));
        let restored = retained.settings().and_then(with_config);
        let first = restored.is_none();
        let mut learner = Learner::new(finished);
        let stored = if boot.safe_mode { None } else { read_stored(board, &mut learner) };
        let fresh = |user| RetainedSettings { user, ..RetainedSettings::default() };
        let kept = || with_config(fresh(stored?.user));
        let (mut settings, config) = restored.or_else(kept).unwrap_or((fresh(FIRST_SETTINGS), FIRST_CONFIG));
        settings.starts = starts.saturating_add(1);
        boot.starts = settings.starts;
        board.estimators(|estimators| estimators.restart(config));
        for index in 0..CHANNELS.len() {
            if let Some(sums) = retained.restore(index).filter(|_| !first) {
                board.estimators(|estimators| estimators.restore(index, &sums));
                boot.restored_channels += 1;
            }
        }
        retained.write_settings(settings, first);
        // If the device restarted while learning, the report of the epoch starts again.
        let interrupted = !first
            && learner.finished.as_deref_mut().is_some_and(|finished| {
                retained.restore_epoch(finished) && finished.number.wrapping_add(1) == settings.epoch
            });
        match stored {
            Some(stored) if stored.user.of_sensor() == settings.user.of_sensor() => {
                board.estimators(|estimators| estimators.set_raw_stream(first && stored.raw_stream));
            }
            _ => learner.reset(),
        }
        let mut report = ReportProgress::default();
        if interrupted {
            report.start_epoch_end();
        }
        let now_us = board.now_us();
        // After any other restart the sensor may be starting up too.
        let sensor_runs = matches!(boot.cause, BootCause::Pin | BootCause::Software | BootCause::Watchdog);
        let probe_us = if sensor_runs { now_us } else { now_us + START_UP_US };
        Self {
            state: DeviceState {
                spi_clock_hz: board.set_clock_limit(BURST_LIMIT_HZ),
                boot,
                settings,
                config,
                product_id: 0,
                sensor: SensorState::Probing { at_us: probe_us, step: None },
                learner,
                epoch_start_us: now_us as i64 - settings.epoch_age_us as i64,
                counters: Health::default(),
                recovery: SensorRecovery::default(),
                status_flags: StatusFlags::default(),
                report_scale: ReportScale::new(config, None),
            },
            retained,
            parsers: Default::default(),
            console: Console::default(),
            report,
            next_report_us: now_us + interval_us(settings),
            next_checkpoint_us: now_us + CHECKPOINT_US,
            checkpoint_channel: 0,
            noted_us: now_us,
            armed_until_us: 0,
            next_kept_us: 0,
            tasks: TaskMonitor::new(now_us),
            counter_log: CounterLog::default(),
        }
    }

    /// One pass of the main loop: all received commands and at most one message. Returns false if nothing is left
    /// before the next interrupt.
    pub fn turn(&mut self, board: &mut impl Board) -> bool {
        self.service(board);
        self.transmit(board)
    }

    /// Does the urgent work, also during a fit: watchdog, commands, sensor, checkpoints, timers.
    fn service(&mut self, board: &mut impl Board) {
        if !self.tasks.are_alive(board) {
            return; // the watchdog must not be fed
        }
        board.feed_watchdog();
        while let Some((port, byte)) = board.receive() {
            let answer = match self.parsers[port as usize].push(byte) {
                Some(Ok(command)) => {
                    event!(debug, "command {}", command);
                    self.execute(command, board)
                }
                Some(Err(error)) => Some(self.reject(error)),
                None => None,
            };
            if let Some(line) = answer {
                self.console.print(board, line);
            }
        }
        if self.state.supervise_sensor(board) {
            self.restart(board);
        }
        self.checkpoint(board);
        self.check_timers(board);
    }

    /// Sends waiting text, a line of an answer, a message of the report; false if nothing is left or there is no room.
    fn transmit(&mut self, board: &mut impl Board) -> bool {
        if !self.flush(board) {
            return false;
        }
        self.console.send_line(&self.state, board);
        self.send_report_part(board);
        self.console.has_answers() || self.report.is_active()
    }

    fn flush(&mut self, board: &mut impl Board) -> bool {
        let has_room = self.console.flush(board);
        if has_room {
            self.tasks.mark_transmitted(board.now_us());
        }
        has_room
    }

    /// Executes a command; the answer of one line, if it has one. Not inlined: its lines would add to the stack of a fit.
    #[inline(never)]
    fn execute(&mut self, command: Command, board: &mut impl Board) -> Option<TextLine> {
        let (now_us, config) = (board.now_us(), self.state.config);
        let (range, taps, period) = (config.range(), config.filter_taps_log2(), config.sample_period());
        Some(match command {
            Command::Answer(answer) => return self.console.answer(answer),
            Command::Version => text!("{VERSION_LINE}"),
            Command::Report => {
                self.report.start();
                return None;
            }
            Command::ResetStatistics => {
                self.reset_statistics(board);
                self.state.counters = Health::default();
                self.state.status_flags = StatusFlags::default();
                text!("statistics reset")
            }
            Command::Rate(millihertz) => {
                let period = SamplePeriod::nearest(f64::from(millihertz) / 1000.0);
                self.configure(board, period.and_then(|period| Config::new(range, taps, period)))
            }
            Command::Range(range) => {
                self.configure(board, Config::new(range, taps.max(range.min_filter_taps_log2()), period))
            }
            Command::Filter(taps) => self.configure(board, Config::new(range, taps, period)),
            Command::Epoch(seconds) => {
                self.state.settings.user.epoch_s = seconds;
                self.retained.write_settings(self.state.settings, false);
                text!("epoch of {seconds} s; this one began {} s ago", self.state.epoch_age_s(now_us))
            }
            Command::Interval(seconds) => {
                self.state.settings.user.interval_s = seconds;
                self.next_report_us = now_us + interval_us(self.state.settings);
                self.retained.write_settings(self.state.settings, false);
                text!("reports every {seconds} s")
            }
            Command::RawStream(on) => {
                board.estimators(|estimators| estimators.set_raw_stream(on));
                text!("stream of raw bursts {}", if on { "on" } else { "off" })
            }
            Command::SelfTest => {
                self.state.request_check(now_us, board);
                return None;
            }
            Command::ProductId(prod_id) => {
                self.state.settings.user.prod_id = prod_id;
                self.retained.write_settings(self.state.settings, false);
                self.state.request_check(now_us, board);
                match prod_id {
                    0 => text!("parts with the PROD_ID of their type"),
                    _ => text!("a part that answers PROD_ID {prod_id} is an ADIS16405"),
                }
            }
            Command::BrownOut => {
                let level = match board.program_brown_out() {
                    BrownOutLevel::Fixed => return Some(text!("this board sets its brown-out level itself")),
                    BrownOutLevel::Set => return Some(text!("brown-out: 2.7 V, as before")),
                    BrownOutLevel::Programmed => "written: brown-out level 2.7 V, after the supply was off",
                    BrownOutLevel::Failed => "not written",
                };
                log(board, format_args!("option bytes {level}"));
                return None;
            }
            Command::Arm => {
                self.armed_until_us = now_us + ARMED_US;
                text!("keep the sensor still; autonull within 10 s nulls its bias")
            }
            Command::AutoNull => self.auto_null(board, now_us),
            Command::ReadRegister(register) => bench_console::read_register(register, &self.state, board),
            Command::CompareReads(register) => bench_console::compare_reads(register, &self.state, board),
            Command::WriteRegister(register, value)
                if bench_console::writes_flash(register, value) && !self.disarm(now_us) =>
            {
                text!("not armed: this writes the sensor's flash; arm, then poke within 10 s")
            }
            Command::WriteRegister(register, value) => {
                bench_console::write_register(register, value, &self.state, board)
            }
            Command::SlowBus(is_slow) => {
                board.set_sampling(false);
                board.set_bus_timing(if is_slow { BusTiming::SLOW } else { BusTiming::USUAL });
                self.state.request_probe(now_us);
                let timing =
                    if is_slow { "slow timing of the bus, until a restart" } else { "usual timing of the bus" };
                text!("{timing}")
            }
            Command::Persist => written(self.persist(board), "settings and models are kept without power"),
            Command::Forget => written(self.write_record(&[], board), "nothing is kept without power"),
            Command::Restart => {
                self.restart(board);
                return None;
            }
            Command::BootLoader => {
                self.checkpoint_all(board);
                return (!board.start_boot_loader())
                    .then(|| text!("no boot loader that a command starts: use the board's button or pin"));
            }
        })
    }

    fn restart(&mut self, board: &mut impl Board) {
        self.checkpoint_all(board);
        board.restart();
    }

    fn checkpoint_all(&mut self, board: &mut impl Board) {
        (0..CHANNELS.len()).for_each(|index| self.checkpoint_channel(board, index));
        self.checkpoint_age(board.now_us());
    }

    fn reject(&mut self, error: CommandError) -> TextLine {
        add(&mut self.state.counters.bad_commands, 1);
        match error {
            CommandError::UnknownKey(byte) => {
                text!("{} is no command; ? lists them", char::from(byte).escape_default())
            }
            CommandError::LostBytes => text!("bytes were lost: repeat the command"),
            CommandError::InvalidLine(letter) => text!("no such {} command; ? lists them", char::from(letter)),
        }
    }

    fn configure(&mut self, board: &mut impl Board, config: Result<Config, ConfigError>) -> TextLine {
        let config = match config {
            Ok(config) => config,
            Err(error) => return text!("{error}"),
        };
        if let Err(clock_hz) = self.state.prepare_clock(config, board) {
            let limit_hz = LOW_POWER_LIMIT_HZ;
            return text!("below 182 SPS the sensor takes a serial clock of {limit_hz} Hz, not {clock_hz} Hz");
        }
        self.state.config = config;
        self.state.settings.user.smpl_prd = config.sample_period().register();
        self.state.settings.user.sens_avg = config.sens_avg();
        self.reset_statistics(board);
        board.estimators(|estimators| estimators.restart(config));
        self.state.request_probe(board.now_us());
        text!("statistics reset: the sensor is configured anew")
    }

    /// Returns whether a flash write was armed; the next one must be armed again.
    fn disarm(&mut self, now_us: u64) -> bool {
        now_us < core::mem::take(&mut self.armed_until_us)
    }

    fn auto_null(&mut self, board: &mut impl Board, now_us: u64) -> TextLine {
        if !self.disarm(now_us) {
            return text!("not armed: arm first, then autonull within 10 s");
        }
        board.set_sampling(false);
        self.state.request_probe(now_us);
        let sck_hz = board.set_clock_limit(LOW_POWER_LIMIT_HZ);
        let done = auto_null(board.sensor_bus(), self.state.config, sck_hz).map_err(|error| text!("{error}"));
        if done.is_ok() {
            self.reset_statistics(board);
        }
        match done.map(|bias| bias.host_x) {
            Ok(0) => text!("bias nulled, statistics reset"),
            // The driver keeps a negative x, since bursts lose its sign (erratum). The Allan variance does not depend on it.
            Ok(x) => text!("bias of y and z nulled, statistics reset; x: {x} counts not applied by the part"),
            Err(error) => text!("bias not nulled: {error}"),
        }
    }

    /// Stores settings and models in flash; returns the pause of sampling in µs.
    #[inline(never)]
    fn persist(&mut self, board: &mut impl Board) -> Result<u64, StoreError> {
        let raw_stream = board.estimators(|estimators| estimators.raw_stream.is_on());
        let mut record = [0; MAX_RECORD];
        let settings = StoredSettings { user: self.state.settings.user, raw_stream };
        let record =
            stored_state::encode(&settings, &self.state.learner.models, &mut record).ok_or(StoreError::TooLong)?;
        self.write_record(record, board)
    }

    /// Stores the models once an hour at most, since a write costs samples.
    fn keep_models(&mut self, board: &mut impl Board) {
        let now_us = board.now_us();
        if now_us < self.next_kept_us {
            return;
        }
        self.next_kept_us = now_us + KEEP_US;
        match self.persist(board) {
            Ok(us) => log(board, format_args!("models kept without power, not sampled for {} ms", us.div_ceil(1000))),
            Err(StoreError::NoMemory) => {}
            Err(error) => log(board, format_args!("models not kept without power: {error}")),
        }
    }

    fn write_record(&mut self, record: &[u8], board: &mut impl Board) -> Result<u64, StoreError> {
        if !board.keeps_record() {
            return Err(StoreError::NoMemory);
        }
        let began_us = board.now_us();
        board.set_sampling(false);
        let written = board.write_record(record);
        let pause_us = board.now_us() - began_us;
        self.state.resume_sampling(board);
        written.map(|()| pause_us)
    }

    /// Writes one channel per [`CHECKPOINT_US`], and the epoch's age after the last: each once in 0.8 s, or at once
    /// after a fit.
    fn checkpoint(&mut self, board: &mut impl Board) {
        let now_us = board.now_us();
        for _ in 0..CHANNELS.len() {
            if now_us < self.next_checkpoint_us {
                return;
            }
            self.next_checkpoint_us += CHECKPOINT_US;
            self.checkpoint_channel = (self.checkpoint_channel + 1) % CHANNELS.len();
            self.checkpoint_channel(board, self.checkpoint_channel);
            if self.checkpoint_channel == 0 {
                self.checkpoint_age(now_us);
            }
        }
        self.next_checkpoint_us = self.next_checkpoint_us.max(now_us);
    }

    fn checkpoint_age(&mut self, now_us: u64) {
        let seconds = (now_us - self.noted_us) / 1_000_000;
        self.noted_us += seconds * 1_000_000;
        self.retained.note_time(seconds as u32);
        self.state.settings.epoch_age_us = self.state.epoch_age_us(now_us);
        self.retained.write_settings(self.state.settings, false);
    }

    fn checkpoint_channel(&mut self, board: &mut impl Board, index: usize) {
        self.retained.checkpoint(index, &mut running_sums(board, index));
    }

    fn check_timers(&mut self, board: &mut impl Board) {
        let now_us = board.now_us();
        if self.counter_log.is_due(now_us) {
            self.counter_log.compare(&self.state.health(board), now_us);
        }
        let epoch_us = u64::from(self.state.settings.user.epoch_s) * 1_000_000;
        if epoch_us > 0 && self.state.epoch_age_us(now_us) >= epoch_us {
            self.finish_epoch(board);
        }
        let interval_us = interval_us(self.state.settings);
        if interval_us > 0 && now_us >= self.next_report_us {
            self.next_report_us += ((now_us - self.next_report_us) / interval_us + 1) * interval_us;
            self.report.start();
        }
    }

    fn reset_statistics(&mut self, board: &mut impl Board) {
        board.estimators(|estimators| estimators.reset());
        self.state.settings.epoch = 0;
        self.state.learner.reset();
        self.retained.clear_epoch();
        self.report = ReportProgress::default();
        self.start_epoch(board);
    }

    /// Ends the running epoch and starts its report, unless the epoch before is still being learned from.
    fn finish_epoch(&mut self, board: &mut impl Board) {
        let finished = self.state.learner.finished.as_deref_mut();
        let Some(finished) = finished.filter(|_| !self.report.ends_epoch()) else { return };
        board.estimators(|estimators| finished.fill(estimators));
        finished.number = self.state.settings.epoch;
        event!(info, "epoch {=u32} finished", finished.number);
        // The epoch is written before the settings: a restart in between finds it either running or finished.
        self.retained.write_epoch(finished);
        self.state.settings.epoch = self.state.settings.epoch.saturating_add(1);
        self.report.start_epoch_end();
        self.start_epoch(board);
    }

    fn start_epoch(&mut self, board: &mut impl Board) {
        self.state.epoch_start_us = board.now_us() as i64;
        self.state.settings.epoch_age_us = 0;
        self.retained.write_settings(self.state.settings, true);
    }

    fn send_report_part(&mut self, board: &mut impl Board) {
        let ends_epoch = self.report.ends_epoch();
        let Some(part) = self.report.part() else {
            if ends_epoch {
                self.retained.clear_epoch(); // the learner is done with it
                self.keep_models(board);
            }
            return;
        };
        match part {
            ReportPart::Hello => self.state.send_hello(ends_epoch, board),
            ReportPart::Channel(index) => self.state.send_channel(index, ends_epoch, board),
            ReportPart::Validation(index) => self.state.send_validation(index, board),
            ReportPart::Learned(index) => self.learn(board, index),
            ReportPart::Health => self.state.send_health(board),
        }
        self.report.advance(ends_epoch);
    }

    /// Fits a channel's model to the finished epoch, servicing everything else meanwhile, and sends the model.
    fn learn(&mut self, board: &mut impl Board, index: usize) {
        let Some(epoch) = self.state.learner.finished.take() else { return };
        let channel = EpochChannel { epoch, index, scale: epoch.scale(self.state.config) };
        if let Some(regressors) = channel.estimate_regressors(&mut || self.service_during_fit(board)) {
            self.fit_model(board, channel, regressors);
        }
        self.state.learner.finished = Some(epoch);
    }

    fn fit_model(&mut self, board: &mut impl Board, channel: EpochChannel<'_>, regressors: Regressors) {
        let mut fit = EpochFit::new(regressors);
        if fit.run(channel, &mut || self.service_during_fit(board)) {
            self.state.learner.learn(&fit, channel.epoch, channel.index);
            send(board, MessageRef::Learned(&fit.message(channel.index, channel.epoch.number)));
        }
    }

    /// Services everything except reports and tables. False cancels the fit, after a reset of the statistics.
    fn service_during_fit(&mut self, board: &mut impl Board) -> bool {
        self.service(board);
        if self.flush(board) {
            self.console.send_quick_line(&self.state, board);
        }
        self.report.ends_epoch()
    }
}

/// Reads stored settings, if any, and models (into `learner`).
#[inline(never)]
fn read_stored(board: &mut impl Board, learner: &mut Learner) -> Option<StoredSettings> {
    let mut record = [0; MAX_RECORD];
    let length = board.read_record(&mut record)?;
    let (settings, models) = stored_state::decode_settings(record.get(..length)?)?;
    stored_state::decode_models(models, &mut learner.models).then_some(settings)
}

/// The answer to a request to write the record.
fn written(result: Result<u64, StoreError>, done: &str) -> TextLine {
    match result {
        Ok(us) => text!("{done}; not sampled for {} ms", us.div_ceil(1000)),
        Err(error) => text!("not written: {error}"),
    }
}
