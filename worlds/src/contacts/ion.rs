//! ION contact plans: the `a contact` and `a range` commands of `ionrc(5)`, read and written.
//!
//! ```text
//! # times are +seconds, or yyyy/mm/dd-hh:mm:ss
//! @ 2031/04/01-00:00:00
//! a range   +0  +3600  1 2  1.28                from 1 to 2, and back unless `2 1` is given
//! a contact +60 +120   1 2  16000  0.9          bytes per second, confidence
//! ```
//!
//! ION takes whole seconds, bytes per second and light seconds; this reader takes decimals, too.
//! What does not touch the contacts of the plan is skipped: every other command, contacts that
//! register a node (`-1` as start), and hypothetical ones (`0` as start or stop). Of a file for
//! several programs, the parts from `## begin ionadmin` to `## end ionadmin` are read, as ionstart
//! does.
//!
//! Sources: ionrc(5); `ici/utils/ionadmin.c`, ION 4.1.

mod edits;
mod ranges;
mod time;

use std::fmt::Write;

use farside::{SimDuration, SimTime};

use super::build::{self, Found, Overlaps, RawContact};
use super::error::shown;
use super::{ContactError, ContactPlan, ContactProblem, MAX_RATE_BIT_PER_S, text_of};
use crate::decimal::{scaled, unscaled};
use edits::Entries;
use ranges::{Range, Ranges};
use time::{Stamp, TimeLine};

const CONTACT_FORM: &str = "a contact start stop from to bytes_per_second [confidence]";
const RANGE_FORM: &str = "a range start stop from to light_seconds";
const AT_FORM: &str = "@ time";

/// Commands of `ionadmin` that say nothing about contacts.
const SKIPPED: [&str; 17] = [
    "!", "?", "1", "^", "b", "e", "h", "i", "l", "m", "q", "r", "s", "t", "v", "w", "x",
];

/// What `contact` or `range` is expected behind, and what was meant if it is another word.
const KINDS: [&str; 2] = ["contact", "range"];

/// A contact whose times are not yet counted from the plan's beginning.
struct Contact {
    from: u32,
    to: u32,
    start: Stamp,
    stop: Stamp,
    rate_bit_per_s: u64,
    confidence: Option<f64>,
    line: usize,
}

/// All that a file says.
#[derive(Default)]
struct Reader {
    found: Found,
    times: TimeLine,
    contacts: Entries<Contact>,
    ranges: Entries<Range<Stamp>>,
    /// The first line that counts from an instant that the file does not tell.
    relative: Option<usize>,
    /// Whether a line has a date.
    dated: bool,
}

impl ContactPlan {
    /// Reads the contacts and ranges of an ION `ionrc` file, or of the part for `ionadmin` of a
    /// file for several programs. A contact has the light time of the range that covers its
    /// beginning, also when that range ends; one that begins within a contact splits it. A range
    /// from a lower to a higher node number holds for the way back, too, while the file has none
    /// for that way. A contact without a range is passed over, with a remark, unless
    /// [`read`](ContactPlan::read) is given a light time.
    ///
    /// The plan counts from the time that the first `@` line with a date sets; without one, from
    /// the earliest date in the file; without dates, from what `+0` means.
    ///
    /// ```
    /// use farside_worlds::contacts::ContactPlan;
    /// let text = "
    ///     a range   2031/04/01-00:00:00 2031/04/02-00:00:00  1 2  0.5
    ///     a contact 2031/04/01-00:01:00 2031/04/01-00:02:00  2 1  1000
    /// ";
    /// let plan = ContactPlan::from_ion(text.as_bytes())?;
    /// let window = plan.contact_windows("2", "1")[0];
    /// assert_eq!(window.start.to_string(), "60s");
    /// assert_eq!(window.owlt.to_string(), "500ms");
    ///
    /// let error = ContactPlan::from_ion(b"a contact +0 +60 1 2").unwrap_err();
    /// assert!(error.to_string().starts_with("line 1: the rate in bytes per second is missing"));
    /// # Ok::<(), farside_worlds::contacts::ContactError>(())
    /// ```
    ///
    /// # Errors
    /// With the line, when the text is no such file, has more than 16 MiB or 200,000 contacts, or
    /// says what cannot be: contacts of one ordered pair that overlap, no contact with a range. All
    /// faults are told at once, up to [`MAX_FAULTS`](super::MAX_FAULTS).
    pub fn from_ion(bytes: &[u8]) -> Result<ContactPlan, ContactError> {
        read(bytes, None)
    }

