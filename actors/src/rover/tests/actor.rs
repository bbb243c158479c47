//! The hardware in a simulation: a controller beside it, crashes, links that take energy, and what
//! idle rovers cost.

use std::sync::{Arc, Mutex};

use farside::carrier::{Carriage, NoChange};
use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{Carrier, Parcel, Report, RunInfo, Verdicts};
use serde::{Deserialize, Serialize};

use super::*;

/// A controller that gives each command of a list at its time, and keeps what it is told.
struct Script {
    rover: String,
    plan: Vec<(u64, Command)>,
    log: Arc<Mutex<Vec<(SimTime, CommandReport)>>>,
}

#[derive(Serialize, Deserialize)]
struct Turn {
    number: u32,
}

impl Actor for Script {
    type Accepts = (Turn, CommandReport, RoverState);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        for (number, (at_s, _)) in (0..).zip(&self.plan) {
            ctx.timer(SimDuration::from_secs(*at_s), Turn { number });
        }
        Ok(())
    }
}

impl Handler<Turn> for Script {
    fn handle(&mut self, turn: Turn, ctx: &mut Context<'_, Self>) -> Outcome {
        let hardware = ctx.lookup::<RoverHardware>(&hardware_name(&self.rover))?;
        let command = self.plan[turn.number as usize].1.clone();
        ctx.send(
            hardware,
            RoverCommand {
                id: turn.number,
                command,
            },
        );
        Ok(())
    }
}

impl Handler<CommandReport> for Script {
    fn handle(&mut self, report: CommandReport, ctx: &mut Context<'_, Self>) -> Outcome {
        self.log.lock().unwrap().push((ctx.now(), report));
        Ok(())
    }
}

