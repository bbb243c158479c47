//! Actors and messages as the engine holds them: by what it does with them, whatever their types.

use std::any::Any;

use smallbox::SmallBox;
use smallbox::space::S4;

use super::{CellState, Parts};
use crate::encoding::{DecodeError, Schema};
use crate::fault::Outcome;
use crate::payload::Encode;

/// A message on its way, with what it takes to deliver, encode and copy it. Messages of up to 24
/// bytes (32, if they have a spare bit pattern) travel without an allocation.
#[doc(hidden)]
pub struct Sealed(pub(crate) SmallBox<dyn Letter, S4>);

/// How an encoded message becomes one sealed for an actor.
pub(crate) type Unseal = fn(&Schema, &[u8]) -> Result<Sealed, DecodeError>;

/// What the engine can do with a message whose type it does not know.
pub(crate) trait Letter: Encode + Send {
    /// Hands the message to `actor`, which must be of the type it was addressed to.
    fn deliver(&mut self, actor: &mut dyn AnyActor, core: &mut Core<'_>) -> Outcome;
    /// Another letter with the message that `bytes` encode, for a link's further copies: messages
    /// need not be `Clone`.
    fn decode(&self, schema: &Schema, bytes: &[u8]) -> Result<Sealed, DecodeError>;
    /// The change of a link that this letter holds, if it is one.
    fn take_change(&mut self) -> Option<Box<dyn Any + Send>> {
        None
    }
}

/// An actor whose type the engine does not know.
pub(crate) trait AnyActor: Any + Send {
    fn started(&mut self, core: &mut Core<'_>) -> Outcome;
    /// Fetches the actor, as far as a line of cache goes.
    fn fetch(&self);
}

/// The constructor of an actor, called with its name at the start and at each restart.
pub(crate) type Factory = Box<dyn Fn(&str) -> Box<dyn AnyActor> + Send>;

/// What a handler works with, whatever its actor's type.
pub(crate) struct Core<'a> {
    pub(crate) parts: &'a mut Parts,
    pub(crate) state: &'a mut CellState,
}
