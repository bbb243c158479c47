//! Logs of other programs: read as values, aligned without our identities, compared field by field.

use std::path::{Path, PathBuf};

use farside_logs::{AnyMessages, DiffOptions, DiffReport, LogError, Tolerance, diff};
use mcap::records::MessageHeader;

/// A pose with the time of its measurement, as ROS 2 has it.
const POSE: &str = "std_msgs/Header header\nfloat64 x\nfloat32[] ranges\n\
    ================================================================================\n\
    MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
    ================================================================================\n\
    MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";

/// A message of a pose: when it was recorded, stamped, and what it says.
#[derive(Clone, Copy)]
struct Pose {
    log_ns: u64,
    stamp_ns: u64,
    x: f64,
    range: f32,
}

fn encoded(pose: &Pose) -> Vec<u8> {
    let seconds = (pose.stamp_ns / 1_000_000_000) as i32;
    let nanos = (pose.stamp_ns % 1_000_000_000) as u32;
    [
        &[0, 1, 0, 0][..],
        &seconds.to_le_bytes(),
        &nanos.to_le_bytes(),
        &4u32.to_le_bytes(),
        b"map\0",
        &pose.x.to_le_bytes(),
        &1u32.to_le_bytes(),
        &pose.range.to_le_bytes(),
    ]
    .concat()
}

/// What is the same at any time: ten poses a second, none of which says what another says.
fn poses() -> Vec<Pose> {
    let pose = |at: u64| Pose {
        log_ns: 1_700_000_000_000_000_000 + at * 100_000_000,
        stamp_ns: 1_700_000_000_000_000_000 + at * 100_000_000 - 3_000_000,
        x: at as f64 * 0.5,
        range: 2.0,
    };
    (0..100).map(pose).collect()
}

fn write(folder: &Path, name: &str, poses: &[Pose]) -> PathBuf {
    let path = folder.join(name);
    let mut writer = mcap::Writer::new(std::fs::File::create(&path).unwrap()).unwrap();
    let schema = writer
        .add_schema("demo/msg/Pose", "ros2msg", POSE.as_bytes())
        .unwrap();
    let channel = writer
        .add_channel(schema, "/pose", "cdr", &Default::default())
        .unwrap();
    for pose in poses {
        let header = MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: pose.log_ns,
            publish_time: pose.log_ns,
        };
        writer
            .write_to_known_channel(&header, &encoded(pose))
            .unwrap();
    }
    writer.finish().unwrap();
    path
}

fn compare_with(a: &[Pose], b: &[Pose], options: &DiffOptions) -> Result<DiffReport, LogError> {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (write(folder.path(), "a", a), write(folder.path(), "b", b));
    diff(a, b, options)
}

fn compare(a: &[Pose], b: &[Pose], options: &DiffOptions) -> DiffReport {
    compare_with(a, b, options).unwrap()
}

fn counts(report: &DiffReport) -> (u64, u64, u64, u64) {
    (
        report.changed,
        report.only_in_a,
        report.only_in_b,
        report.reordered,
    )
}

/// The same an hour and a bit later, with jitter of up to two milliseconds.
fn an_hour_later(poses: &[Pose]) -> Vec<Pose> {
    let later = 3_600_123_456_789;
    let jitter = |at: usize| (at as u64 * 7919) % 2_000_000;
    let each = poses.iter().enumerate();
    each.map(|(at, pose)| Pose {
        log_ns: pose.log_ns + later + jitter(at),
        stamp_ns: pose.stamp_ns + later + jitter(at),
        ..*pose
    })
    .collect()
}

#[test]
fn fields_and_not_bytes_differ() {
    let (a, mut b) = (poses(), poses());
    b[40].x += 0.25;
    let report = compare(&a, &b, &DiffOptions::default());
    let first = report.first.clone().unwrap();
    assert_eq!(
        (first.field.as_str(), first.a.as_str(), first.b.as_str()),
        ("x", "20.0", "20.25")
    );
    assert_eq!(counts(&report), (1, 0, 0, 0));
    let fields = &report.topics[0].fields;
    assert_eq!(
        (fields[0].field.as_str(), fields[0].most),
        ("x", Some(0.25))
    );
}

#[test]
fn a_missing_message_is_one_also_in_a_run_that_was_recorded_an_hour_later() {
    let a = poses();
    let mut b = an_hour_later(&a);
    b.remove(30);
    b.remove(70);
    let options = DiffOptions {
        time_tolerance_ns: Some(3_000_000),
        ..DiffOptions::default()
    };
    let report = compare(&a, &b, &options);
    assert_eq!(counts(&report), (0, 2, 0, 0), "{report}");
    assert!(
        report.offset_ns.abs_diff(3_600_124_456_789) < 2_000_000,
        "{report}"
    );
    assert!(
        report.notes.iter().any(|note| note.contains("later")),
        "{report}"
    );
    // Without the tolerance times differ, and nothing else.
    let exact = compare(&a, &b, &DiffOptions::default());
    assert_eq!((exact.only_in_a, exact.only_in_b), (2, 0));
    assert!(exact.changed > 90, "{exact}");
    let fields = exact.topics[0]
        .fields
        .iter()
        .map(|field| field.field.as_str());
    assert!(fields.clone().any(|field| field == "header.stamp"));
    assert!(!fields.clone().any(|field| field == "x"));
}

