//! Relatives of the inputs in `tests/cases/logs`: other encodings, other damage, other places.

use std::collections::BTreeMap;
use std::fs;

use farside_logs::{DiffOptions, DiffReport, LogError, RecoverReport, diff, info, recover};
use mcap::records::op;
use prost_types::field_descriptor_proto::Type;

fn compared(a: &File, b: &File, tolerance: f64) -> DiffReport {
    let folder = tempfile::tempdir().unwrap();
    let options = DiffOptions {
        tolerance,
        ..DiffOptions::default()
    };
    diff(
        a.write(folder.path(), "a"),
        b.write(folder.path(), "b"),
        &options,
    )
    .unwrap()
}

fn recovered(file: &File) -> (RecoverReport, farside_logs::LogInfo) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let report = recover(file.write(folder.path(), "in"), &out).unwrap();
    (report, info(out).unwrap())
}

use crate::by_hand::{File, attachment, channel, chunk, message, metadata, record, schema};
use crate::schemas::{field, file_of, hostile, set, type_of};

/// A file of one JSON message.
fn json(data: &str) -> File {
    File::new()
        .with(channel(1, 0, "/a", "json"))
        .with(message(1, 1, data.as_bytes()))
        .end()
}

/// A file of one protobuf message of the type `p.M`.
fn protobuf(set: &[u8], data: &[u8]) -> File {
    let file = File::new().with(schema(1, "p.M", "protobuf", set));
    file.with(channel(1, 1, "/a", "protobuf"))
        .with(message(1, 1, data))
        .end()
}

#[test]
fn no_schema_stops_a_comparison() {
    for (name, set) in hostile() {
        let report = compared(&protobuf(&set, &[8, 1]), &protobuf(&set, &[8, 2]), 1e-9);
        let first = report
            .first
            .as_ref()
            .unwrap_or_else(|| panic!("{name}: {report}"));
        let by_bytes = report
            .notes
            .iter()
            .any(|note| note.contains("by their bytes"));
        assert!(first.field == "v" || by_bytes, "{name}: {report}");
        assert!(compared(&protobuf(&set, &[8, 1]), &protobuf(&set, &[8, 1]), 0.0).identical);
    }
}

#[test]
fn identical_is_said_only_of_what_is() {
    let with = |name: &str, kind| {
        set(vec![file_of(
            vec![type_of("M", vec![field(name, 1, kind, "")])],
            "proto3",
        )])
    };
    let double = with("d", Type::Double);
    let number = |value: f64| protobuf(&double, &[&[9][..], &value.to_le_bytes()].concat());
    for (a, b) in [
        (f64::NEG_INFINITY, 1.0),
        (f64::INFINITY, f64::NEG_INFINITY),
        (f64::NAN, 0.5),
    ] {
        assert!(
            !compared(&number(a), &number(b), 1e300).identical,
            "{a} {b}"
        );
    }
    assert!(compared(&number(f64::NAN), &number(-f64::NAN), 0.0).identical);
    // The same bytes, which the schemas read as two things.
    let (one, other) = (with("a", Type::Int64), with("a", Type::Sint64));
    assert!(!compared(&protobuf(&one, &[8, 1]), &protobuf(&other, &[8, 1]), 0.0).identical);
    // Metadata and attachments that only one has, also in files without messages.
    let bare = File::new().end();
    assert!(
        compared(&bare, &bare, 0.0)
            .to_string()
            .contains("no messages to compare")
    );
    let more = [
        File::new().with(metadata("m", "k", "v")).end(),
        File::new().with(attachment("a", b"1")).end(),
    ];
    for file in &more {
        let report = compared(&bare, file, 0.0);
        assert!(!report.identical && report.beside.len() == 1, "{report}");
        assert!(compared(file, file, 0.0).identical);
    }
    let report = compared(
        &bare,
        &File::new().with(channel(1, 0, "/only", "json")).end(),
        0.0,
    );
    assert!(
        report
            .to_string()
            .contains("/only has no messages, and is declared in b only")
    );
    // Another encoding of the same bytes.
    let cbor = File::new()
        .with(channel(1, 0, "/a", "cbor"))
        .with(message(1, 1, b"1"))
        .end();
    assert!(!compared(&json("1"), &cbor, 0.0).identical);
    for (a, b) in [
        ("1e400", "1e401"),
        ("-0", "0"),
        ("[null]", "[]"),
        ("{\"a\":{\"b\":null}}", "{\"a\":{}}"),
        ("9007199254740993", "9007199254740992.0"),
        ("\"1\"", "1"),
        ("{\"a\":1,\"a\":2}", "{\"a\":3,\"a\":2}"),
    ] {
        let report = compared(&json(a), &json(b), 0.0);
        let first = report
            .first
            .clone()
            .unwrap_or_else(|| panic!("{a} {b}: {report}"));
        assert_ne!(first.a, first.b, "{report}");
    }
    assert!(compared(&json("{\"a\": 1.0}"), &json("{\"a\":1}"), 0.0).identical);
}

