//! Comparing a log with a re-execution.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use farside::Executor;
use farside::record::{Flow, Observer, ObserverError};
use farside_logs::{LogOptions, LogWriter, Mismatch, Verifier, VerifyOutcome};

use mcap::read::ChunkFlattener;
use mcap::records::Record;

use crate::common::{Plan, Slip, build, log_to, logged, options, run_with};
use crate::schemas::hostile;

fn verify(path: &Path, plan: &Plan) -> VerifyOutcome {
    let verifier = Verifier::open(path).unwrap();
    let handle = verifier.handle();
    run_with(plan, verifier);
    handle.outcome().unwrap()
}

fn different(outcome: VerifyOutcome) -> Mismatch {
    match outcome {
        VerifyOutcome::Different { first, .. } => *first,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_run_is_the_same_as_its_log() {
    let (_folder, path, report) = logged(&Plan::default());
    match verify(&path, &Plan::default()) {
        VerifyOutcome::Same {
            digest,
            records,
            checkpoints,
        } => {
            assert_eq!(digest, report.digest.to_string());
            assert!(records > report.counts.delivered && checkpoints > 0);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn another_seed_is_told() {
    let (_folder, path, _) = logged(&Plan::default());
    let first = different(verify(
        &path,
        &Plan {
            seed: 8,
            ..Plan::default()
        },
    ));
    assert_eq!((first.field.as_str(), first.logged.as_str()), ("seed", "7"));
}

#[test]
fn the_first_field_that_differs_is_named() {
    let (_folder, path, _) = logged(&Plan::default());
    let slip = Slip {
        from_cycle: 5,
        by_m: 0.5,
    };
    let first = different(verify(
        &path,
        &Plan {
            slip,
            ..Plan::default()
        },
    ));
    assert_eq!(first.field, "body.distance_m");
    assert!(first.topic.ends_with("/odometry"), "{first:?}");
    assert!(first.time_s > 300.0);
}

#[test]
fn a_difference_in_a_filtered_topic_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let exclude = vec!["/**/odometry".to_owned()];
    log_to(
        &path,
        &Plan::default(),
        LogOptions {
            exclude,
            ..options()
        },
    );
    let same = verify(&path, &Plan::default());
    assert!(matches!(same, VerifyOutcome::Same { .. }), "{same:?}");
    let slip = Slip {
        from_cycle: 5,
        by_m: 0.5,
    };
    let first = different(verify(
        &path,
        &Plan {
            slip,
            ..Plan::default()
        },
    ));
    assert_eq!(first.field, "digest");
    assert!(first.topic.ends_with("/odometry"), "{first:?}");
    assert!(first.time_s > 300.0 && first.time_s < 310.0, "{first:?}");
}

#[test]
fn a_cut_log_is_the_same_as_far_as_it_goes() {
    let plan = Plan {
        rovers: 8,
        cycles: 2000,
        ..Plan::default()
    };
    let (_folder, path, _) = logged(&plan);
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() * 6 / 10]).unwrap();
    match verify(&path, &plan) {
        VerifyOutcome::Prefix {
            records,
            checkpoints,
            last_checkpoint_s,
            missing,
            ..
        } => {
            assert!(records > 8000 && checkpoints >= 1);
            assert!(last_checkpoint_s.unwrap() > 1000.0);
            assert!(missing.contains("cut at byte"), "{missing}");
        }
        other => panic!("{other:?}"),
    }
    let slip = Slip {
        from_cycle: 5,
        by_m: 0.5,
    };
    different(verify(&path, &Plan { slip, ..plan }));
}

#[test]
fn a_run_that_goes_on_is_told() {
    let (_folder, path, _) = logged(&Plan::default());
    let first = different(verify(
        &path,
        &Plan {
            cycles: 21,
            ..Plan::default()
        },
    ));
    assert!(!first.field.is_empty());
}

/// Raises the interrupt flag after some records, as Ctrl-C does.
struct Interrupter {
    flag: Arc<AtomicBool>,
    left: u32,
}

impl Observer for Interrupter {
    fn record(&mut self, _record: &farside::record::Record<'_>) -> Result<Flow, ObserverError> {
        self.left = self.left.saturating_sub(1);
        if self.left == 0 {
            self.flag.store(true, Ordering::Relaxed);
        }
        Ok(Flow::Continue)
    }
}

#[test]
fn an_interrupted_run_is_the_same_as_far_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    // Where it stops, with messages on their way or without.
    for left in [20, 50, 51, 52, 53, 54, 55, 80] {
        let mut sim = build(&Plan::default());
        let flag = sim.interrupt();
        sim.observe(LogWriter::create(&path, options()).unwrap());
        sim.observe(Interrupter { flag, left });
        let report = sim.run(Executor::Inline).unwrap();
        assert_eq!(report.end.name(), "interrupted");
        match verify(&path, &Plan::default()) {
            VerifyOutcome::Prefix { missing, .. } => assert!(missing.contains("interrupted")),
            other => panic!("{other:?}"),
        }
    }
}

/// Writes a log again with other schemas for its messages.
fn with_schemas(log: &[u8], set: &[u8], out: &Path) {
    let mut writer = mcap::Writer::new(fs::File::create(out).unwrap()).unwrap();
    let (mut schemas, mut channels) = (BTreeMap::from([(0, 0)]), BTreeMap::new());
    for record in ChunkFlattener::new(log).unwrap() {
        match record.unwrap() {
            Record::Schema { header, data } => {
                let is_body = !header.name.starts_with("farside.");
                let data = if is_body { set } else { &data };
                let name = if is_body { "p.M" } else { &header.name };
                let id = writer.add_schema(name, &header.encoding, data).unwrap();
                schemas.insert(header.id, id);
            }
            Record::Channel(channel) => {
                let encoding = &channel.message_encoding;
                let schema = schemas[&channel.schema_id];
                let id = writer.add_channel(schema, &channel.topic, encoding, &channel.metadata);
                channels.insert(channel.id, id.unwrap());
            }
            Record::Message { mut header, data } => {
                header.channel_id = channels[&header.channel_id];
                writer.write_to_known_channel(&header, &data).unwrap();
            }
            Record::Metadata(metadata) => writer.write_metadata(&metadata).unwrap(),
            _ => {}
        }
    }
    writer.finish().unwrap();
}

#[test]
fn no_schema_stops_a_verification() {
    let (folder, path, _) = logged(&Plan::default());
    let (log, out) = (fs::read(&path).unwrap(), folder.path().join("hostile.mcap"));
    let slip = Slip {
        from_cycle: 5,
        by_m: 0.5,
    };
    for (name, set) in hostile() {
        with_schemas(&log, &set, &out);
        // What a log says of its types decides no comparison: bodies are the same bytes.
        let same = verify(&out, &Plan::default());
        assert!(
            matches!(same, VerifyOutcome::Same { .. }),
            "{name}: {same:?}"
        );
        let plan = Plan {
            slip,
            ..Plan::default()
        };
        let first = different(verify(&out, &plan));
        assert!(first.topic.ends_with("/odometry"), "{name}: {first:?}");
        assert!(first.field.starts_with("body"), "{name}: {first:?}");
        assert_ne!(first.logged, first.rerun, "{name}: {first:?}");
    }
}
