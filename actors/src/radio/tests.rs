//! Radios against closed forms: what a channel carries under each way to share it, who hears whom,
//! what terrain and distance let through.

use std::sync::{Arc, Mutex};

use farside::carrier::Carriage;
use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass};
use farside::{Report, RunInfo};
use farside_worlds::HeightField;
use nalgebra::{Point2, Point3};
use proptest::prelude::*;

use super::*;
use crate::link::{LinkOverrides, LinkParams, QueueLimit};

/// A link that is on the air for 10 ms with each message (a [`Frame`] is 9 bytes, which leaves 1241
/// of 1250 at 1 Mbit/s), and takes 2 W meanwhile.
fn plain() -> LinkParams {
    LinkParams {
        latency: SimDuration::from_micros(1),
        rate: Some(1_000_000),
        overhead: 1241,
        tx_power_w: 2.0,
        ..LinkParams::default()
    }
}

#[derive(Serialize, Deserialize)]
struct Frame(f64);

#[derive(Serialize, Deserialize)]
struct Tick;

/// Sends to one station, at random times of a mean distance.
struct Source {
    to: String,
    mean_s: f64,
    sent: u64,
    energy: Arc<Mutex<f64>>,
}

impl Actor for Source {
    type Accepts = (Frame, Tick);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.wait(ctx);
        Ok(())
    }
}

impl Source {
    fn wait(&self, ctx: &mut Context<'_, Self>) {
        let wait_s = ctx.random("arrivals").exponential(self.mean_s);
        ctx.timer(SimDuration::from_secs_f64(wait_s), Tick);
    }
}

impl Handler<Frame> for Source {
    fn handle(&mut self, _frame: Frame, ctx: &mut Context<'_, Self>) -> Outcome {
        let mut energy = self.energy.lock().unwrap();
        *energy = energy.max(ctx.transmit_energy_j());
        Ok(())
    }
}

impl Handler<Tick> for Source {
    fn handle(&mut self, _tick: Tick, ctx: &mut Context<'_, Self>) -> Outcome {
        let to = ctx.lookup::<Source>(&self.to)?;
        ctx.send(to, Frame(self.sent as f64));
        self.sent += 1;
        self.wait(ctx);
        Ok(())
    }
}

/// A frame's fate: when, after which carriage, between whom, why not.
#[derive(Clone, Debug)]
struct Fate {
    time: SimTime,
    sent: SimTime,
    link: (String, String),
    carriage: Option<Carriage>,
    reason: &'static str,
}

#[derive(Clone, Default)]
struct Fates {
    run: Option<Arc<RunInfo>>,
    list: Arc<Mutex<Vec<Fate>>>,
}

impl Observer for Fates {
    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        self.run = Some(run.clone());
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        if matches!(record.class, RecordClass::Delivered | RecordClass::Lost) {
            let name = |entity| self.run.as_ref().unwrap().name(entity).to_owned();
            self.list.lock().unwrap().push(Fate {
                time: record.time(),
                sent: record.sent,
                link: (name(record.sender), name(record.receiver)),
                carriage: record.carriage.copied(),
                reason: record.reason,
            });
        }
        Ok(Flow::Continue)
    }
}

/// A team of stations with a place and a peer each, all sending at one mean distance.
struct Team {
    radio: RadioConfig,
    link: LinkParams,
    stations: Vec<(Point3<f64>, usize)>,
    mean_s: f64,
    until_s: u64,
    terrain: Option<Arc<HeightField>>,
    moves: Vec<(u64, RadioChange)>,
}

impl Team {
    fn new(radio: &str, stations: Vec<(Point3<f64>, usize)>) -> Self {
        Team {
            radio: toml::from_str(radio).unwrap(),
            link: plain(),
            stations,
            mean_s: 1.0,
            until_s: 1000,
            terrain: None,
            moves: Vec::new(),
        }
    }

