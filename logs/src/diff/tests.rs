//! However a comparison goes about it, it finds the same: with or without passing over what agrees
//! at the front, in memory or by way of a file. And it holds as little as it says.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use proptest::prelude::*;

use super::{DiffOptions, DiffReport, Limits, Usage, comparison};
use crate::envelope::{KeyRef, field};
use crate::wire::{put_bytes, put_number, put_text};

/// A record of a log that was made up.
#[derive(Clone, Debug, PartialEq)]
struct Made {
    fate: usize,
    sender: usize,
    receiver: usize,
    ordinal: u64,
    match_key: Option<u64>,
    time_ns: u64,
    sent_ns: u64,
    count: u64,
    cause: Option<u64>,
    body: Vec<u8>,
    /// What explains the record, and is not compared.
    attempts: u64,
}

const FATES: [&str; 6] = ["delivered", "lost", "timer", "crash", "hand_over", "start"];
const NAMES: [&str; 3] = ["base", "rover_1", "rover_2"];

impl Made {
    fn topic(&self) -> String {
        let sender = NAMES[self.sender];
        match FATES[self.fate] {
            "delivered" => format!("/{sender}/pose"),
            fate @ ("crash" | "start") => format!("/event/{fate}"),
            fate => format!("/{fate}/{sender}/pose"),
        }
    }

    fn role(&self) -> &'static str {
        if matches!(FATES[self.fate], "delivered" | "lost") {
            "message"
        } else {
            "event"
        }
    }

    fn envelope(&self) -> Vec<u8> {
        let mut out = Vec::new();
        put_text(&mut out, field::SENDER, NAMES[self.sender]);
        put_text(&mut out, field::RECEIVER, NAMES[self.receiver]);
        put_text(&mut out, field::KIND, "Pose");
        put_text(&mut out, field::FATE, FATES[self.fate]);
        put_number(&mut out, field::ORDINAL, self.ordinal);
        put_number(&mut out, field::TIME_NS, self.time_ns);
        put_text(&mut out, field::SOURCE, NAMES[self.sender]);
        put_number(&mut out, field::COUNT, self.count);
        put_number(&mut out, field::SENT_NS, self.sent_ns);
        if let Some(count) = self.cause {
            let key = KeyRef {
                time_ns: self.sent_ns,
                source: NAMES[self.sender],
                count,
                ..KeyRef::default()
            };
            let mut cause = Vec::new();
            put_number(&mut cause, 1, key.time_ns);
            put_text(&mut cause, 3, key.source);
            put_number(&mut cause, 4, key.count);
            put_bytes(&mut out, field::CAUSE, &cause);
        }
        if let Some(key) = self.match_key {
            put_number(&mut out, field::MATCH_KEY, key + 1);
        }
        let mut carriage = Vec::new();
        put_number(&mut carriage, 6, self.attempts);
        put_bytes(&mut out, field::CARRIAGE, &carriage);
        put_bytes(&mut out, field::BODY, &self.body);
        out
    }
}

fn made() -> impl Strategy<Value = Made> {
    let who = (0..FATES.len(), 0..NAMES.len(), 0..NAMES.len());
    let numbers = (
        0u64..6,
        prop::option::weighted(0.4, 0u64..3),
        0u64..40,
        0u64..6,
    );
    let rest = (
        prop::option::of(0u64..6),
        prop::collection::vec(0u8..3, 0..3),
        0u64..2,
    );
    (who, numbers, 0u64..4, rest).prop_map(
        |((fate, sender, receiver), (ordinal, match_key, time_ns, count), before, rest)| Made {
            fate,
            sender,
            receiver,
            ordinal,
            match_key,
            time_ns,
            sent_ns: time_ns.saturating_sub(before),
            count,
            cause: rest.0,
            body: rest.1,
            attempts: rest.2,
        },
    )
}

/// What happens to a log on the way to its sibling.
#[derive(Clone, Debug)]
enum Edit {
    Remove(prop::sample::Index),
    Insert(prop::sample::Index, Made),
    Replace(prop::sample::Index, Made),
    Body(prop::sample::Index),
    Attempts(prop::sample::Index),
    Swap(prop::sample::Index, prop::sample::Index),
    Cut(prop::sample::Index),
}

