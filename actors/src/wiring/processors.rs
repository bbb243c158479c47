//! Processors from a scenario, by name.

use std::collections::{BTreeMap, BTreeSet};

use farside::suggest::closest;
use farside::{SimDuration, SimTime};

use super::pattern::{Pattern, shape};
use crate::link::{Degrade, LinkConfigError};
use crate::processor::{Processor, Slowdown, Speed};

/// The degradations of processors.
#[derive(Default)]
pub(super) struct Slowdowns(Vec<(Pattern, Degrade, Slowdown)>);

/// A system's processors, by their names `{host}/{processor}`.
#[derive(Clone, Debug, Default)]
pub(super) struct Processors(BTreeMap<String, Processor>);

/// A processor that is wanted: its host, its name there, and its speed.
type Wanted = (String, String, Speed);

impl Processors {
    /// All of them, never slowed down.
    pub(super) fn healthy(wanted: &[Wanted]) -> Self {
        let all = wanted.iter().map(|(host, name, speed)| {
            let processor = Processor::new(*speed);
            (format!("{host}/{name}"), processor)
        });
        Processors(all.collect())
    }

    pub(super) fn get(&self, name: &str) -> Option<&Processor> {
        self.0.get(name)
    }

    /// What has no effect, for people.
    pub(super) fn remarks(&self) -> impl Iterator<Item = String> + '_ {
        let mut all = self.0.values();
        let idle = all.any(|processor| {
            processor.speed() == Speed::Unlimited && processor.slowdowns().next().is_some()
        });
        let remark = "processors: slowdown of a processor that is unlimited: it takes no time";
        idle.then(|| remark.to_owned()).into_iter()
    }
}

impl Slowdowns {
    pub(super) fn add(&mut self, pattern: Pattern, when: Degrade, slowdown: Slowdown) {
        self.0.push((pattern, when, slowdown));
    }

    /// The wanted processors with their timelines; from each of some instants on as other degradations say.
    ///
    /// # Errors
    /// When a pattern matches none of them, with the nearest name.
    pub(super) fn apply<'a>(
        &mut self,
        changed: impl Iterator<Item = (SimDuration, &'a mut Slowdowns)>,
        wanted: &[Wanted],
    ) -> Result<Processors, LinkConfigError> {
        let mut all = Processors::healthy(wanted);
        let mut changed: Vec<_> = changed.collect();
        let first = changed.first().map(|(at, _)| *at);
        for (host, name, _) in wanted {
            let name = format!("{host}/{name}");
            let mut mine = self.between(&name, host, (SimDuration::ZERO, first));
            for number in 0..changed.len() {
                let until = changed.get(number + 1).map(|(at, _)| *at);
                let (from, later) = &mut changed[number];
                mine.extend(later.between(&name, host, (*from, until)));
            }
            let mine: Vec<_> = mine
                .iter()
                .map(|(when, slowdown)| (when, *slowdown))
                .collect();
            if let Some(processor) = all.0.get_mut(&name) {
                *processor = slowed(processor.clone(), &mine);
            }
        }
        let later = changed.iter().flat_map(|(_, later)| &later.0);
        match self
            .0
            .iter()
            .chain(later)
            .find(|(pattern, ..)| !pattern.used)
        {
            None => Ok(all),
            Some((unused, ..)) => Err(LinkConfigError::NoSuchProcessor {
                key: unused.key.clone(),
                pattern: unused.text.clone(),
                nearest: nearest(&unused.text, wanted),
            }),
        }
    }
}

impl Slowdowns {
    /// What slows a processor down from an instant until another, or for ever.
    fn between(
        &mut self,
        name: &str,
        host: &str,
        (from, until): (SimDuration, Option<SimDuration>),
    ) -> Vec<(Degrade, Slowdown)> {
        let mut mine = Vec::new();
        for (pattern, when, slowdown) in &mut self.0 {
            // Both are asked, so that a pattern counts as used whichever it matches.
            if pattern.matches(name) || pattern.matches(host) {
                let clipped = Degrade {
                    at: when.at.max(from),
                    until: [when.until, until].into_iter().flatten().min(),
                    what: when.what.clone(),
                };
                if clipped.until.is_none_or(|until| clipped.at < until) {
                    mine.push((clipped, *slowdown));
                }
            }
        }
        mine
    }
}

/// The processor with all that slows it down; of entries that overlap the last wins.
fn slowed(processor: Processor, mine: &[(&Degrade, Slowdown)]) -> Processor {
    let mut before = Slowdown::NONE;
    let instants = Degrade::instants(mine.iter().map(|(when, _)| *when));
    instants.into_iter().fold(processor, |processor, at| {
        let active = mine.iter().rev().find(|(when, _)| when.is_active(at));
        let slowdown = active.map_or(Slowdown::NONE, |(_, slowdown)| *slowdown);
        // What an entry says that another overrules is no change.
        if std::mem::replace(&mut before, slowdown) == slowdown {
            return processor;
        }
        processor.then(SimTime::ZERO + at, slowdown)
    })
}

/// The name, or the pattern that names with other numbers share, closest to a pattern: of hosts if
/// it has no slash.
fn nearest(pattern: &str, wanted: &[Wanted]) -> Option<String> {
    let names = wanted
        .iter()
        .map(|(host, name, _)| match pattern.contains('/') {
            true => format!("{host}/{name}"),
            false => host.clone(),
        });
    let candidates: BTreeSet<String> = names.flat_map(|name| [shape(&name), name]).collect();
    closest(pattern, candidates.iter().map(String::as_str)).map(str::to_owned)
}
