//! Radios from a scenario: which links go through which, and where their ends stand.

use std::collections::BTreeMap;
use std::sync::Arc;

use farside::{HostId, SimTime, Simulation};
use farside_worlds::HeightField;
use nalgebra::Point3;

use super::{Access, Radio, RadioChange, RadioConfig};
use crate::link::{LinkChange, Timeline};

/// Collects what goes through one radio, and declares it.
pub(crate) struct RadioBuilder {
    name: String,
    config: RadioConfig,
    links: Vec<Joined>,
}

/// A link that goes through a radio.
struct Joined {
    name: String,
    from: HostId,
    to: HostId,
    timeline: Arc<Timeline>,
    changes: Vec<(SimTime, LinkChange)>,
}

impl RadioBuilder {
    pub(crate) fn new(name: &str, config: RadioConfig) -> Self {
        RadioBuilder {
            name: name.to_owned(),
            config,
            links: Vec::new(),
        }
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// What it is told that has no effect.
    pub(crate) fn remarks(&self) -> Vec<String> {
        let name = &self.name;
        if self.links.is_empty() {
            return vec![format!("radios.{name}: no link goes through it")];
        }
        let remarks = self.config.remarks().into_iter();
        remarks
            .map(|remark| format!("radios.{name}.{remark}"))
            .collect()
    }

    pub(crate) fn join(
        &mut self,
        name: &str,
        (from, to): (HostId, HostId),
        timeline: Arc<Timeline>,
        changes: Vec<(SimTime, LinkChange)>,
    ) {
        self.links.push(Joined {
            name: name.to_owned(),
            from,
            to,
            timeline,
            changes,
        });
    }

    /// Declares the radio and its routes. `hosts` has the names of hosts and where they stand.
    ///
    /// # Errors
    /// With what is missing: the place of a host, if the radio must know places, or the ground, if
    /// it must look over it.
    pub(crate) fn declare(
        self,
        sim: &mut Simulation,
        hosts: &BTreeMap<HostId, String>,
        places_m: &BTreeMap<String, Point3<f64>>,
        terrain: Option<Arc<HeightField>>,
    ) -> Result<(), String> {
        if self.links.is_empty() {
            return Ok(());
        }
        let needs_places = self.config.needs_places();
        if self.config.access != Access::FullDuplex
            && let Some(link) = self.links.iter().find(|link| !link.timeline.takes_time())
        {
            return Err(format!(
                "its channel is shared, and link {:?} has no rate: expected one, for without \
                 transmissions take no time and never meet",
                link.name
            ));
        }
        if self.config.line_of_sight && terrain.is_none() {
            return Err(
                "line_of_sight: expected a world with terrain, such as a built-in crater"
                    .to_owned(),
            );
        }
        let mut radio = Radio::new(self.config, terrain);
        let mut stations: Vec<HostId> = self.links.iter().flat_map(|l| [l.from, l.to]).collect();
        stations.sort_unstable();
        stations.dedup();
        for host in stations {
            let name = hosts.get(&host).map_or("", String::as_str);
            let place_m = match places_m.get(name) {
                Some(place_m) => *place_m,
                None if needs_places => {
                    return Err(format!(
                        "it asks where stations are, and {name:?} has no place: expected one in \
                         [places]"
                    ));
                }
                None => Point3::origin(),
            };
            radio.station(host.index(), name, place_m);
        }
        for link in &self.links {
            let (from, to) = (link.from.index(), link.to.index());
            radio.link(&link.name, from, to, link.timeline.clone());
        }
        let id = sim.shared_link(&self.name, radio);
        for link in self.links {
            sim.route(link.from, link.to, id);
            for (at, change) in link.changes {
                let name = link.name.clone();
                sim.change_at(at, id, RadioChange::Link { name, change });
            }
        }
        Ok(())
    }
}
