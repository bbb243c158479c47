//! What declaring many things costs: work and memory that grow with their number, not with its square.

use std::time::Duration;

use farside::prelude::*;

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
