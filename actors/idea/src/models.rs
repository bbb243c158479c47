//! The models of the K9's agents: their texts, read and proved once, with the places of what they
//! declare (sections 3.1 to 3.3 of the IDEA paper).
//!
//! `k9-system.ddl` is what the system agent knows, `k9-mission.ddl` what the mission agent's reactive
//! planner does, `k9-ordering.ddl` what its deliberative planner orders goals with. `k9-light.ddl`
//! says as little as a search can find by backtracking, and decides as `k9-system.ddl` does.
//!
//! ```
//! use farside_idea::models;
//! let system = models::system();
//! let location = &system.model.timelines[system.timelines.location];
//! assert_eq!(location.name, "Location_SV");
//! assert!(location.predicates.contains(&system.predicates.drive_to));
//! ```

mod handles;
pub mod plant;
#[cfg(test)]
mod tests;

use std::sync::{Arc, LazyLock};

use farside_planning::language::{Options, read_model};
use farside_planning::model::Model;

pub use handles::{
    Mission, MissionPredicates, MissionTimelines, PlannedStatuses, Statuses, System,
    SystemPredicates, SystemTimelines,
};

/// The text of the system agent's model.
pub const SYSTEM: &str = include_str!("../models/k9-system.ddl");
/// The text of the system agent's less thorough model.
pub const LIGHT: &str = include_str!("../models/k9-light.ddl");
/// The text of the mission agent's model.
pub const MISSION: &str = include_str!("../models/k9-mission.ddl");

/// The text of the model of agents between both.
pub const FORWARD: &str = include_str!("../models/k9-forward.ddl");

/// The text of the system agent's relay's table: see [`RelayTable`](crate::relay::RelayTable).
pub const RELAY_TEXT: &str = include_str!("../models/k9-relay.toml");

/// The text of the model with which goals are ordered. It includes `places.ddl`, which is made for each
/// problem.
pub const ORDERING: &str = include_str!("../models/k9-ordering.ddl");

/// The system agent's model.
pub fn system() -> &'static System {
    static SYSTEM_MODEL: LazyLock<System> =
        LazyLock::new(|| System::of(read("k9-system.ddl", SYSTEM)));
    &SYSTEM_MODEL
}

/// The system agent's less thorough model, with the same timelines and predicates.
pub fn light() -> &'static System {
    static LIGHT_MODEL: LazyLock<System> =
        LazyLock::new(|| System::of(read("k9-light.ddl", LIGHT)));
    &LIGHT_MODEL
}

/// The mission agent's model.
pub fn mission() -> &'static Mission {
    static MISSION_MODEL: LazyLock<Mission> =
        LazyLock::new(|| Mission::of(read("k9-mission.ddl", MISSION)));
    &MISSION_MODEL
}

/// What an agent between the mission agent and the system agent knows: it hands goals on.
pub fn forward() -> &'static Arc<Model> {
    static FORWARD_MODEL: LazyLock<Arc<Model>> = LazyLock::new(|| read("k9-forward.ddl", FORWARD));
    &FORWARD_MODEL
}

/// The names of the models that are built in.
pub const NAMES: [&str; 4] = ["k9-forward", "k9-light", "k9-mission", "k9-system"];

/// The model of a name, if it is built in.
pub fn named(name: &str) -> Option<Arc<Model>> {
    match name {
        "k9-forward" => Some(forward().clone()),
        "k9-light" => Some(light().model.clone()),
        "k9-mission" => Some(mission().model.clone()),
        "k9-system" => Some(system().model.clone()),
        _ => None,
    }
}

/// A model of this crate, which is right.
fn read(name: &str, text: &str) -> Arc<Model> {
    let read = read_model(name, text, &Options::default());
    let model = read.ok().unwrap_or_else(|findings| panic!("{findings}"));
    Arc::new(model)
}
