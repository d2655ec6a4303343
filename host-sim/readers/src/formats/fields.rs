//! Fields of a text row and their numbers.

use crate::columns::Unit;
use crate::input::delimited_text;
use crate::rows::Number;
use std::str::SplitAsciiWhitespace;

/// The first that occurs; else blanks.
const SEPARATORS: [char; 4] = [';', '\t', ',', '|'];

const MISSING: [&str; 22] = [
    "", "nan", "na", "n/a", "null", "none", "nil", "-", "--", "---", "*", "?", "#n/a", "#na", "#value!", "#num!",
    "#div/0!", "1.#qnan", "-1.#ind", "1.#inf", "ovf", "missing",
];

/// Between time and line in the Arduino serial monitor.
const ARROW: &str = " -> ";
/// Behind the words of a log.
const MARKS: [char; 4] = [':', ']', '>', '='];

/// The separator by which most of the fields are numbers; blanks if there is none. A semicolon may end a row of MATLAB.
pub(crate) fn separator_of(text: &str) -> Option<char> {
    let fields = &text[words_before_values(text)..];
    let row = fields.trim_end_matches([';', ' ']);
    let is_ended = row.len() < fields.len() && (row.contains(char::is_whitespace) || row.matches(',').count() > 1);
    let fields = if is_ended { row } else { fields };
    // Every second part is quoted.
    let is_outside = |separator: &char| fields.split('"').step_by(2).any(|part| part.contains(*separator));
    let mut separators: Vec<Option<char>> = SEPARATORS.into_iter().filter(is_outside).map(Some).collect();
    let share = |separator: Option<char>| {
        let (mut count, mut numbers) = (0_usize, 0);
        for field in Fields::new(fields, separator) {
            count += 1;
            numbers += usize::from(number(field).is_some() || with_unit(field).is_some());
        }
        numbers as f64 / count as f64
    };
    // Numbers between blanks may have decimal commas.
    separators.extend((fields.contains(' ') && share(None) == 1.0).then_some(None));
    if separators.len() < 2 {
        return separators.pop().flatten();
    }
    // The first of equal ones.
    separators.into_iter().rev().max_by(|one, other| share(*one).total_cmp(&share(*other))).flatten()
}

/// Bytes before the values of a line: a serial monitor's time, or what a log writes, such as `[12.5] INFO imu: `.
fn words_before_values(text: &str) -> usize {
    let start = text.find(ARROW).map_or(0, |at| at + ARROW.len());
    let line = &text[start..];
    let (mut end, mut at, mut last) = (0, 0, "");
    for piece in line.split_inclusive(' ') {
        let (before, word) = (&line[..at], piece.trim_end());
        at += piece.len();
        let has_letters = word.contains(char::is_alphabetic);
        if word.ends_with(SEPARATORS) || has_letters && word.contains(SEPARATORS) {
            break;
        }
        let is_word = (has_letters || word.ends_with(MARKS)) && number(word).is_none();
        let is_in_brackets = word.starts_with('[') && word.ends_with(']');
        if is_word || is_in_brackets || word == "-" && before.contains(" - ") {
            (end, last) = (at, word);
        }
    }
    let values = &line[end..];
    let has_separator = values.contains(SEPARATORS);
    let mut cells = values.split(|sign: char| SEPARATORS.contains(&sign) || !has_separator && sign == ' ');
    // `sensor 1,0.5`: the number is part of a name.
    let is_name = has_separator && !last.ends_with(MARKS) && !cells.clone().next().is_some_and(|of| of.contains('.'));
    let are_several = has_separator || values.trim().contains(' ');
    let are_numbers = are_several && !is_name && cells.all(|cell| number(cell.trim()).is_some());
    start + if are_numbers { end } else { 0 }
}

pub(crate) fn split(text: &str, separator: Option<char>) -> Fields<'_> {
    // Mostly numbers alone.
    let has_blanks = separator.is_none() || text.contains(' ');
    if !has_blanks || !has_words(text) {
        return Fields::new(text, separator);
    }
    let (words, values) = text.split_at(words_before_values(text));
    let words = (!words.is_empty()).then(|| words.split_ascii_whitespace());
    let has_units = separator.is_none() && has_units(values);
    Fields { words, has_units, ..Fields::new(values, separator) }
}