    /// The plan as an ION file, which [`ContactPlan::from_ion`] reads back to an equal one, if the
    /// plan begins with a relative time as here. ION itself reads whole numbers only: it takes the
    /// file if all times, light times and rates in bytes per second are whole. ION knows no contact
    /// without a limit of its rate: the highest there is stands in its place.
    ///
    /// ```
    /// use farside_worlds::contacts::ContactPlan;
    /// let plan = ContactPlan::from_ion(b"a range +0 +9 1 2 1\na contact +0 +9 1 2 50")?;
    /// assert_eq!(plan.to_ion(), "a range +0 +9 1 2 1\na contact +0 +9 1 2 50\n");
    /// # Ok::<(), farside_worlds::contacts::ContactError>(())
    /// ```
    pub fn to_ion(&self) -> String {
        let mut text = String::new();
        for contact in self.contacts() {
            let window = contact.window;
            let [start, stop, owlt] = [
                window.start.as_nanos(),
                window.end.as_nanos(),
                window.owlt.as_nanos(),
            ]
            .map(|nanos| unscaled(nanos, 9));
            let times_and_nodes = format!("+{start} +{stop} {} {}", contact.from, contact.to);
            // A bit is 0.125 bytes, so three decimal places hold any rate.
            let rate = window.rate_bit_per_s.unwrap_or(MAX_RATE_BIT_PER_S);
            let rate = unscaled(rate * 125, 3);
            let confidence = contact.confidence;
            let confidence = confidence.map_or_else(String::new, |share| format!(" {share}"));
            writeln!(text, "a range {times_and_nodes} {owlt}").expect("a String takes any text");
            writeln!(text, "a contact {times_and_nodes} {rate}{confidence}")
                .expect("a String takes any text");
        }
        text
    }
}

/// Reads a plan; contacts without a range have the light time that is given, or are passed over.
pub(super) fn read(
    bytes: &[u8],
    light_time: Option<SimDuration>,
) -> Result<ContactPlan, ContactError> {
    let text = text_of(bytes)?;
    let mut reader = Reader::default();
    let is_combined = text.lines().any(|line| program(line).is_some());
    let mut is_ours = !is_combined;
    for (index, line) in text.split('\n').enumerate() {
        if let Some((is_begin, name)) = program(line) {
            is_ours = is_begin && name == "ionadmin";
        }
        if !is_ours {
            continue;
        }
        let read = reader.line(Words::new(line, index + 1));
        if let Err(error) = read {
            let is_last = matches!(
                error,
                ContactError::At {
                    problem: ContactProblem::TooMany { .. },
                    ..
                }
            );
            reader.found.faults.push(error);
            if is_last {
                break;
            }
        }
    }
    reader.finish(light_time)
}

/// Of a line `## begin NAME` or `## end NAME` in a file for several programs: which of both, and
/// the program.
fn program(line: &str) -> Option<(bool, &str)> {
    let mut words = line.trim_start().strip_prefix("##")?.split_whitespace();
    match (words.next()?, words.next()?) {
        ("begin", name) => Some((true, name)),
        ("end", name) => Some((false, name)),
        _ => None,
    }
}

impl Reader {
    fn line(&mut self, mut words: Words<'_>) -> Result<(), ContactError> {
        let Some(command) = words.next() else {
            return Ok(());
        };
        match command.text {
            "a" => match words.next() {
                Some(word) if word.text == "contact" => self.contact(&mut words),
                Some(word) if word.text == "range" => self.range(&mut words),
                Some(word) => Err(words.directive(word, "contact or range", &KINDS)),
                None => Err(words.missing("contact or range", CONTACT_FORM)),
            },
            "c" | "d" => self.edit(command.text == "c", &mut words),
            "@" => {
                let stamp = self.time(&mut words, "reference time", AT_FORM)?;
                words.end(AT_FORM)?;
                self.times.refer_to(stamp);
                Ok(())
            }
            skipped if SKIPPED.contains(&skipped) => Ok(()),
            _ => Err(words.directive(
                command,
                "a command of ionrc(5), such as `a contact` or `a range`",
                &["a", "a contact", "a range"],
            )),
        }
    }

