//! Pictures of a run, drawn from its log alone: the timelines of an agent with what its cycles cost, and
//! the drive on the ground with goals and alarms. The same log gives the same bytes.

pub(crate) mod account;
mod bars;
mod history;
mod map;
mod strips;
mod timelines;

use std::sync::LazyLock;

use farside::SimDuration;
use farside::suggest::{did_you_mean, nearest};
use farside_actors::field::Place;
use farside_actors::figure::{Figure, ground};
use farside_actors::system::{
    PictureError, PictureInfo, PictureOption, PictureRequest, Recording, Setup,
};
use farside_planning::model::Timeline;

use crate::assemble::{Minds, POLLED, Role, goals, names};
use crate::config::IdeaScenario;
use history::{AgentHistory, History, Lane, RoverHistory};

/// The style of pictures, beside that of all figures.
static STYLE: LazyLock<String> =
    LazyLock::new(|| [ground::STYLE, include_str!("picture/picture.css")].concat());

/// The pictures that there are.
pub(crate) const ALL: [PictureInfo; 2] = [
    PictureInfo {
        name: "timelines",
        about: "what the timelines of an agent said over time, with alarms and faults, and what its \
                cycles cost: --along names the agent, the first system agent unless given",
        takes: &[PictureOption::At, PictureOption::From, PictureOption::Along],
        extras: &[],
    },
    PictureInfo {
        name: "map",
        about: "where rovers drove until an instant, what became of goals, and where alarms and faults \
                came: --along names a rover, all unless given",
        takes: &[PictureOption::At, PictureOption::Along],
        extras: &[],
    },
];

/// Draws one of them.
pub(crate) fn draw(
    scenario: &IdeaScenario,
    picture: &str,
    run: &dyn Recording,
    request: &PictureRequest,
    setup: &mut Setup<'_>,
) -> Result<Figure, PictureError> {
    if !ALL.iter().any(|one| one.name == picture) {
        return Err(PictureError::Unknown {
            picture: picture.to_owned(),
        });
    }
    let along = request.along.as_deref();
    let (agents, rovers) = cast(scenario, setup)?;
    let history = History::read(run, agents, rovers)?;
    let to_ns = time_ns(&history, request.at)?;
    if picture == "map" {
        let rovers: Vec<usize> = match along {
            None => (0..history.rovers.len()).collect(),
            Some(wanted) => {
                let all = history.rovers.iter().map(|rover| rover.name.as_str());
                vec![named("a rover", wanted, all)?]
            }
        };
        if rovers
            .iter()
            .all(|&rover| history.rovers[rover].moments.is_empty())
        {
            return Err(nothing(run, "no states of rovers", "RoverPose"));
        }
        let place = Place::of(&scenario.world, setup)?;
        return Ok(map::figure(&history, &place.field, &rovers, to_ns));
    }
    let agent = match along {
        None => history.agents.iter().position(|agent| agent.is_system),
        Some(wanted) => {
            let all = history.agents.iter().map(|agent| agent.name.as_str());
            Some(named("an agent", wanted, all)?)
        }
    };
    let agent = agent.unwrap_or(0);
    let from_ns = time_ns(&history, Some(request.from.unwrap_or(SimDuration::ZERO)))?;
    if from_ns >= to_ns {
        let [from, to] = [from_ns, to_ns].map(SimDuration::from_nanos);
        let message = format!("from {from} to {to}: expected a time span");
        return Err(PictureError::NotDrawn(message));
    }
    if history.agents[agent].cycles.is_empty() {
        let what = format!("no cycles of {}", history.agents[agent].name);
        return Err(nothing(run, &what, "AgentCycle"));
    }
    Ok(timelines::figure(&history, agent, (from_ns, to_ns)))
}

/// Why there is nothing to draw.
fn nothing(run: &dyn Recording, what: &str, kind: &str) -> PictureError {
    let excluded = match run.excluded() {
        [] => String::new(),
        left_out => format!("; left out of it were {}", left_out.join(", ")),
    };
    PictureError::NotDrawn(format!(
        "it holds {what}: expected samples of {kind}{excluded}"
    ))
}

