//! What parametric constraints say of values, some of which may not be known.

use crate::model::{Model, RelationshipKind, Table, Value};

/// What is known of a constraint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// It holds, whatever is not known.
    Holds,
    /// It does not, whatever is not known.
    Fails,
    /// It depends on what is not known.
    Open,
    /// A function does not know its output: the constraint says nothing.
    Silent,
}

use Verdict::{Fails, Holds, Open, Silent};

/// Whether a constraint holds of operands.
pub(super) fn judge(model: &Model, kind: RelationshipKind, operands: &[Option<Value>]) -> Verdict {
    let known: Vec<Value> = operands.iter().flatten().copied().collect();
    let all_known = known.len() == operands.len();
    let of_two = |holds: fn(&Value, &Value) -> bool| match operands {
        [Some(one), Some(other)] => decided(holds(one, other)),
        [_, _] => Open,
        _ => Fails,
    };
    match kind {
        RelationshipKind::Equal => match known.windows(2).any(|pair| pair[0] != pair[1]) {
            true => Fails,
            false if all_known => Holds,
            false => Open,
        },
        RelationshipKind::Different => of_two(|one, other| one != other),
        RelationshipKind::Less => of_two(|one, other| one < other),
        RelationshipKind::AtMost => of_two(|one, other| one <= other),
        RelationshipKind::Sum | RelationshipKind::Product => match known.split_last() {
            Some((last, others)) if all_known => {
                decided(total(kind, others) == Some(i128::from(*last)))
            }
            Some(_) => Open,
            None if operands.is_empty() => Fails,
            None => Open,
        },
        RelationshipKind::Table(table) => {
            let mut rows = matching(&model.tables[table], operands);
            match rows.next() {
                None => Fails,
                Some(_) if all_known => Holds,
                Some(_) => Open,
            }
        }
        RelationshipKind::Function(function) => {
            let function = &model.functions[function];
            let Some((last, inputs)) = operands.split_last() else {
                return Fails;
            };
            let inputs: Option<Vec<Value>> = inputs.iter().copied().collect();
            match inputs.map(|inputs| (function.call)(&inputs)) {
                None => Open,
                Some(None) => Silent,
                Some(output) if last.is_some() => decided(output == *last),
                Some(_) => Open,
            }
        }
    }
}

fn decided(holds: bool) -> Verdict {
    if holds { Holds } else { Fails }
}

/// The values that operands must have, given those that are known; by their places.
pub(super) fn implied(
    model: &Model,
    kind: RelationshipKind,
    operands: &[Option<Value>],
) -> Vec<(usize, Value)> {
    let unknown: Vec<usize> = places(operands, Option::is_none);
    let narrow = |value: Option<i128>| value.and_then(|value| Value::try_from(value).ok());
    match kind {
        RelationshipKind::Equal => match operands.iter().flatten().next() {
            Some(&value) => unknown.into_iter().map(|place| (place, value)).collect(),
            None => Vec::new(),
        },
        RelationshipKind::Sum | RelationshipKind::Product => {
            let [place] = unknown[..] else {
                return Vec::new();
            };
            let Some((last, others)) = operands.split_last() else {
                return Vec::new();
            };
            let known: Vec<Value> = others.iter().flatten().copied().collect();
            let value = match (total(kind, &known), last) {
                (total, None) => total,
                (Some(total), Some(last)) => rest(kind, i128::from(*last), total),
                (None, Some(_)) => None,
            };
            narrow(value)
                .map(|value| (place, value))
                .into_iter()
                .collect()
        }
        RelationshipKind::Table(table) => {
            let mut rows = matching(&model.tables[table], operands);
            let Some(first) = rows.next() else {
                return Vec::new();
            };
            let mut same: Vec<usize> = unknown;
            for row in rows {
                same.retain(|&place| row[place] == first[place]);
                if same.is_empty() {
                    break;
                }
            }
            same.into_iter()
                .map(|place| (place, first[place]))
                .collect()
        }
        RelationshipKind::Function(function) => match operands.split_last() {
            Some((None, inputs)) => {
                let inputs: Option<Vec<Value>> = inputs.iter().copied().collect();
                let output = inputs.and_then(|inputs| (model.functions[function].call)(&inputs));
                output
                    .map(|output| (operands.len() - 1, output))
                    .into_iter()
                    .collect()
            }
            _ => Vec::new(),
        },
        RelationshipKind::Different | RelationshipKind::Less | RelationshipKind::AtMost => {
            Vec::new()
        }
    }
}

/// Rows that have the operands' values, as far as they are known.
pub(super) fn matching<'a>(
    table: &'a Table,
    operands: &'a [Option<Value>],
) -> impl Iterator<Item = &'a [Value]> {
    let columns = table.columns.max(1);
    let fits = move |row: &&[Value]| {
        let mut pairs = row.iter().zip(operands);
        pairs.all(|(&is, &wanted)| wanted.is_none_or(|wanted| wanted == is))
    };
    // A row of another length is no row of the table.
    let rows = match operands.len() == columns {
        true => &table.rows[..],
        false => &[],
    };
    // Rows are in rising order: those of a first value lie together.
    let rows = match operands.first() {
        Some(&Some(first)) => {
            let count = rows.len() / columns;
            let search = |from: usize, below: &dyn Fn(Value) -> bool| {
                let (mut low, mut high) = (from, count);
                while low < high {
                    let middle = usize::midpoint(low, high);
                    if below(rows[middle * columns]) {
                        low = middle + 1;
                    } else {
                        high = middle;
                    }
                }
                low
            };
            let from = search(0, &|value| value < first);
            let to = search(from, &|value| value <= first);
            &rows[from * columns..to * columns]
        }
        _ => rows,
    };
    rows.chunks_exact(columns).filter(fits)
}

/// Places of operands that are, or are not, known.
fn places(operands: &[Option<Value>], which: fn(&Option<Value>) -> bool) -> Vec<usize> {
    let all = operands.iter().enumerate();
    all.filter(|(_, operand)| which(operand))
        .map(|(place, _)| place)
        .collect()
}

/// The sum or the product of values; none if it is beyond all numbers.
fn total(kind: RelationshipKind, values: &[Value]) -> Option<i128> {
    let mut values = values.iter().map(|&value| i128::from(value));
    match kind {
        RelationshipKind::Product => values.try_fold(1_i128, |all, value| all.checked_mul(value)),
        _ => values.try_fold(0_i128, |all, value| all.checked_add(value)),
    }
}

/// What the remaining operand is, given the total of the others and of all.
fn rest(kind: RelationshipKind, all: i128, others: i128) -> Option<i128> {
    match kind {
        RelationshipKind::Product if others == 0 || all % others != 0 => None,
        RelationshipKind::Product => Some(all / others),
        _ => all.checked_sub(others),
    }
}
