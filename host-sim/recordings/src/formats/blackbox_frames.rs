//! Main frames of a blackbox log (Cleanflight, Betaflight and INAV, data version 2), decoded as the header of the log defines them.
//!
//! Each field has an encoding and a predictor, whose value was subtracted before the encoding. An I frame stands on its own; a P frame builds on
//! the two frames before it, and the first one after an I frame on this I frame alone: for it, both frames before are the I frame. Source:
//! `blackbox.c` and `blackbox_fielddefs.h` of Betaflight, and the decoder of its blackbox-tools.

/// Fields of a frame that are read at most; twice as many as the firmware's own decoder takes.
const MOST_FIELDS: usize = 256;
/// Bytes of a frame, and steps between frames, beyond which something is damaged (those of the firmware's own decoder).
const LONGEST_FRAME: usize = 256;
const LONGEST_STEP_US: i64 = 10_000_000;
const MOST_ITERATIONS: i64 = 5_000;

/// The first letter of every kind of frame.
const KINDS: &[u8] = b"IPSGHE";

/// How a field is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    /// 7 bits a byte, the lowest first; signs by zigzag.
    Signed,
    /// 7 bits a byte, the lowest first.
    Unsigned,
    /// The negative of 14 bits in two's complement.
    Negative14,
    /// Up to eight fields: a bit for each that is not 0, then these as `Signed`.
    Eight,
    /// Three fields of 2, 4, 6, or of 8 to 32 bits.
    Three,
    /// Four fields of 0, 4, 8 or 16 bits.
    Four,
    /// Nothing.
    Null,
}

impl Encoding {
    fn parse(number: &str) -> Result<Self, String> {
        Ok(match number {
            "0" => Self::Signed,
            "1" => Self::Unsigned,
            "3" => Self::Negative14,
            "6" => Self::Eight,
            "7" => Self::Three,
            "8" => Self::Four,
            "9" => Self::Null,
            other => return Err(format!("a field has the encoding {other}, which is not known")),
        })
    }
}

/// What was subtracted from a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Predictor {
    Constant(i64),
    Previous,
    /// Twice the previous value less the one before.
    StraightLine,
    /// The mean of both, rounded towards zero.
    Average,
    /// A field of the same frame that comes before.
    Field(usize),
    /// Not written: one more than before, and one for each loop that is not logged.
    Increment,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Field<'a> {
    pub(crate) name: &'a str,
    is_signed: bool,
    intra: Predictor,
    inter: Predictor,
}

/// Which loops of the controller are logged: those that divide by `every`, and `of` of `out_of` of the others.
#[derive(Debug, Clone, Copy)]
struct Interval {
    every: i64,
    of: i64,
    out_of: i64,
}

impl Interval {
    /// Loops after `iteration` that are not logged before the next one is.
    fn skipped(self, iteration: i64) -> i64 {
        let within = (iteration + 1).rem_euclid(self.every);
        let place = (within + self.of - 1) % self.out_of;
        if place < self.of { 0 } else { (self.out_of - place).min(self.every - within) }
    }
}

/// What was left out of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Damage {
    /// Places with bytes that are no frame, or a frame that cannot follow the one before; the end of the log is none.
    pub(crate) places: u64,
    /// P frames after such a place, whose I frame is missing.
    pub(crate) frames: u64,
}

/// One log, by its header.
#[derive(Debug, Clone)]
pub(crate) struct BlackboxLog<'a> {
    header: Vec<(&'a str, &'a str)>,
    frames: &'a [u8],
    fields: Vec<Field<'a>>,
    intra: Vec<Encoding>,
    inter: Vec<Encoding>,
    /// Encodings of the kinds of frames that are passed over.
    others: Vec<(u8, Vec<Encoding>)>,
    interval: Interval,
    iteration: Option<usize>,
    time: usize,
}

