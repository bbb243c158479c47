//! Studies: one question, put to a scenario in many cells and with many seeds.
//!
//! A study file names a scenario, factors, seeds and metrics; each combination of the factors'
//! values is a cell, and each cell runs with the same seeds. What comes of it is [`results`].
//!
//! ```toml
//! question = "How does loss slow a team down?"
//! scenario = "network/crater-dense"   # or a file, relative to this one
//! seeds = 30                          # or a list
//! metrics = ["completed", "time_ratio", "messages.lost"]
//! baseline = { loss = 0 }             # else the first cell
//!
//! [set]                               # in every cell
//! team.rovers = 25
//!
//! [[factor]]
//! name = "loss"
//! label = "message loss"
//! key = "links.default.loss"          # or keys = [...]
//! values = [0, "15%", "30%"]          # or range = ["0%", "30%"] and steps = 3; scale = "log"
//! ```
//!
//! `design` says how cells are made of factors: `grid` (all combinations), `paired` (they advance
//! together), `list` (`[[cell]]` tables give the values), `latin-hypercube` (`cells` points spread
//! over ranges). With a `[stop]` table of `metric`, `width`, `min_seeds` and `max_seeds`, a cell runs
//! until the 95 % interval of the metric is narrower than `width`.

mod builtin;
mod design;
mod error;
mod execute;
mod factors;
mod file;
mod level;
mod load;
mod metrics;
mod plan;
mod pool;
mod published;
mod reproduce;
pub mod results;
mod runner;
mod stop;
mod store;
pub mod summary;

pub use builtin::{builtin_names, builtin_text};
pub use error::{StoreError, StudyError};
pub use execute::Interrupts;
pub use plan::{Plan, Study};
pub use runner::{Ended, Progress, RunOptions, run};
pub use store::Shard;

pub(crate) use reproduce::{Reproduction, find_run, reproduce};
pub(crate) use store::replace;

#[cfg(test)]
pub(crate) mod fabricated;
#[cfg(test)]
mod tests;
