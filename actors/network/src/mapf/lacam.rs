//! Plans for crowded maps: LaCAM* (Okumura, *LaCAM: search-based algorithm for quick multi-agent
//! pathfinding*, AAAI 2023; *Improving LaCAM for scalable eventually optimal multi-agent
//! pathfinding*, IJCAI 2023). A depth-first search over where the whole team is, step by step;
//! what comes after a state is proposed by [`pibt`], under constraints that are added one by one
//! each time the search comes back to it. So all steps are tried in the end, most of them never.
//!
//! The plan is then improved: a few rovers at a time are planned anew round all others, and the
//! better plan is kept (Okumura, Tamura and Defago, *Iterative refinement for real-time multi-robot
//! path planning*, IROS 2021).

mod improve;
mod pibt;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::rc::Rc;

use farside::random::{RandomKey, Stream};
use farside_worlds::VertexId;
use farside_worlds::roadmap::DistancesTo;

use super::plan::{Plan, Trip};
use super::problem::{CoupledError, Problem, Rules};
use pibt::Stepper;

/// How to search.
///
/// ```
/// use farside_network::mapf::LacamConfig;
/// assert_eq!(LacamConfig::default().improvements, 200);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LacamConfig {
    /// The most states of the team that are looked at before there is a plan. Each is kept, with
    /// some 12 bytes a rover.
    pub max_expansions: u64,
    /// How many more are looked at then, for a better one.
    pub further_expansions: u64,
    /// How many times a few rovers are planned anew at the end.
    pub improvements: u32,
    /// What ties are broken by.
    pub seed: u64,
}

impl Default for LacamConfig {
    fn default() -> Self {
        LacamConfig {
            max_expansions: 50_000,
            further_expansions: 0,
            improvements: 200,
            seed: 0,
        }
    }
}

/// A plan for a team, and what it took to find it.
///
/// ```
/// # use farside_network::mapf::Lacam;
/// assert_eq!(Lacam::default().plan.trips, []);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lacam {
    /// A plan in which all arrive.
    pub plan: Plan,
    /// States of the team that were looked at.
    pub expansions: u64,
}

/// A plan for a team that stands on a map and stays at its goals, however crowded. With enough
/// expansions one is found if there is one, and else it is certain that there is none.
///
/// ```
/// use farside_network::mapf::{LacamConfig, Mission, Problem, Rules, lacam};
/// use farside_worlds::{Roadmap, VertexId as V};
/// let text = "name = 'tee'\nboundary = [0, 2]\npositions_m = [[0, 0], [5, 0], [9, 0], [5, 5]]\n\
///             edges = [[0, 1], [1, 2], [1, 3]]";
/// let map = Roadmap::from_toml(text)?;
/// // Two change places by way of the siding.
/// let missions = [(0, 2), (2, 0)].map(|(a, b)| Mission::new(V(a), V(b)));
/// let problem = Problem::new(&map, missions.to_vec(), Rules::StayAtTarget)?;
/// let plan = lacam(&problem, &LacamConfig::default())?.plan;
/// assert_eq!(plan.conflicts(&problem), []);
/// assert_eq!(plan.metrics(&problem).arrived, 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When the limit of expansions is reached, or there is no plan.
///
/// # Panics
/// With [`Rules::DisappearAtTarget`], where there is no crowd to plan for: a bug in the caller.
pub fn lacam(problem: &Problem<'_>, config: &LacamConfig) -> Result<Lacam, CoupledError> {
    assert_eq!(problem.rules(), Rules::StayAtTarget, "rovers have to stay");
    let missions = problem.missions();
    let goals: Vec<VertexId> = missions.iter().map(|mission| mission.goal).collect();
    let left: Vec<_> = goals
        .iter()
        .map(|&goal| problem.roadmap().distances_to(goal))
        .collect();
    let starts: Rc<[VertexId]> = missions.iter().map(|mission| mission.entry).collect();
    let (mut expansions, mut limit) = (0, FIRST_TRY);
    // A search that goes astray early does not come back soon: it is begun anew, with other ties
    // and a higher limit, so that the last one has half of all expansions.
    let (states, mut draws) = loop {
        let key = RandomKey::new(config.seed).text("lacam");
        let mut draws = key.number(expansions).stream();
        let rest = config.max_expansions - expansions;
        let limits = LacamConfig {
            max_expansions: if rest < 3 * limit { rest } else { limit },
            ..*config
        };
        let stepper = Stepper::new(problem.roadmap(), &goals, &left);
        let mut search = Search::new(stepper, &goals, &left);
        let states = search.run(problem, starts.clone(), &limits, &mut draws);
        expansions += search.expansions;
        match states {
            Some(states) => break (states, draws),
            None if search.open.is_empty() => {
                return Err(CoupledError::Unsolvable { expansions });
            }
            None if expansions >= config.max_expansions => {
                return Err(CoupledError::Exhausted { expansions });
            }
            None => limit *= 2,
        }
    };
    let trips = (0..missions.len()).map(|rover| Some(trip(&states, rover)));
    let plan = Plan {
        trips: trips.collect(),
    };
    let plan = improve::improved(problem, plan, &left, config.improvements, &mut draws);
    Ok(Lacam { plan, expansions })
}

