//! What is written here, read back by the `mcap` crate with every checksum that it checks.

use std::collections::BTreeMap;

use mcap::records::{AttachmentHeader, MessageHeader, Record};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use proptest::prelude::*;

use super::McapFile;
use crate::descriptors::SchemaOf;
use crate::writer::Compression;
use crate::writer::chunk::Chunk;

/// A message: which channel, its numbers, its data.
#[derive(Clone, Debug)]
struct Message {
    header: MessageHeader,
    data: Vec<u8>,
}

/// What is written: chunks, and metadata and attachments before them.
#[derive(Clone, Debug)]
struct Plan {
    compressed: bool,
    texts: Vec<(String, String)>,
    chunks: Vec<Vec<Message>>,
}

fn message() -> impl Strategy<Value = Message> {
    let data = prop_oneof![
        prop::collection::vec(any::<u8>(), 0..40),
        (any::<u8>(), 0usize..3000).prop_map(|(byte, length)| vec![byte; length]),
    ];
    let channel = prop_oneof![0u16..4, Just(700)];
    (channel, any::<u32>(), any::<u64>(), any::<u64>(), data).prop_map(
        |(channel_id, sequence, log_time, publish_time, data)| Message {
            header: MessageHeader {
                channel_id,
                sequence,
                log_time,
                publish_time,
            },
            data,
        },
    )
}

fn plan() -> impl Strategy<Value = Plan> {
    let chunks = prop::collection::vec(prop::collection::vec(message(), 0..30), 0..6);
    let texts = prop::collection::vec(("[a-z.é]{0,12}", ".{0,40}"), 0..3);
    (any::<bool>(), texts, chunks).prop_map(|(compressed, texts, chunks)| Plan {
        compressed,
        texts,
        chunks,
    })
}

const TOPICS: [(u16, &str); 5] = [(0, "/a"), (1, "/b/é"), (2, ""), (3, "/d"), (700, "/far")];

fn role() -> BTreeMap<String, String> {
    [("role".to_owned(), "message".to_owned())].into()
}

fn attachment(name: &str) -> AttachmentHeader {
    AttachmentHeader {
        log_time: 5,
        create_time: 6,
        name: name.to_owned(),
        media_type: "text/plain".to_owned(),
    }
}

fn write(plan: &Plan) -> Vec<u8> {
    let compression = match plan.compressed {
        true => Compression::Zstd,
        false => Compression::None,
    };
    let mut file = McapFile::create(Vec::new(), compression, "farside test".to_owned()).unwrap();
    for (name, text) in &plan.texts {
        let metadata = [(name.clone(), text.clone())].into();
        file.metadata(name, metadata).unwrap();
        file.attachment(attachment(name), text.as_bytes()).unwrap();
    }
    let mut chunk = Chunk::default();
    let (name, data) = ("test.Any".to_owned(), vec![1, 2, 3]);
    chunk.schema(1, SchemaOf { name, data });
    for (id, topic) in TOPICS {
        chunk.channel(id, 1, topic, role());
    }
    for messages in &plan.chunks {
        for message in messages {
            chunk.message(message.header, |out| out.extend_from_slice(&message.data));
        }
        file.chunk(chunk.bytes()).unwrap();
        chunk.clear();
    }
    if !chunk.is_empty() {
        file.chunk(chunk.bytes()).unwrap();
    }
    file.finish().unwrap()
}

