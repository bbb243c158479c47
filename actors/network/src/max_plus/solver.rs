//! Max-plus (*network-guided*, section 3.4): one node's share of the message passing that
//! maximises the global utility Q (equation 1) over the coordination graph.
//!
//! Pure computation: which vectors change, not how they travel, nor how long it takes. A vector for
//! rover j has one value for each of j's candidate paths.

mod anytime;
mod edge;
mod meetings;

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use farside_worlds::NodeId;

use crate::ids::RoverId;
use crate::max_plus::candidates::CandidatePath;
use crate::max_plus::messages::{Choice, Vector};
use crate::max_plus::payoff::Payoffs;
use anytime::Anytime;
use edge::{Edge, Spare};
use meetings::{Known, Meetings, Paths};

/// A rover of the coordination graph, as one node sees it.
#[derive(Debug)]
struct Agent {
    rover: RoverId,
    paths: Paths,
}

impl Agent {
    fn paths(&self) -> &[CandidatePath] {
        &self.paths.list
    }
}

/// How messages are made of what came in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rules {
    /// The largest change that counts as none.
    pub(crate) tolerance: f32,
    /// The share of the old message in a new one, in [0, 1).
    pub(crate) damping: f32,
    /// Whether the best assignment of all iterations is kept.
    pub(crate) anytime: bool,
}

/// What one node optimises in one cycle: its own rovers, its neighbours' rovers, and the edges
/// between them that touch an own one.
#[derive(Debug)]
pub(crate) struct Solver {
    payoffs: Payoffs,
    rules: Rules,
    agents: Vec<Agent>,
    /// The place of each rover among the agents.
    places: BTreeMap<RoverId, usize>,
    /// The first agents are the node's own.
    own: usize,
    /// Which agents each neighbour brought.
    brought: Vec<(NodeId, Range<usize>)>,
    /// Edges at each own agent, to all other agents in their order: see [`place_of`].
    edges: Vec<Vec<Edge>>,
    /// Own agents that something new came in for since their messages were made. The others'
    /// messages would come out the same.
    moved: Vec<bool>,
    anytime: Option<Anytime>,
    /// Pairs of candidate paths compared so far.
    compared: u64,
    room: Room,
}

/// Room to work in, so that nothing is allocated for each edge, and what is kept from cycle to
/// cycle.
#[derive(Debug, Default)]
pub(crate) struct Room {
    known: Known,
    spare: Vec<Spare>,
    meetings: Meetings,
    /// What an own rover's paths are worth by all messages, and by all but one.
    total: Vec<f32>,
    base: Vec<f32>,
    /// The next message.
    fresh: Vec<f32>,
}

/// Where the edge to agent `j` is in the list of own agent `i`.
fn place_of(i: usize, j: usize) -> usize {
    j - usize::from(j > i)
}

impl Solver {
    /// The problem of a node with its own `rovers`, whose paths have their unary payoffs, made in
    /// what is left of the one before.
    pub(crate) fn new(
        payoffs: Payoffs,
        rules: Rules,
        room: Room,
        rovers: Vec<(RoverId, Arc<[CandidatePath]>)>,
    ) -> Self {
        let own = rovers.len();
        let mut problem = Solver {
            payoffs,
            rules,
            agents: Vec::new(),
            places: BTreeMap::new(),
            own,
            brought: Vec::new(),
            edges: (0..own).map(|_| Vec::with_capacity(own)).collect(),
            moved: vec![true; own],
            anytime: None,
            compared: 0,
            room,
        };
        for (rover, paths) in rovers {
            problem.push(rover, paths);
        }
        for i in 0..own {
            for j in (0..own).filter(|&j| j != i) {
                // What a pair is worth does not depend on who asks.
                let edge = if j < i {
                    {
                        let spare = problem.room.spare.pop().unwrap_or_default();
                        problem.edges[j][place_of(j, i)].transposed(spare)
                    }
                } else {
                    problem.edge(i, j)
                };
                problem.edges[i].push(edge);
            }
        }
        if rules.anytime {
            let agents = problem.agents.iter();
            problem.anytime = Some(Anytime::new(agents.map(Agent::paths), own));
        }
        problem
    }

    /// What the next problem can be made in.
    pub(crate) fn into_room(self) -> Room {
        let mut room = self.room;
        let edges = self.edges.into_iter().flatten();
        room.spare.extend(edges.map(Edge::into_spare));
        room
    }

    fn push(&mut self, rover: RoverId, paths: Arc<[CandidatePath]>) {
        self.places.insert(rover, self.agents.len());
        let paths = self.room.known.paths(paths, self.payoffs.leaf_paths_hold);
        self.agents.push(Agent { rover, paths });
    }

