//! From what is known to a plan with times, charges and memory.

use std::collections::BTreeSet;

use super::posing::{Cut, Posed, Ready, fixed_goals, pose};
use super::{Basis, Forecast, Known, Load, Outlook, Piece, Plan, Profile};
use crate::planner::casper::{Casper, Choice, Unmet};
use crate::planner::chain::{Violation, Visit};
use crate::planner::instance::Instance;
use crate::planner::problem::ProblemError;
use crate::shac::{GoalKey, Reason};
use crate::survey::messages::{Activity, PlanMode};

/// How often a plan is cut down to keep its reserve before it is given up.
const CUTS: u32 = 16;

/// How much later a day begins each time that the Sun has not given enough yet \[ms\].
const LATER_MS: i64 = 3_600_000;

/// How much later a day begins at the most \[ms\].
const LATEST_MS: i64 = 5 * LATER_MS;

/// A charge that is too low by less is not too low \[J\].
const EQUAL_J: f64 = 1e-3;

/// After how many steps without a better plan there are no more.
const PATIENCE: u32 = 3;

/// What a search found.
#[derive(Clone, Debug, Default)]
struct Found {
    /// What is done, by sol of the run, in order.
    order: Vec<(u32, Activity)>,
    free: Vec<Piece>,
    shed: Vec<(GoalKey, Reason)>,
    left_out: Vec<(GoalKey, Reason)>,
    missed: Vec<u32>,
    operations: u64,
}

impl Outlook {
    /// The plan for what is known, made from the plan before in continuous mode. `number` counts the plans of
    /// the rover: each has draws of its own.
    ///
    /// # Errors
    /// When what is known cannot be planned with, see [`pose`].
    pub fn plan(
        &mut self,
        known: &Known,
        before: Option<&Plan>,
        number: u32,
    ) -> Result<Plan, ProblemError> {
        let before = before.filter(|_| self.mode == PlanMode::Continuous);
        let basis = Basis {
            goals: known.goals.clone(),
            worth: known.worth.clone(),
            held: known.held.clone(),
        };
        let gains = |before: &Plan| {
            before.basis.is_news(&basis) || (known.has_gained && !before.left_out.is_empty())
        };
        let mut optimises = before.is_none_or(gains);
        let mut order = before.map_or(Vec::new(), |plan| order_of(&mut self.forecast, plan));
        let bare = self.bare(known, number)?;
        let reserve_j = bare.reserve_j;
        let (mut cut, mut operations, mut shed) =
            (Cut::default(), bare.found.operations, Vec::new());
        for _ in 0..CUTS {
            let mut found = self.search(known, &cut, &order, optimises, number)?;
            operations += found.operations;
            shed.append(&mut found.shed);
            let pieces = self.pieces(known, &found.free);
            let (pieces, profile) = self.predict(known, pieces);
            match self.shortfall(known, &profile, reserve_j) {
                None => {
                    let end = End {
                        basis,
                        operations,
                        shed,
                        reserve_j,
                        profile,
                    };
                    return Ok(self.conclude(known, pieces, found, end));
                }
                Some(short) => self.cut_down(known, &mut cut, &short),
            }
            // What fits is kept; what does not any more is repaired away.
            (order, optimises) = (found.order, false);
        }
        let goals = known.goals.iter();
        let mut found = bare.found;
        found.left_out = goals.map(|goal| (goal.key, Reason::Power)).collect();
        let end = End {
            basis,
            operations,
            shed: Vec::new(),
            reserve_j,
            profile: bare.profile,
        };
        Ok(self.conclude(known, bare.pieces, found, end))
    }

