//! The closed loop of MISUS (the paper's Figure 1): readings, model, goals, plans, readings.
//!
//! Rovers read rocks. Their scientists exchange the readings and learn; so does the scientist at the site of the
//! centre, which now and then asks the prioritiser what to look at next, and tells all planners so as a
//! [`GoalList`]. The centre hands the goals out by the protocol of [`crate::shac`]; each rover's planner makes
//! a plan of those that it has, carries it out, and makes another when the world turns out otherwise.
//!
//! What this is not: [`crate::planning`], whose planners make plans that nobody carries out.

mod assemble;
mod assigning;
mod builtin;
mod centre;
mod config;
mod costs;
mod execution;
mod explorer;
mod invariants;
mod messages;
mod metrics;
mod monitor;
pub mod outlook;
mod picture;
mod scenario;
mod science;
mod shared;
mod system;
mod tally;
mod wishes;
mod wishlist;

pub use config::SurveyConfig;
pub use costs::Cost;
pub use execution::ExecutionConfig;
pub use messages::{
    Activity, ActivityBegan, ActivityEnd, ActivityEnded, GoalList, GoalListHeld, GoalsAchieved,
    GoalsShared, HalfReady, ListedCombination, ListedGoal, LoopMade, OfficeHeld, PlanMade,
    PlanMode, PlannedActivity, ReplanCause, UnmetGoal, Window,
};
pub use metrics::SurveyMetrics;
pub use system::SurveySystem;
pub use wishes::{ChangeConfig, CombinationConfig, GoalConfig};
