//! Each kind of violation is made and found; `random` compares with a brute force.

mod random;
mod rover;

use super::*;
use crate::model::{
    Body, Bound, Combination, Effect, EffectKind, Fact, Goal, Operand, Order, Parameter, Predicate,
    Relation, RelationKind, Relationship, RelationshipKind, Resource, ResourceKind, Rule, Table,
    Target, Timeline, TimelineKind, Type,
};
use crate::plan::{Achieved, LeftOut, Moment, Origin, PlanConstraint, PlanEnd, PlanValue};
use crate::temporal::Span;
use rover::*;

/// Moves a token and its windows.
fn shift(plan: &mut Plan, index: usize, [start, end]: [Ticks; 2]) {
    let token = &mut plan.tokens[index];
    (token.start, token.end) = (start, end);
    (token.start_window, token.end_window) = ([start, start], [end, end]);
}

type Change = fn(&mut Model, &mut Problem, &mut Plan);

/// What is found after a change.
fn found(change: Change) -> Vec<Violation> {
    let (mut model, mut problem) = (rover(), day());
    let mut plan = plan(&model, &problem);
    change(&mut model, &mut problem, &mut plan);
    check(&model, &problem, &plan)
}

#[test]
fn a_valid_plan_is_valid() {
    assert_eq!(found(|_, _, _| {}), []);
    // It is written and read without a change.
    let (model, problem) = (rover(), day());
    let text = plan(&model, &problem).to_json();
    let plan = Plan::from_json(text.as_bytes()).unwrap();
    assert_eq!(check(&model, &problem, &plan), []);
}