impl<'a> BlackboxLog<'a> {
    /// Reads the header of a log, which begins at the first of these bytes.
    ///
    /// # Errors
    ///
    /// What is missing in the header, or is not known.
    pub(crate) fn parse(log: &'a [u8]) -> Result<Self, String> {
        let (header, frames) = split_header(log);
        let value = |name: &str| value(&header, name);
        let list = |kind: &str, property: &str| {
            value(&format!("Field {kind} {property}")).map(|line| line.split(',').map(str::trim).collect::<Vec<_>>())
        };
        let needed = |kind: &str, property: &str| {
            list(kind, property).ok_or_else(|| format!("its header has no line `Field {kind} {property}`"))
        };
        match value("Data version") {
            Some("2") => {}
            other => return Err(format!("it has data version {}, and 2 is read", other.unwrap_or("1"))),
        }
        let names = needed("I", "name")?;
        let lines = [needed("I", "predictor")?, needed("P", "predictor")?, needed("I", "encoding")?];
        let [intra, inter, intra_encoding] = lines;
        let inter_encoding = needed("P", "encoding")?;
        let signed = list("I", "signed").unwrap_or_else(|| vec!["0"; names.len()]);
        let lengths = [intra.len(), inter.len(), intra_encoding.len(), inter_encoding.len(), signed.len()];
        if names.len() > MOST_FIELDS || lengths.iter().any(|length| *length != names.len()) {
            return Err(format!("its header has {} fields, and {lengths:?} of their properties", names.len()));
        }
        let constants = Constants {
            least_throttle: number(value("minthrottle")),
            battery: number(value("vbatref")),
            least_motor: number(value("motorOutput").and_then(|ends| ends.split(',').next())),
            motor: names.iter().position(|name| *name == "motor[0]"),
        };
        let field = |at: usize| -> Result<Field<'a>, String> {
            let predictor = |number| constants.predictor(at, number);
            let (intra, inter) = (predictor(intra[at])?, predictor(inter[at])?);
            Ok(Field { name: names[at], is_signed: signed[at] == "1", intra, inter })
        };
        let encodings = |numbers: Vec<&str>| numbers.into_iter().map(Encoding::parse).collect::<Result<Vec<_>, _>>();
        let mut others = Vec::new();
        for (kind, name) in [(b'S', "S"), (b'G', "G"), (b'H', "H")] {
            if let Some(numbers) = list(name, "encoding").filter(|numbers| numbers.len() <= MOST_FIELDS) {
                others.push((kind, encodings(numbers)?));
            }
        }
        let ratio = value("P interval").unwrap_or("1");
        let (of, out_of) = ratio.split_once('/').unwrap_or(("1", ratio));
        let at_least_one = |text: Option<&str>| number(text).unwrap_or(1).max(1);
        Ok(Self {
            fields: (0..names.len()).map(field).collect::<Result<_, _>>()?,
            intra: encodings(intra_encoding)?,
            inter: encodings(inter_encoding)?,
            interval: Interval {
                every: at_least_one(value("I interval")),
                of: at_least_one(Some(of)),
                out_of: at_least_one(Some(out_of)),
            },
            iteration: names.iter().position(|name| *name == "loopIteration"),
            time: names.iter().position(|name| *name == "time").ok_or("it has no field `time`")?,
            others,
            frames,
            header,
        })
    }

    pub(crate) fn fields(&self) -> &[Field<'a>] {
        &self.fields
    }

    /// The value of a line such as `H acc_1G:2048` of the header.
    pub(crate) fn header(&self, name: &str) -> Option<&'a str> {
        value(&self.header, name)
    }

    /// Gives the fields of every main frame and its time in us since the controller started, until `each` fails.
    pub(crate) fn for_each_frame<E>(&self, mut each: impl FnMut(&[i64], i64) -> Result<(), E>) -> Result<Damage, E> {
        let mut bytes = Bytes { bytes: self.frames, at: 0 };
        let (mut damage, mut is_damaged) = (Damage::default(), false);
        let mut history: Option<[Vec<i64>; 2]> = None;
        // Number and time of the last frame, and of an I frame that cannot follow it but may be followed.
        let (mut last, mut candidate) = (None, None);
        while let Some(kind) = bytes.byte() {
            let start = bytes.at;
            let frame = self.frame(kind, &mut bytes, history.as_ref(), last.map_or(0, |(iteration, _)| iteration));
            let is_whole = bytes.at - start < LONGEST_FRAME && bytes.peek().is_none_or(|next| KINDS.contains(&next));
            let Some(frame) = frame.filter(|_| is_whole) else {
                is_damaged = true;
                history = None;
                bytes.at = start;
                continue;
            };
            damage.places += u64::from(std::mem::take(&mut is_damaged));
            let mut fields = match frame {
                Frame::Main(fields) => fields,
                Frame::Orphan => {
                    damage.frames += 1;
                    continue;
                }
                Frame::Resume { iteration, time } => {
                    last = Some((iteration, later(last, time)));
                    continue;
                }
                Frame::End => break,
                Frame::Other => continue,
            };
            let iteration = self.iteration.map_or(0, |at| fields[at]);
            let now = |before| (iteration, later(before, fields[self.time]));
            let follows = |before: Option<(i64, i64)>| {
                before.is_some_and(|before: (i64, i64)| {
                    let (iteration, time) = now(Some(before));
                    (0..MOST_ITERATIONS).contains(&(iteration - before.0)) && time - before.1 < LONGEST_STEP_US
                })
            };
            let before = match kind {
                _ if last.is_none() || follows(last) => last,
                b'I' if follows(candidate) => candidate,
                _ => {
                    candidate = (kind == b'I').then(|| now(last)).or(candidate);
                    history = None;
                    damage.places += 1;
                    continue;
                }
            };
            let (_, time) = now(before);
            (last, candidate) = (Some((iteration, time)), None);
            each(&fields, time)?;
            history = Some(match (kind, history.take()) {
                (b'P', Some([previous, mut before])) => {
                    std::mem::swap(&mut before, &mut fields);
                    [before, previous]
                }
                _ => [fields.clone(), fields],
            });
        }
        Ok(damage)
    }

    /// The frame of this kind that begins here; `None` where it is none.
    fn frame(&self, kind: u8, bytes: &mut Bytes, history: Option<&[Vec<i64>; 2]>, last: i64) -> Option<Frame> {
        match (kind, history) {
            (b'I', _) => {
                let fields = self.fields.iter().map(|field| field.intra);
                Some(Frame::Main(self.predicted(bytes.fields(&self.intra)?, fields, [None, None], last)))
            }
            (b'P', None) => bytes.fields(&self.inter).map(|_| Frame::Orphan),
            (b'P', Some([previous, before])) => {
                let fields = self.fields.iter().map(|field| field.inter);
                let history = [Some(previous), Some(before)];
                Some(Frame::Main(self.predicted(bytes.fields(&self.inter)?, fields, history, last)))
            }
            (b'E', _) => bytes.event(),
            _ => {
                let (_, encodings) = self.others.iter().find(|(other, _)| *other == kind)?;
                bytes.fields(encodings).map(|_| Frame::Other)
            }
        }
    }

    /// Adds to the fields, one after the other, what their predictors say.
    fn predicted(
        &self,
        mut fields: Vec<i64>,
        predictors: impl Iterator<Item = Predictor>,
        history: [Option<&Vec<i64>>; 2],
        last: i64,
    ) -> Vec<i64> {
        for (at, predictor) in predictors.enumerate() {
            let [previous, before] = history.map(|frame| frame.map_or(0, |frame| frame[at]));
            let value = match predictor {
                Predictor::Constant(constant) => fields[at] + constant,
                Predictor::Previous => fields[at] + previous,
                Predictor::StraightLine => fields[at] + 2 * previous - before,
                Predictor::Average => fields[at] + (previous + before) / 2,
                Predictor::Field(other) => fields[at] + fields[other],
                Predictor::Increment => previous + 1 + self.interval.skipped(last),
            };
            // The controller counts in 32 bits.
            fields[at] = if self.fields[at].is_signed { i64::from(value as i32) } else { i64::from(value as u32) };
        }
        fields
    }
}

