//! One rover's ordered plan, sol by sol, as a chain: how early and how late each task can be, and what is
//! left of energy and memory, so that a test of an insertion looks at a few numbers and not at the plan.
//!
//! The plan of a chain is to begin everything as early as its order allows. A drive is made in the sol of
//! what is driven to, just before it. A chain may be in conflict: late, or out of energy or memory; how
//! much, [`Chain::violation`] says exactly, and [`Chain::insertion`] says what it would be with one task
//! more. Both count time by sol: the most that any task of the sol ends too late.
//!
//! With forward times (the earliest start of each task) and backward ones (the latest start at which
//! all that follows in the sol is still in time), a task in time is a comparison; see M. W. P. Savelsbergh,
//! *The Vehicle Routing Problem with Time Windows: Minimizing Route Duration*, 1992. Memory goes the same
//! way: how much more could be stored here without filling it later, with what is sent home counted.

mod build;

use super::instance::{Instance, Task, Vehicle};

/// A task that is put into a plan, and when it may be done: as the task says, or, for one that another rover
/// takes part in, at the time that was agreed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Visit {
    /// The task.
    pub task: usize,
    /// When it may begin \[ms\].
    pub opens_ms: i64,
    /// When it has to have ended \[ms\].
    pub closes_ms: i64,
}

impl Visit {
    /// At any time that the task allows.
    pub fn new(instance: &Instance, task: usize) -> Visit {
        let of = instance.task(task);
        Visit {
            task,
            opens_ms: of.opens_ms,
            closes_ms: of.closes_ms,
        }
    }

    /// At this time and no other.
    pub fn at(instance: &Instance, task: usize, start_ms: i64) -> Visit {
        Visit {
            task,
            opens_ms: start_ms,
            closes_ms: start_ms + instance.task(task).duration_ms,
        }
    }
}

/// By how much a plan cannot be carried out; nothing is a plan that can.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Violation {
    /// How late tasks end: the most of each sol, summed \[ms\].
    pub late_ms: i64,
    /// How much energy is lacking, summed over sols \[uJ\].
    pub energy_uj: i64,
    /// How much memory is lacking at the most \[bit\].
    pub bits: i64,
}

impl Violation {
    /// Whether there is none.
    pub fn is_none(&self) -> bool {
        *self == Violation::default()
    }

    /// Its size, in shares of a sol's time and energy and of the memory of the rover.
    pub fn size(&self, vehicle: &Vehicle) -> f64 {
        let sol = &vehicle.sols[0];
        let share = |lacking: i64, all: i64| lacking as f64 / all.max(1) as f64;
        share(self.late_ms, sol.closes_ms - sol.opens_ms)
            + share(self.energy_uj, sol.energy_uj)
            + share(self.bits, vehicle.memory_bits)
    }
}

/// Where a task can be put in, and what comes of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Insertion {
    /// The sol.
    pub sol: usize,
    /// Before which task of the chain, by its number in it.
    pub index: usize,
    /// How much longer the rover drives \[ms\]; less than nothing where ways are no straight lines.
    pub added_ms: i64,
    /// When the task would start \[ms\].
    pub start_ms: i64,
    /// The violation of the chain with it.
    pub violation: Violation,
}

/// A task in a chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Node {
    /// What is done, and when it may be.
    pub visit: Visit,
    /// In which sol.
    pub sol: usize,
    /// At which place the rover is then.
    pub place: usize,
    /// How long it drives there \[ms\].
    pub drive_ms: i64,
    /// When it begins \[ms\].
    pub start_ms: i64,
    /// When it ends \[ms\].
    pub end_ms: i64,
    /// What is stored when it has ended \[bit\].
    pub stored_bits: i64,
    /// What the sol has taken of energy by then \[uJ\].
    pub used_uj: i64,
    /// How late the sol's tasks up to this one end, at the most \[ms\].
    late_ms: i64,
    /// How much memory lacks up to here, at the most \[bit\].
    over_bits: i64,
    /// The latest start at which it and all later tasks of the sol are in time \[ms\].
    latest_ms: i64,
    /// How late they are however early it starts \[ms\]: they wait for one another's windows.
    stuck_ms: i64,
    /// How much more could be stored before it \[bit\].
    room_bits: i64,
    /// How much memory lacks from here on, at the most \[bit\].
    later_over_bits: i64,
}

