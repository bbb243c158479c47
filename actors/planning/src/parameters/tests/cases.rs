//! Domains beside sets, numbers near the ends of what there is, budgets, and work beside what
//! changed.

use std::collections::BTreeSet;

use proptest::prelude::*;

use super::whole;
use crate::parameters::*;
use crate::temporal::Span;

/// Single values, near and far apart.
fn set_of_values() -> impl Strategy<Value = Vec<Value>> {
    let far = prop_oneof![-40..40i64, -500..500i64, Just(i64::MIN), Just(i64::MAX)];
    prop::collection::vec(far, 1..20)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10_000))]

    #[test]
    fn domains_of_single_values_agree_with_sets(
        a in set_of_values(),
        b in set_of_values(),
        pick in 0..20usize,
        span in (-500..500i64, 0..600i64),
    ) {
        let of = |values: &[Value]| values.iter().copied().collect::<BTreeSet<_>>();
        let list = |domain: &Domain| domain.values().collect::<BTreeSet<_>>();
        let (one, other) = (Domain::of(a.clone()), Domain::of(b.clone()));
        let (a, b) = (of(&a), of(&b));
        prop_assert_eq!(list(&one), a.clone());
        prop_assert_eq!(one.len(), a.len() as u64);
        let both = one.intersect(&other);
        prop_assert_eq!(list(&both), &a & &b);
        prop_assert_eq!(both.is_empty(), both == Domain::NONE);
        prop_assert_eq!(&both, &Domain::of(&a & &b));
        prop_assert_eq!(&both, &other.intersect(&one));
        let span = Span::new(span.0, span.0 + span.1);
        let within: BTreeSet<_> = a.iter().copied().filter(|&x| span.contains(x)).collect();
        prop_assert_eq!(one.within_span(span), Domain::of(within.clone()));
        prop_assert_eq!(one.intersect(&span.into()), Domain::of(within));
        // What shares its values with another one is as if it had its own.
        let upper = one.within_span(Span::at_least(span.min));
        prop_assert_eq!(upper.intersect(&one.within_span(Span::at_most(span.max))), one.within_span(span));
        let value = *a.iter().chain(&b).nth(pick % (a.len() + b.len())).unwrap();
        prop_assert_eq!(one.contains(value), a.contains(&value));
        let mut rest = a.clone();
        rest.remove(&value);
        prop_assert_eq!(one.without(value), Domain::of(rest));
    }

    /// Numbers near the ends of what there is: nothing overflows, and what fits is not left out.
    #[test]
    fn the_largest_numbers_fit(
        inputs in prop::collection::vec(
            prop_oneof![
                Just(i64::MIN), Just(i64::MIN + 1), Just(i64::MAX), Just(1 << 32), Just(-1 << 32),
                -3..4i64, any::<i64>(),
            ],
            1..4,
        ),
        spans in prop::collection::vec((any::<i64>(), any::<i64>(), any::<bool>()), 4),
        is_sum in any::<bool>(),
    ) {
        let wide = inputs.iter().map(|&value| i128::from(value));
        let output: i128 = if is_sum {
            wide.sum()
        } else {
            wide.fold(1, i128::saturating_mul)
        };
        let Ok(output) = i64::try_from(output) else { return Ok(()) };
        let values: Vec<i64> = inputs.into_iter().chain([output]).collect();
        let mut store = Store::new();
        let mut variables = Vec::new();
        for (&value, (a, b, all)) in values.iter().zip(spans) {
            let (a, b) = if all { (i64::MIN, i64::MAX) } else { (a, b) };
            let span = Span::new(value.min(a).min(b), value.max(a).max(b));
            variables.push(store.add(span.into()));
        }
        let kind = if is_sum { Kind::Sum } else { Kind::Product };
        let operands: Vec<Operand> = variables.iter().map(|&x| x.into()).collect();
        prop_assert!(store.post(kind.clone(), &operands, 0).is_ok());
        for at in 0..values.len() {
            for (variable, value) in variables.iter().zip(&values) {
                prop_assert!(store.domain(*variable).contains(*value));
            }
            prop_assert_ne!(store.entailed(&kind, &operands), Some(false));
            let bound = store.restrict(variables[at], Domain::exactly(values[at]), 0);
            prop_assert!(bound.is_ok());
        }
        prop_assert_eq!(store.entailed(&kind, &operands), Some(true));
    }
}

