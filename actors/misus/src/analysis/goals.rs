//! What there is to observe, what each observation is worth, and which are worth more together.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// What a rover can be asked to do.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Observation {
    /// An image of all rocks round a place: their textures, from afar.
    PanoramicImage,
    /// Spectra of all rocks round a place, from afar.
    PanoramicSpectrum,
    /// An image of one rock, at the rock.
    PointImage,
    /// A spectrum of one rock, at the rock.
    #[default]
    PointSpectrum,
}

/// What is observed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Target {
    /// A rock, by its number in the team's catalogue.
    Rock(u32),
    /// A square of the ground, by its column and row.
    Square(i32, i32),
}

/// The name of a goal: what is done, and to what. The same wish has the same name whenever and by
/// whomever it is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct GoalId {
    /// What it is done to.
    pub target: Target,
    /// What is to be done.
    pub observation: Observation,
}

/// A wish for an observation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Goal {
    /// Its name.
    pub id: GoalId,
    /// Where the target is thought to be, east and north \[m\].
    pub position_m: [f64; 2],
    /// What the observation is worth by itself, over 0.
    pub weight: f64,
}

/// Goals that are worth more when all of them are achieved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Combination {
    /// Two goals or more, in ascending order. They name the combination.
    pub goals: Vec<GoalId>,
    /// Over 0. When all goals are achieved, this times the sum of their weights is added to what
    /// they are worth by themselves (the paper's Equation 1 and Table 2).
    pub factor: f64,
}

/// All that is wished for at a time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wishes {
    /// By name.
    pub goals: BTreeMap<GoalId, Goal>,
    /// The factors of combinations, by their goals. All goals are among `goals`.
    pub combinations: BTreeMap<Vec<GoalId>, f64>,
}

/// What has become different in what is wished for.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Revision {
    /// Goals that were not there, in the order of their names.
    pub added: Vec<Goal>,
    /// Goals whose weight or position has changed.
    pub changed: Vec<Goal>,
    /// Goals that are no longer wished for.
    pub withdrawn: Vec<GoalId>,
    /// Combinations that were not there, or have another factor.
    pub combined: Vec<Combination>,
    /// Combinations that are no longer.
    pub separated: Vec<Vec<GoalId>>,
}

impl Wishes {
    /// What turns these wishes into others. A goal whose weight differs by less than `least_change` of
    /// itself, and whose target is where it was to a tenth of a metre, counts as unchanged, so that not
    /// every reading revises every goal.
    pub fn revision_to(&self, other: &Wishes, least_change: f64) -> Revision {
        let mut revision = Revision::default();
        for (id, goal) in &other.goals {
            match self.goals.get(id) {
                None => revision.added.push(*goal),
                Some(known) if differs(known, goal, least_change) => revision.changed.push(*goal),
                Some(_) => {}
            }
        }
        let gone = self.goals.keys().filter(|id| !other.goals.contains_key(id));
        revision.withdrawn.extend(gone);
        for (goals, &factor) in &other.combinations {
            if self.combinations.get(goals) != Some(&factor) {
                let goals = goals.clone();
                revision.combined.push(Combination { goals, factor });
            }
        }
        let combined = self.combinations.keys();
        let gone = combined.filter(|goals| !other.combinations.contains_key(*goals));
        revision.separated.extend(gone.cloned());
        revision
    }

    /// Carries out a revision.
    pub fn apply(&mut self, revision: &Revision) {
        for id in &revision.withdrawn {
            self.goals.remove(id);
        }
        for goal in revision.added.iter().chain(&revision.changed) {
            self.goals.insert(goal.id, *goal);
        }
        for goals in &revision.separated {
            self.combinations.remove(goals);
        }
        for Combination { goals, factor } in &revision.combined {
            self.combinations.insert(goals.clone(), *factor);
        }
    }

    /// What is gained by achieving exactly these goals: the paper's Equation 1.
    ///
    /// ```
    /// use farside_misus::analysis::goals::{Goal, GoalId, Observation, Target, Wishes};
    /// let mut wishes = Wishes::default();
    /// let ids = [Observation::PointImage, Observation::PointSpectrum]
    ///     .map(|observation| GoalId { target: Target::Rock(4), observation });
    /// for id in ids {
    ///     wishes.goals.insert(id, Goal { id, position_m: [3.0, 4.0], weight: 2.0 });
    /// }
    /// wishes.combinations.insert(ids.to_vec(), 1.25);
    /// assert_eq!(wishes.value(&ids[..1]), 2.0);
    /// assert_eq!(wishes.value(&ids), 2.0 + 2.0 + 1.25 * 4.0);
    /// ```
    pub fn value(&self, achieved: &[GoalId]) -> f64 {
        let weight = |id: &GoalId| self.goals.get(id).map_or(0.0, |goal| goal.weight);
        let single: f64 = achieved.iter().map(weight).sum();
        let whole = |goals: &&Vec<GoalId>| goals.iter().all(|goal| achieved.contains(goal));
        let combined = self.combinations.iter().filter(|(goals, _)| whole(goals));
        let extra = combined.map(|(goals, factor)| factor * goals.iter().map(weight).sum::<f64>());
        single + extra.sum::<f64>()
    }
}

fn differs(known: &Goal, goal: &Goal, least_change: f64) -> bool {
    let moved = known.position_m.iter().zip(&goal.position_m);
    let moved = moved.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    (goal.weight - known.weight).abs() > least_change * known.weight || moved > 0.1
}

impl Revision {
    /// Whether nothing has become different.
    pub fn is_empty(&self) -> bool {
        self == &Revision::default()
    }
}
