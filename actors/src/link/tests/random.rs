//! What holds whatever the parameters, and whenever they change.

use farside_worlds::contacts::CapacityTrace;
use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;

use super::*;

fn duration(up_to_us: u64) -> impl Strategy<Value = SimDuration> {
    (0..=up_to_us).prop_map(SimDuration::from_micros)
}

fn shape() -> impl Strategy<Value = JitterShape> {
    prop_oneof![
        Just(JitterShape::Uniform),
        Just(JitterShape::Normal),
        Just(JitterShape::Pareto),
        vec(-3.0..3.0f64, 2..6).prop_map(|mut table| {
            table.sort_by(f64::total_cmp);
            JitterShape::table(&table).unwrap()
        }),
    ]
}

fn burst() -> impl Strategy<Value = Burst> {
    prop_oneof![
        (0.0..0.9f64, 1..200u64)
            .prop_map(|(loss, length)| format!("loss = {loss:?}\nlength = '{length}ms'")),
        (0.01..1.0f64, 0.01..0.99f64).prop_map(|(p, r)| format!("p = {p:?}\nr = {r:?}")),
        (0.01..0.5f64, 0.1..0.5f64)
            .prop_map(|(p, r)| format!("p13 = {p:?}\np31 = {r:?}\np14 = 0.1")),
    ]
    .prop_map(|text| toml::from_str(&text).unwrap())
}

fn contacts() -> impl Strategy<Value = Contacts> {
    let window = (
        1..200u64,
        1..200u64,
        option::of(2_000..2_000_000u64),
        option::of(duration(50_000)),
    );
    (vec(window, 0..4), any::<bool>()).prop_map(|(windows, repeats)| {
        let mut at = 0;
        let mut list = Vec::new();
        for (gap, length, rate, owlt) in windows {
            let (start, end) = (ms(at + gap), ms(at + gap + length));
            list.push(Contact {
                start,
                end,
                rate,
                owlt,
            });
            at += gap + length;
        }
        Contacts::new(list, repeats.then(|| ms(at + 1))).unwrap()
    })
}

fn limit() -> impl Strategy<Value = QueueLimit> {
    prop_oneof![
        (0..5u64).prop_map(QueueLimit::Messages),
        (0..500u64).prop_map(QueueLimit::Bytes),
    ]
}

fn trace() -> impl Strategy<Value = Trace> {
    vec(0..50u64, 1..6).prop_map(|mut stamps| {
        stamps.sort_unstable();
        stamps.push(stamps[stamps.len() - 1] + 1);
        let lines: Vec<String> = stamps.iter().map(u64::to_string).collect();
        CapacityTrace::from_mahimahi(lines.join("\n").as_bytes())
            .unwrap()
            .into()
    })
}

/// Any parameters at all.
fn any_params() -> impl Strategy<Value = LinkParams> {
    prop_oneof![params_at_once(), followed()]
}

/// Parameters with which messages are followed.
fn followed() -> impl Strategy<Value = LinkParams> {
    let keys = (
        1..6u32,
        prop_oneof![Just(0), 0..60u64],
        option::of(2_000..2_000_000u64),
        option::of(0.0..0.6f64),
        option::of(1..60u64),
        0..10u64,
        option::weighted(0.3, duration(300_000)),
    );
    (params_at_once(), keys).prop_map(|(params, keys)| LinkParams {
        window: keys.0,
        ack: keys.1,
        ack_rate: keys.2,
        ack_loss: keys.3,
        mtu: keys.4,
        fragment_header: keys.5,
        lifetime: keys.6.filter(|lifetime| !lifetime.is_zero()),
        ..params
    })
}

