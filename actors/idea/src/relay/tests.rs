//! Relays with a hardware that is made up: what each procedure becomes and how it ends.

mod random;
mod rover;
mod tables;

use farside::SimDuration;
use farside_actors::rover::{Aim, Failure, Obstacle, PoseEstimate, StopCause, View};

use super::*;
use crate::models::{RELAY_TEXT, system};

/// The registers that the K9's system agent has with its relay.
const REGISTERS: [&str; 8] = [
    "Location_SV",
    "Camera_SV",
    "PanTilt_SV",
    "Fans_SV",
    "Pitch_SV",
    "Roll_SV",
    "Temperature_SV",
    "Power_SV",
];
const LOCATION: usize = 0;
const CAMERA: usize = 1;
const PAN_TILT: usize = 2;
const FANS: usize = 3;
const PITCH: usize = 4;
const ROLL: usize = 5;
const TEMPERATURE: usize = 6;
const POWER: usize = 7;

fn table() -> RelayTable {
    RelayTable::new(RELAY_TEXT, system().model.clone(), &REGISTERS).expect("the K9's table")
}

fn number(number: i64) -> RegisterValue {
    RegisterValue::Number(number)
}

fn symbol(name: &str) -> RegisterValue {
    RegisterValue::Symbol(name.into())
}

fn status(name: &str) -> Vec<Option<RegisterValue>> {
    vec![Some(symbol(name))]
}

/// A relay, and the side of the agent.
struct Bench {
    relay: Relay,
    now: SimTime,
    /// The number of the last contract.
    contracts: u32,
    out: Vec<RelayAct>,
}

impl Bench {
    fn new() -> Bench {
        Bench {
            relay: Relay::new(Arc::new(table())),
            now: SimTime::ZERO,
            contracts: 0,
            out: Vec::new(),
        }
    }

    fn pass(&mut self) {
        self.now += SimDuration::from_millis(500);
    }

    /// Loads a register; what comes of it.
    fn load(&mut self, register: usize, says: &str, inputs: &[RegisterValue]) -> Vec<RelayAct> {
        self.contracts += 1;
        let contract = (1, self.contracts);
        self.relay
            .load(self.now, register, contract, says, inputs, &mut self.out);
        std::mem::take(&mut self.out)
    }

    /// The command that a load gives, by its number.
    fn command(&mut self, register: usize, says: &str, inputs: &[RegisterValue]) -> RoverCommand {
        match self.load(register, says, inputs).pop() {
            Some(RelayAct::Command(command)) => command,
            other => panic!("{says}: {other:?}"),
        }
    }

    fn report(&mut self, id: u32, end: CommandEnd) -> Vec<RelayAct> {
        self.relay.report(&report(id, end), &mut self.out);
        std::mem::take(&mut self.out)
    }

    fn state(&mut self, state: RoverState) -> Vec<RelayAct> {
        self.relay.state(&state, &mut self.out);
        std::mem::take(&mut self.out)
    }
}

fn report(id: u32, end: CommandEnd) -> CommandReport {
    CommandReport {
        id,
        part: None,
        end,
        readings: Vec::new(),
        pose: PoseEstimate::default(),
    }
}

/// A rover nose up and left side down, warm, at 61.6 %.
fn state(id: u32) -> RoverState {
    RoverState {
        id,
        pose: PoseEstimate {
            yaw_rad: 3.0,
            roll_rad: -0.1,
            pitch_rad: 0.45,
            ..PoseEstimate::default()
        },
        compass_rad: 3.0,
        bay_c: 41.6,
        fans_on: false,
        pan_rad: 0.0,
        tilt_rad: 0.0,
        battery_j: 616.0,
        battery_capacity_j: 1000.0,
        solar_w: 0.0,
        load_w: 0.0,
        memory_used_bytes: 0,
        memory_size_bytes: 0,
        asleep: false,
        brown_out: false,
        running: Vec::new(),
    }
}

fn ended(register: usize, number: u32, outputs: Vec<Option<RegisterValue>>) -> RelayAct {
    RelayAct::Status {
        register,
        contract: (1, number),
        outputs,
        end: ContractEnd::Ended,
    }
}

fn stop_of(part: Part) -> RelayAct {
    let (id, command) = (UNANSWERED, Command::Stop { part: Some(part) });
    RelayAct::Command(RoverCommand { id, command })
}

