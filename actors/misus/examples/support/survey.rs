//! Runs the built-in survey without the command, with whatever is to be otherwise.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{End, Report, RunInfo};
use farside_actors::link::LinksConfig;
use farside_actors::radio::RadioConfig;
use farside_actors::system::{
    Files, PictureError, PictureRequest, Recorded, Recording, RecordingEnd, Results, Seeds,
    Settings, Setup, System,
};
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
    /// Whether pictures are drawn of it: its records are kept.
    pub(crate) is_kept: bool,
}

impl Default for Run<'_> {
    fn default() -> Self {
        Run {
            text: "",
            seed: 1,
            executor: Executor::Inline,
            crashes: &[],
            is_kept: false,
        }
    }
}

/// What came of it.
pub(crate) struct Ran {
    pub(crate) results: Results,
    pub(crate) report: Report,
    /// How many plans there were for each cause.
    pub(crate) causes: BTreeMap<String, u32>,
    /// Its records, if they were to be kept.
    pub(crate) tape: Tape,
}

/// A record of a run.
#[derive(Clone)]
struct Kept {
    time_ns: u64,
    class: RecordClass,
    actor: String,
    kind: String,
    body: Vec<u8>,
}

/// A run that is kept in memory.
#[derive(Clone, Default)]
pub(crate) struct Tape {
    records: Vec<Kept>,
    end_ns: Option<u64>,
}

impl Tape {
    /// Its first records, as if the log were cut behind them.
    pub(crate) fn cut(&self, records: usize) -> Tape {
        let records = self.records.iter().take(records).cloned().collect();
        Tape {
            records,
            end_ns: None,
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.records.len()
    }
}

impl Recording for Tape {
    fn seeds(&self) -> Seeds {
        Seeds { run: 1, problem: 1 }
    }

    fn scenario(&self) -> &str {
        "survey <&>"
    }

    fn excluded(&self) -> &[String] {
        &[]
    }

    fn for_each(
        &self,
        visit: &mut dyn FnMut(&Recorded<'_>) -> Result<(), PictureError>,
    ) -> Result<RecordingEnd, PictureError> {
        for record in &self.records {
            visit(&Recorded {
                time_ns: record.time_ns,
                class: record.class,
                actor: &record.actor,
                kind: &record.kind,
                body: &record.body,
            })?;
        }
        Ok(RecordingEnd {
            time_ns: self.end_ns,
            detail: String::new(),
        })
    }
}

/// Keeps records.
struct Keep {
    run: Option<Arc<RunInfo>>,
    records: Arc<Mutex<Vec<Kept>>>,
}

impl Observer for Keep {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            samples: true,
            checkpoints: false,
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        self.run = Some(run.clone());
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let run = self.run.as_ref().expect("it has begun");
        self.records.lock().expect("nobody panics").push(Kept {
            time_ns: record.time().as_nanos(),
            class: record.class,
            actor: run.name(record.receiver).to_owned(),
            kind: record.kind.map_or("", |kind| kind.name()).to_owned(),
            body: record.body.to_vec(),
        });
        Ok(Flow::Continue)
    }
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
        let mut sim = Simulation::new(self.seed);
        let (assembly, until) = self.set_up(&mut sim, |settings, mut setup| {
            let until = setup.until.expect("it has an end");
            let assembly = settings.assemble(&mut setup);
            let assembly = assembly.map_err(|error| error.to_string())?;
            setup.close().map_err(|error| error.to_string())?;
            Ok((assembly, until))
        })?;
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
        let records = Arc::new(Mutex::new(Vec::new()));
        if self.is_kept {
            sim.observe(Keep {
                run: None,
                records: records.clone(),
            });
        }
        let report = sim.run(self.executor).expect("it runs");
        assert!(!matches!(report.end, End::Fault(_)), "{:?}", report.end);
        let results = (assembly.conclude)(&report);
        let causes = causes.lock().expect("nobody panics").clone();
        let tape = Tape {
            records: std::mem::take(&mut *records.lock().expect("nobody panics")),
            end_ns: Some(report.end_time.as_nanos()),
        };
        Ok(Ran {
            results,
            report,
            causes,
            tape,
        })
    }

    /// A picture of a run that was kept, as SVG.
    pub(crate) fn draw(
        &self,
        tape: &Tape,
        picture: &str,
        request: &PictureRequest,
    ) -> Result<String, String> {
        self.set_up(&mut Simulation::new(self.seed), |settings, mut setup| {
            let figure = settings.draw(picture, tape, request, &mut setup);
            let figure = figure.map_err(|error| error.to_string())?;
            Ok(figure.standalone())
        })
    }

    fn set_up<T>(
        &self,
        sim: &mut Simulation,
        act: impl FnOnce(&dyn Settings, Setup<'_>) -> Result<T, String>,
    ) -> Result<T, String> {
        let mut table: toml::Table =
            toml::from_str(SurveySystem.scenarios()[0].text).expect("it is TOML");
        assert_eq!(table["system"].as_str(), Some(SurveySystem.name()));
        overlay(&mut table, toml::from_str(self.text).expect("it is TOML"));
        let radios = table.remove("radios").map(toml::Value::try_into);
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
        let mut links = LinkBuilder::new(&links, &[]).expect("they are right");
        if let Some(radios) = radios {
            let radios: BTreeMap<String, RadioConfig> = radios.expect("they are radios");
            links.radios(&radios).expect("they are right");
        }
        let mut files = Files::on_disk(".".into());
        let seeds = Seeds {
            run: self.seed,
            problem: self.seed,
        };
        act(
            settings.as_ref(),
            Setup::new(seeds, Some(until), sim, &mut files, links),
        )
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
