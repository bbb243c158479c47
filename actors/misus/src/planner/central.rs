//! The central planner: which rover is assigned which goal, and what becomes of goals that are shed.
//!
//! Its plan is abstract: for each rover a tour of the places of its goals, so that all tours together are
//! short and the work is even (a multiple travelling salesman problem). It knows where rovers start, where
//! goals are and how long they take, and nothing of batteries and memory (section 3.1).
//!
//! A goal that is shed goes to the nearest rover that has not refused it. When all have, it is pooled, and
//! offered again to all. One that has been offered too often, or that nobody can do, is deleted with a
//! [`Reason`].
//!
//! [`Central`] keeps the whole of a problem's goals. Where a protocol keeps who has what, [`share`] shares out
//! what is open.

mod joint;
mod share;
mod tours;

use thiserror::Error;

use super::casper::PlannerConfig;
use super::instance::Instance;
pub use share::{Open, Shares, share};
use tours::Tours;

/// Why a goal has been given up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Reason {
    /// No sol of any rover is long enough for it within its window.
    #[error("no sol has {duration_ms} ms for it within its window")]
    NoTime {
        /// How long it takes \[ms\].
        duration_ms: i64,
    },
    /// All rovers have refused it so many times.
    #[error("all rovers have refused it, {offers} times")]
    Refused {
        /// How often it was offered to all.
        offers: u32,
    },
    /// A goal that it requires has been given up.
    #[error("goal {required}, which it requires, has been given up")]
    Requires {
        /// That goal, by number.
        required: usize,
    },
    /// It needs more rovers than there are.
    #[error("it needs {needed} rovers of {rovers}")]
    Rovers {
        /// How many it needs.
        needed: u32,
        /// How many there are.
        rovers: usize,
    },
}

/// What has become of a goal, for the centre.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// Rovers are to plan it.
    Assigned(Assignment),
    /// All rovers have refused it; it will be offered again.
    Pooled,
    /// It has been given up.
    Deleted(Reason),
}

/// Who is to plan a goal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Assignment {
    /// The goal.
    pub goal: usize,
    /// One rover, or as many as the goal needs.
    pub rovers: Vec<usize>,
    /// When it is to begin \[ms\], where several rovers have to be there at one time.
    pub start_ms: Option<i64>,
}

/// The central planner.
///
/// ```
/// use farside_misus::planner::casper::PlannerConfig;
/// use farside_misus::planner::central::{Central, State};
/// use farside_misus::planner::instance::Instance;
/// use farside_misus::planner::problem::{ProblemConfig, generate};
/// let instance = Instance::new(&generate(&ProblemConfig::default(), 1)?)?;
/// let mut central = Central::new(&instance, &PlannerConfig::default());
/// let first = central.assign_all(&instance);
/// assert_eq!(first.len(), instance.goals());
/// let rover = first[0].rovers[0];
/// let again = central.shed(&instance, first[0].goal, rover).expect("two others are left");
/// assert_ne!(again.rovers[0], rover);
/// assert!(matches!(central.state(first[0].goal), State::Assigned(_)));
/// # Ok::<(), farside_misus::planner::problem::ProblemError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Central {
    config: PlannerConfig,
    states: Vec<State>,
    tours: Tours,
    /// By goal and rover: whether the rover has refused the goal since it was last offered to all.
    refused: Vec<Vec<bool>>,
    /// By goal: how often all have refused it.
    offers: Vec<u32>,
    operations: u64,
}

impl Central {
    /// A planner that has assigned nothing yet: all goals are in the pool.
    pub fn new(instance: &Instance, config: &PlannerConfig) -> Central {
        let (goals, rovers) = (instance.goals(), instance.vehicles().len());
        Central {
            config: config.clone(),
            states: vec![State::Pooled; goals],
            tours: Tours::new(instance),
            refused: vec![vec![false; rovers]; goals],
            offers: vec![0; goals],
            operations: 0,
        }
    }

    /// What has become of a goal.
    pub fn state(&self, goal: usize) -> &State {
        &self.states[goal]
    }

    /// What was looked at so far.
    pub fn operations(&self) -> u64 {
        self.operations
    }

