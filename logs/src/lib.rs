//! MCAP logs of Farside runs: write, read, verify, diff, recover.

mod attachments;
mod descriptors;
mod diff;
mod envelope;
mod error;
mod info;
mod recover;
mod topics;
mod verify;
mod wire;
mod writer;

pub use attachments::attachments;
pub use diff::{Cause, DiffOptions, DiffReport, FirstDifference, TopicDiff, diff};
pub use envelope::{KeyRef, RecordRef};
pub use error::LogError;
pub use info::{AttachmentInfo, LogInfo, RunSummary, TopicInfo, info};
pub use recover::{RecoverReport, recover};
pub use verify::{Mismatch, Verifier, VerifyHandle, VerifyOutcome};
pub use writer::{Attachment, Compression, LogOptions, LogWriter};
