//! What the propositional technology knows: present tokens, whose parameters are cells and whose
//! ends are counters, and what their rules ask for.
//!
//! A cell is shared by all parameters that are equal: a token that a rule asks for has the cells of
//! the rule's variables, so that a parameter which no guard tests is copied by reference, whatever
//! its value. An end is shared by all tokens that end together.

use farside_planning::Ticks;
use farside_planning::model::{
    Argument, End, Model, Operand, PredicateId, RelationshipKind, RuleId, TimelineId, TypeId,
    Value, VariableId,
};
use smallvec::SmallVec;

use super::Tables;
use super::rules::{Part, constant, is_of};

pub(super) type Cell = u16;
pub(super) type Finish = u16;
pub(super) type Token = u16;

/// Why something cannot be, and by which rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Clash {
    pub(super) what: What,
    pub(super) rule: Option<RuleId>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum What {
    Times,
    Values,
    Kind,
}

/// A value that is known, or not yet.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Known {
    pub(super) value: Option<Value>,
    /// Whose value it has instead, if it is equal to another.
    pub(super) same: Option<Cell>,
    pub(super) of: TypeId,
    /// The type of what it was made equal to, if that is another.
    pub(super) also: Option<TypeId>,
}

/// When a token ends, at the earliest and the latest.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Bounds {
    pub(super) min: Ticks,
    pub(super) max: Ticks,
    pub(super) same: Option<Finish>,
}

/// That one end lies so many ticks after another.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Gap {
    pub(super) from: Finish,
    pub(super) to: Finish,
    pub(super) min: Ticks,
    pub(super) max: Ticks,
    pub(super) rule: RuleId,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Guard {
    Waiting,
    Holds,
    Void,
}

/// A rule as it holds for a token, or waits to.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Instance {
    pub(super) rule: RuleId,
    pub(super) guard: Guard,
    pub(super) variables: SmallVec<[Option<Cell>; 4]>,
    pub(super) labels: SmallVec<[Option<Token>; 3]>,
}

/// A token that is there, or ended in this cycle.
#[derive(Clone, Debug)]
pub(super) struct At {
    pub(super) timeline: TimelineId,
    pub(super) predicate: PredicateId,
    pub(super) start: Ticks,
    pub(super) finish: Finish,
    pub(super) parameters: SmallVec<[Cell; 6]>,
    pub(super) instances: SmallVec<[Instance; 4]>,
    /// Whether it is the default that nobody asked for.
    pub(super) fills: bool,
}

/// What an instance asks for, and nobody decided yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Open {
    pub(super) token: Token,
    pub(super) instance: u16,
    pub(super) part: Part,
}

/// The tokens of a timeline that count: those that began in this cycle and the one before.
#[derive(Clone, Debug, Default)]
pub(super) struct Lane {
    /// The present one, and before it those that are known still.
    pub(super) tokens: SmallVec<[Token; 3]>,
    /// How many tokens had begun before the first of these.
    pub(super) number: u64,
}

/// All that is known.
#[derive(Clone, Debug, Default)]
pub(super) struct State {
    pub(super) cells: Vec<Known>,
    pub(super) finishes: Vec<Bounds>,
    pub(super) gaps: Vec<Gap>,
    pub(super) tokens: Vec<At>,
    pub(super) lanes: Vec<Lane>,
    pub(super) open: Vec<Open>,
    /// Tokens of which something is known anew.
    pub(super) news: Vec<Token>,
    /// What was looked at.
    pub(super) operations: u64,
}

impl State {
    pub(super) fn of(model: &Model) -> State {
        State {
            lanes: vec![Lane::default(); model.timelines.len()],
            ..State::default()
        }
    }

    pub(super) fn last(&self, timeline: TimelineId) -> Option<Token> {
        self.lanes[timeline].tokens.last().copied()
    }

    pub(super) fn at(&self, token: Token) -> &At {
        &self.tokens[usize::from(token)]
    }

    pub(super) fn root(&self, mut cell: Cell) -> Cell {
        while let Some(same) = self.cells[usize::from(cell)].same {
            cell = same;
        }
        cell
    }

    pub(super) fn value(&self, cell: Cell) -> Option<Value> {
        self.cells[usize::from(self.root(cell))].value
    }

