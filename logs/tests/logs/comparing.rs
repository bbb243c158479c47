//! What two logs are said to differ in.

use std::path::Path;

use farside_logs::{DiffOptions, DiffReport, LogOptions, diff};

use crate::common::{Plan, Slip, log_to, logged, options};

fn compare(a: &Plan, b: &Plan, with: &DiffOptions) -> DiffReport {
    let (_a, first, _) = logged(a);
    let (_b, second, _) = logged(b);
    diff(first, second, with).unwrap()
}

#[test]
fn a_run_is_identical_to_itself() {
    let report = compare(&Plan::default(), &Plan::default(), &DiffOptions::default());
    assert!(report.identical && report.first.is_none(), "{report}");
    assert!(report.records_a > 100 && report.topics.is_empty());
}

#[test]
fn what_depends_on_the_machine_is_not_compared() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["one", "two"].map(|host| {
        let path = folder.path().join(host);
        let host = [("host".to_owned(), host.to_owned())].into();
        log_to(
            &path,
            &Plan::default(),
            LogOptions {
                host,
                epoch_ns: 1 << 60,
                ..options()
            },
        );
        path
    });
    assert!(
        diff(&paths[0], &paths[1], &DiffOptions::default())
            .unwrap()
            .identical
    );
}

#[test]
fn a_message_lost_in_one_and_delivered_in_the_other_differs_in_its_fate() {
    let healthy = Plan {
        loss: 0.0,
        ..Plan::default()
    };
    let report = compare(&healthy, &Plan::default(), &DiffOptions::default());
    let first = report.first.clone().unwrap();
    assert_eq!(
        (first.field.as_str(), first.a.as_str(), first.b.as_str()),
        ("fate", "delivered", "lost")
    );
    assert_eq!(first.reason, "loss");
    assert!(
        first.link.starts_with("up_") || first.link.starts_with("down_"),
        "{first:?}"
    );
    assert!(first.match_key.is_some());
    // Back to the base's start: the timers, and what they caused.
    let last = first.causes.last().unwrap();
    assert_eq!(
        (last.fate.as_str(), last.topic.as_str()),
        ("start", "/event/start"),
        "{report}"
    );
    assert!(report.changed > 0);
    let times: Vec<f64> = first.causes.iter().map(|cause| cause.time_s).collect();
    assert!(times.windows(2).all(|two| two[0] >= two[1]));
    assert!(report.to_string().contains("first difference"), "{report}");
    let json = serde_json::to_value(&report).unwrap();
    for key in [
        "identical",
        "first",
        "changed",
        "only_in_a",
        "only_in_b",
        "reordered",
        "topics",
    ] {
        assert!(json.get(key).is_some(), "{key}");
    }
}

#[test]
fn more_loss_from_the_same_seed_loses_no_other_message() {
    let more = Plan {
        loss: 0.3,
        crash: false,
        ..Plan::default()
    };
    let less = Plan {
        loss: 0.1,
        crash: false,
        ..Plan::default()
    };
    let report = compare(&less, &more, &DiffOptions::default());
    let first = report.first.unwrap();
    assert_eq!((first.a.as_str(), first.b.as_str()), ("delivered", "lost"));
}

#[test]
fn a_changed_body_is_named_by_its_field() {
    let slip = Slip {
        from_cycle: 5,
        by_m: 0.5,
    };
    let sick = Plan {
        slip,
        ..Plan::default()
    };
    let report = compare(&Plan::default(), &sick, &DiffOptions::default());
    let first = report.first.unwrap();
    assert_eq!(first.field, "body.distance_m");
    assert!(first.time_s > 300.0 && first.time_s < 310.0, "{first:?}");
    assert_eq!((report.only_in_a, report.only_in_b), (0, 0));
    assert!(
        report
            .topics
            .iter()
            .all(|topic| topic.topic.ends_with("odometry"))
    );
}

