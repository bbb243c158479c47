//! Reads ROS 1 messages by a `ros1msg` schema, both made up: see `read_foreign`.
#![no_main]

use farside_fuzz::{Foreign, read_foreign};
use libfuzzer_sys::fuzz_target;

const KIND: Foreign = Foreign {
    schema_encoding: "ros1msg",
    message_encoding: "ros1",
    type_name: "demo_msgs/Whole",
};

fuzz_target!(|bytes: &[u8]| read_foreign(&KIND, bytes));
