//! Agents that are too slow, that crash, and relays that do.

use farside::prelude::*;
use farside::random::RandomKey;

use crate::mission::K9;
use crate::scenario::{Run, What};

/// A processor a thousand times slower while the rover drives: the agent is faulty at a tick that is
/// named, and the rover stands still when the lease has ended.
#[test]
fn a_slow_system_agent_is_faulty_and_the_rover_stops() {
    let text =
        format!("{K9}\n[[degrade]]\nprocessors = \"system\"\nat = \"40s\"\nslowdown = 1000\n");
    let run = Run::of(&text, 1, |_| ());
    assert_eq!(run.figure("faulty_agents"), 1.0);
    assert_eq!(run.figure("driving_without_lease_s"), 0.0);
    let faulty = run
        .said
        .iter()
        .find(|said| matches!(said.what, What::Faulty(81, _)));
    let faulty = faulty.expect("it says so");
    assert_eq!(
        (faulty.who.as_str(), faulty.at),
        ("system", SimTime::ZERO + SimDuration::from_millis(40_500))
    );
    let stopped = run
        .said
        .iter()
        .find(|said| said.what == What::Other("RelayStopped".to_owned()));
    assert!(
        stopped.is_some_and(
            |said| said.at > faulty.at && said.at < faulty.at + SimDuration::from_secs(4)
        )
    );
}

/// A system agent that crashes while the rover drives, and comes again: the rover stops meanwhile, its
/// goal is faulted or tried again, and all goals are achieved.
#[test]
fn a_system_agent_that_comes_again_goes_on() {
    for restarts_s in [42, 45, 60] {
        let run = Run::of(K9, 1, |sim| {
            sim.crash_named_at(SimTime::from_secs(40), "system")
                .expect("there is one");
            sim.restart_named_at(SimTime::from_secs(restarts_s), "system")
                .expect("there is one");
        });
        assert_eq!(run.figure("driving_without_lease_s"), 0.0, "{restarts_s}");
        assert_eq!(run.figure("goals_repeated"), 0.0);
        assert_eq!(run.figure("goals_achieved"), 6.0, "{restarts_s}");
    }
}

/// So with the relay, and with the mission agent.
#[test]
fn relays_and_mission_agents_that_come_again_go_on() {
    for name in ["k9", "mission", "ground"] {
        let run = Run::of(K9, 1, |sim| {
            sim.crash_named_at(SimTime::from_secs(100), name)
                .expect("there is one");
            sim.restart_named_at(SimTime::from_secs(104), name)
                .expect("there is one");
        });
        if std::env::var("SHOW").is_ok_and(|shown| shown == name) {
            run.print();
        }
        assert_eq!(run.figure("driving_without_lease_s"), 0.0, "{name}");
        assert_eq!(run.figure("goals_achieved"), 6.0, "{name}");
    }
}

/// Mission and system agents that crash at any time while links lose much: nothing is lost, and nothing is
/// done twice. Its load may be under way when the mission agent crashes, or the end of its goal.
fn all_goals_are_settled(seed: u64, loss: f64) {
    let links = format!("[links.default]\nloss = {loss}");
    let text = K9.replace("[links.default]", &links);
    let text = text.replace("until = \"1h\"", "until = \"6h\"");
    let mut random = RandomKey::new(seed).text("crashes").stream();
    let run = Run::of(&text, seed, |sim| {
        for name in ["mission", "system"] {
            let mut at_ms = 0;
            for _ in 0..4 {
                at_ms += 1000 + random.below(150_000);
                let at = SimTime::ZERO + SimDuration::from_millis(at_ms);
                sim.crash_named_at(at, name).expect("there is one");
                at_ms += random.below(20_000);
                let at = SimTime::ZERO + SimDuration::from_millis(at_ms);
                sim.restart_named_at(at, name).expect("there is one");
            }
        }
    });
    let what = format!("seed {seed}, loss {loss}: {:?}", run.results.summary);
    let ends = run.figure("goals_achieved") + run.figure("goals_given_up");
    assert_eq!(ends, run.figure("goals_total"), "{what}");
    assert_eq!(run.figure("goals_repeated"), 0.0, "{what}");
}

#[test]
fn agents_that_crash_behind_links_that_lose_settle_all_goals() {
    for (seed, loss) in [(1, 0.0), (2, 0.3), (3, 0.6)] {
        all_goals_are_settled(seed, loss);
    }
}

#[test]
#[ignore = "takes half a minute"]
fn agents_that_crash_behind_links_that_lose_settle_all_goals_for_many_seeds() {
    for seed in 10..70 {
        all_goals_are_settled(seed, [0.0, 0.2, 0.4, 0.6][seed as usize % 4]);
    }
}
