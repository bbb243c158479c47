//! Goals that come, change and go.

use farside::{SimDuration, SimTime};
use thiserror::Error;

use super::{Centre, CentreWrite};
use crate::shac::definition::{Parameter, Role, Stage};
use crate::shac::messages::Output;
use crate::shac::record::GoalRecord;
use crate::shac::values::{GoalKey, Parameters, Revision, SharedGoal, Wish};

/// A goal that cannot be wished for, or not so.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum WishError {
    /// A number that is none.
    #[error("goal {goal:?}: {what} = {actual}, expected a finite number")]
    NotFinite {
        /// Which.
        goal: GoalKey,
        /// Which parameter.
        what: &'static str,
        /// What was given.
        actual: f64,
    },
    /// The activity does not fit into a lease, so that it could never start.
    #[error("goal {goal:?} takes {duration}, expected at most {longest}: the lease less the guard")]
    LongerThanLease {
        /// Which.
        goal: GoalKey,
        /// How long it takes.
        duration: SimDuration,
        /// How long it may take.
        longest: SimDuration,
    },
    /// A goal is its own other half.
    #[error("goal {goal:?} is its own other half")]
    OwnPartner {
        /// Which.
        goal: GoalKey,
    },
    /// There is a goal of this name. It is changed, not added.
    #[error("there is a goal {goal:?} already")]
    Exists {
        /// Which.
        goal: GoalKey,
    },
    /// There is no goal of this name, or it was withdrawn.
    #[error("there is no goal {goal:?}")]
    Unknown {
        /// Which.
        goal: GoalKey,
    },
    /// The centre may not set this parameter, or not at this stage.
    #[error("the centre may not set {parameter:?} of a goal that is {stage:?}")]
    NotPermitted {
        /// Which.
        parameter: Parameter,
        /// How far the goal is.
        stage: Stage,
    },
}

type Wished = Result<Output<CentreWrite>, WishError>;

impl Centre {
    /// Adds a goal, or wishes again for one that was withdrawn.
    ///
    /// # Errors
    /// When there is such a goal, or this one cannot be.
    pub fn add(&mut self, now: SimTime, goal: SharedGoal) -> Wished {
        self.check(&goal)?;
        let revision = self.next_revision(goal.key);
        let record = match self.durable.table.get(&goal.key) {
            None => GoalRecord::new(goal, revision),
            Some(known) if !known.wish.withdrawn => {
                return Err(WishError::Exists { goal: goal.key });
            }
            Some(known) => {
                let mut record = known.clone();
                record.revise(Wish {
                    goal,
                    revision,
                    withdrawn: false,
                });
                record
            }
        };
        let mut out = Output::default();
        self.keep(now, record, &mut out);
        self.meet_stranger(now, goal.key, &mut out);
        self.finish(now, &mut out);
        Ok(out)
    }

    /// Changes parameters of a goal. What was given up is then tried again.
    ///
    /// # Errors
    /// When there is no such goal, a number is none, or the centre may not set one of the parameters
    /// that differ.
    pub fn change(&mut self, now: SimTime, goal: GoalKey, to: &Parameters) -> Wished {
        let mut record = self.wished(goal)?.clone();
        let stage = match record.holder {
            None => Stage::Pooled,
            Some(holder) if holder.started => Stage::Started,
            Some(_) => Stage::Owned,
        };
        let before = record.wish.goal.parameters;
        for parameter in Parameter::ALL {
            let parameters = record.wish.goal.parameters;
            record.wish.goal.parameters.take(parameter, to);
            let differs = record.wish.goal.parameters != parameters;
            let may = |stage| {
                self.settings
                    .activity
                    .may_set(Role::Centre, parameter, stage)
            };
            if differs && !may(stage) {
                return Err(WishError::NotPermitted { parameter, stage });
            }
        }
        self.check(&record.wish.goal)?;
        let mut out = Output::default();
        if record.wish.goal.parameters != before {
            let wish = Wish {
                revision: self.next_revision(goal),
                ..record.wish
            };
            record.revise(wish);
            self.keep(now, record, &mut out);
        }
        self.finish(now, &mut out);
        Ok(out)
    }

    /// Wishes for a goal no more. A rover that has not started it is told to drop it.
    ///
    /// # Errors
    /// When there is no such goal.
    pub fn withdraw(&mut self, now: SimTime, goal: GoalKey) -> Wished {
        let mut record = self.wished(goal)?.clone();
        record.wish.revision = self.next_revision(goal);
        record.wish.withdrawn = true;
        let mut out = Output::default();
        self.keep(now, record, &mut out);
        self.finish(now, &mut out);
        Ok(out)
    }

    fn wished(&self, goal: GoalKey) -> Result<&GoalRecord, WishError> {
        let known = self.durable.table.get(&goal);
        let known = known.filter(|record| !record.wish.withdrawn);
        known.ok_or(WishError::Unknown { goal })
    }

    fn next_revision(&self, goal: GoalKey) -> Revision {
        let known = self.durable.table.get(&goal);
        Revision {
            number: known.map_or(0, |record| record.wish.revision.number) + 1,
            site: self.site,
        }
    }

    fn check(&self, goal: &SharedGoal) -> Result<(), WishError> {
        let Parameters {
            target_m,
            duration,
            memory_bits,
            weight,
            ..
        } = goal.parameters;
        let goal_key = goal.key;
        let numbers = [
            ("target, east", target_m[0]),
            ("target, north", target_m[1]),
            ("memory", memory_bits),
            ("weight", weight),
        ];
        for (what, actual) in numbers {
            if !actual.is_finite() {
                return Err(WishError::NotFinite {
                    goal: goal_key,
                    what,
                    actual,
                });
            }
        }
        if goal.partner == Some(goal.key) {
            return Err(WishError::OwnPartner { goal: goal_key });
        }
        let longest = self.settings.protocol.lease;
        let longest = longest.map(|lease| lease.saturating_sub(self.settings.guard));
        match longest {
            Some(longest) if duration > longest => Err(WishError::LongerThanLease {
                goal: goal_key,
                duration,
                longest,
            }),
            _ => Ok(()),
        }
    }
}
