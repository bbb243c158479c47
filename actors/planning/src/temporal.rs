//! A temporal network: points in time, and bounds on their differences.
//!
//! It knows of each point the earliest and the latest time at which it can lie, and keeps both up
//! to date edit by edit: with a new or tighter constraint, and when one is retracted, in any order.
//! An edit without a solution is refused, changes nothing, and is explained by a cycle of
//! constraints that cannot all hold.
//!
//! # How it works
//!
//! A constraint of two points is at most two inequalities `to >= from + gap`. The earliest times
//! are the longest paths from the horizon's start, the latest ones those to its end, and of each
//! point's bound the network knows the inequality that it rests on. The earliest times satisfy all
//! inequalities, so they are the potentials of Johnson's algorithm: an edit goes through the
//! points whose bounds change in the order of how much they change, and each is looked at once for
//! each bound (as in S. Cotton and O. Maler, *Fast and Flexible Difference Constraint Propagation
//! for DPLL(T)*, 2006). A retraction starts anew only the points whose bounds rested on what is
//! gone (G. Ramalingam and T. Reps, *An Incremental Algorithm for a Generalization of the
//! Shortest-Path Problem*, 1996).

mod conflict;
mod distance;
mod propagate;
mod span;
#[cfg(test)]
mod tests;
mod trail;

use std::fmt;

pub use conflict::{Conflict, Link};
pub use distance::Distances;
pub use span::Span;

use crate::Ticks;
use crate::arena::{Arena, Id};
use propagate::Scratch;
use span::negated;
use trail::{Change, Retracted};

/// The largest time and the largest bound, either way: sums of them do not overflow.
pub const FURTHEST: Ticks = 1 << 56;

/// A point in time.
pub type Point = Id<Node>;

/// A constraint of two points.
pub type Constraint = Id<Edge>;

/// What the network keeps of a point.
#[derive(Clone, Debug)]
pub struct Node {
    /// By side: what its value is without any constraint.
    base: [Ticks; 2],
    /// By [`Side`]: the earliest time, and the latest time's negative.
    value: [Ticks; 2],
    /// By side: the inequality that the value rests on; none if that is the base.
    by: [Option<Half>; 2],
    /// By side: the first of the inequalities that pass on a change of this value.
    first: [u32; 2],
}

/// What the network keeps of a constraint, but for its owner.
#[derive(Clone, Debug)]
pub struct Edge {
    from: Point,
    to: Point,
    span: Span,
}

/// An inequality: twice the place of its constraint, and one more if it is the constraint's
/// greatest difference, from its second point to its first.
type Half = u32;

/// A gap that every pair of points has.
const NOTHING: Ticks = -(FURTHEST << 2);

/// The place of the origin, which is the first point.
const ORIGIN: u32 = 0;

/// No inequality.
const NONE: u32 = u32::MAX;

/// An inequality `to >= from + gap`, with its neighbours in the lists of its points.
#[derive(Clone, Copy, Debug)]
struct Inequality {
    from: u32,
    to: u32,
    gap: Ticks,
    next: [u32; 2],
    before: [u32; 2],
}

/// Which bound: 0 for earliest times, which inequalities pass on from `from` to `to`; 1 for the
/// negatives of latest times, which they pass on from `to` to `from`. Both grow as the network gets
/// tighter.
type Side = usize;

const EARLIEST: Side = 0;
const LATEST: Side = 1;

/// The points whose bounds changed since somebody asked.
#[derive(Clone, Debug, Default)]
struct Changed {
    /// Their places, in the order in which they changed first.
    points: Vec<u32>,
    /// By place: whether it is among them.
    is_in: Vec<bool>,
}

impl Changed {
    fn add(&mut self, point: u32) {
        let place = point as usize;
        if self.is_in.len() <= place {
            self.is_in.resize(place + 1, false);
        }
        if !std::mem::replace(&mut self.is_in[place], true) {
            self.points.push(point);
        }
    }
}

/// How much an edit looked at: counts that say whether work follows the change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// How often a point's bound was set or started anew.
    pub points: u64,
    /// How often an inequality was looked at.
    pub inequalities: u64,
}

