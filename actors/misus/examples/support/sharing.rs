//! The protocol of shared goals alone, on a network that loses, repeats, delays and parts, with actors
//! that crash at any event: random runs, and what must hold after each event of one.
//!
//! A run is a function of a [`Scenario`], which prints as what it is, and of the rules that are kept.

#[path = "sharing/checks.rs"]
mod checks;
#[path = "sharing/planners.rs"]
mod planners;
#[path = "sharing/scenario.rs"]
mod scenario;
#[path = "sharing/world.rs"]
mod world;

use farside_misus::shac::Rules;

pub(crate) use scenario::{Crash, Partition, Scenario, Wished, Wishing};
pub(crate) use world::{Tally, World};

/// A rule by its name, and how it is broken.
pub(crate) type Rule = (&'static str, fn(&mut Rules));

/// All rules.
pub(crate) const RULES: [Rule; 14] = [
    ("write_first", |rules| rules.write_first = false),
    ("newer_only", |rules| rules.newer_only = false),
    ("highest_status", |rules| rules.highest_status = false),
    ("release_binds", |rules| rules.release_binds = false),
    ("present_epoch_only", |rules| {
        rules.present_epoch_only = false
    }),
    ("revoke_safely", |rules| rules.revoke_safely = false),
    ("start_in_lease", |rules| rules.start_in_lease = false),
    ("pass_outcomes_on", |rules| rules.pass_outcomes_on = false),
    ("drop_achieved", |rules| rules.drop_achieved = false),
    ("wait_out", |rules| rules.wait_out = false),
    ("mandate", |rules| rules.mandate = false),
    ("bind_pairs", |rules| rules.bind_pairs = false),
    ("refusals_hold", |rules| rules.refusals_hold = false),
    ("withdrawn_for_good", |rules| {
        rules.withdrawn_for_good = false
    }),
];

/// All rules but one.
pub(crate) fn without(name: &str) -> Option<Rules> {
    let (_, break_it) = RULES.iter().find(|(rule, _)| *rule == name)?;
    let mut rules = Rules::ALL;
    break_it(&mut rules);
    Some(rules)
}