/// One, or the length of a list.
pub(crate) fn list_lengths(text: &str, separator: Option<char>) -> Vec<usize> {
    let mut fields = split(text, separator);
    let mut lengths = Vec::new();
    while fields.next().is_some() {
        lengths.push(1);
        while fields.list.is_some() && fields.next().is_some() {
            *lengths.last_mut().expect("a cell") += 1;
        }
    }
    lengths
}

/// Fields, also quoted (RFC 4180). List elements are fields.
pub(crate) struct Fields<'a> {
    /// The words that a log writes before the values.
    words: Option<SplitAsciiWhitespace<'a>>,
    rest: Option<&'a str>,
    /// ASCII; blanks if `None`.
    separator: Option<u8>,
    /// Units are behind blanks.
    has_units: bool,
    /// Commas separate no fields.
    has_lists: bool,
    list: Option<&'a str>,
}

impl<'a> Fields<'a> {
    fn new(text: &'a str, separator: Option<char>) -> Self {
        let has_lists = separator != Some(',') && text.contains(',');
        let separator = separator.map(|separator| separator as u8);
        Self { words: None, rest: Some(text), separator, has_units: false, has_lists, list: None }
    }

    fn cut(text: &'a str, separator: u8) -> (&'a str, Option<&'a str>) {
        let at = text.bytes().position(|byte| byte == separator);
        at.map_or((text, None), |at| (&text[..at], Some(&text[at + 1..])))
    }