    fn run(&self, executor: Executor) -> (Report, Vec<Fate>, f64) {
        let mut sim = Simulation::new(5);
        let name = |i: usize| format!("s{i}");
        let mut radio = Radio::new(self.radio.clone(), self.terrain.clone());
        let energy = Arc::new(Mutex::new(0.0));
        for (i, (place_m, peer)) in self.stations.iter().enumerate() {
            let host = sim.host(&name(i));
            sim.heavy(host);
            radio.station(host.index(), &name(i), *place_m);
            let (to, mean_s, energy) = (name(*peer), self.mean_s, energy.clone());
            sim.actor(host, &name(i), move |_| Source {
                to: to.clone(),
                mean_s,
                sent: 0,
                energy: energy.clone(),
            });
        }
        for (i, (_, peer)) in self.stations.iter().enumerate() {
            let link = Timeline::new(self.link.clone());
            radio.link(&format!("s{i}-s{peer}"), i, *peer, link);
        }
        let link = sim.shared_link("radio", radio);
        for (i, (_, peer)) in self.stations.iter().enumerate() {
            let (from, to) = (sim.host(&name(i)), sim.host(&name(*peer)));
            sim.route(from, to, link);
        }
        for (at_s, change) in &self.moves {
            sim.change_at(SimTime::from_secs(*at_s), link, change.clone());
        }
        let fates = Fates::default();
        sim.observe(fates.clone());
        sim.stop_at(SimTime::from_secs(self.until_s), "the end");
        let report = sim.run(executor).unwrap();
        let list = fates.list.lock().unwrap().clone();
        let energy = *energy.lock().unwrap();
        (report, list, energy)
    }
}

/// So many stations at one place, each sending to the next.
fn ring(count: usize) -> Vec<(Point3<f64>, usize)> {
    (0..count)
        .map(|i| (Point3::origin(), (i + 1) % count))
        .collect()
}

fn share(fates: &[Fate], reason: &str) -> f64 {
    let of = fates.iter().filter(|fate| fate.reason == reason).count();
    of as f64 / fates.len() as f64
}

/// Abramson 1970: with load g a frame survives with probability exp(-2g), in slots exp(-g).
#[test]
fn aloha_carries_what_abramson_says() {
    for (radio, per_load) in [
        ("access = 'aloha'", -2.0),
        ("access = 'aloha'\nslotted = true\nslot = '10ms'", -1.0),
    ] {
        let mut team = Team::new(radio, ring(100));
        let load = 0.3;
        team.mean_s = 100.0 * 0.010 / load;
        let (_, fates, _) = team.run(Executor::Inline);
        let expected = libm::exp(per_load * load);
        let found = share(&fates, "");
        assert!(fates.len() > 25_000);
        assert!(
            (found - expected).abs() < 0.015,
            "{radio}: {found} {expected}"
        );
        assert!((share(&fates, COLLISION) - (1.0 - found)).abs() < 1e-9);
    }
}

/// M/D/1: the mean wait for a server of load u and service time s is s u / (2 (1 - u)).
#[test]
fn a_scheduled_channel_is_a_queue_with_one_server() {
    let mut team = Team::new("access = 'scheduled'\nqueue = 1000", ring(50));
    let load = 0.6;
    team.mean_s = 50.0 * 0.010 / load;
    team.until_s = 3000;
    let (_, fates, _) = team.run(Executor::Inline);
    assert_eq!(share(&fates, ""), 1.0);
    let waits = fates
        .iter()
        .map(|f| f.carriage.unwrap().queue.as_secs_f64());
    let mean = waits.sum::<f64>() / fates.len() as f64;
    let expected = 0.010 * load / (2.0 * (1.0 - load));
    assert!(
        (mean - expected).abs() < 0.05 * expected,
        "{mean} {expected}"
    );
    let busy = fates.len() as f64 * 0.010 / 3000.0;
    assert!((busy - load).abs() < 0.02, "utilisation {busy}");
}

