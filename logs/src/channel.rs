//! Channels of an MCAP file and their schemas, as they are declared.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use crate::decode::Layout;
use crate::parse::{ChannelRecord, SchemaRecord};
use crate::schema::Types;
use crate::value::Unreadable;

/// A schema of a log.
#[derive(Debug, Default)]
pub struct SchemaInfo {
    /// Its name.
    pub name: String,
    /// How it is written: `protobuf`, `jsonschema`, `ros2msg`, ...
    pub encoding: String,
    /// The schema itself.
    pub data: Vec<u8>,
    pub(crate) types: OnceLock<Result<Types, String>>,
    pub(crate) layout: OnceLock<Result<Layout, Unreadable>>,
}

impl SchemaInfo {
    /// The messages of the schema; `Err` says why they are not known.
    pub(crate) fn types(&self) -> Result<&Types, &str> {
        let read = || match self.encoding.as_str() {
            "protobuf" => Types::read(&self.data, &self.name),
            other => Err(format!(
                "the schema is written as {other:?}, not as protobuf"
            )),
        };
        let types = self.types.get_or_init(read);
        types.as_ref().map_err(String::as_str)
    }

    /// How messages are laid out by a schema that is no protobuf.
    pub(crate) fn layout(&self) -> Result<&Layout, Unreadable> {
        let layout = self
            .layout
            .get_or_init(|| Layout::read(&self.encoding, &self.name, &self.data));
        layout.as_ref().map_err(Clone::clone)
    }

    pub(crate) fn says_the_same(&self, other: &SchemaRecord<'_>) -> bool {
        self.name == other.name && self.encoding == other.encoding && self.data == other.data
    }
}

/// A channel of a log.
#[derive(Debug)]
pub struct ChannelInfo {
    /// Numbers the channels of a log in the order in which they are declared.
    pub(crate) serial: u32,
    /// Its topic.
    pub topic: String,
    /// The encoding of its messages.
    pub encoding: String,
    /// Its schema, if it has one.
    pub schema: Option<Arc<SchemaInfo>>,
    /// What else it says: `role` and `kind` in Farside's logs.
    pub metadata: BTreeMap<String, String>,
    pub(crate) schema_id: u16,
    /// What its messages are for those who read a log of Farside's.
    pub(crate) role: Role,
}

/// What a channel of Farside's logs is for, of what each message asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    Record,
    Checkpoint,
    Sample,
    /// What viewers draw, and what later versions may add.
    Other,
}

impl Role {
    pub(crate) fn of(metadata: &BTreeMap<String, String>) -> Role {
        match metadata.get("role").map(String::as_str) {
            Some("message" | "event") => Role::Record,
            Some("checkpoint") => Role::Checkpoint,
            Some("state") => Role::Sample,
            _ => Role::Other,
        }
    }
}

impl ChannelInfo {
    /// What the channel is for, in Farside's logs.
    pub fn role(&self) -> &str {
        self.metadata.get("role").map_or("", String::as_str)
    }

    /// Whose state samples the channel has, if it has any.
    pub(crate) fn sampled(&self) -> &str {
        let topic = self.topic.as_str();
        let inner = topic.strip_prefix("/state/").unwrap_or(topic);
        inner.rsplit_once('/').map_or("", |(sender, _)| sender)
    }

    pub(crate) fn says_the_same(&self, other: &ChannelRecord<'_>) -> bool {
        self.schema_id == other.schema_id
            && self.topic == other.topic
            && self.encoding == other.encoding
            && self.metadata == other.metadata
    }
}
