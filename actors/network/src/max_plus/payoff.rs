//! Payoffs (*network-guided*, section 3.4): what a path is worth to a rover, and what two paths are
//! worth to a pair.

use std::sync::LazyLock;

use farside_worlds::{Roadmap, VertexId};

use crate::config::{NetworkConfig, Policy};
use crate::max_plus::candidates::{CandidatePath, Destination};
use crate::max_plus::config::Backtrack;

/// The constants of the payoff functions for one roadmap.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Payoffs {
    /// C, "an estimate of the maximum path length in the roadmap" [cycles].
    pub(crate) longest: f64,
    /// What a path loses that leads back, and which do.
    pub(crate) backtrack: f64,
    pub(crate) leads_back: Backtrack,
    /// What the zero path is worth.
    pub(crate) zero: f64,
    /// What a path gains that leads where the last one led.
    pub(crate) keep: f64,
    /// A path to a leaf holds it after its end.
    pub(crate) leaf_paths_hold: bool,
    /// What the path of length 0 of a rover that stands on a leaf loses.
    pub(crate) leaf_wait: f64,
    /// The payoff of a pair that collides in the cycle to come: "a highly negative constant".
    pub(crate) imminent: f64,
}

/// From this cycle on, what a collision divides a payoff by no longer falls.
const FAR: usize = 9;

/// [`divisor`] of each cycle, the last of all later ones.
static DIVISORS: LazyLock<[f32; FAR + 1]> =
    LazyLock::new(|| std::array::from_fn(|t| divisor(t as u32) as f32));

impl Payoffs {
    pub(crate) fn new(config: &NetworkConfig, roadmap: &Roadmap) -> Self {
        // On a large roadmap the diameter takes a while, and other policies have no payoffs.
        let diameter = match config.policy {
            Policy::MaxPlus => roadmap.diameter(),
            _ => 0,
        };
        let longest = config.max_plus.longest_path_factor * f64::from(diameter.max(1));
        Payoffs {
            longest,
            backtrack: config.max_plus.backtrack_penalty,
            leads_back: config.max_plus.backtrack,
            zero: config.max_plus.zero_payoff,
            keep: config.max_plus.keep_bonus,
            leaf_paths_hold: config.max_plus.leaf_paths_hold,
            leaf_wait: config.max_plus.leaf_wait_penalty,
            imminent: -config.max_plus.collision_penalty_factor * longest,
        }
    }

    /// The unary payoff: C - length to the goal; C - (length + the rest of the way) to a leaf;
    /// 0 for the zero path. `noise` is added to all, and a path back to `previous` pays for it.
    pub(crate) fn unary(
        &self,
        roadmap: &Roadmap,
        path: &CandidatePath,
        goal: VertexId,
        previous: Option<VertexId>,
        noise: f64,
    ) -> f32 {
        let end = *path.vertices.last().expect("a path has a start");
        let worth = match path.destination {
            Destination::Stay => self.zero,
            Destination::Goal => self.longest - f64::from(path.length()),
            Destination::Leaf => {
                let waits = path.length() == 0;
                let penalty = if waits { self.leaf_wait } else { 0.0 };
                self.longest - f64::from(path.length() + roadmap.distance(end, goal)) - penalty
            }
        };
        let penalty = self.backtrack * f64::from(self.backtracks(roadmap, path, goal, previous));
        (worth - penalty + noise) as f32
    }

    /// How often a path pays for leading back.
    fn backtracks(
        &self,
        roadmap: &Roadmap,
        path: &CandidatePath,
        goal: VertexId,
        previous: Option<VertexId>,
    ) -> u32 {
        let next = path.next_vertex();
        match self.leads_back {
            Backtrack::FirstStep => u32::from(previous.is_some() && next == previous),
            Backtrack::Direction => {
                let (Some(from), Some(next)) = (previous, next) else {
                    return 0;
                };
                let at = |v| roadmap.position_m(v);
                let here = at(path.vertices[0]);
                u32::from((here - at(from)).dot(&(at(next) - here)) < 0.0)
            }
            Backtrack::EachStepAway => {
                let left = |v: &VertexId| roadmap.distance(*v, goal);
                let steps = path.vertices.windows(2);
                steps.filter(|step| left(&step[1]) > left(&step[0])).count() as u32
            }
        }
    }

