//! The inline executor: one engine, one thread, no windows.

use std::sync::Arc;

use super::{Ending, dissolved, explained};
use crate::commit::Committer;
use crate::engine::Engine;
use crate::report::{End, Report};
use crate::schedule::{Due, Schedule};
use crate::topology::Topology;

/// Runs to the end. Expects one engine: with several, hosts would have to wait for each other.
pub(super) fn run(
    topology: Arc<Topology>,
    engines: Vec<Engine>,
    mut schedule: Schedule,
    mut committer: Committer,
) -> Report {
    let Ok([mut engine]) = <[Engine; 1]>::try_from(engines) else {
        unreachable!("the builder gives this executor a single engine");
    };
    let ending = run_to_end(&topology, &mut engine, &mut schedule, &mut committer);
    let remains = dissolved(vec![engine], ending.undone_from);
    ending.finish(&topology, schedule, committer, remains)
}

fn run_to_end(
    topology: &Topology,
    engine: &mut Engine,
    schedule: &mut Schedule,
    committer: &mut Committer,
) -> Ending {
    loop {
        if let Err(fault) = engine.run(schedule.bound(), committer) {
            let fault = explained(fault, topology, |key| engine.parts.hops.find(key));
            return Ending::fault(fault);
        }
        if let Some(end) = committer.verdict() {
            return Ending::early(end, committer.last().time);
        }
        let asked = [engine.parts.stop.take(), committer.stop.take()];
        if asked.iter().any(Option::is_some) {
            for (key, by, reason) in asked.into_iter().flatten() {
                schedule.ask_stop(key, by, reason);
            }
            continue;
        }
        if engine.peek().is_none() && schedule.only_stops_left() {
            return Ending::early(End::Completed, committer.last().time);
        }
        match schedule.take_due(topology) {
            Some(Due::Stop { key, by, reason }) => {
                return Ending::stop(topology, committer, key, by, reason);
            }
            Some(Due::Control(key, entity, action)) => {
                if let Err(fault) = engine.control(key, entity, action, committer) {
                    return Ending::fault(fault);
                }
            }
            None => return Ending::early(End::Completed, committer.last().time),
        }
    }
}
