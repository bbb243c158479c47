//! Reads any bytes as a log in every way there is: information, records, comparison, recovery.
//! Whatever the bytes, there is an error or a result, and what is recovered is a whole file.
#![no_main]

use farside_logs::{DiffOptions, Log, LogError, diff, info, recover};
use libfuzzer_sys::fuzz_target;

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
    if let Ok(report) = diff(&path, &path, &DiffOptions::default()) {
        let _ = report.to_string();
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
