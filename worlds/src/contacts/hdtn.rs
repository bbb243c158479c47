//! HDTN contact plans: JSON, as HDTN's router reads it.
//!
//! ```json
//! { "contacts": [
//!     { "contact": 0, "source": 10, "dest": 2, "startTime": 0, "endTime": 60,
//!       "rateBitsPerSec": 128000, "owlt": 1 }
//! ] }
//! ```
//!
//! The file is read in two passes: serde cuts it into contacts and remembers where each lies, and
//! each is then read by itself, so that every mistake has its line.

use std::borrow::Cow;
use std::fmt;

use serde::de::{Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::value::RawValue;

use farside::SimDuration;

use super::build::{self, Found, Overlaps, RawContact};
use super::error::shown;
use super::{ContactError, ContactPlan, ContactProblem, MAX_CONTACTS, text_of};
use crate::decimal::scaled;

/// The keys of a contact that are read, and what they hold. Others are passed over, as HDTN does.
const KEYS: [(&str, &str); 6] = [
    ("source", "the sending node"),
    ("dest", "the receiving node"),
    ("startTime", "the start in seconds"),
    ("endTime", "the end in seconds"),
    ("rateBitsPerSec", "the rate in bits (not bytes) per second"),
    ("owlt", "the one-way light time in seconds"),
];
const SOURCE: usize = 0;
const DEST: usize = 1;
const START: usize = 2;
const END: usize = 3;
const RATE: usize = 4;
const OWLT: usize = 5;

/// HDTN's name for the rate before it had `rateBitsPerSec`: whole Mbit/s. It still reads it.
const OLD_RATE: &str = "rate";

/// The most keys of a contact that are searched for one that was meant for another.
const MAX_STRANGERS: usize = 32;

impl ContactPlan {
    /// Reads an HDTN contact plan. Rates are in bits per second (`rateBitsPerSec`), or, as in old
    /// plans, in Mbit/s (`rate`); 0 sets no limit. A contact without `owlt` has a light time of 0.
    /// Contacts of one rate and light time that overlap are one, and those that end as they begin
    /// are passed over, with a remark. Keys that HDTN passes over are passed over.
    ///
    /// ```
    /// use farside_worlds::contacts::ContactPlan;
    /// let text = r#"{ "contacts": [
    ///     { "source": 1, "dest": 2, "startTime": 0, "endTime": 60,
    ///       "rateBytesPerSec": 16000, "owlt": 1 }
    /// ] }"#;
    /// let error = ContactPlan::from_hdtn(text.as_bytes()).unwrap_err();
    /// assert_eq!(
    ///     error.to_string(),
    ///     "line 2: the contact has no \"rateBitsPerSec\", the rate in bits (not bytes) per \
    ///      second; found \"rateBytesPerSec\" instead"
    /// );
    /// let plan = ContactPlan::from_hdtn(text.replace("Bytes", "Bits").as_bytes())?;
    /// assert_eq!(plan.contact_windows("1", "2")[0].rate_bit_per_s, Some(16_000));
    /// # Ok::<(), farside_worlds::contacts::ContactError>(())
    /// ```
    ///
    /// # Errors
    /// With the line, when the text is no such file, has more than 16 MiB or 200,000 contacts, or
    /// says what cannot be: contacts of one ordered pair that overlap at different rates. All
    /// faults are told at once, up to [`MAX_FAULTS`](super::MAX_FAULTS).
    pub fn from_hdtn(bytes: &[u8]) -> Result<ContactPlan, ContactError> {
        read(bytes, None)
    }
}

/// Reads a plan; contacts without a light time have the one given, or none.
pub(super) fn read(
    bytes: &[u8],
    light_time: Option<SimDuration>,
) -> Result<ContactPlan, ContactError> {
    let text = text_of(bytes)?;
    let file: File<'_> = serde_json::from_str(text).map_err(|error| json(&error, 1, 1))?;
    let mut found = Found::default();
    let mut place = JsonPlace::new(text);
    for raw in file.contacts.0 {
        place.move_to(raw.get());
        let object = serde_json::from_str::<Object<'_>>(raw.get())
            .map_err(|error| json(&error, place.line, place.column()));
        let Some(object) = found.faults.note(object) else {
            continue;
        };
        let reader = Reader {
            place: &place,
            line: place.line,
            object,
        };
        reader.contact(&mut found, light_time.unwrap_or_default());
    }
    build::plan(found, Overlaps::IfAlike)
}

/// An error of the JSON reader within a text that begins at `line` and `column`.
fn json(error: &serde_json::Error, line: usize, column: usize) -> ContactError {
    let message = error.to_string();
    // Its own place counts from where the text begins.
    let end = message.rfind(" at line ").unwrap_or(message.len());
    let message = message[..end].to_owned();
    let on_first_line = error.line() <= 1;
    let line = line + error.line().max(1) - 1;
    let column = if on_first_line { column - 1 } else { 0 } + error.column().max(1);
    ContactError::at_column(line, column, ContactProblem::Json { message })
}

#[derive(Deserialize)]
struct File<'a> {
    #[serde(borrow)]
    contacts: Contacts<'a>,
}

