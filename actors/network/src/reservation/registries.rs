//! The registries of all homes that a node answers for.

use farside_worlds::NodeId;

use super::registry::Registry;

/// The registries of all homes that a node answers for, ascending; durable.
#[derive(Debug, Default)]
pub(crate) struct Registries {
    pub(crate) all: Vec<(NodeId, Registry)>,
}

impl Registries {
    pub(crate) fn find(&mut self, home: NodeId) -> Option<&mut Registry> {
        let found = self.all.iter_mut().find(|(id, _)| *id == home);
        found.map(|(_, registry)| registry)
    }

    /// This node does not answer for `home` any more.
    pub(crate) fn remove(&mut self, home: NodeId) {
        self.all.retain(|(id, _)| *id != home);
    }

    pub(crate) fn insert(&mut self, home: NodeId, registry: Registry) {
        let at = self.all.partition_point(|(id, _)| *id < home);
        self.all.insert(at, (home, registry));
    }
}
