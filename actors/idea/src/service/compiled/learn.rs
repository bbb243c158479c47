//! How a table grows: from what the interpreter decided.

use farside_planning::Ticks;

use super::Compiled;
use super::key::{key, longest};
use super::table::{Bound, Change, Form, Node, REST, Source, Transition};
use super::walk::comes_near;
use crate::service::PlanService;
use crate::service::ServiceCounters;
use crate::service::propositional::Propositional;
use crate::service::propositional::state::{Far, Origin};

impl Compiled {
    /// What the interpreter decided becomes a state, and, if it may, a transition to it.
    pub(super) fn learn(&mut self, interpreter: Box<Propositional>, before: ServiceCounters) {
        let loose = interpreter.world.state.loose.get();
        let ended = self.changes_of(&interpreter, true);
        let asks = interpreter.world.state.open.len();
        let mut stripped = interpreter.clone();
        stripped.world.compact(1);
        let planned = stripped.world.plans.iter().any(Option::is_some);
        let key = key(&stripped, &self.classes, self.exact);
        let (Some(key), false) = (key, planned || asks != stripped.world.state.open.len()) else {
            // It goes on alone.
            interpreter.world.state.loose.set(false);
            (self.node, self.interpreter) = (None, Some(interpreter));
            self.posted.clear();
            return;
        };
        let next = match self.by_key.get(&key) {
            Some(&next) => next,
            None => self.add_form(key, &stripped),
        };
        let spent = interpreter.counters();
        if let (Some(node), Some(ended), false) = (self.node, ended, loose)
            && let Some(started) = self.changes_of(&stripped, false)
            && let Some(code) = self.encode(&stripped, (ended, started))
        {
            self.nodes[node as usize].transition = Some(self.transitions.len() as u32);
            self.transitions.push(Transition {
                next,
                code,
                decisions: (spent.decisions - before.decisions) as u32,
                guards: (spent.guards - before.guards) as u32,
                backtracks: (spent.backtracks - before.backtracks) as u32,
            });
        }
        self.read(&stripped, next);
    }

    /// The registers of a state that the interpreter is in.
    pub(super) fn read(&mut self, is: &Propositional, state: u32) {
        let known = &is.world.state;
        self.registers.cells.clear();
        self.registers
            .cells
            .extend(known.cells.iter().map(|at| at.value));
        self.registers.ends.clear();
        self.registers
            .ends
            .extend(known.finishes.iter().map(|at| (at.min, at.max)));
        for (timeline, lane) in known.lanes.iter().enumerate() {
            self.numbers[timeline] = lane.number;
            if let Some(&token) = lane.tokens.last() {
                self.starts[timeline] = known.at(token).start;
            }
        }
        let near = { self.registers.ends.iter() }.map(|&at| comes_near(at, self.now, self.exact));
        self.near = near.min().unwrap_or(Ticks::MAX);
        self.state = state;
        self.settle_state();
    }

    pub(super) fn add_form(&mut self, key: Vec<u32>, is: &Propositional) -> u32 {
        let node = self.nodes.len() as u32;
        self.nodes.push(Node::default());
        let known = &is.world.state;
        let lanes = known.lanes.iter().map(|lane| {
            let token = lane.tokens.last().expect("each timeline says something");
            let at = known.at(*token);
            (at.predicate, at.parameters.iter().copied().collect())
        });
        let ends = 0..known.finishes.len();
        let far = ends.filter(|&at| {
            let at = &known.finishes[at];
            known.is_far(at.min) || known.is_far(at.max)
        });
        let lasts = known.lanes.iter().enumerate().map(|(timeline, lane)| {
            let token = lane.tokens.last().expect("each timeline says something");
            let longest = longest(is, timeline).unwrap_or(Ticks::MAX);
            (known.end(known.at(*token).finish), longest)
        });
        let mut interpreter = Box::new(is.clone());
        interpreter.shrink();
        self.forms.push(Form {
            node,
            lanes: lanes.collect(),
            ends: is.ends.clone().into(),
            far: far.map(|at| at as u16).collect(),
            lasts: lasts.collect(),
            interpreter,
        });
        let state = (self.forms.len() - 1) as u32;
        self.by_key.insert(key, state);
        state
    }

    /// What began or ended, with where its parameters are from; none, if that is not clear.
    pub(super) fn changes_of(&self, is: &Propositional, ended: bool) -> Option<Vec<Change>> {
        let known = &is.world.state;
        let mut changes = Vec::new();
        for (timeline, lane) in known.lanes.iter().enumerate() {
            let token = match (ended, &lane.tokens[..]) {
                (true, &[.., before, present]) if known.at(present).start == self.now => before,
                (false, &[.., present]) if known.at(present).start == self.now => present,
                _ => continue,
            };
            let at = known.at(token);
            if ended && known.finish(token).1 != self.now {
                return None;
            }
            let parameters = at.parameters.iter().map(|&cell| source(is, cell));
            changes.push(Change {
                timeline: timeline as u16,
                predicate: at.predicate,
                parameters: parameters.collect(),
            });
        }
        Some(changes)
    }

    /// From where a state's registers are filled, and what began and ended, as a row of numbers;
    /// none, if it is not clear.
    pub(super) fn encode(
        &mut self,
        is: &Propositional,
        (ended, started): (Vec<Change>, Vec<Change>),
    ) -> Option<Box<[u32]>> {
        let known = &is.world.state;
        let counts = [
            known.cells.len(),
            known.finishes.len(),
            ended.len(),
            started.len(),
        ];
        let mut code: Vec<u32> = counts.iter().map(|&at| at as u32).collect();
        for cell in 0..known.cells.len() {
            code.push(self.names.source(source(is, cell as u16)));
        }
        for at in &known.finishes {
            for (time, fars) in [(at.min, &at.lows), (at.max, &at.highs)] {
                let bound = match (time, &fars[..]) {
                    (Ticks::MAX, _) => Bound::Never,
                    (time, _) if !known.is_far(time) => Bound::Ahead((time - self.now).max(0)),
                    (_, []) => return None,
                    (_, &[Far::Ahead(ticks)]) if ticks > Ticks::from(REST) => return None,
                    (_, &[Far::Ahead(ticks)]) => Bound::Ahead(ticks),
                    (_, &[Far::End(end)]) => Bound::End(end),
                    (_, several) => Bound::Several(several.into()),
                };
                code.push(self.names.bound(bound));
            }
        }
        for change in ended.into_iter().chain(started) {
            code.push(u32::from(change.timeline) << 16 | change.predicate as u32);
            code.push(change.parameters.len() as u32);
            code.extend(
                change
                    .parameters
                    .into_iter()
                    .map(|at| self.names.source(at)),
            );
        }
        Some(code.into())
    }
}

/// From where a cell has its value.
fn source(is: &Propositional, cell: u16) -> Source {
    let known = &is.world.state.cells[usize::from(is.world.state.root(cell))];
    match (known.value, known.origin) {
        (None, _) | (_, Origin::Model | Origin::Computed) => Source::Value(known.value),
        (_, Origin::Cell(cell)) => Source::Cell(cell),
        (_, Origin::Posted(which, place)) => Source::Posted(which, place),
    }
}
