//! Which of two rovers' candidate paths collide, and when: the other half of what planning costs.
//!
//! Paths that begin alike take the same steps, and what one of these meets all of them meet. Hence
//! paths are compared by steps, each of which stands for all paths that take it, and a step finds
//! those of another rover that end where it ends in the same cycle in a table: most end where nobody
//! is, and cost no more than that look.

use std::collections::BTreeMap;
use std::hash::Hasher;
use std::sync::Arc;

use rustc_hash::FxHasher;

use super::edge::LANES;
use crate::max_plus::candidates::{CandidatePath, Destination};

/// Marks the end of a list of steps.
const NONE: u32 = u32::MAX;

/// So many rovers' steps a node keeps at most.
const KEPT: usize = 1000;

/// A step, for all paths of one rover that take it and began alike.
#[derive(Debug)]
struct Step {
    from: u32,
    to: u32,
    /// The cycle at whose end it is made, from 1.
    cycle: u32,
    /// These of the paths in lexicographic order take it.
    first: u32,
    last: u32,
    /// The next with the same place in the table.
    next: u32,
    /// Where in a table of any size a step is that ends in this cycle where this one ends, and
    /// where it begins.
    key: u32,
    back_key: u32,
}

/// A path that holds its last vertex from the cycle after its end.
#[derive(Debug)]
struct Hold {
    vertex: u32,
    after: u32,
    place: u32,
}

/// The steps of one rover's candidate paths.
#[derive(Debug)]
struct Steps {
    /// In such an order that a path's steps come one after the other.
    steps: Vec<Step>,
    /// The places of the paths in lexicographic order.
    order: Vec<u32>,
    holds: Vec<Hold>,
    /// Lists of steps by the upper bits of their keys.
    table: Vec<u32>,
    shift: u32,
    /// A bit for each key in the table: what has none there is not looked for.
    keys: [u64; 8],
    /// A hash of all vertices that steps lead to: sets whose hashes share no bit share no vertex.
    reached: [u64; 4],
}

/// Where in a table a step is that ends at `vertex` in `cycle`.
fn key(vertex: u32, cycle: u32) -> u32 {
    (vertex.wrapping_mul(0x85eb_ca6b) ^ cycle.wrapping_mul(0xc2b2_ae35)).wrapping_mul(0x9e37_79b1)
}

/// The bit of a key.
fn key_bit(key: u32) -> (usize, u64) {
    ((key >> 29) as usize, 1 << (key >> 23 & 63))
}

fn bit(vertex: u32) -> (usize, u64) {
    ((vertex / 64 % 4) as usize, 1 << (vertex % 64))
}

impl Steps {
    fn new(list: &[CandidatePath], leaf_paths_hold: bool) -> Steps {
        let mut order: Vec<u32> = (0..list.len() as u32).collect();
        let path = |place: u32| &list[place as usize].vertices[..];
        order.sort_by(|a, b| path(*a).cmp(path(*b)));
        let (mut steps, mut reached) = (Vec::<Step>::new(), [0; 4]);
        // The steps of the path before, by cycle.
        let mut open: Vec<usize> = Vec::new();
        for (at, &place) in order.iter().enumerate() {
            let this = path(place);
            let before = at
                .checked_sub(1)
                .map_or(&[][..], |before| path(order[before]));
            let pairs = before.iter().zip(this);
            let shared = pairs.take_while(|(a, b)| a == b).count();
            open.truncate(shared.saturating_sub(1));
            for &step in &open {
                steps[step].last = at as u32;
            }
            for cycle in open.len() + 1..this.len() {
                let (from, to) = (this[cycle - 1].0, this[cycle].0);
                open.push(steps.len());
                let (word, bit) = bit(to);
                reached[word] |= bit;
                let cycle = cycle as u32;
                steps.push(Step {
                    from,
                    to,
                    cycle,
                    first: at as u32,
                    last: at as u32,
                    next: NONE,
                    key: key(to, cycle),
                    back_key: key(from, cycle),
                });
            }
        }
        let size = (2 * steps.len()).next_power_of_two().max(2);
        let shift = 32 - size.trailing_zeros();
        let (mut table, mut keys) = (vec![NONE; size], [0; 8]);
        for (at, step) in steps.iter_mut().enumerate() {
            let (word, bit) = key_bit(step.key);
            keys[word] |= bit;
            let head = &mut table[(step.key >> shift) as usize];
            step.next = std::mem::replace(head, at as u32);
        }
        let holds = |path: &CandidatePath| {
            path.length() == 0 || leaf_paths_hold && path.destination == Destination::Leaf
        };
        let holding = list.iter().enumerate().filter(|(_, path)| holds(path));
        let hold = |(place, path): (usize, &CandidatePath)| Hold {
            vertex: path.vertices[path.vertices.len() - 1].0,
            after: path.length(),
            place: place as u32,
        };
        Steps {
            order,
            holds: holding.map(hold).collect(),
            steps,
            table,
            shift,
            keys,
            reached,
        }
    }

