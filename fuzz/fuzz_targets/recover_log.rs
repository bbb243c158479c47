//! Breaks a real log: the input overwrites, cuts out and puts in bytes. What is recovered is a
//! whole file, and every message in it is one that the log had, or the report says that some are
//! doubtful or lost.
#![no_main]

use std::collections::BTreeSet;
use std::sync::OnceLock;

use farside_fuzz::{broken, each_record, log};
use farside_logs::{info, recover};
use libfuzzer_sys::fuzz_target;
use mcap::records::Record;

static MESSAGES: OnceLock<BTreeSet<(u64, Vec<u8>)>> = OnceLock::new();

fn messages(bytes: &[u8]) -> BTreeSet<(u64, Vec<u8>)> {
    let mut messages = BTreeSet::new();
    each_record(bytes, |record| {
        if let Record::Message { header, data } = record {
            messages.insert((header.log_time, data.into_owned()));
        }
    });
    messages
}

fuzz_target!(|bytes: &[u8]| {
    let broken = broken(bytes);
    let folder = tempfile::tempdir().expect("a folder");
    let (path, out) = (folder.path().join("in"), folder.path().join("out"));
    std::fs::write(&path, &broken).expect("a file");
    let report = recover(&path, &out).expect("it starts like a log");
    assert!(!report.to_string().is_empty());
    let saved = std::fs::read(&out).expect("a file");
    let known = MESSAGES.get_or_init(|| messages(log()));
    // Only what is named as unchecked may be something that nobody wrote, and what no checksum
    // covers: messages that the input itself spells out between the chunks.
    let strangers = messages(&saved).difference(known).count() as u64;
    assert!(strangers == 0 || !report.is_lossless(), "messages that nobody wrote: {report}");
    if report.is_lossless() {
        assert!(messages(&saved) == *known, "called lossless: {report}");
    }
    if broken == log() {
        assert!(report.is_lossless(), "{report}");
    }
    let _ = info(&out);
});
