//! What has become of goals at an instant, told from what was written of them until then.

use std::collections::{BTreeMap, BTreeSet};

use super::history::{History, News};
use crate::shac::{GoalKey, OwnerWrite};
use crate::survey::messages::ListedGoal;
use crate::survey::tally::SurveyTally;

/// What becomes of a goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Standing {
    /// A rover has done it.
    Achieved { rover: usize },
    /// A rover has started it.
    Started { rover: usize },
    /// A rover has said that it will do it.
    Owned { rover: usize },
    /// A rover was asked to do it.
    Offered,
    /// Nobody has it; somebody may get it.
    Pooled,
    /// It is on the list, and the centre does not know of it yet.
    Wished,
    /// The centre has given it up, with a reason.
    GivenUp,
    /// It is no longer wished for.
    Withdrawn,
}

/// The states of a survey's goals, as time goes on.
pub(super) struct Standings<'a> {
    history: &'a History,
    tally: SurveyTally,
    /// Who has achieved a goal first.
    achieved: BTreeMap<GoalKey, usize>,
    /// How much of the news is taken in.
    taken: usize,
    goals: BTreeMap<GoalKey, ListedGoal>,
}

impl<'a> Standings<'a> {
    pub(super) fn new(history: &'a History) -> Standings<'a> {
        Standings {
            history,
            tally: SurveyTally::new(history.rovers.len()),
            achieved: BTreeMap::new(),
            taken: 0,
            goals: BTreeMap::new(),
        }
    }

    /// Takes in all news until a time, which must not be before the last one.
    pub(super) fn until(&mut self, at_ns: u64) {
        let news = &self.history.news;
        while let Some((_, one)) = news
            .get(self.taken)
            .filter(|(time_ns, _)| *time_ns <= at_ns)
        {
            self.taken += 1;
            match one {
                News::List(list) => {
                    let goals = list.goals.iter();
                    self.goals
                        .extend(goals.map(|goal| (goal.key, goal.clone())));
                    self.tally.lists.push(list.clone());
                }
                News::Owner(rover, write) => {
                    self.tally.owner_wrote(*rover, write);
                    if let OwnerWrite::Outcome(outcome) = write {
                        let rover = outcome.rover as usize;
                        self.achieved.entry(outcome.goal).or_insert(rover);
                    }
                }
                News::Centre(site, write) => self.tally.centre_wrote(*site, write),
            }
        }
    }

    /// What the goals that were achieved are worth, by Equation 1.
    pub(super) fn score(&self) -> f64 {
        self.tally.score
    }

    /// How many goals there ever were, and how many were achieved.
    pub(super) fn counts(&self) -> (usize, usize) {
        (self.goals.len(), self.achieved.len())
    }

    /// All goals that ever were on the list, as it last had them, and what has become of each.
    pub(super) fn all(&self) -> Vec<(&ListedGoal, Standing)> {
        let listed = self.tally.lists.last().map(|list| &list.goals);
        let listed: BTreeSet<GoalKey> = listed.into_iter().flatten().map(|one| one.key).collect();
        let of = |(key, goal): (&GoalKey, _)| (goal, self.of(*key, listed.contains(key)));
        self.goals.iter().map(of).collect()
    }

    fn of(&self, goal: GoalKey, is_listed: bool) -> Standing {
        if let Some(&rover) = self.achieved.get(&goal) {
            return Standing::Achieved { rover };
        }
        let holding = |rover: usize| self.tally.rovers[rover].owner.held.get(&goal);
        let mut holders = (0..self.tally.rovers.len()).filter_map(|rover| {
            let holding = holding(rover)?;
            Some((holding.started.is_none(), rover))
        });
        // The one who has started it, if any has.
        if let Some((is_waiting, rover)) = holders.by_ref().min() {
            return match is_waiting {
                true => Standing::Owned { rover },
                false => Standing::Started { rover },
            };
        }
        let centre = self.tally.in_office();
        match centre.and_then(|centre| centre.durable.table.get(&goal)) {
            _ if !is_listed => Standing::Withdrawn,
            None => Standing::Wished,
            Some(record) if record.wish.withdrawn => Standing::Withdrawn,
            Some(record) if record.given_up.is_some() => Standing::GivenUp,
            Some(record) if record.holder.is_some() => Standing::Offered,
            Some(_) => Standing::Pooled,
        }
    }
}