/// The contacts' texts; no more than a plan may have.
struct Contacts<'a>(Vec<&'a RawValue>);

impl<'de: 'a, 'a> Deserialize<'de> for Contacts<'a> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct List;

        impl<'de> Visitor<'de> for List {
            type Value = Vec<&'de RawValue>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an array of contacts")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Self::Value, A::Error> {
                let mut contacts = Vec::new();
                while let Some(raw) = seq.next_element()? {
                    if contacts.len() == MAX_CONTACTS {
                        let message = format!("more than {MAX_CONTACTS} contacts");
                        return Err(A::Error::custom(message));
                    }
                    contacts.push(raw);
                }
                Ok(contacts)
            }
        }

        from.deserialize_seq(List).map(Contacts)
    }
}

/// One contact's values by [`KEYS`], still as text.
struct Object<'a> {
    values: [Option<&'a RawValue>; KEYS.len()],
    old_rate: Option<&'a RawValue>,
    /// A key that is there twice.
    twice: Option<&'static str>,
    strangers: Vec<String>,
}

impl<'de: 'a, 'a> Deserialize<'de> for Object<'a> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Entries;

        impl<'de> Visitor<'de> for Entries {
            type Value = Object<'de>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a contact, as an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Object<'de>, A::Error> {
                let mut object = Object {
                    values: [None; KEYS.len()],
                    old_rate: None,
                    twice: None,
                    strangers: Vec::new(),
                };
                while let Some(Key(key)) = map.next_key()? {
                    let known = KEYS.iter().position(|(name, _)| *name == key);
                    let (name, slot) = match known {
                        Some(at) => (KEYS[at].0, &mut object.values[at]),
                        None if key == OLD_RATE => (OLD_RATE, &mut object.old_rate),
                        None => {
                            map.next_value::<IgnoredAny>()?;
                            if object.strangers.len() < MAX_STRANGERS {
                                object.strangers.push(shown(&key));
                            }
                            continue;
                        }
                    };
                    if slot.replace(map.next_value()?).is_some() {
                        object.twice = Some(name);
                    }
                }
                Ok(object)
            }
        }

        from.deserialize_map(Entries)
    }
}

/// A key, which need not be copied unless it has escapes.
#[derive(Deserialize)]
struct Key<'a>(#[serde(borrow)] Cow<'a, str>);

/// Finds the lines of parts of the text. Contacts come in order, so each search goes on where the
/// last one ended; columns are counted for errors only.
struct JsonPlace<'a> {
    text: &'a str,
    offset: usize,
    line: usize,
    line_start: usize,
}

impl<'a> JsonPlace<'a> {
    fn new(text: &'a str) -> Self {
        JsonPlace {
            text,
            offset: 0,
            line: 1,
            line_start: 0,
        }
    }

    /// Moves on to where `part` begins, a part of the text.
    fn move_to(&mut self, part: &str) {
        let offset = (part.as_ptr() as usize).saturating_sub(self.text.as_ptr() as usize);
        let offset = offset.clamp(self.offset, self.text.len());
        for (at, byte) in self.text.as_bytes()[self.offset..offset].iter().enumerate() {
            if *byte == b'\n' {
                self.line += 1;
                self.line_start = self.offset + at + 1;
            }
        }
        self.offset = offset;
    }

    fn column(&self) -> usize {
        self.text[self.line_start..self.offset].chars().count() + 1
    }
}

/// Reads one contact.
struct Reader<'a> {
    place: &'a JsonPlace<'a>,
    line: usize,
    object: Object<'a>,
}

