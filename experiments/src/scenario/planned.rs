//! What a scenario plans for instants of a run, and what of it a run never reaches. A crash, a
//! degradation or a contact behind the end of a run changes nothing, and whoever reads the results
//! must be told: a study over it draws a flat line that reads as robust.

use std::collections::BTreeMap;

use farside::{End, Report, SimDuration, SimTime, Simulation};
use farside_actors::link::{Contacts, LinksConfig};
use farside_actors::processor::ProcessorChange;

use super::contacts::LinkContacts;

/// All that a scenario plans for instants of its run.
///
/// ```
/// use farside::Executor;
/// use farside_experiments::{registry::Registry, scenario::Scenario};
/// let sets = ["team.rovers=1", "degrade=[{ at = '1h', links = '*', loss = 0.5 }]"];
/// let sets = sets.map(str::to_owned);
/// let scenario = Scenario::open("network/crater-sparse", &sets, &Registry::builtin())?;
/// let assembled = scenario.assemble()?;
/// let report = assembled.sim.run(Executor::Inline)?;
/// let never: Vec<&str> = assembled.planned.never(&report).map(|one| one.key()).collect();
/// assert_eq!(never, ["degrade.0"]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Planned {
    entries: Vec<Entry>,
    until: Option<SimDuration>,
}

/// What one entry of a scenario plans.
#[derive(Clone, Debug, PartialEq)]
struct Entry {
    /// The entry: `degrade.0`, `crash.1.restart`, `contacts`.
    key: String,
    /// What happens at each of the times, after "it": `begins`.
    happens: &'static str,
    /// What several of them are called; none where it is enough that the first is reached.
    each: Option<&'static str>,
    /// When, in order.
    times: Vec<SimDuration>,
}

/// An entry that a run never reached, in whole or in part.
#[derive(Clone, Debug, PartialEq)]
pub struct Never<'a> {
    entry: &'a Entry,
    reached: usize,
}

impl<'a> Never<'a> {
    /// The entry: `degrade.0`, `crash.1`, `crash.1.restart`, `contacts`, `told.rover_05.Goal`.
    pub fn key(&self) -> &'a str {
        &self.entry.key
    }

    /// Whether none of it was reached.
    pub fn is_whole(&self) -> bool {
        self.reached == 0
    }

    /// The sentence about a run that ended at `end`.
    fn told(&self, verb: &str, end: &str) -> String {
        let Never { entry, reached } = self;
        let (key, happens) = (&entry.key, entry.happens);
        let count = entry.times.len();
        let next = entry.times.get(*reached).copied().unwrap_or_default();
        match (entry.each, reached) {
            (Some(each), 1..) => format!(
                "{key}: {} of its {count} {each} {verb} never reached: the next {happens} at \
                 {next}, {end}",
                count - reached
            ),
            _ => format!("{key} {verb} never reached: it {happens} at {next}, {end}"),
        }
    }
}

impl Planned {
    pub(super) fn new(until: Option<SimDuration>) -> Self {
        Planned {
            entries: Vec::new(),
            until,
        }
    }

    /// Adds what is planned for `times`; nothing if there are none.
    pub(super) fn add(
        &mut self,
        key: String,
        happens: &'static str,
        each: Option<&'static str>,
        mut times: Vec<SimDuration>,
    ) {
        if times.is_empty() {
            return;
        }
        times.sort_unstable();
        self.entries.push(Entry {
            key,
            happens,
            each,
            times,
        });
    }

    /// Adds the contacts of a plan between hosts that a link joins, and those that `[links]` has
    /// itself. Of contacts that repeat the first is enough.
    pub(super) fn add_contacts(
        &mut self,
        plan: Option<&LinkContacts>,
        links: &LinksConfig,
        sim: &Simulation,
    ) {
        let begins = |contacts: &Contacts| -> Vec<SimDuration> {
            contacts.windows().iter().map(|one| one.start).collect()
        };
        if let Some(plan) = plan {
            let joined: std::collections::BTreeSet<&str> = sim.link_names().collect();
            let pairs = plan.pairs();
            let pairs = pairs.filter(|(from, to, _)| {
                let name = format!("{from}-{to}");
                joined.contains(name.as_str())
            });
            let windows = pairs.flat_map(|(_, _, windows)| windows);
            let starts = windows.map(|window| window.start.since(SimTime::ZERO));
            let starts = starts.collect();
            self.add("contacts".to_owned(), "begins", Some("contacts"), starts);
        }
        let own = links.default.contacts.iter();
        let own = own.map(|contacts| ("default", contacts));
        let patterns = links.patterns.iter();
        let patterns = patterns.filter_map(|(text, over)| {
            let contacts = over.contacts.as_ref()?.as_ref()?;
            Some((text.as_str(), contacts))
        });
        for (name, contacts) in own.chain(patterns) {
            let key = format!("links.{name}.contacts");
            let each = (!contacts.repeats()).then_some("contacts");
            self.add(key, "begins", each, begins(contacts));
        }
    }

    /// Adds what actors are told by the system itself. That processors become slower stands in
    /// `[[degrade]]` already.
    pub(super) fn add_tells(&mut self, sim: &Simulation) {
        let mut tells: BTreeMap<String, Vec<SimDuration>> = BTreeMap::new();
        let slower = std::any::type_name::<ProcessorChange>();
        for (at, actor, kind) in sim.tells().filter(|(_, _, kind)| *kind != slower) {
            let kind = kind.split('<').next().unwrap_or(kind);
            let kind = kind.rsplit("::").next().unwrap_or(kind);
            let key = format!("told.{actor}.{kind}");
            tells.entry(key).or_default().push(at.since(SimTime::ZERO));
        }
        for (key, times) in tells {
            self.add(key, "comes", Some("messages"), times);
        }
    }

