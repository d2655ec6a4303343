//! The columns of channels, time and index with their units, as the user says or by their names.

use crate::columns;
use crate::columns::{COUNT, INERTIAL, Printable, ReadingNote, SECOND, SensorChannel, SensorChannels, Unit};

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Role {
    Time,
    /// Running number of a sample.
    Index,
    Channel(SensorChannel),
}

impl Role {
    fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Index => "sample",
            Self::Channel(channel) => channel.name,
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct AvailableColumn {
    /// Its name in the file, or its number, from 0.
    pub(crate) name: String,
    pub(crate) unit: Option<Unit>,
}

pub(crate) fn as_they_are(available: &[AvailableColumn]) -> Vec<ChosenColumn> {
    let role = Role::Channel(SensorChannel { name: "", unit: "V", lsb: None });
    let column = |(position, column): (usize, &AvailableColumn)| {
        let (label, unit) = (column.name.clone(), column.unit);
        ChosenColumn { position, role, label, unit, factor: 1.0 }
    };
    available.iter().enumerate().map(column).collect()
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ChosenColumn {
    /// Position among the available columns.
    pub(crate) position: usize,
    pub(crate) role: Role,
    pub(crate) label: String,
    /// `None` for times without a stated unit.
    pub(crate) unit: Option<Unit>,
    /// Size of 1 in the unit of the channel.
    pub(crate) factor: f64,
}

/// Why columns cannot be chosen.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SelectionError {
    #[error("no column is named like a channel; say which is which, as in --columns gyro_x=NAME; the file has {0}")]
    NoChannel(String),
    #[error("{0}")]
    Other(String),
}

fn ambiguous(channel: &str, one: &str, other: &str) -> SelectionError {
    SelectionError::Other(format!("{channel} is both {one} and {other}: say which with --columns"))
}

/// The columns as the user states them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ColumnSelection {
    assignments: Vec<(String, String)>,
    units: Vec<Unit>,
    has_no_time: bool,
    /// Columns that no note needs to name.
    read_by_others: Vec<String>,
}

impl ColumnSelection {
    /// From assignments such as `gyro_x=wx`, and a unit for each quantity.
    ///
    /// # Errors
    /// A text that is no assignment, or an unknown or a second unit of a quantity.
    pub fn parse(columns: &[String], units: &[String]) -> Result<Self, SelectionError> {
        let assignment = |text: &String| match text.split_once('=') {
            Some((channel, column)) if !channel.trim().is_empty() && !column.trim().is_empty() => {
                Ok((channel.trim().to_owned(), column.trim().to_owned()))
            }
            _ => Err(SelectionError::Other(format!("--columns {text}: expected CHANNEL=COLUMN, such as gyro_x=wx"))),
        };
        let assignments: Vec<(String, String)> = columns.iter().map(assignment).collect::<Result<_, _>>()?;
        let mut known: Vec<Unit> = Vec::new();
        for text in units {
            let unit = Unit::parse(text).ok_or_else(|| {
                let known = Unit::names().collect::<Vec<_>>().join(", ");
                SelectionError::Other(format!("--units {text}: not a known unit; known are {known}"))
            })?;
            if let Some(other) = known.iter().find(|other| other.base == unit.base) {
                let told = format!("--units {} and {} are of one quantity", other.name, unit.name);
                return Err(SelectionError::Other(told));
            }
            known.push(unit);
        }
        Ok(Self { assignments, units: known, ..Self::default() })
    }

    /// The same, without a column of times.
    #[must_use]
    pub fn without_time(self) -> Self {
        Self { has_no_time: true, ..self }
    }

