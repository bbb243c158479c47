//! What a plan is worth: Equation 1 of the MISUS paper, evaluated goal by goal.

use crate::model::{GoalId, Problem};

/// The goals that a plan achieves, and what they are worth: the sum of their weights and of those
/// of all combinations whose goals are all achieved (section 4.1, Equation 1).
///
/// A change of one goal looks at its combinations only. Sums are always taken in the order of the
/// problem, so that the same goals are worth the same to the last bit, whichever came first.
///
/// ```
/// use farside_planning::model::{Combination, Goal, Problem, Position};
/// use farside_planning::objective::Objective;
/// # use farside_planning::model::Pattern;
/// # use farside_planning::temporal::Span;
/// # let goal = |name: &str, weight| Goal {
/// #     name: name.to_string(), position: Position::default(), variables: vec![],
/// #     pattern: Pattern { position: Position::default(), timelines: vec![], object: None,
/// #         predicate: 0, arguments: vec![] },
/// #     start: Span::ALL, finish: Span::ALL, duration: Span::ALL, weight: Some(weight),
/// # };
/// let mut problem = Problem { goals: vec![goal("image", 12.0), goal("spectrum", 5.0)], ..Problem::default() };
/// problem.combinations.push(Combination {
///     name: "both".to_string(),
///     position: Position::default(),
///     goals: vec![0, 1],
///     weight: 10.0,
/// });
/// let mut objective = Objective::new(&problem);
/// assert_eq!(objective.gain(0), 12.0);
/// objective.set(0, true);
/// assert_eq!((objective.gain(1), objective.score()), (15.0, 12.0));
/// ```
#[derive(Clone, Debug)]
pub struct Objective {
    weights: Vec<f64>,
    achieved: Vec<bool>,
    combinations: Vec<Together>,
    /// By goal: its combinations.
    of_goal: Vec<Vec<u32>>,
}

/// A combination, and how many of its goals are missing.
#[derive(Clone, Debug)]
struct Together {
    weight: f64,
    missing: u32,
}

impl Objective {
    /// With no goal achieved. Mandatory goals are worth nothing of themselves; a goal that a
    /// combination names twice counts once.
    pub fn new(problem: &Problem) -> Self {
        let weights = problem.goals.iter().map(|goal| goal.weight.unwrap_or(0.0));
        let combinations = problem.combinations.iter();
        Objective::of(
            weights.collect(),
            combinations.map(|combination| (combination.goals.as_slice(), combination.weight)),
        )
    }

    /// With no goal achieved, of goals with these weights and of combinations of them, each with its
    /// own weight: for whoever has no [`Problem`]. A goal that a combination names twice counts once.
    ///
    /// ```
    /// use farside_planning::objective::Objective;
    /// let mut objective = Objective::of(vec![12.0, 5.0], [([0, 1].as_slice(), -30.0)]);
    /// objective.set(0, true);
    /// assert_eq!(objective.gain(1), -25.0);
    /// ```
    ///
    /// # Panics
    /// When a combination names a goal that has no weight: a bug in the caller.
    pub fn of<'a>(
        weights: Vec<f64>,
        combinations: impl IntoIterator<Item = (&'a [GoalId], f64)>,
    ) -> Self {
        let mut of_goal = vec![Vec::new(); weights.len()];
        let mut together = Vec::new();
        for (place, (goals, weight)) in (0..).zip(combinations) {
            let mut missing = 0;
            for &goal in goals {
                let of_goal: &mut Vec<u32> = &mut of_goal[goal];
                if of_goal.last() != Some(&place) {
                    of_goal.push(place);
                    missing += 1;
                }
            }
            together.push(Together { weight, missing });
        }
        Objective {
            achieved: vec![false; weights.len()],
            weights,
            combinations: together,
            of_goal,
        }
    }

    /// Whether a goal is achieved.
    pub fn has(&self, goal: GoalId) -> bool {
        self.achieved[goal]
    }

    /// Says whether a goal is achieved.
    pub fn set(&mut self, goal: GoalId, achieved: bool) {
        if std::mem::replace(&mut self.achieved[goal], achieved) == achieved {
            return;
        }
        for &combination in &self.of_goal[goal] {
            let missing = &mut self.combinations[combination as usize].missing;
            *missing = if achieved { *missing - 1 } else { *missing + 1 };
        }
    }

