//! The kameo executor: a run led by a kameo actor, helped by others, on tokio's threads.
//!
//! A run with one engine stays in the leader. With several, time advances in windows no longer than
//! the look-ahead: within a window no engine can hear from another, so all run side by side, each
//! claimed by the actor that next has time; then shared links take what was handed to them; then
//! everything is committed in key order. kameo's own identities, supervision and streams stay out
//! of it.

mod seat;
mod window;

use std::convert::Infallible;
use std::sync::Arc;

use kameo::Actor;
use kameo::actor::{ActorRef, Spawn};
use kameo::message::{Context, Message};
use kameo::reply::DelegatedReply;
use tokio::runtime::Runtime;

use self::seat::Round;
use super::inline;
use crate::commit::Committer;
use crate::engine::Engine;
use crate::fault::BuildError;
use crate::report::Report;
use crate::schedule::Schedule;
use crate::topology::Topology;

/// The threads of a run.
pub(super) struct Threads {
    count: usize,
    runtime: Runtime,
}

/// A pool of `count` threads, at least one, for one run.
pub(super) fn threads(count: usize) -> Result<Threads, BuildError> {
    let count = count.max(1);
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(count)
        .thread_name("farside")
        .build()
        .map_err(|error| BuildError::Threads(error.to_string()))?;
    Ok(Threads { count, runtime })
}

/// Runs to the end on these threads.
pub(super) fn run(
    topology: Arc<Topology>,
    engines: Vec<Engine>,
    schedule: Schedule,
    committer: Committer,
    threads: Threads,
) -> Report {
    let Threads { count, runtime } = threads;
    let run = Run {
        topology,
        engines,
        schedule,
        committer,
    };
    let report = runtime.block_on(async move {
        let leader = Leader::spawn(Leader { threads: count });
        let report = leader.ask(run).await;
        report.unwrap_or_else(|error| lost_worker(&error))
    });
    *report
}

/// Handlers' panics are caught in the engine; a worker that is gone is a bug of this executor.
fn lost_worker<T>(error: &dyn std::fmt::Display) -> T {
    panic!("a kameo worker did not answer: {error}")
}

/// The actor that leads a run. As an actor it lives on the pool's threads. On the calling thread it
/// would need a processor of its own, and two switches of threads for each engine and window.
struct Leader {
    threads: usize,
}

/// A whole run.
struct Run {
    topology: Arc<Topology>,
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
            topology,
            engines,
            schedule,
            committer,
        } = run;
        if engines.len() == 1 {
            return Box::new(inline::run(topology, engines, schedule, committer));
        }
        let coordinator =
            window::Coordinator::new(topology, engines, schedule, committer, self.threads);
        Box::new(coordinator.run().await)
    }
}

/// An actor that runs engines for the leader. There is one for each thread: one for each engine
/// would cost a message and an answer for each engine and window.
struct Helper;

impl Actor for Helper {
    type Args = Self;
    type Error = Infallible;

    async fn on_start(args: Self, _: ActorRef<Self>) -> Result<Self, Infallible> {
        Ok(args)
    }
}

/// Asks for help with a window.
struct Share {
    round: Arc<Round>,
    /// Whether to wait awake for the next one, on a thread that has nothing else to do.
    stays_awake: bool,
}

impl Message<Share> for Helper {
    type Reply = DelegatedReply<()>;

    async fn handle(&mut self, share: Share, ctx: &mut Context<Self, Self::Reply>) -> Self::Reply {
        share.round.share();
        let (replied, sender) = ctx.reply_sender();
        if let Some(sender) = sender {
            sender.send(());
        }
        if share.stays_awake {
            share.round.await_next();
        }
        replied
    }
}