/// Parameters with which all of a message is decided when it is sent.
fn params_at_once() -> impl Strategy<Value = LinkParams> {
    let way = (
        duration(50_000),
        duration(30_000),
        shape(),
        prop_oneof![Just(0.0), 0.0..=1.0f64],
        option::weighted(0.2, duration(20_000)),
        any::<bool>(),
    );
    let loss = (
        0.0..0.5f64,
        option::weighted(0.3, burst()),
        0.0..0.3f64,
        0.0..0.3f64,
        option::weighted(0.3, duration(100_000)),
        0.0..0.1f64,
        prop_oneof![Just(0.0), 0.0..1e-3f64],
    );
    let air = (
        option::weighted(0.6, 2_000..2_000_000u64),
        0..100u64,
        option::weighted(0.5, limit()),
        option::weighted(0.2, trace()),
        option::weighted(0.3, contacts()),
        any::<bool>(),
    );
    let more = (
        0..4u32,
        option::weighted(0.3, duration(200_000)),
        0.0..10.0f64,
        any::<bool>(),
    );
    (way, loss, air, more).prop_map(|(way, loss, air, more)| LinkParams {
        latency: way.0,
        jitter: way.1,
        jitter_shape: way.2,
        jitter_correlation: way.3,
        least_delay: way.4,
        fifo: way.5,
        loss: loss.0,
        burst: loss.1,
        duplicate: loss.2,
        reorder: loss.3,
        reorder_by: loss.4,
        corrupt: loss.5,
        ber: loss.6,
        rate: air.0,
        overhead: air.1,
        queue: air.2,
        trace: air.3,
        contacts: air.4,
        store_and_forward: air.5,
        lifetime: None,
        mtu: None,
        fragment_header: 0,
        retries: more.0,
        window: 1,
        ack: 0,
        ack_rate: None,
        ack_loss: None,
        timeout: more.1.filter(|timeout| !timeout.is_zero()),
        radio: None,
        tx_power_w: more.2,
        rx_power_w: more.2 / 4.0,
        outage: more.3 && way.5,
    })
}

fn any_timeline() -> impl Strategy<Value = Timeline> {
    (any_params(), vec((1..1_000u64, any_params()), 0..4)).prop_map(|(base, mut changes)| {
        changes.sort_by_key(|(at, _)| *at);
        let later =
            |timeline: Timeline, (at, params)| timeline.then(SimTime::ZERO + ms(at), params);
        changes.into_iter().fold(Timeline::new(base), later)
    })
}

fn traffic() -> impl Strategy<Value = Vec<Send>> {
    vec((0..20u64, 0..120usize), 1..80).prop_map(|gaps| {
        let mut at = SimTime::ZERO;
        let mut send = |(gap, pad)| {
            at += ms(gap);
            Send { at, pad }
        };
        gaps.into_iter().map(&mut send).collect()
    })
}

