//! What a message costs by the link that carries it, beside the kernel's plainest link. Ratios of
//! one run; the best of five rounds each.
//!
//! ```text
//! cargo bench -p farside-actors --bench links
//! ```

// A benchmark measures real time.
#![allow(clippy::disallowed_types)]

use std::time::Instant;

use farside::carrier::FixedDelay;
use farside::prelude::*;
use farside_actors::link::{Link, LinkParams, Timeline};
use farside_actors::radio::{Radio, RadioConfig};
use nalgebra::Point3;
use serde::{Deserialize, Serialize};

const MESSAGES: u32 = 200_000;

/// The least of this many rounds counts: noise only ever adds.
const ROUNDS: usize = 5;

#[derive(Serialize, Deserialize)]
struct Datagram {
    number: u32,
    value: f64,
}

#[derive(Serialize, Deserialize)]
struct Tick;

struct Sink;

impl Actor for Sink {
    type Accepts = (Datagram,);
}

impl Handler<Datagram> for Sink {
    fn handle(&mut self, _datagram: Datagram, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

struct Source {
    to: Address<Sink>,
    sent: u32,
}

impl Actor for Source {
    type Accepts = (Tick,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_millis(1), Tick);
        Ok(())
    }
}

impl Handler<Tick> for Source {
    fn handle(&mut self, _tick: Tick, ctx: &mut Context<'_, Self>) -> Outcome {
        let (number, value) = (self.sent, f64::from(self.sent));
        ctx.send(self.to, Datagram { number, value });
        self.sent += 1;
        if self.sent < MESSAGES {
            ctx.timer(SimDuration::from_millis(1), Tick);
        }
        Ok(())
    }
}

/// Joins the hosts `a` and `b`, one way.
type Join = dyn Fn(&mut Simulation, HostId, HostId);

/// The least wall time of a message, its timer and the digest included, in nanoseconds.
fn message_ns(join: &Join) -> f64 {
    let round = |_| {
        let mut sim = Simulation::new(1);
        let (a, b) = (sim.host("a"), sim.host("b"));
        let to = sim.actor(b, "sink", |_| Sink);
        sim.actor(a, "source", move |_| Source { to, sent: 0 });
        join(&mut sim, a, b);
        let start = Instant::now();
        let report = sim.run(Executor::Inline).expect("it starts");
        let elapsed = start.elapsed();
        assert_eq!(report.counts.sent, u64::from(MESSAGES));
        elapsed.as_secs_f64() * 1e9 / f64::from(MESSAGES)
    };
    (0..ROUNDS).map(round).fold(f64::INFINITY, f64::min)
}

fn link(text: &str) -> Box<Join> {
    let params: LinkParams = toml::from_str(text).expect("link parameters");
    Box::new(move |sim, a, b| {
        sim.link(a, b, "a-b", Link::new(Timeline::new(params.clone())));
    })
}

fn radio(text: &str) -> Box<Join> {
    let config: RadioConfig = toml::from_str(text).expect("a radio");
    Box::new(move |sim, a, b| {
        let mut radio = Radio::new(config.clone(), None);
        radio.station(a.index(), "a", Point3::origin());
        radio.station(b.index(), "b", Point3::new(100.0, 0.0, 0.0));
        let params: LinkParams = toml::from_str("rate = '1Mbit/s'").expect("link parameters");
        radio.link("a-b", a.index(), b.index(), Timeline::new(params));
        let id = sim.shared_link("air", radio);
        sim.route(a, b, id);
    })
}

fn main() {
    let fixed: Box<Join> = Box::new(|sim, a, b| {
        sim.link(a, b, "a-b", FixedDelay::new(SimDuration::from_millis(5)));
    });
    let all = "jitter = '1ms'\nloss = 0.02\nburst = { loss = 0.1, length = '100ms' }\n\
               rate = '1Mbit/s'\noverhead = '20B'\nqueue = 64\nretries = 3\nber = 1e-6\n\
               duplicate = 0.01\nreorder = 0.01\ntx_power = '1W'";
    let cases: [(&str, Box<Join>); 7] = [
        ("fixed delay (kernel)", fixed),
        ("latency", link("latency = '5ms'")),
        ("jitter and loss", link("jitter = '1ms'\nloss = 0.02")),
        ("bursts", link("burst = { loss = 0.1, length = '100ms' }")),
        ("everything", link(all)),
        (
            "radio, full duplex",
            radio("light_time = true\n[path_loss]"),
        ),
        ("radio, csma", radio("access = 'csma'\nrange = '1km'")),
    ];
    println!("a message, with its timer and the digest, {MESSAGES} of them");
    let base_ns = message_ns(&cases[0].1);
    for (name, join) in &cases {
        let ns = message_ns(join);
        println!("{name:<22} {ns:7.0} ns  {:5.2} times", ns / base_ns);
    }
}