fn edit() -> impl Strategy<Value = Edit> {
    let at = any::<prop::sample::Index>;
    prop_oneof![
        at().prop_map(Edit::Remove),
        (at(), made()).prop_map(|(at, made)| Edit::Insert(at, made)),
        (at(), made()).prop_map(|(at, made)| Edit::Replace(at, made)),
        at().prop_map(Edit::Body),
        at().prop_map(Edit::Attempts),
        (at(), at()).prop_map(|(one, other)| Edit::Swap(one, other)),
        at().prop_map(Edit::Cut),
    ]
}

fn edited(log: &[Made], edits: &[Edit]) -> Vec<Made> {
    let mut log = log.to_vec();
    for edit in edits {
        if log.is_empty() {
            break;
        }
        let length = log.len();
        match edit {
            Edit::Remove(at) => drop(log.remove(at.index(length))),
            Edit::Insert(at, made) => log.insert(at.index(length), made.clone()),
            Edit::Replace(at, made) => log[at.index(length)] = made.clone(),
            Edit::Body(at) => log[at.index(length)].body.push(7),
            Edit::Attempts(at) => log[at.index(length)].attempts += 1,
            Edit::Swap(one, other) => log.swap(one.index(length), other.index(length)),
            Edit::Cut(at) => log.truncate(at.index(length)),
        }
    }
    log
}

/// Writes a log with so many records in a chunk; as some other program's if it is not Farside's.
fn write(path: &Path, log: &[Made], chunk: usize, farside: bool) {
    let file = std::fs::File::create(path).unwrap();
    let mut writer = mcap::WriteOptions::new()
        .compression(None)
        .use_chunks(chunk > 0)
        .chunk_size(None)
        .create(file)
        .unwrap();
    if farside {
        let entries = [
            ("format", "1.3"),
            ("seed", "1"),
            ("scenario", "made/up"),
            ("epoch_ns", "0"),
            ("exclude", "[]"),
        ];
        let metadata = entries.map(|(key, value)| (key.to_owned(), value.to_owned()));
        let name = "farside".to_owned();
        let metadata = metadata.into();
        let record = mcap::records::Metadata { name, metadata };
        writer.write_metadata(&record).unwrap();
    }
    for (at, made) in log.iter().enumerate() {
        let role = [("role".to_owned(), made.role().to_owned())];
        let role: BTreeMap<String, String> = role.into();
        let channel = writer
            .add_channel(0, &made.topic(), "protobuf", &role)
            .unwrap();
        let header = MessageHeader {
            channel_id: channel,
            sequence: made.ordinal as u32,
            log_time: made.time_ns,
            publish_time: made.sent_ns,
        };
        writer
            .write_to_known_channel(&header, &made.envelope())
            .unwrap();
        if chunk > 0 && at % chunk == chunk - 1 {
            writer.flush().unwrap();
        }
    }
    writer.finish().unwrap();
}

/// Ways to go about it: everything kept in memory, as it once was the only one, comes first.
fn ways() -> Vec<Limits> {
    let whole = Limits {
        entries: usize::MAX,
        pairs: usize::MAX,
        message_bytes: usize::MAX,
        passes_front: false,
        ..Limits::default()
    };
    let mut ways = vec![whole];
    for (passes_front, entries, pairs, message_bytes) in [
        (true, usize::MAX, usize::MAX, usize::MAX),
        (false, 3, 2, 1),
        (true, 3, 2, 1),
        (true, 1, 1, 300),
    ] {
        ways.push(Limits {
            entries,
            pairs,
            message_bytes,
            passes_front,
            ..whole
        });
    }
    ways
}

struct Logs {
    _folder: tempfile::TempDir,
    a: PathBuf,
    b: PathBuf,
}

impl Logs {
    fn write(a: &[Made], b: &[Made], chunks: [usize; 2], farside: bool) -> Logs {
        let folder = tempfile::tempdir().unwrap();
        let [one, other] = ["a.mcap", "b.mcap"].map(|name| folder.path().join(name));
        write(&one, a, chunks[0], farside);
        write(&other, b, chunks[1], farside);
        Logs {
            _folder: folder,
            a: one,
            b: other,
        }
    }

    fn compare(&self, options: &DiffOptions, limits: Limits) -> (DiffReport, Usage) {
        comparison::compare(&self.a, &self.b, options, limits, None).unwrap()
    }
}

