//! Calendar times, as people's loggers write them: dates, times of day, and both in one text.

/// Nanoseconds of a second, a day and half a day.
const SECOND_NS: i64 = 1_000_000_000;
pub(crate) const DAY_NS: i64 = 86_400 * SECOND_NS;

const MONTHS: [&str; 12] = ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"];

/// Nanoseconds from 1970 to a date and a time of day in one text: ISO 8601, or any [`date`] and [`time_of_day`] with a blank or a T
/// between them; or of a duration as `0 days 00:00:01.5`.
pub(crate) fn date_time(text: &str) -> Option<i64> {
    let at = text.find(|c: char| c == 'T' || c == 't' || c.is_ascii_whitespace())?;
    let (first, rest) = (&text[..at], text[at + 1..].trim_start());
    if let Some(clock) = rest.strip_prefix("days ").or_else(|| rest.strip_prefix("day ")) {
        let days: i64 = first.parse().ok()?;
        return days.checked_mul(DAY_NS)?.checked_add(time_of_day(clock.trim_start().trim_start_matches('+'))?);
    }
    date(first)?.checked_mul(DAY_NS)?.checked_add(time_of_day(rest)?)
}

/// Days from 1970 to a date: 2018-04-25, 2018/04/25, 25.04.2018, 25-Apr-2018, 04/25/2018, and 25/04/2018 where there is no such month.
pub(crate) fn date(text: &str) -> Option<i64> {
    let sign = text.chars().find(|c| ['-', '/', '.'].contains(c))?;
    let parts: Vec<&str> = text.split(sign).collect();
    let number = |text: &str| text.bytes().all(|b| b.is_ascii_digit()).then(|| text.parse::<i64>().ok()).flatten();
    let month = |text: &str| {
        let named = MONTHS.iter().position(|name| text.to_lowercase().starts_with(name)).map(|at| at as i64 + 1);
        number(text).or(named)
    };
    let (year, month, day) = match parts[..] {
        [year, of_year, day] if year.len() == 4 => (number(year)?, month(of_year)?, number(day)?),
        [one, other, year] if year.len() == 4 => {
            let is_month_first = sign == '/' && number(one)? <= 12;
            let (of_year, day) = if is_month_first { (one, other) } else { (other, one) };
            (number(year)?, month(of_year)?, number(day)?)
        }
        _ => return None,
    };
    let is_leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let days = [31, if is_leap { 29 } else { 28 }, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let length = *days.get(usize::try_from(month - 1).ok()?)?;
    if !(1..=length).contains(&day) {
        return None;
    }
    // Leap years before the first day of the year, in the Gregorian calendar.
    let leap_years = |year: i64| (year - 1).div_euclid(4) - (year - 1).div_euclid(100) + (year - 1).div_euclid(400);
    let before: i64 = days[..(month - 1) as usize].iter().sum();
    Some(365 * (year - 1970) + leap_years(year) - leap_years(1970) + before + day - 1)
}

/// Nanoseconds from midnight to a time of day, in UTC where it says its offset: 10:00, 10:00:13, 10:00:13.25, 10:00:13Z,
/// 10:00:13+02:00, 10:00:13 PM, 10:00:13:250 (ms).
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
        Some(at) => (&clock[..at], offset(&clock[at..])?),
        None => (clock, 0),
    };
    // Minutes and seconds with a fraction, as of an elapsed time.
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
            // The 61st second of a minute is a leap second.
            (two_digits(second, 61)?, digits.parse::<i64>().ok()? * scale)
        }
        None => (0, 0),
    };
    let hour = noon.map_or(hour, |noon| hour % 12 + noon);
    parts.next().is_none().then_some(((hour * 60 + minute - offset) * 60 + second) * SECOND_NS + fraction)
}

/// Minutes that a clock is ahead of UTC, of `+02:00`, `+0200` or `+02`.
fn offset(text: &str) -> Option<i64> {
    let digits = text[1..].replace(':', "");
    let is_offset = [2, 4].contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_digit());
    let minutes = is_offset.then(|| digits[..2].parse::<i64>().ok().zip(digits[2..].parse().ok().or(Some(0))))?;
    minutes.map(|(hours, minutes): (i64, i64)| (60 * hours + minutes) * if text.starts_with('-') { -1 } else { 1 })
}

/// Where the calendar times of a row are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CalendarColumns {
    /// Date and time of day in one field.
    One(usize),
    /// A date, and the time of day in the next field.
    Two(usize),
    /// A time of day without a date.
    TimeOfDay(usize),
}

impl CalendarColumns {
    /// The first of `fields` with a calendar time.
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

    /// Number of the field in which it begins.
    pub(crate) fn position(self) -> usize {
        match self {
            Self::One(at) | Self::Two(at) | Self::TimeOfDay(at) => at,
        }
    }
}

/// Reads the calendar times of consecutive rows.
#[derive(Debug, Clone)]
pub(crate) struct CalendarClock {
    pub(crate) columns: CalendarColumns,
    /// Time of day of the row before, and midnights since the first row, for times without a date.
    before_ns: Option<i64>,
    midnights: i64,
}

impl CalendarClock {
    pub(crate) fn new(columns: CalendarColumns) -> Self {
        Self { columns, before_ns: None, midnights: 0 }
    }

    /// The time of a row, ns; `field` is the one at the position of the columns, and `next` the one after it.
    pub(crate) fn time_ns(&mut self, field: &str, next: &str) -> Option<i64> {
        match self.columns {
            CalendarColumns::One(_) => date_time(field),
            CalendarColumns::Two(_) => date(field)?.checked_mul(DAY_NS)?.checked_add(time_of_day(next)?),
            CalendarColumns::TimeOfDay(_) => {
                let now = time_of_day(field)?;
                // A time that goes back by more than half a day is that of the next one.
                self.midnights += i64::from(self.before_ns.is_some_and(|before| now < before - DAY_NS / 2));
                self.before_ns = Some(now);
                Some(now + self.midnights * DAY_NS)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{CalendarClock, CalendarColumns, DAY_NS, date, date_time, time_of_day};

    /// By `date -u -d ... +%s`: 2018-04-25 10:00:13 is 1524650413; 2000-02-29 is day 11016.
    #[test]
    fn calendar_times_of_many_loggers_are_the_same_second() {
        const NS: i64 = 1_524_650_413_000_000_000;
        for (text, fraction) in [
            ("2018-04-25T10:00:13Z", 0),
            ("2018-04-25 10:00:13", 0),
            ("2018-04-25T12:00:13.5+02:00", 500_000_000),
            ("2018-04-25T08:30:13-0130", 0),
            ("2018/04/25 10:00:13.000001", 1_000),
            ("25.04.2018 10:00:13.123456789", 123_456_789),
            ("04/25/2018 10:00:13 AM", 0),
            ("25/04/2018 10:00:13", 0),
            ("25-Apr-2018 10:00:13", 0),
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
        for text in ["2018-02-29", "2018-13-01", "1.2.3", "0.5", "-0.012", "2018-04", "1e-3", "18-04-25"] {
            assert_eq!(date(text), None, "{text}");
        }
        for text in
            ["25:00:00", "10:61:00", "10", "10:00:13.", "10:00:00:00", "a:b", "1:2:3.4.5", "+1:00", "1:2:3.12345678é"]
        {
            assert_eq!(time_of_day(text), None, "{text}");
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
