//! The end of a replay: what is left is compared, and why the run and the replay ended.

use super::compare::{First, FlowKey, Seen, Side};
use super::report::{Difference, KindTally, Output, OutputClass, ReplayReport, Tally};
use super::{RecordEnd, Replay};
use crate::engine::{Class, Remains};
use crate::ids::EntityId;
use crate::key::{Bound, EventKey};
use crate::schedule::stop_of;
use crate::time::SimTime;
use crate::topology::Topology;

impl Replay {
    /// What came of it, once the record is over.
    pub fn finish(mut self, end: RecordEnd) -> ReplayReport {
        match &end {
            RecordEnd::Completed { at } => self.advance(Bound {
                time: *at,
                step: u32::MAX,
            }),
            RecordEnd::Stopped { at } => self.advance(Bound::at(*at)),
            RecordEnd::Fault { at, text, last } => {
                self.advance_through(last.unwrap_or(self.last));
                self.run_into(*at, text);
            }
            RecordEnd::Cut { at, last } => {
                self.advance(Bound::at(*at));
                self.advance_through(last.unwrap_or(self.last));
            }
        }
        let (RecordEnd::Completed { at }
        | RecordEnd::Stopped { at }
        | RecordEnd::Fault { at, .. }
        | RecordEnd::Cut { at, .. }) = &end;
        if *at > self.last.time {
            self.last = self.topology.key(*at, 0, EntityId::CONTROL, 0);
        }
        let until = match &self.fault {
            Some(fault) => fault.time,
            None => self.last.time,
        };
        self.meet_in_flight();
        let is_over = !matches!(end, RecordEnd::Cut { .. });
        let (kinds, first) = self.comparer.close(is_over, self.last.time);
        let mut ended = Ended { kinds, first };
        self.compare_stops(&mut ended, is_over);
        let fault = self.compare_fault(&mut ended, &end);
        let asked = self.engine.parts.energy_read.get();
        ReplayReport {
            inputs: self.inputs,
            steps: self.comparer.steps,
            kinds: ended.kinds,
            first: ended.first.map(|(_, first)| first),
            needs_charges: asked && self.charged && !self.charges_told,
            fault,
            until,
        }
    }

    /// The living actor in whose event the run failed, if it was one's. What a control event does is recorded
    /// once it is done: one that failed is not.
    fn failed(&self, at: SimTime, text: &str) -> Option<EntityId> {
        let is_control =
            text.contains(" from @control: ") || !text.contains(" handling ") && at > SimTime::ZERO;
        if is_control {
            return None;
        }
        let mut actors = self.topology.declared.iter().copied();
        actors.find(|actor| {
            let name = self.topology.name(*actor);
            self.is_live(*actor) && text.starts_with(&format!("{name} at "))
        })
    }

    /// Goes on into the event in which the run failed, if it was one of a living actor.
    fn run_into(&mut self, at: SimTime, text: &str) {
        if self.failed(at, text).is_none() {
            return;
        }
        if let Some((key, head, letter)) = self.in_flight.take_if(|(key, ..)| key.time == at) {
            self.insert(key, head, Some(letter), None);
        }
        self.advance(Bound {
            time: at,
            step: u32::MAX,
        });
    }

    /// Meets what living actors have sent and is still on its way.
    fn meet_in_flight(&mut self) {
        let until = self.fault.as_ref().map(|fault| fault.key);
        let mut remains = Remains::default();
        self.engine.dissolve(until, &mut remains);
        for (key, head, body) in remains.in_flight {
            let is_own = head.link().is_none() || head.class == Class::HandOver;
            if !self.is_live(head.sender) || !is_own {
                continue;
            }
            let flow = FlowKey {
                class: OutputClass::Message,
                actor: head.sender,
                receiver: head.receiver,
                kind: head.kind().unwrap_or_default(),
            };
            let seen = Seen {
                ordinal: head.ordinal,
                time: head.sent(key),
                cause: head.cause().unwrap_or(key),
                match_key: head.match_key(),
                body: &body,
            };
            self.comparer.meet(Side::Replayed, flow, seen);
        }
    }

