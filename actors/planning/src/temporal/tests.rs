//! The network beside Bellman and Ford from scratch, its explanations beside sums, its work beside
//! what changed.

use std::collections::{BTreeMap, BTreeSet};

use proptest::prelude::*;

use super::*;

const HORIZON: Span = Span::new(-200, 1_000);

/// What is asked of a network, each with numbers that pick among what there is.
#[derive(Clone, Debug)]
enum Edit {
    Point,
    PointWithin(Span),
    RemovePoint(usize),
    Constrain(usize, usize, Span),
    Tighten(usize, Span),
    Retract(usize),
    Push,
    Pop,
    Commit,
}

fn span() -> impl Strategy<Value = Span> {
    let bound = -60..120i64;
    prop_oneof![
        bound.clone().prop_map(Span::at_least),
        bound.clone().prop_map(Span::at_most),
        (bound, 0..80i64).prop_map(|(min, more)| Span::new(min, min + more)),
        Just(Span::ALL),
        (0..50i64, -50..0i64).prop_map(|(min, max)| Span::new(min, max)),
    ]
}

fn edit() -> impl Strategy<Value = Edit> {
    let pick = || 0..1_000usize;
    prop_oneof![
        3 => Just(Edit::Point),
        1 => span().prop_map(Edit::PointWithin),
        1 => pick().prop_map(Edit::RemovePoint),
        12 => (pick(), pick(), span()).prop_map(|(a, b, span)| Edit::Constrain(a, b, span)),
        4 => (pick(), span()).prop_map(|(a, span)| Edit::Tighten(a, span)),
        6 => pick().prop_map(Edit::Retract),
        1 => Just(Edit::Push),
        1 => Just(Edit::Pop),
        1 => Just(Edit::Commit),
    ]
}

/// The bounds of all points by Bellman and Ford from scratch; none if no times fit.
fn from_scratch(
    points: &[Point],
    within: &BTreeMap<Point, Span>,
    constraints: &[(Point, Point, Span)],
    origin: Point,
) -> Option<Vec<(Point, Span)>> {
    let places = points.iter().map(|point| point.index() + 1).max()?;
    // Distances from the origin, and to it: an edge (a, b, w) says b - a <= w.
    let mut edges = Vec::new();
    for point in points.iter().filter(|point| **point != origin) {
        let span = within[point];
        edges.push((origin.index(), point.index(), span.max));
        edges.push((point.index(), origin.index(), -span.min));
    }
    for (from, to, span) in constraints {
        if span.max != Ticks::MAX {
            edges.push((from.index(), to.index(), span.max));
        }
        if span.min != Ticks::MIN {
            edges.push((to.index(), from.index(), -span.min));
        }
    }
    let distances = |reversed: bool| {
        let mut distance: Vec<Ticks> = vec![1 << 40; places];
        distance[origin.index()] = 0;
        for _ in 0..=places {
            let mut changed = false;
            for &(a, b, weight) in &edges {
                let (a, b) = if reversed { (b, a) } else { (a, b) };
                if distance[a] + weight < distance[b] {
                    distance[b] = distance[a] + weight;
                    changed = true;
                }
            }
            if !changed {
                return Some(distance);
            }
        }
        // Still changing after as many rounds as points: there is a negative cycle.
        None
    };
    let (latest, earliest) = (distances(false)?, distances(true)?);
    let bounds = |point: &Point| Span::new(-earliest[point.index()], latest[point.index()]);
    Some(points.iter().map(|point| (*point, bounds(point))).collect())
}

/// Whether a conflict is what it says: a cycle of inequalities of these constraints and the
/// horizon, through each point once, whose sum is above 0.
fn check(
    conflict: &Conflict<u32>,
    constraints: &BTreeMap<u32, (Point, Point, Span)>,
    within: &BTreeMap<Point, Span>,
    network: &Network<u32>,
) -> Result<(), TestCaseError> {
    prop_assert!(conflict.excess() > 0, "{conflict}");
    let cycle = &conflict.cycle;
    for (link, next) in cycle.iter().zip(cycle.iter().cycle().skip(1)) {
        prop_assert_eq!(link.to, next.from, "{}", conflict);
        let holds = match link.owner {
            None => {
                let origin = network.origin();
                let from_start = link.from == origin && link.at_least == within[&link.to].min;
                from_start || link.to == origin && link.at_least == -within[&link.from].max
            }
            Some(owner) => {
                let (from, to, span) = constraints[&owner];
                // A constraint that was to be tightened may be there by what it was.
                let on = (link.from, link.to) == (from, to) && link.at_least <= span.min;
                let back = (link.from, link.to) == (to, from) && link.at_least <= -span.max;
                on || back
            }
        };
        prop_assert!(holds, "{conflict}");
    }
    let visited: BTreeSet<Point> = cycle.iter().map(|link| link.from).collect();
    prop_assert_eq!(visited.len(), cycle.len(), "{}", conflict);
    Ok(())
}

type Whole = (
    Vec<(Point, Span)>,
    Vec<(Constraint, Point, Point, Span)>,
    Vec<u32>,
);

