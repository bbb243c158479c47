//! Reads CDR by a `ros2msg` schema, both made up: see `read_foreign`.
#![no_main]

use farside_fuzz::{Foreign, read_foreign};
use libfuzzer_sys::fuzz_target;

const KIND: Foreign = Foreign {
    schema_encoding: "ros2msg",
    message_encoding: "cdr",
    type_name: "demo_msgs/msg/Root",
};

fuzz_target!(|bytes: &[u8]| read_foreign(&KIND, bytes));
