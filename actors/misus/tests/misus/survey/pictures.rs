//! Pictures of the loop, of a whole run, of what is left of one, and of none. What is drawn here is left in the
//! folder for tests' files, for who wants to look.

use farside::SimDuration;
use farside_actors::system::PictureRequest;

use super::runs::{Run, Tape};

const PICTURES: [&str; 4] = ["plans", "score", "goals", "tracks"];

fn keep(name: &str, svg: &str) {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
    std::fs::write(folder.join(format!("survey-{name}.svg")), svg).expect("it can be written");
}

fn hours(from_h: u64, at_h: u64) -> PictureRequest {
    PictureRequest {
        from: Some(SimDuration::from_secs(3600 * from_h)),
        at: Some(SimDuration::from_secs(3600 * at_h)),
        ..PictureRequest::default()
    }
}

fn count(svg: &str, part: &str) -> usize {
    svg.matches(part).count()
}

/// Of a run in which rover 2 is lost after five hours, and that ends after more than eight.
pub(crate) fn check(run: &Run<'_>, tape: &Tape) {
    let whole = PictureRequest::default();
    for picture in PICTURES {
        let svg = run.draw(tape, picture, &whole).unwrap();
        keep(picture, &svg);
        assert_eq!(svg, run.draw(tape, picture, &whole).unwrap());
        assert!(
            svg.contains("survey &lt;&amp;&gt;") && !svg.contains("<&") && !svg.contains("NaN")
        );
    }
    a_rover_that_is_lost_is_seen_to_be(run, tape);
    what_is_left_of_a_log_is_drawn(run, tape);
    what_cannot_be_drawn_is_said(run, tape);
}

fn a_rover_that_is_lost_is_seen_to_be(run: &Run<'_>, tape: &Tape) {
    let svg = |picture: &str, request: &PictureRequest| run.draw(tape, picture, request).unwrap();
    let plans = svg("plans", &hours(0, 8));
    assert_eq!(count(&plans, r#"class="down" x"#), 1);
    // Nothing of what it does is drawn later, in a picture of that time alone.
    let lost = PictureRequest {
        along: Some("rover_02".to_owned()),
        ..hours(6, 8)
    };
    assert_eq!(
        count(&svg("plans", &lost), "<rect class=\"done\" x="),
        count_of_legend()
    );
    let others = PictureRequest {
        along: Some("rover_01".to_owned()),
        ..hours(6, 8)
    };
    assert!(count(&svg("plans", &others), "<rect class=\"done\" x=") > count_of_legend());
    for picture in ["score", "goals"] {
        assert!(
            svg(picture, &hours(0, 8)).contains(">rover_02 is down</text>"),
            "{picture}"
        );
        assert!(!svg(picture, &hours(0, 4)).contains("is down"), "{picture}");
    }
    assert!(svg("tracks", &hours(0, 8)).contains(">rover_02, down</text>"));
    assert!(!svg("tracks", &hours(0, 4)).contains(", down"));
}

/// How many samples of what is done are in the legend: one for each kind of activity.
fn count_of_legend() -> usize {
    6
}

fn what_is_left_of_a_log_is_drawn(run: &Run<'_>, tape: &Tape) {
    for part in [0, 1, 10, 1_000, tape.len() / 2, tape.len() - 1] {
        let cut = tape.cut(part);
        for picture in PICTURES {
            match run.draw(&cut, picture, &PictureRequest::default()) {
                Ok(svg) => assert!(svg.contains("the recording is cut") && !svg.contains("NaN")),
                Err(said) => assert!(
                    said.contains("expected samples of") || said.contains("expected a time span"),
                    "{part}: {said}"
                ),
            }
        }
        let has_plans = run.draw(&cut, "plans", &PictureRequest::default()).is_ok();
        assert_eq!(has_plans, part > 10, "{part}");
    }
}

fn what_cannot_be_drawn_is_said(run: &Run<'_>, tape: &Tape) {
    let refused = |tape: &Tape, picture: &str, request: &PictureRequest, expected: &str| {
        let said = run.draw(tape, picture, request).unwrap_err();
        assert!(said.contains(expected), "{said}");
    };
    let none = Tape::default();
    let whole = PictureRequest::default();
    refused(
        &none,
        "plans",
        &whole,
        "it holds no plans of rovers: expected samples of PlanMade",
    );
    refused(
        &none,
        "goals",
        &whole,
        "it holds nothing of goals: expected samples of GoalList",
    );
    refused(
        &none,
        "tracks",
        &whole,
        "it holds no states of rovers: expected samples of RoverPose",
    );
    refused(tape, "plan", &whole, "there is no picture \"plan\"");
    refused(
        tape,
        "plans",
        &hours(3, 3),
        "from 10800s to 10800s: expected a time span",
    );
    refused(tape, "score", &hours(0, 999), "the run ended at");
    let along = PictureRequest {
        along: Some("rover_2".to_owned()),
        ..PictureRequest::default()
    };
    refused(
        tape,
        "plans",
        &along,
        "expected a rover, one of rover_01, rover_02, rover_03",
    );
}
