//! When a link can transmit at all: contact windows, and traces of delivery opportunities.

use std::sync::Arc;

use farside::{SimDuration, SimTime};
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

/// The contacts of a link, in order and apart, perhaps repeated: `[{ start, end, rate, owlt }, ...]`
/// or `{ every = "12h", windows = [...] }`.
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

    /// How many contacts there are, repetitions apart.
    pub fn len(&self) -> usize {
        self.windows.len()
    }

    /// True if there is no contact at all.
    pub fn is_empty(&self) -> bool {
        self.windows.is_empty()
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

/// A recorded capacity, as mahimahi's link shell reads it: instants in milliseconds, each an
/// opportunity to deliver 1500 bytes, repeated after the last one.
///
/// A message may take the rest of an opportunity that the one before it left over, if it was there
/// in time; otherwise the rest is wasted.
///
/// Source: mahimahi(1), mm-link; Netravali et al., USENIX ATC 2015.
///
/// ```
/// use farside_actors::link::Trace;
/// // 1500 bytes each 10 ms are 1.2 Mbit/s.
/// let trace = Trace::new(vec![10]).unwrap();
/// assert_eq!(trace.mean_rate_bit_per_s(), 1.2e6);
/// assert!(Trace::new(vec![]).is_err());
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<u64>", into = "Vec<u64>")]
pub struct Trace {
    stamps_ms: Arc<[u64]>,
}

/// What one opportunity delivers.
const OPPORTUNITY_BYTES: u64 = 1500;

/// The latest instant of a trace, a year.
const MAX_STAMP_MS: u64 = 366 * 86_400_000;

/// An opportunity that is partly used: its number, and the bytes left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Opportunity {
    number: u64,
    left_bytes: u64,
}

impl TryFrom<Vec<u64>> for Trace {
    type Error = String;

    fn try_from(stamps_ms: Vec<u64>) -> Result<Self, String> {
        Trace::new(stamps_ms)
    }
}

impl From<Trace> for Vec<u64> {
    fn from(trace: Trace) -> Self {
        trace.stamps_ms.to_vec()
    }
}

impl Trace {
    /// A trace with an opportunity at each of these milliseconds, repeated after the last.
    ///
    /// # Errors
    /// When there are none, one is before the one before it, or the last is 0 or beyond a year.
    pub fn new(stamps_ms: Vec<u64>) -> Result<Self, String> {
        let Some(last) = stamps_ms.last() else {
            return Err("expected at least one delivery opportunity".to_owned());
        };
        if !(1..=MAX_STAMP_MS).contains(last) {
            return Err(format!(
                "the last opportunity at {last} ms: expected from 1 to {MAX_STAMP_MS}"
            ));
        }
        if !stamps_ms.is_sorted() {
            return Err("expected instants of which none is before the one before it".to_owned());
        }
        Ok(Trace {
            stamps_ms: stamps_ms.into(),
        })
    }

    /// The mean rate over one repetition: opportunities of 1500 bytes over its length.
    pub fn mean_rate_bit_per_s(&self) -> f64 {
        let bits = (self.stamps_ms.len() as u64 * OPPORTUNITY_BYTES * 8) as f64;
        bits / (self.period_ms() as f64 * 1e-3)
    }

    fn period_ms(&self) -> u64 {
        self.stamps_ms.last().copied().unwrap_or(1)
    }

    fn instant(&self, number: u64) -> SimTime {
        let n = self.stamps_ms.len() as u64;
        let ms = (number / n)
            .saturating_mul(self.period_ms())
            .saturating_add(self.stamps_ms[(number % n) as usize]);
        SimTime::from_nanos(ms.saturating_mul(1_000_000))
    }

    /// The number of the first opportunity at or after `at`.
    fn next(&self, at: SimTime) -> u64 {
        let n = self.stamps_ms.len() as u64;
        let ms = at.as_nanos().div_ceil(1_000_000);
        // The last opportunity of a repetition falls together with the start of the next.
        let cycle = (ms / self.period_ms()).saturating_sub(u64::from(ms % self.period_ms() == 0));
        let within = ms - cycle * self.period_ms();
        let before = self.stamps_ms.partition_point(|stamp| *stamp < within);
        cycle * n + before as u64
    }

    /// When `bytes` that may go from `ready` on have gone, and what they leave of the last
    /// opportunity.
    pub(super) fn delivered(
        &self,
        ready: SimTime,
        bytes: u64,
        used: Option<Opportunity>,
    ) -> (SimTime, Opportunity) {
        let mut number = self.next(ready);
        let mut left_bytes = OPPORTUNITY_BYTES;
        if let Some(used) = used.filter(|used| used.number >= number) {
            number = used.number;
            left_bytes = used.left_bytes;
        }
        let missing = bytes.saturating_sub(left_bytes);
        let more = missing.div_ceil(OPPORTUNITY_BYTES);
        let last = number.saturating_add(more);
        let left_bytes = left_bytes + more * OPPORTUNITY_BYTES - bytes;
        let rest = if left_bytes == 0 {
            Opportunity {
                number: last + 1,
                left_bytes: OPPORTUNITY_BYTES,
            }
        } else {
            Opportunity {
                number: last,
                left_bytes,
            }
        };
        (self.instant(last), rest)
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
        let text = "every = '1s'\nwindows = [{ start = '600ms', end = '700ms' }, { start = '100ms', end = '200ms' }]";
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

    #[test]
    fn opportunities_are_shared_and_repeat() {
        let trace = Trace::new(vec![2, 2, 5]).unwrap();
        let instants: Vec<u64> = (0..7)
            .map(|n| trace.instant(n).as_nanos() / 1_000_000)
            .collect();
        assert_eq!(instants, [2, 2, 5, 7, 7, 10, 12]);
        assert_eq!(
            [0, 2, 3, 5, 6, 10].map(|ms| trace.next(at(ms))),
            [0, 0, 2, 2, 3, 5]
        );
        // 1000 bytes leave 500, which 500 more take at the same instant.
        let (done, rest) = trace.delivered(at(0), 1000, None);
        assert_eq!(done, at(2));
        let (done, rest) = trace.delivered(at(1), 500, Some(rest));
        assert_eq!(done, at(2));
        let (done, rest) = trace.delivered(at(1), 1501, Some(rest));
        assert_eq!(done, at(5));
        assert_eq!(rest.left_bytes, 1499);
        // Who comes after it has no part in it.
        assert_eq!(trace.delivered(at(6), 10, Some(rest)).0, at(7));
    }
}
