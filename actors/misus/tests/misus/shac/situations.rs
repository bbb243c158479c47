//! Single situations, among them the wrong turns that such protocols are known for.

use farside::{SimDuration, SimTime};
use farside_misus::shac::{
    AssignError, Calendar, CalendarError, Definitions, GoalKey, Message, OwnerError, Parameter,
    Party, Reason, Settings, SettingsError, Standing, WishError,
};

use super::team::{Team, goal, pair};

const MINUTE: SimDuration = SimDuration::from_secs(60);

fn settings(protocol: &str) -> Settings {
    Settings::new(protocol, 3, &[3]).unwrap()
}

fn key(number: u32) -> GoalKey {
    GoalKey::Numbered(number)
}

/// A team in which rover 0 has accepted goal 7.
fn owned(settings: Settings) -> Team {
    let mut team = Team::new(settings);
    team.centre(|centre, now| centre.add(now, goal(7)));
    team.centre(|centre, now| centre.assign(now, key(7), &[0]));
    team.owner(0, |owner, now| owner.accept(now, key(7)))
        .unwrap();
    team
}

/// Windows of a minute every ten; the rover falls silent when it has just been heard. The lease of
/// six hours ends, the guard passes, and the next rover has the goal within two windows.
#[test]
fn a_goal_of_a_silent_rover_is_owned_again_within_lease_and_guard_and_two_contacts() {
    let mut settings = settings("lease");
    let contact = MINUTE * 10;
    settings.windows = Calendar::repeated(SimTime::ZERO, MINUTE, contact).unwrap();
    settings.sol = MINUTE * 60 * 24;
    let (lease, guard) = (settings.protocol.lease.unwrap(), settings.guard);
    let mut team = owned(settings);
    team.pass(MINUTE * 125);
    team.silent = vec![0];
    let crashed = team.now;
    let latest = crashed + lease + guard + contact * 2;
    while team.centre.vacancies(team.now).is_empty() {
        team.pass(MINUTE);
        assert!(team.now <= latest, "not vacant at {}", team.now);
    }
    team.centre(|centre, now| centre.assign(now, key(7), &[1]));
    while team.owners[1].offers().next().is_none() {
        team.pass(MINUTE);
        assert!(team.now <= latest, "not offered at {}", team.now);
    }
    team.owner(1, |owner, now| owner.accept(now, key(7)))
        .unwrap();
    assert!(
        team.now + MINUTE * 130 > crashed + lease,
        "taken away too soon, at {}",
        team.now
    );
    // The silent rover, who is up, knows by itself that it may not start any more.
    let error = team
        .owner(0, |owner, now| owner.begin(now, key(7)))
        .unwrap_err();
    assert!(matches!(
        error,
        OwnerError::LeaseTooShort { .. } | OwnerError::NotHeld { .. }
    ));
}

/// What a rover is given when nobody has heard it for hours comes back with all else that it has, and when that is
/// too soon for it, it gets nothing.
#[test]
fn a_rover_that_is_silent_has_no_goal_for_longer_than_a_lease_after_it_was_heard() {
    let settings = settings("lease");
    let (lease, guard) = (settings.protocol.lease.unwrap(), settings.guard);
    let mut team = owned(settings);
    team.pass(MINUTE * 30);
    team.silent = vec![0];
    let heard = team.centre.heard(0).unwrap();
    team.pass(MINUTE * 300);
    team.centre(|centre, now| centre.add(now, goal(8)));
    team.centre(|centre, now| centre.assign(now, key(8), &[0]));
    team.pass(MINUTE * 25);
    team.centre(|centre, now| centre.add(now, goal(9)));
    let vacancies = team.centre.vacancies(team.now);
    assert_eq!(vacancies.len(), 1);
    assert_eq!(vacancies[0].candidates, [0, 1, 2]);
    while team.now + MINUTE * 10 + guard <= heard + lease {
        team.pass(MINUTE);
    }
    let candidates = |team: &Team| {
        let vacancies = team.centre.vacancies(team.now);
        let of = |number| {
            let vacancy = vacancies.iter().find(|one| one.goal == key(number));
            vacancy.map(|one| one.candidates.clone())
        };
        [of(7), of(8), of(9)]
    };
    // The lease of the first was given before it was last heard.
    assert_eq!(
        candidates(&team),
        [Some(vec![1, 2]), None, Some(vec![1, 2])]
    );
    while team.now < heard + lease + guard {
        team.pass(MINUTE);
    }
    let others = Some(vec![1, 2]);
    assert_eq!(candidates(&team), [others.clone(), others.clone(), others]);
    // Heard again, it gets what it has not lost.
    team.silent.clear();
    team.pass(MINUTE * 20);
    assert_eq!(candidates(&team)[2], Some(vec![0, 1, 2]));
}

