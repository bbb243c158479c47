//! Both sides of a register over a network that loses, repeats and reorders.

use std::collections::BTreeMap;

use farside::{SimDuration, SimTime};
use proptest::prelude::*;

use super::*;

const BACKOFF: Backoff = Backoff {
    first: SimDuration::from_millis(2000),
    most: SimDuration::from_millis(16_000),
};

fn name() -> Arc<str> {
    "goal".into()
}

fn at(tick: u64) -> SimTime {
    SimTime::ZERO + SimDuration::from_millis(500 * tick)
}

#[derive(Clone, Debug)]
enum Message {
    Load(RegisterLoad),
    Status(RegisterStatus),
    Ack(RegisterAck),
}

/// What happens to the message of a number, drawn by proptest.
#[derive(Clone, Debug)]
struct Fate {
    lost: bool,
    twice: bool,
    delay_ticks: u64,
}

/// Both sides, the network between them, and what was seen to happen.
struct Pair {
    controlling: Controlling,
    controlled: Controlled,
    fates: Vec<Fate>,
    sent: usize,
    /// By tick of arrival, then in the order of sending.
    under_way: BTreeMap<(u64, usize), Message>,
    /// The numbers of procedures that began, and of those that were carried out, in order.
    begun: Vec<u32>,
    done: Vec<u32>,
    /// The procedure that is being carried out, and when it is over.
    running: Option<(u32, u64)>,
}

impl Pair {
    fn new(fates: Vec<Fate>) -> Self {
        Pair {
            controlling: Controlling::new(name(), 1, BACKOFF),
            controlled: Controlled::new(name(), BACKOFF),
            fates,
            sent: 0,
            under_way: BTreeMap::new(),
            begun: Vec::new(),
            done: Vec::new(),
            running: None,
        }
    }

    fn send(&mut self, message: Message, tick: u64) {
        let fate = self.fates[self.sent % self.fates.len()].clone();
        self.sent += 1;
        if fate.lost {
            return;
        }
        let arrives = (tick + fate.delay_ticks, 2 * self.sent);
        if fate.twice {
            let again = (arrives.0 + 3, arrives.1 + 1);
            self.under_way.insert(again, message.clone());
        }
        self.under_way.insert(arrives, message);
    }

    fn load(&mut self, tick: u64) {
        let load = self.controlling.load("Go".into(), Vec::new(), at(tick));
        self.send(Message::Load(load), tick);
    }

    /// A tick of both sides; what the controlling side heard of the end of its contract.
    fn step(&mut self, tick: u64) -> Option<ContractEnd> {
        let mut end = None;
        while let Some(entry) = self.under_way.first_entry() {
            if entry.key().0 > tick {
                break;
            }
            match entry.remove() {
                Message::Load(load) => self.receive(&load, tick),
                Message::Ack(ack) => {
                    self.controlling.acknowledged(&ack);
                    self.controlled.acknowledged(&ack);
                }
                Message::Status(status) => {
                    if let Heard::News { end: news, .. } = self.controlling.status(&status) {
                        end = Some(news);
                    }
                    self.send(Message::Ack(Controlling::ack(&status)), tick);
                }
            }
        }
        if let Some((number, until)) = self.running
            && until <= tick
        {
            self.running = None;
            self.done.push(number);
            let said = self
                .controlled
                .say(Vec::new(), ContractEnd::Ended, at(tick));
            said.into_iter()
                .for_each(|status| self.send(Message::Status(status), tick));
        }
        if let Some((load, _)) = self.controlling.repeat(at(tick)) {
            self.send(Message::Load(load), tick);
        }
        if let Some((status, _)) = self.controlled.repeat(at(tick)) {
            self.send(Message::Status(status), tick);
        }
        end
    }

    fn receive(&mut self, load: &RegisterLoad, tick: u64) {
        match self.controlled.take(load, at(tick)) {
            Taken::Yes => {
                self.begun.push(load.number);
                self.running = Some((load.number, tick + 4));
                let ack = self.controlled.ack();
                self.send(Message::Ack(ack), tick);
            }
            Taken::Before(said) => {
                let answer = match said {
                    Some(status) => Message::Status(status),
                    None => Message::Ack(self.controlled.ack()),
                };
                self.send(answer, tick);
            }
            Taken::Old | Taken::Early => {}
        }
    }

