//! Max-plus against brute force and against its definition.

use super::*;
use crate::NetworkConfig;
use crate::max_plus::candidates::Destination;
use crate::max_plus::payoff::collision;
use crate::testing::grid;
use farside::random::{RandomKey, Stream};

const PLAIN: Rules = Rules {
    tolerance: 1e-3,
    damping: 0.0,
    anytime: false,
};

fn payoffs() -> Payoffs {
    Payoffs {
        longest: 100.0,
        backtrack: 40.0,
        leaf_wait: 45.0,
        imminent: -1000.0,
        ..Payoffs::new(&NetworkConfig::default(), &grid(2, 1, &[]))
    }
}

/// Random paths on 6 vertices; whether they make sense on a roadmap does not matter here.
fn random_paths(stream: &mut Stream) -> Arc<[CandidatePath]> {
    // More than a block of payoffs holds, now and then.
    let most = if stream.chance(0.2) { 12 } else { 3 };
    let count = 2 + stream.below(most);
    (0..count)
        .map(|_| {
            let vertices = (0..2 + stream.below(3))
                .map(|_| farside_worlds::VertexId(stream.below(6) as u32))
                .collect();
            CandidatePath {
                destination: Destination::Leaf,
                vertices,
                payoff: stream.uniform_in(0.0, 50.0) as f32,
            }
        })
        .collect()
}

type Team = Vec<Arc<[CandidatePath]>>;

fn team(stream: &mut Stream, size: usize) -> Team {
    (0..size).map(|_| random_paths(stream)).collect()
}

/// Q (equation 1) of a joint choice.
fn utility(rovers: &Team, pairs: &[(usize, usize)], choice: &[usize]) -> f64 {
    let alone = choice
        .iter()
        .zip(rovers)
        .map(|(&c, r)| f64::from(r[c].payoff));
    let worth = |&(i, j): &(usize, usize)| {
        let (a, b) = (&rovers[i][choice[i]], &rovers[j][choice[j]]);
        f64::from(payoffs().pairwise(a.payoff + b.payoff, collision(a, b, false)))
    };
    alone.sum::<f64>() + pairs.iter().map(worth).sum::<f64>()
}

/// The joint choice that maximises Q, by trying all.
fn exhaustive(rovers: &Team, pairs: &[(usize, usize)]) -> Vec<usize> {
    let mut best = (f64::NEG_INFINITY, vec![]);
    let mut choice = vec![0; rovers.len()];
    loop {
        let q = utility(rovers, pairs, &choice);
        if q > best.0 {
            best = (q, choice.clone());
        }
        let Some(at) = (0..choice.len()).find(|&i| choice[i] + 1 < rovers[i].len()) else {
            return best.1;
        };
        choice[at] += 1;
        choice[..at].fill(0);
    }
}

fn problem(rules: Rules, first: u32, rovers: &[Arc<[CandidatePath]>]) -> Solver {
    let rovers = (first..).map(RoverId).zip(rovers.iter().cloned());
    Solver::new(payoffs(), rules, Room::default(), rovers.collect())
}

fn iterate(problem: &mut Solver) -> bool {
    let changed = problem.compute();
    problem.deliver();
    changed
}

/// A node for each rover, with its own edges of `pairs`.
fn nodes(rules: Rules, rovers: &Team, pairs: &[(usize, usize)]) -> Vec<Solver> {
    let alone = |i: usize| problem(rules, i as u32, &rovers[i..=i]);
    let mut nodes: Vec<_> = (0..rovers.len()).map(alone).collect();
    for &(a, b) in pairs {
        for (a, b) in [(a, b), (b, a)] {
            let rover = (RoverId(b as u32), rovers[b].clone());
            nodes[a].add(NodeId(b as u32), vec![rover], 0);
        }
    }
    nodes
}

/// One iteration of all nodes; true if anything changed.
fn iterate_all(nodes: &mut [Solver]) -> bool {
    let mut changed = false;
    for node in nodes.iter_mut() {
        changed |= iterate(node);
    }
    exchange(nodes);
    changed
}

/// All nodes' messages arrive.
fn exchange(nodes: &mut [Solver]) {
    for from in 0..nodes.len() {
        let choices = nodes[from].choices();
        for to in 0..nodes.len() {
            let (vectors, bases) = nodes[from].changed_for(NodeId(to as u32));
            for vector in &vectors {
                nodes[to].receive(vector);
            }
            for base in &bases {
                nodes[to].take(base);
            }
            for choice in &choices {
                nodes[to].note(choice);
            }
        }
    }
}

/// What all nodes choose, as places in each rover's list.
fn joint(nodes: &[Solver], rovers: &Team, converged: bool) -> Vec<usize> {
    let chosen = nodes.iter().flat_map(|node| node.best(converged));
    chosen
        .zip(rovers)
        .map(|((_, path), all)| all.iter().position(|p| p == path).unwrap())
        .collect()
}

