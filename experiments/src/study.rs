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
//!
//! Instead of a key and values, a factor may have variants: names for what each sets, several keys
//! or none. What one variant does not set is as the scenario has it.
//!
//! ```toml
//! [[factor]]
//! name = "policy"
//! variants = [
//!     { name = "paper", set = { network.policy = "paper" } },
//!     { name = "chained", set = { network.policy = "paper", network.acceleration_chains = true } },
//! ]
//! ```
//!
//! # Published figures
//!
//! A `[[published]]` table has figures of others for one metric. The report sets them beside ours.
//!
//! ```toml
//! [[published]]
//! metric = "deadlocked"
//! title = "Table 1: deadlocks, dense roadmap"
//! source = "Luna, Oyama and Bekris, section 4, Table 1"
//! unit = "%"          # of the published figures; none unless given
//! scale = 100         # a published figure is ours times this; 1 unless given
//! rows = "rovers"     # which factor makes the rows of the table; the first unless given
//! values = [
//!     { rovers = 100, nodes = 28, value = 58 },
//!     { rovers = 25, about = 1.4, quote = "about 1.4 in the 25 vehicle case" },
//!     { linear = "rovers" },
//! ]
//! note = "How to read them."
//! why = "Why ours differ."
//! ```
//!
//! Each of `values` names levels of factors, and is for every cell that has them all; a factor that
//! it does not name may have any. Its claim is one of `value`, `about`, `below`, `above` (a number in
//! `unit`), or `linear`, the name of a factor along which the metric should grow linearly. Two
//! figures of a table for one cell are refused. Results are kept when these tables change: a note on
//! why ours differ may be written when the runs are done.

mod blocks;
mod design;
mod error;
mod execute;
mod factors;
mod file;
mod lengths;
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
