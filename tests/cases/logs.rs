//! Logs of other programs, and broken ones: `diff`, `recover` and `info`.

use std::path::{Path, PathBuf};
use std::time::Duration;

use farside_logs::{DiffOptions, DiffReport, LogInfo, RecoverReport};

/// Longer than any of these files needs, also where others work on the machine.
const PATIENCE: Duration = Duration::from_secs(120);

fn input(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("cases/logs/{name}.mcap"))
}

/// Does the work on a thread of its own, with the stack that threads have, and fails if it takes
/// too long.
fn in_time<T: Send + 'static>(name: &str, work: impl FnOnce() -> T + Send + 'static) -> T {
    let (done, answer) = std::sync::mpsc::channel();
    #[expect(
        clippy::disallowed_methods,
        reason = "a hang is to fail the test; nothing is simulated on that thread"
    )]
    std::thread::spawn(move || done.send(work()));
    let answer = answer.recv_timeout(PATIENCE);
    answer.unwrap_or_else(|error| panic!("{name}: no answer: {error}"))
}

fn diff(a: &str, b: &str, tolerance: f64) -> DiffReport {
    let (x, y) = (input(a), input(b));
    in_time(a, move || {
        let options = DiffOptions {
            tolerance,
            ..DiffOptions::default()
        };
        farside_logs::diff(x, y, &options).expect("both are whole files")
    })
}

fn info(path: PathBuf) -> LogInfo {
    in_time("info", move || {
        farside_logs::info(path).expect("it is an MCAP file")
    })
}

fn recover(name: &str) -> (RecoverReport, LogInfo) {
    let path = input(name);
    in_time(name, move || {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("out.mcap");
        let report = farside_logs::recover(path, &out).expect("it starts like an MCAP file");
        let saved = info(out);
        assert_eq!(saved.missing, [""; 0]);
        assert_eq!(saved.messages, report.messages);
        (report, saved)
    })
}

#[test]
fn the_first_difference_is_named() {
    // The files, the tolerance, the field and its two values.
    let cases = [
        ("tree-type", 0.0, ["v", "1", "2"]),
        ("edition-2023", 0.0, ["v", "1", "2"]),
        ("wide-nested-type", 0.0, ["v", "1", "2"]),
        ("infinity", 1e-9, ["d", "inf", "1"]),
        ("unknown-field", 0.0, ["unknown field 99", "1", "2"]),
        ("file-twice-in-set", 0.0, ["t.seconds", "5", "6"]),
        ("schema-changed", 0.0, ["d", "2.5", "no such field"]),
        (
            "json-big-integer",
            0.0,
            [
                "id",
                "123456789012345678901234567890",
                "123456789012345678901234567891",
            ],
        ),
        ("json-null-absent", 0.0, ["a", "null", "absent"]),
        ("json-array-length", 0.0, ["a.length", "100", "101"]),
    ];
    for (name, tolerance, [field, a, b]) in cases {
        let [one, other] = ["a", "b"].map(|side| format!("{name}-{side}"));
        let report = diff(&one, &other, tolerance);
        assert!(!report.identical, "{name}: {report}");
        let first = report.first.clone().expect("a message differs");
        assert_eq!(
            [&first.field, &first.a, &first.b],
            [field, a, b],
            "{name}: {report}"
        );
        assert!(
            report.to_string().contains(&format!("{field}: {a} | {b}")),
            "{report}"
        );
        // The other way round it is the same.
        let first = diff(&other, &one, tolerance)
            .first
            .expect("a message differs");
        let (back_a, back_b) = (&first.a, &first.b);
        assert!(
            first.field == field || b == "no such field",
            "{name}: {first:?}"
        );
        assert!(
            [back_a, back_b].contains(&&a.to_owned()),
            "{name}: {first:?}"
        );
    }
}

#[test]
fn what_differs_beside_the_messages_is_named() {
    for (a, b) in [("a", "b"), ("b", "a")] {
        let report = diff(
            &format!("schema-grew-{a}"),
            &format!("schema-grew-{b}"),
            1e-9,
        );
        assert!(report.identical && report.first.is_none(), "{report}");
        assert!(
            report
                .to_string()
                .contains("note: the schema of /a differs"),
            "{report}"
        );
    }
    let report = diff("schema-changed-a", "schema-changed-b", 0.0);
    assert!(
        report.to_string().contains("the schema of /a differs"),
        "{report}"
    );
    let report = diff("attachments-differ-a", "attachments-differ-b", 0.0);
    let text = report.to_string();
    assert!(!report.identical, "{text}");
    for named in ["metadata cfg.gain differs", "attachment map.yaml differs"] {
        assert!(text.contains(named), "{text}");
    }
}

