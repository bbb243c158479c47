//! How long a queue may get.

use std::fmt;

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
