//! Edits of tokens: they come, go on a timeline and leave it, are merged and rejected, and go.

use smallvec::SmallVec;

use super::Slot;
use super::trail::Change;
use super::{Cause, Conflict, Database, Owner, Status, Time, Token, TokenId};
use crate::Ticks;
use crate::model::{PredicateId, TimelineKind, TypeId};
use crate::parameters::{self, Domain, Operand};
use crate::temporal::Span;

/// A token that is to be.
#[derive(Clone, Debug)]
pub struct Wanted<'a> {
    /// What it says.
    pub predicate: PredicateId,
    /// The timeline on which it will be, if that is known: where exactly one token is at any
    /// time, or at most one, tokens last 1 tick at least.
    pub timeline: Option<crate::model::TimelineId>,
    /// By parameter: its value or variable; none for one that may be anything.
    pub parameters: &'a [Option<Operand>],
    /// When it starts, if that is known for good.
    pub start: Option<Time>,
    /// When it ends, if that is known for good.
    pub finish: Option<Time>,
    /// Why it is there.
    pub cause: Cause,
}

impl Database {
    /// A new token, free: it is wanted, and on no timeline yet.
    ///
    /// # Errors
    ///
    /// If a value is none that its parameter can have: nothing changes.
    ///
    /// # Panics
    ///
    /// If the predicate has another number of parameters.
    pub fn insert(&mut self, wanted: Wanted<'_>) -> Result<TokenId, Conflict> {
        self.attempt(|database| database.insert_free(&wanted))
    }

    fn insert_free(&mut self, wanted: &Wanted<'_>) -> Result<TokenId, Conflict> {
        let predicate = &self.model.predicates[wanted.predicate];
        assert_eq!(
            wanted.parameters.len(),
            predicate.parameters.len(),
            "as many parameters as {} has",
            predicate.name
        );
        let least = match wanted
            .timeline
            .map(|timeline| self.model.timelines[timeline].kind)
        {
            Some(TimelineKind::State | TimelineKind::Unary) => 1,
            Some(TimelineKind::Free) | None => 0,
        };
        let (start, finish, lasts) = self.new_times(wanted, least);
        let mut parameters: SmallVec<[Operand; 4]> = SmallVec::new();
        for (place, &known) in wanted.parameters.iter().enumerate() {
            let operand = match known {
                Some(operand) => operand,
                None => {
                    self.new_variable(self.model.predicates[wanted.predicate].parameters[place].of)
                }
            };
            self.hold(operand);
            parameters.push(operand);
        }
        let token = self.tokens.insert(Token {
            predicate: wanted.predicate,
            timeline: wanted.timeline,
            status: Status::Free,
            cause: wanted.cause,
            start,
            finish,
            parameters,
            supports: 0,
            before: None,
            after: None,
            order: None,
            orders: SmallVec::new(),
            times: SmallVec::new(),
            values: SmallVec::new(),
            instances: SmallVec::new(),
            supported: SmallVec::new(),
            merged: SmallVec::new(),
            merged_times: SmallVec::new(),
            merged_values: SmallVec::new(),
            kept: self.serial,
        });
        self.note(Change::TokenAdded(token));
        self.point_at(token, [start, finish]);
        let owner = Owner::Token(token);
        if !lasts && let Some(posted) = self.between(start, finish, Span::at_least(least), owner)? {
            self.change(token).times.push(posted);
        }
        for (place, &known) in wanted.parameters.iter().enumerate() {
            if let Some(operand) = known {
                let of = self.model.predicates[wanted.predicate].parameters[place].of;
                self.keep_to_type(token, of, operand)?;
            }
        }
        Ok(token)
    }

    /// When a token that is wanted starts and ends, and whether by that it lasts so many ticks at
    /// least.
    fn new_times(&mut self, wanted: &Wanted<'_>, least: Ticks) -> (Time, Time, bool) {
        if let (Some(start @ Time::At(tick)), None) = (wanted.start, wanted.finish) {
            let after = Span::at_least(tick.saturating_add(least));
            if let Some(finish) = self.network.add_point_within(after) {
                return (start, Time::Point(finish), true);
            }
        }
        let mut new_time = |time: Option<Time>| match time {
            Some(time) => time,
            None => Time::Point(self.network.add_point()),
        };
        (new_time(wanted.start), new_time(wanted.finish), false)
    }

