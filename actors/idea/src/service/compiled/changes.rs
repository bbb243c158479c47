//! A cycle on the table without copies: what began and ended is read from where the table has it.

use farside_planning::Ticks;
use farside_planning::model::{PredicateId, Value};

use super::Compiled;
use super::table::{NONE, Names, Registers, Row as TableRow};
use crate::service::{Contract, Ended, Outcome, Started};

/// Where what began and ended with the last cycle stands.
#[derive(Clone, Copy, Debug)]
pub(super) enum Recent {
    /// In the lists of tokens.
    Listed,
    /// In the rows that an effect names, with the registers of before.
    Row(u32),
    /// Nowhere any more: another cycle goes on.
    Gone,
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
        names: &'a Names,
        registers: &'a Registers,
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
    /// As [`solve`](crate::service::PlanService::solve), but nothing is copied that the table has: what
    /// began and ended is read with [`each_started`](Self::each_started) and
    /// [`each_ended`](Self::each_ended), until something is posted or it is another tick.
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
        self.settle();
        let spent = 1 + self.posted.len() as u64;
        if self.interpreter.is_none()
            && let Some(node) = self.node
        {
            let node = self.table.nodes[node as usize];
            if node.effect != NONE && spent <= budget {
                self.counters.operations += spent;
                self.follow(node);
                self.recent = Recent::Row(node.effect);
                return Outcome::Decided;
            }
            if node.effect != NONE {
                // What was posted stands, and the interpreter keeps it.
                self.clear_lists();
                self.wake();
                self.node = None;
                return Outcome::OverBudget;
            }
        }
        self.clear_lists();
        self.interpret(horizon, budget)
    }

    fn clear_lists(&mut self) {
        self.started.clear();
        self.ended.clear();
        (self.listed, self.recent) = (NONE, Recent::Listed);
    }

    /// The tokens that have begun with the last cycle, by timeline.
    pub fn each_started(&self) -> impl Iterator<Item = Began<'_>> {
        let listed = self.lists().0.iter().map(|at| Began {
            contract: at.contract,
            predicate: at.predicate,
            start: self.now,
            parameters: Row(Values::Known(&at.parameters)),
        });
        listed.chain(self.rows().1.iter().map(|&row| self.began(row, true)))
    }

    /// The tokens that have ended with the last cycle, by timeline.
    pub fn each_ended(&self) -> impl Iterator<Item = Began<'_>> {
        let listed = self.lists().1.iter().map(|at| Began {
            contract: at.contract,
            predicate: at.predicate,
            start: at.start,
            parameters: Row(Values::Known(&at.parameters)),
        });
        listed.chain(self.rows().0.iter().map(|&row| self.began(row, false)))
    }

    /// What began and ended, if that is listed.
    pub(super) fn lists(&self) -> (&[Started], &[Ended]) {
        match self.recent {
            Recent::Listed => (&self.started, &self.ended),
            _ => (&[], &[]),
        }
    }

    /// The rows of what ended and of what began, if that is not listed.
    fn rows(&self) -> (&[u32], &[u32]) {
        match self.recent {
            Recent::Row(effect) => {
                let effect = &self.table.effects[effect as usize];
                let [.., ended, started] = self.table.named(effect);
                (ended, started)
            }
            _ => (&[], &[]),
        }
    }

    #[inline]
    fn began(&self, row: u32, started: bool) -> Began<'_> {
        let row = &self.table.rows[row as usize];
        let (contract, start) = self.which(row, started);
        Began {
            contract,
            predicate: usize::from(row.predicate),
            start,
            parameters: Row(Values::Sources {
                sources: self.table.sources(row),
                names: &self.table.names,
                registers: &self.registers,
            }),
        }
    }

    /// Which token a row is of, and when that began.
    #[inline]
    fn which(&self, row: &TableRow, started: bool) -> (Contract, Ticks) {
        let lane = &self.lanes[usize::from(row.timeline)];
        // On its timeline another has begun, if it ended.
        let (number, start) = match started {
            true => (lane.number, lane.start),
            false => (lane.number - 1, lane.before),
        };
        let contract = Contract {
            timeline: row.timeline,
            number,
        };
        (contract, start)
    }

    /// Copies what began and ended to the lists. If they are of the same effect as before, only
    /// what differs is copied.
    pub(super) fn list(&mut self, effect: u32) {
        let (mut started, mut ended) = (
            std::mem::take(&mut self.started),
            std::mem::take(&mut self.ended),
        );
        let (rows_ended, rows_started) = self.rows();
        let names = &self.table.names;
        if self.listed == effect {
            for (at, &row) in started.iter_mut().zip(rows_started) {
                let row = &self.table.rows[row as usize];
                at.contract.number = self.lanes[usize::from(row.timeline)].number;
                for pair in self.table.varying(row).chunks_exact(2) {
                    at.parameters[pair[0] as usize] = names.value(pair[1], &self.registers);
                }
            }
            for (at, &row) in ended.iter_mut().zip(rows_ended) {
                let row = &self.table.rows[row as usize];
                (at.contract, at.start) = self.which(row, false);
                at.finish = self.now;
                for pair in self.table.varying(row).chunks_exact(2) {
                    at.parameters[pair[0] as usize] = names.value(pair[1], &self.registers);
                }
            }
        } else {
            started.clear();
            started.extend(self.each_started().map(|at| Started {
                contract: at.contract,
                predicate: at.predicate,
                parameters: at.parameters.iter().collect(),
            }));
            ended.clear();
            ended.extend(self.each_ended().map(|at| Ended {
                contract: at.contract,
                predicate: at.predicate,
                start: at.start,
                finish: self.now,
                parameters: at.parameters.iter().collect(),
            }));
        }
        (self.started, self.ended) = (started, ended);
        (self.listed, self.recent) = (effect, Recent::Listed);
    }
}
