//! The relay as an actor, between an agent that says what a test has it say and hardware that drives for
//! three seconds.

use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside_actors::rover::{
    Command, CommandEnd, CommandReport, PoseEstimate, RoverCommand, RoverQuery, hardware_name,
};
use farside_idea::models;
use farside_idea::register::{
    Acknowledged, AgentOffline, Backoff, RegisterAck, RegisterLoad, RegisterStatus, RegisterValue,
};
use farside_idea::relay::{RelayActor, RelaySetup, RelayTable};
use serde::{Deserialize, Serialize};

const REGISTER: &str = "Location_SV";

/// What the agent says.
#[derive(Clone, Copy)]
enum Say {
    /// A drive, by its number.
    Drive(u32),
    /// It has heard the first status of the first drive.
    Heard,
    /// It is faulty.
    Offline,
}

struct Script(Vec<(u64, Say)>);

#[derive(Serialize, Deserialize)]
struct Due(usize);

impl Actor for Script {
    type Accepts = (RegisterStatus, RegisterAck, Due);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        for (place, (at_ms, _)) in self.0.iter().enumerate() {
            ctx.timer(SimDuration::from_millis(*at_ms), Due(place));
        }
        Ok(())
    }
}

impl Handler<Due> for Script {
    fn handle(&mut self, due: Due, ctx: &mut Context<'_, Self>) -> Outcome {
        let (register, epoch) = (REGISTER.into(), 1);
        match self.0[due.0].1 {
            Say::Drive(number) => {
                let load = RegisterLoad {
                    register,
                    epoch,
                    number,
                    superseded: 0,
                    procedure: "DriveTo".into(),
                    inputs: [10, 20].map(RegisterValue::Number).into(),
                };
                ctx.send(ctx.recipient::<RegisterLoad>("relay")?, load);
            }
            Say::Heard => {
                let ack = RegisterAck {
                    register,
                    epoch,
                    number: 1,
                    of: Acknowledged::Status { revision: 0 },
                };
                ctx.send(ctx.recipient::<RegisterAck>("relay")?, ack);
            }
            Say::Offline => {
                let offline = AgentOffline {
                    agent: "agent".into(),
                    epoch,
                    tick: 1,
                    reason: "it was late".to_owned(),
                };
                ctx.send(ctx.recipient::<AgentOffline>("relay")?, offline);
            }
        }
        Ok(())
    }
}