/// The time of a 32-bit clock, us, at or after the last one.
fn later(last: Option<(i64, i64)>, time: i64) -> i64 {
    last.map_or(time, |(_, last)| last + i64::from((time as u32).wrapping_sub(last as u32)))
}

/// Lines `H NAME:VALUE`, and what comes after them.
fn split_header(log: &[u8]) -> (Vec<(&str, &str)>, &[u8]) {
    let (mut header, mut rest) = (Vec::new(), log);
    while let Some(line) = rest.strip_prefix(b"H ") {
        let Some(end) = line.iter().position(|byte| *byte == b'\n') else { break };
        let Some(pair) = std::str::from_utf8(&line[..end]).ok().and_then(|line| line.split_once(':')) else { break };
        header.push((pair.0.trim(), pair.1.trim()));
        rest = &line[end + 1..];
    }
    (header, rest)
}

fn value<'a>(header: &[(&'a str, &'a str)], name: &str) -> Option<&'a str> {
    header.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
}

fn number(text: Option<&str>) -> Option<i64> {
    text?.trim().parse::<i32>().ok().map(i64::from)
}

/// What the header says of the predictors.
struct Constants {
    least_throttle: Option<i64>,
    battery: Option<i64>,
    least_motor: Option<i64>,
    /// Position of `motor[0]`.
    motor: Option<usize>,
}

