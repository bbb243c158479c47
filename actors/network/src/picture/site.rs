//! The ground that pictures are drawn on.

use std::sync::Arc;

use farside::SimDuration;
use farside_worlds::{HeightField, Roadmap, SensorNetwork};

use crate::waits::WaitRule;

/// Where a run took place, as its pictures need it.
#[derive(Clone, Debug)]
pub(crate) struct Site {
    /// Where rovers drive.
    pub(crate) roadmap: Arc<Roadmap>,
    /// The nodes, and which vertices are whose.
    pub(crate) sensors: Arc<SensorNetwork>,
    /// What lies around.
    pub(crate) ground: Surroundings,
    /// The length of a planning cycle.
    pub(crate) cycle: SimDuration,
    /// Rovers are coordinated by max-plus, and have a coordination graph.
    pub(crate) coordinates: bool,
    /// How many rovers the team has.
    pub(crate) rovers: u32,
    /// For what they wait.
    pub(crate) wait_rule: WaitRule,
}

/// What lies around a roadmap.
#[derive(Clone, Debug)]
pub(crate) enum Surroundings {
    /// Nothing that is known.
    Unknown,
    /// Hills and hollows.
    Heights(Arc<HeightField>),
    /// Square cells that cannot be entered.
    Walls {
        /// The middle of each cell \[m\].
        middles_m: Vec<[f64; 2]>,
        /// The side of a cell \[m\].
        cell_m: f64,
    },
}
