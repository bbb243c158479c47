//! Times of tokens: known ticks and points of the network, and variables that follow them.

use super::trail::Change;
use super::{Conflict, Database, Guard, Owner, Time, TokenId};
use crate::Ticks;
use crate::model::End;
use crate::parameters::{self, Domain, Operand, Variable};
use crate::temporal::{Constraint, Point, Span};

/// A variable that is when a token starts or ends, or how long it lasts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mirror {
    pub(super) variable: Variable,
    token: TokenId,
    /// Which end; none for the duration.
    end: Option<End>,
    /// That the variable is within the bounds of the time.
    pub(super) value: Option<parameters::Constraint>,
    /// That the time is within the bounds of the variable.
    pub(super) time: Option<Constraint>,
}

impl Database {
    /// When a token starts or ends.
    ///
    /// # Panics
    ///
    /// If the token is not there.
    #[inline]
    pub fn time(&self, token: TokenId, end: End) -> Time {
        let at = self.at(token);
        match end {
            End::Start => at.start,
            End::Finish => at.finish,
        }
    }

    /// The earliest and the latest tick of a time.
    #[inline]
    pub fn bounds_of(&self, time: Time) -> Span {
        match time {
            Time::At(tick) => Span::exactly(tick),
            Time::Point(point) => self.network.bounds(point),
        }
    }

    /// The earliest and the latest start of a token \[ticks\].
    #[inline]
    pub fn start(&self, token: TokenId) -> Span {
        self.bounds_of(self.at(token).start)
    }

    /// The earliest and the latest end of a token \[ticks\].
    #[inline]
    pub fn finish(&self, token: TokenId) -> Span {
        self.bounds_of(self.at(token).finish)
    }

    /// Whether a token has ended by a tick.
    #[inline]
    pub(crate) fn has_ended(&self, token: TokenId, tick: Ticks) -> bool {
        match self.at(token).finish {
            Time::At(finish) => finish <= tick,
            Time::Point(point) => self.network.latest(point) <= tick,
        }
    }

    /// How long the rules that hold for a token let it last at most \[ticks\]; none, if they do not
    /// say.
    pub(crate) fn longest(&self, token: TokenId) -> Option<Ticks> {
        let instances = self.at(token).instances.iter();
        let bounds = instances.filter_map(|&instance| {
            let at = self.instance_at(instance);
            let [min, max] = self.model.rules[at.rule].duration?;
            (at.guard == Guard::Holds).then(|| self.span(instance, min, max, false).max)
        });
        bounds.min()
    }

    /// Posts that `to - from` lies within a span; between known times nothing is posted.
    pub(super) fn between(
        &mut self,
        from: Time,
        to: Time,
        span: Span,
        owner: Owner,
    ) -> Result<Option<Constraint>, Conflict> {
        let Some((from, to, span)) = self.as_points(from, to, span, owner)? else {
            return Ok(None);
        };
        if span == Span::ALL {
            return Ok(None);
        }
        Ok(Some(self.network.constrain(from, to, span, owner)?))
    }

    /// A bound of times as one of points, of which known times have none: it is one of the
    /// origin then, or of nothing at all.
    fn as_points(
        &self,
        from: Time,
        to: Time,
        span: Span,
        owner: Owner,
    ) -> Result<Option<(Point, Point, Span)>, Conflict> {
        let origin = self.network.origin();
        Ok(match (from, to) {
            (Time::At(from), Time::At(to)) => {
                let is = to - from;
                if !span.contains(is) {
                    return Err(Conflict::Known {
                        owner,
                        is,
                        expected: span,
                    });
                }
                None
            }
            (Time::At(from), Time::Point(to)) => Some((origin, to, shifted(span, from))),
            (Time::Point(from), Time::At(to)) => Some((origin, from, shifted(span.negated(), to))),
            (Time::Point(from), Time::Point(to)) => Some((from, to, span)),
        })
    }

    /// Gives a constraint that [`between`](Self::between) posted another span: it is tightened,
    /// or, if it is to be wider, posted anew.
    pub(super) fn between_again(
        &mut self,
        posted: Constraint,
        from: Time,
        to: Time,
        span: Span,
        owner: Owner,
    ) -> Result<Constraint, Conflict> {
        let Some((from, to, span)) = self.as_points(from, to, span, owner)? else {
            return Ok(posted);
        };
        let Some((_, _, now)) = self.network.constraint(posted) else {
            return Ok(posted);
        };
        if now.intersect(span) == span {
            if now != span {
                self.network.tighten(posted, span)?;
            }
            return Ok(posted);
        }
        self.network.retract(posted);
        Ok(self.network.constrain(from, to, span, owner)?)
    }

