//! Inertial columns by format, names or numbers.

use crate::columns::{
    ACCELEROMETER, AvailableColumn, COUNT, ColumnSelection, GYROSCOPE, SECOND, SensorChannels, Unit, known_by_name,
};
use crate::inspection::column_facts::{ColumnFacts, time_unit};
use crate::inspection::unit_guess::{self, UnitGuess};
use crate::rows::{TopicSensor, WholeTable, usual_unit};
use std::collections::BTreeMap;
use time_base::TimeRange;

#[derive(Debug, Clone, PartialEq)]
pub struct ColumnGuess {
    /// Or `time` or `sample`.
    pub channel: &'static str,
    pub unit: Option<&'static str>,
    pub reason: String,
}

/// Options for a sensor of a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Proposal {
    pub topic: Option<String>,
    /// Empty if the file tells.
    pub columns: Vec<String>,
    /// Empty if the file tells.
    pub units: Vec<String>,
    /// Part at rest of a moved sensor.
    pub part: Option<TimeRange>,
    /// True if `--rate` is needed.
    pub lacks_rate: bool,
    pub is_found: bool,
    /// True if a column or a unit is guessed.
    pub is_guessed: bool,
    pub sensor: Option<&'static str>,
    pub doubts: Vec<String>,
}

impl Proposal {
    /// Nothing guessed.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        !self.is_guessed && !self.lacks_rate
    }

    /// Nothing missing or doubtful.
    #[must_use]
    pub fn is_safe(&self) -> bool {
        !self.lacks_rate && self.doubts.is_empty()
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Evidence {
    User,
    Format,
    Names,
    Prefix,
    Numbers,
}

/// Channel, `time` or `sample`; position; stated unit; reason.
type Columns = Vec<(&'static str, usize, Option<Unit>, &'static str)>;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SensorGuess {
    /// May be empty.
    name: String,
    evidence: Evidence,
    columns: Columns,
    force: Option<UnitGuess>,
    rate: Option<UnitGuess>,
    time: Option<(Unit, String)>,
    is_celsius: bool,
}

const CELSIUS: &str = "degC";
const TEMPERATURES: std::ops::RangeInclusive<f64> = -40.0..=125.0;

impl SensorGuess {
    /// None without gyroscope or accelerometer.
    pub(crate) fn all(
        table: &WholeTable,
        facts: &[ColumnFacts],
        profile: &SensorChannels,
        selection: &ColumnSelection,
    ) -> Vec<Self> {
        let mut found: Vec<Self> = Self::by_user(facts, selection).into_iter().collect();
        if found.is_empty() {
            let by_format: Vec<Self> = table.sensors.iter().map(|sensor| Self::of_format(sensor, facts)).collect();
            let by_names = Self::by_names(facts);
            // Several groups of arrays.
            let channels = |of: &[Self]| of.iter().map(|sensor| sensor.inertial().count()).max().unwrap_or(0);
            let is_more = table.is_of_arrays && channels(&by_names) > channels(&by_format);
            found = if by_format.is_empty() || is_more { by_names } else { by_format };
        }
        if found.is_empty() {
            found = Self::by_numbers(facts, &table.name).into_iter().collect();
        } else if table.rate_hz.is_none() {
            found.iter_mut().for_each(|sensor| sensor.add_clock(facts));
        }
        let has_numbers = |&(_, at, ..): &(_, usize, _, _)| facts[at].values.iter().any(|value| value.is_finite());
        found.retain(|sensor| sensor.columns.iter().any(|of| !["time", "sample"].contains(&of.0) && has_numbers(of)));
        found.into_iter().map(|sensor| sensor.with_units(facts, profile, selection)).collect()
    }

    fn new(name: &str, evidence: Evidence, columns: Columns) -> Self {
        Self { name: name.to_owned(), evidence, columns, force: None, rate: None, time: None, is_celsius: false }
    }

    /// And the time, seldom named.
    fn by_user(facts: &[ColumnFacts], selection: &ColumnSelection) -> Option<Self> {
        let available: Vec<AvailableColumn> = facts.iter().map(|of| of.column.clone()).collect();
        let mut assigned = selection.assignments(&available);
        let named = known_by_name(&available).unwrap_or_default();
        let time = named.into_iter().find(|(channel, _)| *channel == "time");
        assigned.extend(time.filter(|_| !assigned.iter().any(|(channel, _)| *channel == "time")));
        let columns = assigned.into_iter().map(|(channel, at)| (channel, at, facts[at].column.unit, "")).collect();
        Some(Self::new("", Evidence::User, columns)).filter(Self::is_inertial)
    }

    fn of_format(sensor: &TopicSensor, facts: &[ColumnFacts]) -> Self {
        let column = |&(channel, at, unit): &(&'static str, usize, Option<Unit>)| {
            (channel, at, unit.or(facts[at].column.unit), "")
        };
        Self::new(&sensor.name, Evidence::Format, sensor.columns.iter().map(column).collect())
    }

    fn by_names(facts: &[ColumnFacts]) -> Vec<Self> {
        let available: Vec<AvailableColumn> = facts.iter().map(|of| of.column.clone()).collect();
        let unit = |at: usize| facts[at].column.unit;
        if let Some(named) = known_by_name(&available) {
            let columns: Columns = named.into_iter().map(|(channel, at)| (channel, at, unit(at), "")).collect();
            return Some(Self::new("", Evidence::Names, columns)).filter(Self::is_inertial).into_iter().collect();
        }
        let mut groups: BTreeMap<&str, Vec<(&'static str, usize)>> = BTreeMap::new();
        for (at, column) in available.iter().enumerate() {
            if let Some((prefix, channel)) = column.prefix_and_channel() {
                let group = groups.entry(prefix).or_default();
                if !group.iter().any(|(known, _)| *known == channel) {
                    group.push((channel, at));
                }
            }
        }
        // Times belong to all.
        let common = groups.remove("").unwrap_or_default();
        let mut groups: Vec<Vec<(&'static str, usize)>> = groups.into_values().collect();
        // In the order of the table: by their names imu10 would precede imu2.
        groups.sort_by_key(|own| own.first().map(|(_, at)| *at));
        let of_group = |own: &Vec<(&'static str, usize)>| {
            let is_new = |(channel, _): &&(&'static str, usize)| !own.iter().any(|(known, _)| known == channel);
            let all =
                common.iter().filter(|(channel, _)| matches!(*channel, "time" | "sample")).filter(is_new).chain(own);
            let columns = all.map(|&(channel, at)| (channel, at, unit(at), "")).collect();
            Some(Self::new("", Evidence::Prefix, columns)).filter(Self::is_inertial)
        };
        let of_common = common.iter().map(|&(channel, at)| (channel, at, unit(at), "")).collect();
        let of_common = Some(Self::new("", Evidence::Prefix, of_common)).filter(Self::is_inertial);
        of_common.into_iter().chain(groups.iter().filter_map(of_group)).collect()
    }

    /// By name, or growing evenly.
    fn clock(facts: &[ColumnFacts]) -> Option<(usize, &'static str)> {
        let named = facts.iter().position(|of| of.column.is_time()).map(|at| (at, ""));
        let is_clock = |at: &usize| facts[*at].is_clock() && !facts[*at].is_counter();
        let is_called = |at: &usize| facts[*at].column.name.to_lowercase().contains("time");
        let clocks: Vec<usize> = if named.is_none() { (0..facts.len()).filter(is_clock).collect() } else { Vec::new() };
        let clock = clocks.iter().copied().find(is_called).or(clocks.first().copied());
        named.or(clock.map(|at| (at, "it grows evenly")))
    }

    fn add_clock(&mut self, facts: &[ColumnFacts]) {
        let is_known = ["time", "sample"].iter().any(|channel| self.position(channel).is_some());
        if matches!(self.evidence, Evidence::Names | Evidence::Prefix)
            && !is_known
            && let Some((at, why)) = Self::clock(facts)
        {
            self.columns.push(("time", at, facts[at].column.unit, why));
            self.evidence = Evidence::Prefix;
        }
    }

    /// By numbers: time grows, gravity is the accelerometer, the smallest mean over noise the gyroscope.
    fn by_numbers(facts: &[ColumnFacts], topic: &str) -> Option<Self> {
        let mut columns: Columns = Vec::new();
        let unit = |at: usize| facts[at].column.unit;
        let clock = Self::clock(facts);
        columns.extend(clock.map(|(at, why)| ("time", at, unit(at), why)));
        let clock = clock.map(|(at, _)| at);
        let counter = (0..facts.len()).find(|at| facts[*at].is_counter() && clock != Some(*at));
        columns.extend(counter.filter(|_| clock.is_none()).map(|at| ("sample", at, None, "it grows by one")));
        let is_free = |at: usize| {
            let of = &facts[at];
            let may_be = may_be_inertial(of.column) && of.noise > 0.0 && !of.is_clock();
            may_be && clock != Some(at) && counter != Some(at)
        };
        let Triples { force, others } = Triples::find(facts, is_free);
        let first = force.into_iter().chain(others.iter().copied()).min();
        let (force, others) = match RowLabel::of(topic) {
            Some(RowLabel::Force) => (force.or(first), Vec::new()),
            Some(RowLabel::Rate) => (None, first.into_iter().collect()),
            Some(RowLabel::Other) => (None, Vec::new()),
            None => (force, others),
        };
        let against_noise = |at: usize| {
            let axes = &facts[at..at + 3];
            let norm = axes.iter().map(|axis| axis.mean * axis.mean).sum::<f64>().sqrt();
            norm / axes.iter().map(|axis| axis.noise).fold(0.0, f64::max)
        };
        let rate = others.into_iter().min_by(|one, other| against_noise(*one).total_cmp(&against_noise(*other)));
        let reason = "the three are not gravity";
        for (channels, first, reason) in [(GYROSCOPE, rate, reason), (ACCELEROMETER, force, "")] {
            let Some(first) = first else { continue };
            let axis =
                |at: usize| facts[at].column.name.to_lowercase().chars().last().and_then(|axis| "xyz".find(axis));
            let named: Vec<usize> = (first..first + 3).filter_map(axis).collect();
            let is_named = (0..3).all(|axis| named.contains(&axis));
            for (number, at) in (first..first + 3).enumerate() {
                let channel = channels[if is_named { named[number] } else { number }];
                columns.push((channel, at, unit(at), reason));
            }
        }
        columns.sort_by_key(|(channel, ..)| {
            ["time", "sample"].iter().chain(&GYROSCOPE).chain(&ACCELEROMETER).position(|known| known == channel)
        });
        Some(Self::new("", Evidence::Numbers, columns)).filter(Self::is_inertial)
    }

    /// Adds units that the file lacks.
    fn with_units(mut self, facts: &[ColumnFacts], profile: &SensorChannels, selection: &ColumnSelection) -> Self {
        let any = SensorChannels::generic();
        for (channel, _, unit, _) in &mut self.columns {
            let base = any.channel(channel).map_or(SECOND, |of| of.unit);
            *unit = selection.stated_unit(base).or(*unit);
            if unit.is_some_and(|unit| unit.base == COUNT) {
                let known = profile.channel(channel);
                *unit = known.and_then(|of| Some(Unit { factor: of.lsb?, ..Unit::parse(of.unit)? }));
            }
        }
        let lacks_unit = |channels: [&str; 3]| {
            self.columns.iter().any(|(channel, _, unit, _)| channels.contains(channel) && unit.is_none())
        };
        let of = |channels: [&str; 3]| -> Vec<&ColumnFacts> {
            channels.iter().filter_map(|channel| Some(&facts[self.position(channel)?])).collect()
        };
        let (force, rate) = (of(ACCELEROMETER), of(GYROSCOPE));
        let force_guess = unit_guess::force_unit(&force).filter(|_| lacks_unit(ACCELEROMETER));
        let force_guess = force_guess.or_else(|| {
            let reason = "the accelerometer does not show gravity in any unit; m/s^2 is taken".to_owned();
            lacks_unit(ACCELEROMETER).then_some(UnitGuess { unit: "m/s^2", reason, is_safe: false })
        });
        let own_force = self.columns.iter().find(|(channel, ..)| ACCELEROMETER.contains(channel));
        let own_force = own_force.and_then(|(_, _, unit, _)| unit.map(|unit| unit.name));
        let known_force = force_guess.as_ref().filter(|of| of.is_safe).map(|of| of.unit).or(own_force);
        let rate_guess = lacks_unit(GYROSCOPE).then(|| unit_guess::rate_unit(&rate, known_force));
        // Defaults are no guess.
        let time_guess = self.columns.iter().find(|(channel, ..)| *channel == "time").and_then(|&(_, at, unit, _)| {
            let values = facts[at].values;
            let origin = values.first().copied().unwrap_or(0.0);
            let since: Vec<f64> = values.iter().map(|value| value - origin).collect();
            let is_missing = !unit.is_some_and(|unit| unit.is_time()) && usual_unit(&since, origin).is_none();
            time_unit(values).filter(|_| is_missing)
        });
        let is_celsius = self.columns.iter().any(|(channel, at, unit, _)| {
            *channel == "temp" && unit.is_none() && TEMPERATURES.contains(&facts[*at].mean)
        });
        Self { force: force_guess, rate: rate_guess, time: time_guess, is_celsius, ..self }
    }

    fn is_inertial(&self) -> bool {
        let is_axis = |channel: &str| GYROSCOPE.contains(&channel) || ACCELEROMETER.contains(&channel);
        self.columns.iter().any(|(channel, ..)| is_axis(channel) || channel.starts_with("magn_"))
    }

    pub(crate) fn position(&self, channel: &str) -> Option<usize> {
        self.columns.iter().find(|(own, ..)| *own == channel).map(|(_, at, ..)| *at)
    }

    pub(crate) fn is_force(&self, at: usize) -> bool {
        self.columns.iter().any(|(channel, own, ..)| *own == at && ACCELEROMETER.contains(channel))
    }

    /// Positions, and size of 1 in deg/s or g if known.
    pub(crate) fn inertial(&self) -> impl Iterator<Item = (usize, Option<f64>)> {
        self.columns.iter().filter_map(|&(channel, at, unit, _)| {
            let guess = self.unit_guess(channel)?;
            let guessed = guess.filter(|of| of.is_safe).and_then(|of| Unit::parse(of.unit));
            Some((at, unit.or(guessed).map(|unit| unit.factor)))
        })
    }

    /// `None` for other channels.
    fn unit_guess(&self, channel: &str) -> Option<Option<&UnitGuess>> {
        if GYROSCOPE.contains(&channel) {
            return Some(self.rate.as_ref());
        }
        ACCELEROMETER.contains(&channel).then_some(self.force.as_ref())
    }

    pub(crate) fn guess(&self, at: usize) -> Option<ColumnGuess> {
        let &(channel, _, unit, why) = self.columns.iter().find(|(_, own, ..)| *own == at)?;
        let (guessed, reason) = match (self.unit_guess(channel).flatten(), &self.time) {
            (Some(UnitGuess { unit: guessed, reason, .. }), _) if unit.is_none() => (Some(*guessed), reason.clone()),
            (_, Some((guessed, reason))) if channel == "time" => (Some(guessed.name), reason.clone()),
            _ if channel == "temp" && self.is_celsius => (Some(CELSIUS), "a temperature of a sensor".to_owned()),
            _ => (None, String::new()),
        };
        let reason = [why, reason.as_str()].into_iter().filter(|text| !text.is_empty()).collect::<Vec<_>>().join("; ");
        Some(ColumnGuess { channel, unit: guessed, reason })
    }

    pub(crate) fn proposal(&self, table: &WholeTable, facts: &[ColumnFacts], has_rate: bool) -> Proposal {
        let is_needed = |(channel, _, unit, _): &(&str, usize, Option<Unit>, &str)| {
            let is_axis = GYROSCOPE.contains(channel) || ACCELEROMETER.contains(channel);
            let is_known = unit.is_some() || *channel == "temp" && self.is_celsius;
            is_axis || matches!(*channel, "time" | "sample") || is_known
        };
        let mut proposal = Proposal { lacks_rate: !has_rate, ..Proposal::default() };
        let is_part = table.is_of_arrays && self.evidence == Evidence::Names;
        if matches!(self.evidence, Evidence::Prefix | Evidence::Numbers) || is_part {
            let assigned = self.columns.iter().filter(|column| is_needed(column));
            let assignment =
                |(channel, at, ..): &(&str, usize, Option<Unit>, &str)| format!("{channel}={}", facts[*at].column.name);
            proposal.columns = assigned.map(assignment).collect();
        }
        let topic = if self.evidence == Evidence::Format { &self.name } else { &table.name };
        proposal.topic = Some(topic.clone()).filter(|topic| !topic.is_empty());
        proposal.is_found = matches!(self.evidence, Evidence::Format | Evidence::Names | Evidence::User);
        let has_guess = self.rate.is_some() || self.force.is_some() || self.time.is_some();
        proposal.is_guessed = has_guess || self.evidence == Evidence::Numbers;
        proposal.units.extend(self.time.as_ref().map(|(unit, _)| unit.name.to_owned()));
        let lacks_force = self.position(ACCELEROMETER[0]).is_none();
        let is_told = matches!(RowLabel::of(&table.name), Some(RowLabel::Rate));
        if self.evidence == Evidence::Numbers
            && lacks_force
            && !is_told
            && self.rate.as_ref().is_none_or(|rate| rate.is_safe)
        {
            proposal.doubts.push("nothing but their place says that the three columns are rates".to_owned());
        }
        proposal.units.extend(self.is_celsius.then(|| CELSIUS.to_owned()));
        for guess in self.rate.iter().chain(&self.force) {
            proposal.units.push(guess.unit.to_owned());
            proposal.doubts.extend(Some(guess.reason.clone()).filter(|_| !guess.is_safe));
        }
        proposal
    }
}

enum RowLabel {
    Force,
    Rate,
    Other,
}

impl RowLabel {
    fn of(topic: &str) -> Option<Self> {
        let plain = topic.to_lowercase();
        let begins = |names: &[&str]| names.iter().any(|name| plain.starts_with(name));
        match () {
            () if begins(&["acc", "lin_acc", "linacc"]) => Some(Self::Force),
            () if begins(&["gyr", "ang", "rate", "rot"]) => Some(Self::Rate),
            () if begins(&["mag", "gps", "gnss", "baro", "pres", "temp", "light", "ori", "ahrs"]) => Some(Self::Other),
            () => None,
        }
    }
}

const OTHER_NAMES: &str = "lat lon alt easting northing quality yaw pitch roll heading speed press humid volt current batt covariance \
    orientation quat magnetic position temp delta";

fn may_be_inertial(column: &AvailableColumn) -> bool {
    let name = column.name.to_lowercase();
    let unit = column.unit.is_none_or(|unit| ["deg/s", "g", COUNT].contains(&unit.base));
    // `q0` and `qw` are a quaternion's.
    let is_of_quaternion = name.len() == 2 && name.starts_with('q');
    unit && !is_of_quaternion && !OTHER_NAMES.split(' ').any(|other| name.contains(other))
}

/// Over the longest.
const LONGEST: f64 = 0.9;
/// For one sensor's axes.
const MOST_UNLIKE: f64 = 10.0;

struct Triples {
    force: Option<usize>,
    others: Vec<usize>,
}

impl Triples {
    fn find(facts: &[ColumnFacts], is_free: impl Fn(usize) -> bool) -> Self {
        let unlike = |at: usize| {
            let noises = || facts[at..at + 3].iter().map(|of| of.noise);
            noises().fold(0.0, f64::max) / noises().fold(f64::INFINITY, f64::min)
        };
        let mut runs: Vec<std::ops::Range<usize>> = Vec::new();
        let mut start = 0;
        while start < facts.len() {
            let length = (start..facts.len()).take_while(|at| is_free(*at)).count();
            runs.push(start..start + length);
            start += length + 1;
        }
        let all = |run: &std::ops::Range<usize>| {
            (run.start..(run.end + 1).saturating_sub(3).max(run.start))
                .filter(|at| unlike(*at) < MOST_UNLIKE)
                .collect::<Vec<_>>()
        };
        let axes = |at: usize| [&facts[at], &facts[at + 1], &facts[at + 2]];
        let length = |at: usize| unit_guess::usual_length(&axes(at));
        let is_gravity = |at: &usize| unit_guess::force_unit(&axes(*at)).is_some();
        let gravity: Vec<usize> = runs.iter().flat_map(all).filter(is_gravity).collect();
        // 9.8 is no bias, 1 may be.
        let longest = gravity.iter().map(|at| length(*at)).fold(0.0, f64::max);
        // Most others left, then most alike.
        let division = |at: usize| {
            let run = runs.iter().find(|run| run.contains(&at)).cloned().unwrap_or_default();
            let threes: Vec<usize> =
                (run.start..(run.end + 1).saturating_sub(3)).filter(|other| other.abs_diff(at) % 3 == 0).collect();
            let unlike: f64 = threes.iter().map(|at| unlike(*at).ln()).sum();
            (threes.len(), unlike / threes.len().max(1) as f64)
        };
        let force = gravity.into_iter().filter(|at| length(*at) > LONGEST * longest).min_by(|one, other| {
            let (one, other) = (division(*one), division(*other));
            other.0.cmp(&one.0).then(one.1.total_cmp(&other.1))
        });
        let mut others = Vec::new();
        for run in runs {
            let parts = match force.filter(|at| run.contains(at)) {
                Some(at) => vec![run.start..at, at + 3..run.end],
                None => vec![run],
            };
            for part in parts.into_iter().filter(|part| part.len() >= 3) {
                let of_offset = |offset: usize| (part.start + offset..part.end - 2).step_by(3).collect::<Vec<_>>();
                let cost = |triples: &Vec<usize>| triples.iter().map(|at| unlike(*at).ln()).sum::<f64>();
                let offsets = (0..=part.len() % 3).map(of_offset);
                let best = offsets.min_by(|one, other| cost(one).total_cmp(&cost(other))).unwrap_or_default();
                others.extend(best.into_iter().filter(|at| unlike(*at) < MOST_UNLIKE));
            }
        }
        Self { force, others }
    }
}
