//! Committing: the one place where a run becomes a digest, counts, and records for observers.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::carrier::Carriage;
use crate::digest::Digest;
use crate::engine::{FirstSample, Head, InFlight, Sink, hash_if_wanted};
use crate::fault::ObserverError;
use crate::guard::{dropped, guarded};
use crate::ids::EntityId;
use crate::key::EventKey;
use crate::record::{Checkpoint, Flow, Observer, Record, RecordClass, Wants};
use crate::report::{Counts, End, Report};
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
            topology,
            observers,
            digest: Digest::EMPTY,
            hashes: Vec::with_capacity(CHECKPOINT_RECORDS),
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
        in_flight.sort_unstable_by_key(|(key, head, _)| (*key, head.copy));
        let topology = self.topology.clone();
        for (key, head, body) in in_flight {
            let record = head.record(&topology, RecordClass::InFlight, key, &body, None);
            self.commit(&record, hash_if_wanted(&topology, &record));
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

    #[inline]
    fn count(&mut self, class: RecordClass, copy: u32, reason: &'static str, sends: u32) {
        let counts = &mut self.counts;
        counts.sent += u64::from(sends);
        if class.is_fate() && copy > 0 {
            counts.duplicated += 1;
        }
        match class {
            RecordClass::Delivered => {
                counts.delivered += 1;
                counts.events += 1;
            }
            RecordClass::Lost => {
                counts.lost += 1;
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

impl Sink for Committer {
    fn commit(&mut self, record: &Record<'_>, hash: u128) {
        self.count(record.class, record.copy, record.reason, record.sends);
        self.last = record.key;
        for (wants, observer) in &mut self.observers {
            if record.class == RecordClass::Sample && !wants.samples {
                continue;
            }
            match guarded(|| observer.record(record)) {
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
        if self.topology.digest && record.class != RecordClass::Sample {
            self.digest.extend(hash);
            self.hashed += 1;
            self.hashes.push(hash as u32);
            if self.hashes.len() == CHECKPOINT_RECORDS {
                self.checkpoint();
            }
        }
    }

    fn count_event(
        &mut self,
        class: RecordClass,
        key: EventKey,
        head: &Head,
        reason: &'static str,
        sends: u32,
    ) {
        self.count(class, head.copy, reason, sends);
        self.last = key;
    }

    /// The one engine that commits here has compared it with all others.
    fn first_sample(&mut self, _sample: FirstSample) {}

    fn paused(&self) -> bool {
        self.stop.is_some() || self.failure.is_some() || self.interrupt.load(Ordering::Relaxed)
    }
}

/// A record kept until its window is committed.
struct Kept {
    record: Record<'static>,
    kind: Option<Arc<Kind>>,
    carriage: Option<Carriage>,
    body: Range<usize>,
    hash: u128,
}

/// What one engine did in one window, in key order.
#[derive(Default)]
pub(crate) struct Batch {
    kept: Vec<Kept>,
    bytes: Vec<u8>,
    pub(crate) first_samples: Vec<FirstSample>,
}

impl Batch {
    /// The key of the record at `at`.
    pub(crate) fn key(&self, at: usize) -> Option<EventKey> {
        self.kept.get(at).map(|kept| kept.record.key)
    }

    /// Commits the record at `at`.
    pub(crate) fn commit(&self, at: usize, sink: &mut impl Sink) {
        let kept = &self.kept[at];
        let record = Record {
            kind: kept.kind.as_ref(),
            carriage: kept.carriage.as_ref(),
            body: &self.bytes[kept.body.clone()],
            ..kept.record
        };
        sink.commit(&record, kept.hash);
    }

    pub(crate) fn clear(&mut self) {
        self.kept.clear();
        self.bytes.clear();
    }

    /// The messages that the uncommitted records from `at` on had taken from their way, though
    /// committed events before `fault` sent them.
    pub(crate) fn undone(&self, at: usize, fault: EventKey, topology: &Topology) -> Vec<InFlight> {
        let mut found = Vec::new();
        let mut unit: Option<(EventKey, RecordClass)> = None;
        for kept in &self.kept[at..] {
            let record = &kept.record;
            let first = unit.is_none_or(|(key, _)| key != record.key);
            if first {
                unit = Some((record.key, record.class));
            }
            // A loss that a hand-over decided is undone with the hand-over, which is counted.
            let message = match record.class {
                RecordClass::Delivered | RecordClass::HandOver => true,
                RecordClass::Lost => first,
                _ => false,
            };
            if message && record.scheduled_by.is_some_and(|by| by < fault) {
                let head = Head {
                    sender: record.sender,
                    receiver: record.receiver,
                    link: record.link,
                    kind: kept
                        .kind
                        .as_ref()
                        .and_then(|kind| topology.kind_index(kind)),
                    ordinal: record.ordinal,
                    copy: record.copy,
                    match_key: record.match_key,
                    cause: record.cause,
                    ..Head::of_entity(record.sender)
                };
                found.push((record.key, head, self.bytes[kept.body.clone()].to_vec()));
            }
        }
        found
    }
}

impl Sink for Batch {
    fn commit(&mut self, record: &Record<'_>, hash: u128) {
        let start = self.bytes.len();
        self.bytes.extend_from_slice(record.body);
        self.kept.push(Kept {
            record: Record {
                kind: None,
                body: &[],
                carriage: None,
                ..*record
            },
            carriage: record.carriage.copied(),
            kind: record.kind.cloned(),
            body: start..self.bytes.len(),
            hash,
        });
    }

    fn count_event(
        &mut self,
        class: RecordClass,
        key: EventKey,
        head: &Head,
        reason: &'static str,
        sends: u32,
    ) {
        // A window's events are merged by key before they count, so they are kept all the same.
        let record = Record {
            class,
            key,
            cause: head.cause,
            scheduled_by: head.cause,
            sender: head.sender,
            receiver: head.receiver,
            link: head.link,
            kind: None,
            ordinal: head.ordinal,
            copy: head.copy,
            match_key: head.match_key,
            sent: head.sent(key),
            reason,
            body: &[],
            sends,
            carriage: None,
        };
        self.commit(&record, 0);
    }

    fn first_sample(&mut self, sample: FirstSample) {
        self.first_samples.push(sample);
    }

    fn paused(&self) -> bool {
        false
    }
}
