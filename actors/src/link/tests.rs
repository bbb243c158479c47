//! What links promise, against closed forms: rates, bounds, coupling, and changes in time.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};

use farside::HostId;
use farside::carrier::Carriage;
use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass};
use proptest::prelude::*;
use serde::{Deserialize, Serialize};

use super::*;
use crate::wiring::{LinkBuilder, Wiring};

mod air;
mod arq;
mod fragments;
mod loss;
mod presets;
mod random;
mod redraw;

/// A message of a size to choose.
#[derive(Serialize, Deserialize)]
struct Probe {
    pad: Vec<u8>,
}

#[derive(Serialize, Deserialize)]
struct Tick;

struct Sink;

impl Actor for Sink {
    type Accepts = (Probe,);
}

impl Handler<Probe> for Sink {
    fn handle(&mut self, _probe: Probe, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

/// What is sent: when, and how much.
#[derive(Clone, Copy, Debug)]
struct Send {
    at: SimTime,
    pad: usize,
}

/// One probe of a size each `every`, whatever comes of them.
fn each(every: SimDuration, count: u32, pad: usize) -> Vec<Send> {
    let at = |n: u32| SimTime::ZERO + every * u64::from(n);
    (0..count).map(|n| Send { at: at(n), pad }).collect()
}

/// Sends each of its probes to every sink.
struct Source {
    sinks: Vec<Address<Sink>>,
    sends: std::vec::IntoIter<Send>,
    next: Option<Send>,
}

impl Source {
    fn new(sinks: Vec<Address<Sink>>, sends: Vec<Send>) -> Self {
        let mut sends = sends.into_iter();
        let next = sends.next();
        Source { sinks, sends, next }
    }
}

impl Actor for Source {
    type Accepts = (Tick,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.handle(Tick, ctx)
    }
}

impl Handler<Tick> for Source {
    fn handle(&mut self, _tick: Tick, ctx: &mut Context<'_, Self>) -> Outcome {
        while let Some(send) = self.next.filter(|send| send.at <= ctx.now()) {
            for sink in &self.sinks {
                let pad = vec![0; send.pad];
                ctx.send(*sink, Probe { pad });
            }
            self.next = self.sends.next();
        }
        if let Some(next) = self.next {
            ctx.timer(next.at.since(ctx.now()), Tick);
        }
        Ok(())
    }
}

/// The fate of one copy.
#[derive(Clone, Debug, PartialEq)]
struct Fate {
    link: Option<farside::ids::EntityId>,
    ordinal: u64,
    copy: u32,
    sent: SimTime,
    delay: SimDuration,
    reason: &'static str,
    bytes: u64,
    carriage: Option<Carriage>,
}

impl Fate {
    /// How it was carried, where the link says so.
    fn parts(&self) -> Carriage {
        self.carriage.expect("a link that is not plain tells")
    }
}

struct Fates(Arc<Mutex<Vec<Fate>>>);

impl Observer for Fates {
    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        if matches!(record.class, RecordClass::Delivered | RecordClass::Lost) {
            self.0.lock().unwrap().push(Fate {
                link: record.link,
                ordinal: record.ordinal,
                copy: record.copy,
                sent: record.sent,
                delay: record.time().since(record.sent),
                reason: record.reason,
                bytes: record.body.len() as u64,
                carriage: record.carriage.copied(),
            });
        }
        Ok(Flow::Continue)
    }
}

/// Sends over the links that `connect` declares from host `a` to each of the other hosts.
fn run(
    seed: u64,
    sends: &[Send],
    to: &[&str],
    connect: impl FnOnce(&mut Simulation, HostId, &[HostId]),
) -> Vec<Fate> {
    let mut sim = Simulation::new(seed);
    let a = sim.host("a");
    let hosts: Vec<HostId> = to.iter().map(|name| sim.host(name)).collect();
    let sink = |(host, name): (&HostId, &&str)| sim.actor(*host, &format!("sink_{name}"), |_| Sink);
    let sinks: Vec<Address<Sink>> = hosts.iter().zip(to).map(sink).collect();
    let sends = sends.to_vec();
    sim.actor(a, "source", move |_| {
        Source::new(sinks.clone(), sends.clone())
    });
    connect(&mut sim, a, &hosts);
    let seen = Arc::new(Mutex::new(Vec::new()));
    sim.observe(Fates(seen.clone()));
    let report = sim.run(Executor::Inline).unwrap();
    assert_eq!(report.end.name(), "completed", "{}", report.end.detail());
    Arc::into_inner(seen).unwrap().into_inner().unwrap()
}

/// What becomes of traffic over links built from this scenario text.
fn scenario(seed: u64, sends: &[Send], to: &[&str], text: &str) -> Vec<Fate> {
    #[derive(Deserialize)]
    struct Written {
        #[serde(default)]
        links: LinksConfig,
        #[serde(default)]
        degrade: Vec<Degrade>,
    }
    let written: Written = toml::from_str(text).unwrap();
    run(seed, sends, to, |sim, a, hosts| {
        let mut wiring = Wiring::default();
        let builder = LinkBuilder::new(&written.links, &written.degrade).unwrap();
        for (host, name) in hosts.iter().zip(to) {
            wiring.link((a, "a"), (*host, name));
        }
        builder.build(sim, &wiring).unwrap();
    })
}

/// What becomes of traffic over one link.
fn over(seed: u64, sends: &[Send], link: Link) -> Vec<Fate> {
    run(seed, sends, &["b"], |sim, a, hosts| {
        sim.link(a, hosts[0], "a-b", link);
    })
}

/// Parameters from a line of TOML.
fn params(text: &str) -> LinkParams {
    toml::from_str(text).unwrap()
}

fn ms(ms: u64) -> SimDuration {
    SimDuration::from_millis(ms)
}

/// Sends `count` empty probes, one each 10 ms, over a link built from this scenario text.
fn fates(seed: u64, count: u32, links: &str, degrades: &str) -> Vec<Fate> {
    let text = format!("[links]\n{links}\n{degrades}");
    scenario(seed, &each(ms(10), count, 0), &["b"], &text)
}

/// The messages that arrive, by arrival.
fn arrived(fates: &[Fate]) -> Vec<&Fate> {
    fates.iter().filter(|fate| fate.reason.is_empty()).collect()
}

fn lost(fates: &[Fate]) -> BTreeSet<u64> {
    let lost = fates.iter().filter(|fate| !fate.reason.is_empty());
    lost.map(|fate| fate.ordinal).collect()
}

#[test]
fn loss_and_duplication_meet_their_rates() {
    let n = 20_000;
    let seen = fates(1, n, "default = { loss = 0.2, duplicate = 0.1 }", "");
    let copies = seen.len() as f64;
    // Three standard deviations of a binomial.
    let duplicated = copies - f64::from(n);
    assert!((duplicated - 2_000.0).abs() < 3.0 * (2_000.0f64 * 0.9).sqrt());
    let share = seen.iter().filter(|fate| fate.reason == LOSS).count() as f64 / copies;
    assert!(
        (share - 0.2).abs() < 3.0 * (0.2 * 0.8 / copies).sqrt(),
        "{share}"
    );
}

#[test]
fn uniform_jitter_fills_its_interval_and_no_more() {
    let seen = fates(
        2,
        20_000,
        "default = { latency = '50ms', jitter = '20ms' }",
        "",
    );
    let delays_ms: Vec<f64> = seen.iter().map(|f| f.delay.as_secs_f64() * 1e3).collect();
    let mean = delays_ms.iter().sum::<f64>() / delays_ms.len() as f64;
    assert!(delays_ms.iter().all(|d| (30.0..=70.0).contains(d)));
    assert!(delays_ms.iter().any(|d| *d < 30.1) && delays_ms.iter().any(|d| *d > 69.9));
    // The standard deviation of the mean is 20 / sqrt(3 n).
    assert!((mean - 50.0).abs() < 0.25, "{mean}");
}

#[test]
fn normal_jitter_has_its_moments_and_is_cut() {
    let links = "default = { latency = '50ms', jitter = '10ms', jitter_shape = 'normal' }";
    let seen = fates(3, 20_000, links, "");
    let delays_ms: Vec<f64> = seen.iter().map(|f| f.delay.as_secs_f64() * 1e3).collect();
    let mean = delays_ms.iter().sum::<f64>() / delays_ms.len() as f64;
    let variance = delays_ms
        .iter()
        .map(|d| (d - mean) * (d - mean))
        .sum::<f64>()
        / delays_ms.len() as f64;
    assert!(delays_ms.iter().all(|d| (20.0..=80.0).contains(d)));
    assert!((mean - 50.0).abs() < 0.3, "{mean}");
    assert!((variance.sqrt() - 10.0).abs() < 0.3, "{variance}");
}

#[test]
fn a_floor_holds_against_wide_jitter() {
    let links = "default = { latency = '5ms', jitter = '9ms', min_delay = '2ms' }";
    let seen = fates(4, 2_000, links, "");
    let floor = SimDuration::from_millis(2);
    assert!(seen.iter().all(|fate| fate.delay >= floor));
    assert!(seen.iter().any(|fate| fate.delay == floor));
}

#[test]
fn degradations_begin_end_and_overlap() {
    let degrades = "
        [[degrade]]
        at = '1s'
        until = '3s'
        links = 'a-*'
        latency = '1ms'
        [[degrade]]
        at = '2s'
        until = '4s'
        links = '*'
        outage = true
        [[degrade]]
        at = '2500ms'
        until = '2600ms'
        links = 'a-b'
        outage = false
    ";
    let seen = fates(5, 500, "default = { latency = '5ms' }", degrades);
    for fate in &seen {
        let sent_ms = fate.sent.as_nanos() / 1_000_000;
        let delay_ms = fate.delay.as_nanos() / 1_000_000;
        let (reason, expected_ms) = match sent_ms {
            1000..2000 | 2500..2600 => ("", 1),
            2000..4000 => (OUTAGE, 0),
            _ => ("", 5),
        };
        assert_eq!(
            (fate.reason, delay_ms),
            (reason, expected_ms),
            "sent at {sent_ms} ms"
        );
    }
}

#[test]
fn the_last_pattern_in_the_file_wins() {
    let links = "
        'a-b' = { loss = 1.0, latency = '7ms' }
        '*-b' = { loss = 0.0 }
    ";
    let seen = fates(6, 10, links, "");
    assert!(seen.iter().all(|fate| fate.reason.is_empty()));
    assert!(
        seen.iter()
            .all(|fate| fate.delay == SimDuration::from_millis(7))
    );
}

#[test]
fn mistakes_are_refused_with_their_place() {
    let build = |degrade: &str| {
        let degrade: Degrade = toml::from_str(degrade).unwrap();
        LinkBuilder::new(&LinksConfig::default(), &[degrade])
            .err()
            .unwrap()
    };
    let error = build("at = '9s'\nuntil = '3s'\nlinks = '*'\noutage = true");
    assert_eq!(error.key(), ["degrade", "0", "until"]);
    assert!(error.to_string().contains("expected a time after \"9s\""));
    let error = build("at = '9s'\nlinks = '*'");
    assert!(error.to_string().contains("changes nothing"));
    let error = build("at = '9s'\nlinks = '[z-a'\nloss = 1");
    assert_eq!(error.key(), ["degrade", "0", "links"]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn no_delay_undercuts_what_the_link_declares(
        seed: u64, latency in 0..5_000_000u64, jitter in 0..9_000_000u64, normal: bool,
        floor in proptest::option::of(0..3_000_000u64),
    ) {
        let params = LinkParams {
            latency: SimDuration::from_nanos(latency),
            jitter: SimDuration::from_nanos(jitter),
            jitter_shape: if normal { JitterShape::Normal } else { JitterShape::Uniform },
            least_delay: floor.map(SimDuration::from_nanos),
            ..LinkParams::default()
        };
        let links = LinksConfig { default: params.clone(), ..LinksConfig::default() };
        // A delay below the declared one would be a fault, which `fates` refuses.
        let seen = fates(seed, 50, &toml::to_string(&links).unwrap(), "");
        prop_assert!(seen.iter().all(|fate| fate.delay >= params.min_delay()));
    }

    #[test]
    fn a_links_table_prints_back_to_itself(loss in 0.0..=1.0f64, nanos: u64) {
        let over = LinkOverrides {
            loss: Some(loss),
            latency: Some(SimDuration::from_nanos(nanos)),
            ..LinkOverrides::default()
        };
        let patterns = ["z-*", "a-*"].map(|pattern| (pattern.to_owned(), over.clone()));
        let links = LinksConfig { default: LinkParams::default(), patterns: patterns.to_vec() };
        let text = toml::to_string(&links).unwrap();
        prop_assert_eq!(toml::from_str::<LinksConfig>(&text).unwrap(), links);
    }
}