/// One rover's plan.
///
/// ```
/// use farside_misus::planner::chain::{Chain, Visit};
/// use farside_misus::planner::instance::Instance;
/// use farside_misus::planner::problem::{ProblemConfig, generate};
/// let instance = Instance::new(&generate(&ProblemConfig::default(), 1)?)?;
/// let mut chain = Chain::new(&instance, 0);
/// let visit = Visit::new(&instance, 0);
/// let (best, tested) = chain.best_insertion(&instance, &visit);
/// let best = best.expect("there is room");
/// assert!(tested >= 2 && best.violation.is_none());
/// chain.insert(&instance, visit, best.sol, best.index);
/// assert_eq!(chain.drive_ms(), best.added_ms);
/// # Ok::<(), farside_misus::planner::problem::ProblemError>(())
/// ```
#[derive(Debug, PartialEq, Eq)]
pub struct Chain {
    rover: usize,
    nodes: Vec<Node>,
    /// By sol: which node is its first; and the number of nodes.
    firsts: Vec<usize>,
    /// By sol.
    sums: Vec<Sum>,
    violation: Violation,
    drive_ms: i64,
}

impl Clone for Chain {
    fn clone(&self) -> Chain {
        Chain {
            nodes: self.nodes.clone(),
            firsts: self.firsts.clone(),
            sums: self.sums.clone(),
            ..*self
        }
    }

    // Searches go back to their best plan again and again: without memory from the system.
    fn clone_from(&mut self, from: &Chain) {
        self.nodes.clone_from(&from.nodes);
        self.firsts.clone_from(&from.firsts);
        self.sums.clone_from(&from.sums);
        (self.rover, self.violation, self.drive_ms) = (from.rover, from.violation, from.drive_ms);
    }
}

/// What a sol comes to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Sum {
    energy_uj: i64,
    late_ms: i64,
}

impl Chain {
    /// The plan of a rover that does nothing but its activities, in the order of their windows.
    pub fn new(instance: &Instance, rover: usize) -> Chain {
        let vehicle = &instance.vehicles()[rover];
        let mut chain = Chain {
            rover,
            nodes: Vec::new(),
            firsts: vec![0; vehicle.sols.len() + 1],
            sums: vec![Sum::default(); vehicle.sols.len()],
            violation: Violation::default(),
            drive_ms: 0,
        };
        let mut activities = vehicle.activities.clone();
        activities.sort_by_key(|&(task, sol)| (sol, instance.task(task).closes_ms, task));
        for (task, sol) in activities {
            chain.put(Visit::new(instance, task), sol, chain.firsts[sol + 1]);
        }
        chain.rebuild(instance);
        chain
    }

    /// Whose plan it is.
    pub fn rover(&self) -> usize {
        self.rover
    }

