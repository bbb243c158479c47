//! The envelopes over all schedules.
//!
//! N. Muscettola, *Computing the Envelope for Stepwise-Constant Resource Allocations* (2002): of
//! the times that may lie before a tick or after it, those that lie before it in a schedule are a
//! set that holds with a time all that never lie after it, and each such set is one of a schedule,
//! if the distances are those that the temporal network implies. The worst level is that of the
//! worst set: a closure of most weight.

use std::ops::Range;

use super::flow::Flow;
use super::steps::{GREATEST, LEAST, Side};
use super::{Bound, Contributor, Moment, Order, OverUse, Profile};
use crate::Ticks;
use crate::temporal::Span;

/// Finds the envelopes of profiles over all schedules; kept for its memory.
///
/// ```
/// use farside_planning::profile::{Exact, Moment, Profile, Use};
/// use farside_planning::temporal::Span;
/// // Two drives, one after the other, each somewhen.
/// let mut motor = Profile::new(1, Span::at_least(0));
/// let first = Use::renewable(Span::new(0, 60), Span::new(20, 80), Span::exactly(1));
/// let second = Use::renewable(Span::new(20, 80), Span::new(40, 100), Span::exactly(1));
/// motor.add(first, 1).unwrap();
/// motor.add(second, 2).unwrap();
/// assert_eq!(motor.level(50), Span::new(-1, 1));
/// // Of what is known, only that the first one ends before or when the second one starts.
/// let mut order = |a: Moment<'_, i32>, b: Moment<'_, i32>| {
///     *a.owner == 1 && *b.owner == 2 && !(!a.is_end && b.is_end)
/// };
/// let mut exact = Exact::new();
/// assert_eq!(exact.level(&motor, 50, &mut order), Span::new(0, 1));
/// assert_eq!(exact.first_over_use(&motor, 0, &mut order), None);
/// assert!(motor.first_over_use(0).is_some());
/// ```
#[derive(Clone, Debug, Default)]
pub struct Exact {
    /// The times that are open at a tick.
    open: Vec<Open>,
    /// Pairs of open times, by place: with the first one the second one lies before the tick too.
    needs: Vec<(u32, u32)>,
    weights: Vec<i64>,
    /// By place: whether it lies before the tick where the level is worst.
    chosen: Vec<bool>,
    known: Known,
    /// By the number of a time: its place among those that are open at the present tick.
    places: Vec<Option<u32>>,
    found: Vec<u32>,
    flow: Flow,
    work: ExactWork,
}

/// How much was looked at for exact levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExactWork {
    /// How often an extreme level was found.
    pub levels: u64,
    /// How many times of uses were open then, added up over the levels.
    pub open: u64,
    /// How many pairs of them were found to have an order.
    pub pairs: u64,
    /// How often an arc of a flow was looked at.
    pub arcs: u64,
}

/// A time of a use of which it is open whether it lies before a tick.
#[derive(Clone, Copy, Debug)]
struct Open {
    /// The place of the use.
    place: u32,
    is_end: bool,
}

impl Open {
    /// As the profile's tree of open times has it.
    fn of(number: u32) -> Self {
        Open {
            place: number / 2,
            is_end: number % 2 == 1,
        }
    }

    fn number(self) -> u32 {
        2 * self.place + u32::from(self.is_end)
    }
}

/// What is known of the order of times that are open at some ticks: asked once for each.
#[derive(Clone, Debug, Default)]
struct Known {
    /// How often all was forgotten.
    pass: u64,
    /// By the number of a time: where in `never_after` its part is, and in which pass it was asked
    /// for.
    parts: Vec<(u64, usize, usize)>,
    /// The numbers of times that lie after one in no schedule.
    never_after: Vec<u32>,
    others: Vec<u32>,
}

impl Known {
    /// Forgets all.
    fn begin(&mut self, times: usize) {
        self.pass += 1;
        self.never_after.clear();
        self.parts.resize(times.max(self.parts.len()), (0, 0, 0));
    }

    /// Where those are that lie after a time in no schedule, and are open at one of the ticks
    /// at which it is itself, `within` some.
    fn of<O: Clone>(
        &mut self,
        profile: &Profile<O>,
        one: Open,
        within: Span,
        order: &mut impl Order<O>,
    ) -> Range<usize> {
        let (pass, mut start, mut end) = self.parts[one.number() as usize];
        if pass != self.pass {
            start = self.never_after.len();
            self.ask(profile, one, within, order);
            end = self.never_after.len();
            self.parts[one.number() as usize] = (self.pass, start, end);
        }
        start..end
    }