    /// Where there are resources, their profiles follow the points of tokens.
    fn point_at(&mut self, token: TokenId, times: [Time; 2]) {
        if self.levels_by_resource.is_empty() {
            return;
        }
        for time in times {
            if let Time::Point(point) = time {
                let place = point.index();
                if self.token_of_point.len() <= place {
                    self.token_of_point.resize(place + 1, None);
                }
                let old = self.token_of_point[place].replace(token);
                self.note(Change::Pointed(place, old));
            }
        }
    }

    /// A parameter has values of its type only.
    fn keep_to_type(
        &mut self,
        token: TokenId,
        of: TypeId,
        operand: Operand,
    ) -> Result<(), Conflict> {
        let owner = Owner::Token(token);
        let domain = &self.domains[of];
        match operand {
            Operand::Value(value) if domain.contains(value) => Ok(()),
            Operand::Value(_) => Err(Conflict::Mismatch { owner }),
            Operand::Variable(variable) => {
                let now = self.store.domain(variable);
                if now == domain || now.intersect(domain) == *now {
                    return Ok(());
                }
                let posted = self.store.restrict(variable, domain.clone(), owner)?;
                self.change(token).values.push(posted);
                Ok(())
            }
        }
    }

    /// Puts a free token on a timeline: it is active then, and the rules of its kind hold or wait.
    ///
    /// # Errors
    ///
    /// If it cannot be there: nothing changes.
    ///
    /// # Panics
    ///
    /// If the token is not free, or the slot's token is not on the slot's timeline.
    pub fn activate(&mut self, token: TokenId, slot: Slot) -> Result<(), Conflict> {
        self.attempt(|database| database.place(token, slot))
    }

    pub(super) fn place(&mut self, token: TokenId, slot: Slot) -> Result<(), Conflict> {
        assert_eq!(self.at(token).status, Status::Free, "{token:?} is free");
        let timeline = &self.model.timelines[slot.timeline];
        let (kind, owner) = (timeline.kind, Owner::Token(token));
        if !timeline.predicates.contains(&self.at(token).predicate) {
            return Err(Conflict::Mismatch { owner });
        }
        let lane = self.lanes[slot.timeline];
        let before = match kind {
            // Nothing orders the tokens of such a timeline: the last to come is the last.
            TimelineKind::Free => lane.last,
            TimelineKind::State | TimelineKind::Unary => slot.after,
        };
        if let Some(before) = before {
            let at = self.at(before);
            assert!(
                at.status == Status::Active && at.timeline == Some(slot.timeline),
                "{before:?} is on the slot's timeline"
            );
        }
        let after = match before {
            Some(before) => self.at(before).after,
            None => lane.first,
        };
        // A token that was said to be on such a timeline lasts a tick at least already.
        let said = self
            .at(token)
            .timeline
            .map(|at| self.model.timelines[at].kind);
        let lasts_a_tick = matches!(said, Some(TimelineKind::State | TimelineKind::Unary));
        let at = self.change(token);
        at.status = Status::Active;
        at.timeline = Some(slot.timeline);
        (at.before, at.after) = (before, after);
        let lane = self.change_lane(slot.timeline);
        lane.tokens += 1;
        if before.is_none() {
            lane.first = Some(token);
        }
        if after.is_none() {
            lane.last = Some(token);
        }
        if let Some(before) = before {
            self.set_after(before, Some(token));
        }
        if let Some(after) = after {
            self.set_before(after, Some(token));
        }
        if kind != TimelineKind::Free {
            if !lasts_a_tick {
                let lasts = Span::at_least(1);
                let (start, finish) = (self.at(token).start, self.at(token).finish);
                if let Some(posted) = self.between(start, finish, lasts, owner)? {
                    self.change(token).times.push(posted);
                }
            }
            self.follow_on(before, token)?;
            if let Some(after) = after {
                self.follow_on(Some(token), after)?;
            }
        }
        self.make_instances(token)
    }

    /// Posts that a token starts when the one before it has ended, in place of what was posted
    /// for the one before that.
    fn follow_on(&mut self, first: Option<TokenId>, second: TokenId) -> Result<(), Conflict> {
        if let Some(order) = self.at(second).order {
            self.change(second).order = None;
            self.retract_time(order);
        }
        let Some(first) = first else {
            return Ok(());
        };
        let (from, to) = (self.at(first).finish, self.at(second).start);
        let owner = Owner::Sequence { first, second };
        if let Some(posted) = self.between(from, to, Span::at_least(0), owner)? {
            self.change(second).order = Some(posted);
        }
        Ok(())
    }

