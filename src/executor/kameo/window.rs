//! Windows: which engines may run up to where.
//!
//! A window is as long as the look-ahead, and may hold any number of events. So that it takes bounded
//! memory, an engine that is far ahead of what is committed waits for the others: a window has parts,
//! after each of which is committed what no engine can add to any more.

mod settle;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use kameo::actor::{ActorRef, Spawn};

use self::settle::Settled;
use super::seat::{Round, Seats};
use super::{Helper, Share, lost_worker};
use crate::commit::Committer;
use crate::engine::{Action, Engine, Outgoing, Remains, SampleNames};
use crate::executor::Ending;
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
    /// By seat, whether it is as far ahead of what is committed as it may be.
    full: Vec<bool>,
    helpers: Vec<ActorRef<Helper>>,
    /// The engine of shared links, which runs after the others in each window.
    shared: Option<usize>,
    schedule: Schedule,
    committer: Committer,
    look_ahead: SimDuration,
    sample_names: SampleNames,
    /// How many rounds were shared among threads.
    rounds: Arc<AtomicUsize>,
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
        let seats = Seats::new(engines, &committer.interrupt);
        let next: Vec<_> = (0..seats.len()).map(|at| seats.take(at).peek()).collect();
        Coordinator {
            topology,
            full: vec![false; seats.len()],
            seats,
            next,
            helpers,
            shared,
            schedule,
            committer,
            look_ahead,
            sample_names: SampleNames::default(),
            rounds: Arc::default(),
            order: Vec::new(),
        }
    }

    pub(super) async fn run(mut self) -> Report {
        let ending = loop {
            if let Some(ending) = self.advance().await {
                break ending;
            }
        };
        let mut remains = Remains::default();
        for at in 0..self.seats.len() {
            let mut seat = self.seats.take(at);
            if let Some(from) = ending.undone_from {
                let undone = seat.batch.undone(from, &self.topology);
                remains.in_flight.extend(undone);
            }
            for Outgoing { key, pending, .. } in std::mem::take(&mut seat.inbox) {
                remains.take(&self.topology, key, pending, ending.undone_from);
            }
            seat.engine.dissolve(ending.undone_from, &mut remains);
        }
        ending.finish(&self.topology, self.schedule, self.committer, remains)
    }

    /// Runs one window or applies one control event; tells if that was the last.
    async fn advance(&mut self) -> Option<Ending> {
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
                self.run_window(window.min(limit)).await
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
                Some(Due::Control(key, entity, action)) => self.apply(key, entity, action),
                None => Some(Ending::early(End::Completed, self.committer.last().time)),
            },
        }
    }

    /// Runs all engines up to `bound`, part by part; tells if that was the last window.
    async fn run_window(&mut self, mut bound: Bound) -> Option<Ending> {
        let shared = self.shared;
        let independent = |at: &usize| Some(*at) != shared;
        let mut ran = Vec::new();
        // What all wait for: it runs however far it is ahead of what is committed.
        let mut behind = None;
        loop {
            let engines = (0..self.seats.len()).filter(independent);
            self.run_engines(engines, bound, behind, &mut ran).await;
            // The others may still hand something to shared links from where they have come to.
            let reached = ran.iter().filter(|at| independent(at));
            let reached = reached.filter_map(|at| self.next[*at]).min();
            let reached = reached.map_or(bound, |reached| reached.min(bound));
            self.run_engines(shared.into_iter(), reached, behind, &mut ran)
                .await;
            let settled = self.settle(&mut ran, &mut bound);
            match settled {
                Settled::Part(least) => behind = Some(least),
                Settled::All(ending) => return ending,
            }
        }
    }

    /// Runs those of the engines that have something to do before `bound`, side by side, and
    /// hands out what they sent to other engines. Notes who ran.
    async fn run_engines(
        &mut self,
        engines: impl Iterator<Item = usize>,
        bound: Bound,
        behind: Option<Bound>,
        ran: &mut Vec<usize>,
    ) {
        let is_due = |at: &usize| {
            let next = self.next[*at];
            let may_go_on = !self.full[*at] || next == behind;
            may_go_on && next.is_some_and(|next| next < bound)
        };
        let due: Vec<usize> = engines.filter(is_due).collect();
        if due.is_empty() {
            return;
        }
        let threads = self.threads_worth_waking(&due);
        if threads > 1 {
            self.rounds.fetch_add(1, Ordering::Relaxed);
        }
        let rounds = self.rounds.clone();
        let round = Arc::new(Round::new(self.seats.clone(), due, bound, rounds));
        if threads > 1 {
            // The leader takes no share itself: tokio starts the last actor that it asks on its own
            // thread, and only once it waits.
            let mut asked = Vec::with_capacity(self.helpers.len());
            for (at, helper) in self.helpers.iter().take(threads).enumerate() {
                // The last is started on this thread.
                let stays_awake = at + 1 < threads;
                let share = Share {
                    round: round.clone(),
                    stays_awake,
                };
                let answer = helper.ask(share).enqueue().await;
                asked.push(answer.unwrap_or_else(|error| lost_worker(&error)));
            }
            if let Some(last) = asked.pop() {
                last.await.unwrap_or_else(|error| lost_worker(&error));
            }
            round.await_others();
            for answer in asked {
                answer.await.unwrap_or_else(|error| lost_worker(&error));
            }
        } else {
            round.share();
        }
        for at in &round.due {
            self.seats.hand_out(*at, &mut self.next);
        }
        ran.extend(&round.due);
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

    fn apply(&mut self, key: EventKey, entity: EntityId, action: Action) -> Option<Ending> {
        let at = self.topology.place(entity).engine as usize;
        self.seats.take(at).control(key, entity, action);
        self.seats.hand_out(at, &mut self.next);
        self.settle_all(&[at])
    }
}
