//! What a team's plan is worth to a planner: Equation 1 over its own goals and those it last heard others
//! hold. The sum itself is [`farside_planning::objective`]'s.

use farside_planning::objective::Objective;

use super::instance::Instance;

/// Which goals are held, by whom, as one planner knows it.
///
/// A goal counts once, however many hold it; one that needs two rovers counts when two hold it.
///
/// ```
/// use farside_misus::planner::instance::Instance;
/// use farside_misus::planner::problem::{ProblemConfig, generate};
/// use farside_misus::planner::score::Score;
/// let problem = generate(&ProblemConfig::default(), 1)?;
/// let mut score = Score::new(&Instance::new(&problem)?);
/// score.hold(0);
/// assert_eq!(score.value(), problem.goals[0].weight);
/// score.hear(2, &[0, 3]);
/// assert_eq!(score.value(), problem.goals[0].weight + problem.goals[3].weight);
/// score.release(0);
/// score.hear(2, &[]);
/// assert_eq!((score.value(), score.gain(0)), (0.0, problem.goals[0].weight));
/// # Ok::<(), farside_misus::planner::problem::ProblemError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Score {
    objective: Objective,
    /// By goal: how many hold it, and how many have to.
    holders: Vec<u32>,
    needs: Vec<u32>,
    own: Vec<bool>,
    /// By rover: what it was last heard to hold.
    heard: Vec<Vec<usize>>,
}

impl Score {
    /// Nobody holds anything.
    pub fn new(instance: &Instance) -> Score {
        let combinations = instance.combinations().iter();
        let combinations = combinations.map(|(goals, weight)| (goals.as_slice(), *weight));
        let goals = instance.goals();
        Score {
            objective: Objective::of(instance.weights().to_vec(), combinations),
            holders: vec![0; goals],
            needs: (0..goals).map(|goal| instance.task(goal).rovers).collect(),
            own: vec![false; goals],
            heard: vec![Vec::new(); instance.vehicles().len()],
        }
    }

    /// The planner's own plan has a goal now.
    pub fn hold(&mut self, goal: usize) {
        if !std::mem::replace(&mut self.own[goal], true) {
            self.holders[goal] += 1;
            self.enter(goal);
        }
    }

    /// The planner's own plan has a goal no more.
    pub fn release(&mut self, goal: usize) {
        if std::mem::replace(&mut self.own[goal], false) {
            self.holders[goal] -= 1;
            self.enter(goal);
        }
    }

    /// Whether the planner's own plan has a goal.
    pub fn holds(&self, goal: usize) -> bool {
        self.own[goal]
    }

    /// Another rover holds these goals now, and no others. A goal counts once if it is named twice.
    pub fn hear(&mut self, rover: usize, goals: &[usize]) {
        let mut now = goals.to_vec();
        now.sort_unstable();
        now.dedup();
        let before = std::mem::replace(&mut self.heard[rover], now);
        for &goal in &before {
            self.holders[goal] -= 1;
        }
        for at in 0..self.heard[rover].len() {
            let goal = self.heard[rover][at];
            self.holders[goal] += 1;
            self.enter(goal);
        }
        for goal in before {
            self.enter(goal);
        }
    }

    fn enter(&mut self, goal: usize) {
        let achieved = self.holders[goal] >= self.needs[goal];
        self.objective.set(goal, achieved);
    }

    /// What would be gained by holding a goal that the planner does not hold: nothing if others do
    /// already, or if too few hold it even then.
    pub fn gain(&self, goal: usize) -> f64 {
        match self.objective.has(goal) || self.holders[goal] + 1 < self.needs[goal] {
            true => 0.0,
            false => self.objective.gain(goal),
        }
    }

    /// As [`Objective::promise`], of a goal that the planner does not hold.
    pub fn promise(&self, goal: usize) -> f64 {
        match self.objective.has(goal) || self.holders[goal] + 1 < self.needs[goal] {
            true => 0.0,
            false => self.objective.promise(goal),
        }
    }

    /// What the goals that are held are worth.
    pub fn value(&self) -> f64 {
        self.objective.score()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::planner::problem::{Combination, ProblemConfig, generate};

    proptest! {
        /// After any changes the value is Equation 1 over what is held, and a gain is a change of it.
        #[test]
        fn a_score_is_equation_1_over_own_and_heard(
            changes in prop::collection::vec((0..3usize, prop::collection::vec(0..9usize, 0..4)), 1..30),
        ) {
            let config = ProblemConfig {
                rocks_least: 3,
                rocks_most: 3,
                joint_share: 0.5,
                combination_dropped: 0.2,
                ..ProblemConfig::default()
            };
            let mut problem = generate(&config, 5).unwrap();
            problem.combinations.push(Combination {
                goals: ["rock_01_a", "rock_02_a", "rock_03_a"].map(str::to_owned).to_vec(),
                weight: -30.0,
            });
            let instance = Instance::new(&problem).unwrap();
            let mut score = Score::new(&instance);
            let mut held = [const { Vec::new() }; 3];
            let value = |held: &[Vec<usize>; 3]| {
                let name = |goal: usize| &problem.goals[goal].name;
                let achieved = |goal: usize| {
                    let holders = held.iter().filter(|goals| goals.contains(&goal)).count();
                    holders >= problem.goals[goal].rovers as usize
                };
                let single = (0..9).filter(|goal| achieved(*goal)).map(|goal| problem.goals[goal].weight);
                let whole = problem.combinations.iter().filter(|combination| {
                    (0..9).all(|goal| !combination.goals.contains(name(goal)) || achieved(goal))
                });
                single.sum::<f64>() + whole.map(|at| at.weight).sum::<f64>()
            };
            for (rover, goals) in changes {
                if rover == 0 {
                    for goal in 0..9 {
                        if goals.contains(&goal) { score.hold(goal) } else { score.release(goal) }
                    }
                } else {
                    score.hear(rover, &goals);
                }
                held[rover] = goals;
                prop_assert!((score.value() - value(&held)).abs() < 1e-9);
                for goal in (0..9).filter(|goal| !held[0].contains(goal)) {
                    let mut more = held.clone();
                    more[0].push(goal);
                    prop_assert!((score.gain(goal) - (value(&more) - value(&held))).abs() < 1e-9);
                }
            }
        }
    }
}
