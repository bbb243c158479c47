//! For the tests of this module: random roadmaps and teams, and oracles that know of no table, no
//! gap and no heuristic. They try out everything, cycle by cycle.

use std::collections::{BTreeMap, BTreeSet};

use farside_worlds::{Roadmap, VertexId};
use proptest::prelude::*;

use super::plan::{Plan, Trip};
use super::problem::{Mission, Problem, Rules};
use crate::testing::{grid, v};

/// A small world. All small numbers, so that it shrinks well.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    columns: u32,
    rows: u32,
    /// Edges of the grid are left out by these bits, as long as it stays connected.
    cuts: u64,
    /// Entries and goals.
    picks: Vec<(u32, u32)>,
    pub(crate) rules: Rules,
}

/// Grids of up to `columns` x `rows` with holes, and up to so many rovers.
pub(crate) fn case(columns: u32, rows: u32, rovers: usize) -> impl Strategy<Value = Case> {
    let rules = prop_oneof![Just(Rules::DisappearAtTarget), Just(Rules::StayAtTarget)];
    let picks = prop::collection::vec((0..64u32, 0..64u32), 1..=rovers);
    let parts = (2..=columns, 1..=rows, any::<u64>(), picks, rules);
    parts.prop_map(|(columns, rows, cuts, picks, rules)| Case {
        columns,
        rows,
        cuts,
        picks,
        rules,
    })
}

impl Case {
    /// A connected grid with some edges cut out: trees, loops, corridors.
    pub(crate) fn roadmap(&self) -> Roadmap {
        let whole = grid(self.columns, self.rows, &[]);
        let mut missing = Vec::new();
        for (bit, &(a, b)) in whole.edges().iter().enumerate() {
            if self.cuts >> (bit % 64) & 1 == 1 {
                missing.push((a.0, b.0));
                if !is_connected(&whole, &missing) {
                    missing.pop();
                }
            }
        }
        grid(self.columns, self.rows, &missing)
    }

    /// Missions between any two vertices; on the map, those that are left for the later rovers, and
    /// no more rovers than half the vertices.
    pub(crate) fn missions(&self) -> Vec<Mission> {
        let count = self.columns * self.rows;
        let missions = self.picks.iter().map(|&(a, b)| (a % count, b % count));
        if self.rules == Rules::DisappearAtTarget {
            return missions.map(|(a, b)| Mission::new(v(a), v(b))).collect();
        }
        let (mut entries, mut goals) = (BTreeSet::new(), BTreeSet::new());
        let free = |taken: &mut BTreeSet<u32>, from: u32| {
            let mut at = from;
            while !taken.insert(at) {
                at = (at + 1) % count;
            }
            v(at)
        };
        missions
            .take((count as usize).div_ceil(2))
            .map(|(a, b)| Mission::new(free(&mut entries, a), free(&mut goals, b)))
            .collect()
    }
}

fn is_connected(whole: &Roadmap, missing: &[(u32, u32)]) -> bool {
    let mut reached = BTreeSet::from([v(0)]);
    let mut open = vec![v(0)];
    while let Some(here) = open.pop() {
        for &next in whole.neighbors(here) {
            let edge = (here.0.min(next.0), here.0.max(next.0));
            if !missing.contains(&edge) && reached.insert(next) {
                open.push(next);
            }
        }
    }
    reached.len() == whole.len()
}

/// Whether two or more of these moves, of a rover each, cannot be made together. A move into the
/// roadmap comes from nowhere, a move out of it goes nowhere.
pub(crate) fn clash(moves: &[(Option<VertexId>, Option<VertexId>)]) -> bool {
    for (i, a) in moves.iter().enumerate() {
        if a.1.is_some() && moves[..i].iter().any(|b| a.1 == b.1) {
            return true;
        }
    }
    // Rings: whoever can still be reached after as many steps as there are rovers is on one.
    let follows: BTreeMap<VertexId, VertexId> = moves
        .iter()
        .filter_map(|&(from, to)| Some((from?, to?)))
        .filter(|(from, to)| from != to)
        .collect();
    follows.keys().any(|&start| {
        let mut at = Some(start);
        for _ in 0..follows.len() {
            at = at.and_then(|at| follows.get(&at).copied());
            if at == Some(start) {
                return true;
            }
        }
        false
    })
}

/// Where a rover of a plan is in each cycle.
fn place(trip: &Trip, rules: Rules, cycle: Option<u32>) -> Option<VertexId> {
    let cycle = cycle?;
    match rules {
        Rules::StayAtTarget if cycle > trip.last_cycle() => Some(trip.end()),
        _ => trip.at(cycle),
    }
}

