//! What a node does with reservation tables: what comes in goes to the registry, what the registry
//! wants goes out, and vertices are granted to the first of their visits.

use farside::prelude::*;
use farside_worlds::NodeId;
use serde::{Deserialize, Serialize};

use super::Node;
use super::base::Base;
use super::messages::RoadmapKnown;
use crate::failover::FailoverRecord;
use crate::failover::messages::{Account, Content};
use crate::failover::rank::Replacement;
use crate::reservation::messages::{Between, ItineraryAnswer, Relay};
use crate::reservation::{Atlas, Desk, Receipt, Registries, Registry};
use crate::safety::messages::Whereabouts;
use crate::safety::{News, OccupancyTable};

/// Timer: something is overdue, or a vertex is to be granted.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct RegistryDue;

/// The state of it between two crashes; what must outlive one is in [`Registries`] and [`Atlas`].
#[derive(Default)]
pub(super) struct Reservations {
    /// When the timer fires \[ns\].
    alarm: Option<(u64, TimerId)>,
}

impl Reservations {
    /// Opens the registries; after a crash, what was on its way is repeated.
    pub(super) fn open_registry(&mut self, base: &Base, ctx: &mut Context<'_, Node>) {
        if base.answers_for(base.id) && ctx.durable::<Registries>().all.is_empty() {
            let region = base.id;
            ctx.durable::<Registries>()
                .insert(region, Registry::default());
        }
        self.with_registries(base, ctx, |registry, atlas, desk| {
            registry.open(desk);
            atlas.publish(registry, desk);
        });
    }

    /// A cycle begins: rovers that wait without a path apply for one.
    pub(super) fn apply(&mut self, base: &Base, ctx: &mut Context<'_, Node>) {
        self.with_registries(base, ctx, |registry, _, desk| registry.apply(desk));
    }

    /// Says and grants what is due.
    pub(super) fn go_on(&mut self, base: &Base, ctx: &mut Context<'_, Node>) {
        self.with_registries(base, ctx, |_, _, _| {});
    }

    /// What was heard of a rover: vertices may be free again.
    pub(super) fn heard(
        &mut self,
        base: &Base,
        ctx: &mut Context<'_, Node>,
        fact: &Whereabouts,
        news: &News,
    ) {
        for &previous in &news.unheard {
            base.report_departure(ctx, *fact, Some(previous));
        }
        if !news.freed.is_empty() {
            self.with_registries(base, ctx, |registry, _, _| {
                for &vertex in &news.freed {
                    registry.table.departed(vertex);
                }
            });
        }
    }

    /// Another one than before answers for `region`; with rovers' accounts, this node does.
    pub(super) fn succeed(
        &mut self,
        base: &Base,
        ctx: &mut Context<'_, Node>,
        region: NodeId,
        accounts: Option<&[Account]>,
    ) {
        self.with_registries(base, ctx, |registry, _, desk| registry.renew(desk, region));
        if let Some(accounts) = accounts {
            ctx.durable::<Registries>()
                .insert(region, Registry::default());
            self.with_registries(base, ctx, |registry, atlas, desk| {
                if desk.region == region {
                    *registry = Registry::succeed(desk, accounts);
                    atlas.share(registry, desk);
                }
            });
        }
    }

