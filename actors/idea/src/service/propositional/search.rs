//! How the propositional technology decides: as the temporal one does, with copies of what is known
//! where that one undoes edits.

mod plans;

use farside_planning::Ticks;
use farside_planning::model::{Argument, End, RuleId, Target, TimelineId, Value};
use smallvec::SmallVec;

use super::Tables;
use super::rules::Part;
use super::state::{Cell, Clash, Open, Origin, State, Token, What, span};

pub(in crate::service) use plans::{Followed, Place};

/// What is missing.
#[derive(Clone, Copy, Debug)]
pub(in crate::service) enum Flaw {
    Open(Open),
    Goal(usize),
    Gap(TimelineId),
    /// The default goes on, or the next step of a plan comes, whose time it is.
    Ahead(TimelineId),
}

/// A way to put it right.
#[derive(Clone, Copy, Debug)]
pub(in crate::service) enum Decision {
    Support(Token),
    Insert(TimelineId),
    Relate,
    Alternative(usize),
    Follow(TimelineId, usize),
    Default(TimelineId),
    Wait(TimelineId),
}

/// A goal from elsewhere.
#[derive(Clone, Debug)]
pub(in crate::service) struct Goal {
    pub(in crate::service) timeline: TimelineId,
    pub(in crate::service) predicate: usize,
    pub(in crate::service) inputs: SmallVec<[Value; 4]>,
    /// How early it comes.
    pub(in crate::service) early: u32,
    /// How many statuses, goals and cancels were posted before it.
    pub(in crate::service) posted: u16,
}

/// All that a search changes.
#[derive(Clone, Debug, Default)]
pub(in crate::service) struct World {
    pub(in crate::service) state: State,
    /// Goals of this cycle that are not on their timelines yet.
    pub(in crate::service) goals: SmallVec<[Option<Goal>; 2]>,
    pub(in crate::service) plans: Vec<Option<Followed>>,
    /// Timelines whose plans wait, or that have a goal or a cancel in this cycle.
    pub(in crate::service) barred: SmallVec<[TimelineId; 2]>,
}

impl World {
    /// How early a part of a rule comes; none, if it is not due.
    fn urgency(&self, tables: &Tables, tick: Ticks, open: Open) -> Option<u32> {
        let instance = &self.state.at(open.token).instances[usize::from(open.instance)];
        let flat = &tables.flats[instance.rule];
        let relation = match open.part {
            Part::Relation(relation) => usize::from(relation),
            Part::Choice(choice) => {
                let parts = flat.choices[usize::from(choice)].iter().flatten();
                let dues =
                    parts.filter_map(|&part| self.urgency(tables, tick, Open { part, ..open }));
                // It comes with the first token that it could insert.
                return dues.min_by_key(|&due| (due & 1 == 0, due));
            }
        };
        let said = &flat.relations[relation];
        let anchor = match said.anchor {
            0 => open.token,
            label => instance.labels[label]?,
        };
        for distance in &said.distances {
            if distance.to == End::Finish && said.distances.len() > 1 {
                continue;
            }
            let (least, most) = self.state.time(anchor, distance.from);
            let (min, _) = span(distance);
            if distance.from == End::Start && least < self.state.tick && min > 1 {
                self.state.loose.set(true);
            }
            if least != most || most > tick || (min != -Ticks::MAX && least + min > tick) {
                return None;
            }
        }
        let early = tables.early[instance.rule][relation];
        Some(2 * early + u32::from(!said.condition))
    }

    /// What is missing next; nothing, if each timeline says something and nothing is due.
    pub(in crate::service) fn flaw(&self, tables: &Tables, tick: Ticks) -> Option<Flaw> {
        let mut first: Option<(u32, Open)> = None;
        for &open in &self.state.open {
            if let Some(early) = self.urgency(tables, tick, open)
                && first.is_none_or(|(best, _)| early < best)
            {
                first = Some((early, open));
            }
        }
        let goals = self.goals.iter().enumerate();
        let goals = goals.filter_map(|(place, goal)| Some((goal.as_ref()?.early, place)));
        if let Some((early, place)) = goals.min()
            && first.is_none_or(|(best, _)| early < best)
        {
            return Some(Flaw::Goal(place));
        }
        if let Some((_, open)) = first {
            return Some(Flaw::Open(open));
        }
        let gap = (0..self.state.lanes.len()).find(|&timeline| self.is_over(timeline, tick));
        gap.map(Flaw::Gap).or_else(|| self.waiting(tick))
    }
}

