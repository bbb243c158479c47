//! What declaring many things costs: work and memory that grow with their number, not with its square.

use std::time::Duration;

use farside::prelude::*;
use farside_logs::{LogOptions, LogWriter, info};
use farside_tests::executors::WAYS;
use serde::{Deserialize, Serialize};

struct Idle;

impl Actor for Idle {
    type Accepts = ();
}

/// Hosts with an actor and a link each, crashed and started again by name.
fn declared(hosts: usize) -> Simulation {
    let wire = || FixedDelay::new(SimDuration::from_millis(1));
    let mut sim = Simulation::new(1);
    let ids: Vec<HostId> = (0..hosts).map(|at| sim.host(&format!("h{at}"))).collect();
    for (at, host) in ids.iter().enumerate() {
        sim.actor(*host, &format!("h{at}/a"), |_| Idle);
    }
    for (at, host) in ids.iter().enumerate() {
        // To the last of all, which is far from its own number.
        let last = ids[hosts - 1 - usize::from(at + 1 == hosts)];
        sim.link(*host, last, &format!("h{at}-base"), wire());
        sim.crash_host_at(SimTime::from_secs(1), *host);
        let name = format!("h{at}/a");
        let restarted = sim.restart_named_at(SimTime::from_secs(2), &name);
        restarted.expect("it was declared");
    }
    sim
}

fn run(hosts: usize) {
    let report = declared(hosts).run(Executor::Inline);
    let report = report.expect("it can start");
    assert_eq!(report.counts.events, 3 * hosts as u64);
}

/// 26 GB for 80,000 hosts, if routes were a table for each.
#[test]
fn memory_grows_with_the_number_of_hosts() {
    let asked = |hosts| allocation_counter::measure(|| run(hosts));
    let (few, many) = (asked(2_000), asked(8_000));
    let (times, bytes) = (
        many.count_total as f64 / few.count_total as f64,
        many.bytes_total as f64 / few.bytes_total as f64,
    );
    // Four times as much; what doubles its room when it is full may be a step ahead.
    assert!(times < 5.0, "{times} times as often");
    assert!(bytes < 6.0, "{bytes} times as many bytes");
}

/// Half an hour, if names were looked for one by one: each is asked for four times.
#[test]
fn very_many_hosts_are_declared_at_once() {
    /// Far longer than it takes, also where others work on the machine.
    const PATIENCE: Duration = Duration::from_secs(120);
    let (done, answer) = std::sync::mpsc::channel();
    #[expect(
        clippy::disallowed_methods,
        reason = "a hang is to fail the test; nothing is simulated on that thread"
    )]
    std::thread::spawn(move || {
        run(400_000);
        done.send(())
    });
    answer.recv_timeout(PATIENCE).expect("no hang, no panic");
}

/// Sends itself one message.
struct Once;

impl Actor for Once {
    type Accepts = (Mark,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_secs(1), Mark);
        Ok(())
    }
}

#[derive(Serialize, Deserialize)]
struct Mark;

impl Handler<Mark> for Once {
    fn handle(&mut self, _mark: Mark, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

/// MCAP numbers topics in 16 bits. A run of more actors than that is logged all the same, each event of it.
#[test]
fn more_actors_than_a_log_has_numbers_for_topics_are_logged() {
    const ACTORS: u64 = 66_000;
    let build = |heavy: bool| {
        let mut sim = Simulation::new(1);
        let hosts = ["a", "b"].map(|name| sim.host(name));
        for host in hosts.into_iter().filter(|_| heavy) {
            sim.heavy(host);
        }
        for at in 0..ACTORS {
            sim.actor(hosts[at as usize % 2], &format!("x{at}"), |_| Once);
        }
        sim
    };
    let folder = tempfile::tempdir().expect("a folder");
    let reports = WAYS.map(|(executor, heavy)| {
        let path = folder.path().join("run.mcap");
        let mut sim = build(heavy);
        sim.observe(LogWriter::create(&path, LogOptions::default()).expect("it can be created"));
        let report = sim.run(executor).expect("it can start");
        let run = info(&path).expect("it is a log").run.expect("of a run");
        assert_eq!(run.digest, Some(report.digest.to_string()));
        report
    });
    assert_eq!(reports[0].end.name(), "completed");
    assert_eq!(reports[0].counts.events, 2 * ACTORS);
    for report in &reports {
        assert_eq!(*report, reports[0]);
    }
}
