//! The checker: what is wrong with a plan, told from the plan and the problem alone. It shares
//! nothing with the planners, and looks at one cycle after the other as an onlooker would.

use std::collections::BTreeMap;

use farside_worlds::VertexId;

use super::plan::{Plan, Trip};
use super::problem::{Problem, Rules};

/// Something that a plan must not hold. Rovers are named by number, lower ones first.
///
/// ```
/// use farside_network::mapf::{Conflict, Mission, Plan, Problem, Rules, Trip};
/// use farside_worlds::{Roadmap, VertexId as V};
/// let text = "name = 'pair'\nboundary = [0, 1]\npositions_m = [[0, 0], [5, 0]]\nedges = [[0, 1]]";
/// let map = Roadmap::from_toml(text)?;
/// let missions = vec![Mission::new(V(0), V(1)), Mission::new(V(1), V(0))];
/// let problem = Problem::new(&map, missions, Rules::DisappearAtTarget)?;
/// let trip = |way: [V; 2]| Some(Trip { entered: 0, vertices: way.to_vec() });
/// let plan = Plan { trips: vec![trip([V(0), V(1)]), trip([V(1), V(0)])] };
/// let swap = Conflict::Swap { cycle: 1, rovers: (0, 1), edge: (V(0), V(1)) };
/// assert_eq!(plan.conflicts(&problem), [swap]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Conflict {
    /// There is not one trip, or none, for each rover.
    Count {
        /// Trips in the plan.
        trips: usize,
        /// Rovers in the problem.
        rovers: usize,
    },
    /// A trip without a vertex.
    Empty {
        /// Whose.
        rover: usize,
    },
    /// A trip begins elsewhere than at the entry, or, for a rover that stands on the map, later
    /// than in cycle 0.
    Start {
        /// Whose.
        rover: usize,
        /// Where it begins.
        vertex: VertexId,
        /// And when.
        cycle: u32,
    },
    /// A trip of a rover that leaves at its goal ends elsewhere.
    End {
        /// Whose.
        rover: usize,
        /// Where it ends.
        vertex: VertexId,
    },
    /// A rover that leaves at its goal is there earlier than at its trip's end.
    GoesOn {
        /// Whose.
        rover: usize,
        /// When it should have been gone.
        cycle: u32,
    },
    /// A rover gets from one vertex to another with no edge between them, or out of the roadmap.
    Jump {
        /// Who.
        rover: usize,
        /// The cycle in which it lands.
        cycle: u32,
        /// From where.
        from: VertexId,
        /// To where.
        to: VertexId,
    },
    /// A rover enters no later than one that stood before it in their queue.
    Overtakes {
        /// Who.
        rover: usize,
        /// The one that stood before it.
        predecessor: usize,
    },
    /// Two rovers at one vertex.
    Vertex {
        /// When.
        cycle: u32,
        /// Where.
        vertex: VertexId,
        /// Who.
        rovers: (usize, usize),
    },
    /// Two rovers change places.
    Swap {
        /// The cycle in which each is where the other was.
        cycle: u32,
        /// Who.
        rovers: (usize, usize),
        /// Between which vertices, the first rover's old one first.
        edge: (VertexId, VertexId),
    },
    /// Three or more rovers move on together round a cycle of the graph.
    Rotation {
        /// The cycle in which each is where the next was.
        cycle: u32,
        /// Who, each followed by the one whose vertex it takes, from the lowest number on.
        rovers: Vec<usize>,
    },
}

impl Conflict {
    /// Who has to do with it; nobody with a plan of the wrong length.
    pub fn rovers(&self) -> Vec<usize> {
        match self {
            Conflict::Count { .. } => vec![],
            Conflict::Empty { rover }
            | Conflict::Start { rover, .. }
            | Conflict::End { rover, .. }
            | Conflict::GoesOn { rover, .. }
            | Conflict::Jump { rover, .. } => vec![*rover],
            Conflict::Overtakes { rover, predecessor } => vec![*predecessor, *rover],
            Conflict::Vertex { rovers, .. } | Conflict::Swap { rovers, .. } => {
                vec![rovers.0, rovers.1]
            }
            Conflict::Rotation { rovers, .. } => rovers.clone(),
        }
    }
}

impl Plan {
    /// Everything that is wrong with this plan for `problem`, first what is wrong with single
    /// trips, then by cycle. Empty: it can be driven. Whether all arrive is another question (see
    /// [`Plan::arrives`]).
    pub fn conflicts(&self, problem: &Problem<'_>) -> Vec<Conflict> {
        let (trips, rovers) = (self.trips.len(), problem.missions().len());
        if trips != rovers {
            return vec![Conflict::Count { trips, rovers }];
        }
        let mut found = Vec::new();
        for (rover, trip) in self.trips.iter().enumerate() {
            match trip {
                Some(trip) if trip.vertices.is_empty() => found.push(Conflict::Empty { rover }),
                Some(trip) => check_trip(problem, rover, trip, &mut found),
                None => {}
            }
        }
        if !found.is_empty() {
            return found;
        }
        check_queues(self, problem, &mut found);
        let stays = problem.rules() == Rules::StayAtTarget;
        let present = self.trips.iter().flatten();
        let end = present.map(Trip::last_cycle).max().unwrap_or(0);
        let mut before = BTreeMap::new();
        for cycle in 0..=end {
            let now = self.positions(cycle, stays);
            check_cycle(cycle, &before, &now, &mut found);
            before = now;
        }
        found
    }

