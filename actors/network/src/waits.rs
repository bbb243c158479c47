//! Who waits for whom at an instant, who waits in a circle, and who can never move again: the one
//! rule of it, for what a run reports and for what its pictures show.
//!
//! # Waiting
//!
//! A rover waits if it stands, is not at its goal, and each vertex that would bring it nearer to
//! its goal is claimed by another rover. Where rovers stay on the map and make room for others
//! (policy `complete`), one that is at its goal waits too if all vertices beside it are claimed: it
//! cannot let anybody pass. Rovers in entry queues hold nothing, so that nobody waits for them.
//! With policies whose rovers take planned paths other than the shortest, there is no such graph.
//!
//! A circle of such waits explains why a team stands, and proves nothing: with every policy a rover
//! may go aside, by a longer way, when its node has thought again or heard more.
//!
//! # Deadlock
//!
//! What is certain is this. Take a set of rovers that all stand, none of them at a goal where it
//! would leave the map, such that each vertex beside one of them is claimed by one of them. **None
//! of them ever moves again**, whatever its policy decides, whatever is sent, lost, repeated or
//! timed:
//!
//! 1. A rover moves only onto a vertex that was granted to it, and a vertex is granted only while
//!    it is free by its owner's record ([`safety`](crate::safety), rules 1 and 2).
//! 2. In that record a vertex that a rover stands on belongs to it, until a proof comes that it is
//!    on its way elsewhere, or there already (rule 4); such a proof is said only of rovers that
//!    have set out. So no vertex beside a rover of the set is granted to it before one of the set
//!    has set out.
//! 3. The first of the set to set out would need such a grant. So there is no first.
//!
//! Grants that were given before, and are still on their way, are no exception: they are for
//! vertices that were free when they were given, and stand empty until the rover comes that has
//! them. Nor is a node that takes over for another: it first hears from every rover where it is.
//! A rover that is down and never restarted does not move either, whatever is free beside it, so
//! that others may be held by it ([`Standing::is_down`]).
//!
//! The union of two such sets is one. So there is a largest, [`Waits::locked`], which is what is
//! left when all rovers are struck off beside which there is a vertex that none of the rest claims.
//! A team that has a rover in it which is not at its goal never arrives: that is a deadlock. In the
//! words of deadlock theory each rover waits for any one of several, and what is left is a knot
//! (Holt, *Some deadlock properties of computer systems*, 1972).
//!
//! Two rovers that face each other in a corridor, with room behind them, are not in such a set. Nor
//! is there another proof for them: they may back out, and with the policy `max-plus` they do, to
//! and fro. That is no progress, and may end.

use std::collections::{BTreeMap, BTreeSet};

use farside_actors::invariants::{Place, WaitCycle, WaitGraph};
use farside_worlds::{Roadmap, VertexId};

use crate::config::Policy;

/// A rover at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Standing {
    /// Its number, from 0.
    pub(crate) rover: u32,
    pub(crate) place: Place<VertexId>,
    pub(crate) goal: VertexId,
    /// It is down, and nothing will restart it.
    pub(crate) is_down: bool,
}

/// What rovers wait for, and whether they stay where they arrive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct WaitRule {
    wanted: Wanted,
    stay_at_target: bool,
}

/// For what rovers of a policy wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wanted {
    /// There is no telling: they take other paths than the shortest.
    Unknown,
    /// For the vertices on shortest paths to their goals.
    ShortestPaths,
    /// For these; and at their goals for any vertex beside them, to make room for others.
    AndRoom,
}

impl WaitRule {
    /// That of a policy whose rovers stay on the map, or queue at entries and leave it.
    pub(crate) fn of(policy: Policy, stay_at_target: bool) -> WaitRule {
        let wanted = match (policy, stay_at_target) {
            (Policy::Complete, true) => Wanted::AndRoom,
            (Policy::MaxPlus, _) | (_, true) => Wanted::ShortestPaths,
            _ => Wanted::Unknown,
        };
        WaitRule {
            wanted,
            stay_at_target,
        }
    }
}

/// The wait-for graph of rovers at an instant.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Waits {
    /// Those that wait, and for whom, each list sorted.
    pub(crate) on: BTreeMap<u32, Vec<u32>>,
    /// Rovers that wait for each other: each list is a strongly connected part of the graph, made
    /// of rovers that none can leave on a shortest path before another of them does.
    pub(crate) circles: Vec<Vec<u32>>,
    /// Those that wait, if not in a circle, then for one.
    pub(crate) behind: BTreeSet<u32>,
    /// Those that can never move again.
    pub(crate) locked: BTreeSet<u32>,
}

