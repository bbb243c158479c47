//! When tokens end: what rules and relations say of it, and where far times are from.

use farside_planning::Ticks;
use farside_planning::model::{End, RuleId};
use smallvec::SmallVec;

use super::super::Tables;
use super::super::rules::constant;
use super::{Clash, Far, Fars, Finish, Gap, Open, State, Token, What};

impl State {
    /// An end lies within bounds that are near, or of which nobody knows where they are from.
    pub(in crate::service) fn within(
        &mut self,
        finish: Finish,
        min: Ticks,
        max: Ticks,
        rule: Option<RuleId>,
    ) -> Result<(), Clash> {
        self.within_from(finish, (min, &[]), (max, &[]), rule)
    }

    /// Whether a time is so far ahead that it is not told apart from others.
    pub(in crate::service) fn is_far(&self, time: Ticks) -> bool {
        time != Ticks::MAX && time > self.tick.saturating_add(self.exact)
    }

    /// Whether a token's end is known; notes if that depends on times that are not told apart.
    pub(in crate::service) fn is_fixed(&self, finish: Finish) -> bool {
        let at = &self.finishes[usize::from(self.end(finish))];
        if self.is_far(at.min) && !are_comparable(&at.lows, &at.highs) {
            self.loose.set(true);
        }
        at.min == at.max
    }

    /// An end lies within bounds, which are from somewhere if they are far.
    pub(in crate::service) fn within_from(
        &mut self,
        finish: Finish,
        (min, lows): (Ticks, &[Far]),
        (max, highs): (Ticks, &[Far]),
        rule: Option<RuleId>,
    ) -> Result<(), Clash> {
        let finish = usize::from(self.end(finish));
        let far = (self.is_far(min), self.is_far(max));
        let is = &self.finishes[finish];
        let was_far = (self.is_far(is.min), self.is_far(is.max));
        // What is far does not matter to what is near already.
        let matters = was_far.1 || is.max == Ticks::MAX;
        if (far.0 && lows.is_empty()) || (far.1 && highs.is_empty() && matters) {
            self.loose.set(true);
        }
        let known = (is.lows.len(), is.highs.len());
        let bounds = &mut self.finishes[finish];
        let before = (bounds.min, bounds.max);
        match (far.0, was_far.0) {
            (true, true) => join(&mut bounds.lows, lows),
            (true, false) => bounds.lows = SmallVec::from_slice(lows),
            _ => {}
        }
        match (far.1, was_far.1) {
            (true, true) => join(&mut bounds.highs, highs),
            (true, false) if max < bounds.max => bounds.highs = SmallVec::from_slice(highs),
            (false, _) if max < bounds.max => bounds.highs.clear(),
            _ => {}
        }
        (bounds.min, bounds.max) = (bounds.min.max(min), bounds.max.min(max));
        let (low, high) = (bounds.min, bounds.max);
        let unclear = !are_comparable(&bounds.lows, &bounds.highs);
        let same = before == (low, high) && known == (bounds.lows.len(), bounds.highs.len());
        if self.is_far(low) && self.is_far(high) && unclear {
            self.loose.set(true);
        }
        if low > high {
            let what = What::Times;
            return Err(Clash { what, rule });
        }
        if same {
            return Ok(());
        }
        self.operations += 1;
        for place in 0..self.gaps.len() {
            let gap = self.gaps[place].clone();
            let (from, to) = (self.end(gap.from), self.end(gap.to));
            if usize::from(from) == finish || usize::from(to) == finish {
                self.keep(&gap)?;
            }
        }
        Ok(())
    }

    pub(super) fn keep(&mut self, gap: &Gap) -> Result<(), Clash> {
        let rule = Some(gap.rule);
        // Times that are moved are of no known origin.
        let from_there = |fars: Fars, by: Ticks| if by == 0 { fars } else { Fars::new() };
        let at = self.finishes[usize::from(self.end(gap.from))].clone();
        let (lows, highs) = (from_there(at.lows, gap.min), from_there(at.highs, gap.max));
        let low = (later(at.min, gap.min), &lows[..]);
        let high = (later(at.max, gap.max), &highs[..]);
        self.within_from(gap.to, low, high, rule)?;
        let at = self.finishes[usize::from(self.end(gap.to))].clone();
        let (lows, highs) = (from_there(at.lows, gap.max), from_there(at.highs, gap.min));
        let low = (later(at.min, -gap.max), &lows[..]);
        let high = (later(at.max, -gap.min), &highs[..]);
        self.within_from(gap.from, low, high, rule)
    }

