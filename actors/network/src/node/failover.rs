//! A node's part in failovers: whom it suspects, whom it asks, for whose vertices it answers, and
//! how it reaches those beside them that are no radio neighbours of it. Why this is safe:
//! [`failover`](crate::failover).

use farside::prelude::*;
use farside_worlds::NodeId;

use super::Node;
use super::base::{Base, Neighbor};
use crate::config::Sabotage;
use crate::failover::messages::{Account, Content, FailedOver, Inquiry, Passed, Replaced};
use crate::failover::rank::Replacement;
use crate::failover::{FailoverRecord, PendingFailover, holder, released};
use crate::node::messages::Locations;
use crate::reservation::Registries;
use crate::safety::OccupancyTable;
use crate::safety::messages::{Departed, DepartedAck, Holding, Whereabouts};

/// By how many ways a message to a node out of radio range sets out: one of them may be lost.
const WAYS: usize = 2;

/// What a node knows of failovers between two crashes; what must outlive one is in its
/// [`FailoverRecord`].
pub(super) struct FailoverState {
    /// A node is silent that was not heard for more cycles than this.
    after: u32,
    /// The cycle in which this node started.
    since: u32,
    /// The regions that this node answers for, ascending.
    pub(super) regions: Vec<NodeId>,
    /// Who answers for each region.
    pub(super) acting: Vec<NodeId>,
    /// For how many cycles each region's node, or who replaced it, was heard and did not answer for
    /// it.
    vacant: Vec<u32>,
    /// Nodes to coordinate with that are no radio neighbours.
    partners: Vec<Partner>,
}

struct Partner {
    id: NodeId,
    located: Option<u32>,
    holdings: Vec<Holding>,
}

impl Base {
    /// At the start, and after a crash.
    pub(super) fn open_failover(&mut self, ctx: &mut Context<'_, Node>) {
        let Some(after) = self.site.config.failover_after else {
            return;
        };
        let nodes = self.site.node_names.len();
        let record = ctx.durable::<FailoverRecord>();
        record.open(self.id, nodes, self.rovers.len());
        self.failover = Some(FailoverState {
            after,
            since: self.site.cycle_at(ctx.now()),
            regions: Vec::new(),
            acting: Vec::new(),
            vacant: vec![0; nodes],
            partners: Vec::new(),
        });
        self.mirror(ctx);
    }

    /// Brings what is derived from the record up to date.
    fn mirror(&mut self, ctx: &mut Context<'_, Node>) {
        let site = self.site.clone();
        let Some(failover) = &mut self.failover else {
            return;
        };
        let record = ctx.durable::<FailoverRecord>();
        failover.regions.clone_from(&record.regions);
        let lines = site.backup_lists.iter().zip(&record.ranks);
        failover.acting = lines.map(|(line, &rank)| line[rank as usize]).collect();
        let beside = failover
            .regions
            .iter()
            .flat_map(|&h| site.sensors.neighbors(h));
        let mut ids: Vec<NodeId> = beside.map(|g| failover.acting[g.0 as usize]).collect();
        ids.retain(|&id| id != self.id && !site.sensors.are_neighbors(id, self.id));
        ids.sort_unstable();
        ids.dedup();
        failover
            .partners
            .retain(|partner| ids.contains(&partner.id));
        ids.retain(|id| failover.partners.iter().all(|partner| partner.id != *id));
        let partner = |id| Partner {
            id,
            located: None,
            holdings: Vec::new(),
        };
        failover.partners.extend(ids.into_iter().map(partner));
        failover.partners.sort_by_key(|partner| partner.id);
    }

    /// A cycle begins: counts for how long regions have been vacant.
    fn count_vacant(&mut self) {
        let regions = self.site.sensors.neighbors(self.id);
        let denied = |region: &&NodeId| self.denies(self.acting(**region), **region);
        let denied: Vec<NodeId> = regions.iter().filter(denied).copied().collect();
        for (region, vacant) in (0..)
            .map(NodeId)
            .zip(self.failover.iter_mut().flat_map(|w| &mut w.vacant))
        {
            *vacant = if denied.contains(&region) {
                *vacant + 1
            } else {
                0
            };
        }
    }

    /// Whether nodes that fall silent are replaced.
    pub(super) fn takes_over(&self) -> bool {
        self.failover.is_some()
    }

    pub(super) fn answers_for(&self, region: NodeId) -> bool {
        match &self.failover {
            Some(failover) => failover.regions.binary_search(&region).is_ok(),
            None => region == self.id,
        }
    }

