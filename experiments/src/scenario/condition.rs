//! What must never happen in a run, as scenarios and commands name it: an invariant of the system, or a
//! condition over its metrics.

use std::fmt;
use std::str::FromStr;

use farside::suggest::{did_you_mean, nearest};
use farside::{End, Report};
use farside_actors::system::{Assembly, MetricKind, Removable, Results, System};
use serde_json::Value;

use super::{Scenario, ScenarioError};

/// What is broken if the system itself calls a run wrong.
const VIOLATION: &str = "violation";
/// What is broken if a run fails.
const FAULT: &str = "fault";

/// What of a run the kernel counts, for conditions; a system's own metrics of these names go before.
const COUNTED: [&str; 5] = ["sim_time_s", "events", "sent", "delivered", "lost"];

/// What must never happen.
#[derive(Clone, Debug)]
pub struct Forbidden {
    name: String,
    is_lasting: bool,
    what: What,
}

#[derive(Clone, Debug)]
enum What {
    Fault,
    Violation,
    Condition(Condition),
}

/// `left op right`.
#[derive(Clone, Debug, PartialEq)]
struct Condition {
    left: String,
    op: Op,
    right: Side,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Op {
    Below,
    AtMost,
    Above,
    AtLeast,
    Equal,
    Unequal,
}

#[derive(Clone, Debug, PartialEq)]
enum Side {
    Number(f64),
    Flag(bool),
    Name(String),
}

/// Longer ones first: `<=` begins as `<` does.
const OPS: [(&str, Op); 6] = [
    ("<=", Op::AtMost),
    (">=", Op::AtLeast),
    ("!=", Op::Unequal),
    ("<", Op::Below),
    (">", Op::Above),
    ("=", Op::Equal),
];

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let written = OPS.iter().find(|(_, op)| *op == self.op);
        let op = written.map_or("=", |(text, _)| text);
        let left = &self.left;
        match &self.right {
            Side::Number(number) => write!(f, "{left}{op}{number}"),
            Side::Flag(flag) => write!(f, "{left}{op}{flag}"),
            Side::Name(name) => write!(f, "{left}{op}{name}"),
        }
    }
}

impl FromStr for Condition {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let at = text.find(['<', '>', '=', '!']).ok_or(())?;
        let (left, rest) = text.split_at(at);
        let (written, op) = OPS
            .into_iter()
            .find(|(op, _)| rest.starts_with(op))
            .ok_or(())?;
        let (left, right) = (left.trim(), rest[written.len()..].trim());
        let is_name = |text: &str| {
            let mut letters = text.chars();
            letters.all(|letter| letter.is_alphanumeric() || matches!(letter, '_' | '-'))
        };
        let right = match right {
            "true" => Side::Flag(true),
            "false" => Side::Flag(false),
            number => match number.parse::<f64>() {
                Ok(number) if number.is_finite() => Side::Number(number),
                _ => Side::Name(right.to_owned()),
            },
        };
        let is_whole = match &right {
            Side::Name(name) => !name.is_empty() && is_name(name),
            _ => true,
        };
        if left.is_empty() || !is_name(left) || !is_whole {
            return Err(());
        }
        let left = left.to_owned();
        Ok(Condition { left, op, right })
    }
}

impl Condition {
    fn holds(&self, report: &Report, results: &Results) -> bool {
        let Some(left) = value(&self.left, report, results) else {
            return false;
        };
        let right = match &self.right {
            Side::Number(number) => Value::from(*number),
            Side::Flag(flag) => Value::from(*flag),
            Side::Name(name) => {
                let of_metric = value(name, report, results);
                of_metric.unwrap_or_else(|| Value::from(name.as_str()))
            }
        };
        if let (Some(left), Some(right)) = (left.as_f64(), right.as_f64()) {
            return match self.op {
                Op::Below => left < right,
                Op::AtMost => left <= right,
                Op::Above => left > right,
                Op::AtLeast => left >= right,
                Op::Equal => left == right,
                Op::Unequal => left != right,
            };
        }
        match self.op {
            Op::Equal => left == right,
            // What is no number is not comparable with one.
            Op::Unequal => left != right && !left.is_number() && !right.is_number(),
            _ => false,
        }
    }
}