impl Handler<RoverState> for Script {
    fn handle(&mut self, _state: RoverState, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

type Told = Arc<Mutex<Vec<(SimTime, CommandReport)>>>;

/// A rover and its controller on one host.
fn add(sim: &mut Simulation, spec: RoverSpec, plan: &[(u64, Command)]) -> (HostId, Told) {
    let host = sim.host(&spec.name);
    let log = Told::default();
    let (rover, plan, told) = (spec.name.clone(), plan.to_vec(), log.clone());
    let name = format!("{rover}/controller");
    let controller = sim.actor(host, &name, move |_| Script {
        rover: rover.clone(),
        plan: plan.clone(),
        log: told.clone(),
    });
    add_hardware(sim, host, spec, controller).expect("a rover on its terrain");
    (host, log)
}

/// What the samples of one rover say.
#[derive(Clone, Default, PartialEq, Debug)]
struct Sampled {
    resources: RoverResources,
    pose: RoverPose,
    /// The greatest share of all energy that was not accounted for.
    imbalance: f64,
    incidents: Vec<RoverIncident>,
}

/// Watches the samples of a rover's hardware.
fn watch(sim: &mut Simulation, rover: &str) -> Arc<Mutex<Sampled>> {
    let sampled: Arc<Mutex<Sampled>> = Arc::default();
    let name = hardware_name(rover);
    let into = sampled.clone();
    let entity = 0;
    sim.observe(Samples { name, entity, into });
    sampled
}

struct Samples {
    name: String,
    entity: usize,
    into: Arc<Mutex<Sampled>>,
}

impl Observer for Samples {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            samples: true,
            checkpoints: false,
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        let place = run.entities.iter().position(|one| one.name == self.name);
        self.entity = place.expect("the hardware");
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let of_it = record.sender.index() == self.entity;
        let Some(kind) = record
            .kind
            .filter(|_| of_it && record.class == RecordClass::Sample)
        else {
            return Ok(Flow::Continue);
        };
        let (schema, body) = (kind.schema(), record.body);
        let mut sampled = self.into.lock().unwrap();
        match kind.name() {
            "RoverResources" => {
                sampled.resources = schema.decode(body).unwrap();
                let energy = sampled.resources.energy;
                let share = energy.imbalance_j().abs() / energy.total_j();
                sampled.imbalance = sampled.imbalance.max(share);
            }
            "RoverPose" => sampled.pose = schema.decode(body).unwrap(),
            "RoverIncident" => sampled.incidents.push(schema.decode(body).unwrap()),
            other => panic!("{other}"),
        }
        Ok(Flow::Continue)
    }
}

fn config() -> RoverConfig {
    let mut config = RoverConfig::named("mer").expect("a model");
    config.lease = SimDuration::ZERO;
    config
}

fn fault(at_s: u64, kind: FaultKind, part: Option<&str>) -> FaultConfig {
    FaultConfig {
        at: SimDuration::from_secs(at_s),
        kind,
        part: part.map(str::to_owned),
        duration: Some(SimDuration::from_secs(500)),
        ..FaultConfig::default()
    }
}

#[test]
fn a_rover_that_cannot_be_is_refused() {
    let refused = |edit: fn(&mut RoverSpec)| {
        let mut sim = Simulation::new(1);
        let host = sim.host("rover_03");
        let controller = sim.actor(host, "rover_03/controller", |_| Script {
            rover: String::new(),
            plan: Vec::new(),
            log: Told::default(),
        });
        let mut spec = spec(level_field(1), config());
        edit(&mut spec);
        add_hardware(&mut sim, host, spec, controller)
            .unwrap_err()
            .to_string()
    };
    let error = refused(|spec| spec.start.east_m = 51.0);
    assert!(
        error.starts_with("rover_03: starts at (51, 0) m: expected"),
        "{error}"
    );
    assert!(refused(|spec| spec.start.north_m = f64::NAN).contains("(0, NaN) m"));
    assert!(refused(|spec| spec.site.starts_s = f64::INFINITY).contains("starts_s: inf"));
    assert!(refused(|spec| spec.config.recovery = 0.0).starts_with("rover.recovery"));
}

#[test]
fn a_stop_is_obeyed_in_one_event() {
    let mut sim = Simulation::new(1);
    let plan = [(0, drive(5.0, 0.0)), (30, STOP)];
    let (_, told) = add(&mut sim, spec(level_field(1), config()), &plan);
    let after: Arc<Mutex<Vec<RecordClass>>> = Arc::default();
    let seen = after.clone();
    sim.observe(move |record: &Record<'_>| {
        if record.time() == SimTime::from_secs(30) {
            seen.lock().unwrap().push(record.class);
        }
    });
    sim.stop_at(SimTime::from_secs(3600), "enough");
    sim.run(Executor::Inline).unwrap();
    let told = told.lock().unwrap();
    let at = SimTime::from_secs(30);
    let ends: Vec<_> = told
        .iter()
        .map(|(time, report)| (*time, &report.end))
        .collect();
    assert_eq!(ends, [(at, &stopped()), (at, &CommandEnd::Done)]);
    // The controller's timer, the command, two reports: the rover stands in the second of four.
    let (timer, delivered) = (RecordClass::Timer, RecordClass::Delivered);
    assert_eq!(
        *after.lock().unwrap(),
        [timer, delivered, delivered, delivered]
    );
}

/// What a rover had at the end of a run, and how many of its commands ended in which way.
#[derive(Debug, PartialEq)]
struct Ended {
    sampled: Sampled,
    done: usize,
    failed: usize,
}

