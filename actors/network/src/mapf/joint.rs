//! The joint search: A* over the states of several rovers at once, one rover's move after the other
//! (operator decomposition, Standley 2010). Exact.
//!
//! A state says of each rover whether it is still queued, where it is, or that it is done. Being
//! done is a decision for ever: with [`Rules::StayAtTarget`] a rover that comes to its goal may be
//! done or may move on again later, which makes the costs of waiting there a matter of the state
//! alone. The search begins one cycle early, with all in their queues (on a map, each in one of its
//! own that it must leave at once), so that whoever needs n steps arrives in cycle n - 1.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::rc::Rc;

use farside_worlds::VertexId;

use super::plan::Trip;
use super::problem::{CoupledError, Objective, Problem, Rules};

/// Not yet on the roadmap. Vertices are below [`farside_worlds::roadmap::MAX_VERTICES`].
const QUEUED: u32 = u32::MAX;
/// At the goal for good, or gone from there.
const DONE: u32 = u32::MAX - 1;

/// A node: the state of all members in one cycle, followed by that of some in the next.
struct Node {
    symbols: Rc<[u32]>,
    /// Steps so far, of all rovers or of the whole team.
    cost: u32,
    parent: usize,
}

struct Search<'a> {
    problem: &'a Problem<'a>,
    members: &'a [usize],
    /// Each member's nearest predecessor in its queue that is a member, by place in `members`.
    predecessors: Vec<Option<usize>>,
    objective: Objective,
    nodes: Vec<Node>,
    /// The nodes that are whole states.
    states: BTreeMap<Rc<[u32]>, usize>,
    open: BinaryHeap<(Reverse<u32>, u32, usize, Reverse<usize>)>,
}

/// The best trips of `members` (sorted; the trips in their order), with nobody else there.
/// `expansions` counts on, up to `limit`.
pub(crate) fn search(
    problem: &Problem<'_>,
    members: &[usize],
    objective: Objective,
    limit: u64,
    expansions: &mut u64,
) -> Result<Vec<Trip>, CoupledError> {
    let count = members.len();
    let predecessor = |place: usize| {
        let entry = problem.missions()[members[place]].entry;
        let same = |&other: &usize| problem.missions()[members[other]].entry == entry;
        (0..place).rev().find(same)
    };
    let mut search = Search {
        problem,
        members,
        predecessors: (0..count).map(predecessor).collect(),
        objective,
        nodes: Vec::new(),
        states: BTreeMap::new(),
        open: BinaryHeap::new(),
    };
    search.reach(vec![QUEUED; count], 0, 0);
    while let Some((_, cost, _, Reverse(at))) = search.open.pop() {
        let symbols = search.nodes[at].symbols.clone();
        if cost > search.nodes[at].cost {
            continue;
        }
        if symbols.len() == count && symbols.iter().all(|&symbol| symbol == DONE) {
            return Ok(search.trips(at));
        }
        if *expansions >= limit {
            return Err(CoupledError::Exhausted {
                expansions: *expansions,
            });
        }
        *expansions += 1;
        search.expand(at, &symbols);
    }
    Err(CoupledError::Unsolvable {
        expansions: *expansions,
    })
}

