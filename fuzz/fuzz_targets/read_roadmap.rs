//! Reads any text as a roadmap file. Whatever the text, there is an error to print or a roadmap.
#![no_main]

use farside_worlds::Roadmap;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    match Roadmap::from_toml(text) {
        Ok(roadmap) => assert!(!roadmap.name().is_empty()),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
