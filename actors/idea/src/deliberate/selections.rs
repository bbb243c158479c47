//! Which goals are done, and in which order.

use std::sync::Arc;

use farside_planning::Ticks;
use farside_planning::model::Model;
use farside_planning::plan::Plan;
use farside_planning::search::{self, Forward, Planner, Repair};

use super::{
    Begin, DeliberationError, LeftOut, Ordering, Settings, Target, Visit, drive_ticks, problem,
};

/// What a selection of goals is worth: how many of those that must be done are in it, what the others
/// weigh, and how many goals it has.
fn worth(bits: usize, targets: &[Target]) -> (u32, u64, u32) {
    let chosen = targets
        .iter()
        .enumerate()
        .filter(|(at, _)| bits >> at & 1 == 1);
    chosen.fold(
        (0, 0, bits.count_ones()),
        |(must, weight, count), (_, target)| match target.weight {
            None => (must + 1, weight, count),
            Some(more) => (must, weight + u64::from(more), count),
        },
    )
}

/// The shortest drives through each selection of goals (M. Held and R. M. Karp, *A Dynamic Programming
/// Approach to Sequencing Problems*, 1962).
struct Shortest {
    count: usize,
    /// By selection and last goal: how long its drives take, and the goal before the last.
    best: Vec<(Ticks, usize)>,
    operations: u64,
}

impl Shortest {
    fn of(targets: &[Target], begin: &Begin, settings: &Settings) -> Self {
        let count = targets.len();
        let place = |at: usize| [targets[at].x_dm, targets[at].y_dm];
        let mut drives = vec![0; (count + 1) * count];
        for to in 0..count {
            drives[to] = drive_ticks([begin.x_dm, begin.y_dm], place(to), settings);
            for from in 0..count {
                drives[(from + 1) * count + to] = drive_ticks(place(from), place(to), settings);
            }
        }
        let mut shortest = Shortest {
            count,
            best: vec![(Ticks::MAX, count); (1 << count) * count],
            operations: 0,
        };
        for bits in 1..1_usize << count {
            for last in (0..count).filter(|last| bits >> last & 1 == 1) {
                let before = bits & !(1 << last);
                let mut best = (Ticks::MAX, count);
                if before == 0 {
                    best = (drives[last], count);
                }
                for from in (0..count).filter(|from| before >> from & 1 == 1) {
                    let until = shortest.best[before * count + from].0;
                    best = best.min((until + drives[(from + 1) * count + last], from));
                    shortest.operations += 1;
                }
                shortest.best[bits * count + last] = best;
            }
        }
        shortest
    }

    /// How long the drives of a selection take at least.
    fn ticks(&self, bits: usize) -> Ticks {
        if bits == 0 {
            return 0;
        }
        let of = &self.best[bits * self.count..][..self.count];
        of.iter().map(|&(ticks, _)| ticks).min().unwrap_or(0)
    }

    /// The order with the shortest drives.
    fn order(&self, mut bits: usize) -> Vec<usize> {
        let of = |bits: usize| &self.best[bits * self.count..][..self.count];
        let mut last = (0..self.count).min_by_key(|&last| (of(bits)[last].0, last));
        let mut order = Vec::new();
        while let Some(at) = last.filter(|_| bits != 0) {
            order.push(at);
            let before = of(bits)[at].1;
            bits &= !(1 << at);
            last = Some(before);
        }
        order.reverse();
        order
    }
}

/// Whether the horizon and the battery allow a selection whose drives take so long.
fn is_allowed(bits: usize, drives: Ticks, begin: &Begin, settings: &Settings) -> bool {
    if bits == 0 {
        return true;
    }
    let images = Ticks::from(bits.count_ones());
    // The rover is a tick at least where it begins.
    let ends = 1 + drives + images * settings.image_ticks;
    let takes = settings.drive_energy * drives + settings.image_energy * images;
    ends <= settings.horizon && begin.battery - takes >= settings.reserve
}

