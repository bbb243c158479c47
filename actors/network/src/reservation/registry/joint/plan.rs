//! A plan for a whole team, from where it stops: made by the root of a joint resolution, entered in
//! the tables of all.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use farside_worlds::VertexId;

use crate::config::Motion;
use crate::ids::RoverId;
use crate::mapf::safe_intervals::{FOREVER, TimedVisit};
use crate::mapf::{CoupledError, LacamConfig, Mission, Problem, Rules, lacam};
use crate::reservation::messages::{PlannedVisit, ReservationRequest, ReservedVisit, Stop};
use crate::reservation::registry::Desk;

/// A plan by which all get from where they stop to their goals.
#[derive(Debug)]
pub(crate) struct JointPlan {
    /// Where each rover stops, by rover.
    pub(crate) stops: Vec<Stop>,
    /// Rover by rover; each one's first visit is where it stops.
    pub(crate) visits: Vec<PlannedVisit>,
}

/// The plan for a team of which this is reserved.
///
/// # Errors
/// When there is none, or none is found within the limits.
pub(crate) fn joint_plan(
    desk: &Desk<'_>,
    reserved: &[ReservedVisit],
    headway: u64,
    limits: LacamConfig,
) -> Result<JointPlan, CoupledError> {
    let site = desk.site;
    let stops = stops(reserved);
    // What rovers still pass before they stop, and where they do.
    let mut busy = BTreeMap::<VertexId, u64>::new();
    let mut last = BTreeMap::<RoverId, TimedVisit>::new();
    for held in reserved {
        match held.step.cmp(&stops[&held.rover]) {
            Ordering::Less => {
                let until = busy.entry(held.visit.vertex).or_default();
                *until = (*until).max(held.visit.end);
            }
            Ordering::Equal => {
                last.insert(held.rover, held.visit);
            }
            Ordering::Greater => {}
        }
    }
    let missions = last.iter().map(|(rover, visit)| {
        let (_, goal) = site.missions[rover.0 as usize];
        Mission::new(visit.vertex, goal)
    });
    let problem = Problem::new(&site.roadmap, missions.collect(), Rules::StayAtTarget);
    let problem = problem.map_err(|_| CoupledError::Exhausted { expansions: 0 })?;
    let limits = LacamConfig {
        improvements: improvements(site.roadmap.len()),
        ..limits
    };
    let plan = lacam(&problem, &limits)?.plan;
    let mut soon = desk.now + headway;
    if site.config.motion == Motion::Cycles {
        // Whole steps, as all planners count them.
        soon = soon.next_multiple_of(site.timing.cycle.as_nanos());
    }
    let ready = last.values().map(|visit| match visit.start {
        0 => soon,
        start => soon.max(start + site.longest_step.as_nanos()),
    });
    let pace = Timing {
        ready: ready.collect(),
        busy,
        travel: &|u, v| site.planned_step(u, v).as_nanos(),
        headway,
    };
    let ways = timed(&plan.visits(&problem), &pace);
    let visits = last.keys().zip(ways).flat_map(|(&rover, way)| {
        let request = ReservationRequest {
            rover,
            attempt: 0,
            since: desk.now,
        };
        let planned = |i: usize| PlannedVisit {
            request,
            step: stops[&rover] + i as u32,
            from: i.checked_sub(1).map(|before| way[before].vertex),
            visit: way[i],
        };
        (0..way.len()).map(planned).collect::<Vec<_>>()
    });
    let visits = visits.collect();
    let stop = |(rover, step)| Stop { rover, step };
    let stops = stops.into_iter().map(stop).collect();
    Ok(JointPlan { stops, visits })
}

/// How far each rover goes on what is reserved: at least to the last vertex that it was granted,
/// and off each vertex that another one, going that far, comes to after it.
fn stops(reserved: &[ReservedVisit]) -> BTreeMap<RoverId, u32> {
    let mut stops = BTreeMap::new();
    for held in reserved.iter().filter(|held| held.granted) {
        let step = stops.entry(held.rover).or_insert(held.step);
        *step = held.step.max(*step);
    }
    let mut in_order: Vec<&ReservedVisit> = reserved.iter().collect();
    in_order.sort_unstable_by_key(|held| (held.visit.vertex, held.visit.start));
    loop {
        let mut is_done = true;
        for pair in in_order.chunk_by(|a, b| a.visit.vertex == b.visit.vertex) {
            let holds = |held: &&&ReservedVisit| stops.get(&held.rover) >= Some(&held.step);
            let kept: Vec<_> = pair.iter().filter(holds).collect();
            for held in kept.iter().rev().skip(1) {
                if stops[&held.rover] == held.step {
                    stops.insert(held.rover, held.step + 1);
                    is_done = false;
                }
            }
        }
        if is_done {
            return stops;
        }
    }
}

/// How many times a plan is improved: fewer times on large maps, where each takes longer.
fn improvements(vertices: usize) -> u32 {
    (MOST_WORK / vertices.max(1)).min(400) as u32
}

/// Vertices times improvements.
const MOST_WORK: usize = 4_000_000;

/// From when on what is free.
struct Timing<'a> {
    /// When each rover may set out.
    ready: Vec<u64>,
    /// When rovers go on from where they have still to pass.
    busy: BTreeMap<VertexId, u64>,
    travel: &'a dyn Fn(VertexId, VertexId) -> u64,
    headway: u64,
}

