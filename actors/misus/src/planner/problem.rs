//! A problem of planning as data: what there is to observe, with what, and what it is worth.
//!
//! Times are whole milliseconds from the start of the problem, powers milliwatts, energies microjoules
//! (a milliwatt for a millisecond), memory bits: so that what fits is decided exactly, and alike by every
//! program that reads the file. Places are metres east and north of the middle of the terrain.

mod check;
mod generate;
mod settings;

use serde::{Deserialize, Serialize};

use super::objective::ObjectiveConfig;

pub use check::{ProblemError, Resolved};
pub use generate::generate;
pub use settings::ProblemConfig;

/// The version of the format that is written. Files with the same number before the point are read.
pub const FORMAT: &str = "1.0";

/// What there is to plan.
///
/// ```
/// use farside_misus::planner::problem::{Problem, ProblemConfig, generate};
/// let config = ProblemConfig { rocks_least: 10, rocks_most: 10, ..ProblemConfig::default() };
/// let problem = generate(&config, 7)?;
/// assert_eq!((problem.rovers.len(), problem.goals.len()), (3, 30));
/// let text = problem.to_json();
/// assert_eq!(Problem::from_json(&text)?, problem);
///
/// let mut wrong = problem.clone();
/// wrong.combinations[0].goals[0] = "rock_1_a".to_string();
/// let error = Problem::from_json(&wrong.to_json()).unwrap_err().to_string();
/// assert!(error.contains("did you mean"), "{error}");
/// # Ok::<(), farside_misus::planner::problem::ProblemError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Problem {
    /// The version of the format, [`FORMAT`].
    pub format: String,
    /// What it is called.
    pub name: String,
    /// The side of the square terrain \[m\], over 0.
    pub side_m: f64,
    /// Who observes.
    pub rovers: Vec<Rover>,
    /// What can be observed.
    pub goals: Vec<Goal>,
    /// What is worth more, or less, together.
    pub combinations: Vec<Combination>,
    /// What rovers have to do besides, wherever they are.
    pub activities: Vec<Activity>,
    /// What counts besides what goals and combinations are worth.
    #[serde(default, skip_serializing_if = "ObjectiveConfig::is_plain")]
    pub objective: ObjectiveConfig,
}

/// A rover and what it has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rover {
    /// Its name, no other rover's.
    pub name: String,
    /// Where it is at first, east and north of the middle \[m\].
    pub position_m: [f64; 2],
    /// How fast it drives \[mm/s\], over 0.
    pub speed_mm_s: u32,
    /// The power that driving takes \[mW\].
    pub drive_mw: i64,
    /// How much it can store \[bit\].
    pub memory_bits: i64,
    /// How much of that is stored at first \[bit\].
    pub stored_bits: i64,
    /// When it can be active, in order.
    pub sols: Vec<Sol>,
}

/// The part of a day in which a rover can be active.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sol {
    /// When it begins \[ms\].
    pub opens_ms: i64,
    /// When all has to be done \[ms\].
    pub closes_ms: i64,
    /// The energy that can be used in it \[uJ\]; what is left is lost.
    pub energy_uj: i64,
}

/// What an observation is (Table 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A: an image of a rock from afar.
    LongRangeImage,
    /// B: an image of a rock from near.
    CloseUpImage,
    /// C: a spectrometer's reading of a rock from near.
    CloseUpSpectrum,
}

/// An observation that is wished for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// Its name, no other goal's.
    pub name: String,
    /// The number of the rock that is observed, if it is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rock: Option<u32>,
    /// What is done, if Table 1 has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<Kind>,
    /// Where it is made from, east and north of the middle \[m\].
    pub position_m: [f64; 2],
    /// How long it takes \[ms\].
    pub duration_ms: i64,
    /// The power that it takes \[mW\].
    pub power_mw: i64,
    /// What it adds to memory, when it ends \[bit\].
    pub memory_bits: i64,
    /// What it is worth by itself.
    pub weight: f64,
    /// When it may begin at the earliest and has to have ended \[ms\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub window_ms: Option<[i64; 2]>,
    /// Goals that the same rover has to have achieved before.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub requires: Vec<String>,
    /// How many rovers have to make it, at one time: 1 or 2.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub rovers: u32,
    /// Whether it has to be achieved: planned first, and never given up.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub mandatory: bool,
}

/// Goals that change each other's worth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Combination {
    /// Two different goals or more.
    pub goals: Vec<String>,
    /// What is added when all are achieved; may be below 0.
    pub weight: f64,
}

/// What a rover has to do in a sol wherever it is, such as the daily communication.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Activity {
    /// Its name, no other activity's.
    pub name: String,
    /// Whose it is.
    pub rover: String,
    /// In which of the rover's sols, from 0.
    pub sol: usize,
    /// When it may begin at the earliest and has to have ended \[ms\].
    pub window_ms: [i64; 2],
    /// How long it takes \[ms\].
    pub duration_ms: i64,
    /// The power that it takes \[mW\].
    pub power_mw: i64,
    /// How much of what is stored it sends home at the most, freeing memory when it ends \[bit\].
    pub sends_bits: i64,
}

fn one() -> u32 {
    1
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the signature that serde asks for"
)]
fn is_one(number: &u32) -> bool {
    *number == 1
}

impl Problem {
    /// Reads a problem from JSON and checks it.
    ///
    /// # Errors
    /// When the text is no problem of a known version, with line and column, or when what it says
    /// cannot be, with the name of what is wrong.
    pub fn from_json(text: &str) -> Result<Problem, ProblemError> {
        /// What every version has.
        #[derive(Deserialize)]
        struct Head {
            format: String,
        }
        let head: Head = serde_json::from_str(text).map_err(|error| ProblemError::json(&error))?;
        let major = |format: &str| format.split('.').next().map(str::to_owned);
        if major(&head.format) != major(FORMAT) {
            return Err(ProblemError::Format { found: head.format });
        }
        let problem: Problem =
            serde_json::from_str(text).map_err(|error| ProblemError::json(&error))?;
        problem.resolve()?;
        Ok(problem)
    }

    /// The problem as JSON, a line for each value.
    ///
    /// # Panics
    /// Never: all keys are texts.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a problem has no keys but texts")
    }

    /// What the problem is known by in tables of bounds: XXH3 of its JSON as [`Problem::to_json`] has it, 128
    /// bits as 32 hexadecimal digits. Equal for equal problems, on any machine.
    pub fn digest(&self) -> String {
        format!(
            "{:032x}",
            xxhash_rust::xxh3::xxh3_128(self.to_json().as_bytes())
        )
    }

    /// Checks that the problem makes sense, and finds what its names stand for.
    ///
    /// # Errors
    /// When it does not; the error names what is wrong, what was found and what was expected.
    pub fn resolve(&self) -> Result<Resolved, ProblemError> {
        check::resolve(self)
    }
}

#[cfg(test)]
mod tests;
