//! The application's main loop: commands, care for the sensor, epochs, and what is kept over a restart.

mod answer;
mod epoch;
mod report;

use crate::board::Board;
use crate::command::{Command, Mistake, Parser};
use crate::epoch::Epoch;
use crate::estimators::CHANNELS;
use crate::last_words::line;
use crate::retained::{Retained, Settings};
use crate::sensor::{Identity, auto_null, bring_up};
use adis16405_driver::{ClockMode, Config, GyroRange, SamplePeriod, TimeBase};
use answer::Answer;
use core::fmt::Arguments;
use epoch::School;
use heapless::Deque;
use link::{Boot, Line, MessageRef};
use report::{Report, sums};

/// What a board knows when it starts the application.
pub struct Start {
    /// Serial clock of the sensor's bus that was really set, in Hz.
    pub spi_clock_hz: u32,
    /// Why the microcontroller started, and its last words.
    pub boot: Boot,
    /// What survived the start.
    pub retained: Retained,
    /// Memory for what an epoch leaves.
    pub finished: &'static mut Epoch,
}

/// Configuration of a first start: 204.8 samples a second, ±300 °/s, no filter.
pub const FIRST_CONFIG: Config = {
    let Ok(period) = SamplePeriod::from_divisor(TimeBase::Fast, 8) else { panic!("divisor") };
    let Ok(config) = Config::new(GyroRange::Dps300, 0, period) else { panic!("filter") };
    config
};

/// Settings of a first start: a report every ten seconds, no epochs.
const FIRST: Settings = Settings {
    smpl_prd: FIRST_CONFIG.sample_period().register(),
    sens_avg: FIRST_CONFIG.sens_avg(),
    epoch_s: 0,
    epoch: 0,
    interval_s: 10,
    starts: 0,
};

/// Serial clock that the sensor takes in its low-power mode, in Hz (data sheet Rev. B, page 10).
const LOW_POWER_HZ: u32 = 300_000;
/// Pause between attempts to find the sensor.
const RETRY_US: u64 = 1_000_000;
/// How long auto-null stays armed.
const ARMED_US: u64 = 10_000_000;
/// Pause between two records that are kept; all of them take ten times as long.
const KEEP_US: u64 = 100_000;
/// Lines of text that may wait for room.
const LINES: usize = 4;
/// Answers that may wait for one another.
const ANSWERS: usize = 4;

/// The state of the main loop.
pub struct App {
    spi_clock_hz: u32,
    boot: Boot,
    retained: Retained,
    settings: Settings,
    config: Config,
    product_id: u16,
    sensor: Sensor,
    parser: Parser,
    lines: Deque<Line, LINES>,
    /// The first is being given.
    answers: Deque<Answer, ANSWERS>,
    report: Report,
    school: School,
    epoch_began_us: u64,
    next_report_us: u64,
    next_keep_us: u64,
    keep: usize,
    armed_until_us: u64,
    recoveries: u32,
    bad_commands: u32,
}

#[derive(Debug, Clone, Copy)]
enum Sensor {
    /// To be identified, tested and configured at this time.
    Sought { at_us: u64 },
    /// Sampled since this time.
    Sampled { since_us: u64 },
}

/// The configuration that registers with these values mean.
fn config(smpl_prd: u8, sens_avg: u16) -> Option<Config> {
    let range = match sens_avg >> 8 {
        0b100 => GyroRange::Dps300,
        0b010 => GyroRange::Dps150,
        0b001 => GyroRange::Dps75,
        _ => return None,
    };
    Config::new(range, sens_avg as u8, SamplePeriod::from_register(smpl_prd)?).ok()
}

impl App {
    /// Goes on with what survived, if anything did: the settings, and the statistics of each channel.
    #[inline(never)] // so that what it moves is not on everybody's stack
    pub fn new(start: Start, board: &mut impl Board) -> Self {
        let Start { spi_clock_hz, mut boot, mut retained, finished } = start;
        let kept = retained.settings().and_then(|kept| Some((kept, config(kept.smpl_prd, kept.sens_avg)?)));
        let fresh = kept.is_none();
        let (mut settings, config) = kept.unwrap_or((FIRST, FIRST_CONFIG));
        settings.starts = settings.starts.saturating_add(1);
        boot.starts = settings.starts;
        board.estimators(|estimators| estimators.begin(config));
        for index in 0..CHANNELS.len() {
            if let Some(sums) = retained.sums(index).filter(|_| !fresh) {
                board.estimators(|estimators| estimators.resume(index, &sums));
                boot.kept_channels += 1;
            }
        }
        retained.keep_settings(settings, fresh);
        let now_us = board.now_us();
        Self {
            spi_clock_hz,
            boot,
            retained,
            settings,
            config,
            product_id: 0,
            sensor: Sensor::Sought { at_us: now_us },
            parser: Parser::default(),
            lines: Deque::new(),
            answers: Deque::new(),
            report: Report::default(),
            school: School::new(finished),
            epoch_began_us: now_us,
            next_report_us: now_us + interval_us(settings),
            next_keep_us: now_us + KEEP_US,
            keep: 0,
            armed_until_us: 0,
            recoveries: 0,
            bad_commands: 0,
        }
    }

