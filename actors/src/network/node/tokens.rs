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
//! **What was tried and is worse** (dense map, 28 nodes, 2 iterations, 75 rovers, only two runs
//! each, none of which comes to a standstill without tokens): to forbid moves against the flow
//! inside, which takes from rovers the way back by which the paper's policy gets them out of each
//! other's way; to keep an exit free of rovers that wait there for the same corridor in the opposite
//! direction, by which rovers in two corridors that meet there wait for each other; and tokens for
//! chains of one vertex, with which teams are slower. So only entering needs a token, and a rover
//! inside may turn.

use farside::prelude::*;
use farside_worlds::{NodeId, VertexId};

use super::Node;
use crate::network::assignment::Request;
use crate::network::corridors::{Direction, Passage};
use crate::network::messages::{CorridorNews, CorridorReport, CorridorToken};
use crate::network::safety::Ledger;

/// For how many cycles' reports of one member a keeper keeps.
const KEPT: usize = 8;

/// The token's state, told by its epoch alone: 0 closed, 1 open forward, 2 closed, 3 open backward,
/// 4 closed, and so on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Epoch(u32);

impl Epoch {
    /// The direction it is open in; none if it is closed.
    fn open(self) -> Option<Direction> {
        (self.0 % 2 == 1).then(|| self.flow())
    }

    /// The direction of who is inside: the last that it was open in.
    fn flow(self) -> Direction {
        match self.0 % 4 {
            1 | 2 => Direction::Forward,
            _ => Direction::Backward,
        }
    }

    /// The next epoch in which it is open in `direction`. The present one must be closed.
    fn opened(self, direction: Direction) -> Epoch {
        Epoch(self.0 + if direction == self.flow() { 3 } else { 1 })
    }
}

/// What the keeper of a corridor knows of it.
#[derive(Clone, Copy, Debug)]
struct View {
    epoch: Epoch,
    /// For how many cycles it has been so.
    age: u32,
    /// For how many it stays open at least if both sides want it.
    quantum: u32,
    inside: u32,
    wanted: [bool; 2],
}

/// What the token does next. With both sides waiting it alternates.
fn next_epoch(view: &View) -> Epoch {
    let View { epoch, wanted, .. } = *view;
    let wants = |direction: Direction| wanted[direction.index()];
    let (flow, counter) = (epoch.flow(), epoch.flow().other());
    match epoch.open() {
        Some(_) if wants(counter) && (!wants(flow) || view.age >= view.quantum) => {
            Epoch(epoch.0 + 1)
        }
        Some(_) => epoch,
        None if view.inside > 0 => epoch,
        None if wants(counter) => epoch.opened(counter),
        None if wants(flow) => epoch.opened(flow),
        None => epoch,
    }
}

/// The tokens as a node knows them. Durable: a node that forgot a closing would let rovers in.
#[derive(Default)]
struct Tokens {
    /// For each corridor of the roadmap the epoch heard last, or, of the keeper, the epoch.
    epochs: Vec<Epoch>,
}

impl Tokens {
    fn open(&mut self, corridors: usize) -> &mut Tokens {
        self.epochs.resize(corridors, Epoch::default());
        self
    }
}

/// What a node knows of a corridor beside the token. Lost in a crash.
#[derive(Clone, Default)]
pub(super) struct Watch {
    /// The last cycle in which a rover wanted to go in, by direction.
    wanted: [Option<u32>; 2],
    /// There is room for one more, in the cycle told last.
    room: bool,
    told: u32,
    /// Keeper: since when the epoch is what it is.
    since: u32,
    /// Keeper: what members reported, the latest last.
    reports: Vec<CorridorReport>,
}

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

/// All members' reports of one cycle, together.
struct Summary {
    inside: u32,
    wanted: [bool; 2],
    room: [Option<u32>; 2],
}

impl Watch {
    fn keep(&mut self, report: CorridorReport) {
        let same = |old: &CorridorReport| old.node == report.node;
        let known = |old: &CorridorReport| same(old) && old.cycle == report.cycle;
        if self.reports.iter().any(known) {
            return;
        }
        if self.reports.iter().filter(|old| same(old)).count() >= KEPT {
            let oldest = self
                .reports
                .iter()
                .filter(|old| same(old))
                .map(|r| r.cycle)
                .min();
            self.reports
                .retain(|old| !same(old) || Some(old.cycle) != oldest);
        }
        self.reports.push(report);
    }

    /// The latest cycle of which all members have reported, all of them knowing this epoch.
    fn summary(&self, members: &[NodeId], epoch: Epoch) -> Option<Summary> {
        let of = |cycle| {
            let told = move |r: &&CorridorReport| r.cycle == cycle && r.epoch == epoch.0;
            self.reports.iter().filter(told)
        };
        let complete = |cycle: &u32| {
            let told = |member: &NodeId| of(*cycle).any(|r| r.node == *member);
            members.iter().all(told)
        };
        let cycle = self
            .reports
            .iter()
            .map(|r| r.cycle)
            .filter(complete)
            .max()?;
        let mut sum = Summary {
            inside: 0,
            wanted: [false; 2],
            room: [None; 2],
        };
        for report in of(cycle) {
            sum.inside += report.inside;
            for side in 0..2 {
                sum.wanted[side] |= report.wanted[side];
                sum.room[side] = sum.room[side].or(report.room[side]);
            }
        }
        Some(sum)
    }
}