    /// Notes what is wrong with a field, so that the rest of its line is read, too.
    fn note<T>(&mut self, field: Result<T, ContactError>) -> Result<Option<T>, ContactError> {
        match field {
            Err(error) if error.ends_it() => Err(error),
            field => Ok(self.found.faults.note(field)),
        }
    }

    fn contact(&mut self, words: &mut Words<'_>) -> Result<(), ContactError> {
        // A node registers in a region: no contact.
        if words.peek() == Some("-1") {
            return Ok(());
        }
        let is_hypothetical = |text: &str| text.starts_with('0') && !text.contains('/');
        let hypothetical = || "the contact is hypothetical: it is passed over".to_owned();
        let line = words.number;
        if words.peek().is_some_and(is_hypothetical) {
            self.found.remarks.push(line, hypothetical);
            return Ok(());
        }
        let start = self.counted_time(words, "start time", CONTACT_FORM)?;
        if words.peek().is_some_and(is_hypothetical) {
            self.found.remarks.push(line, hypothetical);
            return Ok(());
        }
        let stop = self.counted_time(words, "stop time", CONTACT_FORM)?;
        let from = self.node(words, "sending node", CONTACT_FORM)?;
        let to = self.node(words, "receiving node", CONTACT_FORM)?;
        let rate = words.field("rate in bytes per second", CONTACT_FORM)?;
        let rate_bit_per_s = self.note(words.rate(rate))?;
        let confidence = words.next().map(|word| words.confidence(word));
        let confidence = self.note(confidence.transpose())?;
        words.end(CONTACT_FORM)?;
        let (Some(start), Some(stop)) = (start, stop) else {
            return Ok(());
        };
        let all = (from, to, rate_bit_per_s, confidence);
        let (Some(from), Some(to), Some(rate_bit_per_s), Some(confidence)) = all else {
            return Ok(());
        };
        let contact = Contact {
            from,
            to,
            start,
            stop,
            rate_bit_per_s,
            confidence,
            line,
        };
        self.contacts
            .push((from, to, start), contact, "contacts", line)
    }

    fn range(&mut self, words: &mut Words<'_>) -> Result<(), ContactError> {
        let start = self.counted_time(words, "start time", RANGE_FORM)?;
        let stop = self.counted_time(words, "stop time", RANGE_FORM)?;
        let from = self.node(words, "first node", RANGE_FORM)?;
        let to = self.node(words, "second node", RANGE_FORM)?;
        let owlt = words.field("distance in light seconds", RANGE_FORM)?;
        let owlt_ns = scaled(owlt.text, 9).map_err(|error| {
            let expected = "light seconds, such as 1.28";
            words.at(
                owlt,
                build::bad_number("distance", owlt.text, error, expected),
            )
        });
        let owlt_ns = self.note(owlt_ns)?;
        words.end(RANGE_FORM)?;
        let all = (start, stop, from, to, owlt_ns);
        let (Some(start), Some(stop), Some(from), Some(to), Some(owlt_ns)) = all else {
            return Ok(());
        };
        let range = Range {
            from,
            to,
            start,
            stop,
            owlt_ns,
            line: words.number,
        };
        self.ranges
            .push((from, to, start), range, "ranges", words.number)
    }

    fn time(
        &mut self,
        words: &mut Words<'_>,
        field: &'static str,
        form: &'static str,
    ) -> Result<Stamp, ContactError> {
        let word = words.field(field, form)?;
        let stamp = self.times.read(word.text);
        stamp.map_err(|expected| words.bad(word, field, expected))
    }