/// Messages that never repeat, each a nanosecond earlier in the second log: clocks are taken as one.
#[test]
fn what_is_nearly_at_one_time_has_no_offset() {
    let measured = |shift: u64, body: u8| -> Vec<Made> {
        let one = |at: u64| Made {
            fate: 0,
            sender: 0,
            receiver: 1,
            ordinal: at,
            match_key: None,
            time_ns: 10 * at + 10 - shift,
            sent_ns: 10 * at + 10 - shift,
            count: at,
            cause: None,
            body: vec![body, at as u8],
            attempts: 0,
        };
        (0..20).map(one).collect()
    };
    let logs = Logs::write(&measured(0, 1), &measured(1, 2), [0, 0], false);
    let (found, _) = logs.compare(&DiffOptions::default(), ways()[0]);
    assert_eq!(found.offset_ns, 0);
}

/// The second log has one message less at the front, so that all others have another place in their flow, and says
/// the last one otherwise.
#[test]
fn places_that_are_forgotten_are_told() {
    let sent = |at: u64, ordinal: u64, body: u8| Made {
        fate: 0,
        sender: 0,
        receiver: 1,
        ordinal,
        match_key: None,
        time_ns: 10 * at + 10,
        sent_ns: 10 * at + 10,
        count: at,
        cause: None,
        body: vec![body],
        attempts: 0,
    };
    let a: Vec<Made> = (0..6).map(|at| sent(at, at, at as u8)).collect();
    let mut b: Vec<Made> = (1..6).map(|at| sent(at, at - 1, at as u8)).collect();
    b[4].body = vec![99];
    let logs = Logs::write(&a, &b, [0, 0], true);
    let told = |shifted: usize| {
        let limits = Limits {
            shifted,
            ..Limits::default()
        };
        let (report, _) = logs.compare(&DiffOptions::default(), limits);
        let is_told = |note: &&String| note.contains("are kept in mind");
        (report.notes.iter().find(is_told).cloned(), report.changed)
    };
    assert_eq!(told(4), (None, 1));
    let (note, _) = told(3);
    let note = note.unwrap();
    assert!(
        note.starts_with("4 messages have another place in their flow, of which 3"),
        "{note}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn every_way_finds_the_same(
        mut a in prop::collection::vec(made(), 0..40),
        in_order in any::<bool>(),
        edits in prop::collection::vec(edit(), 0..5),
        chunks in [0usize..12, 0usize..12],
        farside in prop::bool::weighted(0.7),
        tolerance in prop_oneof![Just(0.0), Just(1e-3)],
        ignored in any::<bool>(),
    ) {
        if in_order {
            a.sort_by_key(|made| (made.time_ns, made.sender, made.count));
        }
        let b = edited(&a, &edits);
        let logs = Logs::write(&a, &b, chunks, farside);
        let ignore = if ignored { vec!["/rover_1/*".to_owned()] } else { Vec::new() };
        let options = DiffOptions {
            tolerance,
            ignore,
            ..DiffOptions::default()
        };
        let ways = ways();
        let (expected, _) = logs.compare(&options, ways[0]);
        for way in &ways[1..] {
            let (mut found, _) = logs.compare(&options, *way);
            if !in_order {
                // A log that is not in the order of its events has no chains of causes.
                for (found, expected) in [
                    (&mut found.first, &expected.first),
                    (&mut found.consequence, &expected.consequence),
                ] {
                    if let (Some(found), Some(expected)) = (found, expected) {
                        found.causes.clone_from(&expected.causes);
                        found.causes_omitted = expected.causes_omitted;
                    }
                }
            }
            prop_assert_eq!(&found, &expected);
        }
    }
}

/// Many records, in order: sent by turns, every tenth with a match key.
fn many(count: u64) -> Vec<Made> {
    let made = |at: u64| Made {
        fate: 0,
        sender: at as usize % 3,
        receiver: (at as usize + 1) % 3,
        ordinal: at / 3,
        match_key: at.is_multiple_of(10).then_some(at),
        time_ns: at * 1000,
        sent_ns: (at * 1000).saturating_sub(5000),
        count: at,
        cause: None,
        body: at.to_le_bytes().to_vec(),
        attempts: 1,
    };
    (0..count).map(made).collect()
}

#[test]
fn of_what_agrees_nothing_is_kept() {
    let a = many(5000);
    // How messages were carried is not compared.
    let mut b = a.clone();
    b.iter_mut().step_by(7).for_each(|made| made.attempts = 3);
    for farside in [true, false] {
        let logs = Logs::write(&a, if farside { &b } else { &a }, [100, 70], farside);
        let (report, usage) = logs.compare(&DiffOptions::default(), Limits::default());
        assert!(report.identical, "{report}");
        let expected = Usage {
            agreed: [5000, 5000],
            ..Usage::default()
        };
        assert_eq!(usage, expected);
    }
}