    fn ask<O: Clone>(
        &mut self,
        profile: &Profile<O>,
        one: Open,
        within: Span,
        order: &mut impl Order<O>,
    ) {
        let moment = |one: Open| {
            let of = profile.uses.id_at(one.place as usize);
            Moment {
                of: of.expect("the use is there"),
                owner: &profile.owners[one.place as usize],
                is_end: one.is_end,
            }
        };
        let used = profile.uses.at(one.place as usize);
        let span = used.and_then(|used| used.time(one.is_end));
        let open = span.map(|span| Span::new(span.min, span.max - 1));
        self.others.clear();
        if let Some(open) = open {
            profile
                .open
                .overlapping(open.intersect(within), &mut self.others);
        }
        // Of a use's own, the start does not lie after the end: that need not be asked.
        let start = one.is_end.then(|| one.number() - 1);
        self.others
            .retain(|other| *other != one.number() && Some(*other) != start);
        self.never_after.extend(start);
        let others = self.others.iter().copied().map(Open::of);
        let moments: Vec<Moment<'_, O>> = others.map(moment).collect();
        order.never_after(&moments, moment(one), |other| {
            self.never_after.push(self.others[other]);
        });
    }
}

impl Exact {
    /// Without memory yet.
    pub fn new() -> Self {
        Exact::default()
    }

    /// The least and the greatest level at a tick over all schedules.
    ///
    /// The spans in the profile must be those that go with what `order` says: for a temporal
    /// network, its present bounds.
    pub fn level<O: Clone>(
        &mut self,
        profile: &Profile<O>,
        tick: Ticks,
        order: &mut impl Order<O>,
    ) -> Span {
        self.begin(profile);
        self.level_within(profile, tick, Span::exactly(tick), order)
    }

    fn level_within<O: Clone>(
        &mut self,
        profile: &Profile<O>,
        tick: Ticks,
        within: Span,
        order: &mut impl Order<O>,
    ) -> Span {
        self.prepare(profile, tick, within, order);
        let [least, greatest] = [LEAST, GREATEST].map(|side| self.extreme(profile, tick, side));
        Span::new(least, greatest)
    }

    /// The envelopes over all schedules as steps, as [`Profile::envelope`] gives them.
    pub fn envelope<O: Clone>(
        &mut self,
        profile: &Profile<O>,
        order: &mut impl Order<O>,
    ) -> Vec<(Ticks, Span)> {
        self.begin(profile);
        let ticks = profile.steps.entries().map(|step| step.tick);
        ticks
            .map(|tick| (tick, self.level_within(profile, tick, Span::ALL, order)))
            .collect()
    }

    /// The first over-use at or after a tick, of any limit, over all schedules: there is a schedule
    /// in which the limit is broken.
    ///
    /// Levels are found only where the profile's own envelopes are beyond a limit.
    pub fn first_over_use<O: Clone>(
        &mut self,
        profile: &Profile<O>,
        from: Ticks,
        order: &mut impl Order<O>,
    ) -> Option<OverUse<O>> {
        let least = self.first_over_use_of(profile, Bound::Least, from, order);
        let most = self.first_over_use_of(profile, Bound::Most, from, order);
        match (least, most) {
            (Some(least), Some(most)) if most.during.min < least.during.min => Some(most),
            (least, most) => least.or(most),
        }
    }

    /// The first over-use at or after a tick that breaks a certain limit, over all schedules.
    pub fn first_over_use_of<O: Clone>(
        &mut self,
        profile: &Profile<O>,
        bound: Bound,
        mut from: Ticks,
        order: &mut impl Order<O>,
    ) -> Option<OverUse<O>> {
        loop {
            let run = profile.beyond(bound, from)?;
            if let Some(found) = self.within(profile, bound, run, order) {
                return Some(found);
            }
            from = run.max.checked_add(1)?;
        }
    }

    /// How much was looked at since this was made.
    pub fn work(&self) -> ExactWork {
        ExactWork {
            arcs: self.flow.looked_at(),
            ..self.work
        }
    }

