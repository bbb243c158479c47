//! What is to be planned: a roadmap, who drives from where to where, and by which rules.

use std::collections::{BTreeMap, VecDeque};

use farside_worlds::{Roadmap, VertexId};

/// A rover's task: to get from `entry` to `goal`.
///
/// ```
/// use farside_network::mapf::Mission;
/// use farside_worlds::VertexId;
/// assert_eq!(Mission::from((VertexId(1), VertexId(2))), Mission::new(VertexId(1), VertexId(2)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mission {
    /// Where it enters the roadmap, or stands in cycle 0.
    pub entry: VertexId,
    /// Where it leaves the roadmap, or stays.
    pub goal: VertexId,
}

impl Mission {
    /// From `entry` to `goal`.
    pub fn new(entry: VertexId, goal: VertexId) -> Mission {
        Mission { entry, goal }
    }
}

impl From<(VertexId, VertexId)> for Mission {
    fn from((entry, goal): (VertexId, VertexId)) -> Mission {
        Mission { entry, goal }
    }
}

/// How rovers come and go.
///
/// ```
/// use farside_network::mapf::Rules;
/// assert_ne!(Rules::DisappearAtTarget, Rules::StayAtTarget);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Rules {
    /// Rovers wait in queues outside their entries, in the order of their numbers, and leave the
    /// roadmap at their goals.
    DisappearAtTarget,
    /// Rovers stand at their entries from cycle 0 on, and stay at their goals.
    StayAtTarget,
}

/// Why something is no problem to plan for.
///
/// ```
/// use farside_network::mapf::{Mission, Problem, ProblemError, Rules};
/// use farside_worlds::{Roadmap, VertexId};
/// let map = Roadmap::builtin("crater-sparse")?;
/// let mission = Mission::new(VertexId(0), VertexId(1));
/// let error = Problem::new(&map, vec![mission, mission], Rules::StayAtTarget).unwrap_err();
/// assert!(matches!(error, ProblemError::SameEntry { first: 0, second: 1, .. }));
/// # Ok::<(), farside_worlds::WorldError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProblemError {
    /// A mission begins or ends outside the roadmap.
    #[error("rover {rover} drives by vertex {}, but the roadmap's vertices are 0 to {}", .vertex.0, .vertices - 1)]
    Vertex {
        /// The rover's number.
        rover: usize,
        /// The vertex that is not there.
        vertex: VertexId,
        /// How many there are.
        vertices: usize,
    },
    /// Two rovers start at one vertex of a map.
    #[error("rovers {first} and {second} both start at vertex {}", .vertex.0)]
    SameEntry {
        /// The lower number.
        first: usize,
        /// The higher number.
        second: usize,
        /// Where they start.
        vertex: VertexId,
    },
    /// Two rovers are to stay at one vertex of a map.
    #[error("rovers {first} and {second} both have the goal {}", .vertex.0)]
    SameGoal {
        /// The lower number.
        first: usize,
        /// The higher number.
        second: usize,
        /// Their goal.
        vertex: VertexId,
    },
}

/// A team on a roadmap, checked. Rovers are numbered from 0, as their missions are listed.
///
/// ```
/// use farside_network::mapf::{Mission, Problem, Rules};
/// use farside_worlds::{Roadmap, VertexId};
/// let map = Roadmap::builtin("crater-sparse")?;
/// let missions = [(5, 9), (7, 9), (5, 8)].map(|(a, b)| Mission::new(VertexId(a), VertexId(b)));
/// let problem = Problem::new(&map, missions.to_vec(), Rules::DisappearAtTarget)?;
/// assert_eq!(problem.queues(), [vec![0, 2], vec![1]]);
/// assert_eq!(problem.predecessor(2), Some(0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Problem<'a> {
    roadmap: &'a Roadmap,
    missions: Vec<Mission>,
    rules: Rules,
    queues: Vec<Vec<usize>>,
    predecessors: Vec<Option<usize>>,
}