#[test]
fn messages_are_aligned_by_what_they_say_and_when() {
    let file = |messages: &[(u64, &str)]| {
        let file = File::new().with(channel(1, 0, "/a", "json"));
        let add =
            |file: File, (time, data): &(u64, &str)| file.with(message(1, *time, data.as_bytes()));
        messages.iter().fold(file, add).end()
    };
    let counts = |a: &[(u64, &str)], b: &[(u64, &str)]| {
        let report = compared(&file(a), &file(b), 0.0);
        (
            report.changed,
            report.only_in_a,
            report.only_in_b,
            report.reordered,
        )
    };
    let all: Vec<(u64, String)> = (0..50)
        .map(|at| (at * 10, format!("{}", at * at)))
        .collect();
    let all: Vec<(u64, &str)> = all
        .iter()
        .map(|(time, data)| (*time, data.as_str()))
        .collect();
    assert_eq!(counts(&all, &all[1..]), (0, 1, 0, 0));
    assert_eq!(counts(&all[..49], &all), (0, 0, 1, 0));
    // One dropped, and one changed behind it.
    let mut changed = all[1..].to_vec();
    changed[20].1 = "-1";
    assert_eq!(counts(&all, &changed), (1, 1, 0, 0));
    // All a little later.
    let later: Vec<(u64, &str)> = all.iter().map(|(time, data)| (time + 3, *data)).collect();
    assert_eq!(counts(&all, &later[1..]), (49, 1, 0, 0));
    // Two swapped.
    let mut swapped = all.clone();
    swapped.swap(10, 11);
    assert_eq!(counts(&all, &swapped), (0, 0, 0, 1));
}

#[test]
fn topics_stored_one_after_the_other_compare_as_fast_as_mixed_ones() {
    // 100 topics in 100 chunks of 2 MB, all messages changed: opening a chunk for each message
    // would unpack 20 GB.
    const TOPICS: u16 = 100;
    let mut state = 1u64;
    let letters = std::iter::repeat_with(|| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        char::from(b'a' + (state >> 60) as u8)
    });
    // Long, and not the same in any two messages, so that unpacking takes its time.
    let letters: String = letters.take(80_000).collect();
    let add = |side: &str, topic: u16, n: u16| {
        let from = (usize::from(topic) * 593 + usize::from(n) * 419) % 60_000;
        let pad = &letters[from..from + 20_000];
        let data = format!("{{\"s\":\"{side}\",\"n\":{n},\"pad\":\"{pad}\"}}");
        message(topic, u64::from(n), data.as_bytes())
    };
    let declared = |at| channel(at, 0, &format!("/{at}"), "json");
    let declared: Vec<u8> = (0..TOPICS).flat_map(declared).collect();
    let chunks = |side: &'static str, by_topic: bool| {
        let file = File::new().with(&declared);
        let of = |outer: u16, inner: u16| match by_topic {
            true => add(side, outer, inner),
            false => add(side, inner, outer),
        };
        let chunk_of = |outer| {
            (0..TOPICS)
                .flat_map(|inner| of(outer, inner))
                .collect::<Vec<u8>>()
        };
        let add = |file: File, outer| file.with(chunk("zstd", &chunk_of(outer)));
        (0..TOPICS).fold(file, add).end()
    };
    let (mixed, sorted) = (chunks("a", false), chunks("b", true));
    // Where a chunk is opened for each message, this takes minutes.
    let report = compared(&mixed, &sorted, 0.0);
    assert_eq!(report.changed, 10_000, "{report}");
}