    /// The goals that have been given up, and why.
    pub fn deleted(&self) -> impl Iterator<Item = (usize, Reason)> + '_ {
        let states = self.states.iter().enumerate();
        states.filter_map(|(goal, state)| match state {
            State::Deleted(reason) => Some((goal, *reason)),
            _ => None,
        })
    }

    /// Assigns all goals that can be done at all, for short tours and even work.
    pub fn assign_all(&mut self, instance: &Instance) -> Vec<Assignment> {
        for goal in 0..instance.goals() {
            if let Some(reason) = hopeless(instance, goal) {
                self.delete(instance, goal, reason);
            }
        }
        let open = |goal: &usize| !matches!(self.states[*goal], State::Deleted(_));
        let goals: Vec<usize> = (0..instance.goals()).filter(open).collect();
        let (joint, single): (Vec<usize>, Vec<usize>) = goals
            .into_iter()
            .partition(|goal| instance.task(*goal).rovers > 1);
        let imbalance = self.config.imbalance;
        self.operations += self.tours.build(instance, &single, imbalance, |_, _| true);
        let mut assigned = Vec::new();
        for goal in single {
            if let Some(rover) = self.tours.owner(goal) {
                assigned.push(self.give(Assignment {
                    goal,
                    rovers: vec![rover],
                    start_ms: None,
                }));
            }
        }
        for goal in joint {
            assigned.extend(self.offer(instance, goal));
        }
        assigned
    }

    /// A rover has shed a goal: whoever is to plan it now, or nobody if it is pooled or deleted. A goal for
    /// two rovers is withdrawn from both; what required a shed goal should be shed by the rover, too.
    /// Nothing happens if the goal is not assigned to the rover.
    pub fn shed(&mut self, instance: &Instance, goal: usize, rover: usize) -> Option<Assignment> {
        self.shed_by(instance, goal, &[rover])
    }

    /// The same for a goal that these rovers have shed, none of which is asked again at once: both may shed a
    /// goal for two.
    pub fn shed_by(
        &mut self,
        instance: &Instance,
        goal: usize,
        rovers: &[usize],
    ) -> Option<Assignment> {
        let State::Assigned(assignment) = &self.states[goal] else {
            return None;
        };
        let had = rovers
            .iter()
            .filter(|rover| assignment.rovers.contains(rover));
        let had: Vec<usize> = had.copied().collect();
        if had.is_empty() {
            return None;
        }
        for rover in had {
            self.refused[goal][rover] = true;
        }
        self.tours.remove(goal);
        self.states[goal] = State::Pooled;
        self.offer(instance, goal)
    }

    /// Offers all goals of the pool to all rovers again; those that were offered too often are deleted.
    pub fn offer_pool(&mut self, instance: &Instance) -> Vec<Assignment> {
        let mut assigned = Vec::new();
        for goal in 0..instance.goals() {
            if self.states[goal] != State::Pooled {
                continue;
            }
            self.offers[goal] += 1;
            self.refused[goal].fill(false);
            if self.offers[goal] >= self.config.offers {
                let offers = self.offers[goal];
                self.delete(instance, goal, Reason::Refused { offers });
            } else {
                assigned.extend(self.offer(instance, goal));
            }
        }
        assigned
    }

    /// Offers a goal to whoever is nearest of those that have not refused it, if there are enough; a goal
    /// that requires others only to who has them.
    fn offer(&mut self, instance: &Instance, goal: usize) -> Option<Assignment> {
        let needed = instance.task(goal).rovers as usize;
        let mut near: Vec<(u64, usize)> = (0..instance.vehicles().len())
            .filter(|&rover| !self.refused[goal][rover])
            .filter(|&rover| {
                let requires = instance.requires(goal).iter();
                requires.clone().all(|&other| self.is_with(other, rover))
            })
            .map(|rover| (self.tours.away_mm(instance, goal, rover), rover))
            .collect();
        self.operations += instance.goals() as u64;
        near.sort_unstable();
        let assignment = match needed {
            1 => near.first().map(|&(_, rover)| Assignment {
                goal,
                rovers: vec![rover],
                start_ms: None,
            }),
            _ => self.appoint(instance, goal, &near),
        }?;
        for &rover in &assignment.rovers {
            self.tours.append(goal, rover);
        }
        Some(self.give(assignment))
    }

    fn is_with(&self, goal: usize, rover: usize) -> bool {
        matches!(&self.states[goal], State::Assigned(at) if at.rovers.contains(&rover))
    }

    fn give(&mut self, assignment: Assignment) -> Assignment {
        self.states[assignment.goal] = State::Assigned(assignment.clone());
        assignment
    }

    /// Gives a goal up, and all that require it.
    fn delete(&mut self, instance: &Instance, goal: usize, reason: Reason) {
        self.states[goal] = State::Deleted(reason);
        for &other in instance.required_by(goal) {
            if !matches!(self.states[other], State::Deleted(_)) {
                self.tours.remove(other);
                self.delete(instance, other, Reason::Requires { required: goal });
            }
        }
    }
}

/// Why nobody can do a goal, as far as the centre knows.
fn hopeless(instance: &Instance, goal: usize) -> Option<Reason> {
    let task = instance.task(goal);
    let (needed, rovers) = (task.rovers, instance.vehicles().len());
    if needed as usize > rovers {
        return Some(Reason::Rovers { needed, rovers });
    }
    let fits = instance.vehicles().iter().any(|vehicle| {
        vehicle.sols.iter().any(|sol| {
            let opens_ms = task.opens_ms.max(sol.opens_ms);
            task.closes_ms.min(sol.closes_ms) - opens_ms >= task.duration_ms
        })
    });
    let duration_ms = task.duration_ms;
    (!fits).then_some(Reason::NoTime { duration_ms })
}

#[cfg(test)]
mod tests;
