//! Pictures of a run, drawn from its log alone: a map at an instant, and who was where along a
//! corridor over time.
//!
//! The log's attachments hold the scenario and the files it read; from them comes the ground
//! ([`Site`]). Its state samples say where rovers were. The same log gives the same bytes.

pub(crate) mod colouring;
pub(crate) mod corridor;
mod ground;
mod map;
mod site;
mod spacetime;

use farside::SimDuration;
use farside_actors::figure::Figure;
use farside_actors::link::Degrade;
use farside_actors::system::{
    PictureError as Failure, PictureInfo, PictureOption, PictureRequest, Recording, Setup,
};
use farside_worlds::VertexId;
use thiserror::Error;

pub(crate) use site::{Site, Surroundings};

use crate::ids;
use crate::scenario::NetworkScenario;
use crate::tracks::{Sighting, Tracks, TracksError};
use crate::waits::{Standing, Waits};
pub(crate) use map::coordinated;

/// The style of pictures, beside that of all figures.
const STYLE: &str = include_str!("picture/picture.css");

/// What the map shows if asked: the coordination graph (section 3.2).
const COORDINATION: &str = "coordination";

/// The pictures that there are.
pub(crate) const ALL: [PictureInfo; 2] = [
    PictureInfo {
        name: "map",
        about: "where rovers are at an instant, on the roadmap in the colours of its nodes",
        takes: &[PictureOption::At, PictureOption::With],
        extras: &[(
            COORDINATION,
            "lines between the rovers that max-plus coordinates",
        )],
    },
    PictureInfo {
        name: "corridor",
        about: "who was where along a line of vertices over time: --along auto is where rovers stand \
                in each other's way, V the corridor of a vertex, V1,V2,... the shortest ways between",
        takes: &[PictureOption::At, PictureOption::From, PictureOption::Along],
        extras: &[],
    },
];

/// Draws one of them.
pub(crate) fn draw(
    scenario: &NetworkScenario,
    picture: &str,
    run: &dyn Recording,
    request: &PictureRequest,
    setup: &mut Setup<'_>,
) -> Result<Figure, Failure> {
    let drawn = drawn(scenario, run, setup)?;
    let figure = match picture {
        "map" => {
            let coordination = request.with.iter().any(|extra| extra == COORDINATION);
            drawn.map(request.at, coordination)
        }
        "corridor" => {
            let line = request
                .along
                .as_deref()
                .map_or(Ok(VertexLine::Auto), VertexLine::read);
            let line = line.map_err(Failure::NotDrawn)?;
            drawn.time_space(&line, request.from, request.at)
        }
        other => {
            let picture = other.to_owned();
            return Err(Failure::Unknown { picture });
        }
    };
    Ok(figure?)
}

/// What pictures are drawn from.
pub(crate) fn drawn(
    scenario: &NetworkScenario,
    run: &dyn Recording,
    setup: &mut Setup<'_>,
) -> Result<Drawn, Failure> {
    Ok(Drawn {
        site: ground::site(scenario, setup)?,
        tracks: Tracks::read(run).map_err(PictureError::from)?,
        scenario: run.scenario().to_owned(),
        seed: run.seeds().run,
        degrades: setup.degrades.clone(),
    })
}

impl From<PictureError> for Failure {
    fn from(error: PictureError) -> Failure {
        match error {
            PictureError::Tracks(TracksError::Recording(error)) => error,
            error => Failure::NotDrawn(error.to_string()),
        }
    }
}

/// A run, as pictures need it.
pub(crate) struct Drawn {
    /// Where it took place.
    pub(crate) site: Site,
    /// Where rovers were.
    pub(crate) tracks: Tracks,
    /// The scenario's name.
    pub(crate) scenario: String,
    pub(crate) seed: u64,
    /// When links and processors were worse.
    pub(crate) degrades: Vec<Degrade>,
}

/// Which line of vertices a time-space diagram is of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum VertexLine {
    /// Where rovers are most in each other's way.
    Auto,
    /// The corridor of one vertex, or the shortest ways between several.
    Through(Vec<VertexId>),
}

impl VertexLine {
    /// A line as people write it: `auto`, `12` or `12,40`.
    fn read(text: &str) -> Result<VertexLine, String> {
        if text == "auto" {
            return Ok(VertexLine::Auto);
        }
        let vertex = |part: &str| {
            let number = part.trim().parse::<u32>().map(VertexId);
            number.map_err(|_| format!("along {part:?}: expected auto, or vertices as in 12,40"))
        };
        let vertices = text.split(',').map(vertex).collect::<Result<_, _>>();
        vertices.map(VertexLine::Through)
    }
}