#[test]
fn topics_without_messages_are_there() {
    let folder = tempfile::tempdir().unwrap();
    let file = File::new().with(channel(1, 0, "/never", "json")).end();
    let told = info(file.write(folder.path(), "x")).unwrap();
    assert_eq!((told.topics.len(), told.topics[0].messages), (1, 0));
    let (report, saved) = recovered(&file);
    assert!(
        report.is_lossless() && saved.topics[0].topic == "/never",
        "{report}"
    );
}

/// Twenty messages, declared, in a chunk or not.
fn twenty(compression: Option<&str>) -> Vec<u8> {
    let declared = [
        schema(1, "S", "jsonschema", b"{}"),
        channel(1, 1, "/a", "json"),
    ]
    .concat();
    let messages = (0..20).flat_map(|at| message(1, at, format!("{{\"n\":{at}}}").as_bytes()));
    let records: Vec<u8> = declared.into_iter().chain(messages).collect();
    match compression {
        Some(compression) => chunk(compression, &records),
        None => records,
    }
}

#[test]
fn chunks_of_any_compression_are_saved_as_far_as_they_go() {
    for compression in ["", "zstd", "lz4"] {
        let whole = File::new().with(twenty(Some(compression)));
        let (report, _) = recovered(&whole.clone().end());
        assert!(
            report.messages == 20 && report.is_lossless(),
            "{compression}: {report}"
        );
        // A wrong checksum, and behind it what is in order.
        let mut wrong = whole.clone();
        let sum = 8 + 9 + 12 + 9 + 24;
        wrong.0[sum] ^= 1;
        let other = [channel(2, 0, "/b", "json"), message(2, 1, b"{}")].concat();
        let (report, saved) = recovered(&wrong.with(chunk("", &other)).end());
        assert_eq!(
            (report.messages, report.unchecked),
            (21, 20),
            "{compression}: {report}"
        );
        assert_eq!(saved.topics.len(), 2);
        // A length that is wrong, by a little or by much.
        for bit in [0, 40] {
            let mut wrong = whole.clone();
            wrong.0[8 + 9 + 12 + 1 + bit / 8] ^= 1 << (bit % 8);
            let (report, _) = recovered(&wrong.with(chunk("", &other)).end());
            assert_eq!(report.messages, 21, "{compression}, bit {bit}: {report}");
        }
        let mut cut = whole.clone();
        cut.0.truncate(whole.0.len() - 3);
        let (report, _) = recovered(&cut);
        assert!(!report.is_lossless(), "{compression}: {report}");
        if compression.is_empty() {
            assert_eq!(report.messages, 19, "{report}");
        }
    }
}

#[test]
fn behind_damage_everything_whole_is_saved() {
    let file = File::new().with(twenty(None)).with(metadata("m", "k", "v"));
    let file = file
        .with(attachment("a", b"data"))
        .with(message(1, 99, b"{}"))
        .end();
    // Each bit of the head of the fifth message's record, one at a time.
    let at = 8 + 21 + schema(1, "S", "jsonschema", b"{}").len() + channel(1, 1, "/a", "json").len();
    let fifth = at + 4 * message(1, 0, b"{\"n\":0}").len();
    for bit in 0..9 * 8 {
        let mut damaged = file.clone();
        damaged.0[fifth + bit / 8] ^= 1 << (bit % 8);
        let (report, _) = recovered(&damaged);
        let found = (report.messages >= 20, report.attachments, report.metadata);
        assert_eq!(found, (true, 1, 1), "bit {bit}: {report}");
        // The opcode of a private record: it is kept as one, and named.
        let kept = report.messages == 21 || report.notes.iter().any(|note| note.contains("0x85"));
        assert!(!report.is_lossless() || kept, "bit {bit}: {report}");
    }
    // A hole where the first declarations were, which the summary repeats.
    let again = [channel(1, 0, "/a", "json")].concat();
    let start = 8 + 21;
    let hole = File::new().with([0; 200]).with(message(1, 5, b"{}"));
    let summary = hole.0.len() as u64 + 13;
    let footer = [&summary.to_le_bytes()[..], &[0; 12]].concat();
    let file = hole.with(record(op::DATA_END, &[0; 4])).with(again);
    let file = file.with(record(op::FOOTER, &footer)).with(mcap::MAGIC);
    let (report, saved) = recovered(&file);
    assert_eq!((report.messages, saved.topics.len()), (1, 1), "{report}");
    assert!(
        report.lost[0].contains(&format!("at byte {start}: 200 bytes")),
        "{report}"
    );
}

