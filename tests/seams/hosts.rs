//! Hosts: crashed as a whole, and charged for what their actors send and receive.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use farside::carrier::{Carrier, NoChange, Parcel, Verdicts};
use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record};
use farside_actors::link::{Link, LinkParams, Path, Transmitter};
use farside_experiments::registry::Registry;
use farside_experiments::scenario::Scenario;
use proptest::prelude::*;
use serde::{Deserialize, Serialize};

fn network(sets: &[&str], executor: Executor) -> Report {
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    let name = "network/crater-dense";
    let scenario = Scenario::open(name, &sets, &Registry::builtin()).expect("it is built in");
    let assembled = scenario.assemble().expect("it can be assembled");
    assembled.sim.run(executor).expect("it can start")
}

#[test]
fn a_host_of_one_actor_crashes_as_the_actor_does() {
    let short = ["until=8s", "team.rovers=6"];
    let run = |crash: &str, executor| network(&[short[0], short[1], crash], executor);
    let actor = "crash=[{ actor = 'node_07', at = '3s', restart = '5s' }]";
    let host = "crash=[{ host = 'node_07', at = '3s', restart = '5s' }]";
    let expected = run(actor, Executor::Inline);
    assert_eq!(expected, run(host, Executor::Inline));
    assert_eq!(expected, run(host, Executor::Kameo { threads: 2 }));
    assert_ne!(expected.digest, run("seed=1", Executor::Inline).digest);
}

#[test]
fn an_unknown_host_is_refused_with_the_nearest() {
    let open = |crash: &str| {
        let sets = ["team.rovers=6".to_owned(), crash.to_owned()];
        let scenario = Scenario::open("network/crater-dense", &sets, &Registry::builtin());
        match scenario.and_then(|scenario| scenario.assemble().map(|_| ())) {
            Err(error) => error.to_string(),
            Ok(()) => panic!("{crash} was taken"),
        }
    };
    let unknown = open("crash=[{ host = 'nod_07', at = '3s' }]");
    assert!(unknown.contains("did you mean \"node_07\"?"), "{unknown}");
    let both = open("crash=[{ host = 'node_07', actor = 'node_07', at = '3s' }]");
    assert!(
        both.contains("expected `actor` or `host`, not both"),
        "{both}"
    );
    let nobody = open("crash=[{ at = '3s' }]");
    assert!(nobody.contains("expected who crashes"), "{nobody}");
}

#[derive(Serialize, Deserialize)]
struct Data {
    bytes: Vec<u8>,
}

#[derive(Serialize, Deserialize)]
struct Next;

#[derive(Serialize, Deserialize)]
struct Read;

/// What one host was charged for sending and for receiving, in joules.
type Energies = Arc<Mutex<BTreeMap<String, (f64, f64)>>>;

/// Sends to everyone in turn, and says in each message what its host was charged so far.
struct Talker {
    names: Vec<String>,
    sends: u32,
}

impl Actor for Talker {
    type Accepts = (Data, Next);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_millis(1), Next);
        Ok(())
    }
}

impl Handler<Next> for Talker {
    fn handle(&mut self, _next: Next, ctx: &mut Context<'_, Self>) -> Outcome {
        let to = ctx.random("to").below(self.names.len() as u64) as usize;
        let to = ctx.recipient::<Data>(&self.names[to])?;
        let energy_j = ctx.host_transmit_energy_j() + ctx.host_receive_energy_j();
        let mut bytes = energy_j.to_bits().to_le_bytes().to_vec();
        bytes.resize(8 + ctx.random("size").below(100) as usize, 0);
        ctx.send(to, Data { bytes });
        if ctx.durable::<u32>() < &mut self.sends {
            *ctx.durable::<u32>() += 1;
            let wait = SimDuration::from_millis(1 + ctx.random("wait").below(20));
            ctx.timer(wait, Next);
        }
        Ok(())
    }
}

impl Handler<Data> for Talker {
    fn handle(&mut self, _data: Data, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

/// The actor beside the talkers that keeps the battery.
struct Meter {
    read: Energies,
}

impl Actor for Meter {
    type Accepts = (Read,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_secs(1_000), Read);
        Ok(())
    }
}

impl Handler<Read> for Meter {
    fn handle(&mut self, _read: Read, ctx: &mut Context<'_, Self>) -> Outcome {
        assert_eq!(ctx.transmit_energy_j(), 0.0, "a meter sends nothing");
        let energies = (ctx.host_transmit_energy_j(), ctx.host_receive_energy_j());
        self.read
            .lock()
            .expect("no meter panics")
            .insert(ctx.name().to_owned(), energies);
        Ok(())
    }
}

/// What the carriages of all fates add up to.
#[derive(Clone, Default)]
struct Carried(Arc<Mutex<(f64, f64)>>);

impl Observer for Carried {
    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        if let (true, Some(carriage)) = (record.class.is_fate(), record.carriage) {
            let mut sums = self.0.lock().expect("no observer panics");
            sums.0 += carriage.energy_j;
            sums.1 += carriage.receive_j;
        }
        Ok(Flow::Continue)
    }
}

