//! How tokens come to fulfil what rules ask for.

use smallvec::SmallVec;

use super::edit::Wanted;
use super::rules::{Open, Posted, Step, Wishes, varies};
use super::{Cause, Conflict, Database, InstanceId, Status, Time, TokenId};
use crate::model::{Argument, Pattern, Target, TimelineId, VariableId};
use crate::parameters::{self, Operand};

impl Database {
    /// The pattern that an open relation asks for; none if it asks for a token that has a label
    /// already.
    pub fn asked(&self, instance: InstanceId, relation: u32) -> Option<&Pattern> {
        match &self.relation(instance, relation).target {
            Target::New(pattern, _) => Some(pattern),
            Target::Label(_) => None,
        }
    }

    /// What is known of the parameters of the token that a relation asks for, by parameter: none,
    /// if nothing is.
    pub fn wishes(&self, instance: InstanceId, relation: u32) -> SmallVec<[Option<Operand>; 4]> {
        let at = self.instance_at(instance);
        let Some(pattern) = self.asked(instance, relation) else {
            return SmallVec::new();
        };
        let wish = |argument: &Argument| match *argument {
            Argument::Any => None,
            Argument::Value(value) => Some(Operand::Value(value)),
            Argument::Variable(variable) => at.variable(variable),
        };
        pattern.arguments.iter().map(wish).collect()
    }

    /// Whether a token can be what a relation asks for, as far as each of its parameters, taken
    /// alone, says. Times are not asked.
    pub fn fits(&self, instance: InstanceId, relation: u32, token: TokenId) -> bool {
        let Some(pattern) = self.asked(instance, relation) else {
            return false;
        };
        let (at, token) = (self.instance_at(instance), self.at(token));
        let of_kind = token.status == Status::Active
            && token.predicate == pattern.predicate
            && token
                .timeline
                .is_some_and(|timeline| pattern.timelines.contains(&timeline));
        of_kind
            && pattern
                .arguments
                .iter()
                .zip(&token.parameters)
                .all(|(argument, &is)| {
                    let wish = match *argument {
                        Argument::Any => return true,
                        Argument::Value(value) => Operand::Value(value),
                        Argument::Variable(variable) => match at.variable(variable) {
                            Some(wish) => wish,
                            None => return true,
                        },
                    };
                    wish == is || self.are_equal(wish, is) != Some(false)
                })
    }

    /// An active token fulfils an open relation: its parameters are what the relation says, its
    /// times stand in the relation to the anchor's.
    ///
    /// # Errors
    ///
    /// If that cannot be: nothing changes.
    ///
    /// # Panics
    ///
    /// If the relation is not open.
    pub fn support(
        &mut self,
        instance: InstanceId,
        relation: u32,
        token: TokenId,
    ) -> Result<(), Conflict> {
        self.attempt(|database| {
            database.unify(instance, relation, token)?;
            database.relate(instance, relation, token)
        })
    }

    /// A relation between two tokens that have their labels is fulfilled by posting it.
    ///
    /// # Errors
    ///
    /// If it cannot be: nothing changes.
    ///
    /// # Panics
    ///
    /// If the relation is not open, asks for a new token, or a label is of no token yet.
    pub fn relate_labels(&mut self, instance: InstanceId, relation: u32) -> Result<(), Conflict> {
        let label = match self.relation(instance, relation).target {
            Target::Label(label) => label,
            Target::New(..) => panic!("the relation is one of labels"),
        };
        let token = self.instance_at(instance).label(label);
        let token = token.expect("the label is of a token");
        self.attempt(|database| database.relate(instance, relation, token))
    }

    /// A new token fulfils an open relation: it goes on a timeline after another token, or first
    /// of all.
    ///
    /// # Errors
    ///
    /// If it cannot be there: nothing changes.
    ///
    /// # Panics
    ///
    /// If the relation is not open, or asks for no new token.
    pub fn insert_for(
        &mut self,
        instance: InstanceId,
        relation: u32,
        slot: Slot,
        start: Option<Time>,
    ) -> Result<TokenId, Conflict> {
        self.attempt(|database| {
            let wishes = database.wishes_with_variables(instance, relation);
            let pattern = database.asked(instance, relation);
            let predicate = pattern.expect("the relation asks for a token").predicate;
            let at = database.instance_at(instance);
            let token = database.insert(Wanted {
                predicate,
                timeline: Some(slot.timeline),
                parameters: &wishes,
                start,
                finish: None,
                cause: Cause::Rule {
                    rule: at.rule,
                    master: at.master,
                },
            })?;
            database.unify(instance, relation, token)?;
            database.relate(instance, relation, token)?;
            database.place(token, slot)?;
            Ok(token)
        })
    }

