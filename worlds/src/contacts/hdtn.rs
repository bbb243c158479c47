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

use super::build::{self, Nodes, RawContact};
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
    /// plans, in Mbit/s (`rate`). Keys that HDTN passes over are passed over.
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
    ///     "line 2: the contact has no \"rateBitsPerSec\", the rate in bits (not bytes) per second; \
    ///      found \"rateBytesPerSec\" instead"
    /// );
    /// let plan = ContactPlan::from_hdtn(text.replace("Bytes", "Bits").as_bytes())?;
    /// assert_eq!(plan.contact_windows("1", "2")[0].rate_bit_per_s, 16_000);
    /// # Ok::<(), farside_worlds::contacts::ContactError>(())
    /// ```
    ///
    /// # Errors
    /// With the line, when the text is no such file, has more than 16 MiB or 200,000 contacts, or
    /// says what cannot be: contacts of one ordered pair that overlap, a rate of zero (by which
    /// HDTN means no limit).
    pub fn from_hdtn(bytes: &[u8]) -> Result<ContactPlan, ContactError> {
        let text = text_of(bytes)?;
        let file: File<'_> = serde_json::from_str(text).map_err(|error| json(&error, 1, 1))?;
        let mut nodes = Nodes::default();
        let mut contacts = Vec::with_capacity(file.contacts.0.len());
        let mut place = JsonPlace::new(text);
        for raw in file.contacts.0 {
            place.move_to(raw.get());
            let object: Object<'_> = serde_json::from_str(raw.get())
                .map_err(|error| json(&error, place.line, place.column()))?;
            let reader = Reader {
                place: &place,
                line: place.line,
                object,
            };
            contacts.push(reader.contact(&mut nodes)?);
        }
        build::plan(nodes, contacts)
    }
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
    fn contact(&self, nodes: &mut Nodes) -> Result<RawContact, ContactError> {
        if let Some(key) = self.object.twice {
            return Err(ContactError::at(
                self.line,
                ContactProblem::DuplicateKey { key },
            ));
        }
        let from = self.node(SOURCE, nodes)?;
        let to = self.node(DEST, nodes)?;
        let start = self.number(START, 9, "seconds from the plan's beginning")?;
        let end = self.number(END, 9, "seconds from the plan's beginning")?;
        let rate_bit_per_s = self.rate()?;
        let owlt = self.number(OWLT, 9, "seconds")?;
        build::check_order(self.line, start, end)?;
        Ok(RawContact {
            from,
            to,
            window: build::window(start, end, rate_bit_per_s, owlt),
            confidence: None,
            line: self.line,
        })
    }

    fn rate(&self) -> Result<u64, ContactError> {
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
        if bit_per_s == 0 {
            let expected = "a rate over 0; HDTN means no limit by it, a link needs one";
            return Err(self.bad(text, field, expected));
        }
        if !build::is_sane_rate(bit_per_s) {
            return Err(self.bad(text, field, "at most 1e15 bits per second"));
        }
        Ok(bit_per_s)
    }

    fn node(&self, key: usize, nodes: &mut Nodes) -> Result<u32, ContactError> {
        let value = self.value(key)?;
        let text = self.text(KEYS[key].0, value)?;
        let number = nodes.number(&text, self.line);
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