impl Search<'_> {
    /// Gives the next member, in all ways there are, its next place.
    fn expand(&mut self, at: usize, symbols: &[u32]) {
        let count = self.members.len();
        let place = symbols.len() - count;
        let cost = self.nodes[at].cost;
        let step = match self.objective {
            Objective::SumOfCosts => u32::from(symbols[place] != DONE),
            // The team's step, told once.
            Objective::Makespan => u32::from(place == 0),
        };
        for next in self.moves(symbols, place) {
            if !self.is_free(symbols, place, next) {
                continue;
            }
            let mut symbols = symbols.to_vec();
            symbols.push(next);
            if symbols.len() == 2 * count {
                symbols.drain(..count);
            }
            self.reach(symbols, cost + step, at);
        }
    }

    /// Notes a node, unless it is a state that was reached as cheaply before.
    fn reach(&mut self, symbols: Vec<u32>, cost: u32, parent: usize) {
        let bound = self.bound(&symbols, cost);
        let assigned = symbols.len() - self.members.len();
        let symbols: Rc<[u32]> = symbols.into();
        let at = match self.states.get(&symbols) {
            Some(&at) if self.nodes[at].cost <= cost => return,
            // Bounds never fall along a way, so that what is expanded is never improved, and a
            // node between states belongs to one state only.
            Some(&at) => {
                (self.nodes[at].cost, self.nodes[at].parent) = (cost, parent);
                at
            }
            None => {
                self.nodes.push(Node {
                    symbols: symbols.clone(),
                    cost,
                    parent,
                });
                self.nodes.len() - 1
            }
        };
        if assigned == 0 {
            self.states.insert(symbols, at);
        }
        self.open
            .push((Reverse(bound), cost, assigned, Reverse(at)));
    }

    /// What the cheapest plan by way of this node costs at least: each rover drives its shortest
    /// way, after those that are before it in its queue have entered, a cycle each.
    fn bound(&self, symbols: &[u32], cost: u32) -> u32 {
        let count = self.members.len();
        let assigned = symbols.len() - count;
        // Each member by its latest symbol.
        let latest = |place: usize| {
            let at = if place < assigned {
                count + place
            } else {
                place
            };
            symbols[at]
        };
        let left = |place: usize| {
            let mission = self.problem.missions()[self.members[place]];
            let distance = |from| self.problem.roadmap().distance(from, mission.goal);
            match symbols_of(latest(place)) {
                Symbol::Done => 0,
                Symbol::At(vertex) => distance(vertex),
                Symbol::Queued => {
                    // The predecessor's symbol is of the same cycle or the next one.
                    let mut before = self.predecessors[place];
                    let mut ahead = 0;
                    while let Some(other) = before {
                        let same = if place < assigned {
                            latest(other)
                        } else {
                            symbols[other]
                        };
                        ahead += u32::from(same == QUEUED);
                        before = self.predecessors[other];
                    }
                    distance(mission.entry) + 1 + ahead
                }
            }
        };
        match self.objective {
            Objective::SumOfCosts => cost + (0..count).map(left).sum::<u32>(),
            // With some members moved, `cost` has the step in it that the others are yet to make.
            Objective::Makespan if assigned == 0 => cost + (0..count).map(left).max().unwrap_or(0),
            Objective::Makespan => {
                let ahead = |place| left(place).saturating_sub(u32::from(place >= assigned));
                cost + (0..count).map(ahead).max().unwrap_or(0)
            }
        }
    }

    /// Where the member may be in the next cycle, for all that it knows alone.
    fn moves(&self, symbols: &[u32], place: usize) -> Vec<u32> {
        let mission = self.problem.missions()[self.members[place]];
        let stays = self.problem.rules() == Rules::StayAtTarget;
        let mut moves = Vec::new();
        let mut arrive = |vertex: VertexId| {
            if vertex == mission.goal {
                moves.push(DONE);
            }
            if vertex != mission.goal || stays {
                moves.push(vertex.0);
            }
        };
        match symbols_of(symbols[place]) {
            Symbol::Done => moves.push(DONE),
            Symbol::At(here) => {
                let neighbors = self.problem.roadmap().neighbors(here);
                neighbors.iter().copied().for_each(&mut arrive);
                moves.push(here.0);
            }
            Symbol::Queued => {
                let waits_for = |other: usize| symbols[other] == QUEUED;
                if !self.predecessors[place].is_some_and(waits_for) {
                    arrive(mission.entry);
                }
                if !stays {
                    moves.push(QUEUED);
                }
            }
        }
        moves
    }

    /// Whether the member can do that together with what those before it do.
    fn is_free(&self, symbols: &[u32], place: usize, next: u32) -> bool {
        let count = self.members.len();
        let goal = |place: usize| self.problem.missions()[self.members[place]].goal;
        let stays = self.problem.rules() == Rules::StayAtTarget;
        let before = |place: usize| match symbols_of(symbols[place]) {
            Symbol::Queued => None,
            Symbol::At(vertex) => Some(vertex),
            Symbol::Done => stays.then(|| goal(place)),
        };
        // Whoever is done in this very step is at its goal once more before it is gone.
        let after = |place: usize, next: u32| match symbols_of(next) {
            Symbol::Queued => None,
            Symbol::At(vertex) => Some(vertex),
            Symbol::Done => (stays || symbols[place] != DONE).then(|| goal(place)),
        };
        let Some(to) = after(place, next) else {
            return true;
        };
        let moved = |place: usize| after(place, symbols[count + place]);
        if (0..place).any(|other| moved(other) == Some(to)) {
            return false;
        }
        // Who is done and stays will be there in any case.
        if (place + 1..count).any(|other| symbols[other] == DONE && before(other) == Some(to)) {
            return false;
        }
        let Some(from) = before(place).filter(|&from| from != to) else {
            return true;
        };
        // Along the chain of those that leave to one another: back to `from` it is a swap, or a
        // rotation. Whoever is not assigned yet looks for itself, later.
        let mut at = to;
        for _ in 0..place {
            let Some(other) = (0..place).find(|&other| before(other) == Some(at)) else {
                return true;
            };
            match moved(other) {
                Some(next) if next == from => return false,
                Some(next) => at = next,
                None => return true,
            }
        }
        true
    }

    /// The trips that lead to a node in which all are done.
    fn trips(&self, last: usize) -> Vec<Trip> {
        let count = self.members.len();
        let mut states = Vec::new();
        let mut at = last;
        loop {
            let node = &self.nodes[at];
            if node.symbols.len() == count {
                states.push(&node.symbols);
            }
            if at == 0 {
                break;
            }
            at = node.parent;
        }
        states.reverse();
        let trip = |place: usize| {
            let mission = self.problem.missions()[self.members[place]];
            let mut trip = Trip {
                entered: 0,
                vertices: Vec::new(),
            };
            // The first state is that of the cycle before cycle 0.
            for (cycle, state) in (0..).zip(&states[1..]) {
                match symbols_of(state[place]) {
                    Symbol::Queued => trip.entered = cycle + 1,
                    Symbol::At(vertex) => trip.vertices.push(vertex),
                    Symbol::Done => {
                        trip.vertices.push(mission.goal);
                        break;
                    }
                }
            }
            trip
        };
        (0..count).map(trip).collect()
    }
}

enum Symbol {
    Queued,
    At(VertexId),
    Done,
}

fn symbols_of(symbol: u32) -> Symbol {
    match symbol {
        QUEUED => Symbol::Queued,
        DONE => Symbol::Done,
        vertex => Symbol::At(VertexId(vertex)),
    }
}
