//! Rules as they hold for tokens: instances that wait for their guard, hold, or are void, and what
//! they ask for.

use smallvec::SmallVec;

use super::resources::Effected;
use super::token::copy;
use super::trail::Change;
use super::{Conflict, Database, InstanceId, Owner, TokenId};
use crate::model::{
    Argument, Body, Bound, End, Operand as Term, Position, Relation, Relationship,
    RelationshipKind, Rule, RuleId, Target, Value, VariableId,
};
use crate::parameters::{self, Operand};
use crate::temporal::{Constraint, Span};

/// A part of a rule's body: a relation or a choice, by its place among those of the rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Step {
    /// A relation.
    Relation(u32),
    /// A choice of alternatives.
    Choice(u32),
}

/// What an instance asks for, and nobody decided yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Open {
    /// Who asks.
    pub instance: InstanceId,
    /// What for.
    pub step: Step,
}

/// A rule's body without nesting.
#[derive(Clone, Debug, Default)]
pub(crate) struct Flat {
    /// The relations, in the order of the text.
    pub(crate) relations: Vec<Relation>,
    /// By choice: by alternative: its parts.
    pub(crate) choices: Vec<Vec<Vec<Step>>>,
    /// What holds in any case.
    pub(crate) top: Vec<Step>,
    /// Whether the rule holds from the first, without a guard.
    pub(crate) unguarded: bool,
    /// Whether bounds of its times are variables.
    pub(super) varies: bool,
    /// The variables among the master's arguments, each with the first place that it has.
    pub(super) named: Vec<(VariableId, usize)>,
    /// The places of the master's arguments that its guard asks of.
    pub(super) guarding: Vec<usize>,
}

impl Flat {
    pub(crate) fn of(rule: &Rule) -> Self {
        let mut flat = Flat::default();
        flat.top = flat.parts(&rule.body);
        for (place, argument) in rule.master.arguments.iter().enumerate() {
            match *argument {
                Argument::Any => {}
                Argument::Value(_) => flat.guarding.push(place),
                Argument::Variable(variable) => {
                    match flat.named.iter().find(|named| named.0 == variable) {
                        Some(&(_, first)) => flat.guarding.extend([first, place]),
                        None => flat.named.push((variable, place)),
                    }
                }
            }
        }
        flat.unguarded = rule.when.is_empty() && flat.guarding.is_empty();
        let distances = flat.relations.iter().flat_map(|at| &at.distances);
        let bounds = distances.map(|at| [at.min, at.max]).chain(rule.duration);
        flat.varies = { bounds }.any(varies);
        flat
    }

    fn parts(&mut self, body: &Body) -> Vec<Step> {
        match body {
            Body::All(parts) => parts.iter().flat_map(|part| self.parts(part)).collect(),
            Body::Any(alternatives, _) => {
                let place = self.choices.len();
                self.choices.push(Vec::new());
                let alternatives = alternatives.iter().map(|part| self.parts(part)).collect();
                self.choices[place] = alternatives;
                vec![Step::Choice(place as u32)]
            }
            Body::Relation(relation) => {
                self.relations.push((**relation).clone());
                vec![Step::Relation(self.relations.len() as u32 - 1)]
            }
        }
    }
}

/// Whether a rule holds for a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Guard {
    /// What it asks is undecided.
    Waiting,
    /// It holds.
    Holds,
    /// It does not.
    Void,
}

/// A rule as it holds for one token, or waits to.
#[derive(Debug)]
pub struct Instance {
    /// The rule.
    pub rule: RuleId,
    /// The token.
    pub master: TokenId,
    /// Whether it holds.
    pub guard: Guard,
    /// By variable of the rule: what it stands for, once something says so. A rule that never held
    /// has none of these, nor labels and choices.
    pub(super) variables: SmallVec<[Option<Operand>; 4]>,
    /// By label: the token that has it, but for label 0, which is the master.
    pub(super) labels: SmallVec<[Option<TokenId>; 3]>,
    /// By choice: the alternative that was chosen.
    pub(super) chosen: SmallVec<[Option<u32>; 1]>,
    /// Constraints of times, by what they are of.
    pub(super) times: SmallVec<[Posted; 2]>,
    /// Constraints of parameters; of which relation, if of one.
    pub(super) values: SmallVec<[(Option<u32>, parameters::Constraint); 2]>,
    /// What it does to resources.
    pub(super) effects: SmallVec<[Effected; 1]>,
    /// The variables that it asked to be told of, those among them that are gone.
    pub(super) watched: SmallVec<[parameters::Variable; 2]>,
    /// Since which edit the trail need not keep it again.
    pub(super) kept: u64,
}

