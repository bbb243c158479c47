//! Comparing a log with a re-execution.

use std::fs;
use std::path::Path;

use farside_logs::{LogOptions, Mismatch, Verifier, VerifyOutcome};

use crate::common::{Plan, Slip, log_to, logged, options, run_with};

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
