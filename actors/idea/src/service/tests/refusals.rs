//! What is not taken, and that nothing changes then.

use super::*;

/// That something is refused, with these words, and changes nothing.
fn refused(agent: &mut Agent, words: &str, post: impl FnOnce(&mut Agent) -> Result<(), Refusal>) {
    let before = agent.service.snapshot();
    let refusal = post(agent).expect_err(words);
    assert_eq!(refusal.to_string(), words, "{}", agent.name);
    assert_eq!(agent.service.snapshot(), before);
}

#[test]
fn what_is_not_of_the_model_is_refused() {
    for mut agent in agents(TEXT) {
        agent.service.advance(1);
        let poll = agent.contract("Poll_SV");
        refused(&mut agent, "Goal_SV does not say Drive", |agent| {
            agent.goal("Goal_SV", "Drive", &[7])
        });
        refused(&mut agent, "timeline 77 does not say GoTo", |agent| {
            let goal = agent.predicate("GoTo");
            agent.service.insert_goal(77, goal, &[7])
        });
        refused(&mut agent, "Goal_SV does not say predicate 99", |agent| {
            agent.service.insert_goal(0, 99, &[7])
        });
        refused(&mut agent, "GoTo: expected 1 inputs, found 0", |agent| {
            agent.goal("Goal_SV", "GoTo", &[])
        });
        refused(&mut agent, "GoTo: ?x: 101 is not a Metres", |agent| {
            agent.goal("Goal_SV", "GoTo", &[101])
        });
        refused(&mut agent, "Poll: expected 3 outputs, found 2", |agent| {
            agent.service.bind(poll, &[None, None], true)
        });
        refused(&mut agent, "Poll: ?tilt: 91 is not a Degrees", |agent| {
            agent.service.bind(poll, &[None, Some(91), Some(1)], true)
        });
        refused(&mut agent, "Poll: ?received: 2 is not a Boolean", |agent| {
            agent.service.bind(poll, &[None, Some(9), Some(2)], true)
        });
    }
}

#[test]
fn a_dead_contract_is_refused() {
    for mut agent in agents(TEXT) {
        agent.service.advance(1);
        agent.goal("Drive_SV", "Drive", &[7]).expect("it can start");
        let still = agent.contract("Drive_SV");
        agent.cycle(1);
        let never = Contract { number: 5, ..still };
        let nowhere = Contract {
            timeline: 60,
            number: 0,
        };
        for (contract, words) in [
            (still, "contract 0 of Drive_SV is not active"),
            (never, "contract 5 of Drive_SV is not active"),
            (nowhere, "contract 0 of timeline 60 is not active"),
        ] {
            refused(&mut agent, words, |agent| {
                agent.service.bind(contract, &[None], true)
            });
            refused(&mut agent, words, |agent| agent.service.cancel(contract));
        }
        // The first status wins, though its token has to go on for a while.
        agent.service.advance(2);
        agent.status("Drive_SV", "ok").expect("it is active");
        refused(
            &mut agent,
            "contract 1 of Drive_SV is not active",
            |agent| agent.status("Drive_SV", "failed"),
        );
    }
}

#[test]
fn a_known_value_stays() {
    for mut agent in agents(TEXT) {
        agent.service.advance(1);
        let poll = agent.contract("Poll_SV");
        let tilt = [None, Some(30), None];
        agent
            .service
            .bind(poll, &tilt, false)
            .expect("it is active");
        let other = agent.service.bind(poll, &[None, Some(31), Some(1)], true);
        assert!(matches!(other, Err(Refusal::Rule { .. })), "{other:?}");
        let same = agent.service.bind(poll, &[None, Some(30), Some(1)], true);
        assert_eq!(same, Ok(()));
    }
}

/// A value that the model's functions do not allow.
#[test]
fn a_status_against_a_rule_is_refused_with_the_rule() {
    for mut agent in agents(TEXT) {
        agent.service.advance(1);
        let poll = agent.contract("Poll_SV");
        let outputs = [Some(0), Some(30), Some(1)];
        let refusal = agent.service.bind(poll, &outputs, true);
        let Err(Refusal::Rule { what, reason }) = refusal else {
            panic!("{}: {refusal:?}", agent.name);
        };
        assert_eq!(what, "Poll");
        assert!(reason.contains("agent.ddl:43:1 (Poll)"), "{reason}");
        agent
            .service
            .bind(poll, &[None, Some(30), Some(1)], true)
            .expect("it is active");
    }
}

#[test]
fn a_goal_that_would_end_what_may_not_end_is_refused() {
    for mut agent in agents(TEXT) {
        agent.service.advance(1);
        agent.goal("Drive_SV", "Drive", &[7]).expect("it can start");
        let again = agent.goal("Drive_SV", "Drive", &[8]);
        assert!(matches!(again, Err(Refusal::Rule { .. })), "{again:?}");
        agent.idle(1..3);
        agent.service.advance(3);
        for refusal in [
            agent.goal("Drive_SV", "Drive", &[8]),
            agent.service.cancel(agent.contract("Drive_SV")),
        ] {
            assert!(matches!(refusal, Err(Refusal::Rule { .. })), "{refusal:?}");
        }
        agent.cycle(3);
        assert_eq!(agent.says("Drive_SV"), ("Drive", 1));
    }
}
