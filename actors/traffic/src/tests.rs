//! Traffic over links whose behaviour is known: what is counted, how late, how old.

use farside::record::{Flow as Go, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{End, Executor, Report, SimDuration, SimTime, Simulation};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use super::*;
use farside_actors::link::LinksConfig;
use farside_actors::wiring::LinkBuilder;

/// What was sent on the first hop, by flow and number: when, how large, and whether it arrived.
type Sends = BTreeMap<(u32, u32), (SimTime, usize, bool)>;

struct Watch(Arc<Mutex<Sends>>);

impl Observer for Watch {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            ..Wants::default()
        }
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Go, ObserverError> {
        if let (true, Some(key)) = (record.class.is_fate(), record.match_key) {
            let arrived = record.class == RecordClass::Delivered;
            let told = (record.sent, record.body.len(), arrived);
            self.0
                .lock()
                .unwrap()
                .insert((key.major(), key.minor()), told);
        }
        Ok(Go::Continue)
    }
}

struct Outcome {
    metrics: TrafficMetrics,
    sends: Sends,
    report: Report,
}

fn run_with(text: &str, links: &str, seed: u64, plan: impl FnOnce(&mut Simulation)) -> Outcome {
    let config: TrafficConfig = toml::from_str(text).unwrap();
    let links: LinksConfig = toml::from_str(links).unwrap();
    let mut builder = Some(LinkBuilder::new(&links, &[]).unwrap());
    let mut sim = Simulation::new(seed);
    let traffic = assemble(&mut sim, &config, seed, &mut |sim, wiring| {
        builder.take().unwrap().build(sim, wiring)
    });
    let traffic = traffic.unwrap();
    plan(&mut sim);
    let sends = Arc::new(Mutex::new(Sends::new()));
    sim.observe(Watch(sends.clone()));
    let report = sim.run(Executor::Inline).unwrap();
    assert!(!matches!(report.end, End::Fault(_)), "{:?}", report.end);
    let sends = std::mem::take(&mut *sends.lock().unwrap());
    Outcome {
        metrics: traffic.metrics(report.end_time),
        sends,
        report,
    }
}

fn run(text: &str, links: &str) -> Outcome {
    run_with(text, links, 1, |_| {})
}

fn secs(seconds: u64) -> SimTime {
    SimTime::ZERO + SimDuration::from_secs(seconds)
}

const PERIODIC: &str = "
    hosts = ['rover', 'base']
    flow = [{ from = 'rover', to = 'base', period = '2s', start = '1s', stop = '101s' }]
";

#[test]
fn without_loss_everything_arrives_once_and_in_order() {
    let Outcome {
        metrics, report, ..
    } = run(PERIODIC, "default = { latency = '700ms' }");
    assert_eq!((metrics.sent, metrics.delivered, metrics.lost), (50, 50, 0));
    assert_eq!(
        (metrics.duplicates, metrics.reordered, metrics.in_flight),
        (0, 0, 0)
    );
    assert_eq!(metrics.delivery_ratio, Some(1.0));
    let delays = [
        metrics.delay_mean_s,
        metrics.delay_p50_s,
        metrics.delay_p95_s,
        metrics.delay_max_s,
    ];
    assert_eq!(delays, [Some(0.7); 4]);
    assert_eq!(metrics.delays_s, [0.7; 50]);
    assert_eq!(report.counts.delivered, 50);
    // 50 messages of 1600 bits from the start at 1 s to the last arrival.
    assert_eq!(metrics.goodput_bit_per_s, Some(80_000.0 / 98.7));
}

#[test]
fn periodic_messages_are_half_a_period_older_than_their_delay() {
    for (latency, delay_s) in [("700ms", 0.7), ("5s", 5.0)] {
        let metrics = run(PERIODIC, &format!("default.latency = '{latency}'")).metrics;
        // The age is a saw tooth from the delay to the delay and a period.
        assert_eq!(metrics.age_of_information_mean_s, Some(delay_s + 1.0));
        assert_eq!(metrics.age_peak_s, Some(delay_s + 2.0));
    }
}