/// A temporal network. `O` says whose a constraint is: a token, a line of a model.
///
/// ```
/// use farside_planning::temporal::{Network, Span};
/// let mut network = Network::new(Span::new(0, 1_000));
/// let (start, end) = (network.add_point(), network.add_point());
/// network.constrain(start, end, Span::new(30, 40), "duration")?;
/// network.constrain(network.origin(), start, Span::at_least(100), "not before dawn")?;
/// assert_eq!(network.bounds(end), Span::new(130, 1_000));
/// let deadline = network.constrain(network.origin(), end, Span::at_most(120), "deadline");
/// let conflict = deadline.unwrap_err();
/// let owners: Vec<_> = conflict.owners().copied().collect();
/// assert_eq!(owners, ["deadline", "not before dawn", "duration"]);
/// // Refused, it changed nothing.
/// assert_eq!(network.bounds(end), Span::new(130, 1_000));
/// # Ok::<(), farside_planning::temporal::Conflict<&str>>(())
/// ```
#[derive(Clone)]
pub struct Network<O> {
    horizon: Span,
    origin: Point,
    nodes: Arena<Node>,
    edges: Arena<Edge>,
    /// By the place of a constraint.
    owners: Vec<O>,
    /// By half.
    halves: Vec<Inequality>,
    scratch: Scratch,
    changed: Changed,
    trail: Vec<Change>,
    /// What changes on the trail took away, the last one last.
    retracted: Vec<Retracted<O>>,
    removed_points: Vec<Node>,
    /// How long the trail was at each push.
    levels: Vec<usize>,
    work: Work,
}

impl<O: Clone> Network<O> {
    /// Without points but the origin, which lies at 0; all points lie within `horizon`.
    ///
    /// # Panics
    ///
    /// If the horizon is empty, does not hold 0, or reaches beyond [`FURTHEST`].
    pub fn new(horizon: Span) -> Self {
        assert!(
            horizon.contains(0) && horizon.min >= -FURTHEST && horizon.max <= FURTHEST,
            "{horizon:?}: expected a horizon that holds 0, within {FURTHEST} ticks of it"
        );
        let mut nodes = Arena::new();
        let origin = nodes.insert(Node {
            base: [0, 0],
            value: [0, 0],
            by: [None; 2],
            first: [NONE; 2],
        });
        Network {
            horizon,
            origin,
            nodes,
            edges: Arena::new(),
            owners: Vec::new(),
            halves: Vec::new(),
            scratch: Scratch::default(),
            changed: Changed::default(),
            trail: Vec::new(),
            retracted: Vec::new(),
            removed_points: Vec::new(),
            levels: Vec::new(),
            work: Work::default(),
        }
    }

    /// The point that lies at 0.
    pub fn origin(&self) -> Point {
        self.origin
    }

    /// The times within which all points lie.
    pub fn horizon(&self) -> Span {
        self.horizon
    }

    /// How many points there are, with the origin.
    pub fn points(&self) -> usize {
        self.nodes.len()
    }

    /// How many constraints there are.
    pub fn constraints(&self) -> usize {
        self.edges.len()
    }

    /// A new point, anywhere within the horizon.
    pub fn add_point(&mut self) -> Point {
        self.add_within(self.horizon)
    }

    /// A new point, which is known for good to lie within a span; none, if nothing of that lies
    /// within the horizon. That costs less than a constraint, and a conflict tells of it as of the
    /// horizon.
    ///
    /// ```
    /// use farside_planning::temporal::{Network, Span};
    /// let mut network = Network::<()>::new(Span::new(0, 100));
    /// let point = network.add_point_within(Span::at_least(7)).expect("there is room");
    /// assert_eq!(network.bounds(point), Span::new(7, 100));
    /// assert_eq!(network.add_point_within(Span::at_least(101)), None);
    /// ```
    pub fn add_point_within(&mut self, span: Span) -> Option<Point> {
        let within = self.horizon.intersect(span);
        (!within.is_empty()).then(|| self.add_within(within))
    }

    fn add_within(&mut self, span: Span) -> Point {
        let base = [span.min, -span.max];
        let point = self.nodes.insert(Node {
            base,
            value: base,
            by: [None; 2],
            first: [NONE; 2],
        });
        self.note(Change::PointAdded(point));
        point
    }

    /// Removes a point, with the constraints that it has.
    ///
    /// # Panics
    ///
    /// If it is the origin, or is not there.
    pub fn remove_point(&mut self, point: Point) {
        assert!(point != self.origin, "the origin stays");
        let start = self.trail.len();
        let place = point.index() as u32;
        for side in [EARLIEST, LATEST] {
            loop {
                let half = self.node(place).first[side];
                if half == NONE {
                    break;
                }
                let constraint = self.edges.id_at(half as usize / 2);
                self.detach(constraint.expect("a point's constraints are there"), place);
            }
        }
        self.settle(start);
        let node = self.nodes.remove(point).expect("the point is there");
        if self.depth() > 0 {
            self.removed_points.push(node);
            self.note(Change::PointRemoved(point));
        }
    }

