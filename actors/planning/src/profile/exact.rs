//! The envelopes over all schedules.
//!
//! N. Muscettola, *Computing the Envelope for Stepwise-Constant Resource Allocations* (2002): of
//! the times that may lie before a tick or after it, those that lie before it in a schedule are a
//! set that holds with a time all that never lie after it, and each such set is one of a schedule,
//! if the distances are those that the temporal network implies. The worst level is that of the
//! worst set: a closure of most weight.

use super::flow::Flow;
use super::known::Known;
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
/// // The first one ends before the second one starts: none of its times lies after the other's.
/// let mut order = |a: Moment<'_, i32>, b: Moment<'_, i32>| *a.owner == 1 && *b.owner == 2;
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
    /// By moment: its place among those that are open at the present tick.
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
    /// How many times of uses were open then, added up over the ticks.
    pub open: u64,
    /// How many pairs of them have an order, added up too.
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
    /// Its place among the moments that are open within the ticks in question.
    moment: u32,
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
        let moments = self.begin(profile, Span::exactly(tick), order);
        self.level_of(profile, &moments, tick, order)
    }

    fn level_of<O: Clone>(
        &mut self,
        profile: &Profile<O>,
        moments: &[Moment<'_, O>],
        tick: Ticks,
        order: &mut impl Order<O>,
    ) -> Span {
        self.prepare(profile, moments, tick, order);
        let [least, greatest] = [LEAST, GREATEST].map(|side| self.extreme(profile, tick, side));
        Span::new(least, greatest)
    }

    /// The envelopes over all schedules as steps, as [`Profile::envelope`] gives them.
    pub fn envelope<O: Clone>(
        &mut self,
        profile: &Profile<O>,
        order: &mut impl Order<O>,
    ) -> Vec<(Ticks, Span)> {
        let moments = self.begin(profile, Span::ALL, order);
        let ticks = profile.steps.entries().map(|step| step.tick);
        ticks
            .map(|tick| (tick, self.level_of(profile, &moments, tick, order)))
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

    /// Begins with the times that are open at a tick of a span.
    fn begin<'a, O: Clone>(
        &mut self,
        profile: &'a Profile<O>,
        within: Span,
        order: &mut impl Order<O>,
    ) -> Vec<Moment<'a, O>> {
        let moments = self.known.begin(profile, within, order);
        self.open.clear();
        self.places.clear();
        self.places.resize(self.known.len(), None);
        moments
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
        let moments = self.begin(profile, run, order);
        let mut found: Option<OverUse<O>> = None;
        let mut tick = run.min;
        loop {
            self.prepare(profile, &moments, tick, order);
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
        moments: &[Moment<'_, O>],
        tick: Ticks,
        order: &mut impl Order<O>,
    ) {
        for one in &self.open {
            self.places[one.moment as usize] = None;
        }
        self.found.clear();
        let at = Span::exactly(tick);
        profile.open.overlapping(at, &mut self.found);
        // The start of a use comes before its end.
        self.found.sort_unstable();
        self.open.clear();
        for &number in &self.found {
            let Some(moment) = self.known.place(number) else {
                continue;
            };
            self.places[moment as usize] = Some(self.open.len() as u32);
            self.open.push(Open {
                place: number / 2,
                is_end: number % 2 == 1,
                moment,
            });
        }
        self.needs.clear();
        for (place, one) in (0..).zip(&self.open) {
            for at in self.known.part(moments, one.moment, order) {
                let other = self.known.at(at);
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
