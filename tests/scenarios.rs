//! Every built-in scenario, cut short: one result on every executor, with everything that it
//! switches on, and delays whose parts add up.

use std::sync::{Arc, Mutex};

use farside::record::{Flow, Observer, ObserverError, Record, RecordClass};
use farside::{Executor, Report};
use farside_experiments::registry::Registry;
use farside_experiments::scenario::Scenario;

/// Counts delays, and those whose parts do not add up.
#[derive(Clone, Default)]
struct Parts(Arc<Mutex<(u64, u64)>>);

impl Observer for Parts {
    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        if let (RecordClass::Delivered, Some(_)) = (record.class, record.link) {
            let mut counts = self.0.lock().unwrap();
            let delay = record.time().since(record.sent);
            let adds_up = record.carriage.is_some_and(|c| c.total() == delay);
            counts.0 += 1;
            counts.1 += u64::from(!adds_up);
        }
        Ok(Flow::Continue)
    }
}

fn run(name: &str, sets: &[&str], executor: Executor) -> (Report, (u64, u64)) {
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    let scenario = Scenario::open(name, &sets, &Registry::builtin()).unwrap();
    let mut assembled = scenario.assemble().unwrap();
    let parts = Parts::default();
    assembled.sim.observe(parts.clone());
    let report = assembled.sim.run(executor).unwrap();
    let counts = *parts.0.lock().unwrap();
    (report, counts)
}

#[test]
fn built_in_scenarios_have_one_result_and_explain_every_delay() {
    for name in Registry::builtin().scenario_names() {
        let sets: &[&str] = match name {
            "traffic/contact-plan" => &["until=6h"],
            "misus/planners" => &[],
            _ if name.starts_with("misus/") => &["until=8h", "learn.exchange_every=10min"],
            _ if name.starts_with("network/") => &["until=8s", "team.rovers=12"],
            _ => &["until=60s"],
        };
        let (inline, counts) = run(name, sets, Executor::Inline);
        let (kameo, _) = run(name, sets, Executor::Kameo { threads: 2 });
        assert_eq!(inline, kameo, "{name}");
        assert!(counts.0 > 100 && counts.1 == 0, "{name}: {counts:?}");
    }
}

/// Radios, contacts, bursts, queues, retries, crashes and degradations at once.
#[test]
fn everything_at_once_has_one_result() {
    let sets = [
        "until=30s",
        "radios={ uhf = { access = 'csma', range = '900m', light_time = true } }",
        "places={ lander = ['0m','0m','2m'], relay = ['0m','50m','9m'], earth = ['9m','0m','0m'], \
         rover_1 = ['99m','0m','0m'], rover_2 = ['-99m','0m','0m'], rover_3 = ['0m','950m','0m'], \
         rover_4 = ['0m','0m','0m'] }",
        "links={ default = { radio = 'uhf', rate = '64kbit/s', retries = 2, loss = 0.1, \
         burst = { loss = 0.1, length = '1s' }, jitter = '2ms', duplicate = 0.1, tx_power = '1W' }, \
         'relay-earth' = { contacts = [{ start = '5s', end = '20s' }], store_and_forward = true, \
         radio = 'off', queue = 4 } }",
        "degrade=[{ at = '10s', until = '12s', links = '*-lander', outage = true }]",
        "crash=[{ actor = '*', mtbf = '8s', mttr = '3s' }]",
    ];
    let (inline, counts) = run("traffic/open-loop", &sets, Executor::Inline);
    let (kameo, _) = run("traffic/open-loop", &sets, Executor::Kameo { threads: 2 });
    assert_eq!(inline, kameo);
    assert_eq!(counts.1, 0, "parts that do not add up");
    let reasons = &inline.counts.lost_by_reason;
    for reason in ["loss", "burst", "range", "outage", "crashed"] {
        assert!(
            reasons.contains_key(reason),
            "{reason} is not in {reasons:?}"
        );
    }
}