    /// The same, of one of several sensors: `columns` are read by the others, and are not noted as left out.
    #[must_use]
    pub fn beside(self, columns: Vec<String>) -> Self {
        Self { read_by_others: columns, ..self }
    }

    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.assignments.is_empty() && self.units.is_empty()
    }

    /// Assigned channels, `time` and `sample`, each with its column's position in `available`.
    pub(crate) fn assignments(&self, available: &[AvailableColumn]) -> Vec<(&'static str, usize)> {
        let sensor = SensorChannels::generic();
        let assigned = self.assigned(available, &sensor).unwrap_or_default();
        assigned.into_iter().map(|(role, position)| (role.name(), position)).collect()
    }

    pub(crate) fn stated_unit(&self, base: &str) -> Option<Unit> {
        self.units.iter().copied().find(|unit| unit.base == base)
    }

    pub(crate) fn has_columns(&self) -> bool {
        !self.assignments.is_empty()
    }

    pub(crate) fn has_units(&self) -> bool {
        !self.units.is_empty()
    }

    /// True if every named column is in `available`.
    pub(crate) fn is_covered(&self, available: &[AvailableColumn]) -> bool {
        self.assignments.iter().all(|(_, wanted)| available.iter().any(|column| column.name == *wanted))
    }

    /// Time, index, and the channels in the order of `sensor`.
    pub(crate) fn choose(
        &self,
        available: &[AvailableColumn],
        sensor: &SensorChannels,
    ) -> Result<Vec<ChosenColumn>, SelectionError> {
        let mut chosen = if self.assignments.is_empty() {
            by_name(available, sensor)?
        } else {
            let mut assigned = self.assigned(available, sensor)?;
            if !assigned.iter().any(|(role, _)| *role == Role::Time) {
                // Time is seldom named, and seldom ambiguous.
                assigned.extend(by_name(available, sensor).ok().and_then(|named| {
                    named.into_iter().find(|(role, column)| {
                        *role == Role::Time && !assigned.iter().any(|(_, other)| other == column)
                    })
                }));
            }
            assigned
        };
        chosen.retain(|(role, _)| *role != Role::Time || !self.has_no_time);
        if !chosen.iter().any(|(role, _)| matches!(role, Role::Channel(_))) {
            return Err(SelectionError::NoChannel(names(available)));
        }
        if self.assignments.is_empty() {
            let left_out = self.unitless_companions(&chosen, available);
            chosen.retain(|(_, position)| !left_out.contains(position));
        }
        chosen.sort_by_key(|(role, _)| match role {
            Role::Time => 0,
            Role::Index => 1,
            Role::Channel(own) => 2 + sensor.channels.iter().position(|channel| channel.name == own.name).unwrap_or(0),
        });
        chosen.into_iter().map(|(role, position)| self.with_unit(role, position, &available[position])).collect()
    }

    /// Unitless columns of other quantities, by positions: a magnetometer or thermometer is no reason to ask.
    fn unitless_companions(&self, chosen: &[(Role, usize)], available: &[AvailableColumn]) -> Vec<usize> {
        let channel = |role: &Role| if let Role::Channel(channel) = role { Some(*channel) } else { None };
        if !chosen.iter().any(|(role, _)| channel(role).is_some_and(SensorChannel::is_inertial)) {
            return Vec::new();
        }
        let is_unitless = |(role, position): &(Role, usize)| {
            channel(role).is_some_and(|channel| {
                let stated = self.stated_unit(channel.unit).or_else(|| self.stated_unit(COUNT));
                !channel.is_inertial() && available[*position].unit_of(channel).or(stated).is_none()
            })
        };
        chosen.iter().copied().filter(is_unitless).map(|(_, position)| position).collect()
    }

    /// Notes on the columns that are not `chosen`, and on units by name.
    pub(crate) fn notes(
        &self,
        available: &[AvailableColumn],
        chosen: &[ChosenColumn],
        sensor: &SensorChannels,
    ) -> Vec<ReadingNote> {
        // Positions may be those of a whole row.
        let is_used = |at: &usize| chosen.iter().any(|column| column.label == available[*at].name);
        if !self.assignments.is_empty() {
            let is_other = |name: &&String| !self.read_by_others.contains(name);
            let others = available.iter().enumerate().filter(|(at, _)| !is_used(at)).map(|(_, column)| &column.name);
            let others = others.filter(is_other).cloned().collect();
            return ReadingNote::on_columns(others, "left out: --columns does not name it").into_iter().collect();
        }
        let named = by_name(available, sensor).unwrap_or_default();
        let unitless = self.unitless_companions(&named, available);
        let (mut no_channel, mut other_unit) = (Vec::new(), Vec::new());
        let is_ignored = |at: &usize| self.has_no_time && named.contains(&(Role::Time, *at));
        let is_left_out = |at: &usize| !is_used(at) && !unitless.contains(at) && !is_ignored(at);
        for (_, column) in available.iter().enumerate().filter(|(at, _)| is_left_out(at)) {
            match (sensor.channel(&column.name).or_else(|| column.channel(sensor)), column.unit) {
                (Some(_), Some(unit)) => other_unit.push(format!("{} in {}", column.name, unit.name)),
                _ => no_channel.push(column.name.clone()),
            }
        }
        let has_no_name = |column: &&ChosenColumn| {
            let position = available.iter().position(|of| of.name == column.label);
            position.is_some_and(|position| role_by_name(available, position, sensor).is_none())
        };
        let labels = |is_one: &dyn Fn(&&ChosenColumn) -> bool| -> Vec<String> {
            chosen.iter().filter(is_one).map(|column| column.label.clone()).collect()
        };
        let unitless = unitless.iter().map(|&at| available[at].name.clone()).collect();
        let by_interface = labels(&|column| self.unit_of_interface(column).is_some());
        let notes = [
            (unitless, "left out: no unit; --units gives one"),
            (other_unit, "left out: a unit of another quantity than the name; --columns reads it"),
            (no_channel, "left out: no known name of a channel; --columns reads it"),
            (labels(&has_no_name), "are axes of a sensor by their unit; --columns says otherwise"),
            (
                by_interface,
                "taken to be in the units of the industrial I/O interface of Linux, rad/s, m/s^2 and gauss; --units says otherwise",
            ),
        ];
        notes.into_iter().filter_map(|(columns, statement)| ReadingNote::on_columns(columns, statement)).collect()
    }

    fn unit_of_interface(&self, column: &ChosenColumn) -> Option<Unit> {
        let Role::Channel(channel) = column.role else { return None };
        let is_stated = self.stated_unit(channel.unit).is_some();
        unit_by_interface(&column.label, channel.unit).filter(|unit| !is_stated && column.unit == Some(*unit))
    }

    fn assigned(
        &self,
        available: &[AvailableColumn],
        sensor: &SensorChannels,
    ) -> Result<Vec<(Role, usize)>, SelectionError> {
        let mut assigned: Vec<(Role, usize)> = Vec::new();
        for (name, wanted) in &self.assignments {
            let role = match name.as_str() {
                "time" => Role::Time,
                "sample" => Role::Index,
                _ => sensor.channel(name).map(Role::Channel).ok_or_else(|| {
                    let known = sensor.channels.iter().map(|channel| channel.name).collect::<Vec<_>>().join(", ");
                    SelectionError::Other(format!(
                        "--columns {name}=…: no such channel; {} has {known}, and there are time and sample",
                        sensor.name
                    ))
                })?,
            };
            // As printed, which escapes letters of an unknown encoding.
            let is_named = |column: &AvailableColumn| {
                column.name == *wanted || wanted.contains('\\') && Printable(&column.name).to_string() == *wanted
            };
            let by_name = available.iter().position(is_named);
            let heading = AvailableColumn::from_heading(wanted);
            let position = by_name
                .or_else(|| available.iter().position(|column| *column == heading))
                .ok_or_else(|| format!("no column {wanted}; the file has {}", names(available)))
                .map_err(SelectionError::Other)?;
            if let Some((_, other)) = assigned.iter().find(|(known, _)| *known == role) {
                return Err(ambiguous(name, &available[*other].name, wanted));
            }
            assigned.push((role, position));
        }
        Ok(assigned)
    }

    fn with_unit(&self, role: Role, position: usize, column: &AvailableColumn) -> Result<ChosenColumn, SelectionError> {
        let stated = |base: &str| self.stated_unit(base);
        let (unit, factor) = match role {
            Role::Index => (None, 1.0),
            Role::Time => (stated(SECOND).or(column.unit.filter(|unit| unit.base == SECOND)), 1.0),
            Role::Channel(channel) => {
                let (name, example) = (&column.name, channel.unit);
                let none = || format!("column {name}: no unit of {}; give one, as in --units {example}", channel.name);
                let own = || column.unit_of_file(channel).or_else(|| stated(COUNT)).or_else(|| column.unit_of(channel));
                let unit = stated(example).or_else(own).ok_or_else(|| SelectionError::Other(none()))?;
                let told = || format!("column {name}: counts of which sensor? give its profile with --sensor");
                let factor = if unit.base == COUNT { channel.lsb } else { Some(unit.factor) };
                (Some(unit), factor.ok_or_else(|| SelectionError::Other(told()))?)
            }
        };
        Ok(ChosenColumn { position, role, label: column.name.clone(), unit, factor })
    }
}

