//! Compares two logs of some other program: one channel, whose schema and messages are the input.
//! Whatever they are, there is an error or a report: descriptors and bodies are read without trust.
#![no_main]

use std::collections::BTreeMap;
use std::path::Path;

use farside_logs::{DiffOptions, diff, info};
use libfuzzer_sys::fuzz_target;

fn write(path: &Path, name: &str, schema: &[u8], body: &[u8]) {
    let file = std::fs::File::create(path).expect("a file");
    let options = mcap::WriteOptions::new().compression(None);
    let mut writer = options.create(file).expect("a writer");
    let schema = writer.add_schema(name, "protobuf", schema).expect("a schema");
    let channel = writer.add_channel(schema, "/x", "protobuf", &BTreeMap::new());
    let header = mcap::records::MessageHeader {
        channel_id: channel.expect("a channel"),
        sequence: 0,
        log_time: 1,
        publish_time: 1,
    };
    writer.write_to_known_channel(&header, body).expect("a message");
    writer.finish().expect("an end");
}

// The first three bytes say how long the schema and the first message are, the rest is the second.
fuzz_target!(|bytes: &[u8]| {
    let Some(([low, high, length], rest)) = bytes.split_first_chunk() else {
        return;
    };
    let schema = usize::from(u16::from_le_bytes([*low, *high]));
    let (schema, bodies) = rest.split_at(schema.min(rest.len()));
    let (first, second) = bodies.split_at(usize::from(*length).min(bodies.len()));
    let folder = tempfile::tempdir().expect("a folder");
    let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
    write(&a, "test.M", schema, first);
    write(&b, "test.M", schema, second);
    assert!(!info(&a).expect("a whole file").to_string().is_empty());
    match diff(&a, &b, &DiffOptions::default()) {
        Ok(report) => assert!(!report.to_string().is_empty()),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
