//! What all actors of a survey carry: the ground as seen from orbit, how rovers are built, how they plan, who
//! takes part, and how goals are shared.

use std::sync::Arc;

use farside::random::RandomKey;
use farside_actors::rover::RoverConfig;

use super::config::SurveyConfig;
use super::execution::ExecutionConfig;
use super::wishes::OwnWishes;
use crate::planner::casper::PlannerConfig;
use crate::planner::objective::ObjectiveConfig;
use crate::shac::Settings;
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
    /// `[objective]`.
    pub(crate) objective: ObjectiveConfig,
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

    /// The scientist who closes the loop while the centre is at a site.
    pub(crate) fn lead_at(&self, site: u32) -> &str {
        match site == self.site_of_centre() {
            true => SCIENTIST,
            false => &self.site.rovers[site as usize],
        }
    }

    /// The scientist who has made an edition of the goal list.
    pub(crate) fn author_of(&self, edition: u64) -> &str {
        let sites = &self.settings.candidates;
        self.lead_at(sites[(edition % sites.len() as u64) as usize])
    }

    /// The next edition after one, of the scientist who closes the loop at a site.
    pub(crate) fn next_edition(&self, edition: u64, site: u32) -> u64 {
        let sites = self.settings.candidates.len() as u64;
        edition_after(edition, self.settings.rank(site), sites)
    }
}

/// The next edition of the site of a rank: no two sites ever make the same, and its rest tells whose it is.
fn edition_after(edition: u64, rank: u64, sites: u64) -> u64 {
    let next = edition + 1;
    next + (rank + sites - next % sites) % sites
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edition_is_newer_and_of_one_site_only() {
        for sites in 1..5 {
            for (rank, edition) in (0..sites).flat_map(|rank| (0..20).map(move |at| (rank, at))) {
                let next = edition_after(edition, rank, sites);
                assert!(next > edition && next <= edition + sites);
                assert_eq!(next % sites, rank);
            }
        }
    }
}
