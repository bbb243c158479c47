//! A cycle on the table without copies: what began and ended is read from where the table has it.

use farside_planning::Ticks;
use farside_planning::model::{PredicateId, Value};

use super::Compiled;
use super::table::Transition;
use crate::service::{Contract, Ended, Outcome, Started};

/// Where what began and ended with the last cycle stands.
#[derive(Clone, Copy, Debug)]
pub(super) enum Recent {
    /// In the lists of tokens.
    Listed,
    /// In a transition's row, with the registers of before.
    Row(Transition),
}

/// A token that began or ended with the last cycle.
#[derive(Clone, Copy, Debug)]
pub struct Began<'a> {
    /// Which.
    pub contract: Contract,
    /// What it says.
    pub predicate: PredicateId,
    /// When it began \[ticks\].
    pub start: Ticks,
    /// The values of its parameters.
    pub parameters: Row<'a>,
}

/// Values of parameters: each is read when it is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a>(Values<'a>);

#[derive(Clone, Copy, Debug)]
enum Values<'a> {
    Known(&'a [Option<Value>]),
    /// From constants and registers.
    Sources {
        sources: &'a [u32],
        names: &'a super::Names,
        registers: &'a [Option<Value>],
    },
}

impl Row<'_> {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self.0 {
            Values::Known(values) => values.len(),
            Values::Sources { sources, .. } => sources.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One of them; none, if it is not known.
    ///
    /// # Panics
    ///
    /// If there are no more than `place`.
    #[inline]
    pub fn get(&self, place: usize) -> Option<Value> {
        match self.0 {
            Values::Known(values) => values[place],
            Values::Sources {
                sources,
                names,
                registers,
            } => names.value(sources[place], registers),
        }
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = Option<Value>> {
        (0..self.len()).map(|place| self.get(place))
    }
}

impl Compiled {
    /// As [`solve`](crate::service::PlanService::solve), but nothing is copied that the table has: what began and
    /// ended is read with [`each_started`](Self::each_started) and [`each_ended`](Self::each_ended).
    /// [`started`](crate::service::PlanService::started) and
    /// [`ended`](crate::service::PlanService::ended) are then empty, or what
    /// the interpreter decided.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use farside_idea::service::{Outcome, PlanService, compiled::Compiled};
    /// use farside_planning::language::{Options, read_model};
    /// # let text = include_str!("../../../../planning/models/polling.ddl");
    /// let model = read_model("polling.ddl", text, &Options::default()).value.expect("it is right");
    /// let mut service = Compiled::new(Arc::new(model)).expect("it can be a table");
    /// assert_eq!(service.decide(1, 10_000), Outcome::Decided);
    /// let poll = service.each_started().next().expect("it polls").contract;
    /// service.advance(1);
    /// service.bind(poll, &[None, Some(301), Some(1)], true).expect("the poll is active");
    /// assert_eq!(service.decide(1, 10_000), Outcome::Decided);
    /// let ended = service.each_ended().next().expect("the poll ended");
    /// assert_eq!((ended.contract, ended.parameters.get(1)), (poll, Some(301)));
    /// ```
    pub fn decide(&mut self, horizon: Ticks, budget: u64) -> Outcome {
        self.started.clear();
        self.ended.clear();
        self.recent = Recent::Listed;
        let spent = 1 + self.posted.len() as u64;
        let known = { self.node.filter(|_| self.interpreter.is_none()) }
            .and_then(|node| self.nodes[node as usize].transition);
        match known {
            Some(_) if spent > budget => {
                // What was posted stands, and the interpreter keeps it.
                self.wake();
                self.node = None;
                Outcome::OverBudget
            }
            Some(transition) => {
                self.counters.operations += spent;
                let transition = self.transitions[transition as usize];
                self.follow(transition);
                self.recent = Recent::Row(transition);
                Outcome::Decided
            }
            None => self.interpret(horizon, budget),
        }
    }

    /// The tokens that have begun with the last cycle, by timeline.
    pub fn each_started(&self) -> impl Iterator<Item = Began<'_>> {
        let listed = self.started.iter().map(|at| Began {
            contract: at.contract,
            predicate: at.predicate,
            start: self.now,
            parameters: Row(Values::Known(&at.parameters)),
        });
        let at = self.transition();
        let skipped = at.map_or(0, |at| at.ended);
        listed.chain(self.rows(true).skip(usize::from(skipped)))
    }

    /// The tokens that have ended with the last cycle, by timeline.
    pub fn each_ended(&self) -> impl Iterator<Item = Began<'_>> {
        let listed = self.ended.iter().map(|at| Began {
            contract: at.contract,
            predicate: at.predicate,
            start: at.start,
            parameters: Row(Values::Known(&at.parameters)),
        });
        let at = self.transition();
        let count = at.map_or(0, |at| at.ended);
        listed.chain(self.rows(false).take(usize::from(count)))
    }

    fn transition(&self) -> Option<Transition> {
        match self.recent {
            Recent::Listed => None,
            Recent::Row(at) => Some(at),
        }
    }

    /// What the last transition names: what ended, and then what started.
    fn rows(&self, started: bool) -> impl Iterator<Item = Began<'_>> {
        let (mut code, mut left) = match self.transition() {
            Some(at) => {
                let before = u32::from(at.cells) + u32::from(at.ends) + u32::from(at.started);
                let code = &self.codes[(at.code + before) as usize..];
                (code, at.ended + at.started)
            }
            None => (&[][..], 0),
        };
        std::iter::from_fn(move || {
            left = left.checked_sub(1)?;
            let (sources, rest) = code[2..].split_at(code[1] as usize);
            let timeline = code[0] >> 16;
            let predicate = (code[0] & 0xffff) as PredicateId;
            code = rest;
            let lane = &self.lanes[timeline as usize];
            // On its timeline another has begun.
            let (number, start) = match started {
                true => (lane.number, lane.start),
                false => (lane.number - 1, lane.before),
            };
            let contract = Contract {
                timeline: timeline as u16,
                number,
            };
            let parameters = Row(Values::Sources {
                sources,
                names: &self.names,
                registers: &self.spare.cells,
            });
            Some(Began {
                contract,
                predicate,
                start,
                parameters,
            })
        })
    }

    /// Copies what began and ended to the lists.
    pub(super) fn list(&mut self) {
        let (mut started, mut ended) = (
            std::mem::take(&mut self.started),
            std::mem::take(&mut self.ended),
        );
        started.extend(self.each_started().map(|at| Started {
            contract: at.contract,
            predicate: at.predicate,
            parameters: at.parameters.iter().collect(),
        }));
        ended.extend(self.each_ended().map(|at| Ended {
            contract: at.contract,
            predicate: at.predicate,
            start: at.start,
            finish: self.now,
            parameters: at.parameters.iter().collect(),
        }));
        (self.started, self.ended) = (started, ended);
        self.recent = Recent::Listed;
    }
}
