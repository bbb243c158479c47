//! The ground that pictures are drawn on.

use std::sync::Arc;

use farside::SimDuration;
use farside_worlds::{HeightField, Roadmap, SensorNetwork};

/// Where a run took place. A system that has a roadmap tells it by
/// [`Settings::site`](crate::system::Settings::site), and `farside draw` draws its runs.
///
/// ```
/// use farside_experiments::{scenario::Scenario, system::Registry};
/// let scenario = Scenario::open("network/crater-sparse", &[], &Registry::builtin())?;
/// let site = scenario.site(1)?.unwrap();
/// assert_eq!((site.roadmap.len(), site.cycle.as_secs_f64()), (178, 1.0));
/// # Ok::<(), farside_experiments::scenario::ScenarioError>(())
/// ```
#[derive(Clone, Debug)]
pub(crate) struct Site {
    /// Where rovers drive.
    pub(crate) roadmap: Arc<Roadmap>,
    /// The nodes, and which vertices are whose.
    pub(crate) sensors: Arc<SensorNetwork>,
    /// What lies around.
    pub(crate) ground: Ground,
    /// The length of a planning cycle.
    pub(crate) cycle: SimDuration,
    /// Rovers are coordinated by max-plus, and have a coordination graph.
    pub(crate) coordinates: bool,
}

/// What lies around a roadmap.
#[derive(Clone, Debug)]
pub(crate) enum Ground {
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