// As that of a token.
impl Clone for Instance {
    fn clone(&self) -> Self {
        Instance {
            variables: copy(&self.variables),
            labels: copy(&self.labels),
            chosen: copy(&self.chosen),
            times: copy(&self.times),
            values: copy(&self.values),
            effects: copy(&self.effects),
            watched: copy(&self.watched),
            ..*self
        }
    }
}

/// A constraint of times that an instance brought.
#[derive(Clone, Copy, Debug)]
pub(super) struct Posted {
    /// Of which relation; none, if of the master's duration.
    pub(super) relation: Option<u32>,
    /// Which of its distances.
    pub(super) distance: u32,
    /// None where the bounds are variables, and as far as they are known today they hold between
    /// known times, or say nothing: once they are closer they may not.
    pub(super) constraint: Option<Constraint>,
}

/// Whether one of two bounds is a variable.
pub(super) fn varies(bounds: [Bound; 2]) -> bool {
    bounds.iter().any(|at| matches!(at, Bound::Variable(_)))
}

impl Instance {
    /// The token that has a label, if one has it yet; label 0 is the master.
    pub fn label(&self, label: usize) -> Option<TokenId> {
        match label {
            0 => Some(self.master),
            label => self.labels.get(label).copied().flatten(),
        }
    }

    /// What a variable of the rule stands for, if something says so.
    pub fn variable(&self, variable: VariableId) -> Option<Operand> {
        self.variables.get(variable).copied().flatten()
    }

    /// Whose constraints are that it brings: its own, or one of its relations'.
    pub(super) fn owner(&self, relation: Option<u32>) -> Owner {
        Owner::Rule {
            master: self.master,
            rule: self.rule,
            relation,
        }
    }

    /// The alternative of a choice that was chosen.
    pub fn chosen(&self, choice: usize) -> Option<u32> {
        self.chosen.get(choice).copied().flatten()
    }
}

/// What a token of a pattern can be asked for by: of parameters what is known of them.
pub(crate) type Wishes = SmallVec<[Option<Operand>; 4]>;

impl Database {
    /// The relation that an instance has in a place.
    pub fn relation(&self, instance: InstanceId, relation: u32) -> &Relation {
        let rule = self.instance_at(instance).rule;
        &self.flats[rule].relations[relation as usize]
    }

    /// The relations of a rule, in the order of the text.
    pub fn relations(&self, rule: RuleId) -> &[Relation] {
        &self.flats[rule].relations
    }

    /// Where a relation of a rule stands.
    pub fn position_of(&self, rule: RuleId, relation: u32) -> Position {
        self.flats[rule].relations[relation as usize].position
    }

    /// The alternatives of a choice: what each asks for.
    pub fn alternatives(&self, instance: InstanceId, choice: u32) -> &[Vec<Step>] {
        let rule = self.instance_at(instance).rule;
        &self.flats[rule].choices[choice as usize]
    }

    /// Chooses an alternative of an open choice: what it asks for is open now.
    ///
    /// # Panics
    ///
    /// If the choice is not open, or has no such alternative.
    pub fn choose(&mut self, instance: InstanceId, choice: u32, alternative: u32) {
        let open = Open {
            instance,
            step: Step::Choice(choice),
        };
        assert!(self.open.contains(&open), "{open:?} is open");
        self.close_open(open);
        self.change_instance(instance).chosen[choice as usize] = Some(alternative);
        let rule = self.instance_at(instance).rule;
        let (choice, alternative) = (choice as usize, alternative as usize);
        for place in 0..self.flats[rule].choices[choice][alternative].len() {
            let step = self.flats[rule].choices[choice][alternative][place];
            self.push_open(Open { instance, step });
        }
    }

