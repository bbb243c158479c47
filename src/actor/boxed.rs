//! An actor as the engine keeps it: in a box, behind a trait that knows no type.

use std::slice::from_ref;

use prefetch_index::prefetch_index;

use super::{Actor, Context};
use crate::engine::{AnyActor, Core};
use crate::fault::Outcome;

impl<A: Actor> AnyActor for A {
    fn started(&mut self, core: &mut Core<'_>) -> Outcome {
        Actor::started(self, &mut Context::new(core))
    }

    fn fetch(&self) {
        prefetch_index(from_ref(self), 0);
    }
}