    /// Who answers for the vertices of `region`, as far as is known here.
    pub(super) fn acting(&self, region: NodeId) -> NodeId {
        let failover = self.failover.as_ref();
        failover.map_or(region, |failover| failover.acting[region.0 as usize])
    }

    fn partner(&self, id: NodeId) -> Option<&Partner> {
        let partners = &self.failover.as_ref()?.partners;
        partners.iter().find(|partner| partner.id == id)
    }

    /// What neighbours are told of the regions that it answers for.
    pub(super) fn told_answers(&self) -> Vec<NodeId> {
        self.failover
            .iter()
            .flat_map(|failover| failover.regions.clone())
            .collect()
    }

    /// Whether a neighbour was heard, and did not say that it answers for `region`.
    fn denies(&self, id: NodeId, region: NodeId) -> bool {
        let at = self.neighbor(id).map(|at| &self.neighbors[at]);
        at.is_some_and(|n| n.located.is_some() && !n.answers.contains(&region))
    }

    /// Whether somebody in the backup list of `region` can be reckoned with no more: it is silent;
    /// or it has given the region up to somebody who does not take it; or, as a backup, it was
    /// replaced itself.
    fn is_out(&self, id: NodeId, region: NodeId) -> bool {
        let Some(failover) = &self.failover else {
            return false;
        };
        let is_acting = id == failover.acting[region.0 as usize];
        let gave_up = match is_acting {
            true => failover.vacant[region.0 as usize] > failover.after,
            false => self.acting(id) != id || self.denies(id, id),
        };
        gave_up || self.is_silent(id)
    }

    /// Whether a neighbour, or a partner, was not heard for too long.
    pub(super) fn is_silent(&self, id: NodeId) -> bool {
        let Some(failover) = &self.failover else {
            return false;
        };
        let heard = match self.neighbor(id) {
            // Nobody has been heard when a node starts, which is nobody's fault.
            Some(at) => Some(self.neighbors[at].located.unwrap_or(failover.since)),
            None => self.partner(id).and_then(|partner| partner.located),
        };
        heard.is_none_or(|cycle| self.cycle.saturating_sub(cycle) > failover.after)
    }

    /// What others say of the vertices that they answer for.
    pub(super) fn reports(&self) -> impl Iterator<Item = &Holding> {
        let near = self.neighbors.iter().map(|n| (n.id, &n.holdings));
        let partners = self.failover.iter().flat_map(|failover| &failover.partners);
        let all = near.chain(partners.map(|p| (p.id, &p.holdings)));
        let told = all.filter(|(id, _)| !self.is_silent(*id));
        let of = move |(id, holdings)| std::iter::repeat(id).zip::<&Vec<Holding>>(holdings);
        let entitled = |(id, held): &(NodeId, &Holding)| {
            self.failover.is_none() || self.acting(self.site.sensors.owner(held.vertex)) == *id
        };
        told.flat_map(of).filter(entitled).map(|(_, held)| held)
    }

    /// Tells neighbours who is replaced. False if there is nothing else to tell, because this node
    /// answers for nothing.
    pub(super) fn spread(&self, ctx: &mut Context<'_, Node>) -> bool {
        let Some(failover) = &self.failover else {
            return true;
        };
        let ranks = ctx.durable::<FailoverRecord>().ranks.iter();
        let regions: Vec<Replacement> = (0..)
            .map(NodeId)
            .zip(ranks)
            .filter(|&(_, &rank)| rank > 0)
            .map(|(region, &rank)| Replacement { region, rank })
            .collect();
        if !regions.is_empty() {
            for neighbor in &self.neighbors {
                let regions = regions.clone();
                ctx.send(neighbor.address, Replaced { regions });
            }
        }
        !failover.regions.is_empty()
    }

    /// Says something to a node, directly or by way of common neighbours.
    pub(super) fn tell(&self, ctx: &mut Context<'_, Node>, to: NodeId, content: Content) {
        if let Some(at) = self.neighbor(to) {
            let address = self.neighbors[at].address;
            return match content {
                Content::Locations(message) => ctx.send(address, message),
                Content::Assignments(message) => ctx.send(address, message),
                Content::Departed(message) => ctx.send(address, message),
                Content::DepartedAck(message) => ctx.send(address, message),
                Content::Relay(message) => ctx.send(address, message),
            };
        }
        let passed = Passed {
            to,
            // No way is longer, and what goes round in a circle comes to an end.
            hops: self.site.sensors.len() as u32,
            content,
        };
        self.pass_on(ctx, passed, WAYS);
    }

