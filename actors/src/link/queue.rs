//! How long a queue may get, and what waits in it.

use std::collections::VecDeque;
use std::fmt;

use farside::SimTime;
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::units;

/// The limit of a drop-tail queue: a number of messages (`queue = 10`), or of bytes with overhead
/// (`queue = "64kB"`), that wait behind the one being sent.
///
/// ```
/// use farside_actors::link::{LinkParams, QueueLimit};
/// let params: LinkParams = toml::from_str("queue = '1.5kB'")?;
/// assert_eq!(params.queue, Some(QueueLimit::Bytes(1500)));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QueueLimit {
    /// So many messages.
    Messages(u64),
    /// So many bytes, overhead included.
    Bytes(u64),
}

impl QueueLimit {
    /// Whether so many messages of so many bytes together may wait.
    pub fn allows(self, messages: u64, bytes: u64) -> bool {
        match self {
            QueueLimit::Messages(limit) => messages <= limit,
            QueueLimit::Bytes(limit) => bytes <= limit,
        }
    }
}

/// The messages that wait, in the order in which they are transmitted. What all of them come to is
/// kept up to date, so that one more costs the same however many there are.
#[derive(Clone, Debug, Default)]
pub(super) struct Backlog {
    /// Those that will be transmitted, and those whose lifetime ends before, each in order.
    waiting: [VecDeque<Waiting>; 2],
    bytes: u64,
}

/// What a message waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WaitsFor {
    Transmission = 0,
    Expiry = 1,
}

/// A message that waits.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    until: SimTime,
    bytes: u64,
}

impl Waiting {
    /// When it has waited long enough, and its bytes. Tests count how often that is asked.
    fn look(&self) -> (SimTime, u64) {
        #[cfg(test)]
        LOOKS.with(|looks| looks.set(looks.get() + 1));
        (self.until, self.bytes)
    }
}

#[cfg(test)]
thread_local! {
    /// How often anything was asked of a message that waits.
    static LOOKS: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };
}

impl Backlog {
    /// Forgets what waits no longer at `now`.
    pub(super) fn begin_until(&mut self, now: SimTime) {
        for waiting in &mut self.waiting {
            while let Some((until, bytes)) = waiting.front().map(Waiting::look) {
                if until > now {
                    break;
                }
                waiting.pop_front();
                self.bytes -= bytes;
            }
        }
    }

    /// Takes a message that waits until then, no less than those before it that wait for the same;
    /// `false` if the limit leaves no room.
    pub(super) fn push(
        &mut self,
        (waits_for, until): (WaitsFor, SimTime),
        bytes: u64,
        limit: Option<QueueLimit>,
    ) -> bool {
        let messages = self.waiting.iter().map(VecDeque::len).sum::<usize>() as u64 + 1;
        let all = self.bytes.saturating_add(bytes);
        if limit.is_some_and(|limit| !limit.allows(messages, all)) {
            return false;
        }
        let bytes = all - self.bytes;
        self.waiting[waits_for as usize].push_back(Waiting { until, bytes });
        self.bytes = all;
        true
    }
}

impl Serialize for QueueLimit {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            QueueLimit::Messages(limit) => to.serialize_u64(*limit),
            QueueLimit::Bytes(limit) => to.serialize_str(&units::print_data_size(*limit)),
        }
    }
}

impl<'de> Deserialize<'de> for QueueLimit {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Limit;

        impl Visitor<'_> for Limit {
            type Value = QueueLimit;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number of messages, or of bytes such as \"64kB\"")
            }

            fn visit_u64<E: Error>(self, limit: u64) -> Result<QueueLimit, E> {
                // TOML's integers are signed.
                if i64::try_from(limit).is_err() {
                    return Err(E::custom(format!("{limit}: expected fewer messages")));
                }
                Ok(QueueLimit::Messages(limit))
            }

            fn visit_i64<E: Error>(self, limit: i64) -> Result<QueueLimit, E> {
                let limit = u64::try_from(limit).map_err(|_| {
                    E::custom(format!("{limit}: expected a number of messages from 0 on"))
                })?;
                Ok(QueueLimit::Messages(limit))
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<QueueLimit, E> {
                let bytes = units::parse_data_size(text).map_err(E::custom)?;
                Ok(QueueLimit::Bytes(bytes))
            }
        }

        from.deserialize_any(Limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How often messages that wait are looked at while `count` are taken, a thousand at a time,
    /// and none begins before all are there.
    fn looks(count: u64, limit: Option<QueueLimit>) -> u64 {
        LOOKS.with(|looks| looks.set(0));
        let mut backlog = Backlog::default();
        for number in 0..count {
            backlog.begin_until(SimTime::from_nanos(number / 1000));
            let start = SimTime::from_nanos(count + number);
            assert!(backlog.push((WaitsFor::Transmission, start), 200, limit));
        }
        assert_eq!(backlog.bytes, 200 * count);
        backlog.begin_until(SimTime::from_nanos(2 * count));
        assert_eq!((backlog.waiting[0].len(), backlog.bytes), (0, 0));
        LOOKS.with(std::cell::Cell::get)
    }

    #[test]
    fn a_message_costs_the_same_however_many_wait() {
        let roomy = [QueueLimit::Messages(1 << 40), QueueLimit::Bytes(1 << 40)];
        for limit in [None].into_iter().chain(roomy.map(Some)) {
            for count in [1_000, 20_000, 160_000] {
                let looks = looks(count, limit);
                // One when it goes, and of the first one each time that one comes.
                assert!(
                    looks <= 2 * count + 1,
                    "{count} wait, {limit:?}: {looks} looks"
                );
            }
        }
    }

    #[test]
    fn a_message_that_is_refused_leaves_the_rest_alone() {
        let mut backlog = Backlog::default();
        let at = |nanos| (WaitsFor::Transmission, SimTime::from_nanos(nanos));
        let limit = Some(QueueLimit::Bytes(500));
        assert!(backlog.push(at(10), 300, limit));
        assert!(!backlog.push(at(20), 201, limit));
        assert!(backlog.push(at(20), 200, limit));
        backlog.begin_until(at(10).1);
        assert!(backlog.push(at(30), 300, limit));
        assert!(!backlog.push(at(40), 1, limit));
    }
}
