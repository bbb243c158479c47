//! A relay with the hardware of a K9: what a register says happens to the rover, and what the rover is
//! like comes back.

use std::sync::Mutex;

use farside::prelude::*;
use farside_actors::rover::{
    FaultConfig, FaultKind, RoverConfig, RoverHardware, RoverSite, RoverSpec, RoverStart,
    add_hardware, hardware_name,
};
use farside_worlds::rock_field::FieldRocks;
use farside_worlds::{RockField, RockFieldSettings, Sky};
use serde::{Deserialize, Serialize};

use super::*;

/// The seconds at which something is said, by which register, with which inputs.
type Line = (u64, usize, &'static str, &'static [i64]);

/// What a contract ended with, and when.
type Said = Arc<Mutex<Vec<(f64, usize, Vec<Option<RegisterValue>>)>>>;

/// A relay that is told what to say by a list, and is asked for the pitch twice a second.
struct Scripted {
    relay: Relay,
    lines: &'static [Line],
    contracts: u32,
    said: Said,
}

/// Timer: a line of the list.
#[derive(Serialize, Deserialize)]
struct Speak {
    line: u32,
}

/// Timer: the pitch is to be measured.
#[derive(Serialize, Deserialize)]
struct Poll;

impl Scripted {
    fn load(
        &mut self,
        register: usize,
        says: &str,
        inputs: &[RegisterValue],
        ctx: &mut Context<'_, Self>,
    ) -> Outcome {
        self.contracts += 1;
        let (now, contract) = (ctx.now(), (1, self.contracts));
        let mut out = Vec::new();
        self.relay
            .load(now, register, contract, says, inputs, &mut out);
        self.send(out, ctx)
    }

    fn send(&mut self, out: Vec<RelayAct>, ctx: &mut Context<'_, Self>) -> Outcome {
        let hardware = ctx.lookup::<RoverHardware>(&hardware_name("k9"))?;
        for act in out {
            match act {
                RelayAct::Command(command) => ctx.send(hardware, command),
                RelayAct::Query(query) => ctx.send(hardware, query),
                RelayAct::Status {
                    register, outputs, ..
                } => {
                    let at_s = ctx.now().since(SimTime::ZERO).as_secs_f64();
                    self.said.lock().unwrap().push((at_s, register, outputs));
                }
            }
        }
        Ok(())
    }
}

impl Actor for Scripted {
    type Accepts = (Speak, Poll, CommandReport, RoverState);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        for (line, (at_s, ..)) in (0..).zip(self.lines) {
            ctx.timer(SimDuration::from_secs(*at_s), Speak { line });
        }
        ctx.timer(SimDuration::from_millis(500), Poll);
        Ok(())
    }
}

impl Handler<Speak> for Scripted {
    fn handle(&mut self, speak: Speak, ctx: &mut Context<'_, Self>) -> Outcome {
        let (_, register, says, inputs) = self.lines[speak.line as usize];
        let is_truth = register == FANS;
        let value = |&input: &i64| match is_truth {
            true => RegisterValue::Truth(input != 0),
            false => number(input),
        };
        let inputs: Vec<RegisterValue> = inputs.iter().map(value).collect();
        self.load(register, says, &inputs, ctx)
    }
}

impl Handler<Poll> for Scripted {
    fn handle(&mut self, _poll: Poll, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_millis(500), Poll);
        self.load(PITCH, "PitchMeasure", &[number(0)], ctx)
    }
}

impl Handler<CommandReport> for Scripted {
    fn handle(&mut self, report: CommandReport, ctx: &mut Context<'_, Self>) -> Outcome {
        let mut out = Vec::new();
        self.relay.report(&report, &mut out);
        self.send(out, ctx)
    }
}

impl Handler<RoverState> for Scripted {
    fn handle(&mut self, state: RoverState, ctx: &mut Context<'_, Self>) -> Outcome {
        let mut out = Vec::new();
        self.relay.state(&state, &mut out);
        self.send(out, ctx)
    }
}

