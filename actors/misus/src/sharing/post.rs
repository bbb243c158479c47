//! How messages of the machines reach actors.

use std::collections::BTreeMap;
use std::sync::Arc;

use farside::Message as Sent;
use farside::prelude::*;
use serde::{Deserialize, Serialize};

use crate::shac::{Message, Party};

/// The name of each party's actor.
pub type Names = Arc<BTreeMap<Party, String>>;

/// A timer: the machine or its planner has something to do.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct SharingDue;

/// The most moves of a planner at one instant. One that wants more repeats itself.
pub(super) const MOST_MOVES: usize = 10_000;

/// Sends what a machine wants to be sent.
pub(super) fn post<A: Actor>(
    ctx: &mut Context<'_, A>,
    names: &Names,
    sends: Vec<(Party, Message)>,
) -> Outcome {
    for (to, message) in sends {
        let Some(name) = names.get(&to) else {
            return Err(HandlerError::new(format!("no actor for {to:?}")));
        };
        match message {
            Message::Assign(message) => send(ctx, name, message)?,
            Message::Ack(message) => send(ctx, name, message)?,
            Message::Status(message) => send(ctx, name, message)?,
            Message::Release(message) => send(ctx, name, message)?,
            Message::Cancel(message) => send(ctx, name, message)?,
            Message::Outcome(message) => send(ctx, name, message)?,
            Message::Digest(message) => send(ctx, name, message)?,
        }
    }
    Ok(())
}

fn send<A: Actor, M: Sent>(ctx: &mut Context<'_, A>, name: &str, message: M) -> Outcome {
    let recipient = ctx.recipient::<M>(name)?;
    ctx.send(recipient, message);
    Ok(())
}

/// Sets the timer for the next instant at which there is something to do.
pub(super) fn set_timer<A: Actor + Handler<SharingDue>>(
    ctx: &mut Context<'_, A>,
    timer: &mut Option<TimerId>,
    wake: SimTime,
) {
    if let Some(timer) = timer.take() {
        ctx.cancel(timer);
    }
    if wake < SimTime::MAX {
        // What is due already waits for a nanosecond, so that no instant goes round in a circle.
        let wait = wake.since(ctx.now()).max(SimDuration::from_nanos(1));
        *timer = Some(ctx.timer(wait, SharingDue));
    }
}

/// Handlers of all messages of the protocol, which call `receive` with the message.
macro_rules! receives {
    ($actor:ty: $($kind:ident as $variant:ident),+) => {
        $(impl Handler<$crate::shac::$kind> for $actor {
            fn handle(
                &mut self,
                message: $crate::shac::$kind,
                ctx: &mut Context<'_, Self>,
            ) -> Outcome {
                self.receive(&$crate::shac::Message::$variant(message), ctx)
            }
        })+
    };
}
pub(crate) use receives;