/// The recording as the user states it.
#[derive(Debug, Clone, PartialEq)]
pub struct RowOptions {
    pub sensor: SensorChannels,
    pub selection: ColumnSelection,
    pub topic: Option<String>,
}

impl RowOptions {
    /// Defaults for `sensor`.
    #[must_use]
    pub fn of_sensor(sensor: SensorChannels) -> Self {
        Self { sensor, selection: ColumnSelection::default(), topic: None }
    }

    pub(crate) fn choose(&self, available: &[AvailableColumn]) -> Result<Vec<ChosenColumn>, SelectionError> {
        self.selection.choose(available, &self.sensor)
    }
}

impl AvailableColumn {
    /// From a heading that may end in a unit: `ax [m/s^2]`, `wx (rad/s)`, `gyro x, deg/s`, `gyro_x_deg_s`, `time_us`.
    pub(crate) fn from_heading(heading: &str) -> Self {
        let heading = heading.trim().trim_start_matches(['#', '%']).trim();
        if let Some((name, unit)) = heading.rsplit_once(',')
            && let Some(unit) = Unit::parse(unit)
        {
            return Self { name: name.trim().to_owned(), unit: Some(unit) };
        }
        if is_output_register(heading) {
            return Self { name: heading.to_owned(), unit: Unit::parse(COUNT) };
        }
        for (open, close) in [('[', ']'), ('(', ')')] {
            let bracketed = heading.strip_suffix(close).and_then(|text| text.rsplit_once(open));
            if let Some((name, unit)) = bracketed
                && let Some(unit) = Unit::parse(unit).map(|known| gauss_of_field(name, unit).unwrap_or(known))
            {
                return Self { name: name.trim().to_owned(), unit: Some(unit) };
            }
        }
        if let Some(unit) = time_unit(heading) {
            return Self { name: heading.to_owned(), unit: Some(unit) };
        }
        // The longest ending that is a unit: `deg_s`, not `s`.
        let ends = heading.char_indices().filter(|(_, letter)| *letter == '_').map(|(at, _)| at);
        let named = ends.filter(|at| *at > 0).find_map(|at| {
            Unit::parse(&heading[at + 1..]).map(|unit| Self { name: heading[..at].to_owned(), unit: Some(unit) })
        });
        // A channel's `_min` is its least value.
        let is_of_channel = |column: &Self| matches!(role_of(&column.name), Some(NamedRole::Channel(_)));
        named
            .filter(|column| role_of(&column.name).is_some() && !(column.is_in_time() && is_of_channel(column)))
            .unwrap_or_else(|| Self { name: heading.to_owned(), unit: None })
    }