impl Handler<RegisterStatus> for Script {
    fn handle(&mut self, _: RegisterStatus, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

impl Handler<RegisterAck> for Script {
    fn handle(&mut self, _: RegisterAck, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

struct Wheels;

#[derive(Serialize, Deserialize)]
struct Arrived(u32);

impl Actor for Wheels {
    type Accepts = (RoverCommand, RoverQuery, Arrived);
}

impl Handler<RoverCommand> for Wheels {
    fn handle(&mut self, command: RoverCommand, ctx: &mut Context<'_, Self>) -> Outcome {
        if matches!(command.command, Command::Drive { .. }) {
            ctx.timer(SimDuration::from_secs(3), Arrived(command.id));
        }
        Ok(())
    }
}

impl Handler<RoverQuery> for Wheels {
    fn handle(&mut self, _: RoverQuery, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

impl Handler<Arrived> for Wheels {
    fn handle(&mut self, arrived: Arrived, ctx: &mut Context<'_, Self>) -> Outcome {
        let report = CommandReport {
            id: arrived.0,
            part: None,
            end: CommandEnd::Done,
            readings: Vec::new(),
            pose: PoseEstimate::default(),
        };
        ctx.send(ctx.recipient::<CommandReport>("relay")?, report);
        Ok(())
    }
}

/// What came of it, a line each, with the time in seconds.
struct Listen(Arc<Mutex<Vec<String>>>);

impl Observer for Listen {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            samples: true,
            checkpoints: false,
        }
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let Some(kind) = record.kind else {
            return Ok(Flow::Continue);
        };
        let is_sample = record.class == RecordClass::Sample;
        if !is_sample && record.class != RecordClass::Delivered {
            return Ok(Flow::Continue);
        }
        let (schema, body) = (kind.schema(), record.body);
        let says = match kind.name() {
            "RelayStopped" => "abandoned".to_owned(),
            "RoverCommand" => {
                let command: RoverCommand = schema.decode(body).expect("it is one");
                match command.command {
                    Command::Stop { part: None } => "stop".to_owned(),
                    Command::Drive { .. } => "drive".to_owned(),
                    other => format!("{other:?}"),
                }
            }
            "RegisterStatus" => {
                let status: RegisterStatus = schema.decode(body).expect("it is one");
                format!("{} {:?}", status.number, status.end)
            }
            // Those of the agent are what the test has it say.
            "RegisterAck" => {
                let ack: RegisterAck = schema.decode(body).expect("it is one");
                match ack.of {
                    Acknowledged::Load => format!("{} taken", ack.number),
                    Acknowledged::Status { .. } => return Ok(Flow::Continue),
                }
            }
            _ => return Ok(Flow::Continue),
        };
        let line = format!("{:.1} {says}", record.time().as_secs_f64());
        self.0.lock().expect("nobody panics").push(line);
        Ok(Flow::Continue)
    }
}

/// What becomes of it within half a minute; the relay crashes, and comes again, at these seconds.
fn run(lease_s: u64, script: &[(u64, Say)], crash_s: Option<(u64, u64)>) -> Vec<String> {
    let model = models::system().model.clone();
    let table = RelayTable::new(models::RELAY_TEXT, model, &[REGISTER]);
    let setup = Arc::new(RelaySetup {
        table: Arc::new(table.expect("it is the K9's")),
        registers: vec![REGISTER.into()],
        agent: "agent".to_owned(),
        rover: "k9".to_owned(),
        backoff: Backoff {
            first: SimDuration::from_secs(2),
            most: SimDuration::from_secs(60),
        },
        lease: SimDuration::from_secs(lease_s),
    });
    let mut sim = Simulation::new(1);
    let host = sim.host("k9_host");
    let script = script.to_vec();
    sim.actor(host, "agent", move |_| Script(script.clone()));
    sim.actor(host, "relay", move |_| RelayActor::new(setup.clone()));
    sim.actor(host, &hardware_name("k9"), |_| Wheels);
    if let Some((crash_s, restart_s)) = crash_s {
        let crashes = sim.crash_named_at(SimTime::from_secs(crash_s), "relay");
        crashes.expect("there is one");
        let restarts = sim.restart_named_at(SimTime::from_secs(restart_s), "relay");
        restarts.expect("there is one");
    }
    let said = Arc::new(Mutex::new(Vec::new()));
    sim.observe(Listen(said.clone()));
    sim.stop_at(SimTime::from_secs(30), "that is enough");
    sim.run(Executor::Inline).expect("it runs");
    let said = said.lock().expect("nobody panics");
    said.clone()
}

#[test]
fn a_load_is_carried_out_once_and_its_status_said_until_it_is_heard() {
    let script = [
        (1_000, Say::Drive(1)),
        (2_000, Say::Drive(1)),
        (5_000, Say::Drive(1)),
        (9_000, Say::Heard),
    ];
    let expected = [
        "1.0 drive",
        "1.0 1 taken",
        "2.0 1 taken",
        "4.0 1 Ended",
        "5.0 1 Ended",
        "6.0 1 Ended",
    ];
    let mut said = run(0, &script, None);
    said[..2].sort();
    let mut expected = expected.map(str::to_owned).to_vec();
    expected[..2].sort();
    assert_eq!(said, expected);
}

/// Whatever is heard of the agent renews its lease, and so does what is heard after it had ended.
#[test]
fn the_rover_is_stopped_whenever_the_lease_ends() {
    let script = [
        (3_500, Say::Drive(1)),
        (5_500, Say::Heard),
        (12_000, Say::Heard),
    ];
    let said = run(3, &script, None);
    let stops: Vec<&str> = { said.iter().map(String::as_str) }
        .filter(|line| line.ends_with("abandoned") || line.ends_with("stop"))
        .collect();
    let expected = [
        "3.0 abandoned",
        "3.0 stop",
        "8.5 abandoned",
        "8.5 stop",
        "15.0 abandoned",
        "15.0 stop",
    ];
    assert_eq!(stops, expected);
    // Before its end a drive is faulted by it.
    let said = run(2, &[(1_000, Say::Drive(1))], None);
    assert!(said.contains(&"3.0 stop".to_owned()), "{said:?}");
    assert!(said.contains(&"3.0 1 Fault".to_owned()), "{said:?}");
    assert!(!said.contains(&"4.0 1 Ended".to_owned()), "{said:?}");
}

#[test]
fn the_rover_is_stopped_when_its_agent_is_off_line() {
    let script = [
        (1_000, Say::Drive(1)),
        (2_000, Say::Offline),
        (2_500, Say::Offline),
    ];
    let mut said = run(0, &script, None);
    said.retain(|line| line.starts_with("1.0") || line.starts_with("2."));
    said.sort();
    let expected = [
        "1.0 1 taken",
        "1.0 drive",
        "2.0 1 Fault",
        "2.0 abandoned",
        "2.0 stop",
    ];
    assert_eq!(said, expected);
}

/// What it was at is faulted, and is not begun again; the lease begins with its new life.
#[test]
fn a_relay_that_comes_again_stops_the_rover() {
    let script = [(1_000, Say::Drive(1)), (11_000, Say::Drive(1))];
    let said = run(5, &script, Some((2, 10)));
    let count = |line: &str| said.iter().filter(|at| *at == line).count();
    assert_eq!(count("10.0 stop"), 1, "{said:?}");
    assert_eq!(count("10.0 1 Fault"), 1, "{said:?}");
    assert_eq!(count("11.0 1 Fault"), 1, "{said:?}");
    assert_eq!(said.iter().filter(|at| at.ends_with("drive")).count(), 1);
    let abandoned = said.iter().filter(|at| at.ends_with("abandoned"));
    assert_eq!(abandoned.collect::<Vec<_>>(), ["16.0 abandoned"]);
}
