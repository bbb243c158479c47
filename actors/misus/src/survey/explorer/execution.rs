//! Carrying a plan out: activities begin when they are due, one after the other, and end as the hardware says.

use farside::prelude::*;
use farside_actors::rover::{Command, RoverState};
use farside_worlds::sky::SOL_S;

use super::conduct::{Drive, Look, Next};
use super::goals::goal_of;
use super::logbook::{Conduct, Under};
use super::meeting::Wait;
use super::{ActivityDue, Explorer, bits, planned, time};
use crate::analysis::goals::Observation;
use crate::shac::{GoalKey, OwnerError, Reason};
use crate::sharing::RoverMove;
use crate::survey::messages::{Activity, ActivityBegan, ReplanCause};
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
            if let Activity::Goal(goal) = piece.activity {
                match self.wait_for_partner(ctx, goal)? {
                    Wait::No => {}
                    Wait::Over => continue,
                    Wait::Until(at) => {
                        self.wake_at(ctx, at);
                        return Ok(());
                    }
                }
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
        let (observation, rock) = (self.desk.observation(goal), self.rock(goal));
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
    pub(super) fn rock(&self, goal: GoalKey) -> Option<u32> {
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
    pub(super) fn step(&mut self, ctx: &mut Context<'_, Self>, next: Next) -> Outcome {
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
}

impl Handler<ActivityDue> for Explorer {
    fn handle(&mut self, _: ActivityDue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.due = None;
        // How it is then is asked before anything begins.
        self.ask(ctx)
    }
}
