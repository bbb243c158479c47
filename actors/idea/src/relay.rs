//! The relay between goal registers and a rover's hardware (section 3.1 of the IDEA paper: it "behaves
//! as a parser/decoder, translating the goals sent by the System Level agent into the corresponding
//! commands or information requests to the K9 controllers").
//!
//! What it translates is data: a [`RelayTable`] says for each procedure of a model which command it is,
//! or which readings, in which units. [`Relay`] is a state machine: it is told what registers say and
//! what the hardware answers, and says what is to be sent. It sends nothing itself and keeps no
//! time.
//!
//! - A *command* runs until the hardware reports its end, which is the status of the procedure. If the
//!   register says something else before, the relay stops that part of the rover, unless what it
//!   says is itself a stop of it.
//! - A *poll* ends with the rover's state as it is when the hardware answers. Polls that are loaded at
//!   one instant share one question.
//! - An *idle* procedure has no end of its own: the part does nothing until the register says
//!   otherwise.
//! - Each contract is answered at most once. What the hardware says of contracts that are over is ignored
//!   and counted.
//!
//! ```
//! use std::sync::Arc;
//! use farside::SimTime;
//! use farside_actors::rover::{Command, RoverCommand};
//! use farside_idea::register::RegisterValue;
//! use farside_idea::relay::{Relay, RelayAct, RelayTable};
//! use farside_planning::language::{Options, read_model};
//!
//! let model = read_model("wheels.ddl", "
//!     (Define_Model wheels :profile executive)
//!     (Define_Object_Class Rover :state_variables ((Executable Wheels_SV)))
//!     (Define_Type Decimetres [0 100])
//!     (Define_Type Status (ok failed TIMEOUT PREEMPTED))
//!     (Define_Predicate Still ())
//!     (Define_Predicate BackUp ((Decimetres ?distance) -> (Status ?status)))
//!     (Define_Member_Values (Rover Wheels_SV) (Still BackUp) :default (Still ()))
//!     (Define_Compatibility (SINGLE ((Rover Wheels_SV) ((BackUp)))) :duration_bounds [1 60])
//! ", &Options::default()).ok()?;
//! let table = RelayTable::new("
//!     [procedure.Still]
//!     idle = true
//!     [procedure.BackUp]
//!     command = 'back-up'
//!     with = { distance = { input = 'distance', unit = 'dm' } }
//! ", Arc::new(model), &["Wheels_SV"])?;
//! let mut relay = Relay::new(Arc::new(table));
//! let mut out = Vec::new();
//! relay.load(SimTime::ZERO, 0, (1, 1), "BackUp", &[RegisterValue::Number(5)], &mut out);
//! let command = Command::BackUp { distance_m: 0.5 };
//! assert_eq!(out, [RelayAct::Command(RoverCommand { id: 1, command })]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod action;
mod actor;
mod table;
#[cfg(test)]
mod tests;
mod words;

use std::sync::Arc;

use farside::SimTime;
use farside_actors::rover::{
    Command, CommandEnd, CommandReport, Part, RoverCommand, RoverQuery, RoverState,
};
use farside_planning::model::{PredicateId, Value};

use crate::register::{ContractEnd, ContractKey, RegisterValue};
use crate::wording;
use table::Entry;

pub use actor::{RelayActor, RelaySetup, RelayStopped, RelayWakes};
pub use table::{RelayError, RelayProblem, RelayRegister, RelayTable};

/// The number of commands whose reports nobody waits for.
const UNANSWERED: u32 = 0;

/// What a relay wants sent.
#[derive(Clone, Debug, PartialEq)]
pub enum RelayAct {
    /// To the hardware.
    Command(RoverCommand),
    /// To the hardware.
    Query(RoverQuery),
    /// To the side that controls a register: what has become of its contract, which is over.
    Status {
        /// The register, by its place in [`RelayTable::registers`].
        register: usize,
        /// The contract.
        contract: ContractKey,
        /// The outputs, as far as the relay knows them; empty where it knows none.
        outputs: Vec<Option<RegisterValue>>,
        /// How it ended: not [`ContractEnd::Open`].
        end: ContractEnd,
    },
}

