//! How a table grows: from what the interpreter decided.

use farside_planning::Ticks;
use farside_planning::model::{RelationshipKind, Value};

use super::Compiled;
use super::key::{key, longest};
use super::table::{Bound, Change, Form, Held, Node, REST, Source, Time, Transition, What};
use crate::service::PlanService;
use crate::service::ServiceCounters;
use crate::service::propositional::Propositional;
use crate::service::propositional::state::{Far, Origin};

impl Compiled {
    /// What the interpreter decided becomes a state, and, if it may, a transition to it.
    pub(super) fn learn(&mut self, mut interpreter: Box<Propositional>, before: ServiceCounters) {
        let loose = interpreter.world.state.loose.get();
        let ended = self.node.and_then(|_| self.changes_of(&interpreter, true));
        let asks = interpreter.world.state.open.len();
        let mut stripped = interpreter.clone();
        stripped.world.compact(1);
        let planned = stripped.world.plans.iter().any(Option::is_some);
        let key = key(&stripped, &self.sorts, self.exact);
        let (Some(key), false) = (key, planned || asks != stripped.world.state.open.len()) else {
            // It goes on alone.
            interpreter.world.state.loose.set(false);
            interpreter.world.state.formulas.clear();
            (self.node, self.interpreter) = (None, Some(interpreter));
            self.posted.clear();
            self.solved = Some(self.now);
            return;
        };
        let next = match self.by_key.get(&key) {
            Some(&next) => next,
            None => self.add_form(key, &stripped),
        };
        let spent = interpreter.counters();
        if let (Some(node), Some(ended), false) = (self.node, ended, loose)
            && let Some(started) = self.changes_of(&stripped, false)
            && let Some(mut transition) = self.encode(&stripped, next, (ended, started))
        {
            transition.decisions = (spent.decisions - before.decisions) as u32;
            transition.guards = (spent.guards - before.guards) as u32;
            transition.backtracks = (spent.backtracks - before.backtracks) as u32;
            self.nodes[node as usize].transition = Some(self.transitions.len() as u32);
            self.transitions.push(transition);
        }
        self.read(&stripped, next);
    }

    /// The registers of a state that the interpreter is in.
    fn read(&mut self, is: &Propositional, state: u32) {
        let (known, form) = (&is.world.state, &self.forms[state as usize]);
        self.registers.cells.clear();
        for (at, held) in known.cells.iter().zip(&form.cells) {
            if let Held::Register(_) = held {
                self.registers.cells.push(at.value);
            }
        }
        self.registers.ends.clear();
        for (at, held) in known.finishes.iter().zip(&form.ends) {
            for (time, held) in [at.min, at.max].into_iter().zip(held) {
                if let Held::Register(_) = held {
                    self.registers.ends.push(time);
                }
            }
        }
        for (lane, at) in self.lanes.iter_mut().zip(&known.lanes) {
            lane.number = at.number;
            if let Some(&token) = at.tokens.last() {
                lane.start = known.at(token).start;
            }
        }
        let ends = self.registers.ends.iter();
        let near = ends.map(|&at| at.saturating_sub(self.exact)).min();
        self.near = near.unwrap_or(Ticks::MAX);
        self.enter(state);
    }

    fn add_form(&mut self, key: Vec<u32>, is: &Propositional) -> u32 {
        let node = self.nodes.len() as u32;
        self.nodes.push(Node::default());
        let known = &is.world.state;
        let lanes = known.lanes.iter().map(|lane| {
            let token = lane.tokens.last().expect("each timeline says something");
            let at = known.at(*token);
            (at.predicate, at.parameters.iter().copied().collect())
        });
        let mut registers = 0..;
        let mut register = || registers.next().expect("there are few");
        let cells = known.cells.iter().map(|at| match at.value {
            Some(_) if is.tables.is_measured(at.of) => Held::Register(register()),
            value => Held::Same(value),
        });
        let cells = cells.collect();
        let mut times = 0..;
        let ends = known.finishes.iter().map(|at| {
            [at.min, at.max].map(|time| match time {
                Ticks::MAX => Held::Same(Ticks::MAX),
                time if known.is_far(time) => Held::Register(times.next().expect("there are few")),
                time => Held::Same((time - self.now).max(0)),
            })
        });
        let ends: Box<[[Held<Ticks>; 2]]> = ends.collect();
        let mut asked: Vec<Time> = Vec::new();
        let registers = |held: &Held<Ticks>| match *held {
            Held::Register(end) => Some(end),
            Held::Same(_) => None,
        };
        let all = ends.iter().flatten().filter_map(registers);
        asked.extend(all.map(|end| Time { end, whose: None }));
        for (timeline, lane) in (0..).zip(&known.lanes) {
            let token = lane.tokens.last().expect("each timeline says something");
            let end = usize::from(known.end(known.at(*token).finish));
            let longest = longest(is, usize::from(timeline));
            if let (Some(end), Some(longest)) = (registers(&ends[end][1]), longest) {
                let whose = Some((timeline, longest));
                asked.push(Time { end, whose });
            }
        }
        let mut interpreter = Box::new(is.clone());
        interpreter.shrink();
        self.forms.push(Form {
            node,
            lanes: lanes.collect(),
            over: is.ends.clone().into(),
            cells,
            ends,
            times: asked.into(),
            interpreter,
        });
        let state = (self.forms.len() - 1) as u32;
        self.by_key.insert(key, state);
        state
    }

