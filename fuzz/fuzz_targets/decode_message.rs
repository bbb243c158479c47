//! Decodes any bytes as a message. Whatever the bytes, there is an error or a value, and a value
//! encodes to bytes that decode again.
#![no_main]

use std::collections::BTreeMap;
use std::sync::OnceLock;

use farside::encoding::Schema;
use libfuzzer_sys::fuzz_target;
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
enum Shape {
    Nothing,
    Point(f64, f32),
    Tree {
        left: Option<Box<Message>>,
        right: Vec<Message>,
    },
}

#[derive(Serialize, Deserialize)]
struct Message {
    count: u32,
    offset: i64,
    note: Option<Option<String>>,
    flags: Vec<bool>,
    rows: Vec<Vec<u16>>,
    names: BTreeMap<String, Vec<i8>>,
    shape: Shape,
}

static SCHEMA: OnceLock<Schema> = OnceLock::new();

fuzz_target!(|bytes: &[u8]| {
    let schema = SCHEMA.get_or_init(|| Schema::of::<Message>().expect("a type that can be traced"));
    if let Ok(message) = schema.decode::<Message>(bytes) {
        let (mut once, mut twice) = (Vec::new(), Vec::new());
        schema
            .encode(&message, &mut once)
            .expect("what was decoded can be encoded");
        let again: Message = schema
            .decode(&once)
            .expect("what was encoded can be decoded");
        schema.encode(&again, &mut twice).expect("and again");
        assert_eq!(once, twice);
    }
});
