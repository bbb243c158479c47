//! Planning anew: what is known becomes a plan, and the plan comes into force unless it is stale by then.

use farside::prelude::*;
use farside_actors::rover::RoverState;

use super::goals::goal_of;
use super::{Explorer, InHand, PlanDue, PlanReady, bits, millis, planned};
use crate::shac::{GoalKey, Parameter, Parameters, Reason};
use crate::sharing::RoverMove;
use crate::survey::messages::{
    Activity, ActivityEnd, ActivityEnded, PlanMade, ReplanCause, UnmetGoal,
};
use crate::survey::outlook::{Known, Piece, Plan};

/// The least time from the beginning of a plan to that of the next.
const LEAST_BETWEEN: SimDuration = SimDuration::from_secs(1);

impl Explorer {
    /// Begins a plan, if there is a reason and none is in hand.
    pub(super) fn plan_now(&mut self, ctx: &mut Context<'_, Self>, state: &RoverState) -> Outcome {
        if self.in_hand.is_some() || state.brown_out {
            return Ok(());
        }
        // Whatever goes wrong, a rover does not do nothing but plan.
        let earliest = self.planned + LEAST_BETWEEN;
        if self.cause.is_some() && self.log.plans > 0 && ctx.now() < earliest {
            if !std::mem::replace(&mut self.is_waiting, true) {
                ctx.timer(earliest.since(ctx.now()), PlanDue);
            }
            return Ok(());
        }
        let Some(cause) = self.cause.take() else {
            return Ok(());
        };
        self.planned = ctx.now();
        let now_ms = Self::now_ms(ctx);
        let known = self.known(now_ms, state, cause);
        self.log.plans += 1;
        let number = self.log.plans;
        let before = self.log.plan.as_ref();
        let plan = self.outlook.plan(&known, before, number);
        let mut plan = plan.map_err(|error| HandlerError::new(error.to_string()))?;
        // Bids are worked out on the same processor.
        plan.operations += std::mem::take(&mut self.bid_operations);
        let takes = self.processor.time_for(ctx.now(), plan.operations);
        self.took_ms = (takes.as_nanos() / 1_000_000) as i64;
        self.in_hand = Some(InHand {
            plan,
            cause,
            number,
            edition: self.log.list.edition,
            known,
            is_stale: false,
        });
        ctx.timer(takes, PlanReady { number });
        Ok(())
    }

    /// What is known now.
    pub(super) fn known(&mut self, now_ms: i64, state: &RoverState, cause: ReplanCause) -> Known {
        let fixed = self.fixed(now_ms, state);
        let is_fixed = |goal: &GoalKey| {
            let mut fixed = fixed.iter();
            fixed.any(|piece| piece.activity == Activity::Goal(*goal))
        };
        let mut goals = self.own_goals();
        goals.retain(|goal| !is_fixed(&goal.key));
        let gained = std::mem::take(&mut self.has_gained);
        Known {
            now_ms,
            // Whoever stands before a rock is where it is observed from.
            position_m: self
                .there_m
                .unwrap_or([state.pose.east_m, state.pose.north_m]),
            battery_j: state.battery_j,
            clean: self.clean,
            memory_bits: bits(state.memory_used_bytes),
            memory_size_bits: bits(state.memory_size_bytes),
            fixed,
            goals,
            worth: self.worth(),
            held: self.held_by_others(),
            achieved: self.achieved(),
            communicated: self.log.communicated.clone(),
            has_gained: gained || cause == ReplanCause::Early,
        }
    }