#[test]
fn two_rovers_of_one_node_get_the_best_pair() {
    let mut stream = RandomKey::new(5).text("pair").stream();
    for _ in 0..200 {
        let rovers = team(&mut stream, 2);
        let mut one = problem(PLAIN, 0, &rovers);
        while iterate(&mut one) {}
        assert_eq!(joint(&[one], &rovers, true), exhaustive(&rovers, &[(0, 1)]));
    }
}

/// A chain a - b - c over three nodes, where a and c do not hear each other: a tree. Damped or not,
/// with the best kept or not, max-plus is exact on it.
#[test]
fn a_chain_of_nodes_finds_the_exhaustive_optimum() {
    let mut stream = RandomKey::new(6).text("chain").stream();
    let pairs = [(0, 1), (1, 2)];
    for round in 0..300 {
        let rovers = team(&mut stream, 3);
        let (damping, anytime) = ([0.0, 0.5, 0.9][round % 3], round % 2 == 0);
        let rules = Rules {
            // Damped vectors stop short of their limit by several times the tolerance.
            tolerance: 1e-4,
            damping,
            anytime,
        };
        let mut nodes = nodes(rules, &rovers, &pairs);
        let enough = if damping == 0.0 { 6 } else { 400 };
        for _ in 0..enough {
            iterate_all(&mut nodes);
        }
        assert!(!iterate_all(&mut nodes), "a tree converges");
        let best = utility(&rovers, &pairs, &exhaustive(&rovers, &pairs));
        let found = utility(&rovers, &pairs, &joint(&nodes, &rovers, true));
        // Payoffs are single, and so is the sum here.
        assert!(found >= best - 0.1, "{found} instead of {best}");
    }
}

/// All rovers in one node, every pair an edge: cycles, on which max-plus may not converge.
#[test]
fn the_best_of_all_iterations_is_never_worse_than_the_last() {
    let mut stream = RandomKey::new(8).text("cycle").stream();
    let pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
    let rules = Rules {
        anytime: true,
        ..PLAIN
    };
    let mut better = 0;
    for _ in 0..200 {
        let rovers = team(&mut stream, 4);
        let (mut one, mut seen) = (problem(rules, 0, &rovers), f64::NEG_INFINITY);
        for _ in 0..20 {
            iterate(&mut one);
            let last = utility(
                &rovers,
                &pairs,
                &joint(std::slice::from_ref(&one), &rovers, true),
            );
            seen = seen.max(last);
            let kept = joint(std::slice::from_ref(&one), &rovers, false);
            let kept = utility(&rovers, &pairs, &kept);
            // What it does before the first message counts too.
            assert!(kept >= seen - 1e-3, "{kept} after {seen}");
            better += u32::from(kept > last + 1e-3);
        }
    }
    assert!(better > 0, "never of use");
}

/// A ring of four nodes with a rover each. Two nodes may keep what does not fit together, so that
/// nothing is promised for one ring; over many, keeping helps.
#[test]
fn keeping_helps_in_rings_of_nodes() {
    let mut stream = RandomKey::new(9).text("ring").stream();
    let pairs = [(0, 1), (1, 2), (2, 3), (0, 3)];
    let rules = Rules {
        anytime: true,
        ..PLAIN
    };
    let (mut kept, mut last) = (0.0, 0.0);
    for _ in 0..300 {
        let rovers = team(&mut stream, 4);
        let mut nodes = nodes(rules, &rovers, &pairs);
        let converged = (0..15).any(|_| !iterate_all(&mut nodes));
        last += utility(&rovers, &pairs, &joint(&nodes, &rovers, true));
        kept += utility(&rovers, &pairs, &joint(&nodes, &rovers, converged));
    }
    assert!(kept >= last, "{kept} kept, {last} in the end");
}

#[test]
fn damping_mixes_the_old_vector_in() {
    let mut stream = RandomKey::new(10).text("damped").stream();
    let rovers = team(&mut stream, 2);
    let first = |damping| {
        let rules = Rules { damping, ..PLAIN };
        let mut node = nodes(rules, &rovers, &[(0, 1)]).swap_remove(0);
        iterate(&mut node);
        let once = node.changed_for(NodeId(1)).0.remove(0).values;
        iterate(&mut node);
        let twice = node.changed_for(NodeId(1)).0;
        (once, twice)
    };
    let (plain, nothing_new) = first(0.0);
    assert!(nothing_new.is_empty());
    let (once, twice) = first(0.75);
    for ((full, one), two) in plain.iter().zip(&once).zip(&twice[0].values) {
        assert!((one - 0.25 * full).abs() < 1e-3);
        assert!((two - (0.75 * 0.25 + 0.25) * full).abs() < 1e-3);
    }
}

