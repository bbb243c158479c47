//! Which goals are done, and in which order.

use farside_planning::Ticks;
use farside_planning::plan::Plan;
use farside_planning::search::complete::Complete;
use farside_planning::search::schedule::Schedule;
use farside_planning::search::{Stack, Verdict, chronological, extract};

use super::{Begin, DeliberationError, Settings, Target, Visit, drive_ticks, problem};

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

/// A selection of goals in an order.
pub(super) struct Chosen {
    pub(super) order: Vec<usize>,
    /// Whether nothing is better.
    pub(super) proven: bool,
    pub(super) operations: u64,
}

/// The best selection. Time and energy both follow the drives, so that of each selection only the
/// shortest order counts.
pub(super) fn best(targets: &[Target], begin: &Begin, settings: &Settings) -> Chosen {
    let shortest = Shortest::of(targets, begin, settings);
    let allowed = |bits: &usize| is_allowed(*bits, shortest.ticks(*bits), begin, settings);
    let selections = (0..1_usize << targets.len()).filter(allowed);
    let bits = selections
        .max_by_key(|&bits| {
            (
                worth(bits, targets),
                std::cmp::Reverse(shortest.ticks(bits)),
            )
        })
        .unwrap_or(0);
    Chosen {
        order: if bits == 0 {
            Vec::new()
        } else {
            shortest.order(bits)
        },
        proven: true,
        operations: shortest.operations,
    }
}

/// A good selection of many goals: each, the one that is worth most first, goes where it makes the way
/// least longer, if the horizon and the battery allow it; and parts of the order are turned around as
/// long as that makes it shorter (G. A. Croes, *A Method for Solving Traveling-Salesman Problems*, 1958).
pub(super) fn good(targets: &[Target], begin: &Begin, settings: &Settings) -> Chosen {
    let mut chosen = Chosen {
        order: Vec::new(),
        proven: false,
        operations: 0,
    };
    let mut by_worth: Vec<usize> = (0..targets.len()).collect();
    by_worth.sort_by_key(|&at| std::cmp::Reverse(targets[at].weight.map_or(u64::MAX, u64::from)));
    for target in by_worth {
        if chosen.operations >= settings.operations {
            break;
        }
        let slots = (0..=chosen.order.len()).map(|slot| {
            let mut order = chosen.order.clone();
            order.insert(slot, target);
            (drives(&order, targets, begin, settings), order)
        });
        let Some((_, order)) = slots.min() else {
            continue;
        };
        chosen.operations += (order.len() * order.len()) as u64;
        let order = turned(order, targets, begin, settings, &mut chosen.operations);
        if fits(&order, targets, begin, settings) {
            chosen.order = order;
        }
    }
    chosen
}

/// An order with parts turned around, as long as that makes it shorter.
fn turned(
    mut order: Vec<usize>,
    targets: &[Target],
    begin: &Begin,
    settings: &Settings,
    operations: &mut u64,
) -> Vec<usize> {
    let mut least = drives(&order, targets, begin, settings);
    let mut shorter = true;
    while shorter && *operations < settings.operations {
        shorter = false;
        for from in 0..order.len() {
            for to in from + 2..=order.len() {
                order[from..to].reverse();
                let ticks = drives(&order, targets, begin, settings);
                *operations += order.len() as u64;
                if ticks < least {
                    (least, shorter) = (ticks, true);
                } else {
                    order[from..to].reverse();
                }
            }
        }
    }
    order
}

/// How long the drives of an order take.
fn drives(order: &[usize], targets: &[Target], begin: &Begin, settings: &Settings) -> Ticks {
    let places = order.iter().map(|&at| [targets[at].x_dm, targets[at].y_dm]);
    let mut at = [begin.x_dm, begin.y_dm];
    let drives =
        places.map(|there| drive_ticks(std::mem::replace(&mut at, there), there, settings));
    drives.sum()
}

/// Whether the horizon and the battery allow an order.
pub(super) fn fits(
    order: &[usize],
    targets: &[Target],
    begin: &Begin,
    settings: &Settings,
) -> bool {
    let bits = (1_usize << order.len().min(63)) - 1;
    is_allowed(
        bits,
        drives(order, targets, begin, settings),
        begin,
        settings,
    )
}

/// When each goal of an order is done, as the complete planner says that plans it.
pub(super) fn planned(
    chosen: &Chosen,
    targets: &[Target],
    begin: &Begin,
    settings: &Settings,
) -> Result<(Vec<Visit>, u64), DeliberationError> {
    if chosen.order.is_empty() {
        return Ok((Vec::new(), 0));
    }
    let model = problem::model(targets, begin, settings)?;
    let problem = problem::in_order(&model, &chosen.order, begin, settings)?;
    let mut schedule = Schedule::new(model, problem)?;
    let mut complete = Complete::new(&schedule);
    let (before, limit) = (schedule.database.operations(), settings.operations);
    let mut stack = Stack::default();
    let verdict = chronological(&mut schedule.database, &mut complete, &mut stack, limit);
    let operations = schedule.database.operations() - before;
    if !matches!(verdict, Verdict::Solved) {
        return Err(DeliberationError::NoPlan { operations });
    }
    let plan = extract(&schedule, |_| String::new(), ("complete", 0, operations));
    Ok((visits(&plan), operations))
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
