//! Better plans from good ones: a few rovers at a time are planned anew round all others.

use farside::random::Stream;
use farside_worlds::VertexId;
use farside_worlds::roadmap::DistancesTo;

use crate::mapf::plan::Plan;
use crate::mapf::problem::Problem;
use crate::mapf::safe_intervals::TimedVisit;
use crate::mapf::single::{self, Entry};
use crate::mapf::table::StayTable;
use crate::mapf::timetable::{Pace, Timetable};

/// How many rovers are planned anew at a time, at most.
const GROUP: u64 = 8;

/// The plan after so many attempts to make it better, each of which takes some rovers out and plans
/// them anew one after the other; it never gets worse. All arrive in it, before and after.
pub(super) fn improved(
    problem: &Problem<'_>,
    plan: Plan,
    left: &[DistancesTo<'_>],
    attempts: u32,
    draws: &mut Stream,
) -> Plan {
    let count = problem.missions().len();
    let mut table = StayTable::new(problem.roadmap(), count);
    for (rover, way) in plan.visits(problem).into_iter().enumerate() {
        table.insert(rover, way);
    }
    for attempt in 0..attempts as usize {
        // Everybody once, together with some others, again and again.
        let mut group = vec![attempt % count];
        for _ in 0..draws.below(GROUP) {
            let other = draws.below(count as u64) as usize;
            if !group.contains(&other) {
                group.push(other);
            }
        }
        draws.shuffle(&mut group);
        attempt_group(problem, &mut table, left, &group);
    }
    let ways = table.into_ways();
    let timetable = Timetable {
        ways,
        ..Timetable::default()
    };
    timetable.in_cycles().plan
}

fn attempt_group(
    problem: &Problem<'_>,
    table: &mut StayTable,
    left: &[DistancesTo<'_>],
    group: &[usize],
) {
    let old: Vec<Vec<TimedVisit>> = group.iter().map(|&r| table.way(r).to_vec()).collect();
    let cost = |ways: &[TimedVisit]| ways.last().map_or(0, |visit| visit.start);
    let before: u64 = old.iter().map(|way| cost(way)).sum();
    for &rover in group {
        table.remove(rover);
    }
    let mut after = 0;
    let mut done = 0;
    for &rover in group {
        let least = |v: VertexId| u64::from(left[rover].from(v));
        let way = single::search_with(problem, &Pace::CYCLES, table, rover, Entry::From(0), &least);
        let Ok(way) = way else { break };
        after += cost(&way);
        if after > before {
            break;
        }
        table.insert(rover, way);
        done += 1;
    }
    if done == group.len() {
        return;
    }
    for &rover in &group[..done] {
        table.remove(rover);
    }
    for (&rover, way) in group.iter().zip(old) {
        table.insert(rover, way);
    }
}