/// The longest way of a search, and why it did not go on.
#[derive(Clone, Debug)]
pub(in crate::service) struct Failure {
    pub(in crate::service) flaw: Flaw,
    pub(in crate::service) rule: Option<RuleId>,
    pub(in crate::service) goal: Option<Goal>,
    pub(in crate::service) clashes: Vec<Clash>,
}

impl World {
    /// The decisions that may put a flaw right, the best one first; how many are ruled out by their
    /// guards.
    pub(in crate::service) fn decisions(
        &self,
        tables: &Tables,
        tick: Ticks,
        flaw: Flaw,
    ) -> (Decisions, u64) {
        let mut decisions = Decisions::new();
        let mut guards = 0;
        match flaw {
            Flaw::Gap(timeline) => {
                let next = self.next_step(timeline, tick);
                decisions.extend(next.map(|step| Decision::Follow(timeline, step)));
                decisions.push(Decision::Default(timeline));
            }
            Flaw::Ahead(timeline) => {
                let next = self.next_step(timeline, tick);
                decisions.extend(next.map(|step| Decision::Follow(timeline, step)));
                decisions.push(Decision::Wait(timeline));
            }
            Flaw::Goal(place) => {
                let goal = self.goals[place].as_ref();
                decisions.extend(goal.map(|goal| Decision::Insert(goal.timeline)));
            }
            Flaw::Open(open) => match open.part {
                Part::Choice(choice) => {
                    let rule = self.rule(open);
                    let alternatives = &tables.flats[rule].choices[usize::from(choice)];
                    for (place, parts) in alternatives.iter().enumerate() {
                        if self.may_begin(tables, open, parts) {
                            decisions.push(Decision::Alternative(place));
                        } else {
                            guards += 1;
                        }
                    }
                }
                Part::Relation(relation) => {
                    self.ways(tables, tick, open, usize::from(relation), &mut decisions);
                }
            },
        }
        (decisions, guards)
    }

    /// How a relation can be fulfilled.
    fn ways(
        &self,
        tables: &Tables,
        tick: Ticks,
        open: Open,
        relation: usize,
        into: &mut Decisions,
    ) {
        let said = &tables.flats[self.rule(open)].relations[relation];
        let Target::New(pattern, _) = &said.target else {
            into.push(Decision::Relate);
            return;
        };
        into.extend(
            self.candidates(tables, open, relation)
                .map(Decision::Support),
        );
        if said.condition {
            return;
        }
        for &timeline in &pattern.timelines {
            let last = self.state.last(timeline);
            if last.is_none_or(|last| self.state.at(last).start != tick) {
                into.push(Decision::Insert(timeline));
            }
        }
    }

    pub(in crate::service) fn rule(&self, open: Open) -> RuleId {
        self.state.at(open.token).instances[usize::from(open.instance)].rule
    }

    fn may_begin(&self, tables: &Tables, open: Open, parts: &[Part]) -> bool {
        let Some(&Part::Relation(relation)) = parts.first() else {
            return true;
        };
        let relation = usize::from(relation);
        !tables.flats[self.rule(open)].relations[relation].condition
            || self.candidates(tables, open, relation).next().is_some()
    }