    fn crash(&mut self, tick: u64) {
        self.running = None;
        let said = self.controlled.restarted(at(tick));
        said.into_iter()
            .for_each(|status| self.send(Message::Status(status), tick));
    }

    /// What must hold at any time.
    fn check(&self) {
        assert!(
            self.begun.is_sorted_by(|a, b| a < b),
            "each once, in order: {:?}",
            self.begun
        );
        assert!(self.done.iter().all(|done| self.begun.contains(done)));
    }
}

fn fates() -> impl Strategy<Value = Vec<Fate>> {
    let fate = |loss: f64| {
        (
            proptest::bool::weighted(loss),
            proptest::bool::weighted(0.2),
            0_u64..12,
        )
            .prop_map(|(lost, twice, delay_ticks)| Fate {
                lost,
                twice,
                delay_ticks,
            })
    };
    (0.0..0.9).prop_flat_map(move |loss| proptest::collection::vec(fate(loss), 200..400))
}

proptest! {
    /// Ten goals, one after the other: all are carried out, in order, none twice, whatever is lost,
    /// repeated or comes late, and an end is never heard of before it was reached.
    #[test]
    fn all_goals_are_carried_out_once(fates in fates()) {
        prop_assume!(fates.iter().any(|fate| !fate.lost));
        let mut pair = Pair::new(fates);
        let mut ended = 0;
        pair.load(0);
        for tick in 0..200_000 {
            if let Some(end) = pair.step(tick) {
                prop_assert_eq!(end, ContractEnd::Ended);
                ended += 1;
                prop_assert!(pair.done.contains(&ended), "the end of {ended} was not reached");
                if ended == 10 {
                    break;
                }
                pair.load(tick);
            }
            pair.check();
        }
        prop_assert_eq!(&pair.done, &(1..=10).collect::<Vec<u32>>());
    }

    /// Goals are taken back by others before they have ended, and the controlled side crashes: what
    /// begins begins once and in order, and the last goal is reached in the end.
    #[test]
    fn goals_that_are_taken_back_do_not_block_the_next(
        fates in fates(),
        loads in proptest::collection::btree_set(0_u64..300, 1..20),
        crashes in proptest::collection::btree_set(0_u64..400, 0..4),
    ) {
        prop_assume!(fates.iter().any(|fate| !fate.lost));
        let mut pair = Pair::new(fates);
        let mut open = false;
        for tick in 0..200_000 {
            if crashes.contains(&tick) {
                pair.crash(tick);
            }
            if loads.contains(&tick) {
                pair.load(tick);
                open = true;
            }
            if let Some(end) = pair.step(tick) {
                open = false;
                let number = pair.controlling.number();
                let is_done = pair.done.contains(&number);
                prop_assert_eq!(is_done, end == ContractEnd::Ended);
            }
            pair.check();
            if tick > 400 && !open {
                break;
            }
        }
        prop_assert!(!open, "the last of {} goals: {:?}", pair.controlling.number(), pair.controlled);
    }
}

#[test]
fn a_goal_that_must_be_done_is_not_skipped() {
    let mut controlling = Controlling::new(name(), 1, BACKOFF);
    let mut controlled = Controlled::new(name(), BACKOFF);
    let first = controlling.load("A".into(), Vec::new(), at(0));
    assert_eq!(controlled.take(&first, at(0)), Taken::Yes);
    let said = controlled
        .say(Vec::new(), ContractEnd::Ended, at(1))
        .expect("it goes on");
    assert!(matches!(controlling.status(&said), Heard::News { .. }));
    let lost = controlling.load("B".into(), Vec::new(), at(2));
    assert_eq!(lost.superseded, 0);
    // Somebody's next goal that does not say that the second was given up.
    let next = RegisterLoad {
        number: 3,
        superseded: 0,
        ..lost.clone()
    };
    assert_eq!(controlled.take(&next, at(2)), Taken::Early);
    let given_up = controlling.load("C".into(), Vec::new(), at(3));
    assert_eq!((given_up.number, given_up.superseded), (3, 1));
    assert_eq!(controlled.take(&given_up, at(3)), Taken::Yes);
    assert_eq!(controlled.take(&lost, at(3)), Taken::Old);
}

