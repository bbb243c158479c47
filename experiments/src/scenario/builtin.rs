//! The scenarios that are built in.

/// Names and texts, sorted by name.
const BUILTIN: [(&str, &str); 7] = [
    (
        "network/crater-dense",
        include_str!("../../scenarios/network/crater-dense.toml"),
    ),
    (
        "network/crater-gaps",
        include_str!("../../scenarios/network/crater-gaps.toml"),
    ),
    (
        "network/crater-radio",
        include_str!("../../scenarios/network/crater-radio.toml"),
    ),
    (
        "network/crater-sparse",
        include_str!("../../scenarios/network/crater-sparse.toml"),
    ),
    (
        "network/rubble",
        include_str!("../../scenarios/network/rubble.toml"),
    ),
    (
        "traffic/contact-plan",
        include_str!("../../scenarios/traffic/contact-plan.toml"),
    ),
    (
        "traffic/open-loop",
        include_str!("../../scenarios/traffic/open-loop.toml"),
    ),
];

/// The names of all built-in scenarios, sorted.
///
/// ```
/// use farside_experiments::scenario::builtin_names;
/// assert!(builtin_names().contains(&"network/crater-dense"));
/// ```
pub fn builtin_names() -> Vec<&'static str> {
    BUILTIN.iter().map(|(name, _)| *name).collect()
}

/// The text of a built-in scenario.
///
/// ```
/// use farside_experiments::scenario::builtin_text;
/// assert!(builtin_text("network/crater-dense").unwrap().contains("rovers = 50"));
/// assert_eq!(builtin_text("network/moon"), None);
/// ```
pub fn builtin_text(name: &str) -> Option<&'static str> {
    let found = BUILTIN.iter().find(|(known, _)| *known == name);
    found.map(|(_, text)| *text)
}
