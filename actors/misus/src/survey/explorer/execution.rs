//! Carrying a plan out: activities begin when they are due, one after the other, and end as the hardware says.

use farside::prelude::*;
use farside_actors::rover::{
    Command, CommandEnd, CommandReport, Part, PoseEstimate, RoverCommand, RoverState,
};
use farside_worlds::sky::SOL_S;

use super::conduct::{Drive, Look, Next, lack};
use super::goals::{goal_of, observation};
use super::logbook::{Conduct, Under};
use super::{ActivityDue, EndDue, Explorer, millis, time};
use crate::analysis::goals::Observation;
use crate::shac::{GoalKey, OwnerError, Reason};
use crate::sharing::RoverMove;
use crate::survey::messages::{
    Activity, ActivityBegan, ActivityEnd, ActivityEnded, PlannedActivity, ReplanCause,
};
use crate::survey::outlook::Piece;

/// How near to the middle of what is around a panorama is taken \[m\], and how far from it at the most.
const PANORAMA_M: [f64; 2] = [2.0, 10.0];

/// From how far, beyond where it should stand, a rover observes a rock all the same \[m\].
const REACH_M: f64 = 3.0;

/// How much nearer it goes each time that it has not seen what it observes.
const NEARER: f64 = 0.75;

/// How long it rests where the battery is low \[ms\].
const REST_MS: i64 = 3_600_000;

/// How long it rests at the least \[ms\].
const LEAST_REST_MS: i64 = 60_000;

/// How much farther it drives to get round something that is in its way \[m\].
const DETOUR_M: f64 = 6.0;

/// How many times as long as planned an activity may take, and how much longer at the least \[ms\].
const OVERDUE: (i64, i64) = (3, 3_600_000);

impl Explorer {
    /// Begins the next activity if it is due, or sets the timer for it.
    pub(super) fn begin_what_is_due(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        // Activities that end at once let the next one begin.
        while self.log.under.is_none() && self.can_act() {
            let now_ms = Self::now_ms(ctx);
            if !self.outlook.forecast().is_light(now_ms) {
                return self.sleep_till_dawn(ctx);
            }
            let Some(piece) = self.log.ahead.first().copied() else {
                return Ok(());
            };
            let due_ms = self.due_ms(&piece);
            if due_ms > now_ms {
                self.wake_at(ctx, time(due_ms));
                return Ok(());
            }
            let next = self.urgent(now_ms, &piece).unwrap_or(0);
            let piece = self.log.ahead[next];
            let is_optional = goal_of(piece.activity).is_some();
            if is_optional && self.must_rest() {
                return self.rest(ctx);
            }
            self.log.ahead.remove(next);
            self.begin(ctx, piece)?;
        }
        Ok(())
    }

    /// The place of the sol's communication among what is ahead, if it would fail after what is next.
    fn urgent(&mut self, now_ms: i64, next: &Piece) -> Option<usize> {
        let goal = goal_of(next.activity)?;
        let sol = self.outlook.forecast().sol_at(now_ms);
        let duty = Activity::Communication(sol);
        let at = self
            .log
            .ahead
            .iter()
            .position(|piece| piece.activity == duty)?;
        let [opens_ms, closes_ms] = self.communicates_ms(sol);
        let of_goal = self
            .log
            .ahead
            .iter()
            .filter(|piece| goal_of(piece.activity) == Some(goal));
        let lasts_ms: i64 = of_goal.map(|piece| piece.ends_ms - piece.starts_ms).sum();
        let tolerance_ms = (self.shared.execution.late_tolerance.as_nanos() / 1_000_000) as i64;
        let duty_ms = self.outlook.means().communication_ms + tolerance_ms;
        (opens_ms <= now_ms && now_ms + lasts_ms + duty_ms > closes_ms).then_some(at)
    }