    /// Says what a relation says of the times of two tokens.
    pub(in crate::service) fn relate(
        &mut self,
        tables: &Tables,
        open: Open,
        relation: usize,
        target: Token,
    ) -> Result<(), Clash> {
        let instance = &self.at(open.token).instances[usize::from(open.instance)];
        let rule = instance.rule;
        let said = &tables.flats[rule].relations[relation];
        let anchor = match said.anchor {
            0 => Some(open.token),
            label => instance.labels[label],
        };
        let what = What::Kind;
        let anchor = anchor.ok_or(Clash {
            what,
            rule: Some(rule),
        })?;
        for distance in &said.distances {
            let (min, max) = span(distance);
            let (from, to) = (
                self.time(anchor, distance.from),
                self.time(target, distance.to),
            );
            let ends = (self.at(anchor).finish, self.at(target).finish);
            let starts = (self.at(anchor).start, self.at(target).start);
            self.judge((distance.from, distance.to), starts, (min, max));
            let rule = Some(rule);
            match (distance.from, distance.to) {
                (End::Start, End::Start) => {
                    let apart = to.0 - from.0;
                    if apart < min || apart > max {
                        let what = What::Times;
                        return Err(Clash { what, rule });
                    }
                }
                (End::Finish, End::Start) => {
                    self.within(ends.0, later(to.0, -max), later(to.0, -min), rule)?;
                }
                (End::Start, End::Finish) => {
                    self.within(ends.1, later(from.0, min), later(from.0, max), rule)?;
                }
                (End::Finish, End::Finish) => self.part(ends, (min, max), rule)?,
            }
        }
        self.close(open);
        Ok(())
    }

    /// Notes if what a distance says of two tokens depends on when they started, which is not told
    /// apart unless it is now.
    pub(in crate::service) fn judge(
        &self,
        ends: (End, End),
        (from, to): (Ticks, Ticks),
        (min, max): (Ticks, Ticks),
    ) {
        let clear = match ends {
            (End::Start, End::Start) => match (from < self.tick, to < self.tick) {
                (true, true) => false,
                (true, false) => max == Ticks::MAX && min <= 1 || max <= 0,
                (false, true) => min == -Ticks::MAX && max >= -1 || min >= 0,
                (false, false) => true,
            },
            (End::Start, End::Finish) => from == self.tick || (min <= 0 && max == Ticks::MAX),
            (End::Finish, End::Start) => {
                to == self.tick || (min == -Ticks::MAX && max >= 0) || min >= 0
            }
            // What is near is told apart; two far ends are another question.
            (End::Finish, End::Finish) => {
                (min == -Ticks::MAX || min == 0 || min == 1)
                    && (max == Ticks::MAX || max == 0 || max == -1)
            }
        };
        if !clear {
            self.loose.set(true);
        }
    }

    /// Two ends lie so many ticks apart.
    pub(super) fn part(
        &mut self,
        ends: (Finish, Finish),
        span: (Ticks, Ticks),
        rule: Option<RuleId>,
    ) -> Result<(), Clash> {
        let (from, to) = (self.end(ends.0), self.end(ends.1));
        if span == (0, 0) {
            for (one, other) in [(to, from), (from, to)] {
                let at = self.finishes[usize::from(one)].clone();
                self.within_from(other, (at.min, &at.lows), (at.max, &at.highs), rule)?;
            }
            if from != to && !self.is_fixed(from) {
                self.finishes[usize::from(to)].same = Some(from);
            }
            return Ok(());
        }
        let gap = Gap {
            from,
            to,
            min: span.0,
            max: span.1,
            rule: rule.unwrap_or_default(),
        };
        self.keep(&gap)?;
        self.gaps.push(gap);
        Ok(())
    }
}

/// Takes over from where a time may be, too.
fn join(fars: &mut Fars, others: &[Far]) {
    for &other in others {
        if !fars.contains(&other) {
            fars.push(other);
        }
    }
}

/// Whether a far earliest and a far latest end can be compared without knowing when they are.
fn are_comparable(lows: &[Far], highs: &[Far]) -> bool {
    let all_ahead = { lows.iter().chain(highs) }.all(|at| matches!(at, Far::Ahead(_)));
    all_ahead || (lows.len() == 1 && lows == highs)
}

/// A time and a distance, either of which may have no bound.
pub(in crate::service) fn later(time: Ticks, by: Ticks) -> Ticks {
    match (time, by) {
        (Ticks::MIN | Ticks::MAX, _) => time,
        // The negation of no bound below is none above.
        (_, Ticks::MIN) => Ticks::MIN,
        (_, Ticks::MAX) => Ticks::MAX,
        _ if by == -Ticks::MAX => Ticks::MIN,
        _ => time.saturating_add(by),
    }
}

/// Least and most ticks from one end to the other.
pub(in crate::service) fn span(distance: &farside_planning::model::Distance) -> (Ticks, Ticks) {
    let bound = |bound, none| constant(bound, none).unwrap_or(none);
    // One more than the least, so that it can be negated.
    let none = -Ticks::MAX;
    let (min, max) = (bound(distance.min, none), bound(distance.max, Ticks::MAX));
    if distance.backward {
        (-max, -min)
    } else {
        (min, max)
    }
}