    /// The plan of nothing but what has to be done.
    fn bare(&mut self, known: &Known, number: u32) -> Result<Bare, ProblemError> {
        let bare = Known {
            goals: Vec::new(),
            ..known.clone()
        };
        let found = self.search(&bare, &Cut::default(), &[], false, number)?;
        let pieces = self.pieces(known, &found.free);
        let (pieces, profile) = self.predict(known, pieces);
        let least_j = profile.least_j(known.now_ms, self.until_ms(known));
        let least_j = least_j.map_or(known.battery_j, |(_, least_j)| least_j);
        Ok(Bare {
            found,
            pieces,
            profile,
            reserve_j: self.means.reserve_j.min(least_j),
        })
    }

    /// Until when the charge is followed: the dawn after the last sol that is planned.
    fn until_ms(&mut self, known: &Known) -> i64 {
        let last = self.forecast.sol_at(known.now_ms) + self.means.horizon;
        let dawn = self.forecast.day_ms(last);
        dawn.map_or_else(
            || self.forecast.time_ms(last, 0.0),
            |[opens_ms, _]| opens_ms,
        )
    }

    /// Fills in what the battery and memory are predicted to hold.
    fn predict(&mut self, known: &Known, mut pieces: Vec<Piece>) -> (Vec<Piece>, Profile) {
        let loads: Vec<Load> = pieces.iter().map(load).collect();
        let until_ms = self.until_ms(known);
        let (from_ms, battery_j) = (known.now_ms, known.battery_j);
        let forecast = &mut self.forecast;
        let profile = forecast.profile(from_ms, battery_j, known.clean, &loads, until_ms);
        let mut memory_bits = known.memory_bits;
        for piece in &mut pieces {
            memory_bits += piece.adds_bits;
            memory_bits -= piece.sends_bits.min(memory_bits);
            piece.memory_bits = memory_bits;
            piece.battery_j = profile.at_j(piece.ends_ms);
        }
        (pieces, profile)
    }

    /// Where a plan first goes below its reserve; None if it does not.
    fn shortfall(&mut self, known: &Known, profile: &Profile, reserve_j: f64) -> Option<Shortfall> {
        let first = self.forecast.sol_at(known.now_ms);
        let mut from_ms = known.now_ms;
        for sol in first..first + self.means.horizon {
            let dawn_ms = dawn_after(&mut self.forecast, sol);
            if let Some((at_ms, least_j)) = profile.least_j(from_ms, dawn_ms)
                && least_j < reserve_j - EQUAL_J
            {
                return Some(Shortfall {
                    sol,
                    at_ms,
                    lacking_j: reserve_j - least_j,
                });
            }
            from_ms = dawn_ms;
        }
        None
    }

    /// Begins the day later, if the Sun would help, or gives its sol less energy.
    fn cut_down(&mut self, known: &Known, cut: &mut Cut, short: &Shortfall) {
        let is_first = short.sol == self.forecast.sol_at(known.now_ms);
        let noon_ms = self
            .forecast
            .time_ms(short.sol, 0.5 * farside_worlds::sky::SOL_S);
        if is_first && short.at_ms < noon_ms && cut.delay_ms < LATEST_MS {
            cut.delay_ms += LATER_MS;
        } else {
            *cut.energy_j.entry(short.sol).or_default() += 1.05 * short.lacking_j + 1.0;
        }
    }

