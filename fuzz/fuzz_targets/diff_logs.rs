//! Compares two different logs, which are real but for the edits that the input makes in the
//! messages of either. Whatever they are, there is an error or a report that is the same both ways;
//! and logs without edits are the same.
#![no_main]

use farside_fuzz::write_edited;
use farside_logs::{DiffOptions, diff};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let folder = tempfile::tempdir().expect("a folder");
    let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
    write_edited(bytes, [&a, &b]);
    let there = diff(&a, &b, &DiffOptions::default());
    let back = diff(&b, &a, &DiffOptions::default());
    match (&there, &back) {
        (Ok(there), Ok(back)) => {
            assert_eq!(there.identical, back.identical);
            assert_eq!(there.identical, there.first.is_none());
            assert!(!there.to_string().is_empty());
        }
        (Err(there), Err(_)) => assert!(!there.to_string().is_empty()),
        _ => panic!("{there:?} one way, {back:?} the other"),
    }
    if bytes.len() < 7 {
        assert!(there.is_ok_and(|report| report.identical));
    }
    let tolerant = DiffOptions {
        tolerance: 1e-3,
        ignore: vec!["/state/**".to_owned()],
        ..DiffOptions::default()
    };
    let _ = diff(&a, &b, &tolerant);
    // And as somebody else's files, by topic: the same messages without what Farside's logs begin
    // with.
    let [a, b] = [&a, &b].map(|path| {
        let foreign = path.with_extension("foreign");
        std::fs::write(&foreign, without_metadata(path)).expect("a file");
        foreign
    });
    if let Ok(report) = diff(&a, &b, &tolerant) {
        assert!(!report.to_string().is_empty());
    }
});

/// The log without its metadata, which says whose it is.
fn without_metadata(path: &std::path::Path) -> Vec<u8> {
    let bytes = std::fs::read(path).expect("it was written");
    let mut out = bytes[..8].to_vec();
    let mut rest = &bytes[8..];
    while let Some((head, behind)) = rest.split_first_chunk::<9>() {
        let length = u64::from_le_bytes(head[1..].try_into().expect("eight bytes")) as usize;
        let Some((content, behind)) = behind.split_at_checked(length) else {
            break;
        };
        if head[0] != mcap::records::op::METADATA {
            out.extend_from_slice(head);
            out.extend_from_slice(content);
        }
        rest = behind;
    }
    out.extend_from_slice(rest);
    out
}
