//! The multi-rover integrated science understanding system (MISUS): rovers that learn which rocks
//! lie on the ground, and choose by that what to look at next.
//!
//! After T. Estlin, D. Gaines, F. Fisher and R. Castano, "Coordinating Multiple Rovers with
//! Interdependent Science Objectives", AAMAS 2005:
//!
//! - its environment (section 2), as rock fields of [`farside_worlds`] and rover hardware of
//!   [`farside_actors::rover`], and its data [`analysis`], which runs distributed over the rovers: the system
//!   [`MisusSystem`], on fixed or prioritised [`tour`]s;
//! - its [`planner`]s (sections 3 and 4), and actors that exchange their plans over links ([`planning`]), by
//!   which the paper's evaluation (section 5) is repeated: the system [`PlanningSystem`];
//! - the sharing of goals over bad links (section 3.2): the language [`shac`], and actors ([`sharing`]);
//! - all of it as one loop, plans carried out ([`survey`]): the system [`SurveySystem`].
//!
//! On each rover there are two actors at least: the hardware, and who commands it.

pub mod analysis;
mod assemble;
mod builtin;
mod chart;
mod config;
mod learner;
mod learning;
mod messages;
mod metrics;
mod monitor;
mod picture;
pub mod planner;
pub mod planning;
mod scenario;
mod scene;
mod scientist;
pub mod shac;
pub mod sharing;
mod site;
pub mod survey;
mod system;
mod tools;
pub mod tour;

pub use config::{LearnConfig, Objective, TeamConfig, Tour};
pub use messages::{FieldModel, RockLabel, Stop};
pub use metrics::MisusMetrics;
pub use planning::PlanningSystem;
pub use survey::SurveySystem;
pub use system::MisusSystem;
