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
    println!(
        "{spent:?} {:?} {} tokens",
        rover.executive.counters(),
        rover.executive.database().len()
    );
    assert!(spent[9] * 100 <= spent[0] * 105, "{spent:?}");
    assert_eq!(rover.executive.counters().backtracks, 0);
}