    pub(super) fn end(&self, mut finish: Finish) -> Finish {
        while let Some(same) = self.finishes[usize::from(finish)].same {
            finish = same;
        }
        finish
    }

    /// When a token ends, at the earliest and the latest.
    pub(super) fn finish(&self, token: Token) -> (Ticks, Ticks) {
        let bounds = &self.finishes[usize::from(self.end(self.at(token).finish))];
        (bounds.min, bounds.max)
    }

    pub(super) fn time(&self, token: Token, end: End) -> (Ticks, Ticks) {
        match end {
            End::Start => (self.at(token).start, self.at(token).start),
            End::Finish => self.finish(token),
        }
    }

    pub(super) fn new_cell(&mut self, of: TypeId, value: Option<Value>) -> Cell {
        self.cells.push(Known {
            value,
            same: None,
            of,
            also: None,
        });
        (self.cells.len() - 1) as Cell
    }

    /// Something is known anew of all tokens that have a cell.
    fn tell(&mut self, cell: Cell) {
        for (place, at) in self.tokens.iter().enumerate() {
            self.operations += 1;
            let has = |&one: &Cell| one == cell || self.root(one) == cell;
            let mut variables = at
                .instances
                .iter()
                .flat_map(|at| at.variables.iter().flatten());
            if (at.parameters.iter().any(has) || variables.any(has))
                && !self.news.contains(&(place as Token))
            {
                self.news.push(place as Token);
            }
        }
    }

    /// A cell has a value.
    pub(super) fn bind(
        &mut self,
        tables: &Tables,
        cell: Cell,
        value: Value,
        rule: Option<RuleId>,
    ) -> Result<(), Clash> {
        let what = What::Values;
        let cell = self.root(cell);
        let known = &self.cells[usize::from(cell)];
        match known.value {
            Some(is) if is == value => return Ok(()),
            Some(_) => return Err(Clash { what, rule }),
            None => {}
        }
        let is = |of: TypeId| is_of(&tables.model, of, value);
        if !is(known.of) || known.also.is_some_and(|of| !is(of)) {
            return Err(Clash { what, rule });
        }
        self.cells[usize::from(cell)].value = Some(value);
        self.tell(cell);
        Ok(())
    }

    /// Two cells are equal.
    pub(super) fn equal(
        &mut self,
        tables: &Tables,
        one: Cell,
        other: Cell,
        rule: Option<RuleId>,
    ) -> Result<(), Clash> {
        let (one, other) = (self.root(one), self.root(other));
        if one == other {
            return Ok(());
        }
        match (self.value(one), self.value(other)) {
            (Some(value), _) => self.bind(tables, other, value, rule)?,
            (None, Some(value)) => self.bind(tables, one, value, rule)?,
            (None, None) => {}
        }
        // Known ones stay apart: what they are equal to may be forgotten.
        if self.value(one).is_none() {
            let of = self.cells[usize::from(other)].of;
            let kept = &mut self.cells[usize::from(one)];
            if kept.of != of {
                kept.also = Some(of);
            }
            self.cells[usize::from(other)].same = Some(one);
            self.tell(one);
        }
        Ok(())
    }

    /// An end lies within bounds.
    pub(super) fn within(
        &mut self,
        finish: Finish,
        min: Ticks,
        max: Ticks,
        rule: Option<RuleId>,
    ) -> Result<(), Clash> {
        let finish = usize::from(self.end(finish));
        let bounds = &mut self.finishes[finish];
        let (low, high) = (bounds.min.max(min), bounds.max.min(max));
        if low > high {
            let what = What::Times;
            return Err(Clash { what, rule });
        }
        if (low, high) == (bounds.min, bounds.max) {
            return Ok(());
        }
        (bounds.min, bounds.max) = (low, high);
        self.operations += 1;
        for place in 0..self.gaps.len() {
            let gap = self.gaps[place].clone();
            let (from, to) = (self.end(gap.from), self.end(gap.to));
            if usize::from(from) == finish || usize::from(to) == finish {
                self.keep(&gap)?;
            }
        }
        Ok(())
    }

    fn keep(&mut self, gap: &Gap) -> Result<(), Clash> {
        let bounds = |state: &State, at: Finish| {
            let at = &state.finishes[usize::from(state.end(at))];
            (at.min, at.max)
        };
        let rule = Some(gap.rule);
        let (min, max) = bounds(self, gap.from);
        self.within(gap.to, later(min, gap.min), later(max, gap.max), rule)?;
        let (min, max) = bounds(self, gap.to);
        self.within(gap.from, later(min, -gap.max), later(max, -gap.min), rule)
    }

