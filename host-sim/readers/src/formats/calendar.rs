//! Calendar times of loggers: dates, times of day, both in one text, or parts in several columns.

use crate::columns::AvailableColumn;
use crate::formats::fields::number;
use crate::rows::Number;
use jiff::civil::Date;

const SECOND_NS: i64 = 1_000_000_000;
pub(crate) const DAY_NS: i64 = 86_400 * SECOND_NS;

const MONTHS: [&str; 12] = ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"];

/// ns since 1970 by ISO 8601 or any [`date`] and [`time_of_day`]; or a duration, `0 days 00:00:01.5`.
pub(crate) fn date_time(text: &str) -> Option<i64> {
    date_time_with(text, date)
}

fn date_time_with(text: &str, date: impl FnOnce(&str) -> Option<i64>) -> Option<i64> {
    let may_be_words = text.bytes().filter(|byte| *byte == b' ').count() > 1;
    if let Some((date, clock)) = may_be_words.then(|| with_named_month(text)).flatten() {
        return date.days(Order::MonthFirst)?.checked_mul(DAY_NS)?.checked_add(time_of_day(&clock)?);
    }
    let at = text.find(|c: char| matches!(c, 'T' | 't' | '_') || c.is_ascii_whitespace())?;
    let (first, rest) = (&text[..at], text[at + 1..].trim_start());
    // 20180425T100013.5, 2018-04-25_10-00-13.5.
    let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
    if digits == 6 && first.len() == 8 && first.bytes().all(|byte| byte.is_ascii_digit()) {
        let clock = format!("{}:{}:{}", &rest[..2], &rest[2..4], &rest[4..]);
        let date = date(&format!("{}-{}-{}", &first[..4], &first[4..6], &first[6..]))?;
        return date.checked_mul(DAY_NS)?.checked_add(time_of_day(&clock)?);
    }
    if digits == 2 && rest.matches('-').count() == 2 && !rest.contains(':') {
        return date(first)?.checked_mul(DAY_NS)?.checked_add(time_of_day(&rest.replace('-', ":"))?);
    }
    if let Some(clock) = rest.strip_prefix("days ").or_else(|| rest.strip_prefix("day ")) {
        let days: i64 = first.parse().ok()?;
        return days.checked_mul(DAY_NS)?.checked_add(time_of_day(clock.trim_start().trim_start_matches('+'))?);
    }
    date(first)?.checked_mul(DAY_NS)?.checked_add(time_of_day(rest)?)
}

/// Date and time of day of words between blanks: `Apr 25, 2018 10:00:13`, `Wed Apr 25 10:00:13 2018`, `25 Apr 2018 10:00`.
fn with_named_month(text: &str) -> Option<(WrittenDate, String)> {
    let (mut year, mut month, mut day, mut clock) = (None, None, None, String::new());
    for word in text.split([' ', ',']).filter(|word| !word.is_empty()) {
        let is_number = word.bytes().all(|byte| byte.is_ascii_digit());
        match word.len() {
            4 if is_number => year = word.parse().ok(),
            1 | 2 if is_number => day = word.parse().ok(),
            // AM, PM or an offset follow the clock.
            _ if !clock.is_empty() => clock = format!("{clock} {word}"),
            _ if word.contains(':') => word.clone_into(&mut clock),
            _ => month = month.or_else(|| month_of(word)),
        }
    }
    let date = WrittenDate { year: year?, parts: [month?, day?], is_open: false, is_stroked: false };
    (!clock.is_empty()).then_some((date, clock))
}

/// By the first letters of its name.
fn month_of(name: &str) -> Option<i64> {
    let is_letters = name.starts_with(|letter: char| letter.is_ascii_alphabetic());
    let plain = name.to_lowercase();
    MONTHS.iter().position(|month| is_letters && plain.starts_with(month)).map(|at| at as i64 + 1)
}

/// Days since 1970: 2018-04-25, 2018/04/25, 25.04.2018, 25-Apr-2018, 04/25/2018 or 25/04/2018. Ambiguous: month first
/// between strokes, else day first.
pub(crate) fn date(text: &str) -> Option<i64> {
    let date = WrittenDate::parse(text)?;
    date.days(Order::MonthFirst).filter(|_| date.is_stroked).or_else(|| date.days(Order::DayFirst))
}

/// First of day and month, if the year is last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Order {
    DayFirst,
    MonthFirst,
}

/// A date of perhaps unknown order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct WrittenDate {
    year: i64,
    /// As written if the year is last.
    parts: [i64; 2],
    /// In the file's order.
    is_open: bool,
    is_stroked: bool,
}

