//! Goals and combinations of one's own: `[[goal]]` and `[[combination]]`, with the times at which they are added,
//! changed and withdrawn.

use farside::{SimDuration, SimTime};
use farside_actors::system::settings::{Within, in_unit, one_of, such_that};
use farside_actors::{settings, units};

use super::messages::{ListedCombination, ListedGoal, Window};
use crate::analysis::goals::{GoalId, Observation, Target};
use crate::shac::GoalKey;

settings! {
    /// A `[[goal]]` entry: an observation of one's own.
    pub struct GoalConfig {
        /// Its name, no other goal's.
        pub name: String, such_that("a name", |_| "missing".to_owned(), |name: &String| !name.is_empty());
        /// What is done.
        pub observation: Observation = Observation::PointSpectrum,
            one_of(&["panoramic-image", "panoramic-spectrum", "point-image", "point-spectrum"]);
        /// The rock, by its number from 0; or `east_m` and `north_m` are given.
        pub rock: Option<u32> [skip_serializing_if = "Option::is_none"];
        /// Where, east of the middle of the field \[m\].
        pub east_m: f64 = 0.0, in_unit("m", -1e6..=1e6);
        /// Where, north of the middle of the field \[m\].
        pub north_m: f64 = 0.0, in_unit("m", -1e6..=1e6);
        /// What it is worth by itself; may be negative.
        pub weight: f64 = 1.0, -1e9..=1e9;
        /// Whether it is planned first and never shed.
        pub mandatory: bool;
        /// How many rovers have to do it at one time: 1 or 2.
        pub rovers: u32 = 1, 1..=2;
        /// The earliest start.
        pub opens: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"];
        /// When it has to have ended.
        pub closes: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"];
        /// The names of goals of one's own that the same rover has to have achieved before.
        pub requires: Vec<String> [skip_serializing_if = "Vec::is_empty"];
        /// When it is wished for.
        pub added: SimDuration [with = "units::duration"] = SimDuration::ZERO;
        /// From when on it is wished for no more.
        pub withdrawn: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"];
        /// Other weights, in the order of their times.
        pub changes as "change": Vec<ChangeConfig> [skip_serializing_if = "Vec::is_empty"], Within;
    }
}

settings! {
    /// A `[[combination]]` entry: goals of one's own that change each other's worth.
    pub struct CombinationConfig {
        /// The names of two different goals of one's own or more.
        pub goals: Vec<String>;
        /// What is added when all are achieved; may be negative.
        pub weight: f64 = 1.0, -1e9..=1e9;
        /// When it begins to count.
        pub added: SimDuration [with = "units::duration"] = SimDuration::ZERO;
        /// From when on it counts no more.
        pub withdrawn: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"];
        /// Other weights, in the order of their times.
        pub changes as "change": Vec<ChangeConfig> [skip_serializing_if = "Vec::is_empty"], Within;
    }
}

settings! {
    /// A `[[goal.change]]` or `[[combination.change]]` entry: another weight.
    pub struct ChangeConfig {
        /// From when on.
        pub at: SimDuration [with = "units::duration"] = SimDuration::ZERO;
        /// The weight.
        pub weight: f64 = 1.0, -1e9..=1e9;
    }
}

/// Goals and combinations of one's own, with their names resolved.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct OwnWishes {
    goals: Vec<Timed<ListedGoal>>,
    combinations: Vec<Timed<ListedCombination>>,
}

/// What is wished for from an instant on, perhaps with other weights later, perhaps until another instant.
#[derive(Clone, Debug, PartialEq)]
struct Timed<T> {
    what: T,
    weights: Vec<(SimTime, f64)>,
    until: SimTime,
}

impl<T> Timed<T> {
    fn new(
        what: T,
        (added, weight): (SimDuration, f64),
        changes: &[ChangeConfig],
        until: Option<SimDuration>,
    ) -> Timed<T> {
        let first = (SimTime::ZERO + added, weight);
        let later = changes
            .iter()
            .map(|change| (SimTime::ZERO + change.at, change.weight));
        Timed {
            what,
            weights: std::iter::once(first).chain(later).collect(),
            until: until.map_or(SimTime::MAX, |until| SimTime::ZERO + until),
        }
    }

