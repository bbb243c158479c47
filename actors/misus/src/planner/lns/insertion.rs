//! How a plan is filled: greedily, by what a goal is worth for the time that it takes.

use farside::random::Stream;

use super::state::{Fit, State};
use crate::planner::chain::Visit;
use crate::planner::instance::Instance;

/// By how much time counts: worth is divided by the time to one of these powers.
const POWERS: [f64; 4] = [0.0, 0.3, 0.7, 1.0];
/// Which part of what a goal would bring nearer counts with what it brings.
const PARTS: [f64; 3] = [0.0, 0.5, 1.0];
/// By how much worths are made uncertain at the most, so that equal plans are filled differently.
const NOISE: f64 = 0.2;
/// By how much sols are made to seem longer at the most.
const BIAS: f64 = 1.0;
/// Times are told apart by so much \[ms\].
const GRAIN_MS: i64 = 60_000;
/// Longer times are as this one.
const GRAINS: usize = 1_000;

/// Times to the powers, worked out before.
#[derive(Clone, Debug)]
pub(super) struct Powers([Vec<f64>; POWERS.len()]);

impl Powers {
    pub(super) fn new() -> Powers {
        let table = |power| {
            (0..GRAINS)
                .map(|at| libm::pow(at as f64 + 1.0, power))
                .collect()
        };
        Powers(POWERS.map(table))
    }

    fn of(&self, power: usize, time_ms: i64) -> f64 {
        let at = (time_ms.max(0) / GRAIN_MS) as usize;
        self.0[power][at.min(GRAINS - 1)]
    }
}

/// What may be put in next.
#[derive(Clone, Copy)]
enum Candidate {
    One(usize),
    Pair(usize, usize),
}

/// How a plan is filled this time.
struct Manner<'a> {
    powers: &'a Powers,
    /// Which of the powers.
    power: usize,
    /// Which part of promises counts.
    part: f64,
    noise: f64,
    /// Whether two goals of a combination are put in at once.
    pairs: bool,
}

/// Puts in one goal, or two of a combination, after the other, whatever is worth most for its time, until
/// nothing that fits is worth anything.
pub(super) fn fill(instance: &Instance, state: &mut State, powers: &Powers, draws: &mut Stream) {
    let manner = Manner {
        powers,
        power: draws.below(POWERS.len() as u64) as usize,
        part: PARTS[draws.below(PARTS.len() as u64) as usize],
        noise: NOISE * draws.uniform(),
        pairs: draws.chance(0.5),
    };
    state.shake(BIAS * draws.uniform(), draws);
    // What was tried and did not fit after all is not tried again.
    let mut tried = vec![false; instance.goals()];
    loop {
        state.refresh(instance);
        match manner.choose(instance, state, &tried, draws) {
            None => break,
            Some(Candidate::One(goal)) => tried[goal] = !put(instance, state, goal),
            Some(Candidate::Pair(goal, other)) => {
                tried[goal] = !put(instance, state, goal);
                state.refresh(instance);
                tried[other] = !put(instance, state, other);
            }
        }
    }
    drop_losses(instance, state);
}

