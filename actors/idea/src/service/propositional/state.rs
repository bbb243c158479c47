//! What the propositional technology knows: present tokens, whose parameters are cells and whose
//! ends are counters, and what their rules ask for.
//!
//! A cell is shared by all parameters that are equal: a token that a rule asks for has the cells of
//! the rule's variables, so that a parameter which no guard tests is copied by reference, whatever
//! its value. An end is shared by all tokens that end together.

mod says;
mod times;

use farside_planning::Ticks;
use farside_planning::model::{
    End, Model, PredicateId, RelationshipKind, RuleId, TimelineId, TypeId, Value, VariableId,
};
use smallvec::SmallVec;

use super::Tables;
use super::rules::{Part, is_of};

pub(in crate::service) type Cell = u16;
pub(in crate::service) type Finish = u16;
pub(in crate::service) type Token = u16;

pub(in crate::service) use says::reckon;
pub(in crate::service) use times::span;

/// Why something cannot be, and by which rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::service) struct Clash {
    pub(in crate::service) what: What,
    pub(in crate::service) rule: Option<RuleId>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::service) enum What {
    Times,
    Values,
    Kind,
}

/// Where a value is from, for a table of what follows from what.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub(in crate::service) enum Origin {
    /// The model, or what values of the same classes give.
    #[default]
    Model,
    /// A function, by its place in [`State::formulas`].
    Computed(u16),
    /// What a cell had when the cycle began.
    Cell(u16),
    /// What was posted in this cycle: which, and in which place.
    Posted(u16, u16),
}

/// A function's number, and what it was made from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::service) struct Formula {
    pub(in crate::service) kind: RelationshipKind,
    pub(in crate::service) inputs: SmallVec<[(Value, Origin); 4]>,
}

/// Where an end is from that lies further ahead than what is counted exactly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::service) enum Far {
    /// So many ticks from now.
    Ahead(Ticks),
    /// What an end had when the cycle began.
    End(u16),
}

/// Where a time is from, of several that say so.
pub(in crate::service) type Fars = SmallVec<[Far; 2]>;

/// A value that is known, or not yet.
#[derive(Clone, Debug)]
pub(in crate::service) struct Known {
    pub(in crate::service) value: Option<Value>,
    pub(in crate::service) origin: Origin,
    /// Whose value it has instead, if it is equal to another.
    pub(in crate::service) same: Option<Cell>,
    pub(in crate::service) of: TypeId,
    /// The type of what it was made equal to, if that is another.
    pub(in crate::service) also: Option<TypeId>,
}

/// When a token ends, at the earliest and the latest.
#[derive(Clone, Debug)]
pub(in crate::service) struct Bounds {
    pub(in crate::service) min: Ticks,
    pub(in crate::service) max: Ticks,
    /// Where a far earliest end is from: it is the latest of these.
    pub(in crate::service) lows: Fars,
    /// Where a far latest end is from: it is the earliest of these.
    pub(in crate::service) highs: Fars,
    pub(in crate::service) same: Option<Finish>,
}

/// That one end lies so many ticks after another.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(in crate::service) struct Gap {
    pub(in crate::service) from: Finish,
    pub(in crate::service) to: Finish,
    pub(in crate::service) min: Ticks,
    pub(in crate::service) max: Ticks,
    pub(in crate::service) rule: RuleId,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::service) enum Guard {
    Waiting,
    Holds,
    Void,
}

/// A rule as it holds for a token, or waits to.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(in crate::service) struct Instance {
    pub(in crate::service) rule: RuleId,
    pub(in crate::service) guard: Guard,
    pub(in crate::service) variables: SmallVec<[Option<Cell>; 4]>,
    pub(in crate::service) labels: SmallVec<[Option<Token>; 3]>,
}

/// A token that is there, or ended in this cycle.
#[derive(Clone, Debug)]
pub(in crate::service) struct At {
    pub(in crate::service) timeline: TimelineId,
    pub(in crate::service) predicate: PredicateId,
    pub(in crate::service) start: Ticks,
    pub(in crate::service) finish: Finish,
    pub(in crate::service) parameters: SmallVec<[Cell; 6]>,
    pub(in crate::service) instances: SmallVec<[Instance; 4]>,
    /// Whether it is the default that nobody asked for.
    pub(in crate::service) fills: bool,
}

/// What an instance asks for, and nobody decided yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::service) struct Open {
    pub(in crate::service) token: Token,
    pub(in crate::service) instance: u16,
    pub(in crate::service) part: Part,
}

/// The tokens of a timeline that count: those that began in this cycle and the one before.
#[derive(Clone, Debug, Default)]
pub(in crate::service) struct Lane {
    /// The present one, and before it those that are known still.
    pub(in crate::service) tokens: SmallVec<[Token; 3]>,
    /// How many tokens had begun before the first of these.
    pub(in crate::service) number: u64,
}

/// All that is known.
#[derive(Clone, Debug, Default)]
pub(in crate::service) struct State {
    pub(in crate::service) cells: Vec<Known>,
    pub(in crate::service) finishes: Vec<Bounds>,
    pub(in crate::service) gaps: Vec<Gap>,
    pub(in crate::service) tokens: Vec<At>,
    pub(in crate::service) lanes: Vec<Lane>,
    pub(in crate::service) open: Vec<Open>,
    /// Tokens of which something is known anew.
    pub(in crate::service) news: Vec<Token>,
    /// What was looked at.
    pub(in crate::service) operations: u64,
    pub(in crate::service) tick: Ticks,
    /// Ends so many ticks ahead at most are counted exactly by whoever tells states apart.
    pub(in crate::service) exact: Ticks,
    /// Whether something was decided by numbers that such a one does not tell apart.
    pub(in crate::service) loose: std::cell::Cell<bool>,
    /// What numbers were made from, for whoever tells states apart.
    pub(in crate::service) formulas: Vec<Formula>,
}

