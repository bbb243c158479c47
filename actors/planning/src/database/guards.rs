//! Whether rules hold: guards that are asked, and asked again when what they speak of changes.

use smallvec::SmallVec;

use super::rules::{Guard, Instance};
use super::trail::Change;
use super::{Conflict, Database, InstanceId, Owner};
use crate::model::{Argument, End, Operand as Term, Relationship};
use crate::parameters::{self, Operand};

impl Database {
    /// Asks to be told of all that the guard speaks of.
    pub(super) fn watch_guard(&mut self, instance: InstanceId) -> Result<(), Conflict> {
        let rule = self.instance_at(instance).rule;
        if self.flats[rule].unguarded {
            return Ok(());
        }
        let master = self.instance_at(instance).master;
        for place in 0..self.flats[rule].guarding.len() {
            let place = self.flats[rule].guarding[place];
            let operand = self.at(master).parameters[place];
            self.watch(instance, operand);
        }
        if self.model.rules[rule].when.is_empty() {
            return Ok(());
        }
        let model = self.model.clone();
        let rule = &model.rules[rule];
        for term in rule.when.iter().flat_map(|when| &when.operands) {
            let operand = match *term {
                Term::Value(_) => continue,
                Term::Variable(variable) => self.named(self.instance_at(instance), variable),
                // Only the master is there when the guard is asked.
                Term::Start(0) => Some(self.mirror(master, Some(End::Start))?),
                Term::Finish(0) => Some(self.mirror(master, Some(End::Finish))?),
                Term::Duration(0) => Some(self.mirror(master, None)?),
                Term::Start(_) | Term::Finish(_) | Term::Duration(_) => None,
            };
            if let Some(operand) = operand {
                self.watch(instance, operand);
            }
        }
        Ok(())
    }

    pub(super) fn watch(&mut self, instance: InstanceId, operand: Operand) {
        let Operand::Variable(variable) = operand else {
            return;
        };
        if self.instance_at(instance).watched.contains(&variable) {
            return;
        }
        let place = variable.index();
        if self.watchers.len() <= place {
            self.watchers.resize_with(place + 1, Vec::new);
        }
        self.watchers[place].push(instance);
        self.note(Change::Watched(place));
        self.change_instance(instance).watched.push(variable);
    }

    /// A rule that holds, or may, is told that variables changed: its guard is asked again, and
    /// bounds of times follow their variables.
    pub(super) fn reconsider(&mut self, instance: InstanceId) -> Result<(), Conflict> {
        let now = self.guard(instance);
        let before = self.instance_at(instance).guard;
        match (before, now) {
            (Guard::Holds, Guard::Holds) => {
                let at = self.instance_at(instance);
                if !at.effects.is_empty() {
                    self.dirty.push(at.master);
                }
                return self.follow_bounds(instance);
            }
            (Guard::Holds, _) => {
                self.set_guard(instance, now);
                self.withdraw(instance);
                return Ok(());
            }
            (_, Guard::Holds) => {
                self.set_guard(instance, now);
                return self.apply(instance);
            }
            _ => {}
        }
        if before != now {
            self.set_guard(instance, now);
        }
        Ok(())
    }

    /// What is known of a guard.
    pub(super) fn guard(&self, instance: InstanceId) -> Guard {
        let at = self.instance_at(instance);
        if self.flats[at.rule].unguarded {
            return Guard::Holds;
        }
        let rule = &self.model.rules[at.rule];
        let parameters = &self.at(at.master).parameters;
        let mut all = Guard::Holds;
        for &place in &self.flats[at.rule].guarding {
            let operand = parameters[place];
            let wanted = match rule.master.arguments[place] {
                Argument::Any => continue,
                Argument::Value(value) => Operand::Value(value),
                Argument::Variable(variable) => match self.named(at, variable) {
                    Some(wanted) => wanted,
                    None => continue,
                },
            };
            if wanted == operand {
                continue;
            }
            match self.are_equal(wanted, operand) {
                Some(true) => {}
                Some(false) => return Guard::Void,
                None => all = Guard::Waiting,
            }
        }
        for when in &rule.when {
            match self.is_certain(at, when) {
                Some(true) => {}
                Some(false) => return Guard::Void,
                None => all = Guard::Waiting,
            }
        }
        all
    }

    /// Whether two operands are certainly equal, certainly not, or neither.
    pub(super) fn are_equal(&self, one: Operand, other: Operand) -> Option<bool> {
        match (one, other) {
            (Operand::Value(value), Operand::Variable(variable))
            | (Operand::Variable(variable), Operand::Value(value)) => {
                let domain = self.store.domain(variable);
                match domain.value() {
                    Some(is) => Some(is == value),
                    None => (!domain.contains(value)).then_some(false),
                }
            }
            _ => {
                let equal = [one, other];
                self.store.entailed(&parameters::Kind::Equal, &equal)
            }
        }
    }

