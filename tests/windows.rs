//! Windows of the parallel executor: however much happens in one, it is committed in order, it takes
//! bounded memory, and an interrupt or a failing observer ends it between two events.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass};
use farside::{End, FaultCause};
use farside_tests::executors::{WAYS, agreed};
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
struct Tick;

#[derive(Serialize, Deserialize)]
struct News {
    ticks: u64,
}

/// Ticks every so often, and tells a neighbour now and then.
struct Ticker {
    every: SimDuration,
    ticks: u64,
    fails_at: u64,
    /// How many ticks all of them had.
    total: Arc<AtomicU64>,
}

impl Actor for Ticker {
    type Accepts = (Tick, News);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(self.every, Tick);
        Ok(())
    }
}

impl Handler<Tick> for Ticker {
    fn handle(&mut self, _tick: Tick, ctx: &mut Context<'_, Self>) -> Outcome {
        self.ticks += 1;
        self.total.fetch_add(1, Ordering::Relaxed);
        if self.ticks == self.fails_at {
            return Err(HandlerError::new("so many are enough"));
        }
        if self.ticks.is_multiple_of(1_000) {
            let other = ctx.lookup::<Ticker>(if ctx.name() == "a" { "b" } else { "a" })?;
            ctx.send(other, News { ticks: self.ticks });
        }
        ctx.timer(self.every, Tick);
        Ok(())
    }
}

impl Handler<News> for Ticker {
    fn handle(&mut self, news: News, _ctx: &mut Context<'_, Self>) -> Outcome {
        self.ticks += news.ticks % 3;
        Ok(())
    }
}

/// Two tickers whose windows have very many events: one every 10 ns and one every 70, joined by links
/// of a millisecond.
#[derive(Clone, Default)]
struct Model {
    fails_at: u64,
    shared: bool,
    total: Arc<AtomicU64>,
}

impl Model {
    fn build(&self, heavy: bool) -> Simulation {
        let mut sim = Simulation::new(1);
        let hosts = ["a", "b"].map(|name| sim.host(name));
        for host in hosts.into_iter().filter(|_| heavy) {
            sim.heavy(host);
        }
        for (name, host, every, fails_at) in [("a", 0, 10, 0), ("b", 1, 70, self.fails_at)] {
            let total = self.total.clone();
            sim.actor(hosts[host], name, move |_| Ticker {
                every: SimDuration::from_nanos(every),
                ticks: 0,
                fails_at,
                total: total.clone(),
            });
        }
        let wire = || FixedDelay::new(SimDuration::from_millis(1));
        if self.shared {
            let medium = sim.shared_link("medium", wire());
            sim.route(hosts[0], hosts[1], medium);
            sim.route(hosts[1], hosts[0], medium);
        } else {
            sim.link(hosts[0], hosts[1], "a-b", wire());
            sim.link(hosts[1], hosts[0], "b-a", wire());
        }
        // Two windows and a half.
        sim.stop_at(SimTime::from_nanos(2_500_000), "long enough");
        sim
    }
}

#[test]
fn windows_of_very_many_events_give_the_same_report() {
    for shared in [false, true] {
        for fails_at in [0, 20_000] {
            let model = Model {
                fails_at,
                shared,
                ..Model::default()
            };
            let report = agreed(|heavy| model.build(heavy)).expect("it can start");
            let expected = if fails_at == 0 { "stopped" } else { "fault" };
            assert_eq!(report.end.name(), expected);
            assert!(report.counts.events > 150_000, "{:?}", report.counts);
        }
    }
}

/// Looks at how far ahead of what it is shown handlers are, and fails or interrupts at a record.
struct Watcher {
    records: u64,
    ticks: u64,
    total: Arc<AtomicU64>,
    furthest: Arc<AtomicU64>,
    fails_at: u64,
    interrupts: Option<(u64, Arc<AtomicBool>)>,
}

