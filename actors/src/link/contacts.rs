//! When a link can transmit at all: its contacts.

use std::sync::Arc;

use farside::{SimDuration, SimTime};
use farside_worlds::contacts::ContactWindow;
use serde::{Deserialize, Serialize};

use crate::units;

/// A contact: from `start` to `end` the link can transmit, at `rate` and with the one-way light
/// time `owlt` in place of the link's own rate and latency, where given.
///
/// ```
/// use farside_actors::link::Contact;
/// let pass: Contact = toml::from_str("start = '0s'\nend = '8min'\nrate = '128kbit/s'")?;
/// assert_eq!((pass.rate, pass.owlt), (Some(128_000), None));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// When it begins, from the start of the run or of the period.
    #[serde(with = "units::duration")]
    pub start: SimDuration,
    /// When it ends: the first instant outside.
    #[serde(with = "units::duration")]
    pub end: SimDuration,
    /// The bit rate meanwhile.
    #[serde(
        default,
        with = "units::data_rate_bit_per_s::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub rate: Option<u64>,
    /// The one-way light time meanwhile.
    #[serde(
        default,
        with = "units::duration::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub owlt: Option<SimDuration>,
}

/// The contacts of a link, in order and apart, perhaps repeated: `[{ start, end, rate, owlt },
/// ...]` or `{ every = "12h", windows = [...] }`.
///
/// ```
/// use farside::SimTime;
/// use farside_actors::link::Contacts;
/// let text = "every = '12h'\nwindows = [{ start = '0s', end = '8min' }]";
/// let passes: Contacts = toml::from_str(text)?;
/// let noon = SimTime::from_nanos(12 * 3_600_000_000_000);
/// assert_eq!(passes.at(noon).unwrap().start, noon);
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub struct Contacts {
    every: Option<SimDuration>,
    windows: Arc<[Contact]>,
}

/// One occurrence of a contact, in the run's time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// When it begins.
    pub start: SimTime,
    /// The first instant after it.
    pub end: SimTime,
    /// The bit rate meanwhile, if it has its own.
    pub rate: Option<u64>,
    /// The one-way light time meanwhile, if it has its own.
    pub owlt: Option<SimDuration>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Periodic {
    #[serde(
        default,
        with = "units::duration::option",
        skip_serializing_if = "Option::is_none"
    )]
    every: Option<SimDuration>,
    windows: Vec<Contact>,
}

/// A list, or a table with the list inside.
struct Written(Periodic);

impl Serialize for Written {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self.0.every {
            Some(_) => self.0.serialize(to),
            None => self.0.windows.serialize(to),
        }
    }
}

impl<'de> Deserialize<'de> for Written {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
        use serde::de::{MapAccess, SeqAccess, Visitor};
        struct Either;

        impl<'de> Visitor<'de> for Either {
            type Value = Written;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a list of { start, end, rate, owlt }, or { every, windows = [...] }")
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Written, A::Error> {
                Periodic::deserialize(MapAccessDeserializer::new(map)).map(Written)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Written, A::Error> {
                let windows = Vec::deserialize(SeqAccessDeserializer::new(seq))?;
                Ok(Written(Periodic {
                    every: None,
                    windows,
                }))
            }
        }

        from.deserialize_any(Either)
    }
}

impl TryFrom<Written> for Contacts {
    type Error = String;

    fn try_from(Written(Periodic { every, windows }): Written) -> Result<Self, String> {
        Contacts::new(windows, every)
    }
}

impl From<Contacts> for Written {
    fn from(contacts: Contacts) -> Self {
        Written(Periodic {
            every: contacts.every,
            windows: contacts.windows.to_vec(),
        })
    }
}

impl Contacts {
    /// These contacts, repeated `every` so often if given.
    ///
    /// # Errors
    /// When one ends before it begins, overlaps the one before it, has a rate of zero, or ends
    /// after the period.
    pub fn new(mut windows: Vec<Contact>, every: Option<SimDuration>) -> Result<Self, String> {
        windows.sort_by_key(|window| window.start);
        for window in &windows {
            if window.end <= window.start {
                return Err(format!(
                    "a contact from {} to {}: expected an end after its start",
                    window.start, window.end
                ));
            }
            if window.rate == Some(0) {
                return Err("a contact at 0bit/s: expected more than that".to_owned());
            }
            if every.is_some_and(|every| window.end > every) {
                return Err(format!(
                    "a contact that ends at {}: expected an end within the period, {}",
                    window.end,
                    every.unwrap_or_default()
                ));
            }
        }
        if let Some(pair) = windows.windows(2).find(|pair| pair[1].start < pair[0].end) {
            return Err(format!(
                "contacts from {} to {} and from {}: expected contacts that do not overlap",
                pair[0].start, pair[0].end, pair[1].start
            ));
        }
        if every.is_some_and(SimDuration::is_zero) {
            return Err("every = 0s: expected more than that".to_owned());
        }
        Ok(Contacts {
            every,
            windows: windows.into(),
        })
    }

