//! What a cycle decides, and in which order.

use super::*;

#[test]
fn the_first_cycle_begins_the_defaults() {
    for agent in agents(TEXT) {
        let started = agent.service.started();
        assert_eq!(started.len(), 5, "{}", agent.name);
        for (timeline, started) in started.iter().enumerate() {
            let contract = Contract {
                timeline: timeline as u16,
                number: 0,
            };
            assert_eq!(started.contract, contract);
        }
        assert!(agent.ended().is_empty());
        assert_eq!(agent.says("Goal_SV"), ("NoGoal", 0));
    }
}

#[test]
fn a_status_binds_at_once_and_ends_as_the_duration_allows() {
    for mut agent in agents(TEXT) {
        agent.service.advance(1);
        agent.goal("Drive_SV", "Drive", &[7]).expect("it can start");
        agent.cycle(1);
        assert_eq!(agent.ended(), ["Still() 0-1"]);
        agent.service.advance(2);
        agent.status("Drive_SV", "ok").expect("it is active");
        let present = agent.service.present(agent.timeline("Drive_SV"));
        let ok = agent.symbol("ok");
        assert_eq!(present.expect("it drives").parameters[1], Some(ok));
        agent.idle(2..4);
        assert_eq!(agent.says("Drive_SV"), ("Drive", 1));
        agent.cycle(4);
        assert_eq!(agent.ended(), ["Drive(ok) 1-4", "Poll(?) 2-4"]);
        assert_eq!(agent.says("Drive_SV"), ("Still", 4));
    }
}

#[test]
fn an_expired_timer_says_so_and_what_follows_comes_in_the_same_cycle() {
    for mut agent in agents(TEXT) {
        agent.service.advance(1);
        agent.goal("Drive_SV", "Drive", &[7]).expect("it can start");
        agent.idle(1..6);
        assert_eq!(agent.says("Drive_SV"), ("Drive", 1));
        agent.cycle(6);
        let ended = ["Drive(TIMEOUT) 1-6", "Poll(?) 4-6", "Quiet() 0-6"];
        assert_eq!(agent.ended(), ended);
        assert_eq!(agent.says("Drive_SV"), ("Still", 6));
        assert_eq!(agent.says("Log_SV"), ("Late", 6));
    }
}

/// "A status beats a timer or a pre-emption in the same cycle."
#[test]
fn a_status_beats_a_timer_of_the_same_cycle() {
    for mut agent in agents(TEXT) {
        agent.service.advance(1);
        agent.goal("Drive_SV", "Drive", &[7]).expect("it can start");
        agent.idle(1..6);
        agent.service.advance(6);
        agent.status("Drive_SV", "ok").expect("it is active");
        agent.cycle(6);
        assert_eq!(agent.ended()[0], "Drive(ok) 1-6");
        assert_eq!(agent.says("Log_SV"), ("Quiet", 0));
    }
}

#[test]
fn a_status_beats_a_preemption_whatever_was_posted_first() {
    for status_first in [true, false] {
        for mut agent in agents(TEXT) {
            agent.service.advance(1);
            agent.goal("Drive_SV", "Drive", &[7]).expect("it can start");
            agent.idle(1..5);
            agent.service.advance(5);
            if status_first {
                agent.status("Drive_SV", "ok").expect("it is active");
            }
            agent
                .goal("Drive_SV", "Drive", &[8])
                .expect("the first may end");
            if !status_first {
                agent.status("Drive_SV", "ok").expect("it is active");
            }
            agent.cycle(5);
            assert_eq!(agent.ended()[0], "Drive(ok) 1-5");
            assert_eq!(agent.says("Drive_SV"), ("Drive", 5));
        }
    }
}

#[test]
fn a_cancel_is_a_preemption_and_a_status_beats_it() {
    for status in [true, false] {
        for mut agent in agents(TEXT) {
            agent.service.advance(1);
            agent.goal("Goal_SV", "GoTo", &[7]).expect("it can start");
            agent.idle(1..3);
            agent.service.advance(3);
            let goal = agent.contract("Goal_SV");
            agent.service.cancel(goal).expect("it is active");
            if status {
                agent.status("Goal_SV", "failed").expect("it is active");
            }
            agent.cycle(3);
            let ended = if status {
                "GoTo(failed) 1-3"
            } else {
                "GoTo(PREEMPTED) 1-3"
            };
            assert_eq!(agent.ended()[0], ended);
            assert_eq!(agent.says("Goal_SV"), ("NoGoal", 3));
        }
    }
}

/// Section 3 of the paper: a goal holds within a mode, and ends with it.
#[test]
fn an_alarm_ends_the_goal_in_the_same_cycle() {
    for mut agent in agents(TEXT) {
        agent.service.advance(1);
        agent.goal("Goal_SV", "GoTo", &[7]).expect("it can start");
        agent.cycle(1);
        agent.service.advance(2);
        let poll = agent.contract("Poll_SV");
        let outputs = [None, Some(26), Some(1)];
        agent
            .service
            .bind(poll, &outputs, true)
            .expect("it is active");
        agent.cycle(2);
        let ended = ["GoTo(PREEMPTED) 1-2", "Poll(True) 0-2", "Nominal() 0-2"];
        assert_eq!(agent.ended(), ended);
        assert_eq!(agent.says("Mode_SV"), ("Hold", 2));
        assert_eq!(agent.says("Goal_SV"), ("NoGoal", 2));
    }
}

