//! Plans in time: whole cycles are one way for time to pass, and driving by length is another.

use farside_worlds::VertexId;

use super::plan::{Failure, Outcome, Plan, Trip};
use super::problem::{Problem, Rules};
use super::safe_intervals::{FOREVER, TimedVisit};

/// How time passes for a rover on a roadmap, counted in ticks: cycles, nanoseconds, or what one
/// likes.
///
/// ```
/// use farside_network::mapf::Pace;
/// use farside_worlds::VertexId as V;
/// assert_eq!((Pace::CYCLES.travel)(V(3), V(4)), 1);
/// let slow = Pace { travel: &|from, _| 10 + u64::from(from.0), enter: 5, headway: 2 };
/// assert_eq!((slow.travel)(V(3), V(4)), 13);
/// ```
#[derive(Clone, Copy)]
pub struct Pace<'a> {
    /// From setting out along an edge to being ready to set out again; at least 1.
    pub travel: &'a dyn Fn(VertexId, VertexId) -> u64,
    /// From coming in at the entry to being ready to set out. With [`Rules::StayAtTarget`] it
    /// counts from the start.
    pub enter: u64,
    /// The least time between one rover's leaving a vertex and the next one's setting out for it.
    /// With none a rover may follow at once; but still no two may change places, nor several in a
    /// ring.
    pub headway: u64,
}

impl Pace<'static> {
    /// Whole cycles: see [the model](super#the-model).
    pub const CYCLES: Pace<'static> = Pace {
        travel: &|_, _| 1,
        enter: 1,
        headway: 0,
    };
}

/// A plan in ticks, and who is not served by it.
///
/// ```
/// assert!(farside_network::mapf::Timetable::default().failures.is_empty());
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Timetable {
    /// Each rover's visits one after the other; none for a rover that is not on the roadmap at all.
    /// The last visit has no end with [`Rules::StayAtTarget`].
    pub ways: Vec<Vec<TimedVisit>>,
    /// Rovers that do not reach their goals, in the order in which they were planned.
    pub failures: Vec<Failure>,
    /// How many orders were tried.
    pub tries: u32,
}

/// Something that a timetable must not hold. Rovers are named by number.
///
/// ```
/// use farside_network::mapf::{Mission, Pace, Problem, Rules, Timetable, TimetableError};
/// use farside_network::mapf::safe_intervals::TimedVisit;
/// use farside_worlds::{Roadmap, VertexId as V};
/// let text = "name = 'pair'\nboundary = [0, 1]\npositions_m = [[0, 0], [5, 0]]\nedges = [[0, 1]]";
/// let map = Roadmap::from_toml(text)?;
/// let problem = Problem::new(&map, vec![Mission::new(V(0), V(1))], Rules::DisappearAtTarget)?;
/// let visit = |vertex, start, end| TimedVisit { vertex: V(vertex), start, end };
/// let ways = vec![vec![visit(0, 0, 1), visit(1, 1, 3)]];
/// let hasty = Timetable { ways, ..Timetable::default() };
/// assert_eq!(hasty.errors(&problem, &Pace::CYCLES), []);
/// let slow = Pace { travel: &|_, _| 7, ..Pace::CYCLES };
/// assert_eq!(hasty.errors(&problem, &slow), [TimetableError::Way { rover: 0, visit: 1 }]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimetableError {
    /// A visit that does not begin where and when the one before it ends, is shorter than what it
    /// takes to get there, or begins or ends a way where the mission does not.
    Way {
        /// Whose.
        rover: usize,
        /// Which of its visits, from 0.
        visit: usize,
    },
    /// Two rovers' visits of one vertex come too close.
    Meet {
        /// Where.
        vertex: VertexId,
        /// The earlier one and the later one.
        rovers: (usize, usize),
    },
    /// A rover comes in no later than one that stood before it in its queue.
    Overtakes {
        /// Who.
        rover: usize,
    },
}