/// A metric, or what the kernel counts; none if the run has no such thing.
fn value(name: &str, report: &Report, results: &Results) -> Option<Value> {
    if let Some(value) = results.metrics.get(name) {
        return Some(value.clone()).filter(|value| !value.is_null());
    }
    let counts = &report.counts;
    Some(match name {
        "sim_time_s" => report.end_time.as_secs_f64().into(),
        "events" => counts.events.into(),
        "sent" => counts.sent.into(),
        "delivered" => counts.delivered.into(),
        "lost" => counts.lost.into(),
        _ => return None,
    })
}

impl Forbidden {
    /// Reads what a system's runs must never come to: the name of an invariant, `violation`, `fault`,
    /// or a condition.
    ///
    /// ```
    /// use farside_experiments::registry::Registry;
    /// use farside_experiments::scenario::Forbidden;
    /// let registry = Registry::builtin();
    /// let network = registry.find("network")?;
    /// assert!(Forbidden::parse("collision", network).is_ok());
    /// assert!(Forbidden::parse("arrived < rovers", network).is_ok());
    /// let error = Forbidden::parse("colision", network).unwrap_err();
    /// assert!(error.ends_with("did you mean \"collision\"?"), "{error}");
    /// # Ok::<(), farside_experiments::registry::UnknownSystem>(())
    /// ```
    ///
    /// # Errors
    /// What was found and what was expected, with the nearest name.
    pub fn parse(text: &str, system: &dyn System) -> Result<Forbidden, String> {
        let text = text.trim();
        let named = |what, is_lasting| Forbidden {
            name: text.to_owned(),
            is_lasting,
            what,
        };
        match text {
            FAULT => return Ok(named(What::Fault, true)),
            VIOLATION => return Ok(named(What::Violation, false)),
            _ => {}
        }
        let mut invariants = system.invariants().iter();
        if let Some(invariant) = invariants.find(|one| one.name == text) {
            let condition = read(invariant.condition, system)?;
            return Ok(named(What::Condition(condition), invariant.is_lasting));
        }
        let mut forbidden = named(What::Condition(read(text, system)?), false);
        if let What::Condition(condition) = &forbidden.what {
            forbidden.name = condition.to_string();
        }
        Ok(forbidden)
    }

    /// As it is called: the invariant's name, or the condition.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether it is broken for good once it is.
    pub(crate) fn is_lasting(&self) -> bool {
        self.is_lasting
    }

    /// Whether a run has come to it.
    pub(crate) fn is_broken(&self, report: &Report, results: &Results) -> bool {
        match &self.what {
            What::Fault => matches!(report.end, End::Fault(_)),
            What::Violation => !results.violations.is_empty(),
            What::Condition(condition) => condition.holds(report, results),
        }
    }

    /// What has happened, in a sentence for people.
    pub(crate) fn sentence(&self) -> String {
        match &self.what {
            What::Condition(condition) if self.name != condition.to_string() => {
                format!("{}, which must never be: {condition}", self.name)
            }
            _ => format!("{}, which must never be", self.name),
        }
    }
}

/// All names that can stand for what must never happen.
pub(crate) fn names(system: &dyn System) -> Vec<&str> {
    let own = system.invariants().iter().map(|one| one.name);
    own.chain([VIOLATION, FAULT]).collect()
}

/// A condition over what runs of a system are measured by.
fn read(text: &str, system: &dyn System) -> Result<Condition, String> {
    let metrics = || system.metrics().iter().map(|metric| metric.name);
    let known = |name: &str| metrics().chain(COUNTED).any(|known| known == name);
    let Ok(condition) = text.parse::<Condition>() else {
        let all = names(system);
        let hint = did_you_mean(nearest(text, all.iter().copied()).as_deref());
        return Err(format!(
            "{text:?}: expected {}, or a condition over metrics, as in sim_time_s>60{hint}",
            all.join(", ")
        ));
    };
    let unknown = |name: &str| {
        let hint = did_you_mean(nearest(name, metrics().chain(COUNTED)).as_deref());
        let system = system.name();
        Err(format!(
            "{text:?}: {name:?} is no metric of the system {system}{hint}"
        ))
    };
    if !known(&condition.left) {
        return unknown(&condition.left);
    }
    let is_word = |metric: &farside_actors::system::Metric| {
        metric.name == condition.left && matches!(metric.kind, MetricKind::Word)
    };
    match &condition.right {
        Side::Name(name) if !known(name) && !system.metrics().iter().any(is_word) => unknown(name),
        _ => Ok(condition),
    }
}

