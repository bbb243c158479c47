//! What is saved of cut and damaged logs.

use std::fs;

use farside_logs::{DiffOptions, diff, info, recover};

use crate::common::{Plan, logged};

fn long() -> Plan {
    Plan {
        rovers: 8,
        cycles: 1500,
        ..Plan::default()
    }
}

#[test]
fn a_whole_log_is_saved_whole() {
    let (folder, path, _) = logged(&Plan::default());
    let out = folder.path().join("out.mcap");
    let report = recover(&path, &out).unwrap();
    assert_eq!(
        (report.bytes_lost, report.losses, report.attachments),
        (0, 0, 2),
        "{report}"
    );
    assert!(
        diff(&path, &out, &DiffOptions::default())
            .unwrap()
            .identical
    );
    let (before, after) = (info(&path).unwrap(), info(&out).unwrap());
    assert_eq!((&before.run, &before.topics), (&after.run, &after.topics));
    assert_eq!(after.missing, Vec::<String>::new());
}

#[test]
fn a_cut_log_is_saved_into_its_last_chunk() {
    let (folder, path, _) = logged(&long());
    let whole = fs::read(&path).unwrap();
    let out = folder.path().join("out.mcap");
    let (mut saved, mut unchecked) = (Vec::new(), 0);
    for tenths in [2, 5, 7, 9] {
        fs::write(&path, &whole[..whole.len() * tenths / 10]).unwrap();
        let before = info(&path).unwrap();
        assert_eq!(before.missing.len(), 1, "{before}");
        let report = recover(&path, &out).unwrap();
        // Also those of the chunk that is cut, as far as it unpacks.
        assert_eq!(report.messages - before.messages, report.unchecked);
        unchecked += report.unchecked;
        let after = info(&out).unwrap();
        assert_eq!(after.messages, report.messages);
        assert_eq!(
            after.missing,
            ["no farside.end: the run did not end in this log"]
        );
        saved.push(report.messages);
    }
    assert!(unchecked > 0);
    assert!(
        saved.windows(2).all(|two| two[0] <= two[1]) && saved[3] > 8000,
        "{saved:?}"
    );
}

#[test]
fn a_damaged_chunk_is_saved_as_far_as_it_unpacks_and_the_rest_whole() {
    let (folder, path, _) = logged(&long());
    let mut bytes = fs::read(&path).unwrap();
    let messages = info(&path).unwrap().messages;
    // Far enough apart to hit chunks and not only what lies between them.
    for at in (bytes.len() * 2 / 5..bytes.len() * 3 / 5).step_by(5000) {
        bytes[at] ^= 0xff;
    }
    fs::write(&path, &bytes).unwrap();
    let out = folder.path().join("out.mcap");
    let report = recover(&path, &out).unwrap();
    assert!(report.losses > 0 && report.bytes_lost > 0, "{report}");
    assert!(report.messages > messages / 4 && report.messages < messages);
    assert!(!report.is_lossless(), "{report}");
    assert!(info(&out).unwrap().messages == report.messages);
}

#[test]
fn behind_a_hole_reading_goes_on() {
    let (folder, path, _) = logged(&long());
    let mut bytes = fs::read(&path).unwrap();
    let messages = info(&path).unwrap().messages;
    // A block of the disk that was never written.
    let hole = bytes.len() / 4..bytes.len() / 4 + 4096;
    bytes[hole].fill(0);
    // And one that hits the framing: the head of whatever starts there.
    fs::write(&path, &bytes).unwrap();
    let out = folder.path().join("out.mcap");
    let report = recover(&path, &out).unwrap();
    assert!(report.messages > messages / 4, "{report}");
}

#[test]
fn a_file_is_not_written_over_itself() {
    let (_folder, path, _) = logged(&Plan::default());
    let error = recover(&path, &path).unwrap_err();
    assert!(error.to_string().contains("is read by"), "{error}");
    assert!(info(&path).unwrap().missing.is_empty());
}