/// The first cycle in which a rover can be at its goal for good, in the midst of `others`: the set
/// of all vertices where it can be is followed from cycle to cycle. It enters in `ready` or later
/// if it may wait outside, else in `ready`.
pub(crate) fn first_arrival(
    roadmap: &Roadmap,
    others: &[Trip],
    rules: Rules,
    mission: Mission,
    ready: u32,
    may_wait: bool,
) -> Option<u32> {
    let settled = others.iter().map(|trip| trip.last_cycle() + 1).max();
    let horizon = settled.unwrap_or(0).max(ready) + roadmap.len() as u32 + 1;
    let mut here = BTreeSet::new();
    for cycle in 0..=horizon {
        let before = cycle.checked_sub(1);
        let can = |from: Option<VertexId>, to: VertexId| {
            let other = |trip| (place(trip, rules, before), place(trip, rules, Some(cycle)));
            let mut moves: Vec<_> = others.iter().map(other).collect();
            moves.push((from, Some(to)));
            !clash(&moves)
        };
        let mut next = BTreeSet::new();
        for &from in &here {
            for &to in roadmap.neighbors(from).iter().chain([&from]) {
                if can(Some(from), to) {
                    next.insert(to);
                }
            }
        }
        if (cycle == ready || may_wait && cycle > ready) && can(None, mission.entry) {
            next.insert(mission.entry);
        }
        here = next;
        let free_from = |cycle| {
            let mut cycles = cycle..=horizon;
            cycles.all(|c| {
                others
                    .iter()
                    .all(|t| place(t, rules, Some(c)) != Some(mission.goal))
            })
        };
        let stays = rules == Rules::StayAtTarget;
        if here.contains(&mission.goal) && (!stays || free_from(cycle)) {
            return Some(cycle);
        }
    }
    None
}

/// Trips that are no plan of anybody's: random walks, of which those are kept that get on with
/// the ones before.
pub(crate) fn walks(roadmap: &Roadmap, rules: Rules, seeds: &[u64]) -> Vec<Trip> {
    let mut trips = Vec::new();
    for &seed in seeds {
        let mut bits = seed;
        let mut draw = |n: usize| {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (bits >> 33) as usize % n
        };
        let entered = if rules == Rules::DisappearAtTarget {
            draw(6) as u32
        } else {
            0
        };
        let mut vertices = vec![v(draw(roadmap.len()) as u32)];
        for _ in 0..draw(12) {
            let here = vertices[vertices.len() - 1];
            let near = roadmap.neighbors(here);
            vertices.push(near.get(draw(near.len() + 1)).copied().unwrap_or(here));
        }
        if rules == Rules::DisappearAtTarget {
            let goal = vertices[vertices.len() - 1];
            let first = vertices.iter().position(|&v| v == goal);
            vertices.truncate(first.map_or(1, |at| at + 1));
        }
        let mut longer = trips.clone();
        longer.push(Trip { entered, vertices });
        longer.sort_by_key(|trip| trip.entered);
        let mission = |trip: &Trip| Mission::new(trip.vertices[0], trip.end());
        let missions = longer.iter().map(mission).collect();
        let plan = Plan {
            trips: longer.iter().cloned().map(Some).collect(),
        };
        let problem = Problem::new(roadmap, missions, rules);
        if problem.is_ok_and(|problem| plan.conflicts(&problem).is_empty()) {
            trips = longer;
        }
    }
    trips
}

/// A rover in the brute-force search: where it is, if it has entered and not left, whether it has
/// left, and for how long it has been standing at its goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Pawn {
    at: Option<VertexId>,
    left: bool,
    rests: u32,
}

/// The least sum of costs or the least makespan, by uniform-cost search over all joint moves; none
/// if there is no plan. A rover that rests at its goal pays nothing until it leaves it again, and
/// then for all the time.
pub(crate) fn brute_force(problem: &Problem<'_>, makespan: bool) -> Option<u64> {
    let stays = problem.rules() == Rules::StayAtTarget;
    let missions = problem.missions();
    // Where there is no plan rests would grow for ever; without them there are finitely many
    // states.
    if stays && !makespan && brute_force(problem, true).is_none() {
        return None;
    }
    let pawn = Pawn {
        at: None,
        left: false,
        rests: 0,
    };
    // How long somebody has rested matters only for sums.
    let start = vec![pawn; missions.len()];
    let mut open = BTreeSet::from([(0u64, start)]);
    let mut closed = BTreeSet::new();
    let home = |pawn: &Pawn, rover: usize| pawn.left || pawn.at == Some(missions[rover].goal);
    while let Some((cost, pawns)) = open.pop_first() {
        if pawns.iter().enumerate().all(|(i, pawn)| home(pawn, i)) {
            // Each paid for the step out of its queue.
            let steps = if makespan { 1 } else { missions.len() as u64 };
            return Some(cost - steps);
        }
        if !closed.insert(pawns.clone()) {
            continue;
        }
        let mut joint: Vec<Vec<(Pawn, u64)>> = vec![vec![]];
        for rover in 0..pawns.len() {
            let options = pawn_moves(problem, &pawns, rover, makespan);
            let longer = |moves: &Vec<(Pawn, u64)>| {
                let with = |&option: &(Pawn, u64)| {
                    let mut moves = moves.clone();
                    moves.push(option);
                    moves
                };
                options.iter().map(with).collect::<Vec<_>>()
            };
            joint = joint.iter().flat_map(longer).collect();
        }
        for moves in joint {
            let pairs = moves.iter().zip(&pawns);
            let steps: Vec<_> = pairs.map(|((new, _), old)| (old.at, new.at)).collect();
            if clash(&steps) {
                continue;
            }
            let paid: u64 = moves.iter().map(|(_, paid)| paid).sum();
            let paid = if makespan { 1 } else { paid };
            let next: Vec<Pawn> = moves.into_iter().map(|(pawn, _)| pawn).collect();
            if !closed.contains(&next) {
                open.insert((cost + paid, next));
            }
        }
    }
    debug_assert!(stays, "with queues there is always a plan");
    None
}

