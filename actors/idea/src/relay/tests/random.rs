//! Registers that say anything at any time, and a hardware that answers whenever it likes.

use std::collections::BTreeSet;

use proptest::prelude::*;

use super::*;

#[derive(Clone, Debug)]
enum Deed {
    Load(usize, usize),
    /// The hardware ends a command, of those that run.
    End(usize),
    /// It answers a question, of those that are out.
    Answer(usize),
    Pass,
    Abandon,
}

fn deed() -> impl Strategy<Value = Deed> {
    prop_oneof![
        6 => (0..8usize, 0..5usize).prop_map(|(register, says)| Deed::Load(register, says)),
        3 => any::<usize>().prop_map(Deed::End),
        3 => any::<usize>().prop_map(Deed::Answer),
        2 => Just(Deed::Pass),
        1 => Just(Deed::Abandon),
    ]
}

/// What a register may say: its procedures, in the order of the model.
fn says(register: usize, which: usize) -> (&'static str, Vec<RegisterValue>) {
    let all: &[(&str, &[i64])] = match register {
        LOCATION => &[
            ("Still", &[]),
            ("Stop", &[]),
            ("DriveTo", &[30, 40]),
            ("BackUp", &[5]),
            ("TurnInPlace", &[45]),
        ],
        CAMERA => {
            return [("Shut", vec![]), ("TakeImage", vec![symbol("hawk_eye")])][which % 2].clone();
        }
        PAN_TILT => &[("Rest", &[]), ("Point", &[10, 10])],
        FANS => {
            let on = RegisterValue::Truth(which > 2);
            return [("FansUnchanged", vec![]), ("DeviceSetFanState", vec![on])][which % 2].clone();
        }
        PITCH => &[("PitchMeasure", &[0])],
        ROLL => &[("RollMeasure", &[0])],
        TEMPERATURE => &[("TempReadCompare", &[]), ("TempPause", &[])],
        _ => &[("PowerMeasure", &[]), ("PowerPause", &[])],
    };
    let (name, inputs) = all[which % all.len()];
    (name, inputs.iter().map(|&input| number(input)).collect())
}

/// A hardware that takes what it is sent, keeps to one command a part and answers whenever it likes;
/// and an agent that counts what it is told.
#[derive(Default)]
struct Other {
    /// What runs: part and number.
    runs: Vec<(Part, u32)>,
    queries: Vec<u32>,
    /// By register: the contract that is not over, whether it says that nothing is to be done, and
    /// the part that it may move.
    open: Vec<Option<(u32, Option<Part>)>>,
    answered: BTreeSet<u32>,
    reports: Vec<CommandReport>,
}

fn part_of(register: usize) -> Option<Part> {
    match register {
        LOCATION => Some(Part::Wheels),
        CAMERA => Some(Part::Instrument {
            name: "hawk_eye".to_owned(),
        }),
        PAN_TILT => Some(Part::Mast),
        _ => None,
    }
}

impl Other {
    fn take(&mut self, acts: Vec<RelayAct>) {
        for act in acts {
            match act {
                RelayAct::Query(RoverQuery { id }) => {
                    assert!(!self.queries.contains(&id));
                    self.queries.push(id);
                }
                RelayAct::Command(RoverCommand { id, command }) => self.obey(id, &command),
                RelayAct::Status {
                    register, contract, ..
                } => {
                    // Once, and of the present contract.
                    assert!(self.answered.insert(contract.1), "{contract:?} twice");
                    let open = self.open[register].take().expect("a contract");
                    assert_eq!(open.0, contract.1);
                }
            }
        }
    }

    fn obey(&mut self, id: u32, command: &Command) {
        let part = match command {
            Command::Stop { part } => {
                let by = StopCause::Command;
                let stopped = |one: &Part| part.as_ref().is_none_or(|part| part == one);
                for (_, id) in self.runs.iter().filter(|(one, _)| stopped(one)) {
                    self.reports.push(report(*id, CommandEnd::Stopped { by }));
                }
                self.runs.retain(|(one, _)| !stopped(one));
                self.reports.push(report(id, CommandEnd::Done));
                return;
            }
            Command::Fans { .. } => {
                self.reports.push(report(id, CommandEnd::Done));
                return;
            }
            Command::Drive { .. } | Command::BackUp { .. } | Command::Turn { .. } => Part::Wheels,
            Command::PanTilt { .. } => Part::Mast,
            Command::Image { camera, .. } => Part::Instrument {
                name: camera.clone(),
            },
            other => panic!("{other:?}"),
        };
        // The part is free: what had lost its contract was stopped before.
        assert!(self.runs.iter().all(|(one, _)| *one != part), "{command:?}");
        self.runs.push((part, id));
    }
}

proptest! {
    /// Whatever is loaded and answered, in whatever order: no contract is answered twice, none that is
    /// over, no part runs for a register that says nothing of the kind, and no command meets a part
    /// that is busy.
    #[test]
    fn contracts_are_answered_once_and_parts_follow_their_registers(
        deeds in prop::collection::vec(deed(), 1..120),
    ) {
        let mut bench = Bench::new();
        let mut other = Other { open: vec![None; 8], ..Other::default() };
        for deed in deeds {
            match deed {
                Deed::Load(register, which) => {
                    let (name, inputs) = says(register, which);
                    let idle = inputs.is_empty() && !name.contains("Measure") && !name.contains("Read");
                    let moves = (!idle).then(|| part_of(register)).flatten();
                    other.open[register] = Some((bench.contracts + 1, moves));
                    other.take(bench.load(register, name, &inputs));
                }
                Deed::End(which) => {
                    if !other.runs.is_empty() {
                        let (_, id) = other.runs.remove(which % other.runs.len());
                        other.reports.push(report(id, CommandEnd::Done));
                    }
                }
                Deed::Answer(which) => {
                    if !other.queries.is_empty() {
                        let id = other.queries.remove(which % other.queries.len());
                        other.take(bench.state(state(id)));
                    }
                }
                Deed::Pass => bench.pass(),
                Deed::Abandon => {
                    bench.relay.abandon(&mut bench.out);
                    other.take(std::mem::take(&mut bench.out));
                    prop_assert!(other.runs.is_empty());
                    prop_assert!(other.open.iter().all(Option::is_none));
                }
            }
            for report in std::mem::take(&mut other.reports) {
                bench.relay.report(&report, &mut bench.out);
                other.take(std::mem::take(&mut bench.out));
            }
            for (part, _) in &other.runs {
                let wanted = other.open.iter().flatten().any(|(_, moves)| moves.as_ref() == Some(part));
                prop_assert!(wanted, "{part:?} runs for nobody");
            }
        }
        // What is answered last leaves nothing open but idle procedures and commands that run.
        while let Some(id) = other.queries.pop() {
            other.take(bench.state(state(id)));
        }
        let polls = other.open[PITCH..].iter().enumerate().filter(|(at, open)| {
            open.as_ref().is_some_and(|_| *at < 2)
        });
        prop_assert_eq!(polls.count(), 0);
    }
}