impl Waits {
    pub(crate) fn of(roadmap: &Roadmap, rule: WaitRule, rovers: &[Standing]) -> Waits {
        let locked = locked(roadmap, rule, rovers);
        if rule.wanted == Wanted::Unknown {
            return Waits {
                locked,
                ..Waits::default()
            };
        }
        let holders: BTreeMap<VertexId, u32> = rovers
            .iter()
            .filter_map(|standing| Some((standing.place.claim()?, standing.rover)))
            .collect();
        let waiting = |standing: &Standing| {
            let Place::At(here) = standing.place else {
                return None;
            };
            let wanted: Vec<VertexId> = match (here == standing.goal, rule.wanted) {
                (true, Wanted::AndRoom) => roadmap.neighbors(here).to_vec(),
                _ => nearer(roadmap, here, standing.goal).collect(),
            };
            let holders = wanted.iter().map(|next| holders.get(next).copied());
            let holders: Vec<u32> = holders
                .collect::<Option<BTreeSet<u32>>>()?
                .into_iter()
                .collect();
            (!holders.is_empty()).then_some((standing.rover, holders))
        };
        let on: BTreeMap<u32, Vec<u32>> = rovers.iter().filter_map(waiting).collect();
        let stuck = stuck(&on);
        let circles = circles(&on, &stuck);
        let mut behind = stuck;
        for rover in circles.iter().flatten() {
            behind.remove(rover);
        }
        Waits {
            on,
            circles,
            behind,
            locked,
        }
    }

    /// One way round each circle, the shortest first, with rovers' names and the vertices that they
    /// hold.
    pub(crate) fn named(
        &self,
        name: impl Fn(u32) -> String,
        rovers: &[Standing],
    ) -> Vec<WaitCycle<VertexId>> {
        let circled: BTreeSet<u32> = self.circles.iter().flatten().copied().collect();
        graph(&self.on, |rover| circled.contains(&rover)).named_cycles(|rover| {
            let rover = rover as u32;
            let standing = rovers.iter().find(|standing| standing.rover == rover);
            (
                name(rover),
                standing.and_then(|standing| standing.place.claim()),
            )
        })
    }

    pub(crate) fn in_circle(&self, rover: u32) -> bool {
        self.circles.iter().any(|circle| circle.contains(&rover))
    }

    /// One way round a circle, as short as can be, from the lowest number on it on.
    pub(crate) fn round(&self, circle: &[u32]) -> Vec<u32> {
        let cycles = graph(&self.on, |rover| circle.contains(&rover)).cycles();
        numbers(cycles.first().map_or(&[], Vec::as_slice))
    }
}

/// The neighbours of `here` on shortest paths to `goal`.
pub(crate) fn nearer(
    roadmap: &Roadmap,
    here: VertexId,
    goal: VertexId,
) -> impl Iterator<Item = VertexId> {
    let left = roadmap.distance(here, goal);
    let neighbors = roadmap.neighbors(here).iter().copied();
    neighbors.filter(move |next| roadmap.distance(*next, goal) < left)
}

/// The largest set of rovers none of which can ever move again, see the head of this file.
fn locked(roadmap: &Roadmap, rule: WaitRule, rovers: &[Standing]) -> BTreeSet<u32> {
    let stays = |standing: &&Standing| match standing.place {
        Place::Away => false,
        Place::Between(..) => standing.is_down,
        Place::At(here) => standing.is_down || rule.stay_at_target || here != standing.goal,
    };
    let mut left: Vec<&Standing> = rovers.iter().filter(stays).collect();
    loop {
        let claimed: BTreeSet<VertexId> = left.iter().filter_map(|s| s.place.claim()).collect();
        let before = left.len();
        left.retain(|standing| match standing.place {
            Place::At(here) if !standing.is_down => {
                let beside = roadmap.neighbors(here);
                beside.iter().all(|next| claimed.contains(next))
            }
            _ => true,
        });
        if left.len() == before {
            return left.into_iter().map(|standing| standing.rover).collect();
        }
    }
}

/// Those that wait and go on waiting even if every rover that can move does: one is free as soon as
/// one of those it waits for is.
fn stuck(on: &BTreeMap<u32, Vec<u32>>) -> BTreeSet<u32> {
    let mut stuck: BTreeSet<u32> = on.keys().copied().collect();
    loop {
        let free = |rover: &&u32| on[*rover].iter().any(|holder| !stuck.contains(holder));
        let freed: Vec<u32> = stuck.iter().filter(free).copied().collect();
        if freed.is_empty() {
            return stuck;
        }
        for rover in freed {
            stuck.remove(&rover);
        }
    }
}