/// A rover's way through the states, to where it stays.
fn trip(states: &[Rc<[VertexId]>], rover: usize) -> Trip {
    let mut vertices: Vec<VertexId> = states.iter().map(|state| state[rover]).collect();
    while let [.., before, last] = vertices[..]
        && before == last
    {
        vertices.pop();
    }
    Trip {
        entered: 0,
        vertices,
    }
}

/// Where all rovers are, and how the search came there.
struct State {
    at: Rc<[VertexId]>,
    parent: Option<usize>,
    /// Steps so far of rovers that are not at rest at their goals.
    cost: u64,
    /// No less than this is left.
    left: u64,
    /// Since when each rover has not been at its goal: who has waited for longest goes first.
    away: Rc<[u32]>,
    order: Vec<u32>,
    /// States one step on that were found.
    next: BTreeSet<usize>,
    /// Constraints to be tried: rovers of `order`, from the first on, and where they are to go.
    constraints: VecDeque<Vec<VertexId>>,
}

struct Search<'a> {
    stepper: Stepper<'a>,
    goals: &'a [VertexId],
    left: &'a [DistancesTo<'a>],
    states: Vec<State>,
    known: BTreeMap<Rc<[VertexId]>, usize>,
    open: Vec<usize>,
    end: Option<usize>,
    expansions: u64,
}

