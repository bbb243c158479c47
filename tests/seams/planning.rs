//! What a planner may know before the run: the contact plan, and links as nothing degrades them.

use std::collections::BTreeMap;
use std::path::Path;

use farside_actors::link::Contacts;
use farside_actors::system::{
    Assembly, Files, Results, Section, Settings, Setup, SetupError, System,
};
use farside_actors::wiring::Wiring;
use farside_experiments::registry::Registry;
use farside_experiments::scenario::{Assembled, Scenario};
use serde::{Deserialize, Serialize};

const HOSTS: [&str; 3] = ["earth", "orbiter", "rover"];

/// A system that plans nothing, and says what it could plan by.
#[derive(Serialize, Deserialize)]
struct Asks {}

impl System for Asks {
    fn name(&self) -> &str {
        "asks"
    }

    fn about(&self) -> &str {
        "says what planners may know"
    }

    fn sections(&self) -> Vec<Section> {
        Vec::new()
    }

    fn parse(&self, keys: toml::Deserializer<'_>) -> Result<Box<dyn Settings>, toml::de::Error> {
        Ok(Box::new(Asks::deserialize(keys)?))
    }
}

impl Settings for Asks {
    fn resolved(&self) -> Result<toml::Table, toml::ser::Error> {
        Ok(toml::Table::new())
    }

    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError> {
        let mut wiring = Wiring::default();
        let hosts = HOSTS.map(|name| (setup.sim.host(name), name));
        for pair in hosts.windows(2) {
            wiring.both_ways(pair[0], pair[1]);
        }
        let planned = setup.contacts.clone().expect("the scenario has a plan");
        let links = setup.link(&wiring)?;
        let mut known = BTreeMap::new();
        for (from, to) in wiring.links() {
            let (from, to) = (from.1, to.1);
            let nominal = links.nominal(from, to).expect("there is such a link");
            let windows = planned
                .windows_between(from, to)
                .expect("the plan names both");
            let contacts = nominal.contacts.as_ref().expect("as the plan has it");
            assert_eq!(*contacts, Contacts::of_plan(windows), "{from}-{to}");
            let latency = nominal.latency.to_string();
            known.insert(
                format!("{from}-{to}"),
                (windows.len(), latency, nominal.loss),
            );
        }
        assert_eq!(links.nominal("earth", "rover"), None);
        let notes = known
            .iter()
            .map(|(link, what)| format!("known: {link} {what:?}"));
        let notes = notes.collect();
        Ok(Assembly::new(|_| Results::default()).with_notes(notes))
    }
}

const PLAN: &str = "system = 'asks'\nuntil = '1h'\n[contacts]\nfile = 'mars-relay'\n\
    nodes = { 1 = 'earth', 2 = 'orbiter', 3 = 'rover' }\n\
    [links.default]\nlatency = '7ms'\nloss = 0.25\n";

fn assemble(degrade: &str) -> Assembled {
    let text = format!("{PLAN}{degrade}");
    let registry = Registry::empty().with(Asks {});
    let files = Files::on_disk(Path::new("").to_owned());
    let scenario = Scenario::parse("asks.toml", text, &[], &registry, files);
    scenario
        .and_then(|scenario| scenario.assemble())
        .expect("it can be assembled")
}

fn known(assembled: &Assembled) -> Vec<&String> {
    let all = assembled.notes.iter();
    all.filter(|note| note.starts_with("known: ")).collect()
}

#[test]
fn planners_know_contacts_and_parameters_and_no_degradation() {
    let healthy = assemble("");
    let said = known(&healthy);
    assert_eq!(said.len(), 4);
    assert_eq!(said[3], "known: rover-orbiter (4, \"7ms\", 0.25)");
    let worse = "[[degrade]]\nat = '0s'\nlinks = '*'\nloss = 1\nlatency = '9s'\ncontacts = 'off'\n";
    let degraded = assemble(worse);
    assert_eq!(said, known(&degraded));
    // What links act by is another matter.
    let latency = |assembled: &Assembled| assembled.sim.slowest_link().to_string();
    assert_ne!(latency(&healthy), latency(&degraded));
}
