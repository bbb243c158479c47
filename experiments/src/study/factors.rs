//! Factors: what a study varies, read from its file and checked.

use farside::suggest::nearest;
use farside_actors::figure::scale;

use crate::scenario::{ScenarioError, Source};

use super::file::{Design, FactorFile, StudyFile};
use super::level::{Dimension, Level, Range, settings};
use super::results::{Factor, Scale};

/// The most values of a factor; nobody means more.
const MAX_LEVELS: usize = 10_000;

/// A factor, checked.
#[derive(Debug)]
pub(super) struct FactorPlan {
    pub(super) factor: Factor,
    /// The keys of the scenario that get its value.
    pub(super) keys: Vec<String>,
    pub(super) levels: Levels,
}

impl FactorPlan {
    /// How many `--set` arguments a cell has of it.
    pub(super) fn sets_of(&self, value: &serde_json::Value, text: &str) -> usize {
        let Levels::Values(levels) = &self.levels else {
            return self.keys.len();
        };
        let level = levels.iter().find(|level| level.is(value, text));
        level.map_or(self.keys.len(), |level| level.sets(&self.keys).len())
    }
}

/// Which values a factor takes.
#[derive(Debug)]
pub(super) enum Levels {
    /// These.
    Values(Vec<Level>),
    /// Any of a range; the design draws them.
    Range(Box<Range>),
    /// Those that the cells say.
    OfCells,
}

/// Says where in a study file a mistake is.
pub(super) struct Blame<'a>(pub(super) &'a Source);

impl Blame<'_> {
    /// A mistake in the value of `key`, dotted from the top.
    pub(super) fn invalid(&self, key: &str, message: impl ToString) -> ScenarioError {
        self.invalid_at(&split(key), message)
    }

    /// A mistake in the value that these keys lead to; they may have dots in them.
    pub(super) fn invalid_at(&self, keys: &[String], message: impl ToString) -> ScenarioError {
        ScenarioError::Invalid {
            place: self.0.place_of_key(keys),
            key: keys.join("."),
            message: message.to_string(),
        }
    }

    /// A name that does not exist as the value of `key`.
    pub(super) fn unknown(&self, key: &str, found: &str, known: &[&str]) -> ScenarioError {
        self.unknown_at(&split(key), found, known)
    }

    /// The same for the value that these keys lead to; they may have dots in them.
    pub(super) fn unknown_at(&self, keys: &[String], found: &str, known: &[&str]) -> ScenarioError {
        ScenarioError::UnknownValue {
            place: self.0.place_of_key(keys),
            key: keys.join("."),
            found: found.to_owned(),
            nearest: nearest(found, known.iter().copied()),
            expected: format!("one of {}", known.join(", ")),
        }
    }
}

fn split(key: &str) -> Vec<String> {
    key.split('.').map(str::to_owned).collect()
}

/// The factors of a study.
pub(super) fn factors(
    file: &StudyFile,
    blame: &Blame<'_>,
) -> Result<Vec<FactorPlan>, ScenarioError> {
    if file.factor.is_empty() {
        let message = "there is no [[factor]]: expected at least one, with a name, a key of the \
                       scenario and its values";
        return Err(blame.invalid("factor", message));
    }
    let mut plans: Vec<FactorPlan> = Vec::new();
    for (index, factor) in file.factor.iter().enumerate() {
        let at = |key: &str| format!("factor.{index}.{key}");
        let name = &factor.name;
        if name.is_empty() || name.contains([',', '=']) {
            let message = format!("{name:?}: expected a name without commas and equals signs");
            return Err(blame.invalid(&at("name"), message));
        }
        if plans.iter().any(|plan| plan.factor.name == *name) {
            let message = format!("{name:?}: another factor has this name");
            return Err(blame.invalid(&at("name"), message));
        }
        let plan = plan_of(factor, index, file.design, blame)?;
        let used = |key: &&String| plans.iter().any(|other| other.keys.contains(key));
        if let Some(key) = plan.keys.iter().find(used) {
            let message = format!("{key}: another factor sets this key");
            let keys = [
                ("key", factor.key.is_some()),
                ("keys", factor.keys.is_some()),
            ];
            let given = keys.iter().find(|(_, given)| *given);
            return Err(blame.invalid(&at(given.map_or("variants", |(key, _)| key)), message));
        }
        plans.push(plan);
    }
    Ok(plans)
}