    /// Adds a neighbour's rovers. Those known already are left as they are. Messages to them are
    /// handed over to that neighbour to make, up to `handed` pairs of candidate paths.
    pub(crate) fn add(
        &mut self,
        node: NodeId,
        rovers: Vec<(RoverId, Arc<[CandidatePath]>)>,
        mut handed: u64,
    ) {
        let first = self.agents.len();
        for (rover, paths) in rovers {
            if paths.is_empty() || self.places.contains_key(&rover) {
                continue;
            }
            if let Some(anytime) = &mut self.anytime {
                anytime.expect(&paths);
            }
            self.push(rover, paths);
            let j = self.agents.len() - 1;
            for i in 0..self.own {
                let pairs = self.pairs_between(i, j);
                let edge = if pairs <= handed {
                    handed -= pairs;
                    self.handed_edge(i, j)
                } else {
                    self.edge(i, j)
                };
                self.edges[i].push(edge);
            }
        }
        self.brought.push((node, first..self.agents.len()));
        self.moved.fill(true);
    }

    fn pairs_between(&self, i: usize, j: usize) -> u64 {
        (self.agents[i].paths().len() * self.agents[j].paths().len()) as u64
    }

    fn edge(&mut self, i: usize, j: usize) -> Edge {
        self.compared += self.pairs_between(i, j);
        self.edge_for_free(i, j)
    }

    fn edge_for_free(&mut self, i: usize, j: usize) -> Edge {
        let (a, b) = (&self.agents[i], &self.agents[j]);
        let (room, payoffs) = (&mut self.room, &self.payoffs);
        let spare = room.spare.pop().unwrap_or_default();
        Edge::between(&a.paths, &b.paths, payoffs, &mut room.meetings, spare)
    }

    fn handed_edge(&mut self, i: usize, j: usize) -> Edge {
        if self.anytime.is_none() {
            return Edge::handed_over((self.agents[i].paths().len(), self.agents[j].paths().len()));
        }
        // Who judges assignments looks at one pair of it now and then. That all of them are made
        // for that is a short cut, like others.
        let mut edge = self.edge_for_free(i, j);
        edge.hand_over();
        edge
    }

    /// Pairs of candidate paths that were compared, to make payoffs, since this was last asked.
    pub(crate) fn take_compared(&mut self) -> u64 {
        std::mem::take(&mut self.compared)
    }

    /// Pairs of candidate paths that an iteration looks at.
    pub(crate) fn pairs(&self) -> u64 {
        self.edges.iter().flatten().map(Edge::work).sum()
    }

    /// The same if nothing were handed over, neither by this node nor to it.
    pub(crate) fn pairs_of_its_own(&self) -> u64 {
        self.edges.iter().flatten().map(Edge::pairs).sum()
    }

    /// Pairs of candidate paths of the messages that are handed over.
    pub(crate) fn handed(&self) -> u64 {
        let handed = |edge: &&Edge| edge.handed;
        let edges = self.edges.iter().flatten().filter(handed);
        edges.map(Edge::pairs).sum()
    }

    /// True if no own rover interacts with another: there is nothing to pass on.
    pub(crate) fn is_trivial(&self) -> bool {
        self.edges.iter().all(Vec::is_empty)
    }

    /// Takes a neighbour's message. False if it fits no edge, or changes nothing.
    pub(crate) fn receive(&mut self, vector: &Vector) -> bool {
        let place = |rover| self.places.get(rover).copied();
        let (Some(i), Some(j)) = (place(&vector.to), place(&vector.from)) else {
            return false;
        };
        // A rover between two nodes may be taken for its own by both.
        if i >= self.own || i == j || !self.edges[i][place_of(i, j)].hear(&vector.values) {
            return false;
        }
        self.moved[i] = true;
        true
    }

    /// Takes what a message to an own rover is to be made of here. False if it fits no edge, or
    /// changes nothing.
    pub(crate) fn take(&mut self, base: &Vector) -> bool {
        let place = |rover| self.places.get(rover).copied();
        let (Some(i), Some(j)) = (place(&base.to), place(&base.from)) else {
            return false;
        };
        i < self.own && i != j && self.edges[i][place_of(i, j)].take(&base.values)
    }

    /// Makes the messages to own rovers that others handed over. True if one of them changed.
    fn make_incoming(&mut self) -> bool {
        let mut changed = false;
        for (edges, moved) in self.edges.iter_mut().zip(&mut self.moved) {
            for edge in edges {
                let is_new = edge.make_incoming(&self.rules, &mut self.room.fresh);
                *moved |= is_new;
                changed |= is_new;
            }
        }
        changed
    }

    /// Takes the path that a neighbour's rover has as things stand there.
    pub(crate) fn note(&mut self, choice: &Choice) {
        let place = self.places.get(&choice.rover).copied();
        if let (Some(anytime), Some(j)) = (&mut self.anytime, place)
            && j >= self.own
            && (choice.path as usize) < self.agents[j].paths().len()
        {
            anytime.announced(j, choice.path as usize);
        }
    }

