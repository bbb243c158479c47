//! The node's side of the `complete` policy: what comes in goes to the registry, what the registry
//! wants goes out, and vertices are granted to the first of their books.

use farside::prelude::*;
use farside_worlds::VertexId;
use serde::{Deserialize, Serialize};

use super::messages::Relay;
use super::registry::{Desk, Registry};
use super::relay::Receipt;
use crate::network::config::Policy;
use crate::network::node::Node;
use crate::network::safety::Ledger;

/// Timer: something is overdue, or a vertex is to be granted.
#[derive(Serialize, Deserialize)]
#[doc(hidden)]
pub struct RegistryDue;

impl Node {
    /// Opens the registry; after a crash, what was on its way is repeated.
    pub(crate) fn open_registry(&mut self, ctx: &mut Context<'_, Self>) {
        self.with_registry(ctx, |registry, desk| registry.open(desk));
    }

    /// A cycle begins: rovers that wait without a way apply for one.
    pub(crate) fn apply(&mut self, ctx: &mut Context<'_, Self>) {
        // Other policies have planned for all before the start.
        let applies = self.site.config.policy == Policy::Complete;
        self.with_registry(ctx, |registry, desk| {
            if applies {
                registry.apply(desk);
            }
        });
    }

    /// Vertices are free again.
    pub(crate) fn departed(&mut self, ctx: &mut Context<'_, Self>, freed: &[VertexId]) {
        self.with_registry(ctx, |registry, _| {
            for &vertex in freed {
                registry.book.departed(vertex);
            }
        });
    }

    /// Lets `work` change the registry, then does what follows from it.
    fn with_registry(
        &mut self,
        ctx: &mut Context<'_, Self>,
        work: impl FnOnce(&mut Registry, &Desk<'_>),
    ) {
        let mut registry = std::mem::take(ctx.durable::<Registry>());
        let site = self.site.clone();
        let now = ctx.now().as_nanos();
        let desk = Desk {
            site: &site,
            node: self.id,
            now,
        };
        work(&mut registry, &desk);
        registry.decide_overdue(&desk);
        let next_grant = self.grant_heads(ctx, &mut registry, now);
        for (&to, line) in &mut registry.lines {
            let Some((
                Receipt {
                    taken,
                    beyond,
                    echo,
                },
                items,
            )) = line.due(now)
            else {
                continue;
            };
            let Some(at) = self.neighbor(to) else {
                continue;
            };
            let relay = Relay {
                node: self.id,
                taken,
                beyond,
                sent: now,
                echo,
                items,
            };
            ctx.send(self.neighbors[at].address, relay);
        }
        let due = registry.next_due().into_iter().chain(next_grant).min();
        *ctx.durable::<Registry>() = registry;
        self.wake_at(ctx, due, now);
    }

    /// Grants the vertices whose first visit is due. Returns when the next one is.
    fn grant_heads(
        &self,
        ctx: &mut Context<'_, Self>,
        registry: &mut Registry,
        now: u64,
    ) -> Option<u64> {
        let config = &self.site.config;
        let ahead = self.site.timing.cycle.as_nanos() * u64::from(config.grants_ahead);
        let mut next = None::<u64>;
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

impl Handler<RegistryDue> for Node {
    fn handle(&mut self, _timer: RegistryDue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.alarm = None;
        self.with_registry(ctx, |_, _| {});
        Ok(())
    }
}

impl Handler<Relay> for Node {
    fn handle(&mut self, relay: Relay, ctx: &mut Context<'_, Self>) -> Outcome {
        let Relay {
            node,
            taken,
            beyond,
            sent,
            echo,
            items,
        } = relay;
        self.with_registry(ctx, |registry, desk| {
            let Some(line) = registry.lines.get_mut(&node) else {
                return;
            };
            line.acknowledged(
                &Receipt {
                    taken,
                    beyond,
                    echo,
                },
                desk.now,
            );
            let new: Vec<_> = items
                .into_iter()
                .filter_map(|item| line.take(sent, item))
                .collect();
            for item in new {
                registry.take(desk, item);
            }
        });
        Ok(())
    }
}