    /// The tasks, in order.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The goals among them, in order.
    pub fn goals<'a>(&'a self, instance: &Instance) -> impl Iterator<Item = usize> + 'a {
        let goals = instance.goals();
        let tasks = self.nodes.iter().map(|node| node.visit.task);
        tasks.filter(move |task| *task < goals)
    }

    /// Which nodes are in a sol.
    pub fn sol(&self, sol: usize) -> std::ops::Range<usize> {
        self.firsts[sol]..self.firsts[sol + 1]
    }

    /// By how much the plan cannot be carried out.
    pub fn violation(&self) -> Violation {
        self.violation
    }

    /// By how much a sol is violated: late \[ms\] and short of energy \[uJ\].
    pub fn sol_violation(&self, instance: &Instance, sol: usize) -> Violation {
        let has_uj = instance.vehicles()[self.rover].sols[sol].energy_uj;
        Violation {
            late_ms: self.sums[sol].late_ms,
            energy_uj: (self.sums[sol].energy_uj - has_uj).max(0),
            bits: 0,
        }
    }

    /// What the user's preferences take from its worth.
    pub fn cost(&self, instance: &Instance) -> f64 {
        let costs = instance.costs();
        if costs.is_plain() {
            return 0.0;
        }
        let goals: f64 = self.goals(instance).map(|goal| costs.of_goal(goal)).sum();
        goals + costs.of_drive(self.rover(), self.drive_ms())
    }

    /// How long the rover drives \[ms\].
    pub fn drive_ms(&self) -> i64 {
        self.drive_ms
    }

    /// How far it drives \[mm\].
    pub fn drive_mm(&self, instance: &Instance) -> u64 {
        let mut place = instance.vehicles()[self.rover].start;
        let mut drive_mm = 0;
        for node in &self.nodes {
            drive_mm += u64::from(instance.length_mm(place, node.place));
            place = node.place;
        }
        drive_mm
    }

    /// Where a task is in the chain.
    pub fn position(&self, task: usize) -> Option<usize> {
        self.nodes.iter().position(|node| node.visit.task == task)
    }

    /// Between which numbers a task may be put in: after all that it requires, before all that requires it.
    /// None if something that it requires is not there.
    fn between(&self, instance: &Instance, task: usize) -> Option<(usize, usize)> {
        let (mut low, mut high) = (0, self.nodes.len());
        if task >= instance.goals() {
            return Some((low, high));
        }
        for &other in instance.requires(task) {
            low = low.max(self.position(other)? + 1);
        }
        for &other in instance.required_by(task) {
            if let Some(at) = self.position(other) {
                high = high.min(at);
            }
        }
        Some((low, high))
    }

    /// The place for a task with the least violation, then the least added drive, then the earliest; None
    /// if something that it requires is not in the plan. And how many places were tested.
    pub fn best_insertion(&self, instance: &Instance, visit: &Visit) -> (Option<Insertion>, u64) {
        self.best_insertion_where(instance, visit, |_| true)
    }

    /// As [`Chain::best_insertion`], in the sols that `wanted` wants; None also if there are none.
    pub fn best_insertion_where(
        &self,
        instance: &Instance,
        visit: &Visit,
        wanted: impl Fn(usize) -> bool,
    ) -> (Option<Insertion>, u64) {
        let vehicle = &instance.vehicles()[self.rover];
        let mut best: Option<(f64, Insertion)> = None;
        let mut tested = 0;
        let Some((low, high)) = self.between(instance, visit.task) else {
            return (None, 1);
        };
        for sol in (0..vehicle.sols.len()).filter(|sol| wanted(*sol)) {
            let range = self.sol(sol);
            for index in range.start.max(low)..=range.end.min(high) {
                tested += 1;
                let found = self.insertion(instance, visit, sol, index);
                let size = found.violation.size(vehicle);
                let better = best.as_ref().is_none_or(|(least, best)| {
                    size < *least || (size == *least && found.added_ms < best.added_ms)
                });
                if better {
                    best = Some((size, found));
                }
            }
        }
        (best.map(|(_, found)| found), tested)
    }

    /// What comes of putting a task in, in a sol before the node of a number: exactly what
    /// [`Chain::insert`] would make of the chain, from a few numbers.
    ///
    /// # Panics
    /// When the number is not in the sol, nor the first after it: a bug in the caller.
    pub fn insertion(
        &self,
        instance: &Instance,
        visit: &Visit,
        sol: usize,
        index: usize,
    ) -> Insertion {
        let range = self.sol(sol);
        assert!(
            range.start <= index && index <= range.end,
            "outside the sol"
        );
        let vehicle = &instance.vehicles()[self.rover];
        let task = instance.task(visit.task);
        let before = index.checked_sub(1).map(|at| &self.nodes[at]);
        let from = before.map_or(vehicle.start, |node| node.place);
        let place = task.place.unwrap_or(from);
        let drive_ms = instance.drive_ms(self.rover, from, place);
        let (ready_ms, late_ms) = match index > range.start {
            true => before.map_or((0, 0), |node| (node.end_ms, node.late_ms)),
            false => (vehicle.sols[sol].opens_ms, 0),
        };
        let start_ms = (ready_ms + drive_ms).max(visit.opens_ms);
        let end_ms = start_ms + task.duration_ms;
        let closes_ms = visit.closes_ms.min(vehicle.sols[sol].closes_ms);
        let mut after = After {
            sol,
            late_ms: late_ms.max(end_ms - closes_ms),
            energy_uj: task.energy_uj + drive_ms * vehicle.drive_mw,
            added_ms: drive_ms,
            violation: self.violation,
        };
        self.follow(instance, index, place, end_ms, &mut after);
        after.close(self, vehicle);
        after.violation.bits = self.bits_with(instance, index, task);
        Insertion {
            sol,
            index,
            added_ms: after.added_ms,
            start_ms,
            violation: after.violation,
        }
    }

    /// What happens from a node on, if the rover is at `place` and ready at `ready_ms` before it: what is done
    /// wherever the rover is, one by one; then the first that has a place of its own, behind which
    /// all is as it was but for the time.
    fn follow(
        &self,
        instance: &Instance,
        index: usize,
        place: usize,
        mut ready_ms: i64,
        after: &mut After,
    ) {
        let vehicle = &instance.vehicles()[self.rover];
        for node in &self.nodes[index..] {
            if node.sol != after.sol {
                after.close(self, vehicle);
                (after.sol, after.late_ms, after.energy_uj) = (node.sol, 0, 0);
                ready_ms = vehicle.sols[node.sol].opens_ms;
            }
            let task = instance.task(node.visit.task);
            let drive_ms = match task.place {
                Some(_) => instance.drive_ms(self.rover, place, node.place),
                None => 0,
            };
            let start_ms = (ready_ms + drive_ms).max(node.visit.opens_ms);
            if task.place.is_some() {
                let late_ms = (start_ms - node.latest_ms).max(node.stuck_ms);
                after.late_ms = after.late_ms.max(late_ms);
                after.energy_uj += (drive_ms - node.drive_ms) * vehicle.drive_mw;
                after.added_ms += drive_ms - node.drive_ms;
                return;
            }
            let closes_ms = node.visit.closes_ms.min(vehicle.sols[node.sol].closes_ms);
            ready_ms = start_ms + task.duration_ms;
            after.late_ms = after.late_ms.max(ready_ms - closes_ms);
        }
    }

    /// How much memory lacks at the most, with a task before a node.
    fn bits_with(&self, instance: &Instance, index: usize, task: &Task) -> i64 {
        let vehicle = &instance.vehicles()[self.rover];
        let before = index.checked_sub(1).map(|at| &self.nodes[at]);
        let (stored, over) = before.map_or((vehicle.stored_bits, 0), |node| {
            (node.stored_bits, node.over_bits)
        });
        let full = stored + task.adds_bits;
        let over = over.max(full - vehicle.memory_bits);
        let more = task.adds_bits - task.sends_bits.min(full);
        if more >= 0 {
            let later = self
                .nodes
                .get(index)
                .map_or(0, |node| node.later_over_bits.max(more - node.room_bits));
            return over.max(later);
        }
        // What room there is says nothing of less than before.
        let (mut stored, mut over) = (stored + more, over);
        for node in &self.nodes[index..] {
            let task = instance.task(node.visit.task);
            let full = stored + task.adds_bits;
            over = over.max(full - vehicle.memory_bits);
            stored = full - task.sends_bits.min(full);
        }
        over
    }
}

/// What an insertion changes, while the nodes after it are looked at.
struct After {
    /// The sol that is looked at.
    sol: usize,
    /// How late its tasks are, so far.
    late_ms: i64,
    /// How much more energy it takes, so far.
    energy_uj: i64,
    added_ms: i64,
    violation: Violation,
}

impl After {
    /// Enters what has become of the sol.
    fn close(&mut self, chain: &Chain, vehicle: &Vehicle) {
        let (sum, has_uj) = (&chain.sums[self.sol], vehicle.sols[self.sol].energy_uj);
        let lacking = |used_uj: i64| (used_uj - has_uj).max(0);
        self.violation.late_ms += self.late_ms.max(0) - sum.late_ms;
        self.violation.energy_uj +=
            lacking(sum.energy_uj + self.energy_uj) - lacking(sum.energy_uj);
    }
}

#[cfg(test)]
mod tests;
