//! A* in space and time: the fastest way of one rover from a given vertex and cycle, round all
//! that is reserved. It knows why it fails.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

use farside_worlds::{Roadmap, VertexId};

use super::plan::{Failure, Trip};
use super::problem::Rules;
use super::table::Table;

/// No state: the way begins here.
const START: u32 = u32::MAX;

/// The search of one rover. A state is a vertex and a cycle; from the cycle on in which nobody
/// moves any more, cycles are not told apart, so that there are finitely many.
struct Search<'a> {
    roadmap: &'a Roadmap,
    table: &'a Table,
    goal: VertexId,
    settled: u32,
    /// Where each state was reached from.
    parents: Vec<u32>,
    /// The least cycle in which each state was reached: its own, but for settled states.
    cycles: Vec<u32>,
    refusals: Refusals,
}

/// Who said no in the last cycle in which the rover could still have been somewhere.
#[derive(Default)]
struct Refusals {
    cycle: u32,
    rovers: BTreeSet<usize>,
}

impl Refusals {
    fn note(&mut self, cycle: u32, rover: usize) {
        if cycle > self.cycle {
            self.cycle = cycle;
            self.rovers.clear();
        }
        if cycle == self.cycle {
            self.rovers.insert(rover);
        }
    }
}

/// The way of `rover` that arrives first at `goal`, from `start` in the cycle `entered`, where it
/// must be free. With [`Rules::OnMap`] it may stay at its goal from its arrival on.
///
/// # Errors
/// When there is none.
pub(crate) fn search(
    roadmap: &Roadmap,
    table: &Table,
    rules: Rules,
    rover: usize,
    (start, entered): (VertexId, u32),
    goal: VertexId,
) -> Result<Trip, Failure> {
    let settled = table.settled().max(entered);
    let layers = (settled - entered + 1) as usize;
    let mut search = Search {
        roadmap,
        table,
        goal,
        settled,
        parents: vec![START; layers * roadmap.len()],
        cycles: vec![u32::MAX; layers * roadmap.len()],
        refusals: Refusals::default(),
    };
    // Whoever stays needs the goal free of everybody who comes later.
    let earliest = match rules {
        Rules::Queues => 0,
        Rules::OnMap => table.stays(goal).last().map_or(0, |stay| stay.until),
    };
    let id = |v: VertexId, cycle: u32| (cycle.min(settled) - entered) * roadmap.len() as u32 + v.0;
    let vertex = |state: u32| VertexId(state % roadmap.len() as u32);
    let mut open = BinaryHeap::new();
    let to_goal = roadmap.distances_to(goal);
    let left = |v: VertexId| to_goal.from(v);
    let first = id(start, entered);
    search.cycles[first as usize] = entered;
    // Of states with equal bounds the latest goes first: it is nearer to the goal.
    open.push((Reverse(entered + left(start)), entered, Reverse(first)));
    while let Some((_, cycle, Reverse(state))) = open.pop() {
        let here = vertex(state);
        if here == goal && cycle >= earliest {
            return Ok(search.trip(state, entered, vertex));
        }
        if cycle > search.cycles[state as usize] {
            continue;
        }
        for to in search.moves(here, cycle) {
            let next = id(to, cycle + 1);
            if cycle + 1 < search.cycles[next as usize] {
                search.parents[next as usize] = state;
                search.cycles[next as usize] = cycle + 1;
                open.push((Reverse(cycle + 1 + left(to)), cycle + 1, Reverse(next)));
            }
        }
    }
    Err(Failure {
        rover,
        blockers: search.refusals.rovers.into_iter().collect(),
        cycle: search.refusals.cycle,
    })
}

impl Search<'_> {
    /// Where a rover that is `here` in `cycle` may be in the next one.
    fn moves(&mut self, here: VertexId, cycle: u32) -> Vec<VertexId> {
        let next = cycle + 1;
        let mut free = Vec::new();
        // Where nobody moves any more, nothing is worth waiting for.
        let waits = (cycle < self.settled).then_some(here);
        let table = self.table;
        for &to in waits.iter().chain(self.roadmap.neighbors(here)) {
            let bars = if to == here {
                table.occupant(here, next)
            } else {
                table.bars(here, to, next)
            };
            match bars {
                Some(rover) => self.refusals.note(next.min(self.settled + 1), rover),
                None => free.push(to),
            }
        }
        free
    }

    fn trip(&self, last: u32, entered: u32, vertex: impl Fn(u32) -> VertexId) -> Trip {
        let mut vertices = vec![self.goal];
        let mut state = last;
        while self.parents[state as usize] != START {
            state = self.parents[state as usize];
            vertices.push(vertex(state));
        }
        vertices.reverse();
        Trip { entered, vertices }
    }
}