/// The order in a cycle: safety comes before goals. A goal of the alarm's cycle finds the new mode.
#[test]
fn a_goal_of_an_alarms_cycle_finds_what_safety_decided() {
    for mut agent in agents(TEXT) {
        agent.service.advance(1);
        agent
            .goal("Goal_SV", "GoTo", &[7])
            .expect("it can be, as things are");
        let poll = agent.contract("Poll_SV");
        let outputs = [None, Some(-26), Some(1)];
        agent
            .service
            .bind(poll, &outputs, true)
            .expect("it is active");
        let Outcome::NoPlan(why) = agent.service.solve(1, BUDGET) else {
            panic!("{}: no mode contains the goal", agent.name);
        };
        assert!(why.compatibility.contains("agent.ddl:36:1 (GoTo)"), "{why}");
    }
}

#[test]
fn parts_of_a_status_come_one_by_one() {
    for mut agent in agents(TEXT) {
        agent.service.advance(1);
        let poll = agent.contract("Poll_SV");
        let tilt = [None, Some(30), None];
        agent
            .service
            .bind(poll, &tilt, false)
            .expect("it is active");
        agent.cycle(1);
        let present = agent.service.present(agent.timeline("Poll_SV"));
        let known = present.expect("it polls").parameters;
        assert_eq!(known.as_slice(), [None, Some(30), None]);
        agent.service.advance(2);
        let received = [None, None, Some(1)];
        agent
            .service
            .bind(poll, &received, true)
            .expect("it is active");
        agent.cycle(2);
        let ended = { agent.service.ended().iter() }.find(|at| at.contract == poll);
        let known = &ended.expect("it ended").parameters;
        assert_eq!(known.as_slice(), [Some(1), Some(30), Some(1)]);
    }
}

/// What was posted stands, and nothing else changes, if the budget is spent.
#[test]
fn over_budget_nothing_is_decided_and_what_was_posted_stands() {
    for mut agent in agents(TEXT) {
        agent.service.advance(1);
        agent.goal("Goal_SV", "GoTo", &[7]).expect("it can start");
        let poll = agent.contract("Poll_SV");
        let outputs = [None, Some(3), Some(1)];
        agent
            .service
            .bind(poll, &outputs, true)
            .expect("it is active");
        let before = agent.service.snapshot();
        assert_eq!(agent.service.solve(1, 0), Outcome::OverBudget);
        assert_eq!(agent.service.snapshot(), before);
        assert!(agent.service.started().is_empty() && agent.ended().is_empty());
        agent.cycle(1);
        assert_eq!(agent.says("Goal_SV"), ("GoTo", 1));
        assert_eq!(agent.ended(), ["NoGoal() 0-1", "Poll(True) 0-1"]);
    }
}

#[test]
fn without_a_plan_the_rule_is_named_and_nothing_is_decided() {
    for mut agent in agents(TEXT) {
        agent.service.advance(1);
        let poll = agent.contract("Poll_SV");
        let outputs = [None, Some(26), Some(1)];
        agent
            .service
            .bind(poll, &outputs, true)
            .expect("it is active");
        agent.cycle(1);
        agent.service.advance(2);
        agent
            .goal("Goal_SV", "GoTo", &[7])
            .expect("the model alone allows it");
        let before = agent.service.snapshot();
        for _ in 0..2 {
            let Outcome::NoPlan(why) = agent.service.solve(1, BUDGET) else {
                panic!("{}: no mode contains the goal", agent.name);
            };
            assert!(why.compatibility.contains("agent.ddl:36:1 (GoTo)"), "{why}");
            assert!(
                why.reason.contains("contained_by Nominal on Mode_SV"),
                "{why}"
            );
            assert_eq!(agent.service.snapshot(), before);
        }
    }
}

#[test]
fn with_deletion_tokens_are_few_and_decisions_the_same() {
    let mut agents = agents(TEXT);
    for tick in 1..300 {
        for agent in &mut agents {
            agent.service.advance(tick);
            if tick % 7 == 0 {
                let poll = agent.contract("Poll_SV");
                let outputs = [None, Some(tick % 50), Some(1)];
                agent
                    .service
                    .bind(poll, &outputs, true)
                    .expect("it is active");
            }
            agent.cycle(tick);
        }
        let (first, others) = agents.split_first().expect("there are some");
        for other in others {
            assert_eq!(first.service.started(), other.service.started());
            assert_eq!(first.service.ended(), other.service.ended());
        }
    }
    assert!(agents[0].service.counters().tokens <= 10);
    assert!(agents[1].service.counters().tokens > 100);
}
