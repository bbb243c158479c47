//! What a scenario says of MISUS.

use farside_actors::field::FieldConfig;
use farside_actors::rover::RoverConfig;
use serde::{Deserialize, Serialize};

use crate::config::{LearnConfig, TeamConfig};

/// The tables that it reads.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct MisusScenario {
    pub(crate) world: FieldConfig,
    pub(crate) team: TeamConfig,
    pub(crate) rover: RoverConfig,
    pub(crate) learn: LearnConfig,
}
