//! What the fuzz targets share: a small real log, and ways in which bytes change it.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::OnceLock;

use farside::Executor;
use farside_experiments::registry::Registry;
use farside_experiments::scenario::{Assembled, Scenario};
use farside_logs::{AnyMessages, LogOptions, LogWriter};
use mcap::records::{Metadata, Record};
use mcap::sans_io::{LinearReadEvent, LinearReader};

/// The scenario that the log is of, and its run.
pub fn assembled() -> (Scenario, Assembled) {
    let sets = [
        "until=1200ms",
        "links.default.loss=0.2",
        "crash=[{ actor = 'rover_2', at = '500ms', restart = '900ms' }]",
    ];
    let sets = sets.map(str::to_owned);
    let scenario = Scenario::open("traffic/open-loop", &sets, &Registry::builtin());
    let scenario = scenario.expect("the scenario is one");
    let assembled = scenario.assemble().expect("it can be built");
    (scenario, assembled)
}

/// A log of a second of traffic, with losses, timers and a crash.
pub fn log() -> &'static [u8] {
    static LOG: OnceLock<Vec<u8>> = OnceLock::new();
    LOG.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.mcap");
        let (scenario, mut assembled) = assembled();
        let options = LogOptions {
            scenario: scenario.name().to_owned(),
            resolved: scenario.resolved().expect("it can be written"),
            ..LogOptions::default()
        };
        assembled
            .sim
            .observe(LogWriter::create(&path, options).expect("a log"));
        assembled.sim.run(Executor::Inline).expect("a run");
        std::fs::read(&path).expect("the log is there")
    })
}

/// The log with bytes overwritten, cut out and put in, by five bytes of a target's input each.
pub fn broken(input: &[u8]) -> Vec<u8> {
    let mut broken = log().to_vec();
    for edit in input.chunks_exact(5).take(32) {
        let place = usize::from(u16::from_le_bytes([edit[1], edit[2]]));
        // The magic bytes stay, or nothing is read at all.
        let place = 8 + place % (broken.len() - 8).max(1);
        let end = (place + usize::from(edit[3])).min(broken.len());
        match edit[0] % 4 {
            0 if place < broken.len() => broken[place] = edit[4],
            1 => drop(broken.drain(place.min(end)..end)),
            2 => broken
                .splice(place..place, (0..edit[3]).map(|_| edit[4]))
                .for_each(drop),
            3 if edit[4] == 0 => broken.truncate(place),
            _ => {}
        }
    }
    broken
}

/// One change of a message of the log, by seven bytes of a target's input.
struct Edit {
    message: usize,
    what: u8,
    place: usize,
    value: u8,
}

/// Writes the log to two files, each message as it is but for the edits that `input` makes in one
/// file or the other. Chunks and checksums are in order: what is read is what was changed.
pub fn write_edited(input: &[u8], paths: [&Path; 2]) {
    let mut edits: [Vec<Edit>; 2] = [Vec::new(), Vec::new()];
    for bytes in input.chunks_exact(7).take(64) {
        edits[usize::from(bytes[0] & 1)].push(Edit {
            what: bytes[0] >> 1,
            message: usize::from(u16::from_le_bytes([bytes[1], bytes[2]])),
            place: usize::from(u16::from_le_bytes([bytes[3], bytes[4]])),
            value: bytes[5],
        });
    }
    for (path, edits) in paths.into_iter().zip(edits) {
        std::fs::write(path, rewritten(&edits)).expect("a file");
    }
}

