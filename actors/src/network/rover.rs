//! The rover: stands, drives along an edge, says where it is. It decides nothing: without a valid
//! command it holds, for ever if need be.

use std::sync::Arc;

use farside::LinkId;
use farside::prelude::*;
use farside_worlds::{NodeId, VertexId};
use serde::{Deserialize, Serialize};

use super::assemble::Site;
use super::config::{Policy, Sabotage};
use super::messages::{Beacon, Grant, RoverId, RoverState};
use super::node::Node;
use super::safety::{Answer, RoverMemory};
use crate::radio::RadioChange;

/// A rover of the network-guided system.
///
/// It accepts [`Grant`]s, and answers with [`Beacon`]s: one a cycle to the owner of its vertex, one
/// at each change, one to whoever grants a step that is done.
pub struct Rover {
    site: Arc<Site>,
    id: RoverId,
    entry: VertexId,
    goal: VertexId,
    nodes: Vec<Address<Node>>,
    /// What must know where it is.
    radios: Vec<LinkId<RadioChange>>,
}

/// Timer: a planning cycle begins.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct CycleStarts;

/// Timer: the end of the edge is reached.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct EdgeEnds;

/// Timer: the next move may begin.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct PaceAllows;

impl Rover {
    pub(crate) fn new(site: Arc<Site>, id: RoverId) -> Self {
        let (entry, goal) = site.missions[id.0 as usize];
        Rover {
            site,
            id,
            entry,
            goal,
            nodes: Vec::new(),
            radios: Vec::new(),
        }
    }

    fn record(&self, ctx: &mut Context<'_, Self>) {
        let whereabouts = ctx.durable::<RoverMemory>().whereabouts(self.id);
        let state = RoverState {
            whereabouts,
            entry: self.entry,
            goal: self.goal,
            transmit_energy_j: ctx.transmit_energy_j(),
        };
        ctx.sample(&state);
    }

    /// Begins to drive along the edge from `here`.
    fn drive(&self, ctx: &mut Context<'_, Self>) {
        ctx.timer(self.site.config.traverse, EdgeEnds);
        let memory = ctx.durable::<RoverMemory>();
        let (Some(here), Some(next)) = (memory.vertex, memory.moving_to) else {
            return;
        };
        let end = ctx.now() + self.site.config.traverse;
        for radio in &self.radios {
            let moves = RadioChange::Moves {
                host: self.site.rover_names[self.id.0 as usize].clone(),
                from_m: self.site.place_m(here).into(),
                to_m: self.site.place_m(next).into(),
                end_ns: end.as_nanos(),
            };
            ctx.tell_link(*radio, moves);
        }
    }

    fn beacon(&self, ctx: &mut Context<'_, Self>, to: NodeId) {
        let memory = ctx.durable::<RoverMemory>();
        let beacon = Beacon {
            whereabouts: memory.whereabouts(self.id),
            previous: memory.previous,
            goal: self.goal,
        };
        ctx.send(self.nodes[to.0 as usize], beacon);
    }

    /// Tells the owner of the vertex that it stands on, or is leaving.
    fn beacon_here(&self, ctx: &mut Context<'_, Self>) {
        if let Some(here) = ctx.durable::<RoverMemory>().vertex {
            self.beacon(ctx, self.site.sensors.owner(here));
        }
    }

    /// Moves on without being told to: what [`Sabotage::MoveUnbidden`] is for.
    fn misbehave(&self, ctx: &mut Context<'_, Self>, probability: f64) {
        let unbidden = ctx.random("sabotage").chance(probability);
        let memory = ctx.durable::<RoverMemory>();
        let (Some(here), None, true) = (memory.vertex, memory.moving_to, unbidden) else {
            return;
        };
        memory.moving_to = self.site.roadmap.neighbors(here).first().copied();
        self.drive(ctx);
        self.record(ctx);
        self.beacon_here(ctx);
    }
}