/// Every kind of fault in one run of three sols, on two rovers that are kept busy.
fn troubled(executor: Executor) -> (Report, [Ended; 2], Vec<String>) {
    let mut sim = Simulation::new(4);
    let mut config = config();
    for (number, kind) in (0..).zip(FaultKind::ALL) {
        config.faults.push(fault(1000 + 2000 * number, kind, None));
    }
    config.fault_rates.dust = 1.0;
    let mut plan = Vec::new();
    for round in 0..40 {
        let at_s = 700 * round;
        let metre = (round % 7) as f64;
        plan.push((at_s, drive(metre, -metre)));
        plan.push((at_s + 300, down()));
        plan.push((at_s + 400, image(View::Point)));
        plan.push((at_s + 500, spectrum(View::Point)));
    }
    let field = level_field(60);
    let mut watched = Vec::new();
    for number in 3..5 {
        let spec = RoverSpec {
            number,
            name: format!("rover_{number:02}"),
            seed: 4,
            ..spec(field.clone(), config.clone())
        };
        let sampled = watch(&mut sim, &spec.name);
        let (host, reports) = add(&mut sim, spec, &plan);
        sim.heavy(host);
        watched.push((sampled, reports));
    }
    let told: Arc<Mutex<Vec<String>>> = Arc::default();
    let seen = told.clone();
    sim.observe(move |record: &Record<'_>| {
        if record.class == RecordClass::Told {
            let kind = record
                .kind
                .map(|kind| kind.name().to_owned())
                .unwrap_or_default();
            seen.lock().unwrap().push(kind);
        }
    });
    sim.stop_at(SimTime::from_secs(3 * 88_775), "three sols");
    let report = sim.run(executor).unwrap();
    let told = told.lock().unwrap().clone();
    let ended = [0, 1].map(|rover: usize| {
        let (sampled, reports) = &watched[rover];
        let reports = reports.lock().unwrap();
        let count = |which: fn(&CommandEnd) -> bool| {
            let ends = reports.iter().map(|(_, report)| &report.end);
            ends.filter(|end| which(end)).count()
        };
        Ended {
            sampled: sampled.lock().unwrap().clone(),
            done: count(|end| matches!(end, CommandEnd::Done)),
            failed: count(|end| matches!(end, CommandEnd::Failed { .. })),
        }
    });
    (report, ended, told)
}

#[test]
fn faults_are_told_end_no_run_and_change_no_executor() {
    let (report, ended, told) = troubled(Executor::Inline);
    assert_eq!(report.end.name(), "stopped");
    let begun = told
        .iter()
        .filter(|kind| kind.ends_with("FaultBegins"))
        .count();
    assert!(begun >= 2 * FaultKind::ALL.len());
    for ended in &ended {
        assert!(ended.failed > 0 && ended.done > 20, "{ended:?}");
        let imbalance = ended.sampled.imbalance;
        assert!(imbalance <= 1e-9, "{imbalance}");
    }
    assert_ne!(ended[0], ended[1]);
    let (again, ..) = troubled(Executor::Kameo { threads: 2 });
    assert_eq!(again.digest, report.digest);
    assert_eq!(again.counts, report.counts);
}

#[test]
fn ten_sols_of_three_idle_rovers_are_cheap() {
    let mut sim = Simulation::new(1);
    let field = level_field(90);
    let mut watched = Vec::new();
    for number in 0..3 {
        let spec = RoverSpec {
            number,
            name: format!("rover_{number:02}"),
            ..spec(field.clone(), config())
        };
        watched.push(watch(&mut sim, &spec.name));
        add(&mut sim, spec, &[]);
    }
    #[derive(Default)]
    struct Seen {
        records: u64,
        bytes: u64,
    }
    let seen: Arc<Mutex<Seen>> = Arc::default();
    sim.observe(Bytes(seen.clone()));
    sim.stop_at(SimTime::from_secs(10 * 88_775), "ten sols");
    let report = sim.run(Executor::Inline).unwrap();
    let seen = seen.lock().unwrap();
    // 49.3 records of the state a sol, of two samples each, and looks at the battery.
    let events = report.counts.events as f64 / 30.0;
    assert!(
        (49.0..54.0).contains(&events),
        "{events} events for each rover and sol"
    );
    let bytes = seen.bytes as f64 / 10.0;
    assert!(
        bytes < 100_000.0,
        "{bytes} bytes a sol, in {} records",
        seen.records
    );
    for sampled in watched {
        let sampled = sampled.lock().unwrap();
        assert!(sampled.imbalance <= 1e-9 && sampled.incidents.is_empty());
        let energy = sampled.resources.energy;
        assert!(energy.not_taken_j > 0.0 && energy.heater_j > 0.0);
    }

    struct Bytes(Arc<Mutex<Seen>>);
    impl Observer for Bytes {
        fn wants(&self) -> Wants {
            Wants {
                bodies: true,
                samples: true,
                checkpoints: false,
            }
        }
        fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
            let mut seen = self.0.lock().unwrap();
            seen.records += 1;
            seen.bytes += record.body.len() as u64;
            Ok(Flow::Continue)
        }
    }
}