#[test]
fn memory_is_bounded_where_nothing_agrees() {
    let a = many(20_000);
    let mut b = a.clone();
    b.iter_mut().for_each(|made| made.body.push(1));
    let logs = Logs::write(&a, &b, [500, 300], true);
    let limits = Limits {
        entries: 1000,
        pairs: 500,
        message_bytes: 20_000,
        passes_front: true,
        ..Limits::default()
    };
    for tolerance in [0.0, 1e-9] {
        let options = DiffOptions {
            tolerance,
            ..DiffOptions::default()
        };
        let (report, usage) = logs.compare(&options, limits);
        assert_eq!(report.changed, 20_000);
        assert_eq!(usage.agreed, [0, 0]);
        // Two logs' entries, the pairs, one bucket of each, the messages, and how they are ordered.
        let most = 4 * 1000 * 110 + 500 * (220 + 12) + 500 * 220 + 20_000 + 1000 + 4 * 20_000;
        assert!(usage.most_bytes < most, "{usage:?}, {most}");
        assert!(usage.file_bytes >= 2 * 19_000 * 110, "{usage:?}");
    }
}

/// A key that is repeated, where the repeats overtake each other just where the logs part: pairing
/// goes by their ordinals, so that what agreed at the front is paired otherwise.
#[test]
fn repeats_that_overtake_each_other_are_paired_by_their_ordinals() {
    let mut a = many(30);
    for (at, ordinal) in [(12, 9), (15, 5)] {
        a[at] = Made {
            match_key: Some(1),
            ordinal,
            sender: 0,
            receiver: 1,
            sent_ns: 9_000,
            ..a[at].clone()
        };
    }
    let mut b = a.clone();
    b.remove(15);
    let logs = Logs::write(&a, &b, [4, 5], true);
    let ways = ways();
    let (expected, _) = logs.compare(&DiffOptions::default(), ways[0]);
    assert_eq!((expected.changed, expected.only_in_a), (1, 1), "{expected}");
    let (found, usage) = logs.compare(&DiffOptions::default(), Limits::default());
    assert_eq!(found, expected);
    assert_eq!(usage.agreed, [0, 0]);
}

/// A topic's second channel, declared when all messages of the first have been read, and with other
/// fields in the two logs: then all on the topic are read by field, also what agreed by its bytes.
#[test]
fn what_agreed_is_read_by_field_where_a_later_schema_differs() {
    // Descriptor sets of one message `M` with one number `x`, in its first or its second field.
    let schema = |number: u8| {
        let field = [&b"\x0a\x01x\x18"[..], &[number], b"\x20\x01\x28\x05"].concat();
        let message = [&b"\x0a\x01M\x12"[..], &[field.len() as u8], &field].concat();
        let file = [
            &b"\x0a\x01f\x22"[..],
            &[message.len() as u8],
            &message,
            b"\x62\x06proto3",
        ];
        let file = file.concat();
        [&b"\x0a"[..], &[file.len() as u8], &file].concat()
    };
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = [1, 2].map(|number| {
        let path = folder.path().join(format!("{number}.mcap"));
        let file = std::fs::File::create(&path).unwrap();
        let mut writer = mcap::Writer::new(file).unwrap();
        for (name, second) in [("", 1), ("second", number)] {
            let schema = writer.add_schema("M", "protobuf", &schema(second)).unwrap();
            let channel = [("channel".to_owned(), name.to_owned())].into();
            let channel = writer
                .add_channel(schema, "/x", "protobuf", &channel)
                .unwrap();
            for time in 0..if name.is_empty() { 5 } else { 0 } {
                let header = MessageHeader {
                    channel_id: channel,
                    sequence: 0,
                    log_time: time,
                    publish_time: time,
                };
                writer.write_to_known_channel(&header, &[8, 1]).unwrap();
            }
        }
        writer.finish().unwrap();
        path
    });
    let compare =
        |limits| comparison::compare(&a, &b, &DiffOptions::default(), limits, None).unwrap();
    let (expected, _) = compare(ways()[0]);
    let (found, usage) = compare(Limits::default());
    assert_eq!(found, expected);
    assert!(
        found.notes[0].contains("the schema of /x differs"),
        "{found}"
    );
    assert_eq!(usage.agreed, [0, 0]);
}