impl WrittenDate {
    fn parse(text: &str) -> Option<Self> {
        let sign = text.chars().find(|c| ['-', '/', '.'].contains(c))?;
        let parts: Vec<&str> = text.split(sign).collect();
        let number = |text: &str| text.bytes().all(|b| b.is_ascii_digit()).then(|| text.parse::<i64>().ok()).flatten();
        let is_stroked = sign == '/';
        match parts[..] {
            [year, month, day] if year.len() == 4 => {
                let month = number(month).or_else(|| month_of(month))?;
                Some(Self { year: number(year)?, parts: [month, number(day)?], is_open: false, is_stroked })
            }
            // Two digits of a year between dashes may be a day.
            [one, other, year] if year.len() == 4 || year.len() == 2 && sign != '-' => {
                let year = number(year)? + if year.len() == 2 { 2000 } else { 0 };
                let (parts, is_open) = match month_of(other) {
                    Some(month) => ([month, number(one)?], false),
                    None => ([number(one)?, number(other)?], true),
                };
                Some(Self { year, parts, is_open, is_stroked })
            }
            _ => None,
        }
    }

    /// `None` if there is no such day.
    fn days(self, order: Order) -> Option<i64> {
        let [month, day] = match (self.is_open, order) {
            (true, Order::DayFirst) => [self.parts[1], self.parts[0]],
            _ => self.parts,
        };
        let date = Date::new(self.year.try_into().ok()?, month.try_into().ok()?, day.try_into().ok()?).ok()?;
        Some(i64::from(date.since(Date::new(1970, 1, 1).ok()?).ok()?.get_days()))
    }
}

/// Order of day and month in a file, by a day above 12 or the first change of date.
#[derive(Debug, Clone, Default)]
struct DateOrder {
    known: Option<Order>,
    /// Last date, and days added since.
    before: Option<WrittenDate>,
    shift: i64,
}

impl DateOrder {
    fn days(&mut self, text: &str) -> Option<i64> {
        let date = WrittenDate::parse(text)?;
        if !date.is_open {
            return date.days(Order::MonthFirst);
        }
        let provisional = if date.is_stroked { Order::MonthFirst } else { Order::DayFirst };
        if let (None, Some(before)) = (self.known, self.before.filter(|before| *before != date)) {
            let step = |order: Order| Some((date.days(order)? - before.days(order)?).unsigned_abs());
            let steps = [Order::DayFirst, Order::MonthFirst].map(|order| (step(order), order));
            let least =
                steps.into_iter().filter_map(|(step, order)| Some((step?, order))).min_by_key(|(step, _)| *step);
            let order = least.map_or(provisional, |(_, order)| order);
            let days_before = before.days(provisional).or_else(|| before.days(order))?;
            self.shift = days_before - before.days(order)?;
            self.known = Some(order);
        }
        self.before = Some(date);
        let order = self.known.unwrap_or(provisional);
        let other = if order == Order::DayFirst { Order::MonthFirst } else { Order::DayFirst };
        let days = date.days(order).or_else(|| date.days(other).filter(|_| self.known.is_none()))?;
        Some(days + self.shift)
    }
}

/// ns from midnight, UTC with an offset: 10:00, 10:00:13.25, 10:00:13+02:00, 10:00:13 PM, 10:00:13:250 (ms).
pub(crate) fn time_of_day(text: &str) -> Option<i64> {
    let text = text.trim();
    let upper = text.to_uppercase();
    let (clock, noon) = match (upper.strip_suffix("AM"), upper.strip_suffix("PM")) {
        (Some(clock), _) => (clock.trim_end(), Some(0)),
        (_, Some(clock)) => (clock.trim_end(), Some(12)),
        _ => (upper.as_str(), None),
    };
    let clock = clock.strip_suffix('Z').unwrap_or(clock);
    let (clock, offset) = match clock.rfind(['+', '-']) {
        Some(at) => (clock[..at].trim_end(), offset(&clock[at..])?),
        None => (clock, 0),
    };
    // Minutes and seconds of an elapsed time.
    let is_without_hour = clock.matches(':').count() == 1 && clock.contains('.');
    let with_hour = format!("0:{clock}");
    let clock = if is_without_hour { with_hour.as_str() } else { clock };
    let mut parts = clock.split(':');
    let two_digits = |text: &str, below: i64| {
        let is_number = (1..=2).contains(&text.len()) && text.bytes().all(|b| b.is_ascii_digit());
        text.parse::<i64>().ok().filter(|number| is_number && *number < below)
    };
    let (hour, minute) = (two_digits(parts.next()?, 24)?, two_digits(parts.next()?, 60)?);
    let (second, fraction) = match parts.next() {
        Some(text) => {
            let (second, fraction) = match (text.split_once(['.', ',']), parts.next()) {
                (Some(split), None) => split,
                (None, None) => (text, "0"),
                // Two digits would be frames.
                (None, Some(milliseconds)) if milliseconds.len() == 3 => (text, milliseconds),
                _ => return None,
            };
            if !(1..=18).contains(&fraction.len()) || !fraction.bytes().all(|b| b.is_ascii_digit()) {
                return None;
            }
            let digits = &fraction[..fraction.len().min(9)];
            let scale = 10i64.pow(9 - digits.len() as u32);
            // Leap second.
            (two_digits(second, 61)?, digits.parse::<i64>().ok()? * scale)
        }
        None => (0, 0),
    };
    let hour = noon.map_or(hour, |noon| hour % 12 + noon);
    parts.next().is_none().then_some(((hour * 60 + minute - offset) * 60 + second) * SECOND_NS + fraction)
}