    /// The time of a contact or range; `None` once it is noted what is wrong with it.
    fn counted_time(
        &mut self,
        words: &mut Words<'_>,
        field: &'static str,
        form: &'static str,
    ) -> Result<Option<Stamp>, ContactError> {
        let stamp = self.time(words, field, form);
        let stamp = self.note(stamp)?;
        match stamp {
            Some(Stamp::Relative(_)) => {
                self.relative.get_or_insert(words.number);
            }
            Some(Stamp::Absolute(_)) => self.dated = true,
            None => {}
        }
        Ok(stamp)
    }

    fn node(
        &mut self,
        words: &mut Words<'_>,
        field: &'static str,
        form: &'static str,
    ) -> Result<Option<u32>, ContactError> {
        let word = words.field(field, form)?;
        let number = self.found.nodes.number(word.text, words.number);
        self.note(number.ok_or_else(|| words.bad(word, field, build::NODE_EXPECTED)))
    }

    /// Counts all times from the plan's beginning and gives contacts their light times.
    fn finish(mut self, light_time: Option<SimDuration>) -> Result<ContactPlan, ContactError> {
        if let (Some(line), true, false) = (self.relative, self.dated, self.times.is_dated()) {
            let mixed = ContactError::at(line, ContactProblem::MixedTimes);
            self.found.faults.push(mixed);
            self.found.faults.check()?;
            return Err(ContactError::Empty { what: "contact" });
        }
        let contact_times = self.contacts.iter().flat_map(|c| [c.start, c.stop]);
        let range_times = self.ranges.iter().flat_map(|r| [r.start, r.stop]);
        let clock = self.times.clock(contact_times.chain(range_times));
        let mut found = self.found;
        let mut ranges = Vec::new();
        for range in self.ranges.iter() {
            ranges.extend(found.faults.note(range.counted(&clock)).flatten());
        }
        let ranges = Ranges::new(ranges, &found.nodes, &mut found.faults);
        let light_time = light_time.map(SimDuration::as_nanos);
        let mut without_range = Vec::new();
        for contact in self.contacts.iter() {
            let span = contact.counted(&clock);
            let Some(span) = found.faults.note(span) else {
                continue;
            };
            contact.add_to(&mut found, &ranges, span, light_time, &mut without_range);
        }
        if found.contacts.is_empty() && found.faults.is_empty() {
            without_range
                .into_iter()
                .for_each(|error| found.faults.push(error));
        }
        build::plan(found, Overlaps::IfEqual)
    }
}

impl Contact {
    /// When it begins and ends, from the plan's beginning \[ns\].
    fn counted(&self, clock: &time::Clock) -> Result<(u64, u64), ContactError> {
        let start = clock.since_start(self.start, "start time", self.line)?;
        let stop = clock.since_start(self.stop, "stop time", self.line)?;
        build::check_order(self.line, start, stop)?;
        Ok((start, stop))
    }

    /// Adds its parts of one light time to what was found, or says why it is passed over.
    fn add_to(
        &self,
        found: &mut Found,
        ranges: &Ranges,
        span: (u64, u64),
        light_time: Option<u64>,
        without_range: &mut Vec<ContactError>,
    ) {
        let (from, to, line) = (self.from, self.to, self.line);
        if let Some(share) = self.confidence.filter(|share| *share < 1.0) {
            found.remarks.push(line, || {
                format!("confidence {share} is not used: the contact takes place")
            });
        }
        let contacts = &mut found.contacts;
        let left_at = ranges.split((from, to), span, light_time, |start, stop, owlt_ns| {
            contacts.push(RawContact {
                from,
                to,
                window: build::window(start, stop, Some(self.rate_bit_per_s), owlt_ns),
                confidence: self.confidence,
                line,
            });
        });
        let at = |nanos| SimTime::from_nanos(nanos).to_string();
        let [from, to] = [from, to].map(|node| found.nodes.name(node).to_owned());
        match left_at {
            Some(None) => {}
            Some(Some(left)) => found.remarks.push(line, || {
                format!(
                    "no range covers the contact from {from} to {to} from {} on: its light time \
                     stays as it was",
                    at(left)
                )
            }),
            None => {
                let text = || {
                    format!(
                        "no range covers the contact from {from} to {to} at {}: it is passed \
                         over; range = \"...\" in [contacts] gives it a light time",
                        at(span.0)
                    )
                };
                found.remarks.push(line, text);
                let problem = ContactProblem::NoRange {
                    from: from.clone(),
                    to: to.clone(),
                    at: at(span.0),
                };
                without_range.push(ContactError::at(line, problem));
            }
        }
    }
}