#[test]
fn a_tolerance_covers_small_differences() {
    let slip = Slip {
        from_cycle: 5,
        by_m: 1e-7,
    };
    let sick = Plan {
        slip,
        ..Plan::default()
    };
    let exact = compare(&Plan::default(), &sick, &DiffOptions::default());
    assert!(exact.changed > 0);
    let tolerant = DiffOptions {
        tolerance: 1e-6,
        ..DiffOptions::default()
    };
    let report = compare(&Plan::default(), &sick, &tolerant);
    assert!(report.identical, "{report}");
}

#[test]
fn ignored_topics_do_not_differ() {
    let slip = Slip {
        from_cycle: 5,
        by_m: 0.5,
    };
    let sick = Plan {
        slip,
        ..Plan::default()
    };
    let ignore = DiffOptions {
        ignore: vec!["/**/odometry".to_owned()],
        ..DiffOptions::default()
    };
    let report = compare(&Plan::default(), &sick, &ignore);
    assert!(report.identical, "{report}");
}

#[test]
fn topics_that_one_log_filtered_do_not_differ() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a"), folder.path().join("b"));
    log_to(&a, &Plan::default(), options());
    let exclude = vec!["/**/odometry".to_owned()];
    log_to(
        &b,
        &Plan::default(),
        LogOptions {
            exclude,
            ..options()
        },
    );
    let report = diff(&a, &b, &DiffOptions::default()).unwrap();
    assert!(report.identical, "{report}");
    assert!(
        report
            .notes
            .iter()
            .any(|note| note.contains("filtered topics differ"))
    );
}

#[test]
fn a_longer_run_has_more_messages() {
    let longer = Plan {
        cycles: 22,
        ..Plan::default()
    };
    let report = compare(&Plan::default(), &longer, &DiffOptions::default());
    assert!(report.only_in_b > 0);
    assert!(report.first.unwrap().time_s > 1200.0);
}

#[test]
fn globs_that_make_no_sense_are_told() {
    let options = DiffOptions {
        ignore: vec!["/{a".to_owned()],
        ..DiffOptions::default()
    };
    let error = diff("a.mcap", "b.mcap", &options).unwrap_err();
    assert!(error.to_string().contains("/{a"), "{error}");
}

/// Writes a file as a stranger would: without envelopes.
fn foreign(path: &Path, encoding: &str, messages: &[(&str, u64, &str)]) {
    let file = std::io::BufWriter::new(std::fs::File::create(path).unwrap());
    let mut writer = mcap::Writer::new(file).unwrap();
    for (topic, time, data) in messages {
        let channel = writer
            .add_channel(0, topic, encoding, &Default::default())
            .unwrap();
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: *time,
            publish_time: *time,
        };
        writer
            .write_to_known_channel(&header, data.as_bytes())
            .unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn strangers_files_are_compared_by_topic_and_place() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a"), folder.path().join("b"));
    foreign(
        &a,
        "json",
        &[("/x", 1, r#"{"p":{"q":1},"r":2}"#), ("/y", 2, "{}")],
    );
    foreign(
        &b,
        "json",
        &[
            ("/x", 1, r#"{"r":2,"p":{"q":3}}"#),
            ("/y", 2, "{}"),
            ("/y", 3, "{}"),
        ],
    );
    let report = diff(&a, &b, &DiffOptions::default()).unwrap();
    let first = report.first.unwrap();
    assert_eq!(
        (first.field.as_str(), first.a.as_str(), first.b.as_str()),
        ("p.q", "1", "3")
    );
    assert_eq!(
        (report.changed, report.only_in_a, report.only_in_b),
        (1, 0, 1)
    );
    foreign(&b, "cdr", &[("/x", 1, "abc")]);
    foreign(&a, "cdr", &[("/x", 1, "abd")]);
    let first = diff(&a, &b, &DiffOptions::default())
        .unwrap()
        .first
        .unwrap();
    assert_eq!(first.field, "data");
}
