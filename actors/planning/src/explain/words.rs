//! An explanation in plain sentences.

use std::fmt;

use super::{Explanation, Outcome, Part, Reason, Smallest, ToldGoal, ToldToken};

/// How many parts of a reason are shown: the data has all.
const MOST_PARTS: usize = 20;

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let operations = self.operations;
        match (self.outcome, self.proven) {
            (Outcome::Facts, _) => writeln!(
                f,
                "What is the case cannot be, whatever is wanted: no goal need be dropped for that."
            )?,
            (Outcome::FactsUndecided, _) => writeln!(
                f,
                "No plan was found even without goals, within {operations} operations. That there \
                 is none is not proven."
            )?,
            (Outcome::Possible, _) => {
                writeln!(f, "There is a plan: the explanation came upon one.")?;
            }
            (Outcome::Goals, true) => writeln!(f, "{}: that is proven.", self.what("There is no"))?,
            (Outcome::Goals, false) => writeln!(
                f,
                "{}. That there is none is not proven.",
                self.what("No plan was found, within the budget:")
            )?,
        }
        if !self.together.is_empty() {
            let names = list(&self.together);
            match self.together.len() {
                1 => writeln!(f, "This goal cannot be, whatever the others are: {names}.")?,
                _ => writeln!(f, "These goals cannot all be: {names}.")?,
            }
        }
        if !self.reasons.is_empty() {
            match (&self.added, self.only_way) {
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
        }
        for reason in &self.reasons {
            write!(f, "{reason}")?;
        }
        if !self.to_drop.is_empty() {
            let names = list(&self.to_drop);
            let with = match &self.goal {
                Some(goal) => format!(" with {}", goal.name),
                None => String::new(),
            };
            write!(f, "Without {names} there is a plan{with}. ")?;
            let known = match (self.smallest, self.to_drop.len()) {
                (Some(Smallest::Proven), _) => "No smaller set of goals will do: that is proven.",
                (Some(Smallest::Irreducible), _) => {
                    "With any one of them back there is none: that is proven. Another set may be \
                     smaller."
                }
                (_, 1) => "Whether it must be dropped is not proven.",
                _ => "Whether fewer will do is not known.",
            };
            writeln!(f, "{known}")?;
        } else if self.outcome == Outcome::Goals {
            writeln!(
                f,
                "Which goals to drop was not found within {operations} operations."
            )?;
        }
        Ok(())
    }
}

impl Explanation {
    fn what(&self, begins: &str) -> String {
        let plan = if begins.ends_with("no") { " plan" } else { "" };
        match &self.goal {
            Some(goal) => format!("{begins}{plan} with {goal} and what the plan achieves"),
            None => match plan.is_empty() {
                true => format!("{begins} none with all mandatory goals"),
                false => format!("{begins}{plan} with all mandatory goals"),
            },
        }
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
