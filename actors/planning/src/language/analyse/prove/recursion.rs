//! Rules without guards that force each other without end.
//!
//! Rules that follow each other in time, as a poll that meets the next one, end at the horizon.
//! What does not is a cycle of rules each of which forces a token at the same time as its master's,
//! if that token cannot be the one that forced the first, since a value is another one each time
//! around, or since it must lie strictly within. And rules that follow each other may stand still
//! if nothing says that a token in the cycle lasts a tick or more.

use std::collections::{BTreeMap, VecDeque};

use crate::language::analyse::names::last_part;
use crate::language::analyse::rule::Draft;
use crate::language::findings::{Notes, Severity};
use crate::model::{
    Argument, Bound, Distance, End, Model, Operand, Position, PredicateId, Relation, RelationKind,
    Target, TimelineId,
};

/// The most edges that all searches for cycles look at together.
const MOST_STEPS: usize = 10_000_000;

/// Tokens of a predicate on a state variable, whichever object's.
type Node = usize;

/// When a token is that another one forces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Direction {
    /// Possibly at the same time.
    Beside,
    After,
    Before,
}

#[derive(Clone, Copy, Debug)]
struct Edge {
    from: Node,
    to: Node,
    direction: Direction,
    /// Whether the token cannot be one that is there already.
    renews: bool,
    position: Position,
}

struct Graph<'m> {
    model: &'m Model,
    nodes: BTreeMap<(&'m str, PredicateId), Node>,
    /// By node: how long such a token lasts at least.
    least: Vec<i64>,
    edges: Vec<Edge>,
    /// By node: the edges from it.
    out: Vec<Vec<usize>>,
    steps: usize,
}

/// Notes each cycle, by one of its rules.
pub(super) fn check(model: &Model, drafts: &[Draft], notes: &mut Notes) {
    let mut graph = Graph {
        model,
        nodes: BTreeMap::new(),
        least: Vec::new(),
        edges: Vec::new(),
        out: Vec::new(),
        steps: 0,
    };
    for draft in drafts.iter().filter(|draft| is_unguarded(draft)) {
        graph.add(draft);
    }
    graph.report(notes);
}

/// Whether a rule holds for all tokens of its predicate.
fn is_unguarded(draft: &Draft) -> bool {
    let mut arguments = draft.rule.master.arguments.iter();
    draft.rule.when.is_empty() && !arguments.any(|of| matches!(of, Argument::Value(_)))
}

impl<'m> Graph<'m> {
    fn node(&mut self, timelines: &[TimelineId], predicate: PredicateId) -> Node {
        let name = last_part(&self.model.timelines[timelines[0]].name);
        let fresh = self.least.len();
        let node = *self.nodes.entry((name, predicate)).or_insert(fresh);
        if node == fresh {
            self.least.push(0);
            self.out.push(Vec::new());
        }
        node
    }

    fn add(&mut self, draft: &Draft) {
        let rule = &draft.rule;
        let from = self.node(&draft.master.timelines, rule.master.predicate);
        if let Some([Bound::Value(least), _]) = rule.duration {
            self.least[from] = self.least[from].max(least);
        }
        let mut relations = Vec::new();
        super::certain(&rule.body, &mut relations);
        // By label: when its token is, as seen from the master.
        let mut places = BTreeMap::from([(0, (Direction::Beside, false))]);
        for relation in relations {
            let Target::New(pattern, label) = &relation.target else {
                continue;
            };
            let Some(&(anchor, strict)) = places.get(&relation.anchor) else {
                continue;
            };
            let Some(direction) = join(anchor, direction(relation)) else {
                continue;
            };
            let strict = strict || is_strict(relation);
            places.insert(*label, (direction, strict));
            if relation.condition {
                continue;
            }
            let derived = pattern.arguments.iter().any(|of| is_derived(draft, of));
            let to = self.node(&pattern.timelines, pattern.predicate);
            let renews = direction == Direction::Beside && (strict || derived);
            // What is strictly later or earlier gets to the horizon's end.
            if direction == Direction::Beside || !strict {
                let position = relation.position;
                self.out[from].push(self.edges.len());
                self.edges.push(Edge {
                    from,
                    to,
                    direction,
                    renews,
                    position,
                });
            }
        }
    }

