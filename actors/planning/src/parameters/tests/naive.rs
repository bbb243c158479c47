//! The same rules once more, without any of the store: over sets of numbers, all constraints again
//! and again until nothing changes.

use std::collections::{BTreeMap, BTreeSet};

use crate::model::Value;
use crate::parameters::{Domain, Kind, Operand, Variable};

/// A wide interval, or single values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Naive {
    Span(Value, Value),
    Set(BTreeSet<Value>),
}

pub(super) type Naives = BTreeMap<Variable, Naive>;

/// What a constraint says, and of what.
pub(super) type Said = (Kind, Vec<Operand>);

impl Naive {
    fn ends(&self) -> (Value, Value) {
        match self {
            Naive::Span(min, max) => (*min, *max),
            Naive::Set(all) => (*all.first().unwrap(), *all.last().unwrap()),
        }
    }

    fn has(&self, value: Value) -> bool {
        match self {
            Naive::Span(min, max) => (*min..=*max).contains(&value),
            Naive::Set(all) => all.contains(&value),
        }
    }

    fn value(&self) -> Option<Value> {
        let (min, max) = self.ends();
        (min == max).then_some(min)
    }

    /// Narrow intervals are sets; none is empty.
    fn checked(self) -> Option<Naive> {
        match self {
            Naive::Span(min, max) if max - min < 64 => Naive::Set((min..=max).collect()).checked(),
            Naive::Set(all) if all.is_empty() => None,
            other => Some(other),
        }
    }

    fn within(&self, min: i128, max: i128) -> Option<Naive> {
        let fits = |value: Value| min <= value.into() && i128::from(value) <= max;
        match self {
            Naive::Span(a, b) => {
                let (a, b) = (min.max((*a).into()), max.min((*b).into()));
                Naive::Span(a.try_into().ok()?, b.try_into().ok()?).checked()
            }
            Naive::Set(all) => {
                Naive::Set(all.iter().copied().filter(|&x| fits(x)).collect()).checked()
            }
        }
    }

    fn meet(&self, other: &Naive) -> Option<Naive> {
        match (self, other) {
            (Naive::Span(a, b), other) | (other, Naive::Span(a, b)) => {
                other.within((*a).into(), (*b).into())
            }
            (Naive::Set(a), Naive::Set(b)) => Naive::Set(a & b).checked(),
        }
    }

    fn without(&self, value: Value) -> Option<Naive> {
        match self {
            Naive::Span(min, max) if *min == value => Naive::Span(min + 1, *max).checked(),
            Naive::Span(min, max) if *max == value => Naive::Span(*min, max - 1).checked(),
            Naive::Span(..) => Some(self.clone()),
            Naive::Set(all) => {
                let mut all = all.clone();
                all.remove(&value);
                Naive::Set(all).checked()
            }
        }
    }
}

impl From<&Domain> for Naive {
    fn from(domain: &Domain) -> Naive {
        if domain.is_interval() {
            Naive::Span(domain.min(), domain.max())
        } else {
            Naive::Set(domain.values().collect())
        }
    }
}

/// The domains when no rule narrows anything any more; none if a variable has no value.
pub(super) fn from_scratch<'a>(
    bases: Naives,
    all: impl Iterator<Item = &'a Said> + Clone,
) -> Option<Naives> {
    let mut domains = bases;
    loop {
        let before = domains.clone();
        for (kind, operands) in all.clone() {
            apply(kind, operands, &mut domains)?;
        }
        if domains == before {
            return Some(domains);
        }
    }
}

fn domain(operand: Operand, domains: &Naives) -> Naive {
    match operand {
        Operand::Value(value) => Naive::Set([value].into()),
        Operand::Variable(variable) => domains[&variable].clone(),
    }
}

fn set(operand: Operand, to: Naive, domains: &mut Naives) -> Option<()> {
    match operand {
        Operand::Value(value) => to.has(value).then_some(()),
        Operand::Variable(variable) => {
            domains.insert(variable, to);
            Some(())
        }
    }
}

