//! Designs: how the values of factors become cells.

use farside::random::RandomKey;

use crate::scenario::ScenarioError;

use super::factors::{Blame, FactorPlan, Levels, check_values};
use super::file::{Design, StudyFile};
use super::level::Level;
use super::results::{Cell, Factor};

/// The most cells of a study.
const MAX_CELLS: usize = 100_000;

/// The cells of a study, in order.
pub(super) fn cells(
    file: &StudyFile,
    factors: &mut [FactorPlan],
    blame: &Blame<'_>,
) -> Result<Vec<Cell>, ScenarioError> {
    if file.design != Design::List && !file.cell.is_empty() {
        return Err(blame.invalid("cell", "only design = \"list\" has [[cell]] tables"));
    }
    if file.design != Design::LatinHypercube {
        for (key, given) in [
            ("cells", file.cells.is_some()),
            ("design_seed", file.design_seed.is_some()),
        ] {
            if given {
                return Err(blame.invalid(key, "only design = \"latin-hypercube\" has this key"));
            }
        }
    }
    let rows = match file.design {
        Design::Grid => grid(factors, blame)?,
        Design::Paired => paired(factors, blame)?,
        Design::List => list(file, factors, blame)?,
        Design::LatinHypercube => {
            let cells = file.cells.unwrap_or(0);
            if !(2..=MAX_CELLS as u32).contains(&cells) {
                let message = format!("a latin hypercube has from 2 to {MAX_CELLS} cells");
                return Err(blame.invalid("cells", message));
            }
            latin_hypercube(factors, cells, file.design_seed.unwrap_or(0))
        }
    };
    Ok(rows.iter().map(|row| cell(factors, row)).collect())
}

fn cell(factors: &[FactorPlan], row: &[Level]) -> Cell {
    let pairs = factors.iter().zip(row);
    let sets = pairs.flat_map(|(factor, level)| level.sets(&factor.keys));
    Cell {
        values: row.iter().map(|level| level.value.clone()).collect(),
        texts: row.iter().map(|level| level.text.clone()).collect(),
        sets: sets.collect(),
    }
}

fn values(factor: &FactorPlan) -> &[Level] {
    match &factor.levels {
        Levels::Values(levels) => levels,
        Levels::Range(_) | Levels::OfCells => &[],
    }
}

fn grid(factors: &[FactorPlan], blame: &Blame<'_>) -> Result<Vec<Vec<Level>>, ScenarioError> {
    let mut rows: Vec<Vec<Level>> = vec![Vec::new()];
    for factor in factors {
        let levels = values(factor);
        let count = rows.len().saturating_mul(levels.len());
        if count > MAX_CELLS {
            let message = format!("{count} combinations: expected at most {MAX_CELLS} cells");
            return Err(blame.invalid("factor", message));
        }
        let extended = rows.iter().flat_map(|row| {
            levels.iter().map(|level| {
                let mut row = row.clone();
                row.push(level.clone());
                row
            })
        });
        rows = extended.collect();
    }
    Ok(rows)
}

fn paired(factors: &[FactorPlan], blame: &Blame<'_>) -> Result<Vec<Vec<Level>>, ScenarioError> {
    let count = factors.first().map_or(0, |factor| values(factor).len());
    for (index, factor) in factors.iter().enumerate() {
        let actual = values(factor).len();
        if actual != count {
            let message = format!(
                "{actual} values: factors that advance together have equally many, and the first \
                 has {count}"
            );
            return Err(blame.invalid(&format!("factor.{index}"), message));
        }
    }
    let row = |at: usize| factors.iter().map(|f| values(f)[at].clone()).collect();
    Ok((0..count).map(row).collect())
}

