//! How activities end: command by command as the hardware reports, late, broken off, or for want of something.

use farside::prelude::*;
use farside_actors::rover::{
    Command, CommandEnd, CommandReport, Part, PoseEstimate, RoverCommand, RoverState,
};

use super::conduct::{Next, lack};
use super::goals::goal_of;
use super::logbook::{Conduct, Under};
use super::{EndDue, Explorer, bits, millis, planned, time};
use crate::shac::{GoalKey, OwnerError, Reason};
use crate::sharing::RoverMove;
use crate::survey::messages::{Activity, ActivityEnd, ActivityEnded, ReplanCause};
use crate::survey::outlook::Piece;

/// How much farther it drives to get round something that is in its way \[m\].
const DETOUR_M: f64 = 6.0;

/// How many times as long as planned an activity may take, and how much longer at the least \[ms\].
const OVERDUE: (i64, i64) = (3, 3_600_000);

impl Handler<CommandReport> for Explorer {
    fn handle(&mut self, report: CommandReport, ctx: &mut Context<'_, Self>) -> Outcome {
        if !report.readings.is_empty() {
            let scientist = &self.shared.site.rovers[self.number as usize];
            let scientist = ctx.recipient::<CommandReport>(scientist)?;
            ctx.send(scientist, report.clone());
            let rocks = report.readings.iter();
            let rocks = rocks.filter_map(|at| Some((at.rock?, [at.east_m, at.north_m])));
            self.seen_m.extend(rocks);
        }
        self.note_pose(&report.pose);
        let instruments = &self.shared.site.instruments;
        let Some(under) = &mut self.log.under else {
            return Ok(());
        };
        if under.command != report.id || report.id == 0 {
            return Ok(());
        }
        let (next, more) = match &mut under.conduct {
            Conduct::Drive(drive) => {
                let before = drive.detours();
                let next = drive.next(&report);
                (
                    next,
                    (drive.detours() > before).then_some(ReplanCause::Blocked),
                )
            }
            Conduct::Look(look) => {
                let before = look.has_searched();
                let next = look.next(&report, instruments);
                (
                    next,
                    (look.has_searched() != before).then_some(ReplanCause::Late),
                )
            }
            Conduct::Single => match &report.end {
                CommandEnd::Done => (Next::Over(Ok(())), None),
                end => (Next::Over(Err(lack(end))), None),
            },
        };
        if let (Some(cause), Next::Command(_)) = (more, &next) {
            self.expect_longer(Self::now_ms(ctx), cause);
        }
        self.step(ctx, next)?;
        self.settle_goals(ctx)
    }
}

impl Handler<EndDue> for Explorer {
    fn handle(&mut self, due: EndDue, ctx: &mut Context<'_, Self>) -> Outcome {
        let now_ms = Self::now_ms(ctx);
        let tolerance_ms = (self.shared.execution.late_tolerance.as_nanos() / 1_000_000) as i64;
        let Some(under) = &mut self.log.under else {
            return Ok(());
        };
        if under.command != due.command || under.expected_ms + tolerance_ms > now_ms {
            return Ok(());
        }
        let is_overdue = now_ms >= Self::overdue_ms(under);
        let activity = under.piece.activity;
        if is_overdue || now_ms >= self.closes_ms(activity) {
            return self.break_off(ctx, Reason::Time);
        }
        let Some(under) = &mut self.log.under else {
            return Ok(());
        };
        // The longer it lasts, the longer it is expected to last.
        let lasts_ms = now_ms - millis(under.began);
        under.expected_ms = now_ms + (lasts_ms / 4).max(tolerance_ms);
        self.watch_end(ctx);
        self.plan_anew(ReplanCause::Late);
        self.go_on(ctx)
    }
}

impl Explorer {
    /// Sets the timer for when the activity should have ended.
    pub(super) fn watch_end(&self, ctx: &mut Context<'_, Self>) {
        let Some(under) = &self.log.under else {
            return;
        };
        let at = time(under.expected_ms) + self.shared.execution.late_tolerance;
        let command = under.command;
        let wait = at.since(ctx.now()).max(SimDuration::from_millis(1));
        ctx.timer(wait, EndDue { command });
    }

