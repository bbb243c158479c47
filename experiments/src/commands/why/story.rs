//! What an actor did when and whom it waited for, and what of losses, crashes and degradations touched it
//! meanwhile: from the log of its run.

use std::collections::{BTreeMap, BTreeSet};

use farside::record::RecordClass;
use farside::ruling::{MessageId, MessageNumber};
use farside::suggest::{did_you_mean, nearest};
use farside::{Pattern, SimDuration};
use farside_actors::link::{Degrade, Degraded};
use farside_actors::system::{Account, Doing, Phase};
use farside_logs::{Log, RecordRef};
use serde::{Serialize, Serializer};

use crate::commands::CommandError;
use crate::recorded::Logged;
use crate::scenario::Scenario;

/// As many lost messages as are held of an actor.
const LOSSES: usize = 1_000_000;

/// What an actor did, and what touched it.
#[derive(Serialize)]
pub(super) struct Story {
    pub(super) actor: String,
    /// Up to when it is told, in nanoseconds since the start of the run.
    pub(super) until_ns: u64,
    /// Whether its system told it; without, it is only told when it was down.
    pub(super) is_told_by_system: bool,
    #[serde(serialize_with = "phases")]
    pub(super) account: Account,
    /// Messages to or from it that were lost, in order of time.
    #[serde(skip)]
    pub(super) losses: Vec<Lost>,
    /// The longest time before it was done in which no link brought it anything, from when to when.
    pub(super) silence_ns: Option<[u64; 2]>,
    /// Entries of the scenario that made its links worse, or those of actors that it waited for.
    pub(super) degrades: Vec<Touching>,
    /// Entries of the scenario by which it crashed, or actors that it waited for.
    pub(super) crashes: Vec<Touching>,
    /// Why the run ended.
    pub(super) end: String,
    pub(super) remarks: Vec<String>,
}

fn phases<S: Serializer>(account: &Account, to: S) -> Result<S::Ok, S::Error> {
    let phase = |phase: &Phase| {
        serde_json::json!({
            "from_s": phase.from_ns as f64 / 1e9,
            "until_s": phase.until_ns as f64 / 1e9,
            "doing": phase.doing.name(),
            "text": phase.text,
            "waits_for": phase.waits_for,
        })
    };
    to.collect_seq(account.phases.iter().map(phase))
}

/// A message to or from an actor that was lost.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Lost {
    pub(super) at_ns: u64,
    /// Whether it was for the actor, and not from it.
    pub(super) is_for_it: bool,
    pub(super) peer: String,
    pub(super) link: String,
    pub(super) reason: String,
    pub(super) id: MessageId,
}

/// An entry of the scenario that touched the actor.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Touching {
    /// Its place among the entries of its kind, from 0.
    pub(super) entry: usize,
    pub(super) from_ns: u64,
    /// When it is over; none if it is not before the end.
    pub(super) until_ns: Option<u64>,
    /// What it says, in a line.
    pub(super) text: String,
}

impl Touching {
    /// How long it lasts up to a time.
    pub(super) fn within(&self, until_ns: u64) -> [u64; 2] {
        let end_ns = self.until_ns.unwrap_or(until_ns).min(until_ns);
        [self.from_ns, end_ns.max(self.from_ns)]
    }
}

/// What a log says of an actor.
#[derive(Default)]
struct Heard {
    losses: Vec<Lost>,
    more_losses: u64,
    /// The links that it sends and receives over.
    links: BTreeMap<String, BTreeSet<String>>,
    /// When links brought it something.
    heard_ns: Vec<u64>,
    /// When who was down.
    outages: Vec<(String, u64, Option<u64>)>,
    names: BTreeSet<String>,
    end_ns: u64,
}

