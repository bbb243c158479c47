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
//! over ranges). With a `[stop]` table of `metric`, `width`, `min_seeds` and `max_seeds`, a cell
//! runs until the 95 % interval of the metric is narrower than `width`.
//!
//! Instead of a key and values, a factor may have variants: names for what each sets, several keys
//! or none. What one variant does not set is as the scenario has it.
//!
//! ```toml
//! [[factor]]
//! name = "policy"
//! variants = [
//!     { name = "paper", set = { network.policy = "max-plus" } },
//!     { name = "chained", set = { network.max_plus.acceleration_chains = true } },
//! ]
//! ```
//!
//! # Plots
//!
//! Plots have the first factor of numbers along x, a curve for each value of the next factor, and a
//! plot for each value of further ones. A study may say otherwise, by the factors' names.
//!
//! ```toml
//! [report]
//! x = "loss"
//! series = "policy"
//! facet = "latency"
//! ```
//!
//! Numbers above 0 that span two decades or more are spaced by ratio; a factor's `scale`, `linear`
//! or `log`, says otherwise.
//!
//! # Blocks
//!
//! Seeds may share a problem: `seeds = 30` and `block = 5` give six problems of five runs each.
//! Seeds 1 to 5 have the world, the team and the goals of `problem_seed`
//! 1, seeds 6 to 10 those of 6, and so on; what else happens by chance is each run's own.
//! Bootstraps and paired tests then draw problems and not runs, as five runs on one problem do not
//! say what five problems do. A log's scenario holds the `problem_seed`, so that it can be verified
//! by itself.
//!
//! # Ties
//!
//! `tie_seed` is a key of scenarios: it shuffles what happens at one instant. As a factor it tells
//! whether a result hangs on that order. `values` gives some seeds; a variant that sets nothing is
//! the order of the actors' names.
//!
//! ```toml
//! [[factor]]
//! name = "ties"
//! key = "tie_seed"
//! values = [1, 2, 3]
//! ```
//!
//! # Curves
//!
//! A metric may be a curve over an index, as a reward over the steps of an optimiser: a
//! [`Series`](farside_actors::system::Series). What the index is, is declared once, by the system
//! ([`MetricKind::Series`](farside_actors::system::MetricKind)); a study may say it differently.
//!
//! ```toml
//! metrics = [
//!     "reward",
//!     { name = "coverage", index = { label = "time", unit = "s", lengths_differ = true } },
//! ]
//! ```
//!
//! All runs of a cell have the same indices, unless `lengths_differ` says that some may end
//! earlier. The report shows each cell's mean with its band, the paired difference to the baseline
//! at each index, and from which index on it holds to the last.
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
//! it does not name may have any. Its claim is one of `value`, `about`, `below`, `above` (a number
//! in `unit`), `linear`, the name of a factor along which the metric should grow linearly, or
//! `exceeds`. Two figures of a table for one cell are refused.
//!
//! `exceeds` has the levels in which another cell differs, and claims that there the metric, a
//! number, a rate or a curve, is less. The claim is judged by the interval of the difference over
//! the same seeds: it holds, does not hold, or is undecided.
//!
//! ```toml
//! values = [
//!     { planner = "search", exceeds = { planner = "greedy" }, from_index = 15 },
//!     { planner = "search", exceeds = { planner = "random" }, by_at_least = 1, by_at_most = 3 },
//!     { planner = "search", exceeds = { planner = "oracle" }, equal_within = 0.05 },
//! ]
//! ```
//!
//! `from_index` is for curves: the claim is then for each index from there on, else for all.
//! `by_at_least` and `by_at_most` bound the difference, in `unit`; `equal_within` says that it is
//! 0, as nearly as that.
//!
//! Results are kept when these tables change: a note on why ours differ may be written when the
//! runs are done.

mod blocks;
mod design;
mod error;
mod execute;
mod factors;
mod file;
mod forecast;
mod lengths;
mod level;
mod load;
mod merge;
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
pub(crate) use file::sections;
pub use forecast::{Basis, Forecast, forecast};
pub(crate) use merge::Merged;
pub(crate) use metrics::KERNEL as KERNEL_METRICS;
pub use plan::{Study, StudyPlan};
pub use runner::{Ended, Progress, RunOptions, run};
pub use store::Shard;

pub(crate) use reproduce::{Reproduction, find_run, reproduce};
pub(crate) use store::{outputs, replace};

#[cfg(test)]
pub(crate) mod fabricated;
#[cfg(test)]
mod tests;
