//! The scenarios and studies that come with the system.

use farside_actors::system::Builtin;

/// Sorted by name.
pub(crate) const SCENARIOS: [Builtin; 5] = [
    Builtin {
        name: "network/crater-dense",
        text: include_str!("../scenarios/crater-dense.toml"),
    },
    Builtin {
        name: "network/crater-gaps",
        text: include_str!("../scenarios/crater-gaps.toml"),
    },
    Builtin {
        name: "network/crater-radio",
        text: include_str!("../scenarios/crater-radio.toml"),
    },
    Builtin {
        name: "network/crater-sparse",
        text: include_str!("../scenarios/crater-sparse.toml"),
    },
    Builtin {
        name: "network/rubble",
        text: include_str!("../scenarios/rubble.toml"),
    },
];

/// Sorted by name.
pub(crate) const STUDIES: [Builtin; 16] = [
    Builtin {
        name: "degradation/bursts",
        text: include_str!("../studies/degradation/bursts.toml"),
    },
    Builtin {
        name: "degradation/latency",
        text: include_str!("../studies/degradation/latency.toml"),
    },
    Builtin {
        name: "degradation/loss",
        text: include_str!("../studies/degradation/loss.toml"),
    },
    Builtin {
        name: "degradation/loss-x-latency",
        text: include_str!("../studies/degradation/loss-x-latency.toml"),
    },
    Builtin {
        name: "degradation/node-failure",
        text: include_str!("../studies/degradation/node-failure.toml"),
    },
    Builtin {
        name: "network/ablation",
        text: include_str!("../studies/network/ablation.toml"),
    },
    Builtin {
        name: "network/bandwidth",
        text: include_str!("../studies/network/bandwidth.toml"),
    },
    Builtin {
        name: "network/coverage",
        text: include_str!("../studies/network/coverage.toml"),
    },
    Builtin {
        name: "network/figure-5",
        text: include_str!("../studies/network/figure-5.toml"),
    },
    Builtin {
        name: "network/growth",
        text: include_str!("../studies/network/growth.toml"),
    },
    Builtin {
        name: "network/load-balancing",
        text: include_str!("../studies/network/load-balancing.toml"),
    },
    Builtin {
        name: "network/node-loss",
        text: include_str!("../studies/network/node-loss.toml"),
    },
    Builtin {
        name: "network/readings",
        text: include_str!("../studies/network/readings.toml"),
    },
    Builtin {
        name: "network/robust",
        text: include_str!("../studies/network/robust.toml"),
    },
    Builtin {
        name: "network/table-1",
        text: include_str!("../studies/network/table-1.toml"),
    },
    Builtin {
        name: "network/table-2",
        text: include_str!("../studies/network/table-2.toml"),
    },
];
