//! Corridor tokens: a corridor is driven in one direction at a time, and entered only while there is
//! room behind its exit.
//!
//! Each corridor has a keeper, the owner of the lowest vertex of its chain. Its members, the owners of
//! the vertices of the way, report to it once a cycle; it answers with the token's epoch, which says
//! all: whether the corridor is open, and in which direction. Messages go from owner to owner along
//! the way, since owners of adjacent vertices are neighbours.
//!
//! **Never entered from both sides.** The keeper closes a corridor before it opens it in the other direction,
//! and opens only when all members have reported, for one and the same cycle, that they know of
//! the closing and that nobody is inside. Clocks are synchronous and a rover on its way from one
//! vertex to the next is on record at one of them at least: so at that instant the corridor was empty,
//! and since all had closed it, it still is. Lost and late messages delay that and cannot break it;
//! epochs are durable. Rovers that enter the roadmap inside a corridor need the token as well,
//! in the direction of their goals.
//!
//! **Room.** The owner of an exit reports the free vertices there: the exit and those beyond it. As long
//! as no more rovers are inside than that, one more may enter; who leaves the roadmap inside, or at
//! the exit, needs no room. Room is counted, not reserved: of two corridors that share an exit both
//! may count the same vertex.
//!
//! **They make things worse** (dense map, 28 nodes, 100 rovers, 15 seeds: 73 % of the teams come to a
//! standstill, without tokens 50 %), and it is the map that makes them. Of the eleven circles of rovers that waited
//! for each other in one such run ten had the same form: one rover at the end of a corridor, and one on
//! the junction there, waiting to enter that very corridor. Beyond it there is nothing but
//! single junctions and other corridors, so that wherever a rover waits it waits in somebody's
//! way, and the moves by which the paper's policy gets it out, aside into a third arm or back
//! into the one that it came from, need tokens too. A slot reserved beyond the exit does not help, as
//! that slot is the junction, and who holds it stands there until the next corridor opens. It would have to be
//! granted together with the next corridor and its exit, and so on to the goal: which is the
//! reservation walk of the `complete` policy. With `entry_gates` no team comes to a
//! standstill, and tokens beside them only cost time (time ratio 4.77 against 3.98, 16 seeds).
//!
//! **What was tried and is worse still**: to forbid moves against the flow inside, which takes from rovers
//! the way back; to keep an exit free of rovers that wait there for the same corridor in the
//! opposite direction, by which rovers in two corridors that meet there wait for each other; tokens
//! for chains of one vertex, with which teams are slower. And tokens as a right of way in place of
//! a barrier: a path into a corridor that is not open, or against its flow, loses 20, 100 or 400 of its payoff,
//! and turning back into the flow costs nothing. Then all teams of 100 come to a standstill (6 seeds
//! each), the sooner the higher the penalty: rovers leave their ways to the goal, and go in circles.

mod epoch;

use farside::prelude::*;
use farside_worlds::{NodeId, VertexId};

use super::Node;
use crate::assignment::Request;
use crate::corridors::{Direction, Passage};
use crate::messages::{CorridorNews, CorridorReport, CorridorToken};
use crate::safety::Ledger;
use epoch::{Epoch, Tokens, View, next_epoch};

pub(super) use epoch::Watch;

impl Node {
    fn corridor_watch(&mut self, corridor: usize) -> &mut Watch {
        let count = self.site.corridors.all().len();
        self.watches.resize(count, Watch::default());
        &mut self.watches[corridor]
    }

    fn epoch(&self, ctx: &mut Context<'_, Self>, corridor: usize) -> Epoch {
        let count = self.site.corridors.all().len();
        ctx.durable::<Tokens>().open(count).epochs[corridor]
    }

    fn keeper(&self, corridor: usize) -> Option<NodeId> {
        let lowest = self.site.corridors.all()[corridor].chain().iter().min();
        lowest.map(|v| self.site.sensors.owner(*v))
    }

    /// The node to hand something to that is meant for `to`, both members of the corridor: the next
    /// one along the way, one hop away.
    fn towards(&self, corridor: usize, to: NodeId) -> Option<NodeId> {
        if self.neighbor(to).is_some() {
            return Some(to);
        }
        let (way, sensors) = (&self.site.corridors.all()[corridor].way, &self.site.sensors);
        let place = |node| move |v: &VertexId| sensors.owner(*v) == node;
        let from = way.iter().position(place(self.id))?;
        let target = way.iter().position(place(to))?;
        if from < target {
            let last = way[..target].iter().rposition(place(self.id))?;
            Some(sensors.owner(way[last + 1]))
        } else {
            Some(sensors.owner(way[from - 1]))
        }
    }

