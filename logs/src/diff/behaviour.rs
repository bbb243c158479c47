//! How topics behave in two logs: how often there are messages, how long there is none, and which fields
//! changed by how much.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use serde::Serialize;

use crate::envelope::seconds;
use crate::fields::{Differs, Path};
use crate::value::Value;

/// How often there are messages on a topic of one log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Rate {
    /// Messages a second, from the first to the last; 0 of fewer than two.
    pub rate_hz: f64,
    /// The longest time without a message between the first and the last, in seconds.
    pub largest_gap_s: f64,
}

/// A field that differs in messages that both logs have.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FieldChange {
    /// The field; `[]` stands for any element of a list.
    pub field: String,
    /// In how many values it differs.
    pub changed: u64,
    /// By how much, on average, where both are numbers or times in seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean: Option<f64>,
    /// By how much at most.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub most: Option<f64>,
}

/// The times of the messages of a topic.
#[derive(Clone, Copy, Default)]
pub(super) struct Times {
    count: u64,
    first_ns: u64,
    last_ns: u64,
    gap_ns: u64,
}

impl Times {
    pub(super) fn add(&mut self, time_ns: u64) {
        match self.count {
            0 => self.first_ns = time_ns,
            _ => self.gap_ns = self.gap_ns.max(time_ns.saturating_sub(self.last_ns)),
        }
        self.last_ns = self.last_ns.max(time_ns);
        self.first_ns = self.first_ns.min(time_ns);
        self.count += 1;
    }

    pub(super) fn rate(&self) -> Rate {
        let length_s = seconds(self.last_ns - self.first_ns.min(self.last_ns));
        let rate_hz = match self.count {
            0 | 1 => 0.0,
            _ if length_s == 0.0 => 0.0,
            count => (count - 1) as f64 / length_s,
        };
        Rate {
            rate_hz,
            largest_gap_s: seconds(self.gap_ns),
        }
    }
}

/// Fields that are told apart on a topic.
const FIELDS: usize = 200;

/// The fields that differ on a topic.
#[derive(Default)]
pub(super) struct Changes {
    fields: BTreeMap<String, Change>,
}

#[derive(Default)]
struct Change {
    changed: u64,
    numbers: u64,
    sum: f64,
    most: f64,
}

impl Changes {
    /// Counts a difference of a field, and by how much, if that can be said.
    pub(super) fn add(&mut self, field: String, apart: Option<f64>) {
        let field = match self.fields.len() >= FIELDS && !self.fields.contains_key(&field) {
            true => "...".to_owned(),
            false => field,
        };
        let change = self.fields.entry(field).or_default();
        change.changed += 1;
        if let Some(apart) = apart.filter(|apart| apart.is_finite()) {
            change.numbers += 1;
            change.sum += apart;
            change.most = change.most.max(apart);
        }
    }

    /// What changed, most often first.
    pub(super) fn told(self) -> Vec<FieldChange> {
        let told = |(field, change): (String, Change)| FieldChange {
            field,
            changed: change.changed,
            mean: (change.numbers > 0).then(|| change.sum / change.numbers as f64),
            most: (change.numbers > 0).then_some(change.most),
        };
        let mut told: Vec<FieldChange> = self.fields.into_iter().map(told).collect();
        told.sort_by(|a, b| {
            b.changed
                .cmp(&a.changed)
                .then_with(|| a.field.cmp(&b.field))
        });
        told
    }
}

/// A path in which all elements of a list are one.
fn pattern(path: &Path<'_>) -> String {
    match path {
        Path::Root(name) => (*name).to_owned(),
        Path::Field(Path::Root(""), name) => (*name).to_owned(),
        Path::Field(path, name) => format!("{}.{name}", pattern(path)),
        Path::Entry(path, _) => format!("{}[]", pattern(path)),
    }
}

impl Differs for Changes {
    fn differs(
        &mut self,
        path: &Path<'_>,
        a: Option<&Value<'_>>,
        b: Option<&Value<'_>>,
    ) -> ControlFlow<()> {
        let times = (a.and_then(Value::as_time_ns), b.and_then(Value::as_time_ns));
        let apart = match (times, a, b) {
            ((Some(x), Some(y)), ..) => Some(x.abs_diff(y) as f64 / 1e9),
            (_, Some(x), Some(y)) if !matches!(x, Value::Enum { .. } | Value::Bool(_)) => {
                x.as_f64().zip(y.as_f64()).map(|(x, y)| (x - y).abs())
            }
            _ => None,
        };
        let field = pattern(path);
        self.add(
            if field.is_empty() {
                "data".to_owned()
            } else {
                field
            },
            apart,
        );
        ControlFlow::Continue(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_and_gaps_are_those_between_the_first_and_the_last() {
        let mut times = Times::default();
        for time_ns in [1_000_000_000, 1_500_000_000, 3_000_000_000] {
            times.add(time_ns);
        }
        let rate = Rate {
            rate_hz: 1.0,
            largest_gap_s: 1.5,
        };
        assert_eq!(times.rate(), rate);
        assert_eq!(Times::default().rate(), Rate::default());
    }
}
