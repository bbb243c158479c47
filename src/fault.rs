//! Faults as values: what ends a run, and what keeps one from starting.

use crate::suggest::nearest;
use thiserror::Error;

use crate::key::EventKey;
use crate::time::{SimDuration, SimTime};

/// The error a handler returns to end the run, made from any error with `?`, or from a text.
///
/// ```
/// use farside::HandlerError;
/// fn parse(text: &str) -> Result<u32, HandlerError> {
///     Ok(text.parse::<u32>()?)
/// }
/// assert!(parse("x").unwrap_err().to_string().contains("invalid digit"));
/// assert_eq!(HandlerError::new("no power").to_string(), "no power");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HandlerError(String);

impl std::fmt::Display for HandlerError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

// `HandlerError` itself is no `Error`: only so can every error convert into it.
impl<E: std::error::Error> From<E> for HandlerError {
    fn from(error: E) -> Self {
        let mut text = error.to_string();
        let mut source = error.source();
        while let Some(inner) = source {
            text.push_str(": ");
            text.push_str(&inner.to_string());
            source = inner.source();
        }
        HandlerError(text)
    }
}

impl HandlerError {
    /// An error that says `text`.
    pub fn new(text: impl Into<String>) -> Self {
        HandlerError(text.into())
    }
}

/// What a handler returns.
pub type Outcome = Result<(), HandlerError>;

/// A fault: the run ended at this event, and neither it nor anything after it was committed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{actor} at {time}{}: {cause}", .message.as_deref().map(|m| format!(" handling {m}")).unwrap_or_default())]
pub struct Fault {
    /// The key of the event that failed.
    pub key: EventKey,
    /// When it failed.
    pub time: SimTime,
    /// The actor or link that failed.
    pub actor: String,
    /// The kind of the message being handled, and who sent it.
    pub message: Option<String>,
    /// What went wrong.
    pub cause: FaultCause,
}

/// What went wrong in a [`Fault`].
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum FaultCause {
    /// The handler returned an error.
    #[error("{0}")]
    Error(String),
    /// A handler, a constructor, a link or the encoding of a message panicked.
    #[error("panicked: {0}")]
    Panic(String),
    /// Something of the actor or link panicked while it was dropped: its state at a crash, a
    /// restart or the end of the run, or a message that could not reach it.
    #[error("panicked while it was dropped: {0}")]
    PanicInDrop(String),
    /// A link delivered sooner than it declared it ever would.
    #[error("link {link} declares a min_delay of {declared} but delivers after {actual}")]
    UndercutsMinDelay {
        /// The link.
        link: String,
        /// What `min_delay` returned at the start.
        declared: SimDuration,
        /// The delay it gave.
        actual: SimDuration,
    },
    /// A link gave a message no fate.
    #[error("link {link} gave {kind} from {sender} no fate")]
    NoFate {
        /// The link.
        link: String,
        /// The message's kind.
        kind: String,
        /// Who sent it.
        sender: String,
    },
    /// A link gave one copy of a message two fates: a copy that it held has one, unless it makes
    /// another that has a number of its own.
    #[error("link {link} gave copy {copy} of {kind} from {sender} two fates")]
    TwoFates {
        /// The link.
        link: String,
        /// The copy's number.
        copy: u32,
        /// The message's kind.
        kind: String,
        /// Who sent it.
        sender: String,
    },
    /// A link lost a message and did not say why.
    #[error("link {link} lost {kind} from {sender} for no reason: say why, as in `queue_full`")]
    NoReason {
        /// The link.
        link: String,
        /// The message's kind.
        kind: String,
        /// Who sent it.
        sender: String,
    },
    /// A link delivers a message after another delay than it says that the parts of it are.
    #[error("link {link} delivers {delay} after the sending, but the parts of that are {parts}")]
    PartsOfDelay {
        /// The link.
        link: String,
        /// From the sending to the delivery.
        delay: SimDuration,
        /// The sum of the parts: [`Carriage::total`](crate::Carriage::total).
        parts: SimDuration,
    },
    /// No link joins the two hosts.
    #[error("no link from host {from} to host {to}, to send {kind} to {receiver}")]
    NoRoute {
        /// The sender's host.
        from: String,
        /// The receiver's host.
        to: String,
        /// The receiving actor.
        receiver: String,
        /// The message's kind.
        kind: String,
    },
    /// The receiver's `Accepts` does not list the message.
    #[error("{receiver} handles {kind} but its `Accepts` does not list it")]
    NotListed {
        /// The receiving actor.
        receiver: String,
        /// The Rust type of the message.
        kind: String,
    },
    /// A handler used an id that another simulation of the same program gave out.
    #[error("{what} number {number} is of another simulation")]
    OtherSimulation {
        /// What the id is of: `actor`, `link` or `timer`.
        what: &'static str,
        /// Its number there, in order of declaration.
        number: u32,
    },
    /// A delayed send to another host: only a link delays what leaves a host.
    #[error("send_after reaches {receiver} on another host; only its link may delay it")]
    DelayedAcrossHosts {
        /// The receiving actor.
        receiver: String,
    },
    /// Too many zero-delay hops at one instant.
    #[error("more than {limit} zero-delay hops at one instant; the last ones were {}", .chain.join(", "))]
    StepLimit {
        /// The limit.
        limit: u32,
        /// The last hops, as `sender -> receiver (kind)`, each the cause of the next, up to the one
        /// that was too many.
        chain: Vec<String>,
    },
    /// Two types of state samples share a name, which a log could not tell apart.
    #[error("two types of state samples are called {name}: {first} and {second}")]
    SampleNames {
        /// The shared name.
        name: String,
        /// The Rust type that had it first.
        first: String,
        /// The other.
        second: String,
    },
    /// A message's value does not fit the schema traced from its type.
    #[error("cannot encode {kind}: {error}")]
    Encoding {
        /// The message's kind.
        kind: String,
        /// What is wrong with it.
        error: String,
    },
}