    /// What runs and what is committed: what begins within the commit window, or before a plan can be
    /// ready. A drive brings what it is for with it. What memory has no room for any more is not committed,
    /// and of what runs it takes what it has room for.
    fn fixed(&mut self, now_ms: i64, state: &RoverState) -> Vec<Piece> {
        let size_bits = bits(state.memory_size_bytes);
        let mut used_bits = bits(state.memory_used_bytes);
        let window = self.shared.execution.commit_window.as_nanos() / 1_000_000;
        let until_ms = now_ms + (window as i64).max(self.took_ms);
        let mut fixed: Vec<Piece> = Vec::new();
        let mut ready_ms = now_ms;
        if let Some(under) = &self.log.under {
            let mut piece = under.piece;
            piece.starts_ms = millis(under.began);
            // What is not done by the end of its window is broken off then.
            let closes_ms = self.closes_ms(piece.activity);
            piece.ends_ms = under.expected_ms.max(now_ms + 1).min(closes_ms.max(now_ms));
            piece.adds_bits = piece.adds_bits.min((size_bits - used_bits).max(0));
            used_bits += piece.adds_bits;
            used_bits -= piece.sends_bits.min(used_bits);
            ready_ms = piece.ends_ms;
            fixed.push(piece);
        }
        for piece in &self.log.ahead.clone() {
            let follows = matches!(
                (fixed.last().map(|at| at.activity), piece.activity),
                (Some(Activity::Drive(before)), Activity::Goal(goal)) if before == goal
            ) || self.is_next(piece, fixed.is_empty());
            if piece.starts_ms > until_ms && !follows {
                break;
            }
            let lasts_ms = match piece.activity {
                Activity::Sleep => piece.ends_ms - piece.starts_ms.max(ready_ms),
                _ => piece.ends_ms - piece.starts_ms,
            };
            if lasts_ms <= 0 {
                continue;
            }
            let starts_ms = match follows {
                true => ready_ms.max(self.opens_ms(piece)),
                false => piece.starts_ms.max(ready_ms),
            };
            let ends_ms = starts_ms + lasts_ms;
            let has_room = used_bits + piece.adds_bits <= size_bits;
            let is_in_time = self.is_in_time(piece, ends_ms);
            if !is_in_time || !has_room || self.endangers_duty(&fixed, piece, ends_ms) {
                break;
            }
            used_bits += piece.adds_bits;
            used_bits -= piece.sends_bits.min(used_bits);
            ready_ms = ends_ms;
            fixed.push(Piece {
                starts_ms,
                ends_ms,
                ..*piece
            });
        }
        fixed
    }

    /// Whether the sol's communication would fail after something else that ends then.
    fn endangers_duty(&mut self, fixed: &[Piece], piece: &Piece, ends_ms: i64) -> bool {
        let sol = self.outlook.forecast().sol_at(piece.starts_ms);
        let duty = Activity::Communication(sol);
        let mut before = fixed.iter().chain([piece]);
        let duty_ms = self.outlook.means().communication_ms;
        let [_, closes_ms] = self.communicates_ms(sol);
        duty_ms > 0
            && !self.log.communicated.contains(&sol)
            && !before.any(|at| at.activity == duty)
            && ends_ms + duty_ms > closes_ms
            && piece.starts_ms < closes_ms
    }

    /// Whether an observation is next and the rover has driven to where it is made.
    fn is_next(&self, piece: &Piece, is_first: bool) -> bool {
        let is_goal = matches!(piece.activity, Activity::Goal(_));
        is_first && is_goal && self.there_m == Some(piece.position_m)
    }

    /// When a piece may begin at the earliest \[ms\].
    fn opens_ms(&self, piece: &Piece) -> i64 {
        let goal = goal_of(piece.activity);
        let own = self
            .own_goals()
            .into_iter()
            .find(|own| Some(own.key) == goal);
        own.map_or(0, |own| own.window_ms[0])
    }

    /// Whether what would end then would be in time. What would not be is planned anew.
    fn is_in_time(&mut self, piece: &Piece, ends_ms: i64) -> bool {
        match piece.activity {
            Activity::Sleep => true,
            Activity::Communication(sol) => {
                let [_, closes_ms] = self.communicates_ms(sol);
                ends_ms <= closes_ms
            }
            Activity::Drive(goal) | Activity::Goal(goal) => {
                let forecast = self.outlook.forecast();
                let sol = forecast.sol_at(piece.starts_ms);
                let closes_ms = forecast.day_ms(sol).map_or(0, |[_, closes_ms]| closes_ms);
                let own = self.own_goals().into_iter().find(|own| own.key == goal);
                own.is_some_and(|own| ends_ms <= closes_ms.min(own.window_ms[1]))
            }
        }
    }

