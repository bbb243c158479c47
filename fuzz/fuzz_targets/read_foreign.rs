//! Reads messages of other programs: the first byte says how schema and message are encoded, the next two how
//! long the schema is. Whatever they are, there is a value or an error.
#![no_main]

use std::collections::BTreeMap;

use farside_logs::AnyMessages;
use libfuzzer_sys::fuzz_target;

const ENCODINGS: [(&str, &str); 6] = [
    ("ros2msg", "cdr"),
    ("ros2idl", "cdr"),
    ("ros1msg", "ros1"),
    ("flatbuffer", "flatbuffer"),
    ("jsonschema", "json"),
    ("protobuf", "protobuf"),
];

fuzz_target!(|bytes: &[u8]| {
    let Some(([which, low, high], rest)) = bytes.split_first_chunk() else {
        return;
    };
    let (written, encoding) = ENCODINGS[usize::from(*which) % ENCODINGS.len()];
    let schema = usize::from(u16::from_le_bytes([*low, *high]));
    let (schema, body) = rest.split_at(schema.min(rest.len()));
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a");
    let file = std::fs::File::create(&path).expect("a file");
    let mut writer = mcap::WriteOptions::new().compression(None).create(file).expect("a writer");
    let schema = writer.add_schema("demo/R", written, schema).expect("a schema");
    let channel = writer.add_channel(schema, "/x", encoding, &BTreeMap::new());
    let header = mcap::records::MessageHeader {
        channel_id: channel.expect("a channel"),
        sequence: 0,
        log_time: 1,
        publish_time: 1,
    };
    writer.write_to_known_channel(&header, body).expect("a message");
    writer.finish().expect("an end");
    let mut messages = AnyMessages::open(&path, &[]).expect("a whole file");
    let message = messages.next().expect("a whole file").expect("a message");
    match message.value() {
        Ok(value) => {
            assert!(!value.to_string().is_empty());
            value.flatten(&mut |_, part| assert!(!part.to_string().is_empty()));
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