    /// Whether a relationship certainly holds, certainly does not, or neither.
    fn is_certain(&self, at: &Instance, when: &Relationship) -> Option<bool> {
        let mut operands: SmallVec<[Operand; 4]> = SmallVec::new();
        for term in &when.operands {
            operands.push(match *term {
                Term::Value(value) => Operand::Value(value),
                Term::Variable(variable) => self.named(at, variable)?,
                Term::Start(label) => self.mirrored_by(at.label(label)?, Some(End::Start))?,
                Term::Finish(label) => self.mirrored_by(at.label(label)?, Some(End::Finish))?,
                Term::Duration(label) => self.mirrored_by(at.label(label)?, None)?,
            });
        }
        self.store.entailed(&self.kind(when), &operands)
    }

    /// Whether a relationship of a rule that holds certainly does not hold.
    pub(super) fn is_broken(&self, at: &Instance, said: &Relationship) -> bool {
        let operands: Option<SmallVec<[Operand; 4]>> = { said.operands.iter() }
            .map(|term| match *term {
                Term::Value(value) => Some(Operand::Value(value)),
                Term::Variable(variable) => at.variable(variable),
                _ => None,
            })
            .collect();
        operands.is_some_and(|all| self.store.entailed(&self.kind(said), &all) == Some(false))
    }

    /// Whether variables changed that nobody was told of.
    pub(super) fn has_news(&self) -> bool {
        self.store.has_changed() || !self.told.is_empty() || !self.equalities.is_empty()
    }

    /// Variables changed: whoever watches them is told, until nothing changes any more.
    pub(super) fn settle_values(&mut self) -> Result<(), Conflict> {
        let mut changed = std::mem::take(&mut self.changed);
        let outcome = loop {
            changed.clear();
            self.store.take_changed(&mut changed);
            changed.append(&mut self.equalities);
            if changed.is_empty() && self.told.is_empty() {
                break Ok(());
            }
            if let Err(conflict) = self.tell(&changed) {
                break Err(conflict);
            }
        };
        self.changed = changed;
        outcome
    }

    /// Posts a constraint of values.
    pub(super) fn post_value(
        &mut self,
        kind: parameters::Kind,
        operands: &[Operand],
        owner: Owner,
    ) -> Result<parameters::Constraint, Conflict> {
        let equal = matches!(kind, parameters::Kind::Equal);
        let posted = self.store.post(kind, operands, owner)?;
        if equal {
            self.note_equality(posted);
        }
        Ok(posted)
    }

    /// Whether two variables are equal can change while none of their values does: who watches one
    /// that an equality makes equal to others, or did, is told too.
    pub(super) fn note_equality(&mut self, constraint: parameters::Constraint) {
        if self.watchers.is_empty()
            || !matches!(self.store.kind(constraint), Some(parameters::Kind::Equal))
        {
            return;
        }
        let mut told = std::mem::take(&mut self.equalities);
        let mut at = told.len();
        let add = |operand: Operand, told: &mut Vec<parameters::Variable>| {
            if let Operand::Variable(variable) = operand
                && !told.contains(&variable)
            {
                told.push(variable);
            }
        };
        for operand in self.store.operands(constraint) {
            add(operand, &mut told);
        }
        while at < told.len() {
            // What has a value tells by that.
            if self.store.value(told[at]).is_none() {
                for other in self.store.constraints_of(told[at]) {
                    if matches!(self.store.kind(other), Some(parameters::Kind::Equal)) {
                        for operand in self.store.operands(other) {
                            add(operand, &mut told);
                        }
                    }
                }
            }
            at += 1;
        }
        self.steps += told.len() as u64;
        self.equalities = told;
    }

    fn tell(&mut self, changed: &[parameters::Variable]) -> Result<(), Conflict> {
        // Each once, however many of its variables changed.
        let mut watchers: SmallVec<[InstanceId; 16]> = SmallVec::new();
        watchers.extend(self.told.drain(..));
        for &variable in changed {
            let all = self.watchers.get(variable.index());
            for &instance in all.map_or(&[][..], |all| all) {
                if !watchers.contains(&instance) {
                    watchers.push(instance);
                }
            }
            if !self.mirrors.is_empty() {
                self.follow_mirrors(variable)?;
            }
        }
        for instance in watchers {
            // It may be gone by what those before it do.
            if self.instances.get(instance).is_some() {
                self.reconsider(instance)?;
            }
        }
        Ok(())
    }
}