    /// Makes and solves the planner's problem.
    fn search(
        &mut self,
        known: &Known,
        cut: &Cut,
        order: &[(u32, Activity)],
        optimises: bool,
        number: u32,
    ) -> Result<Found, ProblemError> {
        let Some(posed) = pose(&self.means, &mut self.forecast, known, cut)? else {
            let goals = known.goals.iter();
            return Ok(Found {
                left_out: goals.map(|goal| (goal.key, Reason::Time)).collect(),
                ..Found::default()
            });
        };
        let instance = Instance::new(&posed.problem)?;
        let mut found = Found {
            left_out: posed.impossible.clone(),
            missed: posed.missed.clone(),
            operations: (posed.keys.len() * posed.keys.len()) as u64,
            ..Found::default()
        };
        let key = self.key.text("plan").number(u64::from(number));
        let Ok(mut casper) = Casper::new(&instance, 0, &self.planner, key) else {
            // What has to be done in any case cannot be: nothing is planned besides.
            found.missed.extend(&posed.duties);
            return Ok(found);
        };
        casper.hear(1, &(posed.own..posed.keys.len()).collect::<Vec<_>>());
        let mut unmet = assign_all(&mut casper, &instance, &posed);
        if !order.is_empty() {
            let plan = visits(&instance, &posed, order);
            // What is mandatory is insisted on below, whether it was in the plan or not.
            found.operations += casper.resume(&instance, &plan).unwrap_or(0);
            unmet = assign_all(&mut casper, &instance, &posed);
        }
        if optimises {
            self.optimise(&mut casper, &instance, &posed, &mut found);
        }
        let names = |unmet: &Unmet| (posed.keys[unmet.task], lack(&unmet.lacking));
        found.left_out.extend(unmet.iter().map(names));
        self.say_why(&casper, &instance, &posed, &mut found);
        trace(&casper, &posed, &self.means, known, &mut found);
        Ok(found)
    }

    /// Optimisation steps, until all goals are planned or nothing gets better.
    fn optimise(&self, casper: &mut Casper, instance: &Instance, posed: &Posed, found: &mut Found) {
        let mut idle = 0;
        for _ in 0..self.planner.steps {
            let planned = casper.plan().goals(instance).count();
            if planned == posed.own || idle >= PATIENCE {
                break;
            }
            let step = casper.step(instance);
            found.operations += step.operations;
            idle = if step.improved { 0 } else { idle + 1 };
            for goal in step.shed {
                let reason = self.why_not(casper, instance, goal);
                found
                    .shed
                    .push((posed.keys[goal], reason.unwrap_or(Reason::Worth)));
            }
        }
    }

    /// Why goals are not in the plan that there is neither room nor wish for.
    fn say_why(&self, casper: &Casper, instance: &Instance, posed: &Posed, found: &mut Found) {
        let gone: BTreeSet<GoalKey> = found.shed.iter().map(|(key, _)| *key).collect();
        let known: BTreeSet<GoalKey> = found.left_out.iter().map(|(key, _)| *key).collect();
        for (goal, key) in posed.keys.iter().enumerate().take(posed.own) {
            let is_planned = casper.score().holds(goal);
            if is_planned || gone.contains(key) || known.contains(key) {
                continue;
            }
            if let Some(reason) = self.why_not(casper, instance, goal) {
                found.left_out.push((*key, reason));
            }
        }
    }

    /// Why a goal is not in the plan; None if there is room for it.
    fn why_not(&self, casper: &Casper, instance: &Instance, goal: usize) -> Option<Reason> {
        let gain = casper.score().gain(goal);
        if self.planner.choice == Choice::Idgs && gain <= 0.0 {
            return Some(Reason::Worth);
        }
        let visit = Visit::new(instance, goal);
        let (place, _) = casper.plan().best_insertion(instance, &visit);
        let costs =
            |added_ms| instance.costs().of_goal(goal) + instance.costs().of_drive(0, added_ms);
        match place {
            None => Some(Reason::Time),
            Some(place)
                if !instance.costs().is_plain()
                    && self.planner.choice != Choice::Random
                    && gain <= costs(place.added_ms) =>
            {
                Some(Reason::Worth)
            }
            Some(place) if place.violation.is_none() => None,
            Some(place) => Some(lack(&place.violation)),
        }
    }