    /// What it is worth at an instant; none if it is not wished for.
    fn weight(&self, now: SimTime) -> Option<f64> {
        let begun = self.weights.iter().take_while(|(at, _)| *at <= now);
        let weight = begun.last().map(|(_, weight)| *weight);
        weight.filter(|_| now < self.until)
    }

    fn instants(&self) -> impl Iterator<Item = SimTime> {
        let at = self.weights.iter().map(|(at, _)| *at);
        at.chain([self.until])
    }
}

/// The number from which on second halves of goals for two rovers are counted.
const SECOND_HALVES: u32 = 1 << 31;

/// The name of a goal of one's own: that of the observation, if it is one of a rock, so that it is the same goal
/// as the prioritiser's. Of a goal for two rovers, the name of its first half.
pub(super) fn key_of(number: usize, goal: &GoalConfig) -> GoalKey {
    match goal.rock {
        Some(rock) if goal.rovers == 1 => GoalKey::Observation(GoalId {
            target: Target::Rock(rock),
            observation: goal.observation,
        }),
        _ => GoalKey::Numbered(number as u32),
    }
}

/// The names of a goal of one's own: one, or one for each half.
fn keys_of(number: usize, goal: &GoalConfig) -> Vec<GoalKey> {
    let first = key_of(number, goal);
    let second = GoalKey::Numbered(SECOND_HALVES + number as u32);
    match goal.rovers {
        1 => vec![first],
        _ => vec![first, second],
    }
}

impl OwnWishes {
    /// What entries say that have been checked; `place_m` is where a rock lies.
    pub(super) fn new(
        goals: &[GoalConfig],
        combinations: &[CombinationConfig],
        place_m: impl Fn(u32) -> Option<[f64; 2]>,
    ) -> OwnWishes {
        let keys: Vec<Vec<GoalKey>> = (0..)
            .zip(goals)
            .map(|(at, goal)| keys_of(at, goal))
            .collect();
        let named = |name: &String| {
            let at = goals.iter().position(|goal| goal.name == *name);
            at.map_or(&[][..], |at| keys[at].as_slice())
        };
        let all = |names: &[String]| {
            let mut all: Vec<GoalKey> = names.iter().flat_map(named).copied().collect();
            all.sort_unstable();
            all
        };
        let at = |time: Option<SimDuration>, else_at: SimTime| {
            time.map_or(else_at, |time| SimTime::ZERO + time)
        };
        let halves = goals.iter().zip(&keys);
        let halves = halves.flat_map(|(goal, keys)| keys.iter().map(move |key| (goal, keys, *key)));
        let listed = halves.map(|(goal, keys, key)| {
            let window = (goal.opens.is_some() || goal.closes.is_some()).then(|| Window {
                opens: at(goal.opens, SimTime::ZERO),
                closes: at(goal.closes, SimTime::MAX),
            });
            let place_m = goal.rock.and_then(&place_m);
            let listed = ListedGoal {
                key,
                observation: goal.observation,
                rock: goal.rock,
                position_m: place_m.unwrap_or([goal.east_m, goal.north_m]),
                weight: goal.weight,
                mandatory: goal.mandatory,
                window,
                requires: all(&goal.requires),
                partner: keys.iter().find(|other| **other != key).copied(),
            };
            match keys.len() {
                1 => {
                    let first = (goal.added, goal.weight);
                    Timed::new(listed, first, &goal.changes, goal.withdrawn)
                }
                // Both together are worth what the goal is.
                _ => Timed::new(listed, (goal.added, 0.0), &[], goal.withdrawn),
            }
        });
        let pairs = goals.iter().zip(&keys).filter(|(_, keys)| keys.len() == 2);
        let pairs = pairs.map(|(goal, keys)| {
            let listed = ListedCombination {
                goals: keys.clone(),
                weight: goal.weight,
            };
            let first = (goal.added, goal.weight);
            Timed::new(listed, first, &goal.changes, goal.withdrawn)
        });
        let combinations = combinations.iter().map(|one| {
            let listed = ListedCombination {
                goals: all(&one.goals),
                weight: one.weight,
            };
            let first = (one.added, one.weight);
            Timed::new(listed, first, &one.changes, one.withdrawn)
        });
        OwnWishes {
            goals: listed.collect(),
            combinations: pairs.chain(combinations).collect(),
        }
    }