    /// A prefix and the channel, `time` or `sample` in the name.
    pub(crate) fn prefix_and_channel(&self) -> Option<(&str, &'static str)> {
        let channel = match role_of(&self.name)? {
            NamedRole::Time => return Some(("", "time")),
            NamedRole::Index => return Some(("", "sample")),
            NamedRole::Channel(name) => name,
        };
        // The shortest ending has the longest beginning before it.
        let starts = self.name.char_indices().map(|(at, _)| at).rev();
        let short = starts.filter(|at| *at > 0 && !self.name[..*at].ends_with(|letter: char| letter.is_alphanumeric()));
        let is_name =
            |at: &usize| matches!(role_of(&self.name[*at..]), Some(NamedRole::Channel(own)) if own == channel);
        Some((&self.name[..short.clone().find(is_name).unwrap_or(0)], channel))
    }

    fn channel(&self, sensor: &SensorChannels) -> Option<SensorChannel> {
        match role_of(&self.name)? {
            NamedRole::Channel(name) => sensor.channel(name),
            NamedRole::Time | NamedRole::Index => None,
        }
    }

    /// Its unit, if that suits the channel.
    fn unit_of_file(&self, channel: SensorChannel) -> Option<Unit> {
        self.unit.filter(|unit| unit.base == channel.unit || unit.base == COUNT)
    }

    /// The same, or that of its interface.
    fn unit_of(&self, channel: SensorChannel) -> Option<Unit> {
        self.unit_of_file(channel).or_else(|| unit_by_interface(&self.name, channel.unit))
    }

    fn is_in_time(&self) -> bool {
        self.unit.is_some_and(|unit| unit.base == SECOND)
    }

    pub(crate) fn is_time(&self) -> bool {
        matches!(role_of(&self.name), Some(NamedRole::Time))
    }

    /// A column whose format states it.
    pub(crate) fn known(name: &str, unit: &str) -> Self {
        Self { name: name.to_owned(), unit: Unit::parse(unit) }
    }
}

fn names(available: &[AvailableColumn]) -> String {
    const SHOWN: usize = 24;
    let shown: Vec<&str> = available.iter().take(SHOWN).map(|column| column.name.as_str()).collect();
    let more = if available.len() > SHOWN { ", …" } else { "" };
    format!("{}{more}", shown.join(", "))
}

/// The unit that names a column of times; minutes are parts of a time.
fn time_unit(heading: &str) -> Option<Unit> {
    Unit::parse(heading).filter(|unit| unit.base == SECOND && unit.factor <= 1.0 && heading.len() > 1)
}

/// `G` of a magnetic field is gauss.
fn gauss_of_field(name: &str, unit: &str) -> Option<Unit> {
    let is_field = matches!(role_of(name), Some(NamedRole::Channel(channel)) if channel.starts_with("magn"));
    Unit::parse("gauss").filter(|_| is_field && unit.trim() == "G")
}

/// True for an output register of the ADIS164xx data sheets.
pub fn is_output_register(heading: &str) -> bool {
    const OF_PART: [&str; 3] = ["SUPPLY_OUT", "TEMP_OUT", "AUX_ADC"];
    let of_axis = heading.strip_suffix("_OUT").and_then(|name| name.strip_prefix(['X', 'Y', 'Z']));
    OF_PART.contains(&heading) || of_axis.is_some_and(|name| ["GYRO", "ACCL", "MAGN"].contains(&name))
}

/// Unit in the industrial I/O interface of Linux, such as `in_anglvel_x`, without raw counts.
fn unit_by_interface(name: &str, of_channel: &str) -> Option<Unit> {
    let plain = name.to_lowercase();
    let unit = match of_channel {
        "deg/s" if plain.starts_with("in_anglvel_") => "rad/s",
        "g" if plain.starts_with("in_accel_") => "m/s^2",
        "gauss" if plain.starts_with("in_magn_") => "gauss",
        _ => return None,
    };
    if plain.ends_with("_raw") { None } else { Unit::parse(unit) }
}

