//! The node's side of the `complete` policy: what comes in goes to the registry, what the registry
//! wants goes out, and vertices are granted to the first of their books.

use farside::prelude::*;
use farside_worlds::{NodeId, VertexId};
use serde::{Deserialize, Serialize};

use super::atlas::Atlas;
use super::messages::{Between, ItineraryAnswer, Relay};
use super::registry::{Desk, Registry};
use super::relay::Receipt;
use crate::config::Policy;
use crate::messages::{Account, Content, Replacement, RoadmapKnown, RoverId};
use crate::node::Node;
use crate::safety::Ledger;
use crate::takeover::Charter;

/// Timer: something is overdue, or a vertex is to be granted.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct RegistryDue;

/// The registries of all homes that a node answers for, ascending; durable.
#[derive(Debug, Default)]
pub(crate) struct Registries {
    all: Vec<(NodeId, Registry)>,
}

impl Registries {
    fn find(&mut self, home: NodeId) -> Option<&mut Registry> {
        let found = self.all.iter_mut().find(|(id, _)| *id == home);
        found.map(|(_, registry)| registry)
    }

    /// This node does not answer for `home` any more.
    pub(crate) fn remove(&mut self, home: NodeId) {
        self.all.retain(|(id, _)| *id != home);
    }

    fn insert(&mut self, home: NodeId, registry: Registry) {
        let at = self.all.partition_point(|(id, _)| *id < home);
        self.all.insert(at, (home, registry));
    }
}

impl Node {
    /// Opens the registries; after a crash, what was on its way is repeated.
    pub(crate) fn open_registry(&mut self, ctx: &mut Context<'_, Self>) {
        if self.answers_for(self.id) && ctx.durable::<Registries>().all.is_empty() {
            let home = self.id;
            ctx.durable::<Registries>()
                .insert(home, Registry::default());
        }
        self.with_registries(ctx, |registry, atlas, desk| {
            registry.open(desk);
            atlas.publish(registry, desk);
        });
    }

    /// A cycle begins: rovers that wait without a way apply for one.
    pub(crate) fn apply(&mut self, ctx: &mut Context<'_, Self>) {
        // Other policies have planned for all before the start.
        let applies = self.site.config.policy == Policy::Complete;
        self.with_registries(ctx, |registry, _, desk| {
            if applies {
                registry.apply(desk);
            }
        });
    }

    /// Vertices are free again.
    pub(crate) fn departed(&mut self, ctx: &mut Context<'_, Self>, freed: &[VertexId]) {
        self.with_registries(ctx, |registry, _, _| {
            for &vertex in freed {
                registry.book.departed(vertex);
            }
        });
    }

    /// Another one than before answers for `home`; with rovers' accounts, this node does.
    pub(crate) fn succeed(
        &mut self,
        ctx: &mut Context<'_, Self>,
        home: NodeId,
        accounts: Option<&[Account]>,
    ) {
        self.with_registries(ctx, |registry, _, desk| registry.renew(desk, home));
        if let Some(accounts) = accounts {
            ctx.durable::<Registries>()
                .insert(home, Registry::default());
            self.with_registries(ctx, |registry, atlas, desk| {
                if desk.home == home {
                    *registry = Registry::succeed(desk, accounts);
                    atlas.share(registry, desk);
                }
            });
        }
    }

