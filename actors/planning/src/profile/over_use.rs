//! Where limits are broken: when, by how much, and by whom.

use super::steps::{GREATEST, LEAST, Side, Test};
use super::{Profile, UseId};
use crate::Ticks;
use crate::temporal::Span;

/// A limit of a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Bound {
    /// The least level: too much is used.
    Least,
    /// The greatest level: too much is given back or produced.
    Most,
}

impl Bound {
    /// Which envelope breaks it.
    pub(super) fn side(self) -> Side {
        match self {
            Bound::Least => LEAST,
            Bound::Most => GREATEST,
        }
    }

    /// What a level that breaks it passes.
    pub(super) fn test(self, limits: Span) -> Test {
        match self {
            Bound::Least => Test::Below(limits.min),
            Bound::Most => Test::Above(limits.max),
        }
    }

    /// By how much a level that breaks it does so; beyond the largest number, that.
    pub(super) fn excess(self, level: i64, limits: Span) -> i64 {
        match self {
            Bound::Least => limits.min.saturating_sub(level),
            Bound::Most => level.saturating_sub(limits.max),
        }
    }

    /// How far a change leads towards it; below 0 if it leads away.
    pub(super) fn towards(self, change: i64) -> i64 {
        match self {
            Bound::Least => -change,
            Bound::Most => change,
        }
    }
}

/// Ticks at which the level breaks a limit, in every schedule or in some.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OverUse<O> {
    /// Which limit.
    pub bound: Bound,
    /// The first and the last tick of the interval throughout which the level is, or may be, beyond
    /// the limit; [`Ticks::MAX`] if it stays so for good.
    pub during: Span,
    /// By how much, at the worst tick.
    pub amount: i64,
    /// The first of the worst ticks.
    pub worst_tick: Ticks,
    /// Whether at one of the ticks the limit is broken in every schedule.
    pub is_certain: bool,
    /// What is in force at the worst tick when that is worst, and leads towards the limit: in the
    /// order of their earliest starts.
    pub contributors: Vec<Contributor<O>>,
}

/// A use that contributes to an over-use.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contributor<O> {
    /// The use.
    pub of: UseId,
    /// Whose it is.
    pub owner: O,
    /// By how much it leads towards the limit, at the worst; above 0.
    pub amount: i64,
    /// Whether it is in force at the worst tick in every schedule.
    pub is_certain: bool,
}

impl<O: Clone> Profile<O> {
    /// The first over-use at or after a tick, of any limit, if each time lies anywhere within its
    /// span.
    ///
    /// It is found for the logarithm of how many uses there are, and one look for each use that
    /// may be in force.
    pub fn first_over_use(&self, from: Ticks) -> Option<OverUse<O>> {
        let [least, most] = [Bound::Least, Bound::Most].map(|bound| self.beyond(bound, from));
        let first = match (least, most) {
            (Some(least), Some(most)) if most.min < least.min => (Bound::Most, most),
            (Some(least), _) => (Bound::Least, least),
            (None, most) => (Bound::Most, most?),
        };
        Some(self.over_use(first.0, first.1))
    }

    /// The first over-use at or after a tick that breaks a certain limit, if each time lies
    /// anywhere within its span.
    pub fn first_over_use_of(&self, bound: Bound, from: Ticks) -> Option<OverUse<O>> {
        let run = self.beyond(bound, from)?;
        Some(self.over_use(bound, run))
    }

    /// All over-uses, of the least level first, each in the order of time.
    ///
    /// ```
    /// use farside_planning::profile::{Profile, Use};
    /// use farside_planning::temporal::Span;
    /// let mut lane = Profile::new(1, Span::at_least(0));
    /// for (start, end) in [(0, 10), (10, 20), (15, 30), (29, 40)] {
    ///     let one = Use::renewable(Span::exactly(start), Span::exactly(end), Span::exactly(1));
    ///     lane.add(one, ()).unwrap();
    /// }
    /// let ticks: Vec<_> = lane.over_uses().map(|over_use| over_use.during).collect();
    /// assert_eq!(ticks, [Span::new(15, 19), Span::new(29, 29)]);
    /// ```
    pub fn over_uses(&self) -> impl Iterator<Item = OverUse<O>> {
        let of = |bound| {
            let mut from = Some(Ticks::MIN);
            std::iter::from_fn(move || {
                let run = self.beyond(bound, from?)?;
                from = run.max.checked_add(1);
                Some(self.over_use(bound, run))
            })
        };
        of(Bound::Least).chain(of(Bound::Most))
    }

