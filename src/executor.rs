//! Executors: how the events of a run meet processors. The result is the same.
//!
//! *Inline* runs everything on the calling thread. *Kameo* runs engines in kameo actors on tokio's
//! threads; light hosts share one engine, a host declared heavy has its own.

mod inline;
mod kameo;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::commit::Committer;
use crate::engine::{Class, Engine, Happened, Head, Hop, Remains, Sink};
use crate::fault::{BuildError, Fault, FaultCause};
use crate::ids::EntityId;
use crate::key::EventKey;
use crate::record::{NamedObserver, RecordClass, Wants};
use crate::report::{End, Report};
use crate::schedule::Schedule;
use crate::time::SimTime;
use crate::topology::Topology;

/// How to execute a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Executor {
    /// On the calling thread: the fastest for one core.
    Inline,
    /// On `threads` threads of a pool, at least one.
    Kameo {
        /// How many.
        threads: usize,
    },
}

impl Executor {
    /// The executor's name: `inline` or `kameo`.
    pub fn name(self) -> &'static str {
        match self {
            Executor::Inline => "inline",
            Executor::Kameo { .. } => "kameo",
        }
    }
}

/// A run, ready to start.
pub(crate) struct Ready {
    pub(crate) topology: Arc<Topology>,
    pub(crate) engines: Vec<Engine>,
    pub(crate) schedule: Schedule,
    pub(crate) observers: Vec<(NamedObserver, Wants)>,
    pub(crate) interrupt: Arc<AtomicBool>,
    /// A constructor, or a link that was asked about itself, panicked before the first event.
    pub(crate) fault: Option<Box<Fault>>,
}

pub(crate) fn run(ready: Ready, executor: Executor) -> Result<Report, BuildError> {
    let Ready {
        topology,
        engines,
        schedule,
        observers,
        interrupt,
        fault,
    } = ready;
    let committer = Committer::new(topology.clone(), observers, interrupt);
    let threads = match executor {
        Executor::Inline => Ok(None),
        Executor::Kameo { threads } => self::kameo::threads(threads).map(Some),
    };
    let ready = match (committer, threads) {
        (Ok(committer), Ok(threads)) => Ok((committer, threads)),
        (Ok(committer), Err(error)) => {
            committer.dismiss();
            Err(error)
        }
        (Err(error), _) => Err(error.into()),
    };
    let (committer, threads) = match ready {
        Ok(ready) => ready,
        Err(error) => {
            // Why the run cannot start is known; what panics now is of no interest any more.
            let mut remains = dissolved(engines, None);
            schedule.dissolve(&topology, &mut remains);
            return Err(error);
        }
    };
    if let Some(fault) = fault {
        let ending = Ending::fault(fault);
        let remains = dissolved(engines, ending.undone_from);
        return Ok(ending.finish(&topology, schedule, committer, remains));
    }
    match threads {
        None => Ok(inline::run(topology, engines, schedule, committer)),
        Some(threads) => Ok(self::kameo::run(
            topology, engines, schedule, committer, threads,
        )),
    }
}

/// Takes engines apart that will not run, or not again.
fn dissolved(engines: Vec<Engine>, undone_from: Option<EventKey>) -> Remains {
    let mut remains = Remains::default();
    for mut engine in engines {
        engine.dissolve(undone_from, &mut remains);
    }
    remains
}

/// The fault, with what led to it if it is one of too many hops at an instant: the hops before it, each
/// the cause of the next, whichever engines they were in. `hop` finds one by its event's key.
fn explained(
    mut fault: Box<Fault>,
    topology: &Topology,
    hop: impl Fn(EventKey) -> Option<Hop>,
) -> Box<Fault> {
    /// So many hops show a loop of any length that people write.
    const SHOWN: usize = Topology::TRACED_STEPS as usize;
    if let FaultCause::StepLimit { chain, .. } = &mut fault.cause {
        let mut at = Some(fault.key);
        while let Some(hop) = at.and_then(&hop)
            && chain.len() < SHOWN
        {
            chain.push(hop.told(topology));
            at = hop.scheduled_by(topology);
        }
        chain.reverse();
    }
    fault
}

/// How a run ended, before what is still on its way is counted.
pub(crate) struct Ending {
    end: End,
    time: SimTime,
    /// What happened at or after this key is undone: that of the fault, if there was one, or where
    /// engines that had run further ahead were cut off.
    undone_from: Option<EventKey>,
}

impl Ending {
    fn fault(fault: Box<Fault>) -> Self {
        Ending {
            time: fault.time,
            undone_from: Some(fault.key),
            end: End::Fault(fault),
        }
    }

    fn early(end: End, time: SimTime) -> Self {
        Ending {
            end,
            time,
            undone_from: None,
        }
    }

    /// Drops what is left, then commits what is still on its way and reports. A panic meanwhile is a
    /// fault, unless the run ends with another: nothing that was committed is undone by it.
    fn finish(
        self,
        topology: &Topology,
        schedule: Schedule,
        committer: Committer,
        mut remains: Remains,
    ) -> Report {
        schedule.dissolve(topology, &mut remains);
        let fault = remains.fault(topology, self.time);
        let end = match (self.end, fault) {
            (End::Fault(fault), _) | (_, Some(fault)) => End::Fault(fault),
            (end, None) => end,
        };
        committer.finish(end, self.time, remains.in_flight)
    }

    /// Commits a stop and ends the run with it.
    fn stop(
        topology: &Topology,
        committer: &mut Committer,
        key: EventKey,
        by: EntityId,
        reason: String,
    ) -> Self {
        let mut head = Head::of_entity(Class::Tell, EntityId::CONTROL);
        head.sender = by;
        let (class, body) = (RecordClass::Stop, reason.as_bytes());
        committer.commit(&Happened {
            class,
            key,
            head: &head,
            side: None,
            sample: None,
            body,
            sends: 0,
            hash: head.hash_if_wanted(topology, class, key, body),
        });
        let by = topology.name(by).to_owned();
        Ending {
            end: End::Stopped { by, reason },
            time: key.time,
            undone_from: None,
        }
    }
}
