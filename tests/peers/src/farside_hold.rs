//! The hold model in Farside: typed actors, 24-byte messages, no log.

use std::sync::{Arc, OnceLock};

use farside::carrier::NoChange;
use farside::prelude::*;
use farside::random::Stream;
use farside::{Carrier, Parcel, Verdicts};
use serde::{Deserialize, Serialize};

use crate::{LOOK_AHEAD_NS, MEAN_NS, Size};

/// A job that passes from actor to actor: 24 bytes.
#[derive(Serialize, Deserialize)]
struct Job {
    id: u64,
    hops: u64,
    payload: u64,
}

struct Holder {
    at: u32,
    actors: u32,
    /// All of them, the same list for all: looked up by who starts first.
    others: Arc<OnceLock<Vec<Address<Holder>>>>,
    population: u32,
    /// Hosts of their own, joined by links that make the delay, or one host and delayed sends.
    by_link: bool,
}

impl Actor for Holder {
    type Accepts = (Job,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        if self.others.get().is_none() {
            let all = (0..self.actors).map(|at| ctx.lookup(&name(at)));
            let all = all.collect::<Result<_, _>>()?;
            self.others.get_or_init(|| all);
        }
        for id in 0..u64::from(self.population) {
            self.pass(
                Job {
                    id,
                    hops: 0,
                    payload: 0,
                },
                ctx,
            );
        }
        Ok(())
    }
}

impl Holder {
    fn pass(&mut self, job: Job, ctx: &mut Context<'_, Self>) {
        let Some(others) = self.others.get() else {
            return;
        };
        let stream = ctx.random("hold");
        let at = stream.below(others.len() as u64) as u32;
        let to = others[at as usize];
        if self.by_link && at != self.at {
            ctx.send(to, job);
        } else {
            let delay = delay(stream);
            ctx.send_after(to, delay, job);
        }
    }
}

impl Handler<Job> for Holder {
    fn handle(&mut self, job: Job, ctx: &mut Context<'_, Self>) -> Outcome {
        self.pass(
            Job {
                hops: job.hops + 1,
                ..job
            },
            ctx,
        );
        Ok(())
    }
}

fn delay(stream: &mut Stream) -> SimDuration {
    SimDuration::from_nanos(LOOK_AHEAD_NS + stream.exponential(MEAN_NS) as u64)
}

fn name(at: u32) -> String {
    format!("holder_{at}")
}

/// A link that delays by the look-ahead plus an exponential time.
struct Hold;

impl Carrier for Hold {
    type Change = NoChange;

    fn min_delay(&self) -> SimDuration {
        SimDuration::from_nanos(LOOK_AHEAD_NS)
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        verdicts.deliver(delay(&mut parcel.random(0, 0, 0).stream()));
    }

    fn change(&mut self, _change: NoChange, _now: SimTime) {}
}

fn build(size: Size, by_link: bool) -> Simulation {
    let mut sim = Simulation::new(1);
    let one_host = sim.host("all");
    let others = Arc::new(OnceLock::new());
    for at in 0..size.actors {
        let others = others.clone();
        let host = if by_link {
            sim.host(&format!("host_{at}"))
        } else {
            one_host
        };
        let Size {
            actors, population, ..
        } = size;
        sim.actor(host, &name(at), move |_| Holder {
            at,
            actors,
            others: others.clone(),
            population,
            by_link,
        });
        if by_link {
            sim.uplink(host, &format!("{}-all", name(at)), Hold);
        }
    }
    // In the mean one event in (look-ahead + mean) for each of the population.
    let in_flight = f64::from(size.actors) * f64::from(size.population);
    let until_ns = size.events as f64 / in_flight * (LOOK_AHEAD_NS as f64 + MEAN_NS);
    sim.stop_at(SimTime::from_nanos(until_ns as u64), "enough events");
    sim
}

/// One host, one thread. Returns how many events were handled.
pub fn inline(size: Size, digest: bool) -> u64 {
    let mut sim = build(size, false);
    if !digest {
        sim.without_digest();
    }
    sim.run(Executor::Inline)
        .expect("the model can start")
        .counts
        .events
}

/// A host for each actor, joined by links, through kameo; no digest, as in the other.
pub fn kameo(size: Size) -> u64 {
    let mut sim = build(size, true);
    sim.without_digest();
    let executor = Executor::Kameo { threads: 1 };
    sim.run(executor)
        .expect("the model can start")
        .counts
        .events
}