fn plan_of(
    file: &FactorFile,
    index: usize,
    design: Design,
    blame: &Blame<'_>,
) -> Result<FactorPlan, ScenarioError> {
    let (keys, (levels, dimension)) = if file.variants.is_some() {
        variants(file, index, blame)?
    } else {
        let keys = keys(file, index, blame)?;
        (keys, levels(file, index, design, blame)?)
    };
    let unit = match (&file.unit, dimension.unit()) {
        (Some(unit), Some(base)) if unit != base => {
            let key = format!("factor.{index}.unit");
            let base = if base.is_empty() { "no unit" } else { base };
            let message = format!("{unit:?}: these values are counted in {base}");
            return Err(blame.invalid(&key, message));
        }
        (Some(unit), _) => unit.clone(),
        (None, base) => base.unwrap_or("").to_owned(),
    };
    Ok(FactorPlan {
        factor: Factor {
            name: file.name.clone(),
            label: file.label.clone().unwrap_or_else(|| file.name.clone()),
            unit,
            scale: file.scale.unwrap_or_else(|| plotted(&levels)),
        },
        keys,
        levels,
    })
}

fn keys(file: &FactorFile, index: usize, blame: &Blame<'_>) -> Result<Vec<String>, ScenarioError> {
    let at = format!("factor.{index}");
    let keys = match (&file.key, &file.keys) {
        (Some(key), None) => vec![key.clone()],
        (None, Some(keys)) if !keys.is_empty() => keys.clone(),
        (None, _) => {
            let message = "no key: expected the key of the scenario that it sets, as in \
                           key = \"links.default.loss\", or variants, each with what it sets";
            return Err(blame.invalid(&at, message));
        }
        (Some(_), Some(_)) => {
            return Err(blame.invalid(&format!("{at}.keys"), "expected either key or keys"));
        }
    };
    let name = if file.key.is_some() { "key" } else { "keys" };
    for (index, key) in keys.iter().enumerate() {
        let wrong = |message: String| Err(blame.invalid(&format!("{at}.{name}"), message));
        if let Err(message) = check_key(key) {
            return wrong(message);
        }
        if keys[..index].contains(key) {
            return wrong(format!("{key} is there twice"));
        }
    }
    Ok(keys)
}

/// Checks that a factor may set a key, as far as that is known without the scenario.
fn check_key(key: &str) -> Result<(), String> {
    if let Err(error) = Source::new("", String::new(), &[format!("{key}=0")]) {
        return Err(format!("{key:?} is no key of a scenario: {error}"));
    }
    if key == "seed" {
        return Err("seed: a study's seeds are given by its own key, seeds".to_owned());
    }
    Ok(())
}

/// The variants of a factor: all keys that any of them sets, and a level for each.
fn variants(
    file: &FactorFile,
    index: usize,
    blame: &Blame<'_>,
) -> Result<(Vec<String>, (Levels, Dimension)), ScenarioError> {
    let at = format!("factor.{index}");
    let given = [
        ("key", file.key.is_some()),
        ("keys", file.keys.is_some()),
        ("values", file.values.is_some()),
        ("range", file.range.is_some()),
        ("steps", file.steps.is_some()),
    ];
    if let Some((key, _)) = given.iter().find(|(_, given)| *given) {
        let message = "variants say themselves what they set: expected either these or variants";
        return Err(blame.invalid(&format!("{at}.{key}"), message));
    }
    let mut keys: Vec<String> = Vec::new();
    let mut levels: Vec<Level> = Vec::new();
    for (place, variant) in file.variants.iter().flatten().enumerate() {
        let here = format!("{at}.variants.{place}");
        let name = &variant.name;
        if name.trim() != name || name.is_empty() || name.contains([',', '=']) {
            let message = format!("{name:?}: expected a name without commas and equals signs");
            return Err(blame.invalid(&format!("{here}.name"), message));
        }
        let settings = settings(&variant.set, &format!("{here}.set"));
        for setting in &settings {
            if let Err(message) = check_key(&setting.key) {
                return Err(blame.invalid_at(&setting.path, message));
            }
            if !keys.contains(&setting.key) {
                keys.push(setting.key.clone());
            }
        }
        let level = Level::variant(name, settings.into_iter().map(|one| one.argument).collect());
        let same = |other: &&Level| other.sets(&[]) == level.sets(&[]);
        if let Some(other) = levels.iter().find(same) {
            let message = format!("{name} sets the same as {}", other.text);
            return Err(blame.invalid(&here, message));
        }
        levels.push(level);
    }
    // Names of which only some can be read as quantities are words.
    if check_values(&levels, file.scale.unwrap_or_default()).is_err() {
        levels = levels.into_iter().map(Level::into_word).collect();
    }
    match check_values(&levels, file.scale.unwrap_or_default()) {
        Ok(dimension) => Ok((keys, (Levels::Values(levels), dimension))),
        Err(message) => Err(blame.invalid(&format!("{at}.variants"), message)),
    }
}

