//! The mission agent's deliberative planner: in which order goals are best done (sections 3.2 and 3.3
//! of the IDEA paper), and a plan of it for the Goal timeline, with a branch for each way in which a
//! goal can end.
//!
//! Goals are ordered with the model `k9-ordering.ddl`: what is best has all goals that must be done, if
//! the horizon and the battery allow that, else as many of them as can be; then the most weight; then
//! the most goals; then the soonest end. For few goals that is proven: the shortest drives through each
//! selection are known. Beyond, goals are inserted one by one, and the order is repaired. The complete
//! planner plans what was chosen, and says when each goal is done. All is bounded by operations and
//! gives the same for the same input.
//!
//! After a goal that was done comes the next one; after one that was not, the best order of the others
//! from where the rover was before it.
//!
//! ```
//! use farside_idea::deliberate::{Begin, Settings, Target, order};
//! let target = |number, x_dm| Target {
//!     number, x_dm, y_dm: 0, pan_deg: 0, tilt_deg: 0, camera: 0, weight: None,
//! };
//! let begin = Begin { x_dm: 0, y_dm: 0, battery: 90_000 };
//! let found = order(&[target(1, 300), target(2, 100)], &begin, &Settings::default())?;
//! let visits: Vec<i64> = found.visits.iter().map(|visit| visit.target as i64).collect();
//! assert_eq!((visits, found.proven), (vec![1, 0], true));
//! # Ok::<(), farside_idea::deliberate::DeliberationError>(())
//! ```

mod branches;
mod problem;
mod selections;
#[cfg(test)]
mod tests;

use farside_planning::Ticks;
use farside_planning::language::Findings;
use farside_planning::model::Value;
use farside_planning::search::schedule::LoadError;
use thiserror::Error;

pub use branches::{Deliberated, deliberate};

/// For more goals than these no best order is looked for: it would take too much memory.
const MOST_FEW: usize = 14;

/// A goal and its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Target {
    /// Its number; no other goal has it.
    pub number: Value,
    /// Where it is \[dm\].
    pub x_dm: Value,
    /// Where it is \[dm\].
    pub y_dm: Value,
    /// Where the cameras look \[degrees\].
    pub pan_deg: Value,
    /// Where the cameras look \[degrees\].
    pub tilt_deg: Value,
    /// With which camera, as a value of the mission agent's model.
    pub camera: Value,
    /// What it is worth; none if it must be done.
    pub weight: Option<u32>,
}

/// Where the rover is when the plan begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Begin {
    /// \[dm\]
    pub x_dm: Value,
    /// \[dm\]
    pub y_dm: Value,
    /// What the battery holds \[thousandths of a percent\].
    pub battery: Value,
}

/// What drives and images take, and how planners work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// How long a drive of a metre takes \[ticks\].
    pub ticks_per_m: Value,
    /// How long it takes to point and to take an image \[ticks\].
    pub image_ticks: Value,
    /// What a tick of driving takes \[thousandths of a percent\].
    pub drive_energy: Value,
    /// What an image takes \[thousandths of a percent\].
    pub image_energy: Value,
    /// What stays in the battery \[thousandths of a percent\].
    pub reserve: Value,
    /// How long all may take \[ticks\].
    pub horizon: Ticks,
    /// Up to so many goals the best order is proven; at most 14.
    pub few: usize,
    /// How many operations deliberation may take.
    pub operations: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            ticks_per_m: 20,
            image_ticks: 20,
            drive_energy: 8,
            image_energy: 200,
            reserve: 20_000,
            horizon: 20_000,
            few: 10,
            operations: 5_000_000,
        }
    }
}

/// Why goals cannot be ordered.
#[derive(Debug, Error)]
pub enum DeliberationError {
    /// A number that the model does not allow.
    #[error("{0}")]
    Text(#[from] Findings),
    /// What is the case cannot be.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The planner found none for an order that there is.
    #[error("no plan of the best order within {operations} operations")]
    NoPlan {
        /// How many it had.
        operations: u64,
    },
    /// Two goals have one number.
    #[error("goal {number} is there twice")]
    Twice {
        /// The number.
        number: Value,
    },
}

/// A goal in an order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Visit {
    /// Which, by its place among those that were to be ordered.
    pub target: usize,
    /// When its image begins \[ticks from the beginning\].
    pub start: Ticks,
    /// When its image is done \[ticks from the beginning\].
    pub end: Ticks,
}

/// A goal that is not in an order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// Which, by its place among those that were to be ordered.
    pub target: usize,
    /// Why.
    pub reason: String,
}

/// An order of goals.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ordering {
    /// What is done, the first one first.
    pub visits: Vec<Visit>,
    /// What is not.
    pub left_out: Vec<LeftOut>,
    /// Whether nothing is better.
    pub proven: bool,
    /// What it took.
    pub operations: u64,
}

/// The best order of goals that is found.
///
/// # Errors
///
/// If numbers are beyond those that the model knows, or two goals have one number.
pub fn order(
    targets: &[Target],
    begin: &Begin,
    settings: &Settings,
) -> Result<Ordering, DeliberationError> {
    for (place, target) in targets.iter().enumerate() {
        let number = target.number;
        if targets[..place].iter().any(|other| other.number == number) {
            return Err(DeliberationError::Twice { number });
        }
    }
    let chosen = chosen(targets, begin, settings);
    let (visits, operations) = selections::planned(&chosen, targets, begin, settings)?;
    let missing = (0..targets.len()).filter(|target| !chosen.order.contains(target));
    let left_out = missing.map(|target| {
        let reason = match selections::fits(&[target], targets, begin, settings) {
            false => "the horizon and the battery do not allow it, even alone",
            true => "the horizon and the battery do not allow it with what is worth more",
        };
        let reason = reason.to_owned();
        LeftOut { target, reason }
    });
    Ok(Ordering {
        visits,
        left_out: left_out.collect(),
        proven: chosen.proven,
        operations: chosen.operations + operations,
    })
}

fn chosen(targets: &[Target], begin: &Begin, settings: &Settings) -> selections::Chosen {
    if targets.len() <= settings.few.min(MOST_FEW) {
        selections::best(targets, begin, settings)
    } else {
        selections::good(targets, begin, settings)
    }
}

/// How long a drive takes \[ticks\]: along the straight line, rounded up; a tick at least.
pub fn drive_ticks(from_dm: [Value; 2], to_dm: [Value; 2], settings: &Settings) -> Ticks {
    let (x, y) = (to_dm[0] - from_dm[0], to_dm[1] - from_dm[1]);
    let squared = (x * x + y * y).unsigned_abs();
    let distance_dm = squared.isqrt() + u64::from(squared.isqrt().pow(2) < squared);
    let ticks = distance_dm as Ticks * settings.ticks_per_m;
    ((ticks + 9) / 10).max(1)
}
