//! What the kernel keeps for an actor: what every event needs in two lines of cache, the rest apart.

use std::any::Any;
use std::slice::from_ref;

use prefetch_index::prefetch_index;

use super::flows::Flows;
use super::{AnyActor, Factory};
use crate::ids::{EntityId, KindIndex, MatchKey};
use crate::random::Stream;
use crate::topology::FixedMap;

/// What a sender keeps of a flow (receiver, kind) in which it gives messages match keys.
#[derive(Clone, Copy, Default)]
struct KeyedFlow {
    last_key: Option<MatchKey>,
    repeat: u32,
}

/// What the kernel keeps for an actor, crashed or not.
pub(crate) struct CellState {
    flows: Flows,
    /// The next of the keys that this actor assigns.
    pub(crate) count: u64,
    pub(crate) entity: EntityId,
    pub(crate) declared: u32,
    pub(crate) incarnation: u32,
    /// The random stream that was asked for first, with its purpose: most actors have one.
    first_stream: Option<(&'static str, Stream)>,
    pub(crate) rest: Box<Rest>,
}

/// What is not needed at every event.
pub(crate) struct Rest {
    pub(crate) factory: Factory,
    streams: Vec<(&'static str, Stream)>,
    pub(crate) durable: Vec<Box<dyn Any + Send>>,
    /// What links have charged this actor. Spent energy outlives a crash.
    pub(crate) charged_j: f64,
    keyed_flows: FixedMap<(EntityId, KindIndex), KeyedFlow>,
}

impl CellState {
    pub(crate) fn new(entity: EntityId, declared: u32, factory: Factory) -> Self {
        CellState {
            flows: Flows::default(),
            count: 0,
            entity,
            declared,
            incarnation: 0,
            first_stream: None,
            rest: Box::new(Rest {
                factory,
                streams: Vec::new(),
                durable: Vec::new(),
                charged_j: 0.0,
                keyed_flows: FixedMap::default(),
            }),
        }
    }

    /// The ordinal of the next message of this kind to the actor with this number in its address.
    #[inline(always)]
    pub(crate) fn next_in_flow(&mut self, declared: u32, kind: KindIndex) -> u64 {
        self.flows.next(declared, kind)
    }

    /// Fetches what [`CellState::next_in_flow`] will need.
    #[inline(always)]
    pub(crate) fn fetch_flow(&self, declared: u32, kind: KindIndex) {
        self.flows.fetch(declared, kind);
    }

    /// The ordinal of the next change of a link, or of what the simulation tells.
    pub(crate) fn next_of_entity(&mut self, entity: EntityId, kind: KindIndex) -> u64 {
        self.flows.next_of_entity(entity, kind)
    }

    /// The ordinal of the next timer of this kind.
    #[inline(always)]
    pub(crate) fn next_timer(&mut self, kind: KindIndex) -> u64 {
        self.flows.next_timer(kind)
    }

    /// How many messages right before in a flow had this key too.
    #[inline(never)]
    pub(crate) fn repeats(&mut self, receiver: EntityId, kind: KindIndex, key: MatchKey) -> u32 {
        let flow = (receiver, kind);
        let keyed = self.rest.keyed_flows.entry(flow).or_default();
        keyed.repeat = if keyed.last_key == Some(key) {
            keyed.repeat + 1
        } else {
            0
        };
        keyed.last_key = Some(key);
        keyed.repeat
    }

    /// The random stream for `purpose`, made by `make` when first asked for.
    #[inline]
    pub(crate) fn stream(
        &mut self,
        purpose: &'static str,
        make: impl Fn() -> Stream,
    ) -> &mut Stream {
        // A purpose is nearly always the same literal: compare its address before its letters.
        let same = |known: &str| std::ptr::eq(known, purpose) || known == purpose;
        let (first, _) = self.first_stream.get_or_insert_with(|| (purpose, make()));
        if same(first) {
            return &mut self.first_stream.as_mut().expect("just put there").1;
        }
        let streams = &mut self.rest.streams;
        let at = match streams.iter().position(|(known, _)| same(known)) {
            Some(at) => at,
            None => {
                streams.push((purpose, make()));
                streams.len() - 1
            }
        };
        &mut streams[at].1
    }

    /// Forgets the random streams, at a restart.
    pub(crate) fn clear_streams(&mut self) {
        self.first_stream = None;
        self.rest.streams.clear();
    }
}

/// An actor, with what outlives it. As with events that wait, its two lines are an aligned pair.
#[repr(align(128))]
pub(crate) struct ActorCell {
    /// `None` while crashed.
    pub(crate) actor: Option<Box<dyn AnyActor>>,
    pub(crate) state: CellState,
}

impl ActorCell {
    /// Fetches all lines of this cell.
    #[inline(always)]
    pub(crate) fn fetch(&self) {
        prefetch_index(from_ref(&self.state.count), 0);
        prefetch_index(from_ref(&self.state.first_stream), 0);
    }

    /// Fetches the actor, as far as a line of cache goes.
    #[inline(always)]
    pub(crate) fn fetch_actor(&self) {
        if let Some(actor) = &self.actor {
            actor.fetch();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::mem::offset_of;

    use super::*;

    /// Every event reads and writes them; each further line of cache costs as much again.
    #[test]
    fn an_actor_has_two_lines_of_cache_and_both_are_fetched() {
        assert_eq!(size_of::<ActorCell>(), 128);
        let state = offset_of!(ActorCell, state);
        let fetched = [
            state + offset_of!(CellState, count),
            state + offset_of!(CellState, first_stream),
        ];
        let mut lines = fetched.map(|offset| offset / 64);
        lines.sort_unstable();
        assert_eq!(lines, [0, 1], "{fetched:?}");
    }
}
