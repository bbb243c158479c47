//! A team's plan in the making: who has which goal, what it is worth, and where others would fit.

use farside::random::Stream;
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

/// A sol of a rover.
#[derive(Clone, Copy, Debug)]
struct Slot {
    rover: usize,
    sol: usize,
    /// By how much more than it takes a goal seems to take there.
    bias: f64,
}

/// A team's plan.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) chains: Vec<Chain>,
    pub(super) objective: Objective,
    /// The sols of all rovers.
    slots: Vec<Slot>,
    /// By slot and goal: where the goal fits, as far as the rover's plan is still the one it was tested with.
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
        let slots = instance.vehicles().iter().enumerate();
        let slots = slots.flat_map(|(rover, vehicle)| {
            let sols = 0..vehicle.sols.len();
            sols.map(move |sol| Slot {
                rover,
                sol,
                bias: 1.0,
            })
        });
        let slots: Vec<Slot> = slots.collect();
        let combinations = instance.combinations().iter();
        let combinations = combinations.map(|(goals, weight)| (goals.as_slice(), *weight));
        State {
            chains: (0..rovers)
                .map(|rover| Chain::new(instance, rover))
                .collect(),
            objective: Objective::of(instance.weights().to_vec(), combinations),
            fits: vec![vec![None; instance.goals()]; slots.len()],
            slots,
            stale: vec![true; rovers],
            changed: vec![false; rovers],
            operations: 0,
        }
    }

    /// What the plan is worth: by so little less, the more is driven, that it decides between equals only.
    pub(super) fn value(&self, instance: &Instance) -> f64 {
        let drive_ms: i64 = self.chains.iter().map(Chain::drive_ms).sum();
        let costs = self.chains.iter().map(|chain| chain.cost(instance));
        self.objective.score() - costs.sum::<f64>() - drive_ms as f64 * 1e-9
    }

    /// What is gained by a goal of a rover that takes so long, drive and all, by the objective \[ms\].
    pub(super) fn gain(&self, instance: &Instance, goal: usize, rover: usize, fit: &Fit) -> f64 {
        let costs = instance.costs();
        let drive_ms = fit.cost_ms - instance.task(goal).duration_ms;
        self.objective.gain(goal) - costs.of_goal(goal) - costs.of_drive(rover, drive_ms)
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

    /// Makes some sols of some rovers seem to take up to this much longer than they do, so that plans
    /// are not always filled in one way.
    pub(super) fn shake(&mut self, most: f64, draws: &mut Stream) {
        for slot in &mut self.slots {
            slot.bias = 1.0 + most * draws.uniform();
        }
    }

    /// Tests where all goals that are not in the plan fit into plans that have changed.
    pub(super) fn refresh(&mut self, instance: &Instance) {
        for at in 0..self.slots.len() {
            let Slot { rover, sol, .. } = self.slots[at];
            if !self.stale[rover] {
                continue;
            }
            for goal in 0..instance.goals() {
                let skip = self.has(goal) || instance.task(goal).rovers > 1;
                self.fits[at][goal] = match skip {
                    true => None,
                    false => self.fit(instance, rover, &Visit::new(instance, goal), |at| at == sol),
                };
            }
        }
        self.stale.fill(false);
    }

    /// The rover into whose plan a goal fits best, and where.
    pub(super) fn best_fit(&self, goal: usize) -> Option<(usize, Fit)> {
        let mut best = (f64::INFINITY, None);
        for (slot, fits) in self.slots.iter().zip(&self.fits) {
            if let Some(fit) = fits[goal] {
                let cost_ms = fit.cost_ms as f64 * slot.bias;
                if cost_ms < best.0 {
                    best = (cost_ms, Some((slot.rover, fit)));
                }
            }
        }
        best.1
    }

    /// Where a goal fits best into a rover's plan, in the sols that are wanted.
    pub(super) fn fit(
        &mut self,
        instance: &Instance,
        rover: usize,
        visit: &Visit,
        wanted: impl Fn(usize) -> bool,
    ) -> Option<Fit> {
        let duration_ms = instance.task(visit.task).duration_ms;
        let chain = &self.chains[rover];
        let (found, tested) = chain.best_insertion_where(instance, visit, wanted);
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