/// Takes energy from the sender and from the receiver.
#[derive(Clone)]
struct Costly;

impl Carrier for Costly {
    type Change = NoChange;

    fn min_delay(&self) -> SimDuration {
        SimDuration::from_millis(10)
    }

    fn carry(&mut self, _parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        let carriage = Carriage {
            propagation: self.min_delay(),
            attempts: 1,
            energy_j: 50.0,
            receive_j: 7.0,
            ..Carriage::default()
        };
        verdicts.deliver_as(self.min_delay(), carriage);
        verdicts.charge(50.0);
    }

    fn change(&mut self, _change: NoChange, _now: SimTime) {}
}

/// Sends to whoever accepts it, ten times.
struct Chatter(&'static str);

#[derive(Serialize, Deserialize)]
struct Word {
    number: u32,
}

impl Actor for Chatter {
    type Accepts = (Word,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let other = ctx.lookup::<Chatter>(self.0)?;
        for number in 0..10 {
            ctx.send(other, Word { number });
        }
        Ok(())
    }
}

impl Handler<Word> for Chatter {
    fn handle(&mut self, _word: Word, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

#[test]
fn what_links_charge_the_host_comes_from_the_battery() {
    let mut sim = Simulation::new(1);
    let rover = spec(level_field(1), config());
    let sampled = watch(&mut sim, &rover.name);
    let (host, _) = add(&mut sim, rover, &[]);
    let base = sim.host("base");
    sim.actor(host, "rover_03/chatter", |_| Chatter("base/chatter"));
    sim.actor(base, "base/chatter", |_| Chatter("rover_03/chatter"));
    sim.link(host, base, "rover_03-base", Costly);
    sim.link(base, host, "base-rover_03", Costly);
    sim.stop_at(SimTime::from_secs(7200), "two hours");
    sim.run(Executor::Inline).unwrap();
    let energy = sampled.lock().unwrap().resources.energy;
    assert_eq!(energy.links_j, 570.0);
    assert!(energy.imbalance_j().abs() <= 1e-9 * energy.total_j());
}

#[test]
fn a_crash_of_the_computer_stops_the_rover_and_forgets_no_metal() {
    let mut sim = Simulation::new(1);
    let mut config = config();
    config.faults.push(fault(250, FaultKind::ExtraPower, None));
    let plan = [
        (0, down()),
        (100, image(View::Point)),
        (180, drive(10.0, 0.0)),
    ];
    let rover = spec(level_field(1), config);
    let sampled = watch(&mut sim, &rover.name);
    let (host, told) = add(&mut sim, rover, &plan);
    sim.crash_host_at(SimTime::from_secs(230), host);
    sim.restart_host_at(SimTime::from_secs(400), host);
    sim.stop_at(SimTime::from_secs(405), "seen enough");
    sim.run(Executor::Inline).unwrap();
    let sampled = sampled.lock().unwrap().clone();
    // The leg that was under way at 230 s ended at 3 m, within the slip's draws.
    let driven_m = sampled.pose.driven_m;
    assert!((2.9..3.1).contains(&driven_m), "{driven_m}");
    assert_eq!(sampled.resources.memory_used_bytes, 1_000_000);
    // Told in vain at 250 s, found at the restart.
    assert_eq!(sampled.resources.energy.fault_j, 150.0 * 20.0);
    // Nobody was told of the drive; the controller began again, and points the mast once more.
    let ids: Vec<u32> = told
        .lock()
        .unwrap()
        .iter()
        .map(|(_, report)| report.id)
        .collect();
    assert_eq!(ids, [0, 1, 0]);
}