    /// What the plan would be worth more with a goal that it does not achieve, or is worth more by
    /// one that it does; less than nothing if the goal spoils more than it brings.
    pub fn gain(&self, goal: GoalId) -> f64 {
        let last = u32::from(!self.achieved[goal]);
        let mut gain = self.weights[goal];
        for &combination in &self.of_goal[goal] {
            let combination = &self.combinations[combination as usize];
            if combination.missing == last {
                gain += combination.weight;
            }
        }
        gain
    }

    /// What a goal that is not achieved would bring nearer without completing it: of each combination
    /// that lacks other goals too, and is worth more than nothing, the weight over how many it lacks.
    pub fn promise(&self, goal: GoalId) -> f64 {
        let mut promise = 0.0;
        for &combination in &self.of_goal[goal] {
            let combination = &self.combinations[combination as usize];
            if combination.missing > 1 && combination.weight > 0.0 {
                promise += combination.weight / f64::from(combination.missing);
            }
        }
        promise
    }

    /// What the plan is worth.
    pub fn score(&self) -> f64 {
        let mut score = 0.0;
        for (weight, _) in self.weights.iter().zip(&self.achieved).filter(|at| *at.1) {
            score += weight;
        }
        for combination in self.combinations.iter().filter(|at| at.missing == 0) {
            score += combination.weight;
        }
        score
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::model::{Combination, Goal, Pattern, Position};
    use crate::temporal::Span;

    fn problem(weights: &[i32], combinations: &[(Vec<usize>, i32)]) -> Problem {
        let pattern = Pattern {
            position: Position::default(),
            timelines: Vec::new(),
            object: None,
            predicate: 0,
            arguments: Vec::new(),
        };
        let goal = |weight: &i32| Goal {
            name: String::new(),
            position: Position::default(),
            pattern: pattern.clone(),
            variables: Vec::new(),
            start: Span::ALL,
            finish: Span::ALL,
            duration: Span::ALL,
            weight: Some(f64::from(*weight) / 8.0),
        };
        let combination = |(goals, weight): &(Vec<usize>, i32)| Combination {
            name: String::new(),
            position: Position::default(),
            goals: goals.clone(),
            weight: f64::from(*weight) / 8.0,
        };
        Problem {
            goals: weights.iter().map(goal).collect(),
            combinations: combinations.iter().map(combination).collect(),
            ..Problem::default()
        }
    }

    proptest! {
        /// The score is Equation 1 after each change, and a gain is what the score changes by:
        /// weights are eighths, so that sums are exact.
        #[test]
        fn gains_are_changes_of_the_score(
            weights in prop::collection::vec(-80..80i32, 1..7),
            combinations in prop::collection::vec(
                (prop::collection::vec(0..7usize, 0..4), -80..80i32), 0..8),
            changes in prop::collection::vec((0..7usize, any::<bool>()), 0..30),
        ) {
            let n = weights.len();
            let within = |(goals, weight): (Vec<usize>, i32)| {
                (goals.into_iter().map(|goal| goal % n).collect::<Vec<_>>(), weight)
            };
            let combinations: Vec<_> = combinations.into_iter().map(within).collect();
            let mut objective = Objective::new(&problem(&weights, &combinations));
            let mut plan = vec![false; n];
            for (goal, achieved) in changes {
                let goal = goal % n;
                let (before, gain) = (objective.score(), objective.gain(goal));
                if achieved && !plan[goal] {
                    objective.set(goal, true);
                    prop_assert_eq!(objective.score() - before, gain);
                } else {
                    objective.set(goal, achieved);
                }
                plan[goal] = achieved;
                let singles = weights.iter().zip(&plan).filter(|at| *at.1).map(|at| *at.0);
                let whole = combinations
                    .iter()
                    .filter(|at| at.0.iter().all(|&goal| plan[goal]))
                    .map(|at| at.1);
                let sum: i32 = singles.sum::<i32>() + whole.sum::<i32>();
                prop_assert_eq!(objective.score(), f64::from(sum) / 8.0);
            }
        }
    }

    #[test]
    fn a_promise_is_a_part_of_what_is_not_complete_and_worth_something() {
        let combinations = [([0, 1].as_slice(), 6.0), (&[0, 1, 2], 9.0), (&[0, 2], -4.0)];
        let mut objective = Objective::of(vec![1.0; 3], combinations);
        assert_eq!(objective.promise(0), 3.0 + 3.0);
        objective.set(1, true);
        assert_eq!((objective.gain(0), objective.promise(0)), (7.0, 4.5));
        objective.set(2, true);
        assert_eq!((objective.gain(0), objective.promise(0)), (12.0, 0.0));
    }
}