#[test]
fn each_kind_of_violation_is_found_and_told() {
    let cases: &[(Kind, &str, Change)] = &[
        (Kind::Name, "not \"day\"", |_, _, plan| {
            plan.problem = "night".into()
        }),
        (
            Kind::Name,
            "horizon is 20, the problem's 21",
            |_, problem, _| problem.horizon = 21,
        ),
        (
            Kind::Name,
            "there is no timeline \"k9.Locaton\"; did you mean \"k9.Location\"?",
            |_, _, plan| {
                plan.tokens[0].timeline = "k9.Locaton".into();
            },
        ),
        (
            Kind::Name,
            "k9.Camera never says \"Tke\"; did you mean \"Take\"?",
            |_, _, plan| {
                plan.tokens[3].predicate = "Tke".into();
            },
        ),
        (
            Kind::Name,
            "it has no argument \"place\"; did you mean \"plac\"?",
            |_, _, plan| {
                plan.tokens[3].arguments[0].0 = "plac".into();
            },
        ),
        (
            Kind::Name,
            "it has 0 arguments, and its predicate 1",
            |_, _, plan| {
                plan.tokens[3].arguments.clear();
            },
        ),
        (Kind::Name, "two tokens have the number 4", |_, _, plan| {
            plan.tokens[4].id = 4
        }),
        (
            Kind::Name,
            "there is no resource \"poer\"; did you mean \"power\"?",
            |_, _, plan| {
                plan.tokens[3].effects[0].resource = "poer".into();
            },
        ),
        (Kind::Name, "timelines are not the model's", |_, _, plan| {
            plan.timelines[0].name = "k".into();
        }),
        (
            Kind::Name,
            "of the resource \"power\" other",
            |_, _, plan| plan.resources[1].initial = 9,
        ),
        (
            Kind::Name,
            "there is no goal \"shoot\"; did you mean \"shot\"?",
            |_, _, plan| {
                plan.achieved[0].goal = "shoot".into();
            },
        ),
        (
            Kind::Domain,
            "its place is roc, no Place; did you mean \"rock\"?",
            |_, _, plan| {
                plan.tokens[3].arguments[0].1 = PlanValue::Symbol("roc".into());
            },
        ),
        (Kind::Domain, "its place is 1, no Place", |_, _, plan| {
            plan.tokens[3].arguments[0].1 = PlanValue::Number(1);
        }),
        (Kind::Inverted, "ends before it starts", |_, _, plan| {
            shift(plan, 3, [12, 10])
        }),
        (
            Kind::Horizon,
            "not in the horizon, 0 to 20",
            |_, _, plan| shift(plan, 2, [8, 21]),
        ),
        (
            Kind::Gap,
            "k9.Location has no token from 19 to 20",
            |_, _, plan| shift(plan, 2, [8, 19]),
        ),
        (
            Kind::Gap,
            "k9.Location has no token from 0 to 1",
            |_, _, plan| shift(plan, 0, [1, 5]),
        ),
        (
            Kind::Overlap,
            "k9.Camera has two tokens at once: 4 Take(rock)",
            |_, _, plan| {
                shift(plan, 4, [11, 14]);
            },
        ),
        (
            Kind::Fact,
            "day.ddl:30:1: no token is the fact At(base) on k9.Location",
            |_, problem, _| {
                problem.facts[0].finish = Span::exactly(4);
            },
        ),
        (
            Kind::Goal,
            "day.ddl:40:1: goal \"shot\" is not achieved",
            |_, _, plan| {
                plan.achieved.remove(0);
                plan.left_out.push(LeftOut {
                    goal: "shot".into(),
                    reason: String::new(),
                });
            },
        ),
        (
            Kind::Goal,
            "goal \"home\" is neither achieved nor left out",
            |_, _, plan| {
                plan.left_out.clear();
            },
        ),
        (
            Kind::Goal,
            "goal \"shot\" is listed more than once",
            |_, _, plan| {
                plan.achieved.push(plan.achieved[0].clone());
            },
        ),
        (
            Kind::Goal,
            "goal \"shot\" and token 1 At(base)",
            |_, _, plan| plan.achieved[0].token = 1,
        ),
        (
            Kind::Goal,
            "it starts at 10, which is not within [11 15]",
            |_, problem, _| {
                problem.goals[0].start = Span::new(11, 15);
            },
        ),
        (
            Kind::Goal,
            "it lasts 2, which is not within [3 inf]",
            |_, problem, _| {
                problem.goals[0].duration = Span::at_least(3);
            },
        ),
        (
            Kind::Order,
            "day.ddl:43:1: the order of goals \"shot\" and \"again\"",
            |_, problem, _| {
                problem.orders[0].distances[0].max = Bound::Value(1);
            },
        ),
        (
            Kind::Relation,
            "models/rover.ddl:11:1: there is no At(base) on k9.Location for token 4",
            |_, _, plan| {
                plan.tokens[3].arguments[0].1 = PlanValue::Symbol("base".into());
            },
        ),
        (
            Kind::Relation,
            "models/rover.ddl:21:1: there is no At(rock) on k9.Location for token 2",
            |_, _, plan| {
                plan.tokens[1].arguments[0].1 = PlanValue::Symbol("rock".into());
            },
        ),
        (
            Kind::Relationship,
            "models/rover.ddl:23:1: token 2 Drive(base, rock) on k9.Location [5 8]: \
          it does not hold that distance(?from = base, ?to = rock",
            |model, _, _| {
                model.tables[0].rows = vec![ROCK, BASE, 3, BASE, BASE, 3];
            },
        ),
        (
            Kind::Duration,
            "models/rover.ddl:10:1: token 4 Take(rock) on k9.Camera [10 12] lasts 2 ticks, \
          and must last at least 3",
            |model, _, _| {
                model.rules[0].duration = Some([Bound::Value(3), Bound::None]);
            },
        ),
        (Kind::Duration, "must last at most 3", |_, _, plan| {
            shift(plan, 0, [0, 4]);
            shift(plan, 1, [4, 8]);
        }),
        (
            Kind::Effect,
            "models/rover.ddl:12:1: token 4 Take(rock) on k9.Camera [10 12] uses power, \
          and lists no such effect",
            |_, _, plan| plan.tokens[3].effects.clear(),
        ),
        (
            Kind::Effect,
            "and the effect that it lists is another: 2 of power",
            |_, _, plan| {
                plan.tokens[3].effects[0].amount = 2;
            },
        ),
        (
            Kind::Effect,
            "lists an effect on power that no rule has",
            |_, _, plan| {
                let again = plan.tokens[3].effects[0].clone();
                plan.tokens[3].effects.push(again);
            },
        ),
        (
            Kind::Overuse,
            "models/rover.ddl:3:1: power is at -1 from 10 to 12, below its least level \
          of 0: by token 4 -3",
            |model, problem, plan| {
                problem.initial = vec![(1, 2)];
                plan.resources = Plan::new(model, problem).resources;
            },
        ),
        (
            Kind::Overuse,
            "battery is at -1 from 8 to 20",
            |model, problem, plan| {
                problem.changes = vec![(0, 3, -3)];
                plan.resources = Plan::new(model, problem).resources;
            },
        ),
        (
            Kind::Overuse,
            "battery is at 6 from 1 to 8, above its greatest level of 5: by no token",
            |model, problem, plan| {
                problem.changes = vec![(0, 1, 1)];
                plan.resources = Plan::new(model, problem).resources;
            },
        ),
        (
            Kind::Score,
            "the score is 1.5, and should be 1.75",
            |_, _, plan| plan.score = 1.5,
        ),
        (
            Kind::Makespan,
            "the makespan is 12, and should be 16",
            |_, _, plan| plan.makespan = 12,
        ),
        (
            Kind::Window,
            "the start of token 4 Take(rock) on k9.Camera [10 12] is not in its",
            |_, _, plan| {
                plan.tokens[3].start_window = [11, 12];
            },
        ),
        (
            Kind::Window,
            "token 4 Take(rock) on k9.Camera [10 12] is not in the horizon",
            |_, _, plan| {
                plan.tokens[3].end_window = [11, 21];
            },
        ),
        (
            Kind::Constraint,
            "x: from the start of token 4 to the end of token 5 it is 6 ticks",
            |_, _, plan| {
                let at = |token, at| Some(Moment { token, at });
                plan.constraints = vec![PlanConstraint {
                    from: at(4, PlanEnd::Start),
                    to: at(5, PlanEnd::End),
                    min: Some(7),
                    max: None,
                    why: "x".into(),
                }];
            },
        ),
        (Kind::Origin, "the master of token 2", |_, _, plan| {
            plan.tokens[1].origin = Origin::Rule {
                place: String::new(),
                master: 77,
            };
        }),
        (Kind::Origin, "which is no goal", |_, _, plan| {
            plan.tokens[1].origin = Origin::Goal("x".into());
        }),
        (
            Kind::Undecided,
            "a value that the rule needs is not known",
            |model, _, _| {
                model.rules[1].relationships.clear();
                model.rules[1].duration = None;
                model.rules[1].effects.clear();
                model.rules[1].relationships.push(Relationship {
                    position: line(50),
                    kind: RelationshipKind::Less,
                    operands: vec![Operand::Variable(2), Operand::Value(4)],
                });
            },
        ),
    ];
    for (kind, text, change) in cases {
        let violations = found(*change);
        let told: Vec<String> = violations.iter().map(ToString::to_string).collect();
        let is_it = |one: &Violation| one.kind == *kind && one.to_string().contains(text);
        assert!(violations.iter().any(is_it), "{kind:?} {text}\n{told:#?}");
    }
}