    /// As [`wishes`](Self::wishes), and with variables for those that nothing stands for yet: the
    /// new token has the rule's own.
    fn wishes_with_variables(&mut self, instance: InstanceId, relation: u32) -> Wishes {
        let Some(pattern) = self.asked(instance, relation) else {
            return Wishes::new();
        };
        let variables: SmallVec<[VariableId; 4]> = pattern
            .arguments
            .iter()
            .filter_map(|argument| match *argument {
                Argument::Variable(variable) => Some(variable),
                _ => None,
            })
            .collect();
        for variable in variables {
            self.variable_of(instance, variable);
        }
        self.wishes(instance, relation)
    }

    /// Makes a token's parameters what a relation says, and gives it the relation's label.
    fn unify(
        &mut self,
        instance: InstanceId,
        relation: u32,
        token: TokenId,
    ) -> Result<(), Conflict> {
        let at = self.instance_at(instance);
        let owner = at.owner(Some(relation));
        let Some(pattern) = self.asked(instance, relation) else {
            return Err(Conflict::Mismatch { owner });
        };
        let is = self.at(token);
        let timeline = is.timeline;
        if is.predicate != pattern.predicate
            || !timeline.is_some_and(|timeline| pattern.timelines.contains(&timeline))
        {
            return Err(Conflict::Mismatch { owner });
        }
        let object = pattern.object;
        for place in 0..self.at(token).parameters.len() {
            let operand = self.at(token).parameters[place];
            let pattern = self.asked(instance, relation);
            match pattern.map_or(Argument::Any, |pattern| pattern.arguments[place]) {
                Argument::Any => {}
                Argument::Value(value) => {
                    self.make_equal(instance, relation, Operand::Value(value), operand)?;
                }
                Argument::Variable(variable) => {
                    self.stand_or_equal(instance, relation, variable, operand)?;
                }
            }
        }
        if let (Some(variable), Some(timeline)) = (object, timeline) {
            let object = Operand::Value(self.model.timelines[timeline].object);
            self.stand_or_equal(instance, relation, variable, object)?;
        }
        if let Target::New(_, label) = self.relation(instance, relation).target {
            self.change_instance(instance).labels[label] = Some(token);
        }
        let changed = self.change(token);
        changed.supports += 1;
        changed.supported.push((instance, relation));
        Ok(())
    }

    fn stand_or_equal(
        &mut self,
        instance: InstanceId,
        relation: u32,
        variable: VariableId,
        operand: Operand,
    ) -> Result<(), Conflict> {
        match self.instance_at(instance).variable(variable) {
            Some(stands) => self.make_equal(instance, relation, stands, operand),
            // Nothing can part them while the token fulfils the relation; when it does no more,
            // the variable would still stand for its parameter. So it is one of its own.
            None => {
                let own = self.variable_of(instance, variable);
                self.make_equal(instance, relation, own, operand)
            }
        }
    }

    fn make_equal(
        &mut self,
        instance: InstanceId,
        relation: u32,
        one: Operand,
        other: Operand,
    ) -> Result<(), Conflict> {
        if one == other {
            return Ok(());
        }
        let at = self.instance_at(instance);
        let owner = at.owner(Some(relation));
        if let (Operand::Value(_), Operand::Value(_)) = (one, other) {
            return Err(Conflict::Mismatch { owner });
        }
        let posted = self.post_value(parameters::Kind::Equal, &[one, other], owner)?;
        let at = self.change_instance(instance);
        at.values.push((Some(relation), posted));
        Ok(())
    }

    /// Posts what a relation says of times, between its anchor and a token; it is open no more.
    fn relate(
        &mut self,
        instance: InstanceId,
        relation: u32,
        token: TokenId,
    ) -> Result<(), Conflict> {
        let at = self.instance_at(instance);
        let rule = at.rule;
        let owner = at.owner(Some(relation));
        let said = &self.flats[rule].relations[relation as usize];
        let anchor = at.label(said.anchor);
        let anchor = anchor.ok_or(Conflict::Mismatch { owner })?;
        for place in 0..said.distances.len() {
            let distance = self.flats[rule].relations[relation as usize].distances[place];
            self.watch_bounds(instance, [distance.min, distance.max]);
            let span = self.span(instance, distance.min, distance.max, distance.backward);
            let from = self.time(anchor, distance.from);
            let to = self.time(token, distance.to);
            let constraint = self.between(from, to, span, owner)?;
            if constraint.is_some() || varies([distance.min, distance.max]) {
                self.change_instance(instance).times.push(Posted {
                    relation: Some(relation),
                    distance: place as u32,
                    constraint,
                });
            }
        }
        let step = Step::Relation(relation);
        self.close_open(Open { instance, step });
        Ok(())
    }

