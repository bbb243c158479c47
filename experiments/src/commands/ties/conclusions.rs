//! Which conclusions differ between runs whose ties are broken otherwise, and how.

use std::cmp::Ordering;
use std::collections::BTreeSet;

use serde::Serialize;
use serde_json::Value;

use super::runs::Ran;

/// By what share of itself a number may differ and be the same: sums of the same numbers in another order
/// differ by less.
pub(super) const TOLERANCE: f64 = 1e-9;

/// By how much it may in any case: what is zero but for rounding has no share.
const NOTHING: f64 = 1e-12;

/// A conclusion that is not the same in all runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Changed {
    /// `end`, `broken: NAME`, `sim_time_s`, or the name of a metric.
    pub(super) name: String,
    /// What it is in which runs: numbers in their order, all else most often first.
    pub(super) values: Vec<Held>,
    /// The least of its numbers, if it is one in all runs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) min: Option<f64>,
    /// The middle one of all runs, or the mean of the two in the middle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) median: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) max: Option<f64>,
    /// What it is in the first run, which is that of the scenario as it is.
    own: usize,
}

/// A value, and the tie seeds that come to it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Held {
    pub(super) value: Value,
    pub(super) tie_seeds: Vec<Option<u64>>,
}

impl Changed {
    /// What it is in the scenario as it is.
    pub(super) fn own(&self) -> &Held {
        &self.values[self.own]
    }

    /// Two runs that come to something else: the scenario as it is, and the first other.
    pub(super) fn parted(&self) -> [Option<u64>; 2] {
        let own = self.own().tie_seeds[0];
        let others = self.values.iter().enumerate();
        let others = others.filter(|(at, _)| *at != self.own);
        // Its own tie seed may be the greatest; the others are in order.
        let first = others.map(|(_, held)| held.tie_seeds[0]).min();
        [own, first.unwrap_or(own)]
    }
}

/// How many digests there are.
pub(super) fn digests(ran: &[Ran]) -> usize {
    let all: BTreeSet<&str> = ran.iter().map(|ran| ran.digest.as_str()).collect();
    all.len()
}

