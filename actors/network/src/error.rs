//! What can be wrong with a network-guided system.

use farside::SimDuration;
use farside_actors::link::LinkConfigError;
use farside_actors::system::SetupError;
use farside_worlds::VertexId;

use crate::config::ConfigError;

/// Why a system could not be assembled, or has no such actor.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NetworkError {
    /// A setting makes no sense.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A link cannot be.
    #[error(transparent)]
    Links(#[from] LinkConfigError),
    /// A team of none.
    #[error("team.rovers is 0, must be at least 1")]
    NoRovers,
    /// No rover can enter at one place and leave at another.
    #[error(
        "the roadmap {roadmap} has {entries} entries and {exits} exits, too few to drive between"
    )]
    Endpoints {
        /// The roadmap's name.
        roadmap: String,
        /// Its entries, as `world.endpoints` divides the boundary.
        entries: usize,
        /// Its exits.
        exits: usize,
    },
    /// A policy that plans for the whole team ahead has no plan.
    #[error("no plan for the whole team: {0}")]
    NoPlan(String),
    /// Two rovers cannot be in one place.
    #[error("two rovers have the {what} {}", .vertex.0)]
    Shared {
        /// `start` or `goal`.
        what: &'static str,
        /// Where.
        vertex: VertexId,
    },
    /// Vertices are out of the nodes' coverage where none may be.
    #[error("no node covers {} vertices: {}; world.gaps says what becomes of them", .vertices.len(), listed(.vertices))]
    Uncovered {
        /// The vertices.
        vertices: Vec<VertexId>,
    },
    /// Only reservation requests reserve crossings.
    #[error("gaps can be crossed with network.policy = \"complete\" only; close them, or use that")]
    CannotCross,
    /// Gaps leave rovers without a way: all of them, or some that stand on the map.
    #[error("{}", .all.join("; "))]
    Refused {
        /// A sentence for each.
        all: Vec<String>,
    },
    /// A vertex that the roadmap does not have.
    #[error("a rover's {what} is vertex {}, which the roadmap does not have", .vertex.0)]
    Outside {
        /// `start` or `goal`.
        what: &'static str,
        /// Where.
        vertex: VertexId,
    },
    /// Continuous motion along an edge takes longer than something that has to be longer.
    #[error(
        "the edge from vertex {} to {} is {length_m:.1} m long and takes {time}, but {limit_of} is \
         {limit}: make that longer, or network.speed or network.acceleration_limit higher",
        .edge.0.0, .edge.1.0
    )]
    SlowEdge {
        /// The edge that takes longest.
        edge: (VertexId, VertexId),
        /// Its length \[m\].
        length_m: f64,
        /// From rest to rest.
        time: SimDuration,
        /// What is too short.
        limit_of: &'static str,
        /// How long that is.
        limit: SimDuration,
    },
    /// A name in `team.only` that cannot be there.
    #[error("{message}")]
    Only {
        /// Its place in the list.
        at: usize,
        /// What was found and what was expected.
        message: String,
    },
    /// No node has the name that `network.roadmap_from` gives.
    #[error("network.roadmap_from is {name}, but there are {first} to {last}")]
    UnknownSource {
        /// The name.
        name: String,
        /// The first node.
        first: String,
        /// The last.
        last: String,
    },
}

/// `3, 7`.
fn listed(vertices: &[VertexId]) -> String {
    let all: Vec<String> = vertices.iter().map(VertexId::to_string).collect();
    all.join(", ")
}

/// The error with the key to blame.
pub(crate) fn blame(error: NetworkError) -> SetupError {
    match error {
        NetworkError::Links(error) => error.into(),
        NetworkError::Config(ConfigError::Value { key, message }) => {
            SetupError::value(&key, message)
        }
        NetworkError::Only { at, message } => {
            SetupError::value(&format!("team.only.{at}"), message)
        }
        error => SetupError::value(key_of(&error), error),
    }
}

/// The key to blame.
fn key_of(error: &NetworkError) -> &'static str {
    match error {
        NetworkError::NoRovers => "team.rovers",
        NetworkError::Endpoints { .. } => "world.endpoints",
        NetworkError::Config(ConfigError::Schedule { .. }) => "network.cycle",
        NetworkError::SlowEdge { .. } => "network.speed",
        NetworkError::Uncovered { .. }
        | NetworkError::CannotCross
        | NetworkError::Refused { .. } => "world.gaps",
        NetworkError::UnknownSource { .. } => "network.roadmap_from",
        NetworkError::Config(ConfigError::Planned { key }) => key,
        _ => "network",
    }
}
