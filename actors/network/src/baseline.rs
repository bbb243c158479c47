//! Plans made for the whole team before the start, by someone who knows everything: the baselines
//! among the policies. They are driven by the same grants as any other plan.

use farside_worlds::{Roadmap, VertexId};

use crate::config::{Motion, NetworkConfig, Policy};
use crate::ids::RoverId;
use crate::mapf::safe_intervals::{FOREVER, TimedVisit};
use crate::mapf::{
    CoupledConfig, LacamConfig, Mission, Order, Pace, Plan, Problem, Rules, coupled, lacam,
    prioritised_in_time, reference_in_time,
};
use crate::motion::EdgeTimes;
use crate::timing::Timing;

/// Each rover's visits \[ns\], none for one that has no way; and what it took to find them.
#[derive(Debug, Default)]
pub(crate) struct Schedule {
    pub(crate) visits: Vec<(RoverId, Vec<TimedVisit>)>,
    pub(crate) expansions: u64,
}

impl Schedule {
    /// The plan of a policy that plans ahead; of another none. `missions` are those of rovers that
    /// have a way.
    ///
    /// # Errors
    /// When there is no plan, or it would take too long to find, or the policy cannot plan for this
    /// motion.
    pub(crate) fn of(
        config: &NetworkConfig,
        timing: &Timing,
        roadmap: &Roadmap,
        missions: &[(RoverId, (VertexId, VertexId))],
        stay_at_target: bool,
    ) -> Result<Option<Schedule>, String> {
        if matches!(config.policy, Policy::MaxPlus | Policy::Complete) {
            return Ok(None);
        }
        let rules = if stay_at_target {
            Rules::StayAtTarget
        } else {
            Rules::DisappearAtTarget
        };
        let (rovers, missions): (Vec<RoverId>, Vec<_>) = missions.iter().copied().unzip();
        let of_rover = |visits: Vec<Vec<TimedVisit>>| rovers.into_iter().zip(visits).collect();
        let missions = missions.into_iter().map(Mission::from).collect();
        let problem = Problem::new(roadmap, missions, rules).map_err(|error| error.to_string())?;
        if let Policy::Coupled | Policy::Lacam = config.policy {
            let (plan, expansions) = Schedule::joint(config, &problem)?;
            let visits = in_ns(plan.visits(&problem), timing.cycle.as_nanos());
            let visits = of_rover(visits);
            return Ok(Some(Schedule { visits, expansions }));
        }
        let ways = EdgeTimes { roadmap, config };
        let cycle_ns = timing.cycle.as_nanos();
        let travel = |u, v| ways.planned(u, v).as_nanos();
        let (pace, tick_ns) = match config.motion {
            Motion::Cycles => (Pace::CYCLES, cycle_ns),
            Motion::Continuous => {
                let pace = Pace {
                    travel: &travel,
                    // What a rover stands for at its entry.
                    enter: if stay_at_target { 0 } else { cycle_ns },
                    // What leaves a vertex says so, and what comes next is told.
                    headway: timing.iteration_timeout.as_nanos().max(1),
                };
                (pace, 1)
            }
        };
        let plan = match config.policy {
            Policy::Prioritised => prioritised_in_time,
            _ => reference_in_time,
        };
        let table = plan(&problem, &pace, &Order::QueuePosition);
        Ok(Some(Schedule {
            visits: of_rover(in_ns(table.ways, tick_ns)),
            expansions: 0,
        }))
    }

    /// The plan of a search over all rovers at once, and what it took to find it.
    fn joint(config: &NetworkConfig, problem: &Problem<'_>) -> Result<(Plan, u64), String> {
        let is_exact = config.policy == Policy::Coupled;
        let name = if is_exact { "coupled" } else { "lacam" };
        if config.motion == Motion::Continuous {
            return Err(format!(
                "network.policy \"{name}\" searches in whole cycles, and so cannot plan for \
                 network.motion \"continuous\"; \"reference\" can"
            ));
        }
        if !is_exact {
            if problem.rules() == Rules::DisappearAtTarget {
                let why = "network.policy \"lacam\" is for maps where rovers stay at their goals; \
                           where they queue and leave, \"reference\" always has a plan";
                return Err(why.to_owned());
            }
            let limits = LacamConfig {
                max_expansions: config.max_expansions,
                ..LacamConfig::default()
            };
            let found = lacam(problem, &limits).map_err(|error| error.to_string())?;
            return Ok((found.plan, found.expansions));
        }
        let limits = CoupledConfig {
            max_expansions: config.max_expansions,
            // The growth is what this baseline is there to show.
            independence: false,
            ..CoupledConfig::default()
        };
        let best = coupled(problem, &limits).map_err(|error| error.to_string())?;
        Ok((best.plan, best.expansions))
    }
}

/// Visits in ticks as visits in time: a rover that is at a vertex from tick t on sets out towards
/// it at that instant.
fn in_ns(mut ways: Vec<Vec<TimedVisit>>, tick_ns: u64) -> Vec<Vec<TimedVisit>> {
    let scale = |tick: u64| match tick {
        FOREVER => FOREVER,
        tick => tick * tick_ns,
    };
    for visit in ways.iter_mut().flatten() {
        visit.start = scale(visit.start);
        visit.end = scale(visit.end);
    }
    ways
}