    /// When a sol's communication may be \[ms\].
    pub(super) fn communicates_ms(&mut self, sol: u32) -> [i64; 2] {
        let window_s = self.outlook.means().communicates_s;
        window_s.map(|at_s| self.outlook.forecast().time_ms(sol, at_s))
    }

    /// Whether the hardware was heard of since the start, and obeys.
    fn can_act(&self) -> bool {
        let state = self.state.as_ref();
        !self.is_restarted && !self.is_asking && state.is_some_and(|(_, state)| !state.brown_out)
    }

    /// When an activity may begin. One at the end of a drive begins when the rover is there, unless it has a
    /// window; all others when it was planned.
    fn due_ms(&self, piece: &Piece) -> i64 {
        let Activity::Goal(goal) = piece.activity else {
            return piece.starts_ms;
        };
        let own = self.own_goals().into_iter().find(|own| own.key == goal);
        let opens_ms = own.map_or(0, |own| own.window_ms[0]);
        match self.there_m == Some(piece.position_m) {
            true => opens_ms,
            false => piece.starts_ms.max(opens_ms),
        }
    }

    /// The charge below which nothing begins and no drive goes on \[J\]: between the reserve, which plans keep,
    /// and the brown-out.
    fn rests_below_j(&self) -> f64 {
        let rover = &self.shared.rover;
        0.5 * (self.shared.site.config.reserve + rover.cutoff) * rover.battery_j
    }

    pub(super) fn must_rest(&self) -> bool {
        let state = self.state.as_ref();
        state.is_some_and(|(_, state)| state.battery_j < self.rests_below_j())
    }

    fn wake_at(&mut self, ctx: &mut Context<'_, Self>, at: SimTime) {
        if self.due.is_some_and(|(due, _)| due == at) {
            return;
        }
        if let Some((_, timer)) = self.due.take() {
            ctx.cancel(timer);
        }
        let timer = ctx.timer(at.since(ctx.now()), ActivityDue);
        self.due = Some((at, timer));
    }

    /// Sleeps until the Sun is high enough: as planned, if it is.
    fn sleep_till_dawn(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let now_ms = Self::now_ms(ctx);
        let planned = self.log.ahead.first().copied();
        let planned = planned.filter(|piece| {
            piece.activity == Activity::Sleep && piece.starts_ms <= now_ms && now_ms < piece.ends_ms
        });
        if let Some(piece) = planned {
            self.log.ahead.remove(0);
            return self.begin(ctx, piece);
        }
        // What was to be done by now comes another day.
        if !self.log.ahead.is_empty() {
            self.plan_anew(ReplanCause::Late);
        }
        let sol = self.outlook.forecast().sol_at(now_ms);
        let dawns = [sol, sol + 1].map(|sol| self.outlook.forecast().day_ms(sol));
        let mut dawns = dawns.into_iter().flatten().map(|[opens_ms, _]| opens_ms);
        let in_a_sol_ms = now_ms + (1e3 * SOL_S) as i64;
        let dawn_ms = dawns.find(|opens_ms| *opens_ms > now_ms);
        self.sleep(ctx, dawn_ms.unwrap_or(in_a_sol_ms))
    }

    /// Rests until the Sun has given something, and plans anew then.
    fn rest(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.plan_anew(ReplanCause::Power);
        let now_ms = Self::now_ms(ctx);
        let is_duty = |piece: &&Piece| matches!(piece.activity, Activity::Communication(_));
        let duty_ms = self
            .log
            .ahead
            .iter()
            .find(is_duty)
            .map(|piece| piece.starts_ms);
        let until_ms = duty_ms.map_or(i64::MAX, |at_ms| at_ms.max(now_ms + LEAST_REST_MS));
        self.sleep(ctx, until_ms.min(now_ms + REST_MS))
    }

