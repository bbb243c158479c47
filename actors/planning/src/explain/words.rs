//! An explanation in plain sentences.

use std::fmt;

use super::{Explanation, Outcome, Part, Reason, Smallest, ToldGoal, ToldToken};

/// How many parts of a reason are shown: the data has all.
const MOST_PARTS: usize = 20;

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.outcome(f)?;
        match self.together.as_slice() {
            [] => {}
            [one] => writeln!(f, "This goal cannot be, whatever the others are: {one}.")?,
            all => writeln!(f, "These goals cannot all be: {}.", list(all))?,
        }
        match (&self.added, self.only_way) {
            _ if self.reasons.is_empty() => {}
            (Some(added), _) => writeln!(
                f,
                "When {} was to be added to a plan with the others, the way that got furthest \
                 ended here:",
                added.name
            )?,
            (None, true) => writeln!(f, "Why:")?,
            (None, false) => {
                writeln!(f, "Of several ways, the one that got furthest ended here:")?;
            }
        }
        for reason in &self.reasons {
            write!(f, "{reason}")?;
        }
        self.what_to_drop(f)
    }
}

impl Explanation {
    fn outcome(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let operations = self.operations;
        let with = match &self.goal {
            Some(goal) => format!("{goal} and all that the plan achieves"),
            None => "all mandatory goals".to_owned(),
        };
        match (self.outcome, self.proven) {
            (Outcome::Facts, true) => writeln!(
                f,
                "What is the case cannot be, whatever is wanted: to drop goals does not help."
            ),
            (Outcome::Facts, false) => writeln!(
                f,
                "What is the case cannot be in the order in which it may begin; that another order \
                 is none either is not proven."
            ),
            (Outcome::FactsUndecided, _) => writeln!(
                f,
                "No plan was found even without goals, within {operations} operations; that there \
                 is none is not proven."
            ),
            (Outcome::Possible, _) => {
                writeln!(f, "There is a plan: the explanation came upon one.")
            }
            (Outcome::Goals, true) => {
                writeln!(f, "There is no plan with {with}: that is proven.")
            }
            (Outcome::Goals, false) => writeln!(
                f,
                "No plan with {with} was found; that there is none is not proven."
            ),
        }
    }

    fn what_to_drop(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let is_alone = self.goal.is_some() && self.together.len() == 1;
        if self.to_drop.is_empty() {
            return match self.outcome {
                Outcome::Goals if is_alone => writeln!(f, "To drop other goals does not help."),
                Outcome::Goals => writeln!(
                    f,
                    "Which goals to drop was not found within {} operations.",
                    self.operations
                ),
                _ => Ok(()),
            };
        }
        let with = match &self.goal {
            Some(goal) => format!(" with {}", goal.name),
            None => String::new(),
        };
        let names = list(&self.to_drop);
        let known = match (self.smallest, self.to_drop.len()) {
            (Some(Smallest::Proven), _) => "No smaller set of goals will do: that is proven.",
            (Some(Smallest::Irreducible), _) => {
                "With any one of them back there is none: that is proven. Another set may be \
                 smaller."
            }
            (_, 1) => "Whether it must be dropped is not proven.",
            _ => "Whether fewer will do is not known.",
        };
        writeln!(f, "Without {names} there is a plan{with}. {known}")
    }
}

fn list(goals: &[ToldGoal]) -> String {
    let names: Vec<String> = goals.iter().map(ToldGoal::to_string).collect();
    names.join(", ")
}

impl fmt::Display for ToldGoal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)?;
        match (self.place.is_empty(), self.mandatory) {
            (true, _) => Ok(()),
            (false, true) => write!(f, " ({})", self.place),
            (false, false) => write!(f, " ({}, optional)", self.place),
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "  {}", self.message)?;
        if !self.place.is_empty() {
            write!(f, " ({})", self.place)?;
        }
        let end = if self.parts.is_empty() { "" } else { ":" };
        writeln!(f, "{end}")?;
        for part in self.parts.iter().take(MOST_PARTS) {
            writeln!(f, "  - {part}")?;
        }
        if let Some(more) = self.parts.len().checked_sub(MOST_PARTS + 1) {
            writeln!(f, "  - and {} more", more + 1)?;
        }
        Ok(())
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)?;
        match self.place.is_empty() {
            true => Ok(()),
            false => write!(f, " ({})", self.place),
        }
    }
}

impl fmt::Display for ToldToken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let values = self.arguments.iter().map(|(_, value)| value.to_string());
        let values: Vec<String> = values.collect();
        f.write_str(&self.predicate)?;
        match values.is_empty() {
            true => Ok(()),
            false => write!(f, "({})", values.join(", ")),
        }
    }
}
