//! MCAP logs of Farside runs: write, read, verify, diff, recover.
//!
//! This is the only crate that names `mcap`. It knows runs, records and messages; it does not know
//! rovers, radios or terrain.
//!
//! - [`LogWriter`] is an observer that writes a run while it goes on.
//! - [`info`] says what is in a log, or in any MCAP file, whole or cut.
//! - [`Log`] and [`Records`] read a log's records one after the other.
//! - [`Verifier`] is an observer that compares a re-execution with a log.
//! - [`diff`] says which messages of two logs differ, which one first, and what caused it.
//! - [`recover`] makes a whole file of a broken one.
//!
//! # The format, version 1.3
//!
//! One MCAP message for each record of a run, in the order in which they were committed.
//!
//! | topic | what | `log_time` | `publish_time` |
//! |---|---|---|---|
//! | `/{sender}/{kind}` | a message was delivered | delivered | sent |
//! | `/lost/{sender}/{kind}` | a message was lost | lost | sent |
//! | `/in_flight/{sender}/{kind}` | a message was on its way when the run ended | the end | sent |
//! | `/hand_over/{sender}/{kind}` | a message reached a shared link | reached | sent |
//! | `/timer/{actor}/{kind}` | a timer fired | fired | set |
//! | `/event/{start,crash,restart}` | what happened to an actor, the `receiver` | when | when |
//! | `/event/change/{kind}` | a link, the `receiver`, was changed | when | when |
//! | `/event/told/{kind}` | a control event handed an actor a message | when | when |
//! | `/event/stop` | the run was stopped | when | when |
//! | `/state/{actor}/{kind}` | a state sample; never compared | when | when |
//! | `/tf` | drawn: frames, `foxglove.FrameTransforms` | when | when |
//! | `/scene` | drawn: shapes, and deletions, `foxglove.SceneUpdate` | when | when |
//! | `/poses/...` | drawn: where something is, `foxglove.PosesInFrame` | when | when |
//! | `/log` | drawn: text, `foxglove.Log` | when | when |
//! | `farside/checkpoint` | digest, and 32-bit hashes of the records since the last | when | when |
//!
//! `kind` is the serde name of the message's type in `snake_case`. Each message is an envelope, the
//! protobuf message `farside.record.{Kind}`: `sender`, `receiver`, `link`, `kind`, `fate`,
//! `reason`, `ordinal`, `copy`, the event's key (`time_ns`, `step`, `source`, `count`, `tie`),
//! `sent_ns`, `cause`, `match_key`, `body`, and `carriage`: how the link carried the message, its
//! delay in parts (`queue_ns`, `serialization_ns`, `propagation_ns`, `jitter_ns`, `retries_ns`),
//! the `attempts` it took, the `energy_j` they cost, the `receive_j` that receiving took and the
//! number of `fragments` if it did not go as a whole; that explains a fate and is never compared. What has no body is a `farside.log.Event`. State samples
//! are their own type, without an envelope.
//!
//! `role` in a channel's metadata is `message`, `event`, `state`, `viewer` or `checkpoint`; readers
//! skip the roles that they do not know. What is drawn ([`farside::scene::Scene`]) is derived from
//! the records, in Foxglove's published schemas, and never compared. Metadata: `farside` (format,
//! code version, seed, scenario), `farside.run`, `farside.host` (what may differ between machines),
//! and at the end `farside.end` (digest, counts, why the run ended); a log without it is a prefix.
//! Attachments: the resolved scenario as `scenario.toml`, and the files that it read.
//!
//! MCAP numbers channels in 16 bits: in a run of very many actors those that come last share a topic for each
//! kind, with `others` in place of their name. Their state samples say what, and not whose.
//!
//! 1.2 added `/event/told` and a carriage's `receive_j` and `fragments`. Before 1.3 each actor and each
//! link had a topic of its own for its events (`/event/crash/node_07`), thousands in one log. A minor
//! version adds fields, roles or metadata, or says otherwise which topic a record is on: readers go by
//! the record. A major version changes or removes them.

mod any;
mod channel;
mod decode;
mod descriptors;
mod diff;
mod envelope;
mod error;
mod fields;
mod frames;
mod group;
mod info;
mod log;
mod messages;
mod output;
mod parse;
mod recover;
mod replay;
mod salvage;
mod scan;
mod schema;
mod shown;
mod source;
mod topics;
mod value;
mod verify;
mod wire;
mod writer;

pub use any::{AnyMessage, AnyMessages};
pub use channel::{ChannelInfo, SchemaInfo};
pub use diff::{
    Carried, Cause, CauseChain, CausedBy, DiffOptions, DiffReport, Differing, FieldChange,
    FirstDifference, Hop, Rate, Reached, Root, RootKind, TopicDiff, causes, diff, diff_marked,
};
pub use envelope::{KeyRef, RecordRef};
pub use error::LogError;
pub use fields::Tolerance;
pub use info::{AttachmentInfo, ControlInfo, LogInfo, RunSummary, TopicInfo, info};
pub use log::{Ending, Log, LoggedKey, LoggedRecord, Records};
pub use messages::{FoundMessage, find_messages};
pub use output::{may_hold_log, refuse_input};
pub use recover::{LostMessages, LostToldBy, RecoverReport, recover};
pub use replay::{
    Again, OutputCount, OutputSide, ReplayOutcome, ReplayedOutput, ReplayedStep, again, charges_in,
    filtered_inputs, replay,
};
pub use shown::{escaped, is_hidden};
pub use value::{NumberKind, Numbers, Unreadable, Value};
pub use verify::{Mismatch, Verifier, VerifyHandle, VerifyOutcome};
pub use writer::{Attachment, Compression, LogOptions, LogWriter};