    /// The first half of an iteration: every own rover's messages from what came in before it. True
    /// if one of them changed by more than the tolerance.
    pub(crate) fn compute(&mut self) -> bool {
        let mut changed = self.make_incoming() && self.rules.damping > 0.0;
        if let Some(mut anytime) = self.anytime.take() {
            anytime.judge(&self.agents, &self.edges);
            anytime.choose((0..self.own).map(|i| first_best(&self.total(i))));
            self.anytime = Some(anytime);
        }
        let mut room = std::mem::take(&mut self.room);
        for i in 0..self.own {
            let moved = std::mem::take(&mut self.moved[i]);
            let damped = self.rules.damping > 0.0;
            if moved || damped {
                self.add_up(i, &mut room.total);
            }
            for edge in &mut self.edges[i] {
                // A damped message goes on to approach what it was made of.
                let same = !(moved || damped && edge.changed);
                if same {
                    edge.changed = false;
                    continue;
                }
                changed |= edge.refresh(&self.rules, &mut room);
            }
        }
        self.room = room;
        changed
    }

    /// The second half: messages between two own rovers take effect.
    pub(crate) fn deliver(&mut self) {
        for i in 0..self.own {
            for j in 0..i {
                let (low, high) = self.edges.split_at_mut(i);
                let (down, up) = (&mut high[0][place_of(i, j)], &mut low[j][place_of(j, i)]);
                if down.changed {
                    up.hear(&down.outgoing);
                    self.moved[j] = true;
                }
                if up.changed {
                    down.hear(&up.outgoing);
                    self.moved[i] = true;
                }
            }
        }
    }

    /// The vectors for the rovers of `node` that changed in the last iteration; and of those that
    /// it makes itself, the bases that did.
    pub(crate) fn changed_for(&self, node: NodeId) -> (Vec<Vector>, Vec<Vector>) {
        let (mut vectors, mut bases) = (Vec::new(), Vec::new());
        let brought = || self.brought.iter().filter(|(by, _)| *by == node);
        for (i, edges) in self.edges.iter().enumerate() {
            for j in brought().flat_map(|(_, agents)| agents.clone()) {
                let edge = &edges[place_of(i, j)];
                if edge.changed {
                    let list = if edge.handed {
                        &mut bases
                    } else {
                        &mut vectors
                    };
                    list.push(Vector {
                        from: self.agents[i].rover,
                        to: self.agents[j].rover,
                        values: edge.outgoing.clone(),
                    });
                }
            }
        }
        (vectors, bases)
    }

    /// The own rovers' paths in the iteration just computed, for neighbours to judge theirs by;
    /// nothing unless the best assignment is to be kept.
    pub(crate) fn choices(&self) -> Vec<Choice> {
        let chosen = self.anytime.iter().flat_map(Anytime::chosen);
        let choice = |(agent, path): (&Agent, usize)| Choice {
            rover: agent.rover,
            path: path as u32,
        };
        self.agents.iter().zip(chosen).map(choice).collect()
    }

    /// g_i: the unary payoffs and all incoming messages of an own rover, a value for each path.
    fn total(&self, i: usize) -> Vec<f32> {
        let mut total = Vec::new();
        self.add_up(i, &mut total);
        total
    }

    fn add_up(&self, i: usize, total: &mut Vec<f32>) {
        total.clear();
        total.extend(self.agents[i].paths().iter().map(|path| path.payoff));
        for edge in &self.edges[i] {
            for (t, m) in total.iter_mut().zip(&edge.incoming) {
                *t += m;
            }
        }
    }

    /// The path of each own rover as things stand: the best by all messages, the first of equals.
    /// An optimisation that has not `converged` gives the best of all iterations instead, if those
    /// are to be kept.
    pub(crate) fn best(&self, converged: bool) -> Vec<(RoverId, &CandidatePath)> {
        let last = (0..self.own).map(|i| first_best(&self.total(i))).collect();
        let chosen = match &self.anytime {
            Some(anytime) if !converged => anytime.best(last, &self.agents, &self.edges),
            _ => last,
        };
        let path = |(agent, at): (_, usize)| {
            let agent: &Agent = agent;
            (agent.rover, &agent.paths()[at])
        };
        self.agents.iter().zip(chosen).map(path).collect()
    }

    /// How many rovers the node plans for.
    pub(crate) fn rovers(&self) -> usize {
        self.own
    }
}

/// The place of the largest value, of equals the first.
fn first_best(values: &[f32]) -> usize {
    let mut best = (f32::NEG_INFINITY, 0);
    for (at, &value) in values.iter().enumerate() {
        if value > best.0 {
            best = (value, at);
        }
    }
    best.1
}

#[cfg(test)]
mod tests;