impl Story {
    /// Reads it from a log, up to a time or the end.
    pub(super) fn read(
        log: &Log,
        scenario: &Scenario,
        actor: &str,
        at: Option<SimDuration>,
    ) -> Result<Story, CommandError> {
        let (heard, end) = heard(log, actor, at)?;
        if !heard.names.contains(actor) {
            let hint =
                did_you_mean(nearest(actor, heard.names.iter().map(String::as_str)).as_deref());
            let what = format!("{actor:?}: the log has no actor of this name{hint}");
            return Err(CommandError::Arguments(what));
        }
        let until_ns = at.map_or(heard.end_ns, SimDuration::as_nanos);
        if until_ns > heard.end_ns {
            let (at, end) = (
                SimDuration::from_nanos(until_ns),
                SimDuration::from_nanos(heard.end_ns),
            );
            return Err(CommandError::Arguments(format!(
                "--at {at}: the run ended at {end}"
            )));
        }
        let mut remarks = Vec::new();
        if heard.more_losses > 0 {
            remarks.push(format!(
                "{} more messages were lost behind the first {LOSSES}",
                heard.more_losses
            ));
        }
        if !log.exclude().is_empty() {
            let topics = log.exclude().join(", ");
            remarks.push(format!("topics that were not written: {topics}"));
        }
        let seeds = scenario.seeds_of(log.seed(), None);
        let told = scenario.account(actor, &Logged { log, seeds }, until_ns);
        let told = told.map_err(|error| CommandError::NotDrawn {
            path: log.path().to_owned(),
            reason: error.to_string(),
        })?;
        let is_told_by_system = told.is_some();
        let account = told.unwrap_or_else(|| up_or_down(actor, &heard, until_ns));
        let mut touched: BTreeSet<&str> = BTreeSet::from([actor]);
        for phase in &account.phases {
            touched.extend(phase.waits_for.iter().map(String::as_str));
        }
        let degrades = degrades(scenario, &heard, &touched, until_ns);
        let crashes = crashes(scenario, &heard, &touched, until_ns)?;
        let done_ns = account.done_ns().unwrap_or(until_ns);
        Ok(Story {
            actor: actor.to_owned(),
            until_ns,
            is_told_by_system,
            account,
            silence_ns: heard.silence_ns(done_ns),
            losses: heard.losses,
            degrades,
            crashes,
            end,
            remarks,
        })
    }

    /// Messages that were lost within a time.
    pub(super) fn lost_within(&self, from_ns: u64, until_ns: u64) -> &[Lost] {
        let from = self.losses.partition_point(|lost| lost.at_ns < from_ns);
        let until = self.losses.partition_point(|lost| lost.at_ns < until_ns);
        &self.losses[from..until.max(from)]
    }

    /// How it fared, in a line.
    pub(super) fn outcome(&self) -> String {
        let Story { account, .. } = self;
        let spent = |doing| seconds(account.spent_ns(doing));
        let done = match account.done_ns() {
            Some(done_ns) => format!("done at {}", seconds(done_ns)),
            None if account.spent_ns(Doing::Active) == account.spent_ns(Doing::Waiting) => {
                String::new()
            }
            None => "not done".to_owned(),
        };
        let mut parts = vec![
            format!("{} active", spent(Doing::Active)),
            format!("{} waiting", spent(Doing::Waiting)),
        ];
        if account.spent_ns(Doing::Down) > 0 {
            parts.push(format!("{} down", spent(Doing::Down)));
        }
        if self.is_told_by_system && !done.is_empty() {
            parts.push(done);
        }
        parts.join(", ")
    }
}

/// Nanoseconds as seconds, to the millisecond.
pub(super) fn seconds(ns: u64) -> String {
    let ms = (ns + 500_000) / 1_000_000;
    format!("{}.{:03} s", ms / 1_000, ms % 1_000)
}

