//! Windows: which engines may run up to where, and how what they did becomes one order.

use std::sync::Arc;

use kameo::actor::{ActorRef, Spawn};

use super::{Apply, CollectInFlight, Done, RunWindow, Worker, lost_worker};
use crate::commit::{Batch, Committer};
use crate::engine::{Action, Engine, InFlight, Outgoing};
use crate::executor::Ending;
use crate::fault::Fault;
use crate::key::{Bound, EntityId, EventKey};
use crate::plan::Plan;
use crate::report::{End, Report};
use crate::schedule::{Due, Schedule};
use crate::time::SimDuration;

/// An engine as the coordinator sees it.
struct Seat {
    worker: ActorRef<Worker>,
    next: Option<Bound>,
    inbox: Vec<Outgoing>,
    batch: Batch,
}

impl Seat {
    /// Time and step of the first event it would handle.
    fn peek(&self) -> Option<Bound> {
        let arriving = self.inbox.iter().map(|event| Bound {
            time: event.key.time,
            step: event.key.step,
        });
        arriving.chain(self.next).min()
    }
}

/// Leads the engines of one run from window to window.
pub(super) struct Coordinator {
    plan: Arc<Plan>,
    seats: Vec<Seat>,
    /// The engine of shared links, which runs after the others in each window.
    shared: Option<usize>,
    schedule: Schedule,
    committer: Committer,
    look_ahead: SimDuration,
    /// Reused from window to window: which record of which engine comes next.
    order: Vec<(EventKey, usize, usize)>,
}

impl Coordinator {
    pub(super) fn new(
        plan: Arc<Plan>,
        engines: Vec<Engine>,
        schedule: Schedule,
        committer: Committer,
    ) -> Self {
        let shared = plan.links.iter().find(|(_, link)| link.shared);
        let shared = shared.map(|(link, _)| plan.place(*link).engine as usize);
        let look_ahead = plan.info.look_ahead;
        let seat = |mut engine: Engine| Seat {
            next: engine.peek(),
            worker: Worker::spawn(Worker { engine }),
            inbox: Vec::new(),
            batch: Batch::default(),
        };
        let seats = engines.into_iter().map(seat).collect();
        Coordinator {
            plan,
            seats,
            shared,
            schedule,
            committer,
            look_ahead,
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
        let mut in_flight = undone;
        for seat in &mut self.seats {
            for Outgoing { key, pending, .. } in seat.inbox.drain(..) {
                let found = pending.in_flight(&self.plan, key, ending.fault);
                in_flight.extend(found);
            }
            let collect = CollectInFlight {
                until: ending.fault,
            };
            let found = seat.worker.ask(collect).await;
            in_flight.extend(found.unwrap_or_else(|error| lost_worker(&error)));
        }
        self.committer.finish(ending.end, ending.time, in_flight)
    }

    /// Runs one window or applies one control event; tells if that was the last.
    async fn advance(&mut self, undone: &mut Vec<InFlight>) -> Option<Ending> {
        if let Some(end) = self.committer.verdict() {
            return Some(Ending::early(end, self.committer.last().time));
        }
        let earliest = self.seats.iter().filter_map(Seat::peek).min();
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
            _ => match self.schedule.take_due(&self.plan) {
                Some(Due::Stop { key, by, reason }) => Some(Ending::stop(
                    &self.plan,
                    &mut self.committer,
                    key,
                    by,
                    reason,
                )),
                Some(Due::Control(key, entity, action)) => {
                    self.apply(key, entity, action, undone).await
                }
                None => Some(Ending::early(End::Completed, self.committer.last().time)),
            },
        }
    }

    async fn run_window(&mut self, bound: Bound, undone: &mut Vec<InFlight>) -> Option<Ending> {
        let shared = self.shared;
        let independent: Vec<usize> = (0..self.seats.len())
            .filter(|at| Some(*at) != shared)
            .collect();
        let mut finished = self.run_engines(&independent, bound).await;
        if let Some(shared) = shared {
            finished.extend(self.run_engines(&[shared], bound).await);
        }
        self.settle(finished, undone)
    }

