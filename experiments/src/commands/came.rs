//! What came of two runs: how they ended, and the metrics in which they differ.

use std::fmt;
use std::path::Path;

use farside::Report;
use farside_actors::system::Results;
use serde::Serialize;
use serde_json::{Map, Value};

use super::CommandError;
use super::interrupt;
use super::logged::scenario_of;
use super::run::{ExecutorName, ending};
use crate::registry::Registry;

/// Metrics that people are shown.
const SHOWN: usize = 12;

/// Letters of a value that people are shown.
const LETTERS: usize = 60;

/// What came of a run.
pub(super) struct Came {
    ending: String,
    metrics: Map<String, Value>,
    violations: Vec<String>,
}

impl Came {
    /// Of a run that was executed.
    pub(super) fn of(report: &Report, results: &Results) -> Self {
        let mut metrics = results.metrics.clone();
        // Counts of events and messages by name are always a JSON object.
        if let Ok(counts) = serde_json::to_value(&report.counts) {
            metrics.insert("messages".to_owned(), counts);
        }
        Came {
            ending: ending(report),
            metrics,
            violations: results.violations.clone(),
        }
    }

    /// Of the run that a log is of: executed again, from the start to its end.
    pub(super) fn again(path: &Path, registry: &Registry) -> Result<Self, CommandError> {
        let not_repeatable = |reason: &str| CommandError::NotRepeatable {
            path: path.to_owned(),
            reason: reason.to_owned(),
        };
        let summary = farside_logs::info(path)?.run;
        let summary =
            summary.ok_or_else(|| not_repeatable("it is not the log of a Farside run"))?;
        let scenario = scenario_of(path, &summary, registry)?;
        let mut assembled = scenario.assemble()?;
        assembled.sim.tie_seed(summary.tie_seed);
        interrupt::raise_on_interrupt(assembled.sim.interrupt());
        let executor = ExecutorName::Auto.executor(&assembled.sim, None);
        let report = assembled.sim.run(executor)?;
        if report.end == farside::End::Interrupted {
            return Err(not_repeatable("it was interrupted as it was run again"));
        }
        let results = (assembled.system.conclude)(&report);
        Ok(Came::of(&report, &results))
    }
}

/// A metric that two runs do not have alike.
#[derive(Serialize)]
pub(super) struct Differs {
    /// Its name; of a list or a table, with the place in it.
    metric: String,
    a: Value,
    b: Value,
}

/// What came of two runs, where it differs.
#[derive(Serialize)]
pub(super) struct BothCame {
    /// How they ended.
    ends: [String; 2],
    metrics: Vec<Differs>,
    /// What must not be and was, in either.
    violations: [Vec<String>; 2],
}

impl BothCame {
    pub(super) fn new(a: Came, b: Came) -> Self {
        let mut metrics = Vec::new();
        let (x, y) = (Value::Object(a.metrics), Value::Object(b.metrics));
        differing("", Some(&x), Some(&y), &mut metrics);
        BothCame {
            ends: [a.ending, b.ending],
            metrics,
            violations: [a.violations, b.violations],
        }
    }
}

/// Adds what differs of two values: of lists and tables each part by itself.
fn differing(name: &str, a: Option<&Value>, b: Option<&Value>, found: &mut Vec<Differs>) {
    let inner = |key: &str| match name {
        "" => key.to_owned(),
        name => format!("{name}.{key}"),
    };
    match (a, b) {
        (a, b) if a == b => {}
        (Some(Value::Object(x)), Some(Value::Object(y))) => {
            let mut keys: Vec<&String> = x.keys().chain(y.keys()).collect();
            keys.sort();
            keys.dedup();
            for key in keys {
                differing(&inner(key), x.get(key), y.get(key), found);
            }
        }
        (Some(Value::Array(x)), Some(Value::Array(y))) if x.len() == y.len() => {
            for (at, (x, y)) in x.iter().zip(y).enumerate() {
                differing(&format!("{name}[{at}]"), Some(x), Some(y), found);
            }
        }
        (a, b) => found.push(Differs {
            metric: name.to_owned(),
            a: a.cloned().unwrap_or_default(),
            b: b.cloned().unwrap_or_default(),
        }),
    }
}

impl fmt::Display for BothCame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b] = &self.ends;
        match a == b {
            true => writeln!(f, "both {a}")?,
            false => writeln!(f, "one {a}\nthe other {b}")?,
        }
        let [a, b] = &self.violations;
        for (which, violations) in [("one", a), ("the other", b)] {
            for violation in violations {
                writeln!(f, "VIOLATED in {which}: {violation}")?;
            }
        }
        let count = self.metrics.len();
        if count == 0 {
            return writeln!(f, "no metric differs");
        }
        let word = if count == 1 {
            "metric differs"
        } else {
            "metrics differ"
        };
        writeln!(f, "{count} {word}")?;
        let value = |value: &Value| {
            let text = value.to_string();
            match text.char_indices().nth(LETTERS) {
                Some((at, _)) => format!("{}...", &text[..at]),
                None => text,
            }
        };
        for Differs { metric, a, b } in self.metrics.iter().take(SHOWN) {
            writeln!(f, "  {metric}: {} | {}", value(a), value(b))?;
        }
        match count.saturating_sub(SHOWN) {
            0 => Ok(()),
            more => writeln!(f, "  and {more} more (--json has all)"),
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn came(ending: &str, metrics: &Value) -> Came {
        Came {
            ending: ending.to_owned(),
            metrics: metrics.as_object().cloned().unwrap_or_default(),
            violations: Vec::new(),
        }
    }

    #[test]
    fn parts_of_lists_and_tables_are_compared_each_by_itself() {
        let a = json!({"arrived": 3, "arrival_s": [1.0, 2.0], "lost": {"loss": 1}, "why": null});
        let b = json!({"arrived": 3, "arrival_s": [1.0, 2.5], "lost": {"burst": 1}, "why": [1]});
        let both = BothCame::new(came("x", &a), came("y", &b));
        assert_eq!(
            both.to_string(),
            "one x\nthe other y\n4 metrics differ\n  arrival_s[1]: 2.0 | 2.5\n  \
             lost.burst: null | 1\n  lost.loss: 1 | null\n  why: null | [1]\n"
        );
        let same = BothCame::new(came("x", &a), came("x", &a));
        assert_eq!(same.to_string(), "both x\nno metric differs\n");
    }
}
