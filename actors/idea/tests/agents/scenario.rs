//! Scenarios of the whole system, as the command would run them, with what agents said.

use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{End, Report, RunInfo};
use farside_actors::link::{Degrade, LinksConfig};
use farside_actors::rover::{CommandEnd, CommandReport};
use farside_actors::system::{Assembly, Files, Results, Seeds, Settings, Setup, System};
use farside_actors::units;
use farside_actors::wiring::LinkBuilder;
use farside_idea::IdeaSystem;
use farside_idea::records::{AgentFaulty, AgentRemark, GoalEnded, TimelineSays};

/// A scenario that is read.
pub(crate) struct Scenario {
    pub(crate) settings: Box<dyn Settings>,
    pub(crate) until: SimDuration,
    links: LinksConfig,
    degrades: Vec<Degrade>,
}

impl Scenario {
    /// Reads a scenario's text as the command does.
    pub(crate) fn read(text: &str) -> Scenario {
        let mut table: toml::Table = toml::from_str(text).expect("it is TOML");
        let take = |table: &mut toml::Table, key: &str| table.remove(key);
        let links = take(&mut table, "links").unwrap_or_else(|| toml::Table::new().into());
        let degrades =
            take(&mut table, "degrade").unwrap_or_else(|| Vec::<toml::Value>::new().into());
        let until = take(&mut table, "until").expect("it ends");
        for key in ["system", "description", "seed"] {
            take(&mut table, key);
        }
        let text = toml::to_string(&table).expect("it was TOML");
        let sections = toml::Deserializer::parse(&text).expect("it was TOML");
        let settings = IdeaSystem.parse(sections).expect("these are its keys");
        settings.check().expect("they are in their ranges");
        Scenario {
            settings,
            until: units::duration::deserialize(until).expect("it is a duration"),
            links: links.try_into().expect("they are links"),
            degrades: degrades.try_into().expect("they are degradations"),
        }
    }

    /// Hands out what the system is built from, for a run or for a picture.
    pub(crate) fn set_up<T>(
        &self,
        seed: u64,
        sim: &mut Simulation,
        build: impl FnOnce(&dyn Settings, Setup<'_>) -> T,
    ) -> T {
        let mut files = Files::on_disk(".".into());
        let links = LinkBuilder::new(&self.links, &self.degrades).expect("they are right");
        let seeds = Seeds {
            run: seed,
            problem: seed,
        };
        let setup = Setup::new(seeds, Some(self.until), sim, &mut files, links);
        build(&*self.settings, setup)
    }

    /// Puts the system together.
    pub(crate) fn assemble(&self, seed: u64, sim: &mut Simulation) -> Assembly {
        self.set_up(seed, sim, |settings, mut setup| {
            let assembly = settings.assemble(&mut setup).expect("it can be");
            let remarks = setup.close().expect("all keys match");
            assert!(remarks.is_empty(), "{remarks:?}");
            assembly
        })
    }
}

/// What came of a run.
pub(crate) struct Run {
    pub(crate) results: Results,
    pub(crate) report: Report,
    pub(crate) said: Vec<Said>,
}

/// Something that an actor recorded.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Said {
    pub(crate) at: SimTime,
    pub(crate) who: String,
    pub(crate) what: What,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum What {
    Says(TimelineSays),
    Ended(GoalEnded),
    Remark(String),
    /// The tick, and why.
    Faulty(u64, String),
    /// Any other sample that is no cycle, by its type.
    Other(String),
}

struct Listen {
    run: Option<Arc<RunInfo>>,
    said: Arc<Mutex<Vec<Said>>>,
}

impl Observer for Listen {
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
        let (Some(run), Some(kind)) = (&self.run, record.kind) else {
            return Ok(Flow::Continue);
        };
        let schema = kind.schema();
        let is_report = kind.name() == "CommandReport" && record.class == RecordClass::Delivered;
        if record.class != RecordClass::Sample && !is_report {
            return Ok(Flow::Continue);
        }
        let what = match kind.name() {
            "AgentCycle" | "RoverPose" | "RoverResources" => return Ok(Flow::Continue),
            "TimelineSays" => What::Says(schema.decode(record.body).expect("it is one")),
            "GoalEnded" => What::Ended(schema.decode(record.body).expect("it is one")),
            "AgentRemark" => {
                let remark: AgentRemark = schema.decode(record.body).expect("it is one");
                What::Remark(remark.text)
            }
            "CommandReport" => {
                let report: CommandReport = schema.decode(record.body).expect("it is one");
                match report.end {
                    CommandEnd::Done => return Ok(Flow::Continue),
                    end => What::Remark(format!("{:?}: {end:?}", report.part)),
                }
            }
            "AgentFaulty" => {
                let faulty: AgentFaulty = schema.decode(record.body).expect("it is one");
                What::Faulty(faulty.tick, faulty.reason)
            }
            other => What::Other(other.to_owned()),
        };
        let who = run.name(record.sender).to_owned();
        let said = Said {
            at: record.time(),
            who,
            what,
        };
        self.said.lock().expect("nobody panics").push(said);
        Ok(Flow::Continue)
    }
}

