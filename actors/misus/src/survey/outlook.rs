//! What a rover does next, planned anew from what it knows now: its pose, battery and memory, what runs and
//! what is about to begin, the goals that it has, and what others hold. A function of these: no clock, no link,
//! no actor.
//!
//! The planner is the paper's ([`crate::planner::casper`]): here its problem is made, and its plan is given
//! times, charges and memory. What runs and what is committed comes first and stays as it is; planned is what
//! comes after. In `continuous` mode the plan before is taken over and repaired, and optimised only where
//! something new may be gained; in `batch` mode each plan is made from nothing.
//!
//! A chain counts energy by sol, a battery does not: what is used in the morning is there only if the
//! Sun has given it. So each plan's charge is followed through day and night ([`Forecast`]), and a plan
//! that would go below the reserve is begun later in the day, or given less energy, until none does.

mod ahead;
mod forecast;
mod means;
mod posing;

use std::collections::{BTreeMap, BTreeSet};

use farside::SimDuration;
use farside::random::RandomKey;

use super::messages::{Activity, ListedCombination, PlanMode};
use crate::planner::casper::PlannerConfig;
use crate::shac::{GoalKey, Reason};

pub use forecast::{Forecast, Load, Profile};
pub use means::Means;
pub use posing::{Posed, pose};

/// How long a rover waits for another one before it gives up a goal for two.
pub(crate) const WAITS: SimDuration = SimDuration::from_secs(1200);

/// A goal that a rover has, as it plans it.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnGoal {
    /// Its name.
    pub key: GoalKey,
    /// Where it is made from, east and north \[m\].
    pub position_m: [f64; 2],
    /// How long it takes \[ms\].
    pub duration_ms: i64,
    /// What it takes beyond what the body takes \[W\].
    pub power_w: f64,
    /// What it adds to memory \[bit\].
    pub memory_bits: i64,
    /// Whether it is planned first, and never given up.
    pub mandatory: bool,
    /// When it may begin at the earliest and has to have ended \[ms\]; the latter may be `i64::MAX`.
    pub window_ms: [i64; 2],
    /// Goals that this rover has to have achieved before.
    pub requires: Vec<GoalKey>,
}

/// What goals are worth, alone and together (Equation 1).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Worth {
    /// By goal.
    pub weights: BTreeMap<GoalKey, f64>,
    /// Of several goals.
    pub combinations: Vec<ListedCombination>,
}

impl Worth {
    /// Equation 1: what these goals are worth.
    ///
    /// ```
    /// use farside_misus::shac::GoalKey::Numbered;
    /// use farside_misus::survey::ListedCombination;
    /// use farside_misus::survey::outlook::Worth;
    /// let worth = Worth {
    ///     weights: [(Numbered(1), 4.0), (Numbered(2), 3.0)].into(),
    ///     combinations: vec![ListedCombination {
    ///         goals: vec![Numbered(1), Numbered(2)],
    ///         weight: -5.0,
    ///     }],
    /// };
    /// assert_eq!(worth.of(&[Numbered(1)].into()), 4.0);
    /// assert_eq!(worth.of(&[Numbered(1), Numbered(2)].into()), 2.0);
    /// ```
    pub fn of(&self, goals: &BTreeSet<GoalKey>) -> f64 {
        let alone = self.weights.iter().filter(|(goal, _)| goals.contains(goal));
        let alone = alone.fold(0.0, |sum, (_, weight)| sum + weight);
        let is_whole = |at: &&ListedCombination| at.goals.iter().all(|goal| goals.contains(goal));
        let together = self.combinations.iter().filter(is_whole);
        together.fold(alone, |sum, at| sum + at.weight)
    }
}

/// What a rover knows when it plans.
#[derive(Clone, Debug, PartialEq)]
pub struct Known {
    /// When that is \[ms\].
    pub now_ms: i64,
    /// Where it believes to be \[m\].
    pub position_m: [f64; 2],
    /// What its battery holds \[J\].
    pub battery_j: f64,
    /// The share of its power that the array yields, 0 to 1.
    pub clean: f64,
    /// What its memory holds \[bit\].
    pub memory_bits: i64,
    /// What its memory can hold \[bit\].
    pub memory_size_bits: i64,
    /// What runs and what is committed, in order, with the times at which they are expected now.
    pub fixed: Vec<Piece>,
    /// The goals that it may plan; none that is among `fixed`.
    pub goals: Vec<OwnGoal>,
    /// What they are worth, with those of others.
    pub worth: Worth,
    /// What others were last heard to hold, or to have achieved.
    pub held: BTreeSet<GoalKey>,
    /// What this rover has achieved.
    pub achieved: BTreeSet<GoalKey>,
    /// The sols whose communication is done, or given up.
    pub communicated: BTreeSet<u32>,
    /// Whether there may be room for more than before: something ended early, or a new sol has begun.
    pub has_gained: bool,
}