impl Actor for Rover {
    type Accepts = (Grant, CycleStarts, EdgeEnds, PaceAllows);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        for name in &self.site.node_names {
            self.nodes.push(ctx.lookup::<Node>(name)?);
        }
        self.radios = ctx.links();
        let memory = ctx.durable::<RoverMemory>();
        if self.site.stays && memory.step == 0 {
            memory.vertex = Some(self.entry);
            memory.step = 1;
        }
        // Stopped in the middle of an edge by a crash, it drives the edge to its end: it is bound to.
        if ctx.durable::<RoverMemory>().moving_to.is_some() {
            self.drive(ctx);
        }
        self.record(ctx);
        if self.site.config.policy != Policy::Paper {
            self.proceed(ctx);
        }
        ctx.timer(self.site.until_next_cycle(ctx.now()), CycleStarts);
        Ok(())
    }
}

impl Handler<CycleStarts> for Rover {
    fn handle(&mut self, _timer: CycleStarts, ctx: &mut Context<'_, Self>) -> Outcome {
        self.beacon_here(ctx);
        if let Sabotage::MoveUnbidden(probability) = self.site.config.sabotage {
            self.misbehave(ctx, probability);
        }
        let memory = ctx.durable::<RoverMemory>();
        let has_left = memory.vertex.is_none() && memory.step > 0;
        if !has_left {
            ctx.timer(self.site.timing.cycle, CycleStarts);
        }
        Ok(())
    }
}

impl Handler<PaceAllows> for Rover {
    fn handle(&mut self, _timer: PaceAllows, ctx: &mut Context<'_, Self>) -> Outcome {
        self.proceed(ctx);
        Ok(())
    }
}

impl Handler<Grant> for Rover {
    fn handle(&mut self, grant: Grant, ctx: &mut Context<'_, Self>) -> Outcome {
        if self.site.config.policy != Policy::Paper {
            if !ctx.durable::<RoverMemory>().keep(&grant) {
                self.beacon(ctx, grant.node);
            }
            self.proceed(ctx);
            return Ok(());
        }
        self.obey(&grant, ctx);
        Ok(())
    }
}

impl Rover {
    /// Takes the next step if it was granted ahead, and no sooner than a cycle after the last move
    /// began.
    fn proceed(&mut self, ctx: &mut Context<'_, Self>) {
        let now = ctx.now();
        let pace = self.site.timing.cycle;
        let memory = ctx.durable::<RoverMemory>();
        let Some(grant) = memory.next_granted().cloned() else {
            return;
        };
        let begins = memory.last_move.map_or(now, |last| last + pace);
        if grant.to.is_some() && begins > now {
            let wait = begins.as_nanos() - now.as_nanos();
            ctx.timer(SimDuration::from_nanos(wait), PaceAllows);
            return;
        }
        memory.last_move = Some(now);
        self.obey(&grant, ctx);
    }

    fn obey(&mut self, grant: &Grant, ctx: &mut Context<'_, Self>) {
        let roadmap = &self.site.roadmap;
        let adjacent = |u, v| roadmap.are_adjacent(u, v);
        let memory = ctx.durable::<RoverMemory>();
        let answer = memory.obey(grant, self.entry, self.goal, adjacent);
        match answer {
            Answer::Hold => return,
            Answer::Report => {}
            Answer::SetOut => {
                self.drive(ctx);
                self.record(ctx);
                // LEAVING goes to the owner of the vertex left, which is not the one that granted
                // the next one.
                self.beacon_here(ctx);
                return;
            }
            Answer::Entered | Answer::Left => self.record(ctx),
        }
        self.beacon(ctx, grant.node);
    }
}

impl Handler<EdgeEnds> for Rover {
    fn handle(&mut self, _timer: EdgeEnds, ctx: &mut Context<'_, Self>) -> Outcome {
        if ctx.durable::<RoverMemory>().arrive() {
            self.record(ctx);
            self.beacon_here(ctx);
            if self.site.config.policy != Policy::Paper {
                self.proceed(ctx);
            }
        }
        Ok(())
    }
}
