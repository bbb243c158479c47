//! Windows: which engines may run up to where, and how what they did becomes one order.

use std::sync::Arc;
use std::time::Duration;

use kameo::actor::{ActorRef, Spawn};

use super::seat::{Round, Seats};
use super::{Helper, Share, lost_worker};
use crate::commit::Committer;
use crate::engine::{Action, Engine, InFlight, Outgoing, Remains, SampleNames};
use crate::executor::Ending;
use crate::fault::Fault;
use crate::ids::EntityId;
use crate::key::{Bound, EventKey};
use crate::report::{End, Report};
use crate::schedule::{Due, Schedule};
use crate::time::SimDuration;
use crate::topology::Topology;

/// A thread that sleeps is woken for so much work, or not at all: waking it takes a few
/// microseconds, and so does waiting for what it did.
const WORTH_A_THREAD: Duration = Duration::from_micros(25);

/// Leads the engines of one run from window to window.
pub(super) struct Coordinator {
    topology: Arc<Topology>,
    seats: Seats,
    /// By seat, time and step of the first event that it would handle. Windows look at no engine
    /// that has none in them.
    next: Vec<Option<Bound>>,
    helpers: Vec<ActorRef<Helper>>,
    /// The engine of shared links, which runs after the others in each window.
    shared: Option<usize>,
    schedule: Schedule,
    committer: Committer,
    look_ahead: SimDuration,
    sample_names: SampleNames,
    /// Reused from window to window: which record of which engine comes next.
    order: Vec<(EventKey, usize, usize)>,
}

impl Coordinator {
    pub(super) fn new(
        topology: Arc<Topology>,
        engines: Vec<Engine>,
        schedule: Schedule,
        committer: Committer,
        threads: usize,
    ) -> Self {
        let shared = topology.links.iter().find(|(_, link)| link.shared);
        let shared = shared.map(|(link, _)| topology.place(link).engine as usize);
        let look_ahead = topology.info.look_ahead;
        let helpers = (0..threads).map(|_| Helper::spawn(Helper)).collect();
        let seats = Seats::new(engines);
        let next = (0..seats.len()).map(|at| seats.take(at).peek()).collect();
        Coordinator {
            topology,
            seats,
            next,
            helpers,
            shared,
            schedule,
            committer,
            look_ahead,
            sample_names: SampleNames::default(),
            order: Vec::new(),
        }
    }

    pub(super) async fn run(mut self) -> Report {
        let mut undone = Vec::new();
        let ending = loop {
            if let Some(ending) = self.advance(&mut undone).await {
                break ending;
            }
        };
        let mut remains = Remains::default();
        remains.in_flight = undone;
        for at in 0..self.seats.len() {
            let mut seat = self.seats.take(at);
            for Outgoing { key, pending, .. } in std::mem::take(&mut seat.inbox) {
                remains.take(&self.topology, key, pending, ending.fault);
            }
            seat.engine.dissolve(ending.fault, &mut remains);
        }
        ending.finish(&self.topology, self.schedule, self.committer, remains)
    }

    /// Runs one window or applies one control event; tells if that was the last.
    async fn advance(&mut self, undone: &mut Vec<InFlight>) -> Option<Ending> {
        if let Some(end) = self.committer.verdict() {
            return Some(Ending::early(end, self.committer.last().time));
        }
        let earliest = self.next.iter().flatten().min().copied();
        let limit = self.schedule.bound();
        match earliest {
            Some(earliest) if earliest < limit => {
                let window = if self.look_ahead.is_zero() {
                    Bound {
                        time: earliest.time,
                        step: earliest.step + 1,
                    }
                } else {
                    Bound::at(earliest.time + self.look_ahead)
                };
                self.run_window(window.min(limit), undone).await
            }
            None if self.schedule.only_stops_left() => {
                Some(Ending::early(End::Completed, self.committer.last().time))
            }
            _ => match self.schedule.take_due(&self.topology) {
                Some(Due::Stop { key, by, reason }) => Some(Ending::stop(
                    &self.topology,
                    &mut self.committer,
                    key,
                    by,
                    reason,
                )),
                Some(Due::Control(key, entity, action)) => self.apply(key, entity, action, undone),
                None => Some(Ending::early(End::Completed, self.committer.last().time)),
            },
        }
    }