impl<'a> Problem<'a> {
    /// The problem of `missions` on `roadmap`. Entries and goals need not be on its boundary.
    ///
    /// # Errors
    /// When a mission leaves the roadmap; with [`Rules::StayAtTarget`] also when two rovers have
    /// the same entry or the same goal.
    pub fn new(
        roadmap: &'a Roadmap,
        missions: Vec<Mission>,
        rules: Rules,
    ) -> Result<Problem<'a>, ProblemError> {
        let vertices = roadmap.len();
        let (mut entries, mut goals) = (BTreeMap::new(), BTreeMap::new());
        for (rover, mission) in missions.iter().enumerate() {
            for vertex in [mission.entry, mission.goal] {
                if vertex.0 as usize >= vertices {
                    return Err(ProblemError::Vertex {
                        rover,
                        vertex,
                        vertices,
                    });
                }
            }
            if rules == Rules::DisappearAtTarget {
                continue;
            }
            if let Some(first) = entries.insert(mission.entry, rover) {
                return Err(ProblemError::SameEntry {
                    first,
                    second: rover,
                    vertex: mission.entry,
                });
            }
            if let Some(first) = goals.insert(mission.goal, rover) {
                return Err(ProblemError::SameGoal {
                    first,
                    second: rover,
                    vertex: mission.goal,
                });
            }
        }
        let mut queues = BTreeMap::<VertexId, Vec<usize>>::new();
        let mut predecessors = Vec::with_capacity(missions.len());
        for (rover, mission) in missions.iter().enumerate() {
            let queue = queues.entry(mission.entry).or_default();
            predecessors.push(queue.last().copied());
            queue.push(rover);
        }
        Ok(Problem {
            roadmap,
            missions,
            rules,
            queues: queues.into_values().collect(),
            predecessors,
        })
    }

    /// The roadmap.
    pub fn roadmap(&self) -> &'a Roadmap {
        self.roadmap
    }

    /// Each rover's mission.
    pub fn missions(&self) -> &[Mission] {
        &self.missions
    }

    /// How rovers come and go.
    pub fn rules(&self) -> Rules {
        self.rules
    }

    /// Who waits at each entry, first to last, by the entries' numbers. With
    /// [`Rules::StayAtTarget`] each rover is a queue of its own.
    pub fn queues(&self) -> &[Vec<usize>] {
        &self.queues
    }

    /// Who stands before `rover` in its queue.
    pub fn predecessor(&self, rover: usize) -> Option<usize> {
        self.predecessors[rover]
    }

    /// The fewest edges that `rover` has to drive.
    pub fn shortest(&self, rover: usize) -> u32 {
        let Mission { entry, goal } = self.missions[rover];
        self.roadmap.distance(entry, goal)
    }

    /// The rovers that have no way to their goals round the entries and goals of all others. None:
    /// the problem is *well-formed* (Cap, Vokrinek and Kleiner 2015, section 3), and
    /// [`reference`](fn@super::reference) is certain to solve it. With [`Rules::DisappearAtTarget`]
    /// every problem is: a rover that has not entered, or has left, is in nobody's way.
    ///
    /// ```
    /// use farside_network::mapf::{Mission, Problem, Rules};
    /// use farside_worlds::{Roadmap, VertexId};
    /// let line = "name = 'line'\nboundary = [0, 2]\npositions_m = [[0, 0], [5, 0], [9, 0]]\n\
    ///             edges = [[0, 1], [1, 2]]";
    /// let map = Roadmap::from_toml(line)?;
    /// let missions = [(0, 1), (1, 2)].map(|(a, b)| Mission::new(VertexId(a), VertexId(b)));
    /// let stays = Problem::new(&map, missions.to_vec(), Rules::StayAtTarget)?;
    /// assert_eq!(stays.ill_formed(), [0, 1]);
    /// let leaves = Problem::new(&map, missions.to_vec(), Rules::DisappearAtTarget)?;
    /// assert!(leaves.ill_formed().is_empty());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn ill_formed(&self) -> Vec<usize> {
        if self.rules == Rules::DisappearAtTarget {
            return Vec::new();
        }
        let mut claims = vec![0u32; self.roadmap.len()];
        for mission in &self.missions {
            claims[mission.entry.0 as usize] += 1;
            if mission.goal != mission.entry {
                claims[mission.goal.0 as usize] += 1;
            }
        }
        let blocked = |&rover: &usize| !self.has_clear_way(self.missions[rover], &claims);
        (0..self.missions.len()).filter(blocked).collect()
    }

    /// Whether some way leads from entry to goal on which nobody else has an entry or goal.
    fn has_clear_way(&self, mission: Mission, claims: &[u32]) -> bool {
        let clear = |v: VertexId| {
            let own = u32::from(v == mission.entry || v == mission.goal);
            claims[v.0 as usize] == own
        };
        let mut seen = vec![false; self.roadmap.len()];
        let mut open = VecDeque::new();
        if clear(mission.entry) {
            seen[mission.entry.0 as usize] = true;
            open.push_back(mission.entry);
        }
        while let Some(here) = open.pop_front() {
            if here == mission.goal {
                return true;
            }
            for &next in self.roadmap.neighbors(here) {
                if clear(next) && !std::mem::replace(&mut seen[next.0 as usize], true) {
                    open.push_back(next);
                }
            }
        }
        false
    }
}

/// What the best plan is.
///
/// ```
/// use farside_network::mapf::Objective;
/// assert_eq!(Objective::default(), Objective::SumOfCosts);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Objective {
    /// The least sum of the cycles in which rovers arrive for good, time in queues included.
    #[default]
    SumOfCosts,
    /// The least cycle in which all have arrived.
    Makespan,
}

/// Why there is no best plan to show.
///
/// ```
/// use farside_network::mapf::CoupledError;
/// let error = CoupledError::Exhausted { expansions: 500 };
/// assert_eq!(error.to_string(), "no plan found within 500 expansions");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CoupledError {
    /// The limit was reached: there may be a plan.
    #[error("no plan found within {expansions} expansions")]
    Exhausted {
        /// Nodes expanded.
        expansions: u64,
    },
    /// There is no plan. Never with [`Rules::DisappearAtTarget`](super::Rules::DisappearAtTarget).
    #[error("there is no plan: all of {expansions} expansions lead nowhere")]
    Unsolvable {
        /// Nodes expanded.
        expansions: u64,
    },
}