    /// A sleep that no plan has.
    fn sleep(&mut self, ctx: &mut Context<'_, Self>, until_ms: i64) -> Outcome {
        let Some((_, state)) = &self.state else {
            return Ok(());
        };
        let piece = Piece {
            activity: Activity::Sleep,
            position_m: [state.pose.east_m, state.pose.north_m],
            starts_ms: Self::now_ms(ctx),
            ends_ms: until_ms,
            power_w: 0.0,
            adds_bits: 0,
            sends_bits: 0,
            battery_j: state.battery_j,
            memory_bits: bits(state.memory_used_bytes),
        };
        self.begin(ctx, piece)
    }

    /// Begins an activity.
    fn begin(&mut self, ctx: &mut Context<'_, Self>, piece: Piece) -> Outcome {
        let Some((_, state)) = self.state.clone() else {
            return Ok(());
        };
        if let Some(in_hand) = &mut self.in_hand {
            let mut fixed = in_hand.known.fixed.iter();
            in_hand.is_stale |= !fixed.any(|at| at.activity == piece.activity);
        }
        if let Activity::Drive(_) = piece.activity {
            self.there_m = None;
        }
        let (now_ms, plan) = (Self::now_ms(ctx), self.log.plans);
        let conduct = self.conduct(&piece);
        let lasts_ms = piece.ends_ms - piece.starts_ms;
        self.log.under = Some(Under {
            piece,
            plan,
            began: ctx.now(),
            expected_ms: match piece.activity {
                Activity::Sleep => piece.ends_ms,
                _ => now_ms + lasts_ms,
            },
            conduct,
            command: 0,
        });
        ctx.sample(&ActivityBegan {
            plan,
            planned: planned(&piece),
            battery_j: state.battery_j,
            memory_bits: bits(state.memory_used_bytes),
        });
        if let Some(reason) = self.cannot_begin(ctx, &piece)? {
            return self.end(ctx, Err(reason));
        }
        let next = self.first_step(&state, &piece, now_ms);
        self.step(ctx, next)
    }

    /// Asks whether an activity may begin, and for a goal says that it does. What keeps it from that.
    fn cannot_begin(
        &mut self,
        ctx: &mut Context<'_, Self>,
        piece: &Piece,
    ) -> Result<Option<Reason>, HandlerError> {
        let ends_ms = Self::now_ms(ctx) + piece.ends_ms - piece.starts_ms;
        match piece.activity {
            Activity::Sleep => Ok(None),
            Activity::Communication(sol) => {
                let [_, until_ms] = self.communicates_ms(sol);
                Ok((ends_ms > until_ms).then_some(Reason::Time))
            }
            Activity::Drive(goal) => Ok((!self.holds(goal)).then_some(Reason::Revoked)),
            Activity::Goal(goal) => {
                let own = self.own_goals().into_iter().find(|own| own.key == goal);
                let Some(own) = own else {
                    return Ok(Some(Reason::Revoked));
                };
                if ends_ms > own.window_ms[1] {
                    return Ok(Some(Reason::Time));
                }
                Ok(match self.seat.decide(RoverMove::Begin(goal), ctx)? {
                    // Of an attempt before this one.
                    Ok(()) | Err(OwnerError::Started { .. }) => None,
                    Err(OwnerError::LeaseTooShort { .. }) => Some(Reason::LeaseEnded),
                    Err(OwnerError::Achieved { .. }) => Some(Reason::Achieved),
                    Err(_) => Some(Reason::Revoked),
                })
            }
        }
    }

    fn conduct(&self, piece: &Piece) -> Conduct {
        let goal = match piece.activity {
            Activity::Goal(goal) | Activity::Drive(goal) => goal,
            Activity::Communication(_) | Activity::Sleep => return Conduct::Single,
        };
        let (observation, rock) = (observation(goal), self.rock(goal));
        match piece.activity {
            Activity::Goal(_) => {
                let is_point = matches!(
                    observation,
                    Observation::PointImage | Observation::PointSpectrum
                );
                let rock = rock.filter(|_| is_point);
                let seen_m = rock.and_then(|rock| self.seen_m.get(&rock)).copied();
                let place_m = seen_m.unwrap_or(piece.position_m);
                let look = Look::new(observation, rock, place_m);
                match rock.is_some_and(|rock| self.unseen.contains(&rock)) {
                    true => Conduct::Look(look.without_search()),
                    false => Conduct::Look(look),
                }
            }
            _ => {
                let [stands_m, reach_m] = self.distances_m(observation, rock);
                // Each time from nearer by.
                let tries = self.log.tried.get(&goal).map_or(0, |(tries, _)| *tries);
                let stands_m = stands_m * libm::pow(NEARER, f64::from(tries));
                Conduct::Drive(Drive::new(piece.position_m, stands_m, reach_m))
            }
        }
    }

