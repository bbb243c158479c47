//! Puts traffic together: a station on each host, links where messages go, and a monitor.

use std::sync::{Arc, Mutex, PoisonError};

use farside::{HostId, SimTime, Simulation};
use farside_actors::wiring::{Wire, Wiring};

use crate::config::{TrafficConfig, TrafficError};
use crate::metrics::TrafficMetrics;
use crate::monitor::{Monitor, Tally};
use crate::route::TrafficPlan;
use crate::station::Station;

/// Traffic in a simulation: what it was to be, and once the run is over, what came of it.
pub struct Traffic {
    plan: Arc<TrafficPlan>,
    tally: Arc<Mutex<Tally>>,
}

/// Declares hosts, stations and links. `seed` is the run's; the monitor keeps a sample of the
/// delays by it where there are too many to keep them all.
///
/// # Errors
/// When the settings cannot be; the error names the key.
pub fn assemble(
    sim: &mut Simulation,
    config: &TrafficConfig,
    seed: u64,
    wire: &mut Wire<'_>,
) -> Result<Traffic, TrafficError> {
    let plan = Arc::new(TrafficPlan::new(config)?);
    let hosts: Vec<HostId> = plan.hosts.iter().map(|name| sim.host(name)).collect();
    let stations = plan.own_flows().into_iter().zip(plan.next_hops());
    for ((own, next), (host, name)) in stations.zip(hosts.iter().zip(&plan.hosts)) {
        let plan = plan.clone();
        sim.actor(*host, name, move |_| {
            Station::new(plan.clone(), own.clone(), next.clone())
        });
    }
    let mut wiring = Wiring::default();
    for (from, to) in plan.hops() {
        let host = |at: usize| (hosts[at], plan.hosts[at].as_str());
        wiring.link(host(from), host(to));
    }
    wire(sim, &wiring)?;
    let (monitor, tally) = Monitor::new(&plan, seed);
    sim.observe(monitor);
    Ok(Traffic { plan, tally })
}

impl Traffic {
    /// The hosts and flows.
    pub fn plan(&self) -> &TrafficPlan {
        &self.plan
    }

    /// What came of a run that ended at `end`.
    pub fn metrics(&self, end: SimTime) -> TrafficMetrics {
        let tally = self.tally.lock().unwrap_or_else(PoisonError::into_inner);
        TrafficMetrics::new(&self.plan, &tally, end)
    }
}
