//! The goal list: what the prioritiser wishes for and goals of one's own, as one list with editions.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use farside::SimTime;

use super::messages::{GoalList, ListedCombination, ListedGoal};
use super::wishes::OwnWishes;
use crate::analysis::goals::{GoalId, Observation, Target, Wishes};
use crate::shac::GoalKey;

/// The goal list, and which of its goals are achieved. It outlives crashes.
///
/// What is achieved is not wished for again. It stays on the list as it was, with its combinations, because
/// what is left of these is worth as much as before.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Wishlist {
    pub(super) list: GoalList,
    achieved: BTreeSet<GoalKey>,
}

/// How a list differs from the one before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Difference {
    pub(super) added: u32,
    pub(super) changed: u32,
    pub(super) withdrawn: u32,
    combinations: bool,
}

impl Wishlist {
    /// Notes what is achieved.
    pub(super) fn achieve(&mut self, goals: &[GoalKey]) {
        self.achieved.extend(goals);
    }

    /// Wishes anew: what the prioritiser wishes for, with its weights times `scale`, as far as rovers can do
    /// it, and what is of one's own, which goes before. There is a new edition, with the number that is given, if
    /// anything differs.
    pub(super) fn revise(
        &mut self,
        wishes: &Wishes,
        (scale, can): (f64, impl Fn(Observation) -> bool),
        own: &OwnWishes,
        (now, edition): (SimTime, u64),
    ) -> Option<Difference> {
        let mut goals: BTreeMap<GoalKey, ListedGoal> = BTreeMap::new();
        for (&id, goal) in wishes.goals.iter().filter(|(id, _)| can(id.observation)) {
            let listed = listed(id, goal.position_m, scale * goal.weight);
            goals.insert(listed.key, listed);
        }
        goals.extend(own.goals(now).map(|goal| (goal.key, goal)));
        for goal in &self.list.goals {
            if self.achieved.contains(&goal.key) {
                goals.insert(goal.key, goal.clone());
            }
        }
        let mut combinations: BTreeMap<Vec<GoalKey>, f64> = BTreeMap::new();
        for (ids, factor) in &wishes.combinations {
            let keys: Vec<GoalKey> = ids.iter().map(|&id| GoalKey::from(id)).collect();
            let weights = ids.iter().filter_map(|id| wishes.goals.get(id));
            let sum: f64 = weights.map(|goal| goal.weight).sum();
            combinations.insert(keys, scale * factor * sum);
        }
        for one in own.combinations(now) {
            combinations.insert(one.goals, one.weight);
        }
        for one in &self.list.combinations {
            if one.goals.iter().any(|goal| self.achieved.contains(goal)) {
                combinations.insert(one.goals.clone(), one.weight);
            }
        }
        combinations.retain(|keys, _| keys.iter().all(|key| goals.contains_key(key)));
        let combinations = combinations.into_iter();
        let combinations = combinations.map(|(goals, weight)| ListedCombination { goals, weight });
        let (goals, combinations) = (goals.into_values().collect(), combinations.collect());
        self.replace(goals, combinations, edition)
    }

    /// Takes over a list that somebody else has made, if it is newer.
    pub(super) fn take(&mut self, list: GoalList) {
        if list.edition > self.list.edition {
            self.list = list;
        }
    }

    fn replace(
        &mut self,
        goals: Vec<ListedGoal>,
        combinations: Vec<ListedCombination>,
        edition: u64,
    ) -> Option<Difference> {
        let before: BTreeMap<GoalKey, &ListedGoal> = self
            .list
            .goals
            .iter()
            .map(|goal| (goal.key, goal))
            .collect();
        let mut difference = Difference {
            combinations: combinations != self.list.combinations,
            ..Difference::default()
        };
        for goal in &goals {
            match before.get(&goal.key) {
                None => difference.added += 1,
                Some(known) if *known != goal => difference.changed += 1,
                Some(_) => {}
            }
        }
        let kept = goals.len() as u32 - difference.added;
        difference.withdrawn = before.len() as u32 - kept;
        if difference == Difference::default() {
            return None;
        }
        self.list = GoalList {
            edition,
            goals,
            combinations,
        };
        Some(difference)
    }
}

/// A goal of the prioritiser.
fn listed(id: GoalId, position_m: [f64; 2], weight: f64) -> ListedGoal {
    ListedGoal {
        key: id.into(),
        observation: id.observation,
        rock: match id.target {
            Target::Rock(rock) => Some(rock),
            Target::Square(..) => None,
        },
        position_m,
        weight,
        mandatory: false,
        window: None,
        requires: Vec::new(),
        partner: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::goals::Goal;

    fn wishes(rocks: &[u32], weight: f64) -> Wishes {
        let mut wishes = Wishes::default();
        for &rock in rocks {
            let ids = [Observation::PointImage, Observation::PointSpectrum].map(|observation| {
                let target = Target::Rock(rock);
                GoalId {
                    target,
                    observation,
                }
            });
            for id in ids {
                let position_m = [f64::from(rock), 0.0];
                let goal = Goal {
                    id,
                    position_m,
                    weight,
                };
                wishes.goals.insert(id, goal);
            }
            wishes.combinations.insert(ids.to_vec(), 1.25);
        }
        wishes
    }

    #[test]
    fn what_is_achieved_stays_with_its_combinations_and_is_not_wished_for_again() {
        let (own, now) = (OwnWishes::default(), SimTime::ZERO);
        let mut list = Wishlist::default();
        let first = list
            .revise(&wishes(&[3, 5], 2.0), (10.0, |_| true), &own, (now, 1))
            .unwrap();
        assert_eq!((first.added, list.list.edition), (4, 1));
        assert_eq!(list.list.combinations[0].weight, 10.0 * 1.25 * 4.0);
        assert_eq!(
            list.revise(&wishes(&[3, 5], 2.0), (10.0, |_| true), &own, (now, 1)),
            None
        );

        let image = list.list.goals[0].key;
        list.achieve(&[image]);
        let later = list
            .revise(&wishes(&[5, 8], 1.0), (10.0, |_| true), &own, (now, 2))
            .unwrap();
        assert_eq!((later.added, later.changed, later.withdrawn), (2, 2, 1));
        assert_eq!(list.list.goals[0].key, image);
        assert_eq!(list.list.goals[0].weight, 20.0);
        // The spectrum of rock 3 is no longer wished for, so that nothing is left of its combination.
        assert_eq!(list.list.combinations.len(), 2);
    }
}
