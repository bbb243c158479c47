//! The scenarios and studies that come with the system.

use farside_actors::system::Builtin;

/// Sorted by name.
pub(crate) const SCENARIOS: [Builtin; 2] = [
    Builtin {
        name: "misus/faults",
        text: include_str!("../scenarios/faults.toml"),
    },
    Builtin {
        name: "misus/learn",
        text: include_str!("../scenarios/learn.toml"),
    },
];

/// Sorted by name.
pub(crate) const STUDIES: [Builtin; 2] = [
    Builtin {
        name: "misus/learning",
        text: include_str!("../studies/learning.toml"),
    },
    Builtin {
        name: "misus/prioritiser",
        text: include_str!("../studies/prioritiser.toml"),
    },
];