    /// Once a cycle: reports to the keepers of all corridors that this node is a member of.
    pub(super) fn report_corridors(&mut self, ctx: &mut Context<'_, Self>) {
        if !self.site.config.corridor_tokens {
            return;
        }
        let site = self.site.clone();
        let mut reports = Vec::new();
        for (corridor, at) in site.corridors.all().iter().enumerate() {
            if !corridor_is_of(at.way.iter(), |v| self.owns(v)) {
                continue;
            }
            let epoch = self.epoch(ctx, corridor).0;
            let cycle = self.cycle;
            let recent = |last: Option<u32>| last.is_some_and(|last| last + 2 > cycle);
            let wanted = self.corridor_watch(corridor).wanted.map(recent);
            let ledger = ctx.durable::<Ledger>();
            let held = |v: &&VertexId| ledger.occupant(**v).is_some();
            let inside = at.chain().iter().filter(held).count() as u32;
            let directions = [Direction::Forward, Direction::Backward];
            let room = directions.map(|direction| self.room(ctx, at.exit(direction), &at.way));
            reports.push(CorridorReport {
                corridor: corridor as u32,
                node: self.id,
                cycle,
                epoch,
                inside,
                wanted,
                room,
            });
        }
        self.deliver(ctx, reports, Vec::new());
    }

    /// The free vertices at an own exit: itself, and those beyond it.
    fn room(&self, ctx: &mut Context<'_, Self>, exit: VertexId, way: &[VertexId]) -> Option<u32> {
        if !self.owns(exit) {
            return None;
        }
        let ledger = ctx.durable::<Ledger>();
        let free = |v: &VertexId| {
            let mut theirs = self.neighbors.iter().flat_map(|n| &n.holdings);
            ledger.occupant(*v).is_none() && !theirs.any(|h| h.vertex == *v)
        };
        let beyond = self.site.roadmap.neighbors(exit).iter();
        let beyond = beyond.filter(|v| !way.contains(v) && free(v)).count();
        Some(beyond as u32 + u32::from(free(&exit)))
    }

    /// Takes what is meant for this node, and passes on the rest, in one message for each neighbour.
    fn deliver(
        &mut self,
        ctx: &mut Context<'_, Self>,
        reports: Vec<CorridorReport>,
        tokens: Vec<CorridorToken>,
    ) {
        let mut onward: Vec<CorridorNews> = Vec::new();
        let (id, cycle) = (self.id, self.cycle);
        let news = |to| CorridorNews {
            node: id,
            cycle,
            to,
            reports: Vec::new(),
            tokens: Vec::new(),
        };
        let corridors = self.site.corridors.all().len();
        for report in reports {
            let corridor = report.corridor as usize;
            let Some(keeper) = (corridor < corridors)
                .then(|| self.keeper(corridor))
                .flatten()
            else {
                continue;
            };
            if keeper == self.id {
                self.corridor_watch(corridor).keep(report);
            } else if let Some(hop) = self.towards(corridor, keeper) {
                bundle(&mut onward, hop, news).reports.push(report);
            }
        }
        for token in tokens {
            let corridor = token.corridor as usize;
            if corridor >= corridors {
                continue;
            }
            if token.to == self.id {
                let known = &mut ctx.durable::<Tokens>().open(corridors).epochs[corridor];
                *known = (*known).max(Epoch(token.epoch));
                let watch = self.corridor_watch(corridor);
                if token.cycle >= watch.told {
                    (watch.told, watch.room) = (token.cycle, token.room);
                }
            } else if let Some(hop) = self.towards(corridor, token.to) {
                bundle(&mut onward, hop, news).tokens.push(token);
            }
        }
        for message in onward {
            if let Some(at) = self.neighbor(message.to) {
                ctx.send(self.neighbors[at].address, message);
            }
        }
    }

