//! Code of users runs behind a guard, wherever the kernel calls it: handlers, constructors, links,
//! the encoding of messages, and what happens when an actor or a message is dropped. A panic there
//! is a fault with a name, and the run's log stays readable.
//!
//! A type that panics while it is dropped because of another panic still ends the program: Rust
//! aborts then, and nothing can catch it.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::fault::FaultCause;

/// Runs code of a user; a panic becomes a cause.
#[inline(always)]
pub(crate) fn guarded<T>(code: impl FnOnce() -> T) -> Result<T, Box<FaultCause>> {
    match catch_unwind(AssertUnwindSafe(code)) {
        Ok(value) => Ok(value),
        Err(payload) => Err(panicked(payload, FaultCause::Panic)),
    }
}

/// Drops something of a user; a panic becomes a cause.
pub(crate) fn dropped<T>(value: T) -> Result<(), Box<FaultCause>> {
    catch_unwind(AssertUnwindSafe(|| drop(value)))
        .map_err(|payload| panicked(payload, FaultCause::PanicInDrop))
}

#[cold]
fn panicked(payload: Box<dyn Any + Send>, cause: fn(String) -> FaultCause) -> Box<FaultCause> {
    Box::new(cause(panic_text(payload)))
}

/// What a panic says.
fn panic_text(payload: Box<dyn Any + Send>) -> String {
    let text = payload
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned());
    text.or_else(|| payload.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| {
            // Its own drop might panic too, and nobody would be there to catch that.
            std::mem::forget(payload);
            "a value that is no text".to_owned()
        })
}
