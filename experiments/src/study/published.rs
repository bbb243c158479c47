//! Published figures: what a study file says of them, checked against its metrics and cells.

mod exceeds;

use serde_json::Value;

use crate::scenario::ScenarioError;
use farside_actors::system::Series;

use super::factors::{Blame, FactorPlan};
use super::file::{PublishedFile, StudyFile};
use super::level::Level;
use super::results::{Cell, Claim, Metric, Published, PublishedFigure};

/// The keys of a figure that say what is claimed; it has one of them.
const CLAIMS: [&str; 6] = ["value", "about", "below", "above", "linear", EXCEEDS];

/// The claim that one cell is more than another; read in [`exceeds`].
const EXCEEDS: &str = "exceeds";

/// Its key for the publication's own words.
const QUOTE: &str = "quote";

/// What a figure is checked against.
struct StudyParts<'a> {
    factors: &'a [FactorPlan],
    cells: &'a [Cell],
    blame: &'a Blame<'a>,
}

/// The published figures of a study.
///
/// # Errors
/// When a table names a metric that the study does not measure, or a figure a factor or level that
/// there is not, no claim or several, or a cell that another figure of the table has already.
pub(super) fn published(
    file: &StudyFile,
    factors: &[FactorPlan],
    cells: &[Cell],
    metrics: &[Metric],
    blame: &Blame<'_>,
) -> Result<Vec<Published>, ScenarioError> {
    let known = StudyParts {
        factors,
        cells,
        blame,
    };
    let tables = file.published.iter().enumerate();
    tables
        .map(|(index, table)| known.table(index, table, metrics))
        .collect()
}