    /// Once a cycle, after the reports: the keeper decides, and tells the members.
    pub(super) fn decide_corridors(&mut self, ctx: &mut Context<'_, Self>) {
        if !self.site.config.corridor_tokens {
            return;
        }
        let (site, cycle) = (self.site.clone(), self.cycle);
        let mut tokens = Vec::new();
        for (corridor, at) in site.corridors.all().iter().enumerate() {
            if self.keeper(corridor) != Some(self.id) {
                continue;
            }
            let members = at.members(&site.sensors);
            let epoch = self.epoch(ctx, corridor);
            let watch = self.corridor_watch(corridor);
            let mut room = false;
            let mut decided = epoch;
            if let Some(sum) = watch.summary(&members, epoch) {
                let view = View {
                    epoch,
                    age: cycle.saturating_sub(watch.since),
                    quantum: 2 * at.chain().len() as u32 + 4,
                    inside: sum.inside,
                    wanted: sum.wanted,
                };
                decided = next_epoch(&view);
                room = sum.inside < sum.room[decided.flow().index()].unwrap_or(0);
            }
            if decided != epoch {
                watch.since = cycle;
                let count = site.corridors.all().len();
                ctx.durable::<Tokens>().open(count).epochs[corridor] = decided;
            }
            tokens.extend(members.iter().map(|&to| CorridorToken {
                corridor: corridor as u32,
                to,
                cycle,
                epoch: decided.0,
                room,
            }));
        }
        self.deliver(ctx, Vec::new(), tokens);
    }

    /// Whether tokens let this request have its vertex, one of this node's. Takes down who wants to go
    /// where.
    pub(super) fn token_permits(&mut self, ctx: &mut Context<'_, Self>, request: &Request) -> bool {
        if !self.site.config.corridor_tokens {
            return true;
        }
        let passage = self.site.corridors.passage(request.from, request.vertex);
        let Passage::Enters(corridor, direction) = passage else {
            return true;
        };
        let way = &self.site.corridors.all()[corridor].way;
        let exempt = request.leaves_at.is_some_and(|goal| way.contains(&goal));
        self.may_go_in(ctx, corridor, direction, exempt)
    }

    /// Takes down that a rover wants to go in. True if it may.
    fn may_go_in(
        &mut self,
        ctx: &mut Context<'_, Self>,
        corridor: usize,
        direction: Direction,
        exempt: bool,
    ) -> bool {
        let cycle = self.cycle;
        let open = self.epoch(ctx, corridor).open() == Some(direction);
        let watch = self.corridor_watch(corridor);
        watch.wanted[direction.index()] = Some(cycle);
        open && (exempt || watch.room)
    }

    /// Whether a rover in the queue at `entry`, with this goal, may come in as far as tokens go.
    pub(super) fn token_admits(
        &mut self,
        ctx: &mut Context<'_, Self>,
        entry: VertexId,
        goal: VertexId,
    ) -> bool {
        let Some(next) = super::probes::wanted(&self.site.roadmap, entry, goal) else {
            return true;
        };
        if !self.site.config.corridor_tokens {
            return true;
        }
        let Some((corridor, direction)) = self.site.corridors.heading(entry, next) else {
            return true;
        };
        let exempt = self.site.corridors.all()[corridor].way.contains(&goal);
        self.may_go_in(ctx, corridor, direction, exempt)
    }

    /// What a planner has to know of tokens: a rover on an own vertex may not set out to `next` in
    /// this cycle.
    pub(super) fn token_forbids(
        &self,
        ctx: &mut Context<'_, Self>,
        from: VertexId,
        next: VertexId,
    ) -> bool {
        if !self.site.config.corridor_tokens {
            return false;
        }
        match self.site.corridors.passage(from, next) {
            Passage::Enters(corridor, direction) => {
                self.epoch(ctx, corridor).open() != Some(direction)
            }
            Passage::Other => false,
        }
    }
}

fn corridor_is_of<'a>(
    mut way: impl Iterator<Item = &'a VertexId>,
    owns: impl Fn(VertexId) -> bool,
) -> bool {
    way.any(|v| owns(*v))
}

fn bundle(
    onward: &mut Vec<CorridorNews>,
    hop: NodeId,
    news: impl Fn(NodeId) -> CorridorNews,
) -> &mut CorridorNews {
    let at = onward.iter().position(|message| message.to == hop);
    let at = at.unwrap_or_else(|| {
        onward.push(news(hop));
        onward.len() - 1
    });
    &mut onward[at]
}

impl Handler<CorridorNews> for Node {
    fn handle(&mut self, news: CorridorNews, ctx: &mut Context<'_, Self>) -> Outcome {
        if self.site.config.corridor_tokens {
            self.deliver(ctx, news.reports, news.tokens);
        }
        Ok(())
    }
}
