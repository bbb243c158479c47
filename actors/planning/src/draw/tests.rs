//! What plans drawn as charts look like, in numbers and in texts that do not collide.

use super::*;
use crate::plan::{
    Achieved, LeftOut, Origin, PlanEffect, PlanEffectKind, PlanEnd, PlanResource, PlanResourceKind,
    PlanTimeline, PlanTimelineKind, PlanValue,
};
use proptest::prelude::*;

fn token(
    id: TokenId,
    timeline: &str,
    says: (&str, &[&str]),
    [start, end]: [Ticks; 2],
) -> PlanToken {
    let arguments = says.1.iter().enumerate();
    let arguments =
        arguments.map(|(place, value)| (format!("{place}"), PlanValue::Symbol((*value).into())));
    PlanToken {
        id,
        timeline: timeline.into(),
        predicate: says.0.into(),
        arguments: arguments.collect(),
        start,
        end,
        start_window: [start, start],
        end_window: [end, end],
        origin: Origin::Filler,
        effects: Vec::new(),
    }
}

fn effect(resource: &str, does: PlanEffectKind, amount: i64) -> PlanEffect {
    PlanEffect {
        place: String::new(),
        resource: resource.into(),
        does,
        amount,
    }
}

/// A day of a rover.
fn day() -> Plan {
    let timeline = |name: &str, kind| PlanTimeline {
        name: name.into(),
        kind,
    };
    let resource = |name: &str, kind, initial| PlanResource {
        name: name.into(),
        kind,
        initial,
        limits: [Some(0), Some(initial)],
        changes: Vec::new(),
    };
    let place = "k9.Location";
    let mut tokens = vec![
        token(1, place, ("At", &["base"]), [0, 12]),
        token(2, place, ("Drive", &["base", "rock_one"]), [12, 34]),
        token(3, place, ("At", &["rock_one"]), [34, 60]),
        token(4, place, ("Drive", &["rock_one", "base"]), [60, 82]),
        token(5, place, ("At", &["base"]), [82, 100]),
        token(6, "k9.Camera", ("Take", &["rock_one"]), [36, 42]),
        token(7, "k9.Camera", ("Take", &["rock_one"]), [50, 56]),
        token(8, "k9.Work", ("Heat", &[]), [30, 60]),
        token(9, "k9.Work", ("Compress", &["first"]), [42, 47]),
        token(10, "k9.Work", ("Downlink", &["<all> & \"more\""]), [84, 98]),
        token(11, "k9.Work", ("Ping", &[]), [99, 99]),
    ];
    let flexible = [
        (1, [0, 0], [12, 20]),
        (2, [12, 20], [34, 42]),
        (3, [34, 42], [60, 68]),
    ];
    for (id, start, end) in flexible {
        (tokens[id - 1].start_window, tokens[id - 1].end_window) = (start, end);
    }
    tokens[4].start_window = [82, 90];
    tokens[1].effects = vec![effect(
        "k9.battery",
        PlanEffectKind::Consumes(PlanEnd::End),
        40,
    )];
    tokens[3].effects = vec![effect(
        "k9.battery",
        PlanEffectKind::Consumes(PlanEnd::End),
        40,
    )];
    for id in [6, 7, 8, 10] {
        tokens[id - 1].effects = vec![effect("k9.power", PlanEffectKind::Uses, 25)];
    }
    tokens[8].effects = vec![effect("k9.power", PlanEffectKind::Uses, 90)];
    let achieved = |goal: &str, token| Achieved {
        goal: goal.into(),
        token,
    };
    Plan {
        model: "rover.ddl".into(),
        problem: "day 1".into(),
        horizon: 100,
        planner: "repair".into(),
        score: 3.5,
        makespan: 98,
        timelines: vec![
            timeline(place, PlanTimelineKind::State),
            timeline("k9.Camera", PlanTimelineKind::Unary),
            timeline("k9.Work", PlanTimelineKind::Free),
            timeline("k9.Nothing", PlanTimelineKind::Free),
        ],
        resources: vec![
            PlanResource {
                changes: vec![(40, 15)],
                limits: [Some(10), None],
                ..resource("k9.battery", PlanResourceKind::Depletable, 70)
            },
            resource("k9.power", PlanResourceKind::Renewable, 100),
        ],
        tokens,
        achieved: vec![
            achieved("shot", 6),
            achieved("again", 7),
            achieved("downlink", 10),
        ],
        left_out: vec![LeftOut {
            goal: "far rock".into(),
            reason: "too far for the battery".into(),
        }],
        ..Plan::default()
    }
}

