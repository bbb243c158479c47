//! Why an edit was refused: a cycle of inequalities that cannot all hold.

use std::fmt;

use super::{EARLIEST, Half, NONE, Network, ORIGIN, Point, Side};
use crate::Ticks;

/// An inequality of a cycle: `to - from` is at least `at_least`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Link<O> {
    /// The point that it leads from.
    pub from: Point,
    /// The point that it leads to.
    pub to: Point,
    /// How many ticks are between them at least; below 0, how many `from` is later at most.
    pub at_least: Ticks,
    /// Whose constraint it is of; none, if it is the horizon, or within what a point was added.
    pub owner: Option<O>,
}

/// A cycle of inequalities whose sum is above 0: going around, a point would lie after itself. It
/// passes each point once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Conflict<O> {
    /// The inequalities, each leading to where the next one starts, the last to where the first
    /// one does.
    pub cycle: Vec<Link<O>>,
}

impl<O> Conflict<O> {
    /// Whose constraints cannot all hold, in the order of the cycle.
    pub fn owners(&self) -> impl Iterator<Item = &O> {
        self.cycle.iter().filter_map(|link| link.owner.as_ref())
    }

    /// By how many ticks they miss.
    pub fn excess(&self) -> Ticks {
        self.cycle.iter().map(|link| link.at_least).sum()
    }

    /// Leaves out what makes it longer than it must be: parts that lead back to where they start.
    fn simple(walk: Vec<Link<O>>) -> Self {
        let mut cycle: Vec<Link<O>> = Vec::new();
        for link in walk {
            let to = link.to;
            cycle.push(link);
            let Some(start) = cycle.iter().position(|link| link.from == to) else {
                continue;
            };
            let excess: Ticks = cycle[start..].iter().map(|link| link.at_least).sum();
            if excess > 0 {
                cycle.drain(..start);
                return Conflict { cycle };
            }
            cycle.truncate(start);
        }
        Conflict { cycle }
    }
}

impl<O: fmt::Debug> fmt::Display for Conflict<O> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let excess = self.excess();
        write!(f, "these cannot all hold, by {excess} ticks:")?;
        for link in &self.cycle {
            match &link.owner {
                Some(owner) => write!(f, " {owner:?}")?,
                None => f.write_str(" (the horizon)")?,
            }
            write!(
                f,
                " [{:?} to {:?}: at least {}]",
                link.from, link.to, link.at_least
            )?;
        }
        Ok(())
    }
}

impl<O: fmt::Debug> std::error::Error for Conflict<O> {}

impl<O: Clone> Network<O> {
    /// The growth of a value came back to `point`, where the inequality that is new starts.
    pub(super) fn around(&self, side: Side, point: u32, new: Half) -> Conflict<O> {
        let mut walk = Vec::new();
        let mut at = point;
        // What grew rests on what grew before it; the first of all rests on the new inequality.
        while let Some(half) = self.node(at).by[side] {
            walk.push(self.link_of(half));
            at = self.halves[half as usize].source(side);
            if half == new {
                break;
            }
        }
        // On the side of the latest times, what a value rests on comes after it.
        if side == EARLIEST {
            walk.reverse();
        }
        Conflict::simple(walk)
    }

    /// The growth of a point's value, by an inequality that is new, took its earliest time beyond
    /// its latest. The origin's are both 0.
    pub(super) fn crossed(&self, side: Side, point: u32, new: Half) -> Conflict<O> {
        let start = self.halves[new as usize].source(side);
        let mut walk = Vec::new();
        self.roots(side, point, start, &mut walk);
        let mut rest = Vec::new();
        self.roots(1 - side, point, NONE, &mut rest);
        let (mut back, on) = if side == EARLIEST {
            (walk, rest)
        } else {
            (rest, walk)
        };
        back.reverse();
        back.extend(on);
        Conflict::simple(back)
    }

    /// From a point along what its value rests on, to the origin: through the horizon, if that is
    /// what it rests on in the end.
    ///
    /// While values grow, what those at `start` rest on may have grown already, by what starts
    /// there: the way leads back then, and ends.
    fn roots(&self, side: Side, point: u32, start: u32, walk: &mut Vec<Link<O>>) {
        let mut at = point;
        let mut was_at_start = point == start;
        while let Some(half) = self.node(at).by[side] {
            walk.push(self.link_of(half));
            at = self.halves[half as usize].source(side);
            if at == start && std::mem::replace(&mut was_at_start, true) {
                return;
            }
        }
        if at != ORIGIN {
            walk.push(self.link_of_horizon(side, at));
        }
    }

    fn link_of(&self, half: Half) -> Link<O> {
        let inequality = &self.halves[half as usize];
        let id = |place: u32| {
            self.nodes
                .id_at(place as usize)
                .expect("the point is there")
        };
        Link {
            from: id(inequality.from),
            to: id(inequality.to),
            at_least: inequality.gap,
            owner: self.owners.get(half as usize / 2).cloned(),
        }
    }

    fn link_of_horizon(&self, side: Side, point: u32) -> Link<O> {
        let at_least = self.node(point).base[side];
        let point = self
            .nodes
            .id_at(point as usize)
            .expect("the point is there");
        let (from, to) = if side == EARLIEST {
            (self.origin, point)
        } else {
            (point, self.origin)
        };
        Link {
            from,
            to,
            at_least,
            owner: None,
        }
    }
}