#[test]
fn one_message_that_is_dropped_is_one_difference() {
    let report = diff("one-dropped-a", "one-dropped-b", 0.0);
    let counts = (
        report.changed,
        report.only_in_a,
        report.only_in_b,
        report.reordered,
    );
    assert_eq!(counts, (0, 1, 0, 0), "{report}");
}

#[test]
fn times_have_all_their_digits() {
    let report = diff("nanoseconds-a", "nanoseconds-b", 0.0);
    assert!(
        report.to_string().contains("1700000000.123456790 s"),
        "{report}"
    );
    let json = serde_json::to_value(&report).expect("a report is JSON");
    assert_eq!(
        json["first"]["time_ns"].as_u64(),
        Some(1_700_000_000_123_456_790)
    );
}

#[test]
fn every_whole_message_is_saved_and_what_is_dropped_is_named() {
    // The file, the messages that are saved, how many of them unchecked, whether nothing is lost,
    // and what is said.
    let cases = [
        (
            "first-chunk-damaged",
            6,
            3,
            false,
            "does not match its checksum",
        ),
        (
            "cut-in-chunk",
            99,
            99,
            false,
            "a message of 92 bytes that is not whole",
        ),
        ("chunk-never-closed", 100, 0, false, "never closed"),
        ("chunk-one-bit", 100, 100, false, "unchecked: 100"),
        (
            "unchunked-one-bad-length",
            99,
            0,
            false,
            "that is not whole",
        ),
        (
            "two-files-in-one",
            3,
            0,
            false,
            "390 bytes behind the end, from byte 312 on: another",
        ),
        (
            "channel-before-schema",
            3,
            0,
            true,
            "nothing that was in the file is lost",
        ),
        (
            "unused-channel",
            3,
            0,
            true,
            "nothing that was in the file is lost",
        ),
        ("metadata-same-name", 3, 0, true, "2 metadata records"),
        (
            "two-publishers",
            2,
            0,
            true,
            "nothing that was in the file is lost",
        ),
        (
            "data-crc-wrong",
            3,
            0,
            false,
            "the checksum of the data does not match",
        ),
        (
            "escape-in-topic",
            1,
            0,
            true,
            "nothing that was in the file is lost",
        ),
    ];
    for (name, messages, unchecked, lossless, said) in cases {
        let (report, _) = recover(name);
        let found = (report.messages, report.unchecked, report.is_lossless());
        assert_eq!(found, (messages, unchecked, lossless), "{name}: {report}");
        assert!(report.to_string().contains(said), "{name}: {report}");
    }
    let (_, saved) = recover("channel-before-schema");
    assert_eq!(saved.topics[0].schema, "S");
    let (_, saved) = recover("unused-channel");
    let unused = saved
        .topics
        .iter()
        .find(|topic| topic.topic == "/never_published");
    assert_eq!(unused.map(|topic| topic.messages), Some(0));
    let (_, saved) = recover("two-publishers");
    assert_eq!(saved.topics[0].channels, 2);
    let (_, saved) = recover("metadata-same-name");
    assert_eq!(saved.metadata["rosbag2"].len(), 2);
}

#[test]
fn info_says_what_there_is() {
    // The file, and a line of what is told.
    let cases = [
        ("unused-channel", "0             0    /never_published  S"),
        ("channel-before-schema", "/a  S"),
        ("data-crc-wrong", "the checksum of the data does not match"),
        ("two-files-in-one", "390 bytes from byte 312 on"),
        (
            "escape-in-topic",
            "/evil\\n     999999       1    /fake\\u{1b}[31m\n",
        ),
    ];
    for (name, told) in cases {
        let text = info(input(name)).to_string();
        assert!(text.contains(told), "{name}: {text}");
    }
    let json = serde_json::to_value(info(input("metadata-same-name"))).expect("it is JSON");
    let parts: Vec<_> = json["metadata"]["rosbag2"]
        .as_array()
        .expect("a list")
        .iter()
        .collect();
    assert_eq!(parts.len(), 2);
    assert_eq!(
        (&parts[0]["part"], &parts[1]["part"]),
        (&"1".into(), &"2".into())
    );
}