/// Columns named as a channel of any sensor, `time` or `sample`, with positions; `None` if ambiguous.
pub(crate) fn known_by_name(available: &[AvailableColumn]) -> Option<Vec<(&'static str, usize)>> {
    let named = by_name(available, &SensorChannels::generic()).ok()?;
    Some(named.into_iter().map(|(role, position)| (role.name(), position)).collect())
}

fn role_by_name(available: &[AvailableColumn], position: usize, sensor: &SensorChannels) -> Option<Role> {
    let name = &available[position].name;
    let by_name = || match role_of(&numbered_from_1(available, name).unwrap_or_else(|| name.clone()))? {
        NamedRole::Time => Some(Role::Time),
        NamedRole::Index => Some(Role::Index),
        NamedRole::Channel(name) => sensor.channel(name).map(Role::Channel),
    };
    let of_body = || rate_of_body(available, position).and_then(|name| sensor.channel(name)).map(Role::Channel);
    sensor.channel(name).map(Role::Channel).or_else(by_name).or_else(of_body)
}

fn by_name(available: &[AvailableColumn], sensor: &SensorChannels) -> Result<Vec<(Role, usize)>, SelectionError> {
    let mut named: Vec<(Role, usize)> = Vec::new();
    for (position, column) in available.iter().enumerate() {
        let role = role_by_name(available, position, sensor).filter(|role| match role {
            Role::Channel(channel) => column.unit.is_none() || column.unit_of_file(*channel).is_some(),
            Role::Time | Role::Index => true,
        });
        let Some(role) = role else { continue };
        if let Some((_, other)) = named.iter().find(|(known, _)| *known == role) {
            if role == Role::Time {
                // The time of sampling, not of publishing or writing.
                if is_time_of_sample(&column.name) {
                    named.retain(|(known, _)| *known != Role::Time);
                    named.push((role, position));
                }
                continue;
            }
            if role == Role::Index {
                continue;
            }
            return Err(ambiguous(role.name(), &available[*other].name, &column.name));
        }
        named.push((role, position));
    }
    for (axes, unit) in AXES.into_iter().zip(INERTIAL) {
        if !named.iter().any(|(role, _)| matches!(role, Role::Channel(known) if known.unit == unit)) {
            let channels = axes.map(|name| sensor.channel(name));
            let by_unit = axes_by_unit(available, unit).into_iter().flatten().zip(channels);
            named.extend(by_unit.filter_map(|(at, channel)| Some((Role::Channel(channel?), at))));
        }
    }
    Ok(named)
}

/// The only three columns in a unit with this base, by the x, y and z at the end of their names.
fn axes_by_unit(available: &[AvailableColumn], base: &str) -> Option<[usize; 3]> {
    let of_unit = |column: &AvailableColumn| column.unit.is_some_and(|unit| unit.base == base);
    let own: Vec<usize> = (0..available.len()).filter(|at| of_unit(&available[*at])).collect();
    let axis = |letter: char| own.iter().copied().find(|at| available[*at].name.to_lowercase().ends_with(letter));
    Some([axis('x')?, axis('y')?, axis('z')?]).filter(|_| own.len() == 3)
}

/// The name with the number from 0, if there are the numbers 1, 2 and 3 but not 0.
fn numbered_from_1(available: &[AvailableColumn], name: &str) -> Option<String> {
    let (base, number) = name.split_at_checked(name.len().checked_sub(1)?)?;
    let has = |number: &str| available.iter().any(|other| other.name.strip_suffix(number) == Some(base));
    let from_1: u8 = number.parse().ok().filter(|number| (1..=3).contains(number))?;
    (["1", "2", "3"].into_iter().all(has) && !has("0")).then(|| format!("{base}{}", from_1 - 1))
}

/// p, q and r of aviation, if all three are there.
fn rate_of_body(available: &[AvailableColumn], position: usize) -> Option<&'static str> {
    let is_named = |column: &AvailableColumn, letter: &str| column.name.trim().eq_ignore_ascii_case(letter);
    let letters = ["p", "q", "r"];
    let has_all = letters.iter().all(|letter| available.iter().any(|column| is_named(column, letter)));
    let axis = letters.iter().position(|letter| has_all && is_named(&available[position], letter))?;
    Some(AXES[0][axis])
}