impl Observer for Watcher {
    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        self.records += 1;
        self.ticks += u64::from(record.class == RecordClass::Timer);
        let ahead = self.total.load(Ordering::Relaxed) - self.ticks;
        self.furthest.fetch_max(ahead, Ordering::Relaxed);
        if let Some((at, flag)) = &self.interrupts
            && self.records == *at
        {
            flag.store(true, Ordering::Relaxed);
        }
        match self.records == self.fails_at {
            true => Err(ObserverError("the disk is full".to_owned())),
            false => Ok(Flow::Continue),
        }
    }
}

/// What a watched run reports, and how many events were handled ahead of what was committed.
fn watched(heavy: bool, executor: Executor, fails_at: u64, interrupts: u64) -> (Report, u64) {
    let model = Model::default();
    let mut sim = model.build(heavy);
    let furthest = Arc::<AtomicU64>::default();
    let flag = sim.interrupt();
    sim.observe(Watcher {
        records: 0,
        ticks: 0,
        total: model.total.clone(),
        furthest: furthest.clone(),
        fails_at,
        interrupts: (interrupts > 0).then_some((interrupts, flag)),
    });
    let report = sim.run(executor).expect("it can start");
    (report, furthest.load(Ordering::Relaxed))
}

#[test]
fn a_window_takes_bounded_memory() {
    for (executor, heavy) in WAYS {
        let (report, furthest) = watched(heavy, executor, 0, 0);
        assert_eq!(report.end.name(), "stopped");
        // 114,000 events in a window, of which no more than two engines' worth wait.
        assert!(furthest <= 20_000, "{executor:?}: {furthest} events waited");
    }
}

#[test]
fn an_observer_that_fails_ends_a_window_between_two_events() {
    for fails_at in [1, 2, 77, 50_000, 180_001] {
        let [first, others @ ..] = WAYS.map(|(executor, heavy)| {
            let (report, _) = watched(heavy, executor, fails_at, 0);
            assert_eq!(
                report.end,
                End::ObserverFailed("the disk is full".to_owned())
            );
            report
        });
        for other in others {
            assert_eq!(first, other, "at record {fails_at}");
        }
    }
}

#[test]
fn an_interrupt_ends_a_window_between_two_events() {
    for at in [1, 50_000, 180_001] {
        let reports = WAYS.map(|(executor, heavy)| watched(heavy, executor, 0, at).0);
        for report in &reports {
            assert_eq!(report.end, End::Interrupted);
            // Raised while a record was committed, it is heeded before the next event.
            assert_eq!(*report, reports[0], "at record {at}");
        }
    }
}

/// An interrupt from outside is heeded long before a window of a year is over.
#[test]
fn a_window_without_end_can_be_interrupted() {
    for (executor, heavy) in WAYS {
        let total = Arc::<AtomicU64>::default();
        let mut sim = Simulation::new(1);
        let hosts = ["a", "b"].map(|name| sim.host(name));
        for host in hosts.into_iter().filter(|_| heavy) {
            sim.heavy(host);
        }
        for (name, host) in [("a", hosts[0]), ("b", hosts[1])] {
            let total = total.clone();
            let flag = sim.interrupt();
            sim.actor(host, name, move |_| Endless {
                total: total.clone(),
                flag: flag.clone(),
            });
        }
        let year = FixedDelay::new(SimDuration::from_secs(365 * 86_400));
        sim.link(hosts[0], hosts[1], "a-b", year);
        let report = sim.run(executor).expect("it can start");
        assert_eq!(report.end, End::Interrupted, "{executor:?}");
        // Each engine ends the event that it has in hand; a thread may see the flag a little later.
        let handled = total.load(Ordering::Relaxed);
        assert!(handled < 101_000, "{executor:?}: {handled} ticks");
    }
}

/// Ticks each nanosecond; at the hundred thousandth tick somebody presses Ctrl-C.
struct Endless {
    total: Arc<AtomicU64>,
    flag: Arc<AtomicBool>,
}

impl Actor for Endless {
    type Accepts = (Tick,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_nanos(1), Tick);
        Ok(())
    }
}