    /// Whether a token ends exactly when another starts, in every schedule: since both times are
    /// known, or since a constraint of the two says so.
    pub fn meets(&self, first: TokenId, second: TokenId) -> bool {
        let (from, to) = (self.at(first).finish, self.at(second).start);
        let (ends, starts) = (self.bounds_of(from), self.bounds_of(to));
        if ends.min == ends.max && starts.min == starts.max {
            return ends == starts;
        }
        let (Time::Point(from), Time::Point(to)) = (from, to) else {
            return false;
        };
        self.network.constraints_of(to).into_iter().any(|at| {
            let span = self.network.constraint(at);
            span.is_some_and(|(one, other, span)| {
                (one, other) == (from, to) && span.max <= 0
                    || (one, other) == (to, from) && span.min >= 0
            })
        })
    }

    /// Says when a token starts or ends, more closely than before.
    ///
    /// # Errors
    ///
    /// If it cannot be then: nothing changes.
    ///
    /// # Panics
    ///
    /// If the token is not there.
    pub fn restrict_time(
        &mut self,
        token: TokenId,
        end: End,
        span: Span,
        owner: Owner,
    ) -> Result<(), Conflict> {
        self.attempt(|database| {
            let time = database.time(token, end);
            if let Some(posted) = database.between(Time::At(0), time, span, owner)? {
                database.change(token).times.push(posted);
            }
            Ok(())
        })
    }

    /// Says how long a token lasts, more closely than before.
    ///
    /// # Errors
    ///
    /// If it cannot last so long: nothing changes.
    pub fn restrict_duration(
        &mut self,
        token: TokenId,
        span: Span,
        owner: Owner,
    ) -> Result<(), Conflict> {
        self.attempt(|database| {
            let at = database.at(token);
            let (start, finish) = (at.start, at.finish);
            if let Some(posted) = database.between(start, finish, span, owner)? {
                database.change(token).times.push(posted);
            }
            Ok(())
        })
    }

    /// Posts that the second of two times lies within `span` after the first. It is a token's: it
    /// goes when that leaves the plan, or when it is taken back. Gives the token and what was
    /// posted; nothing, if both times are known.
    ///
    /// # Errors
    ///
    /// If it cannot hold: nothing changes.
    pub fn order_for(
        &mut self,
        token: TokenId,
        [from, to]: [Time; 2],
        span: Span,
        owner: Owner,
    ) -> Result<Option<(TokenId, Constraint)>, Conflict> {
        self.attempt(|database| {
            let posted = database.between(from, to, span, owner)?;
            if let Some(posted) = posted {
                database.change(token).orders.push(posted);
            }
            Ok(posted.map(|posted| (token, posted)))
        })
    }

    /// Whether a time rests on a constraint: whether it alone keeps an earliest time from being
    /// earlier, or may.
    pub fn is_tight(&self, constraint: Constraint) -> bool {
        let Some((from, to, span)) = self.network.constraint(constraint) else {
            return false;
        };
        let (from, to) = (self.network.bounds(from), self.network.bounds(to));
        to.min == from.min.saturating_add(span.min)
    }

    /// Takes back an order that was posted for a token, if it is there still.
    pub fn take_back_order(&mut self, token: TokenId, constraint: Constraint) {
        let Some(at) = self.tokens.get(token) else {
            return;
        };
        if let Some(place) = at.orders.iter().position(|&at| at == constraint) {
            self.take(|database| {
                database.change(token).orders.remove(place);
                database.retract_time(constraint);
            });
        }
    }

    /// Retracts a constraint of times, if it did not go with a point that it was of.
    pub(super) fn retract_time(&mut self, constraint: Constraint) {
        if self.network.constraint(constraint).is_some() {
            self.network.retract(constraint);
            self.loosened = true;
        }
    }

    /// Retracts a constraint of values, if it did not go with a variable that it was of.
    pub(super) fn retract_value(&mut self, constraint: parameters::Constraint) {
        if self.store.has_constraint(constraint) {
            self.note_equality(constraint);
            self.store.retract(constraint);
            self.loosened = true;
        }
    }

    /// The variable that is when a token starts or ends, or, without an end, how long it lasts.
    pub(super) fn mirror(&mut self, token: TokenId, end: Option<End>) -> Result<Operand, Conflict> {
        if let Some(operand) = self.mirrored_by(token, end) {
            return Ok(operand);
        }
        let variable = self.store.add(Domain::ALL);
        let operand = Operand::Variable(variable);
        self.hold(operand);
        self.mirrors.push(Mirror {
            variable,
            token,
            end,
            value: None,
            time: None,
        });
        self.note(Change::Mirrored);
        self.reflect(self.mirrors.len() - 1)?;
        Ok(operand)
    }