enum NamedRole {
    Time,
    Index,
    Channel(&'static str),
}

/// Usual names in small letters, `_` for other signs, without axis, between blanks.
const GYROSCOPE: &str = "gyro gy gyr gyros gyroscope gyro_rate gyrorate rot_rate rotation_rate rotationrate angularvelocity ang_vel \
    angvel w wb g omega rate angular_velocity angular_rate w_rs_s gyro_rad anglvel angular_vel angularvel \
    angularrate ang_rate angrate rotrate rotation gyroadc gyroscope_rate";
const ACCELEROMETER: &str = "accl ac fb acc accel accels accelerometer linearacceleration lin_acc linacc a acceleration \
    linear_acceleration specific_force gf a_rs_s accelerometer_m_s2 force linear_accel linearaccel specificforce \
    accsmooth accelerometer_acceleration";
const MAGNETOMETER: &str = "magn mag magnetometer m mb b magnetic_field magneticfield mag_field magfield compass";
const AXES: [[&str; 3]; 3] = [columns::GYROSCOPE, columns::ACCELEROMETER, columns::MAGNETOMETER];

/// True for the times of samples in a file with several.
fn is_time_of_sample(name: &str) -> bool {
    let name = name.to_lowercase();
    name.ends_with("stamp_sample") || name.ends_with("header.stamp") || name.starts_with("sensor")
}

fn role_of(name: &str) -> Option<NamedRole> {
    let plain: String =
        name.to_lowercase().chars().map(|letter| if letter.is_ascii_alphanumeric() { letter } else { '_' }).collect();
    let plain = plain.trim_matches('_');
    // `in_anglvel_x_raw`, `XGYRO_OUT`.
    let plain = plain.strip_prefix("in_").unwrap_or(plain);
    let plain =
        ["_raw", "_out", "_input", "_lsb"].iter().find_map(|ending| plain.strip_suffix(ending)).unwrap_or(plain);
    match plain {
        "time" | "times" | "t" | "timestamp" | "timestamps" | "time_stamp" | "stamp" | "timestamp_sample"
        | "timeus" | "elapsed" | "elapsed_time" | "x_value" => {
            return Some(NamedRole::Time);
        }
        // Named by its unit.
        _ if time_unit(plain).is_some() => return Some(NamedRole::Time),
        _ if plain.ends_with("header_stamp") || plain.ends_with("timestamp") => return Some(NamedRole::Time),
        "sample" | "packet" | "packet_counter" | "packetcounter" | "packet_number" | "packetnumber"
        | "sample_number" | "samplenumber" | "sample_index" | "sample_counter" | "samplecounter" => {
            return Some(NamedRole::Index);
        }
        "temp" | "tmp" | "temperature" => return Some(NamedRole::Channel("temp")),
        "supply" | "vdd" => return Some(NamedRole::Channel("supply")),
        "aux_adc" => return Some(NamedRole::Channel("aux_adc")),
        _ => {}
    }
    let groups = [GYROSCOPE, ACCELEROMETER, MAGNETOMETER];
    // An axis before the name: `xgyro`, `x_accel`.
    let before = plain.chars().next().and_then(|axis| "xyz".find(axis)).and_then(|axis| {
        let base = plain[1..].trim_start_matches('_');
        let group = groups.iter().position(|group| base.len() > 2 && group.split(' ').any(|known| known == base))?;
        Some(NamedRole::Channel(AXES[group][axis]))
    });
    if before.is_some() {
        return before;
    }
    let axis = plain.chars().last().and_then(|axis| "xyz".find(axis).or_else(|| "012".find(axis)))?;
    let base = plain[..plain.len() - 1].trim_end_matches('_');
    // A prefix: `imu0_gyro`, `field_angular_velocity`; not before single letters.
    let matches = |known: &str| base == known || known.len() > 2 && base.ends_with(&format!("_{known}"));
    let group = groups.iter().position(|group| group.split(' ').any(matches))?;
    Some(NamedRole::Channel(AXES[group][axis]))
}

#[cfg(test)]
mod tests {
    use super::{AvailableColumn, ColumnSelection, Role, SelectionError};
    use crate::columns::{ReadingNote, SensorChannels};

    fn sentences(notes: &[ReadingNote]) -> Vec<String> {
        notes.iter().map(ToString::to_string).collect()
    }

    fn chosen(headings: &[&str], columns: &[&str], units: &[&str]) -> Result<Vec<(String, f64)>, SelectionError> {
        let owned = |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>();
        let available: Vec<AvailableColumn> = headings.iter().map(|text| AvailableColumn::from_heading(text)).collect();
        let selection = ColumnSelection::parse(&owned(columns), &owned(units))?;
        let describe = |column: super::ChosenColumn| {
            let role = match column.role {
                Role::Time => format!("time {}", column.unit.map_or("?", |unit| unit.name)),
                Role::Index => "sample".to_owned(),
                Role::Channel(channel) => channel.name.to_owned(),
            };
            (format!("{role}={}", column.position), column.factor)
        };
        Ok(selection.choose(&available, &SensorChannels::generic())?.into_iter().map(describe).collect())
    }

