//! A node's part in takeovers: whom it suspects, whom it asks, for whose vertices it answers, and how
//! it reaches those beside them that are no radio neighbours of it. Why this is safe:
//! [`takeover`](crate::failover).

use farside::prelude::*;
use farside_worlds::NodeId;

use super::Node;
use super::base::{Base, Neighbor};
use crate::config::Sabotage;
use crate::failover::messages::{Account, Content, Inquiry, Passed, Replaced, TakenOver};
use crate::failover::rank::Replacement;
use crate::failover::{Charter, Inquest, holder, released};
use crate::ids::RoverId;
use crate::node::messages::Locations;
use crate::reservation::Registries;
use crate::safety::Ledger;
use crate::safety::messages::{Departed, DepartedAck, Holding, Whereabouts};

/// By how many ways a message to a node out of radio range sets out: one of them may be lost.
const WAYS: usize = 2;

/// What a node knows of takeovers between two crashes; what must outlive one is in its [`Charter`].
pub(super) struct Wards {
    /// A node is silent that was not heard for more cycles than this.
    after: u32,
    /// The cycle in which this node started.
    since: u32,
    /// The homes that this node answers for, ascending.
    pub(super) homes: Vec<NodeId>,
    /// Who answers for each home.
    pub(super) acting: Vec<NodeId>,
    /// For how many cycles each home's node, or who replaced it, was heard and did not answer for it.
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
    pub(super) fn open_wards(&mut self, ctx: &mut Context<'_, Node>) {
        let Some(after) = self.site.config.takeover_after else {
            return;
        };
        let nodes = self.site.node_names.len();
        let charter = ctx.durable::<Charter>();
        charter.open(self.id, nodes, self.rovers.len());
        self.wards = Some(Wards {
            after,
            since: self.site.cycle_at(ctx.now()),
            homes: Vec::new(),
            acting: Vec::new(),
            vacant: vec![0; nodes],
            partners: Vec::new(),
        });
        self.mirror(ctx);
    }

    /// Brings what is derived from the charter up to date.
    fn mirror(&mut self, ctx: &mut Context<'_, Node>) {
        let site = self.site.clone();
        let Some(wards) = &mut self.wards else { return };
        let charter = ctx.durable::<Charter>();
        wards.homes.clone_from(&charter.homes);
        let lines = site.lines.iter().zip(&charter.ranks);
        wards.acting = lines.map(|(line, &rank)| line[rank as usize]).collect();
        let beside = wards.homes.iter().flat_map(|&h| site.sensors.neighbors(h));
        let mut ids: Vec<NodeId> = beside.map(|g| wards.acting[g.0 as usize]).collect();
        ids.retain(|&id| id != self.id && !site.sensors.are_neighbors(id, self.id));
        ids.sort_unstable();
        ids.dedup();
        wards.partners.retain(|partner| ids.contains(&partner.id));
        ids.retain(|id| wards.partners.iter().all(|partner| partner.id != *id));
        let partner = |id| Partner {
            id,
            located: None,
            holdings: Vec::new(),
        };
        wards.partners.extend(ids.into_iter().map(partner));
        wards.partners.sort_by_key(|partner| partner.id);
    }

    /// A cycle begins: counts for how long homes have been vacant.
    fn count_vacant(&mut self) {
        let homes = self.site.sensors.neighbors(self.id);
        let denied = |home: &&NodeId| self.denies(self.acting(**home), **home);
        let denied: Vec<NodeId> = homes.iter().filter(denied).copied().collect();
        for (home, vacant) in (0..)
            .map(NodeId)
            .zip(self.wards.iter_mut().flat_map(|w| &mut w.vacant))
        {
            *vacant = if denied.contains(&home) {
                *vacant + 1
            } else {
                0
            };
        }
    }

    /// Whether nodes that fall silent are replaced.
    pub(super) fn takes_over(&self) -> bool {
        self.wards.is_some()
    }

    pub(super) fn answers_for(&self, home: NodeId) -> bool {
        match &self.wards {
            Some(wards) => wards.homes.binary_search(&home).is_ok(),
            None => home == self.id,
        }
    }

    /// Who answers for the vertices of `home`, as far as is known here.
    pub(super) fn acting(&self, home: NodeId) -> NodeId {
        let wards = self.wards.as_ref();
        wards.map_or(home, |wards| wards.acting[home.0 as usize])
    }

    fn partner(&self, id: NodeId) -> Option<&Partner> {
        let partners = &self.wards.as_ref()?.partners;
        partners.iter().find(|partner| partner.id == id)
    }

    /// What neighbours are told of the homes that it answers for.
    pub(super) fn told_answers(&self) -> Vec<NodeId> {
        self.wards
            .iter()
            .flat_map(|wards| wards.homes.clone())
            .collect()
    }

