//! Reads any bytes as a contact plan of each format and as a trace. Whatever the bytes, there is
//! an error to print, or a plan whose ION file reads back equal, or a trace that keeps its order.
#![no_main]

use farside::SimTime;
use farside_worlds::contacts::{CapacityTrace, ContactError, ContactFormat, ContactPlan, MAX_FAULTS};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for format in [ContactFormat::Ion, ContactFormat::Hdtn] {
        match ContactPlan::from_bytes(bytes, format) {
            Ok(plan) => {
                let again = ContactPlan::from_ion(plan.to_ion().as_bytes());
                // ION knows no contact without a limit of its rate.
                match plan.summary().volume_bytes {
                    Some(_) => assert_eq!(again.as_ref(), Ok(&plan)),
                    None => assert_eq!(again.as_ref().map(ContactPlan::len), Ok(plan.len())),
                }
                assert!(plan.remarks().count() <= MAX_FAULTS + 1);
                assert!(!plan.summary().to_string().is_empty());
            }
            Err(error) => check(bytes, &error),
        }
    }
    match CapacityTrace::from_mahimahi(bytes) {
        Ok(trace) => {
            for nanos in [0, 1, 1 << 40, u64::MAX] {
                let from = SimTime::from_nanos(nanos);
                assert!(trace.next_opportunity(from) >= from);
            }
        }
        Err(error) => check(bytes, &error),
    }
});

/// An error names a line that the file has.
fn check(bytes: &[u8], error: &ContactError) {
    assert!(!error.to_string().is_empty());
    let lines = bytes.iter().filter(|byte| **byte == b'\n').count() + 1;
    assert!((1..=MAX_FAULTS).contains(&error.faults().len()), "{error}");
    for fault in error.faults() {
        assert!(fault.line().is_none_or(|line| (1..=lines).contains(&line)), "{error}");
    }
}
