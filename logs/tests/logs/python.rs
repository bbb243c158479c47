//! Others read our logs: Python's MCAP packages decode every record field by field. Skipped, and
//! said so, where they are not installed.

use std::process::Command;

use crate::common::{Plan, logged};

const SCRIPT: &str = r#"
import sys
from mcap.reader import NonSeekingReader, make_reader
from mcap_protobuf.decoder import DecoderFactory
with open(sys.argv[1], "rb") as f:
    reader = make_reader(f, validate_crcs=True, decoder_factories=[DecoderFactory()])
    n, bodies, lost, start = 0, 0, 0, 0
    for schema, channel, message, m in reader.iter_decoded_messages():
        n += 1
        role = channel.metadata["role"]
        if role == "message":
            assert m.sender and m.receiver and m.kind and m.source, m
            assert m.time_ns >= m.sent_ns and m.fate in ("delivered", "lost", "in_flight"), m
            lost += m.fate == "lost"
            if m.fate == "delivered":
                assert m.HasField("cause") and m.cause.time_ns <= m.time_ns
                assert message.publish_time == m.sent_ns and message.log_time == m.time_ns
            if m.kind == "Odometry":
                assert len(m.body.path) == 2 and m.body.distance_m > 0, m
                assert m.HasField("match_key")
                bodies += 1
        elif role == "state":
            assert m.x > 0
        elif role == "checkpoint":
            assert len(m.digest) == 32 and len(m.hashes) > 0
        elif m.fate == "start":
            start += 1
    assert reader.get_summary().statistics.message_count == n
    f.seek(0)
    assert sum(1 for _ in NonSeekingReader(f, validate_crcs=True).iter_messages()) == n
    names = [md.name for md in reader.iter_metadata()]
    assert names == ["farside", "farside.run", "farside.host", "farside.end"], names
    assert [a.name for a in reader.iter_attachments()] == ["scenario.toml", "map.txt"]
    print(n, bodies, lost, start)
"#;

#[test]
fn python_reads_every_field() {
    let packages = Command::new("python3")
        .args(["-c", "import mcap, mcap_protobuf"])
        .output();
    if !packages.is_ok_and(|output| output.status.success()) {
        println!("skipped: python3 with mcap and mcap-protobuf-support is not installed");
        return;
    }
    let (_folder, path, report) = logged(&Plan::default());
    let output = Command::new("python3")
        .args(["-c", SCRIPT])
        .arg(&path)
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    let numbers = String::from_utf8_lossy(&output.stdout);
    let numbers: Vec<u64> = numbers
        .split_whitespace()
        .map(|n| n.parse().unwrap())
        .collect();
    assert_eq!((numbers[2], numbers[3]), (report.counts.lost, 5));
    assert!(numbers[1] > 10);
}