    /// Puts a plan into force.
    fn adopt(&mut self, ctx: &mut Context<'_, Self>, in_hand: InHand) -> Outcome {
        let InHand {
            plan,
            cause,
            number,
            edition,
            known,
            ..
        } = in_hand;
        let before = self.log.plan.as_ref();
        let moved = before.map_or(0, |before| plan.moved_from(before, known.now_ms));
        let is_begun = |piece: &&Piece| self.has_begun(piece, &known);
        self.log.ahead = plan
            .pieces
            .iter()
            .filter(|piece| !is_begun(piece))
            .copied()
            .collect();
        ctx.sample(&PlanMade {
            number,
            cause,
            mode: self.shared.execution.mode,
            edition,
            operations: plan.operations,
            moved,
            shed: self.sheds(&plan).iter().map(|(goal, _)| *goal).collect(),
            unmet: self.unmet(&plan),
            score: plan.score,
            traverse_m: plan.traverse_m,
            reserve_j: plan.reserve_j,
            memory_size_bits: known.memory_size_bits,
            activities: plan.pieces.iter().map(planned).collect(),
        });
        for (goal, reason) in self.sheds(&plan) {
            self.give_up(goal, reason, ctx)?;
        }
        for sol in &plan.missed {
            self.miss(ctx, *sol);
        }
        self.note_left_out(&plan);
        self.announce(ctx, &plan)?;
        self.log.plan = Some(plan);
        Ok(())
    }

    /// Whether a piece of a new plan has begun, or ended, since the planning began.
    fn has_begun(&self, piece: &Piece, known: &Known) -> bool {
        let runs = self.log.under.as_ref();
        if runs.is_some_and(|under| under.piece.activity == piece.activity) {
            return true;
        }
        // What was fixed and is neither running nor ahead any more has been done.
        let was_fixed = known.fixed.iter().any(|at| at.activity == piece.activity);
        let is_ahead = self
            .log
            .ahead
            .iter()
            .any(|at| at.activity == piece.activity);
        was_fixed && !is_ahead
    }

    /// Goals that a plan gives up: those that its repairs deleted too often, and those that so many plans in a
    /// row had no room for. What is mandatory is not given up, nor what has started.
    fn sheds(&self, plan: &Plan) -> Vec<(GoalKey, Reason)> {
        let patience = self.shared.planner.deletions;
        let often = |goal: &GoalKey| {
            let before = self.log.left_out.get(goal).copied().unwrap_or(0);
            before + 1 >= patience
        };
        let left_out = plan.left_out.iter().filter(|(goal, _)| often(goal));
        let all = plan.shed.iter().chain(left_out).copied();
        let is_free = |goal: &GoalKey| {
            let owner = self.seat.owner();
            let holding = owner.and_then(|owner| owner.durable().held.get(goal));
            let is_mandatory = self.listed(*goal).is_some_and(|listed| listed.mandatory);
            holding.is_some_and(|holding| holding.started.is_none()) && !is_mandatory
        };
        let mut sheds: Vec<(GoalKey, Reason)> = all.filter(|(goal, _)| is_free(goal)).collect();
        sheds.sort_unstable();
        sheds.dedup_by_key(|(goal, _)| *goal);
        sheds
    }

    /// Mandatory goals that a plan has not, and why.
    fn unmet(&self, plan: &Plan) -> Vec<UnmetGoal> {
        let is_mandatory = |goal| self.listed(goal).is_some_and(|listed| listed.mandatory);
        let missing = plan.shed.iter().chain(&plan.left_out);
        let unmet = missing.filter(|(goal, _)| is_mandatory(*goal) && self.holds(*goal));
        let mut unmet: Vec<UnmetGoal> = unmet
            .map(|&(goal, reason)| UnmetGoal { goal, reason })
            .collect();
        unmet.sort_unstable();
        unmet.dedup_by_key(|one| one.goal);
        unmet
    }

