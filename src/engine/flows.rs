//! How many messages an actor has sent in each of its flows: by receiver and kind.
//!
//! A team in which everyone talks to everyone has very many flows, and each message looks up one. So a
//! flow is eight bytes in a table with open addressing (linear probing: D. E. Knuth, "The Art of
//! Computer Programming" vol. 3, section 6.4): one line of cache holds eight, and nearly always the
//! first place looked at is the flow's. Once an actor sends to a good part of all others, its flows of
//! that kind are counted in a list by receiver, four bytes each. The few flows that fit into neither
//! are elsewhere.

use prefetch_index::prefetch_index;

use crate::ids::{EntityId, KindIndex};
use crate::topology::FixedMap;

/// Whom a flow leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Receiver {
    /// An actor, by the number in its address: those have no gaps, as entities have.
    Actor(u32),
    /// The sender itself, by timers.
    Itself,
    /// Whatever else: a link that is changed, or what the simulation tells an actor.
    Entity(EntityId),
}

/// Receivers and kinds up to here fit into a short flow together.
const RECEIVER_BITS: u32 = 24;
const SHORT_RECEIVERS: u32 = (1 << RECEIVER_BITS) - 1;
const SHORT_KINDS: u32 = 1 << (32 - RECEIVER_BITS);

/// The receiver of timers in a short flow.
const TIMERS: u32 = SHORT_RECEIVERS;

/// The count of a flow that has become too long for a short one, and goes on as a long one.
const GOES_ON: u32 = u32::MAX;

/// A flow in eight bytes. In a [`Layout::List`], how many messages there were in each of two flows.
#[derive(Clone, Copy, Default)]
struct Short {
    /// The kind in the upper eight bits, the receiver in the others.
    flow: u32,
    /// How many messages there were. None: the place is free.
    count: u32,
}

/// What the places of [`Flows`] are.
#[derive(Clone, Copy)]
enum Layout {
    /// A table: none, or a power of two of places, of which so many are taken, at most three quarters.
    Table { taken: u32 },
    /// The counts of the flows of one kind, to all receivers from that of this flow on.
    List { first: u32 },
}

/// The flows of one sender, and how many messages each has had.
pub(crate) struct Flows {
    places: Box<[Short]>,
    layout: Layout,
    rest: Option<Box<Rest>>,
}

/// Flows that are not in the places.
#[derive(Default)]
struct Rest {
    /// Short ones, beside a list.
    unlisted: Flows,
    long: FixedMap<(Receiver, KindIndex), u64>,
}

impl Default for Flows {
    fn default() -> Self {
        Flows {
            places: Box::default(),
            layout: Layout::Table { taken: 0 },
            rest: None,
        }
    }
}

impl Flows {
    /// The number of the next message of this kind to the actor with this number in its address,
    /// counted from 0.
    #[inline(always)]
    pub(crate) fn next(&mut self, actor: u32, kind: KindIndex) -> u64 {
        if actor >= SHORT_RECEIVERS || kind >= SHORT_KINDS {
            return self.next_long(Receiver::Actor(actor), kind, 0);
        }
        match self.next_short(short_flow(actor, kind)) {
            GOES_ON => self.next_long(Receiver::Actor(actor), kind, GOES_ON),
            ordinal => u64::from(ordinal),
        }
    }

    /// The number of the next timer of this kind, counted from 0.
    #[inline(always)]
    pub(crate) fn next_timer(&mut self, kind: KindIndex) -> u64 {
        if kind >= SHORT_KINDS {
            return self.next_long(Receiver::Itself, kind, 0);
        }
        match self.next_short(short_flow(TIMERS, kind)) {
            GOES_ON => self.next_long(Receiver::Itself, kind, GOES_ON),
            ordinal => u64::from(ordinal),
        }
    }

