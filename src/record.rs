//! What a run tells those who watch it: records in key order, checkpoints, and the end.
//!
//! An observer sees only what was committed. It may ask the run to stop, as part of the scenario;
//! it can change nothing else.

use std::sync::Arc;

use crate::carrier::Carriage;
use crate::digest::Digest;
use crate::fault::FaultCause;
pub use crate::fault::ObserverError;
use crate::guard::{dropped, guarded};
use crate::ids::{EntityId, MatchKey};
use crate::key::EventKey;
use crate::report::Report;
use crate::time::SimTime;
use crate::topology::{Kind, RunInfo};

/// First parts of names that no actor may have: logs put on topics that begin with them what is no
/// delivery of an actor's message, `/lost/rover_01/pose` beside `/rover_01/pose`.
///
/// ```
/// use farside::prelude::*;
/// # struct Idle;
/// # impl Actor for Idle { type Accepts = (); }
/// let mut sim = Simulation::new(1);
/// let host = sim.host("rover_01");
/// sim.actor(host, "lost/rover_01", |_| Idle);
/// let error = sim.run(Executor::Inline).unwrap_err();
/// assert_eq!(
///     error.to_string(),
///     "name \"lost/rover_01\" begins with lost, which names of actors may not: logs use it"
/// );
/// ```
pub const RESERVED: [&str; 7] = [
    "event",
    "hand_over",
    "in_flight",
    "lost",
    "scene",
    "state",
    "timer",
];

/// What a [`Record`] is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum RecordClass {
    /// An actor starts, at time zero.
    Start = 0,
    /// A message arrived and was handled: its fate is `delivered`.
    Delivered = 1,
    /// A message was lost: its fate is `lost`, and the record has the reason.
    Lost = 2,
    /// A message was still on its way when the run ended: its fate is `in_flight`.
    InFlight = 3,
    /// A timer fired.
    Timer = 4,
    /// A message reached a shared link, or came back to a link that had held it; the link then
    /// decided its fate, or holds it.
    HandOver = 5,
    /// A control event crashed an actor.
    Crash = 6,
    /// A control event restarted an actor.
    Restart = 7,
    /// A control event or an actor changed a link.
    Change = 8,
    /// The run was stopped.
    Stop = 9,
    /// An actor recorded a state sample. Not part of the digest.
    Sample = 10,
    /// A control event handed an actor a message. If the actor was crashed, nothing came of it.
    Told = 11,
}

impl RecordClass {
    /// The class's name in logs.
    pub fn name(self) -> &'static str {
        match self {
            RecordClass::Start => "start",
            RecordClass::Delivered => "delivered",
            RecordClass::Lost => "lost",
            RecordClass::InFlight => "in_flight",
            RecordClass::Timer => "timer",
            RecordClass::HandOver => "hand_over",
            RecordClass::Crash => "crash",
            RecordClass::Restart => "restart",
            RecordClass::Change => "change",
            RecordClass::Stop => "stop",
            RecordClass::Sample => "sample",
            RecordClass::Told => "told",
        }
    }

    /// True for the fate of a message copy: each copy has exactly one.
    pub fn is_fate(self) -> bool {
        matches!(
            self,
            RecordClass::Delivered | RecordClass::Lost | RecordClass::InFlight
        )
    }
}

/// One committed event or fate.
#[derive(Clone, Copy)]
pub struct Record<'a> {
    /// What the record is about.
    pub class: RecordClass,
    /// The key of the event. For a loss decided as a message was sent, the key of the sending
    /// event; for a message in flight, the key its delivery would have had.
    pub key: EventKey,
    /// The key of the event that caused this one, where one did.
    pub cause: Option<EventKey>,
    /// The event that put this one on its way: the cause, or behind a shared link the hand-over.
    pub scheduled_by: Option<EventKey>,
    /// Who sent the message; for other events, who they happen to.
    pub sender: EntityId,
    /// Who the message is for; for other events, who they happen to.
    pub receiver: EntityId,
    /// The link that carried it; none within a host.
    pub link: Option<EntityId>,
    /// The type of the body, where there is one.
    pub kind: Option<&'a Arc<Kind>>,
    /// The message's place in the flow (sender, receiver, kind); timers are counted apart.
    pub ordinal: u64,
    /// Which copy of the message this is; 0 unless the link made several.
    pub copy: u32,
    /// The protocol's own identity for the message, if it gave one.
    pub match_key: Option<MatchKey>,
    /// When the message was sent, or the timer set.
    pub sent: SimTime,
    /// Why the message was lost; empty otherwise.
    pub reason: &'static str,
    /// The encoded message; empty if no observer wants bodies and the digest is off.
    pub body: &'a [u8],
    /// How many messages the actor sent while it handled this event.
    pub sends: u32,
    /// How the link carried the message, where the link says. Explains the fate, as samples explain
    /// a state; no part of the digest, which has the delay itself.
    pub carriage: Option<&'a Carriage>,
}