fn apply(kind: &Kind, operands: &[Operand], domains: &mut Naives) -> Option<()> {
    let now: Vec<Naive> = operands.iter().map(|&x| domain(x, domains)).collect();
    let ends = |at: usize| -> (i128, i128) {
        let (min, max) = now[at].ends();
        (min.into(), max.into())
    };
    let last = operands.len() - 1;
    let is_twice = last == 1 && operands[0] == operands[1];
    match kind {
        Kind::In(domain) if domain.is_empty() => None,
        Kind::In(domain) => set(operands[0], now[0].meet(&domain.into())?, domains),
        Kind::Equal => {
            let first = Some(now[0].clone());
            let all = now.iter().fold(first, |all, x| all?.meet(x))?;
            operands
                .iter()
                .try_for_each(|&x| set(x, all.clone(), domains))
        }
        Kind::Different if is_twice && matches!(operands[0], Operand::Variable(_)) => None,
        Kind::Different => {
            if let Some(value) = now[0].value() {
                set(operands[1], now[1].without(value)?, domains)?;
            }
            if let Some(value) = now[1].value() {
                set(operands[0], now[0].without(value)?, domains)?;
            }
            Some(())
        }
        Kind::Less if is_twice => None,
        Kind::Less | Kind::AtMost => {
            let gap = i128::from(matches!(kind, Kind::Less));
            set(
                operands[0],
                now[0].within(i128::MIN, ends(1).1 - gap)?,
                domains,
            )?;
            let second = domain(operands[1], domains);
            set(
                operands[1],
                second.within(ends(0).0 + gap, i128::MAX)?,
                domains,
            )
        }
        Kind::Sum | Kind::Product => arithmetic(kind, operands, &now, domains),
        Kind::Table(rows) => {
            let can_be = |row: &&[Value]| now.iter().zip(*row).all(|(x, &value)| x.has(value));
            let live: Vec<&[Value]> = rows.rows().filter(can_be).collect();
            for (column, &operand) in operands.iter().enumerate() {
                let values = Naive::Set(live.iter().map(|row| row[column]).collect());
                let current = domain(operand, domains);
                set(operand, values.checked()?.meet(&current)?, domains)?;
            }
            Some(())
        }
        Kind::Function(call) => {
            let inputs: Option<Vec<Value>> = now[..last].iter().map(Naive::value).collect();
            match inputs.and_then(|inputs| call(&inputs)) {
                Some(value) => {
                    let only = Naive::Set([value].into());
                    set(operands[last], now[last].meet(&only)?, domains)
                }
                None => Some(()),
            }
        }
    }
}

/// A sum or a product: each operand lies between what the ends of the others leave it.
fn arithmetic(
    kind: &Kind,
    operands: &[Operand],
    now: &[Naive],
    domains: &mut Naives,
) -> Option<()> {
    let is_sum = matches!(kind, Kind::Sum);
    let ends: Vec<[i128; 2]> = now
        .iter()
        .map(|x| [x.ends().0.into(), x.ends().1.into()])
        .collect();
    let (output, inputs) = ends.split_last()?;
    for (at, &operand) in operands.iter().enumerate() {
        // All sums or products of ends of the other inputs.
        let mut corners = vec![i128::from(!is_sum)];
        for (_, ends) in inputs.iter().enumerate().filter(|(other, _)| *other != at) {
            let with = |a: &i128| ends.map(|end| if is_sum { a + end } else { a * end });
            corners = corners.iter().flat_map(with).collect();
        }
        let (least, most) = (*corners.iter().min()?, *corners.iter().max()?);
        let (min, max) = if at == inputs.len() {
            (least, most)
        } else if is_sum {
            (output[0] - most, output[1] - least)
        } else {
            quotients((output[0], output[1]), least, most)?
        };
        let mut current = domain(operand, domains).within(min, max)?;
        let has_zero = current.ends().0 == 0 || current.ends().1 == 0;
        let is_factor = !is_sum && at < inputs.len();
        if is_factor && has_zero && (output[0] > 0 || output[1] < 0) {
            current = current.without(0)?;
        }
        set(operand, current, domains)?;
    }
    Some(())
}

/// Between which whole numbers all quotients of the ends of a product by others lie, tried one by
/// one.
fn quotients(product: (i128, i128), least: i128, most: i128) -> Option<(i128, i128)> {
    let holds_zero = product.0 <= 0 && product.1 >= 0;
    if least <= 0 && most >= 0 && holds_zero {
        return Some((i128::MIN, i128::MAX));
    }
    let mut found: Option<(i128, i128)> = None;
    for by in (least..=most).filter(|&by| by != 0) {
        for end in [product.0, product.1] {
            let exact = end % by == 0;
            let is_negative = (end < 0) != (by < 0);
            let (down, up) = match (exact, is_negative) {
                (true, _) => (end / by, end / by),
                (false, true) => (end / by - 1, end / by),
                (false, false) => (end / by, end / by + 1),
            };
            let (min, max) = found.unwrap_or((up, down));
            found = Some((min.min(up), max.max(down)));
        }
    }
    found
}

/// Whether values satisfy a constraint.
pub(super) fn holds(kind: &Kind, values: &[Value]) -> bool {
    let (last, inputs) = values.split_last().unwrap();
    match kind {
        Kind::In(domain) => domain.contains(*last),
        Kind::Equal => inputs.iter().all(|value| value == last),
        Kind::Different => values[0] != values[1],
        Kind::Less => values[0] < values[1],
        Kind::AtMost => values[0] <= values[1],
        Kind::Sum => inputs.iter().sum::<Value>() == *last,
        Kind::Product => inputs.iter().product::<Value>() == *last,
        Kind::Table(rows) => rows.rows().any(|row| row == values),
        Kind::Function(call) => call(inputs).is_none_or(|value| value == *last),
    }
}