#[test]
fn the_first_status_that_ends_a_contract_counts() {
    let mut controlling = Controlling::new(name(), 1, BACKOFF);
    let load = controlling.load("A".into(), Vec::new(), at(0));
    let mut controlled = Controlled::new(name(), BACKOFF);
    controlled.take(&load, at(0));
    let open = controlled
        .say(vec![None], ContractEnd::Open, at(1))
        .expect("it goes on");
    let end = controlled
        .say(vec![None], ContractEnd::Ended, at(2))
        .expect("it goes on");
    assert_eq!(controlled.say(vec![None], ContractEnd::Fault, at(3)), None);
    assert!(matches!(controlling.status(&end), Heard::News { .. }));
    assert_eq!(controlling.status(&open), Heard::Again);
    assert_eq!(controlling.status(&end), Heard::Again);
    controlling.load("B".into(), Vec::new(), at(4));
    assert_eq!(controlling.status(&end), Heard::Stale);
}

#[test]
fn a_new_life_begins_anew_and_the_old_one_is_not_heard() {
    let mut controlled = Controlled::new(name(), BACKOFF);
    let old = Controlling::new(name(), 1, BACKOFF).load("A".into(), Vec::new(), at(0));
    assert_eq!(controlled.take(&old, at(0)), Taken::Yes);
    let new = Controlling::new(name(), 2, BACKOFF).load("B".into(), Vec::new(), at(9));
    assert_eq!(controlled.take(&new, at(9)), Taken::Yes);
    assert_eq!(controlled.contract(), (2, 1));
    assert_eq!(controlled.take(&old, at(0)), Taken::Old);
}

/// A new life may ask what has become of the last contract of any former one, though that life may have
/// heard of it: each answer is final.
#[test]
fn a_new_life_is_told_what_has_become_of_a_former_ones_contract() {
    for (ending, heard) in [(true, false), (true, true), (false, false)] {
        let mut controlled = Controlled::new(name(), BACKOFF);
        let mut old = Controlling::new(name(), 1, BACKOFF);
        let skipped = old.load("A".into(), Vec::new(), at(0));
        let first = old.load("A".into(), Vec::new(), at(0));
        let lost = old.load("B".into(), Vec::new(), at(1));
        assert_eq!(controlled.take(&first, at(0)), Taken::Yes);
        let mut end = ContractEnd::Fault;
        if ending {
            end = ContractEnd::Ended;
            let said = controlled.say(Vec::new(), end.clone(), at(1));
            let said = said.expect("it goes on");
            if heard {
                controlled.acknowledged(&Controlling::ack(&said));
            }
        }
        let ask = |controlled: &Controlled, epoch: u32, number: u32| {
            let mut new = Controlling::new(name(), 4, BACKOFF);
            let load = new.load("C".into(), Vec::new(), at(9));
            new.acknowledged(&RegisterAck {
                register: name(),
                epoch: load.epoch,
                number: load.number,
                of: Acknowledged::Load,
            });
            new.ask((epoch, number));
            let (question, before) = new.repeat_question(at(9)).expect("it is asked at once");
            assert_eq!(
                (question.epoch, question.number, before),
                (epoch, number, 0)
            );
            controlled.asked(&question).map(|answer| {
                assert_eq!((answer.epoch, answer.number), (epoch, number));
                answer.end
            })
        };
        // As long as the life that loaded it may go on, there is no answer.
        assert_eq!(ask(&controlled, 1, lost.number), None);
        let new = Controlling::new(name(), 3, BACKOFF).load("C".into(), Vec::new(), at(9));
        assert_eq!(controlled.take(&new, at(9)), Taken::Yes);
        assert_eq!(ask(&controlled, 3, 1), None);
        let never = ContractEnd::Refused {
            reason: "it never came".to_owned(),
        };
        assert_eq!(ask(&controlled, 1, first.number), Some(end.clone()));
        assert_eq!(ask(&controlled, 1, lost.number), Some(never.clone()));
        assert_eq!(ask(&controlled, 2, 1), Some(never));
        assert_eq!(
            ask(&controlled, 1, skipped.number),
            Some(ContractEnd::Fault)
        );
        // What was said not to have come does not begin any more.
        assert_eq!(controlled.take(&lost, at(10)), Taken::Old);
        let newer = Controlling::new(name(), 4, BACKOFF).load("C".into(), Vec::new(), at(9));
        assert_eq!(controlled.take(&newer, at(9)), Taken::Yes);
        assert_eq!(ask(&controlled, 1, first.number), Some(end));
        assert_eq!(ask(&controlled, 3, 1), Some(ContractEnd::Fault));
    }
}

