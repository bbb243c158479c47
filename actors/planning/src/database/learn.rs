//! What an executive learns for good: a known time needs no point, a known value no variable.

use smallvec::SmallVec;

use super::trail::Change;
use super::{Conflict, Database, Owner, Time, TokenId};
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
                database.set_finish(token, Time::At(tick));
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
        let mut shared = false;
        for ((place, &operand), &value) in at.parameters.iter().enumerate().skip(from).zip(values) {
            if let Operand::Variable(variable) = operand
                && self.store.is_apart(variable)
                && self.store.domain(variable).contains(value)
                && known.iter().all(|other| other.variable != variable)
            {
                let others = self.holders[variable.index()] - 1;
                shared |= others > 0;
                known.push(Known {
                    place,
                    variable,
                    value,
                    others,
                });
            }
        }
        if shared {
            let variables = at.instances.iter().flat_map(|&instance| {
                let variables = self.instance_at(instance).variables.iter();
                variables.copied().flatten()
            });
            let elsewhere = at.parameters.iter().copied().enumerate();
            let all = elsewhere.map(|(place, operand)| (Some(place), operand));
            for (place, operand) in all.chain(variables.map(|operand| (None, operand))) {
                if let Operand::Variable(variable) = operand
                    && let Some(one) = known.iter_mut().find(|one| one.variable == variable)
                    && place != Some(one.place)
                {
                    one.others -= 1;
                }
            }
            known.retain(|one| one.others == 0);
        }
        known
    }

    /// Values stand where variables of a token alone did.
    fn make_known(&mut self, token: TokenId, known: &[Known]) {
        for one in known {
            let (place, value) = (one.variable.index(), Operand::Value(one.value));
            if self.holders[place] == 1 {
                self.set_parameter(token, one.place, value);
            } else {
                self.replace(token, one.variable.into(), value);
            }
            while let Some(instance) = self.watchers.get_mut(place).and_then(Vec::pop) {
                let at = self.watchers[place].len();
                self.note(Change::Unwatched(place, at, instance));
                if !self.told.contains(&instance) {
                    self.told.push(instance);
                }
            }
            self.note(Change::Held(place, self.holders[place]));
            self.holders[place] = 0;
            self.store.remove(one.variable);
        }
    }

    /// Puts an operand where another stands in a token and its rules.
    fn replace(&mut self, token: TokenId, old: Operand, new: Operand) {
        for place in 0..self.at(token).parameters.len() {
            if self.at(token).parameters[place] == old {
                self.set_parameter(token, place, new);
            }
        }
        for place in 0..self.at(token).instances.len() {
            let instance = self.at(token).instances[place];
            if self.instance_at(instance).variables.contains(&Some(old)) {
                let variables = self.change_instance(instance).variables.iter_mut();
                variables
                    .filter(|at| **at == Some(old))
                    .for_each(|at| *at = Some(new));
            }
        }
    }
}

/// A variable in whose place a value stands from now on.
#[derive(Clone, Copy, Debug)]
struct Known {
    /// A place that it has among the token's parameters.
    place: usize,
    variable: Variable,
    value: Value,
    /// How many hold it but that place, the token's others and its rules.
    others: u32,
}
