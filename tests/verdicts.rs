//! What links decide has to make sense: each copy has one fate, a loss has a reason, the parts of a
//! delay are the delay. A link that breaks that is named, by every executor alike.

use farside::prelude::*;
use farside::{Carriage, Carrier, FaultCause, Parcel, Verdicts};
use farside_tests::executors::agreed;
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
struct Ping {
    number: u32,
}

struct Source;

impl Actor for Source {
    type Accepts = (Ping,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_secs(1), Ping { number: 0 });
        Ok(())
    }
}

impl Handler<Ping> for Source {
    fn handle(&mut self, ping: Ping, ctx: &mut Context<'_, Self>) -> Outcome {
        let sink = ctx.recipient::<Ping>("b/sink")?;
        let number = ping.number;
        ctx.send(sink, Ping { number });
        if number < 9 {
            ctx.timer(SimDuration::from_secs(1), Ping { number: number + 1 });
        }
        Ok(())
    }
}

struct Sink;

impl Actor for Sink {
    type Accepts = (Ping,);
}

impl Handler<Ping> for Sink {
    fn handle(&mut self, _ping: Ping, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

const DELAY: SimDuration = SimDuration::from_millis(10);

/// Decides as it is told: `first` of the fourth message, `again` once it was held.
#[derive(Clone, Copy)]
struct Odd {
    first: fn(&mut Verdicts),
    again: fn(&mut Verdicts),
}

impl Carrier for Odd {
    type Change = farside::carrier::NoChange;

    fn min_delay(&self) -> SimDuration {
        DELAY
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        match (parcel.token(), parcel.ordinal()) {
            (Some(_), _) => (self.again)(verdicts),
            (None, 3) => (self.first)(verdicts),
            _ => verdicts.deliver(DELAY),
        }
    }

    fn change(&mut self, _change: farside::carrier::NoChange, _now: SimTime) {}
}

/// The report of ten messages over such a link, an own and a shared one.
fn reports(odd: Odd) -> [Report; 2] {
    [false, true].map(|shared| {
        agreed(|heavy| {
            let mut sim = Simulation::new(1);
            let hosts = ["a", "b"].map(|name| sim.host(name));
            for host in hosts.into_iter().filter(|_| heavy) {
                sim.heavy(host);
            }
            sim.actor(hosts[0], "a/source", |_| Source);
            sim.actor(hosts[1], "b/sink", |_| Sink);
            if shared {
                let link = sim.shared_link("a-b", odd);
                sim.route(hosts[0], hosts[1], link);
            } else {
                sim.link(hosts[0], hosts[1], "a-b", odd);
            }
            sim
        })
        .expect("it can start")
    })
}

fn fault(odd: Odd) -> FaultCause {
    let faults = reports(odd).map(|report| {
        assert_eq!(report.counts.delivered, 3);
        let fault = report.fault().expect("a fault");
        assert_eq!(fault.actor, "a-b");
        fault.cause.clone()
    });
    let [own, shared] = faults;
    assert_eq!(own, shared);
    own
}

fn told(parts: SimDuration) -> Carriage {
    Carriage {
        propagation: parts,
        attempts: 1,
        ..Carriage::default()
    }
}

const NEVER: fn(&mut Verdicts) = |_| unreachable!("nothing is held");

#[test]
fn a_copy_has_one_fate() {
    let two_fates = |copy| FaultCause::TwoFates {
        link: "a-b".to_owned(),
        copy,
        kind: "Ping".to_owned(),
        sender: "a/source".to_owned(),
    };
    let hold: fn(&mut Verdicts) = |verdicts| verdicts.hold(DELAY, 7);
    let twice: [fn(&mut Verdicts); 5] = [
        |verdicts| {
            verdicts.deliver(DELAY);
            verdicts.deliver(DELAY);
        },
        |verdicts| {
            verdicts.deliver(DELAY);
            verdicts.lose("loss");
        },
        |verdicts| {
            verdicts.lose("loss");
            verdicts.hold(DELAY, 8);
        },
        |verdicts| {
            verdicts.deliver(DELAY);
            verdicts.park(None, 8);
        },
        |verdicts| {
            verdicts.deliver(DELAY);
            verdicts.park_another(None, 8, 0);
        },
    ];
    for again in twice {
        assert_eq!(fault(Odd { first: hold, again }), two_fates(0));
    }
    // Not held, verdicts are about one copy each, unless one names its copy.
    let first = |verdicts: &mut Verdicts| {
        verdicts.deliver(DELAY);
        verdicts.deliver(DELAY);
        verdicts.park_another(None, 8, 1);
    };
    assert_eq!(
        fault(Odd {
            first,
            again: NEVER
        }),
        two_fates(1)
    );
    // One copy more with a number of its own is a copy more.
    let again = |verdicts: &mut Verdicts| {
        verdicts.deliver(DELAY);
        verdicts.park_another(None, 8, 1);
    };
    for report in reports(Odd { first: hold, again }) {
        let counts = &report.counts;
        assert_eq!(report.end.name(), "completed");
        assert_eq!(
            (counts.delivered, counts.duplicated, counts.in_flight),
            (10, 1, 1)
        );
    }
}

#[test]
fn a_loss_has_a_reason() {
    let cause = FaultCause::NoReason {
        link: "a-b".to_owned(),
        kind: "Ping".to_owned(),
        sender: "a/source".to_owned(),
    };
    let losses: [fn(&mut Verdicts); 3] = [
        |verdicts| verdicts.lose(""),
        |verdicts| verdicts.lose_after(DELAY, ""),
        |verdicts| verdicts.lose_as(DELAY, "", told(DELAY)),
    ];
    for first in losses {
        assert_eq!(
            fault(Odd {
                first,
                again: NEVER
            }),
            cause
        );
    }
}

#[test]
fn the_parts_of_a_delay_are_the_delay() {
    let too_long = |verdicts: &mut Verdicts| verdicts.deliver_as(DELAY, told(DELAY * 2));
    let cause = |delay, parts| FaultCause::PartsOfDelay {
        link: "a-b".to_owned(),
        delay,
        parts,
    };
    let first = too_long;
    assert_eq!(
        fault(Odd {
            first,
            again: NEVER
        }),
        cause(DELAY, DELAY * 2)
    );
    // Held for 10 ms, it has been on its way for 20.
    let hold: fn(&mut Verdicts) = |verdicts| verdicts.hold(DELAY, 7);
    let forgets = |verdicts: &mut Verdicts| verdicts.deliver_as(DELAY, told(DELAY));
    let odd = Odd {
        first: hold,
        again: forgets,
    };
    assert_eq!(fault(odd), cause(DELAY * 2, DELAY));
    let odd = Odd {
        first: hold,
        again: too_long,
    };
    for report in reports(odd) {
        assert_eq!(report.end.name(), "completed");
    }
}
