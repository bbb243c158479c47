//! Roots and ways beside an oracle that is told everything and searches it all: two runs of a small world, of
//! which one thing is otherwise.

mod world;

use std::collections::BTreeMap;

use proptest::prelude::*;

use super::super::{DiffOptions, DiffReport, Limits, RootKind, comparison};
use world::{Change, END_NS, Message, Run, Send, link, name, run};

/// How an actor is reached first, as the oracle finds it.
#[derive(Clone, Debug, PartialEq)]
struct Touch {
    at_ns: u64,
    /// The message by which it was; none for a crash.
    message: Option<String>,
    is_received: bool,
    /// Who sent it otherwise; none, if nobody did.
    from: Option<usize>,
}

/// What only one of two lists has.
fn apart<'m, K: PartialEq>(
    a: &'m [Message],
    b: &'m [Message],
    key: impl Fn(&Message) -> K,
) -> Vec<&'m Message> {
    let lacks = |all: &[Message], one: &Message| !all.iter().any(|other| key(other) == key(one));
    let only_a = a.iter().filter(|one| lacks(b, one));
    let only_b = b.iter().filter(|one| lacks(a, one));
    only_a.chain(only_b).collect()
}

/// By actor, how it was reached first: everything it received and sent in both runs is compared with everything.
fn oracle(actors: usize, a: &Run, b: &Run, change: &Change) -> BTreeMap<usize, Touch> {
    let mut touched = BTreeMap::new();
    for actor in 0..actors {
        let of = |run: &Run, pick: &dyn Fn(&Message) -> bool| -> Vec<Message> {
            run.messages.iter().filter(|m| pick(m)).cloned().collect()
        };
        let received = |run| of(run, &|m| m.to == actor && m.lost.is_none());
        let sent = |run| of(run, &|m| m.from == actor);
        let (in_a, in_b) = (received(a), received(b));
        let inputs = apart(&in_a, &in_b, |m| (m.said(), m.at_ns));
        let input = inputs.into_iter().min_by_key(|m| m.at_ns);
        let (out_a, out_b) = (sent(a), sent(b));
        let outputs = apart(&out_a, &out_b, Message::said);
        let output = outputs.into_iter().min_by_key(|m| m.sent_ns);
        let mut first: Option<Touch> = None;
        let mut may_be = |touch: Touch| {
            if first.as_ref().is_none_or(|known| touch.at_ns < known.at_ns) {
                first = Some(touch);
            }
        };
        if let Change::Crash(who, at_ns) = change
            && *who == actor
        {
            may_be(Touch {
                at_ns: *at_ns,
                message: None,
                is_received: false,
                from: None,
            });
        }
        if let Some(m) = input {
            // The link did it, if the same message was sent in both.
            let same = |run: &Run| {
                let mut all = run.messages.iter();
                all.any(|other| (other.said(), other.ordinal) == (m.said(), m.ordinal))
            };
            let by_link = same(a) && same(b);
            may_be(Touch {
                at_ns: m.at_ns,
                message: Some(m.id()),
                is_received: true,
                from: (!by_link).then_some(m.from),
            });
        }
        if let Some(m) = output {
            may_be(Touch {
                at_ns: m.sent_ns,
                message: Some(m.id()),
                is_received: false,
                from: None,
            });
        }
        touched.extend(first.map(|first| (actor, first)));
    }
    touched
}

/// The actors on the way to one, that included.
fn way(touched: &BTreeMap<usize, Touch>, actor: usize) -> Vec<usize> {
    let mut way = vec![actor];
    while let Some(from) = touched[&way[way.len() - 1]].from {
        way.push(from);
    }
    way.reverse();
    way
}

fn compared(a: &Run, b: &Run, chunk: usize) -> DiffReport {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["a.mcap", "b.mcap"].map(|name| folder.path().join(name));
    a.write(&paths[0], chunk);
    b.write(&paths[1], chunk + 2);
    let compare = |limits| {
        let options = DiffOptions::default();
        comparison::compare(&paths[0], &paths[1], &options, limits, None)
            .unwrap()
            .0
    };
    let report = compare(Limits::default());
    let little = Limits {
        entries: 3,
        pairs: 2,
        message_bytes: 1,
        passes_front: false,
        ..Limits::default()
    };
    assert_eq!(report, compare(little));
    report
}

