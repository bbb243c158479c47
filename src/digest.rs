//! The running digest: a chain, in key order, over each handled event and each fate.
//!
//! Names enter as hashes of their text and bodies as canonical protobuf, so the digest depends on
//! what happened and not on how things are numbered or stored.

use std::fmt;

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::{xxh3_64, xxh3_128_with_seed};

use crate::key::{EntityId, EventKey};
use crate::plan::Plan;
use crate::record::Record;
use crate::time::SimTime;

/// The digest of a run so far: 128 bits, printed as 32 hexadecimal digits.
///
/// ```
/// use farside::Digest;
/// let digest: Digest = "000102030405060708090a0b0c0d0e0f".parse().unwrap();
/// assert_eq!(digest.to_string(), "000102030405060708090a0b0c0d0e0f");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Digest(u128);

impl Digest {
    /// The digest of a run in which nothing has happened.
    pub const EMPTY: Digest = Digest(0x6661_7273_6964_6521_6661_7273_6964_6521);

    /// The digest after one more record with the given hash: a polynomial in the hashes over
    /// 2^128, so that order counts.
    pub(crate) fn extend(&mut self, hash: u128) {
        const FACTOR: u128 = 0x9E37_79B9_7F4A_7C15_F39C_C060_5CED_C835;
        self.0 = (self.0 ^ hash)
            .wrapping_mul(FACTOR)
            .rotate_left(29)
            .wrapping_add(hash);
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl std::str::FromStr for Digest {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match u128::from_str_radix(text, 16) {
            Ok(bits) if text.len() == 32 => Ok(Digest(bits)),
            _ => Err(format!("a digest is 32 hexadecimal digits, not {text:?}")),
        }
    }
}

impl From<Digest> for String {
    fn from(digest: Digest) -> String {
        digest.to_string()
    }
}

impl TryFrom<String> for Digest {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

/// What stands for the cause of an event that has none.
const NO_CAUSE: EventKey = EventKey {
    time: SimTime::MAX,
    step: u32::MAX,
    tie: 0,
    source: EntityId::CONTROL,
    count: u64::MAX,
};

/// The hash of one record, to extend a digest with: sixteen words, which is as far as the hash
/// function's fast path goes. When the message was sent is not among them: it is the cause's time.
pub(crate) fn record_hash(plan: &Plan, record: &Record<'_>) -> u128 {
    let (key, cause) = (record.key, record.cause.unwrap_or(NO_CAUSE));
    let shape = record.class as u64
        | u64::from(record.match_key.is_some()) << 8
        | u64::from(record.copy) << 32;
    let words = [
        key.time.as_nanos(),
        u64::from(key.step) << 32 | u64::from(cause.step),
        plan.name_hash(key.source),
        key.count,
        cause.time.as_nanos(),
        plan.name_hash(cause.source),
        cause.count,
        shape,
        plan.name_hash(record.sender),
        plan.name_hash(record.receiver),
        record.link.map_or(0, |link| plan.name_hash(link)),
        record.kind.map_or(0, |kind| kind.hash()),
        record.ordinal,
        record.match_key.map_or(0, |key| key.bits()),
        if record.reason.is_empty() {
            0
        } else {
            xxh3_64(record.reason.as_bytes())
        },
        record.body.len() as u64,
    ];
    let mut bytes = [0u8; 16 * 8];
    for (place, word) in bytes.chunks_exact_mut(8).zip(words) {
        place.copy_from_slice(&word.to_le_bytes());
    }
    xxh3_128_with_seed(&bytes, xxh3_64(record.body))
}