impl Handler<Tick> for Endless {
    fn handle(&mut self, _tick: Tick, ctx: &mut Context<'_, Self>) -> Outcome {
        if self.total.fetch_add(1, Ordering::Relaxed) == 100_000 {
            self.flag.store(true, Ordering::Relaxed);
        }
        ctx.timer(SimDuration::from_nanos(1), Tick);
        Ok(())
    }
}

/// Sends a message around between three actors, without delay: within a host, over links of no delay,
/// over a shared one.
struct Loop {
    to: &'static str,
    loud: bool,
}

impl Actor for Loop {
    type Accepts = (News,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        if self.loud {
            let to = ctx.lookup::<Loop>(self.to)?;
            ctx.send(to, News { ticks: 0 });
        }
        Ok(())
    }
}

impl Handler<News> for Loop {
    fn handle(&mut self, news: News, ctx: &mut Context<'_, Self>) -> Outcome {
        let to = ctx.lookup::<Loop>(self.to)?;
        ctx.send(
            to,
            News {
                ticks: news.ticks + 1,
            },
        );
        Ok(())
    }
}

#[derive(Clone, Copy, Debug)]
enum Way {
    OneHost,
    Links,
    Shared,
}

fn ring(way: Way, limit: u32, heavy: bool) -> Simulation {
    let mut sim = Simulation::new(1);
    let names = ["a", "b", "c"];
    let host_of = |name: &str| {
        if matches!(way, Way::OneHost) {
            "a".to_owned()
        } else {
            name.to_owned()
        }
    };
    let hosts = names.map(|name| sim.host(&host_of(name)));
    for host in hosts.into_iter().filter(|_| heavy) {
        sim.heavy(host);
    }
    // Somebody beside it whose hops have nothing to do with the loop.
    let aside = sim.host("z");
    if heavy {
        sim.heavy(aside);
    }
    sim.actor(aside, "z/1", |_| Loop {
        to: "z/2",
        loud: true,
    });
    sim.actor(aside, "z/2", |_| Loop {
        to: "z/1",
        loud: false,
    });
    for (at, name) in names.into_iter().enumerate() {
        let to = names[(at + 1) % 3];
        sim.actor(hosts[at], name, move |_| Loop {
            to,
            loud: name == "a",
        });
    }
    match way {
        Way::OneHost => {
            let wire = FixedDelay::new(SimDuration::from_millis(1));
            sim.link(hosts[0], aside, "a-z", wire);
        }
        Way::Links => {
            for (at, name) in ["a-b", "b-c", "c-a"].into_iter().enumerate() {
                let wire = FixedDelay::new(SimDuration::ZERO);
                sim.link(hosts[at], hosts[(at + 1) % 3], name, wire);
            }
        }
        Way::Shared => {
            let medium = sim.shared_link("medium", FixedDelay::new(SimDuration::ZERO));
            for at in 0..3 {
                sim.route(hosts[at], hosts[(at + 1) % 3], medium);
            }
        }
    }
    sim.step_limit(limit);
    sim
}

#[test]
fn too_many_hops_are_told_alike_by_all_executors() {
    for way in [Way::OneHost, Way::Links, Way::Shared] {
        for limit in [0, 1, 3, 8, 100] {
            let report = agreed(|heavy| ring(way, limit, heavy)).expect("it can start");
            let fault = report.fault().expect("a fault");
            let FaultCause::StepLimit { chain, .. } = &fault.cause else {
                panic!("{way:?} {limit}: {fault}");
            };
            let expected = (limit as usize + 1).min(8);
            assert_eq!(chain.len(), expected, "{way:?} {limit}: {chain:?}");
            // Each is the cause of the next: who received it sends on.
            for pair in chain.windows(2) {
                let to = pair[0]
                    .split(" -> ")
                    .nth(1)
                    .expect("sender -> receiver (kind)");
                let to = to.trim_end_matches(" (News)");
                let from = pair[1].split(" -> ").next().expect("a sender");
                let handed_over = to == "medium";
                assert!(handed_over || to == from, "{way:?} {limit}: {chain:?}");
            }
        }
    }
}