    /// Whether all constraints of a point are with the origin.
    ///
    /// # Panics
    ///
    /// If it is not there.
    pub fn is_apart(&self, point: Point) -> bool {
        let node = self.nodes.get(point).expect("the point is there");
        let me = point.index() as u32;
        [EARLIEST, LATEST].into_iter().all(|side| {
            let mut half = node.first[side];
            while half != NONE {
                let inequality = &self.halves[half as usize];
                let other = inequality.from ^ inequality.to ^ me;
                if other != ORIGIN {
                    return false;
                }
                half = inequality.next[side];
            }
            true
        })
    }

    /// The earliest and the latest time of a point.
    ///
    /// # Panics
    ///
    /// If it is not there.
    #[inline]
    pub fn bounds(&self, point: Point) -> Span {
        let node = self.nodes.get(point).expect("the point is there");
        Span::new(node.value[EARLIEST], -node.value[LATEST])
    }

    /// The latest time of a point.
    ///
    /// # Panics
    ///
    /// If it is not there.
    #[inline]
    pub fn latest(&self, point: Point) -> Ticks {
        let node = self.nodes.get(point).expect("the point is there");
        -node.value[LATEST]
    }

    /// Within what a point was added: the horizon or less.
    ///
    /// # Panics
    ///
    /// If it is not there.
    pub fn added_within(&self, point: Point) -> Span {
        let node = self.nodes.get(point).expect("the point is there");
        Span::new(node.base[EARLIEST], -node.base[LATEST])
    }

    /// Whether a point is there.
    pub fn has_point(&self, point: Point) -> bool {
        self.nodes.get(point).is_some()
    }

    /// The constraints of a point, the last one first.
    pub fn constraints_of(&self, point: Point) -> Vec<Constraint> {
        let Some(node) = self.nodes.get(point) else {
            return Vec::new();
        };
        if point == self.origin {
            let all = self.edges.iter();
            let all = all.filter(|(_, edge)| edge.from == point || edge.to == point);
            let mut found: Vec<_> = all.map(|at| at.0).collect();
            found.reverse();
            return found;
        }
        let mut found = Vec::new();
        for side in [EARLIEST, LATEST] {
            let mut half = node.first[side];
            while half != NONE {
                found.extend(self.edges.id_at(half as usize / 2));
                half = self.halves[half as usize].next[side];
            }
        }
        // A constraint with both bounds is in both lists.
        found.sort_unstable_by(|a, b| b.cmp(a));
        found.dedup();
        found
    }

    /// The points and the span of a constraint, if it is there.
    pub fn constraint(&self, constraint: Constraint) -> Option<(Point, Point, Span)> {
        let edge = self.edges.get(constraint)?;
        Some((edge.from, edge.to, edge.span))
    }

    /// Whose a constraint is, if it is there.
    pub fn owner(&self, constraint: Constraint) -> Option<&O> {
        self.edges.get(constraint)?;
        self.owners.get(constraint.index())
    }

    /// Adds the constraint that `to - from` lies within `span`.
    ///
    /// # Errors
    ///
    /// If no times fit any more: the network is as before.
    ///
    /// # Panics
    ///
    /// If one of the points is not there.
    pub fn constrain(
        &mut self,
        from: Point,
        to: Point,
        span: Span,
        owner: O,
    ) -> Result<Constraint, Conflict<O>> {
        assert!(
            self.has_point(from) && self.has_point(to),
            "both points are there"
        );
        let start = self.trail.len();
        let edge = Edge {
            from,
            to,
            span: Span::ALL,
        };
        let constraint = self.edges.insert(edge);
        let place = constraint.index();
        if place == self.owners.len() {
            self.owners.push(owner);
            let unused = Inequality::between(NONE, NONE);
            self.halves.extend([unused, unused]);
        } else {
            self.owners[place] = owner;
        }
        let ends = [from.index() as u32, to.index() as u32];
        self.halves[2 * place] = Inequality::between(ends[0], ends[1]);
        self.halves[2 * place + 1] = Inequality::between(ends[1], ends[0]);
        self.trail.push(Change::Added(constraint));
        if span == Span::ALL {
            // Points know their constraints by inequalities: this one says nothing.
            self.set_gap(2 * place as u32, NOTHING);
        }
        match self.narrow(constraint, span) {
            Ok(()) => {
                self.settle(start);
                Ok(constraint)
            }
            Err(conflict) => {
                self.undo_to(start);
                Err(conflict)
            }
        }
    }

    /// Makes a constraint hold within `span` too.
    ///
    /// # Errors
    ///
    /// If no times fit any more: the network is as before.
    ///
    /// # Panics
    ///
    /// If it is not there.
    pub fn tighten(&mut self, constraint: Constraint, span: Span) -> Result<(), Conflict<O>> {
        let start = self.trail.len();
        let outcome = self.narrow(constraint, span);
        match outcome {
            Ok(()) => self.settle(start),
            Err(_) => self.undo_to(start),
        }
        outcome
    }

