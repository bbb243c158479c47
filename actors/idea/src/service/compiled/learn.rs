//! How a table grows: from what the interpreter decided.

use farside_planning::Ticks;
use farside_planning::model::{PredicateId, RelationshipKind, TimelineId, Value};
use smallvec::SmallVec;

use super::Compiled;
use super::key::{key, longest};
use super::table::{Bound, Effect, Form, Held, KIND, NONE, REGISTER, REST, Source, Time, What};
use crate::service::PlanService;
use crate::service::ServiceCounters;
use crate::service::propositional::Propositional;
use crate::service::propositional::state::{Far, Origin};

/// A token that begins or ends.
struct Change {
    timeline: TimelineId,
    predicate: PredicateId,
    parameters: SmallVec<[Source; 4]>,
}

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
            self.registers.posted.clear();
            self.solved = Some(self.now);
            return;
        };
        let next = match self.table.by_key.get(&key) {
            Some(&next) => next,
            None => self.add_form(key, &stripped),
        };
        let spent = interpreter.counters();
        if let (Some(node), Some(ended), false) = (self.node, ended, loose)
            && let Some(started) = self.changes_of(&stripped, false)
            && let Some((mut effect, named)) = self.encode(&stripped, next, (ended, started))
        {
            effect.decisions = (spent.decisions - before.decisions) as u32;
            effect.guards = (spent.guards - before.guards) as u32;
            effect.backtracks = (spent.backtracks - before.backtracks) as u32;
            let effect = self.table.effect(effect, &named);
            let root = self.table.forms[next as usize].node;
            let node = &mut self.table.nodes[node as usize];
            (node.effect, node.state, node.root) = (effect, next, root);
            self.table.transitions += 1;
        }
        self.read(&stripped, next);
    }

    /// The registers of a state that the interpreter is in.
    fn read(&mut self, is: &Propositional, state: u32) {
        let (known, form) = (&is.world.state, &self.table.forms[state as usize]);
        self.registers.posted.clear();
        for (at, &source) in known.cells.iter().zip(&form.cells) {
            if source >> KIND == REGISTER {
                self.registers.cells[(source & REST) as usize] = at.value;
            }
        }
        self.near = Ticks::MAX;
        for (at, held) in known.finishes.iter().zip(&form.ends) {
            for (time, held) in [at.min, at.max].into_iter().zip(held) {
                if let Held::Register(place) = *held {
                    self.registers.ends[usize::from(place)] = time;
                    self.near = self.near.min(time.saturating_sub(self.exact));
                }
            }
        }
        for (timeline, (lane, at)) in self.lanes.iter_mut().zip(&known.lanes).enumerate() {
            lane.number = at.number;
            lane.over = is.ends[timeline];
            if let Some(&token) = at.tokens.last() {
                let token = known.at(token);
                (lane.start, lane.predicate) = (token.start, token.predicate as u16);
            }
        }
        self.enter(state, form.node);
    }

    /// The registers of a state's cells: those of the first parameters that have them. Behind these
    /// stand the registers of cells that are no parameters.
    fn registers_of(&self, is: &Propositional) -> Vec<u32> {
        let known = &is.world.state;
        let mut registers = vec![NONE; known.cells.len()];
        let mut first = 0;
        for (said, lane) in self.model.timelines.iter().zip(&known.lanes) {
            let token = lane.tokens.last().expect("each timeline says something");
            for (place, &cell) in (first..).zip(&known.at(*token).parameters) {
                let register = &mut registers[usize::from(cell)];
                *register = place.min(*register);
            }
            let counts = said.predicates.iter();
            let counts = counts.map(|&at| self.model.predicates[at].parameters.len());
            first += counts.max().unwrap_or(0) as u32;
        }
        for register in registers.iter_mut().filter(|at| **at == NONE) {
            *register = first;
            first += 1;
        }
        registers
    }

    fn add_form(&mut self, key: Vec<u32>, is: &Propositional) -> u32 {
        let node = self.table.add_root();
        let known = &is.world.state;
        let registers = self.registers_of(is);
        let cells = { known.cells.iter().zip(registers) }.map(|(at, register)| match at.value {
            Some(_) if is.tables.is_measured(at.of) => Source::Register(register),
            value => Source::Value(value),
        });
        let cells: Vec<Source> = cells.collect();
        let lanes = known.lanes.iter().enumerate().map(|(timeline, lane)| {
            let token = lane.tokens.last().expect("each timeline says something");
            let at = known.at(*token);
            let parameters = at.parameters.iter();
            let sources = parameters.map(|&cell| cells[usize::from(cell)].clone());
            self.table.row(timeline, at.predicate, sources)
        });
        let lanes = lanes.collect();
        let cells: Box<[u32]> = { cells.into_iter() }
            .map(|at| self.table.names.source(at))
            .collect();
        let filled = cells.iter().filter(|&&at| at >> KIND == REGISTER);
        let width = filled.map(|&at| (at & REST) as usize + 1).max();
        self.table.width = self.table.width.max(width.unwrap_or(0));
        self.registers.cells.resize(self.table.width, None);
        let mut firsts = vec![0; known.finishes.len()];
        for (timeline, lane) in known.lanes.iter().enumerate().rev() {
            let token = lane.tokens.last().expect("each timeline says something");
            firsts[usize::from(known.end(known.at(*token).finish))] = timeline as u16;
        }
        let held = |time: Ticks, register: u16| match time {
            Ticks::MAX => Held::Same(Ticks::MAX),
            time if known.is_far(time) => Held::Register(register),
            time => Held::Same((time - self.now).max(0)),
        };
        let ends = { known.finishes.iter().zip(&firsts) }
            .map(|(at, &first)| [held(at.min, 2 * first), held(at.max, 2 * first + 1)]);
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
        self.table.forms.push(Form {
            node,
            lanes,
            cells,
            ends,
            times: asked.into(),
            interpreter,
        });
        let state = (self.table.forms.len() - 1) as u32;
        self.table.by_key.insert(key, state);
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
                timeline,
                predicate: at.predicate,
                parameters: parameters.collect(),
            });
        }
        Some(changes)
    }

    /// From where a state's registers are filled, and what began and ended, with all that this
    /// names; none, if it is not clear. A register that stays as it is is not filled.
    fn encode(
        &mut self,
        is: &Propositional,
        next: u32,
        (ended, started): (Vec<Change>, Vec<Change>),
    ) -> Option<(Effect, Vec<u32>)> {
        let known = &is.world.state;
        let mut named: Vec<u32> = Vec::new();
        for cell in 0..known.cells.len() {
            let register = self.table.forms[next as usize].cells[cell];
            if register >> KIND == REGISTER {
                let source = self.source(is, cell as u16);
                let source = self.table.names.source(source);
                if source != register {
                    named.extend([register & REST, source]);
                }
            }
        }
        let cells = named.len() / 2;
        for (end, at) in known.finishes.iter().enumerate() {
            for (side, fars) in [&at.lows, &at.highs].into_iter().enumerate() {
                if let Held::Register(place) = self.table.forms[next as usize].ends[end][side] {
                    let bound = self.far_bound(side, fars)?;
                    if bound != Bound::Register(place) {
                        let bound = self.table.names.bound(bound);
                        named.extend([u32::from(place), bound]);
                    }
                }
            }
        }
        let effect = Effect {
            code: 0,
            rows: 0,
            cells: cells as u16,
            ends: (named.len() / 2 - cells) as u16,
            ended: ended.len() as u16,
            started: started.len() as u16,
            decisions: 0,
            guards: 0,
            backtracks: 0,
        };
        for change in ended.into_iter().chain(started) {
            let Change {
                timeline,
                predicate,
                parameters,
            } = change;
            named.push(self.table.row(timeline, predicate, parameters));
        }
        Some((effect, named))
    }

    /// From where a far bound is, the earliest (0) or the latest (1) tick of an end; none, if it is
    /// not clear.
    fn far_bound(&self, side: usize, fars: &[Far]) -> Option<Bound> {
        let form = &self.table.forms[self.state as usize];
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
            Origin::Cell(cell) => {
                let form = &self.table.forms[self.state as usize];
                match form.cells[usize::from(cell)] {
                    source if source >> KIND == REGISTER => Source::Register(source & REST),
                    _ => Source::Value(Some(value)),
                }
            }
            Origin::Posted(which, place) => {
                let at = &self.posted[usize::from(which)];
                let said = &self.model.predicates[at.predicate];
                let first = match at.what {
                    What::Goal(_) => 0,
                    _ => said.inputs,
                };
                let of = said.parameters[first + usize::from(place)].of;
                if is.tables.is_measured(of) {
                    Source::Posted(at.first + u32::from(place))
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