/// A stretch of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// What is done.
    pub activity: Activity,
    /// Where the rover is at its end \[m\].
    pub position_m: [f64; 2],
    /// When it begins \[ms\].
    pub starts_ms: i64,
    /// When it has ended \[ms\].
    pub ends_ms: i64,
    /// What it takes beyond what the body takes \[W\].
    pub power_w: f64,
    /// What it adds to memory at its end \[bit\].
    pub adds_bits: i64,
    /// What it frees of memory at its end, at the most \[bit\].
    pub sends_bits: i64,
    /// What the battery is predicted to hold at its end \[J\].
    pub battery_j: f64,
    /// What memory is predicted to hold at its end \[bit\].
    pub memory_bits: i64,
}

/// A rover's plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// What is done, in order: first what was fixed.
    pub pieces: Vec<Piece>,
    /// The charge below which it does not go \[J\].
    pub reserve_j: f64,
    /// Goals that it gives up, since repairs have deleted them too often, each with what there was too
    /// little of.
    pub shed: Vec<(GoalKey, Reason)>,
    /// Goals that it has no room or no wish for, each with what there was too little of.
    pub left_out: Vec<(GoalKey, Reason)>,
    /// Sols whose communication does not fit any more.
    pub missed: Vec<u32>,
    /// What the planner looked at.
    pub operations: u64,
    /// What the team's goals are worth by this plan and by what others hold (Equation 1).
    pub score: f64,
    /// The same, less what its drives and goals cost by the user's objective.
    pub value: f64,
    /// How far it drives \[m\].
    pub traverse_m: f64,
    /// What the battery is predicted to hold at any time.
    pub profile: Profile,
    /// What memory held when it was made \[bit\].
    stored_bits: i64,
    /// What it was made for.
    basis: Basis,
}

/// What a plan is optimised for: if it is as before, there is nothing to gain.
#[derive(Clone, Debug, PartialEq)]
struct Basis {
    goals: Vec<OwnGoal>,
    worth: Worth,
    held: BTreeSet<GoalKey>,
}

impl Plan {
    /// The goals that are planned, in order.
    pub fn goals(&self) -> impl Iterator<Item = GoalKey> + '_ {
        self.pieces.iter().filter_map(|piece| match piece.activity {
            Activity::Goal(key) => Some(key),
            _ => None,
        })
    }

    /// The goals that it was made for, planned or not, and those that something was done for then.
    pub fn for_goals(&self) -> BTreeSet<GoalKey> {
        let own = self.basis.goals.iter().map(|goal| goal.key);
        let fixed = self.pieces.iter().filter_map(|piece| match piece.activity {
            Activity::Goal(key) | Activity::Drive(key) => Some(key),
            Activity::Communication(_) | Activity::Sleep => None,
        });
        own.chain(fixed).collect()
    }

    /// What others held when it was made.
    pub fn held(&self) -> &BTreeSet<GoalKey> {
        &self.basis.held
    }

    /// What memory is predicted to hold at a time \[bit\].
    pub fn memory_at(&self, at_ms: i64) -> i64 {
        let before = self.pieces.iter().rfind(|piece| piece.ends_ms <= at_ms);
        before.map_or(self.stored_bits, |piece| piece.memory_bits)
    }

    /// How many of the pieces of another plan that begin after a time are not in this one, or more than a
    /// minute away from where they were.
    pub fn moved_from(&self, before: &Plan, now_ms: i64) -> u32 {
        let ahead = before
            .pieces
            .iter()
            .filter(|piece| piece.starts_ms > now_ms);
        let is_kept = |piece: &&Piece| {
            let mut same = self.pieces.iter();
            same.any(|at| {
                at.activity == piece.activity && (at.starts_ms - piece.starts_ms).abs() <= 60_000
            })
        };
        ahead.filter(|piece| !is_kept(piece)).count() as u32
    }
}

/// A rover's way of planning.
#[derive(Clone, Debug)]
pub struct Outlook {
    means: Means,
    forecast: Forecast,
    planner: PlannerConfig,
    mode: PlanMode,
    key: RandomKey,
}

impl Outlook {
    /// Of a rover with these means; its chances are drawn at `key`.
    pub fn new(
        means: Means,
        forecast: Forecast,
        planner: PlannerConfig,
        mode: PlanMode,
        key: RandomKey,
    ) -> Outlook {
        Outlook {
            means,
            forecast,
            planner,
            mode,
            key,
        }
    }

    /// What it can do.
    pub fn means(&self) -> &Means {
        &self.means
    }

    /// What it expects of Sun and battery.
    pub fn forecast(&mut self) -> &mut Forecast {
        &mut self.forecast
    }
}

#[cfg(test)]
mod tests;