    fn report(&mut self, notes: &mut Notes) {
        for place in 0..self.edges.len() {
            let edge = self.edges[place];
            if self.steps > MOST_STEPS {
                return;
            }
            self.steps += self.least.len();
            let beside = |edge: &Edge| edge.direction == Direction::Beside;
            if edge.renews
                && let Some(path) = self.path(edge.to, edge.from, &beside)
            {
                let found = self.show(edge.from, &path);
                let expected = "a guard in rules that force each other at the same time";
                notes.note(Severity::Error, edge.position, expected, found);
                return;
            }
            if edge.direction == Direction::Beside || self.advances(&edge) {
                continue;
            }
            let least = self.least.clone();
            let still = move |other: &Edge| {
                let lasting = match edge.direction {
                    Direction::After => least[other.from],
                    _ => least[other.to],
                };
                beside(other) || (other.direction == edge.direction && lasting == 0)
            };
            if let Some(path) = self.path(edge.to, edge.from, &still) {
                let found = self.show(edge.from, &path);
                let expected = "tokens of 1 tick or more in rules that follow each other";
                notes.note(Severity::Warning, edge.position, expected, found);
                return;
            }
        }
    }

    /// Whether time goes on from one token of an edge to the other.
    fn advances(&self, edge: &Edge) -> bool {
        match edge.direction {
            Direction::After => self.least[edge.from] > 0,
            Direction::Before => self.least[edge.to] > 0,
            Direction::Beside => false,
        }
    }

    /// The nodes from one to another, both included, along some edges; the shortest way.
    fn path(&mut self, from: Node, to: Node, along: &dyn Fn(&Edge) -> bool) -> Option<Vec<Node>> {
        let mut before: Vec<Option<Node>> = vec![None; self.least.len()];
        let mut queue = VecDeque::from([from]);
        let mut seen = vec![false; self.least.len()];
        seen[from] = true;
        while let Some(node) = queue.pop_front() {
            if node == to {
                let mut path = vec![to];
                while let Some(node) = before[path[path.len() - 1]] {
                    path.push(node);
                }
                path.reverse();
                return Some(path);
            }
            for &edge in &self.out[node] {
                self.steps += 1;
                let edge = &self.edges[edge];
                if !seen[edge.to] && along(edge) {
                    seen[edge.to] = true;
                    before[edge.to] = Some(node);
                    queue.push_back(edge.to);
                }
            }
        }
        None
    }

    /// The predicates of a cycle.
    fn show(&self, from: Node, path: &[Node]) -> String {
        let name = |node: Node| {
            let at = self.nodes.iter().find(|(_, of)| **of == node);
            at.map_or("", |((_, predicate), _)| {
                &self.model.predicates[*predicate].name
            })
        };
        let names: Vec<&str> = path.iter().map(|&node| name(node)).collect();
        format!(
            "{} forces {} without end",
            name(from),
            names.join(", which forces ")
        )
    }
}

/// Whether an argument of a target is worked out by a rule, and so another one each time.
fn is_derived(draft: &Draft, argument: &Argument) -> bool {
    let &Argument::Variable(variable) = argument else {
        return false;
    };
    let named = |argument: &Argument| *argument == Argument::Variable(variable);
    let uses = |operand: &Operand| *operand == Operand::Variable(variable);
    !draft.rule.master.arguments.iter().any(named)
        && draft
            .rule
            .relationships
            .iter()
            .any(|of| of.operands.iter().any(uses))
}

/// Whether a relation keeps two ends apart that could be together.
fn is_strict(relation: &Relation) -> bool {
    let apart = |distance: &Distance| matches!(distance.min, Bound::Value(least) if least > 0);
    relation.distances.iter().any(apart)
}

fn direction(relation: &Relation) -> Direction {
    match relation.kind {
        RelationKind::Meets | RelationKind::Before => Direction::After,
        RelationKind::MetBy | RelationKind::After => Direction::Before,
        RelationKind::Distance => {
            let Distance { from, to, min, .. } = relation.distances[0];
            let forward = matches!(min, Bound::Value(least) if least >= 0);
            match (from, to) {
                (End::Finish, End::Start) if forward => Direction::After,
                _ => Direction::Beside,
            }
        }
        _ => Direction::Beside,
    }
}

/// The direction of a target from the master, by that of its anchor; none if it is not known.
fn join(anchor: Direction, relation: Direction) -> Option<Direction> {
    match (anchor, relation) {
        (Direction::Beside, other) | (other, Direction::Beside) => Some(other),
        (a, b) if a == b => Some(a),
        _ => None,
    }
}