#[test]
fn listening_first_avoids_most_collisions_and_retries_the_rest() {
    let lost = |radio: &str, retries| {
        let mut team = Team::new(radio, ring(100));
        team.mean_s = 100.0 * 0.010 / 0.3;
        team.link.retries = retries;
        let (_, fates, _) = team.run(Executor::Inline);
        for fate in &fates {
            let carriage = fate.carriage.unwrap();
            assert!(carriage.attempts <= retries + 1);
            assert_eq!(fate.sent + carriage.total(), fate.time);
            let energy_j = 0.020 * f64::from(carriage.attempts);
            assert!((carriage.energy_j - energy_j).abs() < 1e-12);
        }
        share(&fates, COLLISION)
    };
    let csma = "access = 'csma'\nslot = '5ms'\nwindow = 16\nsense_delay = '1ms'";
    let (aloha, listening) = (lost("access = 'aloha'", 0), lost(csma, 0));
    assert!(listening < 0.4 * aloha, "{listening} {aloha}");
    let patient = lost(csma, 4);
    assert!(patient < 0.05 * listening, "{patient} {listening}");
}

#[test]
fn a_pair_in_half_duplex_never_talks_at_once() {
    let radio = "access = 'scheduled'\nchannel = 'pair'\nturnaround = '3ms'";
    let mut team = Team::new(radio, ring(2));
    team.mean_s = 0.03;
    team.until_s = 100;
    let (_, fates, _) = team.run(Executor::Inline);
    let mut spans: Vec<_> = fates
        .iter()
        .filter_map(|fate| {
            let carriage = fate.carriage?;
            let start = fate.sent + carriage.queue + carriage.retries;
            Some((start, start + carriage.serialization, fate.link.clone()))
        })
        .collect();
    spans.sort_by_key(|(start, ..)| *start);
    assert!(spans.len() > 4000);
    for pair in spans.windows(2) {
        let gap = pair[1].0.since(pair[0].1);
        let turned = pair[0].2 != pair[1].2;
        let least = SimDuration::from_millis(if turned { 3 } else { 0 });
        assert!(pair[1].0 >= pair[0].1 && gap >= least, "{pair:?}");
    }
}

/// Two stations that do not hear each other collide at a third between them, however well they
/// listen; and if one is much nearer, it is understood all the same.
#[test]
fn hidden_stations_collide_and_the_stronger_captures() {
    let collisions = |spread_m: f64, middle_m: f64| {
        let at = |x_m| Point3::new(x_m, 0.0, 0.0);
        let stations = vec![(at(-spread_m), 2), (at(spread_m), 2), (at(middle_m), 0)];
        let radio = "access = 'csma'\n[path_loss]\nshadowing_db = 0.0";
        let mut team = Team::new(radio, stations);
        team.mean_s = 0.05;
        team.until_s = 200;
        let (_, fates, _) = team.run(Executor::Inline);
        let from = |name: &str| {
            let own: Vec<Fate> = fates.iter().filter(|f| f.link.0 == name).cloned().collect();
            share(&own, COLLISION)
        };
        (from("s0"), from("s1"))
    };
    // 27 dBm - 40 - 25 log10(d) = -90 dBm at 1200 m.
    let (near, hidden) = (collisions(300.0, 0.0), collisions(700.0, 0.0));
    assert!(near.0 < 0.01 && near.1 < 0.01, "{near:?}");
    assert!(hidden.0 > 0.1 && hidden.1 > 0.1, "{hidden:?}");
    let uneven = collisions(700.0, -500.0);
    assert!(uneven.0 < 0.01 && uneven.1 > 0.1, "{uneven:?}");
}

