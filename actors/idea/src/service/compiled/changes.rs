//! A cycle on the table without copies: what began and ended is read from where the table has it.

use std::fmt;

use farside_planning::Ticks;
use farside_planning::model::{PredicateId, Value};

use super::Compiled;
use super::table::{Lane, NONE, Row as TableRow};
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

#[derive(Clone, Copy)]
enum Values<'a> {
    Known(&'a [Option<Value>]),
    /// From constants and registers, by a row.
    Row(&'a Compiled, u32),
}

impl fmt::Debug for Values<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(Row(*self).iter()).finish()
    }
}

impl Row<'_> {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self.0 {
            Values::Known(values) => values.len(),
            Values::Row(table, row) => usize::from(table.table.rows[row as usize].count),
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
            Values::Row(of, row) => {
                let sources = of.table.sources(&of.table.rows[row as usize]);
                of.table.names.value(sources[place], &of.registers)
            }
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
    #[inline]
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
    #[inline]
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
    #[inline]
    pub(super) fn lists(&self) -> (&[Started], &[Ended]) {
        match self.recent {
            Recent::Listed => (&self.started, &self.ended),
            _ => (&[], &[]),
        }
    }

    /// The rows of what ended and of what began, if that is not listed.
    #[inline]
    fn rows(&self) -> (&[u32], &[u32]) {
        match self.recent {
            Recent::Row(effect) => {
                let effect = &self.table.effects[effect as usize];
                (self.table.ended(effect), self.table.started(effect))
            }
            _ => (&[], &[]),
        }
    }

    #[inline]
    fn began(&self, row: u32, started: bool) -> Began<'_> {
        let at = &self.table.rows[row as usize];
        let (contract, start) = which(&self.lanes, at, started);
        Began {
            contract,
            predicate: usize::from(at.predicate),
            start,
            parameters: Row(Values::Row(self, row)),
        }
    }

    /// Copies what began and ended to the lists. Of what is of the same effect as what they had,
    /// only what differs is copied.
    pub(super) fn list(&mut self, effect: u32) {
        let (table, lanes, registers) = (&self.table, &self.lanes, &self.registers);
        let now = self.now;
        let at = &table.effects[effect as usize];
        let (ended, started) = (table.ended(at), table.started(at));
        if self.listed == effect {
            for (at, &row) in self.started.iter_mut().zip(started) {
                (at.contract, _) = which(lanes, &table.rows[row as usize], true);
                table.update(&mut at.parameters, row, registers);
            }
            for (at, &row) in self.ended.iter_mut().zip(ended) {
                (at.contract, at.start) = which(lanes, &table.rows[row as usize], false);
                at.finish = now;
                table.update(&mut at.parameters, row, registers);
            }
        } else {
            self.started.clear();
            self.started.extend(started.iter().map(|&row| {
                let at = &table.rows[row as usize];
                Started {
                    contract: which(lanes, at, true).0,
                    predicate: usize::from(at.predicate),
                    parameters: table.parameters(row, registers),
                }
            }));
            self.ended.clear();
            self.ended.extend(ended.iter().map(|&row| {
                let at = &table.rows[row as usize];
                let (contract, start) = which(lanes, at, false);
                Ended {
                    contract,
                    predicate: usize::from(at.predicate),
                    start,
                    finish: now,
                    parameters: table.parameters(row, registers),
                }
            }));
        }
        (self.listed, self.recent) = (effect, Recent::Listed);
    }
}

/// Which token a row is of, and when that began.
#[inline]
fn which(lanes: &[Lane], row: &TableRow, started: bool) -> (Contract, Ticks) {
    let lane = &lanes[usize::from(row.timeline)];
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