#[test]
fn nothing_is_taken_out_of_an_attachment() {
    let inside = File::new().with(twenty(None)).end();
    let declared = channel(1, 0, "/out", "json");
    let file = File::new().with(&declared).with(message(1, 1, b"{}"));
    let file = file
        .with(attachment("log", &inside.0))
        .with(message(1, 2, b"{}"))
        .end();
    let (report, _) = recovered(&file);
    assert_eq!((report.messages, report.attachments), (2, 1), "{report}");
    let at = 8 + 21 + declared.len() + message(1, 1, b"{}").len();
    for byte in [at + 1, at + 2, at + 6] {
        let mut damaged = file.clone();
        damaged.0[byte] ^= 0x10;
        let (report, _) = recovered(&damaged);
        assert!(report.messages <= 2, "{report}");
        assert_eq!((report.messages, report.attachments), (2, 1), "{report}");
    }
    // Cut in the attachment.
    let mut cut = file.clone();
    cut.0.truncate(at + 300);
    let (report, saved) = recovered(&cut);
    assert_eq!((report.messages, saved.topics.len()), (1, 1), "{report}");
    // Its data is damaged: it is saved, and named.
    let mut damaged = file;
    damaged.0[at + 200] ^= 1;
    let (report, _) = recovered(&damaged);
    assert!(report.attachments == 1 && !report.is_lossless(), "{report}");
    assert!(
        report
            .to_string()
            .contains("attachment log does not match its checksum")
    );
}

#[test]
fn the_input_survives_whatever_the_output_is_called() {
    let folder = tempfile::tempdir().unwrap();
    let file = File::new().with(twenty(Some("zstd"))).end();
    let path = file.write(folder.path(), "x.mcap");
    let hard = folder.path().join("hard.mcap");
    fs::hard_link(&path, &hard).unwrap();
    let mut names = vec![
        path.clone(),
        hard,
        folder
            .path()
            .join("../")
            .join(folder.path().file_name().unwrap())
            .join("x.mcap"),
    ];
    #[cfg(unix)]
    {
        let link = folder.path().join("link.mcap");
        std::os::unix::fs::symlink(&path, &link).unwrap();
        names.push(link);
    }
    for out in names {
        let error = recover(&path, &out).unwrap_err();
        assert!(matches!(error, LogError::SameFile { .. }), "{error}");
        assert_eq!(fs::read(&path).unwrap(), file.0);
    }
    let notes = folder.path().join("notes.txt");
    fs::write(&notes, "my notes").unwrap();
    assert!(matches!(
        recover(&path, &notes),
        Err(LogError::InTheWay { .. })
    ));
    assert_eq!(fs::read_to_string(&notes).unwrap(), "my notes");
    // What cannot be written leaves nothing behind, and the old log where it is.
    let old = File::new().end().write(folder.path(), "old.mcap");
    recover(&path, &old).unwrap();
    assert_eq!(info(&old).unwrap().messages, 20);
    let left = fs::read_dir(folder.path()).unwrap().filter_map(Result::ok);
    let parts = left.filter(|entry| entry.file_name().to_string_lossy().ends_with(".part"));
    assert_eq!(parts.count(), 0);
}