    #[test]
    fn every_column_that_is_left_out_is_named_with_why() {
        let headings = ["t [s]", "gx [dps]", "gy [dps]", "gz [dps]", "cov[0]", "cov[1]", "cov[2]", "cov[4]", "state"];
        let available: Vec<AvailableColumn> = headings.iter().map(|text| AvailableColumn::from_heading(text)).collect();
        for (columns, expected) in [
            (&[][..], "cov[0…2], cov[4], state left out: no known name of a channel; --columns reads it"),
            (&["time=t", "gyro_x=gx"], "gy, gz, cov[0…2], cov[4], state left out: --columns does not name it"),
        ] {
            let columns: Vec<String> = columns.iter().map(|text| (*text).to_owned()).collect();
            let selection = ColumnSelection::parse(&columns, &[]).expect("columns");
            let sensor = SensorChannels::generic();
            let chosen = selection.choose(&available, &sensor).expect("columns");
            assert_eq!(sentences(&selection.notes(&available, &chosen, &sensor)), [expected]);
            let others = ["gy", "gz", "cov[0]", "cov[1]", "cov[4]"].map(str::to_owned).to_vec();
            let notes = sentences(&selection.beside(others).notes(&available, &chosen, &sensor));
            let remains =
                if columns.is_empty() { expected } else { "cov[2], state left out: --columns does not name it" };
            assert_eq!(notes, [remains]);
        }
    }

    #[test]
    fn headings_of_well_known_files_need_no_arguments() {
        const RAD: f64 = 180.0 / std::f64::consts::PI;
        const M_S2: f64 = 1.0 / 9.80665;
        for (headings, expected) in [
            // EuRoC: imu0/data.csv.
            (
                &[
                    "#timestamp [ns]",
                    "w_RS_S_x [rad s^-1]",
                    "w_RS_S_y [rad s^-1]",
                    "w_RS_S_z [rad s^-1]",
                    "a_RS_S_x [m s^-2]",
                ][..],
                &[("time ns=0", 1.0), ("gyro_x=1", RAD), ("gyro_y=2", RAD), ("gyro_z=3", RAD), ("accl_x=4", M_S2)][..],
            ),
            (&["time_us", "ax [g]", "gyro_z_deg_s"], &[("time us=0", 1.0), ("gyro_z=2", 1.0), ("accl_x=1", 1.0)]),
            // ulog2csv writes vectors so.
            (&["timestamp", "gyro_rad[0]", "gyro_rad[1]"], &[("time ?=0", 1.0)]),
        ] {
            let found = chosen(headings, &[], &["rad/s"]).expect("columns");
            for (at, (name, factor)) in expected.iter().enumerate() {
                if *name == "gyro_z=2" {
                    continue; // --units overrides the heading; covered below.
                }
                assert_eq!(found[at].0, *name);
                assert!((found[at].1 - factor).abs() < 1e-12, "{name}: {}", found[at].1);
            }
        }
        let plain = chosen(&["time_us", "ax [g]", "gyro_z_deg_s"], &[], &[]).expect("columns");
        assert_eq!(plain[1], ("gyro_z=2".to_owned(), 1.0));
    }

    #[test]
    fn the_names_of_all_trades_are_known() {
        for (name, channel) in [
            ("in_anglvel_x", "gyro_x"),
            ("in_anglvel_z_raw", "gyro_z"),
            ("in_accel_y", "accl_y"),
            ("in_magn_z", "magn_z"),
            ("XGYRO_OUT", "gyro_x"),
            ("ZACCL_OUT", "accl_z"),
            ("YMAGN_OUT", "magn_y"),
            ("TEMP_OUT", "temp"),
            ("gyro_x_radps", "gyro_x"),
            ("accel_z_mps2", "accl_z"),
            ("x_gyro", "gyro_x"),
            ("zAccel", "accl_z"),
            ("angular_velocity.y", "gyro_y"),
            ("AngularRateX", "gyro_x"),
            ("RotRateZ", "gyro_z"),
            ("gyro_z, deg/s", "gyro_z"),
            ("linear_accel_x", "accl_x"),
            ("Magnetic Field y (uT)", "magn_y"),
            ("compass_x", "magn_x"),
        ] {
            let column = AvailableColumn::from_heading(name);
            let found = super::known_by_name(&[column]).expect("one");
            assert_eq!(found, [(channel, 0)], "{name}");
        }
        let body = ["t (s)", "p (deg/s)", "q (deg/s)", "r (deg/s)"];
        let expected = ["time s=0", "gyro_x=1", "gyro_y=2", "gyro_z=3"];
        let found = chosen(&body, &[], &[]).expect("columns");
        assert_eq!(found.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), expected);
        // Pressure and rain, and a field named as a rate.
        for headings in [&["t_s", "p", "r"][..], &["t_s", "w_x [uT]"], &["latitude", "quality"]] {
            assert!(matches!(chosen(headings, &[], &["deg/s"]), Err(SelectionError::NoChannel(_))), "{headings:?}");
        }
    }

