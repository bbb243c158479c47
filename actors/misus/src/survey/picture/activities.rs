//! A rover's activities as two rows of bars: as they were planned when they began, and as they were done; marked
//! below where they ended otherwise than planned.

use farside_actors::figure::scale::text_width;
use farside_actors::figure::svg::{Area, Px, path};
use maud::{Markup, html};

use super::history::{Carried, RoverHistory};
use super::in_hours;
use crate::analysis::goals::{GoalId, Observation, Target};
use crate::shac::GoalKey;
use crate::survey::messages::{Activity, ActivityEnd};

/// How high a row of bars is, in pixels.
pub(super) const BAR: f64 = 15.0;
/// From the upper edge of the planned bars to that of the done ones.
pub(super) const ROW: f64 = 19.0;
/// How high the marks of endings are.
const MARK: f64 = 5.0;
/// All of it.
pub(super) const HEIGHT: f64 = ROW + BAR + MARK + 2.0;

/// What kinds of activities there are: what they are called, and the class of the style.
pub(super) const KINDS: [(&str, &str); 6] = [
    ("drive", "s5"),
    ("image", "s0"),
    ("spectrum", "s3"),
    ("panorama", "s2"),
    ("daily communication", "s6"),
    ("sleep", "sleep"),
];

/// How an activity ended, beside how it was planned to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    OnTime,
    Early,
    Late,
    Interrupted,
    Failed,
    /// It goes on, or nobody recorded how it ended.
    Open,
}

impl Ending {
    /// Those that are marked, with the class of the style.
    pub(super) const MARKED: [(Ending, &str, &str); 4] = [
        (Ending::Early, "ended early", "early"),
        (Ending::Late, "ended late", "late"),
        (Ending::Interrupted, "broken off", "interrupted"),
        (Ending::Failed, "failed", "failed"),
    ];

    fn class(self) -> Option<&'static str> {
        let marked = Ending::MARKED.iter();
        let mut marked = marked.filter(|(ending, ..)| *ending == self);
        marked.next().map(|(_, _, class)| *class)
    }
}

/// How an activity ended, where up to `tolerance_ns` early or late is on time.
pub(super) fn ending(carried: &Carried, tolerance_ns: u64) -> Ending {
    let Some((ended_ns, end)) = carried.ended else {
        return Ending::Open;
    };
    let planned_ns = carried.planned.ends.as_nanos();
    match end {
        ActivityEnd::Failed(_) => Ending::Failed,
        ActivityEnd::Interrupted(_) => Ending::Interrupted,
        ActivityEnd::Done if ended_ns > planned_ns.saturating_add(tolerance_ns) => Ending::Late,
        ActivityEnd::Done if ended_ns.saturating_add(tolerance_ns) < planned_ns => Ending::Early,
        ActivityEnd::Done => Ending::OnTime,
    }
}

/// Which of [`KINDS`] an activity is.
pub(super) fn kind(activity: &Activity) -> usize {
    match activity {
        Activity::Drive(_) => 0,
        Activity::Goal(GoalKey::Observation(id)) => match id.observation {
            Observation::PointImage => 1,
            Observation::PointSpectrum => 2,
            Observation::PanoramicImage | Observation::PanoramicSpectrum => 3,
        },
        Activity::Goal(GoalKey::Numbered(_)) => 1,
        Activity::Communication(_) => 4,
        Activity::Sleep => 5,
    }
}

/// An activity in words.
fn told(activity: &Activity) -> String {
    match activity {
        Activity::Goal(goal) => named(goal),
        Activity::Drive(goal) => format!("drive to {}", named(goal)),
        Activity::Communication(sol) => format!("communication of sol {}", sol + 1),
        Activity::Sleep => "sleep".to_owned(),
    }
}

/// A goal in words.
pub(super) fn named(goal: &GoalKey) -> String {
    match goal {
        GoalKey::Numbered(number) => format!("goal {number}"),
        GoalKey::Observation(id) => observed(id),
    }
}