/// The same, written by the `mcap` crate.
fn write_like_mcap(plan: &Plan) -> Vec<u8> {
    let mut writer = mcap::WriteOptions::new()
        .compression(plan.compressed.then_some(mcap::Compression::Zstd))
        .compression_threads(0)
        .chunk_size(None)
        .create(std::io::Cursor::new(Vec::new()))
        .unwrap();
    for (name, text) in &plan.texts {
        let metadata = [(name.clone(), text.clone())].into();
        let name = name.clone();
        let record = mcap::records::Metadata { name, metadata };
        writer.write_metadata(&record).unwrap();
        let head = attachment(&record.name);
        let attached = mcap::Attachment {
            log_time: head.log_time,
            create_time: head.create_time,
            name: head.name,
            media_type: head.media_type,
            data: text.as_bytes().into(),
        };
        writer.attach(&attached).unwrap();
    }
    let schema = writer
        .add_schema("test.Any", "protobuf", &[1, 2, 3])
        .unwrap();
    for (id, topic) in TOPICS {
        let added = writer.add_channel_with_id(id, schema, topic, "protobuf", &role());
        added.unwrap();
    }
    for messages in &plan.chunks {
        for message in messages {
            let written = writer.write_to_known_channel(&message.header, &message.data);
            written.unwrap();
        }
        writer.flush().unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// All messages of a file, every checksum checked.
fn read(file: &[u8]) -> Vec<(MessageHeader, Vec<u8>)> {
    let options = LinearReaderOptions::default()
        .with_check_finishes_after_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true);
    let mut reader = LinearReader::new_with_options(options);
    let (mut rest, mut messages) = (file, Vec::new());
    while let Some(event) = reader.next_event() {
        match event.unwrap() {
            LinearReadEvent::ReadRequest(wanted) => {
                let (given, after) = rest.split_at(wanted.min(rest.len()));
                reader.insert(given.len()).copy_from_slice(given);
                reader.notify_read(given.len());
                rest = after;
            }
            LinearReadEvent::Record { data, opcode } => {
                if let Record::Message { header, data } = mcap::parse_record(opcode, data).unwrap()
                {
                    messages.push((header, data.into_owned()));
                }
            }
        }
    }
    messages
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, ..ProptestConfig::default() })]

    /// Everything is read back as it was written, by way of the summary too, and the summary says
    /// of it what the `mcap` crate says when it writes the same.
    #[test]
    fn mcap_reads_what_was_written(plan in plan()) {
        let file = write(&plan);
        let written: Vec<_> = plan.chunks.iter().flatten().map(|m| (m.header, m.data.clone())).collect();
        prop_assert_eq!(&read(&file), &written);

        let summary = mcap::Summary::read(&file).unwrap().unwrap();
        let like = write_like_mcap(&plan);
        let like = mcap::Summary::read(&like).unwrap().unwrap();
        prop_assert_eq!(&summary.schemas, &like.schemas);
        prop_assert_eq!(&summary.channels, &like.channels);
        let (statistics, mut expected) = (summary.stats.unwrap(), like.stats.unwrap());
        // Without messages the two may have other chunks: of declarations, or of nothing.
        expected.chunk_count = summary.chunk_indexes.len() as u32;
        prop_assert_eq!(statistics, expected);
        for (index, (name, text)) in summary.attachment_indexes.iter().zip(&plan.texts) {
            let attached = mcap::read::attachment(&file, index).unwrap();
            prop_assert_eq!((&attached.name, &*attached.data), (name, text.as_bytes()));
            prop_assert_eq!((attached.log_time, attached.create_time), (5, 6));
        }
        for (index, (name, text)) in summary.metadata_indexes.iter().zip(&plan.texts) {
            let metadata = mcap::read::metadata(&file, index).unwrap();
            prop_assert_eq!((&metadata.name, metadata.metadata.get(name)), (name, Some(text)));
        }
        let footer = mcap::read::footer(&file).unwrap();
        let mut next = footer.summary_start;
        let offsets = &file[footer.summary_offset_start as usize..];
        for record in mcap::read::LinearReader::sans_magic(offsets) {
            if let Record::SummaryOffset(group) = record.unwrap() {
                prop_assert_eq!(group.group_start, next);
                prop_assert_eq!(file[next as usize], group.group_opcode);
                next += group.group_length;
            }
        }
        prop_assert_eq!(next, footer.summary_offset_start);
        prop_assert_eq!(summary.attachment_indexes.len(), plan.texts.len());
        prop_assert_eq!(summary.metadata_indexes.len(), plan.texts.len());
    }

    /// Every message is found by the index of its chunk, and the indexes have no other.
    #[test]
    fn mcap_finds_every_message_by_its_index(plan in plan()) {
        let file = write(&plan);
        let summary = mcap::Summary::read(&file).unwrap().unwrap();
        let mut found = Vec::new();
        // The crate refuses to read the index of a chunk that has no messages.
        for chunk in summary.chunk_indexes.iter().filter(|chunk| chunk.message_index_length > 0) {
            let times = chunk.message_start_time..=chunk.message_end_time;
            let indexes = summary.read_message_indexes(&file, chunk).unwrap();
            for (channel, entries) in Vec::from_iter(indexes) {
                for entry in entries {
                    let message = summary.seek_message(&file, chunk, &entry).unwrap();
                    prop_assert_eq!(message.channel.id, channel.id);
                    prop_assert_eq!(message.log_time, entry.log_time);
                    prop_assert!(times.contains(&message.log_time));
                    let numbers = (channel.id, message.sequence, message.log_time, message.publish_time);
                    found.push((numbers, message.data.into_owned()));
                }
            }
        }
        let numbers = |h: &MessageHeader| (h.channel_id, h.sequence, h.log_time, h.publish_time);
        let written = plan.chunks.iter().flatten();
        let mut written: Vec<_> = written.map(|m| (numbers(&m.header), m.data.clone())).collect();
        found.sort();
        written.sort();
        prop_assert_eq!(found, written);
    }

    /// However the buffers of chunks lie in memory, the same chunks are the same bytes.
    #[test]
    fn the_same_chunks_are_the_same_bytes(plan in plan()) {
        let first = write(&plan);
        let _moved = vec![0u8; 12_345];
        prop_assert_eq!(first, write(&plan));
    }
}