/// The strongly connected parts of two and more among the stuck, from the lowest number on.
fn circles(on: &BTreeMap<u32, Vec<u32>>, stuck: &BTreeSet<u32>) -> Vec<Vec<u32>> {
    let knots = graph(on, |rover| stuck.contains(&rover)).knots();
    let mut circles: Vec<_> = knots.iter().map(|knot| numbers(knot)).collect();
    circles.sort_unstable();
    circles
}

/// Who of those `within` waits for whom of them.
fn graph(on: &BTreeMap<u32, Vec<u32>>, within: impl Fn(u32) -> bool) -> WaitGraph {
    let rovers = on
        .iter()
        .flat_map(|(rover, holders)| holders.iter().chain([rover]));
    let mut graph = WaitGraph::new(rovers.max().map_or(0, |last| *last as usize + 1));
    for (&rover, holders) in on.iter().filter(|(rover, _)| within(**rover)) {
        for &holder in holders.iter().filter(|holder| within(**holder)) {
            graph.add(rover as usize, holder as usize);
        }
    }
    graph
}

fn numbers(rovers: &[usize]) -> Vec<u32> {
    rovers.iter().map(|rover| *rover as u32).collect()
}

#[cfg(test)]
mod tests {
    use farside_worlds::Roadmap;
    use nalgebra::Point2;
    use proptest::prelude::*;

    use super::*;

    fn standing(rover: u32, at: u32, goal: u32) -> Standing {
        Standing {
            rover,
            goal: VertexId(goal),
            place: Place::At(VertexId(at)),
            is_down: false,
        }
    }

    /// Rovers that leave the map at their goals, with this policy.
    const LEAVING: WaitRule = WaitRule {
        wanted: Wanted::ShortestPaths,
        stay_at_target: false,
    };

    fn line(length: u32) -> Roadmap {
        let at = |i: u32| Point2::new(f64::from(i), 0.0);
        let edges = (1..length).map(|i| (VertexId(i - 1), VertexId(i)));
        let places = (0..length).map(at).collect();
        Roadmap::new("line", places, edges.collect(), vec![VertexId(0)]).unwrap()
    }

    #[test]
    fn two_that_meet_wait_in_a_circle_and_others_behind_them() {
        let map = line(6);
        let team = [
            standing(0, 1, 5),
            standing(1, 2, 5),
            standing(2, 3, 0),
            standing(3, 5, 5),
        ];
        let waits = Waits::of(&map, LEAVING, &team);
        assert_eq!(waits.circles, [vec![1, 2]]);
        assert_eq!(waits.behind, BTreeSet::from([0]));
        assert_eq!(waits.round(&[1, 2]), [1, 2]);
        let named = waits.named(|rover| format!("r{rover}"), &team);
        assert_eq!(
            named[0].to_string(),
            "r1 at 2 waits for r2 at 3, which waits for r1"
        );
        let unknown = WaitRule::of(Policy::Reference, false);
        assert_eq!(Waits::of(&map, unknown, &team), Waits::default());
        // One that drives on frees all behind it.
        let mut team = team;
        team[2].place = Place::Between(VertexId(3), VertexId(4));
        let waits = Waits::of(&map, LEAVING, &team);
        assert_eq!(waits.on, BTreeMap::from([(0, vec![1])]));
        assert!(waits.circles.is_empty() && waits.behind.is_empty());
    }

    #[test]
    fn who_is_at_its_goal_waits_for_room_where_it_is_to_make_some() {
        let (map, team) = (
            line(3),
            [standing(0, 0, 2), standing(1, 1, 1), standing(2, 2, 0)],
        );
        let circles = |policy| Waits::of(&map, WaitRule::of(policy, true), &team).circles;
        assert_eq!(circles(Policy::Complete), [vec![0, 1, 2]]);
        assert!(circles(Policy::Reference).is_empty());
    }

    #[test]
    fn who_has_a_free_vertex_beside_it_or_leaves_is_not_locked_and_frees_others() {
        let map = line(5);
        let locked = |rule, team: &[Standing]| -> Vec<u32> {
            Waits::of(&map, rule, team).locked.into_iter().collect()
        };
        // Two that face each other, with room behind one of them only.
        let facing = [
            standing(0, 0, 4),
            standing(1, 1, 4),
            standing(2, 2, 0),
            standing(3, 3, 0),
        ];
        assert!(locked(LEAVING, &facing).is_empty());
        let full = [&facing[..], &[standing(4, 4, 0)]].concat();
        assert_eq!(locked(LEAVING, &full), [0, 1, 2, 3, 4]);
        // One that is at its goal leaves the map, unless rovers stay.
        let done = [&facing[..], &[standing(4, 4, 4)]].concat();
        assert!(locked(LEAVING, &done).is_empty());
        let staying = WaitRule::of(Policy::Complete, true);
        assert_eq!(locked(staying, &done), [0, 1, 2, 3, 4]);
        // One that drives has left its vertex, or is about to; one that is down for good never has.
        let mut driving = done.clone();
        driving[4].place = Place::Between(VertexId(4), VertexId(3));
        driving.remove(3);
        assert!(locked(staying, &driving).is_empty());
        let mut down = facing;
        down[3].is_down = true;
        assert_eq!(locked(LEAVING, &down), [0, 1, 2, 3]);
    }

