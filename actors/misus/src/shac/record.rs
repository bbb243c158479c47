//! What a centre keeps of a goal, and how the records of two centres become one.

use farside::SimTime;
use serde::{Deserialize, Serialize};

use super::outcomes::Outcomes;
use super::values::{Grant, Reason, Revision, SharedGoal, Wish};

/// What a centre keeps of a goal.
///
/// Two records of one goal are joined part by part: of the wish the larger revision holds, of what
/// became of it the larger grant. Within one grant everything goes one way: it is given,
/// acknowledged, confirmed and ended, and what has ended never begins again. So records may be joined in
/// any order, and as often as one likes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GoalRecord {
    /// What is wished for.
    pub wish: Wish,
    /// The last grant.
    pub grant: Grant,
    /// Who has it; none if that grant has ended.
    pub holder: Option<Holder>,
    /// Why it is given up.
    pub given_up: Option<Reason>,
    /// Who has refused it and when, by rover.
    pub refusals: Vec<Refusal>,
    /// How often all rovers have refused it.
    pub rounds: u32,
}

/// Who has a goal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Holder {
    /// Which rover.
    pub rover: u32,
    /// The latest end of its lease that was ever sent.
    pub lease_end: SimTime,
    /// Whether the rover has said that it accepts.
    pub acknowledged: bool,
    /// Whether the rover has said that it has started.
    pub started: bool,
    /// Of half of a joint goal: whether another rover is bound to the other half.
    pub confirmed: bool,
    /// Whether it is being taken back.
    pub cancelling: bool,
}

/// That a rover did not want a goal, or did not answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Refusal {
    /// Which rover.
    pub rover: u32,
    /// In which sol.
    pub sol: u64,
    /// The rover's capacity then, see [`GoalStatus::capacity`](super::GoalStatus::capacity).
    pub capacity: u32,
}

/// How a goal stands.
///
/// Each goal is one of these at any time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Standing {
    /// Nobody has it; somebody may get it.
    Pooled,
    /// A rover has it, or may have it as far as is known.
    Owned {
        /// Which.
        rover: u32,
    },
    /// It is done.
    Achieved,
    /// It will not be done.
    Unachievable(Reason),
}

impl GoalRecord {
    /// A goal that nobody has had.
    pub(super) fn new(goal: SharedGoal, revision: Revision) -> GoalRecord {
        GoalRecord {
            wish: Wish {
                goal,
                revision,
                withdrawn: false,
            },
            grant: Grant::default(),
            holder: None,
            given_up: None,
            refusals: Vec::new(),
            rounds: 0,
        }
    }

    /// How it stands, given the outcomes that are known.
    pub(super) fn standing(&self, outcomes: &Outcomes) -> Standing {
        if outcomes.achieved(self.wish.goal.key) {
            return Standing::Achieved;
        }
        match (self.holder, self.given_up) {
            (Some(holder), _) => Standing::Owned {
                rover: holder.rover,
            },
            (None, _) if self.wish.withdrawn => Standing::Unachievable(Reason::Withdrawn),
            (None, Some(reason)) => Standing::Unachievable(reason),
            (None, None) => Standing::Pooled,
        }
    }

    /// A newer edition of the goal: what was given up is to be tried again.
    pub(super) fn revise(&mut self, wish: Wish) {
        self.wish = wish;
        self.given_up = None;
        self.rounds = 0;
    }

    /// Notes that a rover did not want it. Its latest word holds.
    pub(super) fn refuse(&mut self, refusal: Refusal) {
        match self
            .refusals
            .binary_search_by_key(&refusal.rover, |known| known.rover)
        {
            Err(place) => self.refusals.insert(place, refusal),
            Ok(place) => {
                let known = &mut self.refusals[place];
                let latest = (known.sol, known.capacity).max((refusal.sol, refusal.capacity));
                (known.sol, known.capacity) = latest;
            }
        }
    }

    /// Joins what another centre has of the same goal.
    pub(super) fn join(&mut self, other: &GoalRecord, keeps_withdrawals: bool) {
        let is_newer = other.wish.revision > self.wish.revision;
        let is_granted_later = other.grant > self.grant;
        if is_newer && keeps_withdrawals || is_granted_later && !keeps_withdrawals {
            self.revise(other.wish);
        }
        if is_granted_later {
            self.grant = other.grant;
            self.holder = other.holder;
            self.rounds = other.rounds;
            if other.wish.revision == self.wish.revision {
                self.given_up = other.given_up;
            }
        } else if other.grant == self.grant {
            self.holder = match (self.holder, other.holder) {
                (Some(mine), Some(theirs)) => Some(mine.joined(&theirs)),
                _ => None,
            };
            self.rounds = self.rounds.max(other.rounds);
            if other.wish.revision == self.wish.revision {
                self.given_up = self.given_up.or(other.given_up);
            }
        }
        for &refusal in &other.refusals {
            self.refuse(refusal);
        }
    }
}

impl Holder {
    /// What is known of one grant from two sides.
    pub(super) fn joined(self, other: &Holder) -> Holder {
        Holder {
            rover: self.rover,
            lease_end: self.lease_end.max(other.lease_end),
            acknowledged: self.acknowledged || other.acknowledged,
            started: self.started || other.started,
            confirmed: self.confirmed || other.confirmed,
            cancelling: self.cancelling || other.cancelling,
        }
    }
}
