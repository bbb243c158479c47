//! An MCAP file of which whole chunks are written, each compressed at once.
//!
//! The writer of the `mcap` crate compresses record by record as they come, which costs as much
//! again as compressing a chunk that is there: each record passes through the compressor's input
//! buffer. It has no way to be given a chunk. So the file's frame is written here, with the crate's
//! own record types; the crate reads it back in the tests.

use std::collections::BTreeMap;
use std::io::{self, Write};

use mcap::MAGIC;
use mcap::records::{
    AttachmentHeader, AttachmentIndex, ChunkHeader, ChunkIndex, DataEnd, Footer, Header, Metadata,
    MetadataIndex, Statistics, SummaryOffset, op,
};

use zstd::zstd_safe::CParameter;

use super::Compression;
use super::records::{put_record, records};

/// A message in an index: its log time, its offset.
const ENTRY_BYTES: usize = 16;

/// An MCAP file that is being written.
pub(super) struct McapFile<W> {
    out: W,
    /// How many bytes were written.
    at: u64,
    /// The checksum of all of them.
    sum: crc32fast::Hasher,
    /// None writes chunks as they are.
    compressor: Option<zstd::bulk::Compressor<'static>>,
    compressed: Vec<u8>,
    channels: Vec<OfChannel>,
    /// The channels with messages in the chunk that is written.
    in_chunk: Vec<u16>,
    /// The earliest and the latest time of a message.
    times: Option<(u64, u64)>,
    /// But for what is known at the end only.
    statistics: Statistics,
    groups: Groups,
}

/// What is kept of a channel.
#[derive(Default)]
struct OfChannel {
    /// The message index of the chunk that is written: log time and offset of each message.
    index: Vec<u8>,
    messages: u64,
}

/// Records that the summary repeats or adds, as they are to be written.
#[derive(Default)]
struct Groups {
    schemas: Vec<u8>,
    channels: Vec<u8>,
    chunk_indexes: Vec<u8>,
    attachment_indexes: Vec<u8>,
    metadata_indexes: Vec<u8>,
}

impl<W: Write> McapFile<W> {
    /// Starts a file: magic bytes and header.
    pub(super) fn create(out: W, compression: Compression, library: String) -> io::Result<Self> {
        let compressor = match compression {
            Compression::Zstd => Some(compressor()?),
            Compression::None => None,
        };
        let mut file = McapFile {
            out,
            at: 0,
            sum: crc32fast::Hasher::new(),
            compressor,
            compressed: Vec::new(),
            channels: Vec::new(),
            in_chunk: Vec::new(),
            times: None,
            statistics: Statistics::default(),
            groups: Groups::default(),
        };
        let profile = String::new();
        let mut start = MAGIC.to_vec();
        put_record(&mut start, op::HEADER, &Header { profile, library }, |_| {});
        file.put(&start)?;
        Ok(file)
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.out.write_all(bytes)?;
        self.sum.update(bytes);
        self.at += bytes.len() as u64;
        Ok(())
    }