fn observed(id: &GoalId) -> String {
    let what = match id.observation {
        Observation::PanoramicImage => "panorama",
        Observation::PanoramicSpectrum => "spectra of all around",
        Observation::PointImage => "image",
        Observation::PointSpectrum => "spectrum",
    };
    match id.target {
        Target::Rock(rock) => format!("{what} of rock {rock}"),
        Target::Square(column, row) => format!("{what} at square {column}, {row}"),
    }
}

/// The bars of a rover's activities, the upper edge of the planned ones at the top of an area whose sides are two
/// instants.
pub(super) fn draw(
    rover: &RoverHistory,
    span_ns: (u64, u64),
    tolerance_ns: u64,
    area: &Area,
) -> Markup {
    let (from_ns, to_ns) = span_ns;
    let place = |at_ns: u64| {
        let at_ns = at_ns.clamp(from_ns, to_ns) - from_ns;
        area.x(at_ns as f64 / (to_ns - from_ns) as f64)
    };
    let bar = |class: &str, (begins_ns, ends_ns): (u64, u64), top: f64, height: f64, says: &str| {
        let (left, right) = (place(begins_ns), place(ends_ns));
        let is_seen = begins_ns < to_ns && ends_ns > from_ns;
        html! {
            @if is_seen {
                rect class=(class) x=(Px(left)) y=(Px(top)) width=(Px((right - left).max(1.0)))
                    height=(Px(height)) { title { (says) } }
            }
        }
    };
    let done = area.top + ROW;
    html! {
        @for one in &rover.carried {
            @let ended_ns = rover.ended_ns(one, to_ns);
            @let planned = (one.planned.starts.as_nanos(), one.planned.ends.as_nanos());
            @let says = in_full(one, tolerance_ns);
            @let ending = ending(one, tolerance_ns);
            g class=(KINDS[kind(&one.planned.activity)].1) {
                (bar("planned", planned, area.top, BAR, &says))
                (bar("done", (one.began_ns, ended_ns), done, BAR, &says))
            }
            @if let Some(class) = ending.class() {
                (bar(class, (one.began_ns, ended_ns), done + BAR + 1.0, MARK, &says))
            }
            @if ending == Ending::Failed && (from_ns..=to_ns).contains(&ended_ns) {
                (cross((place(ended_ns), done + 0.5 * BAR)))
            }
        }
    }
}

/// Where something failed.
pub(super) fn cross((x, y): (f64, f64)) -> Markup {
    let stroke = |dx: f64| path([(x - dx, y - 4.0), (x + dx, y + 4.0)]);
    html! { path class="failure" d={ (stroke(4.0)) (stroke(-4.0)) } {} }
}

/// What was planned and done, for who points at it.
fn in_full(one: &Carried, tolerance_ns: u64) -> String {
    let planned = &one.planned;
    let [starts, ends] = [planned.starts, planned.ends].map(|at| in_hours(at.as_nanos()));
    let began = in_hours(one.began_ns);
    let ended = match one.ended {
        None => "not ended".to_owned(),
        Some((ended_ns, ActivityEnd::Done)) => {
            let how = match ending(one, tolerance_ns) {
                Ending::Early => ", early",
                Ending::Late => ", late",
                _ => "",
            };
            format!("done at {} h{how}", in_hours(ended_ns))
        }
        Some((ended_ns, ActivityEnd::Interrupted(reason))) => {
            format!("broken off at {} h ({reason:?})", in_hours(ended_ns))
        }
        Some((ended_ns, ActivityEnd::Failed(reason))) => {
            format!("failed at {} h ({reason:?})", in_hours(ended_ns))
        }
    };
    let what = told(&planned.activity);
    format!("{what}: planned from {starts} to {ends} h, begun at {began} h, {ended}")
}

/// How many ended how, in words.
pub(super) fn says<'a>(carried: impl Iterator<Item = &'a Carried>, tolerance_ns: u64) -> String {
    let endings: Vec<Ending> = carried.map(|one| ending(one, tolerance_ns)).collect();
    let count = |wanted: Ending| endings.iter().filter(|ending| **ending == wanted).count();
    let mut parts = vec![format!("{} activities", endings.len())];
    for (ending, says, _) in Ending::MARKED {
        match count(ending) {
            0 => {}
            of => parts.push(format!("{of} {says}")),
        }
    }
    parts.join(", ")
}