    /// The pairwise payoff of two paths with these unary payoffs that collide in cycle `collision`.
    pub(crate) fn pairwise(&self, sum: f32, collision: Option<u32>) -> f32 {
        match collision {
            None => sum,
            Some(0 | 1) => self.imminent as f32,
            // Dividing a negative sum would make the collision the better choice.
            Some(t) => sum.min(sum / DIVISORS[FAR.min(t as usize)]),
        }
    }
}

/// What a collision `t` cycles ahead divides a pair's payoff by: max(e, e^(10 - t)).
pub(crate) fn divisor(t: u32) -> f64 {
    libm::exp((10.0 - f64::from(t)).max(1.0))
}

/// The first cycle in which two paths collide: both at one vertex, or swapping along an edge. A path
/// of length 0 (the zero path, and the wait on a leaf) holds its vertex for ever, and with
/// `leaf_paths_hold` any path to a leaf its end; any other claims nothing after its end.
///
/// The definition, which the solver's tables are held against.
#[cfg(test)]
pub(crate) fn collision(
    a: &CandidatePath,
    b: &CandidatePath,
    leaf_paths_hold: bool,
) -> Option<u32> {
    let stays = |path: &CandidatePath| {
        path.length() == 0 || leaf_paths_hold && path.destination == Destination::Leaf
    };
    let cycles = match (stays(a), stays(b)) {
        (true, true) => a.length().max(b.length()).max(1),
        (true, false) => b.length(),
        (false, true) => a.length(),
        (false, false) => a.length().min(b.length()),
    };
    let place = |path: &CandidatePath, t: u32| {
        // Only a path that stays ends before.
        let at = (t as usize).min(path.vertices.len() - 1);
        path.vertices[at]
    };
    (1..=cycles).find(|&t| {
        let (from_a, from_b) = (place(a, t - 1), place(b, t - 1));
        let (to_a, to_b) = (place(a, t), place(b, t));
        to_a == to_b || (to_a == from_b && to_b == from_a)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{grid, v};
    use std::f64::consts::E;

    fn collision(a: &CandidatePath, b: &CandidatePath) -> Option<u32> {
        super::collision(a, b, false)
    }

    fn path(destination: Destination, vertices: &[u32]) -> CandidatePath {
        CandidatePath {
            destination,
            vertices: vertices.iter().map(|&u| v(u)).collect(),
            payoff: 0.0,
        }
    }

    #[test]
    fn the_divisor_has_the_papers_values() {
        assert_eq!(divisor(2).round(), 2981.0);
        for t in [9, 10, 50] {
            assert!((divisor(t) - E).abs() < 1e-12);
        }
        for t in 0..40 {
            assert_eq!(DIVISORS[FAR.min(t as usize)], divisor(t) as f32);
        }
        assert!((divisor(8) - E * E).abs() < 1e-12);
        assert!((2..9).all(|t| divisor(t) > divisor(t + 1)));
    }

    #[test]
    fn collisions_by_hand() {
        use Destination::{Goal, Leaf, Stay};
        let east = path(Leaf, &[0, 1, 2, 3]);
        assert_eq!(
            collision(&east, &path(Leaf, &[3, 2, 1, 0])),
            Some(2),
            "a swap"
        );
        assert_eq!(
            collision(&east, &path(Leaf, &[4, 3, 2, 1])),
            Some(2),
            "a meeting"
        );
        assert_eq!(collision(&east, &path(Stay, &[3])), Some(3));
        assert_eq!(collision(&path(Stay, &[3]), &east), Some(3));
        assert_eq!(
            collision(&east, &path(Leaf, &[1, 2, 3, 4])),
            None,
            "following"
        );
        assert_eq!(
            collision(&east, &path(Goal, &[2, 2, 1])),
            Some(2),
            "a swap after a wait"
        );
        // A goal path vanishes after its end, a leaf path claims nothing there.
        assert_eq!(collision(&east, &path(Goal, &[4, 3])), None);
        assert_eq!(collision(&east, &path(Leaf, &[4, 3])), None);
        assert_eq!(
            collision(&path(Leaf, &[0, 1]), &path(Leaf, &[2, 1])),
            Some(1)
        );
        assert_eq!(collision(&path(Stay, &[0]), &path(Stay, &[1])), None);
        let held = |a, b| super::collision(a, b, true);
        let (east, west) = (path(Leaf, &[0, 1, 2]), path(Leaf, &[5, 4, 3, 2]));
        assert_eq!(collision(&east, &west), None);
        assert_eq!((held(&east, &west), held(&west, &east)), (Some(3), Some(3)));
        let past = path(Goal, &[5, 4, 3, 2, 1]);
        assert_eq!((held(&east, &past), held(&past, &east)), (Some(3), Some(3)));
    }

    #[test]
    fn what_leads_back_is_a_reading() {
        let map = grid(6, 1, &[]);
        let lost = |reading: &str, vertices: &[u32], previous| {
            let text = format!("max_plus = {{ backtrack = '{reading}', backtrack_penalty = 7 }}");
            let config: NetworkConfig = toml::from_str(&text).unwrap();
            let (payoffs, path) = (
                Payoffs::new(&config, &map),
                path(Destination::Leaf, vertices),
            );
            let free = Payoffs {
                backtrack: 0.0,
                ..payoffs
            };
            let worth = |p: Payoffs| p.unary(&map, &path, v(5), Some(v(previous)), 0.0);
            worth(free) - worth(payoffs)
        };
        // Back where it came from; on; and back after it came from elsewhere.
        assert_eq!(lost("first_step", &[3, 2, 1], 2), 7.0);
        assert_eq!(lost("first_step", &[3, 4, 5], 2), 0.0);
        assert_eq!(lost("direction", &[3, 3, 2], 1), 7.0);
        assert_eq!(lost("direction", &[3, 4], 2), 0.0);
        assert_eq!(lost("each_step_away", &[3, 2, 1], 4), 14.0);
        assert_eq!(lost("each_step_away", &[3, 3, 4], 4), 0.0);
    }

    #[test]
    fn unary_payoffs_follow_the_paper() {
        let map = grid(6, 1, &[]);
        let payoffs = Payoffs::new(&NetworkConfig::default(), &map);
        assert_eq!(payoffs.longest, 100.0);
        let unary = |p: &CandidatePath, previous| payoffs.unary(&map, p, v(5), previous, 0.0);
        assert_eq!(unary(&path(Destination::Goal, &[3, 4, 5]), None), 98.0);
        assert_eq!(
            unary(&path(Destination::Leaf, &[3, 2, 1]), None),
            100.0 - 2.0 - 4.0
        );
        assert_eq!(
            unary(&path(Destination::Leaf, &[3, 2, 1]), Some(v(2))),
            54.0
        );
        assert_eq!(
            unary(&path(Destination::Leaf, &[3, 3, 2]), Some(v(2))),
            100.0 - 2.0 - 3.0 - 40.0
        );
        assert_eq!(
            unary(&path(Destination::Leaf, &[0]), Some(v(1))),
            100.0 - 5.0 - payoffs.leaf_wait as f32
        );
        assert_eq!(unary(&path(Destination::Stay, &[3]), Some(v(3))), 0.0);
    }

    #[test]
    fn a_nearer_collision_is_worse_and_the_next_cycle_worst() {
        let map = grid(6, 1, &[]);
        let payoffs = Payoffs::new(&NetworkConfig::default(), &map);
        let worth = |t| payoffs.pairwise(150.0, t);
        assert!(worth(Some(1)) < worth(Some(2)) && worth(Some(2)) < worth(Some(5)));
        assert!(worth(Some(30)) < worth(None));
        assert_eq!(worth(Some(1)), -1000.0);
        assert!(payoffs.pairwise(-20.0, Some(2)) <= -20.0);
    }
}