impl Handler<CorridorNews> for Node {
    fn handle(&mut self, news: CorridorNews, ctx: &mut Context<'_, Self>) -> Outcome {
        if self.site.config.corridor_tokens {
            self.deliver(ctx, news.reports, news.tokens);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn view(epoch: u32, age: u32, inside: u32, wanted: [bool; 2]) -> View {
        let (epoch, quantum) = (Epoch(epoch), 6);
        View {
            epoch,
            age,
            quantum,
            inside,
            wanted,
        }
    }

    #[test]
    fn both_sides_take_turns() {
        let both = [true, true];
        assert_eq!(
            next_epoch(&view(1, 5, 2, both)),
            Epoch(1),
            "its time is not over"
        );
        assert_eq!(next_epoch(&view(1, 6, 2, both)), Epoch(2));
        assert_eq!(
            next_epoch(&view(2, 0, 1, both)),
            Epoch(2),
            "somebody is inside"
        );
        assert_eq!(next_epoch(&view(2, 3, 0, both)), Epoch(3));
        assert_eq!(next_epoch(&view(4, 0, 0, both)), Epoch(5));
    }

    #[test]
    fn one_side_alone_keeps_the_corridor_until_the_other_wants_it() {
        assert_eq!(next_epoch(&view(1, 99, 3, [true, false])), Epoch(1));
        assert_eq!(next_epoch(&view(1, 1, 3, [false, true])), Epoch(2));
        assert_eq!(
            next_epoch(&view(2, 1, 0, [true, false])),
            Epoch(5),
            "the same again"
        );
        assert_eq!(Epoch(5).open(), Some(Direction::Forward));
    }

    fn report(node: u32, cycle: u32, epoch: u32, inside: u32) -> CorridorReport {
        CorridorReport {
            corridor: 0,
            node: NodeId(node as _),
            cycle,
            epoch,
            inside,
            wanted: [false; 2],
            room: [None; 2],
        }
    }

    #[test]
    fn reports_of_different_cycles_prove_nothing() {
        // A rover goes from node 1's part to node 0's between the two reports.
        let mut watch = Watch::default();
        watch.keep(report(0, 4, 2, 0));
        watch.keep(report(1, 5, 2, 0));
        let members = [NodeId(0), NodeId(1)];
        assert!(watch.summary(&members, Epoch(2)).is_none());
        watch.keep(report(0, 5, 2, 1));
        assert_eq!(watch.summary(&members, Epoch(2)).unwrap().inside, 1);
        assert!(watch.summary(&members, Epoch(3)).is_none(), "another epoch");
    }

    proptest! {
        /// Members with clocks in step and links that delay and lose: never are two directions inside.
        #[test]
        fn a_corridor_never_holds_two_directions(
            draws in prop::collection::vec((any::<u64>(), 0..6u32, 0..6u32), 40..200),
        ) {
            // Three cells, a member each; 0 is the keeper. A rover goes one cell a cycle.
            let members = [0, 1, 2].map(NodeId);
            let mut cells: [Option<Direction>; 3] = [None; 3];
            let mut epochs = [Epoch(0); 3];
            let mut watch = Watch::default();
            let (mut reports, mut tokens) = (Vec::new(), Vec::new());
            for (cycle, (bits, lag, loss)) in (0u32..).zip(draws) {
                let bit = |i: u32| bits >> i & 1 == 1;
                for i in 0..3 {
                    let inside = u32::from(cells[i].is_some());
                    let mut told = report(i as u32, cycle, epochs[i].0, inside);
                    told.wanted = [bit(1), bit(2)];
                    reports.push((cycle + lag * u32::from(bit(3 + i as u32)), told));
                }
                for (due, told) in &reports {
                    let lost = told.node.0 != 0 && (told.cycle + u32::from(told.node.0 as u16)) % 7 < loss;
                    if *due == cycle && !lost {
                        watch.keep(told.clone());
                    }
                }
                if let Some(sum) = watch.summary(&members, epochs[0]) {
                    let (age, inside) = (cycle.saturating_sub(watch.since), sum.inside);
                    let seen = View { epoch: epochs[0], age, quantum: 3, inside, wanted: sum.wanted };
                    let decided = next_epoch(&seen);
                    if decided != epochs[0] {
                        watch.since = cycle;
                    }
                    epochs[0] = decided;
                }
                for i in 1..3u32 {
                    tokens.push((cycle + lag * u32::from(bit(8 + i)), i as usize, epochs[0]));
                }
                for &(due, i, epoch) in &tokens {
                    if due == cycle && !bit(12 + i as u32) {
                        epochs[i] = epochs[i].max(epoch);
                    }
                }
                // Moves: those ahead first, then who is outside.
                let out = |d: Direction| if d == Direction::Forward { 2 } else { 0 };
                for d in [Direction::Forward, Direction::Backward] {
                    let order: [usize; 3] = if d == Direction::Forward { [2, 1, 0] } else { [0, 1, 2] };
                    for (k, &i) in order.iter().enumerate() {
                        if cells[i] == Some(d) && !bit(16 + i as u32) {
                            if i == out(d) {
                                cells[i] = None;
                            } else if cells[order[k - 1]].is_none() {
                                cells[order[k - 1]] = cells[i].take();
                            }
                        }
                    }
                    let gate = 2 - out(d);
                    if bit(1 + d.index() as u32) && epochs[gate].open() == Some(d) && cells[gate].is_none() {
                        cells[gate] = Some(d);
                    }
                }
                let both = [Direction::Forward, Direction::Backward]
                    .iter()
                    .all(|d| cells.contains(&Some(*d)));
                prop_assert!(!both, "cycle {}: {:?}", cycle, cells);
            }
        }
    }
}
