//! Reads any bytes as a log in every way there is: information, records, comparison, recovery.
//! Whatever the bytes, there is an error or a result, and what is recovered is a whole file.
#![no_main]

use farside_logs::{DiffOptions, Log, LogError, diff, info, recover};
use libfuzzer_sys::fuzz_target;

/// The bytes with every seventh one from the middle on changed a little, as far as they are letters
/// or digits: what frames the records mostly stays.
fn changed(bytes: &[u8]) -> Vec<u8> {
    let middle = bytes.len() / 2;
    let change = |(at, byte): (usize, &u8)| match byte {
        b'0'..=b'8' | b'a'..=b'y' if at >= middle && at % 7 == 0 => byte + 1,
        byte => *byte,
    };
    bytes.iter().enumerate().map(change).collect()
}

fuzz_target!(|bytes: &[u8]| {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, out) = (folder.path().join("in"), folder.path().join("out"));
    std::fs::write(&path, bytes).expect("a file");
    if let Ok(info) = info(&path) {
        let _ = info.to_string();
    }
    if let Ok(records) = Log::open(&path).and_then(|log| log.records()) {
        let _ = records.take_while(Result::is_ok).count();
    }
    // Two files: of one and the same, no message would be read field by field.
    let other = folder.path().join("other");
    std::fs::write(&other, changed(bytes)).expect("a file");
    let tolerant = DiffOptions { tolerance: 1e-9, ..DiffOptions::default() };
    for (b, options) in [(&path, DiffOptions::default()), (&other, tolerant)] {
        if let Ok(report) = diff(&path, b, &options) {
            assert!(!report.to_string().is_empty());
            assert!(b == &other || report.first.is_none(), "a file differs from itself");
        }
    }
    if let Ok(report) = recover(&path, &out) {
        match info(&out) {
            Ok(saved) => assert_eq!(saved.messages, report.messages),
            // What the log says of itself is kept, also where it makes no sense.
            Err(LogError::Format { .. } | LogError::NotFarside { .. }) => {}
            Err(error) => panic!("what is recovered can be read: {error}"),
        }
    }
});