    /// Runs those of the engines that have something to do before `bound`, side by side, and
    /// hands out what they sent to other engines.
    async fn run_engines(&mut self, engines: &[usize], bound: Bound) -> Vec<(usize, Done)> {
        let mut asked = Vec::new();
        for &at in engines {
            let seat = &mut self.seats[at];
            if seat.peek().is_none_or(|next| next >= bound) {
                continue;
            }
            let window = RunWindow {
                bound,
                inbox: std::mem::take(&mut seat.inbox),
                batch: std::mem::take(&mut seat.batch),
            };
            let pending = seat.worker.ask(window).enqueue().await;
            asked.push((at, pending.unwrap_or_else(|error| lost_worker(&error))));
        }
        let mut finished = Vec::with_capacity(asked.len());
        for (at, pending) in asked {
            let done: Box<Done> = pending.await.unwrap_or_else(|error| lost_worker(&error));
            finished.push((at, *done));
        }
        for (at, done) in &mut finished {
            self.seats[*at].next = done.next;
            for event in done.outgoing.drain(..) {
                self.seats[event.engine as usize].inbox.push(event);
            }
        }
        finished
    }

    async fn apply(
        &mut self,
        key: EventKey,
        entity: EntityId,
        action: Action,
        undone: &mut Vec<InFlight>,
    ) -> Option<Ending> {
        let at = self.plan.place(entity).engine as usize;
        let batch = std::mem::take(&mut self.seats[at].batch);
        let reply = self.seats[at]
            .worker
            .ask(Apply {
                key,
                entity,
                action,
                batch,
            })
            .await;
        let mut done = *reply.unwrap_or_else(|error| lost_worker(&error));
        self.seats[at].next = done.next;
        for event in done.outgoing.drain(..) {
            self.seats[event.engine as usize].inbox.push(event);
        }
        self.settle(vec![(at, done)], undone)
    }

    /// Commits what the engines did, in key order, up to the first fault.
    fn settle(
        &mut self,
        finished: Vec<(usize, Done)>,
        undone: &mut Vec<InFlight>,
    ) -> Option<Ending> {
        let fault = finished.iter().filter_map(|(_, done)| done.fault.as_ref());
        let fault: Option<Box<Fault>> = fault.min_by_key(|fault| fault.key).cloned();
        self.order.clear();
        for (place, (_, done)) in finished.iter().enumerate() {
            let keys = (0..).map_while(|at| done.batch.key(at).map(|key| (key, place, at)));
            self.order.extend(keys);
        }
        self.order.sort_unstable();
        let mut uncommitted: Vec<Option<usize>> = vec![None; finished.len()];
        for &(key, place, at) in &self.order {
            if fault.as_ref().is_some_and(|fault| key >= fault.key) {
                uncommitted[place].get_or_insert(at);
            } else {
                finished[place].1.batch.commit(at, &mut self.committer);
            }
        }
        if let Some(fault) = fault {
            for (place, at) in uncommitted.iter().enumerate() {
                if let Some(at) = at {
                    undone.extend(finished[place].1.batch.undone(*at, fault.key, &self.plan));
                }
            }
            return Some(Ending::fault(fault));
        }
        let mut stops: Vec<_> = Vec::from_iter(self.committer.stop.take());
        for (at, mut done) in finished {
            stops.append(&mut done.stops);
            done.batch.clear();
            self.seats[at].batch = done.batch;
        }
        // Whoever asked first in the order of the run is heard first.
        stops.sort_by_key(|(key, by, _)| (*key, *by == EntityId::CONTROL));
        for (key, by, reason) in stops {
            self.schedule.ask_stop(key, by, reason);
        }
        None
    }
}