/// Minutes ahead of UTC: `+02:00`, `+0200` or `+02`.
fn offset(text: &str) -> Option<i64> {
    let digits = text[1..].replace(':', "");
    let is_offset = [2, 4].contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_digit());
    let minutes = is_offset.then(|| digits[..2].parse::<i64>().ok().zip(digits[2..].parse().ok().or(Some(0))))?;
    minutes.map(|(hours, minutes): (i64, i64)| (60 * hours + minutes) * if text.starts_with('-') { -1 } else { 1 })
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum CalendarColumns {
    One(usize),
    Two(usize),
    TimeOfDay(usize),
    /// Whole numbers with their ns: seconds and nanoseconds, or hours, minutes, seconds.
    Parts(Vec<(usize, i64)>),
}

struct TimePart {
    names: &'static [&'static str],
    unit_ns: i64,
    below: i64,
}

const PARTS: [TimePart; 7] = [
    TimePart { names: &["hour", "hours", "hh"], unit_ns: 3600 * SECOND_NS, below: 24 },
    TimePart { names: &["minute", "minutes", "min", "mins", "mm"], unit_ns: 60 * SECOND_NS, below: 60 },
    TimePart { names: &["second", "seconds", "sec", "secs", "tv_sec", "ss", "s"], unit_ns: SECOND_NS, below: i64::MAX },
    TimePart {
        names: &["ms", "msec", "msecs", "millis", "millisecond", "milliseconds"],
        unit_ns: 1_000_000,
        below: 1000,
    },
    TimePart {
        names: &["us", "usec", "usecs", "tv_usec", "micros", "microsecond", "microseconds"],
        unit_ns: 1000,
        below: 1_000_000,
    },
    TimePart {
        names: &["ns", "nsec", "nsecs", "nanosec", "nanosecs", "tv_nsec", "nanos", "nanosecond", "nanoseconds"],
        unit_ns: 1,
        below: SECOND_NS,
    },
    TimePart { names: &["centisecond", "centiseconds"], unit_ns: 10_000_000, below: 100 },
];
const SECONDS: usize = 2;

struct NamedPart {
    prefix: String,
    part: usize,
    position: usize,
}

impl CalendarColumns {
    pub(crate) fn find(fields: &[&str]) -> Option<Self> {
        fields.iter().enumerate().find_map(|(at, field)| {
            let next_is_time = || fields.get(at + 1).is_some_and(|next| time_of_day(next).is_some());
            if date_time(field).is_some() {
                Some(Self::One(at))
            } else if date(field).is_some() && next_is_time() {
                Some(Self::Two(at))
            } else {
                time_of_day(field).map(|_| Self::TimeOfDay(at))
            }
        })
    }

