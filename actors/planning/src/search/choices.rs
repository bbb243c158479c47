//! Choice points of a repair, and what is chosen at each.
//!
//! A. Fukunaga, G. Rabideau, S. Chien and D. Yan (*ASPEN: A Framework for Automated Planning and
//! Scheduling of Spacecraft Control and Operations*, 1997) give iterative repair its choice points:
//! which conflict, which method, which activity, where. Each is a [`Choice`] here, and can be
//! replaced by another of its kind.

use rand_core::Rng;
use rand_pcg::Pcg32;

/// What can be chosen at a choice point, as the choice sees it: a number that is better when it is
/// less, in the order in which the options were found.
pub type Costs<'a> = &'a [i64];

/// How something is chosen among options: a name, and a rule that gives the place of one of them.
/// A rule is asked with one option at least.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// Its name.
    pub name: &'static str,
    /// The rule.
    pub pick: fn(Costs<'_>, &mut Pcg32) -> usize,
}

impl Choice {
    /// The first option that was found.
    pub const FIRST: Choice = Choice {
        name: "first",
        pick: |_, _| 0,
    };

    /// The least cost; of equals, the first.
    pub const BEST: Choice = Choice {
        name: "best",
        pick: |costs, _| best(costs),
    };

    /// Any, all alike.
    pub const RANDOM: Choice = Choice {
        name: "random",
        pick: |costs, random| below(random, costs.len()),
    };

    /// Two times of three the least cost, else any.
    pub const MOSTLY_BEST: Choice = Choice {
        name: "mostly best",
        pick: |costs, random| match below(random, 3) {
            0 => below(random, costs.len()),
            _ => best(costs),
        },
    };

    /// All choices, for looking one up by its name.
    pub const ALL: [Choice; 4] = [
        Choice::FIRST,
        Choice::BEST,
        Choice::RANDOM,
        Choice::MOSTLY_BEST,
    ];
}

/// What is chosen at each choice point of a [repair](super::Repair).
#[derive(Clone, Copy, Debug)]
pub struct Choices {
    /// Which conflict is looked at: costs are the ranks of their kinds.
    pub conflict: Choice,
    /// How it is resolved: costs are the ranks of the decisions, as the complete search has them.
    pub decision: Choice,
    /// What gives way where no decision can be carried out: costs are 0 for what the repair itself
    /// decided, and what the goal is worth for a goal.
    pub culprit: Choice,
    /// Which orders are taken back when a plan without conflicts is to get shorter: costs are 0
    /// for those that times rest on, else 1.
    pub relaxed: Choice,
}

impl Default for Choices {
    fn default() -> Self {
        Choices {
            conflict: Choice::BEST,
            decision: Choice::MOSTLY_BEST,
            culprit: Choice::MOSTLY_BEST,
            relaxed: Choice::MOSTLY_BEST,
        }
    }
}

fn best(costs: Costs<'_>) -> usize {
    let least = costs.iter().enumerate().min_by_key(|at| *at.1);
    least.map_or(0, |at| at.0)
}

/// A number below `options`, which is above 0.
pub(super) fn below(random: &mut Pcg32, options: usize) -> usize {
    ((u64::from(random.next_u32()) * options as u64) >> 32) as usize
}
