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
pub(crate) const STUDIES: [Builtin; 9] = [
    Builtin {
        name: "idea/deliberation",
        text: include_str!("../studies/deliberation.toml"),
    },
    Builtin {
        name: "idea/figures-6-7",
        text: include_str!("../studies/figures-6-7.toml"),
    },
    Builtin {
        name: "idea/horizon",
        text: include_str!("../studies/horizon.toml"),
    },
    Builtin {
        name: "idea/jitter",
        text: include_str!("../studies/jitter.toml"),
    },
    Builtin {
        name: "idea/latency",
        text: include_str!("../studies/latency.toml"),
    },
    Builtin {
        name: "idea/layers",
        text: include_str!("../studies/layers.toml"),
    },
    Builtin {
        name: "idea/link-degradation",
        text: include_str!("../studies/link-degradation.toml"),
    },
    Builtin {
        name: "idea/outages",
        text: include_str!("../studies/outages.toml"),
    },
    Builtin {
        name: "idea/thorough-or-light",
        text: include_str!("../studies/thorough-or-light.toml"),
    },
];