/// The conclusions that are not the same in all runs, in their order.
pub(super) fn changed(ran: &[Ran]) -> Vec<Changed> {
    let mut names: Vec<&str> = Vec::new();
    for (name, _) in ran.iter().flat_map(|ran| &ran.conclusions) {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    let changed = names.into_iter().map(|name| of_one(name, ran));
    changed.flatten().collect()
}

/// How one conclusion differs; none if it does not.
fn of_one(name: &str, ran: &[Ran]) -> Option<Changed> {
    let value = |ran: &Ran| {
        let mut all = ran.conclusions.iter();
        let found = all.find(|(known, _)| known == name);
        found.map_or(Value::Null, |(_, value)| value.clone())
    };
    let mut values: Vec<Held> = Vec::new();
    for ran in ran {
        let value = value(ran);
        match values.iter_mut().find(|held| is_same(&held.value, &value)) {
            Some(held) => held.tie_seeds.push(ran.tie_seed),
            None => values.push(Held {
                value,
                tie_seeds: vec![ran.tie_seed],
            }),
        }
    }
    if values.len() < 2 {
        return None;
    }
    let own = values[0].value.clone();
    let numbers: Option<Vec<f64>> = ran.iter().map(|ran| value(ran).as_f64()).collect();
    match &numbers {
        Some(_) => values.sort_by(|a, b| by_number(&a.value, &b.value)),
        None => values.sort_by_key(|held| std::cmp::Reverse(held.tie_seeds.len())),
    }
    let numbers = numbers.map(|mut numbers| {
        numbers.sort_by(f64::total_cmp);
        numbers
    });
    let numbers = numbers.as_deref();
    Some(Changed {
        name: name.to_owned(),
        own: values.iter().position(|held| held.value == own)?,
        min: numbers.map(|numbers| numbers[0]),
        median: numbers.map(median),
        max: numbers.map(|numbers| numbers[numbers.len() - 1]),
        values,
    })
}

fn by_number(a: &Value, b: &Value) -> Ordering {
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    number(a).total_cmp(&number(b))
}

fn median(sorted: &[f64]) -> f64 {
    let middle = sorted.len() / 2;
    match sorted.len() % 2 {
        1 => sorted[middle],
        _ => f64::midpoint(sorted[middle - 1], sorted[middle]),
    }
}

/// Whether two values are the same, but for how their sums were rounded.
fn is_same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Number(_), Value::Number(_)) if a != b => match (a.as_f64(), b.as_f64()) {
            (Some(a), Some(b)) => (a - b).abs() <= NOTHING.max(TOLERANCE * a.abs().max(b.abs())),
            _ => false,
        },
        (Value::Array(a), Value::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| is_same(a, b))
        }
        (Value::Object(a), Value::Object(b)) => {
            let same = |(name, value)| b.get(name).is_some_and(|other| is_same(value, other));
            a.len() == b.len() && a.iter().all(same)
        }
        _ => a == b,
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn ran(tie_seed: Option<u64>, value: Value) -> Ran {
        Ran {
            tie_seed,
            digest: format!("{tie_seed:?}"),
            has_failed: false,
            conclusions: vec![("same".to_owned(), json!(1)), ("x".to_owned(), value)],
        }
    }

    #[test]
    fn numbers_have_the_seeds_that_give_them_and_a_middle() {
        let values = [(None, 4.0), (Some(1), 2.0), (Some(2), 4.0), (Some(3), 9.0)];
        let all: Vec<Ran> = values
            .into_iter()
            .map(|(seed, value)| ran(seed, json!(value)))
            .collect();
        let changed = changed(&all);
        let [changed] = &changed[..] else {
            panic!("{changed:?}");
        };
        assert_eq!(
            (changed.min, changed.median, changed.max),
            (Some(2.0), Some(4.0), Some(9.0))
        );
        let seeds: Vec<&[Option<u64>]> = changed.values.iter().map(|v| &v.tie_seeds[..]).collect();
        assert_eq!(seeds, [&[Some(1)][..], &[None, Some(2)], &[Some(3)]]);
        assert_eq!(changed.own().value, json!(4.0));
        assert_eq!(changed.parted(), [None, Some(1)]);
        assert_eq!(digests(&all), 4);
    }

    #[test]
    fn an_even_number_of_runs_has_the_mean_of_two_as_its_middle() {
        assert_eq!((median(&[1.0, 4.0]), median(&[1.0, 4.0, 5.0])), (2.5, 4.0));
    }

    #[test]
    fn what_differs_in_how_it_was_rounded_is_the_same() {
        let same = |a, b| is_same(&a, &b);
        assert!(same(json!(0.1 + 0.2), json!(0.3)));
        assert!(same(json!([1.0, null]), json!([1.0 + 1e-12, null])));
        assert!(same(json!({"a": 2}), json!({"a": 2.0})));
        assert!(!same(json!(1.0), json!(1.0 + 1e-8)));
        assert!(
            same(json!(1e-15), json!(2e-15))
                && !same(json!(0), json!(1e-11))
                && !same(json!(null), json!(0))
        );
        assert!(!same(json!([1]), json!([1, 2])) && !same(json!({"a": 1}), json!({"b": 1})));
    }

    #[test]
    fn words_come_most_often_first_and_a_metric_that_is_missing_counts() {
        let word = |seed, word: &str| ran(seed, json!(word));
        let mut all = vec![
            word(None, "late"),
            word(Some(1), "done"),
            word(Some(2), "done"),
        ];
        let found = changed(&all);
        assert_eq!(found[0].values[0].value, json!("done"));
        assert_eq!(found[0].own().value, json!("late"));
        assert_eq!((found[0].min, found[0].parted()), (None, [None, Some(1)]));
        all.iter_mut().for_each(|ran| drop(ran.conclusions.pop()));
        assert_eq!(changed(&all), []);
        all[1].conclusions.push(("more".to_owned(), json!(3)));
        assert_eq!(changed(&all)[0].name, "more");
        assert_eq!(changed(&all)[0].values.len(), 2);
    }
}
