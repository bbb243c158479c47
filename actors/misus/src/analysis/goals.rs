//! What there is to observe, what each observation is worth, and which are worth more together.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// What a rover can be asked to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Observation {
    /// An image of all rocks round a place: their textures, from afar.
    PanoramicImage,
    /// Spectra of all rocks round a place, from afar.
    PanoramicSpectrum,
    /// An image of one rock, at the rock.
    PointImage,
    /// A spectrum of one rock, at the rock.
    PointSpectrum,
}

/// What is observed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Target {
    /// A rock, by its number in the team's catalogue.
    Rock(u32),
    /// A square of the ground, by its column and row.
    Square(i32, i32),
}

/// The name of a goal: what is done, and to what. The same wish has the same name whenever and by
/// whomever it is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct GoalId {
    /// What it is done to.
    pub target: Target,
    /// What is to be done.
    pub observation: Observation,
}

/// A wish for an observation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Goal {
    /// Its name.
    pub id: GoalId,
    /// Where the target is thought to be, east and north \[m\].
    pub position_m: [f64; 2],
    /// What the observation is worth by itself, over 0.
    pub weight: f64,
}

/// Goals that are worth more when all of them are achieved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Combination {
    /// Two goals or more, in ascending order. They name the combination.
    pub goals: Vec<GoalId>,
    /// Over 0. When all goals are achieved, this times the sum of their weights is added to what
    /// they are worth by themselves (the paper's Equation 1 and Table 2).
    pub factor: f64,
}

/// All that is wished for at a time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wishes {
    /// By name.
    pub goals: BTreeMap<GoalId, Goal>,
    /// The factors of combinations, by their goals. All goals are among `goals`.
    pub combinations: BTreeMap<Vec<GoalId>, f64>,
}

/// What has become different in what is wished for.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Revision {
    /// Goals that were not there, in the order of their names.
    pub added: Vec<Goal>,
    /// Goals whose weight or position has changed.
    pub changed: Vec<Goal>,
    /// Goals that are no longer wished for.
    pub withdrawn: Vec<GoalId>,
    /// Combinations that were not there, or have another factor.
    pub combined: Vec<Combination>,
    /// Combinations that are no longer.
    pub separated: Vec<Vec<GoalId>>,
}