    /// Whether a neighbour was heard, and did not say that it answers for `home`.
    fn denies(&self, id: NodeId, home: NodeId) -> bool {
        let at = self.neighbor(id).map(|at| &self.neighbors[at]);
        at.is_some_and(|n| n.located.is_some() && !n.answers.contains(&home))
    }

    /// Whether somebody in the line of `home` can be reckoned with no more: it is silent; or it has given
    /// the home up to somebody who does not take it; or, as a deputy, it was replaced itself.
    fn is_out(&self, id: NodeId, home: NodeId) -> bool {
        let Some(wards) = &self.wards else {
            return false;
        };
        let is_acting = id == wards.acting[home.0 as usize];
        let gave_up = match is_acting {
            true => wards.vacant[home.0 as usize] > wards.after,
            false => self.acting(id) != id || self.denies(id, id),
        };
        gave_up || self.is_silent(id)
    }

    /// Whether a neighbour, or a partner, was not heard for too long.
    pub(super) fn is_silent(&self, id: NodeId) -> bool {
        let Some(wards) = &self.wards else {
            return false;
        };
        let heard = match self.neighbor(id) {
            // Nobody has been heard when a node starts, which is nobody's fault.
            Some(at) => Some(self.neighbors[at].located.unwrap_or(wards.since)),
            None => self.partner(id).and_then(|partner| partner.located),
        };
        heard.is_none_or(|cycle| self.cycle.saturating_sub(cycle) > wards.after)
    }

    /// What others say of the vertices that they answer for.
    pub(super) fn reports(&self) -> impl Iterator<Item = &Holding> {
        let near = self.neighbors.iter().map(|n| (n.id, &n.holdings));
        let partners = self.wards.iter().flat_map(|wards| &wards.partners);
        let all = near.chain(partners.map(|p| (p.id, &p.holdings)));
        let told = all.filter(|(id, _)| !self.is_silent(*id));
        let of = move |(id, holdings)| std::iter::repeat(id).zip::<&Vec<Holding>>(holdings);
        let entitled = |(id, held): &(NodeId, &Holding)| {
            self.wards.is_none() || self.acting(self.site.sensors.owner(held.vertex)) == *id
        };
        told.flat_map(of).filter(entitled).map(|(_, held)| held)
    }