    /// The steps that end in that cycle where the key says, and some others.
    fn at(&self, key: u32) -> impl Iterator<Item = &Step> {
        let step = |at: u32| self.steps.get(at as usize);
        let (word, bit) = key_bit(key);
        let first = match self.keys[word] & bit {
            0 => None,
            _ => step(self.table[(key >> self.shift) as usize]),
        };
        std::iter::successors(first, move |before| step(before.next))
    }

    /// The places of the paths that take a step.
    fn taking(&self, step: &Step) -> &[u32] {
        &self.order[step.first as usize..=step.last as usize]
    }

    fn reaches(&self, vertex: u32) -> bool {
        let (word, bit) = bit(vertex);
        self.reached[word] & bit != 0
    }
}

/// When each path of one rover first collides with each of another's: 0 for never, [`u8::MAX`] for
/// that cycle and all later ones, which are worth the same long before. In blocks of [`LANES`] paths
/// of the other, and within a block a row for each path of the one.
#[derive(Debug, Default)]
pub(super) struct Meetings {
    rows: usize,
    pub(super) cycles: Vec<[u8; LANES]>,
}

impl Meetings {
    fn clear(&mut self, size: (usize, usize)) {
        self.rows = size.0;
        self.cycles.clear();
        self.cycles
            .resize(size.0 * size.1.div_ceil(LANES), [0; LANES]);
    }

    /// Each of these paths of the one collides with each of those of the other, if not before.
    fn note(&mut self, ones: &[u32], others: &[u32], cycle: u32) {
        let cycle = cycle.min(u32::from(u8::MAX)) as u8;
        for &other in others {
            let (block, lane) = (other as usize / LANES, other as usize % LANES);
            let rows = &mut self.cycles[block * self.rows..][..self.rows];
            for &one in ones {
                let known = &mut rows[one as usize][lane];
                // 0 is later than all.
                if cycle.wrapping_sub(1) < known.wrapping_sub(1) {
                    *known = cycle;
                }
            }
        }
    }
}

/// A rover's candidate paths, made ready to be compared with another's.
#[derive(Debug)]
pub(super) struct Paths {
    pub(super) list: Arc<[CandidatePath]>,
    steps: Arc<Steps>,
}

impl Paths {
    /// When these paths first collide with `other`'s.
    pub(super) fn meet(&self, other: &Paths, meetings: &mut Meetings) {
        meetings.clear((self.list.len(), other.list.len()));
        let (a, b) = (&*self.steps, &*other.steps);
        for step in &b.steps {
            for same in a.at(step.key) {
                // Who was at one vertex before that too has collided then, or started there.
                let known = same.from == step.from && step.cycle > 1;
                if same.to == step.to && same.cycle == step.cycle && !known {
                    meetings.note(a.taking(same), b.taking(step), step.cycle);
                }
            }
            for back in a.at(step.back_key) {
                let swap = (back.from, back.to, back.cycle) == (step.to, step.from, step.cycle);
                if swap {
                    meetings.note(a.taking(back), b.taking(step), step.cycle);
                }
            }
        }
        for hold in a.holds.iter().filter(|hold| b.reaches(hold.vertex)) {
            for step in b.steps.iter().filter(|step| step.to == hold.vertex) {
                if step.cycle > hold.after {
                    meetings.note(&[hold.place], b.taking(step), step.cycle);
                }
            }
        }
        for hold in b.holds.iter().filter(|hold| a.reaches(hold.vertex)) {
            for step in a.steps.iter().filter(|step| step.to == hold.vertex) {
                if step.cycle > hold.after {
                    meetings.note(a.taking(step), &[hold.place], step.cycle);
                }
            }
        }
        let still = |hold: &&Hold| hold.after == 0;
        for one in a.holds.iter().filter(still) {
            for other in b.holds.iter().filter(still) {
                if one.vertex == other.vertex {
                    meetings.note(&[one.place], &[other.place], 1);
                }
            }
        }
    }
}