    /// In brackets, or between commas where these are no separators.
    #[inline]
    fn first_of_list(&mut self, field: &'a str) -> &'a str {
        let may_be_list = self.has_lists || field.as_bytes().first() == Some(&b'[');
        if may_be_list { self.first_of_some_list(field) } else { field }
    }

    fn first_of_some_list(&mut self, field: &'a str) -> &'a str {
        let inner = if field.as_bytes().first() == Some(&b'[') {
            field.strip_prefix('[').and_then(|field| field.strip_suffix(']')).map(str::trim)
        } else {
            let commas = if self.has_lists { field.matches(',').count() } else { 0 };
            let is_number = || number(field).is_some();
            (commas > 1 || commas == 1 && field.contains('.')).then_some(field).filter(|_| !is_number())
        };
        let is_list = |inner: &&str| {
            let mut elements = inner.split([',', ' ']).filter(|element| !element.is_empty());
            elements.clone().count() > 1 && elements.all(|element| number(element).is_some())
        };
        inner.filter(is_list).map_or(field, |inner| self.next_of_list(inner))
    }

    fn next_of_list(&mut self, list: &'a str) -> &'a str {
        let list = list.trim_start_matches([',', ' ']);
        let (element, rest) = list.split_at(list.find([',', ' ']).unwrap_or(list.len()));
        self.list = Some(rest).filter(|rest| !rest.trim_matches([',', ' ']).is_empty());
        element
    }

    fn quoted(text: &'a str) -> Option<(&'a str, &'a str)> {
        if text.bytes().next().is_none_or(|first| first.is_ascii_graphic() && first != b'"') {
            return None;
        }
        let inner = text.trim_start().strip_prefix('"')?;
        // Two marks are one.
        let mut marks = inner.match_indices('"').map(|(at, _)| at).peekable();
        while let Some(at) = marks.next() {
            if marks.next_if_eq(&(at + 1)).is_none() {
                return Some((&inner[..at], &inner[at + 1..]));
            }
        }
        None
    }
}

impl<'a> Iterator for Fields<'a> {
    type Item = &'a str;

    fn next(&mut self) -> Option<&'a str> {
        if let Some(list) = self.list.take() {
            return Some(self.next_of_list(list));
        }
        if let Some(words) = &mut self.words {
            match words.map(bare_word).find(|word| !word.is_empty()) {
                Some(word) => return Some(word),
                None => self.words = None,
            }
        }
        let rest = self.rest.take()?;
        let Some(separator) = self.separator else {
            let start = rest.trim_ascii_start();
            let mut end = word_end(start);
            if self.has_units && number(&start[..end]).is_some() {
                let after = start[end..].trim_ascii_start();
                let unit = &after[..word_end(after)];
                end = if is_unit(unit) { start.len() - after.len() + unit.len() } else { end };
            }
            self.rest = Some(&start[end..]).filter(|_| end > 0);
            return (end > 0).then(|| self.first_of_list(delimited_text::field(&start[..end])));
        };
        if let Some((field, after)) = Self::quoted(rest) {
            self.rest = Self::cut(after, separator).1;
            return Some(self.first_of_list(field.trim()));
        }
        let (field, after) = Self::cut(rest, separator);
        self.rest = after;
        Some(self.first_of_list(delimited_text::field(field)))
    }
}

fn word_end(text: &str) -> usize {
    text.bytes().position(|byte| byte.is_ascii_whitespace()).unwrap_or(text.len())
}

/// Without what a log puts around it.
fn bare_word(word: &str) -> &str {
    let word = word.trim_end_matches("->");
    word.trim_start_matches(['[', '(', '<', '|']).trim_end_matches(|sign| MARKS.contains(&sign) || sign == ')')
}

fn is_unit(word: &str) -> bool {
    number(word).is_none() && Unit::parse(word).is_some()
}

/// Letters other than those of an exponent, a bracket or an arrow; without branches, as most lines have none.
fn has_words(text: &str) -> bool {
    let bytes = text.as_bytes();
    // These, and the arrow, stand behind all digits and signs of numbers.
    if !bytes.iter().fold(false, |any, byte| any | (*byte >= b'>')) {
        return false;
    }
    let is_word = |before: u8, byte: u8| {
        let is_begin = byte.is_ascii_alphabetic() & !before.is_ascii_digit() & (before != b'.');
        is_begin | (byte == b']') | (byte == b'>')
    };
    let first = bytes.first().is_some_and(|first| is_word(b' ', *first));
    bytes.iter().zip(bytes.iter().skip(1)).fold(first, |any, (before, byte)| any | is_word(*before, *byte))
}

/// At least half of the numbers between blanks have one, as a single letter may be a state; and several where the numbers have names.
fn has_units(text: &str) -> bool {
    let (mut numbers, mut units, mut names, mut is_behind_number) = (0, 0, 0, false);
    for word in text.split_ascii_whitespace() {
        let is_name = word.ends_with(':') || word.contains('=');
        if is_name && numbers > 0 {
            return false;
        }
        names += usize::from(is_name);
        units += usize::from(is_behind_number && is_unit(word));
        is_behind_number = number(word).is_some();
        numbers += usize::from(is_behind_number);
    }
    units > names && 2 * units >= numbers
}

/// Also with decimal comma, groups of digits, the exponent `D` of Fortran, as `0x1F`, or of a program's text: in brackets,
/// `0.5f`, `0.5;`. NaN if missing; `None` for other texts.
pub(crate) fn number(field: &str) -> Option<Number> {
    if let Some(number) = short_number(field.as_bytes()) {
        return Some(number);
    }
    if !field.contains('.')
        && let Ok(integer) = field.parse()
    {
        return Some(Number::Integer(integer));
    }
    let of_comma = || field.replace(',', ".").parse().ok();
    let of_signs = || field.replace(',', ".").replace(['D', 'd'], "e").replace('−', "-").parse().ok();
    let real = field.parse().ok().or_else(of_comma).or_else(of_signs);
    let missing = || MISSING.contains(&field.to_lowercase().as_str()).then_some(f64::NAN);
    let inner = field.trim_matches(['[', ']', '(', ')', '{', '}', ';', '\'', ' ']);
    let inner = inner.strip_suffix('f').filter(|inner| inner.contains('.')).unwrap_or(inner);
    let in_text = || number(Some(inner).filter(|inner| !inner.is_empty() && inner.len() < field.len())?);
    real.or_else(missing).or_else(|| grouped(field)).map(Number::Real).or_else(|| hexadecimal(field)).or_else(in_text)
}

/// `0x1F`; 4, 8 and 16 digits are a word in two's complement.
fn hexadecimal(field: &str) -> Option<Number> {
    let digits = field.strip_prefix("0x").or_else(|| field.strip_prefix("0X"))?;
    let word = u64::from_str_radix(digits, 16).ok()?;
    let unused = if let 4 | 8 = digits.len() { 64 - 4 * digits.len() } else { 0 };
    Some(Number::Integer((word << unused).cast_signed() >> unused))
}

/// `1,524.3` or `1.524,3`.
fn grouped(field: &str) -> Option<f64> {
    let (whole, decimals) = field.split_at(field.rfind([',', '.'])?);
    let sign = if decimals.starts_with('.') { ',' } else { '.' };
    let (first, others) = whole.split_once(sign)?;
    let is_group = |group: &str| group.len() == 3 && group.bytes().all(|byte| byte.is_ascii_digit());
    let is_grouped = first.trim_start_matches(['-', '+']).len() <= 3 && others.split(sign).all(is_group);
    let plain = || format!("{}.{}", whole.replace(sign, ""), &decimals[1..]).parse().ok();
    is_grouped.then(plain).flatten()
}

/// With its unit in the cell: `0.12 deg/s`, `23.4°C`.
pub(crate) fn with_unit(field: &str) -> Option<(Number, Unit)> {
    let parts = |at: usize| Some((number(&field[..at])?, Unit::parse(&field[at..])?));
    let at_blank = || parts(field.find(char::is_whitespace)?);
    // One letter behind whole numbers may be a digit.
    let at_letter = || {
        let at = field.find(|letter: char| letter.is_alphabetic() || letter == '°')?;
        parts(at).filter(|_| field[..at].contains('.') || field[at..].len() > 1)
    };
    field
        .starts_with(|first: char| first.is_ascii_digit() || "+-.".contains(first))
        .then(|| at_blank().or_else(at_letter))?
}

/// Both numerator and power of ten are exact.
const EXACT_DIGITS: usize = 15;

/// Up to 18 digits, or 15 with decimals; `None` for other texts.
fn short_number(field: &[u8]) -> Option<Number> {
    leading_number(field).filter(|(_, rest)| rest.is_empty()).map(|(number, _)| number)
}

/// At the start of `text`, and the rest.
#[inline]
pub(crate) fn leading_number(text: &[u8]) -> Option<(Number, &[u8])> {
    const POWERS: [f64; EXACT_DIGITS + 1] =
        [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
    const MOST: usize = 18;
    let is_negative = text.first() == Some(&b'-');
    let start = usize::from(is_negative);
    let (mut end, mut value, mut point) = (start, 0_i64, None);
    while let Some(byte) = text.get(end) {
        match byte.wrapping_sub(b'0') {
            digit if digit < 10 => value = value.wrapping_mul(10).wrapping_add(i64::from(digit)),
            _ if *byte == b'.' && point.is_none() => point = Some(end),
            _ => break,
        }
        end += 1;
    }
    let (length, rest) = (end - start, &text[end..]);
    if length == 0 || length > MOST {
        return None;
    }
    let Some(point) = point else {
        return Some((Number::Integer(if is_negative { -value } else { value }), rest));
    };
    let digits = length - 1;
    if digits == 0 || digits > EXACT_DIGITS {
        return None;
    }
    let size = value as f64 / POWERS[digits + start - point];
    Some((Number::Real(if is_negative { -size } else { size }), rest))
}

#[cfg(test)]
mod tests {
    use super::{MISSING, Number, list_lengths, number, separator_of, short_number, split};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_short_number_is_the_nearest_float_of_its_text() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut texts: Vec<String> = ["-0.0", "5.", ".5", "-.5", "0.1", "999999999999999.", ".000000000000001"]
            .into_iter()
            .map(str::to_owned)
            .collect();
        for _ in 0..20_000 {
            let mut text = random.random_range(0..1_000_000_000_000_000_u64).to_string();
            text.truncate(random.random_range(1..=15));
            text.insert(random.random_range(0..=text.len()), '.');
            texts.extend([format!("-{text}"), text]);
        }
        for text in texts {
            let expected = text.parse::<f64>().expect(&text);
            let found = short_number(text.as_bytes()).map(|number| number.value().to_bits());
            assert_eq!(found, Some(expected.to_bits()), "{text}");
        }
        assert_eq!(short_number(b"-123456789012345678"), Some(Number::Integer(-123_456_789_012_345_678)));
        for text in ["", "-", ".", "-.", "1.2.3", "1-2", "--1", "+1", "1e3", "1,5", " 1"] {
            assert_eq!(short_number(text.as_bytes()), None, "{text}");
        }
        for text in ["+1", "1e0", "1,0", "1.0000000000000000"] {
            assert_eq!(number(text).map(Number::value), Some(1.0), "{text}");
        }
        assert!(MISSING.iter().all(|text| number(text).is_some_and(|number| number.value().is_nan())));
    }

    #[test]
    fn fields_end_at_their_separator_unless_it_is_between_quotation_marks() {
        for (text, separator, expected) in [
            ("", Some(','), &[""][..]),
            ("1,,2,", Some(','), &["1", "", "2", ""]),
            (" 1 ;\u{a0}2\u{a0};\"3\"", Some(';'), &["1", "2", "3"]),
            ("\"a,b\" , \"c\"\"d\",\"", Some(','), &["a,b", "c\"\"d", "\""]),
            ("12:00:01.5 -> 1,2", Some(','), &["12:00:01.5", "1", "2"]),
            ("12:00:01.5 -> 1  2 ", None, &["12:00:01.5", "1", "2"]),
            ("\t1 \"2\"", None, &["1", "2"]),
            ("1°,2°", Some(','), &["1°", "2°"]),
            ("5,\"[0.1, -2, nan]\",[7]", Some(','), &["5", "0.1", "-2", "nan", "[7]"]),
            ("[s];[1 2];x", Some(';'), &["[s]", "1", "2", "x"]),
            ("5;0.1,-2,nan;x", Some(';'), &["5", "0.1", "-2", "nan", "x"]),
            ("1.5 m/s^2 2 °/s\tx", None, &["1.5 m/s^2", "2 °/s", "x"]),
            ("1.5 2 3 V", None, &["1.5", "2", "3", "V"]),
            ("ax: 1 g ay: 2 g", None, &["ax:", "1", "g", "ay:", "2", "g"]),
            ("[12.5] INFO imu: 1, 2", Some(','), &["12.5", "INFO", "imu", "1", "2"]),
            ("sensor 1,2,3", Some(','), &["sensor 1", "2", "3"]),
            ("imu ready: 5", None, &["imu", "ready:", "5"]),
        ] {
            assert_eq!(split(text, separator).collect::<Vec<_>>(), expected, "{text}");
        }
    }

    #[test]
    fn a_separator_in_a_cell_or_a_list_separates_no_columns() {
        for (text, separator, lengths) in [
            ("\"Time; s\",\"Gyro X; deg/s\"", Some(','), &[1, 1][..]),
            ("0.5,\"[1, 2, 3]\",7", Some(','), &[1, 3, 1]),
            ("0.5;[1, 2, 3];7", Some(';'), &[1, 3, 1]),
            ("1 2", None, &[1, 1]),
            ("1,5 2,5", None, &[1, 1]),
            ("0,1;0,2;ok", Some(';'), &[1, 1, 1]),
            ("1,2,3,a;b", Some(','), &[1, 1, 1, 1]),
            ("5|0.1,0.2,0.3", Some('|'), &[1, 3]),
            ("ax: 5, ay: 7", Some(','), &[1, 1]),
        ] {
            assert_eq!(separator_of(text), separator, "{text}");
            assert_eq!(list_lengths(text, separator), lengths, "{text}");
        }
    }
}