    /// The first tick at or after one from which on `change` can be added to the level for so many
    /// ticks without breaking a limit in any schedule: where a new use fits. None if there is no
    /// such tick.
    ///
    /// It costs the logarithm of how many uses there are for each gap that is too short.
    ///
    /// ```
    /// use farside_planning::Ticks;
    /// use farside_planning::profile::{Profile, Use};
    /// use farside_planning::temporal::Span;
    /// let mut lane = Profile::new(1, Span::at_least(0));
    /// for (start, end) in [(0, 10), (13, 20), (25, 30)] {
    ///     let one = Use::renewable(Span::exactly(start), Span::exactly(end), Span::exactly(1));
    ///     lane.add(one, ()).unwrap();
    /// }
    /// assert_eq!(lane.first_fit(0, 3, -1), Some(10));
    /// assert_eq!(lane.first_fit(0, 4, -1), Some(20));
    /// // For good.
    /// assert_eq!(lane.first_fit(0, Ticks::MAX, -1), Some(30));
    /// assert_eq!(lane.first_fit(0, 1, -2), None);
    /// ```
    pub fn first_fit(&self, from: Ticks, duration_ticks: Ticks, change: i64) -> Option<Ticks> {
        let (bound, limit) = if change < 0 {
            (Bound::Least, self.limits.min)
        } else {
            (Bound::Most, self.limits.max)
        };
        if limit == i64::MIN || limit == i64::MAX {
            return Some(from);
        }
        let within = Span::exactly(limit.saturating_sub(change));
        let mut start = from;
        loop {
            let end = start.saturating_add(duration_ticks.max(0));
            match self.run(bound, bound.test(within), start) {
                Some(run) if run.min < end => start = run.max.checked_add(1)?,
                _ => return Some(start),
            }
        }
    }

    /// The first ticks at or after one at which the level may pass a test, without a gap.
    pub(super) fn run(&self, bound: Bound, test: Test, from: Ticks) -> Option<Span> {
        let side = bound.side();
        let start = if test.holds(self.side_at(from, side)) {
            from
        } else {
            self.steps.first(from, side, self.initial, test)?
        };
        let end = self.steps.first(start, side, self.initial, test.opposite());
        Some(Span::new(start, end.map_or(Ticks::MAX, |end| end - 1)))
    }

    /// The first ticks at or after one at which a limit may be broken, without a gap.
    pub(super) fn beyond(&self, bound: Bound, from: Ticks) -> Option<Span> {
        self.run(bound, bound.test(self.limits), from)
    }

    /// What is to be said of ticks at which a limit may be broken.
    fn over_use(&self, bound: Bound, during: Span) -> OverUse<O> {
        let (side, test) = (bound.side(), bound.test(self.limits));
        let at_start = self.side_at(during.min, side);
        let range = (during.min, during.max);
        let later = self.steps.extreme(range, side, self.initial, test);
        let (worst_tick, worst) = match later {
            Some(later) if bound.towards(later) > bound.towards(at_start) => {
                let as_bad = match bound {
                    Bound::Least => Test::Below(later + 1),
                    Bound::Most => Test::Above(later - 1),
                };
                let tick = self.steps.first(during.min, side, self.initial, as_bad);
                (tick.unwrap_or(during.min), later)
            }
            _ => (during.min, at_start),
        };
        let is_certain = test.holds(self.side_at(during.min, 1 - side))
            || self
                .steps
                .first(during.min, 1 - side, self.initial, test)
                .is_some_and(|tick| tick <= during.max);
        OverUse {
            bound,
            during,
            amount: bound.excess(worst, self.limits),
            worst_tick,
            is_certain,
            contributors: self.contributors(bound, worst_tick, |_| true),
        }
    }

    /// What may be in force at a tick, is by what `is_in_force` says of its place, and leads
    /// towards a limit.
    pub(super) fn contributors(
        &self,
        bound: Bound,
        tick: Ticks,
        mut is_in_force: impl FnMut(u32) -> bool,
    ) -> Vec<Contributor<O>> {
        let mut places = Vec::new();
        self.in_force.overlapping(Span::exactly(tick), &mut places);
        let mut found = Vec::new();
        for place in places {
            let (Some(one), Some(of)) = (
                self.uses.at(place as usize),
                self.uses.id_at(place as usize),
            ) else {
                continue;
            };
            let amount = bound.towards(one.worst(bound.side()));
            if amount > 0 && is_in_force(place) {
                found.push(Contributor {
                    of,
                    owner: self.owners[place as usize].clone(),
                    amount,
                    is_certain: one.certain().contains(tick),
                });
            }
        }
        found
    }

    /// The least or the greatest level at a tick.
    pub(super) fn side_at(&self, tick: Ticks, side: Side) -> i64 {
        self.initial + self.steps.until(tick)[side]
    }
}
