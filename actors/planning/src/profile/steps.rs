//! The two envelopes as steps in time: what each adds to the least and to the greatest level.

use super::tree::{Entry, NONE, Tree};
use crate::Ticks;

/// Which envelope: the least level, or the greatest.
pub(super) type Side = usize;

pub(super) const LEAST: Side = 0;
pub(super) const GREATEST: Side = 1;

/// What changes at a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Step {
    pub(super) tick: Ticks,
    /// By side.
    pub(super) change: [i64; 2],
    /// How many times of uses lie here; a step with some stays, even if its changes cancel.
    pub(super) times: i64,
}

/// What a part of the steps adds up to, by side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Levels {
    total: [i64; 2],
    /// The least and the greatest sum of steps up to one of them.
    low: [i64; 2],
    high: [i64; 2],
}

impl Entry for Step {
    type Key = Ticks;
    type Sum = Levels;
    const EMPTY: &'static Levels = &Levels {
        total: [0; 2],
        low: [i64::MAX; 2],
        high: [i64::MIN; 2],
    };

    fn key(&self) -> Ticks {
        self.tick
    }

    fn sum(&self, left: &Levels, right: &Levels) -> Levels {
        let mut all = *Self::EMPTY;
        for side in [LEAST, GREATEST] {
            let here = left.total[side] + self.change[side];
            all.total[side] = here + right.total[side];
            // Of no steps, the low is so high that it stays the largest number, or nearly so.
            let after = here.saturating_add(right.low[side]);
            all.low[side] = left.low[side].min(here).min(after);
            let after = here.saturating_add(right.high[side]);
            all.high[side] = left.high[side].max(here).max(after);
        }
        all
    }

    fn merge(&mut self, other: &Step) {
        for side in [LEAST, GREATEST] {
            self.change[side] += other.change[side];
        }
        self.times += other.times;
    }

    fn is_void(&self) -> bool {
        self.times == 0
    }
}

/// What a level is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Test {
    Below(i64),
    Above(i64),
}

impl Test {
    pub(super) fn holds(self, level: i64) -> bool {
        match self {
            Test::Below(bound) => level < bound,
            Test::Above(bound) => level > bound,
        }
    }

    /// What holds where this one, which does hold somewhere, does not.
    pub(super) fn opposite(self) -> Test {
        match self {
            Test::Below(bound) => Test::Above(bound - 1),
            Test::Above(bound) => Test::Below(bound + 1),
        }
    }

    /// Whether it may hold at a step of a part, before which the level is `base`.
    fn may_hold(self, base: i64, part: &Levels, side: Side) -> bool {
        match self {
            Test::Below(_) => self.holds(base.saturating_add(part.low[side])),
            Test::Above(_) => self.holds(base.saturating_add(part.high[side])),
        }
    }
}

impl Tree<Step> {
    /// What all steps up to a tick add up to.
    pub(super) fn until(&self, tick: Ticks) -> [i64; 2] {
        let mut sums = [0; 2];
        let mut at = self.root();
        while at != NONE {
            let (step, left, right) = self.look(at);
            if step.tick > tick {
                at = left;
                continue;
            }
            for side in [LEAST, GREATEST] {
                sums[side] += self.sum(left).total[side] + step.change[side];
            }
            at = right;
        }
        sums
    }

    /// The first step after a tick.
    pub(super) fn next(&self, tick: Ticks) -> Option<Ticks> {
        let mut found = None;
        let mut at = self.root();
        while at != NONE {
            let (step, left, right) = self.look(at);
            if step.tick > tick {
                found = Some(step.tick);
                at = left;
            } else {
                at = right;
            }
        }
        found
    }

    /// The first step after a tick from which on the level passes a test.
    pub(super) fn first(&self, after: Ticks, side: Side, base: i64, test: Test) -> Option<Ticks> {
        self.first_below(self.root(), after, side, base, test)
    }

    fn first_below(
        &self,
        at: u32,
        after: Ticks,
        side: Side,
        base: i64,
        test: Test,
    ) -> Option<Ticks> {
        if at == NONE || !test.may_hold(base, self.sum(at), side) {
            return None;
        }
        let (step, left, right) = self.look(at);
        let here = base + self.sum(left).total[side] + step.change[side];
        if step.tick > after {
            if let Some(found) = self.first_below(left, after, side, base, test) {
                return Some(found);
            }
            if test.holds(here) {
                return Some(step.tick);
            }
        }
        self.first_below(right, after, side, here, test)
    }

    /// The least (or the greatest) level at the steps after a tick up to another one.
    pub(super) fn extreme(
        &self,
        (after, until): (Ticks, Ticks),
        side: Side,
        base: i64,
        test: Test,
    ) -> Option<i64> {
        self.extreme_below(self.root(), (after, until), side, base, test)
    }

    fn extreme_below(
        &self,
        at: u32,
        (after, until): (Ticks, Ticks),
        side: Side,
        base: i64,
        test: Test,
    ) -> Option<i64> {
        if at == NONE {
            return None;
        }
        let part = self.sum(at);
        if (after, until) == (Ticks::MIN, Ticks::MAX) {
            return Some(match test {
                Test::Below(_) => base + part.low[side],
                Test::Above(_) => base + part.high[side],
            });
        }
        let (step, left, right) = self.look(at);
        let here = base + self.sum(left).total[side] + step.change[side];
        // What lies beyond a step that is inside has one border less to look at.
        let (mut before, mut own, mut later) = (None, None, None);
        if step.tick > after {
            let inner = if step.tick <= until {
                Ticks::MAX
            } else {
                until
            };
            before = self.extreme_below(left, (after, inner), side, base, test);
        }
        if step.tick > after && step.tick <= until {
            own = Some(here);
        }
        if step.tick <= until {
            let inner = if step.tick > after { Ticks::MIN } else { after };
            later = self.extreme_below(right, (inner, until), side, here, test);
        }
        let found = [before, own, later].into_iter().flatten();
        match test {
            Test::Below(_) => found.min(),
            Test::Above(_) => found.max(),
        }
    }
}
