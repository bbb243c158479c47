//! What is read of FlatBuffers that other programs wrote, and that no byte of them brings down the reader.

use proptest::prelude::*;

use super::*;

/// `scan.fbs` and a message of it, as flatc and its Python library write them: see `tests/foreign`.
const SCHEMA: &[u8] = include_bytes!("../../../tests/foreign/scan.bfbs");
const MESSAGE: &[u8] = include_bytes!("../../../tests/foreign/scan.bin");

fn shown(schema: &[u8], message: &[u8]) -> String {
    let schema = match FlatSchema::read(schema, "demo.Scan") {
        Ok(schema) => schema,
        Err(error) => return error.to_string(),
    };
    match schema.value(message) {
        Ok(value) => value.to_string(),
        Err(error) => error.to_string(),
    }
}

#[test]
fn tables_structs_vectors_and_unions_are_read() {
    let expected = include_str!("../../../tests/foreign/scan.json");
    assert_eq!(shown(SCHEMA, MESSAGE), expected.trim());
}

#[test]
fn cut_messages_and_schemas_are_told() {
    for length in 0..MESSAGE.len() {
        assert!(!shown(SCHEMA, &MESSAGE[..length]).is_empty());
    }
    for length in 0..SCHEMA.len() {
        assert!(!shown(&SCHEMA[..length], MESSAGE).is_empty());
    }
    assert!(shown(&[], MESSAGE).contains("no FlatBuffers reflection"));
}

proptest! {
    #[test]
    fn flipped_bytes_are_a_value_or_an_error(
        flips in prop::collection::vec((any::<bool>(), any::<prop::sample::Index>(), any::<u8>()), 1..4)
    ) {
        let (mut schema, mut message) = (SCHEMA.to_vec(), MESSAGE.to_vec());
        for (in_schema, at, value) in flips {
            let bytes = if in_schema { &mut schema } else { &mut message };
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        prop_assert!(!shown(&schema, &message).is_empty());
    }
}