impl Reader<'_> {
    /// Adds the contact to what was found, or what is wrong with it.
    fn contact(&self, found: &mut Found, light_time: SimDuration) {
        let line = self.line;
        if let Some(key) = self.object.twice {
            let problem = ContactProblem::DuplicateKey { key };
            return found.faults.push(ContactError::at(line, problem));
        }
        let from = self.node(SOURCE, found);
        let from = found.faults.note(from);
        let to = self.node(DEST, found);
        let to = found.faults.note(to);
        let number = |key| self.number(key, 9, "seconds from the plan's beginning");
        let [start, end] = [START, END].map(|key| found.faults.note(number(key)));
        let rate_bit_per_s = found.faults.note(self.rate());
        let owlt = match self.object.values[OWLT] {
            Some(_) => found.faults.note(self.number(OWLT, 9, "seconds")),
            None => {
                if let Some(key) = self.stranger_near(KEYS[OWLT].0) {
                    found.remarks.push(line, || {
                        format!(
                            "the contact has no \"owlt\": its light time is {light_time}; found \
                             {key:?}"
                        )
                    });
                }
                Some(light_time.as_nanos())
            }
        };
        let all = (from, to, start, end, rate_bit_per_s, owlt);
        let (Some(from), Some(to), Some(start), Some(end), Some(rate_bit_per_s), Some(owlt)) = all
        else {
            return;
        };
        if start == end {
            let text = || "the contact ends as it begins: it is passed over".to_owned();
            return found.remarks.push(line, text);
        }
        if let Err(error) = build::check_order(line, start, end) {
            return found.faults.push(error);
        }
        found.contacts.push(RawContact {
            from,
            to,
            window: build::window(start, end, rate_bit_per_s, owlt),
            confidence: None,
            line,
        });
    }

    /// The rate in bit/s; `None` is no limit.
    fn rate(&self) -> Result<Option<u64>, ContactError> {
        let (field, text, bit_per_s) = match (self.object.values[RATE], self.object.old_rate) {
            (None, Some(old)) => {
                let text = self.text(OLD_RATE, old)?;
                (OLD_RATE, old, (scaled(&text, 6), "Mbit/s"))
            }
            _ => {
                let value = self.value(RATE)?;
                let text = self.text(KEYS[RATE].0, value)?;
                (
                    KEYS[RATE].0,
                    value,
                    (scaled(&text, 0), "a whole number of bits per second"),
                )
            }
        };
        let (bit_per_s, expected) = bit_per_s;
        let bit_per_s = bit_per_s.map_err(|error| {
            self.at(text, build::bad_number(field, text.get(), error, expected))
        })?;
        // To HDTN's router, 0 is "unlimited".
        if bit_per_s == 0 {
            return Ok(None);
        }
        if !build::is_sane_rate(bit_per_s) {
            return Err(self.bad(text, field, "at most 1e15 bits per second"));
        }
        Ok(Some(bit_per_s))
    }

    fn node(&self, key: usize, found: &mut Found) -> Result<u32, ContactError> {
        let value = self.value(key)?;
        let text = self.text(KEYS[key].0, value)?;
        let number = found.nodes.number(&text, self.line);
        number.ok_or_else(|| self.bad(value, KEYS[key].0, build::NODE_EXPECTED))
    }

    fn number(&self, key: usize, places: i32, expected: &'static str) -> Result<u64, ContactError> {
        let value = self.value(key)?;
        let field = KEYS[key].0;
        let text = self.text(field, value)?;
        scaled(&text, places).map_err(|error| {
            self.at(
                value,
                build::bad_number(field, value.get(), error, expected),
            )
        })
    }

    fn value(&self, key: usize) -> Result<&RawValue, ContactError> {
        let (name, meaning) = KEYS[key];
        self.object.values[key].ok_or_else(|| {
            let problem = ContactProblem::MissingKey {
                key: name,
                meaning,
                nearest: self.stranger_near(name),
            };
            ContactError::at(self.line, problem)
        })
    }

    /// The key nobody reads that comes closest to `name`, whatever its case.
    fn stranger_near(&self, name: &str) -> Option<String> {
        let name = name.to_lowercase();
        let distance = |key: &&String| strsim::damerau_levenshtein(&name, &key.to_lowercase());
        let nearest = self.object.strangers.iter().min_by_key(distance)?;
        let is_close = distance(&nearest) <= name.len() / 2;
        is_close.then(|| nearest.clone())
    }

    /// A number's text; HDTN takes numbers in quotes, too.
    fn text<'v>(
        &self,
        field: &'static str,
        value: &'v RawValue,
    ) -> Result<Cow<'v, str>, ContactError> {
        let raw = value.get();
        match raw.as_bytes().first() {
            Some(b'"') => {
                let Ok(Key(text)) = serde_json::from_str(raw) else {
                    return Err(self.bad(value, field, "text without lone surrogates"));
                };
                Ok(text)
            }
            Some(b'-' | b'0'..=b'9') => Ok(Cow::Borrowed(raw)),
            _ => Err(self.bad(value, field, "a number")),
        }
    }

    fn bad(&self, value: &RawValue, field: &'static str, expected: &'static str) -> ContactError {
        let found = shown(value.get());
        self.at(
            value,
            ContactProblem::Field {
                field,
                found,
                expected,
            },
        )
    }

    fn at(&self, value: &RawValue, problem: ContactProblem) -> ContactError {
        let mut place = JsonPlace { ..*self.place };
        place.move_to(value.get());
        ContactError::at_column(place.line, place.column(), problem)
    }
}