    /// One turn: every command that has come, and at most one message. False if there is nothing more to do before the
    /// next interrupt.
    pub fn turn(&mut self, board: &mut impl Board) -> bool {
        self.attend(board);
        self.speak(board)
    }

    /// Everything that must not wait.
    fn attend(&mut self, board: &mut impl Board) {
        board.alive();
        while let Some(byte) = board.received() {
            match self.parser.push(byte) {
                Some(Ok(command)) => self.obey(command, board),
                Some(Err(mistake)) => self.refuse(mistake, board),
                None => {}
            }
        }
        self.watch(board);
        self.keep(board);
        self.look_at_clock(board);
    }

    #[inline(never)] // so that its stack is not everybody's
    fn obey(&mut self, command: Command, board: &mut impl Board) {
        let now_us = board.now_us();
        match command {
            Command::Help => self.ask(board, Answer::help()),
            Command::Table => self.ask(board, Answer::table()),
            Command::Faults => self.ask(board, Answer::faults()),
            Command::Status => self.ask(board, Answer::status()),
            Command::Version => self.say(board, format_args!("{}", answer::VERSION_LINE)),
            Command::Report => self.report.start(),
            Command::ResetStatistics => {
                self.forget(board);
                self.recoveries = 0;
                self.bad_commands = 0;
                self.say(board, format_args!("statistics forgotten"));
            }
            Command::Rate(millihertz) => match SamplePeriod::nearest(f64::from(millihertz) / 1000.0) {
                Ok(period) => {
                    self.configure(board, Config::new(self.config.range(), self.config.filter_taps_log2(), period));
                }
                Err(error) => self.say(board, format_args!("{error}")),
            },
            Command::Range(range) => {
                let taps = self.config.filter_taps_log2().max(range.min_filter_taps_log2());
                self.configure(board, Config::new(range, taps, self.config.sample_period()));
            }
            Command::Filter(taps) => {
                self.configure(board, Config::new(self.config.range(), taps, self.config.sample_period()));
            }
            Command::Epoch(seconds) => {
                self.settings.epoch_s = seconds;
                self.retained.keep_settings(self.settings, false);
                self.say(
                    board,
                    format_args!("epoch of {seconds} s; this one began {} s ago", self.epoch_age_s(now_us)),
                );
            }
            Command::Interval(seconds) => {
                self.settings.interval_s = seconds;
                self.next_report_us = now_us + interval_us(self.settings);
                self.retained.keep_settings(self.settings, false);
                self.say(board, format_args!("reports every {seconds} s"));
            }
            Command::Raw(on) => {
                board.estimators(|estimators| estimators.set_raw(on));
                self.say(board, format_args!("stream of raw bursts {}", if on { "on" } else { "off" }));
            }
            Command::SelfTest => {
                board.sample(false);
                self.sensor = Sensor::Sought { at_us: now_us };
            }
            Command::ArmNull => {
                self.armed_until_us = now_us + ARMED_US;
                self.say(board, format_args!("keep the sensor still; null within 10 s nulls its bias"));
            }
            Command::Null => self.null(board, now_us),
            Command::Restart => {
                (0..CHANNELS.len()).for_each(|index| self.keep_channel(board, index));
                board.restart();
            }
        }
    }

    fn refuse(&mut self, mistake: Mistake, board: &mut impl Board) {
        self.bad_commands = self.bad_commands.saturating_add(1);
        match mistake {
            Mistake::Unknown(byte) => {
                let key = char::from(byte).escape_default();
                self.say(board, format_args!("{key} is no command; ? lists them"));
            }
            Mistake::Line(letter) => {
                self.say(board, format_args!("no such {} command; ? lists them", char::from(letter)));
            }
        }
    }

    fn configure(&mut self, board: &mut impl Board, config: Result<Config, adis16405_driver::ConfigError>) {
        let config = match config {
            Ok(config) => config,
            Err(error) => return self.say(board, format_args!("{error}")),
        };
        let low_power = config.sample_period().clock_mode() == ClockMode::LowPower;
        if low_power && self.spi_clock_hz > LOW_POWER_HZ {
            let clock_hz = self.spi_clock_hz;
            return self.say(
                board,
                format_args!("below 182 SPS the sensor takes a serial clock of {LOW_POWER_HZ} Hz, not {clock_hz} Hz"),
            );
        }
        board.sample(false);
        self.config = config;
        self.settings.smpl_prd = config.sample_period().register();
        self.settings.sens_avg = config.sens_avg();
        self.forget(board);
        board.estimators(|estimators| estimators.begin(config));
        self.sensor = Sensor::Sought { at_us: board.now_us() };
        self.say(board, format_args!("statistics forgotten: the sensor is configured anew"));
    }

