//! What is saved of cut and damaged logs.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use farside_logs::{DiffOptions, LostToldBy, RecoverReport, diff, info, recover};

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

/// The messages of a whole file, as the `mcap` crate reads it: how often each is there.
type Messages = BTreeMap<(String, u64, Vec<u8>), u64>;

fn messages(bytes: &[u8]) -> Messages {
    let mut found = Messages::new();
    for message in mcap::MessageStream::new(bytes).unwrap() {
        let message = message.unwrap();
        let key = (
            message.channel.topic.clone(),
            message.log_time,
            message.data.into_owned(),
        );
        *found.entry(key).or_default() += 1;
    }
    found
}

/// How many messages of `of` are not among `among`, by topic.
fn missing(of: &Messages, among: &Messages) -> BTreeMap<String, u64> {
    let mut lost = BTreeMap::new();
    for (key, times) in of {
        let missing = times.saturating_sub(among.get(key).copied().unwrap_or(0));
        if missing > 0 {
            *lost.entry(key.0.clone()).or_default() += missing;
        }
    }
    lost
}

/// Recovers a broken log and holds the report against what the whole one had: what is called lossless has
/// all messages and no other, and what is said to be lost is.
fn held_against(whole: &Messages, broken: &[u8], folder: &Path, what: &str) -> RecoverReport {
    let (path, out) = (folder.join("broken.mcap"), folder.join("out.mcap"));
    fs::write(&path, broken).unwrap();
    let report = recover(&path, &out).unwrap();
    let saved = messages(&fs::read(&out).unwrap());
    let lost = missing(whole, &saved);
    let strangers = missing(&saved, whole);
    if report.is_lossless() {
        assert!(lost.is_empty() && strangers.is_empty(), "{what}: {report}");
    }
    if report.unchecked == 0 && strangers.is_empty() {
        let told = &report.lost_messages;
        match told.told_by {
            LostToldBy::Statistics => assert_eq!(told.by_topic, lost, "{what}: {report}"),
            LostToldBy::Indexes => {
                for (topic, count) in &told.by_topic {
                    let really = lost.get(topic).copied().unwrap_or(0);
                    assert!(*count <= really, "{what}: {report}");
                }
            }
        }
        let times = whole.keys().filter(|key| !saved.contains_key(*key));
        for (_, time, _) in times {
            let (from, until) = told
                .between_ns
                .unwrap_or_else(|| panic!("{what}: {time} ns is missing: {report}"));
            let within = *time >= from && until.is_none_or(|until| *time <= until);
            assert!(within, "{what}: {time} ns is missing: {report}");
        }
    }
    report
}

fn small() -> (tempfile::TempDir, Vec<u8>, Messages) {
    let (folder, path, _) = logged(&Plan {
        rovers: 1,
        cycles: 2,
        ..Plan::default()
    });
    let bytes = fs::read(&path).unwrap();
    let whole = messages(&bytes);
    (folder, bytes, whole)
}

/// Cuts and flips of a small log, every `step`th place.
fn at_every_place(step: usize) {
    let (folder, bytes, whole) = small();
    let at = folder.path();
    let data_end = 9 + 4;
    for cut in (8..bytes.len()).step_by(step) {
        let report = held_against(&whole, &bytes[..cut], at, &format!("cut at {cut}"));
        if report.cut {
            assert!(!report.is_lossless(), "cut at {cut}: {report}");
        } else {
            // Only what stands behind the data is missing.
            assert!(cut > data_end && report.messages == info_messages(&bytes, at));
        }
    }
    for place in (8..bytes.len()).step_by(step) {
        let mut flipped = bytes.clone();
        flipped[place] ^= 1 << (place % 8);
        held_against(&whole, &flipped, at, &format!("flipped at {place}"));
    }
}

fn info_messages(bytes: &[u8], folder: &Path) -> u64 {
    let path = folder.join("whole.mcap");
    fs::write(&path, bytes).unwrap();
    info(&path).unwrap().messages
}

#[test]
fn what_is_called_lossless_is_at_some_places() {
    at_every_place(37);
}

#[test]
#[ignore = "each place of a log, cut and flipped: a minute or more"]
fn what_is_called_lossless_is_at_every_place() {
    at_every_place(1);
}

#[test]
fn what_is_lost_is_counted_by_topic_and_time() {
    let (folder, path, _) = logged(&long());
    let bytes = fs::read(&path).unwrap();
    let whole = messages(&bytes);
    let mut damaged = bytes.clone();
    let hole = bytes.len() / 4..bytes.len() / 4 + 4096;
    damaged[hole].fill(0);
    let report = held_against(&whole, &damaged, folder.path(), "a hole");
    let lost = &report.lost_messages;
    assert_eq!(lost.told_by, LostToldBy::Statistics, "{report}");
    assert!(!report.cut && lost.known > 0, "{report}");
    assert_eq!(lost.known, lost.by_topic.values().sum::<u64>());
    let text = report.to_string();
    let said = format!("{} messages were lost, logged between ", lost.known);
    assert!(text.contains(&said), "{text}");
    assert!(text.contains(" on /base/ask\n"), "{text}");
    // Without a summary indexes still count what is lost of chunks that have one.
    damaged.truncate(bytes.len() * 9 / 10);
    let report = held_against(&whole, &damaged, folder.path(), "a hole and a cut");
    let lost = &report.lost_messages;
    assert_eq!(lost.told_by, LostToldBy::Indexes, "{report}");
    assert!(report.cut && lost.known > 0, "{report}");
    let text = report.to_string();
    let said = format!("at least {} messages were lost, logged at ", lost.known);
    assert!(text.contains(&said), "{text}");
    // Cut where nothing was begun: nothing is known to be lost, and nobody says that nothing is.
    let (_folder, path, _) = logged(&Plan::default());
    let bytes = fs::read(&path).unwrap();
    let chunk = bytes.iter().position(|byte| *byte == 6).unwrap();
    let report = held_against(
        &Messages::new(),
        &bytes[..chunk.min(8)],
        folder.path(),
        "empty",
    );
    assert!(report.cut && report.lost_messages.known == 0, "{report}");
    assert!(
        report.to_string().contains("its end is missing"),
        "{report}"
    );
}