#[test]
fn a_chart_has_all_tokens_goals_and_resources() {
    let text = svg(&day()).unwrap();
    let file = roxmltree::Document::parse(&text).unwrap();
    let has = |text: &str| file.descendants().any(|node| node.text() == Some(text));
    for text in [
        "k9.Location",
        "k9.power",
        "At(base)",
        "shot",
        "Drive",
        "time [ticks]",
        "100",
    ] {
        assert!(has(text), "{text}");
    }
    assert!(has("left out: far rock (too far for the battery)"));
    assert!(has(
        "10 Downlink(<all> & \"more\") on k9.Work [84 98], achieves downlink"
    ));
    assert!(!has("k9.Nothing"), "an empty free timeline takes no room");
    // Over-use of power, below the battery's least level.
    assert_eq!(text.matches("class=\"wrong\"").count(), 2);
    assert_eq!(svg(&day()).unwrap(), text);
}

/// The texts of a chart, each with where it is.
fn texts(file: &roxmltree::Document<'_>) -> Vec<(String, [f64; 4])> {
    let texts = file.descendants().filter(|node| node.has_tag_name("text"));
    let texts = texts.filter(|node| node.attribute("class") != Some("halo"));
    texts
        .map(|node| {
            let number = |name| node.attribute(name).unwrap().parse::<f64>().unwrap();
            let (x, y) = (number("x"), number("y"));
            let text = node.text().unwrap_or_default().to_owned();
            let class = node.attribute("class").unwrap();
            let width = text_width(&text);
            let left = match class {
                class if class.contains("end") => x - width,
                class if class.contains("middle") => x - width / 2.0,
                _ => x,
            };
            (text, [left, y - 10.0, left + width, y + 2.0])
        })
        .collect()
}

fn collide([a, b, c, d]: [f64; 4], [e, f, g, h]: [f64; 4]) -> bool {
    a < g && e < c && b < h && f < d
}

#[test]
fn texts_do_not_collide() {
    let text = svg(&day()).unwrap();
    let file = roxmltree::Document::parse(&text).unwrap();
    let texts = texts(&file);
    for (place, (one, at)) in texts.iter().enumerate() {
        for (other, there) in &texts[..place] {
            assert!(!collide(*at, *there), "{one:?} and {other:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn any_plan_is_drawn_without_collisions(
        horizon in 1_i64..3_000,
        spans in proptest::collection::vec((0_usize..3, 0_i64..3_000, 0_i64..300, 0_usize..9), 0..25),
    ) {
        let mut plan = day();
        (plan.horizon, plan.makespan) = (horizon, horizon);
        plan.tokens.clear();
        for (id, (timeline, start, lasts, says)) in spans.into_iter().enumerate() {
            let timeline = ["k9.Location", "k9.Work", "unknown"][timeline];
            let name = format!("Predicate{says}");
            let says = (name.as_str(), &["one", "<&>"][..says % 3]);
            let token = token(id as u32, timeline, says, [start, start + lasts]);
            plan.tokens.push(token);
        }
        let text = svg(&plan).unwrap();
        let file = roxmltree::Document::parse(&text).unwrap();
        prop_assert!(!text.contains("NaN") && !text.contains("inf"));
        let texts = texts(&file);
        for (place, (one, at)) in texts.iter().enumerate() {
            for (other, there) in &texts[..place] {
                prop_assert!(!collide(*at, *there), "{:?} and {:?}", one, other);
            }
        }
    }
}

#[test]
fn levels_are_those_at_fixed_times() {
    let plan = day();
    let battery = levels::levels(&plan, &plan.resources[0]);
    assert_eq!(battery, [(0, 70), (34, 30), (40, 45), (82, 5)]);
    let mut limited = plan.resources[1].clone();
    limited.kind = PlanResourceKind::RateLimited(10);
    let starts = levels::levels(&plan, &limited);
    // Each use counts for 10 ticks from its start.
    assert_eq!(starts[..4], [(0, 100), (30, 75), (36, 50), (40, 75)]);
    assert_eq!(starts.last(), Some(&(94, 100)));
}

#[test]
fn the_axis_has_round_steps_and_ends_with_what_happens() {
    assert_eq!(
        [9, 10, 19, 45, 100, 101, 2_600].map(|until| step(until, 10)),
        [1, 1, 2, 5, 10, 10, 500]
    );
    let mut plan = day();
    assert_eq!(until(&plan), 100);
    plan.horizon = 1_000;
    assert_eq!(until(&plan), 111);
    plan.tokens.clear();
    plan.resources.clear();
    assert_eq!(until(&plan), 1_000);
}

#[test]
fn extremes_are_drawn_or_refused() {
    let mut plan = day();
    plan.horizon = i64::MAX;
    for (place, token) in plan.tokens.iter_mut().enumerate() {
        token.timeline = "x".repeat(1_000);
        token.predicate = "\u{0}".repeat(place);
        (token.start, token.end) = (i64::MIN, i64::MAX);
        token.effects = vec![effect("k9.power", PlanEffectKind::Uses, i64::MIN)];
    }
    let text = svg(&plan).unwrap();
    assert!(roxmltree::Document::parse(&text).is_ok());
    assert!(svg(&Plan::default()).is_ok());
    plan.tokens = vec![plan.tokens[0].clone(); MAX_TOKENS + 1];
    let actual = MAX_TOKENS + 1;
    assert_eq!(svg(&plan), Err(DrawError::TooMany { actual }));
}
