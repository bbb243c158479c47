//! A small simulation that has everything a log can hold: losses, copies, crashes, changes,
//! timers, keyed messages, messages within a host, samples, messages in flight at the end.

use std::path::Path;

use farside::carrier::{Carriage, Carrier, Parcel, Verdicts};
use farside::prelude::*;
use farside::record::Observer;
use farside_logs::{Attachment, LogOptions, LogWriter};
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize, Clone, Debug, PartialEq)]
pub(crate) enum Terrain {
    Flat,
    Rocky { rocks_per_m2: f64 },
}

#[derive(Serialize, Deserialize, Clone, Debug, PartialEq)]
pub(crate) struct Odometry {
    pub(crate) distance_m: f64,
    pub(crate) path: Vec<(f64, f64)>,
    pub(crate) note: Option<String>,
    pub(crate) terrain: Terrain,
}

#[derive(Serialize, Deserialize)]
pub(crate) struct Ask {
    pub(crate) cycle: u32,
}

#[derive(Serialize, Deserialize)]
pub(crate) struct Heard {
    pub(crate) rover: u32,
}

#[derive(Serialize, Deserialize)]
pub(crate) struct Minute;

#[derive(Serialize, Deserialize)]
pub(crate) struct Pose {
    pub(crate) x: f64,
}

/// Where the rover's wheels slip: a fault to be found by comparison.
#[derive(Clone, Copy, Default)]
pub(crate) struct Slip {
    pub(crate) from_cycle: u32,
    pub(crate) by_m: f64,
}

pub(crate) struct Rover {
    base: Address<Base>,
    slip: Slip,
}

impl Actor for Rover {
    type Accepts = (Ask,);
}

impl Handler<Ask> for Rover {
    fn handle(&mut self, ask: Ask, ctx: &mut Context<'_, Self>) -> Outcome {
        let wheel = ctx.random("wheel_slip").normal(1.0, 0.01);
        let mut distance_m = 0.05 * wheel * ctx.now().as_secs_f64();
        if self.slip.by_m != 0.0 && ask.cycle >= self.slip.from_cycle {
            distance_m += self.slip.by_m;
        }
        let odometry = Odometry {
            distance_m,
            path: vec![(0.0, 0.0), (distance_m, 0.5)],
            note: ask
                .cycle
                .is_multiple_of(2)
                .then(|| format!("cycle {}", ask.cycle)),
            terrain: match ask.cycle % 3 {
                0 => Terrain::Flat,
                rocks => Terrain::Rocky {
                    rocks_per_m2: f64::from(rocks),
                },
            },
        };
        ctx.sample(&Pose { x: distance_m });
        ctx.send_keyed(self.base, MatchKey::new(ask.cycle, 0), odometry);
        Ok(())
    }
}

pub(crate) struct Base {
    rovers: u32,
    cycle: u32,
    cycles: u32,
}

impl Actor for Base {
    type Accepts = (Minute, Odometry);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_secs(60), Minute);
        Ok(())
    }
}

impl Handler<Minute> for Base {
    fn handle(&mut self, _minute: Minute, ctx: &mut Context<'_, Self>) -> Outcome {
        self.cycle += 1;
        if self.cycle > self.cycles {
            ctx.stop("enough cycles");
            return Ok(());
        }
        for rover in 1..=self.rovers {
            let rover = ctx.lookup::<Rover>(&format!("rover_{rover}"))?;
            ctx.send_keyed(
                rover,
                MatchKey::new(self.cycle, 1),
                Ask { cycle: self.cycle },
            );
        }
        ctx.timer(SimDuration::from_secs(60), Minute);
        Ok(())
    }
}

impl Handler<Odometry> for Base {
    fn handle(&mut self, _odometry: Odometry, ctx: &mut Context<'_, Self>) -> Outcome {
        let log = ctx.lookup::<Recorder>("recorder")?;
        ctx.send(log, Heard { rover: 1 });
        Ok(())
    }
}

pub(crate) struct Recorder;

impl Actor for Recorder {
    type Accepts = (Heard,);
}