    /// An activity has ended: as it was meant to, or for want of something.
    pub(super) fn end(&mut self, ctx: &mut Context<'_, Self>, end: Result<(), Reason>) -> Outcome {
        let Some(under) = self.log.under.take() else {
            return Ok(());
        };
        let broken_off = self.broken_off.take();
        let end = end.map_err(|reason| broken_off.unwrap_or(reason));
        if let (Err(_), Some(in_hand)) = (end, &mut self.in_hand) {
            in_hand.is_stale = true;
        }
        let tolerance_ms = (self.shared.execution.late_tolerance.as_nanos() / 1_000_000) as i64;
        let late_ms = Self::now_ms(ctx) - under.piece.ends_ms;
        let ended = match end {
            Ok(()) => {
                if late_ms > tolerance_ms {
                    self.plan_anew(ReplanCause::Late);
                } else if late_ms < -tolerance_ms {
                    self.plan_anew(ReplanCause::Early);
                }
                self.done(ctx, &under)?;
                ActivityEnd::Done
            }
            Err(reason) => self.failed(ctx, &under, reason)?,
        };
        self.log.ended.push((under, ended));
        // What it says of itself now is what the next plan and the next activity begin with.
        self.ask(ctx)
    }

    fn done(&mut self, ctx: &mut Context<'_, Self>, under: &Under) -> Outcome {
        match under.piece.activity {
            Activity::Goal(goal) => {
                self.log.tried.remove(&goal);
                self.log.left_out.remove(&goal);
                if let Conduct::Look(look) = &under.conduct
                    && look.is_of_rock()
                {
                    self.note_search(look.has_searched());
                }
                // Nothing else ends a goal that has started.
                self.seat.decide(RoverMove::Done(goal), ctx)?.ok();
            }
            Activity::Drive(_) => self.there_m = Some(under.piece.position_m),
            Activity::Communication(sol) => {
                self.log.communicated.insert(sol);
                self.log.communication_tries = 0;
            }
            Activity::Sleep => {}
        }
        Ok(())
    }

    /// Something did not work: it is tried again later, so many times.
    fn failed(
        &mut self,
        ctx: &mut Context<'_, Self>,
        under: &Under,
        reason: Reason,
    ) -> Result<ActivityEnd, HandlerError> {
        let was_blocked = match &under.conduct {
            Conduct::Drive(drive) => drive.detours() > 0,
            _ => false,
        };
        self.plan_anew(match reason {
            Reason::Path if was_blocked => ReplanCause::Blocked,
            Reason::Power => ReplanCause::Power,
            Reason::Memory => ReplanCause::Memory,
            _ => ReplanCause::Failed,
        });
        let retries = self.shared.execution.retries;
        if let Activity::Communication(sol) = under.piece.activity {
            self.log.communication_tries += 1;
            let is_over = self.log.communication_tries > retries || reason == Reason::Time;
            if !is_over {
                return Ok(ActivityEnd::Interrupted(reason));
            }
            self.log.communicated.insert(sol);
            self.log.communication_tries = 0;
            return Ok(ActivityEnd::Failed(reason));
        }
        let Some(goal) = goal_of(under.piece.activity) else {
            return Ok(ActivityEnd::Interrupted(reason));
        };
        self.log
            .ahead
            .retain(|piece| goal_of(piece.activity) != Some(goal));
        if !self.holds(goal) {
            return Ok(ActivityEnd::Interrupted(reason));
        }
        let again_ms = self.again_ms(Self::now_ms(ctx), reason);
        let searched = match &under.conduct {
            Conduct::Look(look) if reason == Reason::Path => look.searched(),
            _ => None,
        };
        // What one observation does not see others do not see either.
        let mut missed = vec![goal];
        if let Some(rock) = searched {
            self.unseen.insert(rock);
            self.there_m = None;
            let of_rock = |other: &GoalKey| self.rock(*other) == Some(rock) && *other != goal;
            missed.extend(self.held_keys().into_iter().filter(of_rock));
        }
        for goal in missed {
            let (tries, from_ms) = self.log.tried.entry(goal).or_default();
            *tries += 1;
            *from_ms = again_ms;
        }
        let is_mandatory = self.listed(goal).is_some_and(|listed| listed.mandatory);
        let tries = self.log.tried[&goal].0;
        if tries <= retries || (is_mandatory && reason != Reason::Time) {
            return Ok(ActivityEnd::Interrupted(reason));
        }
        self.give_up(goal, reason, ctx)?;
        Ok(ActivityEnd::Failed(reason))
    }

    /// When something that failed for want of something may be tried again: where memory lacks, once
    /// something was sent.
    fn again_ms(&mut self, now_ms: i64, reason: Reason) -> i64 {
        let later_ms = now_ms + (self.shared.execution.retry_after.as_nanos() / 1_000_000) as i64;
        if reason != Reason::Memory {
            return later_ms;
        }
        let is_duty = |piece: &&Piece| matches!(piece.activity, Activity::Communication(_));
        let duty = self.log.ahead.iter().find(is_duty);
        duty.map_or(later_ms, |piece| piece.ends_ms.max(later_ms))
    }

