//! Reads any text as a scenario file. Whatever the text, there is an error to print, or a scenario
//! that can be written down and read again as the same.
#![no_main]

use std::collections::BTreeMap;

use farside_experiments::scenario::Scenario;
use farside_actors::system::Files;
use farside_experiments::registry::Registry;
use libfuzzer_sys::fuzz_target;

fn parse(text: &str) -> Result<String, String> {
    let (files, registry) = (Files::kept(BTreeMap::new()), Registry::builtin());
    let scenario = Scenario::parse("fuzz", text.to_owned(), &[], &registry, files);
    let scenario = scenario.map_err(|error| error.to_string())?;
    scenario.resolved().map_err(|error| error.to_string())
}

fuzz_target!(|text: &str| {
    if let Ok(resolved) = parse(text) {
        assert_eq!(parse(&resolved).as_ref(), Ok(&resolved));
    }
});