/// How many wait at each arrival, by what the fates say of themselves.
fn check_queue(seen: &[Fate], timeline: &Timeline) -> Result<(), TestCaseError> {
    let key = |fate: &&Fate| (fate.ordinal, fate.copy);
    let mut taken: Vec<&Fate> = seen
        .iter()
        .filter(|fate| ![QUEUE_FULL, DUPLICATE].contains(&fate.reason))
        .collect();
    taken.sort_by_key(key);
    for (index, fate) in taken.iter().enumerate() {
        let params = timeline.at(fate.sent);
        let Some(limit) = params.queue else { continue };
        let starts = |fate: &Fate| fate.sent + fate.carriage.unwrap_or_default().queue;
        let waits = |other: &&&Fate| starts(other) > fate.sent;
        let waiting: Vec<_> = taken[..=index].iter().filter(waits).collect();
        if waiting.len() <= 1 && starts(fate) <= fate.sent {
            continue;
        }
        // The overhead is that of its own arrival.
        let bytes = waiting
            .iter()
            .map(|f| f.bytes + timeline.at(f.sent).overhead)
            .sum();
        prop_assert!(
            limit.allows(waiting.len() as u64, bytes) || starts(fate) <= fate.sent,
            "{limit:?}: {} of {bytes} bytes at {}",
            waiting.len(),
            fate.sent
        );
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn whatever_the_parameters_and_whenever_they_change(
        seed: u64, timeline in any_timeline(), sends in traffic(),
    ) {
        let link = Link::new(timeline.clone());
        let least = link.min_delay();
        // The kernel ends a run whose link undercuts its least delay; `over` refuses that.
        let seen = over(seed, &sends, link);
        let reasons = [
            "", LOSS, BURST, OUTAGE, NO_CONTACT, QUEUE_FULL, CORRUPT, EXPIRED, DUPLICATE,
        ];
        for fate in &seen {
            prop_assert!(reasons.contains(&fate.reason), "{}", fate.reason);
            prop_assert!(!fate.reason.is_empty() || fate.delay >= least);
            let Some(parts) = fate.carriage else { continue };
            prop_assert_eq!(parts.total(), fate.delay);
            let most = 4 * parts.fragments.max(1);
            prop_assert!(parts.attempts <= most && (parts.attempts > 0 || !fate.reason.is_empty()));
        }
        for ordinal in 0..sends.len() as u64 {
            // One fate for each copy, and one for each that was kept because an answer was lost.
            let own = || seen.iter().filter(|fate| fate.ordinal == ordinal);
            let copies = own().filter(|fate| fate.reason != DUPLICATE).count();
            prop_assert!((1..=2).contains(&copies) && own().count() <= 2 * copies);
            let numbers: BTreeSet<u32> = own().map(|fate| fate.copy).collect();
            prop_assert!(numbers.len() == own().count());
            let kept = own().count() - copies;
            prop_assert!(kept <= own().filter(|fate| fate.reason.is_empty()).count());
        }
        check_queue(&seen, &timeline)?;
        if timeline.iter().all(|(_, params)| params.fifo) {
            let key = |fate: &&Fate| (fate.ordinal, fate.copy);
            let arrived = arrived(&seen);
            prop_assert!(arrived.is_sorted_by_key(key));
        }
        // The same again, as a run is.
        prop_assert_eq!(over(seed, &sends, Link::new(timeline)), seen);
    }

    #[test]
    fn a_plain_link_is_a_link(
        seed: u64, mut plain in any_params(), sends in traffic(), until in 1..500u64,
    ) {
        let keep = plain.clone();
        plain = LinkParams {
            latency: keep.latency, jitter: keep.jitter, jitter_shape: keep.jitter_shape,
            least_delay: keep.least_delay, loss: keep.loss, duplicate: keep.duplicate,
            ..LinkParams::default()
        };
        // So unlikely that it never happens, and yet no longer plain.
        let full = LinkParams { corrupt: 1e-300, ..plain.clone() };
        let out = LinkParams { outage: true, ..plain.clone() };
        let with = |params: LinkParams| {
            let until = SimTime::ZERO + ms(until);
            Link::new(Timeline::new(out.clone()).then(until, params))
        };
        let fates = |link| -> Vec<Fate> {
            let seen = over(seed, &sends, link);
            seen.into_iter().map(|fate| Fate { carriage: None, ..fate }).collect()
        };
        prop_assert_eq!(fates(with(plain)), fates(with(full)));
    }

    #[test]
    fn parameters_print_back_to_themselves(before in any_params(), after in any_params()) {
        let text = toml::to_string(&after).unwrap();
        prop_assert_eq!(&toml::from_str::<LinkParams>(&text).unwrap(), &after);
        let over = before.changes_to(&after);
        let text = toml::to_string(&over).unwrap();
        prop_assert_eq!(&toml::from_str::<LinkOverrides>(&text).unwrap(), &over);
        prop_assert_eq!(&LinkChange::from(&over).overrides().unwrap(), &over);
        let whole = LinkChange::from(after.clone()).overrides().unwrap();
        prop_assert_eq!(before.with(&whole), after);
    }

    #[test]
    fn a_link_told_in_time_is_a_link_that_knew(
        seed: u64, base in any_params(), later in any_params(), at in 1..500u64,
    ) {
        // Without a queue nothing is decided before it happens.
        let prompt = |params: LinkParams| LinkParams {
            rate: None, trace: None, contacts: None, store_and_forward: false, retries: 0,
            window: 1, ack: 0, ack_loss: None, mtu: None, lifetime: None, ..params
        };
        let (base, later) = (prompt(base), prompt(later));
        let at = SimTime::ZERO + ms(at);
        let sends = each(ms(9), 60, 10);
        let knew = Link::new(Timeline::new(base.clone()).then(at, later.clone()));
        let told = Link::new(base.clone()).may_become(&later);
        let change = LinkChange::from(&base.changes_to(&later));
        let fates = |link: Link, change: Option<LinkChange>| -> Vec<Fate> {
            let seen = run(seed, &sends, &["b"], |sim, a, hosts| {
                let id = sim.link(a, hosts[0], "a-b", link);
                if let Some(change) = change {
                    sim.change_at(at, id, change);
                }
            });
            // How much they tell may differ: a link that will keep an order is never plain.
            seen.into_iter().map(|fate| Fate { carriage: None, ..fate }).collect()
        };
        prop_assume!(!later.fifo || base.fifo);
        prop_assert_eq!(fates(told, Some(change)), fates(knew, None));
    }
}

#[test]
fn a_link_that_knew_takes_no_notice() {
    let out = LinkParams {
        outage: true,
        ..LinkParams::default()
    };
    let planned = LinkChange::planned(&LinkParams::default(), &out);
    assert_eq!(planned.set()["outage"], "true");
    assert_eq!(planned.set().len(), 1);
    let mut link = Link::new(LinkParams::default());
    link.change(planned, SimTime::ZERO);
    assert!(!link.params(SimTime::ZERO).outage);
    link.change(
        LinkChange::from(&LinkParams::default().changes_to(&out)),
        SimTime::ZERO + ms(5),
    );
    assert!(!link.params(SimTime::ZERO).outage && link.params(SimTime::ZERO + ms(5)).outage);
}