/// A word of a line, and where it begins.
#[derive(Clone, Copy)]
struct Word<'a> {
    text: &'a str,
    offset: usize,
}

/// The words of a line, one after the other, up to a comment.
struct Words<'a> {
    line: &'a str,
    /// The line's number, from 1.
    number: usize,
    at: usize,
}

impl<'a> Words<'a> {
    fn new(line: &'a str, number: usize) -> Self {
        Words {
            line,
            number,
            at: 0,
        }
    }

    fn next(&mut self) -> Option<Word<'a>> {
        let rest = &self.line[self.at..];
        let blank = rest.len() - rest.trim_start().len();
        let rest = &rest[blank..];
        let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
        if end == 0 || rest.starts_with('#') {
            return None;
        }
        let offset = self.at + blank;
        self.at = offset + end;
        let text = &rest[..end];
        Some(Word { text, offset })
    }

    fn peek(&self) -> Option<&'a str> {
        let mut ahead = Words { ..*self };
        ahead.next().map(|word| word.text)
    }

    fn field(&mut self, field: &'static str, form: &'static str) -> Result<Word<'a>, ContactError> {
        self.next().ok_or_else(|| self.missing(field, form))
    }

    fn end(&mut self, form: &'static str) -> Result<(), ContactError> {
        match self.next() {
            None => Ok(()),
            Some(word) => {
                let found = shown(word.text);
                Err(self.at(word, ContactProblem::ExtraField { found, form }))
            }
        }
    }

    /// A rate in bytes per second, as bit/s.
    fn rate(&self, word: Word<'_>) -> Result<u64, ContactError> {
        const FIELD: &str = "rate";
        const EXPECTED: &str = "bytes per second, a whole number of bit/s";
        let thousandths = scaled(word.text, 3);
        let thousandths = thousandths
            .map_err(|error| self.at(word, build::bad_number(FIELD, word.text, error, EXPECTED)))?;
        if !thousandths.is_multiple_of(125) {
            return Err(self.bad(word, FIELD, EXPECTED));
        }
        let bit_per_s = thousandths / 125;
        if !build::is_sane_rate(bit_per_s) {
            return Err(self.bad(word, FIELD, "from 0.125 to 1.25e14 bytes per second"));
        }
        Ok(bit_per_s)
    }

    fn confidence(&self, word: Word<'_>) -> Result<f64, ContactError> {
        let is_decimal = scaled(word.text, 19).is_ok();
        match word.text.parse::<f64>() {
            Ok(share) if is_decimal && share > 0.0 && share <= 1.0 => Ok(share),
            _ => Err(self.bad(word, "confidence", "a number over 0 and at most 1")),
        }
    }

    fn at(&self, word: Word<'_>, problem: ContactProblem) -> ContactError {
        let column = self.line[..word.offset].chars().count() + 1;
        ContactError::at_column(self.number, column, problem)
    }

    fn bad(&self, word: Word<'_>, field: &'static str, expected: &'static str) -> ContactError {
        let found = shown(word.text);
        self.at(
            word,
            ContactProblem::Field {
                field,
                found,
                expected,
            },
        )
    }

    fn missing(&self, field: &'static str, form: &'static str) -> ContactError {
        ContactError::at(self.number, ContactProblem::MissingField { field, form })
    }

    fn directive(
        &self,
        word: Word<'_>,
        expected: &'static str,
        known: &[&'static str],
    ) -> ContactError {
        let close = |name: &&&str| strsim::damerau_levenshtein(name, &shown(word.text)) <= 3;
        let distance = |name: &&&str| strsim::damerau_levenshtein(name, &shown(word.text));
        let nearest = known.iter().filter(close).min_by_key(distance).copied();
        let found = shown(word.text);
        self.at(
            word,
            ContactProblem::Directive {
                found,
                expected,
                nearest,
            },
        )
    }
}
