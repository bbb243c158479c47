//! What a writer leaves: the whole run, the same bytes each time, errors that are told.

use std::sync::Arc;

use farside::record::{Flow, Observer, ObserverError, Record};
use farside::{Executor, RunInfo};
use farside_logs::{LogOptions, LogWriter, info};

use crate::common::{Plan, build, log_to, logged, options};

#[test]
fn the_log_tells_what_the_report_tells() {
    let (_folder, path, report) = logged(&Plan::default());
    let info = info(&path).unwrap();
    let run = info.run.clone().unwrap();
    assert_eq!(info.missing, Vec::<String>::new(), "{info}");
    assert_eq!(run.digest, Some(report.digest.to_string()));
    assert_eq!(run.counts, Some(report.counts.clone()));
    assert_eq!(run.end.as_deref(), Some("stopped"));
    assert_eq!((run.seed, run.format.as_str()), (7, "1.3"));
    let fates: u64 = info
        .topics
        .iter()
        .filter(|t| t.role == "message")
        .map(|t| t.messages)
        .sum();
    let counts = report.counts;
    assert_eq!(fates, counts.delivered + counts.lost + counts.in_flight);
    assert!(counts.lost > 0 && counts.duplicated > 0);
    let topic = |name: &str| {
        info.topics
            .iter()
            .find(|t| t.topic == name)
            .map(|t| t.messages)
    };
    assert!(topic("/rover_1/odometry").is_some());
    assert!(topic("/lost/rover_1/odometry").is_some());
    assert!(topic("/base/heard").is_some());
    assert!(topic("/state/rover_1/pose").is_some());
    assert_eq!(topic("/event/crash"), Some(1));
    assert_eq!(info.attachments[0].name, "scenario.toml");
    assert_eq!(info.attachments[1].bytes, 10);
}

#[test]
fn logging_changes_nothing() {
    let plan = Plan::default();
    let bare = build(&plan).run(Executor::Inline).unwrap();
    let (_folder, _path, report) = logged(&plan);
    assert_eq!(report, bare);
}

/// Whoever kills a run early, or looks at its log meanwhile, finds what it is of.
#[test]
fn a_log_has_its_scenario_before_the_run_begins() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let resolved = "system = 'network'".to_owned();
    let writer = LogWriter::create(
        &path,
        LogOptions {
            resolved,
            ..options()
        },
    )
    .unwrap();
    let early = std::fs::read(&path).unwrap();
    assert!(early.starts_with(b"\x89MCAP0\r\n"));
    let text = b"system = 'network'";
    assert!(early.windows(text.len()).any(|part| part == text));
    drop(writer);
}

#[test]
fn one_run_at_a_time_writes_a_log() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let first = LogWriter::create(&path, options()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let link = folder.path().join("other.mcap");
    std::fs::hard_link(&path, &link).unwrap();
    for path in [&path, &link] {
        let second = LogWriter::create(path, options()).map(drop);
        let error = second.unwrap_err();
        assert!(
            matches!(error, farside_logs::LogError::Busy { .. }),
            "{error}"
        );
        assert!(
            !error.is_of_output(),
            "whoever asked for that asked wrongly"
        );
    }
    assert_eq!(std::fs::read(&path).unwrap(), bytes);
    let mut sim = build(&Plan::default());
    sim.observe(first);
    sim.run(Executor::Inline).unwrap();
    // Written and closed, it gives way to the next.
    drop(LogWriter::create(&path, options()).unwrap());
    // Devices take what comes.
    #[cfg(unix)]
    for _ in 0..2 {
        std::mem::forget(LogWriter::create("/dev/null", options()).unwrap());
    }
}

#[test]
fn the_same_run_gives_the_same_bytes() {
    let (_a, first, _) = logged(&Plan::default());
    let (_b, second, _) = logged(&Plan::default());
    assert_eq!(
        std::fs::read(first).unwrap(),
        std::fs::read(second).unwrap()
    );
}

/// Looks at a log as soon as its run has begun.
struct Onlooker(std::path::PathBuf);

impl Observer for Onlooker {
    fn begin(&mut self, _run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        let info = info(&self.0).unwrap();
        let run = info.run.as_ref().unwrap();
        assert_eq!(
            (run.scenario.as_str(), run.seed),
            ("tests/base_and_rovers", 7)
        );
        assert_eq!(info.attachments.len(), 2, "{info}");
        Ok(())
    }

    fn record(&mut self, _record: &Record<'_>) -> Result<Flow, ObserverError> {
        Ok(Flow::Continue)
    }
}

#[test]
fn what_a_log_is_of_is_in_the_file_as_soon_as_the_run_begins() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut sim = build(&Plan::default());
    sim.observe(LogWriter::create(&path, options()).unwrap());
    sim.observe(Onlooker(path));
    let report = sim.run(Executor::Inline).unwrap();
    assert_eq!(report.end.name(), "stopped");
}

#[test]
fn an_epoch_shifts_what_is_written_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let epoch_ns = 2_000_000_000_000_000_000;
    log_to(
        &path,
        &Plan::default(),
        LogOptions {
            epoch_ns,
            ..options()
        },
    );
    let info = info(&path).unwrap();
    assert_eq!(info.start_s, Some(0.0));
    assert!(info.end_s.unwrap() < 1e5);
}

#[test]
fn what_is_filtered_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let exclude = vec!["/*/odometry".to_owned()];
    let report = log_to(
        &path,
        &Plan::default(),
        LogOptions {
            exclude,
            ..options()
        },
    );
    let info = info(&path).unwrap();
    assert!(
        info.topics
            .iter()
            .all(|topic| topic.topic != "/rover_1/odometry")
    );
    assert!(
        info.topics
            .iter()
            .any(|topic| topic.topic == "/lost/rover_1/odometry")
    );
    assert_eq!(info.run.unwrap().digest, Some(report.digest.to_string()));
}

#[test]
fn a_full_disk_is_told() {
    let Ok(writer) = LogWriter::create("/dev/full", options()) else {
        return;
    };
    let mut sim = build(&Plan::default());
    sim.observe(writer);
    // Small runs are only written when they end.
    match sim.run(Executor::Inline) {
        Ok(report) => {
            assert_eq!(report.end.name(), "observer_failed");
            assert!(
                report.end.detail().contains("/dev/full"),
                "{}",
                report.end.detail()
            );
        }
        Err(error) => assert!(error.to_string().contains("/dev/full")),
    }
}

#[test]
fn a_file_that_cannot_be_created_is_told() {
    let error = LogWriter::create("/no/such/folder/run.mcap", options())
        .err()
        .unwrap();
    assert!(
        error.to_string().contains("/no/such/folder/run.mcap"),
        "{error}"
    );
}
