//! The policy `complete`: rovers that wait without a reserved path apply for one, and vertices are
//! granted in the order of the reservation tables. See [`reservation`](crate::reservation).

use farside::prelude::*;

use super::Node;
use super::base::Base;
use super::policy::NodePolicy;
use super::reservations::Reservations;
use crate::safety::News;
use crate::safety::messages::Whereabouts;

#[derive(Default)]
pub(super) struct CompletePolicy {
    reservations: Reservations,
}

impl NodePolicy for CompletePolicy {
    fn begin_cycle(&mut self, base: &Base, ctx: &mut Context<'_, Node>) {
        self.reservations.apply(base, ctx);
        base.locate_for_failover(ctx);
    }

    fn heard(&mut self, base: &Base, ctx: &mut Context<'_, Node>, fact: &Whereabouts, news: &News) {
        self.reservations.heard(base, ctx, fact, news);
    }

    fn reservations(&mut self) -> Option<&mut Reservations> {
        Some(&mut self.reservations)
    }
}