    /// Columns named as parts of a time, as `secs` and `nsecs`, with whole numbers in `rows`; seconds are required.
    pub(crate) fn parts(available: &[AvailableColumn], rows: &[Vec<&str>]) -> Option<Self> {
        let mut named: Vec<NamedPart> = Vec::new();
        for (position, column) in available.iter().enumerate() {
            let plain: String = column.name.to_lowercase().replace([' ', '-'], "_");
            let start = plain.rfind(['.', '_', '/']).map_or(0, |at| at + 1);
            let (prefix, ending) = match plain.strip_suffix("tv_sec").or_else(|| plain.strip_suffix("tv_nsec")) {
                Some(prefix) => (prefix, &plain[prefix.len()..]),
                None => (&plain[..start], &plain[start..]),
            };
            if let Some(part) = PARTS.iter().position(|part| part.names.contains(&ending)) {
                let is_new = !named.iter().any(|known| known.prefix == prefix && known.part == part);
                let fits = rows.iter().all(|row| {
                    let value = row.get(position).and_then(|field| number(field));
                    matches!(value, Some(Number::Integer(value)) if (0..PARTS[part].below).contains(&value))
                });
                if is_new && fits {
                    named.push(NamedPart { prefix: prefix.to_owned(), part, position });
                }
            }
        }
        let prefix = named.iter().find(|of| of.part == SECONDS).map(|of| of.prefix.clone())?;
        named.retain(|of| of.prefix == prefix);
        let has = |part: usize| named.iter().any(|of| of.part == part);
        // Hours need minutes; one fraction at most.
        let is_time = named.len() > 1 && has(0) <= has(1) && !rows.is_empty();
        let mut parts: Vec<(usize, i64)> = named.iter().map(|of| (of.position, PARTS[of.part].unit_ns)).collect();
        parts.sort_unstable();
        is_time.then_some(Self::Parts(parts))
    }

    pub(crate) fn position(&self) -> usize {
        match self {
            Self::One(at) | Self::Two(at) | Self::TimeOfDay(at) => *at,
            Self::Parts(parts) => parts.first().map_or(0, |(at, _)| *at),
        }
    }
}

/// Calendar times of consecutive rows.
#[derive(Debug, Clone)]
pub(crate) struct CalendarClock {
    pub(crate) columns: CalendarColumns,
    order: DateOrder,
    /// Last time of day, and midnights since the first row.
    before_ns: Option<i64>,
    midnights: i64,
}

impl CalendarClock {
    pub(crate) fn new(columns: CalendarColumns) -> Self {
        Self { columns, order: DateOrder::default(), before_ns: None, midnights: 0 }
    }

    /// ns; `next` is the field behind `field`.
    pub(crate) fn time_ns(&mut self, field: &str, next: &str) -> Option<i64> {
        match self.columns {
            CalendarColumns::One(_) => date_time_with(field, |date| self.order.days(date)),
            CalendarColumns::Two(_) => self.order.days(field)?.checked_mul(DAY_NS)?.checked_add(time_of_day(next)?),
            CalendarColumns::TimeOfDay(_) => {
                let now = time_of_day(field)?;
                // Back by more than half a day: the next day.
                self.midnights += i64::from(self.before_ns.is_some_and(|before| now < before - DAY_NS / 2));
                self.before_ns = Some(now);
                Some(now + self.midnights * DAY_NS)
            }
            CalendarColumns::Parts(_) => None,
        }
    }

    /// True for the field of the time or its date.
    pub(crate) fn is_at(&self, position: usize) -> bool {
        !matches!(self.columns, CalendarColumns::Parts(_)) && self.columns.position() == position
    }

    pub(crate) fn start_of_parts(&self) -> Option<usize> {
        matches!(self.columns, CalendarColumns::Parts(_)).then(|| self.columns.position())
    }

    /// ns of a sum of parts, plus passed midnights or hours.
    pub(crate) fn sum_ns(&mut self, sum: i64) -> Option<i64> {
        let CalendarColumns::Parts(parts) = &self.columns else { return None };
        let has = |part: usize| parts.iter().any(|(_, unit)| *unit == PARTS[part].unit_ns);
        let modulus = if has(0) { DAY_NS } else { 3600 * SECOND_NS };
        if has(1) {
            self.midnights += i64::from(self.before_ns.is_some_and(|before| sum < before - modulus / 2));
            self.before_ns = Some(sum);
        }
        sum.checked_add(self.midnights.checked_mul(modulus)?)
    }

