//! The registries of all regions that a node answers for.

use farside_worlds::NodeId;

use super::registry::Registry;

/// The registries of all regions that a node answers for, ascending; durable.
#[derive(Debug, Default)]
pub(crate) struct Registries {
    pub(crate) all: Vec<(NodeId, Registry)>,
}

impl Registries {
    pub(crate) fn find(&mut self, region: NodeId) -> Option<&mut Registry> {
        let found = self.all.iter_mut().find(|(id, _)| *id == region);
        found.map(|(_, registry)| registry)
    }

    /// This node does not answer for `region` any more.
    pub(crate) fn remove(&mut self, region: NodeId) {
        self.all.retain(|(id, _)| *id != region);
    }

    pub(crate) fn insert(&mut self, region: NodeId, registry: Registry) {
        let at = self.all.partition_point(|(id, _)| *id < region);
        self.all.insert(at, (region, registry));
    }
}