#[test]
fn without_leases_a_goal_of_a_silent_rover_stays_its_own() {
    let mut team = owned(settings("assign-and-release"));
    team.silent = vec![0];
    team.pass(MINUTE * 60 * 24 * 10);
    assert_eq!(
        team.centre.standing(key(7)),
        Some(Standing::Owned { rover: 0 })
    );
}

#[test]
fn a_lease_is_prolonged_while_its_owner_is_heard() {
    let mut team = owned(settings("lease"));
    let lease_end = |team: &Team| team.owners[0].durable().held[&key(7)].lease_end;
    let before = lease_end(&team);
    team.pass(MINUTE * 60 * 24);
    assert!(lease_end(&team) > before && lease_end(&team) > team.now + MINUTE * 60 * 4);
}

/// Released by all, a goal stays in the pool until a capacity changes or a sol begins: it does not go
/// round.
#[test]
fn a_goal_that_all_released_rests() {
    let mut team = Team::new(settings("lease"));
    team.centre(|centre, now| centre.add(now, goal(7)));
    for rover in 0..3 {
        assert_eq!(
            team.centre.vacancies(team.now)[0].candidates,
            (rover..3).collect::<Vec<_>>()
        );
        team.centre(|centre, now| centre.assign(now, key(7), &[rover]));
        team.owner(rover, |owner, now| owner.accept(now, key(7)))
            .unwrap();
        team.owner(rover, |owner, now| {
            owner.release(now, key(7), Reason::Power)
        })
        .unwrap();
    }
    assert_eq!(team.centre.standing(key(7)), Some(Standing::Pooled));
    team.pass(MINUTE * 60);
    assert!(team.centre.vacancies(team.now).is_empty());
    team.owner(1, |owner, now| Ok(owner.capacity_changed(now)))
        .unwrap();
    assert_eq!(team.centre.vacancies(team.now)[0].candidates, [1]);
    team.pass(SimDuration::from_secs(88_776));
    assert_eq!(team.centre.vacancies(team.now)[0].candidates, [0, 1, 2]);
}

#[test]
fn an_activity_that_does_not_fit_into_a_lease_is_not_wished_for() {
    let mut settings = settings("lease");
    settings.protocol.lease = Some(SimDuration::from_secs(605));
    let mut team = Team::new(settings);
    let error = team.centre.add(team.now, goal(7)).unwrap_err();
    let expected = "goal Numbered(7) takes 600s, expected at most 595s: the lease less the guard";
    assert_eq!(error.to_string(), expected);
}

/// What was observed is not lost when the rover crashes before it has told anyone, and what was
/// only offered is offered again.
#[test]
fn a_crash_between_observation_and_outcome_loses_nothing() {
    let mut team = owned(settings("lease"));
    team.centre(|centre, now| centre.add(now, goal(8)));
    team.centre(|centre, now| centre.assign(now, key(8), &[0]));
    team.owner(0, |owner, now| owner.begin(now, key(7)))
        .unwrap();
    team.pass(MINUTE * 10);
    team.restart(0);
    assert!(team.owners[0].durable().held[&key(7)].started.is_some());
    team.owner(0, |owner, now| owner.done(now, key(7))).unwrap();
    assert_eq!(team.centre.standing(key(7)), Some(Standing::Achieved));
    team.pass(MINUTE * 20);
    assert_eq!(team.owners[0].offers().count(), 1);
}

#[test]
fn the_highest_bid_gets_the_goal() {
    let mut team = Team::new(settings("market"));
    team.centre(|centre, now| centre.add(now, goal(7)));
    for (rover, score) in [(0, Some(3.5)), (1, Some(9.0)), (2, None)] {
        team.owner(rover, |owner, now| owner.bid(now, key(7), score))
            .unwrap();
    }
    assert_eq!(
        team.centre.standing(key(7)),
        Some(Standing::Owned { rover: 1 })
    );
    assert_eq!(team.owners[1].offers().count(), 1);
}