    /// Gives a goal back: it has failed if it has started, and is released if not.
    pub(super) fn give_up(
        &mut self,
        goal: GoalKey,
        reason: Reason,
        ctx: &mut Context<'_, Self>,
    ) -> Outcome {
        self.log.tried.remove(&goal);
        self.log.left_out.remove(&goal);
        let sol = self.log.sol;
        self.log.given_up.insert(goal, (reason, sol));
        self.desk.refuses.insert(goal, reason);
        if let Err(OwnerError::Started { .. } | OwnerError::Bound { .. }) =
            self.seat.decide(RoverMove::Release(goal, reason), ctx)?
        {
            // What is neither held nor started is gone already.
            self.seat.decide(RoverMove::Failed(goal, reason), ctx)?.ok();
        }
        Ok(())
    }

    /// Breaks off what runs, for want of something: its report ends the activity.
    pub(super) fn break_off(&mut self, ctx: &mut Context<'_, Self>, reason: Reason) -> Outcome {
        self.broken_off = Some(reason);
        self.stop_all(ctx)
    }

    /// Tells what has ended, with what the hardware says now.
    pub(super) fn tell_ended(&mut self, ctx: &mut Context<'_, Self>, state: &RoverState) {
        for (under, end) in self.log.ended.drain(..) {
            ctx.sample(&ActivityEnded {
                plan: under.plan,
                planned: planned(&under.piece),
                began: under.began,
                end,
                battery_j: state.battery_j,
                memory_bits: bits(state.memory_used_bytes),
            });
        }
    }

    /// How long after its planned end an activity is broken off \[ms\].
    fn overdue_ms(under: &Under) -> i64 {
        let lasts_ms = under.piece.ends_ms - under.piece.starts_ms;
        millis(under.began) + OVERDUE.0 * lasts_ms + OVERDUE.1
    }

    /// What runs has something before it that was not planned: something is in the way, or a rock was missed.
    fn expect_longer(&mut self, now_ms: i64, cause: ReplanCause) {
        let more_ms = match cause {
            ReplanCause::Blocked => self.outlook.means().drive_ms([0.0; 2], [DETOUR_M, 0.0]),
            _ => {
                let under = self.log.under.as_ref();
                let goal = under.and_then(|under| goal_of(under.piece.activity));
                let own = goal.and_then(|goal| self.cost(goal));
                let costs = [self.search_cost(), own].into_iter().flatten();
                let costs_ms = costs.map(|cost| (cost.duration.as_nanos() / 1_000_000) as i64);
                costs_ms.sum()
            }
        };
        let tolerance_ms = (self.shared.execution.late_tolerance.as_nanos() / 1_000_000) as i64;
        let Some(under) = &mut self.log.under else {
            return;
        };
        // A search is part of what was planned only in the mean.
        under.expected_ms = match cause {
            ReplanCause::Blocked => under.expected_ms + more_ms,
            _ => under.expected_ms.max(now_ms + more_ms),
        };
        let expected_ms = under.expected_ms;
        let is_late = expected_ms - under.piece.ends_ms > tolerance_ms;
        if is_late || cause == ReplanCause::Blocked {
            self.plan_anew(cause);
        }
    }

    /// When an activity has to have ended \[ms\]: a goal at the end of its window.
    pub(super) fn closes_ms(&self, activity: Activity) -> i64 {
        let Activity::Goal(goal) = activity else {
            return i64::MAX;
        };
        let own = self.own_goals().into_iter().find(|own| own.key == goal);
        own.map_or(i64::MAX, |own| own.window_ms[1])
    }

    /// Where the rover believes to be, as a report has it.
    fn note_pose(&mut self, pose: &PoseEstimate) {
        if let Some((_, state)) = &mut self.state {
            state.pose = *pose;
        }
    }

    /// Whether what runs is on the wheels.
    pub(super) fn drives(&self) -> bool {
        let under = self.log.under.as_ref();
        under.is_some_and(|under| matches!(under.piece.activity, Activity::Drive(_)))
    }

    /// Whether a command of the activity that runs is among those that the hardware has.
    pub(super) fn still_runs(&self, state: &RoverState) -> bool {
        let under = self.log.under.as_ref();
        under.is_some_and(|under| state.running.iter().any(|at| at.id == under.command))
    }

    /// Wakes the hardware, or stops whatever nobody waits for.
    pub(super) fn stop_all(&self, ctx: &mut Context<'_, Self>) -> Outcome {
        let hardware = self.hardware(ctx)?;
        let (id, part) = (0, None::<Part>);
        let command = Command::Stop { part };
        ctx.send(hardware, RoverCommand { id, command });
        Ok(())
    }
}