/// The steps of paths that a node has seen, by a hash of the paths: rovers that come to the same
/// vertex have the same paths, and who stands still has them again in each cycle.
#[derive(Debug, Default)]
pub(super) struct Known {
    /// The paths' vertices, each path's after how many it has.
    of: BTreeMap<u64, (Vec<u32>, Arc<Steps>)>,
    holding: bool,
    room: Vec<u32>,
}

impl Known {
    pub(super) fn paths(&mut self, list: Arc<[CandidatePath]>, leaf_paths_hold: bool) -> Paths {
        if self.holding != leaf_paths_hold || self.of.len() >= KEPT {
            self.of.clear();
            self.holding = leaf_paths_hold;
        }
        self.room.clear();
        for path in &*list {
            // What holds its end depends on where it leads.
            let leads = u32::from(path.destination == Destination::Leaf);
            self.room.push(path.vertices.len() as u32 * 2 + leads);
            self.room.extend(path.vertices.iter().map(|v| v.0));
        }
        let mut hasher = FxHasher::default();
        for &word in &self.room {
            hasher.write_u32(word);
        }
        let hash = hasher.finish();
        let known = self.of.get(&hash).filter(|known| known.0 == self.room);
        let steps = match known {
            Some((_, steps)) => steps.clone(),
            None => {
                let steps = Arc::new(Steps::new(&list, leaf_paths_hold));
                self.of.insert(hash, (self.room.clone(), steps.clone()));
                steps
            }
        };
        Paths { list, steps }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::max_plus::payoff::collision;
    use farside_worlds::VertexId;
    use proptest::prelude::*;

    /// Paths as candidates are, and as they are not: all lengths, waits, few vertices, many alike.
    fn paths() -> impl Strategy<Value = Vec<CandidatePath>> {
        let vertices = prop::collection::vec(0u32..5, 1..6);
        let path = (vertices, any::<bool>()).prop_map(|(vertices, leaf)| CandidatePath {
            destination: if leaf {
                Destination::Leaf
            } else {
                Destination::Goal
            },
            // Two of them have one bit in the hash of all.
            vertices: vertices.into_iter().map(|v| VertexId(v * 64)).collect(),
            payoff: 0.0,
        });
        prop::collection::vec(path, 0..12)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

        #[test]
        fn collisions_are_those_of_each_pair(
            a in paths(), b in paths(), hold in any::<bool>(),
        ) {
            let mut known = Known::default();
            let (again, other) = (a.clone(), b.clone());
            let (a, b) = (known.paths(a.into(), hold), known.paths(b.into(), hold));
            let mut meetings = Meetings::default();
            // What is known already, and the other way round first: neither leaves anything behind.
            b.meet(&a, &mut meetings);
            let (a, b) = (known.paths(again.into(), hold), known.paths(other.into(), hold));
            a.meet(&b, &mut meetings);
            for (at_a, path_a) in a.list.iter().enumerate() {
                for (at_b, path_b) in b.list.iter().enumerate() {
                    let expected = collision(path_a, path_b, hold).unwrap_or(0);
                    let row = at_b / LANES * a.list.len() + at_a;
                    let found = u32::from(meetings.cycles[row][at_b % LANES]);
                    prop_assert_eq!(found, expected, "{:?} and {:?}", path_a, path_b);
                }
            }
        }
    }

    #[test]
    fn cycles_too_late_to_be_told_apart_are_late() {
        let line = |vertices: &mut dyn Iterator<Item = u32>| CandidatePath {
            destination: Destination::Leaf,
            vertices: vertices.map(VertexId).collect(),
            payoff: 0.0,
        };
        let mut known = Known::default();
        let there = known.paths([line(&mut (0..=600))].into(), false);
        let back = known.paths([line(&mut (0..=600).rev())].into(), false);
        let mut meetings = Meetings::default();
        there.meet(&back, &mut meetings);
        assert_eq!(meetings.cycles[0][0], u8::MAX);
    }
}
