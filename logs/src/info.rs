//! What is in a log, at a glance: for Farside's own logs and for any other MCAP file.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use farside::Counts;
use serde::Serialize;

use crate::LogError;

/// What a Farside log says about its run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RunSummary {
    /// The version of the log format, `major.minor`.
    pub format: String,
    /// The version of the code that ran.
    pub code_version: String,
    /// The run's seed.
    pub seed: u64,
    /// The tie seed, if ties were shuffled.
    pub tie_seed: Option<u64>,
    /// The scenario's name.
    pub scenario: String,
    /// The hash of the resolved scenario.
    pub scenario_hash: String,
    /// Topics that were not written, as globs.
    pub exclude: Vec<String>,
    /// The digest; none if the log is cut.
    pub digest: Option<String>,
    /// Why the run ended, in one word; none if the log is cut.
    pub end: Option<String>,
    /// What there is to say about the end beyond that word.
    pub end_detail: String,
    /// The virtual time of the end, in seconds.
    pub end_time_s: Option<f64>,
    /// What the run counted.
    pub counts: Option<Counts>,
    /// The checkpoints in the log.
    pub checkpoints: u64,
}

/// One topic of a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TopicInfo {
    /// The topic.
    pub topic: String,
    /// The name of its schema; empty if it has none.
    pub schema: String,
    /// The encoding of its messages.
    pub encoding: String,
    /// What the topic is for, in Farside's logs: `message`, `event`, `state`, ...
    pub role: String,
    /// How many messages it has.
    pub messages: u64,
    /// Their size before compression, in bytes.
    pub bytes: u64,
}

/// One attachment of a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AttachmentInfo {
    /// Its name.
    pub name: String,
    /// Its media type.
    pub media_type: String,
    /// Its size, in bytes.
    pub bytes: u64,
}

/// What is in a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LogInfo {
    /// The file.
    pub path: String,
    /// Its size, in bytes.
    pub bytes: u64,
    /// The MCAP profile; empty if none is declared.
    pub profile: String,
    /// The library that wrote it.
    pub library: String,
    /// What a Farside log says about its run; none for other files.
    pub run: Option<RunSummary>,
    /// What is missing or damaged; empty for a whole log.
    pub missing: Vec<String>,
    /// How many messages there are on all topics.
    pub messages: u64,
    /// The earliest time of a message, in seconds.
    pub start_s: Option<f64>,
    /// The latest time of a message, in seconds.
    pub end_s: Option<f64>,
    /// From the earliest to the latest message, in seconds.
    pub duration_s: f64,
    /// How many chunks there are, by compression.
    pub chunks: BTreeMap<String, u64>,
    /// The topics, in name order.
    pub topics: Vec<TopicInfo>,
    /// The attachments, in file order.
    pub attachments: Vec<AttachmentInfo>,
    /// The metadata records, by name.
    pub metadata: BTreeMap<String, BTreeMap<String, String>>,
}

impl fmt::Display for LogInfo {
    fn fmt(&self, _f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Ok(())
    }
}

/// Reads the whole of a log, and says what is in it. A cut or damaged file is read as far as it
/// can be.
pub fn info(path: impl AsRef<Path>) -> Result<LogInfo, LogError> {
    let _ = path.as_ref();
    todo!()
}
