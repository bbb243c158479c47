//! Exact envelopes beside all schedules of small temporal networks.

use proptest::prelude::*;

use super::*;
use crate::temporal::{Network, Point};

const HORIZON: Span = Span::new(0, 6);
/// From before all times to after them, with those that end beyond the horizon.
const TICKS: std::ops::Range<Ticks> = -1..12;
const INITIAL: i64 = 2;

/// A time of a use: a point, by its place, and how many ticks after it.
type Time = (usize, Ticks);

/// A small problem: points with constraints, and uses of a resource at them.
#[derive(Clone, Debug)]
struct Case {
    points: usize,
    constraints: Vec<(usize, usize, Span)>,
    uses: Vec<(Time, Option<Time>, Span)>,
    limits: Span,
}

fn case() -> impl Strategy<Value = Case> {
    let pick = || 0..5usize;
    let span = prop_oneof![
        (0..4i64).prop_map(Span::at_least),
        (-3..4i64, 0..3i64).prop_map(|(min, more)| Span::new(min, min + more)),
        (0..5i64).prop_map(Span::at_most),
    ];
    let change = (-3..3i64, 0..2i64).prop_map(|(min, more)| Span::new(min, min + more));
    // For good, from a point to another one, or for a window after a point.
    let end = prop_oneof![
        2 => Just((None, None)),
        3 => pick().prop_map(|to| (Some(to), None)),
        1 => (0..4i64).prop_map(|window| (None, Some(window))),
    ];
    let one = (pick(), end, change).prop_map(|(from, (to, window), change)| {
        let end = to.map(|to| (to, 0));
        (
            (from, 0),
            end.or(window.map(|window| (from, window))),
            change,
        )
    });
    (
        2..=5usize,
        prop::collection::vec((pick(), pick(), span), 0..6),
        prop::collection::vec(one, 1..6),
        (-2..2i64, 3..6i64).prop_map(|(least, most)| Span::new(least, most)),
    )
        .prop_map(|(points, constraints, uses, limits)| {
            let wrapped = |(place, plus): Time| (place % points, plus);
            Case {
                points,
                constraints: constraints
                    .into_iter()
                    .map(|(from, to, span)| (from % points, to % points, span))
                    .collect(),
                uses: uses
                    .into_iter()
                    .map(|(start, end, change)| (wrapped(start), end.map(wrapped), change))
                    .collect(),
                limits,
            }
        })
}

/// The network of a case, its points, and the constraints that it took. What would end before it
/// starts is no use, but each use adds the constraint that it does not.
struct Built {
    network: Network<()>,
    points: Vec<Point>,
    constraints: Vec<(usize, usize, Span)>,
    uses: Vec<(Time, Option<Time>, Span)>,
}

fn build(case: &Case) -> Built {
    let mut network = Network::new(HORIZON);
    let points: Vec<Point> = (0..case.points).map(|_| network.add_point()).collect();
    let mut constraints = Vec::new();
    let mut constrain = |from: usize, to: usize, span: Span| {
        let is_taken = network
            .constrain(points[from], points[to], span, ())
            .is_ok();
        if is_taken {
            constraints.push((from, to, span));
        }
        is_taken
    };
    for &(from, to, span) in &case.constraints {
        constrain(from, to, span);
    }
    let is_taken = |one: &&(Time, Option<Time>, Span)| match one.1 {
        Some(end) if end.0 != one.0.0 => constrain(one.0.0, end.0, Span::at_least(0)),
        _ => true,
    };
    let uses = case.uses.iter().filter(is_taken).copied().collect();
    Built {
        network,
        points,
        constraints,
        uses,
    }
}

/// Calls `each` with all schedules: the times of all points.
fn schedules(built: &Built, times: &mut Vec<Ticks>, each: &mut impl FnMut(&[Ticks])) {
    if times.len() == built.points.len() {
        return each(times);
    }
    for time in HORIZON.min..=HORIZON.max {
        times.push(time);
        let known = times.len();
        let holds = built.constraints.iter().all(|&(from, to, span)| {
            from.max(to) >= known || span.contains(times[to] - times[from])
        });
        if holds {
            schedules(built, times, each);
        }
        times.pop();
    }
}

/// Which uses are in force at a tick of a schedule.
fn in_force(built: &Built, times: &[Ticks], tick: Ticks) -> Vec<bool> {
    let at = |(place, plus): Time| times[place] + plus;
    built
        .uses
        .iter()
        .map(|&(start, end, _)| at(start) <= tick && end.is_none_or(|end| tick < at(end)))
        .collect()
}

/// What all schedules say of a tick.
#[derive(Clone, Debug)]
struct Seen {
    level: Span,
    /// Which uses are in force in a schedule, with the least and the greatest level then.
    sets: Vec<(Vec<bool>, Span)>,
}

