//! Goals: when they are wanted, what they are worth, and those that recur.

use super::Reader;
use crate::Ticks;
use crate::language::analyse::entry::Entry;
use crate::language::analyse::literal;
use crate::language::analyse::pattern::{Master, Variables};
use crate::language::tree::{Form, Kind};
use crate::model::Goal;
use crate::temporal::Span;

/// How many goals a recurring one may become.
const MOST_INSTANCES: i64 = 100_000;

/// When a goal recurs.
struct Recurrence {
    every: Ticks,
    from: Ticks,
    to: Ticks,
    /// Its times, counted from each instant.
    start: Span,
    finish: Span,
    /// Whether the text leaves open when the last one is.
    is_open: bool,
}

impl<'t> Reader<'t, '_> {
    pub(super) fn goal(&mut self, entry: &Entry<'t>) {
        let known = [
            ":start",
            ":end",
            ":duration",
            ":weight",
            ":mandatory",
            ":every",
            ":from",
            ":to",
        ];
        entry.check_options(&known, self.scope.notes);
        let &[name, form] = entry.values.as_slice() else {
            self.scope
                .notes
                .error(entry.form, "(Goal name (SINGLE …) :mandatory)");
            return;
        };
        if name.symbol().is_none() {
            self.scope.notes.error(name, "the goal's name");
            return;
        }
        let mut variables = Variables::default();
        let found = self.scope.pattern(form, &mut variables, &Master::default());
        let weight = self.worth(entry);
        let duration = self.duration(entry);
        let (Some(found), Some(weight), Some(duration)) = (found, weight, duration) else {
            return;
        };
        let whole = Span::new(0, self.problem.horizon);
        let goal = Goal {
            name: name.word().to_owned(),
            position: entry.form.position(),
            pattern: found.pattern,
            variables: variables.list,
            start: whole,
            finish: whole,
            duration,
            weight,
        };
        if entry.keyword(":every").is_some() {
            self.recur(entry, name, &goal);
            return;
        }
        for option in [":from", ":to"] {
            if let Some(keyword) = entry.keyword(option) {
                self.scope.notes.error(keyword, "an option :every as well");
            }
        }
        let start = self.times(entry, ":start", whole);
        let finish = self.times(entry, ":end", whole);
        let (Some(start), Some(finish)) = (start, finish) else {
            return;
        };
        self.add(
            name,
            Goal {
                start,
                finish,
                ..goal
            },
        );
    }

    /// What a goal is worth, or none if it is mandatory.
    fn worth(&mut self, entry: &Entry<'t>) -> Option<Option<f64>> {
        let (weight, mandatory) = (entry.keyword(":weight"), entry.keyword(":mandatory"));
        if let Some(&more) = entry.option(":mandatory").first() {
            self.scope.notes.error(more, "nothing after :mandatory");
        }
        match (weight, mandatory) {
            (Some(_), None) => self.weight(entry).map(Some),
            (None, Some(_)) => Some(None),
            (Some(_), Some(both)) => {
                self.scope
                    .notes
                    .error(both, "either a :weight or :mandatory");
                None
            }
            (None, None) => {
                self.scope
                    .notes
                    .refuse(entry.form, "a :weight or :mandatory", "neither");
                None
            }
        }
    }

    /// A weight, which must be given.
    pub(super) fn weight(&mut self, entry: &Entry<'t>) -> Option<f64> {
        let Some(form) = entry.one(":weight", self.scope.notes) else {
            if entry.keyword(":weight").is_none() {
                self.scope.notes.refuse(entry.form, "a :weight", "none");
            }
            return None;
        };
        let literal = literal::resolve(form, self.scope.constants);
        let is_number = matches!(literal.kind(), Kind::Number | Kind::Decimal);
        let weight: Option<f64> = literal.word().parse().ok().filter(|_| is_number);
        let weight = weight.filter(|weight| weight.is_finite());
        if weight.is_none() {
            self.scope.notes.error(form, "a number that is finite");
        }
        weight
    }

    fn duration(&mut self, entry: &Entry<'t>) -> Option<Span> {
        let whole = Span::new(0, self.problem.horizon);
        let Some(form) = entry.one(":duration", self.scope.notes) else {
            return entry.keyword(":duration").is_none().then_some(whole);
        };
        let span = self.span(form)?;
        if span.min < 0 && span.min != Ticks::MIN {
            self.scope
                .notes
                .error(form, "a duration that is not negative");
            return None;
        }
        let within = span.intersect(whole);
        if within.is_empty() {
            let expected = format!("a duration within the horizon [0 {}]", self.problem.horizon);
            self.scope.notes.error(form, expected);
            return None;
        }
        Some(within)
    }

    /// Adds a goal for each instant `from`, `from + every`, … up to and with `to`, its times
    /// counted from there.
    fn recur(&mut self, entry: &Entry<'t>, name: Form<'t>, goal: &Goal) {
        let Some(recurrence) = self.recurrence(entry) else {
            return;
        };
        let Recurrence {
            every, from, to, ..
        } = recurrence;
        self.recurring.insert(name.word());
        let instants = (0..=(to - from) / every).map(|count| from + count * every);
        for (count, instant) in instants.enumerate() {
            let start = self.shifted(recurrence.start, instant);
            let finish = self.shifted(recurrence.finish, instant);
            let name_text = format!("{}_{}", goal.name, count + 1);
            let one = Goal {
                name: name_text,
                start,
                finish,
                ..goal.clone()
            };
            // Without an end of their own, they end with the horizon.
            if recurrence.is_open && count > 0 && !fits(&one) {
                return;
            }
            let size = name.size() + one.pattern.timelines.len() + one.pattern.arguments.len();
            let spent = self.scope.spend(name.position(), size);
            if spent.is_none() || !self.add(name, one) {
                return;
            }
        }
    }

    fn recurrence(&mut self, entry: &Entry<'t>) -> Option<Recurrence> {
        let horizon = self.problem.horizon;
        let mut number = |option: &str, usual: Ticks, least: Ticks| {
            let Some(form) = entry.one(option, self.scope.notes) else {
                return Some(usual);
            };
            let value = self.scope.number(form)?;
            if value < least || value > horizon {
                let expected = format!("a tick from {least} to the horizon's end, {horizon}");
                self.scope.notes.error(form, expected);
                return None;
            }
            Some(value)
        };
        let every = number(":every", 0, 1);
        let (from, to) = (number(":from", 0, 0), number(":to", horizon, 0));
        let mut offsets = |option: &str, usual: Span| match entry.one(option, self.scope.notes) {
            Some(form) => literal::span(form, self.scope.constants, self.scope.notes),
            None => Some(usual),
        };
        let start = offsets(":start", Span::exactly(0));
        let finish = offsets(":end", Span::ALL);
        let (every, from, to) = (every.filter(|every| *every > 0)?, from?, to?);
        if from > to || (to - from) / every >= MOST_INSTANCES {
            let expected =
                format!("one instant or more, at most {MOST_INSTANCES}, from :from to :to");
            let found = format!("[{from} {to}] every {every}");
            self.scope.notes.refuse(entry.form, expected, found);
            return None;
        }
        let is_open = entry.keyword(":to").is_none();
        Some(Recurrence {
            every,
            from,
            to,
            start: start?,
            finish: finish?,
            is_open,
        })
    }

    /// Times that are counted from an instant, within the horizon.
    fn shifted(&self, times: Span, instant: Ticks) -> Span {
        let shifted = |side: Ticks| match side {
            Ticks::MIN | Ticks::MAX => side,
            _ => side.saturating_add(instant),
        };
        let times = Span::new(shifted(times.min), shifted(times.max));
        times.intersect(Span::new(0, self.problem.horizon))
    }

    /// Adds a goal; whether it can be one.
    fn add(&mut self, name: Form<'t>, goal: Goal) -> bool {
        if self.goals.contains_key(&goal.name) || self.recurring.contains(goal.name.as_str()) {
            self.scope
                .notes
                .refuse(name, "a name that no other goal has", goal.name);
            return false;
        }
        if !fits(&goal) {
            let expected = format!("times in which {} fits", goal.name);
            let found = format!(
                "start {:?}, end {:?}, duration {:?} within the horizon [0 {}]",
                goal.start, goal.finish, goal.duration, self.problem.horizon
            );
            self.scope.notes.refuse(name, expected, found);
            return false;
        }
        self.goals
            .insert(goal.name.clone(), self.problem.goals.len());
        self.problem.goals.push(goal);
        true
    }
}

/// Whether some times of a goal are of its duration.
fn fits(goal: &Goal) -> bool {
    let earliest = goal
        .start
        .min
        .saturating_add(goal.duration.min)
        .max(goal.finish.min);
    let latest = goal
        .start
        .max
        .saturating_add(goal.duration.max)
        .min(goal.finish.max);
    !goal.start.is_empty() && !goal.finish.is_empty() && earliest <= latest
}
