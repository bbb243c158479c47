//! The set of outcomes: it only grows, and everyone passes it on.

use std::collections::BTreeMap;

use farside::SimTime;
use serde::{Deserialize, Serialize};

use super::values::{GoalKey, Grant};

/// How many outcomes a message holds at most.
pub(super) const OUTCOMES_PER_MESSAGE: usize = 32;

/// That a rover has carried out a goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Outcome {
    /// Who.
    pub rover: u32,
    /// Counts the rover's outcomes, from 1.
    pub ordinal: u32,
    /// What.
    pub goal: GoalKey,
    /// The other half of a joint goal.
    pub partner: Option<GoalKey>,
    /// Under which grant.
    pub grant: Grant,
    /// When it ended.
    pub at: SimTime,
    /// Whether the rover knew then that it had been achieved before.
    pub duplicate: bool,
}

/// Outcomes that somebody knows of, each once.
///
/// ```
/// use farside::SimTime;
/// use farside_misus::shac::{GoalKey, Grant, Outcome, Outcomes};
/// let goal = GoalKey::Numbered(3);
/// let (grant, at) = (Grant::default(), SimTime::ZERO);
/// let outcome = Outcome { rover: 1, ordinal: 1, goal, partner: None, grant, at, duplicate: false };
/// let mut known = Outcomes::default();
/// assert!(known.insert(outcome) && !known.insert(outcome));
/// assert!(known.insert(Outcome { rover: 2, duplicate: true, ..outcome }));
/// assert_eq!((known.achieved(goal), known.of(goal).count()), (true, 2));
/// assert_eq!(known.goals_achieved(), [goal]);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcomes {
    /// By rover, those of each in the order of their ordinals.
    rovers: BTreeMap<u32, Vec<Outcome>>,
}

impl Outcomes {
    /// Adds one. Whether it was not known.
    pub fn insert(&mut self, outcome: Outcome) -> bool {
        let known = self.rovers.entry(outcome.rover).or_default();
        match known.binary_search_by_key(&outcome.ordinal, |other| other.ordinal) {
            Ok(_) => false,
            Err(place) => {
                known.insert(place, outcome);
                true
            }
        }
    }

    /// Whether a rover's outcome of this ordinal is known.
    pub fn contains(&self, outcome: &Outcome) -> bool {
        let known = self.rovers.get(&outcome.rover);
        known.is_some_and(|known| {
            let place = known.binary_search_by_key(&outcome.ordinal, |other| other.ordinal);
            place.is_ok()
        })
    }

    /// All of them, by rover.
    pub fn iter(&self) -> impl Iterator<Item = &Outcome> {
        self.rovers.values().flatten()
    }

    /// Those of a goal.
    pub fn of(&self, goal: GoalKey) -> impl Iterator<Item = &Outcome> {
        self.iter().filter(move |outcome| outcome.goal == goal)
    }

    /// Whether a goal is achieved: one rover has done it, or two rovers have done both halves of it
    /// under one grant.
    pub fn achieved(&self, goal: GoalKey) -> bool {
        self.of(goal).any(|half| match half.partner {
            None => true,
            Some(partner) => self
                .of(partner)
                .any(|other| other.grant == half.grant && other.rover != half.rover),
        })
    }

    /// All goals that are achieved, each once, in ascending order: what the score counts.
    pub fn goals_achieved(&self) -> Vec<GoalKey> {
        let mut goals: Vec<GoalKey> = self.iter().map(|outcome| outcome.goal).collect();
        goals.sort_unstable();
        goals.dedup();
        goals.retain(|&goal| self.achieved(goal));
        goals
    }

    /// How many outcomes of each of so many rovers are known, from the first on without gaps.
    pub fn have(&self, rovers: u32) -> Vec<u32> {
        (0..rovers).map(|rover| self.through(rover)).collect()
    }

    /// How many outcomes of a rover are known, from the first on without gaps.
    pub fn through(&self, rover: u32) -> u32 {
        let known = self.rovers.get(&rover).map_or(&[][..], Vec::as_slice);
        let gapless = known.iter().zip(1..);
        gapless
            .take_while(|(outcome, ordinal)| outcome.ordinal == *ordinal)
            .count() as u32
    }

    /// Those that somebody lacks who has so many of each rover.
    pub(super) fn beyond<'a>(&'a self, have: &'a [u32]) -> impl Iterator<Item = &'a Outcome> {
        self.iter().filter(move |outcome| {
            let has = have.get(outcome.rover as usize);
            has.is_none_or(|&has| outcome.ordinal > has)
        })
    }
}
