//! From globs to flows: who sends to whom, over which hosts, by which id.

use std::collections::{BTreeMap, BTreeSet};

use farside::Pattern;
use farside::random::name_hash;
use farside::record::RESERVED;
use farside::suggest::{closest, did_you_mean};

use super::config::{FlowConfig, TrafficConfig, TrafficError};

/// The most hosts.
const MAX_HOSTS: usize = 2_000;

/// The most flows.
const MAX_FLOWS: usize = 100_000;

/// The most characters of a host's name.
const MAX_NAME: usize = 64;

/// The hosts and flows of a scenario.
///
/// ```
/// use farside_traffic::{TrafficConfig, TrafficPlan};
/// let text = "
///     hosts = ['earth', 'relay']
///     groups = [{ prefix = 'rover', count = 2 }]
///     flow = [{ from = 'rover_*', to = 'earth', via = ['relay'], period = '1s' }]
/// ";
/// let plan = TrafficPlan::new(&toml::from_str::<TrafficConfig>(text)?)?;
/// assert_eq!(plan.hosts, ["earth", "relay", "rover_1", "rover_2"]);
/// assert_eq!(plan.flows[1].to_string(), "rover_2 > relay > earth");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct TrafficPlan {
    /// The hosts, in the scenario's order.
    pub hosts: Vec<String>,
    /// The flows, by entry, then by host.
    pub flows: Vec<Flow>,
}

/// One flow: a source, a destination, and who is between.
#[derive(Clone, Debug, PartialEq)]
pub struct Flow {
    /// The flow's id in messages and their identities. It derives from the flow's path, so that
    /// flows that come or go leave the draws of others as they are.
    pub id: u32,
    /// Indices of hosts, source first, destination last.
    pub path: Vec<usize>,
    /// The same as names.
    names: Vec<String>,
    /// When and what it sends.
    pub config: FlowConfig,
}

impl Flow {
    /// The names of its hosts, source first, destination last.
    pub fn names(&self) -> &[String] {
        &self.names
    }
}

impl std::fmt::Display for Flow {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.names.join(" > "))
    }
}

impl TrafficPlan {
    /// Names the hosts and expands the entries.
    ///
    /// # Errors
    /// When a value cannot be, a name is there twice, or a glob matches nothing.
    pub fn new(config: &TrafficConfig) -> Result<TrafficPlan, TrafficError> {
        config.check_all()?;
        let hosts = hosts(config)?;
        if config.flows.is_empty() {
            let message = "no flow: expected at least one [[traffic.flow]]";
            return Err(TrafficError::new("flow", message));
        }
        let mut flows: Vec<Flow> = Vec::new();
        let mut ids = BTreeSet::new();
        for (index, entry) in config.flows.iter().enumerate() {
            let key = |last: &str| format!("flow.{index}.{last}");
            let from = matching(&hosts, &entry.from, key("from"))?;
            let to = matching(&hosts, &entry.to, key("to"))?;
            let mut via = Vec::new();
            for (at, name) in entry.via.iter().enumerate() {
                via.push(host(&hosts, name, format!("flow.{index}.via.{at}"))?);
            }
            let before = flows.len();
            for (source, target) in from.iter().flat_map(|s| to.iter().map(move |t| (*s, *t))) {
                let path = [&[source], &via[..], &[target]].concat();
                let Some(names) = names(&hosts, &path) else {
                    continue;
                };
                if flows.len() == MAX_FLOWS {
                    let message = format!("more than {MAX_FLOWS} flows");
                    return Err(TrafficError::new(format!("flow.{index}"), message));
                }
                flows.push(Flow {
                    id: new_id(&mut ids, &names),
                    path,
                    names,
                    config: entry.clone(),
                });
            }
            if flows.len() == before {
                let message = "no flow: no host sends to itself, or passes its own messages on";
                return Err(TrafficError::new(format!("flow.{index}"), message));
            }
        }
        Ok(TrafficPlan { hosts, flows })
    }

    /// The ordered pairs of hosts that messages cross, by index, each once.
    pub fn hops(&self) -> BTreeSet<(usize, usize)> {
        let hops = self.flows.iter().flat_map(|flow| flow.path.windows(2));
        hops.map(|hop| (hop[0], hop[1])).collect()
    }