fn whole(network: &Network<u32>) -> Whole {
    let constraints: Vec<_> = network.all_constraints().collect();
    let owner = |one: &(Constraint, Point, Point, Span)| *network.owner(one.0).unwrap();
    let owners = constraints.iter().map(owner).collect();
    (network.all_bounds().collect(), constraints, owners)
}

/// After every edit: the same bounds as from scratch, and a refusal where nothing fits; what is
/// popped is as it was.
fn agrees_with_scratch(first: Vec<Edit>, edits: Vec<Edit>) -> Result<(), TestCaseError> {
    let mut network = Network::new(HORIZON);
    let mut marks: Vec<Whole> = Vec::new();
    // Of each point, also of those that are gone and may come back, within what it was added.
    let mut within = BTreeMap::from([(network.origin(), Span::exactly(0))]);
    for (number, edit) in (0u32..).zip(first.into_iter().chain(edits)) {
        let points: Vec<Point> = network.all_bounds().map(|(point, _)| point).collect();
        let all: Vec<_> = network.all_constraints().collect();
        let before = whole(&network);
        // By owner: who owns what when the edit is tried.
        let mut owned: BTreeMap<u32, (Point, Point, Span)> = all
            .iter()
            .map(|&(id, from, to, span)| (*network.owner(id).unwrap(), (from, to, span)))
            .collect();
        let tried: Option<Result<(), Conflict<u32>>> = match edit {
            Edit::Point => {
                within.insert(network.add_point(), HORIZON);
                None
            }
            Edit::PointWithin(span) => {
                let span = HORIZON.intersect(span);
                let point = network.add_point_within(span);
                prop_assert_eq!(point.is_none(), span.is_empty());
                within.extend(point.map(|point| (point, span)));
                None
            }
            Edit::RemovePoint(pick) => {
                let point = points[pick % points.len()];
                if point != network.origin() {
                    network.remove_point(point);
                }
                None
            }
            Edit::Constrain(a, b, span) => {
                let (from, to) = (points[a % points.len()], points[b % points.len()]);
                owned.insert(number, (from, to, span));
                Some(network.constrain(from, to, span, number).map(drop))
            }
            Edit::Tighten(pick, span) if !all.is_empty() => {
                let (id, from, to, old) = all[pick % all.len()];
                let owner = *network.owner(id).unwrap();
                owned.insert(owner, (from, to, old.intersect(span)));
                Some(network.tighten(id, span))
            }
            Edit::Retract(pick) if !all.is_empty() => {
                network.retract(all[pick % all.len()].0);
                None
            }
            Edit::Push => {
                network.push();
                marks.push(before.clone());
                None
            }
            Edit::Pop => {
                network.pop();
                if let Some(mark) = marks.pop() {
                    prop_assert_eq!(whole(&network), mark);
                }
                None
            }
            Edit::Commit => {
                network.commit();
                marks.pop();
                None
            }
            Edit::Tighten(..) | Edit::Retract(_) => None,
        };
        if let Some(outcome) = tried {
            let wanted: Vec<_> = owned.values().copied().collect();
            let fits = from_scratch(&points, &within, &wanted, network.origin()).is_some();
            prop_assert_eq!(outcome.is_ok(), fits);
            if let Err(conflict) = outcome {
                check(&conflict, &owned, &within, &network)?;
                prop_assert_eq!(whole(&network), before, "refused, it changes nothing");
            }
        }
        let points: Vec<Point> = network.all_bounds().map(|(point, _)| point).collect();
        let all = network
            .all_constraints()
            .map(|(_, from, to, span)| (from, to, span));
        let all: Vec<_> = all.collect();
        let expected = from_scratch(&points, &within, &all, network.origin());
        let bounds: Vec<(Point, Span)> = network.all_bounds().collect();
        prop_assert_eq!(Some(bounds), expected);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10_000))]

    #[test]
    fn edits_agree_with_bellman_and_ford(edits in prop::collection::vec(edit(), 1..50)) {
        agrees_with_scratch(Vec::new(), edits)?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn edits_of_many_points_agree_with_bellman_and_ford(
        points in 5..200usize,
        edits in prop::collection::vec(edit(), 1..100),
    ) {
        agrees_with_scratch(vec![Edit::Point; points], edits)?;
    }
}

/// A network of some shape, with `n` points, all constraints with slack.
fn network_of(n: usize, seed: u64) -> (Network<u32>, Vec<Point>) {
    let mut network = Network::new(Span::new(0, 1 << 40));
    let points: Vec<Point> = (0..n).map(|_| network.add_point()).collect();
    let mut random = seed;
    let mut draw = |below: usize| {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (random >> 33) as usize % below
    };
    for (number, at) in (0u32..).zip(1..n) {
        // Each point after one of the ten before it, and after another one anywhere before it.
        let near = at - 1 - draw(at.min(10));
        let far = draw(at);
        for before in [near, far] {
            let span = Span::new(draw(20) as i64, 1 << 30);
            network
                .constrain(points[before], points[at], span, number)
                .unwrap();
        }
    }
    (network, points)
}