    /// Takes an active token off its timeline: it is free, its rules hold no more, relations that
    /// counted on it are open again.
    ///
    /// # Panics
    ///
    /// If it is not active.
    pub fn deactivate(&mut self, token: TokenId) {
        assert_eq!(self.at(token).status, Status::Active, "{token:?} is active");
        self.take(|database| database.take_off(token));
    }

    /// Moves an active token elsewhere: it leaves its timeline, with all that its rules brought,
    /// and goes where the slot is.
    ///
    /// # Errors
    ///
    /// If it cannot be there: nothing changes.
    ///
    /// # Panics
    ///
    /// If it is not active, or the slot's token is not on the slot's timeline or goes with it.
    pub fn relocate(&mut self, token: TokenId, slot: Slot) -> Result<(), Conflict> {
        self.attempt(|database| {
            database.deactivate(token);
            database.activate(token, slot)
        })
    }

    fn take_off(&mut self, token: TokenId) {
        // What goes takes others along, and they must not take this token again.
        self.change(token).status = Status::Free;
        while let Some(&instance) = self.at(token).instances.first() {
            self.change(token).instances.remove(0);
            self.remove_instance(instance);
        }
        while let Some(&(instance, relation)) = self.at(token).supported.first() {
            let at = self.change(token);
            at.supported.remove(0);
            at.supports -= 1;
            self.reopen(instance, relation);
        }
        for other in self.at(token).merged.clone() {
            self.part(other, token);
        }
        self.unlink(token);
        self.take_orders_back(token);
    }

    fn take_orders_back(&mut self, token: TokenId) {
        for posted in std::mem::take(&mut self.change(token).orders) {
            self.retract_time(posted);
        }
    }

    /// Takes a token out of its timeline's order.
    pub(super) fn unlink(&mut self, token: TokenId) {
        let (before, after) = (self.at(token).before, self.at(token).after);
        let Some(timeline) = self.at(token).timeline else {
            return;
        };
        let lane = self.change_lane(timeline);
        lane.tokens -= 1;
        match before {
            Some(before) => self.set_after(before, after),
            None => lane.first = after,
        }
        match after {
            Some(after) => self.set_before(after, before),
            None => self.lanes[timeline].last = before,
        }
        if let Some(order) = self.at(token).order {
            self.change(token).order = None;
            self.retract_time(order);
        }
        if let Some(after) = after
            && self.model.timelines[timeline].kind != TimelineKind::Free
        {
            let followed = self.follow_on(before, after);
            debug_assert!(followed.is_ok(), "the two were in this order before");
        }
        let at = self.change(token);
        (at.before, at.after) = (None, None);
    }

    /// A free token is done by an active one: parameters and times are equal.
    ///
    /// # Errors
    ///
    /// If they cannot be: nothing changes.
    ///
    /// # Panics
    ///
    /// If the one is not free or the other not active.
    pub fn merge(&mut self, token: TokenId, into: TokenId) -> Result<(), Conflict> {
        assert_eq!(self.at(token).status, Status::Free, "{token:?} is free");
        assert_eq!(self.at(into).status, Status::Active, "{into:?} is active");
        self.attempt(|database| {
            let owner = Owner::Merge(token);
            let [one, other] = [token, into].map(|token| database.at(token).clone());
            if one.predicate != other.predicate {
                return Err(Conflict::Mismatch { owner });
            }
            database.change(token).status = Status::Merged(into);
            let at = database.change(into);
            at.supports += 1;
            at.merged.push(token);
            let pairs = one.parameters.iter().zip(&other.parameters);
            for (&mine, &its) in pairs.filter(|(mine, its)| mine != its) {
                if let (Operand::Value(_), Operand::Value(_)) = (mine, its) {
                    return Err(Conflict::Mismatch { owner });
                }
                let both = [mine, its];
                let posted = database.post_value(parameters::Kind::Equal, &both, owner)?;
                database.change(token).merged_values.push(posted);
            }
            for (mine, its) in [(one.start, other.start), (one.finish, other.finish)] {
                let posted = database.between(mine, its, Span::exactly(0), owner)?;
                database.change(token).merged_times.extend(posted);
            }
            Ok(())
        })
    }

    /// Undoes a [`merge`](Self::merge), whenever it was: the token is free.
    ///
    /// # Panics
    ///
    /// If it is not merged.
    pub fn unmerge(&mut self, token: TokenId) {
        let Status::Merged(into) = self.at(token).status else {
            panic!("{token:?} is merged");
        };
        self.take(|database| database.part(token, into));
    }

