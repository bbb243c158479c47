//! An actor as the engine keeps it: in a box, behind a trait that knows no type.

use super::{Actor, Context};
use crate::engine::{AnyActor, Core};
use crate::fault::Outcome;

/// An actor in its box, with something that can be read whatever its type is.
pub(crate) struct Boxed<A> {
    pub(crate) actor: A,
    readable: u64,
}

impl<A: Actor> Boxed<A> {
    pub(crate) fn boxed(actor: A) -> Box<dyn AnyActor> {
        Box::new(Boxed { actor, readable: 0 })
    }
}

impl<A: Actor> AnyActor for Boxed<A> {
    fn started(&mut self, core: &mut Core<'_>) -> Outcome {
        self.actor.started(&mut Context::new(core))
    }

    fn read_ahead(&self) -> u64 {
        self.readable
    }
}