    /// A token fulfils the relation of a label no more: it goes, if nobody else asked for it.
    pub(super) fn let_go(&mut self, instance: InstanceId, label: usize) {
        // It may have gone with a token that was let go before.
        let at = self.instances.get(instance);
        let Some(token) = at.and_then(|at| at.label(label)) else {
            return;
        };
        self.change_instance(instance).labels[label] = None;
        if self.tokens.get(token).is_none() {
            return;
        }
        // The token may fulfil other relations of the instance, under other labels.
        let relations = self.relations(self.instance_at(instance).rule);
        let mine = |at: &(InstanceId, u32)| {
            at.0 == instance
                && matches!(relations[at.1 as usize].target, Target::New(_, its) if its == label)
        };
        let Some(place) = self.at(token).supported.iter().position(mine) else {
            return;
        };
        let changed = self.change(token);
        changed.supported.remove(place);
        changed.supports -= 1;
        let orphan = changed.supports == 0 && matches!(changed.cause, Cause::Rule { .. });
        if orphan && changed.status == Status::Active {
            self.delete(token);
        }
    }

    /// A relation that a token fulfilled is open again, with all relations that count on the
    /// token's label.
    pub(super) fn reopen(&mut self, instance: InstanceId, relation: u32) {
        // It may have gone with a token that was let go before.
        let Some(at) = self.instances.get(instance) else {
            return;
        };
        let rule = at.rule;
        let flats = self.flats.clone();
        let relations = &flats[rule].relations;
        let Target::New(_, label) = relations[relation as usize].target else {
            return;
        };
        // What is said of the token, of tokens that are said of, and so on.
        let mut labels: SmallVec<[usize; 4]> = SmallVec::from_slice(&[label]);
        let mut depend: SmallVec<[u32; 4]> = SmallVec::new();
        let mut grows = true;
        while grows {
            grows = false;
            for (at, said) in (0..).zip(relations) {
                let target = match said.target {
                    Target::New(_, label) | Target::Label(label) => label,
                };
                let depends = labels.contains(&said.anchor) || labels.contains(&target);
                if depends && !depend.contains(&at) {
                    depend.push(at);
                    grows = true;
                    if !labels.contains(&target) {
                        labels.push(target);
                    }
                }
            }
        }
        depend.sort_unstable();
        let fulfilled = depend.iter().filter(|&&at| self.is_fulfilled(instance, at));
        let fulfilled: SmallVec<[u32; 4]> = fulfilled.copied().collect();
        for &at in &depend {
            self.take_back(instance, at);
        }
        // The token that leaves is let go by itself.
        self.change_instance(instance).labels[label] = None;
        for &other in labels.iter().filter(|&&other| other != label) {
            self.let_go(instance, other);
        }
        if self.instances.get(instance).is_none() {
            return;
        }
        for &at in &fulfilled {
            let step = Step::Relation(at);
            self.push_open(Open { instance, step });
        }
    }

    /// Whether a relation that was asked for is fulfilled.
    fn is_fulfilled(&self, instance: InstanceId, relation: u32) -> bool {
        let open = Open {
            instance,
            step: Step::Relation(relation),
        };
        !self.open.contains(&open) && self.is_asked(instance, relation)
    }

    /// Whether a relation is at the top of the rule or in an alternative that was chosen.
    fn is_asked(&self, instance: InstanceId, relation: u32) -> bool {
        let at = self.instance_at(instance);
        let flat = &self.flats[at.rule];
        let mut steps: Vec<Step> = flat.top.clone();
        while let Some(step) = steps.pop() {
            match step {
                Step::Relation(one) if one == relation => return true,
                Step::Relation(_) => {}
                Step::Choice(choice) => {
                    if let Some(chosen) = at.chosen(choice as usize) {
                        steps.extend(&flat.choices[choice as usize][chosen as usize]);
                    }
                }
            }
        }
        false
    }

    /// Takes back what a relation posted.
    fn take_back(&mut self, instance: InstanceId, relation: u32) {
        let at = self.change_instance(instance);
        let times = std::mem::take(&mut at.times);
        let values = std::mem::take(&mut at.values);
        for posted in times {
            if posted.relation != Some(relation) {
                self.change_instance(instance).times.push(posted);
            } else if let Some(constraint) = posted.constraint {
                self.retract_time(constraint);
            }
        }
        for (of, posted) in values {
            if of == Some(relation) {
                self.retract_value(posted);
            } else {
                self.change_instance(instance).values.push((of, posted));
            }
        }
    }
}

/// A place on a timeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// The timeline.
    pub timeline: TimelineId,
    /// After which of its tokens; before all, if none.
    pub after: Option<TokenId>,
}
