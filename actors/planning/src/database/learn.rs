//! What an executive learns for good: a known time needs no point, a known value no variable.

use smallvec::SmallVec;

use super::trail::Change;
use super::{Conflict, Database, InstanceId, Owner, Time, TokenId};
use crate::Ticks;
use crate::model::{End, Value};
use crate::parameters::{Operand, Variable};
use crate::temporal::Span;

impl Database {
    /// Says that a token ends at a tick, as an executive learns it, and for good.
    ///
    /// # Errors
    ///
    /// If it cannot end then: nothing changes.
    pub fn end(&mut self, token: TokenId, tick: Ticks) -> Result<(), Conflict> {
        let owner = Owner::Token(token);
        let expected = self.finish(token);
        if let Time::Point(point) = self.at(token).finish
            && expected.contains(tick)
            && self.network.is_apart(point)
        {
            // Nothing but known times says when it ends, and now that is one itself.
            return self.attempt(|database| {
                database.network.remove_point(point);
                database.change(token).finish = Time::At(tick);
                database.dirty_if_used(token);
                database.loosened = true;
                Ok(())
            });
        }
        self.restrict_time(token, End::Finish, Span::exactly(tick), owner)
    }

    /// Says which values parameters of a token have, from the one in place `from` on, as an
    /// executive learns it, and for good: what was a variable of this token alone, and of no
    /// constraint, is a value then.
    ///
    /// # Errors
    ///
    /// If one cannot have its value: nothing changes.
    ///
    /// # Panics
    ///
    /// If the token is not there or has fewer parameters.
    pub fn learn(&mut self, token: TokenId, from: usize, values: &[Value]) -> Result<(), Conflict> {
        self.attempt(|database| {
            let known = database.own_variables(token, from, values);
            if !known.is_empty() {
                database.make_known(token, &known);
            }
            for (place, &value) in (from..).zip(values) {
                database.bind(token, place, value, Owner::Token(token))?;
            }
            Ok(())
        })
    }

    /// The variables among a token's parameters that nothing but the token and its rules knows of
    /// and that can have the values which are learnt.
    fn own_variables(&self, token: TokenId, from: usize, values: &[Value]) -> SmallVec<[Known; 4]> {
        let at = self.at(token);
        let mut known: SmallVec<[Known; 4]> = SmallVec::new();
        for (&operand, &value) in at.parameters[from..].iter().zip(values) {
            if let Operand::Variable(variable) = operand
                && self.store.is_apart(variable)
                && self.store.domain(variable).contains(value)
                && known.iter().all(|other| other.variable != variable)
            {
                let others = self.holders[variable.index()];
                known.push(Known {
                    variable,
                    value,
                    others,
                });
            }
        }
        let variables = at.instances.iter().flat_map(|&instance| {
            let variables = self.instance_at(instance).variables.iter();
            variables.copied().flatten()
        });
        for operand in at.parameters.iter().copied().chain(variables) {
            if let Operand::Variable(variable) = operand
                && let Some(one) = known.iter_mut().find(|one| one.variable == variable)
            {
                one.others -= 1;
            }
        }
        known.retain(|one| one.others == 0);
        known
    }

    /// Values stand where variables of a token alone did.
    fn make_known(&mut self, token: TokenId, known: &[Known]) {
        let value_of = |operand: Operand| {
            let is = |one: &&Known| Operand::Variable(one.variable) == operand;
            known.iter().find(is).map(|one| Operand::Value(one.value))
        };
        let at = self.change(token);
        for operand in &mut at.parameters {
            *operand = value_of(*operand).unwrap_or(*operand);
        }
        let instances: SmallVec<[InstanceId; 4]> = SmallVec::from_slice(&at.instances);
        for instance in instances {
            // What a guard asks of a parameter it watches, be it a variable of the rule or not.
            let at = self.instance_at(instance);
            let mut has = at.variables.iter().flatten().copied();
            let mut watches = at.watched.iter().map(|&variable| variable.into());
            if !has.any(|at| value_of(at).is_some()) && !watches.any(|at| value_of(at).is_some()) {
                continue;
            }
            let at = self.change_instance(instance);
            for operand in at.variables.iter_mut().flatten() {
                *operand = value_of(*operand).unwrap_or(*operand);
            }
            let watched = at.watched.len();
            at.watched
                .retain(|at| known.iter().all(|one| one.variable != *at));
            if at.watched.len() < watched {
                self.told.push(instance);
            }
        }
        for one in known {
            let place = one.variable.index();
            while let Some(instance) = self.watchers.get_mut(place).and_then(Vec::pop) {
                let at = self.watchers[place].len();
                self.note(Change::Unwatched(place, at, instance));
            }
            self.note(Change::Held(place, self.holders[place]));
            self.holders[place] = 0;
            self.store.remove(one.variable);
        }
    }
}

/// A variable in whose place a value stands from now on.
#[derive(Clone, Copy, Debug)]
struct Known {
    variable: Variable,
    value: Value,
    /// How many hold it but the token and its rules.
    others: u32,
}