/// The log, record by record, with edits.
fn rewritten(edits: &[Edit]) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let options = mcap::WriteOptions::new()
        .compression(None)
        .profile("farside");
    let mut writer = options.create(&mut out).expect("a writer");
    let (mut schemas, mut channels) = (BTreeMap::new(), BTreeMap::new());
    let mut number = 0;
    each_record(log(), |record| match record {
        Record::Schema { header, data } => {
            let id = writer.add_schema(&header.name, &header.encoding, &data);
            schemas.insert(header.id, id.expect("a schema"));
        }
        Record::Channel(channel) => {
            let schema = schemas.get(&channel.schema_id).copied().unwrap_or(0);
            let encoding = &channel.message_encoding;
            let id = writer.add_channel(schema, &channel.topic, encoding, &channel.metadata);
            channels.insert(channel.id, id.expect("a channel"));
        }
        Record::Message { mut header, data } => {
            header.channel_id = channels[&header.channel_id];
            let mut data = data.into_owned();
            let mut times = 1;
            for edit in edits.iter().filter(|edit| edit.message == number) {
                times = edited(edit, &mut data, &mut header.log_time, times);
            }
            for _ in 0..times {
                writer
                    .write_to_known_channel(&header, &data)
                    .expect("a message");
            }
            number += 1;
        }
        Record::Attachment { header, data, .. } => {
            let attachment = mcap::Attachment {
                log_time: header.log_time,
                create_time: header.create_time,
                name: header.name,
                media_type: header.media_type,
                data,
            };
            writer.attach(&attachment).expect("an attachment");
        }
        Record::Metadata(Metadata { name, metadata }) => {
            writer
                .write_metadata(&Metadata { name, metadata })
                .expect("metadata");
        }
        _ => {}
    });
    writer.finish().expect("an end");
    drop(writer);
    out.into_inner()
}

/// Changes a message; how often it is to be written.
fn edited(edit: &Edit, data: &mut Vec<u8>, log_time: &mut u64, times: usize) -> usize {
    let place = edit.place.min(data.len().saturating_sub(1));
    match edit.what % 6 {
        0 if !data.is_empty() => data[place] = edit.value,
        1 => data.truncate(place),
        2 => data.insert(place, edit.value),
        3 => *log_time = log_time.saturating_add(u64::from(edit.value) << (edit.place % 56)),
        4 => return 0,
        5 => return times * 2,
        _ => {}
    }
    times
}

/// Calls `each` with the records of a whole log in front of its summary, chunks opened.
pub fn each_record(bytes: &[u8], mut each: impl FnMut(Record<'_>)) {
    let mut reader = LinearReader::new();
    reader.insert(bytes.len()).copy_from_slice(bytes);
    reader.notify_read(bytes.len());
    while let Some(event) = reader.next_event() {
        let LinearReadEvent::Record { opcode, data } = event.expect("the log is whole") else {
            panic!("the log is whole");
        };
        if opcode == mcap::records::op::DATA_END {
            return;
        }
        each(mcap::parse_record(opcode, data).expect("the log is in order"));
    }
}

/// How messages of another program are written.
pub struct Foreign {
    pub schema_encoding: &'static str,
    pub message_encoding: &'static str,
    /// What the schema calls the type of the message.
    pub type_name: &'static str,
}

/// Writes a log of another program with one message.
pub fn write_foreign(path: &Path, kind: &Foreign, schema: &[u8], body: &[u8]) {
    let file = std::fs::File::create(path).expect("a file");
    let options = mcap::WriteOptions::new().compression(None);
    let mut writer = options.create(file).expect("a writer");
    let schema = writer.add_schema(kind.type_name, kind.schema_encoding, schema);
    let channel = writer.add_channel(
        schema.expect("a schema"),
        "/x",
        kind.message_encoding,
        &BTreeMap::new(),
    );
    let header = mcap::records::MessageHeader {
        channel_id: channel.expect("a channel"),
        sequence: 0,
        log_time: 1,
        publish_time: 1,
    };
    writer
        .write_to_known_channel(&header, body)
        .expect("a message");
    writer.finish().expect("an end");
}

/// Reads a message of another program: the first two bytes say how long the schema is, the message is what comes
/// behind it. Whatever they are, there is a value or an error, and the same one again.
pub fn read_foreign(kind: &Foreign, bytes: &[u8]) {
    let Some((length, rest)) = bytes.split_first_chunk() else {
        return;
    };
    let length = usize::from(u16::from_le_bytes(*length));
    let (schema, body) = rest.split_at(length.min(rest.len()));
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a");
    write_foreign(&path, kind, schema, body);
    let mut messages = AnyMessages::open(&path, &[]).expect("a whole file");
    let message = messages.next().expect("a whole file").expect("a message");
    let told = || match message.value() {
        Ok(value) => {
            value.flatten(&mut |_, part| assert!(!part.to_string().is_empty()));
            value.to_string()
        }
        Err(error) => error.to_string(),
    };
    let first = told();
    assert!(!first.is_empty());
    assert_eq!(first, told());
}
