//! The past is deleted: section 4 of the IDEA paper found that cycles grow without it.

use super::{Database, Owner, Status, Time, TokenId};
use crate::Ticks;
use crate::model::End;
use crate::parameters::{Domain, Operand};
use crate::temporal::Point;

impl Database {
    /// Deletes what ended before a tick, or at it, keeping on each timeline the token that lasts
    /// then, or starts then, and the one before it. What later tokens know from it they know
    /// still: bounds of times and values that rested on it stay, owned by [`Owner::Past`].
    ///
    /// Deletes only tokens whose times are known; gives how many it deleted.
    ///
    /// # Panics
    ///
    /// If a push is not undone or committed.
    pub fn forget(&mut self, before: Ticks) -> usize {
        assert_eq!(self.depth(), 0, "no push is left");
        let mut forgotten = 0;
        for timeline in 0..self.lanes.len() {
            while let Some(first) = self.lanes[timeline].first {
                if !self.is_past(first, before) {
                    break;
                }
                // The one before the token that lasts now stays.
                let Some(second) = self.at(first).after else {
                    break;
                };
                let second_is_past =
                    self.is_past(second, before) && self.at(second).after.is_some();
                if !second_is_past {
                    break;
                }
                self.delete_past(first);
                forgotten += 1;
            }
        }
        forgotten
    }

    /// Whether a token ended at a tick or before, for certain, and when it did.
    fn is_past(&self, token: TokenId, tick: Ticks) -> bool {
        let (start, finish) = (self.start(token), self.finish(token));
        finish.max <= tick && finish.min == finish.max && start.min == start.max
    }

    /// Deletes a token of the past: later ones keep what rested on it.
    fn delete_past(&mut self, token: TokenId) {
        let times = [End::Start, End::Finish].map(|end| self.time(token, end));
        for time in times {
            if let Time::Point(point) = time {
                self.freeze_neighbours(point);
            }
        }
        let at = self.at(token).clone();
        for &instance in &at.instances {
            self.freeze_values(instance);
            self.forget_instance(instance);
        }
        for &(instance, _) in &at.supported {
            // Who asked for it has it: the label is of a token that was.
            let step = self
                .instance_at(instance)
                .labels
                .iter()
                .position(|&at| at == Some(token));
            debug_assert!(step.is_some(), "the label was given to the token");
        }
        self.change(token).instances.clear();
        self.change(token).supported.clear();
        if let Some(order) = self.at(token).order {
            self.change(token).order = None;
            self.network.retract(order);
        }
        // The next one is the first: what held it after this one is in its own bounds.
        let (Some(timeline), after) = (at.timeline, at.after) else {
            return;
        };
        if let Some(after) = after {
            if let Some(order) = self.at(after).order {
                self.change(after).order = None;
                self.network.retract(order);
            }
            self.change(after).before = None;
        }
        let lane = self.change_lane(timeline);
        lane.first = after;
        lane.tokens -= 1;
        let now = self.change(token);
        now.status = Status::Rejected;
        now.before = None;
        now.after = None;
        self.remove(token);
    }

    /// Points that are bound to one whose time is known are bound to that time instead.
    fn freeze_neighbours(&mut self, point: Point) {
        let tick = self.network.bounds(point).min;
        let origin = self.network.origin();
        for constraint in self.network.constraints_of(point) {
            let Some((from, to, span)) = self.network.constraint(constraint) else {
                continue;
            };
            let (other, from, to) = match (from == point, to == point) {
                (true, false) => (to, Time::At(tick), Time::Point(to)),
                (false, true) => (from, Time::Point(from), Time::At(tick)),
                _ => continue,
            };
            if other == origin {
                continue;
            }
            let kept = self.between(from, to, span, Owner::Past);
            debug_assert!(kept.is_ok(), "it held before");
        }
    }

    /// Variables that others have too keep the values that rules of the past gave them.
    fn freeze_values(&mut self, instance: super::InstanceId) {
        let at = self.instance_at(instance).clone();
        for operand in at.variables.iter().copied().flatten() {
            let Operand::Variable(variable) = operand else {
                continue;
            };
            let mine = at.variables.iter().flatten().filter(|&&at| at == operand);
            let mine = mine.count() as u32;
            let master = self.at(at.master).parameters.iter();
            let masters = master.filter(|&&at| at == operand).count() as u32;
            if self.holders[variable.index()] > mine + masters {
                let domain: Domain = self.store.domain(variable).clone();
                let kept = self.store.restrict(variable, domain, Owner::Past);
                debug_assert!(kept.is_ok(), "these are its values");
            }
        }
    }

    /// An instance of the past goes; tokens that it asked for stay.
    fn forget_instance(&mut self, instance: super::InstanceId) {
        let at = self.instance_at(instance).clone();
        for label in at.labels.iter().skip(1).copied().flatten() {
            if let Some(token) = self.tokens.get(label)
                && let Some(place) = token.supported.iter().position(|at| at.0 == instance)
            {
                let token = self.change(label);
                token.supported.remove(place);
                token.supports -= 1;
            }
        }
        self.change_instance(instance).labels.truncate(1);
        self.remove_instance(instance);
    }
}
