//! How rovers plan: the keys.

use farside_actors::settings;
use farside_actors::system::settings::one_of;
use serde::{Deserialize, Serialize};

/// How the next goal is chosen: all in which the paper's three planners differ (section 5.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Choice {
    /// The goal with which the team's score would be highest by Equation 1 (CASPER+IDGS); none if every
    /// goal would make it less.
    #[default]
    Idgs,
    /// The goal that is worth most by itself (CASPER+SimpleReward).
    SimpleReward,
    /// Any goal (CASPER+Random).
    Random,
    /// None: rovers keep to what they are given. The centre plans for the whole team at once, by
    /// large-neighbourhood search.
    Lns,
}

/// When an optimisation step of a rover ends. Section 4.2 of the paper says both that a step consists of so many
/// iterations, and that the next begins when a plan is the best so far. Only with all iterations is planning
/// time independent of how far planners are from their best, as Figure 5 has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StepEnd {
    /// After all iterations: a plan that is better becomes the best, and the step goes on from it.
    #[default]
    Iterations,
    /// At the first plan that is better than the best, or after all iterations.
    FirstBetter,
    /// As `Iterations`, and a plan without conflict that is no better is left for the best one.
    Restart,
}

settings! {
    /// The `[planner]` table: how rovers plan (the paper's section 4.2).
    pub struct PlannerConfig {
        /// How the next goal is chosen.
        pub choice: Choice, one_of(&["idgs", "simple-reward", "random", "lns"]);
        /// How many iterations an optimisation step of a rover has at the most.
        pub iterations: u32 = 20, 1..=100_000;
        /// When a step ends.
        pub step_end: StepEnd, one_of(&["iterations", "first-better", "restart"]);
        /// How many optimisation steps there are.
        pub steps: u32 = 20, 1..=100_000;
        /// How often any goal is chosen instead of the best.
        pub epsilon: f64 = 0.1, 0.0..=1.0;
        /// After how many deletions a rover sheds a goal that its plan does not have.
        pub deletions: u32 = 3, 1..=1_000_000;
        /// How often the centre offers a goal to all rovers before it gives the goal up.
        pub offers: u32 = 10, 1..=1_000_000;
        /// By how much a rover's share of the work may exceed an even one when the centre assigns goals.
        pub imbalance: f64 = 0.1, 0.0..=10.0;
    }
}
