//! A legacy system at the other end of registers: it carries procedures out in a time drawn for each,
//! and says `ok`.

use std::collections::BTreeMap;

use farside::prelude::*;
use farside_idea::register::{
    AgentOffline, Backoff, ContractEnd, Controlled, RegisterAck, RegisterLoad, RegisterStatus,
    RegisterValue, Taken,
};
use serde::{Deserialize, Serialize};

/// How long a procedure takes at least and at most.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    pub(crate) least: SimDuration,
    pub(crate) most: SimDuration,
}

pub(crate) struct Plant {
    agent: String,
    pace: Pace,
    backoff: Backoff,
}

#[derive(Default)]
struct Registers(BTreeMap<String, Controlled>);

#[derive(Serialize, Deserialize)]
pub(crate) struct Done {
    register: String,
    epoch: u32,
    number: u32,
}

#[derive(Serialize, Deserialize)]
pub(crate) struct SayAgain {
    register: String,
}

impl Plant {
    pub(crate) fn new(agent: &str, pace: Pace, backoff: Backoff) -> Self {
        let agent = agent.to_owned();
        Plant {
            agent,
            pace,
            backoff,
        }
    }

    fn register<'a>(&self, ctx: &'a mut Context<'_, Self>, name: &str) -> &'a mut Controlled {
        let new = || Controlled::new(name.into(), self.backoff);
        ctx.durable::<Registers>()
            .0
            .entry(name.to_owned())
            .or_insert_with(new)
    }

    fn say(&self, ctx: &mut Context<'_, Self>, status: RegisterStatus) -> Outcome {
        let register = status.register.to_string();
        ctx.timer(self.backoff.first, SayAgain { register });
        ctx.send(ctx.recipient::<RegisterStatus>(&self.agent)?, status);
        Ok(())
    }
}

impl Actor for Plant {
    type Accepts = (
        RegisterLoad,
        RegisterStatus,
        RegisterAck,
        AgentOffline,
        Done,
        SayAgain,
    );
}

impl Handler<RegisterLoad> for Plant {
    fn handle(&mut self, load: RegisterLoad, ctx: &mut Context<'_, Self>) -> Outcome {
        let now = ctx.now();
        let controlled = self.register(ctx, &load.register);
        let taken = controlled.take(&load, now);
        let ack = controlled.ack();
        match taken {
            Taken::Yes => {
                if &*load.procedure == "Go" {
                    let [least, most] =
                        [self.pace.least, self.pace.most].map(SimDuration::as_nanos);
                    let wait_ns = least + ctx.random("pace").below(most - least + 1);
                    let done = Done {
                        register: load.register.to_string(),
                        epoch: load.epoch,
                        number: load.number,
                    };
                    ctx.timer(SimDuration::from_nanos(wait_ns), done);
                }
                ctx.send(ctx.recipient::<RegisterAck>(&self.agent)?, ack);
                Ok(())
            }
            Taken::Before(Some(status)) => self.say(ctx, status),
            Taken::Before(None) => {
                ctx.send(ctx.recipient::<RegisterAck>(&self.agent)?, ack);
                Ok(())
            }
            Taken::Old | Taken::Early => Ok(()),
        }
    }
}

impl Handler<Done> for Plant {
    fn handle(&mut self, done: Done, ctx: &mut Context<'_, Self>) -> Outcome {
        let now = ctx.now();
        let controlled = self.register(ctx, &done.register);
        if controlled.contract() != (done.epoch, done.number) {
            return Ok(());
        }
        let outputs = vec![Some(RegisterValue::Symbol("ok".into()))];
        match controlled.say(outputs, ContractEnd::Ended, now) {
            Some(status) => self.say(ctx, status),
            None => Ok(()),
        }
    }
}

impl Handler<SayAgain> for Plant {
    fn handle(&mut self, again: SayAgain, ctx: &mut Context<'_, Self>) -> Outcome {
        let now = ctx.now();
        match self.register(ctx, &again.register).repeat(now) {
            Some((status, _)) => self.say(ctx, status),
            None => Ok(()),
        }
    }
}

impl Handler<RegisterAck> for Plant {
    fn handle(&mut self, ack: RegisterAck, ctx: &mut Context<'_, Self>) -> Outcome {
        self.register(ctx, &ack.register).acknowledged(&ack);
        Ok(())
    }
}

impl Handler<RegisterStatus> for Plant {
    fn handle(&mut self, _: RegisterStatus, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

impl Handler<AgentOffline> for Plant {
    fn handle(&mut self, _: AgentOffline, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}