#[test]
fn age_goes_on_while_a_flow_is_cut_off() {
    let text = "hosts = ['rover', 'base']\nflow = [{ from = 'rover', to = 'base', period = '1s' }]";
    let outcome = run_with(text, "default.latency = '1s'", 1, |sim| {
        // The base is down for messages that arrive from 11 s to 20 s.
        sim.crash_named_at(SimTime::from_nanos(10_500_000_000), "base")
            .unwrap();
        sim.restart_named_at(SimTime::from_nanos(20_500_000_000), "base")
            .unwrap();
        sim.stop_at(SimTime::from_nanos(30_500_000_000), "enough");
    });
    let metrics = outcome.metrics;
    assert_eq!(
        (metrics.sent, metrics.delivered, metrics.lost),
        (31, 20, 10)
    );
    assert_eq!(metrics.in_flight, 1);
    assert_eq!(metrics.age_peak_s, Some(12.0));
    // Ages from 1 to 2 s; once from 1 to 12 s over 11 s; at the end from 1 to 1.5 s.
    let area = 1.5 * 18.0 + 6.5 * 11.0 + 1.25 * 0.5;
    let mean = metrics.age_of_information_mean_s.unwrap();
    assert!((mean - area / 29.5).abs() < 1e-9, "{mean}");
}

#[test]
fn poisson_arrivals_have_their_mean_and_spread() {
    let text = "
        groups = [{ prefix = 'rover', count = 20 }]
        hosts = ['base']
        flow = [{ from = 'rover_*', to = 'base', arrivals = 'poisson', period = '2s', stop = '2000s' }]
    ";
    let Outcome { metrics, sends, .. } = run(text, "");
    // 20,000 expected; the standard deviation is 141.
    assert!(metrics.sent.abs_diff(20_000) < 500, "{}", metrics.sent);
    let mut gaps = Vec::new();
    let mut before: Option<((u32, u32), SimTime)> = None;
    for (key, (sent, ..)) in sends {
        if let Some(((flow, _), time)) = before.filter(|((flow, _), _)| *flow == key.0) {
            assert_eq!(flow, key.0);
            gaps.push(sent.since(time).as_secs_f64());
        }
        before = Some((key, sent));
    }
    let mean = gaps.iter().sum::<f64>() / gaps.len() as f64;
    let variance = gaps
        .iter()
        .map(|gap| (gap - mean) * (gap - mean))
        .sum::<f64>()
        / gaps.len() as f64;
    assert!((mean - 2.0).abs() < 0.06, "{mean}");
    // An exponential's standard deviation is its mean.
    assert!((libm::sqrt(variance) - 2.0).abs() < 0.1, "{variance}");
}

#[test]
fn every_message_has_the_size_that_was_asked_for() {
    for size in [40, 128, 129, 130, 131, 200, 16_390, 100_000] {
        let text = format!(
            "hosts = ['a', 'b', 'c']\nflow = [{{ from = 'a', to = 'b', via = ['c'], \
             period = '1ms', size = '{size}B', stop = '300ms' }}]"
        );
        let sends = run(&text, "").sends;
        assert_eq!(sends.len(), 300);
        assert!(sends.values().all(|(_, bytes, _)| *bytes == size));
    }
}

#[test]
fn bursts_come_at_once_and_stop_in_time() {
    let text = "
        hosts = ['a', 'b']
        flow = [{ from = 'a', to = 'b', arrivals = 'burst', burst = 7, period = '10s', stop = '30s' }]
    ";
    let Outcome { metrics, sends, .. } = run(text, "");
    assert_eq!(metrics.sent, 21);
    for ((_, number), (sent, ..)) in sends {
        assert_eq!(sent, secs(u64::from(number / 7) * 10));
    }
}

