//! PHOLD, the hold model, in Farside: each event sends a message of 24 bytes to a random actor, which
//! arrives after a look-ahead plus an exponential delay. What `benches/events.rs` counts, and what
//! `tests/peers` runs beside other simulators.

use std::sync::{Arc, OnceLock};

use farside::carrier::NoChange;
use farside::prelude::*;
use farside::random::Stream;
use farside::{Carrier, Parcel, Verdicts};
use serde::{Deserialize, Serialize};

/// The look-ahead: no event is scheduled sooner \[ns\].
pub(crate) const LOOK_AHEAD_NS: u64 = 100_000_000;
/// The mean of the exponential part \[ns\].
pub(crate) const MEAN_NS: f64 = 900_000_000.0;

/// A job that passes from actor to actor: 24 bytes.
#[derive(Serialize, Deserialize)]
struct Job {
    id: u64,
    hops: u64,
    payload: u64,
}

/// What all actors know.
type Others = Arc<OnceLock<Vec<Address<Holder>>>>;

struct Holder {
    at: u32,
    others: Others,
    population: u32,
    by_link: bool,
}

impl Actor for Holder {
    type Accepts = (Job,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
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
        let stream = ctx.random("hold");
        let others = self.others.get().expect("set before the run");
        let at = stream.below(others.len() as u64) as usize;
        if self.by_link && at != self.at as usize {
            ctx.send(others[at], job);
        } else {
            let delay = delay(stream);
            ctx.send_after(others[at], delay, job);
        }
    }
}

impl Handler<Job> for Holder {
    fn handle(&mut self, job: Job, ctx: &mut Context<'_, Self>) -> Outcome {
        let hops = job.hops + 1;
        self.pass(Job { hops, ..job }, ctx);
        Ok(())
    }
}

fn delay(stream: &mut Stream) -> SimDuration {
    SimDuration::from_nanos(LOOK_AHEAD_NS + stream.exponential(MEAN_NS) as u64)
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

/// PHOLD of one size.
#[derive(Clone, Copy)]
pub(crate) struct Phold {
    pub(crate) actors: u32,
    /// Events on their way for each actor, all the time.
    pub(crate) population: u32,
    /// A host for each actor, joined by links that make the delay; else one host for all, and
    /// delayed sends.
    pub(crate) by_link: bool,
    pub(crate) digest: bool,
}

impl Phold {
    /// Runs until about so many events were handled; returns how many were.
    pub(crate) fn run(self, events: u64, executor: Executor) -> u64 {
        let Phold {
            actors,
            population,
            by_link,
            digest,
        } = self;
        let mut sim = Simulation::new(1);
        let one_host = sim.host("all");
        let others = Others::default();
        let mut addresses = Vec::new();
        for at in 0..actors {
            let name = format!("holder_{at}");
            let host = if by_link { sim.host(&name) } else { one_host };
            let others = others.clone();
            addresses.push(sim.actor(host, &name, move |_| {
                let others = others.clone();
                Holder {
                    at,
                    others,
                    population,
                    by_link,
                }
            }));
            if by_link {
                sim.uplink(host, &format!("{name}-all"), Hold);
            }
        }
        assert!(others.set(addresses).is_ok(), "set once");
        if !digest {
            sim.without_digest();
        }
        // In the mean one event in (look-ahead + mean) for each of the population.
        let in_flight = f64::from(actors) * f64::from(population);
        let until_ns = events as f64 / in_flight * (LOOK_AHEAD_NS as f64 + MEAN_NS);
        sim.stop_at(SimTime::from_nanos(until_ns as u64), "enough events");
        sim.run(executor)
            .expect("the model can start")
            .counts
            .events
    }
}