    /// What began or ended, with where its parameters are from; none, if that is not clear.
    fn changes_of(&self, is: &Propositional, ended: bool) -> Option<Vec<Change>> {
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
            let parameters = at.parameters.iter().map(|&cell| self.source(is, cell));
            changes.push(Change {
                timeline: timeline as u16,
                predicate: at.predicate,
                parameters: parameters.collect(),
            });
        }
        Some(changes)
    }

    /// From where a state's registers are filled, and what began and ended; none, if it is not
    /// clear.
    fn encode(
        &mut self,
        is: &Propositional,
        next: u32,
        (ended, started): (Vec<Change>, Vec<Change>),
    ) -> Option<Transition> {
        let (known, form) = (&is.world.state, &self.forms[next as usize]);
        let mut sources: Vec<Source> = Vec::new();
        for (cell, held) in (0..).zip(&form.cells) {
            if let Held::Register(_) = held {
                sources.push(self.source(is, cell));
            }
        }
        let mut bounds: Vec<Bound> = Vec::new();
        for (at, held) in known.finishes.iter().zip(&form.ends) {
            for (side, fars) in [&at.lows, &at.highs].into_iter().enumerate() {
                if let Held::Register(_) = held[side] {
                    bounds.push(self.far_bound(side, fars)?);
                }
            }
        }
        let transition = Transition {
            next,
            code: self.codes.len() as u32,
            cells: sources.len() as u16,
            ends: bounds.len() as u16,
            ended: ended.len() as u16,
            started: started.len() as u16,
            decisions: 0,
            guards: 0,
            backtracks: 0,
        };
        let (names, codes) = (&mut self.names, &mut self.codes);
        codes.extend(sources.into_iter().map(|at| names.source(at)));
        codes.extend(bounds.into_iter().map(|at| names.bound(at)));
        codes.extend(started.iter().map(|at| u32::from(at.timeline)));
        for change in ended.into_iter().chain(started) {
            codes.push(u32::from(change.timeline) << 16 | change.predicate as u32);
            codes.push(change.parameters.len() as u32);
            codes.extend(change.parameters.into_iter().map(|at| names.source(at)));
        }
        Some(transition)
    }

    /// From where a far bound is, the earliest (0) or the latest (1) tick of an end; none, if it is
    /// not clear.
    fn far_bound(&self, side: usize, fars: &[Far]) -> Option<Bound> {
        let form = &self.forms[self.state as usize];
        let in_registers = |at: &Far| match *at {
            Far::Ahead(ticks) => (ticks <= Ticks::from(REST)).then_some(Far::Ahead(ticks)),
            Far::End(end) => match form.ends.get(usize::from(end))?[side] {
                Held::Register(place) => Some(Far::End(place)),
                Held::Same(_) => None,
            },
        };
        let all: Option<Box<[Far]>> = fars.iter().map(in_registers).collect();
        let all = all?;
        Some(match *all {
            [] => return None,
            [Far::Ahead(ticks)] => Bound::Ahead(ticks),
            [Far::End(place)] => Bound::Register(place),
            _ if side == 0 => Bound::Most(all),
            _ => Bound::Least(all),
        })
    }

    /// From where a cell has its value.
    fn source(&self, is: &Propositional, cell: u16) -> Source {
        let known = &is.world.state.cells[usize::from(is.world.state.root(cell))];
        match known.value {
            Some(value) => self.source_of(is, value, known.origin),
            None => Source::Value(None),
        }
    }

    fn source_of(&self, is: &Propositional, value: Value, origin: Origin) -> Source {
        match origin {
            Origin::Model => Source::Value(Some(value)),
            Origin::Cell(cell) => match self.forms[self.state as usize].cells[usize::from(cell)] {
                Held::Register(place) => Source::Register(u32::from(place)),
                Held::Same(_) => Source::Value(Some(value)),
            },
            Origin::Posted(which, place) => {
                let at = &self.posted[usize::from(which)];
                let said = &self.model.predicates[at.predicate];
                let first = match at.what {
                    What::Goal(_) => 0,
                    _ => said.inputs,
                };
                let of = said.parameters[first + usize::from(place)].of;
                if is.tables.is_measured(of) {
                    Source::Register(at.first + u32::from(place))
                } else {
                    Source::Value(Some(value))
                }
            }
            Origin::Computed(formula) => {
                let formula = &is.world.state.formulas[usize::from(formula)];
                let inputs = formula.inputs.iter();
                let inputs: Vec<Source> = inputs
                    .map(|&(value, origin)| self.source_of(is, value, origin))
                    .collect();
                let same = |at: &Source| matches!(at, Source::Value(_));
                if inputs.iter().all(same) {
                    return Source::Value(Some(value));
                }
                let call = match formula.kind {
                    RelationshipKind::Function(at) => Some(self.model.functions[at].call),
                    _ => None,
                };
                Source::Computed((formula.kind, call), inputs)
            }
        }
    }
}
