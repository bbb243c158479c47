//! A roadmap that nodes are given over the network: one knows it and passes it on in parts, over
//! the same lines as requests, each node to its neighbours. Who does not know all of it takes no
//! part.

use std::collections::BTreeMap;

use farside_worlds::{NodeId, Roadmap, SensorNetwork, VertexId};

use super::messages::{Item, MapVertex, RoadmapPart};
use super::registry::{Desk, Registry};

/// Vertices in a part: a part is then a message of some hundred bytes.
const PART: usize = 16;

/// What a node knows of the roadmap, durably.
#[derive(Debug, Default)]
pub(crate) struct Atlas {
    /// By number.
    parts: BTreeMap<u32, RoadmapPart>,
    complete: bool,
    /// Steps of requests that came before the roadmap was known, and for which region.
    held: Vec<(NodeId, Item)>,
    /// The first part that was wrong.
    wrong: Option<String>,
}

impl RoadmapPart {
    /// Into how many parts a roadmap is divided.
    fn count(roadmap: &Roadmap) -> u32 {
        roadmap.len().div_ceil(PART) as u32
    }

    /// A part: its vertices, and the edges whose lower end is one of them.
    fn of(roadmap: &Roadmap, sensors: &SensorNetwork, part: u32) -> RoadmapPart {
        let all = roadmap.vertices().skip(part as usize * PART).take(PART);
        let vertices: Vec<MapVertex> = all
            .map(|vertex| {
                let at = roadmap.position_m(vertex);
                MapVertex {
                    vertex,
                    position_m: [at.x, at.y, roadmap.height_m(vertex)],
                    is_boundary: roadmap.boundary().contains(&vertex),
                    owner: sensors.owner(vertex),
                }
            })
            .collect();
        let edges = vertices.iter().flat_map(|here| {
            let higher = |v: &&VertexId| **v > here.vertex;
            let ends = roadmap.neighbors(here.vertex).iter().filter(higher);
            ends.map(|&v| (here.vertex, v))
        });
        RoadmapPart {
            part,
            parts: Self::count(roadmap),
            edges: edges.collect(),
            vertices,
        }
    }
}

impl Atlas {
    /// Takes in a part. True if it was new.
    ///
    /// # Errors
    /// When it is not what the roadmap has there.
    fn learn(
        &mut self,
        part: &RoadmapPart,
        roadmap: &Roadmap,
        sensors: &SensorNetwork,
    ) -> Result<bool, String> {
        let is_one = part.part < RoadmapPart::count(roadmap);
        if !is_one || *part != RoadmapPart::of(roadmap, sensors, part.part) {
            return Err(format!(
                "part {} of {} of the roadmap is not as it should be",
                part.part, part.parts
            ));
        }
        let is_new = self.parts.insert(part.part, part.clone()).is_none();
        self.complete = self.parts.len() == part.parts as usize;
        Ok(is_new)
    }
}

impl Atlas {
    /// Whether the node may take part: it knows the roadmap, or need not be given it.
    pub(crate) fn is_known(&self, source: Option<NodeId>) -> bool {
        source.is_none() || self.complete
    }

    /// What was wrong with what the node was given, if anything was.
    pub(crate) fn wrong(&self) -> Option<&str> {
        self.wrong.as_deref()
    }

    /// The node that knows the roadmap from the start tells its neighbours.
    pub(crate) fn publish(&mut self, registry: &mut Registry, desk: &Desk<'_>) {
        if desk.site.roadmap_from != Some(desk.region) || !self.parts.is_empty() {
            return;
        }
        let (roadmap, sensors) = (&desk.site.roadmap, &desk.site.sensors);
        for part in 0..RoadmapPart::count(roadmap) {
            let part = RoadmapPart::of(roadmap, sensors, part);
            self.take_in(registry, desk, desk.region, part);
        }
    }

    /// Tells the neighbours of a region that was taken over, which may have missed parts.
    pub(crate) fn share(&self, registry: &mut Registry, desk: &Desk<'_>) {
        for part in self.parts.values() {
            for &to in desk.site.sensors.neighbors(desk.region) {
                registry.post(to, Item::Roadmap(part.clone()));
            }
        }
    }

    /// Takes an item that came from a neighbour of `desk`'s region. Returns it if it is the step of
    /// a request and the roadmap is known; keeps it until then.
    pub(crate) fn receive(
        &mut self,
        registry: &mut Registry,
        desk: &Desk<'_>,
        from: NodeId,
        item: Item,
    ) -> Option<Item> {
        match item {
            Item::Roadmap(part) => {
                self.take_in(registry, desk, from, part);
                None
            }
            item if self.is_known(desk.site.roadmap_from) => Some(item),
            item => {
                self.held.push((desk.region, item));
                None
            }
        }
    }

    /// What was held, once the roadmap is known.
    pub(crate) fn release(&mut self) -> Vec<(NodeId, Item)> {
        match self.complete {
            true => std::mem::take(&mut self.held),
            false => Vec::new(),
        }
    }

    /// A part has come: it goes on to all other neighbours, if it is new.
    fn take_in(
        &mut self,
        registry: &mut Registry,
        desk: &Desk<'_>,
        from: NodeId,
        part: RoadmapPart,
    ) {
        let (roadmap, sensors) = (&desk.site.roadmap, &desk.site.sensors);
        match self.learn(&part, roadmap, sensors) {
            Err(wrong) => self.wrong = Some(wrong),
            Ok(false) => {}
            Ok(true) => {
                let others = sensors.neighbors(desk.region).iter();
                for &to in others.filter(|&&to| to != from) {
                    registry.post(to, Item::Roadmap(part.clone()));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::grid;

    fn world() -> (Roadmap, SensorNetwork) {
        let map = grid(7, 5, &[(8, 9)]);
        let sensors = SensorNetwork::place(&map, 5, 60.0, 1).unwrap();
        (map, sensors)
    }

    #[test]
    fn the_parts_are_the_roadmap() {
        let (map, sensors) = world();
        let parts: Vec<_> = (0..RoadmapPart::count(&map))
            .map(|part| RoadmapPart::of(&map, &sensors, part))
            .collect();
        assert_eq!(parts.len(), 3);
        let mut edges: Vec<_> = parts.iter().flat_map(|p| p.edges.clone()).collect();
        edges.sort_unstable();
        assert_eq!(edges, map.edges());
        let vertices = parts.iter().flat_map(|p| &p.vertices);
        assert!(vertices.map(|v| v.vertex).eq(map.vertices()));
        let mut atlas = Atlas::default();
        for (i, part) in parts.iter().enumerate() {
            assert!(!atlas.complete);
            assert_eq!(atlas.learn(part, &map, &sensors), Ok(true));
            assert_eq!(atlas.learn(part, &map, &sensors), Ok(false));
            assert_eq!(atlas.complete, i == 2);
        }
    }

    #[test]
    fn a_wrong_part_is_refused() {
        let (map, sensors) = world();
        let good = RoadmapPart::of(&map, &sensors, 1);
        let wrong = |change: &dyn Fn(&mut RoadmapPart)| {
            let mut part = good.clone();
            change(&mut part);
            Atlas::default().learn(&part, &map, &sensors).is_err()
        };
        assert!(!wrong(&|_| {}));
        assert!(wrong(&|part| part.part = 2));
        assert!(wrong(&|part| part.part = 3));
        assert!(wrong(&|part| part.parts = 2));
        assert!(wrong(&|part| part.vertices[3].position_m[0] += 0.01));
        assert!(wrong(&|part| part.vertices[0].owner = NodeId(99)));
        assert!(wrong(&|part| part.edges.truncate(3)));
    }
}