    /// Where each rover on the roadmap is.
    fn positions(&self, cycle: u32, stays: bool) -> BTreeMap<usize, VertexId> {
        let at = |trip: &Trip| {
            let beyond = stays && cycle > trip.last_cycle();
            trip.at(cycle).or_else(|| beyond.then(|| trip.end()))
        };
        let trips = self.trips.iter().enumerate();
        trips
            .filter_map(|(rover, trip)| Some((rover, at(trip.as_ref()?)?)))
            .collect()
    }
}

fn check_trip(problem: &Problem<'_>, rover: usize, trip: &Trip, found: &mut Vec<Conflict>) {
    let (mission, map) = (problem.missions()[rover], problem.roadmap());
    let (vertex, cycle) = (trip.vertices[0], trip.entered);
    let stays = problem.rules() == Rules::StayAtTarget;
    if vertex != mission.entry || stays && cycle != 0 {
        found.push(Conflict::Start {
            rover,
            vertex,
            cycle,
        });
    }
    for (cycle, step) in (trip.entered + 1..).zip(trip.vertices.windows(2)) {
        let (from, to) = (step[0], step[1]);
        let inside = |v: VertexId| (v.0 as usize) < map.len();
        let can = inside(from) && inside(to) && (from == to || map.are_adjacent(from, to));
        if !can {
            found.push(Conflict::Jump {
                rover,
                cycle,
                from,
                to,
            });
        }
        if !stays && from == mission.goal {
            found.push(Conflict::GoesOn { rover, cycle });
        }
    }
    let vertex = trip.end();
    if !stays && vertex != mission.goal {
        found.push(Conflict::End { rover, vertex });
    }
}

/// A rover with no trip holds up nobody, as if it had not been there.
fn check_queues(plan: &Plan, problem: &Problem<'_>, found: &mut Vec<Conflict>) {
    for queue in problem.queues() {
        let entries = queue
            .iter()
            .filter_map(|&rover| Some((rover, plan.trips[rover].as_ref()?.entered)));
        let entries: Vec<(usize, u32)> = entries.collect();
        for pair in entries.windows(2) {
            if pair[1].1 <= pair[0].1 {
                found.push(Conflict::Overtakes {
                    rover: pair[1].0,
                    predecessor: pair[0].0,
                });
            }
        }
    }
}