/// One channel that all hosts share: a transmitter for each, one after the other on the air.
struct Medium {
    sides: BTreeMap<String, Transmitter>,
    free: SimTime,
}

impl Carrier for Medium {
    type Change = NoChange;

    fn min_delay(&self) -> SimDuration {
        self.sides
            .values()
            .map(Transmitter::min_delay)
            .min()
            .unwrap_or_default()
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        let side = self
            .sides
            .get_mut(parcel.sender_host())
            .expect("every host has one");
        for copy in 0..side.copies(parcel) {
            let sent = side.send(parcel, copy, self.free, &Path::default());
            self.free = side.free_at();
            sent.tell(parcel.now(), verdicts);
        }
    }

    fn change(&mut self, _change: NoChange, _now: SimTime) {}
}

#[derive(Clone, Debug)]
struct Team {
    seed: u64,
    /// How many talkers each host has; odd ones are heavy.
    hosts: Vec<u8>,
    loss: f64,
    duplicate: f64,
    retries: u32,
    shared: bool,
    /// A host that crashes, and when [ms].
    crash: Option<(u8, u64)>,
}

fn build(team: &Team, read: &Energies, carried: &Carried) -> Simulation {
    let params = LinkParams {
        rate: Some(100_000),
        loss: team.loss,
        duplicate: team.duplicate,
        retries: team.retries,
        tx_power_w: 2.0,
        rx_power_w: 0.5,
        ..LinkParams::default()
    };
    let mut sim = Simulation::new(team.seed);
    let host_name = |at: usize| format!("rover_{at}");
    let talkers = |(at, count): (usize, &u8)| {
        (0..*count).map(move |talker| (at, format!("{}/talker_{talker}", host_name(at))))
    };
    let names: Vec<_> = team.hosts.iter().enumerate().flat_map(talkers).collect();
    let sides = (0..team.hosts.len()).map(|at| (host_name(at), Transmitter::new(params.clone())));
    let medium = Medium {
        sides: sides.collect(),
        free: SimTime::ZERO,
    };
    let medium = team.shared.then(|| sim.shared_link("medium", medium));
    let hosts: Vec<HostId> = (0..team.hosts.len())
        .map(|at| sim.host(&host_name(at)))
        .collect();
    for (at, host) in hosts.iter().enumerate() {
        let read = read.clone();
        sim.actor(*host, &host_name(at), move |_| Meter { read: read.clone() });
        match medium {
            Some(medium) if at % 2 == 0 => {
                for to in hosts.iter().filter(|to| *to != host) {
                    sim.route(*host, *to, medium);
                }
            }
            _ => {
                sim.uplink(*host, &format!("rover_{at}-all"), Link::new(params.clone()));
            }
        }
        if at % 2 == 1 {
            sim.heavy(*host);
        }
    }
    let all: Vec<String> = names.iter().map(|(_, name)| name.clone()).collect();
    for (at, name) in &names {
        let all = all.clone();
        sim.actor(hosts[*at], name, move |_| Talker {
            names: all.clone(),
            sends: 20,
        });
    }
    if let Some((host, at_ms)) = team.crash {
        let host = hosts[usize::from(host) % hosts.len()];
        let at = SimTime::ZERO + SimDuration::from_millis(at_ms);
        sim.crash_host_at(at, host);
        sim.restart_host_at(at + SimDuration::from_millis(30), host);
    }
    sim.observe(carried.clone());
    sim
}

prop_compose! {
    fn team()(
        seed in any::<u64>(),
        hosts in prop::collection::vec(1u8..3, 2..5),
        loss in 0.0..0.5f64,
        duplicate in 0.0..0.3f64,
        retries in 0u32..3,
        shared in any::<bool>(),
        crash in prop::option::of((any::<u8>(), 0u64..200)),
    ) -> Team {
        Team { seed, hosts, loss, duplicate, retries, shared, crash }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// Over all hosts, what was charged is what the carriages in the log say.
    #[test]
    fn what_hosts_were_charged_is_what_messages_took(team in team()) {
        let run = |executor| {
            let (read, carried) = (Energies::default(), Carried::default());
            let report = build(&team, &read, &carried).run(executor).expect("it can start");
            let read = read.lock().expect("the run is over").clone();
            let carried = *carried.0.lock().expect("the run is over");
            (report, read, carried)
        };
        let (report, read, carried) = run(Executor::Inline);
        prop_assert_eq!(report.end.name(), "completed");
        prop_assert_eq!(read.len(), team.hosts.len());
        let sum = |of: fn(&(f64, f64)) -> f64| read.values().map(of).sum::<f64>();
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-9 * a.max(1.0);
        prop_assert!(close(sum(|e| e.0), carried.0), "{:?} {:?}", read, carried);
        prop_assert!(close(sum(|e| e.1), carried.1), "{:?} {:?}", read, carried);
        prop_assert!(carried.0 > 0.0 && carried.1 > 0.0);
        // To the last bit, whoever ran it.
        prop_assert_eq!((report, read, carried), run(Executor::Kameo { threads: 2 }));
    }
}