/// What a pawn can do by itself, and what it pays for that.
fn pawn_moves(
    problem: &Problem<'_>,
    pawns: &[Pawn],
    rover: usize,
    makespan: bool,
) -> Vec<(Pawn, u64)> {
    let (mission, pawn) = (problem.missions()[rover], pawns[rover]);
    let stays = problem.rules() == Rules::StayAtTarget;
    let to = |vertex: VertexId| Pawn {
        at: Some(vertex),
        left: false,
        rests: 0,
    };
    let Some(here) = pawn.at else {
        if pawn.left {
            return vec![(pawn, 0)];
        }
        let before = problem.predecessor(rover);
        let free = before.is_none_or(|other| pawns[other].at.is_some() || pawns[other].left);
        let enters = free.then(|| (to(mission.entry), 1));
        return enters
            .into_iter()
            .chain((!stays).then_some((pawn, 1)))
            .collect();
    };
    let mut moves = Vec::new();
    if here == mission.goal {
        if !stays {
            let (at, left) = (None, true);
            return vec![(Pawn { at, left, rests: 0 }, 0)];
        }
        let rests = if makespan { 0 } else { pawn.rests + 1 };
        moves.push((Pawn { rests, ..pawn }, 0));
    } else {
        moves.push((pawn, 1));
    }
    for &next in problem.roadmap().neighbors(here) {
        moves.push((to(next), u64::from(pawn.rests) + 1));
    }
    moves
}

#[test]
fn the_oracle_knows_a_rotation_from_a_train() {
    let step = |a, b| (Some(v(a)), Some(v(b)));
    assert!(clash(&[step(0, 1), step(1, 2), step(2, 0)]));
    assert!(clash(&[step(0, 1), step(1, 0)]));
    assert!(!clash(&[step(0, 1), step(1, 2), step(2, 3)]));
    assert!(!clash(&[
        (None, Some(v(0))),
        step(0, 1),
        (Some(v(1)), None)
    ]));
    assert!(clash(&[(None, Some(v(0))), step(0, 0)]));
}

/// The least sum of steps in which rovers are not at rest at their goals, by trying all steps of
/// the team from all places that it can be at, cheapest first. There has to be a plan.
pub(crate) fn least_loss(problem: &Problem<'_>) -> u64 {
    let map = problem.roadmap();
    let goals: Vec<VertexId> = problem.missions().iter().map(|m| m.goal).collect();
    let starts: Vec<VertexId> = problem.missions().iter().map(|m| m.entry).collect();
    let mut open = BTreeSet::from([(0, starts)]);
    let mut done = BTreeSet::new();
    while let Some((cost, at)) = open.pop_first() {
        if at == goals {
            return cost;
        }
        if !done.insert(at.clone()) {
            continue;
        }
        let mut steps = vec![Vec::new()];
        for &here in &at {
            let places = [map.neighbors(here), &[here]].concat();
            let longer = |step: Vec<VertexId>| {
                let longer = places.iter().map(move |&v| [&step[..], &[v]].concat());
                longer.collect::<Vec<_>>()
            };
            steps = steps.into_iter().flat_map(longer).collect();
        }
        for step in steps {
            let pairs: Vec<_> = at
                .iter()
                .zip(&step)
                .map(|(a, b)| (Some(*a), Some(*b)))
                .collect();
            if clash(&pairs) {
                continue;
            }
            let at_rest = |i: &usize| at[*i] == goals[*i] && step[*i] == goals[*i];
            let moving = (0..at.len()).filter(|i| !at_rest(i)).count() as u64;
            open.insert((cost + moving, step));
        }
    }
    unreachable!("there is no plan")
}