    /// The contacts of a plan, in its order.
    ///
    /// ```
    /// use farside_actors::link::Contacts;
    /// use farside_worlds::contacts::ContactPlan;
    /// let text = b"a range +0 +3600 1 2 1.28\na contact +60 +120 1 2 16000";
    /// let plan = ContactPlan::from_ion(text).unwrap();
    /// let contacts = Contacts::of_plan(plan.contact_windows("1", "2"));
    /// assert_eq!(contacts.windows()[0].rate, Some(128_000));
    /// ```
    pub fn of_plan(windows: &[ContactWindow]) -> Self {
        // Plans keep the contacts of a pair in order and apart, and know no rate of zero. Where
        // they set no limit, the link's own holds.
        let windows = windows.iter().map(|window| Contact {
            start: window.start.since(SimTime::ZERO),
            end: window.end.since(SimTime::ZERO),
            rate: window.rate_bit_per_s,
            owlt: Some(window.owlt),
        });
        Contacts {
            every: None,
            windows: windows.collect(),
        }
    }

    /// How many contacts there are, repetitions apart.
    pub fn len(&self) -> usize {
        self.windows.len()
    }

    /// True if there is no contact at all.
    pub fn is_empty(&self) -> bool {
        self.windows.is_empty()
    }

    /// Whether they come again and again.
    pub fn repeats(&self) -> bool {
        self.every.is_some()
    }

    /// The contacts, repetitions apart.
    pub fn windows(&self) -> &[Contact] {
        &self.windows
    }

    /// The contact that `at` lies in.
    pub fn at(&self, at: SimTime) -> Option<Window> {
        let (base, within) = self.split(at);
        let after = self
            .windows
            .partition_point(|window| window.start <= within);
        let window = self.windows[..after].last()?;
        (within < window.end).then(|| occurrence(window, base))
    }

    /// When the next contact begins, after `at`.
    pub fn next_after(&self, at: SimTime) -> Option<SimTime> {
        let (base, within) = self.split(at);
        let after = self
            .windows
            .partition_point(|window| window.start <= within);
        match (self.windows.get(after), self.every) {
            (Some(window), _) => Some(base + window.start),
            (None, Some(every)) => Some(base + every + self.windows.first()?.start),
            (None, None) => None,
        }
    }

    /// The contact that `at` lies in, if it lies in one, and all that begin later.
    pub fn from(&self, at: SimTime) -> impl Iterator<Item = Window> + '_ {
        let next = |at| self.next_after(at).and_then(|start| self.at(start));
        let first = self.at(at).or_else(|| next(at));
        std::iter::successors(first, move |window| next(window.start))
    }

    /// Where the period that `at` lies in begins, and how far into it `at` is.
    fn split(&self, at: SimTime) -> (SimTime, SimDuration) {
        let nanos = at.as_nanos();
        match self.every {
            Some(every) => {
                let within = nanos % every.as_nanos();
                let base = SimTime::from_nanos(nanos - within);
                (base, SimDuration::from_nanos(within))
            }
            None => (SimTime::ZERO, SimDuration::from_nanos(nanos)),
        }
    }
}

fn occurrence(window: &Contact, base: SimTime) -> Window {
    Window {
        start: base + window.start,
        end: base + window.end,
        rate: window.rate,
        owlt: window.owlt,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64) -> SimTime {
        SimTime::from_nanos(ms * 1_000_000)
    }

    #[test]
    fn contacts_begin_end_and_repeat() {
        let text = "every = '1s'\nwindows = [{ start = '600ms', end = '700ms' }, \
                    { start = '100ms', end = '200ms' }]";
        let contacts: Contacts = toml::from_str(text).unwrap();
        assert_eq!(contacts.at(at(99)), None);
        assert_eq!(contacts.at(at(100)).unwrap().end, at(200));
        assert_eq!(contacts.at(at(200)), None);
        assert_eq!(contacts.next_after(at(200)), Some(at(600)));
        assert_eq!(contacts.next_after(at(700)), Some(at(1100)));
        assert_eq!(contacts.at(at(5650)).unwrap().start, at(5600));
        let again: Contacts = toml::from_str(&toml::to_string(&contacts).unwrap()).unwrap();
        assert_eq!(again, contacts);
    }

    #[test]
    fn contacts_that_cannot_be_are_refused() {
        for (text, part) in [
            (
                "windows = [{ start = '2s', end = '1s' }]",
                "after its start",
            ),
            (
                "every = '1s'\nwindows = [{ start = '0s', end = '2s' }]",
                "within the period",
            ),
            (
                "windows = [{ start = '0s', end = '2s' }, { start = '1s', end = '3s' }]",
                "do not overlap",
            ),
            (
                "windows = [{ start = '0s', end = '2s', rate = '0bit/s' }]",
                "more than that",
            ),
            ("windows = []\nevery = '0s'", "more than that"),
        ] {
            let error = toml::from_str::<Contacts>(text).unwrap_err().to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
