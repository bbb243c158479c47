//! Who is lost, and that it is the same ones: chance is addressed, and bursts run in time.

use proptest::prelude::*;

use super::*;

fn lost_at(seed: u64, sends: &[Send], parameters: &str) -> BTreeSet<u64> {
    lost(&over(seed, sends, Link::new(params(parameters))))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn more_loss_loses_a_superset(seed: u64, p in 0.0..1.0f64, q in 0.0..1.0f64) {
        let (low, high) = (p.min(q), p.max(q));
        let sends = each(ms(10), 200, 0);
        for key in ["loss", "corrupt", "ber"] {
            let at = |p: f64| lost_at(seed, &sends, &format!("{key} = {p:?}"));
            prop_assert!(at(low).is_subset(&at(high)));
        }
    }

    #[test]
    fn more_bursts_lose_a_superset(
        seed: u64, p in 0.0..0.9f64, q in 0.0..0.9f64, length in 1..500u64, every in 1..300u64,
    ) {
        let (low, high) = (p.min(q), p.max(q));
        let sends = each(ms(every), 200, 0);
        let at = |p: f64| {
            lost_at(seed, &sends, &format!("burst = {{ loss = {p:?}, length = '{length}ms' }}"))
        };
        prop_assert!(at(low).is_subset(&at(high)));
    }

    #[test]
    fn more_loss_within_states_loses_a_superset(
        seed: u64, p in 0.0..0.5f64, r in 0.0..0.5f64, good in 0.0..1.0f64, bad in 0.0..1.0f64,
        more in 0.0..1.0f64,
    ) {
        prop_assume!(p + r > 1e-3);
        let (good, bad) = (good.min(bad), good.max(bad));
        let sends = each(ms(7), 200, 0);
        let at = |p: f64, r: f64, good: f64| {
            let burst = format!("p = {p:?}, r = {r:?}, 1-k = {good:?}, 1-h = {bad:?}");
            lost_at(seed, &sends, &format!("burst = {{ {burst} }}"))
        };
        let once = at(p, r, good);
        prop_assert!(once.is_subset(&at(p + more * (0.5 - p), r, good)));
        prop_assert!(once.is_subset(&at(p, r * (1.0 - more) + 1e-6, good)));
        prop_assert!(once.is_subset(&at(p, r, good + more * (bad - good))));
    }

    #[test]
    fn one_link_is_nothing_to_another(seed: u64, loss in 0.1..1.0f64, rate in 1_000..100_000u64) {
        let common = "jitter = '3ms', loss = 0.2, duplicate = 0.1, reorder = 0.1, retries = 1, \
            burst = { loss = 0.1, length = '30ms' }";
        let quiet = format!("links.default = {{ {common} }}");
        let other = format!("loss = {loss:?}, rate = '{rate}bit/s', queue = 2, jitter = '1ms'");
        let loud = format!("links.default = {{ {common} }}\nlinks.a-b = {{ {other} }}");
        let sends = each(ms(10), 100, 20);
        let mine = |text: &str| -> Vec<Fate> {
            // Links rank by name: the second is a-c in both runs.
            let all = scenario(seed, &sends, &["b", "c"], text);
            let last = all.iter().map(|fate| fate.link).max();
            let own = all.into_iter().filter(|fate| Some(fate.link) == last);
            let mut mine: Vec<Fate> = own.collect();
            assert!(mine.len() >= 100, "all that went to c");
            mine.sort_by_key(|fate| (fate.ordinal, fate.copy));
            mine
        };
        prop_assert_eq!(mine(&quiet), mine(&loud));
    }
}

#[test]
fn bursts_lose_what_they_state_however_sparse_the_traffic() {
    let link = "burst = { loss = 0.2, length = '200ms' }";
    // The variance of the mean grows with the burst: n/eff independent draws.
    for (every, count, tolerance) in [
        (5, 40_000, 0.03),
        (200, 20_000, 0.02),
        (7_000, 20_000, 0.01),
    ] {
        let lost = lost_at(11, &each(ms(every), count, 0), link);
        let share = lost.len() as f64 / f64::from(count);
        assert!(
            (share - 0.2).abs() < tolerance,
            "{share} at one each {every} ms"
        );
    }
}

#[test]
fn bursts_of_messages_are_as_long_as_stated() {
    let link = "burst = { loss = 0.25, messages = 4, interval = '50ms' }";
    let lost = lost_at(12, &each(ms(50), 40_000, 0), link);
    let bursts = lost.iter().filter(|n| !lost.contains(&(**n + 1))).count();
    let length = lost.len() as f64 / bursts as f64;
    assert!((length - 4.0).abs() < 0.2, "{length}");
    let share = lost.len() as f64 / 40_000.0;
    assert!((share - 0.25).abs() < 0.015, "{share}");
}

#[test]
fn bit_errors_meet_their_closed_form_and_show_at_arrival() {
    let link = params("ber = 1e-4\noverhead = '20B'\nlatency = '30ms'");
    let seen = over(13, &each(ms(1), 20_000, 100), Link::new(link));
    let corrupt: Vec<&Fate> = seen.iter().filter(|fate| fate.reason == CORRUPT).collect();
    let expected = packet_error_rate(1e-4, seen[0].bytes + 20);
    // By hand: 1 - (1 - 1e-4)^(8 * 122).
    assert_eq!(seen[0].bytes, 102);
    assert!((expected - 0.092_99).abs() < 1e-4, "{expected}");
    let share = corrupt.len() as f64 / 20_000.0;
    assert!((share - expected).abs() < 0.007, "{share}");
    assert!(corrupt.iter().all(|fate| fate.delay == ms(30)));
}

#[test]
fn burst_losses_hit_all_who_send_in_one_slot() {
    // Two messages within a slot share a fate, whatever their identities.
    let sends: Vec<Send> = each(ms(100), 500, 0)
        .into_iter()
        .flat_map(|send| [send; 2])
        .collect();
    let lost = lost_at(14, &sends, "burst = { loss = 0.3, length = '100ms' }");
    assert!(lost.iter().all(|n| lost.contains(&(n ^ 1))) && lost.len() > 100);
}