#[test]
fn a_fourth_protocol_is_a_file() {
    let mut definitions = Definitions::builtin();
    let text = "
        [protocol.in-turn]
        chooser = \"least-loaded\"
        lease = \"2h\"
        reassign = \"lease\"
        give_up_after = 1
    ";
    definitions.read("in-turn.toml", text).unwrap();
    let mut settings = settings("lease");
    settings.protocol = definitions.protocol("in-turn").unwrap().clone();
    let mut team = Team::new(settings);
    for number in 0..3 {
        team.centre(|centre, now| centre.add(now, goal(number)));
    }
    for rover in 0..3 {
        let owned = Standing::Owned { rover };
        assert_eq!(team.centre.standing(key(rover)), Some(owned), "in turn");
    }
    // Whoever has the fewest goals is next; when all have refused, it is given up.
    for rover in 0..3 {
        team.owner(rover, |owner, now| owner.refuse(now, key(0), Reason::Path))
            .unwrap();
    }
    let refused = Standing::Unachievable(Reason::RefusedByAll);
    assert_eq!(team.centre.standing(key(0)), Some(refused));
}

#[test]
fn half_of_a_joint_goal_starts_only_when_both_are_bound() {
    let mut team = Team::new(settings("lease"));
    for half in pair(20) {
        team.centre(|centre, now| centre.add(now, half));
    }
    let error = team.centre.assign(team.now, key(20), &[1, 1]).unwrap_err();
    assert!(
        matches!(error, AssignError::NotCandidates { expected: 2, .. }),
        "{error}"
    );
    team.centre(|centre, now| centre.assign(now, key(20), &[1, 2]));
    team.owner(1, |owner, now| owner.accept(now, key(20)))
        .unwrap();
    let error = team
        .owner(1, |owner, now| owner.begin(now, key(20)))
        .unwrap_err();
    assert_eq!(error, OwnerError::Unconfirmed { goal: key(20) });
    let error = team
        .owner(1, |owner, now| owner.release(now, key(20), Reason::Time))
        .unwrap_err();
    assert_eq!(error, OwnerError::Bound { goal: key(20) });
    team.owner(2, |owner, now| owner.accept(now, key(21)))
        .unwrap();
    for (rover, half) in [(1, 20), (2, 21)] {
        team.owner(rover, |owner, now| owner.begin(now, key(half)))
            .unwrap();
    }
    team.owner(1, |owner, now| owner.done(now, key(20)))
        .unwrap();
    assert_ne!(team.centre.standing(key(20)), Some(Standing::Achieved));
    assert!(
        team.centre.vacancies(team.now).is_empty(),
        "the other half goes on"
    );
    team.owner(2, |owner, now| owner.done(now, key(21)))
        .unwrap();
    assert_eq!(team.centre.standing(key(20)), Some(Standing::Achieved));
    assert_eq!(team.centre.standing(key(21)), Some(Standing::Achieved));
}

#[test]
fn if_one_refuses_its_half_the_other_is_freed() {
    let mut team = Team::new(settings("lease"));
    for half in pair(20) {
        team.centre(|centre, now| centre.add(now, half));
    }
    team.centre(|centre, now| centre.assign(now, key(20), &[1, 2]));
    team.owner(1, |owner, now| owner.accept(now, key(20)))
        .unwrap();
    team.owner(2, |owner, now| owner.refuse(now, key(21), Reason::Memory))
        .unwrap();
    assert!(team.owners[1].durable().held.is_empty());
    let vacancy = &team.centre.vacancies(team.now)[0];
    assert_eq!(
        (vacancy.partner, &vacancy.candidates[..]),
        (Some(key(21)), &[0, 1][..])
    );
}

/// A withdrawn goal is dropped if it has not started, and finished if it has.
#[test]
fn goals_come_change_and_go() {
    let mut team = owned(settings("lease"));
    let mut heavier = goal(7).parameters;
    heavier.weight = 5.0;
    team.centre(|centre, now| centre.change(now, key(7), &heavier));
    assert_eq!(
        team.owners[0].durable().held[&key(7)]
            .goal
            .parameters
            .weight,
        5.0
    );
    team.centre(|centre, now| centre.withdraw(now, key(7)));
    assert!(team.owners[0].durable().held.is_empty());
    let withdrawn = Standing::Unachievable(Reason::Withdrawn);
    assert_eq!(team.centre.standing(key(7)), Some(withdrawn));
    team.centre(|centre, now| centre.add(now, goal(7)));
    team.centre(|centre, now| centre.assign(now, key(7), &[0]));
    team.owner(0, |owner, now| owner.accept(now, key(7)))
        .unwrap();
    team.owner(0, |owner, now| owner.begin(now, key(7)))
        .unwrap();
    team.centre(|centre, now| centre.withdraw(now, key(7)));
    team.owner(0, |owner, now| owner.done(now, key(7))).unwrap();
    assert_eq!(team.centre.standing(key(7)), Some(Standing::Achieved));
}

