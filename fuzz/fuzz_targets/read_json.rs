//! Reads JSON, both made up: see `read_foreign`.
#![no_main]

use farside_fuzz::{Foreign, read_foreign};
use libfuzzer_sys::fuzz_target;

const KIND: Foreign = Foreign {
    schema_encoding: "jsonschema",
    message_encoding: "json",
    type_name: "demo",
};

fuzz_target!(|bytes: &[u8]| read_foreign(&KIND, bytes));
