//! What is known of the order of the times that are open within some ticks.

use std::ops::Range;

use super::{Moment, Order, Profile};
use crate::temporal::Span;

/// Times of which it is open within some ticks whether they have passed, and what is known of their
/// order: asked once for each.
#[derive(Clone, Debug, Default)]
pub(super) struct Known {
    /// By moment: twice the place of its use, and one more for an end. They rise.
    numbers: Vec<u32>,
    /// By moment: where in `never_after` its part is, once it was asked for.
    parts: Vec<Option<(usize, usize)>>,
    /// The places of moments that lie after one in no schedule.
    never_after: Vec<u32>,
}

impl Known {
    /// Begins with all that is open at a tick of a span.
    pub(super) fn begin<'a, O: Clone>(
        &mut self,
        profile: &'a Profile<O>,
        within: Span,
        order: &mut impl Order<O>,
    ) -> Vec<Moment<'a, O>> {
        self.numbers.clear();
        profile.open.overlapping(within, &mut self.numbers);
        self.numbers.sort_unstable();
        self.parts.clear();
        self.parts.resize(self.numbers.len(), None);
        self.never_after.clear();
        let moment = |&number: &u32| {
            let place = number as usize / 2;
            Moment {
                of: profile.uses.id_at(place).expect("the use is there"),
                owner: &profile.owners[place],
                is_end: number % 2 == 1,
            }
        };
        let moments: Vec<_> = self.numbers.iter().map(moment).collect();
        order.begin(&moments);
        moments
    }

    /// How many times there are.
    pub(super) fn len(&self) -> usize {
        self.numbers.len()
    }

    /// The moment of a number.
    pub(super) fn place(&self, number: u32) -> Option<u32> {
        let place = self.numbers.binary_search(&number).ok()?;
        Some(place as u32)
    }

    /// Where those are that lie after a moment in no schedule.
    pub(super) fn part<O>(
        &mut self,
        moments: &[Moment<'_, O>],
        at: u32,
        order: &mut impl Order<O>,
    ) -> Range<usize> {
        let at = at as usize;
        let (start, end) = self.parts[at].unwrap_or_else(|| {
            let start = self.never_after.len();
            // That the start of a use does not lie after its end need not be said.
            if at > 0 && moments[at].is_end && moments[at - 1].of == moments[at].of {
                self.never_after.push(at as u32 - 1);
            }
            order.never_after(moments, at, |other| self.never_after.push(other as u32));
            (start, self.never_after.len())
        });
        self.parts[at] = Some((start, end));
        start..end
    }

    /// What is at a place that [`part`](Self::part) named.
    pub(super) fn at(&self, place: usize) -> u32 {
        self.never_after[place]
    }
}
