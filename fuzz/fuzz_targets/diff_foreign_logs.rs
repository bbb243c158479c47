//! Compares two logs of some other program: one channel, whose schema and messages are the input.
//! Whatever they are, there is an error or a report: descriptors and bodies are read without trust.
#![no_main]

use farside_fuzz::{Foreign, write_foreign};
use farside_logs::{DiffOptions, diff, info};
use libfuzzer_sys::fuzz_target;

const KIND: Foreign = Foreign {
    schema_encoding: "protobuf",
    message_encoding: "protobuf",
    type_name: "test.M",
};

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
    write_foreign(&a, &KIND, schema, first);
    write_foreign(&b, &KIND, schema, second);
    assert!(!info(&a).expect("a whole file").to_string().is_empty());
    match diff(&a, &b, &DiffOptions::default()) {
        Ok(report) => assert!(!report.to_string().is_empty()),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