#[test]
fn relays_pass_each_message_on_once() {
    let text = "
        hosts = ['rover', 'relay', 'earth']
        flow = [
            { from = 'rover', to = 'earth', via = ['relay'], period = '1s', stop = '500s' },
            { from = 'relay', to = 'earth', period = '1s', stop = '500s' },
        ]
    ";
    let links = "
        default = { latency = '1s' }
        'rover-relay' = { duplicate = 0.5 }
        'relay-earth' = { latency = '10s' }
    ";
    let metrics = run(text, links).metrics;
    assert_eq!(
        (metrics.sent, metrics.delivered, metrics.duplicates),
        (1000, 1000, 0)
    );
    let delays: Vec<_> = metrics
        .by_flow
        .iter()
        .map(|flow| flow.delay_mean_s)
        .collect();
    assert_eq!(delays, [Some(11.0), Some(10.0)]);
    assert_eq!(metrics.by_flow[0].name, "rover > relay > earth");
    // Half of the messages set out twice on the last hop: their second copies count there.
    let metrics = run(text, "default.duplicate = 0.5\n'rover-relay'.duplicate = 0").metrics;
    assert_eq!(metrics.delivered, 1000);
    assert!(
        (400..600).contains(&metrics.duplicates),
        "{}",
        metrics.duplicates
    );
}

#[test]
fn jitter_reorders_and_is_counted() {
    let text = "hosts = ['a', 'b']\nflow = [{ from = 'a', to = 'b', period = '1ms', stop = '1s' }]";
    let metrics = run(text, "default = { latency = '20ms', jitter = '15ms' }").metrics;
    assert_eq!(metrics.delivered, 1000);
    assert!(metrics.reordered > 500, "{}", metrics.reordered);
    let sorted = metrics.delays_s.is_sorted();
    assert!(sorted && metrics.delay_p50_s < metrics.delay_p95_s);
}

#[test]
fn more_loss_loses_the_same_and_more() {
    let text = "
        groups = [{ prefix = 'rover', count = 4 }]
        hosts = ['relay', 'base']
        flow = [
            { from = 'rover_*', to = 'base', arrivals = 'poisson', period = '100ms', stop = '60s' },
            { from = 'rover_1', to = 'base', via = ['relay'], period = '100ms', stop = '60s' },
        ]
    ";
    let mut before = run(text, "");
    assert_eq!(before.metrics.lost, 0);
    for loss in [0.1, 0.3, 0.6] {
        let now = run(text, &format!("default.loss = {loss}"));
        assert_eq!(now.metrics.sent, before.metrics.sent);
        assert_eq!(now.sends.len(), before.sends.len());
        for ((key, a), (other, b)) in before.sends.iter().zip(&now.sends) {
            assert_eq!(key, other);
            assert!(a.2 || !b.2, "{key:?} arrives only when more is lost");
        }
        assert!(now.metrics.delivered < before.metrics.delivered);
        before = now;
    }
}

#[test]
fn other_flows_leave_a_flow_as_it_is() {
    let one = "{ from = 'b', to = 'c', arrivals = 'poisson', period = '1s', stop = '100s' }";
    let hosts = "hosts = ['a', 'b', 'c']";
    let links = "default.loss = 0.5";
    let alone = run(&format!("{hosts}\nflow = [{one}]"), links).sends;
    let more = "{ from = 'a', to = '*', period = '3s', stop = '100s' }";
    let beside = run(&format!("{hosts}\nflow = [{more}, {one}]"), links).sends;
    assert!(!alone.is_empty());
    assert!(
        alone
            .iter()
            .all(|(key, told)| beside.get(key) == Some(told))
    );
}

#[test]
fn a_crash_costs_messages_and_nothing_else() {
    let text = "
        hosts = ['a', 'b', 'c']
        flow = [
            { from = 'a', to = 'b', period = '1s', stop = '100s' },
            { from = 'a', to = 'c', arrivals = 'poisson', period = '1s', stop = '100s' },
        ]
    ";
    let crash = |sim: &mut Simulation| {
        let at = |tenths| SimTime::ZERO + SimDuration::from_millis(100) * tenths;
        sim.crash_named_at(at(205), "a").unwrap();
        sim.restart_named_at(at(405), "a").unwrap();
    };
    let broken = run_with(text, "", 1, crash);
    let [periodic, poisson] = &broken.metrics.by_flow[..] else {
        panic!("two flows");
    };
    // The schedule goes on as if nothing had been; twenty seconds of it are missing.
    assert_eq!(periodic.sent, 80);
    let sends = |id: u32| {
        broken
            .sends
            .iter()
            .filter(move |((flow, _), _)| *flow == id)
    };
    let is_periodic = |id: &u32| sends(*id).count() == 80 && sends(*id).any(|(k, _)| k.1 == 99);
    let id = broken
        .sends
        .keys()
        .map(|(flow, _)| *flow)
        .find(is_periodic)
        .unwrap();
    for ((_, number), (sent, ..)) in sends(id) {
        assert_eq!(*sent, secs(u64::from(*number)));
    }
    // Numbers are not given twice.
    let numbers = broken
        .sends
        .keys()
        .filter(|(flow, _)| *flow != id)
        .map(|(_, n)| *n);
    assert_eq!(
        numbers.collect::<Vec<_>>(),
        (0..poisson.sent as u32).collect::<Vec<_>>()
    );
}