    #[test]
    fn axes_are_told_by_their_unit_or_their_number() {
        let by_unit = ["t [s]", "ω_x [rad/s]", "ω_y [rad/s]", "ω_z [rad/s]", "fX (m/s^2)", "fY (m/s^2)", "fZ (m/s^2)"];
        let from_1 = ["t [s]", "gyro1", "gyro2", "gyro3", "acc1", "acc2", "acc3"];
        let from_0 = ["t [s]", "gyro0", "gyro1", "gyro2", "gyro3", "acc0", "acc1", "acc2"];
        let all = ["time s", "gyro_x", "gyro_y", "gyro_z", "accl_x", "accl_y", "accl_z"];
        for (headings, places) in [(&by_unit[..], [0, 1, 2, 3, 4, 5, 6]), (&from_1, [0, 1, 2, 3, 4, 5, 6])] {
            let found = chosen(headings, &[], &["rad/s", "m/s^2"]).expect("columns");
            let expected: Vec<String> = all.iter().zip(places).map(|(name, at)| format!("{name}={at}")).collect();
            assert_eq!(found.into_iter().map(|(name, _)| name).collect::<Vec<_>>(), expected);
        }
        let found = chosen(&from_0, &[], &["rad/s", "m/s^2"]).expect("columns");
        assert_eq!(found[1].0, "gyro_x=1");
        // Four of one unit are no axes.
        let four = [&by_unit[..4], &["speed [rad/s]"]].concat();
        assert!(matches!(chosen(&four, &[], &[]), Err(SelectionError::NoChannel(_))));
        let available: Vec<AvailableColumn> = by_unit.iter().map(|text| AvailableColumn::from_heading(text)).collect();
        let (selection, sensor) = (ColumnSelection::default(), SensorChannels::generic());
        let chosen = selection.choose(&available, &sensor).expect("columns");
        let expected = "ω_x, ω_y, ω_z, fX, fY, fZ are axes of a sensor by their unit; --columns says otherwise";
        assert_eq!(sentences(&selection.notes(&available, &chosen, &sensor)), [expected]);
    }

    #[test]
    fn every_column_is_used_or_named_as_left_out() {
        let headings = ["time_s", "gx [deg/s]", "gy [deg/s]", "gz [deg/s]", "temp", "my_rate_q", "m_x [V]", "note"];
        let available: Vec<AvailableColumn> = headings.iter().map(|text| AvailableColumn::from_heading(text)).collect();
        let sensor = SensorChannels::generic();
        let selection = ColumnSelection::default();
        let chosen = selection.choose(&available, &sensor).expect("columns");
        let notes = selection.notes(&available, &chosen, &sensor);
        assert_eq!(
            sentences(&notes),
            [
                "temp left out: no unit; --units gives one",
                "m_x in V left out: a unit of another quantity than the name; --columns reads it",
                "my_rate_q, note left out: no known name of a channel; --columns reads it"
            ]
        );
    }

    #[test]
    fn of_several_times_that_of_the_sample_is_taken() {
        let ros =
            ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id", "field.angular_velocity.x"];
        let expected = vec![("time ?=2".to_owned(), 1.0), ("gyro_x=4".to_owned(), 1.0)];
        assert_eq!(chosen(&ros, &[], &["deg/s"]).expect("columns"), expected);
        let px4 = ["timestamp", "timestamp_sample", "x"];
        let expected = vec![("time us=1".to_owned(), 1.0), ("gyro_x=2".to_owned(), 1.0)];
        assert_eq!(chosen(&px4, &["gyro_x=x"], &["deg/s", "us"]).expect("columns"), expected);
    }

    #[test]
    fn a_column_is_known_by_its_heading_too() {
        let headings = ["time_s", "wx_dps", "wx [rad/s]"];
        let expected = vec![("time s=0".to_owned(), 1.0), ("gyro_x=1".to_owned(), 1.0)];
        assert_eq!(chosen(&headings, &["time=time_s", "gyro_x=wx_dps"], &[]).expect("columns"), expected);
        let found = chosen(&headings, &["gyro_x=wx [rad/s]"], &[]).expect("columns");
        assert_eq!(found[0].0, "gyro_x=2");
    }

    #[test]
    fn faults_of_the_selection_are_named() {
        for (headings, columns, units, expected) in [
            (&["wx"][..], &[][..], &[][..], "no unit of gyro_x"),
            (&["wx", "gyro_x"], &[], &["deg/s"], "gyro_x is both wx and gyro_x"),
            (&["p", "q"], &[], &[], "no column is named like a channel"),
            (&["p", "q"], &["gyro_x=r"], &["deg/s"], "no column r; the file has p, q"),
            (&["p"], &["gyro_w=p"], &["deg/s"], "gyro_w"),
            (&["p"], &["gyro_x"], &["deg/s"], "expected CHANNEL=COLUMN"),
            (&["p"], &["gyro_x=p"], &["furlong"], "not a known unit"),
            (&["p"], &["gyro_x=p"], &["deg/s", "rad/s"], "are of one quantity"),
            (&["gyro_x_counts"], &[], &[], "counts of which sensor"),
        ] {
            let error = chosen(headings, columns, units).expect_err(expected).to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