/// Checks a report against the oracle. Whatever follows in time, all of it goes back to the change.
fn check(actors: usize, plan: &[Send], change: &Change) -> Result<DiffReport, TestCaseError> {
    let (a, b) = (
        run(actors, plan, &Change::Nothing),
        run(actors, plan, change),
    );
    let report = compared(&a, &b, 7);
    let touched = oracle(actors, &a, &b, change);
    let mut order: Vec<usize> = touched.keys().copied().collect();
    order.sort_by_key(|actor| touched[actor].at_ns);
    let found: Vec<&str> = report
        .spread
        .iter()
        .map(|reached| reached.actor.as_str())
        .collect();
    let expected: Vec<String> = order.iter().map(|actor| name(*actor)).collect();
    prop_assert_eq!(found, expected, "{:?}\n{}", touched, report);
    for (actor, reached) in order.iter().zip(&report.spread) {
        let touch = &touched[actor];
        prop_assert_eq!(reached.time_ns, touch.at_ns, "{}", report);
        let path: Vec<&str> = reached.path.iter().map(|hop| hop.actor.as_str()).collect();
        let expected: Vec<String> = way(&touched, *actor).iter().map(|a| name(*a)).collect();
        prop_assert_eq!(path, expected, "{:?}\n{:#}", touched, report);
        let same_flow = |id: &String| id.rsplit_once(',').map(|(flow, _)| flow.to_owned());
        // Two that were sent at once are as good as each other.
        if touch.is_received {
            let [found, expected] =
                [&reached.message, &touch.message].map(|id| id.as_ref().and_then(same_flow));
            prop_assert_eq!(found, expected, "{}", report);
        }
        let root = reached.root.as_ref().unwrap();
        prop_assert_eq!(root.kind, kind(change), "{}", report);
        prop_assert_eq!(&root.actor, &whose(change), "{}", report);
    }
    let root = report
        .root
        .as_ref()
        .map(|root| (root.kind, root.actor.clone()));
    let expected = (report.first.is_some()).then(|| (kind(change), whose(change)));
    prop_assert_eq!(root, expected, "{}", report);
    Ok(report)
}

fn kind(change: &Change) -> RootKind {
    match change {
        Change::Nothing | Change::Key(_) => RootKind::Actor,
        Change::Lose(..) | Change::Delay(..) => RootKind::Verdict,
        Change::Crash(..) | Change::Link(..) => RootKind::Event,
    }
}

fn whose(change: &Change) -> String {
    match change {
        Change::Nothing => String::new(),
        Change::Key(actor) | Change::Crash(actor, _) => name(*actor),
        Change::Lose(from, to, _) | Change::Delay(from, to, ..) | Change::Link(from, to, _) => {
            link(*from, *to)
        }
    }
}

/// A plan whose sends are all at different times, between two ends far from each other's arrivals.
fn plans() -> impl Strategy<Value = (usize, Vec<Send>)> {
    (2usize..6).prop_flat_map(|actors| {
        let send = (1u64..900, 0..actors, 1..actors);
        let sends = prop::collection::vec(send, 1..40);
        sends.prop_map(move |sends| {
            let sends = sends.into_iter().enumerate();
            let plan = sends.map(|(at, (ms, from, by))| Send {
                at_ns: ms * 1_000_000 + at as u64,
                from,
                to: (from + by) % actors,
            });
            (actors, plan.collect())
        })
    })
}

fn changes() -> impl Strategy<Value = (u64, usize, usize, u64, u64)> {
    (0u64..5, 0usize..6, 1usize..6, 0u64..6, 1u64..900)
}

