//! A problem with its names resolved and every drive timed: what planners work on.
//!
//! Goals and activities are *tasks*, numbered: goals first, as in the problem, then activities. Places
//! are numbered too: that of each goal has the goal's number, and then come the places where rovers start.

use super::objective::Costs;
use super::problem::{Problem, ProblemError};

/// The duration of a drive that cannot be made \[ms\]: longer than any sol.
pub const NEVER_MS: u32 = 100_000_000;

/// What a rover does at a place, or wherever it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Task {
    /// Where; None is wherever the rover is.
    pub place: Option<usize>,
    /// When it may begin \[ms\].
    pub opens_ms: i64,
    /// When it has to have ended \[ms\].
    pub closes_ms: i64,
    /// How long it takes \[ms\].
    pub duration_ms: i64,
    /// The energy that it takes \[uJ\].
    pub energy_uj: i64,
    /// What it adds to memory \[bit\].
    pub adds_bits: i64,
    /// What it frees of memory at the most \[bit\].
    pub sends_bits: i64,
    /// Whether it has to be done.
    pub mandatory: bool,
    /// How many rovers have to do it at one time.
    pub rovers: u32,
}

/// A rover, as planners see it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Vehicle {
    /// The place where it starts.
    pub start: usize,
    /// The power that driving takes \[mW\].
    pub drive_mw: i64,
    /// How much it can store \[bit\].
    pub memory_bits: i64,
    /// How much is stored at first \[bit\].
    pub stored_bits: i64,
    /// When it can be active, and with how much energy.
    pub sols: Vec<super::problem::Sol>,
    /// Its activities: tasks, with the sol of each.
    pub activities: Vec<(usize, usize)>,
    /// Which of the tables of drives is its own.
    table: usize,
}

/// A problem, ready to be planned.
///
/// ```
/// use farside_misus::planner::instance::Instance;
/// use farside_misus::planner::problem::{ProblemConfig, generate};
/// let instance = Instance::new(&generate(&ProblemConfig::default(), 1)?)?;
/// let (goal, start) = (4, instance.vehicles()[0].start);
/// assert_eq!(instance.drive_ms(0, start, goal), instance.drive_ms(0, goal, start));
/// assert_eq!(instance.drive_ms(0, goal, goal), 0);
/// # Ok::<(), farside_misus::planner::problem::ProblemError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    goals: usize,
    places_m: Vec<[f64; 2]>,
    tasks: Vec<Task>,
    vehicles: Vec<Vehicle>,
    weights: Vec<f64>,
    rocks: Vec<Option<u32>>,
    combinations: Vec<(Vec<usize>, f64)>,
    /// By goal: with which goals it shares a combination that is worth more than nothing.
    partners: Vec<Vec<usize>>,
    requires: Vec<Vec<usize>>,
    required_by: Vec<Vec<usize>>,
    /// From place to place \[mm\]; `u32::MAX` where there is no way.
    lengths_mm: Vec<u32>,
    /// How long each takes \[ms\], for each speed.
    tables_ms: Vec<Vec<u32>>,
    costs: Costs,
}

impl Instance {
    /// Checks a problem, and times all drives, in straight lines.
    ///
    /// # Errors
    /// When the problem makes no sense, as [`Problem::resolve`] says.
    pub fn new(problem: &Problem) -> Result<Instance, ProblemError> {
        Instance::with_paths(problem, |from_m, to_m| {
            Some(libm::hypot(to_m[0] - from_m[0], to_m[1] - from_m[1]))
        })
    }

    /// As [`Instance::new`], with the length \[m\] of the way from a place to another as `length_m` says:
    /// none where there is no way. It is asked once for each two places, and taken for the way back, too.
    ///
    /// # Errors
    /// When the problem makes no sense, as [`Problem::resolve`] says.
    pub fn with_paths(
        problem: &Problem,
        mut length_m: impl FnMut([f64; 2], [f64; 2]) -> Option<f64>,
    ) -> Result<Instance, ProblemError> {
        let resolved = problem.resolve()?;
        let goals = problem.goals.len();
        let mut places_m: Vec<[f64; 2]> = problem.goals.iter().map(|at| at.position_m).collect();
        places_m.extend(problem.rovers.iter().map(|rover| rover.position_m));
        let lengths_mm = lengths(&places_m, &mut length_m);
        let mut speeds: Vec<u32> = problem.rovers.iter().map(|at| at.speed_mm_s).collect();
        speeds.sort_unstable();
        speeds.dedup();
        let tables_ms = speeds.iter().map(|&speed| timed(&lengths_mm, speed));
        let vehicles = problem.rovers.iter().enumerate().map(|(number, rover)| {
            let own = resolved.activity_rovers.iter().enumerate();
            let own = own.filter(|(_, rover)| **rover == number);
            Vehicle {
                start: goals + number,
                drive_mw: rover.drive_mw,
                memory_bits: rover.memory_bits,
                stored_bits: rover.stored_bits,
                sols: rover.sols.clone(),
                activities: own
                    .map(|(at, _)| (goals + at, problem.activities[at].sol))
                    .collect(),
                table: speeds.binary_search(&rover.speed_mm_s).unwrap_or(0),
            }
        });
        let mut required_by = vec![Vec::new(); goals];
        for (goal, requires) in resolved.requires.iter().enumerate() {
            for &other in requires {
                required_by[other].push(goal);
            }
        }
        let weights = problem.combinations.iter().map(|at| at.weight);
        let combinations: Vec<(Vec<usize>, f64)> =
            resolved.combinations.into_iter().zip(weights).collect();
        Ok(Instance {
            goals,
            tasks: tasks(problem),
            vehicles: vehicles.collect(),
            weights: problem.goals.iter().map(|goal| goal.weight).collect(),
            rocks: problem.goals.iter().map(|goal| goal.rock).collect(),
            partners: partners(goals, &combinations),
            combinations,
            requires: resolved.requires,
            required_by,
            tables_ms: tables_ms.collect(),
            places_m,
            lengths_mm,
            costs: Costs::new(
                &problem.objective,
                problem
                    .goals
                    .iter()
                    .map(|at| (at.duration_ms, at.power_mw * at.duration_ms)),
                problem.rovers.iter().map(|at| (at.speed_mm_s, at.drive_mw)),
            ),
        })
    }

