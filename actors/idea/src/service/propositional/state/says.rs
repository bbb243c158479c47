//! What rules say of values, and whether they hold.

use farside_planning::model::{Argument, Operand, RelationshipKind, RuleId, Value, VariableId};
use smallvec::SmallVec;

use super::super::Tables;
use super::super::rules::is_of;
use super::times::later;
use super::{Cell, Clash, Far, Fars, Formula, Guard, Open, Origin, State, Token, What};

impl State {
    /// What follows from what is known anew, until nothing does.
    pub(in crate::service) fn settle(&mut self, tables: &Tables) -> Result<(), Clash> {
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
    pub(super) fn guard(&self, tables: &Tables, token: Token, rule: RuleId) -> Guard {
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
                    Some(first) => self.are_equal(tables, first, at.parameters[place]),
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
    pub(super) fn are_equal(&self, tables: &Tables, one: Cell, other: Cell) -> Option<bool> {
        if self.root(one) == self.root(other) {
            return Some(true);
        }
        self.compare(tables, one, other);
        self.value(one)
            .zip(self.value(other))
            .map(|(one, other)| one == other)
    }

    /// A rule holds now: what it says is so, what it asks for is open.
    pub(super) fn apply(
        &mut self,
        tables: &Tables,
        token: Token,
        instance: usize,
    ) -> Result<(), Clash> {
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
            let ahead = |ticks| match start == self.tick {
                true => smallvec::smallvec![Far::Ahead(ticks)],
                false => Fars::new(),
            };
            let (lows, highs): (Fars, Fars) = (ahead(min), ahead(max));
            let (low, high) = (later(start, min), later(start, max));
            self.within_from(finish, (low, &lows), (high, &highs), Some(rule))?;
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
    pub(super) fn say(
        &mut self,
        tables: &Tables,
        token: Token,
        instance: usize,
    ) -> Result<(), Clash> {
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
    pub(super) fn say_one(
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
                if let Some(output) = inputs.and_then(|inputs| call(&inputs))
                    && let Some(cell) = cells[cells.len() - 1]
                {
                    let origin = self.computed(tables, kind, cells, known);
                    self.bind_from(tables, cell, (output, origin), Some(rule))?;
                }
                // An output that is known and another than the function's was refused.
                return match known.last().copied().flatten() {
                    Some(last) => self.check_output(call, known, last, rule),
                    None => Ok(()),
                };
            }
            RelationshipKind::Sum | RelationshipKind::Product => {
                let (_, others) = known.split_last().expect("it has operands");
                let others: Option<SmallVec<[Value; 4]>> = others.iter().copied().collect();
                if let Some(value) = others.and_then(|others| reckon(kind, &others))
                    && let Some(cell) = cells[cells.len() - 1]
                {
                    let origin = self.computed(tables, kind, cells, known);
                    self.bind_from(tables, cell, (value, origin), Some(rule))?;
                }
                return Ok(());
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

    /// What the last of some cells is made from, if that is a number and somebody tells states apart.
    fn computed(
        &mut self,
        tables: &Tables,
        kind: RelationshipKind,
        cells: &[Option<Cell>],
        known: &[Option<Value>],
    ) -> Origin {
        let output = cells.last().copied().flatten();
        let is_number = |cell| tables.is_measured(self.cells[usize::from(self.root(cell))].of);
        if self.exact == 0 || !output.is_some_and(is_number) {
            return Origin::Model;
        }
        let origin = |cell: &Option<Cell>| {
            cell.map_or(Origin::Model, |cell| {
                self.cells[usize::from(self.root(cell))].origin
            })
        };
        let inputs = cells[..cells.len() - 1].iter().zip(known);
        let inputs = inputs.map(|(cell, value)| (value.unwrap_or(0), origin(cell)));
        let inputs = inputs.collect();
        let formula = Formula { kind, inputs };
        let place = self.formulas.iter().position(|at| *at == formula);
        let place = place.unwrap_or(self.formulas.len());
        if place == self.formulas.len() {
            self.formulas.push(formula);
        }
        Origin::Computed(place as u16)
    }

    pub(super) fn check_output(
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
}

/// The sum or the product of numbers.
pub(in crate::service) fn reckon(kind: RelationshipKind, values: &[Value]) -> Option<Value> {
    let mut values = values.iter();
    match kind {
        RelationshipKind::Sum => values.try_fold(0, |sum: Value, &one| sum.checked_add(one)),
        _ => values.try_fold(1, |all: Value, &one| all.checked_mul(one)),
    }
}