#[test]
fn what_hangs_on_a_token_outside_the_horizon_is_outside_too() {
    let violations = found(|_, _, plan| {
        shift(plan, 3, [18, 21]);
        plan.tokens[2].origin = Origin::Rule {
            place: "rover.ddl:22:1".into(),
            master: 2,
        };
    });
    let outside: Vec<&[TokenId]> = violations
        .iter()
        .filter(|one| one.kind == Kind::Horizon)
        .map(|one| &one.tokens[..])
        .collect();
    // The take, the drive to it, and where the drive leads.
    assert_eq!(outside, [&[2, 4][..], &[3, 4], &[4]]);
}

#[test]
fn what_could_only_be_outside_the_horizon_is_not_asked_for() {
    let ends_with_a_drive: Change = |_, problem, plan| {
        problem.goals.clear();
        problem.combinations.clear();
        problem.orders.clear();
        plan.achieved.clear();
        plan.left_out.clear();
        (plan.score, plan.makespan) = (0.0, 0);
        plan.tokens.truncate(2);
        plan.tokens[1].origin = Origin::Filler;
        shift(plan, 0, [0, 17]);
        shift(plan, 1, [17, 20]);
    };
    assert_eq!(found(ends_with_a_drive), []);
}

#[test]
fn a_use_that_ends_when_another_begins_does_not_meet_it() {
    assert_eq!(found(|_, _, plan| shift(plan, 4, [13, 16])), []);
    let meets: Change = |_, problem, plan| {
        problem.orders[0].distances = RelationKind::Meets.distances(&[]);
        shift(plan, 4, [12, 16]);
    };
    assert_eq!(found(meets), []);
    // A strict "before" is no "meets".
    let violations = found(|_, _, plan| shift(plan, 4, [12, 16]));
    assert_eq!(violations.len(), 1, "{violations:?}");
    assert_eq!(violations[0].kind, Kind::Order);
}