    /// Lets `work` change each registry, then does what follows from it.
    fn with_registries(
        &mut self,
        ctx: &mut Context<'_, Self>,
        mut work: impl FnMut(&mut Registry, &mut Atlas, &Desk<'_>),
    ) {
        let mut registries = std::mem::take(ctx.durable::<Registries>());
        let mut atlas = std::mem::take(ctx.durable::<Atlas>());
        let site = self.site.clone();
        let now = ctx.now().as_nanos();
        let ranks = match self.takes_over() {
            true => ctx.durable::<Charter>().ranks.clone(),
            false => Vec::new(),
        };
        let desk = |home| Desk {
            site: &site,
            home,
            now,
            ranks: &ranks,
        };
        for (home, registry) in &mut registries.all {
            work(registry, &mut atlas, &desk(*home));
        }
        for (home, item) in atlas.release() {
            if let Some(registry) = registries.find(home) {
                registry.take(&desk(home), item);
            }
        }
        hand_over(&mut registries, &mut atlas, &desk);
        let mut next_due = None;
        for (home, registry) in &mut registries.all {
            registry.decide_overdue(&desk(*home));
            let next_grant = match atlas.is_known(site.roadmap_from) {
                true => self.grant_heads(ctx, registry, now),
                false => None,
            };
            for itinerary in registry.proposals_due(&desk(*home), self.id) {
                let RoverId(rover) = itinerary.way.walk.rover;
                ctx.send(self.rovers[rover as usize], itinerary);
            }
            self.send_items(ctx, *home, registry, &ranks);
            let may_use = |to| self.acting(to) != self.id;
            let dues = [next_due, next_grant, registry.next_due(may_use)];
            next_due = dues.into_iter().flatten().min();
        }
        *ctx.durable::<Registries>() = registries;
        *ctx.durable::<Atlas>() = atlas;
        self.wake_at(ctx, next_due, now);
    }

    /// Sends what is due on the lines of a home.
    fn send_items(
        &self,
        ctx: &mut Context<'_, Self>,
        home: NodeId,
        registry: &mut Registry,
        ranks: &[u32],
    ) {
        let now = ctx.now().as_nanos();
        for (&to, line) in &mut registry.lines {
            let acting = self.acting(to);
            if acting == self.id {
                // It gave that home up, and has not heard to whom: until then it says nothing.
                continue;
            }
            let Some((receipt, items)) = line.due(now) else {
                continue;
            };
            let rank = |home: NodeId| ranks.get(home.0 as usize).copied();
            let between = rank(home).zip(rank(to));
            let between = between.map(|(from_rank, to_rank)| Between {
                from: home,
                from_rank,
                to,
                to_rank,
            });
            let relay = Relay {
                node: self.id,
                taken: receipt.taken,
                beyond: receipt.beyond,
                sent: now,
                echo: receipt.echo,
                items,
                between,
            };
            self.tell(ctx, acting, Content::Relay(relay));
        }
    }

    /// Grants the vertices whose first visit is due. Returns when the next one is.
    fn grant_heads(
        &mut self,
        ctx: &mut Context<'_, Self>,
        registry: &mut Registry,
        now: u64,
    ) -> Option<u64> {
        let config = &self.site.config;
        let ahead = self.site.longest_step.as_nanos() * u64::from(config.grants_ahead);
        let mut next = None::<u64>;
        let mut left = Vec::new();
        for (vertex, visit) in registry.book.heads() {
            let due = visit.start.saturating_sub(ahead);
            if ctx.durable::<Ledger>().occupant(vertex).is_some() {
                continue;
            }
            if due > now {
                next = Some(next.map_or(due, |n| n.min(due)));
                continue;
            }
            let (rover, step) = (visit.walk.rover, visit.step);
            visit.granted = true;
            ctx.durable::<Ledger>()
                .force(vertex, rover, step, visit.from, self.cycle);
            self.send_grant(ctx, rover, step, Some(vertex));
            let from = visit.from;
            left.extend(from.and_then(|v| self.presume_left(ctx, (rover, step), v, vertex)));
        }
        for vertex in left {
            registry.book.departed(vertex);
        }
        next
    }

    /// Sets the timer, unless it will wake the node soon enough.
    fn wake_at(&mut self, ctx: &mut Context<'_, Self>, due: Option<u64>, now: u64) {
        let Some(due) = due else { return };
        if let Some((at, timer)) = self.alarm {
            if at <= due && at > now {
                return;
            }
            ctx.cancel(timer);
        }
        let delay = SimDuration::from_nanos(due.saturating_sub(now).max(1));
        self.alarm = Some((now + delay.as_nanos(), ctx.timer(delay, RegistryDue)));
    }
}

/// Homes that the same node answers for hear from each other at once.
fn hand_over<'a>(
    registries: &mut Registries,
    atlas: &mut Atlas,
    desk: &impl Fn(NodeId) -> Desk<'a>,
) {
    let homes: Vec<NodeId> = match registries.all.len() {
        0 | 1 => return,
        _ => registries.all.iter().map(|(home, _)| *home).collect(),
    };
    loop {
        let mut local = Vec::new();
        for (home, registry) in &mut registries.all {
            for (&to, line) in &mut registry.lines {
                if homes.contains(&to) {
                    local.extend(line.hand_over().into_iter().map(|item| (*home, to, item)));
                }
            }
        }
        if local.is_empty() {
            return;
        }
        for (from, to, item) in local {
            let Some(registry) = registries.find(to) else {
                continue;
            };
            if let Some(step) = atlas.receive(registry, &desk(to), from, item) {
                registry.take(&desk(to), step);
            }
        }
    }
}