fn see_all(built: &Built) -> Vec<Seen> {
    let nothing = Seen {
        level: Span::new(i64::MAX, i64::MIN),
        sets: Vec::new(),
    };
    let mut seen: Vec<Seen> = TICKS.map(|_| nothing.clone()).collect();
    schedules(built, &mut Vec::new(), &mut |times| {
        for (tick, seen) in TICKS.zip(&mut seen) {
            let set = in_force(built, times, tick);
            if seen.sets.iter().any(|(other, _)| *other == set) {
                continue;
            }
            let changes = set.iter().zip(&built.uses).filter(|(is_in, _)| **is_in);
            let level = changes.fold(Span::exactly(INITIAL), |level, (_, (_, _, change))| {
                Span::new(level.min + change.min, level.max + change.max)
            });
            seen.level.min = seen.level.min.min(level.min);
            seen.level.max = seen.level.max.max(level.max);
            seen.sets.push((set, level));
        }
    });
    seen
}

/// The first over-use that all schedules show: interval, amount, worst tick, whether certain.
fn first_over_use(
    seen: &[Seen],
    bound: Bound,
    limits: Span,
    from: Ticks,
) -> Option<(Span, i64, Ticks, bool)> {
    let mut found: Option<(Span, i64, Ticks, bool)> = None;
    for (tick, seen) in TICKS.zip(seen).filter(|(tick, _)| *tick >= from) {
        let (worst, best) = match bound {
            Bound::Least => (limits.min - seen.level.min, limits.min - seen.level.max),
            Bound::Most => (seen.level.max - limits.max, seen.level.min - limits.max),
        };
        match &mut found {
            None if worst > 0 => found = Some((Span::at_least(tick), worst, tick, best > 0)),
            None => {}
            Some((during, ..)) if worst <= 0 => {
                during.max = tick - 1;
                return found;
            }
            Some((_, amount, worst_tick, is_certain)) => {
                if worst > *amount {
                    (*amount, *worst_tick) = (worst, tick);
                }
                *is_certain |= best > 0;
            }
        }
    }
    found
}

/// The contributors are what is in force in a schedule in which the level is worst, as far as it
/// leads towards the limit; those that are certain are in force in all.
fn check_contributors(
    built: &Built,
    seen: &Seen,
    over_use: &OverUse<usize>,
) -> Result<(), TestCaseError> {
    let towards = |change: Span| match over_use.bound {
        Bound::Least => -change.min,
        Bound::Most => change.max,
    };
    let found: Vec<usize> = over_use.contributors.iter().map(|one| one.owner).collect();
    let is_worst = |(set, level): &&(Vec<bool>, Span)| {
        let is_worst = match over_use.bound {
            Bound::Least => level.min == seen.level.min,
            Bound::Most => level.max == seen.level.max,
        };
        let leads = |at: &usize| set[*at] && towards(built.uses[*at].2) > 0;
        let mut expected: Vec<usize> = (0..set.len()).filter(leads).collect();
        let mut found = found.clone();
        expected.sort_unstable();
        found.sort_unstable();
        is_worst && found == expected
    };
    prop_assert!(
        seen.sets.iter().any(|one| is_worst(&one)),
        "{:?} in {:?}",
        found,
        seen
    );
    for one in &over_use.contributors {
        prop_assert_eq!(one.amount, towards(built.uses[one.owner].2));
        let is_certain = seen.sets.iter().all(|(set, _)| set[one.owner]);
        prop_assert_eq!(one.is_certain, is_certain);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    /// The exact envelopes and over-uses are those of all schedules; the profile's own are never
    /// narrower, and are the exact ones of times that are independent.
    #[test]
    fn exact_envelopes_are_those_of_all_schedules(case in case()) {
        let built = build(&case);
        let seen = see_all(&built);
        let mut profile = Profile::new(INITIAL, case.limits);
        let span = |(place, plus): Time| {
            let bounds = built.network.bounds(built.points[place]);
            Span::new(bounds.min + plus, bounds.max + plus)
        };
        for (owner, &(start, end, change)) in built.uses.iter().enumerate() {
            let one = Use { start: span(start), end: end.map(span), change };
            profile.add(one, owner).unwrap();
        }
        let mut order = InNetwork::new(&built.network, |moment: Moment<'_, usize>| {
            let (start, end, _) = built.uses[*moment.owner];
            let (place, plus) = if moment.is_end { end.unwrap() } else { start };
            (built.points[place], plus)
        });
        let mut exact = Exact::new();
        for (tick, seen) in TICKS.zip(&seen) {
            let level = exact.level(&profile, tick, &mut order);
            prop_assert_eq!(level, seen.level, "at {}", tick);
            let wide = profile.level(tick);
            prop_assert!(wide.min <= level.min && level.max <= wide.max);
            prop_assert_eq!(exact.level(&profile, tick, &mut Independent), wide);
        }
        for bound in [Bound::Least, Bound::Most] {
            for from in TICKS {
                let found = exact.first_over_use_of(&profile, bound, from, &mut order);
                let expected = first_over_use(&seen, bound, case.limits, from);
                let said = |at: &OverUse<_>| (at.during, at.amount, at.worst_tick, at.is_certain);
                prop_assert_eq!(found.as_ref().map(said), expected);
                if let Some(found) = found {
                    prop_assert_eq!(found.bound, bound);
                    check_contributors(&built, &seen[(found.worst_tick - TICKS.start) as usize], &found)?;
                }
                let wide = profile.first_over_use_of(bound, from);
                let alone = exact.first_over_use_of(&profile, bound, from, &mut Independent);
                prop_assert_eq!(alone, wide);
            }
        }
    }
}