#[test]
fn of_many_delays_a_fair_sample_is_kept() {
    let text =
        "hosts = ['a', 'b']\nflow = [{ from = 'a', to = 'b', period = '1ms', stop = '40s' }]";
    let metrics = run(text, "default = { latency = '500ms', jitter = '500ms' }").metrics;
    assert_eq!(
        (metrics.delivered, metrics.delays_s.len()),
        (40_000, 10_000)
    );
    let mean = metrics.delays_s.iter().sum::<f64>() / 10_000.0;
    assert!(
        (mean - metrics.delay_mean_s.unwrap()).abs() < 0.01,
        "{mean}"
    );
}

#[test]
fn each_mistake_names_its_key() {
    for (text, message) in [
        ("hosts = ['a']", "traffic.hosts: fewer than two hosts"),
        (
            "hosts = ['a', 'a']",
            "traffic.hosts.1: \"a\" is there twice",
        ),
        (
            "hosts = ['a', 'b c']",
            "traffic.hosts.1: \"b c\": expected 1 to 64 letters",
        ),
        (
            "hosts = ['a', 'lost']",
            "traffic.hosts.1: \"lost\": logs use this name",
        ),
        (
            "groups = [{ prefix = 'x', count = 0 }]",
            "traffic.groups.0.count: 0: expected at least 1",
        ),
        (
            "groups = [{ prefix = 'x', count = 99999 }]",
            "traffic.groups.0: more than 2000 hosts",
        ),
        ("hosts = ['a', 'b']", "traffic.flow: no flow"),
    ] {
        let error = TrafficPlan::new(&toml::from_str(text).unwrap()).unwrap_err();
        assert!(error.to_string().starts_with(message), "{error}");
    }
    for (flow, message) in [
        (
            "from = 'a', to = 'bse', period = '1s'",
            "to: \"bse\" matches no host; did you mean \"base\"?",
        ),
        (
            "from = '[', to = 'base', period = '1s'",
            "from: \"[\" is no pattern over hosts",
        ),
        (
            "from = 'a', to = 'a', period = '1s'",
            ": no flow: no host sends to itself",
        ),
        (
            "from = 'a', to = 'base', via = ['b*'], period = '1s'",
            "via.0: \"b*\" is no host",
        ),
        (
            "from = 'a', period = '1s'",
            "to: missing: expected a host, or a glob over hosts",
        ),
        (
            "from = 'a', to = 'base', period = '0s'",
            "period: missing, or 0s: expected a time over zero",
        ),
        (
            "from = 'a', to = 'base', period = '1s', size = '39B'",
            "size: 39B: expected 40B to 1MiB",
        ),
        (
            "from = 'a', to = 'base', period = '1s', start = '2s', stop = '2s'",
            "stop: 2s: expected a time after",
        ),
        (
            "from = 'a', to = 'base', period = '1s', burst = 3",
            "burst: only with arrivals",
        ),
        (
            "from = 'a', to = 'base', period = '1s', arrivals = 'burst'",
            "burst: missing",
        ),
    ] {
        let text = format!("hosts = ['a', 'base']\nflow = [{{ {flow} }}]");
        let error = TrafficPlan::new(&toml::from_str(&text).unwrap()).unwrap_err();
        let whole = error.to_string();
        let rest = whole.strip_prefix("traffic.flow.0").unwrap();
        assert!(rest.trim_start_matches('.').starts_with(message), "{whole}");
    }
}