/// How many inequalities pass on a change of a point's value on a side.
fn passes(network: &Network<u32>, side: Side, point: Point) -> u64 {
    let mut half = network.nodes.get(point).unwrap().first[side];
    let mut count = 0;
    while half != NONE {
        count += 1;
        half = network.halves[half as usize].next[side];
    }
    count
}

#[test]
fn a_tightening_looks_at_what_changes_once_for_each_bound() {
    for n in [100, 1_000, 10_000] {
        let (mut network, points) = network_of(n, 7);
        let all: Vec<Constraint> = network.all_constraints().map(|one| one.0).collect();
        let mut changed_in_all = 0;
        for pick in 0..60 {
            let id = all[(pick * 7_919) % all.len()];
            let (_, _, span) = network.constraint(id).unwrap();
            let before: Vec<Span> = points.iter().map(|point| network.bounds(*point)).collect();
            let start = network.work().inequalities;
            network.tighten(id, Span::at_least(span.min + 25)).unwrap();
            let looked = network.work().inequalities - start;
            let mut allowed = 0;
            for (point, before) in points.iter().zip(before) {
                let now = network.bounds(*point);
                if now.min != before.min {
                    allowed += passes(&network, EARLIEST, *point);
                    changed_in_all += 1;
                }
                if now.max != before.max {
                    allowed += passes(&network, LATEST, *point);
                    changed_in_all += 1;
                }
            }
            assert!(looked <= allowed, "{n} points: {looked} of {allowed}");
        }
        assert!(
            changed_in_all > 60,
            "the edits change something: {changed_in_all}"
        );
    }
}

#[test]
fn a_retraction_looks_at_what_rested_on_it_and_its_neighbours() {
    for n in [100, 1_000, 10_000] {
        let (mut network, points) = network_of(n, 8);
        let mut rested_in_all = 0;
        for pick in 0..60 {
            let all: Vec<Constraint> = network.all_constraints().map(|one| one.0).collect();
            let id = all[(pick * 7_919) % all.len()];
            let gone = [2 * id.index() as u32, 2 * id.index() as u32 + 1];
            let mut allowed = 0;
            for side in [EARLIEST, LATEST] {
                // Point by point: does the way to its root pass what will be gone?
                let rests = |point: &&Point| {
                    let mut at = point.index() as u32;
                    while let Some(half) = network.node(at).by[side] {
                        if gone.contains(&half) {
                            return true;
                        }
                        at = network.halves[half as usize].source(side);
                    }
                    false
                };
                for point in points.iter().filter(rests) {
                    rested_in_all += 1;
                    // To find who rests on it, to start it anew, and to pass that on.
                    let on = passes(&network, side, *point);
                    allowed += 2 * on + passes(&network, 1 - side, *point);
                }
            }
            let start = network.work().inequalities;
            network.retract(id);
            let looked = network.work().inequalities - start;
            assert!(looked <= allowed, "{n} points: {looked} of {allowed}");
        }
        assert!(
            rested_in_all > 30,
            "something rested on what is gone: {rested_in_all}"
        );
    }
}

#[test]
fn a_push_and_a_pop_cost_what_changed_between_them() {
    let cost = |n: usize| {
        let (mut network, points) = network_of(n, 9);
        let kept = network.all_bounds().collect::<Vec<_>>();
        network.push();
        for pick in 0..20 {
            let at = (pick * 7_919) % n;
            let far = Span::at_least(1 << 20);
            network
                .constrain(network.origin(), points[at], far, 0)
                .unwrap();
            network.retract(network.constraints_of(points[at])[0]);
        }
        let changes = network.trail.len();
        network.pop();
        assert!(network.trail.is_empty());
        assert_eq!(network.all_bounds().collect::<Vec<_>>(), kept);
        changes
    };
    // What changes is what comes after a point, at most all: the trail has no more.
    for n in [10, 100, 1_000] {
        assert!(cost(n) < 20 * 2 * (2 * n + 8), "{n}: {}", cost(n));
    }
}

#[test]
fn far_and_empty_bounds_are_refused_or_say_nothing() {
    let mut network = Network::new(Span::new(0, 100));
    let (a, b) = (network.add_point(), network.add_point());
    for (span, fits) in [
        (Span::new(5, 4), false),
        (Span::at_least(101), false),
        (Span::at_least(Ticks::MAX), false),
        (Span::at_most(Ticks::MIN + 1), false),
        (Span::at_least(Ticks::MIN + 1), true),
        (Span::at_most(Ticks::MAX - 1), true),
        (Span::at_least(100), true),
    ] {
        assert_eq!(
            network.constrain(a, b, span, span).is_ok(),
            fits,
            "{span:?}"
        );
    }
    assert_eq!(
        (network.bounds(a), network.bounds(b)),
        (Span::exactly(0), Span::exactly(100))
    );
    let twice = network
        .constrain(a, a, Span::at_least(1), Span::at_least(1))
        .unwrap_err();
    assert_eq!(twice.cycle.len(), 1);
}
