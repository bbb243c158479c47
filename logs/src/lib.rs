//! MCAP logs of Farside runs: write, read, verify, diff, recover.

mod descriptors;
mod diff;
mod envelope;
mod error;
mod fields;
mod frames;
mod info;
mod log;
mod parse;
mod recover;
mod scan;
mod topics;
mod verify;
mod wire;
mod writer;

pub use diff::{Cause, DiffOptions, DiffReport, FirstDifference, TopicDiff, diff};
pub use envelope::{KeyRef, RecordRef};
pub use error::LogError;
pub use info::{AttachmentInfo, LogInfo, RunSummary, TopicInfo, info};
pub use log::{Ending, Log, LoggedKey, LoggedRecord, Records};
pub use recover::{RecoverReport, recover};
pub use scan::{ChannelInfo, SchemaInfo};
pub use verify::{Mismatch, Verifier, VerifyHandle, VerifyOutcome};
pub use writer::{Attachment, Compression, LogOptions, LogWriter};
