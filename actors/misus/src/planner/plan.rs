//! A team's plan as data, and whether it is valid.
//!
//! [`violations`] and [`score`] are written from what a problem says, walk through the plan, and share no code with
//! chains, planners or [`super::instance`]: what planners return is judged by somebody else.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::problem::{Goal, Problem, Rover};

/// What a rover does, and when.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stop {
    /// The name of a goal or of an activity.
    pub task: String,
    /// In which of the rover's sols.
    pub sol: usize,
    /// When it begins \[ms\]. The drive to its place is made in the same sol, before.
    pub start_ms: i64,
}

/// What each rover does, in order.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TeamPlan {
    /// By rover, as in the problem.
    pub rovers: Vec<Vec<Stop>>,
}

/// Why a plan cannot be carried out.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum PlanViolation {
    /// More or fewer rovers than there are.
    #[error("a plan of {found} rovers, expected {expected}")]
    Rovers {
        /// How many it is of.
        found: usize,
        /// How many there are.
        expected: usize,
    },
    /// Something that the rover does not have to do, or a sol that it does not have.
    #[error("{rover}: no task {task:?} in its sol {sol}")]
    Unknown {
        /// The rover.
        rover: String,
        /// What it does.
        task: String,
        /// The sol.
        sol: usize,
    },
    /// More energy than there is.
    #[error("{rover}: sol {sol} takes {used_uj} uJ of {has_uj} uJ")]
    Power {
        /// The rover.
        rover: String,
        /// The sol.
        sol: usize,
        /// What is used \[uJ\].
        used_uj: i64,
        /// What there is \[uJ\].
        has_uj: i64,
    },
    /// More memory than there is.
    #[error("{rover}: {stored_bits} bit are stored after {task:?}, of {has_bits} bit")]
    Memory {
        /// The rover.
        rover: String,
        /// After what.
        task: String,
        /// What is stored \[bit\].
        stored_bits: i64,
        /// What there is room for \[bit\].
        has_bits: i64,
    },
    /// Outside of a window or of the sol.
    #[error(
        "{rover}: {task:?} from {start_ms} ms to {end_ms} ms, allowed from {opens_ms} ms to {closes_ms} ms"
    )]
    Window {
        /// The rover.
        rover: String,
        /// What.
        task: String,
        /// When it begins \[ms\].
        start_ms: i64,
        /// When it ends \[ms\].
        end_ms: i64,
        /// When it may begin \[ms\].
        opens_ms: i64,
        /// When it has to have ended \[ms\].
        closes_ms: i64,
    },
    /// Before the rover can be there.
    #[error(
        "{rover}: {task:?} begins at {start_ms} ms, the rover is ready for it at {ready_ms} ms"
    )]
    Early {
        /// The rover.
        rover: String,
        /// What.
        task: String,
        /// When it begins \[ms\].
        start_ms: i64,
        /// When the rover is there \[ms\].
        ready_ms: i64,
    },
    /// Not after what it requires.
    #[error("{rover}: {task:?} requires {required:?} before it")]
    Order {
        /// The rover.
        rover: String,
        /// What.
        task: String,
        /// What it requires.
        required: String,
    },
    /// More often than once, or by fewer rovers at one time than it needs.
    #[error("{task:?} is done by {rovers} rovers at {times} times, expected {expected} at once")]
    Together {
        /// What.
        task: String,
        /// By how many.
        rovers: usize,
        /// At how many different times.
        times: usize,
        /// By how many it has to be done.
        expected: u32,
    },
    /// What has to be done is not.
    #[error("{task:?} has to be done and is not")]
    Missing {
        /// What.
        task: String,
    },
}