    /// Takes a constraint away, whenever it was added.
    ///
    /// # Panics
    ///
    /// If it is not there.
    pub fn retract(&mut self, constraint: Constraint) {
        assert!(
            self.edges.get(constraint).is_some(),
            "the constraint is there"
        );
        let start = self.trail.len();
        self.detach(constraint, NONE);
        self.settle(start);
    }

    /// Takes a constraint away; a point that goes with it need not be less tight than it was.
    fn detach(&mut self, constraint: Constraint, going: u32) {
        let kept = self.depth() > 0;
        for half in [
            2 * constraint.index() as u32,
            2 * constraint.index() as u32 + 1,
        ] {
            if self.halves[half as usize].is_linked() {
                self.unlink(half);
                if kept {
                    self.trail.push(Change::Unlinked(half));
                }
                for side in [EARLIEST, LATEST] {
                    if self.halves[half as usize].target(side) != going {
                        self.start_anew(side, half);
                    }
                }
            }
        }
        let place = constraint.index();
        let edge = self.edges.remove(constraint);
        if kept {
            self.retracted.push(Retracted {
                edge: edge.expect("the constraint is there"),
                halves: [self.halves[2 * place], self.halves[2 * place + 1]],
                owner: self.owners[place].clone(),
            });
            self.trail.push(Change::Removed(constraint));
        }
    }

    /// How much was looked at since the network was made.
    pub fn work(&self) -> Work {
        self.work
    }

    /// The points whose bounds changed since this was asked last and that are still there, in the
    /// order in which they changed first. What an undone edit changed may be among them.
    pub fn take_changed(&mut self, into: &mut Vec<Point>) {
        for point in self.changed.points.drain(..) {
            self.changed.is_in[point as usize] = false;
            into.extend(self.nodes.id_at(point as usize));
        }
    }

    /// The points and what is known of them, for comparing whole states.
    pub fn all_bounds(&self) -> impl Iterator<Item = (Point, Span)> {
        let of = |(point, node): (Point, &Node)| {
            (point, Span::new(node.value[EARLIEST], -node.value[LATEST]))
        };
        self.nodes.iter().map(of)
    }

    /// All constraints, place by place.
    pub fn all_constraints(&self) -> impl Iterator<Item = (Constraint, Point, Point, Span)> {
        let edges = self.edges.iter();
        edges.map(|(constraint, edge)| (constraint, edge.from, edge.to, edge.span))
    }

    /// Intersects the span of a constraint, inequality by inequality.
    fn narrow(&mut self, constraint: Constraint, span: Span) -> Result<(), Conflict<O>> {
        let edge = self
            .edges
            .get_mut(constraint)
            .expect("the constraint is there");
        let old = edge.span;
        edge.span = old.intersect(span);
        let now = edge.span;
        if now == old {
            return Ok(());
        }
        self.trail.push(Change::Span(constraint, old));
        let low = 2 * constraint.index() as u32;
        // Beyond the horizon's length a bound says no more, or that nothing fits.
        let gaps = [
            (low, old.min, now.min),
            (low + 1, negated(old.max), negated(now.max)),
        ];
        for (half, old, now) in gaps {
            if now > old {
                self.set_gap(half, now.clamp(NOTHING, -NOTHING));
                for side in [EARLIEST, LATEST] {
                    self.raise(side, half)?;
                }
            }
        }
        Ok(())
    }

    /// Gives an inequality a larger gap.
    fn set_gap(&mut self, half: Half, gap: Ticks) {
        let inequality = &mut self.halves[half as usize];
        if inequality.is_linked() {
            let old = std::mem::replace(&mut inequality.gap, gap);
            self.trail.push(Change::Gap(half, old));
        } else {
            inequality.gap = gap;
            self.link(half);
            self.trail.push(Change::Linked(half));
        }
    }
}

impl<O: fmt::Debug> fmt::Debug for Network<O> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Network")
            .field("points", &self.nodes.len())
            .field("constraints", &self.edges.len())
            .finish_non_exhaustive()
    }
}

impl Inequality {
    /// In no list yet.
    fn between(from: u32, to: u32) -> Self {
        Inequality {
            from,
            to,
            gap: Ticks::MIN,
            next: [NONE; 2],
            before: [NONE; 2],
        }
    }

    /// Whether it has a gap, and so is in its points' lists.
    fn is_linked(&self) -> bool {
        self.gap != Ticks::MIN
    }

    /// Whose value it passes on, on a side.
    fn source(&self, side: Side) -> u32 {
        if side == EARLIEST { self.from } else { self.to }
    }

    /// To whom it passes it.
    fn target(&self, side: Side) -> u32 {
        self.source(1 - side)
    }
}