    fn null(&mut self, board: &mut impl Board, now_us: u64) {
        if now_us >= core::mem::take(&mut self.armed_until_us) {
            return self.say(board, format_args!("not armed: arm first, then null within 10 s"));
        }
        board.sample(false);
        self.sensor = Sensor::Sought { at_us: now_us };
        let done = auto_null(board.bus(), self.config).map_err(|error| line(format_args!("{error}")));
        match done {
            Ok(()) => {
                self.forget(board);
                self.say(board, format_args!("bias nulled, statistics forgotten"));
            }
            Err(error) => self.say(board, format_args!("bias not nulled: {error}")),
        }
    }

    /// Finds the sensor, and finds out when it is lost.
    #[inline(never)]
    fn watch(&mut self, board: &mut impl Board) {
        let now_us = board.now_us();
        match self.sensor {
            Sensor::Sought { at_us } if now_us >= at_us => self.seek(board),
            Sensor::Sought { .. } => {}
            Sensor::Sampled { since_us } => {
                let (doubtful, silent) =
                    board.estimators(|estimators| (estimators.is_doubtful(), estimators.is_silent_at(now_us)));
                if doubtful || silent {
                    self.recoveries = self.recoveries.saturating_add(1);
                    let what = if silent { "no data-ready edges" } else { "silent, stuck or out of step" };
                    self.log(board, format_args!("sensor: {what}; seeking it"));
                    board.sample(false);
                    self.sensor = Sensor::Sought { at_us: now_us.max(since_us + RETRY_US) };
                }
            }
        }
    }

    fn seek(&mut self, board: &mut impl Board) {
        let found = bring_up(board.bus(), self.config).map_err(|trouble| line(format_args!("{trouble}")));
        let now_us = board.now_us();
        match found {
            Ok(Identity { product, tested, diagnosis }) => {
                self.product_id = product.prod_id();
                let test = if tested { "passed" } else { "did not run" };
                let (product, diagnosis) = (self.product_id, diagnosis.bits());
                self.log(board, format_args!("sensor: ADIS{product}, self-test {test}, DIAG_STAT {diagnosis:#06x}"));
                board.estimators(|estimators| estimators.trust(now_us));
                board.sample(true);
                self.sensor = Sensor::Sampled { since_us: now_us };
            }
            Err(trouble) => {
                self.log(board, format_args!("sensor: {trouble}; trying again"));
                self.sensor = Sensor::Sought { at_us: now_us + RETRY_US };
            }
        }
    }

    /// Keeps one record now and then, so that a restart costs a second of statistics.
    fn keep(&mut self, board: &mut impl Board) {
        let now_us = board.now_us();
        // The finished epoch has its place as long as it is needed.
        if now_us >= self.next_keep_us && !self.report.is_closing() {
            self.next_keep_us = now_us + KEEP_US;
            self.keep = (self.keep + 1) % CHANNELS.len();
            self.keep_channel(board, self.keep);
        }
    }

    fn keep_channel(&mut self, board: &mut impl Board, index: usize) {
        self.retained.keep_sums(index, &sums(board, index));
    }

    fn look_at_clock(&mut self, board: &mut impl Board) {
        let now_us = board.now_us();
        let epoch_us = u64::from(self.settings.epoch_s) * 1_000_000;
        if epoch_us > 0 && now_us >= self.epoch_began_us + epoch_us {
            self.finish_epoch(board);
        }
        let interval_us = interval_us(self.settings);
        if interval_us > 0 && now_us >= self.next_report_us {
            // However late: one report makes up for those that were missed.
            self.next_report_us += ((now_us - self.next_report_us) / interval_us + 1) * interval_us;
            self.report.start();
        }
    }

    /// Sends what there is room for. False if nothing is left or no room.
    fn speak(&mut self, board: &mut impl Board) -> bool {
        if !self.speak_up(board) {
            return false;
        }
        self.answer(board);
        self.report(board);
        !self.answers.is_empty() || self.report.is_under_way()
    }

    /// Sends the lines that wait. False if there is no room for more.
    fn speak_up(&mut self, board: &mut impl Board) -> bool {
        while let Some(line) = self.lines.front() {
            if !board.outbox(|outbox| outbox.line(line)) {
                return false;
            }
            self.lines.pop_front();
        }
        board.outbox(|outbox| outbox.has_room())
    }

    /// A line of text, behind those that wait. The oldest gives way when there are too many.
    fn say(&mut self, board: &mut impl Board, text: Arguments<'_>) {
        let line = line(text);
        if self.lines.is_empty() && board.outbox(|outbox| outbox.line(&line)) {
            return;
        }
        if self.lines.is_full() {
            self.lines.pop_front();
        }
        let _room_was_made = self.lines.push_back(line);
    }

    /// A line in a message, for a program too.
    fn log(&mut self, board: &mut impl Board, text: Arguments<'_>) {
        let line = line(text);
        board.outbox(|outbox| outbox.send(MessageRef::Log(&line)));
    }

    fn epoch_age_s(&self, now_us: u64) -> u64 {
        (now_us - self.epoch_began_us) / 1_000_000
    }
}

fn interval_us(settings: Settings) -> u64 {
    u64::from(settings.interval_s) * 1_000_000
}