    /// `None` if it is no part.
    pub(crate) fn part_ns(&self, position: usize, field: &str) -> Option<Option<i64>> {
        let CalendarColumns::Parts(parts) = &self.columns else { return None };
        let (_, unit) = parts.iter().find(|(at, _)| *at == position)?;
        Some(match number(field) {
            Some(Number::Integer(value)) => value.checked_mul(*unit),
            _ => None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{CalendarClock, CalendarColumns, DAY_NS, date, date_time, time_of_day};

    /// By `date -u`: 1524650413; 2000-02-29 is day 11016.
    #[test]
    fn calendar_times_of_many_loggers_are_the_same_second() {
        const NS: i64 = 1_524_650_413_000_000_000;
        for (text, fraction) in [
            ("2018-04-25T10:00:13Z", 0),
            ("2018-04-25 10:00:13", 0),
            ("2018-04-25T12:00:13.5+02:00", 500_000_000),
            ("2018-04-25T08:30:13-0130", 0),
            ("2018-04-25 12:00:13 +0200", 0),
            ("2018/04/25 10:00:13.000001", 1_000),
            ("25.04.2018 10:00:13.123456789", 123_456_789),
            ("04/25/2018 10:00:13 AM", 0),
            ("25/04/2018 10:00:13", 0),
            ("25-Apr-2018 10:00:13", 0),
            ("20180425T100013.5Z", 500_000_000),
            ("2018-04-25_10-00-13.5", 500_000_000),
            ("04/25/18 10:00:13 AM", 0),
            ("25.04.18 10:00:13", 0),
            ("Apr 25, 2018 10:00:13.5", 500_000_000),
            ("25 April 2018 12:00:13 +0200", 0),
            ("Wed Apr 25 10:00:13.5 2018", 500_000_000),
        ] {
            assert_eq!(date_time(text), Some(NS + fraction), "{text}");
        }
        assert_eq!(date_time("1 days 00:00:01.5"), Some(DAY_NS + 1_500_000_000));
        assert_eq!(date_time("-1 days +23:59:59.992"), Some(-8_000_000));
        assert_eq!(time_of_day("10:00:13 PM"), Some((22 * 3600 + 13) * 1_000_000_000));
        for text in ["10:00:13.250", "10:00:13,25", "10:00:13:250"] {
            assert_eq!(time_of_day(text), Some(36_013_250_000_000), "{text}");
        }
        assert_eq!(time_of_day("12:30 am"), Some(30 * 60 * 1_000_000_000));
        assert_eq!((date("2000-02-29"), date("1970-01-01"), date("1969-12-31")), (Some(11_016), Some(0), Some(-1)));
        assert_eq!(date("1900-03-01").map(|day| day - date("1900-02-28").unwrap_or(0)), Some(1));
        for text in ["2018-02-29", "2018-13-01", "1.2.3", "1.2.34.5", "0.5", "-0.012", "2018-04", "1e-3", "18-04-25"] {
            assert_eq!(date(text), None, "{text}");
        }
        for text in
            ["25:00:00", "10:61:00", "10", "10:00:13.", "10:00:00:00", "a:b", "1:2:3.4.5", "+1:00", "1:2:3.12345678é"]
        {
            assert_eq!(time_of_day(text), None, "{text}");
        }
    }

    #[test]
    fn one_order_of_day_and_month_is_that_of_the_whole_file() {
        for (month, day) in [(5, 11), (11, 5), (12, 12), (1, 31), (2, 28), (9, 30), (12, 31)] {
            let last = jiff::civil::date(2026, month, day);
            let next = last.tomorrow().expect("a day");
            for (sign, is_day_first) in [("/", true), ("/", false), ("-", true), ("-", false), (".", true)] {
                let written = |date: jiff::civil::Date| {
                    let (one, other) =
                        if is_day_first { (date.day(), date.month()) } else { (date.month(), date.day()) };
                    format!("{one:02}{sign}{other:02}{sign}{}", date.year())
                };
                let mut clock = CalendarClock::new(CalendarColumns::One(0));
                let texts = [(last, "23:59:59.9"), (last, "23:59:59.95"), (next, "00:00:00.0"), (next, "12:00:00.0")];
                let times: Vec<i64> = texts
                    .iter()
                    .map(|(date, time)| format!("{} {time}", written(*date)))
                    .map(|text| clock.time_ns(&text, "").unwrap_or_else(|| panic!("{text}")))
                    .collect();
                let steps: Vec<i64> = times.windows(2).map(|pair| (pair[1] - pair[0]) / 1_000_000).collect();
                assert_eq!(steps, [50, 50, 43_200_000], "{} then {}", written(last), written(next));
            }
        }
    }

    #[test]
    fn times_without_a_date_go_on_after_midnight() {
        let fields = ["x", "23:59:59.5", "0.1"];
        let columns = CalendarColumns::find(&fields).expect("a time");
        assert_eq!(columns, CalendarColumns::TimeOfDay(1));
        let mut clock = CalendarClock::new(columns);
        let [before, after] = ["23:59:59.5", "00:00:00.5"].map(|text| clock.time_ns(text, "").expect("a time"));
        assert_eq!(after - before, 1_000_000_000);
    }
}
