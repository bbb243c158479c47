//! One iteration of repair: a plan in conflict is changed in one place.

use farside::random::Stream;

use crate::planner::chain::Chain;
use crate::planner::instance::Instance;

/// What an iteration of repair did.
#[derive(Debug, Default)]
pub(super) struct Repaired {
    /// The goals that it deleted.
    pub(super) deleted: Vec<usize>,
    /// What was looked at.
    pub(super) operations: u64,
}

/// Carries out an iteration: with equal chances a goal is moved to another sol, the order of a sol is
/// changed by the best 2-opt move, or a goal is deleted. What does not make the violation less is taken
/// back, and a goal deleted instead. With nothing that may be deleted, nothing is.
pub(super) fn repair(instance: &Instance, chain: &mut Chain, draws: &mut Stream) -> Repaired {
    let mut done = Repaired::default();
    let helped = match draws.below(3) {
        0 => move_goal(instance, chain, draws, &mut done.operations),
        1 => two_opt(instance, chain, &mut done.operations),
        _ => false,
    };
    if helped {
        return done;
    }
    let goals = culprits(instance, chain);
    done.operations += chain.nodes().len() as u64;
    let optional: Vec<usize> = goals
        .into_iter()
        .filter(|goal| may_be_deleted(instance, chain, *goal))
        .collect();
    if let Some(&goal) = draws.choose(&optional) {
        done.deleted = delete(instance, chain, goal);
        done.operations += chain.nodes().len() as u64;
    }
    done
}

/// Deletes a goal, and all that require it; says which.
pub(super) fn delete(instance: &Instance, chain: &mut Chain, goal: usize) -> Vec<usize> {
    let mut deleted = vec![goal];
    let mut at = 0;
    while at < deleted.len() {
        for &other in instance.required_by(deleted[at]) {
            if !deleted.contains(&other) && chain.position(other).is_some() {
                deleted.push(other);
            }
        }
        at += 1;
    }
    chain.retain(instance, |task| !deleted.contains(&task));
    deleted
}

/// The chain without one of the goals for one rover, the one without which it violates least; None if there is
/// none that may go.
pub(super) fn least_without(instance: &Instance, chain: &Chain) -> Option<Chain> {
    let vehicle = &instance.vehicles()[chain.rover()];
    let goals = chain.goals(instance);
    let mut best: Option<(f64, Chain)> = None;
    for goal in goals.filter(|goal| !instance.is_joint(*goal)) {
        if !may_be_deleted(instance, chain, goal) {
            continue;
        }
        let mut without = chain.clone();
        delete(instance, &mut without, goal);
        let size = without.violation().size(vehicle);
        if best.as_ref().is_none_or(|(least, _)| size < *least) {
            best = Some((size, without));
        }
    }
    best.map(|(_, chain)| chain)
}

/// Whether nothing mandatory would go with a goal.
fn may_be_deleted(instance: &Instance, chain: &Chain, goal: usize) -> bool {
    !instance.task(goal).mandatory
        && instance
            .required_by(goal)
            .iter()
            .all(|&other| chain.position(other).is_none() || may_be_deleted(instance, chain, other))
}

/// The goals that take part in a conflict: those of sols that are late or lack energy, and where memory
/// lacks, all that fill it.
fn culprits(instance: &Instance, chain: &Chain) -> Vec<usize> {
    let full = chain.violation().bits > 0;
    let nodes = chain.nodes().iter().filter(|node| {
        let task = node.visit.task;
        task < instance.goals()
            && (!chain.sol_violation(instance, node.sol).is_none()
                || (full && instance.task(task).adds_bits > 0))
    });
    nodes.map(|node| node.visit.task).collect()
}

/// Moves one of the culprits to where it violates least in the other sols.
fn move_goal(
    instance: &Instance,
    chain: &mut Chain,
    draws: &mut Stream,
    operations: &mut u64,
) -> bool {
    let vehicle = &instance.vehicles()[chain.rover()];
    let Some(&goal) = draws.choose(&culprits(instance, chain)) else {
        return false;
    };
    if vehicle.sols.len() < 2 || !instance.required_by(goal).is_empty() {
        return false;
    }
    let before = chain.violation().size(vehicle);
    let at = chain.position(goal).expect("it is in the plan");
    let sol = chain.nodes()[at].sol;
    let index_in_sol = at;
    let visit = chain.remove(instance, at);
    let (found, tested) = chain.best_insertion_where(instance, &visit, |other| other != sol);
    *operations += tested + 2 * chain.nodes().len() as u64;
    match found {
        Some(found) if found.violation.size(vehicle) < before => {
            chain.accept(instance, visit, &found);
            true
        }
        _ => {
            chain.insert(instance, visit, sol, index_in_sol);
            false
        }
    }
}

/// Turns the stretch of a sol in conflict round that leaves the least violation, and then the least driving,
/// if it makes the violation less.
fn two_opt(instance: &Instance, chain: &mut Chain, operations: &mut u64) -> bool {
    let vehicle = &instance.vehicles()[chain.rover()];
    let before = chain.violation().size(vehicle);
    let mut best = (before, i64::MAX, None);
    for sol in 0..vehicle.sols.len() {
        if chain.sol_violation(instance, sol).is_none() {
            continue;
        }
        let range = chain.sol(sol);
        for first in range.clone() {
            for last in first + 1..range.end {
                *operations += 1;
                if !chain.reverse(instance, first, last) {
                    continue;
                }
                let found = (chain.violation().size(vehicle), chain.drive_ms());
                if found.0 < best.0 || (found.0 == best.0 && found.1 < best.1 && best.2.is_some()) {
                    best = (found.0, found.1, Some((first, last)));
                }
                chain.reverse(instance, first, last);
            }
        }
    }
    match best.2 {
        Some((first, last)) => chain.reverse(instance, first, last),
        None => false,
    }
}
