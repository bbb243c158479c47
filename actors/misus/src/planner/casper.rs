//! A rover's planner: random hill climbing with restarts, by iterative repair (section 4.2).
//!
//! First comes a plan of what is mandatory. Then come optimisation steps. A step starts from the best plan
//! and has so many iterations at the most. An iteration of a plan in conflict repairs it; one of a plan
//! without adds the next goal, where it violates least and then drives least. A plan without conflict whose
//! score is better than the best by Equation 1, over the rover's own goals and those that others were last heard
//! to hold, becomes the best; whether the step goes on then is a key ([`StepEnd`]). Three planners differ in how the next goal is chosen ([`Choice`])
//! and in nothing else. A goal that repairs have deleted three times, and that the best plan does not have, is
//! shed at the end of the step.
//!
//! Work is counted in operations: a goal that is looked at, a place that is tested, an order that is tried, a
//! task whose times are worked out anew.

mod repair;
mod settings;

use farside::random::{RandomKey, Stream};
use thiserror::Error;

use super::chain::{Chain, Violation, Visit};
use super::instance::Instance;
use super::score::Score;

pub use settings::{Choice, PlannerConfig, StepEnd};

/// Scores that differ by less are equal: sums are taken in one order, weights need not be whole.
const EQUAL: f64 = 1e-9;

/// What has to be done cannot be.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "rover {rover} cannot do what it has to: with task {task} it is {} s late, lacks {} J and {} bit",
    .lacking.late_ms as f64 / 1e3, .lacking.energy_uj as f64 / 1e6, .lacking.bits
)]
pub struct Unmet {
    /// The rover, by number.
    pub rover: usize,
    /// The mandatory task for which there is no room, by number.
    pub task: usize,
    /// What lacks for it.
    pub lacking: Violation,
}

/// What a step did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Step {
    /// Whether it found a better plan.
    pub improved: bool,
    /// How many iterations it had.
    pub iterations: u32,
    /// What it looked at.
    pub operations: u64,
    /// The goals that it shed, in ascending order.
    pub shed: Vec<usize>,
}

/// The planner of a rover, with its best plan.
///
/// ```
/// use farside::random::RandomKey;
/// use farside_misus::planner::casper::{Casper, PlannerConfig};
/// use farside_misus::planner::instance::Instance;
/// use farside_misus::planner::problem::{ProblemConfig, generate};
/// let instance = Instance::new(&generate(&ProblemConfig::default(), 1)?)?;
/// let config = PlannerConfig::default();
/// let mut casper = Casper::new(&instance, 0, &config, RandomKey::new(1))?;
/// for goal in 0..6 {
///     casper.assign(&instance, goal, None)?;
/// }
/// let step = casper.step(&instance);
/// assert!(step.improved);
/// assert!(casper.score().value() > 0.0 && casper.plan().violation().is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Casper {
    config: PlannerConfig,
    /// What it may plan, in ascending order of the tasks.
    assigned: Vec<Visit>,
    /// By goal: how often it was deleted since the best plan had it.
    deletions: Vec<u32>,
    best: Chain,
    /// What the team's plan is worth with it, as the planner knows it, less what it costs by the user's
    /// preferences.
    best_value: f64,
    best_cost: f64,
    /// The plan that is being worked on, kept for its memory.
    current: Chain,
    /// Of the best plan between steps, and of the current one during a step.
    score: Score,
    draws: Stream,
}

impl Casper {
    /// The planner of a rover that has nothing to do but its activities. Its draws are at `key`, below
    /// the number of the rover.
    ///
    /// # Errors
    /// When the activities alone cannot be done.
    pub fn new(
        instance: &Instance,
        rover: usize,
        config: &PlannerConfig,
        key: RandomKey,
    ) -> Result<Casper, Unmet> {
        let best = Chain::new(instance, rover);
        if !best.violation().is_none() {
            let last = best.nodes().last().map(|node| node.visit.task);
            return Err(Unmet {
                rover,
                task: last.unwrap_or_default(),
                lacking: best.violation(),
            });
        }
        Ok(Casper {
            config: config.clone(),
            assigned: Vec::new(),
            deletions: vec![0; instance.goals()],
            current: best.clone(),
            best,
            best_value: 0.0,
            best_cost: 0.0,
            score: Score::new(instance),
            draws: key.text("casper").number(rover as u64).stream(),
        })
    }