    /// The number of what comes next of this kind in the flow with an entity that is no receiver of
    /// messages, counted from 0.
    pub(crate) fn next_of_entity(&mut self, entity: EntityId, kind: KindIndex) -> u64 {
        self.next_long(Receiver::Entity(entity), kind, 0)
    }

    /// Fetches where a flow probably is.
    #[inline(always)]
    pub(crate) fn fetch(&self, actor: u32, kind: KindIndex) {
        let flow = short_flow(actor, kind);
        let at = match self.layout {
            Layout::Table { .. } => first_place(flow, self.places.len()),
            Layout::List { first } => flow.wrapping_sub(first) as usize / 2,
        };
        prefetch_index(&self.places, at);
    }

    #[inline(always)]
    fn next_short(&mut self, flow: u32) -> u32 {
        match self.counted(flow) {
            Some(ordinal) => ordinal,
            None => {
                self.add(Short { flow, count: 1 });
                0
            }
        }
    }

    /// The number of the next message in a flow that is there, or in a list.
    #[inline(always)]
    fn counted(&mut self, flow: u32) -> Option<u32> {
        let first = match self.layout {
            Layout::Table { .. } => return self.counted_in_table(flow),
            Layout::List { first } => first,
        };
        let at = flow.wrapping_sub(first);
        let Some(pair) = self.places.get_mut(at as usize / 2) else {
            return self.counted_unlisted(flow);
        };
        let count = match at % 2 {
            0 => &mut pair.flow,
            _ => &mut pair.count,
        };
        let ordinal = *count;
        *count = ordinal.saturating_add(1);
        Some(ordinal)
    }

    #[inline(always)]
    fn counted_in_table(&mut self, flow: u32) -> Option<u32> {
        let last = self.places.len().wrapping_sub(1);
        let mut at = first_place(flow, self.places.len());
        loop {
            let place = self.places.get_mut(at)?;
            if place.count == 0 {
                return None;
            }
            if place.flow == flow {
                let ordinal = place.count;
                place.count = ordinal.saturating_add(1);
                return Some(ordinal);
            }
            at = (at + 1) & last;
        }
    }

    #[inline(never)]
    fn counted_unlisted(&mut self, flow: u32) -> Option<u32> {
        self.rest.as_mut()?.unlisted.counted(flow)
    }

    /// Adds a flow that was not there.
    #[inline(never)]
    fn add(&mut self, new: Short) {
        if self.is_full() {
            self.rebuild();
        }
        self.put(new);
    }

    fn put(&mut self, new: Short) {
        match &mut self.layout {
            Layout::Table { taken } => {
                *taken += 1;
                let last = self.places.len() - 1;
                let mut at = first_place(new.flow, self.places.len());
                while self.places[at].count > 0 {
                    at = (at + 1) & last;
                }
                self.places[at] = new;
            }
            Layout::List { first } => {
                let at = new.flow.wrapping_sub(*first);
                match (self.places.get_mut(at as usize / 2), at % 2) {
                    (Some(pair), 0) => pair.flow = new.count,
                    (Some(pair), _) => pair.count = new.count,
                    (None, _) => self.rest.get_or_insert_default().unlisted.add(new),
                }
            }
        }
    }

    /// True if no flow can be added before the places are made anew: those of the last table.
    fn is_full(&self) -> bool {
        match (self.layout, &self.rest) {
            (Layout::Table { taken }, _) => (taken as usize + 1) * 4 > self.places.len() * 3,
            (Layout::List { .. }, Some(rest)) => {
                !rest.unlisted.places.is_empty() && rest.unlisted.is_full()
            }
            (Layout::List { .. }, None) => false,
        }
    }

    /// Makes the places anew, for all short flows and more.
    fn rebuild(&mut self) {
        let all = self.take_short();
        let (layout, places) = match listed(&all) {
            Some((first, flows)) => (Layout::List { first }, flows.div_ceil(2) as usize),
            None => (Layout::Table { taken: 0 }, grown(all.len())),
        };
        (self.layout, self.places) = (layout, vec![Short::default(); places].into());
        for flow in all {
            self.put(flow);
        }
    }