    /// The tokens that may fulfil a relation, the present ones first.
    fn candidates<'a>(
        &'a self,
        tables: &'a Tables,
        open: Open,
        relation: usize,
    ) -> impl Iterator<Item = Token> + 'a {
        let said = &tables.flats[self.rule(open)].relations[relation];
        let timelines: &[TimelineId] = match &said.target {
            Target::New(pattern, _) => &pattern.timelines,
            Target::Label(_) => &[],
        };
        let all = timelines.iter().flat_map(|&timeline| {
            let known = self.state.lanes[timeline].tokens.iter().rev();
            known.take(if said.condition { usize::MAX } else { 1 })
        });
        all.copied()
            .filter(move |&token| self.fits(tables, open, relation, token))
    }

    /// Whether a token can be what a relation asks for, as far as its times and each of its
    /// parameters, taken alone, say.
    fn fits(&self, tables: &Tables, open: Open, relation: usize, token: Token) -> bool {
        let instance = &self.state.at(open.token).instances[usize::from(open.instance)];
        let said = &tables.flats[instance.rule].relations[relation];
        let anchor = match said.anchor {
            0 => Some(open.token),
            label => instance.labels[label],
        };
        let (Some(anchor), Target::New(pattern, _)) = (anchor, &said.target) else {
            return false;
        };
        let at = self.state.at(token);
        if at.predicate != pattern.predicate {
            return false;
        }
        let in_time = said.distances.iter().all(|distance| {
            let from = self.state.time(anchor, distance.from);
            let to = self.state.time(token, distance.to);
            let (min, max) = span(distance);
            let starts = (self.state.at(anchor).start, at.start);
            self.state
                .judge((distance.from, distance.to), starts, (min, max));
            to.1.saturating_sub(from.0) >= min && to.0.saturating_sub(from.1) <= max
        });
        let may_be = |argument: &Argument, cell: Cell| match *argument {
            Argument::Any => true,
            Argument::Value(value) => self.may_be(tables, cell, value),
            Argument::Variable(variable) => match instance.variables[variable] {
                Some(stands) => self.may_equal(tables, stands, cell),
                None => true,
            },
        };
        in_time && { pattern.arguments.iter() }
            .zip(&at.parameters)
            .all(|(argument, &cell)| may_be(argument, cell))
    }

    fn may_be(&self, tables: &Tables, cell: Cell, value: Value) -> bool {
        let known = &self.state.cells[usize::from(self.state.root(cell))];
        match known.value {
            Some(is) => is == value,
            None => super::rules::is_of(&tables.model, known.of, value),
        }
    }

    fn may_equal(&self, tables: &Tables, one: Cell, other: Cell) -> bool {
        if self.state.root(one) == self.state.root(other) {
            return true;
        }
        match (self.state.value(one), self.state.value(other)) {
            (Some(one_is), Some(other_is)) => {
                self.state.compare(tables, one, other);
                one_is == other_is
            }
            (Some(value), _) => self.may_be(tables, other, value),
            (_, Some(value)) => self.may_be(tables, one, value),
            (None, None) => true,
        }
    }

    /// Carries a decision out. What follows is settled by the caller.
    pub(in crate::service) fn decide(
        &mut self,
        tables: &Tables,
        tick: Ticks,
        flaw: Flaw,
        decision: Decision,
    ) -> Result<(), Clash> {
        match (flaw, decision) {
            (Flaw::Open(open), Decision::Alternative(alternative)) => {
                let Part::Choice(choice) = open.part else {
                    return Ok(());
                };
                let choices = &tables.flats[self.rule(open)].choices;
                self.state.close(open);
                for &part in &choices[usize::from(choice)][alternative] {
                    self.state.open.push(Open { part, ..open });
                }
                Ok(())
            }
            (Flaw::Open(open), Decision::Support(token)) => self.support(tables, open, token),
            (Flaw::Open(open), Decision::Relate) => self.relate_labels(tables, open),
            (Flaw::Open(open), Decision::Insert(timeline)) => {
                self.insert_for(tables, tick, open, timeline)
            }
            (Flaw::Goal(place), Decision::Insert(timeline)) => {
                let Some(goal) = self.goals[place].take() else {
                    return Ok(());
                };
                self.make_room(tables, timeline, tick)?;
                let values: SmallVec<[Option<Value>; 6]> =
                    goal.inputs.iter().copied().map(Some).collect();
                let token = self.put(tables, timeline, goal.predicate, &values, tick);
                for place in 0..values.len() {
                    let cell = self.state.at(token).parameters[place];
                    let origin = Origin::Posted(goal.posted, place as u16);
                    self.state.cells[usize::from(cell)].origin = origin;
                }
                Ok(())
            }
            (_, Decision::Follow(timeline, step)) => self.follow(tables, timeline, step, tick),
            (_, Decision::Default(timeline)) => self.fill(tables, timeline, tick),
            (_, Decision::Wait(timeline)) => {
                self.barred.push(timeline);
                Ok(())
            }
            _ => unreachable!("the decision is one for the flaw"),
        }
    }

    /// A token with known values starts now.
    pub(in crate::service) fn put(
        &mut self,
        tables: &Tables,
        timeline: TimelineId,
        predicate: usize,
        values: &[Option<Value>],
        tick: Ticks,
    ) -> Token {
        let parameters = { tables.model.predicates[predicate].parameters.iter() }.enumerate();
        let cells = parameters.map(|(place, parameter)| {
            let value = values.get(place).copied().flatten();
            self.state.new_cell(parameter.of, value)
        });
        let cells = cells.collect();
        self.state.insert(tables, timeline, predicate, cells, tick)
    }

    fn relate_labels(&mut self, tables: &Tables, open: Open) -> Result<(), Clash> {
        let Part::Relation(relation) = open.part else {
            return Ok(());
        };
        let (relation, rule) = (usize::from(relation), self.rule(open));
        let instance = &self.state.at(open.token).instances[usize::from(open.instance)];
        let target = match tables.flats[rule].relations[relation].target {
            Target::Label(0) => Some(open.token),
            Target::Label(label) => instance.labels[label],
            Target::New(..) => None,
        };
        let (what, rule) = (What::Kind, Some(rule));
        let target = target.ok_or(Clash { what, rule })?;
        self.state.relate(tables, open, relation, target)
    }

    fn support(&mut self, tables: &Tables, open: Open, token: Token) -> Result<(), Clash> {
        let Part::Relation(relation) = open.part else {
            return Ok(());
        };
        let (relation, instance) = (usize::from(relation), usize::from(open.instance));
        let rule = self.rule(open);
        let said = &tables.flats[rule].relations[relation];
        let Target::New(pattern, label) = &said.target else {
            return Ok(());
        };
        let rule = Some(rule);
        let parameters = self.state.at(token).parameters.clone();
        for (argument, &cell) in pattern.arguments.iter().zip(&parameters) {
            match *argument {
                Argument::Any => {}
                Argument::Value(value) => self.state.bind(tables, cell, value, rule)?,
                Argument::Variable(variable) => {
                    let at = &mut self.state.tokens[usize::from(open.token)].instances[instance];
                    match at.variables[variable] {
                        Some(own) => self.state.equal(tables, own, cell, rule)?,
                        // It is the token's own from now on.
                        None => self.state.stand(open.token, instance, variable, cell),
                    }
                }
            }
        }
        if let Some(variable) = pattern.object {
            let object = tables.model.timelines[self.state.at(token).timeline].object;
            let own = self.state.variable(tables, open.token, instance, variable);
            self.state.bind(tables, own, object, rule)?;
        }
        self.state.tokens[usize::from(token)].fills = false;
        self.label(open, *label, token);
        self.state.relate(tables, open, relation, token)
    }

    fn label(&mut self, open: Open, label: usize, token: Token) {
        let at = &mut self.state.tokens[usize::from(open.token)];
        at.instances[usize::from(open.instance)].labels[label] = Some(token);
    }

    /// A token that a relation asks for starts now: its cells are those of the rule's variables.
    fn insert_for(
        &mut self,
        tables: &Tables,
        tick: Ticks,
        open: Open,
        timeline: TimelineId,
    ) -> Result<(), Clash> {
        let Part::Relation(relation) = open.part else {
            return Ok(());
        };
        let (relation, instance) = (usize::from(relation), usize::from(open.instance));
        let rule = self.rule(open);
        let said = &tables.flats[rule].relations[relation];
        let Target::New(pattern, label) = &said.target else {
            return Ok(());
        };
        self.make_room(tables, timeline, tick)?;
        let predicate = &tables.model.predicates[pattern.predicate];
        let mut cells: SmallVec<[Cell; 6]> = SmallVec::new();
        for (argument, parameter) in pattern.arguments.iter().zip(&predicate.parameters) {
            let cell = match *argument {
                Argument::Any => self.state.new_cell(parameter.of, None),
                Argument::Value(value) => self.state.new_cell(parameter.of, Some(value)),
                Argument::Variable(variable) => {
                    let own = self.state.variable(tables, open.token, instance, variable);
                    let known = self.state.value(own);
                    if let Some(value) = known
                        && !super::rules::is_of(&tables.model, parameter.of, value)
                    {
                        let (what, rule) = (What::Values, Some(rule));
                        return Err(Clash { what, rule });
                    }
                    own
                }
            };
            cells.push(cell);
        }
        if let Some(variable) = pattern.object {
            let object = tables.model.timelines[timeline].object;
            let own = self.state.variable(tables, open.token, instance, variable);
            self.state.bind(tables, own, object, Some(rule))?;
        }
        let token = self
            .state
            .insert(tables, timeline, pattern.predicate, cells, tick);
        self.label(open, *label, token);
        self.state.relate(tables, open, relation, token)
    }

    /// Ends a token at a tick, or when it had to end before, with the status that says how, if none
    /// came; whether there was anything to say.
    pub(in crate::service) fn close(
        &mut self,
        tables: &Tables,
        token: Token,
        tick: Ticks,
    ) -> Result<bool, Clash> {
        let (_, max) = self.state.finish(token);
        let open = !self.state.is_fixed(self.state.at(token).finish);
        let at = max.min(tick);
        let says = self.says(tables, token, at);
        if open {
            let finish = self.state.at(token).finish;
            self.state.within(finish, at, at, None)?;
        }
        let mut said = false;
        for &(place, value) in says {
            let cell = self.state.at(token).parameters[place];
            if self.state.value(cell).is_none() {
                self.state.bind(tables, cell, value, None)?;
                said = true;
            }
        }
        Ok(said || open)
    }

    /// Whether a token's end, or how it ended, is not known yet.
    pub(in crate::service) fn is_open(&self, tables: &Tables, token: Token, tick: Ticks) -> bool {
        let (min, max) = self.state.finish(token);
        let says = self.says(tables, token, max.min(tick));
        let parameters = &self.state.at(token).parameters;
        let mut says = says.iter().map(|&(place, _)| parameters[place]);
        min != max || says.any(|cell| self.state.value(cell).is_none())
    }

    /// What a token's outputs say if it ends at a tick and no status came.
    fn says<'a>(&self, tables: &'a Tables, token: Token, tick: Ticks) -> &'a [(usize, Value)] {
        let at = self.state.at(token);
        let endings = &tables.model.predicates[at.predicate];
        let longest = self.longest(tables, token);
        match longest.is_some_and(|longest| at.start.saturating_add(longest) == tick) {
            true => &endings.timed_out,
            false => &endings.preempted,
        }
    }

    /// How long the rules that hold let a token last at most.
    fn longest(&self, tables: &Tables, token: Token) -> Option<Ticks> {
        let instances = self.state.at(token).instances.iter();
        let holds = instances.filter(|at| at.guard == super::state::Guard::Holds);
        let bounds = holds.filter_map(|at| tables.flats[at.rule].duration);
        bounds.map(|[_, max]| max).min()
    }

    fn make_room(
        &mut self,
        tables: &Tables,
        timeline: TimelineId,
        tick: Ticks,
    ) -> Result<(), Clash> {
        let Some(last) = self.state.last(timeline) else {
            return Ok(());
        };
        self.close(tables, last, tick)?;
        let (_, max) = self.state.finish(last);
        if max > tick {
            let (what, rule) = (What::Times, None);
            return Err(Clash { what, rule });
        }
        Ok(())
    }

    /// Whether a timeline's last token has ended by a tick, or there is none.
    pub(in crate::service) fn is_over(&self, timeline: TimelineId, tick: Ticks) -> bool {
        let last = self.state.last(timeline);
        last.is_none_or(|last| self.state.finish(last).1 <= tick)
    }

    fn fill(&mut self, tables: &Tables, timeline: TimelineId, tick: Ticks) -> Result<(), Clash> {
        if let Some(last) = self.state.last(timeline)
            && self.close(tables, last, tick)?
        {
            return Ok(());
        }
        let said = &tables.model.timelines[timeline];
        let first = { said.initial.as_ref() }.filter(|_| self.state.last(timeline).is_none());
        let default = said.default.as_ref();
        let Some(filler) = first.or(default) else {
            let (what, rule) = (What::Kind, None);
            return Err(Clash { what, rule });
        };
        let token = self.put(tables, timeline, filler.predicate, &filler.values, tick);
        let fills = default.is_some_and(|default| default.predicate == filler.predicate);
        self.state.tokens[usize::from(token)].fills = fills;
        Ok(())
    }
}

pub(in crate::service) type Decisions = SmallVec<[Decision; 4]>;
