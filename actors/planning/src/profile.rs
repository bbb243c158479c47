//! Resource profiles: how low and how high the level of a resource can be at each tick, while the
//! times of its uses are still flexible.
//!
//! A profile knows of each use the spans of its times and of its amount, and keeps two envelopes:
//! at each tick the least and the greatest level that there can be if each time lies anywhere
//! within its span, whatever the others do. They are steps in a balanced tree, so that an edit
//! costs the logarithm of how many uses there are, and so does each question: the level at a tick,
//! the first tick from which on a limit may be broken.
//!
//! Times are seldom free of each other: a temporal network knows that one use ends before another
//! one begins, though both have wide spans. [`Exact`] takes that in. It gives the envelopes over
//! all schedules, for a cost that grows with how many times are open at a tick, and is therefore
//! asked only where the first kind says that a limit may be broken.
//!
//! Time is half open: what starts at tick `s` and ends at tick `e` is in force at `s` and no more
//! at `e`, so that one use may begin when another one ends.

mod critical;
mod exact;
mod flow;
mod intervals;
mod known;
mod order;
mod over_use;
mod steps;
#[cfg(test)]
mod tests;
mod trail;
mod tree;

use std::fmt;

pub use critical::critical_sets;
pub use exact::{Exact, ExactWork};
pub use order::{InNetwork, Independent, Moment, Order};
pub use over_use::{Bound, Contributor, OverUse};

use crate::Ticks;
use crate::arena::{Arena, Id};
use crate::temporal::Span;
use intervals::Interval;
use steps::{GREATEST, LEAST, Side, Step, Test};
use trail::Change;
use tree::Tree;

/// How far from 0 the initial level can be, and what the amounts of all uses can add up to: sums
/// of levels do not overflow.
pub const MOST: i64 = 1 << 60;

/// What is done to a resource: its level changes at a time for good, or from a time to another.
///
/// ```
/// use farside_planning::profile::Use;
/// use farside_planning::temporal::Span;
/// // Two units of a renewable resource, which come back at the end.
/// let heater = Use::renewable(Span::new(10, 20), Span::new(40, 50), Span::exactly(2));
/// assert_eq!(heater.change, Span::exactly(-2));
/// // What is taken counts for a hundred ticks.
/// let start = Use::rate_limited(Span::new(10, 20), 100, Span::exactly(1));
/// assert_eq!(start.end, Some(Span::new(110, 120)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Use {
    /// When the change happens.
    pub start: Span,
    /// When it is taken back; none if it is for good.
    pub end: Option<Span>,
    /// How much is added to the level; what is used is below 0.
    pub change: Span,
}

impl Use {
    /// Takes `amount` of a renewable resource, from a start to an end.
    pub fn renewable(start: Span, end: Span, amount: Span) -> Use {
        Use {
            start,
            end: Some(end),
            change: negated(amount),
        }
    }

    /// Takes `amount` of a rate-limited resource: it counts for `window_ticks`.
    pub fn rate_limited(at: Span, window_ticks: Ticks, amount: Span) -> Use {
        let later = |time: Ticks| time.saturating_add(window_ticks);
        Use::renewable(at, Span::new(later(at.min), later(at.max)), amount)
    }

    /// Takes `amount` of a depletable resource, for good.
    pub fn consumption(at: Span, amount: Span) -> Use {
        Use {
            start: at,
            end: None,
            change: negated(amount),
        }
    }

    /// Gives `amount` to a depletable resource, for good.
    pub fn production(at: Span, amount: Span) -> Use {
        Use {
            start: at,
            end: None,
            change: amount,
        }
    }

    /// What it changes the level by at the worst, for a side.
    fn worst(&self, side: Side) -> i64 {
        [self.change.min, self.change.max][side]
    }

    /// The same where it may as well not be in force.
    fn worst_if_any(&self, side: Side) -> i64 {
        match side {
            LEAST => self.change.min.min(0),
            _ => self.change.max.max(0),
        }
    }

