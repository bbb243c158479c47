//! The rover: stands, drives along an edge, says where it is. It decides nothing: without a valid
//! command it holds, for ever if need be; and in a gap of the coverage it is deaf and mute
//! ([`gaps`](super::gaps)).

use std::sync::Arc;

use farside::LinkId;
use farside::prelude::*;
use farside_worlds::{NodeId, VertexId};
use serde::{Deserialize, Serialize};

use super::config::{Motion, Policy, Sabotage};
use super::reservation::TimedPaths;
use super::reservation::messages::{Itinerary, ItineraryAnswer};
use super::safety::{Answer, RoverMemory};
use crate::failover::FencingTokens;
use crate::failover::messages::{Account, Inquiry};
use crate::ids::RoverId;
use crate::safety::messages::{Beacon, Grant, RoverState, Whereabouts};
use crate::shared::Shared;
use farside_actors::radio::RadioChange;

/// A rover of the network-guided system.
///
/// It accepts [`Grant`]s, and answers with [`Beacon`]s: one a cycle to the owner of its vertex, one
/// at each change, one to whoever grants a step that is done.
pub struct Rover {
    site: Arc<Shared>,
    id: RoverId,
    entry: VertexId,
    goal: VertexId,
    /// The nodes, in order.
    nodes: Vec<NodeContact>,
    /// What must know where it is.
    radios: Vec<LinkId<RadioChange>>,
    /// How fast it is at the end of the edge under way, or at the vertex that it rolls through
    /// \[m/s\]; a crash stops it.
    speed: f64,
    /// It may say that it is leaving: it is off the vertex for certain.
    off: bool,
    /// Fixes of its position taken at the end of the edge under way.
    fixes: u32,
}

/// Timer: a planning cycle begins.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct CycleStarts;

/// Timer: it is off the vertex that it came to with this step, for certain.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct OffVertex {
    step: u32,
}

/// Timer: the end of the edge is reached.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct EdgeEnds;

/// Timer: the next move may begin.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct PaceAllows;

/// A node, known by what it accepts of a rover.
struct NodeContact {
    beacons: Recipient<Beacon>,
    accounts: Recipient<Account>,
    itinerary_answers: Recipient<ItineraryAnswer>,
}

