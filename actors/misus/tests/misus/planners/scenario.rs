//! Runs scenarios of the planners without the command.

use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{End, Report};
use farside_actors::link::LinksConfig;
use farside_actors::system::{Files, Results, Seeds, Series, Settings, Setup, System};
use farside_actors::wiring::LinkBuilder;
use farside_misus::PlanningSystem;
use farside_misus::planning::{PlanSettled, PlannedStop, PlannerStep};

/// How a run is made.
pub(crate) struct Run<'a> {
    pub(crate) text: &'a str,
    pub(crate) links: &'a str,
    pub(crate) problem: u64,
    pub(crate) seed: u64,
    pub(crate) executor: Executor,
    /// Crashes and restarts: who, when it crashes and when it restarts \[s\].
    pub(crate) crashes: &'a [(&'a str, u64, u64)],
    /// The only files that there are; those on disk unless given.
    pub(crate) files: &'a [(&'a str, &'a str)],
}

impl Default for Run<'_> {
    fn default() -> Self {
        Run {
            text: "",
            links: "default = { latency = \"50ms\" }",
            problem: 1,
            seed: 1,
            executor: Executor::Inline,
            crashes: &[],
            files: &[],
        }
    }
}

/// What came of it.
pub(crate) struct Ran {
    pub(crate) results: Results,
    pub(crate) report: Report,
    /// By rover: the tasks of its last plan.
    pub(crate) plans: Vec<Vec<(usize, usize, i64)>>,
}

/// The plans that were recorded, each with its rover's name.
type Plans = Arc<Mutex<Vec<(String, Vec<PlannedStop>)>>>;

/// Keeps the plans of each rover.
struct Listen(Plans, Vec<String>);

impl Observer for Listen {
    fn wants(&self) -> Wants {
        Wants {
            bodies: false,
            samples: true,
            checkpoints: false,
        }
    }

    fn begin(&mut self, run: &Arc<farside::RunInfo>) -> Result<(), ObserverError> {
        self.1 = run
            .entities
            .iter()
            .map(|one| one.name.to_string())
            .collect();
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let (RecordClass::Sample, Some(kind)) = (record.class, record.kind) else {
            return Ok(Flow::Continue);
        };
        let schema = kind.schema();
        let plan = match kind.name() {
            "PlannerStep" => {
                let step: PlannerStep = schema.decode(record.body).expect("it is one");
                step.plan
            }
            "PlanSettled" => {
                let settled: PlanSettled = schema.decode(record.body).expect("it is one");
                settled.plan
            }
            _ => return Ok(Flow::Continue),
        };
        let name = self.1[record.sender.index()].clone();
        self.0.lock().expect("nobody panics").push((name, plan));
        Ok(Flow::Continue)
    }
}

/// The settings of a scenario, or what is said of them.
fn settings(text: &str) -> Result<Box<dyn Settings>, String> {
    let sections = toml::Deserializer::parse(text).expect("it is TOML");
    let settings = PlanningSystem.parse(sections);
    let settings = settings.map_err(|error| error.message().to_owned())?;
    settings.check().map_err(|error| error.to_string())?;
    Ok(settings)
}