/// One cycle, and the moves into it.
fn check_cycle(
    cycle: u32,
    before: &BTreeMap<usize, VertexId>,
    now: &BTreeMap<usize, VertexId>,
    found: &mut Vec<Conflict>,
) {
    for (&a, &at) in now {
        for (&b, _) in now.range(a + 1..).filter(|&(_, &other)| other == at) {
            found.push(Conflict::Vertex {
                cycle,
                vertex: at,
                rovers: (a, b),
            });
        }
    }
    // For each rover that moved, into whose vertex: whoever stood there and has moved as well.
    let mut follows = BTreeMap::new();
    for (&rover, &to) in now {
        let Some(&from) = before.get(&rover).filter(|&&from| from != to) else {
            continue;
        };
        let left = |other: &usize| now.get(other).is_some_and(|&at| at != to);
        let other = before.iter().find(|&(other, &at)| at == to && left(other));
        if let Some((&other, _)) = other {
            follows.insert(rover, (other, from, to));
        }
    }
    for (&first, &(second, from, to)) in &follows {
        // Along the chain of who follows whom; a ring is told once, from its lowest rover on.
        let mut ring = vec![first];
        let mut next = second;
        while next > first && ring.len() <= follows.len() {
            ring.push(next);
            match follows.get(&next) {
                Some(&(after, ..)) => next = after,
                None => break,
            }
        }
        if next != first {
            continue;
        }
        if ring.len() == 2 {
            found.push(Conflict::Swap {
                cycle,
                rovers: (first, second),
                edge: (from, to),
            });
        } else {
            found.push(Conflict::Rotation {
                cycle,
                rovers: ring,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mapf::Mission;
    use crate::testing::{grid, v};

    /// The conflicts of ways through a 3 x 2 grid, each given as (entered, vertices), with missions
    /// from the first to the last vertex of each.
    fn conflicts(rules: Rules, ways: &[(u32, &[u32])]) -> Vec<Conflict> {
        let map = grid(3, 2, &[]);
        let mission = |way: &&(u32, &[u32])| Mission::new(v(way.1[0]), v(way.1[way.1.len() - 1]));
        let missions = ways.iter().map(|way| mission(&way)).collect();
        let problem = Problem::new(&map, missions, rules).unwrap();
        plan(ways).conflicts(&problem)
    }

    fn plan(ways: &[(u32, &[u32])]) -> Plan {
        let trip = |&(entered, way): &(u32, &[u32])| {
            let vertices = way.iter().copied().map(v).collect();
            Some(Trip { entered, vertices })
        };
        Plan {
            trips: ways.iter().map(trip).collect(),
        }
    }

    #[test]
    fn two_at_one_vertex() {
        let expected = Conflict::Vertex {
            cycle: 1,
            vertex: v(1),
            rovers: (0, 1),
        };
        assert_eq!(
            conflicts(
                Rules::DisappearAtTarget,
                &[(0, &[0, 1, 2]), (0, &[2, 1, 4])]
            ),
            [expected]
        );
        // Where one stays for ever, and one only passes later.
        let expected = Conflict::Vertex {
            cycle: 3,
            vertex: v(1),
            rovers: (0, 1),
        };
        let ways: [(u32, &[u32]); 2] = [(0, &[0, 1]), (0, &[5, 5, 4, 1, 2])];
        assert_eq!(conflicts(Rules::StayAtTarget, &ways), [expected]);
        assert_eq!(
            conflicts(Rules::DisappearAtTarget, &ways),
            [],
            "it is gone by then"
        );
        // One enters where another passes.
        let ways: [(u32, &[u32]); 2] = [(0, &[0, 1, 2]), (1, &[1, 4])];
        assert_eq!(conflicts(Rules::DisappearAtTarget, &ways).len(), 1);
    }

    #[test]
    fn following_closely_is_allowed_and_swapping_is_not() {
        let ways: [(u32, &[u32]); 3] = [(0, &[1, 2, 5]), (0, &[0, 1, 2]), (0, &[3, 0, 1])];
        assert_eq!(conflicts(Rules::DisappearAtTarget, &ways), []);
        // Into the queue's place, behind one that arrives and is gone.
        let ways: [(u32, &[u32]); 3] = [(0, &[0, 1]), (1, &[0, 1]), (2, &[0, 3])];
        assert_eq!(conflicts(Rules::DisappearAtTarget, &ways), []);
        let swap = Conflict::Swap {
            cycle: 1,
            rovers: (0, 1),
            edge: (v(1), v(2)),
        };
        assert_eq!(
            conflicts(Rules::DisappearAtTarget, &[(0, &[1, 2]), (0, &[2, 1])]),
            [swap]
        );
    }

    #[test]
    fn a_rotation_is_named_from_its_lowest_rover_on() {
        let ring: [(u32, &[u32]); 4] = [(0, &[1, 4]), (0, &[4, 3]), (0, &[0, 1]), (0, &[3, 0])];
        let expected = Conflict::Rotation {
            cycle: 1,
            rovers: vec![0, 1, 3, 2],
        };
        assert_eq!(conflicts(Rules::StayAtTarget, &ring), [expected]);
        assert_eq!(
            conflicts(Rules::StayAtTarget, &ring[..3]),
            [],
            "one place is free"
        );
    }

    #[test]
    fn trips_must_make_sense() {
        let map = grid(3, 2, &[]);
        let missions = vec![Mission::new(v(0), v(2)), Mission::new(v(0), v(5))];
        let problem = Problem::new(&map, missions, Rules::DisappearAtTarget).unwrap();
        let check = |ways: &[(u32, &[u32])]| plan(ways).conflicts(&problem);
        let good: (u32, &[u32]) = (1, &[0, 1, 4, 5]);
        assert_eq!(check(&[(0, &[0, 1, 2]), good]), []);
        let (trips, rovers) = (1, 2);
        assert_eq!(check(&[good]), [Conflict::Count { trips, rovers }]);
        assert_eq!(check(&[(0, &[]), good]), [Conflict::Empty { rover: 0 }]);
        let (rover, cycle, vertex) = (0, 0, v(1));
        let start = Conflict::Start {
            rover,
            vertex,
            cycle,
        };
        assert_eq!(check(&[(0, &[1, 2]), good]), [start]);
        assert_eq!(
            check(&[(0, &[0, 1]), good]),
            [Conflict::End { rover, vertex }]
        );
        let (from, to, cycle) = (v(0), v(2), 1);
        let jump = Conflict::Jump {
            rover,
            cycle,
            from,
            to,
        };
        assert_eq!(check(&[(0, &[0, 2]), good]), [jump]);
        let goes_on = Conflict::GoesOn { rover, cycle: 3 };
        assert_eq!(check(&[(0, &[0, 1, 2, 2]), good]), [goes_on]);
        let overtakes = Conflict::Overtakes {
            rover: 1,
            predecessor: 0,
        };
        assert_eq!(check(&[(5, &[0, 1, 2]), good]), [overtakes]);
    }
}
