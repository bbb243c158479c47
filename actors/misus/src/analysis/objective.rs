//! What a team wants to find out. The choice decides which observations are worth how much, and what
//! a run is measured by.
//!
//! | objective | question | measured by |
//! |---|---|---|
//! | [`Objective::Distribution`] | which classes of rock lie where (the paper's) | adjusted Rand index, total variation distance of the classes' shares |
//! | [`Objective::Mineral`] | which rock is the richest in one mineral | regret: the best true fraction minus that of the rock named |
//! | [`Objective::Process`] | which story laid the field | log score of the true story |

mod mineral;
mod process;

pub use mineral::{Estimate, GaugeError, MineralGauge, regret};
pub use process::{Stories, StoryBelief, StorySettings};

/// What a team wants to find out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Objective<'a> {
    /// The distribution of classes of rock.
    Distribution,
    /// The rock that is richest in a mineral.
    Mineral(&'a MineralGauge),
    /// The story that laid the field, with what is believed of it now.
    Process(&'a StoryBelief),
}