impl Timetable {
    /// Whether it is better than another: fewer failures, then an earlier arrival on average.
    pub(crate) fn is_better_than(&self, other: &Timetable, pace: &Pace<'_>) -> bool {
        let rank = |table: &Timetable| {
            let failed = |rover: &usize| table.failures.iter().any(|f| f.rover == *rover);
            let served = (0..table.ways.len()).filter(|rover| !failed(rover));
            let sum: u64 = served.map(|rover| arrival(&table.ways[rover], pace)).sum();
            (table.failures.len(), sum)
        };
        rank(self) < rank(other)
    }

    /// The same in cycles, for a plan made with [`Pace::CYCLES`].
    pub(crate) fn in_cycles(self) -> Outcome {
        Outcome {
            plan: Plan {
                trips: self.ways.iter().map(|way| trip(way)).collect(),
            },
            failures: self.failures,
            tries: self.tries,
        }
    }

    /// All that is wrong with it, told from the timetable and the problem alone. Rings of rovers
    /// that change places at one instant are found where there is no gap by
    /// [`Plan::conflicts`]; where there is one there are none.
    pub fn errors(&self, problem: &Problem<'_>, pace: &Pace<'_>) -> Vec<TimetableError> {
        let mut errors = Vec::new();
        let mut visits = Vec::new();
        for (rover, way) in self.ways.iter().enumerate() {
            let wrong = |visit: &usize| !fits(problem, pace, rover, way, *visit);
            let wrong = (0..way.len()).filter(wrong);
            errors.extend(wrong.map(|visit| TimetableError::Way { rover, visit }));
            visits.extend(
                way.iter()
                    .map(|visit| (visit.vertex, visit.start, visit.end, rover)),
            );
            let before = problem
                .predecessor(rover)
                .and_then(|p| self.ways[p].first());
            let first = way.first();
            if let (Some(before), Some(first)) = (before, first)
                && first.start <= before.start
            {
                errors.push(TimetableError::Overtakes { rover });
            }
        }
        visits.sort_unstable();
        for pair in visits.windows(2) {
            let ((vertex, _, end, a), (then, start, _, b)) = (pair[0], pair[1]);
            if vertex == then && start < end.saturating_add(pace.headway) {
                let rovers = (a, b);
                errors.push(TimetableError::Meet { vertex, rovers });
            }
        }
        errors
    }
}

/// Whether a visit of a way follows from the one before it, and the way from the mission.
fn fits(
    problem: &Problem<'_>,
    pace: &Pace<'_>,
    rover: usize,
    way: &[TimedVisit],
    at: usize,
) -> bool {
    let (mission, visit) = (problem.missions()[rover], way[at]);
    let stays = problem.rules() == Rules::StayAtTarget;
    let takes = match at.checked_sub(1).map(|before| way[before]) {
        None => {
            if visit.vertex != mission.entry || stays && visit.start != 0 {
                return false;
            }
            pace.enter
        }
        Some(before) => {
            let map = problem.roadmap();
            if before.end != visit.start || !map.are_adjacent(before.vertex, visit.vertex) {
                return false;
            }
            (pace.travel)(before.vertex, visit.vertex)
        }
    };
    let is_last = at + 1 == way.len();
    let ends = !is_last || stays || visit.vertex == mission.goal;
    ends && (visit.end == FOREVER) == (is_last && stays) && visit.end - visit.start >= takes
}

/// When a rover is at the end of its way.
fn arrival(way: &[TimedVisit], pace: &Pace<'_>) -> u64 {
    match way {
        [] => 0,
        [only] => only.start + pace.enter,
        [.., before, last] => last.start + (pace.travel)(before.vertex, last.vertex),
    }
}

/// Where a rover is in each cycle, by a way in cycles.
fn trip(way: &[TimedVisit]) -> Option<Trip> {
    let mut trip = Trip {
        entered: way.first()?.start as u32,
        vertices: Vec::new(),
    };
    for visit in way {
        let cycles = match visit.end {
            FOREVER => 1,
            end => end - visit.start,
        };
        trip.vertices.extend((0..cycles).map(|_| visit.vertex));
    }
    Some(trip)
}
