//! Which of two rovers' candidate paths collide, and when: the other half of what planning costs.
//!
//! Shortest paths from one vertex share their beginnings, and what two beginnings do in a cycle
//! they do for all paths that begin so. Hence paths are compared in lexicographic order: what the
//! path before met within the beginning that both share, this one meets too, and if that was
//! nothing, comparing goes on from there.

use crate::max_plus::candidates::CandidatePath;
use crate::max_plus::payoff::collision_from;

/// A hash of vertices: sets whose hashes share no bit share no vertex.
type Mask = [u64; 4];

fn meet(a: &Mask, b: &Mask) -> bool {
    a.iter().zip(b).any(|(x, y)| x & y != 0)
}

/// A rover's candidate paths, made ready to be compared with another's.
#[derive(Debug)]
pub(super) struct Paths {
    pub(super) list: Vec<CandidatePath>,
    /// Of each path's vertices.
    masks: Vec<Mask>,
    /// Of all vertices.
    all: Mask,
    /// The places of the paths in lexicographic order, each with how many of its first vertices are
    /// those of the path before.
    sorted: Vec<(usize, u32)>,
}

impl Paths {
    pub(super) fn new(list: Vec<CandidatePath>) -> Paths {
        let mut masks = vec![Mask::default(); list.len()];
        let mut all = Mask::default();
        for (mask, path) in masks.iter_mut().zip(&list) {
            for v in &path.vertices {
                mask[(v.0 / 64 % 4) as usize] |= 1 << (v.0 % 64);
            }
            for (all, mask) in all.iter_mut().zip(mask) {
                *all |= *mask;
            }
        }
        let mut sorted: Vec<(usize, u32)> = (0..list.len()).map(|at| (at, 0)).collect();
        sorted.sort_by(|a, b| list[a.0].vertices.cmp(&list[b.0].vertices));
        for at in 1..sorted.len() {
            let (before, this) = (&list[sorted[at - 1].0], &list[sorted[at].0]);
            let pairs = before.vertices.iter().zip(&this.vertices);
            sorted[at].1 = pairs.take_while(|(a, b)| a == b).count() as u32;
        }
        Paths {
            list,
            masks,
            all,
            sorted,
        }
    }

    /// The cycle in which each path first collides with each of `other`'s, 0 for never: a row of
    /// `other`'s paths for each path. False, and nothing in `cycles`, if none meets any.
    pub(super) fn meet(&self, other: &Paths, leaf_paths_hold: bool, cycles: &mut Vec<u32>) -> bool {
        cycles.clear();
        if !meet(&self.all, &other.all) {
            return false;
        }
        let width = other.list.len();
        cycles.resize(self.list.len() * width, 0);
        let mut above = None;
        for &(a, shared_a) in &self.sorted {
            let (path, mask) = (&self.list[a], &self.masks[a]);
            let mut left = None;
            for &(b, shared_b) in &other.sorted {
                if meet(mask, &other.masks[b]) {
                    let before = |at: Option<usize>| at.map_or(0, |at| cycles[at]);
                    // From one beginning or from the other.
                    let above = (before(above.map(|above| above * width + b)), shared_a);
                    let left = (before(left.map(|left| a * width + left)), shared_b);
                    let known = [above, left].into_iter();
                    let mut known = known.filter(|&(cycle, shared)| cycle > 0 && cycle < shared);
                    cycles[a * width + b] = match known.next() {
                        Some((cycle, _)) => cycle,
                        None => {
                            let first = shared_a.max(shared_b).max(1);
                            collision_from(path, &other.list[b], first, leaf_paths_hold)
                                .unwrap_or(0)
                        }
                    };
                }
                left = Some(b);
            }
            above = Some(a);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::max_plus::candidates::Destination;
    use farside_worlds::VertexId;
    use proptest::prelude::*;

    /// Paths as candidates are, and as they are not: all lengths, waits, few vertices, many alike.
    fn paths() -> impl Strategy<Value = Vec<CandidatePath>> {
        let vertices = prop::collection::vec(0u32..5, 1..6);
        let path = vertices.prop_map(|vertices| CandidatePath {
            destination: Destination::Leaf,
            // Two of them have one bit in the masks.
            vertices: vertices.into_iter().map(|v| VertexId(v * 64)).collect(),
            payoff: 0.0,
        });
        prop::collection::vec(path, 0..9)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

        #[test]
        fn collisions_are_those_of_each_pair(
            a in paths(), b in paths(), hold in any::<bool>(),
        ) {
            let (a, b) = (Paths::new(a), Paths::new(b));
            let mut cycles = vec![7];
            let any = a.meet(&b, hold, &mut cycles);
            for (at_a, path_a) in a.list.iter().enumerate() {
                for (at_b, path_b) in b.list.iter().enumerate() {
                    let expected = collision_from(path_a, path_b, 1, hold).unwrap_or(0);
                    let found = if any { cycles[at_a * b.list.len() + at_b] } else { 0 };
                    prop_assert_eq!(found, expected, "{:?} and {:?}", path_a, path_b);
                }
            }
        }
    }
}
