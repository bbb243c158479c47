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

/// What is known of the order of the times of uses. Of a use's own it need not say that it does
/// not end before it starts.
///
/// Any function that says of two moments whether the first one lies after the second one in no
/// schedule is one.
pub trait Order<O> {
    /// Calls `found` with the places of those among `moments` that lie after `moment` in no
    /// schedule. That a moment does not lie after itself need not be said.
    fn never_after(
        &mut self,
        moments: &[Moment<'_, O>],
        moment: Moment<'_, O>,
        found: impl FnMut(usize),
    );
}

impl<O, F> Order<O> for F
where
    F: FnMut(Moment<'_, O>, Moment<'_, O>) -> bool,
{
    fn never_after(
        &mut self,
        moments: &[Moment<'_, O>],
        moment: Moment<'_, O>,
        mut found: impl FnMut(usize),
    ) {
        for (place, one) in moments.iter().enumerate() {
            if self(*one, moment) {
                found(place);
            }
        }
    }
}

/// Nothing is known: each time lies anywhere within its span.
#[derive(Clone, Copy, Debug, Default)]
pub struct Independent;

impl<O> Order<O> for Independent {
    fn never_after(&mut self, _: &[Moment<'_, O>], _: Moment<'_, O>, _: impl FnMut(usize)) {}
}

/// The order that a temporal network implies, with all constraints together.
#[derive(Debug)]
pub struct InNetwork<'a, N, F> {
    network: &'a Network<N>,
    place: F,
    distances: Distances,
    points: Vec<Point>,
    offsets: Vec<Ticks>,
}

impl<'a, N: Clone, F> InNetwork<'a, N, F> {
    /// `place` says of a moment which point it is, and how many ticks after it: more than 0 for
    /// the end of what a rate-limited resource counts.
    pub fn new(network: &'a Network<N>, place: F) -> Self {
        InNetwork {
            network,
            place,
            distances: Distances::new(),
            points: Vec::new(),
            offsets: Vec::new(),
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
    fn never_after(
        &mut self,
        moments: &[Moment<'_, O>],
        moment: Moment<'_, O>,
        mut found: impl FnMut(usize),
    ) {
        self.points.clear();
        self.offsets.clear();
        for one in moments {
            let (point, offset) = (self.place)(*one);
            self.points.push(point);
            self.offsets.push(offset);
        }
        let (from, offset) = (self.place)(moment);
        // They may lie so many ticks after the point as their own offsets take back.
        let Some(least) = self.offsets.iter().min() else {
            return;
        };
        let (most, offsets) = (offset - least, &self.offsets);
        self.distances
            .greatest(self.network, from, &self.points, most, |place, greatest| {
                if greatest + offsets[place] <= offset {
                    found(place);
                }
            });
    }
}