    /// Makes the instances of a token that is active now.
    pub(super) fn make_instances(&mut self, token: TokenId) -> Result<(), Conflict> {
        let at = self.at(token);
        let (Some(timeline), predicate) = (at.timeline, at.predicate) else {
            return Ok(());
        };
        let rules = self.model.rules_of(timeline, predicate);
        let rules: SmallVec<[RuleId; 16]> = { rules.iter().copied() }
            .filter(|&rule| !self.never_holds(rule, token))
            .collect();
        for rule in rules {
            let id = self.instances.insert(Instance {
                rule,
                master: token,
                guard: Guard::Waiting,
                variables: SmallVec::new(),
                labels: SmallVec::new(),
                chosen: SmallVec::new(),
                times: SmallVec::new(),
                values: SmallVec::new(),
                effects: SmallVec::new(),
                watched: SmallVec::new(),
                kept: self.serial,
            });
            self.note(Change::InstanceAdded(id));
            self.change(token).instances.push(id);
            self.watch_guard(id)?;
            self.reconsider(id)?;
        }
        Ok(())
    }

    /// Whether a known value of a token is another one than the guard of a rule says. A value that is
    /// known when the token is put on its timeline does not change while it is there.
    fn never_holds(&self, rule: RuleId, token: TokenId) -> bool {
        let parameters = &self.at(token).parameters;
        let arguments = &self.model.rules[rule].master.arguments;
        { self.flats[rule].guarding.iter() }.any(|&place| {
            matches!(
                (arguments[place], parameters[place]),
                (Argument::Value(says), Operand::Value(is)) if says != is
            )
        })
    }

    /// A rule that holds has variables, of which those among the master's arguments stand for the
    /// master's parameters, labels and choices.
    fn begin(&mut self, instance: InstanceId) {
        let at = self.instance_at(instance);
        let rule = at.rule;
        let (said, choices) = (&self.model.rules[rule], self.flats[rule].choices.len());
        let labels = if said.labels > 1 { said.labels } else { 0 };
        let is = [at.variables.len(), at.labels.len(), at.chosen.len()];
        if is == [said.variables.len(), labels, choices] {
            return;
        }
        let named = (0..said.variables.len()).map(|variable| self.named(at, variable));
        let variables: SmallVec<[Option<Operand>; 4]> = named.collect();
        for &operand in variables.iter().flatten() {
            self.hold(operand);
        }
        let at = self.change_instance(instance);
        at.variables = variables;
        at.labels = SmallVec::from_elem(None, labels);
        at.chosen = SmallVec::from_elem(None, choices);
    }

    /// What a variable stands for by being named among the master's arguments.
    pub(super) fn named(&self, at: &Instance, variable: VariableId) -> Option<Operand> {
        let named = self.flats[at.rule].named.iter();
        let master = self.at(at.master);
        if let Some(&(_, place)) = { named }.find(|named| named.0 == variable) {
            return Some(master.parameters[place]);
        }
        let object = self.model.rules[at.rule].master.object == Some(variable);
        let timeline = master.timeline.filter(|_| object)?;
        Some(Operand::Value(self.model.timelines[timeline].object))
    }

    fn stand_for(&mut self, instance: InstanceId, variable: VariableId, operand: Operand) {
        self.hold(operand);
        self.change_instance(instance).variables[variable] = Some(operand);
    }

    /// What a relationship is for the store.
    pub(super) fn kind(&self, relationship: &Relationship) -> parameters::Kind {
        use crate::model::RelationshipKind as Said;
        use crate::parameters::Kind;
        match relationship.kind {
            Said::Equal => Kind::Equal,
            Said::Different => Kind::Different,
            Said::Less => Kind::Less,
            Said::AtMost => Kind::AtMost,
            Said::Sum => Kind::Sum,
            Said::Product => Kind::Product,
            Said::Table(table) => Kind::Table(self.tables[table].clone()),
            Said::Function(function) => Kind::Function(self.model.functions[function].call),
        }
    }