#[test]
fn comparisons_at_the_ends_of_numbers_do_not_overflow() {
    let mut store = Store::new();
    let (a, b) = (store.add(Domain::ALL), store.add(Domain::ALL));
    store.post(Kind::Less, &[a.into(), b.into()], 0).unwrap();
    assert_eq!(store.domain(a).span(), Span::at_most(i64::MAX - 1));
    assert_eq!(store.domain(b).span(), Span::at_least(i64::MIN + 1));
    for (kind, operands, holds) in [
        (Kind::Less, [i64::MAX, i64::MIN], false),
        (Kind::Less, [i64::MIN, i64::MIN], false),
        (Kind::Less, [i64::MAX, i64::MAX], false),
        (Kind::AtMost, [i64::MAX, i64::MAX], true),
        (Kind::Less, [i64::MIN, i64::MAX], true),
        (Kind::Different, [i64::MIN, i64::MIN], false),
        (Kind::Equal, [i64::MIN, i64::MIN], true),
    ] {
        let operands = operands.map(Operand::Value);
        assert_eq!(store.entailed(&kind, &operands), Some(holds));
        assert_eq!(store.post(kind, &operands, 0).is_ok(), holds);
    }
}

#[test]
fn what_runs_out_of_budget_is_refused_and_changes_nothing() {
    let mut store = Store::new();
    let all = || Domain::from(Span::new(0, 1 << 50));
    let (a, b) = (store.add(all()), store.add(all()));
    store.post(Kind::Less, &[a.into(), b.into()], 0).unwrap();
    let before = whole(&store);
    store.set_budget(1_000);
    let start = store.work().operations();
    let refused = store.post(Kind::Less, &[b.into(), a.into()], 1);
    assert!(matches!(
        refused,
        Err(Refusal::OverBudget { operations: 1_000 })
    ));
    assert!(store.work().operations() - start < 1_010);
    assert_eq!(whole(&store), before);
}

#[test]
fn a_retraction_that_runs_out_of_budget_leaves_too_much_and_can_be_resumed() {
    let mut store = Store::new();
    let points: Vec<Variable> = (0..100)
        .map(|_| store.add(Span::new(0, 500).into()))
        .collect();
    for pair in points.windows(2) {
        store
            .post(Kind::Less, &[pair[0].into(), pair[1].into()], 0)
            .unwrap();
    }
    let free = domains(&store);
    let first = store.restrict(points[0], Domain::exactly(300), 1).unwrap();
    store.push();
    let bound = whole(&store);
    store.set_budget(20);
    assert!(!store.retract(first) && !store.is_finished());
    for (variable, domain) in &free {
        assert_eq!(&store.domain(*variable).intersect(domain), domain);
    }
    assert!(matches!(store.resume(), Err(Refusal::OverBudget { .. })));
    store.set_budget(BUDGET);
    store.resume().unwrap();
    assert!(store.is_finished());
    assert_eq!(domains(&store), free);
    store.pop();
    assert_eq!(whole(&store), bound);
}

fn domains(store: &Store<u32>) -> Vec<(Variable, Domain)> {
    let all = store.all_domains();
    all.map(|(id, domain)| (id, domain.clone())).collect()
}

#[test]
fn a_conflict_that_cannot_be_tried_out_is_not_called_minimal() {
    let mut store = Store::new();
    let all = || Domain::from(Span::new(0, 1_000));
    let (a, b) = (store.add(all()), store.add(all()));
    store.post(Kind::Less, &[a.into(), b.into()], 0).unwrap();
    store.restrict(a, Span::new(5, 9).into(), 1).unwrap();
    let refused = store
        .post(Kind::Less, &[b.into(), a.into()], 2)
        .unwrap_err();
    let conflict = refused.conflict().unwrap();
    assert!(!conflict.minimal(10).is_minimal);
    let least = conflict.minimal(BUDGET);
    assert!(least.is_minimal);
    let owners: Vec<u32> = least.owners().copied().collect();
    assert_eq!(owners.len(), 2);
    assert!(owners.contains(&0) && owners.contains(&2));
}