/// What a relay has counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RelayCounters {
    /// Procedures that registers were loaded with.
    pub loads: u64,
    /// Of those, the ones that the table or the model does not know, or that have wrong inputs.
    pub refused: u64,
    /// Commands sent, but for those that stop what has lost its contract.
    pub commands: u64,
    /// Commands sent that stop what has lost its contract.
    pub stops: u64,
    /// Questions sent.
    pub queries: u64,
    /// Reports of the hardware for contracts that were over.
    pub late_reports: u64,
    /// States of the hardware that nobody waited for any more.
    pub late_states: u64,
}

/// A contract that is not over.
#[derive(Clone, Debug)]
struct Open {
    contract: ContractKey,
    predicate: PredicateId,
    inputs: Vec<Value>,
    doing: Doing,
}

#[derive(Clone, Debug)]
enum Doing {
    /// Nothing, for good.
    Idle,
    /// Waits for the report of this command, for this part.
    Command(u32, Option<Part>),
    /// Waits for the answer to this question.
    Query(u32),
}

/// A relay: see the [module](self).
#[derive(Clone, Debug)]
pub struct Relay {
    table: Arc<RelayTable>,
    /// By register.
    open: Vec<Option<Open>>,
    /// The number of the last command and that of the last question.
    last_command: u32,
    last_query: u32,
    /// When the last question was asked.
    asked: Option<SimTime>,
    counters: RelayCounters,
}

impl Relay {
    /// A relay whose registers say nothing yet.
    pub fn new(table: Arc<RelayTable>) -> Relay {
        Relay {
            open: vec![None; table.registers().len()],
            table,
            last_command: UNANSWERED,
            last_query: 0,
            asked: None,
            counters: RelayCounters::default(),
        }
    }

    /// Its table.
    pub fn table(&self) -> &RelayTable {
        &self.table
    }

    /// What it has counted.
    pub fn counters(&self) -> RelayCounters {
        self.counters
    }

    /// A register says this procedure from now on, in place of what it said. What is to be sent goes
    /// to `out`, in order.
    ///
    /// A procedure that the register cannot say, or inputs that are not its own, end at once as
    /// [`ContractEnd::Refused`].
    ///
    /// # Panics
    ///
    /// If there is no such register.
    pub fn load(
        &mut self,
        now: SimTime,
        register: usize,
        contract: ContractKey,
        procedure: &str,
        inputs: &[RegisterValue],
        out: &mut Vec<RelayAct>,
    ) {
        self.counters.loads += 1;
        let table = self.table.clone();
        let before = self.open[register].take();
        let read = table
            .entry(register, procedure)
            .and_then(|(predicate, entry)| {
                let inputs = wording::inputs(&table.model, predicate, inputs)?;
                Ok((predicate, entry, inputs))
            });
        let (predicate, entry, inputs) = match read {
            Ok(read) => read,
            Err(error) => {
                self.stop(before, None, out);
                self.counters.refused += 1;
                let reason = error.to_string();
                out.push(RelayAct::Status {
                    register,
                    contract,
                    outputs: Vec::new(),
                    end: ContractEnd::Refused { reason },
                });
                return;
            }
        };
        let stops = match entry {
            Entry::Command {
                action: action::Action::Stop(part),
                ..
            } => Some(part),
            _ => None,
        };
        self.stop(before, stops, out);
        let doing = match entry {
            Entry::Idle => Doing::Idle,
            Entry::Poll(_) => Doing::Query(self.ask(now, out)),
            Entry::Command { action, .. } if action.needs_heading() => {
                Doing::Query(self.ask(now, out))
            }
            Entry::Command { action, .. } => {
                let command = action.command(&inputs, &table.model, 0.0);
                let id = self.command(command, out);
                Doing::Command(id, action.part(&inputs, &table.model))
            }
        };
        self.open[register] = Some(Open {
            contract,
            predicate,
            inputs,
            doing,
        });
    }

    /// Stops what has lost its contract, unless a stop of `by` follows that does it.
    fn stop(&mut self, before: Option<Open>, by: Option<&Option<Part>>, out: &mut Vec<RelayAct>) {
        let Some(Doing::Command(_, part)) = before.map(|open| open.doing) else {
            return;
        };
        if by.is_some_and(|by| by.is_none() || *by == part) {
            return;
        }
        self.counters.stops += 1;
        let (id, command) = (UNANSWERED, Command::Stop { part });
        out.push(RelayAct::Command(RoverCommand { id, command }));
    }

    fn command(&mut self, command: Command, out: &mut Vec<RelayAct>) -> u32 {
        self.counters.commands += 1;
        self.last_command = self.last_command.checked_add(1).unwrap_or(UNANSWERED + 1);
        let id = self.last_command;
        out.push(RelayAct::Command(RoverCommand { id, command }));
        id
    }