    /// Hands a message to the neighbours nearest to whom it is for, round those that are replaced.
    fn pass_on(&self, ctx: &mut Context<'_, Node>, passed: Passed, ways: usize) {
        if self.failover.is_none() || passed.to.0 as usize >= self.site.sensors.len() {
            return;
        }
        let mut hops = vec![u32::MAX; self.site.sensors.len()];
        hops[passed.to.0 as usize] = 0;
        let mut queue = std::collections::VecDeque::from([passed.to]);
        while let Some(at) = queue.pop_front() {
            for &next in self.site.sensors.neighbors(at) {
                let known = hops[next.0 as usize] != u32::MAX;
                if !known && self.acting(next) == next && next != self.id {
                    hops[next.0 as usize] = hops[at.0 as usize] + 1;
                    queue.push_back(next);
                }
            }
        }
        let distance = |n: &&Neighbor| hops[n.id.0 as usize];
        let mut ahead: Vec<&Neighbor> = self.neighbors.iter().collect();
        ahead.retain(|n| distance(n) != u32::MAX && (n.id == passed.to || !self.is_silent(n.id)));
        ahead.sort_by_key(distance);
        for neighbor in ahead.into_iter().take(ways) {
            ctx.send(neighbor.address, passed.clone());
        }
    }

    /// Says something to all that this node coordinates with and that are no radio neighbours.
    pub(super) fn tell_partners(&self, ctx: &mut Context<'_, Node>, content: &Content) {
        for partner in self.failover.iter().flat_map(|failover| &failover.partners) {
            self.tell(ctx, partner.id, content.clone());
        }
    }

    /// A report was acknowledged by who answers for the region that it was about.
    pub(super) fn acknowledged(&self, ctx: &mut Context<'_, Node>, ack: &DepartedAck) {
        let occupancy = ctx.durable::<OccupancyTable>();
        let mut regions: Vec<NodeId> = occupancy.duties().iter().map(|duty| duty.to).collect();
        regions.retain(|&region| self.acting(region) == ack.node);
        for region in regions {
            occupancy.acknowledged(region, ack.rover, ack.step);
        }
    }

    /// Tells a node of rovers that it takes to be where they are not any more: of a node that
    /// failed, nobody knows what it still had to tell.
    pub(super) fn correct(&self, ctx: &mut Context<'_, Node>, message: &Locations) {
        for held in &message.holdings {
            let known = ctx.durable::<FailoverRecord>().fact(held.rover);
            if let Some(fact) = known.filter(|fact| fact.step > held.step) {
                let whereabouts = Whereabouts {
                    moving_to: None,
                    ..fact
                };
                let node = self.id;
                let departed = Departed { node, whereabouts };
                self.tell(ctx, message.node, Content::Departed(departed));
            }
        }
    }

    pub(super) fn is_member(&self, region: NodeId, rank: u32) -> bool {
        let line = self.site.backup_lists.get(region.0 as usize);
        line.is_some_and(|line| (rank as usize) < line.len())
    }

    /// Locations of a node that is no radio neighbour.
    pub(super) fn located_afar(&mut self, message: Locations) {
        let partners = self
            .failover
            .iter_mut()
            .flat_map(|failover| &mut failover.partners);
        for partner in partners.filter(|partner| partner.id == message.node) {
            if partner.located.is_none_or(|cycle| cycle < message.cycle) {
                partner.located = Some(message.cycle);
                partner.holdings.clone_from(&message.holdings);
            }
        }
    }
}

impl Node {
    /// A cycle begins: begins to replace neighbours that are silent, and asks rovers that have not
    /// answered.
    pub(super) fn watch(&mut self, ctx: &mut Context<'_, Self>) {
        if self.base.failover.is_none() {
            return;
        }
        let site = self.base.site.clone();
        self.base.count_vacant();
        // Who hears nobody cannot tell whose fault it is, and who was replaced stays out.
        let hears = |n: &Neighbor| n.located.is_some() && !self.base.is_silent(n.id);
        if self.base.answers_for(self.base.id) && self.base.neighbors.iter().any(hears) {
            for &region in site.sensors.neighbors(self.base.id) {
                let line = &site.backup_lists[region.0 as usize];
                let Some(rank) = line.iter().position(|&id| id == self.base.id) else {
                    continue;
                };
                let record = ctx.durable::<FailoverRecord>();
                let acting = record.ranks[region.0 as usize] as usize;
                let before = line.get(acting..rank).unwrap_or(&[]);
                let asked = record.pending.iter().any(|i| i.region == region);
                let is_out = |&id: &NodeId| self.base.is_out(id, region);
                if !asked && !before.is_empty() && before.iter().all(is_out) {
                    record.pending.push(PendingFailover {
                        region,
                        rank: rank as u32,
                        accounts: vec![None; self.base.rovers.len()],
                        asked: self.base.site.team().map(|(rover, _)| rover).collect(),
                    });
                }
            }
        }
        let node = self.base.id;
        let asks = |i: &PendingFailover| {
            let of = (i.region, i.rank);
            i.missing()
                .map(move |rover| (of, rover))
                .collect::<Vec<_>>()
        };
        let pending = &ctx.durable::<FailoverRecord>().pending;
        let questions: Vec<_> = pending.iter().flat_map(asks).collect();
        for ((region, rank), rover) in questions {
            let inquiry = Inquiry { node, region, rank };
            if let Some(rover) = self.base.address(rover) {
                ctx.send(rover, inquiry);
            }
        }
    }