#[test]
fn moving_out_of_range_ends_the_link_at_that_instant() {
    let stations = vec![(Point3::origin(), 1), (Point3::new(10.0, 0.0, 0.0), 0)];
    let mut team = Team::new("range = '100m'\nlight_time = true", stations);
    team.mean_s = 0.05;
    // At 3 m/s it is 100 m away 30 s after it set out at 20 s.
    let leaves = RadioChange::Moves {
        host: "s1".to_owned(),
        from_m: [10.0, 0.0, 0.0],
        to_m: [310.0, 0.0, 0.0],
        end_ns: 120_000_000_000,
    };
    team.moves = vec![(20, leaves)];
    team.until_s = 200;
    let (_, fates, _) = team.run(Executor::Inline);
    for fate in &fates {
        let far = fate.sent > SimTime::from_secs(50);
        assert_eq!(fate.reason, if far { RANGE } else { "" }, "{fate:?}");
    }
    assert!(share(&fates, RANGE) > 0.5);
    // Light needs 333.6 ns for 100 m.
    let light_ns = |f: &Fate| f.carriage.unwrap().propagation.as_nanos() - 1000;
    let delivered: Vec<u64> = fates
        .iter()
        .filter(|f| f.reason.is_empty())
        .map(light_ns)
        .collect();
    assert_eq!((delivered[0], delivered.iter().max()), (33, Some(&333)));
}

#[test]
fn ground_between_antennas_blocks_or_weakens() {
    // A ridge 10 m high at x = 50 m.
    let heights_m = vec![0.0, 10.0, 0.0, 0.0, 10.0, 0.0];
    let ridge = HeightField::new(Point2::new(0.0, -50.0), 50.0, 3, heights_m).unwrap();
    let ridge = Arc::new(ridge);
    let lost = |radio: &str, x_m: f64| {
        let ground = |x_m| ridge.antenna_m(x_m, 0.0, 0.0);
        let mut team = Team::new(radio, vec![(ground(5.0), 1), (ground(x_m), 0)]);
        team.terrain = Some(ridge.clone());
        team.until_s = 300;
        let (_, fates, _) = team.run(Executor::Inline);
        (share(&fates, OCCLUDED), share(&fates, RANGE))
    };
    assert_eq!(lost("line_of_sight = true", 95.0), (1.0, 0.0));
    assert_eq!(lost("line_of_sight = true", 30.0), (0.0, 0.0));
    assert_eq!(lost("", 95.0), (0.0, 0.0));
    let weak = "line_of_sight = true\nocclusion_db = 60.0\n[path_loss]\nshadowing_db = 0.0";
    assert_eq!(lost(weak, 95.0), (1.0, 0.0));
    assert_eq!(lost(weak, 30.0), (0.0, 0.0));
}

#[test]
fn what_a_shared_radio_charges_reaches_the_sender() {
    let mut team = Team::new("access = 'scheduled'", ring(2));
    team.mean_s = 0.1;
    team.until_s = 50;
    let (report, _, energy_j) = team.run(Executor::Inline);
    let each_j = report.counts.sent as f64 / 2.0 * 0.020;
    assert!(
        (energy_j - each_j).abs() < 0.2 * each_j,
        "{energy_j} {each_j}"
    );
}

/// The waits and arrivals of one link, in order.
fn of_link<'a>(fates: &'a [Fate], from: &str) -> Vec<&'a Fate> {
    fates.iter().filter(|fate| fate.link.0 == from).collect()
}

#[test]
fn a_links_own_queue_limits_what_waits_for_a_shared_channel() {
    let mut team = Team::new("access = 'scheduled'\nqueue = 1000", ring(2));
    team.mean_s = 0.005;
    team.until_s = 20;
    team.link.queue = Some(QueueLimit::Messages(2));
    let (_, fates, _) = team.run(Executor::Inline);
    assert!(share(&fates, "queue_full") > 0.5);
    // Two of its own wait, one is sent, and the other station has as many.
    let longest = fates.iter().map(|f| f.time.since(f.sent)).max();
    assert!(longest < Some(SimDuration::from_millis(75)), "{longest:?}");
    team.link.queue = Some(QueueLimit::Bytes(2500));
    let (_, bytes, _) = team.run(Executor::Inline);
    assert_eq!(share(&fates, "queue_full"), share(&bytes, "queue_full"));
}

