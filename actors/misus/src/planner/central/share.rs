//! Sharing out goals that nobody has, beside those that rovers have already: the same tours, for who
//! learns from elsewhere which goals are open.

use super::tours::Tours;
use crate::planner::instance::Instance;

/// A goal that nobody has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Open {
    /// The goal.
    pub goal: usize,
    /// Which rovers may have it.
    pub candidates: Vec<usize>,
    /// Whether a rover had it or was asked for it: it goes to the nearest of the others (section 3.1).
    pub shed: bool,
}

/// Who gets what.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Shares {
    /// Goals and their rovers, in the order of the goals; without those that nobody may have.
    pub given: Vec<(usize, usize)>,
    /// What was looked at.
    pub operations: u64,
}

/// Shares out open goals: those that nobody had so that all tours together are short and the work is even,
/// those that were shed to whoever is nearest. `owned` has the goals of each rover.
///
/// ```
/// use farside_misus::planner::central::{Open, share};
/// use farside_misus::planner::instance::Instance;
/// use farside_misus::planner::problem::{ProblemConfig, generate};
/// let instance = Instance::new(&generate(&ProblemConfig::default(), 1)?)?;
/// let open = |goal| Open { goal, candidates: vec![1, 2], shed: goal == 3 };
/// let shares = share(&instance, &[vec![0], vec![1], vec![]], &[open(2), open(3)], 0.1);
/// let goals: Vec<usize> = shares.given.iter().map(|(goal, _)| *goal).collect();
/// assert_eq!(goals, [2, 3]);
/// assert!(shares.given.iter().all(|(_, rover)| [1, 2].contains(rover)));
/// # Ok::<(), farside_misus::planner::problem::ProblemError>(())
/// ```
pub fn share(instance: &Instance, owned: &[Vec<usize>], open: &[Open], imbalance: f64) -> Shares {
    let mut tours = Tours::new(instance);
    let mut operations = 0;
    for (rover, goals) in owned.iter().enumerate() {
        for &goal in goals {
            tours.insert(instance, goal, rover);
        }
        operations += goals.len() as u64;
    }
    let fresh = open.iter().filter(|one| !one.shed);
    let fresh: Vec<usize> = fresh.map(|one| one.goal).collect();
    let may_have = |goal: usize, rover: usize| {
        let one = open.iter().find(|one| one.goal == goal);
        one.is_some_and(|one| one.candidates.contains(&rover))
    };
    operations += tours.build(instance, &fresh, imbalance, may_have);
    for one in open.iter().filter(|one| one.shed) {
        let away = one.candidates.iter();
        let away = away.map(|&rover| (tours.away_mm(instance, one.goal, rover), rover));
        operations += instance.goals() as u64;
        if let Some((_, rover)) = away.min() {
            tours.insert(instance, one.goal, rover);
        }
    }
    let mut given: Vec<(usize, usize)> = open
        .iter()
        .filter_map(|one| tours.owner(one.goal).map(|rover| (one.goal, rover)))
        .collect();
    given.sort_unstable();
    Shares { given, operations }
}