    /// Says what a relation says of the times of two tokens.
    pub(super) fn relate(
        &mut self,
        tables: &Tables,
        open: Open,
        relation: usize,
        target: Token,
    ) -> Result<(), Clash> {
        let instance = &self.at(open.token).instances[usize::from(open.instance)];
        let rule = instance.rule;
        let said = &tables.flats[rule].relations[relation];
        let anchor = match said.anchor {
            0 => Some(open.token),
            label => instance.labels[label],
        };
        let what = What::Kind;
        let anchor = anchor.ok_or(Clash {
            what,
            rule: Some(rule),
        })?;
        for distance in &said.distances {
            let (min, max) = span(distance);
            let (from, to) = (
                self.time(anchor, distance.from),
                self.time(target, distance.to),
            );
            let ends = (self.at(anchor).finish, self.at(target).finish);
            let rule = Some(rule);
            match (distance.from, distance.to) {
                (End::Start, End::Start) => {
                    let apart = to.0 - from.0;
                    if apart < min || apart > max {
                        let what = What::Times;
                        return Err(Clash { what, rule });
                    }
                }
                (End::Finish, End::Start) => {
                    self.within(ends.0, later(to.0, -max), later(to.0, -min), rule)?;
                }
                (End::Start, End::Finish) => {
                    self.within(ends.1, later(from.0, min), later(from.0, max), rule)?;
                }
                (End::Finish, End::Finish) => self.part(ends, (min, max), rule)?,
            }
        }
        self.close(open);
        Ok(())
    }

    /// Two ends lie so many ticks apart.
    fn part(
        &mut self,
        ends: (Finish, Finish),
        span: (Ticks, Ticks),
        rule: Option<RuleId>,
    ) -> Result<(), Clash> {
        let (from, to) = (self.end(ends.0), self.end(ends.1));
        if span == (0, 0) {
            let Bounds { min, max, .. } = self.finishes[usize::from(to)];
            self.within(from, min, max, rule)?;
            let Bounds { min, max, .. } = self.finishes[usize::from(from)];
            self.within(to, min, max, rule)?;
            if from != to && min != max {
                self.finishes[usize::from(to)].same = Some(from);
            }
            return Ok(());
        }
        let gap = Gap {
            from,
            to,
            min: span.0,
            max: span.1,
            rule: rule.unwrap_or_default(),
        };
        self.keep(&gap)?;
        self.gaps.push(gap);
        Ok(())
    }

    pub(super) fn close(&mut self, open: Open) {
        if let Some(place) = self.open.iter().position(|&at| at == open) {
            self.open.remove(place);
        }
    }

    /// A new token, with its rules.
    pub(super) fn insert(
        &mut self,
        tables: &Tables,
        timeline: TimelineId,
        predicate: PredicateId,
        parameters: SmallVec<[Cell; 6]>,
        start: Ticks,
    ) -> Token {
        self.finishes.push(Bounds {
            min: start + 1,
            max: Ticks::MAX,
            same: None,
        });
        let rules = tables.model.rules_of(timeline, predicate).iter();
        let instances = rules.map(|&rule| Instance {
            rule,
            guard: Guard::Waiting,
            variables: SmallVec::new(),
            labels: SmallVec::new(),
        });
        self.tokens.push(At {
            timeline,
            predicate,
            start,
            finish: (self.finishes.len() - 1) as Finish,
            parameters,
            instances: instances.collect(),
            fills: false,
        });
        let token = (self.tokens.len() - 1) as Token;
        self.lanes[timeline].tokens.push(token);
        self.news.push(token);
        self.operations += 1;
        token
    }

    /// What follows from what is known anew, until nothing does.
    pub(super) fn settle(&mut self, tables: &Tables) -> Result<(), Clash> {
        while let Some(token) = self.news.pop() {
            for instance in 0..self.at(token).instances.len() {
                self.operations += 1;
                let is = &self.at(token).instances[instance];
                match is.guard {
                    Guard::Void => {}
                    Guard::Holds => self.say(tables, token, instance)?,
                    Guard::Waiting => match self.guard(tables, token, is.rule) {
                        Guard::Holds => self.apply(tables, token, instance)?,
                        guard => {
                            self.tokens[usize::from(token)].instances[instance].guard = guard;
                        }
                    },
                }
            }
        }
        Ok(())
    }