    async fn run_window(&mut self, bound: Bound, undone: &mut Vec<InFlight>) -> Option<Ending> {
        let shared = self.shared;
        let independent = (0..self.seats.len()).filter(|at| Some(*at) != shared);
        let mut finished = self.run_engines(independent, bound).await;
        finished.extend(self.run_engines(shared.into_iter(), bound).await);
        self.settle(&finished, undone)
    }

    /// Runs those of the engines that have something to do before `bound`, side by side, and
    /// hands out what they sent to other engines.
    async fn run_engines(
        &mut self,
        engines: impl Iterator<Item = usize>,
        bound: Bound,
    ) -> Vec<usize> {
        let is_due = |at: &usize| self.next[*at].is_some_and(|next| next < bound);
        let due: Vec<usize> = engines.filter(is_due).collect();
        if due.is_empty() {
            return due;
        }
        let threads = self.threads_worth_waking(&due);
        let round = Arc::new(Round::new(self.seats.clone(), due, bound));
        if threads > 1 {
            // The leader takes no share itself: tokio starts the last actor that it asks on its own
            // thread, and only once it waits.
            let mut asked = Vec::with_capacity(self.helpers.len());
            for helper in self.helpers.iter().take(threads) {
                let answer = helper.ask(Share(round.clone())).enqueue().await;
                asked.push(answer.unwrap_or_else(|error| lost_worker(&error)));
            }
            for answer in asked {
                answer.await.unwrap_or_else(|error| lost_worker(&error));
            }
        } else {
            round.share();
        }
        for at in &round.due {
            self.seats.hand_out(*at, &mut self.next);
        }
        round.due.clone()
    }

    /// How many threads are to share the work of these engines.
    fn threads_worth_waking(&self, due: &[usize]) -> usize {
        let most = due.len().min(self.helpers.len());
        // Tests have little work, and are to see threads.
        if most < 2 || cfg!(debug_assertions) {
            return most;
        }
        let expected: Duration = due.iter().map(|at| self.seats.take(*at).expected).sum();
        let worth_it = (expected.as_nanos() / WORTH_A_THREAD.as_nanos()) as usize;
        worth_it.min(most)
    }

    fn apply(
        &mut self,
        key: EventKey,
        entity: EntityId,
        action: Action,
        undone: &mut Vec<InFlight>,
    ) -> Option<Ending> {
        let at = self.topology.place(entity).engine as usize;
        self.seats.take(at).control(key, entity, action);
        self.seats.hand_out(at, &mut self.next);
        self.settle(&[at], undone)
    }

    /// Commits what the engines did, in key order, up to the first fault.
    fn settle(&mut self, finished: &[usize], undone: &mut Vec<InFlight>) -> Option<Ending> {
        let mut done: Vec<_> = finished.iter().map(|at| self.seats.take(*at)).collect();
        let samples = done
            .iter_mut()
            .map(|seat| std::mem::take(&mut seat.batch.first_samples));
        let samples: Vec<_> = samples.flatten().collect();
        let name = |actor| self.topology.name(actor).to_owned();
        let clash = self.sample_names.take(samples, name);
        let fault = done.iter().filter_map(|seat| seat.fault.as_ref());
        let fault = fault.chain(&clash).min_by_key(|fault| fault.key);
        let fault: Option<Box<Fault>> = fault.cloned();
        self.order.clear();
        for (place, seat) in done.iter().enumerate() {
            let keys = (0..).map_while(|at| seat.batch.key(at).map(|key| (key, place, at)));
            self.order.extend(keys);
        }
        self.order.sort_unstable();
        let mut uncommitted: Vec<Option<usize>> = vec![None; done.len()];
        for &(key, place, at) in &self.order {
            if fault.as_ref().is_some_and(|fault| key >= fault.key) {
                uncommitted[place].get_or_insert(at);
            } else {
                done[place].batch.commit(at, &mut self.committer);
            }
        }
        if let Some(fault) = fault {
            for (seat, at) in done.iter().zip(&uncommitted) {
                if let Some(at) = at {
                    undone.extend(seat.batch.undone(*at, fault.key, &self.topology));
                }
            }
            return Some(Ending::fault(fault));
        }
        let mut stops: Vec<_> = Vec::from_iter(self.committer.stop.take());
        for seat in &mut done {
            stops.append(&mut seat.stops);
            seat.batch.clear();
        }
        // Whoever asked first in the order of the run is heard first.
        stops.sort_by_key(|(key, by, _)| (*key, *by == EntityId::CONTROL));
        for (key, by, reason) in stops {
            self.schedule.ask_stop(key, by, reason);
        }
        None
    }
}