impl Scenario {
    /// Reads what must never happen.
    pub(super) fn read_never(&mut self, system: &dyn System) -> Result<(), ScenarioError> {
        for (index, text) in self.shared.never.iter().enumerate() {
            let forbidden = Forbidden::parse(text, system);
            let key = || vec!["never".to_owned(), index.to_string()];
            let forbidden = forbidden.map_err(|message| self.invalid(key(), message))?;
            self.forbidden.push(forbidden);
        }
        Ok(())
    }

    /// Lets the results of a run say what must never happen and did.
    pub(super) fn forbid(&self, system: &mut Assembly) {
        if self.forbidden.is_empty() {
            return;
        }
        let forbidden = self.forbidden.clone();
        let plainly = Box::new(|_: &Report| Results::default());
        let conclude = std::mem::replace(&mut system.conclude, plainly);
        system.conclude = Box::new(move |report| {
            let mut results = conclude(report);
            let broken = forbidden
                .iter()
                .filter(|one| one.is_broken(report, &results));
            let broken: Vec<String> = broken.map(Forbidden::sentence).collect();
            results.violations.extend(broken);
            results
        });
    }

    /// What of the system's settings a smaller scenario can be without.
    pub(crate) fn removable(&self) -> Vec<Removable> {
        self.settings.removable()
    }
}

#[cfg(test)]
mod tests {
    use farside::{Executor, Simulation};

    use super::*;
    use crate::registry::Registry;

    fn report() -> Report {
        Simulation::new(1).run(Executor::Inline).unwrap()
    }

    #[test]
    fn conditions_compare_numbers_flags_words_and_metrics() {
        let results = Results::default()
            .metric("arrived", 3)
            .metric("rovers", 4)
            .metric("completed", false)
            .metric("makespan", Value::Null)
            .metric("outcome", "deadlock");
        let report = report();
        let holds = |text: &str| {
            let condition: Condition = text.parse().unwrap();
            assert_eq!(condition.to_string().parse(), Ok(condition.clone()));
            condition.holds(&report, &results)
        };
        for (text, expected) in [
            ("arrived<rovers", true),
            (" arrived >= 3 ", true),
            ("arrived>3", false),
            ("arrived!=4", true),
            ("completed=false", true),
            ("completed=true", false),
            ("outcome=deadlock", true),
            ("outcome!=deadlock", false),
            ("makespan<10", false),
            ("makespan>=10", false),
            ("outcome>2", false),
            ("events=0", true),
            ("gone=0", false),
        ] {
            assert_eq!(holds(text), expected, "{text}");
        }
        for text in [
            "",
            "arrived",
            "<3",
            "arrived<",
            "arrived<>3",
            "a b<3",
            "a<3 4",
        ] {
            assert_eq!(text.parse::<Condition>(), Err(()), "{text:?}");
        }
    }

    #[test]
    fn every_invariant_of_every_system_is_a_condition_over_its_metrics() {
        for system in Registry::builtin().systems() {
            let names: Vec<&str> = system.invariants().iter().map(|one| one.name).collect();
            assert!(names.is_sorted(), "{}: {names:?}", system.name());
            for invariant in system.invariants() {
                let read = Forbidden::parse(invariant.name, system);
                let read = read.unwrap_or_else(|error| panic!("{}: {error}", system.name()));
                assert_eq!(read.is_lasting(), invariant.is_lasting);
                assert!(!invariant.about.is_empty());
            }
        }
    }

    #[test]
    fn what_is_no_invariant_is_named_with_the_nearest() {
        let registry = Registry::builtin();
        let network = registry.find("network").unwrap();
        let error = |text: &str| Forbidden::parse(text, network).unwrap_err();
        assert_eq!(
            error("deadlok"),
            "\"deadlok\": expected collision, deadlock, no_progress, unfinished, violation, fault, or a \
             condition over metrics, as in sim_time_s>60; did you mean \"deadlock\"?"
        );
        assert_eq!(
            error("arived<rovers"),
            "\"arived<rovers\": \"arived\" is no metric of the system network; did you mean \"arrived\"?"
        );
        assert!(error("arrived<rover").ends_with("did you mean \"rovers\"?"));
    }
}