    /// The variable that follows a time of a token, if there is one.
    pub(super) fn mirrored_by(&self, token: TokenId, end: Option<End>) -> Option<Operand> {
        let made = |mirror: &&Mirror| (mirror.token, mirror.end) == (token, end);
        let mirror = self.mirrors.iter().find(made)?;
        Some(Operand::Variable(mirror.variable))
    }

    /// What the network knows of a mirrored time, the store knows too. Whether that was news.
    fn reflect(&mut self, place: usize) -> Result<bool, Conflict> {
        let mirror = self.mirrors[place];
        let bounds = self.mirrored(mirror);
        if self.store.domain(mirror.variable).span().intersect(bounds)
            == self.store.domain(mirror.variable).span()
        {
            return Ok(false);
        }
        let owner = Owner::Token(mirror.token);
        let posted = self
            .store
            .restrict(mirror.variable, Domain::from(bounds), owner)?;
        if let Some(old) = mirror.value {
            self.store.retract(old);
        }
        self.change_mirror(place).value = Some(posted);
        Ok(true)
    }

    fn mirrored(&self, mirror: Mirror) -> Span {
        let at = self.at(mirror.token);
        match mirror.end {
            Some(end) => self.bounds_of(self.time(mirror.token, end)),
            None => {
                let (start, finish) = (self.bounds_of(at.start), self.bounds_of(at.finish));
                Span::new((finish.min - start.max).max(0), finish.max - start.min)
            }
        }
    }

    /// Times and values changed: whoever follows them is told, until nothing changes any more.
    pub(super) fn settle(&mut self) -> Result<(), Conflict> {
        loop {
            if self.mirrors.is_empty() && !self.has_news() {
                self.loosened = false;
                return Ok(());
            }
            self.settle_values()?;
            let loosened = std::mem::take(&mut self.loosened) && !self.mirrors.is_empty();
            if loosened {
                self.loosen_mirrors();
            }
            let mut news = false;
            // All of them, before anybody is told: what was loosened is as tight as before then.
            for place in 0..self.mirrors.len() {
                news |= self.reflect(place)?;
            }
            // What other constraints say of their variables holds for times as before.
            for place in (0..self.mirrors.len()).filter(|_| loosened) {
                self.follow_mirrors(self.mirrors[place].variable)?;
                news = true;
            }
            if !news {
                return Ok(());
            }
        }
    }

    /// A variable changed that follows a time: the time follows it.
    pub(super) fn follow_mirrors(&mut self, variable: Variable) -> Result<(), Conflict> {
        for place in 0..self.mirrors.len() {
            let mirror = self.mirrors[place];
            if mirror.variable != variable {
                continue;
            }
            let says = self.store.domain(variable).span();
            if self.mirrored(mirror).intersect(says) == self.mirrored(mirror) {
                continue;
            }
            let token = self.at(mirror.token);
            let owner = Owner::Token(mirror.token);
            let (from, to) = match mirror.end {
                Some(End::Start) => (Time::At(0), token.start),
                Some(End::Finish) => (Time::At(0), token.finish),
                None => (token.start, token.finish),
            };
            let posted = match mirror.time {
                Some(old) => Some(self.between_again(old, from, to, says, owner)?),
                None => self.between(from, to, says, owner)?,
            };
            self.change_mirror(place).time = posted;
        }
        Ok(())
    }

    /// Something was retracted: what mirrors rest on may be themselves, so they start anew.
    pub(super) fn loosen_mirrors(&mut self) {
        for place in 0..self.mirrors.len() {
            let Mirror { value, time, .. } = self.mirrors[place];
            let mirror = self.change_mirror(place);
            (mirror.value, mirror.time) = (None, None);
            if let Some(value) = value {
                self.store.retract(value);
            }
            if let Some(time) = time
                && self.network.constraint(time).is_some()
            {
                self.network.retract(time);
            }
        }
    }

    fn change_mirror(&mut self, place: usize) -> &mut Mirror {
        self.note(Change::MirrorChanged(place, self.mirrors[place]));
        &mut self.mirrors[place]
    }

    /// The mirrors of a token that goes.
    pub(super) fn remove_mirrors(&mut self, token: TokenId) {
        while let Some(place) = self.mirrors.iter().position(|at| at.token == token) {
            let mirror = self.mirrors.remove(place);
            self.note(Change::Unmirrored(place, mirror));
            if let Some(value) = mirror.value {
                self.retract_value(value);
            }
            if let Some(time) = mirror.time {
                self.retract_time(time);
            }
            self.release(Operand::Variable(mirror.variable));
        }
    }
}

/// A span of differences to a known tick, as one of ticks.
fn shifted(span: Span, by: Ticks) -> Span {
    let shift = |bound: Ticks| match bound {
        Ticks::MIN | Ticks::MAX => bound,
        bound => bound.saturating_add(by),
    };
    Span::new(shift(span.min), shift(span.max))
}
