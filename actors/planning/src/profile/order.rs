//! What is known of the order of times of uses.

use super::UseId;
use crate::Ticks;
use crate::temporal::{Distances, Network, Point};

/// A time of a use: its start or its end.
#[derive(Debug, PartialEq, Eq)]
pub struct Moment<'a, O> {
    /// The use.
    pub of: UseId,
    /// Whose it is.
    pub owner: &'a O,
    /// Whether it is its end.
    pub is_end: bool,
}

// Derived, these would ask the same of `O`.
impl<O> Clone for Moment<'_, O> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<O> Copy for Moment<'_, O> {}

/// What is known of the order of the times of uses.
///
/// It need not say what a use's own times say, of which the end does not lie before the start, nor
/// what their spans say. Any function that says of two moments whether the first one lies after
/// the second one in no schedule is an order.
pub trait Order<O> {
    /// These are the moments that are asked about until the next call.
    fn begin(&mut self, _moments: &[Moment<'_, O>]) {}

    /// Calls `found` with the places of those among the moments that lie after the one at a place
    /// in no schedule.
    fn never_after(&mut self, moments: &[Moment<'_, O>], at: usize, found: impl FnMut(usize));
}

impl<O, F> Order<O> for F
where
    F: FnMut(Moment<'_, O>, Moment<'_, O>) -> bool,
{
    fn never_after(&mut self, moments: &[Moment<'_, O>], at: usize, mut found: impl FnMut(usize)) {
        for (place, one) in moments.iter().enumerate() {
            if place != at && self(*one, moments[at]) {
                found(place);
            }
        }
    }
}

/// Nothing is known: each time lies anywhere within its span.
#[derive(Clone, Copy, Debug, Default)]
pub struct Independent;

impl<O> Order<O> for Independent {
    fn never_after(&mut self, _: &[Moment<'_, O>], _: usize, _: impl FnMut(usize)) {}
}

/// The order that a temporal network implies, with all constraints together.
///
/// ```
/// use farside_planning::profile::{Exact, InNetwork, Moment, Profile, Use};
/// use farside_planning::temporal::{Network, Span};
/// let mut network = Network::new(Span::new(0, 100));
/// // Two uses of 10 ticks, the second one after the first one.
/// let uses = [(); 2].map(|()| [network.add_point(), network.add_point()]);
/// for [start, end] in uses {
///     network.constrain(start, end, Span::exactly(10), ()).unwrap();
/// }
/// network.constrain(uses[0][1], uses[1][0], Span::at_least(0), ()).unwrap();
/// let mut lane = Profile::new(1, Span::at_least(0));
/// for (owner, [start, end]) in uses.into_iter().enumerate() {
///     let times = [network.bounds(start), network.bounds(end)];
///     lane.add(Use::renewable(times[0], times[1], Span::exactly(1)), owner).unwrap();
/// }
/// assert!(lane.first_over_use(0).is_some());
/// let place = |moment: Moment<'_, usize>| (uses[*moment.owner][usize::from(moment.is_end)], 0);
/// let mut order = InNetwork::new(&network, place);
/// assert_eq!(Exact::new().first_over_use(&lane, 0, &mut order), None);
/// ```
#[derive(Debug)]
pub struct InNetwork<'a, N, F> {
    network: &'a Network<N>,
    place: F,
    distances: Distances,
    /// By moment: its point, and how many ticks after it.
    times: Vec<(Point, Ticks)>,
    /// The moments by their points.
    by_point: Vec<(Point, u32)>,
    /// The earliest time of all points, and the least that a moment is after one.
    earliest: Ticks,
    least_after: Ticks,
}

impl<'a, N: Clone, F> InNetwork<'a, N, F> {
    /// `place` says of a moment which point it is, and how many ticks after it: more than 0 for
    /// the end of what a rate-limited resource counts.
    pub fn new(network: &'a Network<N>, place: F) -> Self {
        InNetwork {
            network,
            place,
            distances: Distances::new(),
            times: Vec::new(),
            by_point: Vec::new(),
            earliest: 0,
            least_after: 0,
        }
    }

    /// What was looked at, with its counts.
    pub fn distances(&self) -> &Distances {
        &self.distances
    }
}

impl<O, N, F> Order<O> for InNetwork<'_, N, F>
where
    N: Clone,
    F: FnMut(Moment<'_, O>) -> (Point, Ticks),
{
    fn begin(&mut self, moments: &[Moment<'_, O>]) {
        self.times.clear();
        self.times
            .extend(moments.iter().map(|one| (self.place)(*one)));
        self.by_point.clear();
        let by_point = (0..).zip(&self.times).map(|(at, (point, _))| (*point, at));
        self.by_point.extend(by_point);
        self.by_point.sort_unstable();
        let earliest = |(point, _): &(Point, Ticks)| self.network.bounds(*point).min;
        self.earliest = self.times.iter().map(earliest).min().unwrap_or(0);
        let after = self.times.iter().map(|(_, after)| *after);
        self.least_after = after.min().unwrap_or(0);
    }

    fn never_after(&mut self, _: &[Moment<'_, O>], at: usize, mut found: impl FnMut(usize)) {
        let (from, after) = self.times[at];
        let most = after - self.least_after;
        let (times, by_point) = (&self.times, &self.by_point);
        self.distances.reach(
            self.network,
            from,
            most,
            self.earliest,
            |point, distance| {
                let first = by_point.partition_point(|one| one.0 < point);
                for (_, other) in by_point[first..].iter().take_while(|one| one.0 == point) {
                    let other = *other as usize;
                    if other != at && distance + times[other].1 <= after {
                        found(other);
                    }
                }
            },
        );
    }
}