    /// Takes what came for the region `to` from the region `from`.
    fn take(
        &mut self,
        base: &Base,
        ctx: &mut Context<'_, Node>,
        (from, to): (NodeId, NodeId),
        relay: Relay,
    ) -> Outcome {
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
        let knew = base.knows_roadmap(ctx);
        self.with_registries(base, ctx, |registry, atlas, desk| {
            let line = registry.lines.get_mut(&from);
            let Some(line) = line.filter(|_| desk.region == to) else {
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
        if !knew && base.knows_roadmap(ctx) {
            ctx.sample(&RoadmapKnown { node: base.id });
        }
        match ctx.durable::<Atlas>().wrong() {
            Some(wrong) => Err(HandlerError::new(wrong)),
            None => Ok(()),
        }
    }

    /// Lets `work` change each registry, then does what follows from it.
    fn with_registries(
        &mut self,
        base: &Base,
        ctx: &mut Context<'_, Node>,
        mut work: impl FnMut(&mut Registry, &mut Atlas, &Desk<'_>),
    ) {
        let mut registries = std::mem::take(ctx.durable::<Registries>());
        let mut atlas = std::mem::take(ctx.durable::<Atlas>());
        let site = base.site.clone();
        let now = ctx.now().as_nanos();
        let ranks = match base.takes_over() {
            true => ctx.durable::<FailoverRecord>().ranks.clone(),
            false => Vec::new(),
        };
        let desk = |region| Desk {
            site: &site,
            region,
            now,
            ranks: &ranks,
        };
        for (region, registry) in &mut registries.all {
            work(registry, &mut atlas, &desk(*region));
        }
        for (region, item) in atlas.release() {
            if let Some(registry) = registries.find(region) {
                registry.take(&desk(region), item);
            }
        }
        hand_over(&mut registries, &mut atlas, &desk);
        let mut next_due = None;
        for (region, registry) in &mut registries.all {
            registry.decide_overdue(&desk(*region));
            registry.resolve_jointly(&desk(*region));
            let may_grant = registry.may_grant() && atlas.is_known(site.roadmap_from);
            let next_grant = match may_grant {
                true => grant_heads(base, ctx, registry, now),
                false => None,
            };
            for itinerary in registry.proposals_due(&desk(*region), base.id) {
                if let Some(rover) = base.address(itinerary.path.request.rover) {
                    ctx.send(rover, itinerary);
                }
            }
            send_items(base, ctx, *region, registry, &ranks);
            let may_use = |to| base.acting(to) != base.id;
            let dues = [next_due, next_grant, registry.next_due(may_use)];
            next_due = dues.into_iter().flatten().min();
        }
        *ctx.durable::<Registries>() = registries;
        *ctx.durable::<Atlas>() = atlas;
        self.wake_at(ctx, next_due, now);
    }

    /// Sets the timer, unless it will wake the node soon enough.
    fn wake_at(&mut self, ctx: &mut Context<'_, Node>, due: Option<u64>, now: u64) {
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

/// Sends what is due on the lines of a region.
fn send_items(
    base: &Base,
    ctx: &mut Context<'_, Node>,
    region: NodeId,
    registry: &mut Registry,
    ranks: &[u32],
) {
    let now = ctx.now().as_nanos();
    for (&to, line) in &mut registry.lines {
        let acting = base.acting(to);
        if acting == base.id {
            // It gave that region up, and has not heard to whom: until then it says nothing.
            continue;
        }
        let Some((receipt, items)) = line.due(now) else {
            continue;
        };
        let rank = |region: NodeId| ranks.get(region.0 as usize).copied();
        let between = rank(region).zip(rank(to));
        let between = between.map(|(from_rank, to_rank)| Between {
            from: region,
            from_rank,
            to,
            to_rank,
        });
        let relay = Relay {
            node: base.id,
            taken: receipt.taken,
            beyond: receipt.beyond,
            sent: now,
            echo: receipt.echo,
            items,
            between,
        };
        base.tell(ctx, acting, Content::Relay(relay));
    }
}

/// Grants the vertices whose first visit is due. Returns when the next one is.
fn grant_heads(
    base: &Base,
    ctx: &mut Context<'_, Node>,
    registry: &mut Registry,
    now: u64,
) -> Option<u64> {
    let config = &base.site.config;
    let ahead = base.site.longest_step.as_nanos() * u64::from(config.grants_ahead);
    let mut next = None::<u64>;
    let mut left = Vec::new();
    for (vertex, visit) in registry.table.heads() {
        let due = visit.start.saturating_sub(ahead);
        if ctx.durable::<OccupancyTable>().occupant(vertex).is_some() {
            continue;
        }
        if due > now {
            next = Some(next.map_or(due, |n| n.min(due)));
            continue;
        }
        let (rover, step) = (visit.request.rover, visit.step);
        visit.granted = true;
        ctx.durable::<OccupancyTable>()
            .force(vertex, rover, step, visit.from, base.cycle);
        base.send_grant(ctx, rover, step, Some(vertex));
        let from = visit.from;
        if let Some(from) = from {
            left.extend(base.presume_left(ctx, (rover, step), (from, vertex)));
        }
    }
    for vertex in left {
        registry.table.departed(vertex);
    }
    next
}

/// Regions that the same node answers for hear from each other at once.
fn hand_over<'a>(
    registries: &mut Registries,
    atlas: &mut Atlas,
    desk: &impl Fn(NodeId) -> Desk<'a>,
) {
    let regions: Vec<NodeId> = match registries.all.len() {
        0 | 1 => return,
        _ => registries.all.iter().map(|(region, _)| *region).collect(),
    };
    loop {
        let mut local = Vec::new();
        for (region, registry) in &mut registries.all {
            for (&to, line) in &mut registry.lines {
                if regions.contains(&to) {
                    local.extend(line.hand_over().into_iter().map(|item| (*region, to, item)));
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
        if let Some(reservations) = self.policy.reservations() {
            reservations.alarm = None;
            reservations.go_on(&self.base, ctx);
        }
        Ok(())
    }
}

impl Handler<Relay> for Node {
    fn handle(&mut self, relay: Relay, ctx: &mut Context<'_, Self>) -> Outcome {
        let Some(regions) = self.between(ctx, &relay) else {
            return Ok(());
        };
        match self.policy.reservations() {
            Some(reservations) => reservations.take(&self.base, ctx, regions, relay),
            None => Ok(()),
        }
    }
}

impl Node {
    /// The regions between which a relay goes; none if it is not for this node, or one of the
    /// regions was replaced since. What it says of replacements is learned.
    fn between(&mut self, ctx: &mut Context<'_, Self>, relay: &Relay) -> Option<(NodeId, NodeId)> {
        let Some(between) = relay.between.filter(|_| self.base.takes_over()) else {
            return Some((relay.node, self.base.id));
        };
        let Between {
            from,
            from_rank,
            to,
            to_rank,
        } = between;
        for (region, rank) in [(from, from_rank), (to, to_rank)] {
            self.learn(ctx, Replacement { region, rank });
        }
        let ranks = &ctx.durable::<FailoverRecord>().ranks;
        let rank = |region: NodeId| ranks.get(region.0 as usize).copied();
        let holds = rank(from) == Some(from_rank) && rank(to) == Some(to_rank);
        holds.then_some((from, to))
    }
}

impl Handler<ItineraryAnswer> for Node {
    fn handle(&mut self, answer: ItineraryAnswer, ctx: &mut Context<'_, Self>) -> Outcome {
        if let Some(reservations) = self.policy.reservations() {
            let take = |registry: &mut Registry, _: &mut Atlas, desk: &Desk<'_>| {
                registry.answered(desk, answer);
            };
            reservations.with_registries(&self.base, ctx, take);
        }
        Ok(())
    }
}
