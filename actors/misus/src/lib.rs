//! The multi-rover integrated science understanding system (MISUS): rovers that learn which rocks
//! lie on the ground, and choose by that what to look at next.
//!
//! After T. Estlin, D. Gaines, F. Fisher and R. Castano, "Coordinating Multiple Rovers with
//! Interdependent Science Objectives", AAMAS 2005. Built so far: its environment (section 2), as
//! rock fields of [`farside_worlds`] and rover hardware of [`farside_actors::rover`], and its data
//! [`analysis`], which runs distributed over the rovers. Tours are fixed; [`planner`] has the planners of
//! sections 3 and 4, and [`planning`] puts them into actors: the paper's evaluation (section 5), and the same
//! over links that are not perfect.
//!
//! On each rover there are two actors: the hardware, and the scientist, who sends the rover from rock
//! to rock, exchanges what is read with the other scientists, and learns from all of it.
//!
//! How goals are shared over bad links ([`shac`], its section 3.2) is there by itself, with actors
//! ([`sharing`]) that planners are to be put into.

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