    /// Gives all that was written to the operating system.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    pub(super) fn metadata(
        &mut self,
        name: &str,
        metadata: BTreeMap<String, String>,
    ) -> io::Result<()> {
        let name = name.to_owned();
        let record = Metadata {
            name: name.clone(),
            metadata,
        };
        let mut bytes = Vec::new();
        put_record(&mut bytes, op::METADATA, &record, |_| {});
        let (offset, length) = (self.at, bytes.len() as u64);
        let index = MetadataIndex {
            offset,
            length,
            name,
        };
        put_record(
            &mut self.groups.metadata_indexes,
            op::METADATA_INDEX,
            &index,
            |_| {},
        );
        self.statistics.metadata_count += 1;
        self.put(&bytes)
    }

    pub(super) fn attachment(&mut self, head: AttachmentHeader, data: &[u8]) -> io::Result<()> {
        let mut bytes = Vec::new();
        put_record(&mut bytes, op::ATTACHMENT, &head, |content| {
            content.extend_from_slice(&(data.len() as u64).to_le_bytes());
            content.extend_from_slice(data);
            let sum = crc32fast::hash(content);
            content.extend_from_slice(&sum.to_le_bytes());
        });
        let index = AttachmentIndex {
            offset: self.at,
            length: bytes.len() as u64,
            log_time: head.log_time,
            create_time: head.create_time,
            data_size: data.len() as u64,
            name: head.name,
            media_type: head.media_type,
        };
        put_record(
            &mut self.groups.attachment_indexes,
            op::ATTACHMENT_INDEX,
            &index,
            |_| {},
        );
        self.statistics.attachment_count += 1;
        self.put(&bytes)
    }

    /// Writes the records of a chunk, compressed, and the index of its messages. Then all of it is
    /// the operating system's: a run that is killed leaves every chunk that was written.
    pub(super) fn chunk(&mut self, chunk: &[u8]) -> io::Result<()> {
        let (start, end) = self.index(chunk);
        let mut data = chunk;
        if let Some(compressor) = &mut self.compressor {
            self.compressed.clear();
            self.compressed
                .reserve(zstd::zstd_safe::compress_bound(chunk.len()));
            compressor.compress_to_buffer(chunk, &mut self.compressed)?;
            data = &self.compressed;
        }
        let compression = self.compressor.as_ref().map_or("", |_| "zstd");
        let header = ChunkHeader {
            message_start_time: start,
            message_end_time: end,
            uncompressed_size: chunk.len() as u64,
            uncompressed_crc: crc32fast::hash(chunk),
            compression: compression.to_owned(),
            compressed_size: data.len() as u64,
        };
        let mut head = Vec::new();
        put_record(&mut head, op::CHUNK, &header, |_| {});
        // The record goes on behind its head.
        let length = (head.len() - 9 + data.len()) as u64;
        head[1..9].copy_from_slice(&length.to_le_bytes());
        let chunk_start_offset = self.at;
        let data = std::mem::take(&mut self.compressed);
        self.put(&head)?;
        self.put(match &self.compressor {
            Some(_) => &data,
            None => chunk,
        })?;
        self.compressed = data;
        let chunk_length = self.at - chunk_start_offset;
        let (message_index_offsets, message_index_length) = self.put_index()?;
        let index = ChunkIndex {
            message_start_time: start,
            message_end_time: end,
            chunk_start_offset,
            chunk_length,
            message_index_offsets,
            message_index_length,
            compression: header.compression,
            compressed_size: header.compressed_size,
            uncompressed_size: header.uncompressed_size,
        };
        put_record(
            &mut self.groups.chunk_indexes,
            op::CHUNK_INDEX,
            &index,
            |_| {},
        );
        self.statistics.chunk_count += 1;
        self.flush()
    }

    /// Notes what a chunk declares and where its messages are. Gives their earliest and latest time.
    fn index(&mut self, chunk: &[u8]) -> (u64, u64) {
        let mut times = None;
        for record in records(chunk) {
            match record.opcode {
                op::SCHEMA => {
                    self.groups.schemas.extend_from_slice(record.bytes);
                    self.statistics.schema_count += 1;
                }
                op::CHANNEL => {
                    self.groups.channels.extend_from_slice(record.bytes);
                    self.statistics.channel_count += 1;
                }
                _ => {
                    let (id, log_time) = record.channel_and_log_time();
                    let at = usize::from(id);
                    if self.channels.len() <= at {
                        self.channels.resize_with(at + 1, OfChannel::default);
                    }
                    let channel = &mut self.channels[at];
                    if channel.index.is_empty() {
                        self.in_chunk.push(id);
                    }
                    let mut entry = [0; ENTRY_BYTES];
                    entry[..8].copy_from_slice(&log_time.to_le_bytes());
                    entry[8..].copy_from_slice(&record.offset.to_le_bytes());
                    channel.index.extend_from_slice(&entry);
                    times = Some(spanned(times, (log_time, log_time)));
                }
            }
        }
        if let Some(times) = times {
            self.times = Some(spanned(self.times, times));
        }
        times.unwrap_or_default()
    }

    /// Writes the index of the chunk's messages, channel by channel; says where each is, and how
    /// many bytes all of them have.
    fn put_index(&mut self) -> io::Result<(BTreeMap<u16, u64>, u64)> {
        let mut offsets = BTreeMap::new();
        let mut bytes = Vec::new();
        self.in_chunk.sort_unstable();
        for id in self.in_chunk.drain(..) {
            let channel = &mut self.channels[usize::from(id)];
            offsets.insert(id, self.at + bytes.len() as u64);
            bytes.push(op::MESSAGE_INDEX);
            let length = channel.index.len();
            bytes.extend_from_slice(&(length as u64 + 6).to_le_bytes());
            bytes.extend_from_slice(&id.to_le_bytes());
            // Sixteen bytes for each of the messages of a chunk, which have more each.
            bytes.extend_from_slice(&(length as u32).to_le_bytes());
            bytes.append(&mut channel.index);
            channel.messages += (length / ENTRY_BYTES) as u64;
        }
        self.put(&bytes)?;
        Ok((offsets, bytes.len() as u64))
    }

    /// Writes what stands behind the data, gives it to the operating system, and gives back what
    /// was written to.
    pub(super) fn finish(mut self) -> io::Result<W> {
        let data_section_crc = self.sum.clone().finalize();
        let mut end = Vec::new();
        put_record(
            &mut end,
            op::DATA_END,
            &DataEnd { data_section_crc },
            |_| {},
        );
        let summary_start = self.at + end.len() as u64;
        let mut summary = Vec::new();
        let mut offsets = Vec::new();
        let statistics = self.statistics();
        let groups = std::mem::take(&mut self.groups);
        for (group_opcode, group) in [
            (op::SCHEMA, groups.schemas),
            (op::CHANNEL, groups.channels),
            (op::STATISTICS, statistics),
            (op::CHUNK_INDEX, groups.chunk_indexes),
            (op::ATTACHMENT_INDEX, groups.attachment_indexes),
            (op::METADATA_INDEX, groups.metadata_indexes),
        ] {
            if !group.is_empty() {
                let offset = SummaryOffset {
                    group_opcode,
                    group_start: summary_start + summary.len() as u64,
                    group_length: group.len() as u64,
                };
                put_record(&mut offsets, op::SUMMARY_OFFSET, &offset, |_| {});
                summary.extend_from_slice(&group);
            }
        }
        let footer = Footer {
            summary_start,
            summary_offset_start: summary_start + summary.len() as u64,
            summary_crc: 0,
        };
        summary.append(&mut offsets);
        put_record(&mut summary, op::FOOTER, &footer, |_| {});
        // The checksum is of all before itself, the footer's own beginning included.
        summary.truncate(summary.len() - 4);
        let sum = crc32fast::hash(&summary);
        summary.extend_from_slice(&sum.to_le_bytes());
        summary.extend_from_slice(MAGIC);
        self.put(&end)?;
        self.put(&summary)?;
        self.flush()?;
        Ok(self.out)
    }

    /// The record of how much of everything there is.
    fn statistics(&self) -> Vec<u8> {
        let counts = self.channels.iter().enumerate();
        let counts = counts.map(|(id, channel)| (id as u16, channel.messages));
        let channel_message_counts: BTreeMap<u16, u64> =
            counts.filter(|(_, messages)| *messages > 0).collect();
        let (message_start_time, message_end_time) = self.times.unwrap_or_default();
        let statistics = Statistics {
            message_count: channel_message_counts.values().sum(),
            message_start_time,
            message_end_time,
            channel_message_counts,
            ..self.statistics.clone()
        };
        let mut bytes = Vec::new();
        put_record(&mut bytes, op::STATISTICS, &statistics, |_| {});
        bytes
    }
}

/// Compresses chunks as zstd's default level does, with smaller tables: a quarter of
/// the entries, 192 KB in place of 768. Those of the level are no longer in the second cache when
/// the next chunk comes, and the simulation wants some of that too. Chunks become smaller or at most
/// a hundredth larger.
fn compressor() -> io::Result<zstd::bulk::Compressor<'static>> {
    // 0 is the default level. One thread: with more the bytes would depend on how many.
    let mut compressor = zstd::bulk::Compressor::new(0)?;
    compressor.set_parameter(CParameter::HashLog(15))?;
    compressor.set_parameter(CParameter::ChainLog(14))?;
    Ok(compressor)
}

/// The time from the earlier of two starts to the later of two ends.
fn spanned(known: Option<(u64, u64)>, more: (u64, u64)) -> (u64, u64) {
    known.map_or(more, |known| (known.0.min(more.0), known.1.max(more.1)))
}

#[cfg(test)]
mod tests;
