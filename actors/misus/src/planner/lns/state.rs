//! A team's plan in the making: who has which goal, what it is worth, and where others would fit.

use farside_planning::objective::Objective;

use crate::planner::chain::{Chain, Insertion, Visit};
use crate::planner::instance::Instance;

/// Where a goal fits best into a rover's plan.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    /// How much time it takes, with driving \[ms\].
    pub(super) cost_ms: i64,
    pub(super) found: Insertion,
}

/// A team's plan.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) chains: Vec<Chain>,
    pub(super) objective: Objective,
    /// By rover and goal: where the goal fits, as far as the rover's plan is still the one it was tested with.
    fits: Vec<Vec<Option<Fit>>>,
    /// By rover: whether its plan has changed since.
    stale: Vec<bool>,
    /// By rover: whether its plan has changed since it was marked.
    changed: Vec<bool>,
    pub(super) operations: u64,
}

impl State {
    /// With activities only.
    pub(super) fn new(instance: &Instance) -> State {
        let rovers = instance.vehicles().len();
        let combinations = instance.combinations().iter();
        let combinations = combinations.map(|(goals, weight)| (goals.as_slice(), *weight));
        State {
            chains: (0..rovers)
                .map(|rover| Chain::new(instance, rover))
                .collect(),
            objective: Objective::of(instance.weights().to_vec(), combinations),
            fits: vec![vec![None; instance.goals()]; rovers],
            stale: vec![true; rovers],
            changed: vec![false; rovers],
            operations: 0,
        }
    }

    /// What the plan is worth: by so little less, the more is driven, that it decides between equals only.
    pub(super) fn value(&self) -> f64 {
        let drive_ms: i64 = self.chains.iter().map(Chain::drive_ms).sum();
        self.objective.score() - drive_ms as f64 * 1e-9
    }

    pub(super) fn has(&self, goal: usize) -> bool {
        self.objective.has(goal)
    }

    /// Puts a goal in.
    pub(super) fn insert(
        &mut self,
        instance: &Instance,
        rover: usize,
        visit: Visit,
        at: &Insertion,
    ) {
        self.chains[rover].accept(instance, visit, at);
        self.objective.set(visit.task, true);
        self.touch(rover);
    }

    /// Takes a goal out, wherever it is, and all that require it.
    pub(super) fn remove(&mut self, instance: &Instance, goal: usize) {
        for other in instance.required_by(goal) {
            if self.has(*other) {
                self.remove(instance, *other);
            }
        }
        self.objective.set(goal, false);
        for rover in 0..self.chains.len() {
            if let Some(at) = self.chains[rover].position(goal) {
                self.chains[rover].remove(instance, at);
                self.touch(rover);
            }
        }
    }

    /// Takes all chains over from `from`, which has been the plan before.
    pub(super) fn restore(&mut self, instance: &Instance, from: &[Chain]) {
        let mut has = vec![false; instance.goals()];
        for (rover, chain) in from.iter().enumerate() {
            if std::mem::replace(&mut self.changed[rover], false) {
                self.chains[rover].clone_from(chain);
                self.stale[rover] = true;
            }
            chain.goals(instance).for_each(|goal| has[goal] = true);
        }
        for (goal, has) in has.into_iter().enumerate() {
            self.objective.set(goal, has);
        }
    }

    /// Takes all chains over from `from`, whatever the plan is.
    pub(super) fn restore_all(&mut self, instance: &Instance, from: &[Chain]) {
        self.changed.fill(true);
        self.restore(instance, from);
    }

    /// Copies into `to` what has changed since the last time, or since a restore.
    pub(super) fn mark(&mut self, to: &mut [Chain]) {
        for (rover, chain) in to.iter_mut().enumerate() {
            if std::mem::replace(&mut self.changed[rover], false) {
                chain.clone_from(&self.chains[rover]);
            }
        }
    }

    /// Tests where all goals that are not in the plan fit into plans that have changed.
    pub(super) fn refresh(&mut self, instance: &Instance) {
        for rover in 0..self.chains.len() {
            if !std::mem::replace(&mut self.stale[rover], false) {
                continue;
            }
            for goal in 0..instance.goals() {
                self.fits[rover][goal] = match self.has(goal) || instance.task(goal).rovers > 1 {
                    true => None,
                    false => self.fit(instance, rover, &Visit::new(instance, goal)),
                };
            }
        }
    }

    /// The rover into whose plan a goal fits best, and where.
    pub(super) fn best_fit(&self, goal: usize) -> Option<(usize, Fit)> {
        let fits = self.fits.iter().enumerate();
        let fits = fits.filter_map(|(rover, fits)| fits[goal].map(|fit| (rover, fit)));
        fits.min_by_key(|(_, fit)| fit.cost_ms)
    }

    /// Where a goal fits best into a rover's plan.
    pub(super) fn fit(&mut self, instance: &Instance, rover: usize, visit: &Visit) -> Option<Fit> {
        let duration_ms = instance.task(visit.task).duration_ms;
        let (found, tested) = self.chains[rover].best_insertion(instance, visit);
        self.operations += tested;
        let found = found.filter(|found| found.violation.is_none())?;
        Some(Fit {
            cost_ms: duration_ms + found.added_ms,
            found,
        })
    }

    fn touch(&mut self, rover: usize) {
        self.operations += self.chains[rover].nodes().len() as u64;
        self.stale[rover] = true;
        self.changed[rover] = true;
    }
}