    fn note_left_out(&mut self, plan: &Plan) {
        let is_left_out = |goal: &GoalKey| plan.left_out.iter().any(|(at, _)| at == goal);
        self.log.left_out.retain(|goal, _| is_left_out(goal));
        for (goal, _) in &plan.left_out {
            if self.holds(*goal) {
                *self.log.left_out.entry(*goal).or_default() += 1;
            }
        }
    }

    /// A communication that there is no time for any more.
    pub(super) fn miss(&mut self, ctx: &mut Context<'_, Self>, sol: u32) {
        let is_none = self.outlook.means().communication_ms == 0;
        if is_none || !self.log.communicated.insert(sol) {
            return;
        }
        let [starts_ms, ends_ms] = self.communicates_ms(sol);
        let Some((_, state)) = &self.state else {
            return;
        };
        let memory_bits = bits(state.memory_used_bytes);
        let piece = Piece {
            activity: Activity::Communication(sol),
            position_m: [state.pose.east_m, state.pose.north_m],
            starts_ms,
            ends_ms,
            power_w: 0.0,
            adds_bits: 0,
            sends_bits: 0,
            battery_j: state.battery_j,
            memory_bits,
        };
        ctx.sample(&ActivityEnded {
            plan: self.log.plans,
            planned: planned(&piece),
            began: ctx.now(),
            end: ActivityEnd::Failed(Reason::Time),
            battery_j: state.battery_j,
            memory_bits,
        });
    }

    /// Tells when goals are planned to start, where that is new.
    fn announce(&mut self, ctx: &mut Context<'_, Self>, plan: &Plan) -> Outcome {
        let tolerance = self.shared.execution.late_tolerance;
        for piece in &plan.pieces {
            let Activity::Goal(goal) = piece.activity else {
                continue;
            };
            let owner = self.seat.owner();
            let holding = owner.and_then(|owner| owner.durable().held.get(&goal));
            let Some(holding) = holding.copied() else {
                continue;
            };
            let starts = super::time(piece.starts_ms);
            let is_known = holding.goal.parameters.scheduled.is_some_and(|before| {
                let [first, last] = [before.min(starts), before.max(starts)];
                last.since(first) <= tolerance
            });
            if is_known || holding.started.is_some() {
                continue;
            }
            let to = Parameters {
                scheduled: Some(starts),
                ..holding.goal.parameters
            };
            let set = RoverMove::Set(goal, Parameter::Scheduled, to);
            // A protocol may keep planned times to their owners.
            self.seat.decide(set, ctx)?.ok();
        }
        Ok(())
    }

    /// After a restart: what was running before either runs on, or has ended without a word.
    pub(super) fn pick_up(&mut self, ctx: &mut Context<'_, Self>, state: &RoverState) -> Outcome {
        if self.log.under.is_none() || self.still_runs(state) {
            return Ok(());
        }
        self.end(ctx, Err(Reason::Hardware))
    }
}

impl Handler<PlanDue> for Explorer {
    fn handle(&mut self, _: PlanDue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.is_waiting = false;
        self.go_on(ctx)
    }
}

impl Handler<PlanReady> for Explorer {
    fn handle(&mut self, ready: PlanReady, ctx: &mut Context<'_, Self>) -> Outcome {
        let Some(in_hand) = self.in_hand.take_if(|at| at.number == ready.number) else {
            return Ok(());
        };
        if in_hand.is_stale {
            // Whatever made it stale is among what the next one is made of.
            self.cause = Some(ReplanCause::Stale);
        } else {
            self.adopt(ctx, in_hand)?;
        }
        self.settle_goals(ctx)
    }
}