/// All that is wrong with a plan, of straight drives whose lengths are rounded to millimetres and whose
/// durations are rounded up to milliseconds.
///
/// ```
/// use farside_misus::planner::plan::{Stop, TeamPlan, score, violations};
/// use farside_misus::planner::problem::{ProblemConfig, generate};
/// let problem = generate(&ProblemConfig { rovers: 1, sols: 1, ..ProblemConfig::default() }, 1)?;
/// let stop = |task: &str, start_ms| Stop { task: task.to_string(), sol: 0, start_ms };
/// let early = stop("rock_01_a", 0);
/// let talk = stop("rover_01_communication_1", 17_400_000);
/// let plan = TeamPlan { rovers: vec![vec![early, talk]] };
/// let found = violations(&problem, &plan);
/// assert_eq!(found.len(), 1);
/// assert!(found[0].to_string().starts_with("rover_01: \"rock_01_a\" begins at 0 ms"));
/// assert_eq!(score(&problem, &plan), problem.goals[0].weight);
/// # Ok::<(), farside_misus::planner::problem::ProblemError>(())
/// ```
pub fn violations(problem: &Problem, plan: &TeamPlan) -> Vec<PlanViolation> {
    let mut found = Vec::new();
    if plan.rovers.len() != problem.rovers.len() {
        found.push(PlanViolation::Rovers {
            found: plan.rovers.len(),
            expected: problem.rovers.len(),
        });
    }
    for (rover, stops) in problem.rovers.iter().zip(&plan.rovers) {
        walk(problem, rover, stops, &mut found);
    }
    let doers = doers(plan);
    for goal in &problem.goals {
        let starts = doers.get(goal.name.as_str());
        let rovers = starts.map_or(0, Vec::len);
        let times = starts.map_or(0, |at| at.iter().collect::<BTreeSet<_>>().len());
        if rovers > 0 && (rovers != goal.rovers as usize || times != 1) {
            found.push(PlanViolation::Together {
                task: goal.name.clone(),
                rovers,
                times,
                expected: goal.rovers,
            });
        }
        if goal.mandatory && rovers == 0 {
            let task = goal.name.clone();
            found.push(PlanViolation::Missing { task });
        }
    }
    for activity in &problem.activities {
        if !doers.contains_key(activity.name.as_str()) {
            let task = activity.name.clone();
            found.push(PlanViolation::Missing { task });
        }
    }
    found
}

/// What a plan is worth by Equation 1: each goal once, if as many rovers do it as it needs.
pub fn score(problem: &Problem, plan: &TeamPlan) -> f64 {
    let doers = doers(plan);
    let enough = |goal: &&Goal| {
        let rovers = doers.get(goal.name.as_str()).map_or(0, Vec::len);
        rovers >= goal.rovers as usize
    };
    let achieved: Vec<&Goal> = problem.goals.iter().filter(enough).collect();
    let names: BTreeSet<&str> = achieved.iter().map(|goal| goal.name.as_str()).collect();
    let mut score = 0.0;
    for goal in achieved {
        score += goal.weight;
    }
    for combination in &problem.combinations {
        if combination
            .goals
            .iter()
            .all(|name| names.contains(name.as_str()))
        {
            score += combination.weight;
        }
    }
    score
}

/// How far a team drives \[m\].
pub fn traverse_m(problem: &Problem, plan: &TeamPlan) -> f64 {
    let mut traverse_m = 0.0;
    for (rover, stops) in problem.rovers.iter().zip(&plan.rovers) {
        let mut at_m = rover.position_m;
        for goal in stops.iter().filter_map(|stop| goal_of(problem, &stop.task)) {
            traverse_m += length_m(at_m, goal.position_m);
            at_m = goal.position_m;
        }
    }
    traverse_m
}

/// When each task is begun, by whoever does it.
fn doers(plan: &TeamPlan) -> BTreeMap<&str, Vec<i64>> {
    let mut doers: BTreeMap<&str, Vec<i64>> = BTreeMap::new();
    for stop in plan.rovers.iter().flatten() {
        doers.entry(&stop.task).or_default().push(stop.start_ms);
    }
    doers
}

fn goal_of<'a>(problem: &'a Problem, name: &str) -> Option<&'a Goal> {
    problem.goals.iter().find(|goal| goal.name == name)
}

fn length_m(from_m: [f64; 2], to_m: [f64; 2]) -> f64 {
    libm::hypot(from_m[0] - to_m[0], from_m[1] - to_m[1])
}

fn drive_ms(rover: &Rover, from_m: [f64; 2], to_m: [f64; 2]) -> i64 {
    let mm = libm::round(1e3 * length_m(from_m, to_m)) as i64;
    let speed = i64::from(rover.speed_mm_s);
    (1000 * mm + speed - 1) / speed
}

/// A rover while its plan is walked through.
struct Walk<'a> {
    problem: &'a Problem,
    rover: &'a Rover,
    at_m: [f64; 2],
    /// In which sol it is, and when it has done what comes before.
    ready: (usize, i64),
    stored_bits: i64,
    used_uj: Vec<i64>,
    done: BTreeSet<&'a str>,
    found: &'a mut Vec<PlanViolation>,
}

