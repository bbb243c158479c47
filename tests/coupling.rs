//! Coupled randomness, end to end: the same messages of open-loop traffic meet the same luck in
//! runs whose links differ, so that what differs is what was changed.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use farside::record::{Flow, Observer, ObserverError, Record};
use farside::{Executor, RunInfo};
use farside_actors::system::Files;
use farside_experiments::registry::Registry;
use farside_experiments::scenario::Scenario;
use proptest::prelude::*;

/// Who sent which message of a flow to whom, over which link, and which copy.
type Identity = (String, String, String, u64, u32);

/// When its fate came (ns), why it was lost if it was, and how it was carried.
type Fate = (u64, &'static str, String);

#[derive(Clone, Default)]
struct Fates {
    run: Option<Arc<RunInfo>>,
    list: Arc<Mutex<BTreeMap<Identity, Fate>>>,
}

impl Observer for Fates {
    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        self.run = Some(run.clone());
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        if let (true, Some(run), Some(link)) = (record.class.is_fate(), &self.run, record.link) {
            let name = |entity| run.name(entity).to_owned();
            let key = record.match_key.map_or(record.ordinal, |key| key.bits());
            let identity = (
                name(record.sender),
                name(record.receiver),
                name(link),
                key,
                record.copy,
            );
            let carriage = record.carriage.map(ToString::to_string);
            let fate = (
                record.key.time.as_nanos(),
                record.reason,
                carriage.unwrap_or_default(),
            );
            self.list.lock().unwrap().insert(identity, fate);
        }
        Ok(Flow::Continue)
    }
}

/// Three rovers report to a lander, which answers nobody.
const TRAFFIC: &str = "
    system = 'traffic'
    until = '60s'
    [traffic]
    hosts = ['lander']
    groups = [{ prefix = 'rover', count = 3 }]
    [[traffic.flow]]
    from = 'rover_*'
    to = 'lander'
    arrivals = 'poisson'
    period = '200ms'
    size = '100B'
    stop = '50s'
    [[traffic.flow]]
    from = 'lander'
    to = 'rover_*'
    period = '500ms'
    size = '60B'
    stop = '50s'
";

fn fates(links: &str, seed: u64) -> BTreeMap<Identity, Fate> {
    let text = format!("seed = {seed}\n{TRAFFIC}\n{links}");
    let files = Files::on_disk(PathBuf::new());
    let scenario = Scenario::parse("coupling.toml", text, &[], &Registry::builtin(), files);
    let mut assembled = scenario.and_then(|s| s.assemble()).expect("it is valid");
    let fates = Fates::default();
    assembled.sim.observe(fates.clone());
    let report = assembled.sim.run(Executor::Inline).expect("it starts");
    assert!(report.fault().is_none());
    fates.list.lock().unwrap().clone()
}

/// Who is lost for this reason.
fn lost<'a>(fates: &'a BTreeMap<Identity, Fate>, reason: &str) -> Vec<&'a Identity> {
    let lost = fates.iter().filter(|(_, fate)| fate.1 == reason);
    lost.map(|(identity, _)| identity).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, ..ProptestConfig::default() })]

    /// Point 5 of the kernel's contract.
    #[test]
    fn what_a_lower_loss_loses_a_higher_loses_too(
        seed in 0u64..1000,
        low in 0.0f64..1.0,
        more in 0.0f64..1.0,
        jitter_ms in 0u64..4,
    ) {
        let high = low + more * (1.0 - low);
        let links = |loss: f64| format!("[links.default]\njitter = '{jitter_ms}ms'\nloss = {loss}");
        let (few, many) = (fates(&links(low), seed), fates(&links(high), seed));
        prop_assert_eq!(few.len(), many.len());
        let many_lost = lost(&many, "loss");
        for identity in lost(&few, "loss") {
            prop_assert!(many_lost.contains(&identity), "{identity:?} at {low} and not at {high}");
        }
    }

    /// The same in bursts: they are drawn by time, and a higher mean loss has longer bad times
    /// around the same instants.
    #[test]
    fn bursts_are_coupled_too(
        seed in 0u64..1000,
        low in 0.0f64..0.5,
        more in 0.0f64..0.4,
        length_ms in 20u64..3000,
    ) {
        let links = |loss: f64| {
            format!("[links.default]\nburst = {{ loss = {loss}, length = '{length_ms}ms' }}")
        };
        let (few, many) = (fates(&links(low), seed), fates(&links(low + more), seed));
        let many_lost = lost(&many, "burst");
        for identity in lost(&few, "burst") {
            prop_assert!(many_lost.contains(&identity), "{identity:?}");
        }
    }

    /// Whatever is done to one link, messages on all others fare as they did, to the nanosecond.
    #[test]
    fn a_changed_link_leaves_all_others_alone(
        seed in 0u64..1000,
        change in prop::sample::select(vec![
            "loss = 0.7",
            "burst = { loss = 0.3, length = '1s' }",
            "latency = '300ms'\njitter = '100ms'\njitter_shape = 'normal'",
            "rate = '2kbit/s'\nqueue = 3",
            "retries = 5\nloss = 0.5",
            "duplicate = 0.5\nreorder = 0.3",
            "contacts = [{ start = '5s', end = '20s' }]\nstore_and_forward = true",
            "ber = 0.001\ncorrupt = 0.1",
            "outage = true",
        ]),
    ) {
        let all = "[links.default]\njitter = '2ms'\nloss = 0.1\nduplicate = 0.1\n\
                   burst = { loss = 0.1, length = '500ms' }\nrate = '64kbit/s'\n";
        let plain = fates(all, seed);
        let changed = fates(&format!("{all}[links.'rover_2-lander']\n{change}\n"), seed);
        let others = |fates: &BTreeMap<Identity, Fate>| -> BTreeMap<Identity, Fate> {
            let other = |identity: &Identity| identity.2 != "rover_2-lander";
            let others = fates.iter().filter(|(identity, _)| other(identity));
            others.map(|(identity, fate)| (identity.clone(), fate.clone())).collect()
        };
        prop_assert_eq!(others(&plain), others(&changed));
        prop_assert_ne!(plain, changed);
    }
}

#[test]
fn losses_are_told_apart_and_there_are_some() {
    let fates = fates(
        "[links.default]\nloss = 0.2\nburst = { loss = 0.2, length = '1s' }",
        3,
    );
    let (by_chance, in_bursts) = (lost(&fates, "loss").len(), lost(&fates, "burst").len());
    assert!(by_chance > 50 && in_bursts > 50, "{by_chance} {in_bursts}");
    assert_eq!(lost(&fates, "").len(), fates.len() - by_chance - in_bursts);
}
