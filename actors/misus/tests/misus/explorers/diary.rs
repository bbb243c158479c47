//! Runs surveys without the command, and keeps what rovers' planners recorded.

use std::fmt::Write as _;
use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{Report, RunInfo};
use farside_actors::link::LinksConfig;
use farside_actors::rover::RoverIncident;
use farside_actors::system::{Files, Results, Seeds, Setup, System};
use farside_actors::wiring::LinkBuilder;
use farside_misus::survey::{ActivityBegan, ActivityEnded, PlanMade, SurveySystem};

/// What a planner recorded.
#[derive(Clone, Debug)]
pub(crate) enum Entry {
    Plan(PlanMade),
    Began(ActivityBegan),
    Ended(ActivityEnded),
    Incident(RoverIncident),
}

/// When, who, what.
pub(crate) type Diary = Vec<(SimTime, String, Entry)>;

/// How a run is made.
pub(crate) struct Run<'a> {
    pub(crate) text: &'a str,
    pub(crate) links: &'a str,
    pub(crate) seed: u64,
    pub(crate) hours: u64,
    pub(crate) executor: Executor,
    /// Crashes and restarts: who, when it crashes and when it restarts \[s\].
    pub(crate) crashes: &'a [(&'a str, u64, u64)],
}

/// What came of it.
pub(crate) struct Ran {
    pub(crate) results: Results,
    pub(crate) report: Report,
    pub(crate) diary: Diary,
}

impl Default for Run<'_> {
    fn default() -> Self {
        Run {
            text: "",
            links: "default = { latency = \"50ms\", loss = 0.1 }",
            seed: 1,
            hours: 12,
            executor: Executor::Inline,
            crashes: &[],
        }
    }
}

struct Listen(Arc<Mutex<Diary>>, Vec<String>);

impl Observer for Listen {
    fn wants(&self) -> Wants {
        Wants {
            bodies: false,
            samples: true,
            checkpoints: false,
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        let names = run.entities.iter().map(|one| one.name.to_string());
        self.1 = names.collect();
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let (RecordClass::Sample, Some(kind)) = (record.class, record.kind) else {
            return Ok(Flow::Continue);
        };
        let wrong = |error: farside::encoding::DecodeError| ObserverError(error.to_string());
        let schema = kind.schema();
        let entry = match kind.name() {
            "PlanMade" => Entry::Plan(schema.decode(record.body).map_err(wrong)?),
            "ActivityBegan" => Entry::Began(schema.decode(record.body).map_err(wrong)?),
            "ActivityEnded" => Entry::Ended(schema.decode(record.body).map_err(wrong)?),
            "RoverIncident" => Entry::Incident(schema.decode(record.body).map_err(wrong)?),
            _ => return Ok(Flow::Continue),
        };
        let name = self.1[record.sender.index()].clone();
        let mut diary = self.0.lock().expect("nobody panics");
        diary.push((record.time(), name, entry));
        Ok(Flow::Continue)
    }
}

impl Run<'_> {
    pub(crate) fn run(&self) -> Ran {
        let sections = toml::Deserializer::parse(self.text).expect("it is TOML");
        let settings = SurveySystem.parse(sections).expect("it is a survey");
        settings.check().expect("it is right");
        let links: LinksConfig = toml::from_str(self.links).expect("they are links");
        let links = LinkBuilder::new(&links, &[]).expect("they are right");
        let mut sim = Simulation::new(self.seed);
        let mut files = Files::on_disk(".".into());
        let seeds = Seeds {
            run: self.seed,
            problem: self.seed,
        };
        let until = SimDuration::from_secs(3600 * self.hours);
        let mut setup = Setup::new(seeds, Some(until), &mut sim, &mut files, links);
        let assembly = settings.assemble(&mut setup).expect("it can be built");
        setup.close().expect("all keys match");
        for &(name, crash, restart) in self.crashes {
            let at = SimTime::from_secs;
            sim.crash_named_at(at(crash), name).expect("it is there");
            sim.restart_named_at(at(restart), name)
                .expect("it is there");
        }
        sim.stop_at(SimTime::ZERO + until, "until");
        let diary = Arc::new(Mutex::new(Vec::new()));
        sim.observe(Listen(diary.clone(), Vec::new()));
        let report = sim.run(self.executor).expect("it runs");
        let results = (assembly.conclude)(&report);
        let diary = diary.lock().expect("nobody panics").clone();
        Ran {
            results,
            report,
            diary,
        }
    }
}

/// A diary as text, a line an entry, of one actor or of all.
pub(crate) fn told(diary: &Diary, who: &str) -> String {
    let mut text = String::new();
    for (at, name, entry) in diary.iter().filter(|(_, name, _)| name.contains(who)) {
        let _ = write!(text, "{:7.3} h {name}: ", at.as_secs_f64() / 3600.0);
        let _ = match entry {
            Entry::Plan(plan) => writeln!(
                text,
                "plan {} {:?}: {} activities, score {:.1}, {:.1} m, moved {}, shed {}, {} ops, reserve {:.0}",
                plan.number,
                plan.cause,
                plan.activities.len(),
                plan.score,
                plan.traverse_m,
                plan.moved,
                plan.shed.len(),
                plan.operations,
                plan.reserve_j
            ),
            Entry::Began(began) => writeln!(
                text,
                "  begins {:?} of plan {}, {:.3} to {:.3} h, {:.0} J",
                began.planned.activity,
                began.plan,
                began.planned.starts.as_secs_f64() / 3600.0,
                began.planned.ends.as_secs_f64() / 3600.0,
                began.battery_j
            ),
            Entry::Ended(ended) => writeln!(
                text,
                "  ended {:?} {:?}, {:.0} J planned {:.0} J, {} bit planned {}",
                ended.planned.activity,
                ended.end,
                ended.battery_j,
                ended.planned.battery_j,
                ended.memory_bits,
                ended.planned.memory_bits
            ),
            Entry::Incident(incident) => writeln!(text, "  {incident:?}"),
        };
    }
    text
}
