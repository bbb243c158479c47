//! The sensor node: plans for the rovers on its vertices and admits rovers to them. What all nodes
//! do is here and in [`base`], [`ownership`] and [`failover`]; what a policy does, in [`max_plus`],
//! [`complete`] and [`planned`], of which a node has one ([`policy`]).

mod base;
mod complete;
mod failover;
mod max_plus;
pub(crate) mod messages;
mod ownership;
mod planned;
mod policy;
mod reservations;

use std::sync::Arc;

use farside::prelude::*;
use farside_actors::processor::{Processor, ProcessorChange};
use farside_worlds::{NodeId, VertexId};

use self::messages::Locations;
use crate::config::Policy;
use crate::failover::messages::{Account, Passed, Replaced};
use crate::max_plus::aids::messages::{Aside, Resolve, WaitProbe};
use crate::max_plus::lng::LocalGraph;
use crate::max_plus::messages::{Assignments, CandidatePaths, MaxPlus};
use crate::reservation::messages::{ItineraryAnswer, Relay};
use crate::safety::OccupancyTable;
use crate::safety::messages::{Beacon, Departed, DepartedAck};
use crate::shared::Shared;
use base::Base;
use complete::CompletePolicy;
use max_plus::{IterationOverdue, MaxPlusPolicy, ProcessorDone};
use planned::PlannedPolicy;
use policy::{NodePolicy, Phase, PhaseBegins};
use reservations::RegistryDue;

/// A sensor node of the network-guided system: owns vertices by the safety protocol, and grants
/// them as its policy says.
///
/// Its record of who holds its vertices is durable; what it plans is not.
pub struct Node {
    base: Base,
    policy: Box<dyn NodePolicy>,
}

/// The state machine of the policy that is configured.
fn policy_of(base: &Base, graph: Arc<LocalGraph>, processor: Processor) -> Box<dyn NodePolicy> {
    match base.site.config.policy {
        Policy::MaxPlus => Box::new(MaxPlusPolicy::new(base, graph, processor)),
        Policy::Complete => Box::new(CompletePolicy::default()),
        Policy::Reference | Policy::Prioritised | Policy::Coupled | Policy::Lacam => {
            Box::new(PlannedPolicy::default())
        }
    }
}

impl Node {
    pub(crate) fn new(
        site: Arc<Shared>,
        id: NodeId,
        graph: Arc<LocalGraph>,
        processor: Processor,
    ) -> Self {
        let base = Base::new(site, id);
        let policy = policy_of(&base, graph, processor);
        Node { base, policy }
    }

    /// A cycle begins: what was lost is said again, and the policy goes on.
    fn listen(&mut self, ctx: &mut Context<'_, Self>) {
        let site = self.base.site.clone();
        self.base.cycle = site.cycle_at(ctx.now());
        let knows_roadmap = self.base.knows_roadmap(ctx);
        if knows_roadmap {
            self.policy.open_cycle(&self.base, ctx);
        }
        let phase = Phase::Listen;
        ctx.timer(site.until_next_cycle(ctx.now()), PhaseBegins { phase });
        if knows_roadmap {
            self.watch(ctx);
            self.repeat(ctx);
            self.policy.begin_cycle(&self.base, ctx);
        }
    }
}

impl Actor for Node {
    type Accepts = (
        Beacon,
        Departed,
        DepartedAck,
        Locations,
        CandidatePaths,
        MaxPlus,
        Assignments,
        PhaseBegins,
        IterationOverdue,
        Relay,
        RegistryDue,
        WaitProbe,
        Resolve,
        Aside,
        ProcessorDone,
        Account,
        Replaced,
        Passed,
        ItineraryAnswer,
        ProcessorChange,
    );

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let base = &mut self.base;
        base.look_up(ctx)?;
        base.open_failover(ctx);
        // A node that was replaced has no vertices of its own any more.
        let owned: &[VertexId] = match base.answers_for(base.id) {
            true => base.site.sensors.owned(base.id),
            false => &[],
        };
        let occupancy = ctx.durable::<OccupancyTable>();
        let is_new = occupancy.is_new();
        occupancy.open(owned, base.rovers.len());
        for (rover, vertex) in base.site.standing().filter(|_| is_new) {
            let goal = base.site.missions[rover.0 as usize].1;
            occupancy.stand(vertex, rover, goal);
        }
        self.policy.started(&self.base, ctx);
        // The first cycle begins at once; after a restart, the next.
        let delay = if ctx.now() == SimTime::ZERO {
            SimDuration::ZERO
        } else {
            self.base.site.until_next_cycle(ctx.now())
        };
        let phase = Phase::Listen;
        ctx.timer(delay, PhaseBegins { phase });
        Ok(())
    }
}

impl Handler<ProcessorChange> for Node {
    /// The processor knew it from the start: this is for the log.
    fn handle(&mut self, _: ProcessorChange, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

impl Handler<PhaseBegins> for Node {
    fn handle(&mut self, timer: PhaseBegins, ctx: &mut Context<'_, Self>) -> Outcome {
        match timer.phase {
            Phase::Listen => self.listen(ctx),
            phase => self.policy.begin_phase(&self.base, ctx, phase),
        }
        Ok(())
    }
}