/// The same messages without blocks, short cuts or transposed payoffs.
#[test]
fn messages_agree_with_the_definition() {
    let mut stream = RandomKey::new(11).text("naive").stream();
    for round in 0..60 {
        let rovers = team(&mut stream, 4);
        let n = rovers.len();
        let mut one = problem(PLAIN, 0, &rovers);
        let mut old = vec![vec![vec![]; n]; n];
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            old[i][j] = vec![0.0f32; rovers[j].len()];
        }
        for _ in 0..12 {
            iterate(&mut one);
            let mut new = old.clone();
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                if i == j {
                    continue;
                }
                let worth = |a: usize, b: usize| {
                    let (a, b) = (&rovers[i][a], &rovers[j][b]);
                    payoffs().pairwise(a.payoff + b.payoff, collision(a, b, false))
                };
                let base = |a: usize| {
                    let others = (0..n).filter(|&k| k != i);
                    let sum = others.fold(rovers[i][a].payoff, |sum, k| sum + old[k][i][a]);
                    sum - old[j][i][a]
                };
                let best = |b: usize| {
                    let all = (0..rovers[i].len()).map(|a| base(a) + worth(a, b));
                    all.fold(f32::NEG_INFINITY, f32::max)
                };
                let fresh: Vec<f32> = (0..rovers[j].len()).map(best).collect();
                let mean = fresh.iter().sum::<f32>() / fresh.len() as f32;
                let fresh: Vec<f32> = fresh.iter().map(|value| value - mean).collect();
                let moved = fresh
                    .iter()
                    .zip(&old[i][j])
                    .any(|(x, y)| (x - y).abs() > 1e-3);
                if moved {
                    new[i][j] = fresh;
                }
            }
            old = new;
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                if i != j {
                    let found = &one.edges[i][place_of(i, j)].outgoing;
                    assert_eq!(found, &old[i][j], "round {round}, {i} to {j}");
                }
            }
        }
    }
}

#[test]
fn work_is_counted_by_pairs_of_paths() {
    let mut stream = RandomKey::new(12).text("work").stream();
    let rovers = team(&mut stream, 4);
    let sizes: Vec<u64> = rovers.iter().map(|paths| paths.len() as u64).collect();
    let mut one = problem(PLAIN, 0, &rovers[..2]);
    assert_eq!(one.take_compared(), sizes[0] * sizes[1]);
    assert_eq!(one.take_compared(), 0);
    // Both directions of the pair within the node are computed here.
    assert_eq!(one.pairs(), 2 * sizes[0] * sizes[1]);
    let others = (2..).map(RoverId).zip(rovers[2..].iter().cloned());
    one.add(NodeId(1), others.collect(), 0);
    let more = (sizes[0] + sizes[1]) * (sizes[2] + sizes[3]);
    assert_eq!(one.take_compared(), more);
    assert_eq!(one.pairs(), 2 * sizes[0] * sizes[1] + more);
}

#[test]
fn vectors_that_fit_no_edge_are_refused() {
    let mut stream = RandomKey::new(7).text("refuse").stream();
    let rovers = team(&mut stream, 2);
    let mut one = problem(PLAIN, 0, &rovers[..1]);
    assert!(one.is_trivial());
    one.add(
        NodeId(1),
        vec![(RoverId(1), rovers[1].clone()), (RoverId(1), [].into())],
        0,
    );
    assert!(!one.is_trivial());
    let vector = |from, to, values| Vector {
        from: RoverId(from),
        to: RoverId(to),
        values,
    };
    let fitting = vec![1.0; rovers[0].len()];
    assert!(!one.receive(&vector(2, 0, fitting.clone())));
    assert!(!one.receive(&vector(0, 0, fitting.clone())));
    assert!(!one.receive(&vector(1, 3, fitting.clone())));
    assert!(!one.receive(&vector(1, 0, vec![f32::NAN; rovers[0].len()])));
    assert!(!one.receive(&vector(1, 0, vec![1.0; 40])));
    assert!(one.receive(&vector(1, 0, fitting.clone())));
    assert!(!one.receive(&vector(1, 0, fitting)), "no news");
}

/// Three nodes with two rovers each, all of them neighbours, which hand over what `quotas` say: how
/// many pairs each node hands the next one.
fn three_nodes(rules: Rules, rovers: &Team, quotas: [u64; 3]) -> Vec<Solver> {
    let of =
        |node: usize| (node * 2..node * 2 + 2).map(|at| (RoverId(at as u32), rovers[at].clone()));
    let mut nodes: Vec<_> = (0..3)
        .map(|node| Solver::new(payoffs(), rules, Room::default(), of(node).collect()))
        .collect();
    for (a, b) in (0..3).flat_map(|a| (0..3).map(move |b| (a, b))) {
        let quota = if b == (a + 1) % 3 { quotas[a] } else { 0 };
        if a != b {
            nodes[a].add(NodeId(b as u32), of(b).collect(), quota);
        }
    }
    nodes
}