/// The best order. Time and energy both follow the drives, so that of each selection only the shortest
/// order counts; the complete planner then plans the best selection in that order.
pub(super) fn best(
    targets: &[Target],
    begin: &Begin,
    settings: &Settings,
) -> Result<Ordering, DeliberationError> {
    let shortest = Shortest::of(targets, begin, settings);
    let allowed = |bits: &usize| is_allowed(*bits, shortest.ticks(*bits), begin, settings);
    let selections = (0..1_usize << targets.len()).filter(allowed);
    let best = selections.max_by_key(|&bits| {
        (
            worth(bits, targets),
            std::cmp::Reverse(shortest.ticks(bits)),
        )
    });
    let bits = best.unwrap_or(0);
    let mut ordering = Ordering {
        proven: true,
        operations: shortest.operations,
        ..Ordering::default()
    };
    let missing = (0..targets.len()).filter(|target| bits >> target & 1 == 0);
    ordering.left_out.extend(missing.map(|target| {
        let reason = match allowed(&(1 << target)) {
            false => "the horizon and the battery do not allow it, even alone",
            true => "the horizon and the battery do not allow it with what is worth more",
        };
        LeftOut {
            target,
            reason: reason.to_owned(),
        }
    }));
    if bits == 0 {
        return Ok(ordering);
    }
    let order = shortest.order(bits);
    let model = problem::model(targets, begin, settings)?;
    let problem = problem::in_order(&model, &order, begin, settings)?;
    let operations = settings.operations.saturating_sub(ordering.operations);
    let of = search::Settings {
        operations,
        seed: 1,
    };
    let answer = Forward.solve(&model, &problem, of)?;
    ordering.operations += answer.operations;
    let plan = answer
        .plan
        .ok_or(DeliberationError::NoPlan { operations })?;
    ordering.visits = visits(&plan);
    Ok(ordering)
}

/// A good order of many goals, by repair.
pub(super) fn repaired(
    targets: &[Target],
    begin: &Begin,
    settings: &Settings,
) -> Result<Ordering, DeliberationError> {
    let model = problem::model(targets, begin, settings)?;
    let weights = targets.iter().map(|target| target.weight.map(f64::from));
    let goals: Vec<(usize, Option<f64>)> = weights.enumerate().collect();
    let must = goals.iter().any(|goal| goal.1.is_none());
    let half = if must {
        settings.operations / 2
    } else {
        settings.operations
    };
    let (plan, mut operations) = repair(&model, &goals, half, begin, settings)?;
    let mut plan = plan;
    if plan.is_none() && must {
        // Not all that must be done can be: as many of them as possible.
        let all: f64 = goals.iter().filter_map(|goal| goal.1).sum();
        let weighed = goals
            .iter()
            .map(|&(target, weight)| (target, weight.or(Some(all + 1.0))));
        let weighed: Vec<(usize, Option<f64>)> = weighed.collect();
        let left = settings.operations.saturating_sub(operations);
        let (second, more) = repair(&model, &weighed, left, begin, settings)?;
        (plan, operations) = (second, operations + more);
    }
    let plan = plan.unwrap_or_default();
    let visits = visits(&plan);
    let missing = |target: &usize| visits.iter().all(|visit| visit.target != *target);
    let left_out = (0..targets.len()).filter(missing).map(|target| {
        let name = format!("g{target}");
        let said = plan.left_out.iter().find(|one| one.goal == name);
        let reason = said.map_or("no order with it was found in time", |one| &one.reason);
        LeftOut {
            target,
            reason: reason.to_owned(),
        }
    });
    let left_out = left_out.collect();
    Ok(Ordering {
        visits,
        left_out,
        proven: false,
        operations,
    })
}

fn repair(
    model: &Arc<Model>,
    goals: &[(usize, Option<f64>)],
    operations: u64,
    begin: &Begin,
    settings: &Settings,
) -> Result<(Option<Plan>, u64), DeliberationError> {
    let problem = problem::problem(model, goals, begin, settings)?;
    let of = search::Settings {
        operations,
        seed: 1,
    };
    let answer = Repair::default().solve(model, &problem, of)?;
    Ok((answer.plan, answer.operations))
}

/// The goals of a plan, in its order.
fn visits(plan: &Plan) -> Vec<Visit> {
    let visits = plan.achieved.iter().filter_map(|achieved| {
        let token = plan
            .tokens
            .iter()
            .find(|token| token.id == achieved.token)?;
        let target = achieved.goal.strip_prefix('g')?.parse().ok()?;
        Some(Visit {
            target,
            start: token.start,
            end: token.end,
        })
    });
    let mut visits: Vec<Visit> = visits.collect();
    visits.sort_by_key(|visit| (visit.start, visit.target));
    visits
}