impl Run {
    /// A scenario with a seed; `plan` adds to it what no key says.
    pub(crate) fn of(text: &str, seed: u64, plan: impl FnOnce(&mut Simulation)) -> Run {
        let scenario = Scenario::read(text);
        let mut sim = Simulation::new(seed);
        let assembly = scenario.assemble(seed, &mut sim);
        let until = scenario.until;
        sim.stop_at(SimTime::ZERO + until, "until");
        plan(&mut sim);
        let said = Arc::new(Mutex::new(Vec::new()));
        sim.observe(Listen {
            run: None,
            said: said.clone(),
        });
        let report = sim.run(Executor::Inline).expect("it runs");
        assert!(!matches!(report.end, End::Fault(_)), "{:?}", report.end);
        let results = (assembly.conclude)(&report);
        let said = std::mem::take(&mut *said.lock().expect("nobody panics"));
        Run {
            results,
            report,
            said,
        }
    }

    /// A figure.
    pub(crate) fn figure(&self, metric: &str) -> f64 {
        let value = &self.results.metrics[metric];
        value
            .as_f64()
            .unwrap_or_else(|| panic!("{metric} is {value}"))
    }

    /// What a timeline of an agent said, in order.
    pub(crate) fn of_timeline(&self, who: &str, timeline: &str) -> Vec<(SimTime, String)> {
        let mine = |said: &Said| match &said.what {
            What::Says(says) if said.who == who && says.timeline == timeline => {
                Some((said.at, says.says.clone()))
            }
            _ => None,
        };
        self.said.iter().filter_map(mine).collect()
    }

    /// All of it, for people.
    pub(crate) fn print(&self) {
        for said in &self.said {
            println!("{} {} {:?}", said.at, said.who, said.what);
        }
        for (label, text) in &self.results.summary {
            println!("{label}: {text}");
        }
        println!("{:?} {:?}", self.report.end, self.results.violations);
    }
}

/// What is said of a scenario that cannot be.
pub(crate) fn refused(text: &str) -> String {
    let mut table: toml::Table = toml::from_str(text).expect("it is TOML");
    let links = table
        .remove("links")
        .unwrap_or_else(|| toml::Table::new().into());
    let links: LinksConfig = links.try_into().expect("they are links");
    for key in ["system", "description", "seed", "until"] {
        table.remove(key);
    }
    let text = toml::to_string(&table).expect("it was TOML");
    let sections = toml::Deserializer::parse(&text).expect("it was TOML");
    let settings = match IdeaSystem.parse(sections) {
        Ok(settings) => settings,
        Err(error) => return error.message().to_owned(),
    };
    if let Err(error) = settings.check() {
        return error.to_string();
    }
    let mut sim = Simulation::new(1);
    let mut files = Files::on_disk(".".into());
    let links = LinkBuilder::new(&links, &[]).expect("they are right");
    let (seeds, until) = (
        Seeds { run: 1, problem: 1 },
        Some(SimDuration::from_secs(60)),
    );
    let mut setup = Setup::new(seeds, until, &mut sim, &mut files, links);
    match settings.assemble(&mut setup) {
        Ok(_) => "nothing".to_owned(),
        Err(error) => error.to_string(),
    }
}
