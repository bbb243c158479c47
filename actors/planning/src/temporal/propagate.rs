//! How a change of an inequality changes bounds: best first, each point once.

use std::collections::BinaryHeap;

use super::trail::Change;
use super::{Conflict, EARLIEST, Half, LATEST, NONE, Network, Node, ORIGIN, Side};
use crate::Ticks;

/// A bound that may grow: by how much more than others is what comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Growth {
    by: Ticks,
    point: u32,
    half: Option<Half>,
}

impl Ord for Growth {
    /// The most growth first; among equals the first point, so that the order is always the same.
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let key = |growth: &Growth| (growth.by, std::cmp::Reverse((growth.point, growth.half)));
        key(self).cmp(&key(other))
    }
}

impl PartialOrd for Growth {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// What an edit needs while it goes on; kept for its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    heap: BinaryHeap<Growth>,
    /// By point: what the current pass knows of it.
    seen: Vec<Seen>,
    /// The number of the current pass.
    pass: u64,
    /// Points whose bounds rested on what is gone.
    affected: Vec<u32>,
}

/// What a pass knows of a point.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    /// In which pass.
    pass: u64,
    /// The most growth that was offered.
    offered: Ticks,
    done: bool,
    affected: bool,
}

impl Scratch {
    fn begin(&mut self, places: usize) {
        self.pass += 1;
        self.heap.clear();
        self.affected.clear();
        self.seen
            .resize(places.max(self.seen.len()), Seen::default());
    }

    fn seen(&mut self, point: u32) -> &mut Seen {
        let pass = self.pass;
        let seen = &mut self.seen[point as usize];
        if seen.pass != pass {
            *seen = Seen {
                pass,
                offered: Ticks::MIN,
                done: false,
                affected: false,
            };
        }
        seen
    }

    /// Offers a growth, if it is more than what was offered before.
    fn offer(&mut self, growth: Growth) {
        let seen = self.seen(growth.point);
        if !seen.done && growth.by > seen.offered {
            seen.offered = growth.by;
            self.heap.push(growth);
        }
    }

    /// The most growth of a point that is not done yet.
    fn take(&mut self) -> Option<Growth> {
        while let Some(growth) = self.heap.pop() {
            let seen = self.seen(growth.point);
            if !seen.done {
                seen.done = true;
                return Some(growth);
            }
        }
        None
    }
}

impl<O: Clone> Network<O> {
    /// The node in a place, which is there: inequalities are of points that are.
    pub(super) fn node(&self, place: u32) -> &Node {
        self.nodes.at(place as usize).expect("the point is there")
    }

    pub(super) fn node_mut(&mut self, place: u32) -> &mut Node {
        let node = self.nodes.at_mut(place as usize);
        node.expect("the point is there")
    }

    /// An inequality got a larger gap: raises what follows on a side.
    ///
    /// Before the edit no value was below what its inequalities ask for. So along an inequality a
    /// growth only gets less, and who grows most is done first, once and for all.
    pub(super) fn raise(&mut self, side: Side, half: Half) -> Result<(), Conflict<O>> {
        let inequality = self.halves[half as usize];
        let (source, target) = (inequality.source(side), inequality.target(side));
        let by = self.growth(side, half);
        if by <= 0 {
            return Ok(());
        }
        if self.ends_at(side, target) {
            // Most often nothing follows: the order of what does is not asked then.
            self.set(side, target, by, Some(half));
            if target == source {
                return Err(self.around(side, target, half));
            }
            let node = self.node(target);
            if node.value[EARLIEST] > -node.value[LATEST] {
                return Err(self.crossed(side, target, half));
            }
            return Ok(());
        }
        self.scratch.begin(self.nodes.places());
        self.scratch.offer(Growth {
            by,
            point: target,
            half: Some(half),
        });
        while let Some(growth) = self.scratch.take() {
            let point = growth.point;
            self.set(side, point, growth.by, growth.half);
            // All cycles without a solution lead through the inequality that is new.
            if point == source {
                return Err(self.around(side, point, half));
            }
            let node = self.node(point);
            if node.value[EARLIEST] > -node.value[LATEST] {
                return Err(self.crossed(side, point, half));
            }
            let mut next = node.first[side];
            while next != NONE {
                self.work.inequalities += 1;
                let by = self.growth(side, next);
                let inequality = self.halves[next as usize];
                if by > 0 {
                    self.scratch.offer(Growth {
                        by,
                        point: inequality.target(side),
                        half: Some(next),
                    });
                }
                next = inequality.next[side];
            }
        }
        Ok(())
    }