impl Run<'_> {
    pub(crate) fn run(&self) -> Ran {
        self.tried(Some(SimDuration::from_secs(48 * 3600)))
            .unwrap_or_else(|error| panic!("{error}"))
    }

    /// What the planners of the run have to solve, as text.
    pub(crate) fn exported(&self) -> String {
        let (mut sim, mut files) = (Simulation::new(self.seed), self.read());
        let mut setup = Setup::new(self.seeds(), None, &mut sim, &mut files, self.wired());
        let settings = settings(self.text).expect("they are right");
        let problem = settings.problem(&mut setup).expect("it can be");
        problem.expect("there is one")
    }

    fn seeds(&self) -> Seeds {
        Seeds {
            run: self.seed,
            problem: self.problem,
        }
    }

    fn read(&self) -> Files {
        if self.files.is_empty() {
            return Files::on_disk(".".into());
        }
        let files = self.files.iter();
        let files = files.map(|(name, text)| ((*name).to_owned(), text.as_bytes().to_vec()));
        Files::kept(files.collect())
    }

    fn wired(&self) -> LinkBuilder {
        let links: LinksConfig = toml::from_str(self.links).expect("they are links");
        LinkBuilder::new(&links, &[]).expect("they are right")
    }

    /// What is said of a scenario that cannot be.
    pub(crate) fn refused(&self) -> String {
        let tried = self.tried(Some(SimDuration::from_secs(3600)));
        tried.err().unwrap_or_else(|| "nothing".to_owned())
    }

    pub(crate) fn tried(&self, until: Option<SimDuration>) -> Result<Ran, String> {
        let settings = settings(self.text)?;
        let (mut sim, mut files) = (Simulation::new(self.seed), self.read());
        let mut setup = Setup::new(self.seeds(), until, &mut sim, &mut files, self.wired());
        let assembly = settings.assemble(&mut setup);
        let assembly = assembly.map_err(|error| error.to_string())?;
        setup.close().expect("all keys match");
        for &(name, crash, restart) in self.crashes {
            let at = SimTime::from_secs;
            sim.crash_named_at(at(crash), name).expect("it is there");
            sim.restart_named_at(at(restart), name)
                .expect("it is there");
        }
        if let Some(until) = until {
            sim.stop_at(SimTime::ZERO + until, "until");
        }
        let steps = Arc::new(Mutex::new(Vec::new()));
        sim.observe(Listen(steps.clone(), Vec::new()));
        let report = sim.run(self.executor).expect("it runs");
        assert!(!matches!(report.end, End::Fault(_)), "{:?}", report.end);
        let results = (assembly.conclude)(&report);
        let steps = steps.lock().expect("nobody panics");
        let mut names: Vec<&String> = steps.iter().map(|(name, _)| name).collect();
        names.sort_unstable();
        names.dedup();
        let plan = |name: &&String| {
            let last = steps.iter().rfind(|(of, _)| of == *name);
            let stops = last.iter().flat_map(|(_, plan)| plan);
            let stop = stops.map(|stop| (stop.task as usize, stop.sol as usize, stop.start_ms));
            stop.collect()
        };
        let plans = names.iter().map(plan).collect();
        Ok(Ran {
            results,
            report,
            plans,
        })
    }
}

impl Ran {
    pub(crate) fn figure(&self, metric: &str) -> f64 {
        let value = &self.results.metrics[metric];
        let value = value.as_f64();
        value.unwrap_or_else(|| panic!("{metric} is no number"))
    }

    /// The values of a curve, from step 1 on.
    pub(crate) fn curve(&self, metric: &str) -> Vec<f64> {
        let series = Series::from_json(&self.results.metrics[metric]).expect("it is a curve");
        let values = series.index().iter().map(|at| series.at(*at));
        values.map(|value| value.expect("it is there")).collect()
    }
}

#[test]
fn the_built_in_scenario_runs() {
    let builtin = PlanningSystem.scenarios();
    let mut table: toml::Table = toml::from_str(builtin[0].text).expect("it is TOML");
    assert_eq!(table["system"].as_str(), Some(PlanningSystem.name()));
    let links = table["links"].to_string();
    for key in ["system", "description", "seed", "until", "links"] {
        table.remove(key);
    }
    let links = format!("default = {}", toml::Value::from(links_of(&links)));
    let text = table.to_string();
    let run = Run {
        text: &text,
        links: &links,
        ..Run::default()
    };
    let ran = run.run();
    assert!(ran.results.violations.is_empty());
    assert_eq!(ran.curve("score_by_step").len(), 20);
    assert!(ran.report.end_time < SimTime::from_secs(3600));
}

/// The `default` table of links.
fn links_of(text: &str) -> toml::Table {
    let links: toml::Table = toml::from_str(&format!("links = {text}")).expect("they are links");
    let default = links["links"]["default"].as_table();
    default.expect("there is one").clone()
}