#[test]
fn a_link_with_retries_stops_and_waits_whatever_carries_it() {
    for access in ["full-duplex", "scheduled", "csma"] {
        let mut team = Team::new(&format!("access = '{access}'"), ring(2));
        team.mean_s = 0.01;
        team.until_s = 60;
        team.link.latency = SimDuration::from_millis(500);
        team.link.retries = 2;
        let (_, fates, _) = team.run(Executor::Inline);
        let arrivals = of_link(&fates, "s0").into_iter();
        let times: Vec<SimTime> = arrivals
            .filter(|f| f.reason.is_empty())
            .map(|f| f.time)
            .collect();
        assert!(times.len() > 20, "{access}");
        for pair in times.windows(2) {
            // 10 ms on the air, 500 ms there, 500 ms back.
            let gap = pair[1].since(pair[0]);
            assert!(gap >= SimDuration::from_millis(1010), "{access}: {gap}");
        }
    }
}

#[test]
fn one_link_that_waits_does_not_stop_the_others_of_its_station() {
    // Station 0 is in the middle; the contact of its link to 2 is far away.
    let stations = (0..3)
        .map(|i| (Point3::origin(), if i == 0 { 1 } else { 0 }))
        .collect();
    for access in ["full-duplex", "scheduled", "aloha", "csma"] {
        let team = Team::new(&format!("access = '{access}'"), Vec::clone(&stations));
        let mut sim = Simulation::new(1);
        let mut radio = Radio::new(team.radio, None);
        let hosts: Vec<_> = (0..3).map(|i| sim.host(&format!("s{i}"))).collect();
        for (i, host) in hosts.iter().enumerate() {
            radio.station(host.index(), &format!("s{i}"), Point3::origin());
        }
        let late = "store_and_forward = true\ncontacts = [{ start = '30s', end = '60s' }]";
        let late: LinkOverrides = toml::from_str(late).unwrap();
        radio.link("s0-s1", 0, 1, Timeline::new(plain()));
        radio.link("s0-s2", 0, 2, Timeline::new(plain().with(&late)));
        for (i, host) in hosts.iter().enumerate().take(2) {
            let (to, mean_s) = (format!("s{}", 2 - i), if i == 0 { 1.0 } else { 1e9 });
            let energy = Arc::default();
            sim.actor(*host, &format!("s{i}"), move |_| Source {
                to: to.clone(),
                mean_s,
                sent: 0,
                energy: Arc::clone(&energy),
            });
        }
        let energy: Arc<Mutex<f64>> = Arc::default();
        for (name, to, mean_s) in [("s2", "s0", 1e9), ("other", "s1", 1.0)] {
            let host = sim.host(if name == "other" { "s0" } else { name });
            let (to, energy) = (to.to_owned(), energy.clone());
            sim.actor(host, name, move |_| Source {
                to: to.clone(),
                mean_s,
                sent: 0,
                energy: energy.clone(),
            });
        }
        let link = sim.shared_link("radio", radio);
        sim.route(hosts[0], hosts[1], link);
        sim.route(hosts[0], hosts[2], link);
        let fates = Fates::default();
        sim.observe(fates.clone());
        sim.stop_at(SimTime::from_secs(60), "the end");
        sim.run(Executor::Inline).unwrap();
        let fates = fates.list.lock().unwrap();
        let (waiting, open) = (of_link(&fates, "s0"), of_link(&fates, "other"));
        assert!(waiting.len() > 20 && open.len() > 40, "{access}");
        assert!(
            waiting.iter().all(|f| f.time > SimTime::from_secs(30)),
            "{access}"
        );
        let quick = |f: &&Fate| f.time.since(f.sent) < SimDuration::from_secs(1);
        assert!(
            open.iter()
                .filter(|f| f.time < SimTime::from_secs(30))
                .all(quick),
            "{access}"
        );
    }
}

