//! The addresses that messages go to, and how a message is sealed for one.

use std::any::Any;
use std::fmt;
use std::marker::PhantomData;

use super::context::Context;
use super::{Actor, Handler};
use crate::encoding::{DecodeError, EncodeError, Schema};
use crate::engine::{AnyActor, Core, Letter, Sealed, Unseal};
use crate::fault::{LookupError, Outcome};
use crate::ids::Owner;
use crate::payload::{Encode, Message};
use crate::topology::{ActorType, KindEntry};

/// The address of an actor of type `A`: takes every message that `A` handles, and no other.
///
/// ```compile_fail
/// # use farside::prelude::*;
/// struct Deaf;
/// impl Actor for Deaf { type Accepts = (); }
/// #[derive(serde::Serialize, serde::Deserialize)]
/// struct Ping;
/// fn greet(ctx: &mut Context<'_, Deaf>, deaf: Address<Deaf>) {
///     ctx.send(deaf, Ping); // `Deaf` does not handle `Ping`
/// }
/// ```
pub struct Address<A> {
    pub(crate) owner: Owner,
    pub(crate) declared: u32,
    pub(crate) actor: PhantomData<fn() -> A>,
}

/// The address of an actor known only by handling `M`.
pub struct Recipient<M> {
    owner: Owner,
    declared: u32,
    seal: fn(M) -> Sealed,
}

impl<A> Clone for Address<A> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<A> Copy for Address<A> {}

impl<A> fmt::Debug for Address<A> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Address({})", self.declared)
    }
}

impl<M> Clone for Recipient<M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M> Copy for Recipient<M> {}

impl<M> fmt::Debug for Recipient<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Recipient({})", self.declared)
    }
}

impl<A: Actor> Address<A> {
    pub(crate) fn new(owner: Owner, declared: u32) -> Self {
        Address {
            owner,
            declared,
            actor: PhantomData,
        }
    }

    /// The same actor, known only by handling `M`.
    pub fn recipient<M: Message>(self) -> Recipient<M>
    where
        A: Handler<M>,
    {
        Recipient {
            owner: self.owner,
            declared: self.declared,
            seal: seal::<A, M>,
        }
    }
}

impl<M: Message> Recipient<M> {
    /// The actor with this number in its address, of this type and called so, as one that accepts
    /// `M`.
    pub(crate) fn of(
        owner: Owner,
        declared: u32,
        actor_type: &ActorType,
        name: &str,
    ) -> Result<Self, LookupError> {
        let accepted = actor_type.accepted(&KindEntry::of::<M>(), name)?;
        let seal = accepted.seal.downcast_ref::<fn(M) -> Sealed>();
        let seal = *seal.expect("what an actor accepts is kept with how it is sealed");
        Ok(Recipient {
            owner,
            declared,
            seal,
        })
    }
}

/// How messages of type `M` are sealed for actors of type `A`.
pub(crate) fn sealer<A: Handler<M>, M: Message>() -> fn(M) -> Sealed {
    seal::<A, M>
}

/// How messages of type `M` that a log holds are read and sealed for actors of type `A`.
pub(crate) fn unsealer<A: Handler<M>, M: Message>() -> Unseal {
    unseal::<A, M>
}

fn unseal<A: Handler<M>, M: Message>(schema: &Schema, bytes: &[u8]) -> Result<Sealed, DecodeError> {
    Ok(seal::<A, M>(schema.decode(bytes)?))
}

/// What `M` can be sent to: an [`Address`] or a [`Recipient`].
pub trait Target<M>: Copy {
    #[doc(hidden)]
    fn owner(&self) -> Owner;
    #[doc(hidden)]
    fn declared(&self) -> u32;
    #[doc(hidden)]
    fn seal(&self, message: M) -> Sealed;
}

impl<A: Handler<M>, M: Message> Target<M> for Address<A> {
    #[inline]
    fn owner(&self) -> Owner {
        self.owner
    }

    #[inline]
    fn declared(&self) -> u32 {
        self.declared
    }

    #[inline]
    fn seal(&self, message: M) -> Sealed {
        seal::<A, M>(message)
    }
}

impl<M: Message> Target<M> for Recipient<M> {
    #[inline]
    fn owner(&self) -> Owner {
        self.owner
    }

    #[inline]
    fn declared(&self) -> u32 {
        self.declared
    }

    #[inline]
    fn seal(&self, message: M) -> Sealed {
        (self.seal)(message)
    }
}

/// A change of a link, on its way from an actor.
struct Change<M>(Option<M>);

/// Seals what an actor tells a link.
pub(crate) fn seal_change<M: Message>(change: M) -> Sealed {
    Sealed(smallbox::smallbox!(Change(Some(change))))
}

impl<M: Message> Encode for Change<M> {
    fn encode(&self, schema: &Schema, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        match &self.0 {
            Some(change) => schema.encode(change, out),
            None => Ok(()),
        }
    }
}

impl<M: Message> Letter for Change<M> {
    fn deliver(&mut self, _actor: &mut dyn AnyActor, _core: &mut Core<'_>) -> Outcome {
        unreachable!("changes go to links");
    }

    fn decode(&self, schema: &Schema, bytes: &[u8]) -> Result<Sealed, DecodeError> {
        Ok(seal_change::<M>(schema.decode(bytes)?))
    }

    fn take_change(&mut self) -> Option<Box<dyn Any + Send>> {
        let change = self.0.take()?;
        Some(Box::new(change))
    }
}

struct Addressed<A, M> {
    /// `None` once delivered.
    message: Option<M>,
    actor: PhantomData<fn() -> A>,
}

fn seal<A: Handler<M>, M: Message>(message: M) -> Sealed {
    let letter = Addressed::<A, M> {
        message: Some(message),
        actor: PhantomData,
    };
    Sealed(smallbox::smallbox!(letter))
}

impl<A: Handler<M>, M: Message> Encode for Addressed<A, M> {
    fn encode(&self, schema: &Schema, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        match &self.message {
            Some(message) => schema.encode(message, out),
            None => Ok(()),
        }
    }
}

impl<A: Handler<M>, M: Message> Letter for Addressed<A, M> {
    fn deliver(&mut self, actor: &mut dyn AnyActor, core: &mut Core<'_>) -> Outcome {
        let actor = (actor as &mut dyn Any)
            .downcast_mut::<A>()
            .expect("addresses are typed by their actor");
        let message = self.message.take().expect("a letter is delivered once");
        actor.handle(message, &mut Context::new(core))
    }

    fn decode(&self, schema: &Schema, bytes: &[u8]) -> Result<Sealed, DecodeError> {
        unseal::<A, M>(schema, bytes)
    }
}