/// Reads what there is of an actor, and why the run ended.
fn heard(log: &Log, actor: &str, at: Option<SimDuration>) -> Result<(Heard, String), CommandError> {
    let mut heard = Heard::default();
    let until_ns = at.map_or(u64::MAX, SimDuration::as_nanos);
    let mut records = log.records()?;
    while let Some((record, _)) = records.next_ref()? {
        heard.end_ns = heard.end_ns.max(record.key.time_ns);
        for name in [record.sender, record.receiver] {
            if record.class != RecordClass::Change && !heard.names.contains(name) {
                heard.names.insert(name.to_owned());
            }
        }
        if record.key.time_ns <= until_ns {
            heard.add(&record, actor);
        }
    }
    heard.names.remove("@control");
    let end = records.ending().end.as_ref();
    let text = |key: &str| end.and_then(|end| end.get(key));
    let end_ns = text("end_time_ns").and_then(|text| text.parse().ok());
    heard.end_ns = end_ns.unwrap_or(heard.end_ns);
    let detail = match text("end_detail") {
        Some(detail) => detail.clone(),
        None => "the log is cut".to_owned(),
    };
    Ok((heard, detail))
}

impl Heard {
    fn add(&mut self, record: &RecordRef<'_>, actor: &str) {
        match record.class {
            RecordClass::Crash => {
                let name = record.receiver.to_owned();
                self.outages.push((name, record.key.time_ns, None));
            }
            RecordClass::Restart => {
                let mut outages = self.outages.iter_mut().rev();
                let down =
                    outages.find(|(name, _, to_ns)| name == record.receiver && to_ns.is_none());
                if let Some((_, _, to_ns)) = down {
                    *to_ns = Some(record.key.time_ns);
                }
            }
            _ => {}
        }
        if record.class.is_fate() && !record.link.is_empty() {
            for name in [record.sender, record.receiver] {
                let links = match self.links.get_mut(name) {
                    Some(links) => links,
                    None => self.links.entry(name.to_owned()).or_default(),
                };
                if !links.contains(record.link) {
                    links.insert(record.link.to_owned());
                }
            }
        }
        let is_for_it = record.receiver == actor;
        if record.class == RecordClass::Delivered && is_for_it && !record.link.is_empty() {
            self.heard_ns.push(record.key.time_ns);
        }
        if record.class != RecordClass::Lost || !(is_for_it || record.sender == actor) {
            return;
        }
        if self.losses.len() == LOSSES {
            self.more_losses += 1;
            return;
        }
        let peer = if is_for_it {
            record.sender
        } else {
            record.receiver
        };
        self.losses.push(Lost {
            at_ns: record.key.time_ns,
            is_for_it,
            peer: peer.to_owned(),
            link: record.link.to_owned(),
            reason: record.reason.to_owned(),
            id: MessageId {
                sender: record.sender.to_owned(),
                receiver: record.receiver.to_owned(),
                kind: record.kind.to_owned(),
                number: MessageNumber::Ordinal(record.ordinal),
                copy: record.copy,
            },
        });
    }

    /// The longest time up to `until_ns` in which nothing was heard.
    fn silence_ns(&self, until_ns: u64) -> Option<[u64; 2]> {
        let heard = self.heard_ns.iter().copied().filter(|at| *at < until_ns);
        let times: Vec<u64> = std::iter::once(0).chain(heard).chain([until_ns]).collect();
        let gaps = times.windows(2).map(|pair| [pair[0], pair[1]]);
        gaps.rev().max_by_key(|[from, to]| to - from)
    }
}

/// The account of an actor of which its system tells nothing.
fn up_or_down(actor: &str, heard: &Heard, until_ns: u64) -> Account {
    let mut account = Account::default();
    let phase = |from_ns, until_ns, doing, text: &str| Phase {
        from_ns,
        until_ns,
        doing,
        text: text.to_owned(),
        waits_for: Vec::new(),
    };
    let mut up_ns = 0;
    for (_, from_ns, to_ns) in heard.outages.iter().filter(|(name, ..)| name == actor) {
        let to_ns = to_ns.unwrap_or(until_ns).min(until_ns);
        account.push(phase(up_ns, *from_ns, Doing::Active, "is up"));
        account.push(phase(*from_ns, to_ns, Doing::Down, "is down"));
        up_ns = to_ns;
    }
    account.push(phase(up_ns, until_ns, Doing::Active, "is up"));
    account
}