    /// What is fixed, then what is planned, then the nights between.
    fn pieces(&mut self, known: &Known, free: &[Piece]) -> Vec<Piece> {
        let mut pieces: Vec<Piece> = known.fixed.iter().chain(free).copied().collect();
        let ready = Ready::after(known);
        let first = self.forecast.sol_at(known.now_ms);
        let mut dark_ms = (!self.forecast.is_light(ready.at_ms)).then_some(ready.at_ms);
        for sol in first..=first + self.means.horizon {
            let Some([opens_ms, closes_ms]) = self.forecast.day_ms(sol) else {
                continue;
            };
            if let Some(from_ms) = dark_ms.filter(|from_ms| *from_ms < opens_ms) {
                let before = pieces.iter().rposition(|piece| piece.ends_ms <= from_ms);
                let position_m = before.map_or(known.position_m, |at| pieces[at].position_m);
                let night = Piece {
                    activity: Activity::Sleep,
                    position_m,
                    starts_ms: from_ms,
                    ends_ms: opens_ms,
                    power_w: 0.0,
                    adds_bits: 0,
                    sends_bits: 0,
                    battery_j: 0.0,
                    memory_bits: 0,
                };
                pieces.insert(before.map_or(0, |at| at + 1), night);
            }
            dark_ms = Some(closes_ms.max(ready.at_ms));
        }
        pieces
    }

    fn conclude(&self, known: &Known, pieces: Vec<Piece>, found: Found, end: End) -> Plan {
        let mut goals: BTreeSet<GoalKey> = known.held.union(&known.achieved).copied().collect();
        goals.extend(fixed_goals(known));
        let mut plan = Plan {
            pieces,
            reserve_j: end.reserve_j,
            shed: end.shed,
            left_out: found.left_out,
            missed: found.missed,
            operations: end.operations,
            score: 0.0,
            value: 0.0,
            traverse_m: 0.0,
            profile: end.profile,
            stored_bits: known.memory_bits,
            basis: end.basis,
        };
        goals.extend(plan.goals());
        plan.score = known.worth.of(&goals);
        let mut at_m = known.position_m;
        plan.value = plan.score;
        for piece in &plan.pieces {
            let to_m = piece.position_m;
            let way_m = libm::hypot(to_m[0] - at_m[0], to_m[1] - at_m[1]);
            plan.traverse_m += way_m;
            at_m = to_m;
            if let Activity::Goal(_) | Activity::Drive(_) = piece.activity {
                let lasts_ms = piece.ends_ms - piece.starts_ms;
                let power_mw = piece.power_w * 1e3;
                plan.value -= self.means.objective.drive(way_m, lasts_ms, power_mw);
            }
        }
        plan
    }
}

/// A plan of nothing but what has to be done.
struct Bare {
    found: Found,
    pieces: Vec<Piece>,
    profile: Profile,
    /// The charge below which no plan goes \[J\]: the reserve, or what this comes down to below it.
    reserve_j: f64,
}

/// What a plan is concluded with.
struct End {
    basis: Basis,
    operations: u64,
    shed: Vec<(GoalKey, Reason)>,
    reserve_j: f64,
    profile: Profile,
}

/// Where a plan goes below its reserve.
struct Shortfall {
    /// In which sol, or the night after it.
    sol: u32,
    /// When it is lowest.
    at_ms: i64,
    /// By how much \[J\].
    lacking_j: f64,
}

impl Basis {
    /// Whether another one has goals, weights or what others hold that this one has not.
    fn is_news(&self, other: &Basis) -> bool {
        let is_known = |goal: &_| self.goals.contains(goal);
        self.worth != other.worth
            || !other.held.is_subset(&self.held)
            || !other.goals.iter().all(is_known)
    }
}

/// The dawn after a sol \[ms\].
fn dawn_after(forecast: &mut Forecast, sol: u32) -> i64 {
    match forecast.day_ms(sol + 1) {
        Some([opens_ms, _]) => opens_ms,
        None => forecast.time_ms(sol + 1, 0.0),
    }
}