    /// The largest change either way.
    fn magnitude(&self) -> i128 {
        let [min, max] = [self.change.min, self.change.max].map(|change| i128::from(change).abs());
        min.max(max)
    }

    /// When it starts, or when it ends, if it does.
    fn time(&self, is_end: bool) -> Option<Span> {
        if is_end { self.end } else { Some(self.start) }
    }

    /// The ticks at which it may be in force.
    fn possible(&self) -> Span {
        let last = self.end.map_or(Ticks::MAX, |end| end.max.saturating_sub(1));
        Span::new(self.start.min, last)
    }

    /// The ticks at which it is in force in every schedule.
    fn certain(&self) -> Span {
        let last = self.end.map_or(Ticks::MAX, |end| end.min.saturating_sub(1));
        Span::new(self.start.max, last)
    }

    /// What it does to the envelopes, in any order; twice the same tick may be among them.
    fn steps(&self) -> [Step; 4] {
        let (mut possible, mut certain) = ([0; 2], [0; 2]);
        for side in [LEAST, GREATEST] {
            let if_any = self.worst_if_any(side);
            if !self.possible().is_empty() {
                possible[side] = if_any;
            }
            if !self.certain().is_empty() {
                certain[side] = self.worst(side) - if_any;
            }
        }
        let step = |tick, change, times| Step {
            tick,
            change,
            times,
        };
        let [first, second] = [
            step(self.start.min, possible, 1),
            step(self.start.max, certain, 1),
        ];
        let back = |change: [i64; 2]| change.map(|change| -change);
        let [third, fourth] = match self.end {
            Some(end) => [
                step(end.min, back(certain), 1),
                step(end.max, back(possible), 1),
            ],
            None => [step(self.start.max, [0; 2], 0); 2],
        };
        [first, second, third, fourth]
    }
}

/// With the other sign; one without a bound stays so, and is refused later.
fn negated(amount: Span) -> Span {
    Span::new(
        amount.max.checked_neg().unwrap_or(i64::MAX),
        amount.min.checked_neg().unwrap_or(i64::MAX),
    )
}

/// A use of a resource, in a [`Profile`].
pub type UseId = Id<Use>;

/// Why a use is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UseError {
    /// A time or the amount has no value at all.
    #[error("{0:?} holds no value: expected a least value that is not above the greatest one")]
    Empty(Span),
    /// It may end before it starts.
    #[error(
        "it starts within {start:?} and ends within {end:?}: expected an end that has neither \
             an earlier earliest time nor an earlier latest one"
    )]
    EndsBeforeStart {
        /// When it starts.
        start: Span,
        /// When it ends.
        end: Span,
    },
    /// The amounts of all uses add up to too much.
    #[error("with a change of {change:?} the amounts add up to {total}: expected at most {MOST}")]
    TooMuch {
        /// That of the use that is refused.
        change: Span,
        /// What they would add up to.
        total: i128,
    },
}

/// How much edits and questions looked at: counts that say whether work follows the change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// How often a step of the envelopes or an interval of a use changed: so many paths in a tree.
    pub changes: u64,
    /// How often a node of the envelopes was looked at.
    pub steps: u64,
    /// How often a node of the trees of intervals was looked at, by which uses are found.
    pub intervals: u64,
}