    /// Takes all short flows.
    fn take_short(&mut self) -> Vec<Short> {
        let places = std::mem::take(&mut self.places).into_vec();
        let mut all = match self.layout {
            Layout::Table { .. } => places,
            Layout::List { first } => {
                let counts = places.iter().flat_map(|pair| [pair.flow, pair.count]);
                let flows = (0..).map(|at| first.wrapping_add(at));
                let short = |(flow, count)| Short { flow, count };
                flows.zip(counts).map(short).collect()
            }
        };
        all.retain(|flow| flow.count > 0);
        if let Some(rest) = &mut self.rest {
            all.append(&mut std::mem::take(&mut rest.unlisted).take_short());
        }
        all
    }

    /// Goes on with a flow that is not short, or starts with its message number `first`.
    #[cold]
    fn next_long(&mut self, receiver: Receiver, kind: KindIndex, first: u32) -> u64 {
        let rest = self.rest.get_or_insert_default();
        let count = rest.long.entry((receiver, kind)).or_insert(first.into());
        *count += 1;
        *count - 1
    }
}

/// If a list is worth it: its first flow, and of how many flows it is. They are of one kind, that of
/// most flows. A list takes four bytes for each of them, whether there is one or not; a table takes
/// eleven to twenty-two for each that there is.
fn listed(all: &[Short]) -> Option<(u32, u32)> {
    /// With fewer flows than this a table is small whatever it is like.
    const LEAST: u32 = 32;
    const FLOWS_FOR_EACH: u32 = 4;
    let mut of_kind = [0_u32; SHORT_KINDS as usize];
    for flow in all {
        of_kind[(flow.flow >> RECEIVER_BITS) as usize] += 1;
    }
    let (kind, flows) = of_kind.into_iter().enumerate().max_by_key(|kind| kind.1)?;
    let receivers = all
        .iter()
        .filter(|flow| (flow.flow >> RECEIVER_BITS) as usize == kind)
        .map(|flow| flow.flow & SHORT_RECEIVERS)
        .filter(|receiver| *receiver != TIMERS);
    let (least, greatest) = receivers.fold((TIMERS, 0), |(least, greatest), receiver| {
        (receiver.min(least), receiver.max(greatest))
    });
    // Who sends to one after the other has not come to the last yet.
    let margin = flows / 2;
    let begin = least.saturating_sub(margin);
    let end = (greatest.saturating_add(margin)).min(TIMERS);
    let worth_it = flows >= LEAST && begin < end && end - begin <= FLOWS_FOR_EACH * flows;
    worth_it.then(|| (short_flow(begin, kind as u32), end - begin))
}

