//! The records of one chunk, built where a run commits them: bytes as MCAP has them, back to back,
//! so that whoever compresses and writes the chunk has no record to copy.

use std::collections::BTreeMap;

use mcap::records::{Channel, MessageHeader, SchemaHeader, op};

use super::records::put_record;
use crate::descriptors::SchemaOf;
use crate::frames::{HEAD_BYTES, record_head};
use crate::parse::MESSAGE_HEADER_BYTES;

/// A chunk with this many bytes is full, as the `mcap` crate has it.
const FULL_BYTES: usize = 1 << 20;

/// What stands in front of the data of a message: the record's head, and the message's.
const FRONT_BYTES: usize = HEAD_BYTES as usize + MESSAGE_HEADER_BYTES;

/// Records on their way to the file.
#[derive(Default)]
pub(super) struct Chunk {
    bytes: Vec<u8>,
}

impl Chunk {
    pub(super) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    pub(super) fn is_full(&self) -> bool {
        self.bytes.len() >= FULL_BYTES
    }

    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    pub(super) fn clear(&mut self) {
        self.bytes.clear();
    }

    /// Declares a schema, before the channels that use it.
    pub(super) fn schema(&mut self, id: u16, schema: SchemaOf) {
        let header = SchemaHeader {
            id,
            name: schema.name,
            encoding: "protobuf".to_owned(),
        };
        put_record(&mut self.bytes, op::SCHEMA, &header, |out| {
            // A descriptor set is made by this crate, and far from 4 GiB.
            out.extend_from_slice(&(schema.data.len() as u32).to_le_bytes());
            out.extend_from_slice(&schema.data);
        });
    }

    /// Declares a channel, before the messages on it.
    pub(super) fn channel(
        &mut self,
        id: u16,
        schema_id: u16,
        topic: &str,
        metadata: BTreeMap<String, String>,
    ) {
        let channel = Channel {
            id,
            schema_id,
            topic: topic.to_owned(),
            message_encoding: "protobuf".to_owned(),
            metadata,
        };
        put_record(&mut self.bytes, op::CHANNEL, &channel, |_| {});
    }

    /// Adds a message, whose data `encode` appends.
    pub(super) fn message(&mut self, header: MessageHeader, encode: impl FnOnce(&mut Vec<u8>)) {
        let start = self.bytes.len();
        let mut front = [0; FRONT_BYTES];
        front[0] = op::MESSAGE;
        front[9..11].copy_from_slice(&header.channel_id.to_le_bytes());
        front[11..15].copy_from_slice(&header.sequence.to_le_bytes());
        front[15..23].copy_from_slice(&header.log_time.to_le_bytes());
        front[23..31].copy_from_slice(&header.publish_time.to_le_bytes());
        self.bytes.extend_from_slice(&front);
        encode(&mut self.bytes);
        let length = (self.bytes.len() - start) as u64 - HEAD_BYTES;
        self.bytes[start + 1..start + 9].copy_from_slice(&length.to_le_bytes());
    }

    /// Gives all messages of the chunk this time.
    pub(super) fn set_log_times(&mut self, log_time: u64) {
        let mut rest = self.bytes.as_mut_slice();
        while let Some((opcode, length)) = record_head(rest) {
            if opcode == op::MESSAGE
                && let Some(time) = rest.get_mut(15..23)
            {
                time.copy_from_slice(&log_time.to_le_bytes());
            }
            let next = HEAD_BYTES as usize + length as usize;
            rest = rest.get_mut(next..).unwrap_or_default();
        }
    }
}
