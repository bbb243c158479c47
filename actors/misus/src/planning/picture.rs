//! Pictures of a run of planners, drawn from its log alone: what the plan is worth step by step, what became of
//! goals over time, and the tours that are planned. The same log gives the same bytes.

pub(super) mod account;
mod history;
mod score;
mod states;
mod tours;

use std::sync::LazyLock;

use farside_actors::figure::{Figure, ground};
use farside_actors::system::{
    PictureError, PictureInfo, PictureOption, PictureRequest, Recording, Seeds, Setup,
};

use super::config::PlanningScenario;
use super::shared::shared;
use crate::chart;
use history::History;

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
pub(super) const ALL: [PictureInfo; 3] = [
    PictureInfo {
        name: "tours",
        about: "the tours that rovers plan on the field at an instant, and the observations that are in \
                nobody's plan",
        takes: &[PictureOption::At],
        extras: &[],
    },
    PictureInfo {
        name: "score",
        about: "what the team's plan is worth, how many goals it has and how far it drives, step by step",
        takes: &[PictureOption::At],
        extras: &[],
    },
    PictureInfo {
        name: "goals",
        about: "how many goals are planned, assigned, shed, pooled and given up, over time",
        takes: &[PictureOption::At],
        extras: &[],
    },
];

/// Draws one of them.
pub(super) fn draw(
    scenario: &PlanningScenario,
    picture: &str,
    run: &dyn Recording,
    request: &PictureRequest,
    setup: &mut Setup<'_>,
) -> Result<Figure, PictureError> {
    let seeds = Seeds {
        run: setup.run_seed,
        problem: setup.problem_seed,
    };
    let shared = shared(scenario, seeds, setup.files)?;
    let history = History::read(run, &shared.rovers)?;
    let at_ns = chart::time_ns(history.end_ns, request.at)?;
    match picture {
        "tours" => Ok(tours::figure(&history, &shared, at_ns)),
        "score" => Ok(score::figure(&history, &shared, at_ns)),
        "goals" => Ok(states::figure(&history, &shared, at_ns)),
        other => Err(PictureError::Unknown {
            picture: other.to_owned(),
        }),
    }
}

/// What a picture is of.
fn title(history: &History, at_ns: u64) -> String {
    let at_min = libm::round(at_ns as f64 / 6e9) / 10.0;
    format!(
        "{}, seed {}, until {at_min} min",
        history.scenario, history.seed
    )
}
