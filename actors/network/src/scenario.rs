//! What a scenario says of the network-guided system.

use serde::{Deserialize, Serialize};

use crate::config::{NetworkConfig, TeamConfig, WorldConfig};

/// The tables `[world]`, `[team]` and `[network]`.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct NetworkScenario {
    pub(crate) world: WorldConfig,
    pub(crate) team: TeamConfig,
    pub(crate) network: NetworkConfig,
}