    /// The flows that begin at each host, by their place.
    pub(super) fn own_flows(&self) -> Vec<Vec<u32>> {
        let mut own = vec![Vec::new(); self.hosts.len()];
        for (place, flow) in self.flows.iter().enumerate() {
            own[flow.path[0]].push(place as u32);
        }
        own
    }

    /// Whom each host passes each flow's messages on to, by the flow's id.
    pub(super) fn next_hops(&self) -> Vec<BTreeMap<u32, usize>> {
        let mut next = vec![BTreeMap::new(); self.hosts.len()];
        for flow in &self.flows {
            for hop in flow.path.windows(2) {
                next[hop[0]].insert(flow.id, hop[1]);
            }
        }
        next
    }
}

/// The path's names; `None` if it comes to a host twice.
fn names(hosts: &[String], path: &[usize]) -> Option<Vec<String>> {
    let distinct: BTreeSet<_> = path.iter().collect();
    let names = || path.iter().map(|host| hosts[*host].clone()).collect();
    (distinct.len() == path.len()).then(names)
}

/// An id that no other flow has: the hash of the path, or a number after it.
fn new_id(ids: &mut BTreeSet<u32>, names: &[String]) -> u32 {
    // The upper half, because two flows with one path get ids that follow each other.
    let mut id = (name_hash(&names.join(">")) >> 32) as u32;
    while !ids.insert(id) {
        id = id.wrapping_add(1);
    }
    id
}

fn hosts(config: &TrafficConfig) -> Result<Vec<String>, TrafficError> {
    let mut hosts: Vec<String> = Vec::new();
    let mut known = BTreeSet::new();
    let mut add = |name: String, key: String| {
        let good = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if name.is_empty() || name.len() > MAX_NAME || !name.chars().all(good) {
            let message = format!("{name:?}: expected 1 to {MAX_NAME} letters, digits and `_`");
            return Err(TrafficError::new(key, message));
        }
        // Each host has an actor of its name.
        if RESERVED.contains(&name.as_str()) {
            let message = format!("{name:?}: logs use this name for topics of their own");
            return Err(TrafficError::new(key, message));
        }
        if hosts.len() == MAX_HOSTS {
            return Err(TrafficError::new(
                key,
                format!("more than {MAX_HOSTS} hosts"),
            ));
        }
        if !known.insert(name.clone()) {
            return Err(TrafficError::new(key, format!("{name:?} is there twice")));
        }
        hosts.push(name);
        Ok(())
    };
    for (index, name) in config.hosts.iter().enumerate() {
        add(name.clone(), format!("hosts.{index}"))?;
    }
    for (index, group) in config.groups.iter().enumerate() {
        if group.count == 0 {
            let key = format!("groups.{index}.count");
            return Err(TrafficError::new(key, "0: expected at least 1"));
        }
        for number in 1..=group.count {
            add(
                format!("{}_{number}", group.prefix),
                format!("groups.{index}"),
            )?;
        }
    }
    if hosts.len() < 2 {
        let message = "fewer than two hosts: nobody could send anything";
        return Err(TrafficError::new("hosts", message));
    }
    Ok(hosts)
}

/// The hosts that a name or glob means.
fn matching(hosts: &[String], pattern: &str, key: String) -> Result<Vec<usize>, TrafficError> {
    let names = match Pattern::over_names(pattern) {
        Ok(names) => names,
        Err(error) => {
            let message = format!("{pattern:?} is no pattern over hosts: {error}");
            return Err(TrafficError::new(key, message));
        }
    };
    let found: Vec<usize> = (0..hosts.len())
        .filter(|at| names.matches(&hosts[*at]))
        .collect();
    if found.is_empty() {
        return Err(unknown(hosts, pattern, "matches no host", key));
    }
    Ok(found)
}

fn host(hosts: &[String], name: &str, key: String) -> Result<usize, TrafficError> {
    let found = hosts.iter().position(|host| host == name);
    found.ok_or_else(|| unknown(hosts, name, "is no host", key))
}

fn unknown(hosts: &[String], found: &str, is_not: &str, key: String) -> TrafficError {
    let hint = did_you_mean(closest(found, hosts.iter().map(String::as_str)));
    TrafficError::new(key, format!("{found:?} {is_not}{hint}"))
}
