//! What an actor is: a state, the messages it accepts, and a handler for each.

use crate::fault::Outcome;
use crate::payload::Message;
use crate::topology::Accepted;

pub(crate) mod address;
mod boxed;
pub(crate) mod context;

pub use address::{Address, Recipient, Target};
pub use context::Context;

/// An actor: private state that changes only in its handlers, at instants of virtual time.
///
/// Actors are built by a constructor that a restart calls again, so that a run, a restart and a
/// replay build the same one.
pub trait Actor: Sized + Send + 'static {
    /// The message types that the actor handles, as a tuple: `(Ping,)` or `(Ping, Pong)`.
    type Accepts: Accepts<Self>;

    /// Called at the start of the run, and again after each restart.
    fn started(&mut self, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

/// An actor that handles messages of type `M`.
pub trait Handler<M: Message>: Actor {
    /// Handles one message at the present instant. An error ends the run.
    fn handle(&mut self, message: M, ctx: &mut Context<'_, Self>) -> Outcome;
}

/// A tuple of message types, each of which `A` handles. Implemented for tuples of up to 24.
pub trait Accepts<A> {
    #[doc(hidden)]
    fn list(accepted: &mut Vec<Accepted>);
}

macro_rules! accepts_tuples {
    ($($name:ident)*) => {
        impl<Host, $($name: Message),*> Accepts<Host> for ($($name,)*)
        where
            $(Host: Handler<$name>,)*
        {
            fn list(_accepted: &mut Vec<Accepted>) {
                $(_accepted.push(Accepted::new::<$name>(
                    Box::new(address::sealer::<Host, $name>()),
                    Box::new(address::unsealer::<Host, $name>()),
                ));)*
            }
        }
    };
}

accepts_tuples!();
accepts_tuples!(A);
accepts_tuples!(A B);
accepts_tuples!(A B C);
accepts_tuples!(A B C D);
accepts_tuples!(A B C D E);
accepts_tuples!(A B C D E F);
accepts_tuples!(A B C D E F G);
accepts_tuples!(A B C D E F G H);
accepts_tuples!(A B C D E F G H I);
accepts_tuples!(A B C D E F G H I J);
accepts_tuples!(A B C D E F G H I J K);
accepts_tuples!(A B C D E F G H I J K L);
accepts_tuples!(A B C D E F G H I J K L M);
accepts_tuples!(A B C D E F G H I J K L M N);
accepts_tuples!(A B C D E F G H I J K L M N O);
accepts_tuples!(A B C D E F G H I J K L M N O P);
accepts_tuples!(A B C D E F G H I J K L M N O P Q);
accepts_tuples!(A B C D E F G H I J K L M N O P Q R);
accepts_tuples!(A B C D E F G H I J K L M N O P Q R S);
accepts_tuples!(A B C D E F G H I J K L M N O P Q R S T);
accepts_tuples!(A B C D E F G H I J K L M N O P Q R S T U);
accepts_tuples!(A B C D E F G H I J K L M N O P Q R S T U V);
accepts_tuples!(A B C D E F G H I J K L M N O P Q R S T U V W);
accepts_tuples!(A B C D E F G H I J K L M N O P Q R S T U V W X);
