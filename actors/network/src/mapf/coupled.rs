//! Coupled planning: the best plan for a whole team, exactly. Its cost grows exponentially with the
//! rovers that have to do with one another, which is why nobody plans a hundred like this.

use super::joint;
use super::plan::Plan;
use super::problem::{CoupledError, Objective, Problem};

/// How to search.
///
/// ```
/// assert!(farside_network::mapf::CoupledConfig::default().independence);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CoupledConfig {
    /// What is to be least.
    pub objective: Objective,
    /// The most nodes that are expanded, over all groups. A node takes some 100 to 200 bytes, and
    /// an expansion adds up to as many nodes as a vertex has neighbours, and two.
    pub max_expansions: u64,
    /// Plans rovers apart for as long as their plans do not meet (independence detection, Standley
    /// 2010). Off: all are planned as one from the start.
    pub independence: bool,
}

impl Default for CoupledConfig {
    fn default() -> Self {
        CoupledConfig {
            objective: Objective::default(),
            max_expansions: 1_000_000,
            independence: true,
        }
    }
}

/// The best plan for a team, and what it took to find it.
///
/// ```
/// # use farside_network::mapf::{Coupled, Plan};
/// let nobody = Coupled { plan: Plan::default(), cost: 0, expansions: 0, groups: vec![] };
/// assert_eq!(nobody.groups.iter().map(Vec::len).max(), None);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Coupled {
    /// A plan in which all arrive.
    pub plan: Plan,
    /// The least sum of costs, or the least makespan.
    pub cost: u64,
    /// Nodes expanded, over all groups and their forerunners. A node gives one rover its next
    /// place (operator decomposition): a step of n rovers takes n.
    pub expansions: u64,
    /// The rovers that had to be planned together, each group sorted.
    pub groups: Vec<Vec<usize>>,
}

/// The best plan for all rovers at once. Exact: no plan costs less.
///
/// Rovers may wait in their queues as they like. Rovers are planned apart at first; those whose
/// plans meet are planned together from then on. What is left is best as a whole, because each
/// group would do no better if it were alone in the world.
///
/// ```
/// use farside_network::mapf::{CoupledConfig, Mission, Problem, Rules, coupled};
/// use farside_worlds::{Roadmap, VertexId as V};
/// let text = "name = 'tee'\nboundary = [0, 2]\npositions_m = [[0, 0], [5, 0], [9, 0], [5, 5]]\n\
///             edges = [[0, 1], [1, 2], [1, 3]]";
/// let map = Roadmap::from_toml(text)?;
/// // Two change places by way of the siding: 4 cycles for one, 3 for the other.
/// let missions = [(0, 2), (2, 0)].map(|(a, b)| Mission::new(V(a), V(b)));
/// let problem = Problem::new(&map, missions.to_vec(), Rules::StayAtTarget)?;
/// let best = coupled(&problem, &CoupledConfig::default())?;
/// assert_eq!(best.cost, 7);
/// assert_eq!(best.plan.conflicts(&problem), []);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When the limit of expansions is reached, or, with
/// [`Rules::StayAtTarget`](super::Rules::StayAtTarget), when there is no plan.
pub fn coupled(problem: &Problem<'_>, config: &CoupledConfig) -> Result<Coupled, CoupledError> {
    let rovers = problem.missions().len();
    let mut plan = Plan {
        trips: vec![None; rovers],
    };
    let mut expansions = 0;
    let mut groups: Vec<Vec<usize>> = match config.independence {
        true => (0..rovers).map(|rover| vec![rover]).collect(),
        false => vec![(0..rovers).collect()],
    };
    let mut unplanned = groups.clone();
    loop {
        for group in unplanned.drain(..) {
            let (objective, limit) = (config.objective, config.max_expansions);
            let trips = joint::search(problem, &group, objective, limit, &mut expansions)?;
            for (&rover, trip) in group.iter().zip(trips) {
                plan.trips[rover] = Some(trip);
            }
        }
        let conflicts = plan.conflicts(problem);
        let Some(conflict) = conflicts.first() else {
            break;
        };
        let meets = |group: &Vec<usize>| conflict.rovers().iter().any(|r| group.contains(r));
        let (meeting, apart): (Vec<_>, Vec<_>) = groups.into_iter().partition(meets);
        assert!(meeting.len() > 1, "a group's own plan has {conflict:?}");
        let mut merged = meeting.concat();
        merged.sort_unstable();
        groups = apart;
        groups.push(merged.clone());
        unplanned.push(merged);
    }
    groups.sort_unstable();
    let metrics = plan.metrics(problem);
    let cost = match config.objective {
        Objective::SumOfCosts => metrics.sum_of_costs,
        Objective::Makespan => u64::from(metrics.makespan),
    };
    Ok(Coupled {
        plan,
        cost,
        expansions,
        groups,
    })
}