#[test]
fn tolerances_and_what_is_left_out_are_by_field() {
    let (a, mut b) = (poses(), poses());
    for pose in &mut b {
        pose.stamp_ns += 5_000_000;
        pose.range += 0.001;
    }
    let within = |fields: &[(&str, Tolerance)], ignore: &[&str]| {
        let options = DiffOptions {
            field_tolerances: fields
                .iter()
                .map(|(name, by)| ((*name).to_owned(), *by))
                .collect(),
            ignore: ignore.iter().map(|name| (*name).to_owned()).collect(),
            ..DiffOptions::default()
        };
        compare(&a, &b, &options).changed
    };
    let (ten_ms, one_ms) = (Tolerance::TimeNs(10_000_000), Tolerance::TimeNs(1_000_000));
    let (much, little) = (Tolerance::Number(0.01), Tolerance::Number(1e-6));
    assert_eq!(within(&[], &[]), 100);
    assert_eq!(
        within(&[("header.stamp", ten_ms), ("ranges", much)], &[]),
        0
    );
    assert_eq!(
        within(&[("header.stamp", one_ms), ("ranges", much)], &[]),
        100
    );
    assert_eq!(
        within(&[("header.stamp", ten_ms), ("ranges", little)], &[]),
        100
    );
    assert_eq!(within(&[("header", ten_ms)], &["ranges"]), 0);
    assert_eq!(within(&[], &["header.stamp", "ranges"]), 0);
    assert_eq!(within(&[], &["header.stamp"]), 100);
}

#[test]
fn names_that_are_no_fields_are_told_with_the_nearest() {
    let named = |field: &str| DiffOptions {
        ignore: vec![field.to_owned()],
        ..DiffOptions::default()
    };
    let error = compare_with(&poses(), &poses(), &named("header.stmp")).unwrap_err();
    let told = error.to_string();
    assert!(
        told.contains("\"header.stmp\"; did you mean \"header.stamp\"?"),
        "{told}"
    );
    let only = DiffOptions {
        topics: vec!["/poes".to_owned()],
        ..DiffOptions::default()
    };
    let told = compare_with(&poses(), &poses(), &only)
        .unwrap_err()
        .to_string();
    assert!(told.contains("did you mean \"/pose\"?"), "{told}");
}

#[test]
fn what_comes_in_another_order_is_reordered() {
    let (a, mut b) = (poses(), poses());
    // One is recorded late, behind three others.
    let mut late = b.remove(10);
    late.log_ns = b[12].log_ns + 1_000;
    b.insert(13, late);
    let ignore = vec!["log_time".to_owned(), "publish_time".to_owned()];
    let report = compare(
        &a,
        &b,
        &DiffOptions {
            ignore,
            ..DiffOptions::default()
        },
    );
    assert_eq!(counts(&report), (0, 0, 0, 1), "{report}");
}

#[test]
fn messages_are_read_as_values() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "a", &poses());
    let mut messages = AnyMessages::open(&path, &["/pose".to_owned()]).unwrap();
    let mut count = 0u32;
    while let Some(message) = messages.next().unwrap() {
        let value = message.value().unwrap();
        let x = value.at("x").and_then(|x| x.as_f64());
        assert_eq!(x, Some(f64::from(count) * 0.5));
        assert_eq!(
            value.at("ranges[0]").and_then(|range| range.as_f64()),
            Some(2.0)
        );
        count += 1;
    }
    assert_eq!(count, 100);
    messages.check_topics().unwrap();
    let mut messages = AnyMessages::open(&path, &["/poes".to_owned()]).unwrap();
    assert!(messages.next().unwrap().is_none());
    assert!(messages.check_topics().is_err());
}

/// `known.py`, beside the files, says who has encoded them and who has read them again.
#[test]
fn messages_that_known_tools_have_encoded_are_read_as_known_tools_read_them() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign");
    let known = std::fs::read(folder.join("known.json")).unwrap();
    let known: serde_json::Map<String, serde_json::Value> = serde_json::from_slice(&known).unwrap();
    let mut messages = AnyMessages::open(folder.join("known.mcap"), &[]).unwrap();
    let mut read = 0;
    while let Some(message) = messages.next().unwrap() {
        let value = message.value().unwrap();
        let told: serde_json::Value = serde_json::from_str(&value.to_string()).unwrap();
        let expected = &known[message.topic()];
        match message.topic() {
            "/any" => {
                let mut packed = told["a"].clone();
                let url = packed
                    .as_object_mut()
                    .and_then(|packed| packed.remove("@type"));
                assert_eq!(url.unwrap(), "type.googleapis.com/demo.Inside");
                assert_eq!(packed, *expected);
                // A type that nobody knows stays packed; one that another channel's schema has is unpacked.
                assert_eq!(told["many"][0]["nanos"], 34);
                assert_eq!(told["unknown"]["value"], "CAE=");
                assert_eq!(told["many"][2]["words"], "of another schema");
            }
            _ => assert_eq!(told, *expected, "{}", message.topic()),
        }
        read += 1;
    }
    assert_eq!(read, known.len());
}

#[test]
fn a_part_of_a_time_is_not_left_out_alone() {
    let of = |ignore: &[&str], tolerance: &[&str]| {
        let options = DiffOptions {
            ignore: ignore.iter().map(|name| (*name).to_owned()).collect(),
            field_tolerances: tolerance
                .iter()
                .map(|name| ((*name).to_owned(), Tolerance::Number(1.0)))
                .collect(),
            ..DiffOptions::default()
        };
        compare_with(&poses(), &poses(), &options)
    };
    assert!(of(&["header.stamp"], &[]).unwrap().identical);
    for (ignore, tolerance) in [
        (&["header.stamp.sec"][..], &[][..]),
        (&["header.stamp.nanosec"], &[]),
        (&[], &["header.stamp.sec"]),
    ] {
        let error = of(ignore, tolerance).unwrap_err().to_string();
        assert!(
            error.ends_with("times are compared as a whole: name \"header.stamp\""),
            "{error}"
        );
    }
}
