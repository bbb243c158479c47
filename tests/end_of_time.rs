//! Times near the end of the clock: what would be later than its last nanosecond never happens, and
//! nobody is blamed for it.

use farside::prelude::*;
use farside::{Carrier, Parcel, Verdicts};
use farside_tests::executors::agreed;
use proptest::prelude::*;
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
struct Call;

/// Sends itself a timer and a neighbour a message, from time to time.
struct Caller {
    every: SimDuration,
    other: &'static str,
}

impl Actor for Caller {
    type Accepts = (Call,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(self.every, Call);
        Ok(())
    }
}

impl Handler<Call> for Caller {
    fn handle(&mut self, _call: Call, ctx: &mut Context<'_, Self>) -> Outcome {
        let other = ctx.lookup::<Hearer>(self.other)?;
        ctx.send(other, Call);
        ctx.timer(self.every, Call);
        Ok(())
    }
}

struct Hearer;

impl Actor for Hearer {
    type Accepts = (Call,);
}

impl Handler<Call> for Hearer {
    fn handle(&mut self, _call: Call, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

/// Delivers at a time on the clock, as links do that count from when they are free again.
struct UntilThen {
    delay: SimDuration,
}

impl Carrier for UntilThen {
    type Change = Call;

    fn min_delay(&self) -> SimDuration {
        self.delay
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        let arrival = parcel.now() + self.delay;
        verdicts.deliver(arrival.since(parcel.now()));
    }

    fn change(&mut self, _change: Call, _now: SimTime) {}
}

#[derive(Clone, Debug)]
struct Late {
    every: u64,
    delay: u64,
    restart: Option<u64>,
    heavy: bool,
    stop: Option<u64>,
}

impl Late {
    fn run(&self, executor: Executor) -> Report {
        let mut sim = Simulation::new(1);
        let (a, b) = (sim.host("a"), sim.host("b"));
        if self.heavy {
            sim.heavy(a);
            sim.heavy(b);
        }
        let every = SimDuration::from_nanos(self.every);
        let caller = sim.actor(a, "a", move |_| Caller { every, other: "b" });
        sim.actor(b, "b", |_| Hearer);
        let delay = SimDuration::from_nanos(self.delay);
        sim.link(a, b, "a-b", UntilThen { delay });
        if let Some(restart) = self.restart {
            sim.restart_at(SimTime::from_nanos(restart), caller);
        }
        if let Some(stop) = self.stop {
            sim.stop_at(SimTime::from_nanos(stop), "enough");
        }
        sim.run(executor).expect("the model can start")
    }
}

/// From a sixteenth of the clock on, and often right at its end.
fn long() -> impl Strategy<Value = u64> {
    prop_oneof![
        u64::MAX / 16..=u64::MAX,
        u64::MAX - 3..=u64::MAX,
        Just(u64::MAX)
    ]
}

prop_compose! {
    fn late()(
        every in long(),
        delay in prop_oneof![long(), 1u64..4],
        restart in prop::option::of(long()),
        heavy in any::<bool>(),
        stop in prop::option::of(long()),
    ) -> Late {
        Late { every, delay, restart, heavy, stop }
    }
}

proptest! {
    #[test]
    fn what_would_be_later_than_the_clock_never_happens(model in late()) {
        let report = model.run(Executor::Inline);
        prop_assert_eq!(report.fault(), None);
        prop_assert!(report.end_time < SimTime::MAX);
        prop_assert_eq!(&report, &model.run(Executor::Kameo { threads: 2 }));
        // Without restarts the caller calls at each whole multiple of its period that is on the
        // clock, and is heard if the delay ends on the clock as well.
        if model.restart.is_none() && model.stop.is_none() {
            let last = u128::from(u64::MAX) - 1;
            let (every, delay) = (u128::from(model.every), u128::from(model.delay));
            let sent = last / every;
            let heard = last.saturating_sub(delay) / every;
            prop_assert_eq!(u128::from(report.counts.sent), sent);
            prop_assert_eq!(u128::from(report.counts.delivered), heard.min(sent));
            prop_assert_eq!(u128::from(report.counts.in_flight), sent - heard.min(sent));
        }
    }
}

/// Asks for a stop at the last instant at which anything happens, or shortly before.
struct Stopper {
    at: SimDuration,
}

impl Actor for Stopper {
    type Accepts = (Call,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(self.at, Call);
        Ok(())
    }
}

impl Handler<Call> for Stopper {
    fn handle(&mut self, _call: Call, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.stop("it is late");
        ctx.timer(self.at, Call);
        Ok(())
    }
}

#[test]
fn who_asks_for_a_stop_is_heard_at_the_end_of_the_clock_too() {
    for before in [1, 2, 4, 5, 6] {
        let at = SimDuration::from_nanos(u64::MAX - before);
        let report = agreed(|heavy| {
            let mut sim = Simulation::new(1);
            let hosts = ["a", "b"].map(|name| sim.host(name));
            for host in hosts.into_iter().filter(|_| heavy) {
                sim.heavy(host);
            }
            sim.actor(hosts[0], "a", move |_| Stopper { at });
            sim.actor(hosts[1], "b", |_| Hearer);
            sim.link(
                hosts[0],
                hosts[1],
                "a-b",
                UntilThen {
                    delay: SimDuration::from_nanos(5),
                },
            );
            sim.link(
                hosts[1],
                hosts[0],
                "b-a",
                UntilThen {
                    delay: SimDuration::from_nanos(5),
                },
            );
            sim
        });
        let report = report.expect("it can start");
        assert_eq!(report.end.name(), "stopped", "{:?}", report.end);
        assert!(report.end_time < SimTime::MAX);
    }
}

/// Sets all its timers at the start.
struct Patient {
    delays_ns: Vec<u64>,
}

impl Actor for Patient {
    type Accepts = (Call,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        for delay_ns in &self.delays_ns {
            ctx.timer(SimDuration::from_nanos(*delay_ns), Call);
        }
        Ok(())
    }
}

impl Handler<Call> for Patient {
    fn handle(&mut self, _call: Call, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

/// Enough events to be spread over buckets, which are as wide as the clock is long, or end with it.
#[test]
fn many_timers_fire_up_to_the_end_of_the_clock() {
    let soon = || (0..150).map(|at| 1_000 + at);
    let never = std::iter::repeat_n(u64::MAX, 150);
    let last = (0..150).map(|at| u64::MAX - 1 - at % 7);
    let few = [1 << 20, 1 << 40, (1 << 63) + 5, u64::MAX - 1];
    for (late, fire) in [
        (Vec::from(few), 4),
        (never.clone().collect(), 0),
        (last.clone().collect(), 150),
        (few.into_iter().chain(never).chain(last).collect(), 154),
    ] {
        let delays_ns: Vec<u64> = soon().chain(late).collect();
        let report = agreed(|heavy| {
            let mut sim = Simulation::new(1);
            let hosts = ["a", "b"].map(|name| sim.host(name));
            for (host, name) in hosts.into_iter().zip(["a", "b"]) {
                if heavy {
                    sim.heavy(host);
                }
                let delays_ns = delays_ns.clone();
                sim.actor(host, name, move |_| Patient {
                    delays_ns: delays_ns.clone(),
                });
            }
            sim
        });
        let report = report.expect("it can start");
        assert_eq!(report.end.name(), "completed");
        assert_eq!(report.counts.events, 2 * (1 + 150 + fire));
    }
}

#[test]
fn a_delay_past_the_clock_undercuts_nothing() {
    let model = Late {
        every: u64::MAX / 2,
        delay: u64::MAX - 5,
        restart: None,
        heavy: false,
        stop: None,
    };
    let report = model.run(Executor::Inline);
    assert_eq!(report.end.name(), "completed");
    assert_eq!((report.counts.sent, report.counts.in_flight), (2, 2));
}
