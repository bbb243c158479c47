//! Claims that one cell is more than another.

use crate::scenario::ScenarioError;

use super::super::results::{Cell, Comparison};
use super::{EXCEEDS, StudyParts};

/// The keys that say from where on, and by how much.
pub(super) const DETAILS: [&str; 4] = ["from_index", "by_at_least", "by_at_most", "equal_within"];

impl StudyParts<'_> {
    /// What a figure, which stands at `keys`, claims of its cells and others.
    pub(super) fn comparison(
        &self,
        keys: &[String],
        entry: &toml::Table,
        cells: &[usize],
    ) -> Result<Comparison, ScenarioError> {
        let at = |key: &str| [keys, &[key.to_owned()]].concat();
        let numbers = DETAILS.map(|key| match entry.get(key) {
            Some(value) => self.number(&at(key), value).map(Some),
            None => Ok(None),
        });
        let [from_index, by_at_least, by_at_most, equal_within] = numbers;
        let comparison = Comparison {
            others: self.others(&at(EXCEEDS), entry.get(EXCEEDS), cells)?,
            from_index: from_index?,
            by_at_least: by_at_least?,
            by_at_most: by_at_most?,
            equal_within: equal_within?,
        };
        self.check_bounds(&at, &comparison)?;
        Ok(comparison)
    }

    /// The cell that each of `cells` is compared with: the same but for some levels.
    fn others(
        &self,
        keys: &[String],
        levels: Option<&toml::Value>,
        cells: &[usize],
    ) -> Result<Vec<usize>, ScenarioError> {
        let names = self.names();
        let levels = levels.and_then(toml::Value::as_table);
        let Some(levels) = levels.filter(|levels| !levels.is_empty()) else {
            let first = names.first().copied().unwrap_or("factor");
            let message =
                format!("expected the levels of another cell, as in exceeds = {{ {first} = ... }}");
            return Err(self.blame.invalid_at(keys, message));
        };
        let mut wanted = Vec::new();
        for (name, value) in levels {
            let here = [keys, std::slice::from_ref(name)].concat();
            let factor = names.iter().position(|known| known == name);
            let factor = factor.ok_or_else(|| self.blame.unknown_at(&here, name, &names))?;
            wanted.push((factor, self.level(&here, factor, value)?));
        }
        let other_of = |here: &usize| {
            let own = &self.cells[*here];
            let is_other = |other: &Cell| {
                (0..names.len()).all(|factor| {
                    let (value, text) = (&other.values[factor], &other.texts[factor]);
                    match wanted.iter().find(|(varied, _)| *varied == factor) {
                        Some((_, level)) => level.is(value, text),
                        None => own.texts[factor] == *text,
                    }
                })
            };
            let texts = own.texts.join(", ");
            match self.cells.iter().position(is_other) {
                Some(other) if other == *here => {
                    let message = format!(
                        "cell {here} ({texts}) would be compared with itself: expected other \
                         levels beside exceeds than in it"
                    );
                    Err(self.blame.invalid_at(keys, message))
                }
                Some(other) => Ok(other),
                None => {
                    let message =
                        format!("no cell is as cell {here} ({texts}) is but for these levels");
                    Err(self.blame.invalid_at(keys, message))
                }
            }
        };
        cells.iter().map(other_of).collect()
    }

    /// Refuses bounds between which there is nothing.
    fn check_bounds(
        &self,
        at: &dyn Fn(&str) -> Vec<String>,
        claim: &Comparison,
    ) -> Result<(), ScenarioError> {
        let wrong = |key: &str, message: String| Err(self.blame.invalid_at(&at(key), message));
        if let Some(within) = claim.equal_within {
            if within <= 0.0 {
                return wrong("equal_within", format!("{within}: expected more than 0"));
            }
            let bounds = [
                ("by_at_least", claim.by_at_least),
                ("by_at_most", claim.by_at_most),
            ];
            if let Some((key, _)) = bounds.iter().find(|(_, bound)| bound.is_some()) {
                let message = "what is equal does not exceed: expected either equal_within or this";
                return wrong(key, message.to_owned());
            }
        }
        if let Some(least) = claim.by_at_least.filter(|least| *least < 0.0) {
            let message = format!("{least}: expected 0 or more: what exceeds is more");
            return wrong("by_at_least", message);
        }
        let least = claim.by_at_least.unwrap_or(0.0);
        if let Some(most) = claim.by_at_most.filter(|most| *most <= least) {
            let message = match claim.by_at_least {
                Some(least) => format!("{most}: by_at_least is {least}: expected more than that"),
                None => format!("{most}: expected more than 0: what exceeds is more"),
            };
            return wrong("by_at_most", message);
        }
        Ok(())
    }
}