/// Walks through the plan of one rover.
fn walk(problem: &Problem, rover: &Rover, stops: &[Stop], found: &mut Vec<PlanViolation>) {
    let mut walk = Walk {
        problem,
        rover,
        at_m: rover.position_m,
        ready: (0, i64::MIN),
        stored_bits: rover.stored_bits,
        used_uj: vec![0; rover.sols.len()],
        done: BTreeSet::new(),
        found,
    };
    for stop in stops {
        if !walk.go(stop) {
            walk.found.push(PlanViolation::Unknown {
                rover: rover.name.clone(),
                task: stop.task.clone(),
                sol: stop.sol,
            });
        }
    }
    for (number, (used_uj, sol)) in walk.used_uj.into_iter().zip(&rover.sols).enumerate() {
        if used_uj > sol.energy_uj {
            walk.found.push(PlanViolation::Power {
                rover: rover.name.clone(),
                sol: number,
                used_uj,
                has_uj: sol.energy_uj,
            });
        }
    }
}

impl<'a> Walk<'a> {
    /// To the next stop; false if the rover has no such task or sol, or the sol is over.
    fn go(&mut self, stop: &Stop) -> bool {
        let (problem, rover) = (self.problem, self.rover);
        let goal = goal_of(problem, &stop.task);
        let activity = problem
            .activities
            .iter()
            .find(|at| at.name == stop.task && at.rover == rover.name && at.sol == stop.sol);
        if stop.sol < self.ready.0 || stop.sol >= rover.sols.len() {
            return false;
        }
        let (duration_ms, power_mw, window_ms) = match (goal, activity) {
            (Some(goal), _) => (goal.duration_ms, goal.power_mw, goal.window_ms),
            (_, Some(other)) => (other.duration_ms, other.power_mw, Some(other.window_ms)),
            _ => return false,
        };
        let to_m = goal.map_or(self.at_m, |goal| goal.position_m);
        let drive_ms = drive_ms(rover, self.at_m, to_m);
        let end_ms = stop.start_ms + duration_ms;
        self.check_times(stop, drive_ms, end_ms, window_ms);
        self.stored_bits += goal.map_or(0, |goal| goal.memory_bits);
        if self.stored_bits > rover.memory_bits {
            self.found.push(PlanViolation::Memory {
                rover: rover.name.clone(),
                task: stop.task.clone(),
                stored_bits: self.stored_bits,
                has_bits: rover.memory_bits,
            });
        }
        let sends_bits = activity.map_or(0, |at| at.sends_bits);
        self.stored_bits = (self.stored_bits - sends_bits).max(0);
        if let Some(goal) = goal {
            self.check_order(goal);
        }
        self.used_uj[stop.sol] += drive_ms * rover.drive_mw + duration_ms * power_mw;
        (self.at_m, self.ready) = (to_m, (stop.sol, end_ms));
        true
    }

    fn check_times(
        &mut self,
        stop: &Stop,
        drive_ms: i64,
        end_ms: i64,
        window_ms: Option<[i64; 2]>,
    ) {
        let sol = &self.rover.sols[stop.sol];
        let free_ms = match stop.sol == self.ready.0 {
            true => self.ready.1.max(sol.opens_ms),
            false => sol.opens_ms,
        };
        let (rover, task, start_ms) = (&self.rover.name, &stop.task, stop.start_ms);
        if start_ms < free_ms + drive_ms {
            self.found.push(PlanViolation::Early {
                rover: rover.clone(),
                task: task.clone(),
                start_ms,
                ready_ms: free_ms + drive_ms,
            });
        }
        let [opens_ms, closes_ms] = window_ms.unwrap_or([sol.opens_ms, sol.closes_ms]);
        let (opens_ms, closes_ms) = (opens_ms.max(sol.opens_ms), closes_ms.min(sol.closes_ms));
        if start_ms < opens_ms || end_ms > closes_ms {
            self.found.push(PlanViolation::Window {
                rover: rover.clone(),
                task: task.clone(),
                start_ms,
                end_ms,
                opens_ms,
                closes_ms,
            });
        }
    }

    fn check_order(&mut self, goal: &'a Goal) {
        for required in &goal.requires {
            if !self.done.contains(required.as_str()) {
                self.found.push(PlanViolation::Order {
                    rover: self.rover.name.clone(),
                    task: goal.name.clone(),
                    required: required.clone(),
                });
            }
        }
        self.done.insert(&goal.name);
    }
}
