//! The fastest way of one rover round all that is reserved, by safe intervals; and who is to blame
//! where there is none.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

use farside_worlds::{Roadmap, VertexId};

use super::plan::Failure;
use super::problem::{Mission, Problem, Rules};
use super::safe_intervals::{Aim, FOREVER, Label, SearchSpace, TimedVisit, way_to};
use super::table::StayTable;
use super::timetable::Pace;

/// When a rover may come in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Entry {
    /// At this tick or any later one, as late as the rest of its way allows: so that it waits in
    /// its queue, where it is in nobody's way, and not at its entry. With [`Rules::StayAtTarget`]
    /// it stands there from the start all the same.
    From(u64),
    /// As soon as its entry is free: it may not wait outside for a clear way.
    AtOnce,
}

/// The way of `rover` that ends first. With [`Rules::StayAtTarget`] it stays at its goal for ever.
///
/// # Errors
/// When there is none: with [`Rules::DisappearAtTarget`] and [`Entry::From`] only if somebody stays
/// on the map for ever.
pub(crate) fn search(
    problem: &Problem<'_>,
    pace: &Pace<'_>,
    table: &StayTable,
    rover: usize,
    entry: Entry,
) -> Result<Vec<TimedVisit>, Failure> {
    let left = times_to(problem.roadmap(), pace, problem.missions()[rover].goal);
    search_with(problem, pace, table, rover, entry, &|v| left[v.0 as usize])
}

/// The same for who knows how long the way from each vertex takes at least.
pub(crate) fn search_with(
    problem: &Problem<'_>,
    pace: &Pace<'_>,
    table: &StayTable,
    rover: usize,
    entry: Entry,
    left: &dyn Fn(VertexId) -> u64,
) -> Result<Vec<TimedVisit>, Failure> {
    let (map, rules) = (problem.roadmap(), problem.rules());
    let mission = problem.missions()[rover];
    let ground = SearchSpace {
        roadmap: map,
        headway: pace.headway,
        travel: pace.travel,
        busy: &|v| Some(table.busy(v)),
        // Closed gaps are no part of the map; only a reservation request crosses open ones.
        covers: &|_| true,
    };
    let mut labels = first_labels(&ground, pace, rules, mission, entry);
    let aim = Aim {
        left,
        is_end: &|label| {
            label.vertex == mission.goal
                && (rules == Rules::DisappearAtTarget || label.until == FOREVER)
        },
        is_barred: &|from, to, at| table.closes_ring(from, to, at).is_some(),
    };
    let open: Vec<u32> = (0..labels.len() as u32).collect();
    let Some(last) = ground.search(&mut labels, &open, &aim) else {
        return Err(failure(&ground, table, mission.entry, rover, &labels));
    };
    let label = labels[last as usize];
    let end = match rules {
        // It takes a gap to be known as gone.
        Rules::DisappearAtTarget => label.ready.saturating_add(pace.headway).min(label.until),
        Rules::StayAtTarget => FOREVER,
    };
    let mut way = way_to(&labels, last, end, |_| true);
    if rules == Rules::StayAtTarget || entry == Entry::AtOnce {
        let first = std::iter::successors(Some(&label), |label| {
            label.parent.map(|at| &labels[at as usize])
        });
        way[0].start = first.last().map_or(way[0].start, |label| label.start);
    }
    Ok(way)
}

/// Where the search begins.
fn first_labels(
    ground: &SearchSpace<'_>,
    pace: &Pace<'_>,
    rules: Rules,
    mission: Mission,
    entry: Entry,
) -> Vec<Label> {
    let earliest = match entry {
        Entry::From(tick) => tick,
        Entry::AtOnce => 0,
    };
    let mut labels = ground.enter(mission.entry, earliest, pace.enter);
    match (rules, entry) {
        (Rules::StayAtTarget, _) => labels.retain(|label| label.start == 0),
        (Rules::DisappearAtTarget, Entry::AtOnce) => labels.truncate(1),
        (Rules::DisappearAtTarget, Entry::From(_)) => {}
    }
    labels
}

/// How long the way to `goal` takes from each vertex, for a rover that is alone [ticks].
fn times_to(map: &Roadmap, pace: &Pace<'_>, goal: VertexId) -> Vec<u64> {
    let mut times = vec![FOREVER; map.len()];
    times[goal.0 as usize] = 0;
    let mut open = BinaryHeap::from([(Reverse(0), goal)]);
    while let Some((Reverse(time), at)) = open.pop() {
        if time > times[at.0 as usize] {
            continue;
        }
        for &from in map.neighbors(at) {
            let longer = time.saturating_add((pace.travel)(from, at));
            if longer < times[from.0 as usize] {
                times[from.0 as usize] = longer;
                open.push((Reverse(longer), from));
            }
        }
    }
    times
}

/// Who said no when nothing was left: at the latest instant at which the rover could still be
/// anywhere. `labels` are all places and times that it could reach.
fn failure(
    ground: &SearchSpace<'_>,
    table: &StayTable,
    entry: VertexId,
    rover: usize,
    labels: &[Label],
) -> Failure {
    let Some(until) = labels.iter().map(|label| label.until).max() else {
        // It cannot even begin.
        let first = table.stays(entry).first();
        return Failure {
            rover,
            blockers: first.map(|stay| stay.rover).into_iter().collect(),
            at: 0,
        };
    };
    // From then on nobody moves any more: nothing is worth waiting for.
    let settled = table.settled();
    let mut blockers = BTreeSet::new();
    for label in labels.iter().filter(|label| label.until == until) {
        let here = label.vertex;
        let at = until.min(settled.max(label.ready));
        if until != FOREVER {
            let next = table.stays(here).iter().find(|stay| stay.from >= at);
            blockers.extend(next.map(|stay| stay.rover));
        }
        for &to in ground.roadmap.neighbors(here) {
            let there = at.saturating_add((ground.travel)(here, to));
            let meets = |from: u64, until: u64| {
                until.saturating_add(ground.headway) > at
                    && from < there.saturating_add(ground.headway)
            };
            let stays = table.stays(to).iter();
            let mut taken = stays.filter(|stay| meets(stay.from, stay.until)).peekable();
            if taken.peek().is_none() && ground.headway == 0 {
                blockers.extend(table.closes_ring(here, to, at));
            }
            blockers.extend(taken.map(|stay| stay.rover));
        }
    }
    Failure {
        rover,
        blockers: blockers.into_iter().collect(),
        at: until.min(settled),
    }
}