fn list(
    file: &StudyFile,
    factors: &mut [FactorPlan],
    blame: &Blame<'_>,
) -> Result<Vec<Vec<Level>>, ScenarioError> {
    if file.cell.is_empty() || file.cell.len() > MAX_CELLS {
        let message = format!("expected from 1 to {MAX_CELLS} [[cell]] tables of factor = value");
        return Err(blame.invalid("cell", message));
    }
    let names: Vec<&str> = factors.iter().map(|f| f.factor.name.as_str()).collect();
    let mut rows: Vec<Vec<Level>> = Vec::new();
    for (index, cell) in file.cell.iter().enumerate() {
        let at = format!("cell.{index}");
        if let Some(name) = cell.keys().find(|name| !names.contains(&name.as_str())) {
            return Err(blame.unknown(&format!("{at}.{name}"), name, &names));
        }
        let mut row = Vec::new();
        for factor in factors.iter() {
            let name = factor.factor.name.as_str();
            let value = cell.get(name).ok_or_else(|| {
                let message = format!("{name} is missing: a cell gives each factor a value");
                blame.invalid(&at, message)
            })?;
            let wanted = Level::new(value);
            let variants = values(factor);
            row.push(if variants.is_empty() {
                wanted
            } else {
                let found = variants.iter().find(|v| v.is(&wanted.value, &wanted.text));
                let known: Vec<&str> = variants.iter().map(|v| v.text.as_str()).collect();
                let unknown = || blame.unknown(&format!("{at}.{name}"), &wanted.text, &known);
                found.ok_or_else(unknown)?.clone()
            });
        }
        if rows.contains(&row) {
            return Err(blame.invalid(&at, "another cell has these values"));
        }
        rows.push(row);
    }
    for (index, factor) in factors.iter_mut().enumerate() {
        let mut distinct: Vec<Level> = Vec::new();
        for row in &rows {
            let level = &row[index];
            if !distinct.iter().any(|l| l.is(&level.value, &level.text)) {
                distinct.push(level.clone());
            }
        }
        let dimension = check_values(&distinct, factor.factor.scale)
            .map_err(|message| blame.invalid(&format!("factor.{index}"), message))?;
        if let (Some(unit), true) = (dimension.unit(), factor.factor.unit.is_empty()) {
            unit.clone_into(&mut factor.factor.unit);
        }
    }
    Ok(rows)
}

/// Points of which each of `cells` equal parts of each factor's range has exactly one. The same
/// seed gives the same points; a factor's depend on its name, and on no other factor.
fn latin_hypercube(factors: &[FactorPlan], cells: u32, seed: u64) -> Vec<Vec<Level>> {
    let columns: Vec<Vec<Level>> = factors
        .iter()
        .map(|factor| {
            let name = factor.factor.name.as_str();
            let key = RandomKey::new(seed).text("latin_hypercube").text(name);
            let mut stream = key.stream();
            let mut parts: Vec<u32> = (0..cells).collect();
            // Fisher and Yates's shuffle.
            for at in (1..parts.len()).rev() {
                let other = stream.below(at as u64 + 1) as usize;
                parts.swap(at, other);
            }
            let level = |part: u32| {
                let share = stream.uniform();
                match &factor.levels {
                    Levels::Range(range) => Some(range.in_part(part, cells, share)),
                    Levels::Values(levels) => {
                        let through = (f64::from(part) + share) / f64::from(cells);
                        let at = (through * levels.len() as f64) as usize;
                        levels.get(at).cloned()
                    }
                    Levels::OfCells => None,
                }
            };
            parts.into_iter().filter_map(level).collect()
        })
        .collect();
    let row = |at: usize| columns.iter().map(|column| column[at].clone()).collect();
    (0..cells as usize).map(row).collect()
}

/// The one cell that has these factor values, given by name.
///
/// # Errors
/// In words: an unknown factor, a value that no cell has, values that several cells have.
pub(super) fn find(
    factors: &[Factor],
    cells: &[Cell],
    wanted: &[(String, Level)],
) -> Result<usize, String> {
    let names: Vec<&str> = factors.iter().map(|factor| factor.name.as_str()).collect();
    let mut matching: Vec<usize> = (0..cells.len()).collect();
    for (name, level) in wanted {
        let at = names.iter().position(|known| known == name);
        let at = at.ok_or_else(|| {
            let near = farside::suggest::nearest(name, names.iter().copied());
            let hint = near.map_or_else(String::new, |near| format!("; did you mean {near:?}?"));
            let names = names.join(", ");
            format!("unknown factor {name:?}{hint} (the factors are {names})")
        })?;
        let has = |cell: &Cell| level.is(&cell.values[at], &cell.texts[at]);
        if !cells.iter().any(has) {
            let mut texts: Vec<&str> = Vec::new();
            for cell in cells {
                if !texts.contains(&cell.texts[at].as_str()) {
                    texts.push(&cell.texts[at]);
                }
            }
            let texts = texts.join(", ");
            return Err(format!(
                "no cell has {name} = {} (its values are {texts})",
                level.text
            ));
        }
        matching.retain(|cell| has(&cells[*cell]));
    }
    match matching[..] {
        [cell] => Ok(cell),
        [] => Err("no cell has all these values".to_owned()),
        _ => {
            let cells: Vec<String> = matching.iter().take(10).map(usize::to_string).collect();
            let dots = if matching.len() > 10 { ", ..." } else { "" };
            Err(format!(
                "several cells have these values: {}{dots}",
                cells.join(", ")
            ))
        }
    }
}