#[test]
fn an_edit_looks_at_what_is_near_it() {
    let cost = |n: u32| {
        let mut store = Store::new();
        // All tokens share a parameter that is bound, and each has a chain of its own.
        let shared = store.add(Span::new(0, 1_000).into());
        store.restrict(shared, Domain::exactly(7), n).unwrap();
        let mut chains = Vec::new();
        for token in 0..n {
            let chain = [(); 4].map(|()| store.add(Span::new(0, 1_000).into()));
            store
                .post(Kind::Equal, &[shared.into(), chain[0].into()], token)
                .unwrap();
            for pair in chain.windows(2) {
                store
                    .post(Kind::AtMost, &[pair[0].into(), pair[1].into()], token)
                    .unwrap();
            }
            chains.push(chain);
        }
        let (one, other) = (chains[n as usize / 2], chains[n as usize / 3]);
        let start = store.work().operations();
        let at = |x: usize| [one[x].into(), other[x].into()];
        let merged: Vec<Constraint> = (0..4)
            .map(|x| store.post(Kind::Equal, &at(x), n).unwrap())
            .collect();
        let bound = store.restrict(one[3], Domain::exactly(900), n).unwrap();
        assert_eq!(store.value(other[3]), Some(900));
        store.retract_all(merged);
        assert_eq!(store.domain(other[3]).span(), Span::new(7, 1_000));
        store.retract(bound);
        store.remove_all(&one);
        store.work().operations() - start
    };
    let few = cost(10);
    assert!(few < 200, "{few}");
    for n in [100, 1_000, 10_000] {
        assert_eq!(cost(n), few);
    }
}

#[test]
fn a_retraction_starts_anew_only_what_rested_on_it() {
    let mut store = Store::new();
    let points: Vec<Variable> = (0..1_000)
        .map(|_| store.add(Span::new(0, 10_000).into()))
        .collect();
    for pair in points.windows(2) {
        store
            .post(Kind::AtMost, &[pair[0].into(), pair[1].into()], 0)
            .unwrap();
    }
    store
        .restrict(points[400], Span::at_least(50).into(), 1)
        .unwrap();
    // It narrows the ten last ones alone.
    let near_end = store
        .restrict(points[990], Span::at_least(60).into(), 2)
        .unwrap();
    let idle = store
        .restrict(points[500], Span::at_least(20).into(), 3)
        .unwrap();
    let start = store.work();
    store.retract(idle);
    assert_eq!(store.work(), start);
    store.retract(near_end);
    let domains = store.work().domains - start.domains;
    // To start them anew, and to narrow them again.
    assert!(domains <= 2 * 10, "{domains}");
    assert_eq!(store.domain(points[999]).min(), 50);
}

#[test]
fn what_does_not_matter_is_not_in_a_conflict() {
    let mut store = Store::new();
    let [a, b, c] = [(); 3].map(|()| store.add(Span::new(0, 1_000).into()));
    store.post(Kind::AtMost, &[a.into(), b.into()], 0).unwrap();
    store.post(Kind::AtMost, &[b.into(), c.into()], 1).unwrap();
    store.restrict(c, Span::at_least(10).into(), 2).unwrap();
    store.restrict(b, Span::at_least(500).into(), 3).unwrap();
    let refused = store.restrict(b, Span::at_most(400).into(), 4);
    let conflict = refused.unwrap_err().conflict().unwrap();
    let owners: Vec<u32> = conflict.owners().copied().collect();
    assert_eq!(owners, [4, 3]);
}

#[test]
fn variables_removed_together_are_not_started_anew() {
    let mut store = Store::new();
    let all = [(); 10].map(|()| store.add(Span::new(0, 1_000).into()));
    store.post(Kind::Equal, &all.map(Operand::from), 0).unwrap();
    store.restrict(all[0], Domain::exactly(5), 1).unwrap();
    let start = store.work();
    store.remove_all(&all);
    assert_eq!(
        (store.work(), store.variables(), store.constraints()),
        (start, 0, 0)
    );
}

#[test]
fn what_is_between_the_ends_of_a_domain_decides_too() {
    let mut store = Store::new();
    let a = store.add(Domain::of([1, 2, 3]));
    let within = |store: &Store<u32>, values: &[Value]| {
        let domain = Domain::of(values.iter().copied());
        store.entailed(&Kind::In(domain), &[a.into()])
    };
    assert_eq!(within(&store, &[1, 3]), None);
    assert_eq!(within(&store, &[1, 2, 3, 900]), Some(true));
    assert_eq!(within(&store, &[0, 900]), Some(false));
    store.restrict(a, Domain::of([1, 3]), 0).unwrap();
    assert_eq!(within(&store, &[1, 3]), Some(true));
    assert_eq!(within(&store, &[2]), Some(false));
}

