//! Committing: the one place where a run becomes a digest, counts, and records for observers.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::digest::Digest;
use crate::engine::{FirstSample, Happened, Head, InFlight, Side, Sink};
use crate::fault::ObserverError;
use crate::ids::EntityId;
use crate::key::EventKey;
use crate::record::{Checkpoint, Flow, NamedObserver, RecordClass, Wants};
use crate::report::{Counts, End, Report};
use crate::ruling::Rulings;
use crate::time::SimTime;
use crate::topology::{Kind, Topology};

/// Hashed records from one checkpoint to the next.
const CHECKPOINT_RECORDS: usize = 8192;

/// Takes records in key order, and is told nothing else.
pub(crate) struct Committer {
    topology: Arc<Topology>,
    observers: Vec<(NamedObserver, Wants)>,
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
    pub(crate) interrupt: Arc<AtomicBool>,
}

impl Committer {
    pub(crate) fn new(
        topology: Arc<Topology>,
        mut observers: Vec<(NamedObserver, Wants)>,
        interrupt: Arc<AtomicBool>,
    ) -> Result<Self, ObserverError> {
        let begun = observers
            .iter_mut()
            .try_for_each(|(observer, _)| observer.watch(|o| o.begin(&topology.info)));
        if let Err(error) = begun {
            for (observer, _) in observers {
                // Why the run cannot start is known already.
                let _ = observer.dismiss();
            }
            return Err(error);
        }
        Ok(Committer {
            last: topology.key(SimTime::ZERO, 0, EntityId::CONTROL, 0),
            checkpoints: observers.iter().any(|(_, wants)| wants.checkpoints),
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

    /// Drops the observers of a run that cannot start after all.
    pub(crate) fn dismiss(self) {
        for (observer, _) in self.observers {
            // Why it cannot start is known already.
            let _ = observer.dismiss();
        }
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

    /// True if there is a [`Committer::verdict`].
    pub(crate) fn verdict_is_due(&self) -> bool {
        self.failure.is_some() || self.interrupt.load(Ordering::Relaxed)
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
        for (observer, _) in &mut self.observers {
            if let Err(failure) = observer.watch(|o| o.end(&report)) {
                report.end = End::ObserverFailed(failure.0);
            }
        }
        for (observer, _) in self.observers {
            if let Err(failure) = observer.dismiss() {
                report.end = End::ObserverFailed(failure.0);
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
        for (observer, wants) in &mut self.observers {
            if wants.checkpoints
                && let Err(failure) = observer.watch(|o| o.checkpoint(&checkpoint))
            {
                self.failure.get_or_insert(failure.0);
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
        for (observer, wants) in &mut self.observers {
            if record.class == RecordClass::Sample && !wants.samples {
                continue;
            }
            match observer.watch(|o| o.record(&record)) {
                Ok(Flow::Continue) => {}
                Ok(Flow::Stop(reason)) => {
                    self.stop
                        .get_or_insert((record.key, EntityId::CONTROL, reason));
                }
                Err(failure) => {
                    self.failure.get_or_insert(failure.0);
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
        self.stop.is_some() || self.verdict_is_due()
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

/// So many records an engine may be ahead of what is committed, and so many bytes of messages: then it
/// waits for the others, however long the window is.
const AHEAD_RECORDS: usize = 1 << 12;
const AHEAD_BYTES: usize = 1 << 20;

/// What one engine did in a window and is not committed yet, in key order.
pub(crate) struct Batch {
    kept: Vec<Kept>,
    sides: Vec<Side>,
    bytes: Vec<u8>,
    /// So many of the first are committed.
    committed: usize,
    /// At so many records, or bytes, the engine pauses.
    pause_at: (usize, usize),
    pub(crate) first_samples: Vec<FirstSample>,
    interrupt: Arc<AtomicBool>,
}

impl Batch {
    pub(crate) fn new(interrupt: Arc<AtomicBool>) -> Self {
        Batch {
            kept: Vec::new(),
            sides: Vec::new(),
            bytes: Vec::new(),
            committed: 0,
            pause_at: (AHEAD_RECORDS, AHEAD_BYTES),
            first_samples: Vec::new(),
            interrupt,
        }
    }

    /// Takes as much again as an engine may be ahead: one that all others wait for goes on.
    pub(crate) fn open(&mut self) {
        self.pause_at = (
            self.kept.len() + AHEAD_RECORDS,
            self.bytes.len() + AHEAD_BYTES,
        );
    }

    /// True if the engine is as far ahead as it may be.
    pub(crate) fn is_full(&self) -> bool {
        self.kept.len() >= AHEAD_RECORDS || self.bytes.len() >= AHEAD_BYTES
    }

    /// The keys of what is not committed, and its places.
    pub(crate) fn uncommitted(&self) -> impl Iterator<Item = (EventKey, usize)> {
        let rest = self.kept.iter().enumerate().skip(self.committed);
        rest.map(|(at, kept)| (kept.key, at))
    }

    /// Commits what happened at `at`, the first that is not committed.
    pub(crate) fn commit(&mut self, at: usize, sink: &mut impl Sink) {
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
        self.committed = at + 1;
    }

    /// Forgets what is committed.
    pub(crate) fn shed(&mut self) {
        let committed = std::mem::take(&mut self.committed);
        if committed == self.kept.len() {
            self.kept.clear();
            self.sides.clear();
            self.bytes.clear();
            return;
        }
        self.kept.drain(..committed);
        let bytes = self.kept.first().map_or(0, |kept| kept.body.start);
        let sides = self.kept.iter().find_map(|kept| kept.side);
        let sides = sides.unwrap_or(self.sides.len());
        self.bytes.drain(..bytes);
        self.sides.drain(..sides);
        for kept in &mut self.kept {
            kept.body = kept.body.start - bytes..kept.body.end - bytes;
            kept.side = kept.side.map(|at| at - sides);
        }
    }

    /// The messages that the uncommitted records had taken from their way, though events before
    /// `from`, which are committed, had sent them.
    pub(crate) fn undone(&self, from: EventKey, topology: &Topology) -> Vec<InFlight> {
        let mut found = Vec::new();
        let mut unit: Option<EventKey> = None;
        for kept in &self.kept[self.committed..] {
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
            if message && by.is_some_and(|by| by < from) {
                found.push((
                    kept.head.key_in_flight(topology, kept.key, side),
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

    #[inline]
    fn paused(&self) -> bool {
        let (records, bytes) = self.pause_at;
        self.kept.len() >= records
            || self.bytes.len() >= bytes
            || self.interrupt.load(Ordering::Relaxed)
    }
}