impl Manner<'_> {
    /// What is worth most for its time, if anything is worth more than nothing.
    fn choose(
        &self,
        instance: &Instance,
        state: &mut State,
        tried: &[bool],
        draws: &mut Stream,
    ) -> Option<Candidate> {
        let mut best = (0.0, None);
        let mut enter = |worth: f64, cost_ms: i64, candidate| {
            if worth > 0.0 {
                let shaken = worth * (1.0 - self.noise * draws.uniform());
                let rate = shaken / self.powers.of(self.power, cost_ms);
                if rate > best.0 {
                    best = (rate, Some(candidate));
                }
            }
        };
        for goal in 0..instance.goals() {
            if state.has(goal) || tried[goal] {
                continue;
            }
            state.operations += 1;
            let (joint, duration_ms) = {
                let task = instance.task(goal);
                (task.rovers > 1, task.duration_ms)
            };
            // Where two rovers could meet is looked for when they are to.
            let (cost_ms, gain) = match state.best_fit(goal) {
                Some((rover, fit)) => (fit.cost_ms, state.gain(instance, goal, rover, &fit)),
                None if joint => (2 * duration_ms, state.objective.gain(goal)),
                None => continue,
            };
            let worth = gain + self.part * state.objective.promise(goal);
            enter(worth, cost_ms, Candidate::One(goal));
            if !self.pairs || joint {
                continue;
            }
            for &other in instance.partners(goal) {
                if other < goal || state.has(other) || tried[other] {
                    continue;
                }
                if let Some((rover, fit)) = state.best_fit(other) {
                    state.operations += 1;
                    state.objective.set(goal, true);
                    let worth = gain + state.gain(instance, other, rover, &fit);
                    state.objective.set(goal, false);
                    enter(worth, cost_ms + fit.cost_ms, Candidate::Pair(goal, other));
                }
            }
        }
        best.1
    }
}

/// Puts a goal in where it fits best; says whether it does.
pub(super) fn put(instance: &Instance, state: &mut State, goal: usize) -> bool {
    if instance.task(goal).rovers > 1 {
        return put_joint(instance, state, goal);
    }
    let Some((rover, fit)) = state.best_fit(goal) else {
        return false;
    };
    state.insert(instance, rover, Visit::new(instance, goal), &fit.found);
    true
}

/// When two rovers do a goal together, and what it takes.
struct Meeting {
    cost_ms: i64,
    start_ms: i64,
    fits: [(usize, Fit); 2],
}

/// Puts a goal that two rovers have to do at one time into the plans of the two in which it takes least time,
/// of the times at which one of them can begin earliest.
fn put_joint(instance: &Instance, state: &mut State, goal: usize) -> bool {
    let free = Visit::new(instance, goal);
    let mut best: Option<Meeting> = None;
    for second in 1..state.chains.len() {
        for first in 0..second {
            let mut starts_ms = Vec::new();
            for rover in [first, second] {
                let chain = &state.chains[rover];
                for sol in 0..instance.vehicles()[rover].sols.len() {
                    for index in chain.sol(sol).start..=chain.sol(sol).end {
                        starts_ms.push(chain.insertion(instance, &free, sol, index).start_ms);
                        state.operations += 1;
                    }
                }
            }
            starts_ms.sort_unstable();
            starts_ms.dedup();
            for start_ms in starts_ms {
                let visit = Visit::at(instance, goal, start_ms);
                if visit.closes_ms > free.closes_ms {
                    continue;
                }
                let Some(one) = state.fit(instance, first, &visit, |_| true) else {
                    continue;
                };
                let Some(two) = state.fit(instance, second, &visit, |_| true) else {
                    continue;
                };
                let cost_ms = one.cost_ms + two.cost_ms;
                if best.as_ref().is_none_or(|best| cost_ms < best.cost_ms) {
                    let fits = [(first, one), (second, two)];
                    best = Some(Meeting {
                        cost_ms,
                        start_ms,
                        fits,
                    });
                }
            }
        }
    }
    let Some(Meeting { start_ms, fits, .. }) = best else {
        return false;
    };
    for (rover, fit) in fits {
        let visit = Visit::at(instance, goal, start_ms);
        state.insert(instance, rover, visit, &fit.found);
    }
    true
}

/// Takes out what makes the plan worth less.
fn drop_losses(instance: &Instance, state: &mut State) {
    for goal in 0..instance.goals() {
        let alone = instance
            .required_by(goal)
            .iter()
            .all(|other| !state.has(*other));
        if state.has(goal)
            && alone
            && !instance.task(goal).mandatory
            && state.objective.gain(goal) < instance.costs().of_goal(goal)
        {
            state.remove(instance, goal);
        }
    }
}