fn change(actors: usize, (which, who, by, ordinal, ms): (u64, usize, usize, u64, u64)) -> Change {
    let from = who % actors;
    let to = (from + 1 + by % (actors - 1)) % actors;
    let at_ns = ms * 1_000_000 + 500_000;
    match which {
        0 => Change::Lose(from, to, ordinal),
        1 => Change::Delay(from, to, ordinal, ms * 10_007),
        2 => Change::Crash(from, at_ns),
        3 => Change::Key(from),
        _ => Change::Link(from, to, at_ns),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn whom_a_change_reaches_when_and_how_is_found((actors, plan) in plans(), raw in changes()) {
        check(actors, &plan, &change(actors, raw))?;
    }
}

/// Three in a row: 0 tells 1, 1 tells 2, ten times.
fn row() -> Vec<Send> {
    let hop = |n: u64| {
        [(0, 1, 0), (1, 2, 30)].map(|(from, to, later)| Send {
            at_ns: (n * 60 + later + 1) * 1_000_000,
            from,
            to,
        })
    };
    (0..10).flat_map(hop).collect()
}

fn reached(report: &DiffReport) -> Vec<&str> {
    report
        .spread
        .iter()
        .map(|reached| reached.how.as_str())
        .collect()
}

#[test]
fn a_loss_is_named_with_its_ruling_and_reaches_who_should_have_received_it() {
    let report = check(3, &row(), &Change::Lose(0, 1, 4)).unwrap();
    let root = report.root.as_ref().unwrap();
    assert_eq!(
        root.what,
        "link rover_0-rover_1 on rover_0,rover_1,Fact,4: delivered | lost for ruled"
    );
    assert_eq!(
        report.inputs,
        ["lose[0].message: none | \"rover_0,rover_1,Fact,4\""]
    );
    assert_eq!(
        root.draw.as_deref(),
        Some("none: the scenario rules what becomes of it")
    );
    let how = reached(&report);
    assert!(
        how[0].starts_with("receives rover_0,rover_1,Fact,4 in a.mcap only, lost"),
        "{how:?}"
    );
}

#[test]
fn a_delay_a_crash_and_a_key_are_named() {
    let report = check(3, &row(), &Change::Delay(0, 1, 2, 5_000_000)).unwrap();
    let how = reached(&report);
    assert_eq!(
        how[0],
        "receives rover_0,rover_1,Fact,2, 5ms later in b.mcap"
    );
    let report = check(3, &row(), &Change::Crash(1, 100_500_000)).unwrap();
    assert_eq!(reached(&report)[0], "crashes in b.mcap only");
    assert_eq!(report.inputs.len(), 2, "{report}");
    let report = check(3, &row(), &Change::Key(0)).unwrap();
    assert_eq!(report.inputs, ["knows.rover_0: none | 77"]);
    assert!(
        reached(&report)[0].starts_with("sends rover_0,rover_1,Fact,0"),
        "{report}"
    );
}

/// A message that one run has more, or says otherwise, is one message, not all that follow it in its flow.
#[test]
fn a_message_more_in_a_flow_is_one_message() {
    let a = run(3, &row(), &Change::Nothing);
    let mut b = run(3, &row(), &Change::Nothing);
    let of_flow = |run: &Run| -> Vec<usize> {
        let places = run.messages.iter().enumerate();
        let of = places.filter(|(_, m)| (m.from, m.to) == (0, 1));
        of.map(|(at, _)| at).collect()
    };
    let flow = of_flow(&b);
    assert!(flow.len() > 8);
    let more = Message {
        body: 5,
        sent_ns: b.messages[flow[4]].sent_ns + 7,
        ..b.messages[flow[4]].clone()
    };
    b.messages[flow[7]].body = 6;
    for at in &flow[4..] {
        b.messages[*at].ordinal += 1;
    }
    b.messages.push(more);
    for (a, b, expected) in [(&a, &b, (1, 0, 1)), (&b, &a, (1, 1, 0))] {
        let report = compared(a, b, 5);
        let topics = report.topics.iter();
        let counts: Vec<_> = topics
            .map(|topic| (topic.changed, topic.only_in_a, topic.only_in_b))
            .collect();
        assert_eq!(counts, [expected], "{report}");
    }
}

/// A link draws for another number. Who sent a message more is why it decides otherwise about the next.
#[test]
fn what_a_link_decides_of_a_message_with_another_number_is_by_its_sender() {
    let a = run(3, &row(), &Change::Nothing);
    let mut b = run(3, &row(), &Change::Nothing);
    let flow: Vec<usize> = (0..b.messages.len())
        .filter(|at| (b.messages[*at].from, b.messages[*at].to) == (0, 1))
        .collect();
    let next = b.messages[flow[4]].clone();
    for at in &flow[4..] {
        b.messages[*at].ordinal += 1;
    }
    b.messages[flow[4]].at_ns += 1_000_000;
    b.messages.push(Message {
        sent_ns: next.sent_ns - 7,
        at_ns: next.at_ns + 500_000,
        body: 5,
        ..next
    });
    let report = compared(&a, &b, 5);
    let of_1 = report
        .spread
        .iter()
        .find(|reached| reached.actor == "rover_1")
        .unwrap();
    let path: Vec<&str> = of_1.path.iter().map(|hop| hop.actor.as_str()).collect();
    assert_eq!(path, ["rover_0", "rover_1"], "{report}");
    assert_eq!(
        of_1.how,
        "receives rover_0,rover_1,Fact,4, 1ms later in b.mcap"
    );
    assert_eq!(of_1.root.as_ref().unwrap().kind, RootKind::Actor);
}

#[test]
fn nothing_is_reached_behind_the_end_of_a_log_that_is_cut() {
    let (a, folder) = (
        run(3, &row(), &Change::Nothing),
        tempfile::tempdir().unwrap(),
    );
    let paths = ["a.mcap", "cut.mcap"].map(|name| folder.path().join(name));
    a.write(&paths[0], 4);
    let bytes = std::fs::read(&paths[0]).unwrap();
    for part in [3, 2] {
        std::fs::write(&paths[1], &bytes[..bytes.len() / part]).unwrap();
        let report = super::super::diff(&paths[0], &paths[1], &DiffOptions::default()).unwrap();
        let root = report.root.as_ref().unwrap();
        assert_eq!(root.kind, RootKind::End, "{report}");
        assert!(root.what.starts_with("cut.mcap is cut at "), "{report}");
        assert!(
            report.spread.is_empty() && root.time_ns < END_NS,
            "{report}"
        );
    }
}
