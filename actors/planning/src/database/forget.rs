//! The past is deleted: section 4 of the IDEA paper found that cycles grow without it.

use smallvec::SmallVec;

use super::{Database, Guard, InstanceId, Owner, Status, Time, TokenId};
use crate::Ticks;
use crate::model::Target;
use crate::parameters::{Domain, Kind, Operand, Store, Variable};
use crate::temporal::{Point, Span};

impl Database {
    /// Deletes what ended before a tick, or at it, keeping on each timeline the token that lasts
    /// then, or starts then, and the one before it. What later tokens know from it they know
    /// still: bounds of times and values that rested on it stay, owned by [`Owner::Past`], and
    /// levels of resources from that tick on are as before.
    ///
    /// Deletes only tokens whose times are known, and whose effects are; gives how many it
    /// deleted.
    ///
    /// # Panics
    ///
    /// If a push is not undone or committed.
    pub fn forget(&mut self, before: Ticks) -> usize {
        assert_eq!(self.depth(), 0, "no push is left");
        self.refresh();
        let mut forgotten = 0;
        self.take(|database| {
            for timeline in 0..database.lanes.len() {
                while let Some(first) = database.next_past(timeline, before) {
                    database.delete_past(first, before);
                    forgotten += 1;
                }
            }
        });
        forgotten
    }

    /// The first token of a timeline, if it and the one after it are past.
    fn next_past(&self, timeline: usize, before: Ticks) -> Option<TokenId> {
        // The one before the token that lasts now stays, and so does the last one.
        let lane = self.lanes[timeline];
        if lane.tokens < 3 {
            return None;
        }
        let first = lane.first?;
        let second = self.at(first).after?;
        self.at(second).after?;
        let past = self.is_past(first, before) && self.is_past(second, before);
        (past && self.may_go(first, before)).then_some(first)
    }

    /// Whether a token ended at a tick or before, for certain, and when it did.
    fn is_past(&self, token: TokenId, tick: Ticks) -> bool {
        let finish = self.finish(token);
        finish.max <= tick && finish.min == finish.max && {
            let start = self.start(token);
            start.min == start.max
        }
    }

    /// Whether nothing of the past of a token is still to come: what it does to resources is over,
    /// and no relation that waits speaks of it.
    fn may_go(&self, token: TokenId, before: Ticks) -> bool {
        let at = self.at(token);
        let over = |&instance: &InstanceId| {
            let effects = &self.instance_at(instance).effects;
            effects
                .iter()
                .all(|&effected| self.is_over(effected, before))
        };
        let speaks = |&(instance, relation): &(InstanceId, u32)| {
            let relations = &self.flats[self.instance_at(instance).rule].relations;
            let Target::New(_, mine) = relations[relation as usize].target else {
                return false;
            };
            let of_it = |open: &super::Open| {
                open.instance == instance
                    && match open.step {
                        super::Step::Choice(_) => true,
                        super::Step::Relation(at) => {
                            let said = &relations[at as usize];
                            said.anchor == mine
                                || matches!(said.target, Target::Label(label) if label == mine)
                        }
                    }
            };
            let nested = relations.iter().any(|said| {
                said.anchor == mine || matches!(said.target, Target::Label(label) if label == mine)
            });
            nested && self.open.iter().any(of_it)
        };
        at.instances.iter().all(over) && !at.supported.iter().any(speaks)
    }

    /// Deletes a token of the past: later ones keep what rested on it.
    fn delete_past(&mut self, token: TokenId, before: Ticks) {
        // All that rests on what goes is kept before anything of it does.
        self.freeze_times(token);
        let going = if self.has_variables(token) {
            self.freeze_values(token)
        } else {
            SmallVec::new()
        };
        if !self.at(token).merged.is_empty() {
            self.delete_merged(token);
        }
        if !going.is_empty() {
            self.store.remove_all(&going);
        }
        for instance in std::mem::take(&mut self.change(token).instances) {
            self.forget_instance(instance, before);
        }
        let at = self.change(token);
        // Who asked for it has it: the label is of a token that was.
        at.supported.clear();
        let parameters = std::mem::take(&mut at.parameters);
        let (order, timeline, after) = (at.order.take(), at.timeline, at.after);
        at.status = Status::Rejected;
        (at.before, at.after) = (None, None);
        for operand in parameters {
            if let Operand::Variable(variable) = operand {
                drop_holder(&mut self.holders, &mut self.store, variable);
            }
        }
        if let Some(order) = order {
            self.retract_time(order);
        }
        // The next one is the first: what held it after this one is in its own bounds.
        if let Some(after) = after {
            let next = self.change(after);
            next.before = None;
            if let Some(order) = next.order.take() {
                self.retract_time(order);
            }
        }
        if let Some(timeline) = timeline {
            let lane = self.change_lane(timeline);
            lane.first = after;
            lane.tokens -= 1;
        }
        self.delete(token);
    }

    /// Whether a token or a rule of it has variables.
    fn has_variables(&self, token: TokenId) -> bool {
        let is_variable = |operand: &Operand| matches!(operand, Operand::Variable(_));
        let at = self.at(token);
        at.parameters.iter().any(is_variable)
            || at.instances.iter().any(|&instance| {
                let mut variables = self.instance_at(instance).variables.iter().flatten();
                variables.any(is_variable)
            })
    }

    /// Deletes what is merged into a token of the past.
    fn delete_merged(&mut self, token: TokenId) {
        let merged = self.at(token).merged.clone();
        for &other in &merged {
            self.freeze_times(other);
            self.freeze_values(other);
        }
        for other in merged {
            self.part(other, token);
            self.delete(other);
        }
    }