    /// The best plan so far, without conflict.
    pub fn plan(&self) -> &Chain {
        &self.best
    }

    /// What the team's plan is worth, as the planner knows it.
    pub fn score(&self) -> &Score {
        &self.score
    }

    /// The goals that the planner may plan, in ascending order.
    pub fn assigned(&self) -> impl Iterator<Item = usize> + '_ {
        self.assigned.iter().map(|visit| visit.task)
    }

    /// The goals of the best plan, and those for two rovers that the planner has not shed: what others
    /// count on. In ascending order.
    pub fn held(&self, instance: &Instance) -> Vec<usize> {
        let held = self
            .assigned()
            .filter(|&goal| self.score.holds(goal) || instance.task(goal).rovers > 1);
        held.collect()
    }

    /// Another rover holds these goals now, and no others.
    pub fn hear(&mut self, rover: usize, goals: &[usize]) {
        self.score.hear(rover, goals);
        self.best_value = self.score.value() - self.best_cost;
    }

    /// The planner may plan a goal from now on; at `start_ms` and no other time, if that is given. A
    /// mandatory goal is planned at once, and whatever stands in its way deleted.
    ///
    /// # Errors
    /// When a mandatory goal cannot be done besides what else is mandatory; the plan is as it was.
    pub fn assign(
        &mut self,
        instance: &Instance,
        goal: usize,
        start_ms: Option<i64>,
    ) -> Result<(), Unmet> {
        let visit = match start_ms {
            Some(start_ms) => Visit::at(instance, goal, start_ms),
            None => Visit::new(instance, goal),
        };
        if instance.task(goal).mandatory {
            self.insist(instance, visit)?;
        }
        match self
            .assigned
            .binary_search_by_key(&goal, |visit| visit.task)
        {
            Ok(at) if self.assigned[at] == visit => {}
            Ok(_) => {
                self.withdraw(instance, goal)?;
                return self.assign(instance, goal, start_ms);
            }
            Err(at) => self.assigned.insert(at, visit),
        }
        self.deletions[goal] = 0;
        Ok(())
    }

    /// The planner may not plan a goal any more; it leaves the plan, with all that requires it, and what
    /// cannot be reached in time without having been there.
    ///
    /// # Errors
    /// When something mandatory cannot be done without having been there; the plan still has it then.
    pub fn withdraw(&mut self, instance: &Instance, goal: usize) -> Result<(), Unmet> {
        if self.score.holds(goal) {
            let mut chain = self.best.clone();
            repair::delete(instance, &mut chain, goal);
            self.best = self.settled(instance, chain, &mut 0)?;
            self.reset(instance);
        }
        self.assigned.retain(|visit| visit.task != goal);
        Ok(())
    }

    /// After the last step: of the goals for two rovers only those stay in the plan that the other rover has,
    /// too. What cannot be reached in time without having been at the others goes, but never a goal for two as
    /// long as anything else can go: the other rover would be left alone.
    ///
    /// # Errors
    /// When something mandatory cannot be done then; the plan is as it was.
    pub fn part(
        &mut self,
        instance: &Instance,
        stays: impl Fn(usize) -> bool,
    ) -> Result<(), Unmet> {
        let goes = |goal: usize| instance.is_joint(goal) && !stays(goal);
        let mut chain = self.best.clone();
        let gone: Vec<usize> = chain.goals(instance).filter(|goal| goes(*goal)).collect();
        for goal in gone {
            repair::delete(instance, &mut chain, goal);
        }
        while !chain.violation().is_none() {
            let Some(least) = repair::least_without(instance, &chain) else {
                break;
            };
            chain = least;
        }
        self.best = self.settled(instance, chain, &mut 0)?;
        self.reset(instance);
        self.assigned.retain(|visit| !goes(visit.task));
        Ok(())
    }

    /// Takes a plan over, as `(sol, visit)`, from before something changed: continuous planning. Goals that
    /// are not assigned, and those that lack what they require, are left out; activities need not be named,
    /// but what follows one that is named comes after it; what is in conflict then is repaired. Returns what was looked at.
    ///
    /// # Errors
    /// When what is mandatory in it cannot be done; the plan is as it was.
    pub fn resume(&mut self, instance: &Instance, plan: &[(usize, Visit)]) -> Result<u64, Unmet> {
        let mut chain = Chain::new(instance, self.best.rover());
        let mut operations = 0;
        // Each comes after the one before; activities stand where they violate least.
        let (mut sol_before, mut next) = (0, 0);
        for &(sol, visit) in plan {
            if let Some(at) = chain.position(visit.task)
                && visit.task >= instance.goals()
                && chain.nodes()[at].sol == sol
            {
                let from = if sol == sol_before { next } else { 0 };
                (sol_before, next) = (sol, from.max(at + 1));
                continue;
            }
            let known = sol < instance.vehicles()[chain.rover()].sols.len()
                && visit.task < instance.goals()
                && chain.position(visit.task).is_none()
                && self.assigned().any(|goal| goal == visit.task);
            let requires = |&other: &usize| chain.position(other).is_some();
            if !known || !instance.requires(visit.task).iter().all(requires) {
                continue;
            }
            let range = chain.sol(sol);
            let from = if sol == sol_before {
                range.start.max(next)
            } else {
                range.start
            };
            let sizes = (from..=range.end).map(|index| {
                let found = chain.insertion(instance, &visit, sol, index);
                (
                    found.violation.size(&instance.vehicles()[chain.rover()]),
                    index,
                )
            });
            let best = sizes.min_by(|a, b| a.0.total_cmp(&b.0));
            let index = best.map_or(range.end, |(_, index)| index);
            chain.insert(instance, visit, sol, index);
            operations += (range.end - from) as u64 + 1 + chain.nodes().len() as u64;
            (sol_before, next) = (sol, index + 1);
        }
        self.best = self.settled(instance, chain, &mut operations)?;
        self.reset(instance);
        Ok(operations)
    }

    /// A chain repaired until there is no conflict in it.
    fn settled(
        &mut self,
        instance: &Instance,
        mut chain: Chain,
        operations: &mut u64,
    ) -> Result<Chain, Unmet> {
        // Every few iterations something is deleted, until only what is mandatory is left; orders of that
        // are then tried for as long as a step.
        let patience = self.config.iterations as usize + 10 * chain.nodes().len();
        for _ in 0..patience {
            if chain.violation().is_none() {
                return Ok(chain);
            }
            *operations += repair::repair(instance, &mut chain, &mut self.draws).operations;
        }
        let mut tasks = chain.nodes().iter().rev().map(|node| node.visit.task);
        let last = tasks.find(|task| instance.task(*task).mandatory);
        Err(Unmet {
            rover: chain.rover(),
            task: last.unwrap_or_default(),
            lacking: chain.violation(),
        })
    }

    /// An optimisation step.
    pub fn step(&mut self, instance: &Instance) -> Step {
        let mut step = Step::default();
        self.current.clone_from(&self.best);
        step.operations += self.best.nodes().len() as u64;
        while step.iterations < self.config.iterations {
            step.iterations += 1;
            let conflict = !self.current.violation().is_none();
            if conflict {
                self.repair(instance, &mut step);
            } else if !self.add(instance, &mut step) {
                break;
            }
            if !self.current.violation().is_none() {
                continue;
            }
            let value = self.score.value() - self.current.cost(instance);
            if value > self.best_value + EQUAL {
                step.improved = true;
                if self.config.step_end == StepEnd::FirstBetter {
                    std::mem::swap(&mut self.best, &mut self.current);
                    break;
                }
                self.best.clone_from(&self.current);
                self.best_value = value;
            } else if self.config.step_end == StepEnd::Restart {
                self.current.clone_from(&self.best);
                self.reset(instance);
            }
        }
        self.reset(instance);
        for goal in self.best.goals(instance) {
            self.deletions[goal] = 0;
        }
        self.shed(instance, &mut step);
        step
    }

    /// Adds the next goal; false if there is none.
    fn add(&mut self, instance: &Instance, step: &mut Step) -> bool {
        let Some(at) = self.next(instance, step) else {
            return false;
        };
        let visit = self.assigned[at];
        let (found, tested) = self.current.best_insertion(instance, &visit);
        step.operations += tested;
        let Some(found) = found else {
            return false;
        };
        self.current.accept(instance, visit, &found);
        step.operations += self.current.nodes().len() as u64;
        self.score.hold(visit.task);
        true
    }

    /// The goal to add next, by its number among those assigned; None if there is none, or none that the
    /// planner wants.
    fn next(&mut self, instance: &Instance, step: &mut Step) -> Option<usize> {
        if self.config.choice == Choice::Lns {
            return None;
        }
        let open = |&(_, visit): &(usize, &Visit)| {
            let requires = instance.requires(visit.task);
            !self.score.holds(visit.task) && requires.iter().all(|&other| self.score.holds(other))
        };
        let open: Vec<(usize, usize)> = self
            .assigned
            .iter()
            .enumerate()
            .filter(open)
            .map(|(at, visit)| (at, visit.task))
            .collect();
        step.operations += self.assigned.len() as u64;
        let any = self.config.choice == Choice::Random || self.draws.chance(self.config.epsilon);
        if any {
            return self.draws.choose(&open).map(|(at, _)| *at);
        }
        let mut best = (0.0, None);
        for &(at, goal) in &open {
            let worth = match self.config.choice {
                Choice::Idgs => self.gain(instance, at, goal, step),
                _ => instance.weights()[goal],
            };
            if worth > best.0 {
                best = (worth, Some(at));
            }
        }
        best.1
    }

    /// By how much the objective would rise with a goal: with preferences that hangs on where it would be put.
    fn gain(&self, instance: &Instance, at: usize, goal: usize, step: &mut Step) -> f64 {
        let (gain, costs) = (self.score.gain(goal), instance.costs());
        if costs.is_plain() || gain <= 0.0 {
            return gain;
        }
        let (found, tested) = self.current.best_insertion(instance, &self.assigned[at]);
        step.operations += tested;
        let added_ms = found.map_or(0, |found| found.added_ms);
        gain - costs.of_goal(goal) - costs.of_drive(self.current.rover(), added_ms)
    }

    /// An iteration of repair.
    fn repair(&mut self, instance: &Instance, step: &mut Step) {
        let done = repair::repair(instance, &mut self.current, &mut self.draws);
        step.operations += done.operations;
        for goal in done.deleted {
            self.score.release(goal);
            self.deletions[goal] += 1;
        }
    }

    /// Sheds what has been deleted too often and is not in the plan, and all that requires it.
    fn shed(&mut self, instance: &Instance, step: &mut Step) {
        let often = |goal: usize| self.deletions[goal] >= self.config.deletions;
        let shed = self.assigned().filter(|&goal| {
            !self.score.holds(goal)
                && (often(goal) || instance.requires(goal).iter().any(|&at| often(at)))
        });
        step.shed = shed.collect();
        self.assigned
            .retain(|visit| step.shed.binary_search(&visit.task).is_err());
        for &goal in &step.shed {
            self.deletions[goal] = 0;
        }
    }

    /// Plans a mandatory goal, whatever has to go for it.
    fn insist(&mut self, instance: &Instance, visit: Visit) -> Result<(), Unmet> {
        if self.best.position(visit.task).is_some() {
            return Ok(());
        }
        let (found, _) = self.best.best_insertion(instance, &visit);
        let Some(found) = found else {
            // What it requires is with nobody, or with somebody else.
            return Err(Unmet {
                rover: self.best.rover(),
                task: visit.task,
                lacking: Violation::default(),
            });
        };
        let mut chain = self.best.clone();
        chain.accept(instance, visit, &found);
        let settled = self.settled(instance, chain, &mut 0);
        self.best = settled.map_err(|unmet| Unmet {
            task: visit.task,
            ..unmet
        })?;
        self.reset(instance);
        Ok(())
    }

    /// Makes the score that of the best plan.
    fn reset(&mut self, instance: &Instance) {
        for goal in 0..instance.goals() {
            self.score.release(goal);
        }
        for goal in self.best.goals(instance) {
            self.score.hold(goal);
        }
        self.best_cost = self.best.cost(instance);
        self.best_value = self.score.value() - self.best_cost;
    }
}
