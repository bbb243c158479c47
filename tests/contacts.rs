//! Contact plans, from the file to the log: what a plan says is what its links do, to the
//! nanosecond.

use std::collections::BTreeMap;

use farside::encoding::Schema;
use farside::record::RecordClass;
use farside::{Executor, SimTime};
use farside_actors::link::LinkChange;
use farside_experiments::registry::Registry;
use farside_experiments::scenario::Scenario;
use farside_logs::{Log, LogOptions, LogWriter};
use farside_worlds::contacts::ContactWindow;

/// When a link's contacts open and close, as the log has it.
type Told = BTreeMap<String, Vec<(SimTime, SimTime)>>;

/// Runs a day of the built-in scenario by a contact plan; returns its plan, by link, and its log.
fn logged(folder: &std::path::Path) -> (BTreeMap<String, Vec<ContactWindow>>, Log) {
    let scenario = Scenario::open("traffic/contact-plan", &[], &Registry::builtin()).unwrap();
    let mut assembled = scenario.assemble().unwrap();
    let contacts = assembled.contacts.take().expect("the scenario has a plan");
    let mut plan = BTreeMap::new();
    for (from, to, windows) in contacts.pairs() {
        plan.insert(format!("{from}-{to}"), windows.to_vec());
    }
    let path = folder.join("day.mcap");
    let options = LogOptions {
        scenario: "traffic/contact-plan".to_owned(),
        resolved: scenario.resolved().unwrap(),
        ..LogOptions::default()
    };
    let writer = LogWriter::create(&path, options).unwrap();
    assembled.sim.observe(writer);
    let report = assembled.sim.run(Executor::Inline).unwrap();
    assert_eq!(report.end.detail(), "@control: until 86400s");
    (plan, Log::open(&path).unwrap())
}

#[test]
fn contacts_in_the_log_are_those_of_the_plan() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, log) = logged(folder.path());
    let schema = Schema::of::<LinkChange>().unwrap();
    let mut told: Told = BTreeMap::new();
    let day = SimTime::from_secs(86_400);
    for record in log.records().unwrap().map(Result::unwrap) {
        if record.class != RecordClass::Change {
            continue;
        }
        let change: LinkChange = schema.decode(&record.body).unwrap();
        let at = SimTime::from_nanos(record.key.time_ns);
        let windows = told.entry(record.receiver.clone()).or_default();
        match change.set().get("contact").map(String::as_str) {
            Some("open") => windows.push((at, day)),
            Some("closed") => windows.last_mut().expect("it was open").1 = at,
            _ => {}
        }
    }
    assert!(told.values().map(Vec::len).sum::<usize>() > 3);
    for (link, windows) in &told {
        let planned = plan[link].iter().filter(|window| window.start < day);
        let planned: Vec<_> = planned.map(|w| (w.start, w.end.min(day))).collect();
        assert_eq!(*windows, planned, "{link}");
    }
}

#[test]
fn nothing_is_on_the_air_outside_a_contact() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, log) = logged(folder.path());
    let mut seen = BTreeMap::<String, u64>::new();
    for record in log.records().unwrap().map(Result::unwrap) {
        let (Some(link), Some(carriage)) = (record.link, record.carriage) else {
            continue;
        };
        if record.class != RecordClass::Delivered {
            continue;
        }
        let sent = SimTime::from_nanos(record.sent_ns);
        let start = sent + carriage.queue + carriage.retries;
        let end = start + carriage.serialization;
        let window = plan[&link]
            .iter()
            .find(|w| w.start <= start && end <= w.end)
            .unwrap_or_else(|| panic!("{link}: {start} to {end} is in no contact"));
        assert_eq!(carriage.propagation, window.owlt, "{link}");
        let arrival = SimTime::from_nanos(record.key.time_ns);
        assert_eq!(arrival, sent + carriage.total(), "{link}");
        *seen.entry(link).or_default() += 1;
    }
    assert!(
        seen.len() >= 3 && seen.values().all(|n| *n > 10),
        "{seen:?}"
    );
}