    /// Compares the stops that living actors asked for with the recorded one.
    fn compare_stops(&mut self, ended: &mut Ended, is_over: bool) {
        let topology = self.topology.clone();
        let look_ahead = topology.info.look_ahead;
        let recorded = self.recorded_stop.take();
        let recorded = recorded.filter(|(_, by, _)| self.is_live(*by));
        let output = |time: SimTime, why: &str| Output {
            time,
            ordinal: 0,
            match_key: None,
            body: Some(why.as_bytes().to_vec()),
        };
        let mut expected = recorded.map(|(key, by, why)| {
            let bound = Bound {
                time: key.time,
                step: key.step,
            };
            (bound, by, output(key.time, &why))
        });
        for (key, by, why) in std::mem::take(&mut self.stops) {
            let at = stop_of(key, look_ahead);
            if self.comparer.leaves_out(OutputClass::Stop, by, "") {
                continue;
            }
            let own = expected.take_if(|(_, who, _)| *who == by);
            let actual = output(at.time, &why);
            // A stop that would have taken effect after the end is no difference.
            let reached = Bound {
                time: self.last.time,
                step: self.last.step,
            };
            if own.is_none() && (at >= reached || !is_over) {
                continue;
            }
            let field = match &own {
                None => "presence",
                Some((bound, _, expected)) if *bound == at && *expected == actual => "",
                Some((bound, ..)) if *bound != at => "sent",
                Some(_) => "body",
            };
            let expected = own.map(|(.., output)| output);
            ended.add(
                &topology,
                OutputClass::Stop,
                by,
                key,
                field,
                [expected, Some(actual)],
            );
        }
        if let Some((bound, by, expected)) = expected {
            let key = topology.key(bound.time, bound.step, EntityId::CONTROL, 0);
            let pair = [Some(expected), None];
            ended.add(&topology, OutputClass::Stop, by, key, "presence", pair);
        }
    }

    /// Compares the fault in which the replay ended with the recorded one, and says what it was.
    fn compare_fault(&mut self, ended: &mut Ended, end: &RecordEnd) -> Option<String> {
        let topology = self.topology.clone();
        let output = |time: SimTime, text: &str| Output {
            time,
            ordinal: 0,
            match_key: None,
            body: Some(text.as_bytes().to_vec()),
        };
        let recorded = match end {
            RecordEnd::Fault { at, text, .. } => {
                let whose = self.failed(*at, text);
                whose.map(|whose| (*at, whose, text.as_str()))
            }
            _ => None,
        };
        let fault = self.fault.take();
        let actual = fault.as_ref().map(|fault| fault.to_string());
        let expected = recorded.map(|(at, _, text)| output(at, text));
        let whose = match (&fault, recorded) {
            (Some(fault), _) => topology.info.entity(&fault.actor),
            (None, recorded) => recorded.map(|(_, whose, _)| whose),
        };
        if let Some(whose) = whose {
            let time = fault.as_ref().map(|fault| fault.time);
            let own = actual.as_deref().zip(time);
            let own = own.map(|(text, time)| output(time, text));
            let field = match (&expected, &own) {
                (expected, own) if expected == own => "",
                (Some(_), Some(_)) => "body",
                _ => "presence",
            };
            let key = fault.map_or(self.last, |fault| fault.key);
            ended.add(
                &topology,
                OutputClass::Fault,
                whose,
                key,
                field,
                [expected, own],
            );
        }
        actual
    }
}

/// What is compared once all is over.
struct Ended {
    kinds: Vec<KindTally>,
    first: First,
}

impl Ended {
    /// Adds an output that has no flow; `field` is what differs, or empty.
    fn add(
        &mut self,
        topology: &Topology,
        class: OutputClass,
        actor: EntityId,
        key: EventKey,
        field: &'static str,
        [expected, actual]: [Option<Output>; 2],
    ) {
        let mut tally = Tally::default();
        let counted = match (&expected, &actual) {
            _ if field.is_empty() => &mut tally.same,
            (Some(_), Some(_)) => &mut tally.changed,
            (Some(_), None) => &mut tally.missing,
            _ => &mut tally.extra,
        };
        *counted += 1;
        self.kinds.push(KindTally {
            actor: topology.name(actor).to_owned(),
            class,
            kind: String::new(),
            tally,
            left_out: false,
        });
        let order = (key, u64::MAX);
        let is_first = self.first.as_ref().is_none_or(|(first, _)| order < *first);
        if !field.is_empty() && is_first {
            let difference = Difference {
                class,
                actor: topology.name(actor).to_owned(),
                receiver: String::new(),
                kind: String::new(),
                field,
                expected,
                actual,
                event: None,
                input: None,
            };
            self.first = Some((order, difference));
        }
    }
}
