//! The ground: sends goals on a register, one after the other, each once its time has come and the one
//! before it is answered.

use std::sync::Arc;

use farside::prelude::*;
use serde::{Deserialize, Serialize};

use crate::register::{
    AgentOffline, Backoff, Controlling, Heard, RegisterAck, RegisterLoad, RegisterStatus,
    RegisterValue,
};

/// A procedure that the ground asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Order {
    /// Not before this time of the run.
    pub(crate) at: SimDuration,
    pub(crate) procedure: Arc<str>,
    pub(crate) inputs: Vec<RegisterValue>,
}

/// The ground, as far as one rover is concerned.
#[derive(Clone)]
pub(crate) struct GroundSetup {
    /// The register's name.
    pub(crate) register: Arc<str>,
    /// The actor on its other side.
    pub(crate) agent: String,
    pub(crate) backoff: Backoff,
    /// What is asked for, in order.
    pub(crate) orders: Vec<Order>,
    /// What the register says when there is nothing to ask for.
    pub(crate) nothing: Arc<str>,
}

/// The ground.
pub(crate) struct Ground {
    setup: Arc<GroundSetup>,
    controlling: Option<Controlling>,
    /// Whether an order waits for its answer.
    is_waiting: bool,
}

/// How many orders were answered, and how often the ground began anew: what outlives a crash.
#[derive(Default)]
struct Progress {
    lives: u32,
    answered: usize,
}

/// Timer: it is time for the next order.
#[derive(Serialize, Deserialize)]
pub(crate) struct OrderDue;

/// Timer: something is to be said again.
#[derive(Serialize, Deserialize)]
pub(crate) struct OrderRepeats;

impl Ground {
    pub(crate) fn new(setup: Arc<GroundSetup>) -> Self {
        Ground {
            setup,
            controlling: None,
            is_waiting: false,
        }
    }

    /// Waits for the time of the next order, if there is one.
    fn wait(&self, ctx: &mut Context<'_, Self>) {
        let answered = ctx.durable::<Progress>().answered;
        if let Some(order) = self.setup.orders.get(answered) {
            let wait = (SimTime::ZERO + order.at).since(ctx.now());
            ctx.timer(wait, OrderDue);
        }
    }

    /// Loads the register.
    fn load(
        &mut self,
        procedure: Arc<str>,
        inputs: Vec<RegisterValue>,
        ctx: &mut Context<'_, Self>,
    ) -> Outcome {
        let now = ctx.now();
        let Some(controlling) = &mut self.controlling else {
            return Ok(());
        };
        let load = controlling.load(procedure, inputs, now);
        self.send(load, 0, ctx)
    }

    fn send(&self, load: RegisterLoad, before: u32, ctx: &mut Context<'_, Self>) -> Outcome {
        let to = ctx.recipient::<RegisterLoad>(&self.setup.agent)?;
        let key = crate::agent::key(load.number, 0, load.epoch, before);
        ctx.send_keyed(to, key, load);
        let due = self.controlling.as_ref().and_then(Controlling::due);
        if let Some(due) = due {
            ctx.timer(due.since(ctx.now()), OrderRepeats);
        }
        Ok(())
    }
}

impl Actor for Ground {
    type Accepts = (
        RegisterLoad,
        RegisterStatus,
        RegisterAck,
        AgentOffline,
        OrderDue,
        OrderRepeats,
    );

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let progress = ctx.durable::<Progress>();
        progress.lives += 1;
        let (lives, setup) = (progress.lives, &self.setup);
        let controlling = Controlling::new(setup.register.clone(), lives, setup.backoff);
        self.controlling = Some(controlling);
        self.wait(ctx);
        Ok(())
    }
}

impl Handler<OrderDue> for Ground {
    fn handle(&mut self, _: OrderDue, ctx: &mut Context<'_, Self>) -> Outcome {
        let answered = ctx.durable::<Progress>().answered;
        let Some(order) = self.setup.orders.get(answered).cloned() else {
            return Ok(());
        };
        self.is_waiting = true;
        self.load(order.procedure, order.inputs, ctx)
    }
}

impl Handler<OrderRepeats> for Ground {
    fn handle(&mut self, _: OrderRepeats, ctx: &mut Context<'_, Self>) -> Outcome {
        let now = ctx.now();
        let again = self.controlling.as_mut().and_then(|one| one.repeat(now));
        match again {
            Some((load, before)) => self.send(load, before, ctx),
            None => Ok(()),
        }
    }
}

impl Handler<RegisterStatus> for Ground {
    fn handle(&mut self, status: RegisterStatus, ctx: &mut Context<'_, Self>) -> Outcome {
        let Some(controlling) = &mut self.controlling else {
            return Ok(());
        };
        let heard = controlling.status(&status);
        let to = ctx.recipient::<RegisterAck>(&self.setup.agent)?;
        ctx.send(to, Controlling::ack(&status));
        if !matches!(heard, Heard::News { .. }) || !std::mem::take(&mut self.is_waiting) {
            return Ok(());
        }
        ctx.durable::<Progress>().answered += 1;
        let nothing = self.setup.nothing.clone();
        self.load(nothing, Vec::new(), ctx)?;
        self.wait(ctx);
        Ok(())
    }
}

impl Handler<RegisterAck> for Ground {
    fn handle(&mut self, ack: RegisterAck, _: &mut Context<'_, Self>) -> Outcome {
        if let Some(controlling) = &mut self.controlling {
            controlling.acknowledged(&ack);
        }
        Ok(())
    }
}

/// Nobody controls the ground.
impl Handler<RegisterLoad> for Ground {
    fn handle(&mut self, _: RegisterLoad, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

/// It goes on saying what it wants until somebody hears it.
impl Handler<AgentOffline> for Ground {
    fn handle(&mut self, _: AgentOffline, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}
