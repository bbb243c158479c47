//! Plans made for the whole team before the start, by someone who knows everything: the baselines
//! among the policies. They are driven by the same grants as any other plan.

use farside_worlds::{Roadmap, VertexId};

use super::config::{NetworkConfig, Policy};
use super::messages::RoverId;
use super::timing::Timing;
use crate::planning::safe_intervals::{FOREVER, TimedVisit};
use crate::planning::{
    CoupledConfig, Mission, Order, Plan, Problem, Rules, coupled, prioritised, reference,
};

/// Each rover's visits; and what it took to find them.
#[derive(Debug, Default)]
pub(crate) struct Schedule {
    pub(crate) visits: Vec<(RoverId, Vec<TimedVisit>)>,
    pub(crate) expansions: u64,
}

impl Schedule {
    /// The plan of a policy that plans ahead; of another none. `missions` are those of rovers that have
    /// a way.
    ///
    /// # Errors
    /// When there is no plan, or it would take too long to find.
    pub(crate) fn of(
        config: &NetworkConfig,
        timing: &Timing,
        roadmap: &Roadmap,
        missions: &[(RoverId, (VertexId, VertexId))],
        stays: bool,
    ) -> Result<Option<Schedule>, String> {
        if matches!(config.policy, Policy::Paper | Policy::Complete) {
            return Ok(None);
        }
        let rules = if stays { Rules::OnMap } else { Rules::Queues };
        let all = missions
            .iter()
            .map(|&(_, (entry, goal))| Mission::new(entry, goal));
        let problem = Problem::new(roadmap, all.collect(), rules);
        let problem = problem.map_err(|error| error.to_string())?;
        let (plan, expansions) = match config.policy {
            Policy::Prioritised => (prioritised(&problem, &Order::QueuePosition).plan, 0),
            Policy::Coupled => {
                let limits = CoupledConfig {
                    max_expansions: config.max_expansions,
                    // The growth is what this baseline is there to show.
                    independence: false,
                    ..CoupledConfig::default()
                };
                let best = coupled(&problem, &limits).map_err(|error| error.to_string())?;
                (best.plan, best.expansions)
            }
            _ => (reference(&problem, &Order::QueuePosition).plan, 0),
        };
        let rovers = missions.iter().map(|(rover, _)| *rover);
        let visits = timed(&plan, &problem, timing.cycle.as_nanos());
        Ok(Some(Schedule {
            visits: rovers.zip(visits).collect(),
            expansions,
        }))
    }
}

/// A plan in cycles as visits in time: a rover that is at a vertex from cycle c on sets out towards it
/// at the start of that cycle.
fn timed(plan: &Plan, problem: &Problem<'_>, cycle_ns: u64) -> Vec<Vec<TimedVisit>> {
    let rover = |stays: Vec<crate::planning::Visit>| {
        let visit = |stay: crate::planning::Visit| TimedVisit {
            vertex: stay.vertex,
            start: u64::from(stay.entered) * cycle_ns,
            end: stay.left.map_or(FOREVER, |left| u64::from(left) * cycle_ns),
        };
        stays.into_iter().map(visit).collect()
    };
    plan.visits(problem).into_iter().map(rover).collect()
}