/// Samples of the bars, each a drawing around y 0 with its width, and what it says.
pub(super) fn legend() -> Vec<(Markup, f64, &'static str)> {
    let rect = |class: &str, y: f64, width: f64, height: f64| {
        html! { rect class=(class) x="0" y=(Px(y)) width=(Px(width)) height=(Px(height)) {} }
    };
    let mut entries = vec![(
        html! { g class="s5" { (rect("planned", -6.0, 24.0, 12.0)) } },
        24.0,
        "as planned when it began",
    )];
    for (name, class) in KINDS {
        entries.push((
            html! { g class=(class) { (rect("done", -6.0, 24.0, 12.0)) } },
            24.0,
            name,
        ));
    }
    for (ending, name, class) in Ending::MARKED {
        let sample = match ending {
            Ending::Failed => html! { (rect(class, 2.0, 24.0, MARK)) (cross((12.0, -4.0))) },
            _ => rect(class, -2.0, 24.0, MARK),
        };
        entries.push((sample, 24.0, name));
    }
    entries
}

/// How wide a legend's entry is.
pub(super) fn entry_width(entry: &(Markup, f64, &str)) -> f64 {
    entry.1 + 6.0 + text_width(entry.2, farside_actors::figure::svg::TEXT) + 18.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shac::Reason;
    use crate::survey::messages::PlannedActivity;
    use farside::SimTime;

    fn carried(planned_end_s: u64, ended: Option<(u64, ActivityEnd)>) -> Carried {
        let planned = PlannedActivity {
            activity: Activity::Drive(GoalKey::Numbered(1)),
            position_m: [0.0; 2],
            starts: SimTime::ZERO,
            ends: SimTime::from_secs(planned_end_s),
            battery_j: 0.0,
            memory_bits: 0,
        };
        Carried {
            planned,
            began_ns: 0,
            ended: ended.map(|(at_s, end)| (at_s * 1_000_000_000, end)),
        }
    }

    #[test]
    fn endings_are_told_by_the_tolerance() {
        let minute_ns = 60_000_000_000;
        let of = |ended| ending(&carried(600, ended), minute_ns);
        assert_eq!(of(None), Ending::Open);
        assert_eq!(of(Some((660, ActivityEnd::Done))), Ending::OnTime);
        assert_eq!(of(Some((661, ActivityEnd::Done))), Ending::Late);
        assert_eq!(of(Some((540, ActivityEnd::Done))), Ending::OnTime);
        assert_eq!(of(Some((539, ActivityEnd::Done))), Ending::Early);
        let interrupted = ActivityEnd::Interrupted(Reason::Time);
        assert_eq!(of(Some((600, interrupted))), Ending::Interrupted);
        let all = [
            carried(600, Some((600, ActivityEnd::Failed(Reason::Path)))),
            carried(600, Some((700, ActivityEnd::Done))),
        ];
        assert_eq!(
            says(all.iter(), minute_ns),
            "2 activities, 1 ended late, 1 failed"
        );
    }

    #[test]
    fn bars_outside_of_the_span_are_not_drawn() {
        let area = Area {
            left: 0.0,
            top: 0.0,
            width: 100.0,
            height: 40.0,
        };
        let of = |from_s: u64, to_s: u64| {
            let span = (from_s * 1_000_000_000, to_s * 1_000_000_000);
            let rover = RoverHistory {
                carried: vec![carried(600, Some((900, ActivityEnd::Done)))],
                ..RoverHistory::default()
            };
            draw(&rover, span, 60_000_000_000, &area).into_string()
        };
        assert!(of(0, 1000).contains(r#"class="planned" x="0" y="0" width="60""#));
        assert!(of(0, 1000).contains(r#"class="late""#));
        assert!(of(700, 1000).contains("done") && !of(700, 1000).contains(r#"class="planned""#));
        assert!(!of(1000, 2000).contains("rect"));
    }
}