    /// What is known of a rule's guard.
    fn guard(&self, tables: &Tables, token: Token, rule: RuleId) -> Guard {
        let at = self.at(token);
        let (said, flat) = (&tables.model.rules[rule], &tables.flats[rule]);
        let named = |variable: VariableId| {
            let place = flat.named.iter().find(|named| named.0 == variable);
            place.map(|&(_, place)| at.parameters[place])
        };
        let mut all = Guard::Holds;
        for (place, argument) in said.master.arguments.iter().enumerate() {
            let equal = match *argument {
                Argument::Any => continue,
                Argument::Value(value) => {
                    let is = self.root(at.parameters[place]);
                    let is = &self.cells[usize::from(is)];
                    match is.value {
                        Some(is) => Some(is == value),
                        None => (!is_of(&tables.model, is.of, value)).then_some(false),
                    }
                }
                Argument::Variable(variable) => match named(variable) {
                    Some(first) => self.are_equal(first, at.parameters[place]),
                    None => continue,
                },
            };
            match equal {
                Some(true) => {}
                Some(false) => return Guard::Void,
                None => all = Guard::Waiting,
            }
        }
        let object = tables.model.timelines[at.timeline].object;
        for when in &said.when {
            let value = |operand: &Operand| match *operand {
                Operand::Value(value) => Some(value),
                Operand::Variable(variable) if said.master.object == Some(variable) => Some(object),
                Operand::Variable(variable) => named(variable).and_then(|at| self.value(at)),
                _ => None,
            };
            let values: Option<SmallVec<[Value; 4]>> = when.operands.iter().map(value).collect();
            match values.map(|values| tables.holds(when.kind, &values)) {
                Some(true) => {}
                Some(false) => return Guard::Void,
                None => all = Guard::Waiting,
            }
        }
        all
    }

    /// Whether two cells are certainly equal, certainly not, or neither.
    pub(super) fn are_equal(&self, one: Cell, other: Cell) -> Option<bool> {
        if self.root(one) == self.root(other) {
            return Some(true);
        }
        self.value(one)
            .zip(self.value(other))
            .map(|(one, other)| one == other)
    }

    /// A rule holds now: what it says is so, what it asks for is open.
    fn apply(&mut self, tables: &Tables, token: Token, instance: usize) -> Result<(), Clash> {
        let at = self.at(token);
        let rule = at.instances[instance].rule;
        let (said, flat) = (&tables.model.rules[rule], &tables.flats[rule]);
        let mut variables: SmallVec<[Option<Cell>; 4]> =
            SmallVec::from_elem(None, said.variables.len());
        for &(variable, place) in &flat.named {
            variables[variable] = Some(at.parameters[place]);
        }
        let (timeline, start, finish) = (at.timeline, at.start, at.finish);
        if let Some(object) = said.master.object
            && variables[object].is_none()
        {
            let value = tables.model.timelines[timeline].object;
            variables[object] = Some(self.new_cell(said.variables[object].of, Some(value)));
        }
        let labels = SmallVec::from_elem(None, said.labels.max(1));
        let at = &mut self.tokens[usize::from(token)].instances[instance];
        (at.guard, at.variables, at.labels) = (Guard::Holds, variables, labels);
        self.say(tables, token, instance)?;
        if let Some([min, max]) = flat.duration {
            self.within(finish, later(start, min), later(start, max), Some(rule))?;
        }
        let instance = instance as u16;
        for &part in &flat.top {
            self.open.push(Open {
                token,
                instance,
                part,
            });
        }
        Ok(())
    }

    /// What a rule that holds says of parameters, as far as it follows from what is known.
    fn say(&mut self, tables: &Tables, token: Token, instance: usize) -> Result<(), Clash> {
        let rule = self.at(token).instances[instance].rule;
        for said in &tables.model.rules[rule].relationships {
            self.operations += 1;
            let mut cells: SmallVec<[Option<Cell>; 4]> = SmallVec::new();
            let mut known: SmallVec<[Option<Value>; 4]> = SmallVec::new();
            for operand in &said.operands {
                let cell = match *operand {
                    Operand::Variable(variable) => {
                        Some(self.variable(tables, token, instance, variable))
                    }
                    _ => None,
                };
                cells.push(cell);
                known.push(match (*operand, cell) {
                    (Operand::Value(value), _) => Some(value),
                    (_, Some(cell)) => self.value(cell),
                    _ => None,
                });
            }
            self.say_one(tables, said.kind, (&cells, &known), rule)?;
        }
        Ok(())
    }

