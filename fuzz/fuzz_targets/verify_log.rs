//! Verifies a broken log: its run is executed again and compared. Whatever the bytes, there is an error, a
//! difference or none, and the run that is compared ends as it would have without a log.
#![no_main]

use farside::Executor;
use farside::ruling::MessageId;
use farside_fuzz::{assembled, broken, log};
use farside_logs::{Verifier, VerifyOutcome, find_messages};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let broken = broken(bytes);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("in");
    std::fs::write(&path, &broken).expect("a file");
    let text = String::from_utf8_lossy(bytes);
    let ids = [text.parse::<MessageId>(), "rover_1,lander,Message,0".parse()];
    let ids: Vec<MessageId> = ids.into_iter().flatten().collect();
    let _ = find_messages(&path, &ids);
    let Ok(verifier) = Verifier::open(&path) else {
        return;
    };
    let handle = verifier.handle();
    let mut run = assembled().1.sim;
    run.observe(verifier);
    let report = run.run(Executor::Inline).expect("it starts");
    assert!(!report.end.detail().contains("panicked"), "{:?}", report.end);
    let outcome = handle.outcome();
    if broken == log() {
        assert!(matches!(outcome, Ok(VerifyOutcome::Same { .. })), "{outcome:?}");
    }
});
