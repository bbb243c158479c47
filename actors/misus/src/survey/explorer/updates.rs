//! What the hardware says of itself now and then, and what of it is not as planned.

use farside::prelude::*;
use farside_actors::rover::RoverState;

use super::{Explorer, UpdateDue, bits};
use crate::shac::Reason;
use crate::sharing::RoverMove;
use crate::survey::messages::{Activity, ReplanCause};

/// By which share of what the battery holds its charge may be below what was planned.
const LESS_CHARGE: f64 = 0.05;

/// By which share it has to be above what was planned for there to be room for more.
const MORE_CHARGE: f64 = 0.15;

/// By which share of its size memory may be fuller than planned.
const FULLER: f64 = 0.05;

/// The least power of a clean array that says how clean an array is \[W\].
const LEAST_ARRAY_W: f64 = 10.0;

impl Explorer {
    /// Sets the timer for the next question: in time for the hardware's lease, too.
    pub(super) fn update_later(&self, ctx: &mut Context<'_, Self>) {
        let every = self.shared.execution.update_every;
        let lease = self.shared.site.renew_every;
        ctx.timer(lease.map_or(every, |lease| lease.min(every)), UpdateDue);
    }

    /// The share of its power that the array yields, as far as it can be told now.
    pub(super) fn note_array(&mut self, now_ms: i64, state: &RoverState) {
        let should_w = self.outlook.forecast().array_w(now_ms);
        if should_w >= LEAST_ARRAY_W {
            self.clean = (state.solar_w / should_w).clamp(0.0, 1.0);
        }
    }

    /// Whether battery and memory are not as planned.
    fn compare(&mut self, now_ms: i64, state: &RoverState) {
        let Some(plan) = &self.log.plan else {
            return;
        };
        let more_j = state.battery_j - plan.profile.at_j(now_ms);
        let less = -LESS_CHARGE * state.battery_capacity_j;
        if more_j < less {
            self.plan_anew(ReplanCause::Power);
        } else if more_j > MORE_CHARGE * state.battery_capacity_j {
            let lacks_power = plan.left_out.iter().any(|(_, why)| *why == Reason::Power);
            if lacks_power {
                self.has_gained = true;
                self.plan_anew(ReplanCause::Power);
            }
        }
        let plan = self.log.plan.as_ref();
        let size_bits = bits(state.memory_size_bytes);
        let most_bits = (FULLER * size_bits as f64) as i64;
        let planned = plan.map(|plan| plan.memory_at(now_ms));
        let is_fuller = planned.is_some_and(|at| bits(state.memory_used_bytes) - at > most_bits);
        if is_fuller || self.memory_size_bits.is_some_and(|size| size != size_bits) {
            self.plan_anew(ReplanCause::Memory);
        }
        self.memory_size_bits = Some(size_bits);
    }

    /// A new sol has begun: what was given up may be taken again, and what was missed is missed.
    fn note_sol(&mut self, ctx: &mut Context<'_, Self>, now_ms: i64) {
        let sol = self.outlook.forecast().sol_at(now_ms);
        if sol == self.log.sol {
            return;
        }
        for before in self.log.sol..sol {
            self.miss(ctx, before);
        }
        self.log.sol = sol;
        self.log.communication_tries = 0;
        self.log
            .given_up
            .retain(|_, (_, given_up)| *given_up >= sol);
        let given_up = self.log.given_up.iter();
        self.desk.refuses = given_up
            .map(|(goal, (reason, _))| (*goal, *reason))
            .collect();
        self.has_gained = true;
        self.desk.moves.push_back(RoverMove::CapacityChanged);
        self.plan_anew(ReplanCause::Sol);
    }
}

impl Handler<UpdateDue> for Explorer {
    fn handle(&mut self, _: UpdateDue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.update_later(ctx);
        self.ask(ctx)
    }
}

impl Handler<RoverState> for Explorer {
    fn handle(&mut self, state: RoverState, ctx: &mut Context<'_, Self>) -> Outcome {
        let now_ms = Self::now_ms(ctx);
        self.is_asking = false;
        self.note_array(now_ms, &state);
        self.state = Some((ctx.now(), state.clone()));
        self.tell_ended(ctx, &state);
        self.note_sol(ctx, now_ms);
        if std::mem::take(&mut self.is_restarted) {
            self.pick_up(ctx, &state)?;
        }
        if self.log.under.is_none() && (state.asleep || !state.running.is_empty()) {
            // Nobody waits for it: what was begun before a crash.
            self.stop_all(ctx)?;
        }
        let is_dark = !self.outlook.forecast().is_light(now_ms);
        if self.drives() && self.broken_off.is_none() {
            if is_dark {
                self.break_off(ctx, Reason::Time)?;
            } else if self.must_rest() {
                self.break_off(ctx, Reason::Power)?;
            }
        }
        let sleeps = self.log.under.as_ref();
        let sleeps = sleeps.is_some_and(|under| under.piece.activity == Activity::Sleep);
        if !sleeps && !state.brown_out {
            self.compare(now_ms, &state);
        }
        self.settle_goals(ctx)
    }
}
