//! Teams that learn which rocks there are: on bad links and good ones, with every fault of their
//! hardware, after crashes. What they learn depends on what they read, not on the way it came.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};

use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{Executor, Report};
use farside_actors::rover::{FaultBegins, FaultKind};
use farside_actors::system::Results;
use farside_experiments::registry::Registry;
use farside_experiments::scenario::Scenario;

/// Counts records of each class, and the names of faults.
#[derive(Clone, Default)]
struct Told(Arc<Mutex<(BTreeSet<&'static str>, u64)>>);

impl Observer for Told {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            ..Wants::default()
        }
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let mut told = self.0.lock().unwrap();
        told.1 += 1;
        if let (RecordClass::Told, Some(kind)) = (record.class, record.kind)
            && kind.name() == "FaultBegins"
        {
            let fault: FaultBegins = kind.schema().decode(record.body).unwrap();
            told.0.insert(fault.kind.name());
        }
        Ok(Flow::Continue)
    }
}

fn run_watched(name: &str, sets: &[&str], executor: Executor) -> (Results, Report, Told) {
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    let scenario = Scenario::open(name, &sets, &Registry::builtin()).unwrap();
    let mut assembled = scenario.assemble().unwrap();
    let told = Told::default();
    assembled.sim.observe(told.clone());
    let report = assembled.sim.run(executor).unwrap();
    ((assembled.system.conclude)(&report), report, told)
}

fn run(name: &str, sets: &[&str]) -> (Results, Report) {
    let (results, report, _) = run_watched(name, sets, Executor::Inline);
    (results, report)
}

fn metric(results: &Results, name: &str) -> f64 {
    let value = &results.metrics[name];
    value.as_f64().unwrap_or_else(|| panic!("{name}: {value}"))
}

/// Links that are down for half a sol delay what rovers know of each other's readings. In the end they
/// know the same.
#[test]
fn killed_links_for_half_a_sol_change_what_is_learnt_by_little() {
    let dead = "degrade=[{ at = '1sol', until = '1.5sol', links = '*', outage = true }]";
    let (healthy, _) = run("misus/learn", &["until=3sol"]);
    let (killed, report) = run("misus/learn", &["until=3sol", dead]);
    assert!(report.counts.lost_by_reason.contains_key("outage"));
    let difference = metric(&healthy, "class_ari") - metric(&killed, "class_ari");
    assert!(difference.abs() < 0.02, "{difference}");
    assert_eq!(killed.metrics["k_agrees"], true);
    assert_eq!(metric(&healthy, "readings"), metric(&killed, "readings"));
}

/// A crash empties a scientist's memory; the others give back what they had heard.
#[test]
fn who_restarts_learns_again_what_the_others_know() {
    let crash = "crash=[{ actor = 'rover_02', at = '30h', restart = '31h' }]";
    let (_, without) = run("misus/learn", &["until=2sol"]);
    let (results, report) = run("misus/learn", &["until=2sol", crash]);
    assert_ne!(without.digest, report.digest);
    assert_eq!(results.metrics["k_agrees"], true);
    let least = metric(&results, "class_ari_least");
    assert!(
        (metric(&results, "class_ari") - least).abs() < 1e-9,
        "{least}"
    );
}

#[test]
fn every_kind_of_fault_is_told_and_ends_no_run() {
    let (results, report, told) = run_watched("misus/faults", &[], Executor::Inline);
    assert_eq!(report.end.name(), "stopped", "{:?}", report.end);
    let told = told.0.lock().unwrap();
    let all: BTreeSet<&str> = FaultKind::ALL.iter().map(|kind| kind.name()).collect();
    assert_eq!(told.0, all);
    assert!(metric(&results, "rocks_read") > 5.0);
    assert!(metric(&results, "energy_imbalance") < 1e-9);
}

#[test]
fn energy_is_accounted_for_in_every_run() {
    let rates = "rover.fault_rates={ dust = 2.0, extra_power = 3.0, slip = 3.0, memory = 1.0, \
                 never_ends = 2.0, instrument_fails = 2.0, stuck_mast = 2.0, blocked_path = 3.0 }";
    for seed in ["seed=1", "seed=2", "seed=3"] {
        let (results, report) = run("misus/learn", &["until=2sol", rates, seed]);
        assert_eq!(report.end.name(), "stopped");
        assert!(metric(&results, "faults") > 10.0);
        let imbalance = metric(&results, "energy_imbalance");
        assert!(imbalance < 1e-9, "{seed}: {imbalance}");
    }
}

#[test]
fn both_executors_have_one_result() {
    let sets = ["until=1sol", "links.default.loss=0.4"];
    let (inline, a, _) = run_watched("misus/learn", &sets, Executor::Inline);
    let (kameo, b, _) = run_watched("misus/learn", &sets, Executor::Kameo { threads: 2 });
    assert_eq!(a, b);
    assert_eq!(inline.metrics, kameo.metrics);
}

/// Rovers that have nothing to do cost little.
#[test]
fn idle_rovers_are_cheap() {
    let (results, _, told) = run_watched(
        "misus/learn",
        &["until=10sol", "learn.stops=0"],
        Executor::Inline,
    );
    let records = told.0.lock().unwrap().1;
    assert!(metric(&results, "solar_wh") > 0.0);
    assert!(records < 200_000, "{records} records in 10 sols");
}

#[test]
fn what_cannot_be_is_refused_by_its_key() {
    let refused = |sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
        let scenario = Scenario::open("misus/learn", &sets, &Registry::builtin());
        let assembled = scenario.and_then(|scenario| scenario.assemble().map(drop));
        assembled.expect_err("it is refused").to_string()
    };
    let class = "world.class=[{ name = 'a', olivine = 0.5, plagioclase = 0.4 }]";
    for (set, holds) in [
        ("world.story=strat", "did you mean \"strata\"?"),
        ("world.class_names=['dunit']", "did you mean \"dunite\"?"),
        (class, "sum to 0.9"),
        ("rover.model=fibo", "did you mean \"fido\"?"),
        ("world.spectra=none.csv", "world.spectra"),
        ("learn.tour=fixd", "fixed"),
    ] {
        let message = refused(&[set]);
        assert!(message.contains(holds), "{set}: {message}");
    }
}
