//! The scenarios that come with the system.

use farside_actors::system::Builtin;

/// Sorted by name.
pub(crate) const SCENARIOS: [Builtin; 2] = [
    Builtin {
        name: "traffic/contact-plan",
        text: include_str!("../scenarios/contact-plan.toml"),
    },
    Builtin {
        name: "traffic/open-loop",
        text: include_str!("../scenarios/open-loop.toml"),
    },
];