/// Runs a K9 with these faults by a list for so many seconds; what was said.
fn run(lines: &'static [Line], faults: &[FaultConfig], lasts_s: u64) -> Said {
    let settings = RockFieldSettings {
        hills: 0,
        rocks: FieldRocks::Exactly(1),
        seed: 5,
        ..RockFieldSettings::default()
    };
    let mut config = RoverConfig::named("k9").expect("a model");
    config.faults = faults.to_vec();
    config.bay.start_k = 320.0;
    let spec = RoverSpec {
        number: 0,
        name: "k9".to_owned(),
        config,
        site: RoverSite {
            ground: Arc::new(RockField::generate(&settings).expect("within its ranges")),
            sky: Sky::new(-14.6, 270.0, 0.5).expect("within its ranges"),
            starts_s: 40_000.0,
        },
        start: RoverStart {
            east_m: 0.0,
            north_m: 0.0,
            yaw_rad: 0.0,
        },
        seed: 1,
        until: SimDuration::from_secs(lasts_s),
    };
    let said = Said::default();
    let mut sim = Simulation::new(1);
    let host = sim.host("k9");
    let (table, told) = (Arc::new(table()), said.clone());
    let relay = sim.actor(host, "k9/relay", move |_| Scripted {
        relay: Relay::new(table.clone()),
        lines,
        contracts: 0,
        said: told.clone(),
    });
    add_hardware(&mut sim, host, spec, relay).expect("a rover on its terrain");
    sim.stop_at(SimTime::from_secs(lasts_s), "enough");
    sim.run(Executor::Inline).unwrap();
    said
}

/// What the register last said before a time \[s\]: the number in the output at a place.
fn last(said: &Said, register: usize, place: usize, before_s: f64) -> i64 {
    let said = said.lock().unwrap();
    let of_it = |one: &&(f64, usize, _)| one.1 == register && one.0 < before_s;
    let (_, _, outputs) = said.iter().rfind(of_it).expect("it said something");
    match &outputs[place] {
        Some(RegisterValue::Number(number)) => *number,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_tilt_is_seen_outlasts_backing_up_and_is_driven_off() {
    let rock = FaultConfig {
        at: SimDuration::from_secs(10),
        kind: FaultKind::RockUnderWheel,
        part: Some("front".to_owned()),
        amount: Some(0.5),
        distance_m: Some(1.5),
        ..FaultConfig::default()
    };
    let said = run(
        &[
            (1, LOCATION, "DriveTo", &[50, 0]),
            (12, LOCATION, "Stop", &[]),
            (13, LOCATION, "BackUp", &[8]),
            (40, LOCATION, "TurnInPlace", &[30]),
            (80, LOCATION, "DriveTo", &[50, 0]),
        ],
        &[rock],
        240,
    );
    let pitch = |before_s| last(&said, PITCH, 1, before_s);
    assert!(pitch(9.9).abs() <= 2);
    // Half a metre over a base of 85 cm: 30 degrees, and a little for the ground.
    for after_s in [11.0, 20.0, 39.0, 79.0] {
        assert!((28..=33).contains(&pitch(after_s)), "{}", pitch(after_s));
    }
    assert!(pitch(240.0).abs() <= 2);
    let said = said.lock().unwrap();
    let ends: Vec<_> = said.iter().filter(|one| one.1 == LOCATION).collect();
    // The first drive's contract was over when it was stopped.
    assert_eq!(ends.len(), 4);
    assert!(ends.iter().all(|(_, _, outputs)| *outputs == status("ok")));
    // Asked and answered twice a second, for all that time.
    let polls = said.iter().filter(|one| one.1 == PITCH).count();
    assert_eq!(polls, 479);
}

#[test]
fn fans_cool_the_bay_as_they_are_told() {
    let polled: &[Line] = &[
        (1, TEMPERATURE, "TempReadCompare", &[]),
        (3600, TEMPERATURE, "TempReadCompare", &[]),
    ];
    let cooled: &[Line] = &[
        (1, TEMPERATURE, "TempReadCompare", &[]),
        (2, FANS, "DeviceSetFanState", &[1]),
        (3600, TEMPERATURE, "TempReadCompare", &[]),
    ];
    let ends_c = [polled, cooled].map(|lines| {
        let said = run(lines, &[], 3700);
        assert!((46..=48).contains(&last(&said, TEMPERATURE, 1, 2.0)));
        last(&said, TEMPERATURE, 1, 3700.0)
    });
    assert!(ends_c[1] + 4 < ends_c[0], "{ends_c:?}");
}