impl Constants {
    /// The predictor with this number of the field at `at`.
    fn predictor(&self, at: usize, number: &str) -> Result<Predictor, String> {
        let missing = |what: &str| format!("a field is predicted by `{what}`, which its header does not have");
        let constant = |value: Option<i64>, what| value.map(Predictor::Constant).ok_or_else(|| missing(what));
        match number {
            "0" => Ok(Predictor::Constant(0)),
            "1" => Ok(Predictor::Previous),
            "2" => Ok(Predictor::StraightLine),
            "3" => Ok(Predictor::Average),
            "4" => constant(self.least_throttle, "minthrottle"),
            "5" => self.motor.filter(|motor| *motor < at).map(Predictor::Field).ok_or_else(|| missing("motor[0]")),
            "6" => Ok(Predictor::Increment),
            "8" => Ok(Predictor::Constant(1500)),
            "9" => constant(self.battery, "vbatref"),
            "11" => constant(self.least_motor, "motorOutput"),
            other => Err(format!("a field has the predictor {other}, which is not known")),
        }
    }
}

/// What a frame is for the reader of main frames.
enum Frame {
    Main(Vec<i64>),
    /// A P frame without the frame that it builds on.
    Orphan,
    /// Logging goes on after a pause.
    Resume {
        iteration: i64,
        time: i64,
    },
    End,
    Other,
}