impl Record<'_> {
    /// When the record belongs in the log: the time of the event.
    pub fn time(&self) -> SimTime {
        self.key.time
    }
}

/// What an observer answers to a record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Flow {
    /// Go on.
    Continue,
    /// Stop the run, for this reason, one look-ahead after this record's time.
    Stop(String),
}

/// The state of the digest after some event, with a short hash of each event since the last
/// checkpoint, so that a mismatch can be narrowed down to one event.
#[derive(Clone, Copy, Debug)]
pub struct Checkpoint<'a> {
    /// How many hashed records came before this point.
    pub records: u64,
    /// The key of the last of them.
    pub key: EventKey,
    /// The digest at this point.
    pub digest: Digest,
    /// The low 32 bits of the hash of each record since the last checkpoint, in order.
    pub hashes: &'a [u32],
}

/// What an observer wants to be shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wants {
    /// Encoded message bodies.
    pub bodies: bool,
    /// State samples.
    pub samples: bool,
    /// Checkpoints.
    pub checkpoints: bool,
}

/// Someone who watches a run: a log writer, a monitor, a progress bar.
pub trait Observer: Send {
    /// What to show this observer; asked once, before [`Observer::begin`].
    fn wants(&self) -> Wants {
        Wants::default()
    }

    /// The run is about to start.
    fn begin(&mut self, _run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        Ok(())
    }

    /// An event or fate was committed. Called in key order.
    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError>;

    /// The digest reached a checkpoint. Called every few thousand records, and at the end.
    fn checkpoint(&mut self, _checkpoint: &Checkpoint<'_>) -> Result<(), ObserverError> {
        Ok(())
    }

    /// The run is over.
    fn end(&mut self, _report: &Report) -> Result<(), ObserverError> {
        Ok(())
    }
}

/// An observer, and what its type is called: who is to blame if it cannot go on.
pub(crate) struct NamedObserver {
    pub(crate) name: &'static str,
    pub(crate) observer: Box<dyn Observer>,
}

impl NamedObserver {
    /// Runs the observer. Whether it returns an error or panics, it can watch no longer.
    pub(crate) fn watch<T>(
        &mut self,
        observe: impl FnOnce(&mut dyn Observer) -> Result<T, ObserverError>,
    ) -> Result<T, ObserverError> {
        match guarded(|| observe(&mut *self.observer)) {
            Ok(observed) => observed,
            Err(cause) => Err(self.panicked(&cause)),
        }
    }

    pub(crate) fn wants(&self) -> Result<Wants, ObserverError> {
        guarded(|| self.observer.wants()).map_err(|cause| self.panicked(&cause))
    }

    /// Drops the observer.
    pub(crate) fn dismiss(self) -> Result<(), ObserverError> {
        let NamedObserver { name, observer } = self;
        dropped(observer).map_err(|cause| panicked(name, &cause))
    }

    #[cold]
    fn panicked(&self, cause: &FaultCause) -> ObserverError {
        panicked(self.name, cause)
    }
}

fn panicked(name: &str, cause: &FaultCause) -> ObserverError {
    ObserverError(format!("an observer {cause} ({name})"))
}

/// A closure that looks at each record and never stops the run.
///
/// ```
/// use farside::prelude::*;
/// use std::sync::{Arc, Mutex};
/// # struct Idle;
/// # impl Actor for Idle { type Accepts = (); }
/// let times = Arc::new(Mutex::new(Vec::new()));
/// let seen = times.clone();
/// let mut sim = Simulation::new(1);
/// let host = sim.host("rover_01");
/// sim.actor(host, "rover_01", |_| Idle);
/// sim.observe(move |record: &farside::record::Record<'_>| {
///     seen.lock().unwrap().push(record.time());
/// });
/// sim.run(Executor::Inline).unwrap();
/// assert_eq!(*times.lock().unwrap(), [SimTime::ZERO]);
/// ```
impl<F: FnMut(&Record<'_>) + Send> Observer for F {
    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        self(record);
        Ok(Flow::Continue)
    }
}
