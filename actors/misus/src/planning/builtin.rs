//! The scenarios and studies that come with the system.

use farside_actors::system::Builtin;

/// Sorted by name.
pub(super) const SCENARIOS: [Builtin; 1] = [Builtin {
    name: "misus/planners",
    text: include_str!("../../scenarios/planners.toml"),
}];

/// Sorted by name.
pub(super) const STUDIES: [Builtin; 2] = [
    Builtin {
        name: "misus/figures-3-4-5",
        text: include_str!("../../studies/figures-3-4-5.toml"),
    },
    Builtin {
        name: "misus/planners-over-links",
        text: include_str!("../../studies/planners-over-links.toml"),
    },
];