    /// The goals that are wished for at an instant.
    pub(super) fn goals(&self, now: SimTime) -> impl Iterator<Item = ListedGoal> {
        self.goals.iter().filter_map(move |timed| {
            let weight = timed.weight(now)?;
            Some(ListedGoal {
                weight,
                ..timed.what.clone()
            })
        })
    }

    /// The combinations that count at an instant.
    pub(super) fn combinations(&self, now: SimTime) -> impl Iterator<Item = ListedCombination> {
        self.combinations.iter().filter_map(move |timed| {
            let weight = timed.weight(now)?;
            Some(ListedCombination {
                weight,
                ..timed.what.clone()
            })
        })
    }

    /// When something changes next after an instant; none if never.
    pub(super) fn next_change(&self, now: SimTime) -> Option<SimTime> {
        let goals = self.goals.iter().flat_map(Timed::instants);
        let combinations = self.combinations.iter().flat_map(Timed::instants);
        let all = goals.chain(combinations);
        all.filter(|at| *at > now && *at < SimTime::MAX).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR: SimDuration = SimDuration::from_secs(3600);

    fn goal(name: &str, rock: u32) -> GoalConfig {
        GoalConfig {
            name: name.to_owned(),
            rock: Some(rock),
            ..GoalConfig::default()
        }
    }

    #[test]
    fn both_halves_of_a_goal_for_two_rovers_are_worth_what_it_is() {
        let joint = GoalConfig {
            rovers: 2,
            weight: 7.0,
            changes: vec![ChangeConfig {
                at: HOUR,
                weight: 9.0,
            }],
            ..goal("joint", 4)
        };
        let wishes = OwnWishes::new(&[goal("one", 1), joint], &[], |_| Some([0.0; 2]));
        let goals: Vec<ListedGoal> = wishes.goals(SimTime::ZERO).collect();
        assert_eq!(goals.len(), 3);
        assert_eq!(goals[1].partner, Some(goals[2].key));
        assert_eq!(goals[2].partner, Some(goals[1].key));
        assert_eq!([goals[1].weight, goals[2].weight], [0.0; 2]);
        let worth = |now| {
            let mut combinations = wishes.combinations(now);
            combinations.next().map(|one| one.weight)
        };
        assert_eq!(worth(SimTime::ZERO), Some(7.0));
        assert_eq!(worth(SimTime::ZERO + HOUR), Some(9.0));
    }

    #[test]
    fn goals_come_change_and_go_at_their_times() {
        let one = GoalConfig {
            added: HOUR,
            changes: vec![ChangeConfig {
                at: HOUR * 3,
                weight: -4.0,
            }],
            withdrawn: Some(HOUR * 5),
            ..goal("one", 7)
        };
        let pair = CombinationConfig {
            goals: vec!["two".to_owned(), "one".to_owned()],
            weight: -30.0,
            ..CombinationConfig::default()
        };
        let place_m = |rock| Some([f64::from(rock), 0.0]);
        let wishes = OwnWishes::new(&[one, goal("two", 3)], &[pair], place_m);
        let weights = |hours: u64| {
            let goals = wishes.goals(SimTime::ZERO + HOUR * hours);
            goals.map(|goal| goal.weight).collect::<Vec<f64>>()
        };
        assert_eq!(weights(0), [1.0]);
        assert_eq!(weights(1), [1.0, 1.0]);
        assert_eq!(weights(3), [-4.0, 1.0]);
        assert_eq!(weights(5), [1.0]);
        let changes = std::iter::successors(Some(SimTime::ZERO), |now| wishes.next_change(*now));
        let hours: Vec<u64> = changes.map(|at| at.as_nanos() / HOUR.as_nanos()).collect();
        assert_eq!(hours, [0, 1, 3, 5]);
        let pair = wishes.combinations(SimTime::ZERO).next().unwrap();
        assert_eq!(pair.weight, -30.0);
        assert!(pair.goals[0] < pair.goals[1]);
        assert_eq!(
            wishes.goals(SimTime::ZERO).next().unwrap().position_m,
            [3.0, 0.0]
        );
    }
}