#[test]
fn vectors_that_others_make_are_the_same_bit_for_bit() {
    let mut stream = RandomKey::new(13).text("handed").stream();
    let mut handed = 0;
    for round in 0..120 {
        let rules = Rules {
            tolerance: 0.0,
            damping: [0.0, 0.5][round % 2],
            anytime: round % 3 == 0,
        };
        let rovers = team(&mut stream, 6);
        let quotas = std::array::from_fn(|_| stream.below(200));
        let mut plain = three_nodes(rules, &rovers, [0; 3]);
        let mut handing = three_nodes(rules, &rovers, quotas);
        handed += handing.iter().map(Solver::handed).sum::<u64>();
        for _ in 0..12 {
            for (plain, handing) in plain.iter_mut().zip(&mut handing) {
                plain.compute();
                handing.compute();
                for i in 0..2 {
                    assert_eq!(plain.total(i), handing.total(i), "round {round}");
                }
                assert_eq!(plain.best(false), handing.best(false));
                plain.deliver();
                handing.deliver();
            }
            exchange(&mut plain);
            exchange(&mut handing);
        }
    }
    assert!(handed > 1000, "{handed}");
}

#[test]
fn what_is_handed_over_is_work_for_who_takes_it() {
    let mut stream = RandomKey::new(14).text("handed work").stream();
    let rovers = team(&mut stream, 6);
    let sizes: Vec<u64> = rovers.iter().map(|paths| paths.len() as u64).collect();
    let first = sizes[0] * sizes[2];
    let mut plain = three_nodes(PLAIN, &rovers, [0; 3]);
    let mut handing = three_nodes(PLAIN, &rovers, [first, 0, 0]);
    let compared = |node: &mut Solver| node.take_compared();
    assert_eq!(handing[0].handed(), first);
    assert_eq!(compared(&mut plain[0]) - compared(&mut handing[0]), first);
    assert_eq!(compared(&mut plain[1]), compared(&mut handing[1]));
    iterate_all(&mut handing);
    assert_eq!(plain[0].pairs() - handing[0].pairs(), first);
    assert_eq!(handing[1].pairs() - plain[1].pairs(), first);
    assert_eq!(handing[2].pairs(), plain[2].pairs());
    for (plain, handing) in plain.iter().zip(&handing) {
        assert_eq!(handing.pairs_of_its_own(), plain.pairs());
    }
}

#[test]
fn what_was_handed_over_is_not_taken_in_return() {
    let mut stream = RandomKey::new(15).text("to and fro").stream();
    let rovers = team(&mut stream, 6);
    let mut nodes = three_nodes(PLAIN, &rovers, [u64::MAX, 0, 0]);
    let base = |from: u32, to: u32| Vector {
        from: RoverId(from),
        to: RoverId(to),
        values: vec![1.0; rovers[from as usize].len()],
    };
    assert!(!nodes[0].take(&base(2, 0)), "handed to that node itself");
    assert!(nodes[0].take(&base(4, 0)));
    assert!(!nodes[0].take(&base(4, 0)), "no news");
    assert!(!nodes[0].take(&base(4, 2)) && !nodes[0].take(&base(1, 1)));
    let unfit = |values| Vector {
        values,
        ..base(4, 1)
    };
    assert!(!nodes[0].take(&unfit(vec![1.0; 40])));
    assert!(!nodes[0].take(&unfit(vec![f32::NAN; rovers[4].len()])));
}

/// Two nodes with a rover each: what the vector is made of never changes, and the vector does.
#[test]
fn a_damped_vector_goes_on_where_it_was_handed_to() {
    let mut stream = RandomKey::new(16).text("handed damped").stream();
    let rules = Rules {
        damping: 0.75,
        ..PLAIN
    };
    let rovers = team(&mut stream, 2);
    let mut plain = nodes(rules, &rovers, &[(0, 1)]);
    let mut handing = nodes(rules, &rovers, &[]);
    for (a, b, quota) in [(0, 1, u64::MAX), (1, 0, 0)] {
        let rover = (RoverId(b as u32), rovers[b].clone());
        handing[a].add(NodeId(b as u32), vec![rover], quota);
    }
    for _ in 0..8 {
        for (plain, handing) in plain.iter_mut().zip(&mut handing) {
            plain.compute();
            handing.compute();
            // What changes by less than the tolerance is not sent again: by rounding, here.
            let close = |(a, b): (&f32, &f32)| (a - b).abs() < 2e-3;
            let (plain, handing) = (plain.total(0), handing.total(0));
            assert!(
                plain.iter().zip(&handing).all(close),
                "{plain:?}, {handing:?}"
            );
        }
        exchange(&mut plain);
        exchange(&mut handing);
    }
}