/// The profile of a resource. `O` says whose a use is: a token, a line of a model.
///
/// ```
/// use farside_planning::profile::{Bound, Profile, Use};
/// use farside_planning::temporal::Span;
/// // A bus of 500 watts, none of which can be missing.
/// let mut power = Profile::new(500, Span::at_least(0));
/// let fixed = |from, to, watts| {
///     Use::renewable(Span::exactly(from), Span::exactly(to), Span::exactly(watts))
/// };
/// power.add(fixed(0, 60, 300), "heater")?;
/// // Starts between 30 and 90, and takes 40 ticks.
/// let drive = Use::renewable(Span::new(30, 90), Span::new(70, 130), Span::exactly(250));
/// let drive = power.add(drive, "drive")?;
/// assert_eq!(power.level(50), Span::new(-50, 200));
///
/// let over_use = power.first_over_use(0).unwrap();
/// assert_eq!((over_use.during, over_use.amount), (Span::new(30, 59), 50));
/// assert_eq!((over_use.bound, over_use.is_certain), (Bound::Least, false));
/// let owners: Vec<_> = over_use.contributors.iter().map(|one| one.owner).collect();
/// assert_eq!(owners, ["heater", "drive"]);
///
/// // Moved to where the heater is off.
/// power.update(drive, Use::renewable(Span::new(60, 90), Span::new(100, 130), Span::exactly(250)))?;
/// assert_eq!(power.first_over_use(0), None);
/// # Ok::<(), farside_planning::profile::UseError>(())
/// ```
#[derive(Clone)]
pub struct Profile<O> {
    initial: i64,
    limits: Span,
    uses: Arena<Use>,
    /// By the place of a use.
    owners: Vec<O>,
    /// What the amounts add up to.
    magnitude: i128,
    steps: Tree<Step>,
    /// When uses may be in force, by their places.
    in_force: Tree<Interval>,
    /// When it is open whether a time has passed: twice the place of its use, and one more for an
    /// end.
    open: Tree<Interval>,
    changes: u64,
    trail: Vec<Change<O>>,
    /// How long the trail was at each push.
    levels: Vec<usize>,
}

impl<O: Clone> Profile<O> {
    /// Without uses: the level is `initial` at all ticks, and must stay within `limits`.
    ///
    /// # Panics
    ///
    /// If the initial level is further than [`MOST`] from 0.
    pub fn new(initial: i64, limits: Span) -> Self {
        assert!(
            (-MOST..=MOST).contains(&initial),
            "an initial level of {initial}: expected one within {MOST} of 0"
        );
        Profile {
            initial,
            limits,
            uses: Arena::new(),
            owners: Vec::new(),
            magnitude: 0,
            steps: Tree::default(),
            in_force: Tree::default(),
            open: Tree::default(),
            changes: 0,
            trail: Vec::new(),
            levels: Vec::new(),
        }
    }

    /// The level before all uses.
    pub fn initial(&self) -> i64 {
        self.initial
    }

    /// Within which the level must stay.
    pub fn limits(&self) -> Span {
        self.limits
    }

    /// How many uses there are.
    pub fn len(&self) -> usize {
        self.uses.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.uses.is_empty()
    }

    /// A use, if it is there.
    pub fn get(&self, id: UseId) -> Option<&Use> {
        self.uses.get(id)
    }

    /// Whose a use is, if it is there.
    pub fn owner(&self, id: UseId) -> Option<&O> {
        self.uses.get(id)?;
        self.owners.get(id.index())
    }

    /// All uses, place by place.
    pub fn uses(&self) -> impl Iterator<Item = (UseId, &Use, &O)> {
        let uses = self.uses.iter();
        uses.map(|(id, one)| (id, one, &self.owners[id.index()]))
    }

    /// Takes a use in.
    ///
    /// # Errors
    ///
    /// If one of its spans is empty, it may end before it starts, or amounts add up to more than
    /// [`MOST`]: the profile is as before.
    pub fn add(&mut self, one: Use, owner: O) -> Result<UseId, UseError> {
        self.check(None, &one)?;
        let id = self.uses.insert(one);
        if id.index() == self.owners.len() {
            self.owners.push(owner);
        } else {
            self.owners[id.index()] = owner;
        }
        self.put_in(id, None, Some(one));
        self.note(Change::Added(id));
        Ok(id)
    }