    /// What one relationship says of cells, where there are such, and known values.
    fn say_one(
        &mut self,
        tables: &Tables,
        kind: RelationshipKind,
        (cells, known): (&[Option<Cell>], &[Option<Value>]),
        rule: RuleId,
    ) -> Result<(), Clash> {
        let is = |state: &mut State, place: usize, value: Value| match cells[place] {
            Some(cell) => state.bind(tables, cell, value, Some(rule)),
            None => Ok(()),
        };
        match kind {
            RelationshipKind::Equal => {
                let value = known.iter().copied().flatten().next();
                for place in 0..cells.len() {
                    if let Some(value) = value {
                        is(self, place, value)?;
                    } else if let (Some(one), Some(other)) = (cells[0], cells[place]) {
                        self.equal(tables, one, other, Some(rule))?;
                    }
                }
            }
            RelationshipKind::Function(function) => {
                let inputs: Option<SmallVec<[Value; 4]>> =
                    known[..known.len() - 1].iter().copied().collect();
                let call = tables.model.functions[function].call;
                if let Some(output) = inputs.and_then(|inputs| call(&inputs)) {
                    is(self, known.len() - 1, output)?;
                }
                // An output that is known and another than the function's was refused.
                return match known.last().copied().flatten() {
                    Some(last) => self.check_output(call, known, last, rule),
                    None => Ok(()),
                };
            }
            RelationshipKind::Table(table) => {
                for (place, value) in tables.certain(table, known) {
                    is(self, place, value)?;
                }
            }
            _ => {}
        }
        let values: Option<SmallVec<[Value; 4]>> = known.iter().copied().collect();
        if values.is_some_and(|values| !tables.holds(kind, &values)) {
            let (what, rule) = (What::Values, Some(rule));
            return Err(Clash { what, rule });
        }
        Ok(())
    }

    fn check_output(
        &self,
        call: fn(&[Value]) -> Option<Value>,
        known: &[Option<Value>],
        output: Value,
        rule: RuleId,
    ) -> Result<(), Clash> {
        let inputs: Option<SmallVec<[Value; 4]>> =
            known[..known.len() - 1].iter().copied().collect();
        match inputs.and_then(|inputs| call(&inputs)) {
            Some(is) if is != output => {
                let (what, rule) = (What::Values, Some(rule));
                Err(Clash { what, rule })
            }
            _ => Ok(()),
        }
    }

    /// The cell that a variable of a rule stands for; a new one, if it stands for none yet.
    pub(super) fn variable(
        &mut self,
        tables: &Tables,
        token: Token,
        instance: usize,
        variable: VariableId,
    ) -> Cell {
        let at = &self.at(token).instances[instance];
        if let Some(cell) = at.variables[variable] {
            return cell;
        }
        let of = tables.model.rules[at.rule].variables[variable].of;
        let cell = self.new_cell(of, None);
        self.tokens[usize::from(token)].instances[instance].variables[variable] = Some(cell);
        cell
    }
}

/// A time and a distance, either of which may have no bound.
pub(super) fn later(time: Ticks, by: Ticks) -> Ticks {
    match (time, by) {
        (Ticks::MIN | Ticks::MAX, _) => time,
        // The negation of no bound below is none above.
        (_, Ticks::MIN) => Ticks::MIN,
        (_, Ticks::MAX) => Ticks::MAX,
        _ if by == -Ticks::MAX => Ticks::MIN,
        _ => time.saturating_add(by),
    }
}

/// Least and most ticks from one end to the other.
pub(super) fn span(distance: &farside_planning::model::Distance) -> (Ticks, Ticks) {
    let bound = |bound, none| constant(bound, none).unwrap_or(none);
    // One more than the least, so that it can be negated.
    let none = -Ticks::MAX;
    let (min, max) = (bound(distance.min, none), bound(distance.max, Ticks::MAX));
    if distance.backward {
        (-max, -min)
    } else {
        (min, max)
    }
}