#[test]
fn bombs_are_refused_and_said() {
    let zeros = vec![0; 200 << 20];
    let folder = tempfile::tempdir().unwrap();
    let bomb = chunk("zstd", &zeros);
    assert!(bomb.len() < 50_000);
    let file = (0..20)
        .fold(File::new(), |file, _| file.with(&bomb))
        .with(twenty(None))
        .end();
    let (report, _) = recovered(&file);
    assert_eq!(report.messages, 20, "{report}");
    assert!(
        report
            .to_string()
            .contains("more than the 67108864 allowed"),
        "{report}"
    );
    let path = file.write(folder.path(), "bomb");
    assert!(
        info(&path)
            .unwrap()
            .to_string()
            .contains("unpacks to 209715200")
    );
    let error = diff(&path, &path, &DiffOptions::default()).unwrap_err();
    assert!(error.to_string().contains("more than"), "{error}");
    // Many that are just small enough: together they are too much.
    let small = chunk("zstd", &record(0x80, &zeros[..60 << 20]));
    let file = (0..40).fold(File::new(), |file, _| file.with(&small)).end();
    let (report, _) = recovered(&file);
    assert!(report.losses > 20, "{report}");
}

#[test]
fn other_files_and_pipes_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x");
    fs::write(
        &path,
        "version https://git-lfs.github.com/spec/v1\noid sha256:0\n",
    )
    .unwrap();
    let error = info(&path).unwrap_err().to_string();
    assert!(error.contains("Git LFS pointer"), "{error}");
    #[cfg(unix)]
    for device in ["/dev/null", "/dev/zero"] {
        let error = info(device).unwrap_err();
        assert!(matches!(error, LogError::NotAFile { .. }), "{error}");
        assert!(matches!(
            diff(device, device, &DiffOptions::default()),
            Err(LogError::NotAFile { .. })
        ));
    }
}

#[test]
fn names_are_escaped_in_every_output() {
    let evil = "/e\n\u{1b}[31m\u{202e}";
    let file = |data: &[u8]| {
        let file = File::new()
            .with(channel(1, 0, evil, "json"))
            .with(metadata(evil, evil, evil));
        file.with(attachment(evil, data))
            .with(message(1, 1, data))
            .end()
    };
    let folder = tempfile::tempdir().unwrap();
    let path = file(b"1").write(folder.path(), "x");
    let report = compared(&file(b"1"), &file(b"2"), 0.0);
    let mut broken = file(b"1");
    broken.0.truncate(broken.0.len() - 40);
    let texts = [
        info(path).unwrap().to_string(),
        report.to_string(),
        format!("{report:#}"),
        recovered(&broken).0.to_string(),
    ];
    for text in texts {
        let bad = text
            .chars()
            .find(|c| *c != '\n' && (c.is_control() || *c == '\u{202e}'));
        assert_eq!(bad, None, "{text:?}");
        assert!(!text.contains("/e\n"), "{text}");
    }
}

#[test]
fn checksums_of_data_and_summary_are_compared() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.mcap");
    let mut writer = mcap::WriteOptions::new().compression(None);
    writer = writer.calculate_data_section_crc(true);
    let mut writer = writer.create(fs::File::create(&path).unwrap()).unwrap();
    let channel = writer
        .add_channel(0, "/a", "json", &BTreeMap::new())
        .unwrap();
    let header = mcap::records::MessageHeader {
        channel_id: channel,
        sequence: 0,
        log_time: 1,
        publish_time: 1,
    };
    writer.write_to_known_channel(&header, b"{}").unwrap();
    writer.finish().unwrap();
    drop(writer);
    assert_eq!(info(&path).unwrap().missing, [""; 0]);
    let whole = fs::read(&path).unwrap();
    // Somewhere in the header's library, and in the statistics.
    for (from_end, at, word) in [(false, 25, "data"), (true, 45, "summary")] {
        let mut damaged = whole.clone();
        let at = if from_end { whole.len() - at } else { at };
        damaged[at] ^= 1;
        fs::write(&path, damaged).unwrap();
        let missing = info(&path).unwrap().missing;
        let told = missing
            .iter()
            .any(|what| what.contains(&format!("checksum of the {word}")));
        assert!(told, "{word}: {missing:?}");
    }
}