/// How many places a new table for so many flows has: a power of two, not nearly filled by them. A
/// small one has more, since who starts with many flows would make each size anew.
fn grown(flows: usize) -> usize {
    let factor = if flows < 48 { 4 } else { 2 };
    (flows * factor).next_power_of_two().max(4)
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
    fn receiver() -> impl Strategy<Value = Receiver> {
        let edge = SHORT_RECEIVERS - 2..SHORT_RECEIVERS + 2;
        prop_oneof![
            8 => (0_u32..64).prop_map(Receiver::Actor),
            2 => edge.prop_map(Receiver::Actor),
            1 => Just(Receiver::Itself),
            1 => (0_u32..3).prop_map(|entity| Receiver::Entity(EntityId(entity))),
        ]
    }

    /// Receivers of whom most are a crowd of this size, so that they are listed.
    fn crowd(size: u32) -> impl Strategy<Value = Receiver> {
        prop_oneof![
            20 => (700..700 + size).prop_map(Receiver::Actor),
            10 => (SHORT_RECEIVERS - size..=SHORT_RECEIVERS).prop_map(Receiver::Actor),
            1 => (0_u32..5000).prop_map(Receiver::Actor),
            1 => receiver(),
        ]
    }

    fn kind() -> impl Strategy<Value = KindIndex> {
        prop_oneof![4 => 0_u32..3, 1 => SHORT_KINDS - 1..SHORT_KINDS + 2]
    }

    /// A map counts each flow by itself, and so do flows; true if some of them were listed.
    fn counts(sent: &[(Receiver, KindIndex)]) -> Result<bool, TestCaseError> {
        let mut flows = Flows::default();
        let mut expected: BTreeMap<_, u64> = BTreeMap::new();
        for &(receiver, kind) in sent {
            let ordinal = match receiver {
                Receiver::Actor(actor) => flows.next(actor, kind),
                Receiver::Itself => flows.next_timer(kind),
                Receiver::Entity(entity) => flows.next_of_entity(entity, kind),
            };
            let name = (format!("{receiver:?}"), kind);
            let count = expected.entry(name).or_default();
            prop_assert_eq!(ordinal, *count);
            *count += 1;
        }
        Ok(matches!(flows.layout, Layout::List { .. }))
    }

    proptest! {
        #[test]
        fn each_flow_is_counted_by_itself(
            sent in prop::collection::vec((receiver(), kind()), 0..2000),
        ) {
            counts(&sent)?;
        }

        #[test]
        fn each_flow_to_a_crowd_is_counted_by_itself(
            sent in (1_u32..400).prop_flat_map(|size| {
                prop::collection::vec((crowd(size), kind()), 0..4000)
            }),
        ) {
            counts(&sent)?;
        }
    }

    #[test]
    fn who_talks_to_all_has_a_list() {
        let to_all = |stride: u32| -> Vec<_> {
            let all = (0..3000).map(|n| n * 7 % 1000);
            all.map(|n| (Receiver::Actor(n * stride), 1)).collect()
        };
        assert!(counts(&to_all(1)).expect("counted"));
        // To one in a hundred: a list would be larger than a table.
        assert!(!counts(&to_all(100)).expect("counted"));
    }

    #[test]
    fn a_list_grows_for_who_sends_to_one_after_the_other() {
        let mut flows = Flows::default();
        for actor in 0..1000 {
            assert_eq!(flows.next(actor, 1), 0);
        }
        assert!(matches!(flows.layout, Layout::List { .. }));
        assert!(flows.places.len() <= 1000, "{}", flows.places.len());
        let rest = flows.rest.as_ref();
        let unlisted = rest.map_or(0, |rest| rest.unlisted.places.len());
        assert!(unlisted <= 256, "{unlisted}");
    }

    #[test]
    fn a_flow_goes_on_where_eight_bytes_end() {
        let mut flows = Flows::default();
        assert_eq!(flows.next(7, 3), 0);
        for place in flows.places.iter_mut().filter(|place| place.count > 0) {
            place.count = u32::MAX - 1;
        }
        let last = u64::from(u32::MAX);
        let next: Vec<u64> = (0..4).map(|_| flows.next(7, 3)).collect();
        assert_eq!(next, [last - 1, last, last + 1, last + 2]);
        assert_eq!(flows.next(7, 4), 0);
    }

    #[test]
    fn a_flow_goes_on_where_a_list_ends() {
        let mut flows = Flows::default();
        for actor in 0..200 {
            assert_eq!(flows.next(actor, 3), 0);
        }
        let Layout::List { first } = flows.layout else {
            panic!("no list of 200 neighbours");
        };
        let at = short_flow(151, 3).wrapping_sub(first);
        assert_eq!(at % 2, 1, "the second of a pair");
        flows.places[at as usize / 2].count = u32::MAX - 1;
        let last = u64::from(u32::MAX);
        let next: Vec<u64> = (0..4).map(|_| flows.next(151, 3)).collect();
        assert_eq!(next, [last - 1, last, last + 1, last + 2]);
        assert_eq!(flows.next(150, 3), 1);
    }
}
