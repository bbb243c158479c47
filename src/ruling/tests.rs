//! Rulings against links that deliver, lose, hold and copy.

use std::sync::{Arc, Mutex};

use proptest::prelude::*;
use serde::{Deserialize, Serialize};

use super::*;
use crate::carrier::{Carrier, NoChange, Parcel, Verdicts};
use crate::prelude::*;
use crate::record::{Record, RecordClass};

#[derive(Serialize, Deserialize)]
struct Ping;

struct Sink;
impl Actor for Sink {
    type Accepts = (Ping,);
}
impl Handler<Ping> for Sink {
    fn handle(&mut self, _: Ping, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

#[derive(Serialize, Deserialize)]
struct Again(u32);

/// Sends a message each second, with a key for each second one.
struct Source(Address<Sink>);
impl Actor for Source {
    type Accepts = (Again,);
    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_secs(1), Again(0));
        Ok(())
    }
}
impl Handler<Again> for Source {
    fn handle(&mut self, Again(sent): Again, ctx: &mut Context<'_, Self>) -> Outcome {
        match sent % 2 {
            0 => ctx.send(self.0, Ping),
            _ => ctx.send_keyed(self.0, MatchKey::new(sent / 4, 0), Ping),
        }
        if sent < 19 {
            ctx.timer(SimDuration::from_secs(1), Again(sent + 1));
        }
        Ok(())
    }
}

/// What a link does with the message of this ordinal.
#[derive(Clone, Copy, Debug)]
enum Does {
    Delivers,
    Loses,
    HoldsThenLoses,
    DeliversTwice,
    LosesUnlessSpared,
}

struct Link(Vec<Does>);
impl Carrier for Link {
    type Change = NoChange;

    fn min_delay(&self) -> SimDuration {
        SimDuration::from_millis(5)
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        let delay = SimDuration::from_millis(20);
        match self.0[parcel.ordinal() as usize] {
            Does::Delivers => verdicts.deliver(delay),
            Does::Loses => verdicts.lose("loss"),
            Does::HoldsThenLoses if parcel.token().is_none() => verdicts.hold(delay, 1),
            Does::HoldsThenLoses => verdicts.lose("loss"),
            Does::DeliversTwice => {
                verdicts.deliver(delay);
                verdicts.deliver(delay * 2);
            }
            Does::LosesUnlessSpared if parcel.is_spared(0) => verdicts.deliver(delay),
            Does::LosesUnlessSpared => verdicts.lose("loss"),
        }
    }

    fn change(&mut self, _: NoChange, _: SimTime) {}
}

/// What became of a copy: its ordinal, its number, its time \[ms\], and why it was lost.
type Fate = (u64, u32, u64, &'static str);

fn run(does: &[Does], rules: &[(&str, Ruling)], executor: Executor) -> (Vec<Fate>, Report) {
    let mut sim = Simulation::new(1);
    let (a, b) = (sim.host("a"), sim.host("b"));
    sim.heavy(a);
    sim.heavy(b);
    let sink = sim.actor(b, "sink", |_| Sink);
    sim.actor(a, "source", move |_| Source(sink));
    sim.link(a, b, "a-b", Link(does.to_vec()));
    for (id, ruling) in rules {
        sim.rule(id.parse().unwrap(), *ruling);
    }
    let fates = Arc::new(Mutex::new(Vec::new()));
    let seen = fates.clone();
    sim.observe(move |record: &Record<'_>| {
        if matches!(record.class, RecordClass::Delivered | RecordClass::Lost) {
            let ms = record.time().as_nanos() / 1_000_000;
            let fate = (record.ordinal, record.copy, ms, record.reason);
            seen.lock().unwrap().push(fate);
        }
    });
    let report = sim.run(executor).unwrap();
    let mut fates = std::mem::take(&mut *fates.lock().unwrap());
    fates.sort_unstable();
    (fates, report)
}

fn does() -> impl Strategy<Value = Does> {
    prop_oneof![
        Just(Does::Delivers),
        Just(Does::Loses),
        Just(Does::HoldsThenLoses),
        Just(Does::DeliversTwice),
        Just(Does::LosesUnlessSpared),
    ]
}

/// Whatever name each uses, the one that is declared later decides, and the other says that it does not.
#[test]
fn of_two_that_contradict_each_other_the_later_decides() {
    let deliver = Ruling::Deliver {
        after: SimDuration::ZERO,
    };
    // The message of ordinal 1 has the key 0.0.
    let names = ["source,sink,Ping,1", "source,sink,Ping,0.0"];
    for does in [Does::Delivers, Does::Loses, Does::LosesUnlessSpared] {
        for (one, other) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            for (first, second, arrives) in [
                (Ruling::Lose, deliver, true),
                (deliver, Ruling::Lose, false),
            ] {
                let rules = [(names[one], first), (names[other], second)];
                let (fates, report) = run(&[does; 20], &rules, Executor::Inline);
                let fate = fates.iter().find(|fate| fate.0 == 1).unwrap();
                assert_eq!(fate.3.is_empty(), arrives, "{does:?} {rules:?}");
                assert_eq!(
                    report.rulings[0],
                    RulingEnd::Overruled,
                    "{does:?} {rules:?}"
                );
                assert_ne!(
                    report.rulings[1],
                    RulingEnd::Overruled,
                    "{does:?} {rules:?}"
                );
            }
        }
    }
}

proptest! {
    /// A ruling changes the message that it names and no other, alike on both executors; and says what
    /// came of it.
    #[test]
    fn a_ruling_is_on_one_message(
        does in prop::collection::vec(does(), 20),
        ordinal in 0_u64..22,
        copy in 0_u32..3,
        which in 0_usize..3,
    ) {
        let id = match copy {
            0 => format!("source,sink,Ping,{ordinal}"),
            copy => format!("source,sink,Ping,{ordinal}+{copy}"),
        };
        let by = SimDuration::from_millis(7);
        let ruling = [Ruling::Lose, Ruling::Deliver { after: by }, Ruling::Delay(by)][which];
        let (before, _) = run(&does, &[], Executor::Inline);
        let (after, report) = run(&does, &[(&id, ruling)], Executor::Inline);
        let (side_by_side, other) = run(&does, &[(&id, ruling)], Executor::Kameo { threads: 2 });
        prop_assert_eq!((&after, &report), (&side_by_side, &other));
        let is_other = |fate: &&Fate| (fate.0, fate.1) != (ordinal, copy);
        let others = |fates: &[Fate]| fates.iter().filter(is_other).copied().collect::<Vec<_>>();
        prop_assert_eq!(others(&before), others(&after));
        let of = |fates: &[Fate]| fates.iter().find(|fate| !is_other(fate)).copied();
        let expected = match (of(&before), ruling) {
            (None, _) => None,
            (Some((o, c, ms, "")), Ruling::Lose) => Some((o, c, ms, RULED)),
            (Some((o, c, ms, "")), Ruling::Delay(_)) => Some((o, c, ms + 7, "")),
            (Some((o, c, ms, "loss")), Ruling::Deliver { .. }) => match does[o as usize] {
                Does::LosesUnlessSpared => Some((o, c, ms + 20, "")),
                _ => Some((o, c, ms + 7, "")),
            },
            (Some(same), _) => Some(same),
        };
        prop_assert_eq!(of(&after), expected);
        let end = match of(&before) {
            None => RulingEnd::NeverMet,
            before if before == expected => RulingEnd::WithoutEffect,
            _ => RulingEnd::Applied,
        };
        prop_assert_eq!(&report.rulings, &[end]);
    }
}
