//! Which degradations of a forked run met no message.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use farside::ids::EntityId;
use farside::record::{Flow, Observer, ObserverError, Record};
use farside::{Pattern, RunInfo, SimDuration, SimTime, Simulation};
use farside_actors::link::{Degrade, Degraded};

/// A degradation of links, and whether a message met it.
struct Entry {
    index: usize,
    links: String,
    pattern: Pattern,
    from: SimTime,
    until: SimTime,
    has_met: bool,
}

/// The degradations of a run, as they are met.
#[derive(Clone)]
pub(super) struct Applied(Arc<Mutex<Vec<Entry>>>);

/// Watches which degradations messages meet that are sent at `at` or later.
pub(super) fn watch(sim: &mut Simulation, degrades: &[Degrade], at: SimDuration) -> Applied {
    let entries = degrades.iter().enumerate().filter_map(|(index, degrade)| {
        let Degraded::Links { pattern: links, .. } = &degrade.what else {
            return None;
        };
        // What is no pattern was refused before.
        let pattern = Pattern::over_names(links).ok()?;
        let until = degrade
            .until
            .map_or(SimTime::MAX, |until| SimTime::ZERO + until);
        let from = SimTime::ZERO + degrade.at.max(at);
        (from < until).then(|| Entry {
            index,
            links: links.clone(),
            pattern,
            from,
            until,
            has_met: false,
        })
    });
    let applied = Applied(Arc::new(Mutex::new(entries.collect())));
    sim.observe(Watcher {
        applied: applied.clone(),
        run: None,
        links: BTreeMap::new(),
    });
    applied
}

impl Applied {
    fn entries(&self) -> MutexGuard<'_, Vec<Entry>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What is to be said of those that no message met before the run ended; those that begin later are said
    /// to be never reached anyway.
    pub(super) fn idle(&self, end: SimTime) -> Vec<String> {
        let entries = self.entries();
        let idle = entries
            .iter()
            .filter(|entry| !entry.has_met && entry.from <= end);
        idle.map(|entry| {
            let [from, until] = [entry.from, entry.until.min(end)];
            format!(
                "degrade.{} applied to no message: none was sent over {} from {from} to {until}",
                entry.index, entry.links
            )
        })
        .collect()
    }
}

struct Watcher {
    applied: Applied,
    run: Option<Arc<RunInfo>>,
    /// By link, the places of the degradations that it may meet.
    links: BTreeMap<EntityId, Vec<usize>>,
}

impl Observer for Watcher {
    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        self.run = Some(run.clone());
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let (Some(link), Some(run)) = (record.link, &self.run) else {
            return Ok(Flow::Continue);
        };
        if !record.class.is_fate() {
            return Ok(Flow::Continue);
        }
        let mut entries = self.applied.entries();
        let places = self.links.entry(link).or_insert_with(|| {
            let name = run.name(link);
            let all = entries.iter().enumerate();
            let all = all.filter(|(_, entry)| entry.pattern.matches(name));
            all.map(|(place, _)| place).collect()
        });
        for place in places.iter() {
            let entry = &mut entries[*place];
            // A message that was sent before and waits in a queue may be transmitted within.
            let met = record.sent < entry.until && record.time() >= entry.from;
            entry.has_met |= met;
        }
        Ok(Flow::Continue)
    }
}
