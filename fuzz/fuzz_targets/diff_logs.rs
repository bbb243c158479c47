//! Compares two logs that are real but for the edits that the input makes in the messages of
//! either. Whatever they are, there is an error or a report that is the same both ways; and logs
//! without edits are the same.
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
    let tolerant = DiffOptions { tolerance: 1e-3, ignore: vec!["/state/**".to_owned()] };
    let _ = diff(&a, &b, &tolerant);
});
