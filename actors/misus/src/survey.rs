//! The closed loop of MISUS (the paper's Figure 1): readings, model, goals, plans, readings.
//!
//! Rovers read rocks. Their scientists exchange the readings and learn; so does the scientist at the site of the
//! centre, which now and then asks the prioritiser what to look at next, and tells all planners so as a
//! [`GoalList`]. The centre hands the goals out by the protocol of [`crate::shac`]; each rover's planner makes
//! a plan of those that it has, carries it out, and makes another when the world turns out otherwise.

mod costs;
mod execution;
mod explorer;
mod messages;
pub mod outlook;
mod shared;

pub use costs::Cost;
pub use execution::ExecutionConfig;
pub use messages::{
    Activity, ActivityBegan, ActivityEnd, ActivityEnded, GoalList, GoalListHeld, ListedCombination,
    ListedGoal, PlanMade, PlanMode, PlannedActivity, ReplanCause, Window,
};
