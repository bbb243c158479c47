//! The executive's need, counted: what a cycle costs does not grow, and nothing is taken back.

#[path = "../benches/timelines/rover.rs"]
mod rover;

use farside_planning::search::Verdict;
use rover::Rover;

#[test]
fn cycles_cost_no_more_after_many_and_take_nothing_back() {
    const TICKS: i64 = 20_000;
    let mut rover = Rover::new(1);
    let mut spent = Vec::new();
    let mut before = 0;
    for tick in 0..TICKS {
        let verdict = rover.step(tick);
        assert!(
            matches!(verdict, Verdict::Solved),
            "tick {tick}: {verdict:?}"
        );
        if (tick + 1) % (TICKS / 10) == 0 {
            let now = rover.executive.database().operations();
            spent.push(now - before);
            before = now;
        }
    }
    assert!(
        rover.executive.database().len() <= 25,
        "tokens are forgotten"
    );
    assert!(rover.executive.counters().guards > 100, "alarms came");
    assert!(spent[9] * 100 <= spent[0] * 105, "{spent:?}");
    assert_eq!(rover.executive.counters().backtracks, 0);
}

/// What the timelines say at a tick, with all that is known of it.
fn said(rover: &Rover) -> Vec<String> {
    let database = rover.executive.database();
    let timelines = 0..database.model().timelines.len();
    let tokens = timelines.filter_map(|at| rover.executive.present(at));
    let say = |token| {
        let at = database.token(token).expect("it is there");
        let values = at.parameters.iter().map(|&one| database.values(one));
        let values: Vec<_> = values.collect();
        let times = (database.start(token), database.finish(token));
        format!("{} {values:?} {times:?}", at.predicate)
    };
    tokens.map(say).collect()
}

/// To forget the past changes no decision.
#[test]
fn decisions_are_the_same_without_forgetting() {
    for seed in 1..4 {
        let mut rovers = [Rover::new(seed), Rover::new(seed)];
        rovers[1].executive.forgets = false;
        for tick in 0..2_000 {
            let [one, other] = rovers.each_mut().map(|rover| {
                let verdict = rover.step(tick);
                assert!(
                    matches!(verdict, Verdict::Solved),
                    "tick {tick}: {verdict:?}"
                );
                said(rover)
            });
            assert_eq!(one, other, "tick {tick} of {seed}");
        }
    }
}