    proptest! {
        /// The locked are the union of all sets in which each stands and has members only beside
        /// it: found by trying every set.
        #[test]
        fn the_locked_by_brute_force(
            places in prop::collection::vec((0u32..12, 0u32..12, any::<bool>()), 7),
            cuts in any::<u64>(),
        ) {
            let map = crate::cases::strategies::cut_grid(4, 3, cuts);
            let mut team: Vec<Standing> = Vec::new();
            for &(at, goal, is_down) in &places {
                if team.iter().all(|other| other.place.claim() != Some(VertexId(at))) {
                    let is_down = is_down && at % 3 == 0;
                    let rover = standing(team.len() as u32, at, goal);
                    team.push(Standing { is_down, ..rover });
                }
            }
            let holder = |v: VertexId| team.iter().find(|s| s.place.claim() == Some(v));
            let held = |set: u32, v: VertexId| {
                holder(v).is_some_and(|other| set >> other.rover & 1 == 1)
            };
            let stays = |set: u32, s: &Standing| {
                let here = s.place.claim().unwrap();
                let shut = map.neighbors(here).iter().all(|next| held(set, *next));
                s.is_down || here != s.goal && shut
            };
            let closed = |set: &u32| {
                team.iter().filter(|s| set >> s.rover & 1 == 1).all(|s| stays(*set, s))
            };
            let largest = (0..1u32 << team.len()).filter(closed).fold(0, |all, set| all | set);
            let expected: BTreeSet<u32> = (0..7).filter(|r| largest >> r & 1 == 1).collect();
            prop_assert_eq!(Waits::of(&map, LEAVING, &team).locked, expected);
        }

        /// The stuck are the largest set in which each waits for members only: found by trying
        /// every set. Circles are what can reach each other.
        #[test]
        fn stuck_and_circles_by_brute_force(
            lists in prop::collection::vec(prop::collection::btree_set(0u32..7, 0..3), 7),
        ) {
            let on: BTreeMap<u32, Vec<u32>> = (0..)
                .zip(&lists)
                .map(|(rover, list)| {
                    (rover, list.iter().copied().filter(|r| *r != rover).collect())
                })
                .filter(|(_, list): &(u32, Vec<u32>)| !list.is_empty())
                .collect();
            let closed = |set: u32| (0..7).filter(|r| set >> r & 1 == 1).all(|rover| {
                on.get(&rover).is_some_and(|list| list.iter().all(|h| set >> h & 1 == 1))
            });
            let largest = (0u32..128).filter(|set| closed(*set)).fold(0, |all, set| all | set);
            let expected: BTreeSet<u32> = (0..7).filter(|r| largest >> r & 1 == 1).collect();
            let found = stuck(&on);
            prop_assert_eq!(&found, &expected);
            // Reachability by repeated squaring of the relation.
            let mut can = [[false; 7]; 7];
            for (a, list) in on.iter().filter(|(a, _)| found.contains(a)) {
                for b in list.iter().filter(|b| found.contains(b)) {
                    can[*a as usize][*b as usize] = true;
                }
            }
            for via in 0..7 {
                for a in 0..7 {
                    for b in 0..7 {
                        can[a][b] |= can[a][via] && can[via][b];
                    }
                }
            }
            let parts = circles(&on, &found);
            for a in 0..7u32 {
                for b in (0..7u32).filter(|b| *b != a) {
                    let both = can[a as usize][b as usize] && can[b as usize][a as usize];
                    let together = parts.iter().any(|part| part.contains(&a) && part.contains(&b));
                    prop_assert_eq!(both, together);
                }
            }
            for part in &parts {
                let waits = Waits { on: on.clone(), circles: parts.clone(), ..Waits::default() };
                let round = waits.round(part);
                prop_assert!(round.len() > 1 && part.contains(&round[0]));
                prop_assert_eq!(round.iter().min(), round.first());
                for (at, rover) in round.iter().enumerate() {
                    prop_assert!(on[rover].contains(&round[(at + 1) % round.len()]));
                }
            }
        }
    }
}
