//! What a rover's scientist tells itself, and what it records. What it tells others is
//! [`Statistics`](crate::analysis::exchange::Statistics); what it tells its hardware is in
//! [`farside_actors::rover`].

use serde::{Deserialize, Serialize};

/// A timer: the lease of the hardware is to be renewed.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct LeaseDue;

/// A timer: readings are exchanged with the other rovers.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct ExchangeDue;

/// A timer: the rover learns from what it knows.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct LessonDue;

/// A timer: the hardware is asked how it is, and then something is begun.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct GoOn;

/// A timer: a command should have ended long ago.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Overdue {
    /// The command's number.
    pub(crate) command: u32,
}

/// A state sample: what a rover thinks of the field.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FieldModel {
    /// How many rocks it has been to.
    pub stops: u32,
    /// How many readings it knows of, its own and those of others.
    pub readings: u32,
    /// How many rocks they are of.
    pub rocks_read: u32,
    /// How many of these it knows a spectrum of.
    pub rocks_with_spectrum: u32,
    /// How many classes it tells apart.
    pub classes: u32,
    /// The log-likelihood of the readings.
    pub log_likelihood: f64,
    /// The objective function, which is what was maximised: the penalised log-likelihood.
    pub objective: f64,
    /// The mean entropy of the class of a rock that was read \[nat\].
    pub posterior_entropy: f64,
    /// The share of each class in the field.
    pub proportions: Vec<f64>,
    /// What it thinks of each rock of the catalogue, in the order of their numbers.
    pub rocks: Vec<RockLabel>,
    /// The rock that it thinks is the richest in the mineral of `learn.mineral`.
    pub richest: Option<u32>,
    /// How likely each story is.
    pub stories: Vec<StoryProbability>,
}

/// How likely a story is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StoryProbability {
    /// Its name, as scenarios give it.
    pub story: String,
    /// 0 to 1; those of all stories sum to 1.
    pub probability: f64,
}

/// What a rover thinks of a rock.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RockLabel {
    /// The likeliest class.
    pub class: u32,
    /// How likely it is, 0 to 1.
    pub confidence: f32,
    /// Whether it knows an image of it.
    pub image: bool,
    /// Whether it knows a spectrum of it. Without either its place alone speaks.
    pub spectrum: bool,
}

/// A state sample: what a rover does next.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stop {
    /// The rock that it goes to.
    pub rock: u32,
    /// How many it has been to before.
    pub after: u32,
}