    /// The rule holds now: what it says of the master is posted, what it asks for is open.
    pub(super) fn apply(&mut self, instance: InstanceId) -> Result<(), Conflict> {
        self.begin(instance);
        let at = self.instance_at(instance);
        let (rule, master) = (at.rule, at.master);
        let owner = Owner::Rule {
            master,
            rule,
            relation: None,
        };
        for place in 0..self.model.rules[rule].relationships.len() {
            self.apply_relationship(instance, place)?;
        }
        if let Some([min, max]) = self.model.rules[rule].duration {
            self.watch_bounds(instance, [min, max]);
            let span = self.span(instance, min, max, false);
            let (start, finish) = (self.at(master).start, self.at(master).finish);
            let constraint = self.between(start, finish, span, owner)?;
            if constraint.is_some() || varies([min, max]) {
                self.change_instance(instance).times.push(Posted {
                    relation: None,
                    distance: 0,
                    constraint,
                });
            }
        }
        self.apply_effects(instance)?;
        for place in 0..self.flats[rule].top.len() {
            let step = self.flats[rule].top[place];
            self.push_open(Open { instance, step });
        }
        Ok(())
    }

    /// Posts what a rule says of parameters, where that is not certain already.
    fn apply_relationship(&mut self, instance: InstanceId, place: usize) -> Result<(), Conflict> {
        let at = self.instance_at(instance);
        let (rule, owner) = (at.rule, at.owner(None));
        let count = self.model.rules[rule].relationships[place].operands.len();
        let mut operands: SmallVec<[Operand; 4]> = SmallVec::new();
        for at in 0..count {
            let term = self.model.rules[rule].relationships[place].operands[at];
            if at + 1 == count
                && let Some(output) = self.known_output(instance, place, term, &operands)
            {
                self.stand_for(instance, output.0, output.1);
                return Ok(());
            }
            operands.push(self.operand(instance, term)?);
        }
        let kind = self.kind(&self.model.rules[rule].relationships[place]);
        let known = |operand: &Operand| matches!(operand, Operand::Value(_));
        self.steps += 1;
        if operands.iter().all(known) && self.store.entailed(&kind, &operands) == Some(true) {
            return Ok(());
        }
        let posted = self.post_value(kind, &operands, owner)?;
        self.change_instance(instance).values.push((None, posted));
        Ok(())
    }

    /// What a function gives for known values, where nothing stands for its output yet.
    fn known_output(
        &self,
        instance: InstanceId,
        place: usize,
        term: Term,
        inputs: &[Operand],
    ) -> Option<(VariableId, Operand)> {
        let rule = self.instance_at(instance).rule;
        let (Term::Variable(variable), RelationshipKind::Function(function)) =
            (term, self.model.rules[rule].relationships[place].kind)
        else {
            return None;
        };
        if self.instance_at(instance).variables[variable].is_some() {
            return None;
        }
        let mut values: SmallVec<[Value; 4]> = SmallVec::new();
        for input in inputs {
            let Operand::Value(value) = *input else {
                return None;
            };
            values.push(value);
        }
        let output = (self.model.functions[function].call)(&values)?;
        let of = self.model.rules[rule].variables[variable].of;
        let may_be = self.domains[of].contains(output);
        may_be.then_some((variable, Operand::Value(output)))
    }

    /// What a term stands for; a variable that nothing stands for yet gets one of the store.
    fn operand(&mut self, instance: InstanceId, term: Term) -> Result<Operand, Conflict> {
        let (label, end) = match term {
            Term::Value(value) => return Ok(Operand::Value(value)),
            Term::Variable(variable) => return Ok(self.variable_of(instance, variable)),
            Term::Start(label) => (label, Some(End::Start)),
            Term::Finish(label) => (label, Some(End::Finish)),
            Term::Duration(label) => (label, None),
        };
        let at = self.instance_at(instance);
        let owner = at.owner(None);
        let Some(token) = at.label(label) else {
            return Err(Conflict::Mismatch { owner });
        };
        self.mirror(token, end)
    }

    /// What a variable of an instance stands for.
    pub(super) fn variable_of(&mut self, instance: InstanceId, variable: VariableId) -> Operand {
        if let Some(operand) = self.instance_at(instance).variables[variable] {
            return operand;
        }
        let rule = self.instance_at(instance).rule;
        let of = self.model.rules[rule].variables[variable].of;
        let operand = self.new_variable(of);
        self.stand_for(instance, variable, operand);
        operand
    }

