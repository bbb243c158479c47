//! What all actors of a survey carry: the ground as seen from orbit, how rovers are built, how they plan, who
//! takes part, and how goals are shared.

use std::sync::Arc;

use farside::random::RandomKey;
use farside_actors::rover::RoverConfig;

use super::config::SurveyConfig;
use super::execution::ExecutionConfig;
use super::wishes::OwnWishes;
use crate::planner::casper::PlannerConfig;
use crate::shac::{Party, Settings};
use crate::sharing::Names;
use crate::site::SharedSite;

/// The name of the scientist at the site of the centre.
pub(crate) const SCIENTIST: &str = "scientist";

/// What all actors of a survey carry.
pub(crate) struct Shared {
    /// The catalogue of rocks, the sky, the rovers' names, instruments, `[learn]`. On a rover's host, its
    /// scientist has the rover's name.
    pub(crate) site: SharedSite,
    /// How rovers are built.
    pub(crate) rover: RoverConfig,
    /// `[survey]`.
    pub(crate) survey: SurveyConfig,
    /// `[planner]`.
    pub(crate) planner: PlannerConfig,
    /// `[execution]`.
    pub(crate) execution: ExecutionConfig,
    /// Goals of the users' own.
    pub(crate) own: OwnWishes,
    /// Where rovers start, east and north \[m\].
    pub(crate) starts_m: Vec<[f64; 2]>,
    /// Who takes part in the protocol, and how.
    pub(crate) settings: Arc<Settings>,
    /// The actors of the protocol's parties: `planner_01` and so on for owners, `centre` (with elections
    /// `centre_01` and so on) for centres.
    pub(crate) names: Names,
    /// Where chances of planning come from.
    pub(crate) key: RandomKey,
}

impl Shared {
    /// The site of the first centre, where the scientist is who closes the loop.
    pub(crate) fn site_of_centre(&self) -> u32 {
        self.settings.candidates[0]
    }

    /// Whether a party is on the host of that scientist.
    pub(crate) fn is_at_site(&self, party: Party) -> bool {
        let (Party::Owner(site) | Party::Centre(site)) = party;
        site == self.site_of_centre()
    }
}