/// The ways of a plan in cycles, as soon as can be: at each vertex rovers come in the order of the
/// plan, each when the one before has gone on.
fn timed(ways: &[Vec<TimedVisit>], pace: &Timing<'_>) -> Vec<Vec<TimedVisit>> {
    let mut order: Vec<(u64, usize, usize)> = Vec::new();
    let mut last = BTreeMap::<VertexId, (usize, usize)>::new();
    for (rover, way) in ways.iter().enumerate() {
        order.extend((0..way.len()).map(|i| (way[i].start, rover, i)));
    }
    order.sort_unstable();
    let mut before = BTreeMap::new();
    for &(_, rover, i) in &order {
        if let Some(other) = last.insert(ways[rover][i].vertex, (rover, i)) {
            before.insert((rover, i), other);
        }
    }
    let mut starts: Vec<Vec<Option<u64>>> = ways.iter().map(|way| vec![None; way.len()]).collect();
    let mut open = order;
    // Of those that begin in one cycle some wait for others of it. No ring turns, so each time
    // round some begin.
    while !open.is_empty() {
        let count = open.len();
        open.retain(|&(_, rover, i)| {
            let start = start(ways, &starts, pace, (rover, i), before.get(&(rover, i)));
            starts[rover][i] = start;
            start.is_none()
        });
        assert!(open.len() < count, "a plan in which rovers wait in a ring");
    }
    let way = |(way, starts): (&Vec<TimedVisit>, &Vec<Option<u64>>)| {
        let start = |i: usize| starts.get(i).copied().flatten();
        let visit = |(i, visit): (usize, &TimedVisit)| TimedVisit {
            vertex: visit.vertex,
            start: start(i).unwrap_or(0),
            end: start(i + 1).unwrap_or(FOREVER),
        };
        way.iter().enumerate().map(visit).collect()
    };
    ways.iter().zip(&starts).map(way).collect()
}

/// When a visit can begin, if that is known: when its rover is ready, and whoever is to be there
/// before it has gone on.
fn start(
    ways: &[Vec<TimedVisit>],
    starts: &[Vec<Option<u64>>],
    pace: &Timing<'_>,
    (rover, i): (usize, usize),
    before: Option<&(usize, usize)>,
) -> Option<u64> {
    let way = &ways[rover];
    let ready = match i {
        0 => return Some(0),
        1 => pace.ready[rover],
        _ => starts[rover][i - 1]? + (pace.travel)(way[i - 2].vertex, way[i - 1].vertex),
    };
    let free = match before {
        Some(&(other, at)) => (*starts[other].get(at + 1)?)?,
        None => match pace.busy.get(&way[i].vertex) {
            Some(&end) => end,
            None => return Some(ready),
        },
    };
    Some(ready.max(free + pace.headway))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{grid, v};

    #[test]
    fn rovers_follow_each_other_as_planned_and_as_soon_as_can_be() {
        // 0 1 2 3, and 4 below 1: the first goes aside, the second passes, the first goes on.
        let visit = |vertex, start, end| TimedVisit {
            vertex: v(vertex),
            start,
            end,
        };
        let first = vec![visit(1, 0, 1), visit(4, 1, 4), visit(1, 4, FOREVER)];
        let second = vec![
            visit(0, 0, 1),
            visit(1, 1, 2),
            visit(2, 2, 3),
            visit(3, 3, FOREVER),
        ];
        let pace = Timing {
            ready: vec![100, 250],
            busy: BTreeMap::from([(v(4), 130), (v(2), 7)]),
            travel: &|_, _| 50,
            headway: 2,
        };
        let ways = timed(&[first, second], &pace);
        let spans = |way: &[TimedVisit]| -> Vec<_> {
            way.iter().map(|visit| (visit.start, visit.end)).collect()
        };
        assert_eq!(spans(&ways[0]), [(0, 132), (132, 302), (302, FOREVER)]);
        let passes = [(0, 250), (250, 300), (300, 350), (350, FOREVER)];
        assert_eq!(spans(&ways[1]), passes);
    }

    fn reserved(rover: u32, step: u32, vertex: u32, start: u64, granted: bool) -> ReservedVisit {
        ReservedVisit {
            rover: RoverId(rover),
            step,
            visit: TimedVisit {
                vertex: v(vertex),
                start,
                end: start + 9,
            },
            granted,
        }
    }

    /// The first rover was granted its third vertex and not yet its second, on which the second one
    /// stands; that one has to go on, and so has the third, which is in its way.
    #[test]
    fn rovers_stop_where_they_are_in_the_way_of_no_grant() {
        let all = [
            reserved(0, 1, 0, 0, true),
            reserved(0, 2, 1, 30, false),
            reserved(0, 3, 2, 40, true),
            reserved(0, 4, 3, 50, false),
            reserved(1, 7, 1, 0, true),
            reserved(1, 8, 4, 20, false),
            reserved(1, 9, 5, 30, false),
            reserved(2, 5, 4, 0, true),
            reserved(2, 6, 6, 10, false),
            reserved(2, 7, 1, 50, false),
        ];
        let expected = [(0, 3), (1, 8), (2, 6)].map(|(rover, step)| (RoverId(rover), step));
        assert_eq!(stops(&all), BTreeMap::from(expected));
    }

    #[test]
    fn a_train_sets_out_one_after_the_other_in_one_cycle() {
        let map = grid(9, 1, &[]);
        let missions = (0..8).map(|i| Mission::new(v(i), v(i + 1))).collect();
        let problem = Problem::new(&map, missions, Rules::StayAtTarget).unwrap();
        let plan = lacam(&problem, &LacamConfig::default()).unwrap().plan;
        let pace = Timing {
            ready: vec![10; 8],
            busy: BTreeMap::new(),
            travel: &|_, _| 50,
            headway: 3,
        };
        let ways = timed(&plan.visits(&problem), &pace);
        let starts: Vec<u64> = ways.iter().map(|way| way[1].start).collect();
        assert_eq!(starts, [31, 28, 25, 22, 19, 16, 13, 10]);
    }
}
