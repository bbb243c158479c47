//! Pictures of the closed loop, drawn from its log alone: plans beside what came of them, what was achieved over
//! time, what became of goals, and the tracks of rovers among them. The same log gives the same bytes.
//!
//! What is learnt, and one rover's resources, are drawn as for the system `misus`.

pub(super) mod account;
mod activities;
mod goals;
mod history;
mod incidents;
mod plans;
mod profile;
mod score;
mod standing;
mod tracks;

use std::sync::LazyLock;

use farside_actors::field::Place;
use farside_actors::figure::numbers::plain;
use farside_actors::figure::{Figure, ground};
use farside_actors::system::{
    PictureError, PictureInfo, PictureOption, PictureRequest, Recording, Setup,
};

use super::scenario::SurveyScenario;
use crate::assemble::names;
use crate::{chart, picture};
use history::{Cast, History};

/// The style of pictures, beside that of all figures.
static STYLE: LazyLock<String> = LazyLock::new(|| {
    [
        ground::STYLE,
        chart::STYLE,
        include_str!("picture/picture.css"),
    ]
    .concat()
});

/// The pictures that there are.
pub(super) const ALL: [PictureInfo; 6] = [
    PictureInfo {
        name: "plans",
        about: "each rover's activities as planned and as done, with its battery and memory as predicted and as \
                they were: --along names one rover",
        takes: &[PictureOption::At, PictureOption::From, PictureOption::Along],
        extras: &[],
    },
    PictureInfo {
        name: "score",
        about: "what the goals that were achieved are worth, how many there are, planning and driving, over time",
        takes: &[PictureOption::At, PictureOption::From],
        extras: &[],
    },
    PictureInfo {
        name: "goals",
        about: "how many goals are wished for, pooled, owned, being done, achieved and given up, over time",
        takes: &[PictureOption::At, PictureOption::From],
        extras: &[],
    },
    PictureInfo {
        name: "tracks",
        about: "where rovers drove until an instant, and what became of goals",
        takes: &[PictureOption::At],
        extras: &[],
    },
    picture::ALL[0],
    picture::ALL[1],
];

/// Draws one of them.
pub(super) fn draw(
    scenario: &SurveyScenario,
    name: &str,
    run: &dyn Recording,
    request: &PictureRequest,
    setup: &mut Setup<'_>,
) -> Result<Figure, PictureError> {
    if picture::ALL.iter().any(|one| one.name == name) {
        let tables = (&scenario.world, &scenario.team, &scenario.rover);
        return picture::draw(tables, name, run, request, setup);
    }
    if !ALL.iter().any(|one| one.name == name) {
        return Err(PictureError::Unknown {
            picture: name.to_owned(),
        });
    }
    let settings = scenario.settings(setup.files)?;
    let cast = Cast::new(names(&scenario.team), &scenario.parties(&settings));
    let place = Place::of(&scenario.world, setup)?;
    let history = History::read(run, cast)?;
    let span = chart::span_ns(history.end_ns, request);
    match name {
        "plans" => {
            let rovers = match request.along.as_deref() {
                None => (0..history.rovers.len()).collect(),
                along => vec![picture::rover(&history.names, along)?],
            };
            if rovers
                .iter()
                .all(|&rover| history.rovers[rover].plans.is_empty())
            {
                return Err(chart::nothing(run, "no plans of rovers", "PlanMade"));
            }
            let scene = plans::Scene {
                history: &history,
                place: &place,
                execution: &scenario.execution,
                windows: &settings.windows,
                span: span?,
            };
            Ok(scene.figure(&rovers))
        }
        "tracks" => {
            let rovers = &history.rovers;
            if rovers.iter().all(|rover| rover.moments.is_empty()) {
                return Err(chart::nothing(run, "no states of rovers", "RoverPose"));
            }
            let at_ns = chart::time_ns(history.end_ns, request.at)?;
            Ok(tracks::figure(&history, &place.field, at_ns))
        }
        _ if history.news.is_empty() => Err(chart::nothing(
            run,
            "nothing of goals",
            "GoalList, OwnerWrite and CentreWrite",
        )),
        "goals" => Ok(goals::figure(&history, &place, span?)),
        _ => Ok(score::figure(&history, &place, span?)),
    }
}

/// What a picture is of.
fn title(history: &History, (from_ns, to_ns): (u64, u64)) -> String {
    let [from, to] = [from_ns, to_ns].map(in_hours);
    let (scenario, seed) = (&history.scenario, history.seed);
    let cut = if history.is_cut {
        ", the recording is cut"
    } else {
        ""
    };
    format!("{scenario}, seed {seed}, from {from} to {to} h{cut}")
}

/// A time in hours.
fn hours(time_ns: u64) -> f64 {
    time_ns as f64 / 3.6e12
}

/// The same, to a tenth.
fn in_hours(time_ns: u64) -> String {
    plain(libm::round(10.0 * hours(time_ns)) / 10.0)
}