/// What a plan does in which sol, in order.
fn order_of(forecast: &mut Forecast, plan: &Plan) -> Vec<(u32, Activity)> {
    let pieces = plan.pieces.iter();
    let placed = pieces.filter(|piece| {
        matches!(
            piece.activity,
            Activity::Goal(_) | Activity::Communication(_)
        )
    });
    placed
        .map(|piece| (forecast.sol_at(piece.starts_ms), piece.activity))
        .collect()
}

/// An order as visits of a problem, as far as it is still to be done.
fn visits(instance: &Instance, posed: &Posed, order: &[(u32, Activity)]) -> Vec<(usize, Visit)> {
    let visit = |&(sol, activity): &(u32, Activity)| {
        let number = posed.sols.iter().position(|at| *at == sol)?;
        let task = match activity {
            Activity::Goal(key) => posed.keys[..posed.own].iter().position(|at| *at == key)?,
            Activity::Communication(_) => {
                let duty = posed.duties.iter().position(|at| *at == sol)?;
                instance.goals() + duty
            }
            Activity::Drive(_) | Activity::Sleep => return None,
        };
        Some((number, Visit::new(instance, task)))
    };
    order.iter().filter_map(visit).collect()
}

/// Lets the planner plan all own goals; mandatory ones at once. Returns those for which there is no room.
fn assign_all(casper: &mut Casper, instance: &Instance, posed: &Posed) -> Vec<Unmet> {
    let goals = 0..posed.own;
    let refused = goals.filter_map(|goal| casper.assign(instance, goal, None).err());
    refused.collect()
}

/// What there is too little of.
fn lack(violation: &Violation) -> Reason {
    if violation.bits > 0 {
        Reason::Memory
    } else if violation.energy_uj > 0 && violation.late_ms == 0 {
        Reason::Power
    } else {
        Reason::Time
    }
}

fn load(piece: &Piece) -> Load {
    Load {
        from_ms: piece.starts_ms,
        until_ms: piece.ends_ms,
        power_w: piece.power_w,
    }
}

/// The pieces of the planner's plan, and their order.
fn trace(casper: &Casper, posed: &Posed, means: &super::Means, known: &Known, found: &mut Found) {
    let rover = &posed.problem.rovers[0];
    let mut before: Option<(usize, i64)> = None;
    let mut place_m = Ready::after(known).position_m;
    for node in casper.plan().nodes() {
        let ready_ms = match before {
            Some((sol, ends_ms)) if sol == node.sol => ends_ms,
            _ => rover.sols[node.sol].opens_ms,
        };
        let piece = |activity, starts_ms, ends_ms, position_m| Piece {
            activity,
            position_m,
            starts_ms,
            ends_ms,
            power_w: 0.0,
            adds_bits: 0,
            sends_bits: 0,
            battery_j: 0.0,
            memory_bits: 0,
        };
        let task = node.visit.task;
        let (activity, power_mw, [adds_bits, sends_bits]) =
            match task.checked_sub(posed.problem.goals.len()) {
                None => {
                    let goal = &posed.problem.goals[task];
                    place_m = goal.position_m;
                    (
                        Activity::Goal(posed.keys[task]),
                        goal.power_mw,
                        [goal.memory_bits, 0],
                    )
                }
                Some(duty) => {
                    let of = &posed.problem.activities[duty];
                    let activity = Activity::Communication(posed.duties[duty]);
                    (activity, of.power_mw, [0, of.sends_bits])
                }
            };
        if let (Activity::Goal(key), true) = (activity, node.drive_ms > 0) {
            let arrives_ms = ready_ms + node.drive_ms;
            found.free.push(Piece {
                power_w: means.drive_power_w,
                ..piece(Activity::Drive(key), ready_ms, arrives_ms, place_m)
            });
        }
        found.free.push(Piece {
            power_w: power_mw as f64 * 1e-3,
            adds_bits,
            sends_bits,
            ..piece(activity, node.start_ms, node.end_ms, place_m)
        });
        found.order.push((posed.sols[node.sol], activity));
        before = Some((node.sol, node.end_ms));
    }
}
