//! What is taken out of a plan before it is filled again.

use farside::random::Stream;

use super::state::State;
use crate::planner::instance::Instance;

/// Takes out goals, up to so many: any, those near a place, a stretch of one rover's plan, or all of some
/// rocks. Mandatory ones, and what these require, stay.
pub(super) fn remove(instance: &Instance, state: &mut State, most: usize, draws: &mut Stream) {
    let mut planned: Vec<usize> = Vec::new();
    for chain in &state.chains {
        planned.extend(chain.goals(instance).filter(|goal| may_go(instance, *goal)));
    }
    if planned.is_empty() {
        return;
    }
    let count = 1 + draws.below(most.min(planned.len()) as u64) as usize;
    let goals = match draws.below(4) {
        0 => any(planned, count, draws),
        1 => near(instance, planned, count, draws),
        2 => stretch(instance, state, count, draws),
        _ => rocks(instance, planned, count, draws),
    };
    for goal in goals {
        state.remove(instance, goal);
    }
}

fn may_go(instance: &Instance, goal: usize) -> bool {
    let mut dependants = instance.required_by(goal).iter();
    !instance.task(goal).mandatory && dependants.all(|&other| may_go(instance, other))
}

fn any(mut planned: Vec<usize>, count: usize, draws: &mut Stream) -> Vec<usize> {
    draws.shuffle(&mut planned);
    planned.truncate(count);
    planned
}

fn near(
    instance: &Instance,
    mut planned: Vec<usize>,
    count: usize,
    draws: &mut Stream,
) -> Vec<usize> {
    let middle = planned[draws.below(planned.len() as u64) as usize];
    planned.sort_by_key(|&goal| (instance.length_mm(middle, goal), goal));
    planned.truncate(count);
    planned
}

fn stretch(instance: &Instance, state: &State, count: usize, draws: &mut Stream) -> Vec<usize> {
    let rover = draws.below(state.chains.len() as u64) as usize;
    let goals: Vec<usize> = state.chains[rover].goals(instance).collect();
    if goals.is_empty() {
        return goals;
    }
    let first = draws.below(goals.len() as u64) as usize;
    let stretch = goals.into_iter().skip(first).take(count);
    stretch.filter(|goal| may_go(instance, *goal)).collect()
}

fn rocks(instance: &Instance, planned: Vec<usize>, count: usize, draws: &mut Stream) -> Vec<usize> {
    let mut gone = Vec::new();
    let mut left = planned;
    while gone.len() < count && !left.is_empty() {
        let goal = left[draws.below(left.len() as u64) as usize];
        let same = |other: &usize| {
            *other == goal
                || instance.rock(goal).is_some() && instance.rock(*other) == instance.rock(goal)
        };
        gone.extend(left.iter().copied().filter(same));
        left.retain(|other| !same(other));
    }
    gone
}
