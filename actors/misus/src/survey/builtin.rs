//! The scenarios and studies that come with the system.

use farside_actors::system::Builtin;

/// Sorted by name.
pub(super) const SCENARIOS: [Builtin; 1] = [Builtin {
    name: "misus/mars-survey",
    text: include_str!("../../scenarios/mars-survey.toml"),
}];

/// Sorted by name.
pub(super) const STUDIES: [Builtin; 6] = [
    Builtin {
        name: "misus/batch-or-continuous",
        text: include_str!("../../studies/batch-or-continuous.toml"),
    },
    Builtin {
        name: "misus/central-outage",
        text: include_str!("../../studies/central-outage.toml"),
    },
    Builtin {
        name: "misus/degradation",
        text: include_str!("../../studies/degradation.toml"),
    },
    Builtin {
        name: "misus/hill-between",
        text: include_str!("../../studies/hill-between.toml"),
    },
    Builtin {
        name: "misus/rover-lost",
        text: include_str!("../../studies/rover-lost.toml"),
    },
    Builtin {
        name: "misus/slow-processors",
        text: include_str!("../../studies/slow-processors.toml"),
    },
];