/// What waits is looked at now and then, not whenever anything happens.
#[test]
fn a_long_line_costs_a_few_events_a_message() {
    let mut team = Team::new("access = 'scheduled'\nqueue = 100000", ring(2));
    team.mean_s = 0.002;
    team.until_s = 20;
    let (report, fates, _) = team.run(Executor::Inline);
    assert!(report.counts.in_flight > 15_000 && fates.len() > 1900);
    let events_each = report.counts.events as f64 / report.counts.sent as f64;
    assert!(events_each < 12.0, "{events_each} events for each message");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// Holding, contending and moving are the same on one thread and on several.
    #[test]
    fn radios_give_one_result_on_every_executor(
        access in prop::sample::select(vec!["full-duplex", "scheduled", "aloha", "csma"]),
        pair in any::<bool>(),
        retries in 0u32..4,
        queue in 1u32..5,
        count in 2usize..6,
    ) {
        let channel = if pair { "pair" } else { "all" };
        let radio = format!("access = '{access}'\nchannel = '{channel}'\nqueue = {queue}");
        let mut team = Team::new(&radio, ring(count));
        team.mean_s = 0.03;
        team.until_s = 3;
        team.link.retries = retries;
        let (inline, fates, _) = team.run(Executor::Inline);
        let (kameo, ..) = team.run(Executor::Kameo { threads: 2 });
        prop_assert_eq!(&inline, &kameo);
        prop_assert!(fates.len() as u64 + inline.counts.in_flight == inline.counts.sent);
    }
}

/// Before a contact begins so many messages come together, and after it, on a channel that ten
/// others want too. A message is looked at a number of times that does not hang on how many wait.
#[test]
fn a_message_costs_the_same_however_many_wait_for_the_radio() {
    let contacts = "contacts = [{ start = '1000s', end = '9000s' }]\nstore_and_forward = true";
    let contacts: LinkOverrides = toml::from_str(contacts).unwrap();
    let cases = [
        ("access = 'scheduled'", true),
        ("access = 'csma'\nslot = '5ms'", true),
        ("access = 'csma'\nslot = '5ms'", false),
    ];
    for (radio, waits_for_contact) in cases {
        let looks_each = [4_000u32, 16_000].map(|count| {
            let mut team = Team::new(radio, ring(10));
            team.link = LinkParams {
                queue: Some(QueueLimit::Messages(1 << 40)),
                retries: 3,
                ..team.link
            };
            if waits_for_contact {
                team.link = team.link.with(&contacts);
            }
            team.mean_s = match waits_for_contact {
                true => 1000.0 * 10.0 / f64::from(count),
                // Twice as many as the channel carries.
                false => 10.0 * 0.010 / 2.0,
            };
            team.until_s = match waits_for_contact {
                true => 1000 + u64::from(count) / 10,
                false => u64::from(count) / 200,
            };
            LOOKS.with(|looks| looks.set(0));
            let (report, fates, _) = team.run(Executor::Inline);
            let looks = LOOKS.with(std::cell::Cell::get) as f64;
            let arrived = fates.iter().filter(|fate| fate.reason.is_empty()).count();
            assert!(arrived > count as usize / 4, "{radio}: {arrived}");
            looks / report.counts.sent as f64
        });
        // Who comes first in its line may have to ask several times, among ten; who waits behind it
        // does not.
        let [few, many] = looks_each;
        assert!(
            many < 32.0 && many < 1.5 * few,
            "{radio}: {few} looks for each message of few, {many} of many"
        );
    }
}

#[test]
fn who_is_parked_is_woken_in_every_executor() {
    let contacts = "contacts = [{ start = '5s', end = '900s' }]\nstore_and_forward = true";
    let mut team = Team::new("access = 'csma'\nslot = '5ms'", ring(5));
    team.link.queue = Some(QueueLimit::Messages(1000));
    team.link = team.link.with(&toml::from_str(contacts).unwrap());
    team.mean_s = 0.030;
    team.until_s = 20;
    let (report, fates, _) = team.run(Executor::Inline);
    let counts = &report.counts;
    assert!(counts.in_flight > 100, "many wait at the end");
    assert_eq!(counts.sent, fates.len() as u64 + counts.in_flight);
    let (same, ..) = team.run(Executor::Kameo { threads: 2 });
    assert_eq!(report.digest, same.digest);
    assert_eq!(report.counts, same.counts);
}