#[test]
fn windows_are_what_the_constraints_leave() {
    let flexible: Change = |_, _, plan| {
        let at = |token, at| Some(Moment { token, at });
        let between = |from, to, min, max| PlanConstraint {
            from,
            to,
            min,
            max,
            why: String::new(),
        };
        let exactly = |token, lasts| {
            let ends = (at(token, PlanEnd::Start), at(token, PlanEnd::End));
            between(ends.0, ends.1, Some(lasts), Some(lasts))
        };
        plan.constraints = vec![
            between(None, at(1, PlanEnd::Start), None, Some(0)),
            between(at(1, PlanEnd::End), at(2, PlanEnd::Start), Some(0), Some(0)),
            exactly(2, 3),
            between(at(2, PlanEnd::End), at(3, PlanEnd::Start), Some(0), Some(0)),
            between(at(3, PlanEnd::End), None, None, Some(-20)),
            between(at(3, PlanEnd::Start), at(4, PlanEnd::Start), Some(0), None),
            exactly(4, 2),
            between(at(4, PlanEnd::End), at(5, PlanEnd::Start), Some(1), None),
            exactly(5, 2),
        ];
        let windows = [
            ([0, 0], [0, 12]),
            ([0, 12], [3, 15]),
            ([3, 15], [20, 20]),
            ([3, 15], [5, 17]),
            ([6, 18], [8, 20]),
        ];
        for (token, (start, end)) in plan.tokens.iter_mut().zip(windows) {
            (token.start_window, token.end_window) = (start, end);
        }
    };
    assert_eq!(found(flexible), []);
    let (model, problem) = (rover(), day());
    for token in 0..5 {
        for side in 0..4 {
            let mut plan = plan(&model, &problem);
            flexible(&mut rover(), &mut day(), &mut plan);
            let token = &mut plan.tokens[token];
            let windows = [&mut token.start_window, &mut token.end_window];
            windows[side / 2 % 2][side % 2] -= 1;
            let violations = check(&model, &problem, &plan);
            assert!(
                violations.iter().any(|one| one.kind == Kind::Window),
                "{violations:?}"
            );
        }
    }
}

#[test]
fn arguments_that_are_not_bound_decide_nothing() {
    // A rule whose guard asks for a value does not hold.
    let guarded: Change = |model, _, plan| {
        model.rules[0].master.arguments[0] = Argument::Value(BASE);
        plan.tokens[3].effects.clear();
        plan.tokens[4].effects.clear();
    };
    assert_eq!(found(guarded), []);
    let unbound: Change = |model, problem, plan| {
        model.rules[0].master.arguments[0] = Argument::Value(ROCK);
        problem.goals[0].pattern.arguments[0] = Argument::Any;
        plan.tokens[3].arguments[0].1 = PlanValue::Unbound;
        plan.tokens[3].effects.clear();
    };
    assert_eq!(found(unbound), []);
    // A goal that asks for a value is not achieved.
    let wanted: Change = |_, _, plan| plan.tokens[3].arguments[0].1 = PlanValue::Unbound;
    assert_eq!(found(wanted)[0].kind, Kind::Goal);
}

#[test]
fn two_facts_need_two_tokens() {
    let twice: Change = |_, problem, _| {
        let at = |start, finish| Fact {
            start,
            finish,
            values: vec![None],
            ..problem.facts[0].clone()
        };
        // The first one fits both tokens, the second only the first.
        problem.facts = vec![at(Span::ALL, Span::ALL), at(Span::exactly(0), Span::ALL)];
    };
    assert_eq!(found(twice), []);
    let thrice: Change = |_, problem, _| {
        let any = Fact {
            start: Span::ALL,
            values: vec![None],
            ..problem.facts[0].clone()
        };
        problem.facts = vec![any.clone(), any.clone(), any];
    };
    assert_eq!(found(thrice)[0].kind, Kind::Fact);
}

