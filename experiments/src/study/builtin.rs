//! The studies that are built in.

/// Names and texts, sorted by name.
const BUILTIN: [(&str, &str); 15] = [
    (
        "degradation/bursts",
        include_str!("../../studies/degradation/bursts.toml"),
    ),
    (
        "degradation/latency",
        include_str!("../../studies/degradation/latency.toml"),
    ),
    (
        "degradation/loss",
        include_str!("../../studies/degradation/loss.toml"),
    ),
    (
        "degradation/loss-x-latency",
        include_str!("../../studies/degradation/loss-x-latency.toml"),
    ),
    (
        "degradation/node-failure",
        include_str!("../../studies/degradation/node-failure.toml"),
    ),
    (
        "network/ablation",
        include_str!("../../studies/network/ablation.toml"),
    ),
    (
        "network/bandwidth",
        include_str!("../../studies/network/bandwidth.toml"),
    ),
    (
        "network/coverage",
        include_str!("../../studies/network/coverage.toml"),
    ),
    (
        "network/figure-5",
        include_str!("../../studies/network/figure-5.toml"),
    ),
    (
        "network/growth",
        include_str!("../../studies/network/growth.toml"),
    ),
    (
        "network/load-balancing",
        include_str!("../../studies/network/load-balancing.toml"),
    ),
    (
        "network/node-loss",
        include_str!("../../studies/network/node-loss.toml"),
    ),
    (
        "network/robust",
        include_str!("../../studies/network/robust.toml"),
    ),
    (
        "network/table-1",
        include_str!("../../studies/network/table-1.toml"),
    ),
    (
        "network/table-2",
        include_str!("../../studies/network/table-2.toml"),
    ),
];

/// The names of all built-in studies, sorted.
///
/// ```
/// use farside_experiments::study::builtin_names;
/// assert!(builtin_names().contains(&"degradation/loss"));
/// ```
pub fn builtin_names() -> Vec<&'static str> {
    BUILTIN.iter().map(|(name, _)| *name).collect()
}

/// The text of a built-in study.
///
/// ```
/// use farside_experiments::study::builtin_text;
/// assert!(builtin_text("degradation/loss").unwrap().contains("links.default.loss"));
/// assert_eq!(builtin_text("degradation/moon"), None);
/// ```
pub fn builtin_text(name: &str) -> Option<&'static str> {
    let found = BUILTIN.iter().find(|(known, _)| *known == name);
    found.map(|(_, text)| *text)
}