impl Handler<RegistryDue> for Node {
    fn handle(&mut self, _timer: RegistryDue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.alarm = None;
        self.with_registries(ctx, |_, _, _| {});
        Ok(())
    }
}

impl Handler<Relay> for Node {
    fn handle(&mut self, relay: Relay, ctx: &mut Context<'_, Self>) -> Outcome {
        let Some((from, to)) = self.between(ctx, &relay) else {
            return Ok(());
        };
        let Relay {
            taken,
            beyond,
            sent,
            echo,
            items,
            ..
        } = relay;
        let receipt = Receipt {
            taken,
            beyond,
            echo,
        };
        let mut items = Some(items);
        let knew = self.knows_roadmap(ctx);
        self.with_registries(ctx, |registry, atlas, desk| {
            let line = registry.lines.get_mut(&from);
            let Some(line) = line.filter(|_| desk.home == to) else {
                return;
            };
            line.acknowledged(&receipt, desk.now);
            let all = items.take().into_iter().flatten();
            let new: Vec<_> = all.filter_map(|item| line.take(sent, item)).collect();
            for item in new {
                if let Some(step) = atlas.receive(registry, desk, from, item) {
                    registry.take(desk, step);
                }
            }
        });
        if !knew && self.knows_roadmap(ctx) {
            ctx.sample(&RoadmapKnown { node: self.id });
        }
        match ctx.durable::<Atlas>().wrong() {
            Some(wrong) => Err(HandlerError::new(wrong)),
            None => Ok(()),
        }
    }
}

impl Node {
    /// The homes between which a relay goes; none if it is not for this node, or one of the homes was
    /// replaced since. What it says of replacements is learned.
    fn between(&mut self, ctx: &mut Context<'_, Self>, relay: &Relay) -> Option<(NodeId, NodeId)> {
        let Some(between) = relay.between.filter(|_| self.takes_over()) else {
            return Some((relay.node, self.id));
        };
        let Between {
            from,
            from_rank,
            to,
            to_rank,
        } = between;
        for (home, rank) in [(from, from_rank), (to, to_rank)] {
            self.learn(ctx, Replacement { home, rank });
        }
        let ranks = &ctx.durable::<Charter>().ranks;
        let rank = |home: NodeId| ranks.get(home.0 as usize).copied();
        let holds = rank(from) == Some(from_rank) && rank(to) == Some(to_rank);
        holds.then_some((from, to))
    }
}

impl Handler<ItineraryAnswer> for Node {
    fn handle(&mut self, answer: ItineraryAnswer, ctx: &mut Context<'_, Self>) -> Outcome {
        self.with_registries(ctx, |registry, _, desk| registry.answered(desk, answer));
        Ok(())
    }
}