    /// The bounds of a distance, of variables as far as they are known.
    pub(crate) fn span(
        &self,
        instance: InstanceId,
        min: Bound,
        max: Bound,
        backward: bool,
    ) -> Span {
        let at = self.instance_at(instance);
        let bound = |bound: Bound| match bound {
            Bound::None => Span::ALL,
            Bound::Value(value) => Span::exactly(value),
            Bound::Variable(variable) => match at.variables[variable] {
                Some(operand) => self.values(operand),
                None => Span::ALL,
            },
        };
        let span = Span::new(bound(min).min, bound(max).max);
        if backward { span.negated() } else { span }
    }

    /// Asks to be told when variables of bounds change.
    pub(super) fn watch_bounds(&mut self, instance: InstanceId, bounds: [Bound; 2]) {
        for bound in bounds {
            if let Bound::Variable(variable) = bound {
                let operand = self.variable_of(instance, variable);
                self.watch(instance, operand);
            }
        }
    }

    /// Bounds of times follow their variables.
    pub(super) fn follow_bounds(&mut self, instance: InstanceId) -> Result<(), Conflict> {
        if !self.flats[self.instance_at(instance).rule].varies {
            return Ok(());
        }
        let flats = self.flats.clone();
        for place in 0..self.instance_at(instance).times.len() {
            let at = self.instance_at(instance);
            let posted = at.times[place];
            let master = self.at(at.master);
            let owner = at.owner(posted.relation);
            let ([min, max], backward, from, to) = match posted.relation {
                None => {
                    let bounds = self.model.rules[at.rule].duration;
                    let bounds = bounds.unwrap_or([Bound::None; 2]);
                    (bounds, false, master.start, master.finish)
                }
                Some(relation) => {
                    let relation = &flats[at.rule].relations[relation as usize];
                    let distance = relation.distances[posted.distance as usize];
                    let label = match relation.target {
                        Target::New(_, label) | Target::Label(label) => label,
                    };
                    let here = |label| {
                        let token = at.label(label);
                        token.filter(|&token| self.tokens.get(token).is_some())
                    };
                    let (Some(anchor), Some(target)) = (here(relation.anchor), here(label)) else {
                        continue;
                    };
                    let bounds = [distance.min, distance.max];
                    let from = self.time(anchor, distance.from);
                    (
                        bounds,
                        distance.backward,
                        from,
                        self.time(target, distance.to),
                    )
                }
            };
            if !varies([min, max]) {
                continue;
            }
            let span = self.span(instance, min, max, backward);
            let now = match posted.constraint {
                Some(old) => Some(self.between_again(old, from, to, span, owner)?),
                None => self.between(from, to, span, owner)?,
            };
            if now != posted.constraint {
                self.change_instance(instance).times[place].constraint = now;
            }
        }
        Ok(())
    }

    /// What an instance brought goes; tokens that it alone asked for go with it.
    pub(super) fn withdraw(&mut self, instance: InstanceId) {
        let at = self.instance_at(instance).clone();
        for constraint in at.times.iter().filter_map(|posted| posted.constraint) {
            self.retract_time(constraint);
        }
        for &(_, posted) in &at.values {
            self.retract_value(posted);
        }
        for &effected in &at.effects {
            self.take_effect_back(effected);
        }
        let open = self.open.iter().filter(|open| open.instance == instance);
        for open in open.copied().collect::<Vec<_>>() {
            self.close_open(open);
        }
        let now = self.change_instance(instance);
        now.times.clear();
        now.values.clear();
        now.effects.clear();
        now.chosen.fill(None);
        for label in 1..at.labels.len() {
            self.let_go(instance, label);
        }
    }

    /// Removes an instance of a token that leaves its timeline.
    pub(super) fn remove_instance(&mut self, instance: InstanceId) {
        if self.instance_at(instance).guard == Guard::Holds {
            self.withdraw(instance);
        }
        let Some(at) = self.instances.get(instance).cloned() else {
            return;
        };
        for &variable in &at.watched {
            let place = variable.index();
            if let Some(at) = self.watchers[place].iter().position(|&at| at == instance) {
                self.watchers[place].remove(at);
                self.note(Change::Unwatched(place, at, instance));
            }
        }
        for operand in at.variables.into_iter().flatten() {
            self.release(operand);
        }
        if let Some(removed) = self.instances.remove(instance)
            && self.depth() > 0
        {
            self.kept_instances.push(removed);
            self.note(Change::InstanceRemoved(instance));
        }
    }
}