impl<'a> Search<'a> {
    fn new(stepper: Stepper<'a>, goals: &'a [VertexId], left: &'a [DistancesTo<'a>]) -> Self {
        Search {
            stepper,
            goals,
            left,
            states: Vec::new(),
            known: BTreeMap::new(),
            open: Vec::new(),
            end: None,
            expansions: 0,
        }
    }

    /// The states on the way from `starts` to the goals, if one was found.
    fn run(
        &mut self,
        problem: &Problem<'_>,
        starts: Rc<[VertexId]>,
        config: &LacamConfig,
        draws: &mut Stream,
    ) -> Option<Vec<Rc<[VertexId]>>> {
        self.add(starts, None);
        let mut limit = config.max_expansions;
        while let Some(&at) = self.open.last() {
            let state = &self.states[at];
            if self.end.is_none() && *state.at == *self.goals {
                self.end = Some(at);
                limit = self.expansions + config.further_expansions;
            }
            let bound = state.cost + state.left;
            if self.end.is_some_and(|end| bound >= self.states[end].cost) {
                self.open.pop();
                continue;
            }
            if self.expansions >= limit {
                break;
            }
            let Some(fixed) = self.states[at].constraints.pop_front() else {
                self.open.pop();
                continue;
            };
            self.expansions += 1;
            self.constrain(problem, at, &fixed, draws);
            if let Some(next) = self.propose(at, &fixed, draws) {
                self.reach(at, next);
            }
        }
        let mut way = Vec::new();
        let mut next = Some(self.end?);
        while let Some(at) = next {
            way.push(self.states[at].at.clone());
            next = self.states[at].parent;
        }
        way.reverse();
        Some(way)
    }

    /// Adds the constraints that say one rover more.
    fn constrain(
        &mut self,
        problem: &Problem<'_>,
        at: usize,
        fixed: &[VertexId],
        draws: &mut Stream,
    ) {
        let state = &mut self.states[at];
        let Some(&rover) = state.order.get(fixed.len()) else {
            return;
        };
        let here = state.at[rover as usize];
        let mut places = problem.roadmap().neighbors(here).to_vec();
        places.push(here);
        draws.shuffle(&mut places);
        for place in places {
            state.constraints.push_back([fixed, &[place]].concat());
        }
    }

    /// The best of a few steps that keep the constraints.
    fn propose(
        &mut self,
        at: usize,
        fixed: &[VertexId],
        draws: &mut Stream,
    ) -> Option<Vec<VertexId>> {
        let state = &self.states[at];
        let fixed: Vec<(u32, VertexId)> = state.order.iter().copied().zip(fixed.to_vec()).collect();
        let mut best: Option<(u64, Vec<VertexId>)> = None;
        for _ in 0..PROPOSALS {
            let step = self.stepper.step(&state.at, &fixed, &state.order, draws);
            let Some(step) = step else { continue };
            let price = cost(&state.at, &step, self.goals) + left(self.left, &step);
            if best.as_ref().is_none_or(|(least, _)| price < *least) {
                best = Some((price, step));
            }
        }
        best.map(|(_, step)| step)
    }

    /// A step leads from one state to another.
    fn reach(&mut self, from: usize, next: Vec<VertexId>) {
        let to = match self.known.get(&next[..]) {
            Some(&to) => to,
            None => return self.add(next.into(), Some(from)),
        };
        self.open.push(to);
        self.states[from].next.insert(to);
        // What is reached for less than before is passed on.
        let mut cheaper = VecDeque::from([from]);
        while let Some(from) = cheaper.pop_front() {
            let next: Vec<usize> = self.states[from].next.iter().copied().collect();
            for to in next {
                let step = cost(&self.states[from].at, &self.states[to].at, self.goals);
                let total = self.states[from].cost + step;
                let state = &mut self.states[to];
                if total >= state.cost {
                    continue;
                }
                (state.cost, state.parent) = (total, Some(from));
                let bound = total + state.left;
                cheaper.push_back(to);
                if self.end.is_some_and(|end| bound < self.states[end].cost) {
                    self.open.push(to);
                }
            }
        }
    }

    fn add(&mut self, at: Rc<[VertexId]>, parent: Option<usize>) {
        let new = self.states.len();
        let rovers = 0..at.len();
        let is_home = |rover: usize| at[rover] == self.goals[rover];
        let (cost, away) = match parent.map(|parent| (parent, &self.states[parent])) {
            None => (0, vec![0; at.len()]),
            Some((_, before)) => {
                let away = |rover: usize| match is_home(rover) {
                    true => 0,
                    false => before.away[rover] + 1,
                };
                let step = cost(&before.at, &at, self.goals);
                (before.cost + step, rovers.clone().map(away).collect())
            }
        };
        let mut order: Vec<u32> = (0..at.len() as u32).collect();
        // Who has waited for equally long goes by the length of its way.
        let far = |rover: u32| self.left[rover as usize].from(self.states_start(rover, &at));
        order.sort_by_key(|&rover| std::cmp::Reverse((away[rover as usize], far(rover))));
        if let Some(parent) = parent {
            self.states[parent].next.insert(new);
        }
        self.states.push(State {
            parent,
            cost,
            left: left(self.left, &at),
            away: away.into(),
            order,
            next: BTreeSet::new(),
            constraints: VecDeque::from([Vec::new()]),
            at: at.clone(),
        });
        self.known.insert(at, new);
        self.open.push(new);
    }

    /// Where a rover began.
    fn states_start(&self, rover: u32, first: &[VertexId]) -> VertexId {
        let first = self.states.first().map_or(first, |state| &state.at);
        first[rover as usize]
    }
}

/// What a step costs: one for each rover that was not at rest at its goal.
fn cost(from: &[VertexId], to: &[VertexId], goals: &[VertexId]) -> u64 {
    let moves = from.iter().zip(to).zip(goals);
    let rests = moves.filter(|((from, to), goal)| from == goal && to == goal);
    (goals.len() - rests.count()) as u64
}

/// The least that is left.
fn left(left: &[DistancesTo<'_>], at: &[VertexId]) -> u64 {
    left.iter()
        .zip(at)
        .map(|(left, v)| u64::from(left.from(*v)))
        .sum()
}

/// How many states the first search looks at.
const FIRST_TRY: u64 = 1_000;

/// How many steps are proposed, of which the best is taken.
const PROPOSALS: usize = 4;
