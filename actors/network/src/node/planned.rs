//! The policies that plan for the whole team before the start (`reference`, `prioritised`,
//! `coupled`, `lacam`): the plan is in the reservation tables from the start, and vertices are
//! granted in their order. See [`baseline`](crate::baseline).

use farside::prelude::*;

use super::Node;
use super::base::Base;
use super::policy::NodePolicy;
use super::reservations::Reservations;
use crate::safety::News;
use crate::safety::messages::Whereabouts;

#[derive(Default)]
pub(super) struct PlannedPolicy {
    reservations: Reservations,
}

impl NodePolicy for PlannedPolicy {
    fn begin_cycle(&mut self, base: &Base, ctx: &mut Context<'_, Node>) {
        self.reservations.go_on(base, ctx);
        base.locate_for_failover(ctx);
    }

    fn heard(&mut self, base: &Base, ctx: &mut Context<'_, Node>, fact: &Whereabouts, news: &News) {
        self.reservations.heard(base, ctx, fact, news);
    }

    fn reservations(&mut self) -> Option<&mut Reservations> {
        Some(&mut self.reservations)
    }
}
