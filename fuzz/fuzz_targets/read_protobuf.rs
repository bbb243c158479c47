//! Reads protobuf by a descriptor set, both made up: see `read_foreign`.
#![no_main]

use farside_fuzz::{Foreign, read_foreign};
use libfuzzer_sys::fuzz_target;

const KIND: Foreign = Foreign {
    schema_encoding: "protobuf",
    message_encoding: "protobuf",
    type_name: "demo.Held",
};

fuzz_target!(|bytes: &[u8]| read_foreign(&KIND, bytes));
