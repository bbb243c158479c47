//! What all actors of a survey carry: the ground as seen from orbit, how rovers are built, how they plan, who
//! takes part, and how goals are shared.

use std::sync::Arc;

use farside::SimTime;
use farside::random::RandomKey;
use farside_actors::rover::RoverConfig;

use crate::planner::casper::PlannerConfig;
use crate::shac::Settings;
use crate::sharing::Names;
use crate::site::SharedSite;
use crate::survey::execution::ExecutionConfig;

/// The name of the scientist at the site of the centre.
pub(crate) const SCIENTIST: &str = "scientist";

/// What all actors of a survey carry.
pub(crate) struct Shared {
    /// The catalogue of rocks, the sky, the rovers' names, instruments, `[learn]`. On a rover's host, its
    /// scientist has the rover's name.
    pub(crate) site: SharedSite,
    /// How rovers are built.
    pub(crate) rover: RoverConfig,
    /// `[planner]`.
    pub(crate) planner: PlannerConfig,
    /// `[execution]`.
    pub(crate) execution: ExecutionConfig,
    /// Who takes part in the protocol, and how.
    pub(crate) settings: Arc<Settings>,
    /// The actors of the protocol's parties: `planner_01` and so on for owners, `centre` (with elections
    /// `centre_01` and so on) for centres.
    pub(crate) names: Names,
    /// Where chances of planning come from.
    pub(crate) key: RandomKey,
    /// When the run ends.
    pub(crate) until: SimTime,
}
