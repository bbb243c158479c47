//! Committing: the one place where a run becomes a digest, counts, and records for observers.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::digest::Digest;
use crate::engine::{FirstSample, Happened, Head, InFlight, Side, Sink};
use crate::fault::ObserverError;
use crate::guard::{dropped, guarded};
use crate::ids::EntityId;
use crate::key::EventKey;
use crate::record::{Checkpoint, Flow, Observer, RecordClass, Wants};
use crate::report::{Counts, End, Report};
use crate::ruling::Rulings;
use crate::time::SimTime;
use crate::topology::{Kind, Topology};

/// Hashed records from one checkpoint to the next.
const CHECKPOINT_RECORDS: usize = 8192;

/// Runs an observer. Whether it returns an error or panics, it can watch no longer.
fn watched<T>(observe: impl FnOnce() -> Result<T, ObserverError>) -> Result<T, String> {
    match guarded(observe) {
        Ok(observed) => observed.map_err(|error| error.to_string()),
        Err(cause) => Err(format!("an observer {cause}")),
    }
}

/// Takes records in key order, and is told nothing else.
pub(crate) struct Committer {
    topology: Arc<Topology>,
    observers: Vec<(Wants, Box<dyn Observer>)>,
    digest: Digest,
    /// Some observer wants checkpoints.
    checkpoints: bool,
    /// Of the records since the last checkpoint, if any are wanted.
    hashes: Vec<u32>,
    hashed: u64,
    counts: Counts,
    /// Losses by reason, in order of first occurrence: reasons are few.
    reasons: Vec<(&'static str, u64)>,
    last: EventKey,
    pub(crate) stop: Option<(EventKey, EntityId, String)>,
    failure: Option<String>,
    interrupt: Arc<AtomicBool>,
}

impl Committer {
    pub(crate) fn new(
        topology: Arc<Topology>,
        observers: Vec<Box<dyn Observer>>,
        interrupt: Arc<AtomicBool>,
    ) -> Result<Self, ObserverError> {
        let mut observers: Vec<_> = observers.into_iter().map(|o| (o.wants(), o)).collect();
        for (_, observer) in &mut observers {
            watched(|| observer.begin(&topology.info)).map_err(ObserverError)?;
        }
        Ok(Committer {
            last: topology.key(SimTime::ZERO, 0, EntityId::CONTROL, 0),
            checkpoints: observers.iter().any(|(wants, _)| wants.checkpoints),
            topology,
            observers,
            digest: Digest::EMPTY,
            hashes: Vec::new(),
            hashed: 0,
            counts: Counts::default(),
            reasons: Vec::new(),
            stop: None,
            failure: None,
            interrupt,
        })
    }

    /// The key of the last record committed.
    pub(crate) fn last(&self) -> EventKey {
        self.last
    }

    /// Why the run cannot go on, if it cannot.
    pub(crate) fn verdict(&self) -> Option<End> {
        if let Some(failure) = &self.failure {
            return Some(End::ObserverFailed(failure.clone()));
        }
        self.interrupt
            .load(Ordering::Relaxed)
            .then_some(End::Interrupted)
    }

    /// Records what is still on its way, tells the observers that the run is over, and reports.
    pub(crate) fn finish(
        mut self,
        end: End,
        end_time: SimTime,
        mut in_flight: Vec<InFlight>,
    ) -> Report {
        in_flight.sort_unstable_by_key(|(key, head, _)| (*key, head.copy()));
        let topology = self.topology.clone();
        for (key, head, body) in in_flight {
            let class = RecordClass::InFlight;
            self.commit(&Happened {
                class,
                key,
                head: &head,
                side: None,
                sample: None,
                body: &body,
                sends: 0,
                hash: head.hash_if_wanted(&topology, class, key, &body),
            });
        }
        self.checkpoint();
        self.counts.lost_by_reason = self
            .reasons
            .iter()
            .map(|(reason, n)| ((*reason).to_owned(), *n))
            .collect();
        let mut report = Report {
            digest: self.digest,
            counts: self.counts,
            end_time,
            end,
            rulings: topology
                .rulings
                .as_ref()
                .map(Rulings::ends)
                .unwrap_or_default(),
        };
        if let Some(failure) = self.failure {
            report.end = End::ObserverFailed(failure);
        }
        for (_, observer) in &mut self.observers {
            if let Err(failure) = watched(|| observer.end(&report)) {
                report.end = End::ObserverFailed(failure);
            }
        }
        for (_, observer) in self.observers {
            if let Err(cause) = dropped(observer) {
                report.end = End::ObserverFailed(format!("an observer {cause}"));
            }
        }
        report
    }

    #[inline(always)]
    fn count(&mut self, class: RecordClass, head: &Head, sends: u32) {
        let counts = &mut self.counts;
        counts.sent += u64::from(sends);
        if class.is_fate() && head.copy() > 0 {
            counts.duplicated += 1;
        }
        match class {
            RecordClass::Delivered => {
                counts.delivered += 1;
                counts.events += 1;
            }
            RecordClass::Lost => {
                counts.lost += 1;
                let reason = self.topology.reason(head.reason);
                match self.reasons.iter_mut().find(|(known, _)| *known == reason) {
                    Some((_, n)) => *n += 1,
                    None => self.reasons.push((reason, 1)),
                }
            }
            RecordClass::InFlight => counts.in_flight += 1,
            RecordClass::Sample => {}
            _ => counts.events += 1,
        }
    }