    /// A token that is merged into another is free.
    pub(super) fn part(&mut self, token: TokenId, into: TokenId) {
        let at = self.change(token);
        at.status = Status::Free;
        let values = std::mem::take(&mut at.merged_values);
        let times = std::mem::take(&mut at.merged_times);
        for posted in values {
            self.retract_value(posted);
        }
        for posted in times {
            self.retract_time(posted);
        }
        let at = self.change(into);
        at.supports -= 1;
        at.merged.retain(|at| *at != token);
        self.take_orders_back(token);
    }

    /// The plan does without a free token.
    ///
    /// # Panics
    ///
    /// If it is not free.
    pub fn reject(&mut self, token: TokenId) {
        assert_eq!(self.at(token).status, Status::Free, "{token:?} is free");
        self.change(token).status = Status::Rejected;
    }

    /// Undoes a [`reject`](Self::reject), whenever it was: the token is free.
    ///
    /// # Panics
    ///
    /// If it is not rejected.
    pub fn reconsider_rejected(&mut self, token: TokenId) {
        assert_eq!(
            self.at(token).status,
            Status::Rejected,
            "{token:?} is rejected"
        );
        self.change(token).status = Status::Free;
    }

    /// Removes a token, whatever its status, with what it brought: constraints, rules, and tokens
    /// that only its rules asked for. Relations that counted on it are open again.
    ///
    /// # Panics
    ///
    /// If it is not there.
    pub fn remove(&mut self, token: TokenId) {
        self.take(|database| database.delete(token));
    }

    pub(super) fn delete(&mut self, token: TokenId) {
        match self.at(token).status {
            Status::Active => self.take_off(token),
            Status::Merged(into) => self.part(token, into),
            Status::Free | Status::Rejected => {}
        }
        self.remove_mirrors(token);
        for place in 0..self.at(token).times.len() {
            self.retract_time(self.at(token).times[place]);
        }
        for place in 0..self.at(token).values.len() {
            self.retract_value(self.at(token).values[place]);
        }
        self.loosened = true;
        for place in 0..self.at(token).parameters.len() {
            self.release(self.at(token).parameters[place]);
        }
        self.steps += 1;
        for time in [self.at(token).start, self.at(token).finish] {
            if let Time::Point(point) = time {
                self.network.remove_point(point);
            }
        }
        if self.depth() == 0 {
            self.tokens.discard(token);
        } else if let Some(removed) = self.tokens.remove(token) {
            self.kept_tokens.push(removed);
            self.note(Change::TokenRemoved(token));
        }
    }

    /// Binds a parameter of a token to a value: what another system reports, or what a search
    /// decides. It goes with the token.
    ///
    /// # Errors
    ///
    /// If it cannot have the value: nothing changes.
    ///
    /// # Panics
    ///
    /// If the token is not there or has no such parameter.
    pub fn bind(
        &mut self,
        token: TokenId,
        parameter: usize,
        value: i64,
        owner: Owner,
    ) -> Result<(), Conflict> {
        match self.at(token).parameters[parameter] {
            Operand::Value(is) if is == value => Ok(()),
            Operand::Value(_) => Err(Conflict::Mismatch { owner }),
            Operand::Variable(variable) => self.attempt(|database| {
                let domain = Domain::exactly(value);
                let posted = database.store.restrict(variable, domain, owner)?;
                database.change(token).values.push(posted);
                Ok(())
            }),
        }
    }

    /// Counts one more who has a variable.
    pub(super) fn hold(&mut self, operand: Operand) {
        let Operand::Variable(variable) = operand else {
            return;
        };
        let place = variable.index();
        if self.holders.len() <= place {
            self.holders.resize(place + 1, 0);
        }
        self.note(Change::Held(place, self.holders[place]));
        self.holders[place] += 1;
    }

    /// Counts one less who has a variable: with none it goes.
    pub(super) fn release(&mut self, operand: Operand) {
        let Operand::Variable(variable) = operand else {
            return;
        };
        let place = variable.index();
        self.note(Change::Held(place, self.holders[place]));
        self.holders[place] -= 1;
        if self.holders[place] == 0 {
            self.store.remove(variable);
        }
    }

    /// A variable with all values of a type.
    pub(crate) fn new_variable(&mut self, of: TypeId) -> Operand {
        self.steps += 1;
        Operand::Variable(self.store.add(self.domains[of].clone()))
    }
}