fn levels(
    file: &FactorFile,
    index: usize,
    design: Design,
    blame: &Blame<'_>,
) -> Result<(Levels, Dimension), ScenarioError> {
    let wrong = |key: &str, message: String| {
        let key = match key {
            "" => format!("factor.{index}"),
            key => format!("factor.{index}.{key}"),
        };
        Err(blame.invalid(&key, message))
    };
    if design == Design::List {
        let given = [
            ("values", file.values.is_some()),
            ("range", file.range.is_some()),
            ("steps", file.steps.is_some()),
        ];
        return match given.iter().find(|(_, given)| *given) {
            Some((key, _)) => wrong(key, "in a list, the [[cell]] tables give the values".into()),
            None => Ok((Levels::OfCells, Dimension::Text)),
        };
    }
    match (&file.values, &file.range) {
        (Some(_), Some(_)) => wrong("range", "expected either values or a range".into()),
        (None, None) => wrong(
            "",
            "no values: expected values = [...], or range and steps".into(),
        ),
        (Some(values), None) => {
            if file.steps.is_some() {
                return wrong("steps", "only a range has steps".into());
            }
            let levels: Vec<Level> = values.iter().map(Level::new).collect();
            match check_values(&levels, file.scale.unwrap_or_default()) {
                Ok(dimension) => Ok((Levels::Values(levels), dimension)),
                Err(message) => wrong("values", message),
            }
        }
        (None, Some([low, high])) => {
            let range = match Range::new(low, high, file.scale.unwrap_or_default()) {
                Ok(range) => range,
                Err(message) => return wrong("range", message),
            };
            let dimension = range.dimension();
            match (design, file.steps) {
                (Design::LatinHypercube, None) => Ok((Levels::Range(Box::new(range)), dimension)),
                (Design::LatinHypercube, Some(_)) => wrong(
                    "steps",
                    "a latin hypercube has as many steps as cells".into(),
                ),
                (_, None) => wrong("", "the range needs steps: how many values it gives".into()),
                (_, Some(steps)) if !(2..=MAX_LEVELS as u32).contains(&steps) => {
                    wrong("steps", format!("{steps}: expected from 2 to {MAX_LEVELS}"))
                }
                (_, Some(steps)) => {
                    let levels = range.steps(steps);
                    match check_values(&levels, file.scale.unwrap_or_default()) {
                        Ok(_) => Ok((Levels::Values(levels), dimension)),
                        Err(message) => wrong("steps", message),
                    }
                }
            }
        }
    }
}

/// How plots space values of which the study does not say it: by ratio if they are numbers above 0
/// that span two decades or more. Evenly spaced, all but the greatest would lie in a corner.
fn plotted(levels: &Levels) -> Scale {
    let Levels::Values(levels) = levels else {
        return Scale::Linear;
    };
    // A word among them counts as 0: then they are not spaced by ratio.
    let values = levels.iter().map(|level| level.number().unwrap_or(0.0));
    match scale::spans_decades(values) {
        true => Scale::Log,
        false => Scale::Linear,
    }
}

/// Checks the values of a factor, and says what they measure.
pub(super) fn check_values(levels: &[Level], scale: Scale) -> Result<Dimension, String> {
    let Some(first) = levels.first() else {
        return Err("expected at least one value".to_owned());
    };
    if levels.len() > MAX_LEVELS {
        let count = levels.len();
        return Err(format!("{count} values: expected at most {MAX_LEVELS}"));
    }
    for (index, level) in levels.iter().enumerate() {
        if !level.dimension.fits(first.dimension) {
            return Err(format!(
                "{} and {}: expected values of the same sort",
                first.text, level.text
            ));
        }
        if scale == Scale::Log && !level.number().is_some_and(|number| number > 0.0) {
            let text = &level.text;
            return Err(format!("{text}: expected more than zero on a log scale"));
        }
        let same = |other: &&Level| other.is(&level.value, &level.text);
        if levels[..index].iter().find(same).is_some() {
            return Err(format!("{} is there twice", level.text));
        }
    }
    Ok(first.dimension)
}