/// Bytes of frames, of which some are read.
struct Bytes<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Bytes<'_> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn byte(&mut self) -> Option<u8> {
        let byte = self.peek()?;
        self.at += 1;
        Some(byte)
    }

    fn unsigned(&mut self) -> Option<u32> {
        let mut value = 0;
        for shift in (0..32).step_by(7) {
            let byte = u32::from(self.byte()?);
            value |= (byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    fn signed(&mut self) -> Option<i64> {
        let value = self.unsigned()?;
        Some(i64::from((value >> 1) as i32 ^ -((value & 1) as i32)))
    }

    /// Fields with these encodings.
    fn fields(&mut self, encodings: &[Encoding]) -> Option<Vec<i64>> {
        let mut fields = Vec::with_capacity(encodings.len());
        while let Some(encoding) = encodings.get(fields.len()) {
            match encoding {
                Encoding::Signed => fields.push(self.signed()?),
                Encoding::Unsigned => fields.push(i64::from(self.unsigned()?)),
                Encoding::Negative14 => fields.push(-signed(self.unsigned()?, 14)),
                Encoding::Null => fields.push(0),
                Encoding::Three => fields.extend(self.three()?),
                Encoding::Four => fields.extend(self.four()?),
                Encoding::Eight => {
                    let rest = encodings[fields.len()..].iter().take(8);
                    let count = rest.take_while(|other| **other == Encoding::Eight).count();
                    // One alone has no byte that says whether it is 0.
                    let present = if count == 1 { 1 } else { self.byte()? };
                    for bit in 0..count {
                        fields.push(if present >> bit & 1 == 1 { self.signed()? } else { 0 });
                    }
                }
            }
        }
        (fields.len() == encodings.len()).then_some(fields)
    }

    /// Three fields, whose size is in the upper bits of the first byte.
    fn three(&mut self) -> Option<[i64; 3]> {
        let first = self.byte()?;
        let (values, bits) = match first >> 6 {
            0 => ([first >> 4, first >> 2, first], 2),
            1 => {
                let second = self.byte()?;
                ([first, second >> 4, second], 4)
            }
            2 => ([first, self.byte()?, self.byte()?], 6),
            _ => {
                let mut values = [0; 3];
                for (at, value) in values.iter_mut().enumerate() {
                    let size = 1 + u32::from(first >> (2 * at) & 3);
                    let mut raw = 0;
                    for byte in 0..size {
                        raw |= u32::from(self.byte()?) << (8 * byte);
                    }
                    *value = signed(raw, 8 * size);
                }
                return Some(values);
            }
        };
        Some(values.map(|value| signed(u32::from(value), bits)))
    }

    /// Four fields of 0, 1, 2 or 4 half bytes, the upper half first; half a byte that is left over is none.
    fn four(&mut self) -> Option<[i64; 4]> {
        let sizes = self.byte()?;
        let mut lower = None;
        let mut values = [0; 4];
        for (at, value) in values.iter_mut().enumerate() {
            let size = [0, 1, 2, 4][usize::from(sizes >> (2 * at) & 3)];
            let mut raw = 0;
            for _ in 0..size {
                let half = match lower.take() {
                    Some(half) => half,
                    None => {
                        let byte = self.byte()?;
                        lower = Some(byte & 0xf);
                        byte >> 4
                    }
                };
                raw = raw << 4 | u32::from(half);
            }
            *value = if size == 0 { 0 } else { signed(raw, 4 * size) };
        }
        Some(values)
    }

    fn event(&mut self) -> Option<Frame> {
        const END: &[u8] = b"End of log";
        match self.byte()? {
            // A beep, disarming, and a fault of the sensor.
            0 | 15 | 40 => _ = self.unsigned()?,
            // An adjustment: a float, or a number.
            13 => {
                let bytes = if self.byte()? >= 0x80 { 4 } else { 0 };
                for _ in 0..bytes {
                    self.byte()?;
                }
                if bytes == 0 {
                    self.signed()?;
                }
            }
            14 => {
                let (iteration, time) = (self.unsigned()?, self.unsigned()?);
                return Some(Frame::Resume { iteration: iteration.into(), time: time.into() });
            }
            // Flight modes, of now and of before.
            30 => _ = (self.unsigned()?, self.unsigned()?),
            255 if self.bytes[self.at..].starts_with(END) => {
                self.at = self.bytes.len();
                return Some(Frame::End);
            }
            _ => return None,
        }
        Some(Frame::Other)
    }
}

/// The lowest `bits` of a number, in two's complement.
fn signed(value: u32, bits: u32) -> i64 {
    let unused = 32 - bits;
    i64::from((value << unused) as i32 >> unused)
}

#[cfg(test)]
mod tests {
    use super::{BlackboxLog, Bytes, Damage, Encoding, Interval};
    use std::convert::Infallible;

    /// The header of a log with four fields, of which two are predicted by the mean of the two frames before and by a straight line.
    const HEADER: &str = "H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\nH I interval:8\nH P interval:2\n\
        H Field I name:loopIteration,time,accSmooth[0],debug[0]\nH Field I signed:0,0,1,1\nH Field I predictor:0,0,0,8\n\
        H Field I encoding:1,1,0,0\nH Field P predictor:6,2,3,2\nH Field P encoding:9,0,0,0\nH Field S encoding:1,1\n";

    /// Time and fields of every frame, and what was left out.
    fn decoded(frames: &[u8]) -> (Vec<(i64, Vec<i64>)>, Damage) {
        let log = [HEADER.as_bytes(), frames].concat();
        let log = BlackboxLog::parse(&log).expect("a header");
        let mut found = Vec::new();
        let Ok(damage) = log.for_each_frame(|fields, time| -> Result<(), Infallible> {
            found.push((time, fields.to_vec()));
            Ok(())
        });
        (found, damage)
    }

    /// An I frame: 7 bits a byte, signs by zigzag.
    fn intra(iteration: u8, time: u32, force: u8, debug: u8) -> Vec<u8> {
        let mut frame = vec![b'I', iteration];
        let mut rest = time;
        while rest > 127 {
            frame.push(rest as u8 | 128);
            rest >>= 7;
        }
        frame.extend([rest as u8, 2 * force, 2 * debug]);
        frame
    }

    #[test]
    fn a_frame_after_an_i_frame_builds_on_this_frame_alone() {
        // Forces 10, 30, 20 | 40, 40, 41; the field that grows evenly is 1500, 1503, 1506 | 1550, 1551, 1552. In the first P frame both
        // frames before are the I frame, whatever came before that: 30 is 20 above the mean of 10 and 10, 20 is the mean of 10 and 30.
        let frames = [
            intra(0, 1000, 10, 0),
            vec![b'P', 20, 40, 6],
            vec![b'P', 0, 0, 0],
            intra(8, 1080, 40, 50),
            vec![b'P', 20, 0, 2],
            vec![b'P', 2, 2, 0],
        ];
        let (found, damage) = decoded(&frames.concat());
        let expected = [
            (1000, vec![0, 1000, 10, 1500]),
            (1010, vec![2, 1010, 30, 1503]),
            (1020, vec![4, 1020, 20, 1506]),
            (1080, vec![8, 1080, 40, 1550]),
            (1090, vec![10, 1090, 40, 1551]),
            (1101, vec![12, 1101, 41, 1552]),
        ];
        assert_eq!(found, expected);
        assert_eq!(damage, Damage::default());
    }

    #[test]
    fn frames_after_a_damaged_place_wait_for_an_i_frame() {
        let frames = [
            intra(0, 1000, 10, 0),
            vec![b'P', 20, 40, 6],
            // A byte was lost: what follows the frame is no frame.
            vec![b'P', 0, 0],
            vec![b'S', 1, 2],
            // Its values are those of a sound frame, but of nothing that was read.
            vec![b'P', 0, 0, 0],
            intra(8, 1080, 40, 50),
            vec![b'P', 20, 0, 2],
            b"E\xffEnd of log\0P".to_vec(),
        ];
        let (found, damage) = decoded(&frames.concat());
        let forces: Vec<i64> = found.iter().map(|(_, fields)| fields[2]).collect();
        assert_eq!(forces, [10, 30, 40, 40]);
        assert_eq!(damage, Damage { places: 1, frames: 1 });
    }

    #[test]
    fn a_clock_of_32_bits_goes_on_after_it_has_wrapped() {
        let wrap = 1_i64 << 32;
        let frames = [
            intra(0, u32::MAX - 4, 10, 0),
            vec![b'P', 20, 0, 0],
            intra(8, 75, 10, 0),
            // A pause of an hour, which the log says, and one that is none: the time of the last frame is damaged.
            [&b"E\x0e\x10"[..], &intra(16, 3_600_000_000, 0, 0)[2..7]].concat(),
            intra(16, 3_600_000_000, 10, 0),
            intra(24, 1_000, 10, 0),
        ];
        let (found, damage) = decoded(&frames.concat());
        let times: Vec<i64> = found.iter().map(|(time, _)| *time).collect();
        assert_eq!(times, [wrap - 5, wrap + 5, wrap + 75, wrap + 3_600_000_000]);
        assert_eq!(damage, Damage { places: 1, frames: 0 });
    }

    #[test]
    fn every_encoding_is_that_of_the_firmware() {
        let read = |encodings: &[Encoding], bytes: &[u8]| {
            let mut reader = Bytes { bytes, at: 0 };
            let fields = reader.fields(encodings);
            (reader.at == bytes.len()).then_some(fields).flatten()
        };
        assert_eq!(
            read(&[Encoding::Signed; 3], &[3, 0xd8, 4, 0xff, 0xff, 0xff, 0xff, 15]),
            Some(vec![-2, 300, -(1 << 31)])
        );
        assert_eq!(read(&[Encoding::Unsigned], &[0xff, 0xff, 0xff, 0xff, 15]), Some(vec![(1 << 32) - 1]));
        assert_eq!(read(&[Encoding::Unsigned], &[0xff, 0xff, 0xff, 0xff, 0xff, 1]), None);
        assert_eq!(read(&[Encoding::Negative14], &[5]), Some(vec![-5]));
        assert_eq!(read(&[Encoding::Negative14], &[0xff, 0x7f]), Some(vec![1]));
        assert_eq!(read(&[Encoding::Eight; 3], &[0b101, 1, 4]), Some(vec![-1, 0, 2]));
        // A group has eight at most, and one alone has no bits before it.
        assert_eq!(read(&[Encoding::Eight; 9], &[0, 4]), Some(vec![0, 0, 0, 0, 0, 0, 0, 0, 2]));
        assert_eq!(read(&[Encoding::Three; 3], &[0b00_01_10_11]), Some(vec![1, -2, -1]));
        assert_eq!(read(&[Encoding::Three; 3], &[0b0100_1000, 0x7f]), Some(vec![-8, 7, -1]));
        assert_eq!(read(&[Encoding::Three; 3], &[0b10_100000, 31, 63]), Some(vec![-32, 31, -1]));
        // 16, 8 and 24 bits, the lowest byte first.
        assert_eq!(
            read(&[Encoding::Three; 3], &[0b11_10_00_01, 0, 2, 0x80, 0, 0, 0x80]),
            Some(vec![512, -128, -(1 << 23)])
        );
        assert_eq!(
            read(&[Encoding::Three; 3], &[0xff, 1, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0x80]),
            Some(vec![1, 2, -(1 << 31)])
        );
        // 4, 8, 16 and 0 bits: half bytes 7, f0, 1234, and one that is left over.
        assert_eq!(read(&[Encoding::Four; 4], &[0b00_11_10_01, 0x7f, 0x01, 0x23, 0x40]), Some(vec![7, -16, 0x1234, 0]));
        assert_eq!(read(&[Encoding::Four; 3], &[0]), None);
    }

    #[test]
    fn loops_that_are_not_logged_are_counted() {
        // Of loops 0 to 7 every second one, and each that divides by 8.
        let half = Interval { every: 8, of: 1, out_of: 2 };
        assert_eq!([0, 2, 6, 8].map(|last| half.skipped(last)), [1, 1, 1, 1]);
        // Of 32 loops two thirds: those whose number plus 1 leaves 0 or 1 by 3.
        let thirds = Interval { every: 32, of: 2, out_of: 3 };
        let mut logged = vec![0];
        while let Some(last) = logged.last().copied().filter(|last| *last < 33) {
            logged.push(last + 1 + thirds.skipped(last));
        }
        let expected: Vec<i64> =
            (0..40).filter(|loops| (loops % 32 + 1) % 3 < 2).take_while(|loops| *loops <= 34).collect();
        assert_eq!(logged, expected);
    }

    #[test]
    fn what_a_header_lacks_is_said() {
        for (from, to, expected) in [
            ("version:2", "version:1", "data version 1"),
            ("predictor:6,2,3,2", "predictor:6,2,7,2", "predictor 7"),
            ("predictor:6,2,3,2", "predictor:6,2,9,2", "`vbatref`"),
            ("encoding:9,0,0,0", "encoding:9,0,10,0", "encoding 10"),
            ("encoding:9,0,0,0", "encoding:9,0,0", "4 fields"),
            ("Field P predictor", "Field Q predictor", "`Field P predictor`"),
            (",time,", ",tide,", "`time`"),
        ] {
            let log = HEADER.replace(from, to);
            let error = BlackboxLog::parse(log.as_bytes()).expect_err("no log");
            assert!(error.contains(expected), "{error}");
        }
    }
}
