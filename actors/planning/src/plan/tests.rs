//! Plans as JSON, there and back, and bytes that are none.

use super::*;
use proptest::prelude::*;

fn value() -> impl Strategy<Value = PlanValue> {
    prop_oneof![
        Just(PlanValue::Unbound),
        any::<bool>().prop_map(PlanValue::Truth),
        any::<i64>().prop_map(PlanValue::Number),
        ".*".prop_map(PlanValue::Symbol),
    ]
}

fn token(id: TokenId) -> impl Strategy<Value = PlanToken> {
    let arguments = proptest::collection::btree_map(".*", value(), 0..4);
    let times = proptest::array::uniform6(-1_000_i64..1_000);
    (".*", ".*", arguments, times, 0..4).prop_map(move |(timeline, predicate, all, t, origin)| {
        PlanToken {
            id,
            arguments: all.into_iter().collect(),
            start: t[0],
            end: t[1],
            start_window: [t[2], t[3]],
            end_window: [t[4], t[5]],
            origin: match origin {
                0 => Origin::Goal(timeline.clone()),
                1 => Origin::Fact(predicate.clone()),
                2 => Origin::Rule {
                    place: predicate.clone(),
                    master: 0,
                },
                _ => Origin::Filler,
            },
            effects: vec![PlanEffect {
                place: timeline.clone(),
                resource: predicate.clone(),
                does: PlanEffectKind::Consumes(PlanEnd::End),
                amount: t[0],
            }],
            timeline,
            predicate,
        }
    })
}

fn plan() -> impl Strategy<Value = Plan> {
    (".*", any::<u64>(), -1e9..1e9_f64, token(0), token(7)).prop_map(
        |(name, seed, score, first, second)| Plan {
            model: name.clone(),
            problem: name.clone(),
            horizon: 10,
            seed,
            score,
            timelines: vec![PlanTimeline {
                name: name.clone(),
                kind: PlanTimelineKind::Unary,
            }],
            resources: vec![PlanResource {
                name: name.clone(),
                kind: PlanResourceKind::RateLimited(5),
                initial: -1,
                limits: [None, Some(3)],
                changes: vec![(3, -4)],
            }],
            achieved: vec![Achieved {
                goal: name.clone(),
                token: 7,
            }],
            left_out: vec![LeftOut {
                goal: name.clone(),
                reason: name,
            }],
            constraints: vec![PlanConstraint {
                from: None,
                to: Some(Moment {
                    token: 0,
                    at: PlanEnd::Start,
                }),
                min: Some(-3),
                max: None,
                why: String::new(),
            }],
            tokens: vec![first, second],
            ..Plan::default()
        },
    )
}

proptest! {
    #[test]
    fn what_is_written_is_read(plan in plan()) {
        let text = plan.to_json();
        prop_assert_eq!(Plan::from_json(text.as_bytes()).unwrap(), plan);
    }

    #[test]
    fn any_bytes_are_a_plan_or_an_error(plan in plan(), cut in 0.0..1.0_f64, byte in any::<u8>()) {
        let mut bytes = plan.to_json().into_bytes();
        let at = (bytes.len() as f64 * cut) as usize;
        let _ = Plan::from_json(&bytes[..at]);
        bytes[at] = byte;
        let _ = Plan::from_json(&bytes);
    }
}

/// A small plan with a token, as JSON, with something replaced.
fn error_with(from: &str, to: &str) -> String {
    let text = r#"{
  "format": "farside-plan/1.0", "model": "m", "problem": "p", "horizon": 9,
  "planner": "none", "seed": 1, "operations": 2, "score": 0, "makespan": 0,
  "timelines": [{ "name": "a", "kind": "state" }],
  "tokens": [{ "id": 1, "timeline": "a", "predicate": "P", "arguments": { "x": 1 },
    "start": 0, "end": 9, "start_window": [0, 0], "end_window": [9, 9],
    "origin": { "rule": { "place": "m:1:1", "master": 1 } } }],
  "achieved": [{ "goal": "g", "token": 1 }],
  "constraints": [{ "to": { "token": 1, "at": "start" }, "min": 0 }]
}"#;
    assert!(Plan::from_json(text.as_bytes()).is_ok());
    assert!(text.contains(from), "{from}");
    let text = text.replacen(from, to, 1);
    Plan::from_json(text.as_bytes()).unwrap_err().to_string()
}

#[test]
fn errors_name_the_place_and_the_nearest_name() {
    let cases = [
        (
            "\"seed\"",
            "\"sed\"",
            "line 3, column 26: unknown field `sed`",
        ),
        ("\"seed\"", "\"sed\"", "did you mean \"seed\"?"),
        ("\"state\"", "\"stat\"", "did you mean \"state\"?"),
        (
            "1.0",
            "2.0",
            "line 2, column 30: invalid value: string \"farside-plan/2.0\", \
          expected the format \"farside-plan/1.0\"",
        ),
        (
            "\"x\": 1",
            "\"x\": 1.5",
            "expected a whole number, true, false, the name of a symbol",
        ),
        (
            "\"x\": 1",
            "\"x\": 1, \"x\": 2",
            "the argument `x` stands here twice",
        ),
        (
            "\"horizon\": 9",
            "\"horizon\": -9",
            "horizon: -9 is no horizon",
        ),
        (
            "\"start\": 0",
            "\"start\": -9223372036854775808",
            "tokens[0].start: -92",
        ),
        (
            "\"master\": 1",
            "\"master\": 2",
            "tokens[0].origin.rule.master: there is no token 2",
        ),
        (
            "\"token\": 1",
            "\"token\": 2",
            "achieved[0].token: there is no token 2",
        ),
        (
            "{ \"token\": 1, \"at\"",
            "{ \"token\": 3, \"at\"",
            "constraints[0].to.token: there is",
        ),
        (
            "\"min\": 0",
            "\"min\": 9223372036854775807",
            "constraints[0].min: 92",
        ),
        ("\"id\": 1", "\"id\": -1", "line 5"),
        ("\"id\": 1, ", "", "missing field `id`"),
    ];
    for (from, to, expected) in cases {
        let error = error_with(from, to);
        assert!(error.contains(expected), "{error}\n{expected}");
    }
    assert!(Plan::from_json(b"").is_err());
    let nested = "[".repeat(1_000_000);
    assert!(Plan::from_json(nested.as_bytes()).is_err());
    let large = vec![b' '; MAX_FILE_BYTES + 1];
    let error = Plan::from_json(&large).unwrap_err();
    assert_eq!(
        error,
        PlanError::TooLarge {
            actual_bytes: MAX_FILE_BYTES + 1
        }
    );
}
