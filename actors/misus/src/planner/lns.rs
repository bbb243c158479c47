//! A planner of the whole team: large-neighbourhood search that can be stopped at any time.
//!
//! A part of the plan is taken out (any goals, those near a place, a stretch of one rover's plan, whole rocks),
//! and the plan is filled again greedily, goal by goal and pair by pair, by what is gained over the time that it
//! takes to one of several powers. What is worse is taken with a chance that falls with how much worse it
//! is, and with the share of the operations that is used up (annealing). After P. Shaw, *Using Constraint
//! Programming and Local Search Methods to Solve Vehicle Routing Problems*, 1998, and D. Pisinger and
//! S. Ropke, *A General Heuristic for Vehicle Routing Problems*, 2007. It knows all batteries and memories,
//! which no planner of the paper does: what it finds is what a team without a network between could do.

mod insertion;
mod removal;
mod state;

use farside::random::RandomKey;
use farside_actors::settings;

use super::casper::Unmet;
use super::chain::{Chain, Visit};
use super::instance::Instance;
use insertion::Powers;
use state::State;

settings! {
    /// How the large-neighbourhood search goes.
    pub struct LnsConfig {
        /// How many operations it has: places that are tested and tasks whose times are worked out.
        pub operations: u64 = 50_000_000, 1..=1_000_000_000_000;
        /// Which share of the plan is taken out at the most.
        pub removed: f64 = 0.5, 0.0..=1.0;
        /// The temperature at the beginning, as a share of what the best plan is worth.
        pub hot: f64 = 0.02, 0.0..=1.0;
        /// The temperature at the end.
        pub cold: f64 = 0.0005, 1e-9..=1.0;
    }
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// By rover.
    pub chains: Vec<Chain>,
    /// What the plan is worth by Equation 1.
    pub score: f64,
    /// How many operations it took.
    pub operations: u64,
    /// Each time the plan got better: after how many operations, and what it was worth then.
    pub history: Vec<(u64, f64)>,
}

/// Plans for a team. The draws are at `key`.
///
/// ```
/// use farside::random::RandomKey;
/// use farside_misus::planner::instance::Instance;
/// use farside_misus::planner::lns::{LnsConfig, plan};
/// use farside_misus::planner::problem::{ProblemConfig, generate};
/// let instance = Instance::new(&generate(&ProblemConfig::default(), 1)?)?;
/// let config = LnsConfig { operations: 100_000, ..LnsConfig::default() };
/// let found = plan(&instance, &config, RandomKey::new(1))?;
/// assert!(found.chains.iter().all(|chain| chain.violation().is_none()));
/// assert!(found.history.is_sorted_by(|a, b| a.1 < b.1));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When no place is found for something mandatory.
pub fn plan(instance: &Instance, config: &LnsConfig, key: RandomKey) -> Result<Found, Unmet> {
    let mut draws = key.text("lns").stream();
    let powers = Powers::new();
    let mut state = mandatory(instance)?;
    let mut current = state.chains.clone();
    let mut best = state.chains.clone();
    let (mut value, mut best_value) = (state.value(instance), state.value(instance));
    let mut history = vec![(state.operations, state.objective.score())];
    state.mark(&mut current);
    while state.operations < config.operations {
        // Never none, so that the budget is used up even where nothing can be removed.
        state.operations += 1;
        let share = state.operations as f64 / config.operations as f64;
        let temperature = best_value.abs().max(1.0)
            * config.hot
            * libm::pow(config.cold / config.hot.max(1e-12), share);
        let planned: usize = state.chains.iter().map(|chain| chain.nodes().len()).sum();
        let most = (planned as f64 * config.removed) as usize;
        removal::remove(instance, &mut state, most.max(2), &mut draws);
        insertion::fill(instance, &mut state, &powers, &mut draws);
        // Who has not been at a place at the end of a sol may have too far to go in the next.
        let valid = state.chains.iter().all(|chain| chain.violation().is_none());
        let found = if valid {
            state.value(instance)
        } else {
            f64::NEG_INFINITY
        };
        if found >= value + temperature * libm::log(1.0 - draws.uniform()) {
            value = found;
            state.mark(&mut current);
        } else {
            state.restore(instance, &current);
        }
        if found > best_value + 1e-12 {
            if state.objective.score() > history[history.len() - 1].1 + 1e-9 {
                history.push((state.operations, state.objective.score()));
            }
            best_value = found;
            best.clone_from(&current);
        }
    }
    state.restore_all(instance, &best);
    Ok(Found {
        score: state.objective.score(),
        operations: state.operations,
        chains: best,
        history,
    })
}

/// A plan of what is mandatory: what requires nothing first.
fn mandatory(instance: &Instance) -> Result<State, Unmet> {
    let mut state = State::new(instance);
    let unmet = |chain: &Chain, task: usize| Unmet {
        rover: chain.rover(),
        task,
        lacking: chain.violation(),
    };
    if let Some(chain) = state
        .chains
        .iter()
        .find(|chain| !chain.violation().is_none())
    {
        let last = chain.nodes().last().map(|node| node.visit.task);
        return Err(unmet(chain, last.unwrap_or_default()));
    }
    let mut wanted: Vec<usize> = Vec::new();
    for goal in (0..instance.goals()).filter(|goal| instance.task(*goal).mandatory) {
        want(instance, goal, &mut wanted);
    }
    for goal in wanted {
        state.refresh(instance);
        if !insertion::put(instance, &mut state, goal) {
            let visit = Visit::new(instance, goal);
            let (found, _) = state.chains[0].best_insertion(instance, &visit);
            return Err(Unmet {
                rover: 0,
                task: goal,
                lacking: found.map_or_else(Default::default, |found| found.violation),
            });
        }
    }
    Ok(state)
}

/// A goal after all that it requires, each once.
fn want(instance: &Instance, goal: usize, wanted: &mut Vec<usize>) {
    for &other in instance.requires(goal) {
        want(instance, other, wanted);
    }
    if !wanted.contains(&goal) {
        wanted.push(goal);
    }
}