#[test]
fn only_who_is_permitted_sets_a_parameter() {
    let mut team = owned(settings("lease"));
    let mut parameters = goal(7).parameters;
    parameters.target_m = [99.0, 99.0];
    parameters.scheduled = Some(SimTime::from_secs(4000));
    let set = |team: &mut Team, parameter| {
        team.owner(0, |owner, now| {
            owner.set(now, key(7), parameter, &parameters)
        })
    };
    let error = set(&mut team, Parameter::Target).unwrap_err();
    let expected = "an owner may not set Target of a goal that is Owned";
    assert_eq!(error.to_string(), expected);
    set(&mut team, Parameter::Scheduled).unwrap();
    // Everyone is told: the centre and the other rovers.
    let record = &team.centre.durable().table[&key(7)];
    assert_eq!(record.wish.goal.parameters.scheduled, parameters.scheduled);
    let told = &team.owners[2].told_by(0).unwrap().holdings[0];
    assert_eq!((told.goal, told.scheduled), (key(7), parameters.scheduled));
    let mut longer = record.wish.goal.parameters;
    longer.duration = MINUTE * 30;
    let error = team.centre.change(team.now, key(7), &longer).unwrap_err();
    assert!(matches!(
        error,
        WishError::NotPermitted {
            parameter: Parameter::Duration,
            ..
        }
    ));
}

#[test]
fn in_windows_nothing_is_sent_outside_of_them() {
    let mut settings = settings("lease");
    settings.windows = Calendar::repeated(SimTime::from_secs(600), MINUTE, MINUTE * 30).unwrap();
    let mut team = Team::new(settings);
    team.centre(|centre, now| centre.add(now, goal(7)));
    team.centre(|centre, now| centre.assign(now, key(7), &[0]));
    assert!(team.arrived.is_empty());
    team.pass(SimDuration::from_secs(600));
    let is_assigned = |(_, to, message): &(Party, Party, Message)| {
        *to == Party::Owner(0) && matches!(message, Message::Assign(_))
    };
    assert!(team.arrived.iter().any(is_assigned));
}

#[test]
fn bad_input_is_named() {
    let never = Calendar::repeated(SimTime::ZERO, SimDuration::ZERO, MINUTE).unwrap_err();
    assert!(
        never.to_string().starts_with("the windows never open"),
        "{never}"
    );
    let empty = Calendar::listed(Vec::new()).unwrap_err();
    assert!(matches!(empty, CalendarError::NeverOpen { .. }));
    let second = SimTime::from_secs;
    let overlap = Calendar::listed(vec![(second(5), second(9)), (second(8), second(12))]);
    assert!(matches!(
        overlap,
        Err(CalendarError::Order { number: 2, .. })
    ));
    let unknown = Settings::new("leas", 3, &[3]).unwrap_err();
    assert_eq!(
        unknown.to_string(),
        "no protocol \"leas\"; did you mean \"lease\"?"
    );
    assert_eq!(
        Settings::new("lease", 0, &[3]).unwrap_err(),
        SettingsError::NoRovers
    );
    let nowhere = Settings::new("lease", 3, &[]).unwrap_err();
    assert!(matches!(nowhere, SettingsError::Candidates { .. }));
    let mut team = Team::new(settings("lease"));
    let mut odd = goal(7);
    odd.parameters.weight = f64::NAN;
    let error = team.centre.add(team.now, odd).unwrap_err();
    assert_eq!(
        error.to_string(),
        "goal Numbered(7): weight = NaN, expected a finite number"
    );
    let mut alone = goal(7);
    alone.partner = Some(alone.key);
    assert!(matches!(
        team.centre.add(team.now, alone),
        Err(WishError::OwnPartner { .. })
    ));
    assert!(matches!(
        team.centre.withdraw(team.now, key(9)),
        Err(WishError::Unknown { .. })
    ));
}