#[test]
fn a_rate_limit_counts_what_was_taken_within_its_window() {
    let mut model = rover();
    model.resources[1].kind = ResourceKind::RateLimited { window_ticks: 5 };
    model.rules[0].effects[0].kind = EffectKind::Consumes(End::Start);
    let problem = day();
    let plan = plan(&model, &problem);
    let violations = check(&model, &problem, &plan);
    // Taken at 10 and 14, of 4 within 5 ticks.
    assert_eq!(violations.len(), 1, "{violations:?}");
    assert_eq!(
        (violations[0].kind, violations[0].times),
        (Kind::Overuse, Some([14, 15]))
    );
    model.resources[1].kind = ResourceKind::RateLimited { window_ticks: 4 };
    let plan = rover::plan(&model, &problem);
    assert_eq!(check(&model, &problem, &plan), []);
}

#[test]
fn a_plan_that_is_no_plan_is_told_in_bounds() {
    let (model, problem) = (rover(), day());
    let mut plan = plan(&model, &problem);
    let token = plan.tokens[3].clone();
    let many = (10..5_000).map(|id| PlanToken {
        id,
        ..token.clone()
    });
    plan.tokens.extend(many);
    plan.tokens[4].start = i64::MIN;
    plan.tokens[3].end = i64::MAX;
    plan.tokens[3].start_window = [i64::MIN, i64::MAX];
    plan.score = f64::NAN;
    let violations = check(&model, &problem, &plan);
    assert_eq!(violations.len(), MAX_VIOLATIONS);
}

#[test]
fn what_a_guard_computes_is_known_to_it() {
    // The drive's rule is for far drives alone: by the table, 3 is none.
    let far: Change = |model, _, plan| {
        let mut when = std::mem::take(&mut model.rules[1].relationships);
        when.push(Relationship {
            position: line(25),
            kind: RelationshipKind::Less,
            operands: vec![Operand::Value(3), Operand::Variable(2)],
        });
        model.rules[1].when = when;
        plan.tokens[1].effects.clear();
    };
    assert_eq!(found(far), []);
    let near: Change = |model, _, _| {
        model.rules[1].when = std::mem::take(&mut model.rules[1].relationships);
    };
    assert_eq!(found(near), []);
}

#[test]
fn what_takes_too_many_ways_to_try_is_not_decided() {
    let mut model = rover();
    model.timelines[CAMERA].kind = TimelineKind::Free;
    let problem = day();
    let mut plan = plan(&model, &problem);
    // The take of the base wants three others, the last of which is nowhere.
    let take = |argument| pattern(CAMERA, TAKE, &[argument]);
    let starts = |label, target| relation(60, RelationKind::StartsBefore, target, label);
    let any = || take(Argument::Any);
    let base = || take(Argument::Value(BASE));
    let body = vec![starts(1, any()), starts(2, any()), starts(3, base())];
    model.rules.push(rule(60, base(), &[], body));
    let mut token = plan.tokens[3].clone();
    token.effects.clear();
    plan.tokens.extend((10..300).map(|id| PlanToken {
        id,
        ..token.clone()
    }));
    plan.tokens[3].arguments[0].1 = PlanValue::Symbol("base".into());
    let violations = check(&model, &problem, &plan);
    let undecided = violations.iter().find(|one| one.kind == Kind::Undecided);
    let told = "models/rover.ddl:60:1: token 4 Take(base) on k9.Camera [10 12]: there are too many \
                ways to try";
    assert_eq!(undecided.map(ToString::to_string).as_deref(), Some(told));
}

#[test]
fn masters_may_go_in_circles() {
    let circle: Change = |_, _, plan| {
        for (token, master) in [(0, 2), (1, 3), (2, 1), (3, 3)] {
            let place = String::new();
            plan.tokens[token].origin = Origin::Rule { place, master };
        }
    };
    assert_eq!(found(circle), []);
}