    /// Points that are bound to a token whose times are known are bound to these times instead.
    fn freeze_times(&mut self, token: TokenId) {
        let at = self.at(token);
        for time in [at.start, at.finish] {
            if let Time::Point(point) = time
                && !self.network.is_apart(point)
            {
                self.freeze_neighbours(point);
            }
        }
    }

    fn freeze_neighbours(&mut self, point: Point) {
        let tick = self.network.bounds(point).min;
        let origin = self.network.origin();
        for constraint in self.network.constraints_of(point) {
            let Some((from, to, span)) = self.network.constraint(constraint) else {
                continue;
            };
            let (other, span) = match (from == point, to == point) {
                (true, false) => (to, span),
                (false, true) => (from, span.negated()),
                _ => continue,
            };
            if other == origin {
                continue;
            }
            let later = |bound: Ticks| match bound {
                Ticks::MIN | Ticks::MAX => bound,
                bound => bound.saturating_add(tick),
            };
            let span = Span::new(later(span.min), later(span.max));
            // One constraint of a point is of the past, however much of it there was.
            let past = self.network.constraints_of(other).into_iter();
            let past = past.filter(|&at| self.network.owner(at) == Some(&Owner::Past));
            let kept = match past.min() {
                Some(past) => self.network.tighten(past, span),
                None => {
                    let kept = self.network.constrain(origin, other, span, Owner::Past);
                    kept.map(|_| ())
                }
            };
            debug_assert!(kept.is_ok(), "it held before");
        }
    }

    /// Variables that others have too keep the values that the past gave them; gives those that
    /// nobody else has.
    fn freeze_values(&mut self, token: TokenId) -> SmallVec<[Variable; 16]> {
        let mut mine: SmallVec<[Variable; 16]> = SmallVec::new();
        let at = self.at(token);
        let variables = at.instances.iter().flat_map(|&instance| {
            let at = self.instance_at(instance);
            at.variables.iter().copied().flatten()
        });
        for operand in at.parameters.iter().copied().chain(variables) {
            if let Operand::Variable(variable) = operand {
                mine.push(variable);
            }
        }
        mine.sort_unstable();
        let mut kept: SmallVec<[Variable; 8]> = SmallVec::new();
        let mut going: SmallVec<[Variable; 16]> = SmallVec::new();
        let mut equal: SmallVec<[[Operand; 2]; 4]> = SmallVec::new();
        for run in mine.chunk_by(|one, other| one == other) {
            let variable = run[0];
            if self.holders[variable.index()] > run.len() as u32 {
                kept.push(variable);
                continue;
            }
            going.push(variable);
            // What it is equal to is somebody else's.
            let first = kept.len();
            for constraint in self.store.constraints_of(variable) {
                if matches!(self.store.kind(constraint), Some(Kind::Equal)) {
                    let others = self.store.operands(constraint);
                    kept.extend(others.filter_map(|other| match other {
                        Operand::Variable(other) if mine.binary_search(&other).is_err() => {
                            Some(other)
                        }
                        _ => None,
                    }));
                }
            }
            // And they are equal without it.
            if self.store.value(variable).is_none() {
                let pairs = kept[first..].windows(2);
                equal.extend(pairs.map(|pair| [pair[0].into(), pair[1].into()]));
            }
        }
        for pair in equal {
            let kept = self.store.post(Kind::Equal, &pair, Owner::Past);
            debug_assert!(kept.is_ok(), "they were equal before");
        }
        for variable in kept {
            self.keep_values(variable);
        }
        going
    }

    /// A variable has no values but those that it has now, whoever goes.
    fn keep_values(&mut self, variable: Variable) {
        let domain: Domain = self.store.domain(variable).clone();
        let is_past = |&at: &_| self.store.owner(at) == Some(&Owner::Past);
        let past = self.store.constraints_of(variable).find(is_past);
        if let Some(past) = past {
            if matches!(self.store.kind(past), Some(Kind::In(kept)) if *kept == domain) {
                return;
            }
            self.store.retract(past);
        }
        let kept = self.store.restrict(variable, domain, Owner::Past);
        debug_assert!(kept.is_ok(), "these are its values");
    }

    /// An instance of the past goes; tokens that it asked for stay.
    fn forget_instance(&mut self, instance: InstanceId, before: Ticks) {
        for label in 1..self.instance_at(instance).labels.len() {
            let token = self.instance_at(instance).labels[label];
            if let Some(token) = token
                && let Some(at) = self.tokens.get(token)
                && let Some(place) = at.supported.iter().position(|at| at.0 == instance)
            {
                let at = self.change(token);
                at.supported.remove(place);
                at.supports -= 1;
            }
        }
        let at = self.change_instance(instance);
        let holds = at.guard == Guard::Holds;
        let effects = std::mem::take(&mut at.effects);
        for effected in effects {
            self.forget_effect(effected, before);
        }
        let at = self.instances.get(instance).expect("the instance is there");
        for variable in &at.watched {
            self.watchers[variable.index()].retain(|&at| at != instance);
        }
        // What it says of times and values of others stays with them.
        for &operand in at.variables.iter().flatten() {
            if let Operand::Variable(variable) = operand {
                drop_holder(&mut self.holders, &mut self.store, variable);
            }
        }
        self.instances.discard(instance);
        if holds {
            self.open.retain(|open| open.instance != instance);
        }
    }
}

/// Counts one less who has a variable. If nobody else has it, it is gone already, but for one
/// whose other holders went with this one.
fn drop_holder(holders: &mut [u32], store: &mut Store<Owner>, variable: Variable) {
    let holders = &mut holders[variable.index()];
    *holders -= 1;
    if *holders == 0 && store.has(variable) {
        store.remove(variable);
    }
}
