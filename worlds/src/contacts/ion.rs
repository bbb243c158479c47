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
//! register a node (`-1` as start), and hypothetical ones (`0` as stop).

mod ranges;
mod time;

use std::fmt::Write;

use super::build::{self, Nodes, RawContact};
use super::error::shown;
use super::{ContactError, ContactPlan, ContactProblem, text_of};
use crate::decimal::{scaled, unscaled};
use ranges::{Range, Ranges};
use time::{Stamp, TimeLine};

const CONTACT_FORM: &str = "a contact start stop from to bytes_per_second [confidence]";
const RANGE_FORM: &str = "a range start stop from to light_seconds";
const AT_FORM: &str = "@ time";

/// Commands of `ionadmin` that say nothing about contacts.
const SKIPPED: [&str; 15] = [
    "?", "1", "^", "e", "h", "i", "l", "m", "q", "r", "s", "t", "v", "w", "x",
];

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
    nodes: Nodes,
    times: TimeLine,
    contacts: Vec<Contact>,
    ranges: Vec<Range<Stamp>>,
}

impl ContactPlan {
    /// Reads the contacts and ranges of an ION `ionrc` file. A contact has the light time of the
    /// range that covers it; a range that changes within a contact splits it. A range from a lower
    /// to a higher node number holds for the way back, too, while the file has none for that way.
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
    /// says what cannot be: contacts of one ordered pair that overlap, a contact without a range.
    pub fn from_ion(bytes: &[u8]) -> Result<ContactPlan, ContactError> {
        let text = text_of(bytes)?;
        let mut reader = Reader::default();
        for (index, line) in text.split('\n').enumerate() {
            reader.line(Words::new(line, index + 1))?;
        }
        reader.finish()
    }

    /// The plan as an ION file, which [`ContactPlan::from_ion`] reads back to an equal one, if the
    /// plan begins with a relative time as here. ION itself reads whole numbers only: it takes the
    /// file if all times, light times and rates in bytes per second are whole.
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
            let rate = unscaled(window.rate_bit_per_s * 125, 3);
            let confidence = contact.confidence;
            let confidence = confidence.map_or_else(String::new, |share| format!(" {share}"));
            writeln!(text, "a range {times_and_nodes} {owlt}").expect("a String takes any text");
            writeln!(text, "a contact {times_and_nodes} {rate}{confidence}")
                .expect("a String takes any text");
        }
        text
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
                Some(word) => Err(words.directive(word, "contact or range", &["contact", "range"])),
                None => Err(words.missing("contact or range", CONTACT_FORM)),
            },
            "@" => {
                let stamp = self.time(&mut words, "reference time", AT_FORM)?;
                words.end(AT_FORM)?;
                self.times.refer_to(stamp);
                Ok(())
            }
            "c" | "d" => Err(words.directive(
                command,
                "a plan as it stands; changing and deleting is not read",
                &[],
            )),
            skipped if SKIPPED.contains(&skipped) => Ok(()),
            _ => Err(words.directive(
                command,
                "a command of ionrc(5), such as `a contact` or `a range`",
                &["a", "a contact", "a range"],
            )),
        }
    }

    fn contact(&mut self, words: &mut Words<'_>) -> Result<(), ContactError> {
        let registers = words.peek() == Some("-1");
        let start = match registers {
            true => words.next().map(|_| self.times.zero()),
            false => Some(self.time(words, "start time", CONTACT_FORM)?),
        };
        let is_hypothetical = words.peek() == Some("0");
        let stop = match registers || is_hypothetical {
            true => words.next().map(|_| self.times.zero()),
            false => Some(self.time(words, "stop time", CONTACT_FORM)?),
        };
        // Neither says when there is a contact.
        let (Some(start), Some(stop), false) = (start, stop, registers || is_hypothetical) else {
            return Ok(());
        };
        let from = self.node(words, "sending node", CONTACT_FORM)?;
        let to = self.node(words, "receiving node", CONTACT_FORM)?;
        let rate = words.field("rate in bytes per second", CONTACT_FORM)?;
        let rate_bit_per_s = words.rate(rate)?;
        let confidence = match words.next() {
            Some(word) => Some(words.confidence(word)?),
            None => None,
        };
        words.end(CONTACT_FORM)?;
        let contact = Contact {
            from,
            to,
            start,
            stop,
            rate_bit_per_s,
            confidence,
            line: words.number,
        };
        build::push(&mut self.contacts, contact, "contacts", words.number)
    }

    fn range(&mut self, words: &mut Words<'_>) -> Result<(), ContactError> {
        let start = self.time(words, "start time", RANGE_FORM)?;
        let stop = self.time(words, "stop time", RANGE_FORM)?;
        let from = self.node(words, "first node", RANGE_FORM)?;
        let to = self.node(words, "second node", RANGE_FORM)?;
        let owlt = words.field("distance in light seconds", RANGE_FORM)?;
        let owlt_ns = scaled(owlt.text, 9).map_err(|error| {
            let expected = "light seconds, such as 1.28";
            words.at(
                owlt,
                build::bad_number("distance", owlt.text, error, expected),
            )
        })?;
        words.end(RANGE_FORM)?;
        let range = Range {
            from,
            to,
            start,
            stop,
            owlt_ns,
            line: words.number,
        };
        build::push(&mut self.ranges, range, "ranges", words.number)
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

    fn node(
        &mut self,
        words: &mut Words<'_>,
        field: &'static str,
        form: &'static str,
    ) -> Result<u32, ContactError> {
        let word = words.field(field, form)?;
        let number = self.nodes.number(word.text, words.number);
        number.ok_or_else(|| words.bad(word, field, build::NODE_EXPECTED))
    }

    /// Counts all times from the plan's beginning and gives contacts their light times.
    fn finish(self) -> Result<ContactPlan, ContactError> {
        let contact_times = self.contacts.iter().flat_map(|c| [c.start, c.stop]);
        let range_times = self.ranges.iter().flat_map(|r| [r.start, r.stop]);
        let clock = self.times.clock(contact_times.chain(range_times));
        let mut ranges = Vec::with_capacity(self.ranges.len());
        for range in &self.ranges {
            ranges.extend(range.counted(&clock)?);
        }
        let ranges = Ranges::new(ranges, &self.nodes)?;
        let mut contacts = Vec::with_capacity(self.contacts.len());
        for contact in &self.contacts {
            let line = contact.line;
            let start = clock.since_start(contact.start, "start time", line)?;
            let stop = clock.since_start(contact.stop, "stop time", line)?;
            build::check_order(line, start, stop)?;
            let (from, to) = (contact.from, contact.to);
            ranges
                .split(from, to, start, stop, |start, stop, owlt_ns| {
                    contacts.push(RawContact {
                        from,
                        to,
                        window: build::window(start, stop, contact.rate_bit_per_s, owlt_ns),
                        confidence: contact.confidence,
                        line,
                    });
                })
                .map_err(|at| {
                    let problem = ContactProblem::NoRange {
                        from: self.nodes.name(from).to_owned(),
                        to: self.nodes.name(to).to_owned(),
                        at: farside::SimTime::from_nanos(at).to_string(),
                    };
                    ContactError::at(line, problem)
                })?;
        }
        build::plan(self.nodes, contacts)
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