#[test]
fn what_was_started_anew_no_longer_rests_on_what_had_narrowed_it() {
    let mut store = Store::new();
    let [a, b] = [(); 2].map(|()| store.add(Span::new(0, 1_000).into()));
    let equal = store.post(Kind::Equal, &[a.into(), b.into()], 0).unwrap();
    let bound = store.restrict(a, Domain::exactly(4), 1).unwrap();
    assert_eq!(store.value(b), Some(4));
    store.retract(bound);
    let start = store.work();
    store.retract(equal);
    assert_eq!(store.work(), start);
}

#[test]
fn who_changed_is_not_kept_for_those_that_have_gone() {
    let mut store = Store::new();
    let old = store.add(Domain::ALL);
    store.restrict(old, Domain::exactly(1), 0).unwrap();
    for _ in 0..10_000 {
        let new = store.add(Domain::ALL);
        store.restrict(new, Domain::exactly(1), 0).unwrap();
        store.remove(new);
    }
    assert!(store.changed.len() < 100);
    let mut changed = Vec::new();
    store.take_changed(&mut changed);
    assert_eq!(changed, [old]);
    store.take_changed(&mut changed);
    assert!(changed.is_empty());
}

#[test]
fn a_push_and_a_pop_cost_what_changed_between_them() {
    let cost = |n: usize| {
        let mut store = Store::new();
        let points: Vec<Variable> = (0..n).map(|_| store.add(Span::new(0, 99).into())).collect();
        for pair in points.chunks_exact(2) {
            store
                .post(Kind::Equal, &[pair[0].into(), pair[1].into()], 0)
                .unwrap();
        }
        let before = whole(&store);
        store.push();
        for at in 0..5 {
            let variable = points[at * (n / 5)];
            store.restrict(variable, Domain::exactly(3), 1).unwrap();
            let new = store.add(Domain::ALL);
            store
                .post(Kind::Equal, &[new.into(), variable.into()], 2)
                .unwrap();
            store.remove(new);
        }
        let changes = store.trail.len();
        store.pop();
        assert!(store.trail.is_empty() && store.before.domains.is_empty());
        assert_eq!(whole(&store), before);
        changes
    };
    let few = cost(10);
    for n in [100, 1_000] {
        assert_eq!(cost(n), few);
    }
}

#[test]
fn variables_made_equal_are_known_to_be() {
    let mut store = Store::new();
    let [a, b, c, d] = [(); 4].map(|()| store.add(Span::new(0, 1_000).into()));
    let asks = |store: &Store<u32>, kind: Kind| store.entailed(&kind, &[a.into(), c.into()]);
    store.post(Kind::Equal, &[a.into(), b.into()], 0).unwrap();
    assert_eq!(asks(&store, Kind::Equal), None);
    let merged = store
        .post(Kind::Equal, &[b.into(), d.into(), c.into()], 1)
        .unwrap();
    assert_eq!(asks(&store, Kind::Equal), Some(true));
    assert_eq!(asks(&store, Kind::Different), Some(false));
    assert_eq!(asks(&store, Kind::Less), Some(false));
    assert_eq!(asks(&store, Kind::AtMost), Some(true));
    store.retract(merged);
    assert_eq!(asks(&store, Kind::Equal), None);
}

#[test]
fn a_function_that_gives_nothing_leaves_its_output_free() {
    let mut store = Store::new();
    let [heat, fan] = [10, 1].map(|max| store.add(Span::new(-max, max).into()));
    let limit = |inputs: &[Value]| (inputs[0] >= 0).then(|| i64::from(inputs[0] > 5));
    let says = Kind::Function(limit);
    let operands = [heat.into(), fan.into()];
    store.post(says.clone(), &operands, 0).unwrap();
    for (measured, expected) in [(-3, None), (4, Some(0)), (9, Some(1))] {
        let bound = store.restrict(heat, Domain::exactly(measured), 1).unwrap();
        assert_eq!(store.value(fan), expected);
        assert_eq!(store.entailed(&says, &operands), expected.map(|_| true));
        store.retract(bound);
        assert_eq!(store.value(fan), None);
    }
    store.restrict(fan, Domain::exactly(0), 2).unwrap();
    let refused = store.restrict(heat, Domain::exactly(9), 3).unwrap_err();
    let owners: Vec<u32> = refused
        .conflict()
        .unwrap()
        .minimal(BUDGET)
        .owners()
        .copied()
        .collect();
    assert_eq!(owners, [0, 3, 2]);
}