    /// What the user's preferences take from the worth of plans.
    pub fn costs(&self) -> &Costs {
        &self.costs
    }

    /// How many goals there are.
    pub fn goals(&self) -> usize {
        self.goals
    }

    /// A goal or an activity.
    pub fn task(&self, task: usize) -> &Task {
        &self.tasks[task]
    }

    /// The rovers.
    pub fn vehicles(&self) -> &[Vehicle] {
        &self.vehicles
    }

    /// What each goal is worth by itself.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// The rock that a goal observes, if it is one.
    pub fn rock(&self, goal: usize) -> Option<u32> {
        self.rocks[goal]
    }

    /// The combinations: their goals in ascending order, and their weights.
    pub fn combinations(&self) -> &[(Vec<usize>, f64)] {
        &self.combinations
    }

    /// With which goals a goal shares a combination that is worth more than nothing, in ascending order.
    pub fn partners(&self, goal: usize) -> &[usize] {
        &self.partners[goal]
    }

    /// Whether a goal needs several rovers at one time.
    pub fn is_joint(&self, goal: usize) -> bool {
        self.tasks[goal].rovers > 1
    }

    /// Whether any goal does.
    pub fn has_joint(&self) -> bool {
        self.tasks.iter().any(|task| task.rovers > 1)
    }

    /// The goals that the same rover has to have achieved before a goal.
    pub fn requires(&self, goal: usize) -> &[usize] {
        &self.requires[goal]
    }

    /// The goals that require a goal.
    pub fn required_by(&self, goal: usize) -> &[usize] {
        &self.required_by[goal]
    }

    /// Where a place is, east and north of the middle \[m\].
    pub fn place_m(&self, place: usize) -> [f64; 2] {
        self.places_m[place]
    }

    /// How long a rover drives from a place to a place \[ms\], rounded up; [`NEVER_MS`] where there is no way.
    #[inline]
    pub fn drive_ms(&self, rover: usize, from: usize, to: usize) -> i64 {
        let table = &self.tables_ms[self.vehicles[rover].table];
        i64::from(table[from * self.places_m.len() + to])
    }

    /// How far it is from a place to a place \[mm\]; `u32::MAX` where there is no way.
    #[inline]
    pub fn length_mm(&self, from: usize, to: usize) -> u32 {
        self.lengths_mm[from * self.places_m.len() + to]
    }
}

fn lengths(
    places_m: &[[f64; 2]],
    length_m: &mut impl FnMut([f64; 2], [f64; 2]) -> Option<f64>,
) -> Vec<u32> {
    let n = places_m.len();
    let mut lengths_mm = vec![0; n * n];
    for from in 0..n {
        for to in from + 1..n {
            let length = length_m(places_m[from], places_m[to]);
            // Truncation of what is too long, or no number, is to u32::MAX or 0: lengths are checked first.
            let length = length.filter(|length| *length >= 0.0);
            let mm = length.map_or(u32::MAX, |length| libm::round(length * 1e3) as u32);
            lengths_mm[from * n + to] = mm;
            lengths_mm[to * n + from] = mm;
        }
    }
    lengths_mm
}

fn timed(lengths_mm: &[u32], speed_mm_s: u32) -> Vec<u32> {
    let ms = |&mm: &u32| match mm {
        u32::MAX => NEVER_MS,
        mm => {
            let ms = (u64::from(mm) * 1000).div_ceil(u64::from(speed_mm_s));
            ms.min(u64::from(NEVER_MS)) as u32
        }
    };
    lengths_mm.iter().map(ms).collect()
}

fn tasks(problem: &Problem) -> Vec<Task> {
    let goals = problem.goals.iter().enumerate().map(|(place, goal)| {
        let [opens_ms, closes_ms] = goal.window_ms.unwrap_or([0, i64::MAX]);
        Task {
            place: Some(place),
            opens_ms,
            closes_ms,
            duration_ms: goal.duration_ms,
            energy_uj: goal.power_mw * goal.duration_ms,
            adds_bits: goal.memory_bits,
            sends_bits: 0,
            mandatory: goal.mandatory,
            rovers: goal.rovers,
        }
    });
    let activities = problem.activities.iter().map(|activity| Task {
        place: None,
        opens_ms: activity.window_ms[0],
        closes_ms: activity.window_ms[1],
        duration_ms: activity.duration_ms,
        energy_uj: activity.power_mw * activity.duration_ms,
        adds_bits: 0,
        sends_bits: activity.sends_bits,
        mandatory: true,
        rovers: 1,
    });
    goals.chain(activities).collect()
}

fn partners(goals: usize, combinations: &[(Vec<usize>, f64)]) -> Vec<Vec<usize>> {
    let mut partners = vec![Vec::new(); goals];
    for (members, _) in combinations.iter().filter(|(_, weight)| *weight > 0.0) {
        for &goal in members {
            partners[goal].extend(members.iter().filter(|other| **other != goal));
        }
    }
    for list in &mut partners {
        list.sort_unstable();
        list.dedup();
    }
    partners
}
