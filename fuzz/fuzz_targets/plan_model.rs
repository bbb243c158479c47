//! Reads any text as a model of a planner. Whatever it is, there are findings or a model; and a
//! normal form is its own.
#![no_main]

use farside_planning::language::{MOST_FINDINGS, Options, Severity, format, read_model};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let text = String::from_utf8_lossy(bytes);
    // The first letter says how strict the reading is.
    let options = Options { strict: bytes.first() == Some(&b'!'), ..Options::default() };
    let read = read_model("model.ddl", &text, &options);
    let is_error = read.findings.iter().any(|finding| finding.severity == Severity::Error);
    assert_eq!(read.value.is_none(), is_error);
    assert!(read.findings.len() <= MOST_FINDINGS);
    for finding in &read.findings {
        assert!(finding.position.line > 0 && finding.position.column > 0, "{finding}");
    }
    if let Some(model) = read.value {
        assert_eq!(model.timelines.len(), model.rules_by_timeline.len());
    }
    if let Ok(once) = format(&text) {
        assert_eq!(format(&once).expect("it is well formed"), once);
    }
});
