//! What becomes of goals, as agents record it: pictures and viewers show it.

use crate::assemble::GoalPlace;
use crate::records::GoalEnded;

/// What has become of a goal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum GoalOutcome {
    /// Nothing yet.
    #[default]
    Open,
    /// The system agent has done it.
    Done,
    /// The system agent has tried it in vain.
    Failed,
    /// Nobody tries it any more.
    GivenUp,
    /// The ground has taken it back.
    TakenBack,
}

impl GoalOutcome {
    /// In words.
    pub(crate) fn name(self) -> &'static str {
        match self {
            GoalOutcome::Open => "open",
            GoalOutcome::Done => "done",
            GoalOutcome::Failed => "failed",
            GoalOutcome::GivenUp => "given up",
            GoalOutcome::TakenBack => "taken back",
        }
    }
}

/// The goals of a rover, and what has become of them.
#[derive(Clone, Debug)]
pub(crate) struct GoalBook {
    goals: Vec<GoalPlace>,
    outcomes: Vec<GoalOutcome>,
}

impl GoalBook {
    /// Goals of which nothing has become yet.
    pub(crate) fn new(goals: Vec<GoalPlace>) -> GoalBook {
        GoalBook {
            outcomes: vec![GoalOutcome::Open; goals.len()],
            goals,
        }
    }

    /// The goals.
    pub(crate) fn goals(&self) -> &[GoalPlace] {
        &self.goals
    }

    /// By goal: what has become of it.
    pub(crate) fn outcomes(&self) -> &[GoalOutcome] {
        &self.outcomes
    }

    /// What others had asked an agent for has ended; returns the place of the goal that it settles or
    /// fails. Several goals may have the same words: the first that is not settled is meant.
    pub(crate) fn ended(&mut self, ended: &GoalEnded, by_system: bool) -> Option<usize> {
        if let Some(number) = recalled(&ended.goal) {
            return self.settle(number, GoalOutcome::TakenBack);
        }
        if !by_system {
            return None;
        }
        let is_it = |&at: &usize| {
            let is_settled = matches!(
                self.outcomes[at],
                GoalOutcome::Done | GoalOutcome::GivenUp | GoalOutcome::TakenBack
            );
            !is_settled && self.goals[at].words == ended.goal
        };
        let at = (0..self.goals.len()).find(is_it)?;
        self.outcomes[at] = match ended.outputs.first().map(String::as_str) {
            Some("ok") => GoalOutcome::Done,
            // Another goal or a recovery took its place: it is still wanted.
            Some("PREEMPTED") => return None,
            _ => GoalOutcome::Failed,
        };
        Some(at)
    }

    /// A goal is given up; returns its place.
    pub(crate) fn given_up(&mut self, number: i64) -> Option<usize> {
        self.settle(number, GoalOutcome::GivenUp)
    }

    fn settle(&mut self, number: i64, outcome: GoalOutcome) -> Option<usize> {
        let at = self.goals.iter().position(|goal| goal.number == number)?;
        if self.outcomes[at] == GoalOutcome::Done {
            return None;
        }
        self.outcomes[at] = outcome;
        Some(at)
    }
}

/// The number of the goal that is taken back by `Recall(3 ...)`.
fn recalled(words: &str) -> Option<i64> {
    let inputs = words.strip_prefix("Recall(")?;
    inputs.split([' ', ')']).next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn book() -> GoalBook {
        let goal = |(number, words): (i64, &str)| GoalPlace {
            number,
            name: format!("goal {number}"),
            place_m: [0.0, 0.0],
            words: words.to_owned(),
        };
        let words = ["ImageAt(1 2)", "ImageAt(3 4)", "ImageAt(1 2)"];
        GoalBook::new((1..).zip(words).map(goal).collect())
    }

    fn ended(goal: &str, status: &str) -> GoalEnded {
        GoalEnded {
            register: "mission>system".to_owned(),
            goal: goal.to_owned(),
            outputs: vec![status.to_owned()],
        }
    }

    #[test]
    fn goals_of_the_same_words_are_done_one_after_the_other() {
        let mut book = book();
        let image = |status| ended("ImageAt(1 2)", status);
        assert_eq!(book.ended(&image("ok"), false), None);
        assert_eq!(book.ended(&image("failed"), true), Some(0));
        assert_eq!(book.outcomes()[0], GoalOutcome::Failed);
        assert_eq!(book.ended(&image("PREEMPTED"), true), None);
        assert_eq!(book.ended(&image("ok"), true), Some(0));
        assert_eq!(book.ended(&image("ok"), true), Some(2));
        assert_eq!(book.ended(&image("ok"), true), None);
        assert_eq!(
            book.outcomes(),
            [GoalOutcome::Done, GoalOutcome::Open, GoalOutcome::Done]
        );
    }

    #[test]
    fn what_is_done_stays_done() {
        let mut book = book();
        book.ended(&ended("ImageAt(3 4)", "ok"), true);
        assert_eq!(book.given_up(2), None);
        assert_eq!(book.ended(&ended("Recall(2 3 4)", "accepted"), false), None);
        assert_eq!(book.outcomes()[1], GoalOutcome::Done);
        assert_eq!(
            book.ended(&ended("Recall(3 1 2)", "accepted"), false),
            Some(2)
        );
        assert_eq!(book.outcomes()[2], GoalOutcome::TakenBack);
        assert_eq!(book.given_up(1), Some(0));
        assert_eq!(book.given_up(9), None);
    }
}