    /// Asks for the rover's state, or joins a question that was asked at this instant.
    fn ask(&mut self, now: SimTime, out: &mut Vec<RelayAct>) -> u32 {
        if self.asked != Some(now) {
            self.asked = Some(now);
            self.counters.queries += 1;
            self.last_query = self.last_query.wrapping_add(1);
            let id = self.last_query;
            out.push(RelayAct::Query(RoverQuery { id }));
        }
        self.last_query
    }

    /// Whether what a register says is a poll that waits for its answer.
    pub fn is_polled(&self, register: usize) -> bool {
        let open = self.open.get(register).and_then(Option::as_ref);
        open.is_some_and(|open| matches!(self.table.of(open.predicate), Some(Entry::Poll(_))))
    }

    /// The hardware reports how a command ended.
    pub fn report(&mut self, report: &CommandReport, out: &mut Vec<RelayAct>) {
        if report.id == UNANSWERED {
            return;
        }
        let waits = |open: &Option<Open>| {
            let doing = open.as_ref().map(|open| &open.doing);
            matches!(doing, Some(Doing::Command(id, _)) if *id == report.id)
        };
        let register = self.open.iter().position(waits);
        let open = register.and_then(|register| Some((register, self.open[register].take()?)));
        let Some((register, open)) = open else {
            self.counters.late_reports += 1;
            return;
        };
        let Some(Entry::Command {
            status, outputs, ..
        }) = self.table.of(open.predicate)
        else {
            return;
        };
        let ends = &self.table.ends;
        let said = match &report.end {
            CommandEnd::Done => &ends.done,
            CommandEnd::Stopped { .. } => &ends.stopped,
            CommandEnd::Failed { .. } => &ends.failed,
            CommandEnd::Refused { .. } => &ends.refused,
        };
        let mut outputs = vec![None; *outputs];
        if let Some(place) = status {
            outputs[*place] = Some(RegisterValue::Symbol(said.clone()));
        }
        out.push(RelayAct::Status {
            register,
            contract: open.contract,
            outputs,
            end: ContractEnd::Ended,
        });
    }

    /// The hardware answers a question: every poll that waits for it ends.
    pub fn state(&mut self, state: &RoverState, out: &mut Vec<RelayAct>) {
        if state.id == self.last_query {
            // What is polled from now on would come after the answer.
            self.asked = None;
        }
        let mut is_late = true;
        for register in 0..self.open.len() {
            let waits = |open: &mut Open| matches!(open.doing, Doing::Query(id) if id == state.id);
            let Some(open) = self.open[register].take_if(waits) else {
                continue;
            };
            is_late = false;
            self.answer(register, open, state, out);
        }
        self.counters.late_states += u64::from(is_late);
    }

    /// Goes on with a contract that has waited for the rover's state.
    fn answer(
        &mut self,
        register: usize,
        mut open: Open,
        state: &RoverState,
        out: &mut Vec<RelayAct>,
    ) {
        let table = self.table.clone();
        match table.of(open.predicate) {
            Some(Entry::Poll(outputs)) => {
                let say = |output: &Option<action::Output>| output.as_ref()?.of(state);
                out.push(RelayAct::Status {
                    register,
                    contract: open.contract,
                    outputs: outputs.iter().map(say).collect(),
                    end: ContractEnd::Ended,
                });
            }
            Some(Entry::Command { action, .. }) => {
                let command = action.command(&open.inputs, &table.model, state.pose.yaw_rad);
                let id = self.command(command, out);
                open.doing = Doing::Command(id, action.part(&open.inputs, &table.model));
                self.open[register] = Some(open);
            }
            Some(Entry::Idle) | None => {}
        }
    }

    /// Whoever controls the registers is gone: stops the whole rover, and ends every contract that
    /// is not over with [`ContractEnd::Fault`].
    pub fn abandon(&mut self, out: &mut Vec<RelayAct>) {
        self.counters.stops += 1;
        let (id, command) = (UNANSWERED, Command::Stop { part: None });
        out.push(RelayAct::Command(RoverCommand { id, command }));
        for register in 0..self.open.len() {
            if let Some(open) = self.open[register].take() {
                out.push(RelayAct::Status {
                    register,
                    contract: open.contract,
                    outputs: Vec::new(),
                    end: ContractEnd::Fault,
                });
            }
        }
    }
}