    /// Forgets what was known of the order of times, which may be another one now.
    fn begin<O: Clone>(&mut self, profile: &Profile<O>) {
        let times = 2 * profile.uses.places();
        self.known.begin(times);
        self.places.resize(times.max(self.places.len()), None);
    }

    /// The first over-use within ticks at which there may be one.
    fn within<O: Clone>(
        &mut self,
        profile: &Profile<O>,
        bound: Bound,
        run: Span,
        order: &mut impl Order<O>,
    ) -> Option<OverUse<O>> {
        let (side, test) = (bound.side(), bound.test(profile.limits));
        self.begin(profile);
        let mut found: Option<OverUse<O>> = None;
        let mut tick = run.min;
        loop {
            self.prepare(profile, tick, run, order);
            let level = self.extreme(profile, tick, side);
            if test.holds(level) {
                let amount = bound.excess(level, profile.limits);
                let over_use = found.get_or_insert(OverUse {
                    bound,
                    during: Span::new(tick, run.max),
                    amount,
                    worst_tick: tick,
                    is_certain: false,
                    contributors: Vec::new(),
                });
                if amount > over_use.amount || tick == over_use.during.min {
                    (over_use.amount, over_use.worst_tick) = (amount, tick);
                    over_use.contributors = self.contributors(profile, bound, tick);
                }
                over_use.is_certain |= test.holds(self.extreme(profile, tick, 1 - side));
            } else if let Some(over_use) = &mut found {
                over_use.during.max = tick - 1;
                return found;
            }
            match profile.steps.next(tick) {
                Some(next) if next <= run.max => tick = next,
                _ => return found,
            }
        }
    }

    /// What is in force when the level at a tick is worst, which was the last one found.
    fn contributors<O: Clone>(
        &mut self,
        profile: &Profile<O>,
        bound: Bound,
        tick: Ticks,
    ) -> Vec<Contributor<O>> {
        let (open, chosen) = (&self.open, &self.chosen);
        profile.contributors(bound, tick, |place| {
            let first = open.partition_point(|one| one.place < place);
            let own = open.iter().zip(chosen).skip(first);
            let mut is_in_force = true;
            for (one, chosen) in own.take_while(|(one, _)| one.place == place) {
                is_in_force &= *chosen != one.is_end;
            }
            is_in_force
        })
    }

    /// Gathers the times that are open at a tick, and what is known of their order.
    fn prepare<O: Clone>(
        &mut self,
        profile: &Profile<O>,
        tick: Ticks,
        within: Span,
        order: &mut impl Order<O>,
    ) {
        for one in &self.open {
            self.places[one.number() as usize] = None;
        }
        self.found.clear();
        let at = Span::exactly(tick);
        profile.open.overlapping(at, &mut self.found);
        // The start of a use comes before its end.
        self.found.sort_unstable();
        self.open.clear();
        self.open.extend(self.found.iter().copied().map(Open::of));
        for (place, one) in (0..).zip(&self.open) {
            self.places[one.number() as usize] = Some(place);
        }
        self.needs.clear();
        for (place, one) in (0..).zip(&self.open) {
            for at in self.known.of(profile, *one, within, order) {
                let other = self.known.never_after[at];
                if let Some(other) = self.places[other as usize] {
                    self.needs.push((place, other));
                }
            }
        }
        self.work.open += self.open.len() as u64;
        self.work.pairs += self.needs.len() as u64;
    }

    /// The least or the greatest level at a tick, whose open times were gathered.
    fn extreme<O: Clone>(&mut self, profile: &Profile<O>, tick: Ticks, side: Side) -> i64 {
        self.work.levels += 1;
        let mut base = profile.side_at(tick, side);
        self.weights.clear();
        let mut before = None;
        for one in &self.open {
            let Some(used) = profile.uses.at(one.place as usize) else {
                continue;
            };
            let change = used.worst(side);
            // The profile's own envelope has it in force if that is worse.
            if before != Some(one.place) {
                base -= used.worst_if_any(side);
                base += if one.is_end { change } else { 0 };
            }
            before = Some(one.place);
            self.weights
                .push(towards(side, if one.is_end { -change } else { change }));
        }
        let gained = self
            .flow
            .closure(&self.weights, &self.needs, &mut self.chosen);
        base + towards(side, gained)
    }
}

/// What is to be as large as it can be: for the least level, its negative.
fn towards(side: Side, level: i64) -> i64 {
    if side == LEAST { -level } else { level }
}