impl Handler<Heard> for Recorder {
    fn handle(&mut self, _heard: Heard, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

/// Loses some messages, doubles others.
pub(crate) struct Lossy {
    loss: f64,
    delay: SimDuration,
}

impl Lossy {
    /// As if jitter had halved a longer way.
    pub(crate) fn carriage(&self) -> Carriage {
        Carriage {
            propagation: self.delay * 2,
            jitter_ns: -(self.delay.as_nanos() as i64),
            attempts: 1,
            energy_j: 0.125,
            ..Carriage::default()
        }
    }
}

#[derive(Serialize, Deserialize)]
pub(crate) struct NewLoss {
    pub(crate) loss: f64,
}

impl Carrier for Lossy {
    type Change = NewLoss;

    fn min_delay(&self) -> SimDuration {
        self.delay
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        let draw = parcel.random(1, 0, 0).uniform();
        if draw < self.loss {
            verdicts.lose("loss");
        } else {
            verdicts.deliver_as(self.delay, self.carriage());
            if draw > 0.95 {
                verdicts.deliver(self.delay * 2);
            }
        }
    }

    fn change(&mut self, change: NewLoss, _now: SimTime) {
        self.loss = change.loss;
    }
}

#[derive(Clone)]
pub(crate) struct Plan {
    pub(crate) seed: u64,
    pub(crate) rovers: u32,
    pub(crate) cycles: u32,
    pub(crate) loss: f64,
    pub(crate) slip: Slip,
    pub(crate) crash: bool,
}

impl Default for Plan {
    fn default() -> Self {
        Plan {
            seed: 7,
            rovers: 3,
            cycles: 20,
            loss: 0.2,
            slip: Slip::default(),
            crash: true,
        }
    }
}

pub(crate) fn build(plan: &Plan) -> Simulation {
    let mut sim = Simulation::new(plan.seed);
    let earth = sim.host("earth");
    let cycles = plan.cycles;
    let rovers = plan.rovers;
    let base = sim.actor(earth, "base", move |_| Base {
        rovers,
        cycle: 0,
        cycles,
    });
    sim.actor(earth, "recorder", |_| Recorder);
    let slip = plan.slip;
    for rover in 1..=plan.rovers {
        let host = sim.host(&format!("moon_{rover}"));
        let name = format!("rover_{rover}");
        let address = sim.actor(host, &name, move |_| Rover { base, slip });
        let link = || Lossy {
            loss: plan.loss,
            delay: SimDuration::from_millis(1300),
        };
        let up = sim.link(earth, host, &format!("up_{rover}"), link());
        sim.link(host, earth, &format!("down_{rover}"), link());
        if plan.crash && rover == 1 {
            sim.crash_at(SimTime::ZERO + SimDuration::from_secs(300), address);
            sim.restart_at(SimTime::ZERO + SimDuration::from_secs(500), address);
            sim.change_at(
                SimTime::ZERO + SimDuration::from_secs(600),
                up,
                NewLoss { loss: 0.5 },
            );
        }
    }
    sim
}

pub(crate) fn options() -> LogOptions {
    LogOptions {
        scenario: "tests/base_and_rovers".to_owned(),
        resolved: "rovers = 3\n".to_owned(),
        code_version: "test".to_owned(),
        attachments: vec![Attachment {
            name: "map.txt".to_owned(),
            media_type: "text/plain".to_owned(),
            bytes: b"....\n.@..\n".to_vec(),
        }],
        ..LogOptions::default()
    }
}

pub(crate) fn run_with(plan: &Plan, observer: impl Observer + 'static) -> Report {
    let mut sim = build(plan);
    sim.observe(observer);
    sim.run(Executor::Inline).expect("the simulation starts")
}

pub(crate) fn log_to(path: &Path, plan: &Plan, options: LogOptions) -> Report {
    let writer = LogWriter::create(path, options).expect("the log can be created");
    run_with(plan, writer)
}

/// The log of a run that sees everything, in a folder of its own.
pub(crate) fn logged(plan: &Plan) -> (tempfile::TempDir, std::path::PathBuf, Report) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    let report = log_to(&path, plan, options());
    (folder, path, report)
}