/// Which one is meant.
fn named<'a>(
    what: &str,
    wanted: &str,
    all: impl Iterator<Item = &'a str> + Clone,
) -> Result<usize, PictureError> {
    let found = all.clone().position(|name| name == wanted);
    found.ok_or_else(|| {
        let hint = nearest(wanted, all.clone());
        let hint = did_you_mean(hint.as_deref());
        let known = all.collect::<Vec<_>>().join(", ");
        PictureError::NotDrawn(format!(
            "along {wanted:?}: expected {what}, one of {known}{hint}"
        ))
    })
}

/// A time within the run; its end unless given.
fn time_ns(history: &History, at: Option<SimDuration>) -> Result<u64, PictureError> {
    let end = SimDuration::from_nanos(history.end_ns);
    match at {
        None => Ok(history.end_ns),
        Some(at) if at > end => Err(PictureError::NotDrawn(format!(
            "at {at}: the run ended at {end}"
        ))),
        Some(at) => Ok(at.as_nanos()),
    }
}

/// The agents and rovers of a scenario, of which nothing is known yet.
fn cast(
    scenario: &IdeaScenario,
    setup: &mut Setup<'_>,
) -> Result<(Vec<AgentHistory>, Vec<RoverHistory>), PictureError> {
    let minds = Minds::read(scenario, setup)?;
    let names = names(scenario);
    let goals = goals(scenario, &names, setup.problem_seed)?;
    let (mut agents, mut rovers) = (Vec::new(), Vec::new());
    for (rover, (names, goals)) in names.into_iter().zip(goals).enumerate() {
        let layers = names.agents.len();
        for (layer, name) in names.agents.into_iter().enumerate() {
            let role = Role::of(layer, layers);
            let is_system = role == Role::System;
            let config = match role {
                Role::System => &scenario.system_agent,
                Role::Mission | Role::Between => &scenario.mission_agent,
            };
            let latency_ns = config.latency.as_nanos();
            let mut agent = AgentHistory::new(name, rover, latency_ns, is_system);
            let model = minds.model(role);
            let predicate = |at: &usize| model.predicates[*at].name.clone();
            agent.lanes = model
                .timelines
                .iter()
                .map(|timeline| lane(timeline, is_system, predicate))
                .collect();
            agents.push(agent);
        }
        rovers.push(RoverHistory::new(names.rover, goals.places));
    }
    Ok((agents, rovers))
}

/// A timeline of a model, of which nothing is known yet.
fn lane(timeline: &Timeline, is_system: bool, predicate: impl Fn(&usize) -> String) -> Lane {
    // What a timeline without a default says first goes on until something is asked of it.
    let quiet = timeline.default.as_ref().or(timeline.initial.as_ref());
    let quiet: Vec<usize> = quiet.map(|filler| filler.predicate).into_iter().collect();
    let others = timeline.predicates.iter().filter(|at| !quiet.contains(at));
    Lane {
        name: timeline.name.clone(),
        predicates: others.map(&predicate).collect(),
        quiet: quiet.iter().map(&predicate).collect(),
        is_polled: is_system && POLLED.contains(&timeline.name.as_str()),
        said: Vec::new(),
    }
}

/// A time of a run as a clock shows it: `1:00.5`, `1:02:00`.
fn clock(time_ns: u64) -> String {
    let tenths = (time_ns + 50_000_000) / 100_000_000;
    let (s, tenth) = (tenths / 10, tenths % 10);
    let fraction = match tenth {
        0 => String::new(),
        tenth => format!(".{tenth}"),
    };
    let (hours, minutes, seconds) = (s / 3600, s / 60 % 60, s % 60);
    match hours {
        0 => format!("{minutes}:{seconds:02}{fraction}"),
        hours => format!("{hours}:{minutes:02}:{seconds:02}{fraction}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_as_a_clock_shows_them() {
        let shown = [0, 60_500_000_000, 599_960_000_000, 3_720_000_000_000].map(clock);
        assert_eq!(shown, ["0:00", "1:00.5", "10:00", "1:02:00"]);
    }

    #[test]
    fn an_unknown_name_is_an_error_with_the_nearest() {
        let all = ["mission", "system"];
        assert_eq!(named("an agent", "system", all.into_iter()).unwrap(), 1);
        let error = named("an agent", "sytem", all.into_iter()).unwrap_err();
        let message = error.to_string();
        assert!(message.contains("one of mission, system"), "{message}");
        assert!(
            message.contains("did you mean \"system\"?") || message.contains("`system`"),
            "{message}"
        );
    }
}