    /// Whether a point passes its value on to the origin alone, which does not move.
    fn ends_at(&mut self, side: Side, point: u32) -> bool {
        let mut next = self.node(point).first[side];
        let mut looked_at = 0;
        while next != NONE {
            looked_at += 1;
            let inequality = &self.halves[next as usize];
            if inequality.target(side) != ORIGIN {
                // The pass that follows looks at them, and counts them.
                return false;
            }
            next = inequality.next[side];
        }
        self.work.inequalities += looked_at;
        true
    }

    /// An inequality is gone: what rested on it on a side is less tight now, if nothing else holds
    /// it.
    pub(super) fn start_anew(&mut self, side: Side, gone: Half) {
        let target = self.halves[gone as usize].target(side);
        if self.node(target).by[side] != Some(gone) {
            return;
        }
        self.scratch.begin(self.nodes.places());
        self.find_affected(side, target);
        // What is not affected offers what it asks for; the base asks for something of all.
        for index in 0..self.scratch.affected.len() {
            let point = self.scratch.affected[index];
            let node = self.node(point);
            let old = node.value[side];
            let mut next = node.first[1 - side];
            let mut best = Growth {
                by: node.base[side] - old,
                point,
                half: None,
            };
            while next != NONE {
                self.work.inequalities += 1;
                let inequality = self.halves[next as usize];
                let source = inequality.source(side);
                if !self.scratch.seen(source).affected {
                    let by = self.growth(side, next);
                    if by > best.by {
                        best = Growth {
                            half: Some(next),
                            by,
                            ..best
                        };
                    }
                }
                next = inequality.next[1 - side];
            }
            self.scratch.offer(best);
        }
        while let Some(growth) = self.scratch.take() {
            self.set(side, growth.point, growth.by, growth.half);
            let mut next = self.node(growth.point).first[side];
            while next != NONE {
                self.work.inequalities += 1;
                let inequality = self.halves[next as usize];
                let point = inequality.target(side);
                let seen = *self.scratch.seen(point);
                if seen.affected && !seen.done {
                    let by = self.growth(side, next);
                    self.scratch.offer(Growth {
                        by,
                        point,
                        half: Some(next),
                    });
                }
                next = inequality.next[side];
            }
        }
    }

    /// All points whose value on a side rests on that of `first`, and itself.
    fn find_affected(&mut self, side: Side, first: u32) {
        self.scratch.seen(first).affected = true;
        self.scratch.affected.push(first);
        let mut at = 0;
        while at < self.scratch.affected.len() {
            let point = self.scratch.affected[at];
            let mut next = self.node(point).first[side];
            while next != NONE {
                self.work.inequalities += 1;
                let inequality = self.halves[next as usize];
                let target = inequality.target(side);
                if self.node(target).by[side] == Some(next) && !self.scratch.seen(target).affected {
                    self.scratch.seen(target).affected = true;
                    self.scratch.affected.push(target);
                }
                next = inequality.next[side];
            }
            at += 1;
        }
    }

    /// By how much the target's value is below what an inequality asks for.
    fn growth(&self, side: Side, half: Half) -> Ticks {
        let inequality = &self.halves[half as usize];
        let source = self.node(inequality.source(side)).value[side];
        let target = self.node(inequality.target(side)).value[side];
        source + inequality.gap - target
    }

    fn set(&mut self, side: Side, point: u32, growth: Ticks, by: Option<Half>) {
        self.work.points += 1;
        self.changed.add(point);
        let node = self.node_mut(point);
        let old = (node.value[side], node.by[side]);
        node.value[side] += growth;
        node.by[side] = by;
        self.trail.push(Change::Value {
            side,
            point,
            value: old.0,
            by: old.1,
        });
    }
}