/// An observer could not go on: a full disk, for example. The run ends, its committed part stands.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct ObserverError(pub String);

/// Why a simulation could not start.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum BuildError {
    /// A name is not made of `snake_case` segments joined by `/` (and `-` in link names).
    #[error("name {name:?} is not snake_case segments of a-z, 0-9 and _, joined by /")]
    BadName {
        /// The name.
        name: String,
    },
    /// The name of an actor begins with a word that logs use; see [`crate::record::RESERVED`].
    #[error("name {name:?} begins with {first}, which names of actors may not: logs use it")]
    ReservedName {
        /// The name.
        name: String,
        /// Its first part.
        first: String,
    },
    /// Two entities have one name.
    #[error("the name {name:?} is declared twice")]
    DuplicateName {
        /// The name.
        name: String,
    },
    /// Two message types share a name, which a log could not tell apart.
    #[error("two message types are called {name}: {first} and {second}")]
    DuplicateKind {
        /// The shared name.
        name: String,
        /// One Rust type.
        first: String,
        /// The other.
        second: String,
    },
    /// A message type cannot be described.
    #[error("message type {name}: {error}")]
    Schema {
        /// The Rust type.
        name: String,
        /// What stands in the way.
        error: String,
    },
    /// Two links join the same hosts in the same direction.
    #[error("two links from host {from} to host {to}: {first} and {second}")]
    DuplicateRoute {
        /// The sending host.
        from: String,
        /// The receiving host.
        to: String,
        /// One link.
        first: String,
        /// The other.
        second: String,
    },
    /// A link that is not shared was to carry what a host sends.
    #[error("link {link} is not shared: it cannot carry what host {from} sends to host {to}")]
    NotShared {
        /// The link.
        link: String,
        /// The sending host.
        from: String,
        /// The receiving host.
        to: String,
    },
    /// An id that another simulation of the same program gave out was used to assemble this one.
    #[error("{what} number {number} is of another simulation")]
    OtherSimulation {
        /// What the id is of: `host`, `actor` or `link`.
        what: &'static str,
        /// Its number there, in order of declaration.
        number: u32,
    },
    /// An actor was to be told something, or a message was ruled on, and there is no such actor or
    /// message, or the actor does not accept that.
    #[error(transparent)]
    Lookup(#[from] LookupError),
    /// Actors cannot be built as another simulation builds them.
    #[error(
        "{own} here is {its} there: expected the same hosts, actors and links in the same order"
    )]
    OtherTeam {
        /// What this simulation has.
        own: String,
        /// What the other has in its place.
        its: String,
    },
    /// An observer failed before the first event.
    #[error(transparent)]
    Observer(#[from] ObserverError),
    /// The executor could not start its threads.
    #[error("cannot start the executor's threads: {0}")]
    Threads(String),
}

/// An address was asked for under a name or type that the run does not have.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum LookupError {
    /// No actor has the name.
    #[error("no actor is called {name:?}{}", suggestion(.nearest.as_deref()))]
    Unknown {
        /// The name.
        name: String,
        /// The actor whose name is closest to it.
        nearest: Option<String>,
    },
    /// No message of the run is of the kind.
    #[error("no message is a {kind:?}{}", suggestion(.nearest.as_deref()))]
    UnknownKind {
        /// The kind.
        kind: String,
        /// The kind whose name is closest to it.
        nearest: Option<String>,
    },
    /// The actor is of another type.
    #[error("{name} is a {actual}, not a {expected}")]
    WrongType {
        /// The actor's name.
        name: String,
        /// The type asked for.
        expected: &'static str,
        /// The type it has.
        actual: &'static str,
    },
    /// The actor does not accept messages of the type asked for.
    #[error("{name} is a {actual}, which does not accept {kind}; it accepts {}", listed(.accepts))]
    NotAccepted {
        /// The actor's name.
        name: String,
        /// The Rust type of the message.
        kind: &'static str,
        /// The type of the actor.
        actual: &'static str,
        /// The Rust types of the messages that it accepts.
        accepts: Vec<&'static str>,
    },
}

impl LookupError {
    pub(crate) fn unknown<'a>(name: &str, actors: impl Iterator<Item = &'a str>) -> Self {
        LookupError::Unknown {
            name: name.to_owned(),
            nearest: nearest(name, actors),
        }
    }
}

impl LookupError {
    pub(crate) fn unknown_kind<'a>(kind: &str, kinds: impl Iterator<Item = &'a str>) -> Self {
        LookupError::UnknownKind {
            kind: kind.to_owned(),
            nearest: nearest(kind, kinds),
        }
    }
}

fn suggestion(nearest: Option<&str>) -> String {
    nearest.map_or_else(String::new, |name| format!("; did you mean {name:?}?"))
}

fn listed(accepts: &[&str]) -> String {
    match accepts {
        [] => "no messages".to_owned(),
        names => names.join(", "),
    }
}