/// The degradations that touched links of these actors, or their processors.
fn degrades(
    scenario: &Scenario,
    heard: &Heard,
    touched: &BTreeSet<&str>,
    until_ns: u64,
) -> Vec<Touching> {
    let touches = |degrade: &Degrade| {
        let (pattern, is_links) = match &degrade.what {
            Degraded::Links { pattern, .. } => (pattern, true),
            Degraded::Processors { pattern, .. } => (pattern, false),
        };
        let Ok(pattern) = Pattern::over_names(pattern) else {
            return false;
        };
        let mut actors = touched.iter();
        actors.any(|actor| match is_links {
            true => {
                let links = heard.links.get(*actor);
                links.is_some_and(|links| links.iter().any(|link| pattern.matches(link)))
            }
            // Processors are called by their hosts, and those mostly as their actors are.
            false => pattern.matches(actor) || pattern.matches(&format!("{actor}/planner")),
        })
    };
    let entries = scenario.shared().degrade.iter().enumerate();
    let entries =
        entries.filter(|(_, degrade)| degrade.at.as_nanos() < until_ns && touches(degrade));
    entries
        .map(|(entry, degrade)| Touching {
            entry,
            from_ns: degrade.at.as_nanos(),
            until_ns: degrade.until.map(SimDuration::as_nanos),
            text: entry_text(degrade),
        })
        .collect()
}

/// An entry of a scenario in a line, without when.
fn entry_text(entry: &impl Serialize) -> String {
    let table = toml::Table::try_from(entry).unwrap_or_default();
    let keys = table
        .iter()
        .filter(|(key, _)| !["at", "until"].contains(&key.as_str()));
    let keys: Vec<String> = keys
        .map(|(key, value)| format!("{key} = {value}"))
        .collect();
    keys.join(", ")
}

/// The crashes of these actors, by the entries that say so.
fn crashes(
    scenario: &Scenario,
    heard: &Heard,
    touched: &BTreeSet<&str>,
    until_ns: u64,
) -> Result<Vec<Touching>, CommandError> {
    let entries = &scenario.shared().crash;
    let down: Vec<_> = heard
        .outages
        .iter()
        .filter(|(name, ..)| touched.contains(name.as_str()))
        .collect();
    if down.is_empty() || entries.is_empty() {
        return Ok(Vec::new());
    }
    let assembled = scenario.assemble()?;
    let mut found = Vec::new();
    for (entry, crash) in entries.iter().enumerate() {
        let named = |text: &Option<String>, name: &str| {
            let pattern = text
                .as_ref()
                .and_then(|text| Pattern::over_names(text).ok());
            pattern.is_some_and(|pattern| pattern.matches(name))
        };
        let is_its = |name: &str| {
            let host = assembled.sim.host_of_named(name);
            named(&crash.actor, name) || host.is_some_and(|host| named(&crash.host, host))
        };
        let its: Vec<_> = down.iter().filter(|(name, ..)| is_its(name)).collect();
        let Some(from_ns) = its.iter().map(|(_, from_ns, _)| *from_ns).min() else {
            continue;
        };
        let ends = its.iter().map(|(_, _, to_ns)| *to_ns);
        let until = ends
            .collect::<Option<Vec<u64>>>()
            .and_then(|ends| ends.into_iter().max());
        let names: BTreeSet<&str> = its.iter().map(|(name, ..)| name.as_str()).collect();
        let names: Vec<&str> = names.into_iter().collect();
        if from_ns < until_ns {
            found.push(Touching {
                entry,
                from_ns,
                until_ns: until,
                text: names.join(", "),
            });
        }
    }
    Ok(found)
}