impl State {
    pub(in crate::service) fn of(model: &Model) -> State {
        State {
            lanes: vec![Lane::default(); model.timelines.len()],
            ..State::default()
        }
    }

    pub(in crate::service) fn last(&self, timeline: TimelineId) -> Option<Token> {
        self.lanes[timeline].tokens.last().copied()
    }

    pub(in crate::service) fn at(&self, token: Token) -> &At {
        &self.tokens[usize::from(token)]
    }

    pub(in crate::service) fn root(&self, mut cell: Cell) -> Cell {
        while let Some(same) = self.cells[usize::from(cell)].same {
            cell = same;
        }
        cell
    }

    pub(in crate::service) fn value(&self, cell: Cell) -> Option<Value> {
        self.cells[usize::from(self.root(cell))].value
    }

    pub(in crate::service) fn end(&self, mut finish: Finish) -> Finish {
        while let Some(same) = self.finishes[usize::from(finish)].same {
            finish = same;
        }
        finish
    }

    /// When a token ends, at the earliest and the latest.
    pub(in crate::service) fn finish(&self, token: Token) -> (Ticks, Ticks) {
        let bounds = &self.finishes[usize::from(self.end(self.at(token).finish))];
        (bounds.min, bounds.max)
    }

    pub(in crate::service) fn time(&self, token: Token, end: End) -> (Ticks, Ticks) {
        match end {
            End::Start => (self.at(token).start, self.at(token).start),
            End::Finish => self.finish(token),
        }
    }

    pub(in crate::service) fn new_cell(&mut self, of: TypeId, value: Option<Value>) -> Cell {
        self.cells.push(Known {
            value,
            origin: Origin::Model,
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

    /// A cell has a value that the model gives.
    pub(in crate::service) fn bind(
        &mut self,
        tables: &Tables,
        cell: Cell,
        value: Value,
        rule: Option<RuleId>,
    ) -> Result<(), Clash> {
        self.bind_from(tables, cell, (value, Origin::Model), rule)
    }

    /// A cell has a value.
    pub(in crate::service) fn bind_from(
        &mut self,
        tables: &Tables,
        cell: Cell,
        (value, origin): (Value, Origin),
        rule: Option<RuleId>,
    ) -> Result<(), Clash> {
        let what = What::Values;
        let cell = self.root(cell);
        let known = &self.cells[usize::from(cell)];
        let computed = |at: Origin| matches!(at, Origin::Computed(_));
        if known.value.is_some()
            && known.origin != origin
            && (computed(origin) || computed(known.origin))
        {
            self.compare(tables, cell, cell);
        }
        match known.value {
            Some(is) if is == value => return Ok(()),
            Some(_) => return Err(Clash { what, rule }),
            None => {}
        }
        let is = |of: TypeId| is_of(&tables.model, of, value);
        if !is(known.of) || known.also.is_some_and(|of| !is(of)) {
            return Err(Clash { what, rule });
        }
        let known = &mut self.cells[usize::from(cell)];
        (known.value, known.origin) = (Some(value), origin);
        self.tell(cell);
        Ok(())
    }

    /// Two cells are equal.
    pub(in crate::service) fn equal(
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
        let what = What::Values;
        let (kept, other) = match (self.value(one), self.value(other)) {
            (Some(is), Some(other_is)) => {
                self.compare(tables, one, other);
                return (is == other_is).then_some(()).ok_or(Clash { what, rule });
            }
            (None, Some(_)) => (other, one),
            _ => (one, other),
        };
        let (value, of) = (self.value(kept), &self.cells[usize::from(other)]);
        let also = (of.of, of.also);
        if let Some(value) = value {
            let is = |of: TypeId| is_of(&tables.model, of, value);
            if !is(also.0) || also.1.is_some_and(|of| !is(of)) {
                return Err(Clash { what, rule });
            }
        }
        let known = &mut self.cells[usize::from(kept)];
        if known.of != also.0 && known.value.is_none() {
            known.also = Some(also.0);
        }
        self.cells[usize::from(other)].same = Some(kept);
        self.tell(kept);
        Ok(())
    }

    /// Values of two cells are compared: if they are numbers, whose classes need not say whether they
    /// are equal, that is noted.
    pub(in crate::service) fn compare(&self, tables: &Tables, one: Cell, other: Cell) {
        let is_number =
            |cell: Cell| tables.is_measured(self.cells[usize::from(self.root(cell))].of);
        if is_number(one) || is_number(other) {
            self.loose.set(true);
        }
    }

    pub(in crate::service) fn close(&mut self, open: Open) {
        if let Some(place) = self.open.iter().position(|&at| at == open) {
            self.open.remove(place);
        }
    }

    /// A new token, with its rules.
    pub(in crate::service) fn insert(
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
            lows: Fars::new(),
            highs: Fars::new(),
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

    /// A variable of a rule stands for a cell.
    pub(in crate::service) fn stand(
        &mut self,
        token: Token,
        instance: usize,
        variable: VariableId,
        cell: Cell,
    ) {
        self.tokens[usize::from(token)].instances[instance].variables[variable] = Some(cell);
        if !self.news.contains(&token) {
            self.news.push(token);
        }
    }

    /// The cell that a variable of a rule stands for; a new one, if it stands for none yet.
    pub(in crate::service) fn variable(
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
