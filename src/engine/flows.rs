//! How many messages an actor has sent in each of its flows: by receiver and kind.
//!
//! A team in which everyone talks to everyone has very many flows, and each message looks up one.
//! So a flow is eight bytes in a table with open addressing (linear probing: D. E. Knuth, "The Art of
//! Computer Programming" vol. 3, section 6.4): one line of cache holds eight, and nearly always the
//! first place looked at is the flow's. The few flows that do not fit into eight bytes are elsewhere.

use prefetch_index::prefetch_index;

use crate::ids::{EntityId, KindIndex};
use crate::topology::FixedMap;

/// A flow's receiver as [`Flows`] counts it: an actor, a link, or none for timers.
const TIMERS: u32 = u32::MAX;

/// Receivers and kinds up to here fit into a short flow together.
const RECEIVER_BITS: u32 = 24;
const SHORT_RECEIVERS: u32 = (1 << RECEIVER_BITS) - 1;
const SHORT_KINDS: u32 = 1 << (32 - RECEIVER_BITS);

/// The count of a flow that has become too long for a short one, and goes on as a long one.
const GOES_ON: u32 = u32::MAX;

/// A flow in eight bytes.
#[derive(Clone, Copy, Default)]
struct Short {
    /// The kind in the upper eight bits, the receiver in the others.
    flow: u32,
    /// How many messages there were. None: the place is free.
    count: u32,
}

/// The flows of one sender, and how many messages each has had.
#[derive(Default)]
pub(crate) struct Flows {
    /// None, or a power of two of places, at most three quarters of them taken.
    places: Box<[Short]>,
    taken: u32,
    long: Option<Box<FixedMap<(u32, KindIndex), u64>>>,
}

impl Flows {
    /// The number of the next message to `receiver` of this kind, counted from 0.
    #[inline(always)]
    pub(crate) fn next(&mut self, receiver: EntityId, kind: KindIndex) -> u64 {
        debug_assert_ne!(receiver.0, TIMERS);
        if receiver.0 >= SHORT_RECEIVERS || kind >= SHORT_KINDS {
            return self.next_long(receiver.0, kind, 0);
        }
        match self.next_short(receiver.0, kind) {
            GOES_ON => self.next_long(receiver.0, kind, GOES_ON),
            ordinal => u64::from(ordinal),
        }
    }

    /// The number of the next timer of this kind, counted from 0.
    #[inline(always)]
    pub(crate) fn next_timer(&mut self, kind: KindIndex) -> u64 {
        if kind >= SHORT_KINDS {
            return self.next_long(TIMERS, kind, 0);
        }
        match self.next_short(SHORT_RECEIVERS, kind) {
            GOES_ON => self.next_long(TIMERS, kind, GOES_ON),
            ordinal => u64::from(ordinal),
        }
    }

    /// Fetches where a flow probably is.
    #[inline(always)]
    pub(crate) fn fetch(&self, receiver: EntityId, kind: KindIndex) {
        let at = first_place(short_flow(receiver.0, kind), self.places.len());
        prefetch_index(&self.places, at);
    }

    #[inline(always)]
    fn next_short(&mut self, receiver: u32, kind: KindIndex) -> u32 {
        let flow = short_flow(receiver, kind);
        let last = self.places.len().wrapping_sub(1);
        let mut at = first_place(flow, self.places.len());
        while let Some(place) = self.places.get_mut(at) {
            if place.count == 0 {
                break;
            }
            if place.flow == flow {
                let ordinal = place.count;
                place.count = ordinal.saturating_add(1);
                return ordinal;
            }
            at = (at + 1) & last;
        }
        self.add(flow);
        0
    }

    /// Adds a flow that has had its first message.
    #[inline(never)]
    fn add(&mut self, flow: u32) {
        if (self.taken as usize + 1) * 4 > self.places.len() * 3 {
            let more = vec![Short::default(); grown(self.places.len())].into();
            let all = std::mem::replace(&mut self.places, more);
            for place in all.into_iter().filter(|place| place.count > 0) {
                self.put(place);
            }
        }
        self.taken += 1;
        self.put(Short { flow, count: 1 });
    }

    fn put(&mut self, new: Short) {
        let last = self.places.len() - 1;
        let mut at = first_place(new.flow, self.places.len());
        while self.places[at].count > 0 {
            at = (at + 1) & last;
        }
        self.places[at] = new;
    }

    /// Goes on with a flow that is not short, or starts with its message number `first`.
    #[cold]
    fn next_long(&mut self, receiver: u32, kind: KindIndex, first: u32) -> u64 {
        let long = self.long.get_or_insert_default();
        let count = long.entry((receiver, kind)).or_insert(first.into());
        *count += 1;
        *count - 1
    }
}

/// The next size of a table. A small one grows by more, since who starts with many flows would put
/// each anew at each size.
fn grown(places: usize) -> usize {
    if places < 64 {
        (places * 4).max(4)
    } else {
        places * 2
    }
}

/// What a flow is in a table.
#[inline(always)]
fn short_flow(receiver: u32, kind: KindIndex) -> u32 {
    kind << RECEIVER_BITS | receiver
}

/// Where a flow is looked for first, in a table of this size.
#[inline(always)]
fn first_place(flow: u32, places: usize) -> usize {
    // The upper bits of a product with the golden ratio spread neighbours far apart (Knuth, as
    // above).
    let hash = u64::from(flow.wrapping_mul(0x9E37_79B9));
    ((hash * places as u64) >> 32) as usize
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;

    /// Receivers and kinds on both sides of what is short, few enough to be met again.
    fn receiver() -> impl Strategy<Value = Option<u32>> {
        let edge = SHORT_RECEIVERS - 2..SHORT_RECEIVERS + 2;
        prop_oneof![
            8 => (0_u32..64).prop_map(Some),
            2 => edge.prop_map(Some),
            1 => Just(None),
        ]
    }

    fn kind() -> impl Strategy<Value = KindIndex> {
        prop_oneof![4 => 0_u32..3, 1 => SHORT_KINDS - 1..SHORT_KINDS + 2]
    }

    proptest! {
        /// A map counts each flow by itself.
        #[test]
        fn each_flow_is_counted_by_itself(
            sent in prop::collection::vec((receiver(), kind()), 0..2000),
        ) {
            let mut flows = Flows::default();
            let mut expected: BTreeMap<_, u64> = BTreeMap::new();
            for (receiver, kind) in sent {
                let ordinal = match receiver {
                    Some(receiver) => flows.next(EntityId(receiver), kind),
                    None => flows.next_timer(kind),
                };
                let count = expected.entry((receiver, kind)).or_default();
                prop_assert_eq!(ordinal, *count);
                *count += 1;
            }
        }
    }

    #[test]
    fn a_flow_goes_on_where_eight_bytes_end() {
        let mut flows = Flows::default();
        let receiver = EntityId(7);
        assert_eq!(flows.next(receiver, 3), 0);
        for place in flows.places.iter_mut().filter(|place| place.count > 0) {
            place.count = u32::MAX - 1;
        }
        let last = u64::from(u32::MAX);
        let next: Vec<u64> = (0..4).map(|_| flows.next(receiver, 3)).collect();
        assert_eq!(next, [last - 1, last, last + 1, last + 2]);
        assert_eq!(flows.next(receiver, 4), 0);
    }
}