#[test]
fn each_procedure_is_its_command() {
    let mut bench = Bench::new();
    let drive = bench.command(LOCATION, "DriveTo", &[number(25), number(-140)]);
    let (east_m, north_m) = (2.5, -14.0);
    assert_eq!(drive.command, Command::Drive { east_m, north_m });
    let back = bench.command(LOCATION, "BackUp", &[number(10)]).command;
    assert_eq!(back, Command::BackUp { distance_m: 1.0 });
    let image = bench.command(CAMERA, "TakeImage", &[symbol("haz_rear")]);
    let (camera, view) = ("haz_rear".to_owned(), View::Point);
    assert_eq!(image.command, Command::Image { camera, view });
    let point = bench.command(PAN_TILT, "Point", &[number(90), number(-30)]);
    let Command::PanTilt {
        aim: Aim::Angles { pan_rad, tilt_rad },
    } = point.command
    else {
        panic!("{point:?}");
    };
    assert!((pan_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    assert!((tilt_rad + std::f64::consts::FRAC_PI_6).abs() < 1e-12);
    let fans = bench.command(FANS, "DeviceSetFanState", &[RegisterValue::Truth(true)]);
    assert_eq!(fans.command, Command::Fans { on: true });
    // Open loop: its contract is over when the fans were told, and has nothing to say.
    assert_eq!(
        bench.report(fans.id, CommandEnd::Done),
        [ended(FANS, 5, Vec::new())]
    );
}

#[test]
fn a_command_ends_with_its_report_and_says_how() {
    let by = StopCause::Lease;
    let blocked = Failure::Blocked {
        by: Obstacle::Boulder,
    };
    let reason = farside_actors::rover::Refusal::Asleep;
    for (end, says) in [
        (CommandEnd::Done, "ok"),
        (CommandEnd::Stopped { by }, "failed"),
        (CommandEnd::Failed { reason: blocked }, "failed"),
        (CommandEnd::Refused { reason }, "failed"),
    ] {
        let mut bench = Bench::new();
        let drive = bench.command(LOCATION, "DriveTo", &[number(1), number(2)]);
        let out = bench.report(drive.id, end.clone());
        assert_eq!(out, [ended(LOCATION, 1, status(says))]);
        // Once.
        assert_eq!(bench.report(drive.id, end), []);
        assert_eq!(bench.relay.counters().late_reports, 1);
        // Nothing runs any more that would have to be stopped.
        assert_eq!(bench.load(LOCATION, "Still", &[]), []);
    }
}

#[test]
fn polls_of_one_instant_share_a_question() {
    let mut bench = Bench::new();
    let missed = [number(0)];
    let first = bench.load(PITCH, "PitchMeasure", &missed);
    assert_eq!(first, [RelayAct::Query(RoverQuery { id: 1 })]);
    assert_eq!(bench.load(ROLL, "RollMeasure", &missed), []);
    assert_eq!(bench.load(TEMPERATURE, "TempReadCompare", &[]), []);
    assert_eq!(bench.load(POWER, "PowerMeasure", &[]), []);
    let truth = |truth| Some(RegisterValue::Truth(truth));
    let received = truth(true);
    assert_eq!(
        bench.state(state(1)),
        [
            // To whole degrees; alarms are not the relay's to find.
            ended(PITCH, 1, vec![None, Some(number(26)), received.clone()]),
            ended(ROLL, 2, vec![None, Some(number(-6)), received.clone()]),
            ended(
                TEMPERATURE,
                3,
                vec![None, Some(number(42)), received.clone()]
            ),
            ended(POWER, 4, vec![None, Some(number(62)), received]),
        ]
    );
    // After the answer a question of the same instant is another one, and so it is later.
    let next = RelayAct::Query(RoverQuery { id: 2 });
    assert_eq!(bench.load(PITCH, "PitchMeasure", &missed), [next]);
    bench.pass();
    let next = RelayAct::Query(RoverQuery { id: 3 });
    assert_eq!(bench.load(ROLL, "RollMeasure", &missed), [next]);
    assert_eq!(bench.state(state(3)).len(), 1);
    assert_eq!(bench.state(state(2)).len(), 1);
    assert_eq!(bench.relay.counters().queries, 3);
    assert_eq!(bench.relay.counters().late_states, 0);
}

#[test]
fn a_reading_stays_within_its_type() {
    let mut bench = Bench::new();
    bench.load(TEMPERATURE, "TempReadCompare", &[]);
    let mut hot = state(1);
    hot.bay_c = 1e6;
    let RelayAct::Status { outputs, .. } = bench.state(hot).remove(0) else {
        panic!("no status");
    };
    assert_eq!(outputs[1], Some(number(150)));
}

#[test]
fn a_turn_in_place_is_from_where_the_rover_heads() {
    let mut bench = Bench::new();
    let out = bench.load(LOCATION, "TurnInPlace", &[number(30)]);
    assert_eq!(out, [RelayAct::Query(RoverQuery { id: 1 })]);
    // A poll of the same instant has the same answer.
    assert_eq!(bench.load(PITCH, "PitchMeasure", &[number(1)]), []);
    let mut out = bench.state(state(1));
    assert!(matches!(
        out.remove(1),
        RelayAct::Status {
            register: PITCH,
            ..
        }
    ));
    let RelayAct::Command(RoverCommand {
        id,
        command: Command::Turn { yaw_rad },
    }) = out[0]
    else {
        panic!("{out:?}");
    };
    let turn_rad = std::f64::consts::TAU;
    assert!(
        (yaw_rad - (3.0 + turn_rad / 12.0 - turn_rad)).abs() < 1e-12,
        "{yaw_rad}"
    );
    let done = bench.report(id, CommandEnd::Done);
    assert_eq!(done, [ended(LOCATION, 1, status("ok"))]);
    // One that is taken back while the question is out never turns anything.
    bench.pass();
    bench.load(LOCATION, "TurnInPlace", &[number(30)]);
    assert_eq!(bench.load(LOCATION, "Still", &[]), []);
    assert_eq!(bench.state(state(2)), []);
    assert_eq!(bench.relay.counters().late_states, 1);
}

#[test]
fn what_loses_its_contract_is_stopped_and_its_report_ignored() {
    let mut bench = Bench::new();
    let drive = bench.command(LOCATION, "DriveTo", &[number(100), number(0)]);
    let image = bench.command(CAMERA, "TakeImage", &[symbol("wide_eye")]);
    // Another command: the first is stopped before it.
    let out = bench.load(LOCATION, "BackUp", &[number(5)]);
    assert_eq!(out[0], stop_of(Part::Wheels));
    let RelayAct::Command(back) = out[1].clone() else {
        panic!("{out:?}");
    };
    // Its report is late, and that of the stop is waited for by nobody.
    let by = StopCause::Command;
    assert_eq!(bench.report(drive.id, CommandEnd::Stopped { by }), []);
    assert_eq!(bench.report(UNANSWERED, CommandEnd::Done), []);
    assert_eq!(bench.relay.counters().late_reports, 1);
    // A goal that says stop is the stop.
    let out = bench.load(LOCATION, "Stop", &[]);
    let part = Some(Part::Wheels);
    let id = back.id + 1;
    let command = Command::Stop { part };
    assert_eq!(out, [RelayAct::Command(RoverCommand { id, command })]);
    assert_eq!(bench.report(back.id, CommandEnd::Stopped { by }), []);
    assert_eq!(
        bench.report(id, CommandEnd::Done),
        [ended(LOCATION, 4, status("ok"))]
    );
    // So is what has nothing to do; the camera is another part, by its name.
    let name = "wide_eye".to_owned();
    let stop = stop_of(Part::Instrument { name });
    assert_eq!(bench.load(CAMERA, "Shut", &[]), [stop]);
    assert_eq!(bench.report(image.id, CommandEnd::Stopped { by }), []);
    let counters = bench.relay.counters();
    assert_eq!(
        (counters.stops, counters.commands, counters.late_reports),
        (2, 4, 3)
    );
}

#[test]
fn what_no_register_can_say_is_refused_and_stops_what_ran() {
    let mut bench = Bench::new();
    let refused = |out: &[RelayAct]| match out.last() {
        Some(RelayAct::Status {
            end: ContractEnd::Refused { reason },
            outputs,
            ..
        }) if outputs.is_empty() => reason.clone(),
        other => panic!("{other:?}"),
    };
    let out = bench.load(LOCATION, "TakeImage", &[symbol("wide_eye")]);
    assert_eq!(refused(&out), "Location_SV does not say TakeImage");
    let out = bench.load(LOCATION, "DriveTo", &[number(1)]);
    assert_eq!(refused(&out), "DriveTo: expected 2 inputs, found 1");
    let out = bench.load(LOCATION, "TurnInPlace", &[number(181)]);
    assert!(
        refused(&out).contains("expected a Degrees, found 181"),
        "{out:?}"
    );
    bench.command(LOCATION, "BackUp", &[number(1)]);
    let out = bench.load(LOCATION, "BackUp", &[symbol("wide_eye")]);
    assert_eq!(out[0], stop_of(Part::Wheels));
    assert_eq!(bench.relay.counters().refused, 4);
}

#[test]
fn when_nobody_controls_it_the_rover_is_stopped_whole() {
    let mut bench = Bench::new();
    let drive = bench.command(LOCATION, "DriveTo", &[number(1), number(2)]);
    bench.load(PITCH, "PitchMeasure", &[number(0)]);
    bench.relay.abandon(&mut bench.out);
    let out = std::mem::take(&mut bench.out);
    let (id, command) = (UNANSWERED, Command::Stop { part: None });
    assert_eq!(out[0], RelayAct::Command(RoverCommand { id, command }));
    let faults = out[1..].iter().filter(|act| {
        matches!(
            act,
            RelayAct::Status {
                end: ContractEnd::Fault,
                ..
            }
        )
    });
    assert_eq!((faults.count(), out.len()), (2, 3));
    assert_eq!(bench.report(drive.id, CommandEnd::Done), []);
    assert_eq!(bench.state(state(1)), []);
}
