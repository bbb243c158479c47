//! The hash of what happened, by which the digest is extended.

use xxhash_rust::xxh3::{xxh3_64, xxh3_128_with_seed};

use super::Head;
use crate::ids::EntityId;
use crate::key::EventKey;
use crate::record::RecordClass;
use crate::time::SimTime;
use crate::topology::{Reason, Topology};

/// What stands for the cause of an event that has none.
const NO_CAUSE: EventKey = EventKey {
    time: SimTime::MAX,
    step: u32::MAX,
    tie: 0,
    source: EntityId::CONTROL,
    count: u64::MAX,
};

impl Head {
    /// [`Head::hash`], or zero if there is no digest.
    #[inline(always)]
    pub(crate) fn hash_if_wanted(
        &self,
        topology: &Topology,
        class: RecordClass,
        key: EventKey,
        body: &[u8],
    ) -> u128 {
        if topology.digest {
            self.hash(topology, class, key, body)
        } else {
            0
        }
    }

    /// The hash of what happened to the message or entity of this head: sixteen words, which is as
    /// far as the hash function's fast path goes. When the message was sent is not among them: it
    /// is the cause's time.
    #[inline(never)]
    fn hash(&self, topology: &Topology, class: RecordClass, key: EventKey, body: &[u8]) -> u128 {
        let cause = self.cause().unwrap_or(NO_CAUSE);
        let match_key = self.match_key();
        let shape =
            class as u64 | u64::from(match_key.is_some()) << 8 | u64::from(self.copy()) << 32;
        let words = [
            key.time.as_nanos(),
            u64::from(key.step) << 32 | u64::from(cause.step),
            topology.name_hash(key.source),
            key.count,
            cause.time.as_nanos(),
            topology.name_hash(cause.source),
            cause.count,
            shape,
            topology.name_hash(self.sender),
            topology.name_hash(self.receiver),
            self.link().map_or(0, |link| topology.name_hash(link)),
            self.kind().map_or(0, |kind| topology.kind(kind).hash()),
            self.ordinal,
            match_key.map_or(0, |key| key.bits()),
            if self.reason == Reason::default() {
                0
            } else {
                reason_hash(topology.reason(self.reason))
            },
            body.len() as u64,
        ];
        let mut bytes = [0u8; 16 * 8];
        for (place, word) in bytes.chunks_exact_mut(8).zip(words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        xxh3_128_with_seed(&bytes, xxh3_64(body))
    }
}

/// Out of the way of the many events that have no reason.
#[cold]
fn reason_hash(reason: &str) -> u64 {
    // A link may give an empty one, which is as good as none.
    if reason.is_empty() {
        0
    } else {
        xxh3_64(reason.as_bytes())
    }
}