    /// Gives a use other times or another amount. What stays costs nothing.
    ///
    /// # Errors
    ///
    /// As those of [`add`](Self::add).
    ///
    /// # Panics
    ///
    /// If it is not there.
    pub fn update(&mut self, id: UseId, one: Use) -> Result<(), UseError> {
        let old = *self.uses.get(id).expect("the use is there");
        if old != one {
            self.check(Some(&old), &one)?;
            self.replace(id, one);
            self.note(Change::Updated(id, old));
        }
        Ok(())
    }

    /// Takes a use out, whenever it was added.
    ///
    /// # Panics
    ///
    /// If it is not there.
    pub fn remove(&mut self, id: UseId) {
        let old = self.uses.remove(id).expect("the use is there");
        self.put_in(id, Some(old), None);
        if self.depth() > 0 {
            let owner = self.owners[id.index()].clone();
            self.note(Change::Removed(id, old, owner));
        }
    }

    /// Takes a use out whose times have all passed at a tick; whether it did. What it changed for
    /// good becomes part of the initial level, if it is known exactly, and the use stays otherwise.
    /// From that tick on levels are as before; earlier ones must not be asked for any more.
    ///
    /// ```
    /// use farside_planning::profile::{Profile, Use};
    /// use farside_planning::temporal::Span;
    /// let mut memory = Profile::new(100, Span::new(0, 100));
    /// let picture = Use::consumption(Span::exactly(5), Span::exactly(40));
    /// let picture = memory.add(picture, "picture").unwrap();
    /// assert!(!memory.forget(picture, 4));
    /// assert!(memory.forget(picture, 5));
    /// assert_eq!((memory.len(), memory.level(5)), (0, Span::exactly(60)));
    /// ```
    ///
    /// # Panics
    ///
    /// If it is not there.
    pub fn forget(&mut self, id: UseId, before: Ticks) -> bool {
        let one = *self.uses.get(id).expect("the use is there");
        let stays = one.end.is_none();
        let initial = self.initial + if stays { one.change.max } else { 0 };
        let is_known = !stays || one.change.min == one.change.max;
        if one.end.unwrap_or(one.start).max > before
            || !is_known
            || !(-MOST..=MOST).contains(&initial)
        {
            return false;
        }
        self.remove(id);
        if initial != self.initial {
            self.note(Change::Initial(self.initial));
            self.initial = initial;
        }
        true
    }

    /// The least and the greatest level at a tick, with what happens at that tick, if each time
    /// lies anywhere within its span.
    pub fn level(&self, tick: Ticks) -> Span {
        let sums = self.steps.until(tick);
        Span::new(self.initial + sums[LEAST], self.initial + sums[GREATEST])
    }

    /// The least and the greatest level at the ticks of a span, in the same sense.
    ///
    /// # Panics
    ///
    /// If the span is empty.
    pub fn levels(&self, during: Span) -> Span {
        assert!(!during.is_empty(), "{during:?}: expected at least one tick");
        let first = self.level(during.min);
        let range = (during.min, during.max);
        let later = |side, test| self.steps.extreme(range, side, self.initial, test);
        let least = later(LEAST, Test::Below(0)).map_or(first.min, |level| level.min(first.min));
        let most = later(GREATEST, Test::Above(0)).map_or(first.max, |level| level.max(first.max));
        Span::new(least, most)
    }

    /// The envelopes as steps: from each of these ticks on the level is within the span. Before the
    /// first one it is the initial one.
    pub fn envelope(&self) -> impl Iterator<Item = (Ticks, Span)> {
        let mut level = [self.initial; 2];
        self.steps.entries().map(move |step| {
            for side in [LEAST, GREATEST] {
                level[side] += step.change[side];
            }
            (step.tick, Span::new(level[LEAST], level[GREATEST]))
        })
    }

    /// How much was looked at since the profile was made.
    pub fn work(&self) -> Work {
        Work {
            changes: self.changes,
            steps: self.steps.looked_at(),
            intervals: self.in_force.looked_at() + self.open.looked_at(),
        }
    }

