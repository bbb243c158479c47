//! A station: the one actor of each host. It sends its own flows on their schedules and passes on
//! what others send through it. It answers nothing.

use std::collections::BTreeMap;
use std::sync::Arc;

use farside::prelude::*;
use serde::{Deserialize, Serialize};

use super::Arrivals;
use super::message::Datagram;
use super::route::TrafficPlan;

/// A timer: the flow of this place in the plan sends.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Due {
    flow: u32,
}

/// What a station remembers through a crash: how many messages each of its Poisson flows has sent.
/// The other schedules follow from the clock.
#[derive(Default)]
struct Sent(BTreeMap<u32, u32>);

/// Which messages of a flow a relay has passed on, a bit for each.
#[derive(Default)]
pub(super) struct SeenNumbers {
    bits: Vec<u64>,
}

impl SeenNumbers {
    /// Notes a number; false if it was noted before.
    pub(super) fn insert(&mut self, number: u32) -> bool {
        let (word, bit) = (number as usize / 64, 1 << (number % 64));
        if self.bits.len() <= word {
            self.bits.resize(word + 1, 0);
        }
        let new = self.bits[word] & bit == 0;
        self.bits[word] |= bit;
        new
    }

    pub(super) fn contains(&self, number: u32) -> bool {
        let word = self.bits.get(number as usize / 64);
        word.is_some_and(|word| word & (1 << (number % 64)) != 0)
    }
}

pub(super) struct Station {
    plan: Arc<TrafficPlan>,
    /// The flows that begin here, by their place in the plan.
    own: Vec<u32>,
    /// Whom the messages of each flow, by its id, go to from here.
    next: BTreeMap<u32, usize>,
    /// What was passed on, of each flow by its id.
    passed: BTreeMap<u32, SeenNumbers>,
}

impl Actor for Station {
    type Accepts = (Due, Datagram);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        for flow in &self.own {
            self.schedule(*flow, ctx, true);
        }
        Ok(())
    }
}

impl Handler<Due> for Station {
    fn handle(&mut self, due: Due, ctx: &mut Context<'_, Self>) -> Outcome {
        let flow = &self.plan.flows[due.flow as usize];
        let (id, config) = (flow.id, &flow.config);
        let target = ctx.lookup::<Station>(&flow.names()[1])?;
        let (first, count) = match config.arrivals {
            Arrivals::Poisson => {
                let sent = ctx.durable::<Sent>().0.entry(due.flow).or_default();
                *sent += 1;
                (*sent - 1, 1)
            }
            Arrivals::Periodic | Arrivals::Burst => {
                let burst = config.burst.unwrap_or(1);
                let turn = since(ctx.now(), config.start) / config.period.as_nanos();
                (number(turn.saturating_mul(u64::from(burst)))?, burst)
            }
        };
        for offset in 0..count {
            let number = number(u64::from(first) + u64::from(offset))?;
            let datagram = Datagram::of_size(id, number, ctx.now(), config.size_bytes);
            ctx.send_keyed(target, datagram.key(), datagram);
        }
        self.schedule(due.flow, ctx, false);
        Ok(())
    }
}

impl Handler<Datagram> for Station {
    fn handle(&mut self, datagram: Datagram, ctx: &mut Context<'_, Self>) -> Outcome {
        let Some(&next) = self.next.get(&datagram.flow) else {
            return Ok(());
        };
        // A copy passed on would have the identity of the first, and share its fate.
        if self
            .passed
            .entry(datagram.flow)
            .or_default()
            .insert(datagram.number)
        {
            let target = ctx.lookup::<Station>(&self.plan.hosts[next])?;
            ctx.send_keyed(target, datagram.key(), datagram);
        }
        Ok(())
    }
}

impl Station {
    pub(super) fn new(plan: Arc<TrafficPlan>, own: Vec<u32>, next: BTreeMap<u32, usize>) -> Self {
        Station {
            plan,
            own,
            next,
            passed: BTreeMap::new(),
        }
    }

    /// Sets the timer for a flow's next message; at the start, or after a restart, for the first
    /// from now on.
    fn schedule(&self, flow: u32, ctx: &mut Context<'_, Self>, starts: bool) {
        let super::Flow { id, config, .. } = &self.plan.flows[flow as usize];
        let (now, start) = (ctx.now(), SimTime::ZERO + config.start);
        let at = match config.arrivals {
            Arrivals::Poisson => {
                let sent = ctx.durable::<Sent>().0.get(&flow).copied().unwrap_or(0);
                // Drawn by the message's number, so that a crash elsewhere shifts nothing here.
                let key = ctx.random_at("traffic", u64::from(*id) << 32 | u64::from(sent));
                let wait_s = key.stream().exponential(config.period.as_secs_f64());
                now.max(start) + SimDuration::from_secs_f64(wait_s)
            }
            Arrivals::Periodic | Arrivals::Burst => {
                let period = config.period.as_nanos();
                let turns = since(now, config.start).div_ceil(period) + u64::from(!starts);
                start + config.period * turns
            }
        };
        if config.stop.is_none_or(|stop| at < SimTime::ZERO + stop) && at < SimTime::MAX {
            ctx.timer(at.since(now), Due { flow });
        }
    }
}

/// Nanoseconds since a flow's start; zero before.
fn since(now: SimTime, start: SimDuration) -> u64 {
    now.since(SimTime::ZERO + start).as_nanos()
}

/// A message's number, of which a flow has 2^32.
fn number(number: u64) -> Result<u32, HandlerError> {
    u32::try_from(number).map_err(|_| HandlerError::new("a flow has at most 2^32 messages"))
}