impl Drawn {
    /// The map at a time, at the end of the run unless given; with the coordination graph or not.
    pub(crate) fn map(
        &self,
        at: Option<SimDuration>,
        coordination: bool,
    ) -> Result<Figure, PictureError> {
        let at_ns = self.time_ns(at)?;
        Ok(map::figure(self, at_ns, coordination))
    }

    /// The time-space diagram of a line, from a time to another; of the whole run unless given.
    pub(crate) fn time_space(
        &self,
        line: &VertexLine,
        from: Option<SimDuration>,
        to: Option<SimDuration>,
    ) -> Result<Figure, PictureError> {
        let to_ns = self.time_ns(to)?;
        let from_ns = from.map_or(Ok(0), |from| self.time_ns(Some(from)))?;
        if from_ns >= to_ns {
            let (from, to) = (
                SimDuration::from_nanos(from_ns),
                SimDuration::from_nanos(to_ns),
            );
            return Err(PictureError::Window { from, to });
        }
        spacetime::figure(self, line, from_ns, to_ns)
    }

    /// Who waits for whom, of rovers at an instant.
    pub(crate) fn waits(&self, rovers: &[Sighting]) -> Waits {
        let rovers: Vec<Standing> = rovers.iter().map(Sighting::standing).collect();
        Waits::of(&self.site.roadmap, self.site.wait_rule, &rovers)
    }

    /// The rovers of the shortest circle in a sentence, with a space before it; nothing without
    /// one.
    fn shortest_circle(&self, waits: &Waits, rovers: &[Sighting]) -> String {
        let rovers: Vec<Standing> = rovers.iter().map(Sighting::standing).collect();
        let name = |rover: u32| ids::name("rover", rover, self.site.rovers);
        let named = waits.named(name, &rovers);
        named
            .first()
            .map_or_else(String::new, |circle| format!(" {circle}."))
    }

    fn time_ns(&self, at: Option<SimDuration>) -> Result<u64, PictureError> {
        let highest = self.tracks.highest_vertex();
        if highest as usize >= self.site.roadmap.len() {
            return Err(PictureError::OffTheMap {
                vertex: highest,
                count: self.site.roadmap.len(),
            });
        }
        let end_ns = self.tracks.end_ns;
        match at {
            Some(at) if at.as_nanos() > end_ns => Err(PictureError::AfterEnd {
                at,
                end: SimDuration::from_nanos(end_ns),
            }),
            at => Ok(at.map_or(end_ns, SimDuration::as_nanos)),
        }
    }
}

/// `1 rover`, `2 rovers`.
fn counted(count: usize, what: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {what}{plural}")
}

/// Why there is no picture.
#[derive(Debug, Error)]
pub(crate) enum PictureError {
    /// Where rovers were cannot be read.
    #[error(transparent)]
    Tracks(#[from] TracksError),
    /// A rover is where there is no vertex.
    #[error(
        "its states of rovers cannot be used: a rover is at vertex {vertex}, and the roadmap has \
         {count} vertices"
    )]
    OffTheMap { vertex: u32, count: usize },
    /// A time beyond the end.
    #[error("the run ended at {end}: expected a time up to that, found {at}")]
    AfterEnd { at: SimDuration, end: SimDuration },
    /// Nothing between two times.
    #[error("expected a start before the end at {to}, found {from}")]
    Window { from: SimDuration, to: SimDuration },
    /// A vertex that is not on the map.
    #[error("{roadmap} has no vertex {vertex}: expected 0 to {last}")]
    UnknownVertex {
        vertex: u32,
        roadmap: String,
        last: u32,
    },
    /// One vertex that is in no corridor.
    #[error(
        "vertex {vertex} has {neighbors} neighbours and lies in no corridor: expected one with two, \
         or several vertices to go through"
    )]
    NotInCorridor { vertex: u32, neighbors: usize },
    /// A line that meets itself.
    #[error("the shortest ways through these vertices go through vertex {vertex} twice")]
    Twice { vertex: u32 },
    /// A map without corridors.
    #[error(
        "{roadmap} has no corridor, and no rovers wait in a circle: name vertices to go through"
    )]
    NoCorridor { roadmap: String },
}
