//! What a policy is to its node: a state machine that the node drives.
//!
//! A node owns vertices, hears of rovers and takes part in failover in the same way whatever its
//! policy ([`Base`], and the handlers of [`ownership`](super::ownership) and
//! [`failover`](super::failover)). Which free vertex is granted to whom is its policy's to decide.
//! A new policy is a new file beside this one, and a line in [`policy_of`](super::policy_of).

use std::any::Any;

use farside::prelude::*;
use farside_worlds::VertexId;
use serde::{Deserialize, Serialize};

use super::Node;
use super::base::Base;
use super::reservations::Reservations;
use crate::safety::News;
use crate::safety::messages::Whereabouts;

/// The parts of a planning cycle, in order. A timer begins each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) enum Phase {
    /// Beacons arrive; the entry queues are served.
    Listen,
    /// Step 1: locations are exchanged.
    Locate,
    /// Steps 2 and 3: candidate paths.
    Propose,
    /// Step 4: max-plus.
    Optimise,
    /// Step 5: assignments are exchanged.
    Assign,
    /// Step 6: vertices are granted.
    Admit,
}

/// Timer: a phase of the cycle begins.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct PhaseBegins {
    pub(super) phase: Phase,
}

/// The state machine of a policy. Its state is lost in a crash; what must not be is durable.
pub(super) trait NodePolicy: Any + Send {
    /// The node starts, for the first time or after a crash.
    fn started(&mut self, base: &Base, ctx: &mut Context<'_, Node>) {
        if let Some(reservations) = self.reservations() {
            reservations.open_registry(base, ctx);
        }
    }

    /// A cycle begins; nothing was said in it yet.
    fn open_cycle(&mut self, _base: &Base, _ctx: &mut Context<'_, Node>) {}

    /// A cycle has begun, and what was lost in the one before has been said again.
    fn begin_cycle(&mut self, base: &Base, ctx: &mut Context<'_, Node>);

    /// A later phase begins, of those for which the policy has set timers.
    fn begin_phase(&mut self, _base: &Base, _ctx: &mut Context<'_, Node>, _phase: Phase) {}

    /// What the node heard of a rover, and what that changed.
    fn heard(&mut self, base: &Base, ctx: &mut Context<'_, Node>, fact: &Whereabouts, news: &News);

    /// Another node answers for these vertices of this one from now on; ascending.
    fn give_up(&mut self, _vertices: &[VertexId]) {}

    /// The reservation tables that the node keeps, if it keeps any.
    fn reservations(&mut self) -> Option<&mut Reservations>;
}