    /// All rovers have answered: from now on this node answers for the vertices of `region`.
    fn take_over(&mut self, ctx: &mut Context<'_, Self>, region: NodeId, rank: u32) {
        let site = self.base.site.clone();
        let mut accounts = ctx.durable::<FailoverRecord>().take_on(region, rank);
        if site.config.sabotage == Sabotage::ForgetAccounts {
            accounts.retain(|account| account.whereabouts.step == 0);
        }
        let occupancy = ctx.durable::<OccupancyTable>();
        for &vertex in site.sensors.owned(region) {
            let entered = released(&accounts, site.queue(vertex));
            occupancy.adopt(vertex, holder(&accounts, vertex, self.base.cycle), entered);
        }
        self.base.mirror(ctx);
        if let Some(reservations) = self.policy.reservations() {
            reservations.succeed(&self.base, ctx, region, Some(&accounts));
        }
        ctx.sample(&FailedOver {
            region,
            backup: self.base.id,
            cycle: self.base.cycle,
        });
    }

    /// Somebody of this rank, or above, is to answer for `region`, or does already.
    fn yield_to(&mut self, ctx: &mut Context<'_, Self>, region: NodeId, rank: u32) {
        if ctx.durable::<FailoverRecord>().resign(region, rank) {
            let owned = self.base.site.sensors.owned(region);
            ctx.durable::<OccupancyTable>().abandon(owned);
            self.policy.give_up(owned);
            ctx.durable::<Registries>().remove(region);
        }
        self.base.mirror(ctx);
    }

    /// Takes note of who answers for a region, if that is news.
    pub(super) fn learn(&mut self, ctx: &mut Context<'_, Self>, news: Replacement) {
        let Replacement { region, rank } = news;
        if !self.base.is_member(region, rank)
            || ctx.durable::<FailoverRecord>().ranks[region.0 as usize] >= rank
        {
            return;
        }
        ctx.durable::<FailoverRecord>().ranks[region.0 as usize] = rank;
        self.yield_to(ctx, region, rank);
        if let Some(reservations) = self.policy.reservations() {
            reservations.succeed(&self.base, ctx, region, None);
        }
    }
}

impl Handler<Account> for Node {
    fn handle(&mut self, account: Account, ctx: &mut Context<'_, Self>) -> Outcome {
        let (region, rank) = (account.region, account.rank);
        let rover = account.whereabouts.rover;
        if !self.base.is_member(region, rank) || !self.base.is_rover(rover) {
            return Ok(());
        }
        self.hear(ctx, &account.whereabouts, Some(account.goal));
        if self.base.site.backup_lists[region.0 as usize][rank as usize] != self.base.id {
            // The rover obeys another one here. Of a lower rank it only has not been asked yet.
            let line = &self.base.site.backup_lists[region.0 as usize];
            if line.iter().position(|&id| id == self.base.id) < Some(rank as usize) {
                self.yield_to(ctx, region, rank);
            }
        } else if ctx.durable::<FailoverRecord>().answered(account) {
            self.take_over(ctx, region, rank);
        }
        Ok(())
    }
}

impl Handler<Replaced> for Node {
    fn handle(&mut self, message: Replaced, ctx: &mut Context<'_, Self>) -> Outcome {
        for news in message.regions {
            self.learn(ctx, news);
        }
        Ok(())
    }
}

impl Handler<Passed> for Node {
    fn handle(&mut self, message: Passed, ctx: &mut Context<'_, Self>) -> Outcome {
        if message.to != self.base.id {
            if let Some(hops) = message.hops.checked_sub(1) {
                self.base.pass_on(ctx, Passed { hops, ..message }, 1);
            }
            return Ok(());
        }
        match message.content {
            Content::Locations(message) => self.handle(message, ctx),
            Content::Assignments(message) => self.handle(message, ctx),
            Content::Departed(message) => self.handle(message, ctx),
            Content::DepartedAck(message) => self.handle(message, ctx),
            Content::Relay(message) => self.handle(message, ctx),
        }
    }
}
