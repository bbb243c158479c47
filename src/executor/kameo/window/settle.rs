//! What engines did in a window becomes one order, and is committed.

use std::sync::MutexGuard;

use super::Coordinator;
use crate::executor::kameo::seat::Seat;
use crate::executor::{Ending, explained};
use crate::fault::Fault;
use crate::ids::EntityId;
use crate::key::{Bound, EventKey};

/// How far a window has come.
pub(super) enum Settled {
    /// Some engines are not at its end; the one furthest behind would go on here.
    Part(Bound),
    /// All are; with the run's end, if it ends here.
    All(Option<Ending>),
}

impl Coordinator {
    /// Commits what these engines did, as far as none can add to it any more. After a fault the window
    /// ends with the step in which it happened: what comes later is undone anyway.
    pub(super) fn settle(&mut self, ran: &mut Vec<usize>, bound: &mut Bound) -> Settled {
        ran.sort_unstable();
        ran.dedup();
        if let Some(fault) = self.first_fault(ran) {
            *bound = (*bound).min(Bound {
                time: fault.time,
                step: fault.step + 1,
            });
        }
        let unfinished = ran.iter().filter_map(|at| self.next[*at]);
        let Some(behind) = unfinished.filter(|next| *next < *bound).min() else {
            return Settled::All(self.settle_all(ran));
        };
        // The least key there is at that step.
        let until = EventKey {
            time: behind.time,
            step: behind.step,
            tie: 0,
            source: EntityId::CONTROL,
            count: 0,
        };
        match self.settle_until(ran, Some(until)) {
            Some(ending) => Settled::All(Some(ending)),
            None => Settled::Part(behind),
        }
    }

    /// Commits all that these engines did, up to the first fault, and takes their requests to stop.
    pub(super) fn settle_all(&mut self, ran: &[usize]) -> Option<Ending> {
        let ending = self.settle_until(ran, None);
        if ending.is_some() {
            return ending;
        }
        let mut stops: Vec<_> = Vec::from_iter(self.committer.stop.take());
        for at in ran {
            stops.append(&mut self.seats.take(*at).stops);
        }
        // Whoever asked first in the order of the run is heard first.
        stops.sort_by_key(|(key, by, _)| (*key, *by == EntityId::CONTROL));
        for (key, by, reason) in stops {
            self.schedule.ask_stop(key, by, reason);
        }
        None
    }

    /// The key of the first fault.
    fn first_fault(&self, ran: &[usize]) -> Option<EventKey> {
        let faults = ran.iter().filter_map(|at| {
            let seat = self.seats.take(*at);
            seat.fault.as_ref().map(|fault| fault.key)
        });
        faults.min()
    }

    /// Commits what these engines did before `until`, if there is one, or before the first fault; tells
    /// if the run ends with that.
    fn settle_until(&mut self, ran: &[usize], until: Option<EventKey>) -> Option<Ending> {
        let all = self.seats.clone();
        let mut seats: Vec<_> = ran.iter().map(|at| all.take(*at)).collect();
        let is_settled = |key: EventKey| until.is_none_or(|until| key < until);
        let clash = self.clash(&mut seats, is_settled);
        let faults = seats.iter().filter_map(|seat| seat.fault.as_ref());
        let faults = faults.chain(&clash).filter(|fault| is_settled(fault.key));
        let fault: Option<Box<Fault>> = faults.min_by_key(|fault| fault.key).cloned();
        let limit = fault.as_ref().map(|fault| fault.key).or(until);
        let cut = self.commit(&mut seats, limit);
        for (at, seat) in ran.iter().zip(&mut seats) {
            seat.batch.shed();
            self.full[*at] = seat.batch.is_full();
        }
        // An observer that failed had done so before the fault.
        if let Some(end) = self.committer.verdict() {
            let mut ending = Ending::early(end, self.committer.last().time);
            ending.undone_from = cut.or(limit);
            return Some(ending);
        }
        let fault = fault?;
        drop(seats);
        // What led to it may have happened in engines that had nothing to do in this window.
        let hop = |key| (0..all.len()).find_map(|at| all.take(at).engine.parts.hops.find(key));
        Some(Ending::fault(explained(fault, &self.topology, hop)))
    }

    /// The fault of two types of samples that share a name, as far as that is settled.
    fn clash(
        &mut self,
        seats: &mut [MutexGuard<'_, Seat>],
        is_settled: impl Fn(EventKey) -> bool,
    ) -> Option<Box<Fault>> {
        let mut samples = Vec::new();
        for seat in seats {
            let first = &mut seat.batch.first_samples;
            samples.extend(first.extract_if(.., |sample| is_settled(sample.key)));
        }
        let name = |actor| self.topology.name(actor).to_owned();
        self.sample_names.take(samples, name)
    }

    /// Commits what happened before `limit`, if there is one, in key order. Returns where it broke off,
    /// if an observer can go on no longer or the run is interrupted: between two events, as with one
    /// engine.
    fn commit(
        &mut self,
        seats: &mut [MutexGuard<'_, Seat>],
        limit: Option<EventKey>,
    ) -> Option<EventKey> {
        self.order.clear();
        for (place, seat) in seats.iter().enumerate() {
            let rest = seat.batch.uncommitted();
            let before = rest.take_while(|(key, _)| limit.is_none_or(|limit| *key < limit));
            self.order.extend(before.map(|(key, at)| (key, place, at)));
        }
        self.order.sort_unstable();
        let mut last = None;
        for &(key, place, at) in &self.order {
            if last != Some(key) && self.committer.verdict_is_due() {
                return Some(key);
            }
            seats[place].batch.commit(at, &mut self.committer);
            last = Some(key);
        }
        None
    }
}