    /// What can never be reached, whenever the run ends, because it is not before `until`; a
    /// sentence for each entry.
    pub(super) fn behind_until(&self) -> impl Iterator<Item = String> + '_ {
        let until = self.until.into_iter();
        until.flat_map(|until| {
            let end = format!("and the run ends at {until} at the latest");
            let never = self.not_before(until);
            never.map(move |never| never.told("is", &end))
        })
    }

    /// What a run never reached, also for a reason that was known before.
    pub fn never(&self, report: &Report) -> impl Iterator<Item = Never<'_>> {
        self.not_before(self.end_of(report))
    }

    /// What is to be said once a run is over, a sentence for each entry. What
    /// [`super::Assembled::remarks`] said before the run is not said twice.
    pub fn never_reached(&self, report: &Report) -> Vec<String> {
        if !matches!(report.end, End::Completed | End::Stopped { .. }) {
            // That a run which failed or was interrupted did not come to its end is said anyway.
            return Vec::new();
        }
        let mut end = format!("and the run ended at {}", report.end_time);
        if let Some(until) = self.until {
            end += &format!(", before `until`, {until}");
        }
        let known = |never: &Never<'_>| {
            let of_entry = |other: &Never<'_>| other.key() == never.key();
            let until = self.until.into_iter();
            until
                .flat_map(|until| self.not_before(until))
                .any(|other| of_entry(&other) && other.reached == never.reached)
        };
        let never = self.never(report).filter(|never| !known(never));
        never.map(|never| never.told("was", &end)).collect()
    }

    /// The first instant that counts as behind the end. What happens at the very instant at which
    /// an actor stops a run may be why it stops; at the instant at which its time is over nothing
    /// can come of it.
    fn end_of(&self, report: &Report) -> SimDuration {
        let end = report.end_time.since(SimTime::ZERO);
        match (&report.end, self.until) {
            (End::Stopped { .. }, Some(until)) if until <= end => until,
            _ => SimDuration::from_nanos(end.as_nanos().saturating_add(1)),
        }
    }

    fn not_before(&self, end: SimDuration) -> impl Iterator<Item = Never<'_>> {
        let mut last: Option<&str> = None;
        self.entries.iter().filter_map(move |entry| {
            let reached = entry.times.partition_point(|at| *at < end);
            let is_missed = match entry.each {
                Some(_) => reached < entry.times.len(),
                None => reached == 0,
            };
            // Who never goes down needs not come back.
            let never_down = |last: &str| entry.key.strip_suffix(".restart") == Some(last);
            if !is_missed || last.is_some_and(never_down) {
                return None;
            }
            if reached == 0 {
                last = Some(&entry.key);
            }
            Some(Never { entry, reached })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(times: &[u64]) -> Vec<SimDuration> {
        let times = times.iter();
        times.map(|at| SimDuration::from_secs(*at)).collect()
    }

    fn ended(at_s: u64) -> Report {
        Report {
            digest: farside::Digest::EMPTY,
            counts: farside::Counts::default(),
            end_time: SimTime::from_secs(at_s),
            end: End::Stopped {
                by: "@control".to_owned(),
                reason: "all rovers have arrived".to_owned(),
            },
            rulings: Vec::new(),
        }
    }

    fn planned() -> Planned {
        let mut planned = Planned::new(Some(SimDuration::from_secs(100)));
        planned.add("degrade.0".to_owned(), "begins", None, seconds(&[100]));
        planned.add("degrade.1".to_owned(), "begins", None, seconds(&[50]));
        let crashes = seconds(&[90, 20, 40]);
        planned.add("crash.0".to_owned(), "is", Some("crashes"), crashes);
        planned.add("crash.1".to_owned(), "is", Some("crashes"), seconds(&[60]));
        let back = "crash.1.restart".to_owned();
        planned.add(back, "is", Some("restarts"), seconds(&[70]));
        // Of failures that come again and again, one is enough.
        planned.add("crash.2".to_owned(), "is", None, seconds(&[10, 95]));
        planned
    }

    #[test]
    fn what_is_behind_the_latest_end_is_known_before_the_run() {
        let planned = planned();
        assert_eq!(
            planned.behind_until().collect::<Vec<_>>(),
            [
                "degrade.0 is never reached: it begins at 100s, and the run ends at 100s at the \
              latest"
            ]
        );
        let free = Planned {
            until: None,
            ..planned
        };
        assert_eq!(free.behind_until().count(), 0);
    }

    #[test]
    fn what_a_shorter_run_did_not_reach_is_known_after_it() {
        let planned = planned();
        let end = "and the run ended at 45s, before `until`, 100s";
        assert_eq!(
            planned.never_reached(&ended(45)),
            [
                format!("degrade.1 was never reached: it begins at 50s, {end}"),
                format!("crash.0: 1 of its 3 crashes was never reached: the next is at 90s, {end}"),
                format!("crash.1 was never reached: it is at 60s, {end}"),
            ]
        );
        let whole = |at_s: u64| -> Vec<String> {
            let report = ended(at_s);
            let never = planned.never(&report).filter(Never::is_whole);
            never.map(|never| never.key().to_owned()).collect()
        };
        assert_eq!(whole(45), ["degrade.0", "degrade.1", "crash.1"]);
        // What is at the instant of the end may be why the run ended there.
        assert_eq!(whole(60), ["degrade.0", "crash.1.restart"]);
        assert_eq!(whole(100), ["degrade.0"]);
    }
}
