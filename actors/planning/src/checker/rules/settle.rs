//! The values of a rule: what its relationships, bounds and effects make of its variables.

use super::super::relationships::{Verdict, implied, judge};
use super::{Search, Spot, State, Why, is_within};
use crate::model::{Bound, Effect, Operand, Position, Relationship, Value, Values, VariableId};
use crate::plan::{PlanEffectKind, place};

/// The most values of a type that are tried one by one.
const MAX_VALUES: i64 = 4_096;

impl<'a> Search<'a, '_> {
    /// Whether the rule's `when` is certain: with what its functions and sums give, but without
    /// values for arguments that are not bound.
    pub(super) fn is_certain(&self, state: &mut State<'a>) -> bool {
        let rule = self.rule;
        loop {
            let (mut changed, mut all) = (false, true);
            for of in &rule.when {
                let operands = self.operands(state, of);
                let verdict = operands.as_ref().map(|values| self.judge(of, values));
                if verdict == Some(Verdict::Holds) {
                    continue;
                }
                all = false;
                let Some(values) = operands else { return false };
                for (place, value) in implied(self.scene.model, of.kind, &values) {
                    let Operand::Variable(variable) = of.operands[place] else {
                        continue;
                    };
                    if !state.bindings.open[variable] {
                        changed |= state.bindings.values[variable].is_none();
                        if !self.bind(state, variable, value) {
                            return false;
                        }
                    }
                }
            }
            if all || !changed {
                return all;
            }
        }
    }

    /// Gives variables the values that relationships leave them.
    ///
    /// # Errors
    ///
    /// The relationship that cannot hold.
    pub(super) fn propagate(&self, state: &mut State<'a>) -> Result<(), Why<'a>> {
        let rule = self.rule;
        loop {
            let mut changed = false;
            for of in &rule.relationships {
                let Some(values) = self.operands(state, of) else {
                    continue;
                };
                match self.judge(of, &values) {
                    Verdict::Holds | Verdict::Silent => continue,
                    Verdict::Fails => return Err(Why::Values(of)),
                    Verdict::Open => {}
                }
                for (place, value) in implied(self.scene.model, of.kind, &values) {
                    let Operand::Variable(variable) = of.operands[place] else {
                        continue;
                    };
                    changed |= state.bindings.values[variable].is_none();
                    if !self.bind(state, variable, value) {
                        return Err(Why::Values(of));
                    }
                }
            }
            if !changed {
                return Ok(());
            }
        }
    }

    /// Finds the listed effect for each effect of the rule, and then settles its values.
    pub(super) fn effects(&mut self, state: &State<'a>) -> bool {
        let rule = self.rule;
        let Some(effect) = rule.effects.get(state.effects.len()) else {
            return self.settle(state.clone());
        };
        let seen = &self.scene.tokens[self.master];
        let (at, does) = (place(self.scene.model, effect.position), effect.kind.into());
        let mut any = false;
        for (index, listed) in seen.token.effects.iter().enumerate() {
            let is_it = !self.used[index]
                && !state.effects.contains(&Some(index))
                && listed.does == does
                && listed.place == at
                && seen.resources[index].is_some_and(|id| effect.resources.contains(&id));
            if !is_it {
                continue;
            }
            let mut next = state.clone();
            next.effects.push(Some(index));
            let is_amount = match effect.amount {
                Bound::None => false,
                Bound::Value(amount) => amount == listed.amount,
                Bound::Variable(variable) => self.bind(&mut next, variable, listed.amount),
            };
            self.steps += 1;
            if !is_amount || listed.amount < 0 {
                continue;
            }
            any = true;
            if self.effects(&next) {
                return true;
            }
        }
        // What does nothing need not be listed.
        let mut next = state.clone();
        next.effects.push(None);
        let does_nothing = match effect.amount {
            Bound::None => false,
            Bound::Value(amount) => amount == 0,
            Bound::Variable(variable) => self.bind(&mut next, variable, 0),
        };
        if does_nothing && self.effects(&next) {
            return true;
        }
        match any || does_nothing {
            true => false,
            false => self.fail(state, Why::Effect(effect)),
        }
    }

    /// Whether there are values for all variables such that everything holds.
    fn settle(&mut self, mut state: State<'a>) -> bool {
        loop {
            if let Err(why) = self.propagate(&mut state) {
                return self.fail(&state, why);
            }
            match self.exact_bounds(&mut state) {
                None => return self.fail(&state, Why::Unknown(self.rule.position)),
                Some(true) => {}
                Some(false) => break,
            }
        }
        let undecided = match self.undecided(&state) {
            Ok(undecided) => undecided,
            Err(why) => return self.fail(&state, why),
        };
        let unknown = undecided
            .iter()
            .flat_map(|(variables, _)| variables.iter().copied());
        for variable in unknown {
            if let Some(values) = self.domain(variable) {
                return values.into_iter().any(|value| {
                    self.steps += 1;
                    let mut next = state.clone();
                    self.steps < super::MAX_STEPS
                        && self.bind(&mut next, variable, value)
                        && self.settle(next)
                });
            }
        }
        // What is left speaks of numbers without end.
        let is_excused = |variables: &[VariableId]| {
            let is_open = variables
                .iter()
                .any(|&variable| state.bindings.open[variable]);
            is_open || state.labels.contains(&Spot::Outside)
        };
        let left = undecided
            .iter()
            .find(|(variables, _)| !is_excused(variables));
        if let Some(&(_, position)) = left {
            return self.fail(&state, Why::Unknown(position));
        }
        for index in state.effects.into_iter().flatten() {
            self.used[index] = true;
        }
        true
    }

    /// Gives a variable that is both bounds of a duration or a distance the value it must have:
    /// whether there was one without; none if the value is not of its type.
    fn exact_bounds(&self, state: &mut State<'a>) -> Option<bool> {
        let tokens = &self.scene.tokens;
        let lasts = tokens[self.master].token.end - tokens[self.master].token.start;
        let duration = self.rule.duration.map(|bounds| (bounds, lasts));
        let distances = state.deferred.iter().map(|&(_, distance, anchor, target)| {
            let is = super::apart(distance, &tokens[anchor], &tokens[target]);
            ([distance.min, distance.max], is)
        });
        let all: Vec<_> = duration.into_iter().chain(distances).collect();
        let mut changed = false;
        for (bounds, is) in all {
            if let [Bound::Variable(min), Bound::Variable(max)] = bounds
                && min == max
                && state.bindings.values[min].is_none()
            {
                changed = true;
                if !self.bind(state, min, is) {
                    return None;
                }
            }
        }
        Some(changed)
    }

    /// What is not decided, each with the variables that it waits for and where it stands.
    ///
    /// # Errors
    ///
    /// What does not hold.
    fn undecided(&self, state: &State<'a>) -> Result<Vec<(Vec<VariableId>, Position)>, Why<'a>> {
        let rule = self.rule;
        let mut undecided = Vec::new();
        let is_unknown = |variable: VariableId| state.bindings.values[variable].is_none();
        let of_bounds = |bounds: [Bound; 2]| -> Vec<VariableId> {
            let variables = bounds.into_iter().filter_map(|bound| match bound {
                Bound::Variable(variable) if is_unknown(variable) => Some(variable),
                _ => None,
            });
            variables.collect()
        };
        for of in &rule.relationships {
            let Some(values) = self.operands(state, of) else {
                continue;
            };
            if self.judge(of, &values) == Verdict::Open {
                let variables = of.operands.iter().filter_map(|operand| match *operand {
                    Operand::Variable(variable) if is_unknown(variable) => Some(variable),
                    _ => None,
                });
                undecided.push((variables.collect(), of.position));
            }
        }
        if let Some(bounds) = rule.duration {
            let token = self.scene.tokens[self.master].token;
            let known = self.bounds(state, bounds);
            match is_within(token.end - token.start, known) {
                Some(true) => {}
                Some(false) => {
                    let [min, max] = known.map(Option::flatten);
                    return Err(Why::Lasts(min, max));
                }
                None => undecided.push((of_bounds(bounds), rule.position)),
            }
        }
        for &(relation, distance, anchor, target) in &state.deferred {
            match self.is_apart(state, distance, anchor, target) {
                Some(true) => {}
                Some(false) => return Err(Why::Apart(relation)),
                None => {
                    undecided.push((of_bounds([distance.min, distance.max]), relation.position));
                }
            }
        }
        for &(relation, anchor) in &state.outside {
            match self.is_outside(state, relation, anchor) {
                Some(true) => {}
                Some(false) => return Err(Why::NoTarget(relation)),
                None => {
                    let bounds = relation.distances.iter().map(|at| [at.min, at.max]);
                    let variables: Vec<Vec<VariableId>> = bounds.map(of_bounds).collect();
                    undecided.push((variables.concat(), relation.position));
                }
            }
        }
        Ok(undecided)
    }

    /// The values of a variable's type, if they are not too many to try.
    fn domain(&self, variable: VariableId) -> Option<Vec<Value>> {
        match &self.scene.model.types[self.rule.variables[variable].of].values {
            Values::Truth => Some(vec![0, 1]),
            Values::Symbols(symbols) => Some(symbols.clone()),
            Values::Numbers(span) if span.max.saturating_sub(span.min) < MAX_VALUES => {
                Some((span.min..=span.max).collect())
            }
            Values::Numbers(_) => None,
        }
    }

    /// Gives a variable a value of its type; false if it has another or it is not of its type.
    fn bind(&self, state: &mut State<'a>, variable: VariableId, value: Value) -> bool {
        let of = self.rule.variables[variable].of;
        self.scene.is_of(of, value) && state.bindings.bind(variable, value)
    }

    fn judge(&self, of: &Relationship, values: &[Option<Value>]) -> Verdict {
        judge(self.scene.model, of.kind, values)
    }

    /// What a relationship speaks of; none if that includes a token which is not there.
    fn operands(&self, state: &State<'a>, of: &Relationship) -> Option<Vec<Option<Value>>> {
        let token = |label: usize| match state.labels.get(label) {
            Some(&Spot::Token(index)) => Some(self.scene.tokens[index].token),
            _ => None,
        };
        let values = of.operands.iter().map(|operand| {
            Some(match *operand {
                Operand::Value(value) => Some(value),
                Operand::Variable(variable) => state.bindings.values[variable],
                Operand::Start(label) => Some(token(label)?.start),
                Operand::Finish(label) => Some(token(label)?.end),
                Operand::Duration(label) => token(label)
                    .map(|token| token.end - token.start)
                    .map(Some)?,
            })
        });
        values.collect()
    }
}

/// What an effect does, in a word.
pub(super) fn does(effect: &Effect) -> &'static str {
    match effect.kind.into() {
        PlanEffectKind::Uses => "uses",
        PlanEffectKind::Consumes(_) => "consumes",
        PlanEffectKind::Produces(_) => "produces",
    }
}
