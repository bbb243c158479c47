//! A recorded link as the rate of another: delivery opportunities in place of bits per second.

use std::fmt;
use std::sync::Arc;

use farside::{SimDuration, SimTime};
use farside_worlds::contacts::CapacityTrace;
use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A recorded capacity, as mahimahi's link shell reads it: each opportunity delivers 1500 bytes.
///
/// A scenario names a file or a built-in trace (`trace = "rover-radio"`), or lists the milliseconds
/// (`trace = [10, 20, 30]`). A message may take the rest of an opportunity that the one before it
/// left over, if it was there in time; otherwise the rest is wasted.
///
/// Source: mahimahi(1), mm-link; Netravali et al., USENIX ATC 2015.
///
/// ```
/// use farside_actors::link::{LinkParams, Trace};
/// let params: LinkParams = toml::from_str("trace = [10]")?;
/// // 1500 bytes each 10 ms are 1.2 Mbit/s.
/// let capacity = params.trace.unwrap().capacity().unwrap().mean_rate_bit_per_s();
/// assert_eq!(capacity, 1_200_000);
/// assert_eq!(Trace::named("rover.down").capacity(), None);
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// The file, or the name of a built-in trace, if it has one.
    name: Option<Arc<str>>,
    /// What it holds, once it was read.
    capacity: Option<Arc<CapacityTrace>>,
}

/// An opportunity that is partly used: its number, and the bytes left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Opportunity {
    number: u64,
    left_bytes: u64,
}

impl From<CapacityTrace> for Trace {
    fn from(capacity: CapacityTrace) -> Self {
        Trace {
            name: None,
            capacity: Some(Arc::new(capacity)),
        }
    }
}

impl Trace {
    /// A trace in a file that is still to be read: see [`crate::wiring::LinkBuilder::read_traces`].
    pub fn named(name: &str) -> Self {
        Trace {
            name: Some(name.into()),
            capacity: None,
        }
    }

    /// The file, or the name of a built-in trace, if it has one.
    pub fn name(&self) -> Option<&str> {
        self.name.as_deref()
    }

    /// What it holds, if it was read.
    pub fn capacity(&self) -> Option<&CapacityTrace> {
        self.capacity.as_deref()
    }

    pub(crate) fn read(&mut self, capacity: Arc<CapacityTrace>) {
        self.capacity = Some(capacity);
    }
}

/// When `bytes` that `came` then and may go from `ready` on have gone, and what they leave of the
/// last opportunity. What comes in an opportunity's millisecond misses it: mahimahi's
/// `LinkQueue::read_packet` uses up the opportunities of that millisecond before it takes a packet.
pub(super) fn delivered(
    trace: &CapacityTrace,
    (came, ready): (SimTime, SimTime),
    bytes: u64,
    used: Option<Opportunity>,
) -> (SimTime, Opportunity) {
    let each = CapacityTrace::PACKET_BYTES;
    let missed = trace.first_from(came + SimDuration::from_nanos(1));
    let mut number = trace.first_from(ready).max(missed);
    let mut left_bytes = each;
    if let Some(used) = used.filter(|used| used.number >= number) {
        number = used.number;
        left_bytes = used.left_bytes;
    }
    let more = bytes.saturating_sub(left_bytes).div_ceil(each);
    let last = number.saturating_add(more);
    let left_bytes = left_bytes + more * each - bytes;
    let rest = if left_bytes == 0 {
        Opportunity {
            number: last.saturating_add(1),
            left_bytes: each,
        }
    } else {
        Opportunity {
            number: last,
            left_bytes,
        }
    };
    (trace.opportunity(last), rest)
}

impl Serialize for Trace {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match (&self.name, &self.capacity) {
            (Some(name), _) => to.serialize_str(name),
            (None, Some(trace)) => {
                let stamps = trace.opportunities_ns().iter();
                to.collect_seq(stamps.map(|nanos| nanos / 1_000_000))
            }
            (None, None) => to.collect_seq::<[u64; 0]>([]),
        }
    }
}

impl<'de> Deserialize<'de> for Trace {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Stamps;

        impl<'de> Visitor<'de> for Stamps {
            type Value = Trace;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a trace's file or name, or a list of milliseconds")
            }

            fn visit_str<E: Error>(self, name: &str) -> Result<Trace, E> {
                Ok(Trace::named(name))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Trace, A::Error> {
                // One reader knows what a trace is: that of the files.
                let mut lines = String::new();
                while let Some(stamp) = seq.next_element::<u64>()? {
                    lines.push_str(&stamp.to_string());
                    lines.push('\n');
                }
                let trace = CapacityTrace::from_mahimahi(lines.as_bytes());
                trace.map(Trace::from).map_err(A::Error::custom)
            }
        }

        from.deserialize_any(Stamps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64) -> SimTime {
        SimTime::ZERO + SimDuration::from_millis(ms)
    }

    #[test]
    fn opportunities_are_shared_and_repeat() {
        let trace = CapacityTrace::from_mahimahi(b"2\n2\n5\n").unwrap();
        // 1000 bytes leave 500, which 500 more take at the same instant.
        let (done, rest) = delivered(&trace, (at(0), at(0)), 1000, None);
        assert_eq!(done, at(2));
        let (done, rest) = delivered(&trace, (at(1), at(2)), 500, Some(rest));
        assert_eq!(done, at(2));
        let (done, rest) = delivered(&trace, (at(1), at(2)), 1501, Some(rest));
        assert_eq!(done, at(5));
        assert_eq!(rest.left_bytes, 1499);
        // Who comes after it has no part in it, and the trace begins anew after 5 ms.
        assert_eq!(delivered(&trace, (at(6), at(6)), 10, Some(rest)).0, at(7));
        // Who comes in the millisecond of an opportunity misses it, who waited does not.
        assert_eq!(delivered(&trace, (at(2), at(2)), 10, None).0, at(5));
        assert_eq!(delivered(&trace, (at(1), at(2)), 10, None).0, at(2));
    }

    #[test]
    fn traces_print_back_to_themselves() {
        for text in ["trace = [2, 2, 5]", "trace = 'a.down'"] {
            let table: toml::Table = text.parse().unwrap();
            let trace = Trace::deserialize(table["trace"].clone()).unwrap();
            let printed = toml::Value::try_from(&trace).unwrap();
            assert_eq!(Trace::deserialize(printed).unwrap(), trace);
        }
        let empty = Trace::deserialize(toml::Value::Array(Vec::new()));
        assert!(empty.unwrap_err().to_string().contains("stamp"));
    }
}