#[test]
fn a_question_is_asked_until_the_end_of_its_contract_is_heard() {
    let mut new = Controlling::new(name(), 2, BACKOFF);
    new.ask((1, 7));
    assert_eq!(new.repeat_question(at(0)), None);
    new.load("A".into(), Vec::new(), at(0));
    assert_eq!(new.repeat_question(at(1)), None);
    new.acknowledged(&RegisterAck {
        register: name(),
        epoch: 2,
        number: 1,
        of: Acknowledged::Load,
    });
    let mut asked = Vec::new();
    for tick in 2..50 {
        asked.extend(
            new.repeat_question(at(tick))
                .map(|(_, before)| (tick, before)),
        );
    }
    assert_eq!(asked, [(2, 0), (6, 1), (14, 2), (30, 3)]);
    let answer = RegisterStatus {
        register: name(),
        epoch: 1,
        number: 7,
        revision: 3,
        outputs: Vec::new(),
        end: ContractEnd::Ended,
    };
    let open = RegisterStatus {
        end: ContractEnd::Open,
        ..answer.clone()
    };
    let other = RegisterStatus {
        number: 6,
        ..answer.clone()
    };
    assert_eq!(
        [new.status(&open), new.status(&other)],
        [Heard::Stale, Heard::Stale]
    );
    assert!(matches!(new.status(&answer), Heard::Answer { .. }));
    assert_eq!(new.status(&answer), Heard::Stale);
    assert_eq!(new.repeat_question(at(99)), None);
}

#[test]
fn a_status_is_said_until_it_is_acknowledged_itself_or_a_later_load_comes() {
    let begun = || {
        let mut controlling = Controlling::new(name(), 1, BACKOFF);
        let mut controlled = Controlled::new(name(), BACKOFF);
        controlled.take(&controlling.load("A".into(), Vec::new(), at(0)), at(0));
        let open = controlled.say(vec![None], ContractEnd::Open, at(0));
        let end = controlled.say(vec![None], ContractEnd::Ended, at(0));
        (
            controlling,
            controlled,
            open.expect("it is open"),
            end.expect("it goes on"),
        )
    };
    // 2 s, 4 s, 8 s, 16 s, and no longer.
    let (_, mut controlled, ..) = begun();
    let mut said = Vec::new();
    for tick in 0..160 {
        if let Some((status, before)) = controlled.repeat(at(tick)) {
            assert_eq!(status.end, ContractEnd::Ended);
            said.push((tick, before));
        }
    }
    assert_eq!(
        said,
        [
            (4, 1),
            (12, 2),
            (28, 3),
            (60, 4),
            (92, 5),
            (124, 6),
            (156, 7)
        ]
    );
    let (_, mut controlled, open, end) = begun();
    let ack = Controlling::ack(&end);
    for other in [
        Controlling::ack(&open),
        RegisterAck {
            number: 2,
            ..ack.clone()
        },
        RegisterAck {
            epoch: 2,
            ..ack.clone()
        },
        RegisterAck {
            of: Acknowledged::Load,
            ..ack.clone()
        },
    ] {
        controlled.acknowledged(&other);
        assert_eq!(controlled.due(), Some(at(4)), "{other:?}");
    }
    controlled.acknowledged(&ack);
    assert_eq!((controlled.due(), controlled.repeat(at(99))), (None, None));
    let (mut controlling, mut controlled, ..) = begun();
    let next = controlling.load("B".into(), Vec::new(), at(3));
    assert_eq!(controlled.take(&next, at(3)), Taken::Yes);
    assert_eq!((controlled.due(), controlled.repeat(at(99))), (None, None));
    // And nothing of the one before is said for it.
    assert_eq!(controlled.take(&next, at(4)), Taken::Before(None));
}