    fn check(&self, old: Option<&Use>, one: &Use) -> Result<(), UseError> {
        let spans = [Some(one.start), one.end, Some(one.change)];
        if let Some(span) = spans.into_iter().flatten().find(|span| span.is_empty()) {
            return Err(UseError::Empty(span));
        }
        let start = one.start;
        if let Some(end) = one.end
            && (end.min < start.min || end.max < start.max)
        {
            return Err(UseError::EndsBeforeStart { start, end });
        }
        let total = self.magnitude + one.magnitude() - old.map_or(0, Use::magnitude);
        if total > i128::from(MOST) {
            let change = one.change;
            return Err(UseError::TooMuch { change, total });
        }
        Ok(())
    }

    fn replace(&mut self, id: UseId, one: Use) {
        let slot = self.uses.get_mut(id).expect("the use is there");
        let old = std::mem::replace(slot, one);
        self.put_in(id, Some(old), Some(one));
    }

    /// Makes the trees say what a use is now, and no more what it was.
    fn put_in(&mut self, id: UseId, old: Option<Use>, new: Option<Use>) {
        let place = id.index() as u32;
        let magnitude = |one: &Option<Use>| one.as_ref().map_or(0, Use::magnitude);
        self.magnitude += magnitude(&new) - magnitude(&old);
        self.put_steps(old.as_ref(), new.as_ref());
        let possible = |one: &Option<Use>| one.as_ref().map(Use::possible);
        self.changes += put_interval(&mut self.in_force, place, possible(&old), possible(&new));
        for is_end in [false, true] {
            let open = |one: &Option<Use>| {
                let span = one.as_ref()?.time(is_end)?;
                Some(Span::new(span.min, span.max.saturating_sub(1)))
            };
            let of = 2 * place + u32::from(is_end);
            self.changes += put_interval(&mut self.open, of, open(&old), open(&new));
        }
    }

    /// Adds the steps of a use and takes those of another one back, each tick once.
    fn put_steps(&mut self, old: Option<&Use>, new: Option<&Use>) {
        let none = Step {
            tick: Ticks::MAX,
            change: [0; 2],
            times: 0,
        };
        let mut all = [none; 8];
        if let Some(new) = new {
            all[..4].copy_from_slice(&new.steps());
        }
        if let Some(old) = old {
            all[4..].copy_from_slice(&old.steps().map(|step| Step {
                change: step.change.map(|change| -change),
                times: -step.times,
                ..step
            }));
        }
        all.sort_unstable_by_key(|step| step.tick);
        let mut at = 0;
        while at < all.len() {
            let mut step = all[at];
            at += 1;
            while at < all.len() && all[at].tick == step.tick {
                tree::Entry::merge(&mut step, &all[at]);
                at += 1;
            }
            if step.times != 0 || step.change != [0; 2] {
                self.steps.put(step);
                self.changes += 1;
            }
        }
    }
}

/// Gives an interval another extent; an empty one is in no tree. It says how often it had to go
/// through the tree.
fn put_interval(tree: &mut Tree<Interval>, of: u32, old: Option<Span>, new: Option<Span>) -> u64 {
    let [old, new] = [old, new].map(|span| span.filter(|span| !span.is_empty()));
    let mut changes = 0;
    if old == new {
        return changes;
    }
    if let Some(old) = old
        && new.is_none_or(|new| new.min != old.min)
    {
        tree.remove((old.min, of));
        changes += 1;
    }
    if let Some(new) = new {
        tree.put(Interval {
            first: new.min,
            last: new.max,
            of,
        });
        changes += 1;
    }
    changes
}

impl<O: fmt::Debug> fmt::Debug for Profile<O> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Profile")
            .field("initial", &self.initial)
            .field("limits", &self.limits)
            .field("uses", &self.uses.len())
            .finish_non_exhaustive()
    }
}
