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

pub(in crate::service) type Cell = u16;
pub(in crate::service) type Finish = u16;
pub(in crate::service) type Token = u16;

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
    /// A function's number: it is of no class.
    Computed,
    /// What a cell had when the cycle began.
    Cell(u16),
    /// What was posted in this cycle: which, and in which place.
    Posted(u16, u16),
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

    /// An end lies within bounds that are near, or of which nobody knows where they are from.
    pub(in crate::service) fn within(
        &mut self,
        finish: Finish,
        min: Ticks,
        max: Ticks,
        rule: Option<RuleId>,
    ) -> Result<(), Clash> {
        self.within_from(finish, (min, &[]), (max, &[]), rule)
    }

    /// Whether a time is so far ahead that it is not told apart from others.
    pub(in crate::service) fn is_far(&self, time: Ticks) -> bool {
        time != Ticks::MAX && time > self.tick.saturating_add(self.exact)
    }

    /// Whether a token's end is known; notes if that depends on times that are not told apart.
    pub(in crate::service) fn is_fixed(&self, finish: Finish) -> bool {
        let at = &self.finishes[usize::from(self.end(finish))];
        if self.is_far(at.min) && !are_comparable(&at.lows, &at.highs) {
            self.loose.set(true);
        }
        at.min == at.max
    }

    /// An end lies within bounds, which are from somewhere if they are far.
    pub(in crate::service) fn within_from(
        &mut self,
        finish: Finish,
        (min, lows): (Ticks, &[Far]),
        (max, highs): (Ticks, &[Far]),
        rule: Option<RuleId>,
    ) -> Result<(), Clash> {
        let finish = usize::from(self.end(finish));
        let far = (self.is_far(min), self.is_far(max));
        let is = &self.finishes[finish];
        let was_far = (self.is_far(is.min), self.is_far(is.max));
        // What is far does not matter to what is near already.
        let matters = was_far.1 || is.max == Ticks::MAX;
        if (far.0 && lows.is_empty()) || (far.1 && highs.is_empty() && matters) {
            self.loose.set(true);
        }
        let known = (is.lows.len(), is.highs.len());
        let bounds = &mut self.finishes[finish];
        let before = (bounds.min, bounds.max);
        match (far.0, was_far.0) {
            (true, true) => join(&mut bounds.lows, lows),
            (true, false) => bounds.lows = SmallVec::from_slice(lows),
            _ => {}
        }
        match (far.1, was_far.1) {
            (true, true) => join(&mut bounds.highs, highs),
            (true, false) if max < bounds.max => bounds.highs = SmallVec::from_slice(highs),
            (false, _) if max < bounds.max => bounds.highs.clear(),
            _ => {}
        }
        (bounds.min, bounds.max) = (bounds.min.max(min), bounds.max.min(max));
        let (low, high) = (bounds.min, bounds.max);
        let unclear = !are_comparable(&bounds.lows, &bounds.highs);
        let same = before == (low, high) && known == (bounds.lows.len(), bounds.highs.len());
        if self.is_far(low) && self.is_far(high) && unclear {
            self.loose.set(true);
        }
        if low > high {
            let what = What::Times;
            return Err(Clash { what, rule });
        }
        if same {
            return Ok(());
        }
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
        let rule = Some(gap.rule);
        // Times that are moved are of no known origin.
        let from_there = |fars: Fars, by: Ticks| if by == 0 { fars } else { Fars::new() };
        let at = self.finishes[usize::from(self.end(gap.from))].clone();
        let (lows, highs) = (from_there(at.lows, gap.min), from_there(at.highs, gap.max));
        let low = (later(at.min, gap.min), &lows[..]);
        let high = (later(at.max, gap.max), &highs[..]);
        self.within_from(gap.to, low, high, rule)?;
        let at = self.finishes[usize::from(self.end(gap.to))].clone();
        let (lows, highs) = (from_there(at.lows, gap.max), from_there(at.highs, gap.min));
        let low = (later(at.min, -gap.max), &lows[..]);
        let high = (later(at.max, -gap.min), &highs[..]);
        self.within_from(gap.from, low, high, rule)
    }

    /// Says what a relation says of the times of two tokens.
    pub(in crate::service) fn relate(
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
            let starts = (self.at(anchor).start, self.at(target).start);
            self.judge((distance.from, distance.to), starts, (min, max));
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

    /// Notes if what a distance says of two tokens depends on when they started, which is not told
    /// apart unless it is now.
    pub(in crate::service) fn judge(
        &self,
        ends: (End, End),
        (from, to): (Ticks, Ticks),
        (min, max): (Ticks, Ticks),
    ) {
        let clear = match ends {
            (End::Start, End::Start) => match (from < self.tick, to < self.tick) {
                (true, true) => false,
                (true, false) => max == Ticks::MAX && min <= 1 || max <= 0,
                (false, true) => min == -Ticks::MAX && max >= -1 || min >= 0,
                (false, false) => true,
            },
            (End::Start, End::Finish) => from == self.tick || (min <= 0 && max == Ticks::MAX),
            (End::Finish, End::Start) => {
                to == self.tick || (min == -Ticks::MAX && max >= 0) || min >= 0
            }
            // What is near is told apart; two far ends are another question.
            (End::Finish, End::Finish) => {
                (min == -Ticks::MAX || min == 0 || min == 1)
                    && (max == Ticks::MAX || max == 0 || max == -1)
            }
        };
        if !clear {
            self.loose.set(true);
        }
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
            for (one, other) in [(to, from), (from, to)] {
                let at = self.finishes[usize::from(one)].clone();
                self.within_from(other, (at.min, &at.lows), (at.max, &at.highs), rule)?;
            }
            if from != to && !self.is_fixed(from) {
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
    fn are_equal(&self, tables: &Tables, one: Cell, other: Cell) -> Option<bool> {
        if self.root(one) == self.root(other) {
            return Some(true);
        }
        self.compare(tables, one, other);
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
                if let Some(output) = inputs.and_then(|inputs| call(&inputs))
                    && let Some(cell) = cells[cells.len() - 1]
                {
                    let of = self.cells[usize::from(self.root(cell))].of;
                    let origin = match tables.is_measured(of) {
                        true => Origin::Computed,
                        false => Origin::Model,
                    };
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
                if let Some(value) = others.and_then(|others| reckon(kind, &others)) {
                    is(self, known.len() - 1, value)?;
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

/// Takes over from where a time may be, too.
fn join(fars: &mut Fars, others: &[Far]) {
    for &other in others {
        if !fars.contains(&other) {
            fars.push(other);
        }
    }
}

/// Whether a far earliest and a far latest end can be compared without knowing when they are.
fn are_comparable(lows: &[Far], highs: &[Far]) -> bool {
    let all_ahead = { lows.iter().chain(highs) }.all(|at| matches!(at, Far::Ahead(_)));
    all_ahead || (lows.len() == 1 && lows == highs)
}

/// The sum or the product of numbers.
pub(in crate::service) fn reckon(kind: RelationshipKind, values: &[Value]) -> Option<Value> {
    let mut values = values.iter();
    match kind {
        RelationshipKind::Sum => values.try_fold(0, |sum: Value, &one| sum.checked_add(one)),
        _ => values.try_fold(1, |all: Value, &one| all.checked_mul(one)),
    }
}

/// A time and a distance, either of which may have no bound.
pub(in crate::service) fn later(time: Ticks, by: Ticks) -> Ticks {
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
pub(in crate::service) fn span(distance: &farside_planning::model::Distance) -> (Ticks, Ticks) {
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