    /// Keeps a record's hash until the next checkpoint.
    #[inline(never)]
    fn keep_hash(&mut self, hash: u128) {
        self.hashed += 1;
        self.hashes.push(hash as u32);
        if self.hashes.len() == CHECKPOINT_RECORDS {
            self.checkpoint();
        }
    }

    fn checkpoint(&mut self) {
        if self.hashes.is_empty() {
            return;
        }
        let checkpoint = Checkpoint {
            records: self.hashed,
            key: self.last,
            digest: self.digest,
            hashes: &self.hashes,
        };
        for (wants, observer) in &mut self.observers {
            if wants.checkpoints
                && let Err(failure) = watched(|| observer.checkpoint(&checkpoint))
            {
                self.failure.get_or_insert(failure);
            }
        }
        self.hashes.clear();
    }
}

impl Committer {
    /// Shows observers a record of what happened.
    #[inline(never)]
    fn show(&mut self, happened: &Happened<'_>) {
        let record = happened.record(&self.topology);
        for (wants, observer) in &mut self.observers {
            if record.class == RecordClass::Sample && !wants.samples {
                continue;
            }
            match guarded(|| observer.record(&record)) {
                Ok(Ok(Flow::Continue)) => {}
                Ok(Ok(Flow::Stop(reason))) => {
                    self.stop
                        .get_or_insert((record.key, EntityId::CONTROL, reason));
                }
                Ok(Err(error)) => {
                    self.failure.get_or_insert(error.to_string());
                }
                Err(cause) => {
                    self.failure.get_or_insert(format!("an observer {cause}"));
                }
            }
        }
    }
}

impl Sink for Committer {
    #[inline(always)]
    fn commit(&mut self, happened: &Happened<'_>) {
        let Happened { class, head, .. } = *happened;
        self.count(class, head, happened.sends);
        self.last = happened.key;
        if !self.observers.is_empty() {
            // A copy, so that it need not lie in memory where nobody observes.
            let shown = *happened;
            self.show(&shown);
        }
        if self.topology.digest && class != RecordClass::Sample {
            self.digest.extend(happened.hash);
            if self.checkpoints {
                self.keep_hash(happened.hash);
            }
        }
    }

    /// The one engine that commits here has compared it with all others.
    fn first_sample(&mut self, _sample: FirstSample) {}

    fn paused(&self) -> bool {
        self.stop.is_some() || self.failure.is_some() || self.interrupt.load(Ordering::Relaxed)
    }
}

/// Something that happened, kept until its window is committed.
struct Kept {
    class: RecordClass,
    key: EventKey,
    head: Head,
    /// Its place among the sides.
    side: Option<usize>,
    sample: Option<Arc<Kind>>,
    body: Range<usize>,
    sends: u32,
    hash: u128,
}

/// What one engine did in one window, in key order.
#[derive(Default)]
pub(crate) struct Batch {
    kept: Vec<Kept>,
    sides: Vec<Side>,
    bytes: Vec<u8>,
    pub(crate) first_samples: Vec<FirstSample>,
}

impl Batch {
    /// The key of what happened at `at`.
    pub(crate) fn key(&self, at: usize) -> Option<EventKey> {
        self.kept.get(at).map(|kept| kept.key)
    }

    /// Commits what happened at `at`.
    pub(crate) fn commit(&self, at: usize, sink: &mut impl Sink) {
        let kept = &self.kept[at];
        sink.commit(&Happened {
            class: kept.class,
            key: kept.key,
            head: &kept.head,
            side: kept.side.map(|at| &self.sides[at]),
            sample: kept.sample.as_ref(),
            body: &self.bytes[kept.body.clone()],
            sends: kept.sends,
            hash: kept.hash,
        });
    }

    pub(crate) fn clear(&mut self) {
        self.kept.clear();
        self.sides.clear();
        self.bytes.clear();
    }

    /// The messages that the uncommitted records from `at` on had taken from their way, though
    /// committed events before `fault` sent them.
    pub(crate) fn undone(&self, at: usize, fault: EventKey, topology: &Topology) -> Vec<InFlight> {
        let mut found = Vec::new();
        let mut unit: Option<EventKey> = None;
        for kept in &self.kept[at..] {
            let first = unit != Some(kept.key);
            unit = Some(kept.key);
            // A loss that a hand-over decided is undone with the hand-over, which is counted.
            let message = match kept.class {
                RecordClass::Delivered | RecordClass::HandOver => true,
                RecordClass::Lost => first,
                _ => false,
            };
            let side = kept.side.map(|at| &self.sides[at]);
            let by = kept.head.scheduled_by(topology, side);
            if message && by.is_some_and(|by| by < fault) {
                found.push((
                    kept.key,
                    kept.head.left_over(),
                    self.bytes[kept.body.clone()].to_vec(),
                ));
            }
        }
        found
    }
}

impl Sink for Batch {
    fn commit(&mut self, happened: &Happened<'_>) {
        let start = self.bytes.len();
        self.bytes.extend_from_slice(happened.body);
        let side = happened.side.map(|side| {
            self.sides.push(*side);
            self.sides.len() - 1
        });
        self.kept.push(Kept {
            class: happened.class,
            key: happened.key,
            head: *happened.head,
            side,
            sample: happened.sample.cloned(),
            body: start..self.bytes.len(),
            sends: happened.sends,
            hash: happened.hash,
        });
    }

    fn first_sample(&mut self, sample: FirstSample) {
        self.first_samples.push(sample);
    }

    fn paused(&self) -> bool {
        false
    }
}
