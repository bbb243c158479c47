//! What declaring many things costs: work that grows with their number, not with its square.

use farside::prelude::*;

struct Idle;

impl Actor for Idle {
    type Accepts = ();
}

/// A minute and 26 GB, if routes were a table for each host, or names were looked for one by one.
#[test]
fn eighty_thousand_hosts_are_declared_at_once() {
    const HOSTS: usize = 80_000;
    let wire = || FixedDelay::new(SimDuration::from_millis(1));
    let mut sim = Simulation::new(1);
    let hosts: Vec<HostId> = (0..HOSTS).map(|at| sim.host(&format!("h{at}"))).collect();
    for (at, host) in hosts.iter().enumerate() {
        sim.actor(*host, &format!("h{at}/a"), |_| Idle);
    }
    for (at, host) in hosts.iter().enumerate() {
        // To the last of all, which is far from its own number.
        let last = hosts[HOSTS - 1 - usize::from(at + 1 == HOSTS)];
        sim.link(*host, last, &format!("h{at}-base"), wire());
        sim.crash_host_at(SimTime::from_secs(1), *host);
        let name = format!("h{at}/a");
        let restarted = sim.restart_named_at(SimTime::from_secs(2), &name);
        restarted.expect("it was declared");
    }
    let report = sim.run(Executor::Inline).expect("it can start");
    assert_eq!(report.counts.events, 3 * HOSTS as u64);
}
