//! Who commands a graph: one goal after the other, each with a number of its own, with pauses.

use farside::prelude::*;
use farside_idea::register::{
    AgentOffline, Controlling, Heard, RegisterAck, RegisterLoad, RegisterStatus, RegisterValue,
};
use serde::{Deserialize, Serialize};

use crate::graph::BACKOFF;

pub(crate) struct Ground {
    agent: String,
    controlling: Controlling,
    goals: i64,
    next: i64,
    most_pause: SimDuration,
}

#[derive(Serialize, Deserialize)]
pub(crate) struct NextGoal;

#[derive(Serialize, Deserialize)]
pub(crate) struct Again;

impl Ground {
    pub(crate) fn new(register: &str, agent: &str, goals: i64, most_pause: SimDuration) -> Self {
        Ground {
            agent: agent.to_owned(),
            controlling: Controlling::new(register.into(), 1, BACKOFF),
            goals,
            next: 1,
            most_pause,
        }
    }

    fn pause(&self, ctx: &mut Context<'_, Self>) {
        let wait_ns = 1 + ctx.random("pause").below(self.most_pause.as_nanos());
        ctx.timer(SimDuration::from_nanos(wait_ns), NextGoal);
    }
}

impl Actor for Ground {
    type Accepts = (
        RegisterLoad,
        RegisterStatus,
        RegisterAck,
        AgentOffline,
        NextGoal,
        Again,
    );

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.pause(ctx);
        ctx.timer(BACKOFF.first, Again);
        Ok(())
    }
}

impl Handler<NextGoal> for Ground {
    fn handle(&mut self, _: NextGoal, ctx: &mut Context<'_, Self>) -> Outcome {
        if self.next > self.goals {
            return Ok(());
        }
        let inputs = vec![RegisterValue::Number(self.next)];
        self.next += 1;
        let load = self.controlling.load("Go".into(), inputs, ctx.now());
        ctx.send(ctx.recipient::<RegisterLoad>(&self.agent)?, load);
        Ok(())
    }
}

impl Handler<Again> for Ground {
    fn handle(&mut self, _: Again, ctx: &mut Context<'_, Self>) -> Outcome {
        if let Some((load, _)) = self.controlling.repeat(ctx.now()) {
            ctx.send(ctx.recipient::<RegisterLoad>(&self.agent)?, load);
        }
        ctx.timer(BACKOFF.first, Again);
        Ok(())
    }
}

impl Handler<RegisterStatus> for Ground {
    fn handle(&mut self, status: RegisterStatus, ctx: &mut Context<'_, Self>) -> Outcome {
        if let Heard::News { .. } = self.controlling.status(&status) {
            self.pause(ctx);
        }
        ctx.send(
            ctx.recipient::<RegisterAck>(&self.agent)?,
            Controlling::ack(&status),
        );
        Ok(())
    }
}

impl Handler<RegisterAck> for Ground {
    fn handle(&mut self, ack: RegisterAck, _: &mut Context<'_, Self>) -> Outcome {
        self.controlling.acknowledged(&ack);
        Ok(())
    }
}

impl Handler<RegisterLoad> for Ground {
    fn handle(&mut self, _: RegisterLoad, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

impl Handler<AgentOffline> for Ground {
    fn handle(&mut self, _: AgentOffline, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}