    /// Tells neighbours who is replaced. False if there is nothing else to tell, because this node
    /// answers for nothing.
    pub(super) fn spread(&self, ctx: &mut Context<'_, Node>) -> bool {
        let Some(wards) = &self.wards else {
            return true;
        };
        let ranks = ctx.durable::<Charter>().ranks.iter();
        let homes: Vec<Replacement> = (0..)
            .map(NodeId)
            .zip(ranks)
            .filter(|&(_, &rank)| rank > 0)
            .map(|(home, &rank)| Replacement { home, rank })
            .collect();
        if !homes.is_empty() {
            for neighbor in &self.neighbors {
                let homes = homes.clone();
                ctx.send(neighbor.address, Replaced { homes });
            }
        }
        !wards.homes.is_empty()
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
        if self.wards.is_none() || passed.to.0 as usize >= self.site.sensors.len() {
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
        for partner in self.wards.iter().flat_map(|wards| &wards.partners) {
            self.tell(ctx, partner.id, content.clone());
        }
    }

    /// A report was acknowledged by who answers for the home that it was about.
    pub(super) fn acknowledged(&self, ctx: &mut Context<'_, Node>, ack: &DepartedAck) {
        let ledger = ctx.durable::<Ledger>();
        let mut homes: Vec<NodeId> = ledger.duties().iter().map(|duty| duty.to).collect();
        homes.retain(|&home| self.acting(home) == ack.node);
        for home in homes {
            ledger.acknowledged(home, ack.rover, ack.step);
        }
    }

    /// Tells a node of rovers that it takes to be where they are not any more: of a node that failed,
    /// nobody knows what it still had to tell.
    pub(super) fn correct(&self, ctx: &mut Context<'_, Node>, message: &Locations) {
        for held in &message.holdings {
            let known = ctx.durable::<Charter>().fact(held.rover);
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

    pub(super) fn is_member(&self, home: NodeId, rank: u32) -> bool {
        let line = self.site.lines.get(home.0 as usize);
        line.is_some_and(|line| (rank as usize) < line.len())
    }

    /// Locations of a node that is no radio neighbour.
    pub(super) fn located_afar(&mut self, message: Locations) {
        let partners = self.wards.iter_mut().flat_map(|wards| &mut wards.partners);
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
        if self.base.wards.is_none() {
            return;
        }
        let site = self.base.site.clone();
        self.base.count_vacant();
        // Who hears nobody cannot tell whose fault it is, and who was replaced stays out.
        let hears = |n: &Neighbor| n.located.is_some() && !self.base.is_silent(n.id);
        if self.base.answers_for(self.base.id) && self.base.neighbors.iter().any(hears) {
            for &home in site.sensors.neighbors(self.base.id) {
                let line = &site.lines[home.0 as usize];
                let Some(rank) = line.iter().position(|&id| id == self.base.id) else {
                    continue;
                };
                let charter = ctx.durable::<Charter>();
                let acting = charter.ranks[home.0 as usize] as usize;
                let before = line.get(acting..rank).unwrap_or(&[]);
                let asked = charter.inquests.iter().any(|i| i.home == home);
                let is_out = |&id: &NodeId| self.base.is_out(id, home);
                if !asked && !before.is_empty() && before.iter().all(is_out) {
                    charter.inquests.push(Inquest {
                        home,
                        rank: rank as u32,
                        accounts: vec![None; self.base.rovers.len()],
                    });
                }
            }
        }
        let node = self.base.id;
        let asks = |i: &Inquest| {
            let of = (i.home, i.rank);
            i.missing()
                .map(move |rover| (of, rover))
                .collect::<Vec<_>>()
        };
        let inquests = &ctx.durable::<Charter>().inquests;
        let questions: Vec<_> = inquests.iter().flat_map(asks).collect();
        for ((home, rank), rover) in questions {
            let inquiry = Inquiry { node, home, rank };
            ctx.send(self.base.rovers[rover.0 as usize], inquiry);
        }
    }

    /// All rovers have answered: from now on this node answers for the vertices of `home`.
    fn take_over(&mut self, ctx: &mut Context<'_, Self>, home: NodeId, rank: u32) {
        let site = self.base.site.clone();
        let mut accounts = ctx.durable::<Charter>().take_on(home, rank);
        if site.config.sabotage == Sabotage::ForgetAccounts {
            accounts.retain(|account| account.whereabouts.step == 0);
        }
        let ledger = ctx.durable::<Ledger>();
        for &vertex in site.sensors.owned(home) {
            let entered = released(&accounts, site.queue(vertex));
            ledger.adopt(vertex, holder(&accounts, vertex, self.base.cycle), entered);
        }
        self.base.mirror(ctx);
        if let Some(reservations) = self.policy.reservations() {
            reservations.succeed(&self.base, ctx, home, Some(&accounts));
        }
        ctx.sample(&TakenOver {
            home,
            deputy: self.base.id,
            cycle: self.base.cycle,
        });
    }

    /// Somebody of this rank, or above, is to answer for `home`, or does already.
    fn yield_to(&mut self, ctx: &mut Context<'_, Self>, home: NodeId, rank: u32) {
        if ctx.durable::<Charter>().resign(home, rank) {
            let owned = self.base.site.sensors.owned(home);
            ctx.durable::<Ledger>().abandon(owned);
            self.policy.give_up(owned);
            ctx.durable::<Registries>().remove(home);
        }
        self.base.mirror(ctx);
    }

    /// Takes note of who answers for a home, if that is news.
    pub(super) fn learn(&mut self, ctx: &mut Context<'_, Self>, news: Replacement) {
        let Replacement { home, rank } = news;
        if !self.base.is_member(home, rank)
            || ctx.durable::<Charter>().ranks[home.0 as usize] >= rank
        {
            return;
        }
        ctx.durable::<Charter>().ranks[home.0 as usize] = rank;
        self.yield_to(ctx, home, rank);
        if let Some(reservations) = self.policy.reservations() {
            reservations.succeed(&self.base, ctx, home, None);
        }
    }
}

impl Handler<Account> for Node {
    fn handle(&mut self, account: Account, ctx: &mut Context<'_, Self>) -> Outcome {
        let (home, rank) = (account.home, account.rank);
        let RoverId(rover) = account.whereabouts.rover;
        if !self.base.is_member(home, rank) || rover as usize >= self.base.rovers.len() {
            return Ok(());
        }
        self.hear(ctx, &account.whereabouts, Some(account.goal));
        if self.base.site.lines[home.0 as usize][rank as usize] != self.base.id {
            // The rover obeys another one here. Of a lower rank it only has not been asked yet.
            let line = &self.base.site.lines[home.0 as usize];
            if line.iter().position(|&id| id == self.base.id) < Some(rank as usize) {
                self.yield_to(ctx, home, rank);
            }
        } else if ctx.durable::<Charter>().answered(account) {
            self.take_over(ctx, home, rank);
        }
        Ok(())
    }
}

impl Handler<Replaced> for Node {
    fn handle(&mut self, message: Replaced, ctx: &mut Context<'_, Self>) -> Outcome {
        for news in message.homes {
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
