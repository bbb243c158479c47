//! The scenarios and studies that come with the system.

use farside_actors::system::Builtin;

/// Sorted by name.
pub(crate) const SCENARIOS: [Builtin; 4] = [
    Builtin {
        name: "idea/k9",
        text: include_str!("../scenarios/k9.toml"),
    },
    Builtin {
        name: "idea/k9-alarms",
        text: include_str!("../scenarios/k9-alarms.toml"),
    },
    Builtin {
        name: "idea/k9-alone",
        text: include_str!("../scenarios/k9-alone.toml"),
    },
    Builtin {
        name: "idea/k9-remote",
        text: include_str!("../scenarios/k9-remote.toml"),
    },
];

/// Sorted by name.
pub(crate) const STUDIES: [Builtin; 0] = [];
