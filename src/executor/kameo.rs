//! The kameo executor: engines as kameo actors on tokio's threads.
//!
//! A run moves into one kameo actor and stays there if it has one engine. With several, each is an
//! actor, and time advances in windows no longer than the look-ahead: within a window no engine can hear from another, so
//! all run side by side; then shared links take what was handed to them; then everything is
//! committed in key order. kameo's own identities, supervision and streams stay out of it.

mod window;

use std::convert::Infallible;
use std::sync::Arc;

use kameo::Actor;
use kameo::actor::{ActorRef, Spawn};
use kameo::message::{Context, Message};

use super::inline;
use crate::commit::{Batch, Committer};
use crate::engine::{Action, Engine, InFlight, Outgoing};
use crate::fault::{BuildError, Fault};
use crate::key::{Bound, EntityId, EventKey};
use crate::plan::Plan;
use crate::report::Report;
use crate::schedule::Schedule;

/// Runs to the end on `threads` threads of a pool of its own.
pub(super) fn run(
    plan: Arc<Plan>,
    engines: Vec<Engine>,
    schedule: Schedule,
    committer: Committer,
    threads: usize,
) -> Result<Report, BuildError> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(threads.max(1))
        .thread_name("farside")
        .build()
        .map_err(|error| BuildError::Threads(error.to_string()))?;
    let run = Run {
        plan,
        engines,
        schedule,
        committer,
    };
    let report = runtime.block_on(async move {
        let leader = Leader::spawn(Leader);
        let report = leader.ask(run).await;
        report.unwrap_or_else(|error| lost_worker(&error))
    });
    Ok(*report)
}

/// Handlers' panics are caught in the engine; a worker that is gone is a bug of this executor.
fn lost_worker<T>(error: &dyn std::fmt::Display) -> T {
    panic!("a kameo worker did not answer: {error}")
}

/// The actor that leads a run: the engine itself if there is only one, or who tells the others.
/// As an actor it lives on the pool's threads. On the calling thread it would need a processor of
/// its own, and two switches of threads for each engine and window.
struct Leader;

/// A whole run.
struct Run {
    plan: Arc<Plan>,
    engines: Vec<Engine>,
    schedule: Schedule,
    committer: Committer,
}

impl Actor for Leader {
    type Args = Self;
    type Error = Infallible;

    async fn on_start(args: Self, _: ActorRef<Self>) -> Result<Self, Infallible> {
        Ok(args)
    }
}

impl Message<Run> for Leader {
    type Reply = Box<Report>;

    async fn handle(&mut self, run: Run, _: &mut Context<Self, Self::Reply>) -> Self::Reply {
        let Run {
            plan,
            engines,
            schedule,
            committer,
        } = run;
        if engines.len() == 1 {
            return Box::new(inline::run(plan, engines, schedule, committer));
        }
        let coordinator = window::Coordinator::new(plan, engines, schedule, committer);
        Box::new(coordinator.run().await)
    }
}

/// An engine as a kameo actor.
struct Worker {
    engine: Engine,
}

impl Actor for Worker {
    type Args = Self;
    type Error = Infallible;

    async fn on_start(args: Self, _: ActorRef<Self>) -> Result<Self, Infallible> {
        Ok(args)
    }
}

/// Asks a worker to go on until `bound`.
struct RunWindow {
    bound: Bound,
    inbox: Vec<Outgoing>,
    batch: Batch,
}

/// Asks a worker to apply a control event.
struct Apply {
    key: EventKey,
    entity: EntityId,
    action: Action,
    batch: Batch,
}

/// What a worker did.
struct Done {
    batch: Batch,
    outgoing: Vec<Outgoing>,
    next: Option<Bound>,
    fault: Option<Box<Fault>>,
    stops: Vec<(EventKey, EntityId, String)>,
}

/// Asks a worker for the messages still on their way.
struct CollectInFlight {
    until: Option<EventKey>,
}

impl Worker {
    fn done(&mut self, batch: Batch, result: Result<(), Box<Fault>>) -> Done {
        Done {
            batch,
            outgoing: std::mem::take(&mut self.engine.parts.outgoing),
            next: self.engine.peek(),
            fault: result.err(),
            stops: Vec::from_iter(self.engine.parts.stop.take()),
        }
    }
}

impl Message<RunWindow> for Worker {
    type Reply = Box<Done>;

    async fn handle(
        &mut self,
        window: RunWindow,
        _: &mut Context<Self, Self::Reply>,
    ) -> Self::Reply {
        let RunWindow {
            bound,
            inbox,
            mut batch,
        } = window;
        for Outgoing { key, pending, .. } in inbox {
            self.engine.parts.insert(key, pending);
        }
        let mut stops = Vec::new();
        let result = loop {
            let result = self.engine.run(bound, &mut batch);
            // A request to stop interrupts the engine, but takes effect in a later window.
            match self.engine.parts.stop.take() {
                Some(stop) if result.is_ok() => stops.push(stop),
                _ => break result,
            }
        };
        let mut done = self.done(batch, result);
        done.stops = stops;
        Box::new(done)
    }
}

impl Message<Apply> for Worker {
    type Reply = Box<Done>;

    async fn handle(&mut self, apply: Apply, _: &mut Context<Self, Self::Reply>) -> Self::Reply {
        let Apply {
            key,
            entity,
            action,
            mut batch,
        } = apply;
        let result = self.engine.control(key, entity, action, &mut batch);
        Box::new(self.done(batch, result))
    }
}

impl Message<CollectInFlight> for Worker {
    type Reply = Vec<InFlight>;

    async fn handle(
        &mut self,
        collect: CollectInFlight,
        _: &mut Context<Self, Self::Reply>,
    ) -> Self::Reply {
        self.engine.parts.take_in_flight(collect.until)
    }
}
