//! Runs the built-in survey without the command, with whatever is to be otherwise.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{End, Report};
use farside_actors::link::LinksConfig;
use farside_actors::system::{Files, Results, Seeds, Settings, Setup, System};
use farside_actors::units::parse_duration;
use farside_actors::wiring::LinkBuilder;
use farside_misus::SurveySystem;
use farside_misus::survey::PlanMade;

/// A run.
pub(crate) struct Run<'a> {
    /// What is to be otherwise than in `misus/mars-survey`, as TOML.
    pub(crate) text: &'a str,
    pub(crate) seed: u64,
    pub(crate) executor: Executor,
    /// Hosts that crash: when, and when they start again if they do \[h\].
    pub(crate) crashes: &'a [(&'a str, f64, Option<f64>)],
}

impl Default for Run<'_> {
    fn default() -> Self {
        Run {
            text: "",
            seed: 1,
            executor: Executor::Inline,
            crashes: &[],
        }
    }
}

/// What came of it.
pub(crate) struct Ran {
    pub(crate) results: Results,
    pub(crate) report: Report,
    /// How many plans there were for each cause.
    pub(crate) causes: BTreeMap<String, u32>,
}

/// Counts plans by their causes.
struct Causes(Arc<Mutex<BTreeMap<String, u32>>>);

impl Observer for Causes {
    fn wants(&self) -> Wants {
        Wants {
            bodies: false,
            samples: true,
            checkpoints: false,
        }
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        if let (RecordClass::Sample, Some(kind)) = (record.class, record.kind)
            && kind.name() == "PlanMade"
        {
            let plan: PlanMade = kind.schema().decode(record.body).expect("it is one");
            let mut causes = self.0.lock().expect("nobody panics");
            *causes.entry(format!("{:?}", plan.cause)).or_default() += 1;
        }
        Ok(Flow::Continue)
    }
}

/// Puts what is given over what there is, table by table.
fn overlay(base: &mut toml::Table, given: toml::Table) {
    for (key, value) in given {
        match (base.get_mut(&key), value) {
            (Some(toml::Value::Table(base)), toml::Value::Table(given)) => overlay(base, given),
            (_, value) => drop(base.insert(key, value)),
        }
    }
}

impl Run<'_> {
    pub(crate) fn run(&self) -> Ran {
        self.tried().unwrap_or_else(|error| panic!("{error}"))
    }

    pub(crate) fn tried(&self) -> Result<Ran, String> {
        let mut table: toml::Table =
            toml::from_str(SurveySystem.scenarios()[0].text).expect("it is TOML");
        assert_eq!(table["system"].as_str(), Some(SurveySystem.name()));
        overlay(&mut table, toml::from_str(self.text).expect("it is TOML"));
        let mut take = |key: &str| table.remove(key).expect("it is there");
        let links: LinksConfig = take("links").try_into().expect("they are links");
        let until = take("until").as_str().map(parse_duration);
        let until = until.and_then(Result::ok).expect("it is a duration");
        let _ = ["system", "description", "seed"].map(&mut take);
        let text = table.to_string();
        let sections = toml::Deserializer::parse(&text).expect("it is TOML");
        let settings: Box<dyn Settings> = SurveySystem
            .parse(sections)
            .map_err(|error| error.message().to_owned())?;
        settings.check().map_err(|error| error.to_string())?;
        let links = LinkBuilder::new(&links, &[]).expect("they are right");
        let mut sim = Simulation::new(self.seed);
        let mut files = Files::on_disk(".".into());
        let seeds = Seeds {
            run: self.seed,
            problem: self.seed,
        };
        let mut setup = Setup::new(seeds, Some(until), &mut sim, &mut files, links);
        let assembly = settings.assemble(&mut setup);
        let assembly = assembly.map_err(|error| error.to_string())?;
        setup.close().map_err(|error| error.to_string())?;
        for &(host, crash_h, restart_h) in self.crashes {
            let at = |hours: f64| SimTime::ZERO + SimDuration::from_secs((hours * 3600.0) as u64);
            for name in actors(host) {
                let crashed = sim.crash_named_at(at(crash_h), &name);
                if let (Ok(()), Some(restart_h)) = (crashed, restart_h) {
                    sim.restart_named_at(at(restart_h), &name)
                        .expect("it crashed");
                }
            }
        }
        sim.stop_at(SimTime::ZERO + until, "until");
        let causes = Arc::new(Mutex::new(BTreeMap::new()));
        sim.observe(Causes(causes.clone()));
        let report = sim.run(self.executor).expect("it runs");
        assert!(!matches!(report.end, End::Fault(_)), "{:?}", report.end);
        let results = (assembly.conclude)(&report);
        let causes = causes.lock().expect("nobody panics").clone();
        Ok(Ran {
            results,
            report,
            causes,
        })
    }
}

/// The actors that a host may have.
fn actors(host: &str) -> Vec<String> {
    let hardware = farside_actors::rover::hardware_name(host);
    let own = match host.strip_prefix("rover_") {
        Some(number) => vec![format!("planner_{number}"), format!("centre_{number}")],
        None => vec!["centre".to_owned(), "scientist".to_owned()],
    };
    own.into_iter().chain([host.to_owned(), hardware]).collect()
}

impl Ran {
    pub(crate) fn figure(&self, metric: &str) -> f64 {
        self.results.metrics[metric].as_f64().unwrap_or(f64::NAN)
    }

    /// That nothing happened that must never happen.
    pub(crate) fn assert_sound(&self, what: &str) {
        assert_eq!(self.results.violations, Vec::<String>::new(), "{what}");
        for metric in ["plan_violations", "sharing_violations", "lost_goals"] {
            assert_eq!(self.figure(metric), 0.0, "{what}: {metric}");
        }
    }
}
