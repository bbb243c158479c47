//! Reads any text as a study. Whatever the text, there is an error to print, or a study with a
//! question; its plan, if it has one, runs every cell with every seed.
#![no_main]

use farside_experiments::study::Study;
use farside_experiments::registry::Registry;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    match Study::parse("fuzz", text.to_owned(), "/nowhere".into()) {
        Ok(study) => match study.plan(&[], Some(2), &Registry::builtin()) {
            Ok(plan) => assert!(!plan.manifest.cells.is_empty()),
            Err(error) => assert!(!error.to_string().is_empty()),
        },
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