impl StudyParts<'_> {
    fn table(
        &self,
        index: usize,
        table: &PublishedFile,
        metrics: &[Metric],
    ) -> Result<Published, ScenarioError> {
        let at = |key: &str| format!("published.{index}.{key}");
        let measured: Vec<&str> = metrics.iter().map(|metric| metric.name.as_str()).collect();
        if !measured.contains(&table.metric.as_str()) {
            return Err(self.blame.unknown(&at("metric"), &table.metric, &measured));
        }
        for (key, text) in [("title", &table.title), ("source", &table.source)] {
            if text.trim().is_empty() {
                return Err(self.blame.invalid(&at(key), "expected some words"));
            }
        }
        let scale = table.scale.unwrap_or(1.0);
        if !(scale > 0.0 && scale.is_finite()) {
            let message = format!("{scale}: expected a number above zero");
            return Err(self.blame.invalid(&at("scale"), message));
        }
        if let Some(rows) = &table.rows {
            let names = self.names();
            if !names.contains(&rows.as_str()) {
                return Err(self.blame.unknown(&at("rows"), rows, &names));
            }
        }
        if table.values.is_empty() {
            return Err(self
                .blame
                .invalid(&at("values"), "expected at least one figure"));
        }
        let mut figures: Vec<PublishedFigure> = Vec::new();
        for (place, entry) in table.values.iter().enumerate() {
            let keys = at(&format!("values.{place}"));
            let keys: Vec<String> = keys.split('.').map(str::to_owned).collect();
            let figure = self.figure(&keys, entry)?;
            self.check_apart(&keys, &figures, &figure)?;
            figures.push(figure);
        }
        Ok(Published {
            metric: table.metric.clone(),
            title: table.title.clone(),
            source: table.source.clone(),
            unit: table.unit.clone().unwrap_or_default(),
            scale,
            rows: table.rows.clone(),
            figures,
            note: table.note.clone().unwrap_or_default(),
            why: table.why.clone().unwrap_or_default(),
        })
    }

    fn names(&self) -> Vec<&str> {
        let names = self.factors.iter().map(|plan| plan.factor.name.as_str());
        names.collect()
    }

    /// A figure, which stands at `keys`.
    fn figure(
        &self,
        keys: &[String],
        entry: &toml::Table,
    ) -> Result<PublishedFigure, ScenarioError> {
        let names = self.names();
        let mut cells: Vec<usize> = (0..self.cells.len()).collect();
        let mut claims = Vec::new();
        // What is more than what is known once all levels are.
        let exceeds = entry.contains_key(EXCEEDS);
        let mut quote = String::new();
        for (key, value) in entry {
            let here = [keys, std::slice::from_ref(key)].concat();
            // A factor's name comes first: its level could not be given otherwise.
            if let Some(factor) = names.iter().position(|name| name == key) {
                let level = self.level(&here, factor, value)?;
                let has = |cell: &Cell| level.is(&cell.values[factor], &cell.texts[factor]);
                cells.retain(|cell| has(&self.cells[*cell]));
            } else if key == EXCEEDS || exceeds::DETAILS.contains(&key.as_str()) {
                if !exceeds {
                    let message = "only a figure with exceeds has this key";
                    return Err(self.blame.invalid_at(&here, message));
                }
            } else if CLAIMS.contains(&key.as_str()) {
                claims.push(self.claim(&here, key, value)?);
            } else if key == QUOTE {
                let words = value.as_str().ok_or_else(|| {
                    let message = format!("{value}: expected the publication's words");
                    self.blame.invalid_at(&here, message)
                })?;
                words.clone_into(&mut quote);
            } else {
                let known = names.iter().copied().chain(CLAIMS);
                let known: Vec<&str> = known.chain(exceeds::DETAILS).chain([QUOTE]).collect();
                return Err(self.blame.unknown_at(&here, key, &known));
            }
        }
        if exceeds && !cells.is_empty() {
            claims.push(Claim::Exceeds(self.comparison(keys, entry, &cells)?));
        }
        if cells.is_empty() {
            let message = "no cell has all these values";
            return Err(self.blame.invalid_at(keys, message));
        }
        let [claim] = claims.as_slice() else {
            let names = CLAIMS.join(", ");
            let message = format!("{} claims: expected one of {names}", claims.len());
            return Err(self.blame.invalid_at(keys, message));
        };
        if let Claim::Linear(name) = claim {
            self.check_line(keys, name, &cells)?;
        }
        Ok(PublishedFigure {
            cells,
            claim: claim.clone(),
            quote,
        })
    }

    /// The level of a factor that some cell has.
    fn level(
        &self,
        keys: &[String],
        factor: usize,
        value: &toml::Value,
    ) -> Result<Level, ScenarioError> {
        let level = Level::new(value);
        let mut texts: Vec<&str> = Vec::new();
        let mut numbers: Vec<(f64, &str)> = Vec::new();
        for cell in self.cells {
            let (value, text) = (&cell.values[factor], cell.texts[factor].as_str());
            if level.is(value, text) {
                return Ok(level);
            }
            if !texts.contains(&text) {
                texts.push(text);
                numbers.extend(value.as_f64().map(|number| (number, text)));
            }
        }
        // Of numbers the one next to it is near, not the one that is written like it.
        let near = level.number().and_then(|wanted| {
            let apart = |(number, _): &&(f64, &str)| (number - wanted).abs();
            numbers.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)))
        });
        match near {
            Some((_, near)) => {
                let message = format!(
                    "no cell has {}; did you mean {near}?\n  expected one of {}",
                    level.text,
                    texts.join(", ")
                );
                Err(self.blame.invalid_at(keys, message))
            }
            None => Err(self.blame.unknown_at(keys, &level.text, &texts)),
        }
    }

    fn claim(
        &self,
        keys: &[String],
        kind: &str,
        value: &toml::Value,
    ) -> Result<Claim, ScenarioError> {
        if kind == "linear" {
            let names = self.names();
            let name = value.as_str().unwrap_or_default();
            let Some(factor) = names.iter().position(|known| *known == name) else {
                let found = value
                    .as_str()
                    .map_or_else(|| value.to_string(), str::to_owned);
                return Err(self.blame.unknown_at(keys, &found, &names));
            };
            if self
                .cells
                .iter()
                .any(|cell| !cell.values[factor].is_number())
            {
                let message = format!("{name}: expected a factor whose values are numbers");
                return Err(self.blame.invalid_at(keys, message));
            }
            return Ok(Claim::Linear(name.to_owned()));
        }
        let number = self.number(keys, value)?;
        Ok(match kind {
            "about" => Claim::About(number),
            "below" => Claim::Below(number),
            "above" => Claim::Above(number),
            _ => Claim::Value(number),
        })
    }

    fn number(&self, keys: &[String], value: &toml::Value) -> Result<f64, ScenarioError> {
        let number = value
            .as_float()
            .or_else(|| value.as_integer().map(|n| n as f64));
        number.filter(|number| number.is_finite()).ok_or_else(|| {
            let message = format!("{value}: expected a number, in the publication's unit");
            self.blame.invalid_at(keys, message)
        })
    }

    /// Refuses a line over two points or fewer, which any figures are on.
    fn check_line(
        &self,
        keys: &[String],
        name: &str,
        cells: &[usize],
    ) -> Result<(), ScenarioError> {
        let factor = self.names().iter().position(|known| *known == name);
        let mut texts: Vec<&String> = Vec::new();
        for cell in cells {
            let text = factor.and_then(|factor| self.cells[*cell].texts.get(factor));
            texts.extend(text.filter(|text| !texts.contains(text)));
        }
        if texts.len() < 3 {
            let count = texts.len();
            let message = format!("{name} has {count} values here: a line needs three");
            return Err(self.blame.invalid_at(keys, message));
        }
        Ok(())
    }

    /// Refuses a second figure for a cell: one of the two is a slip. A cell may be compared with
    /// several others, and from several indices on.
    fn check_apart(
        &self,
        keys: &[String],
        before: &[PublishedFigure],
        figure: &PublishedFigure,
    ) -> Result<(), ScenarioError> {
        let others = before.iter().flat_map(subjects);
        let others: Vec<Subject> = others.collect();
        let both = subjects(figure).find(|subject| others.contains(subject));
        let Some(Subject { cell, .. }) = both else {
            return Ok(());
        };
        let texts = self.cells[cell].texts.join(", ");
        let message = format!("another figure of this table is for cell {cell} ({texts}) too");
        Err(self.blame.invalid_at(keys, message))
    }
}