    /// The rock that a goal observes.
    fn rock(&self, goal: GoalKey) -> Option<u32> {
        use crate::analysis::goals::Target;
        match (self.listed(goal), goal) {
            (Some(listed), _) => listed.rock,
            (None, GoalKey::Observation(id)) => match id.target {
                Target::Rock(rock) => Some(rock),
                Target::Square(..) => None,
            },
            (None, GoalKey::Numbered(_)) => None,
        }
    }

    /// How near to its target a rover observes, and from how far at the most.
    fn distances_m(&self, observation: Observation, rock: Option<u32>) -> [f64; 2] {
        let site = &self.shared.site;
        let rock = rock.and_then(|rock| site.catalogue.get(rock as usize));
        match (observation, rock) {
            (Observation::PointImage | Observation::PointSpectrum, Some(rock)) => {
                let stands_m = 0.5 * rock.diameter_m + site.config.stand_off_m;
                [stands_m, stands_m + REACH_M]
            }
            _ => PANORAMA_M,
        }
    }

    fn first_step(&mut self, state: &RoverState, piece: &Piece, now_ms: i64) -> Next {
        let instruments = &self.shared.site.instruments;
        let Some(under) = &mut self.log.under else {
            return Next::Over(Err(Reason::Hardware));
        };
        match &mut under.conduct {
            Conduct::Drive(drive) => drive.start(&state.pose),
            Conduct::Look(look) => look.start(instruments),
            Conduct::Single => Next::Command(match piece.activity {
                Activity::Communication(_) => Command::Transmit {
                    to: "earth".to_owned(),
                    size_bytes: (self.outlook.means().sends_bits / 8).max(1) as u64,
                },
                _ => Command::Sleep {
                    duration: time(piece.ends_ms).since(time(now_ms)),
                },
            }),
        }
    }

    /// Does what comes next in an activity.
    fn step(&mut self, ctx: &mut Context<'_, Self>, next: Next) -> Outcome {
        match next {
            Next::Over(end) => self.end(ctx, end),
            Next::Command(command) => {
                if let Command::Drive { .. } | Command::BackUp { .. } = command {
                    self.seen_m.clear();
                    self.unseen.clear();
                }
                let id = self.command(ctx, command)?;
                if let Some(under) = &mut self.log.under {
                    under.command = id;
                }
                self.watch_end(ctx);
                Ok(())
            }
        }
    }

    /// Sets the timer for when the activity should have ended.
    fn watch_end(&self, ctx: &mut Context<'_, Self>) {
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
        if let Err(OwnerError::Started { .. }) =
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
}

/// A piece as it is told.
pub(super) fn planned(piece: &Piece) -> PlannedActivity {
    PlannedActivity {
        activity: piece.activity,
        position_m: piece.position_m,
        starts: time(piece.starts_ms),
        ends: time(piece.ends_ms),
        battery_j: piece.battery_j,
        memory_bits: piece.memory_bits,
    }
}

pub(super) fn bits(bytes: u64) -> i64 {
    i64::try_from(bytes)
        .unwrap_or(i64::MAX / 8)
        .saturating_mul(8)
}

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

impl Handler<ActivityDue> for Explorer {
    fn handle(&mut self, _: ActivityDue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.due = None;
        // How it is then is asked before anything begins.
        self.ask(ctx)
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
