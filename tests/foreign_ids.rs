//! Ids are of one simulation, and links that a host owns are of one host: whatever is given another's
//! says so, before the run or in the event that used it, and never hands a message to somebody else.

use farside::prelude::*;
use farside::{BuildError, FaultCause, LinkId};
use farside_tests::executors::agreed;
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
struct Ping;

#[derive(Clone, Copy)]
enum Uses {
    Nothing,
    Address(Address<Pinger>),
    Recipient(Recipient<Ping>),
    Link(LinkId<farside::carrier::NoChange>),
}

/// Uses what it was given after a second.
struct Pinger(Uses);

impl Actor for Pinger {
    type Accepts = (Ping,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_secs(1), Ping);
        Ok(())
    }
}

impl Handler<Ping> for Pinger {
    fn handle(&mut self, _ping: Ping, ctx: &mut Context<'_, Self>) -> Outcome {
        match self.0 {
            Uses::Nothing => {}
            Uses::Address(to) => ctx.send(to, Ping),
            Uses::Recipient(to) => ctx.send_after(to, SimDuration::from_secs(1), Ping),
            Uses::Link(link) => ctx.tell_link(link, farside::carrier::NoChange),
        }
        self.0 = Uses::Nothing;
        Ok(())
    }
}

/// Two hosts, an actor on each, a link each way and a shared one.
struct Pair {
    sim: Simulation,
    hosts: [HostId; 2],
    actors: [Address<Pinger>; 2],
    link: LinkId<farside::carrier::NoChange>,
    shared: LinkId<farside::carrier::NoChange>,
}

fn pair(heavy: bool, uses: Uses) -> Pair {
    let mut sim = Simulation::new(1);
    let hosts = ["a", "b"].map(|name| sim.host(name));
    if heavy {
        for host in hosts {
            sim.heavy(host);
        }
    }
    let actors = [("a/p", 0), ("b/p", 1)]
        .map(|(name, host)| sim.actor(hosts[host], name, move |_| Pinger(uses)));
    let wire = || FixedDelay::new(SimDuration::from_millis(5));
    let link = sim.link(hosts[0], hosts[1], "a-b", wire());
    let shared = sim.shared_link("medium", wire());
    Pair {
        sim,
        hosts,
        actors,
        link,
        shared,
    }
}

fn refused(spoil: impl Fn(&mut Pair)) -> BuildError {
    let build = |heavy| {
        let mut pair = pair(heavy, Uses::Nothing);
        spoil(&mut pair);
        pair.sim
    };
    agreed(build).expect_err("it is refused")
}

#[test]
fn only_shared_links_carry_for_several_hosts() {
    let not_shared = |from: &str, to: &str| BuildError::NotShared {
        link: "a-b".to_owned(),
        from: from.to_owned(),
        to: to.to_owned(),
    };
    // Its own host may not use it twice either: there is one way to say which host a link is of.
    for (from, to) in [(1, 0), (0, 1), (0, 0), (1, 1)] {
        let error = refused(|pair| pair.sim.route(pair.hosts[from], pair.hosts[to], pair.link));
        assert_eq!(error, not_shared(["a", "b"][from], ["a", "b"][to]));
    }
    let error = refused(|pair| {
        let up = FixedDelay::new(SimDuration::from_millis(5));
        let up = pair.sim.uplink(pair.hosts[0], "up", up);
        pair.sim.route(pair.hosts[1], pair.hosts[0], up);
    });
    assert_eq!(
        error.to_string(),
        "link up is not shared: it cannot carry what host b sends to host a"
    );
    let build = |heavy| {
        let mut pair = pair(heavy, Uses::Nothing);
        pair.sim.route(pair.hosts[1], pair.hosts[0], pair.shared);
        pair.sim
    };
    assert_eq!(agreed(build).expect("it can start").end.name(), "completed");
}

#[test]
fn ids_of_another_simulation_are_refused_before_the_start() {
    let second = SimTime::from_secs(1);
    let wire = || FixedDelay::new(SimDuration::from_millis(5));
    let other = pair(false, Uses::Nothing);
    let (host, actor, link, shared) = (other.hosts[1], other.actors[1], other.link, other.shared);
    let recipient = actor.recipient::<Ping>();
    type Spoil<'a> = &'a dyn Fn(&mut Pair);
    let mistakes: [(&str, Spoil<'_>); 16] = [
        ("host", &|pair| pair.sim.heavy(host)),
        ("host", &|pair| {
            pair.sim.actor(host, "c", |_| Pinger(Uses::Nothing));
        }),
        ("host", &|pair| {
            pair.sim.link(host, pair.hosts[0], "b-a", wire());
        }),
        ("host", &|pair| {
            pair.sim.link(pair.hosts[1], host, "b-a", wire());
        }),
        ("host", &|pair| {
            pair.sim.uplink(host, "up", wire());
        }),
        ("host", &|pair| {
            pair.sim.route(host, pair.hosts[0], pair.shared)
        }),
        ("host", &|pair| {
            pair.sim.route(pair.hosts[0], host, pair.shared)
        }),
        ("host", &|pair| pair.sim.crash_host_at(second, host)),
        ("host", &|pair| pair.sim.restart_host_at(second, host)),
        ("link", &|pair| {
            pair.sim.route(pair.hosts[1], pair.hosts[0], shared);
        }),
        ("link", &|pair| {
            pair.sim.change_at(second, link, farside::carrier::NoChange);
        }),
        ("actor", &|pair| pair.sim.crash_at(second, actor)),
        ("actor", &|pair| pair.sim.restart_at(second, actor)),
        ("actor", &|pair| pair.sim.tell_at(second, actor, Ping)),
        ("actor", &|pair| pair.sim.tell_at(second, recipient, Ping)),
        // The first mistake is the one that is told.
        ("actor", &|pair| {
            pair.sim.crash_at(second, actor);
            pair.sim.heavy(host);
        }),
    ];
    for (at, (what, spoil)) in mistakes.into_iter().enumerate() {
        let error = refused(spoil);
        let told = matches!(error, BuildError::OtherSimulation { what: told, .. } if told == what);
        assert!(told, "mistake {at}: {error}");
    }
}

#[test]
fn ids_of_another_simulation_are_faults_in_a_handler() {
    let other = pair(false, Uses::Nothing);
    for (what, uses) in [
        ("actor", Uses::Address(other.actors[0])),
        ("actor", Uses::Recipient(other.actors[0].recipient())),
        ("link", Uses::Link(other.link)),
    ] {
        let report = agreed(|heavy| pair(heavy, uses).sim).expect("it can start");
        let fault = report.fault().expect("a fault");
        assert_eq!(fault.actor, "a/p");
        assert_eq!(fault.time, SimTime::from_secs(1));
        assert_eq!(fault.cause, FaultCause::OtherSimulation { what, number: 0 });
    }
}

#[test]
fn ids_look_the_same_however_many_simulations_came_before() {
    let shown = || {
        let pair = pair(false, Uses::Nothing);
        format!("{:?} {:?}", pair.hosts, pair.actors)
    };
    assert_eq!(shown(), shown());
    assert_eq!(shown(), "[HostId(0), HostId(1)] [Address(0), Address(1)]");
}