/// What a figure is said of: two figures of a table are never said of the same.
#[derive(Debug, PartialEq)]
struct Subject {
    cell: usize,
    is_line: bool,
    /// The other cell, and the index from which on.
    compared: Option<(usize, Option<f64>)>,
}

fn subjects(figure: &PublishedFigure) -> impl Iterator<Item = Subject> {
    figure
        .cells
        .iter()
        .enumerate()
        .map(|(place, cell)| Subject {
            cell: *cell,
            is_line: matches!(figure.claim, Claim::Linear(_)),
            compared: match &figure.claim {
                Claim::Exceeds(claim) => Some((claim.others[place], claim.from_index)),
                _ => None,
            },
        })
}

/// Checks that what a table claims can be said of its metric, as a run that ended reports it.
///
/// # Errors
/// When words have figures, or a curve has; when what is no number is compared; when an index is
/// given of what is no curve, or one beyond its end.
pub(super) fn check_kind(
    index: usize,
    table: &Published,
    reported: Option<&Value>,
    blame: &Blame<'_>,
) -> Result<(), ScenarioError> {
    let metric = &table.metric;
    let series = reported.and_then(|value| Series::from_json(value).ok());
    if let Some(Value::String(_)) = reported {
        let message = format!("{metric}: expected a metric that is counted or measured");
        return Err(blame.invalid(&format!("published.{index}.metric"), message));
    }
    for (place, figure) in table.figures.iter().enumerate() {
        let at = |key: &str| format!("published.{index}.values.{place}{key}");
        let Claim::Exceeds(claim) = &figure.claim else {
            if series.is_some() {
                let message = format!("{metric} is a curve: expected exceeds, and no figure");
                return Err(blame.invalid(&at(""), message));
            }
            continue;
        };
        if let Some(Value::Array(_)) = reported {
            let message = format!(
                "{metric} is a list: expected a metric that is a number, true or false, or a curve"
            );
            return Err(blame.invalid(&at(".exceeds"), message));
        }
        // A metric that this run does not report says nothing of its kind.
        let (Some(from), Some(_)) = (claim.from_index, reported) else {
            continue;
        };
        let key = at(".from_index");
        match series.as_ref().map(|series| series.index().last()) {
            None => {
                let message = format!("{metric} is no curve, so it has no index");
                return Err(blame.invalid(&key, message));
            }
            Some(Some(last)) if *last < from => {
                let message = format!("{from}: the last index of {metric} is {last}");
                return Err(blame.invalid(&key, message));
            }
            Some(_) => {}
        }
    }
    Ok(())
}