#[test]
fn a_load_is_said_until_it_is_acknowledged_itself_or_answered() {
    let loaded = || {
        let mut controlling = Controlling::new(name(), 1, BACKOFF);
        let load = controlling.load("A".into(), Vec::new(), at(0));
        (controlling, load)
    };
    let (mut controlling, load) = loaded();
    let mut said = Vec::new();
    for tick in 0..100 {
        if let Some((again, before)) = controlling.repeat(at(tick)) {
            assert_eq!(again, load);
            said.push((tick, before));
        }
    }
    assert_eq!(said, [(4, 1), (12, 2), (28, 3), (60, 4), (92, 5)]);
    let mut controlled = Controlled::new(name(), BACKOFF);
    controlled.take(&load, at(0));
    let ack = controlled.ack();
    let (mut controlling, _) = loaded();
    let of = Acknowledged::Status { revision: 0 };
    for other in [
        RegisterAck {
            number: 2,
            ..ack.clone()
        },
        RegisterAck {
            epoch: 2,
            ..ack.clone()
        },
        RegisterAck { of, ..ack.clone() },
    ] {
        controlling.acknowledged(&other);
        assert_eq!(controlling.due(), Some(at(4)), "{other:?}");
    }
    controlling.acknowledged(&ack);
    assert_eq!(
        (controlling.due(), controlling.repeat(at(99))),
        (None, None)
    );
    let (mut controlling, _) = loaded();
    let open = controlled.say(vec![None], ContractEnd::Open, at(1));
    controlling.status(&open.expect("it goes on"));
    assert_eq!((controlling.due(), controlling.is_open()), (None, true));
}

/// What was taken need not be given up: only what lies behind it is skipped.
#[test]
fn only_what_was_given_up_and_never_taken_is_superseded() {
    let mut controlling = Controlling::new(name(), 1, BACKOFF);
    let mut controlled = Controlled::new(name(), BACKOFF);
    let first = controlling.load("A".into(), Vec::new(), at(0));
    controlled.take(&first, at(0));
    controlling.acknowledged(&controlled.ack());
    let again = controlling.load("A".into(), Vec::new(), at(0));
    controlled.take(&again, at(0));
    controlling.acknowledged(&controlled.ack());
    let superseded = |load: &RegisterLoad| (load.number, load.superseded);
    let second = controlling.load("B".into(), Vec::new(), at(1));
    assert_eq!(superseded(&second), (3, 1));
    let third = controlling.load("C".into(), Vec::new(), at(2));
    assert_eq!(superseded(&third), (4, 2));
    let fourth = controlling.load("D".into(), Vec::new(), at(2));
    assert_eq!(superseded(&fourth), (5, 3));
    assert_eq!(controlled.take(&fourth, at(3)), Taken::Yes);
    let said = controlled.say(Vec::new(), ContractEnd::Ended, at(4));
    controlling.status(&said.expect("it goes on"));
    let fifth = controlling.load("E".into(), Vec::new(), at(5));
    assert_eq!(superseded(&fifth), (6, 0));
}

#[test]
fn a_restart_faults_what_went_on_and_says_again_what_was_not_heard() {
    let mut controlling = Controlling::new(name(), 1, BACKOFF);
    let mut controlled = Controlled::new(name(), BACKOFF);
    controlled.take(&controlling.load("A".into(), Vec::new(), at(0)), at(0));
    let fault = controlled.restarted(at(1)).expect("it went on");
    assert_eq!((&fault.end, fault.revision), (&ContractEnd::Fault, 0));
    assert!(!controlled.is_open());
    assert_eq!(controlled.restarted(at(20)), Some(fault.clone()));
    assert_eq!(controlled.due(), Some(at(24)));
    controlled.acknowledged(&Controlling::ack(&fault));
    assert_eq!(controlled.restarted(at(30)), None);
}

/// Statuses may overtake each other, and be made up.
#[test]
fn of_statuses_only_a_later_one_before_the_end_is_news() {
    let mut controlling = Controlling::new(name(), 1, BACKOFF);
    let mut controlled = Controlled::new(name(), BACKOFF);
    controlled.take(&controlling.load("A".into(), Vec::new(), at(0)), at(0));
    let mut say = |end| controlled.say(vec![None], end, at(1)).expect("it goes on");
    let said = [
        say(ContractEnd::Open),
        say(ContractEnd::Open),
        say(ContractEnd::Ended),
    ];
    assert!(matches!(controlling.status(&said[1]), Heard::News { .. }));
    assert_eq!(controlling.status(&said[0]), Heard::Again);
    assert_eq!(controlling.status(&said[1]), Heard::Again);
    assert!(matches!(controlling.status(&said[2]), Heard::News { .. }));
    let later = RegisterStatus {
        revision: 7,
        ..said[2].clone()
    };
    assert_eq!(controlling.status(&later), Heard::Again);
}