impl Rover {
    pub(crate) fn new(site: Arc<Shared>, id: RoverId) -> Self {
        let (entry, goal) = site.missions[id.0 as usize];
        Rover {
            site,
            id,
            entry,
            goal,
            nodes: Vec::new(),
            radios: Vec::new(),
            speed: 0.0,
            off: true,
            fixes: 0,
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
    fn drive(&mut self, ctx: &mut Context<'_, Self>) {
        let memory = ctx.durable::<RoverMemory>();
        let (Some(here), Some(next)) = (memory.vertex, memory.moving_to) else {
            return;
        };
        let step = memory.step;
        let sigma_m = self.site.config.location_sigma_m;
        let is_certain = sigma_m == 0.0;
        let beyond = memory.granted_beyond(|v| self.site.sensors.covers(v));
        let beyond = beyond.filter(|_| is_certain);
        let drive = self
            .site
            .edge_times()
            .drive((here, next), beyond, self.speed);
        self.speed = drive.end;
        ctx.timer(drive.time, EdgeEnds);
        self.fixes = 0;
        self.off = is_certain;
        if !is_certain {
            let said_m = self.leaves_at_m(ctx, step);
            if let Some(after) = drive.passes(said_m) {
                ctx.timer(after, OffVertex { step });
            }
        }
        let end = ctx.now() + drive.time;
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

    /// How far from the vertex it is when it says that it has left: as soon as its estimate is that
    /// it is off it by the clearance and three standard deviations. Errors beyond that it notices.
    fn leaves_at_m(&self, ctx: &Context<'_, Self>, step: u32) -> f64 {
        let config = &self.site.config;
        let most_m = 3.0 * config.location_sigma_m;
        let mut draws = ctx.random_at("odometry", u64::from(step)).stream();
        let error_m = draws.normal(0.0, config.location_sigma_m);
        config.location_clearance_m + most_m - error_m.clamp(-most_m, most_m)
    }

    /// At the end of an edge: whether it has yet to find out that it is there.
    fn is_lost(&mut self, ctx: &mut Context<'_, Self>) -> bool {
        let config = &self.site.config;
        if config.location_sigma_m == 0.0 {
            return false;
        }
        let step = ctx.durable::<RoverMemory>().step;
        let key = u64::from(step) << 32 | u64::from(self.fixes);
        let mut draws = ctx.random_at("location_fix", key).stream();
        let error_m = draws.normal(0.0, config.location_sigma_m).abs();
        // The first time there is no fix yet.
        let is_lost = self.fixes == 0 || error_m > config.location_clearance_m;
        self.fixes += 1;
        is_lost
    }

    fn is_in_gap(&self, ctx: &mut Context<'_, Self>) -> bool {
        ctx.durable::<RoverMemory>().is_in_gap(&self.site.sensors)
    }

    /// Says where it is, if anybody can hear it.
    fn beacon(&self, ctx: &mut Context<'_, Self>, to: NodeId) {
        if !self.is_in_gap(ctx) {
            self.say(ctx, to);
        }
    }

    /// Tells the owner of the vertex that it leaves: the last that is heard of it before a gap.
    fn say_leaving(&self, ctx: &mut Context<'_, Self>) {
        let here = ctx.durable::<RoverMemory>().vertex;
        if let Some(here) = here.filter(|&v| self.site.sensors.covers(v)) {
            let to = self.acting(ctx, here);
            self.say(ctx, to);
        }
    }

    fn say(&self, ctx: &mut Context<'_, Self>, to: NodeId) {
        let memory = ctx.durable::<RoverMemory>();
        let whereabouts = memory.whereabouts(self.id);
        let beacon = Beacon {
            whereabouts: Whereabouts {
                moving_to: whereabouts.moving_to.filter(|_| self.off),
                ..whereabouts
            },
            previous: memory.previous,
            goal: self.goal,
        };
        ctx.send(self.nodes[to.0 as usize].beacons, beacon);
    }

    /// Tells the owner of the vertex that it stands on, or is leaving.
    fn beacon_here(&self, ctx: &mut Context<'_, Self>) {
        if let Some(here) = ctx.durable::<RoverMemory>().vertex {
            let to = self.acting(ctx, here);
            self.beacon(ctx, to);
        }
    }

    /// The node that answers for a vertex: its owner, or who has replaced it.
    fn acting(&self, ctx: &mut Context<'_, Self>, vertex: VertexId) -> NodeId {
        let region = self.site.sensors.owner(vertex);
        match self.site.backup_lists.get(region.0 as usize) {
            Some(line) => line[ctx.durable::<FencingTokens>().rank(region) as usize],
            None => region,
        }
    }

    /// Whether who grants a vertex answers for it, as far as the rover was told.
    fn obeys(&self, ctx: &mut Context<'_, Self>, grant: &Grant) -> bool {
        let heeds = self.site.config.sabotage != Sabotage::IgnoreFencing;
        let acting = grant.to.map(|to| self.acting(ctx, to));
        !heeds || acting.is_none_or(|acting| acting == grant.node)
    }

    /// Tells `to` where it is, and whom it obeys about the vertices of `region`.
    fn account(&self, ctx: &mut Context<'_, Self>, to: NodeId, region: NodeId) {
        let rank = ctx.durable::<FencingTokens>().rank(region);
        let memory = ctx.durable::<RoverMemory>();
        let (step, previous) = (memory.step, memory.previous);
        let account = Account {
            region,
            rank,
            whereabouts: memory.whereabouts(self.id),
            previous,
            goal: self.goal,
            paths: ctx.durable::<TimedPaths>().left(step).to_vec(),
        };
        ctx.send(self.nodes[to.0 as usize].accounts, account);
    }

    /// Moves on without being told to: what [`Sabotage::MoveUnbidden`] is for.
    fn misbehave(&mut self, ctx: &mut Context<'_, Self>, probability: f64) {
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
    type Accepts = (
        Grant,
        CycleStarts,
        EdgeEnds,
        PaceAllows,
        OffVertex,
        Inquiry,
        Itinerary,
    );

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        for name in &self.site.node_names {
            self.nodes.push(NodeContact {
                beacons: ctx.recipient(name)?,
                accounts: ctx.recipient(name)?,
                itinerary_answers: ctx.recipient(name)?,
            });
        }
        self.radios = ctx.links();
        let memory = ctx.durable::<RoverMemory>();
        if self.site.stay_at_target && memory.step == 0 {
            memory.vertex = Some(self.entry);
            memory.step = 1;
        }
        // Stopped in the middle of an edge by a crash, it drives the edge to its end: it is bound
        // to.
        if ctx.durable::<RoverMemory>().moving_to.is_some() {
            self.drive(ctx);
        }
        self.record(ctx);
        if self.site.config.policy != Policy::MaxPlus {
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
        if self.is_in_gap(ctx) {
            return Ok(());
        }
        if !self.obeys(ctx, &grant) {
            // The node does not know that it was replaced.
            if let Some(to) = grant.to {
                self.account(ctx, grant.node, self.site.sensors.owner(to));
            }
            return Ok(());
        }
        if self.site.config.policy == Policy::MaxPlus {
            self.obey(&grant, ctx);
            return Ok(());
        }
        if !ctx.durable::<RoverMemory>().keep(&grant) {
            self.beacon(ctx, grant.node);
        }
        self.proceed(ctx);
        Ok(())
    }
}

impl Handler<Inquiry> for Rover {
    fn handle(&mut self, inquiry: Inquiry, ctx: &mut Context<'_, Self>) -> Outcome {
        let Inquiry { node, region, rank } = inquiry;
        let line = self.site.backup_lists.get(region.0 as usize);
        let entitled = line.and_then(|line| line.get(rank as usize));
        if entitled != Some(&node) || self.is_in_gap(ctx) {
            return Ok(());
        }
        let site = self.site.clone();
        let is_higher = rank > ctx.durable::<FencingTokens>().rank(region);
        let of_home = |v: VertexId| site.sensors.owner(v) == region;
        let beyond = ctx
            .durable::<RoverMemory>()
            .granted_beyond(|v| site.sensors.covers(v));
        if is_higher && beyond.is_some_and(of_home) && self.speed > 0.0 {
            // It cannot stop before a vertex that it is about to roll on to. It answers when it is
            // there.
            return Ok(());
        }
        ctx.durable::<FencingTokens>().raise(region, rank);
        if is_higher {
            let is_void = |grant: &Grant| grant.to.is_some_and(of_home);
            ctx.durable::<RoverMemory>().forget(is_void);
        }
        self.account(ctx, node, region);
        Ok(())
    }
}

impl Handler<Itinerary> for Rover {
    fn handle(&mut self, itinerary: Itinerary, ctx: &mut Context<'_, Self>) -> Outcome {
        if self.is_in_gap(ctx) {
            return Ok(());
        }
        let Itinerary {
            node,
            path,
            replaced,
        } = itinerary;
        let request = path.request;
        let reserved_at = |region| {
            let of = replaced.iter().find(|r| r.region == region);
            of.map_or(0, |r| r.rank)
        };
        let site = self.site.clone();
        let fencing_tokens = ctx.durable::<FencingTokens>();
        let mut regions = path.visits.iter().map(|v| site.sensors.owner(v.vertex));
        let holds = regions.all(|region| fencing_tokens.rank(region) == reserved_at(region))
            || site.config.sabotage == Sabotage::IgnoreFencing;
        let paths = ctx.durable::<TimedPaths>();
        let known = paths.has(&request);
        if holds && !known {
            paths.take(path);
        }
        let taken = holds || known;
        let to = self.nodes[node.0 as usize].itinerary_answers;
        ctx.send(to, ItineraryAnswer { request, taken });
        Ok(())
    }
}

impl Rover {
    /// Takes the next step if it was granted ahead, and no sooner than a cycle after the last move
    /// began; in continuous motion at once, but for a cycle at the entry. Into a gap only with the
    /// grants for the way through.
    fn proceed(&mut self, ctx: &mut Context<'_, Self>) {
        let now = ctx.now();
        let memory = ctx.durable::<RoverMemory>();
        let goes_on = self.site.config.motion == Motion::Continuous && memory.previous.is_some();
        let pace = match goes_on {
            true => SimDuration::ZERO,
            false => self.site.timing.cycle,
        };
        let Some(grant) = memory.next_granted().cloned() else {
            return;
        };
        if !memory.holds_through(grant.step, |v| self.site.sensors.covers(v)) {
            return;
        }
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
                // the next one. Said later, if the rover cannot be certain yet.
                if self.off {
                    self.say_leaving(ctx);
                }
                return;
            }
            Answer::Entered | Answer::Left => self.record(ctx),
        }
        self.beacon(ctx, grant.node);
    }
}

impl Handler<OffVertex> for Rover {
    fn handle(&mut self, timer: OffVertex, ctx: &mut Context<'_, Self>) -> Outcome {
        let memory = ctx.durable::<RoverMemory>();
        if memory.step == timer.step && memory.moving_to.is_some() {
            self.off = true;
            self.say_leaving(ctx);
        }
        Ok(())
    }
}

impl Handler<EdgeEnds> for Rover {
    fn handle(&mut self, _timer: EdgeEnds, ctx: &mut Context<'_, Self>) -> Outcome {
        if self.is_lost(ctx) {
            ctx.timer(self.site.config.location_fix, EdgeEnds);
            return Ok(());
        }
        if ctx.durable::<RoverMemory>().arrive() {
            self.record(ctx);
            self.beacon_here(ctx);
            if self.site.config.policy != Policy::MaxPlus {
                self.proceed(ctx);
            }
        }
        Ok(())
    }
}
