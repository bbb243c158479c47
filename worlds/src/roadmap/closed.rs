//! A roadmap of which some vertices are closed.

use std::sync::Arc;

use super::Roadmap;
use super::distances::{Distances, NO_WAY};
use crate::ids::VertexId;

impl Roadmap {
    /// What [`Roadmap::distance`] says of two vertices between which no path leads.
    pub const UNREACHABLE: u32 = NO_WAY as u32;

    /// The same roadmap with these vertices closed: no edge leads to one. All vertices, numbers and
    /// the boundary stay; the rest may fall apart.
    ///
    /// ```
    /// use farside_worlds::{Roadmap, VertexId as V};
    /// let text = "name = 'bend'\nboundary = [0, 2]\n\
    ///             positions_m = [[0, 0], [5, 0], [9, 0], [5, 5]]\n\
    ///             edges = [[0, 1], [1, 2], [0, 3], [2, 3]]";
    /// let map = Roadmap::from_toml(text)?;
    /// assert_eq!(map.without(&[V(1)]).shortest_path(V(0), V(2)), [V(0), V(3), V(2)]);
    /// let apart = map.without(&[V(1), V(3)]);
    /// assert_eq!(apart.distance(V(0), V(2)), Roadmap::UNREACHABLE);
    /// assert!(map.is_reachable(V(0), V(2)) && !apart.is_reachable(V(0), V(2)));
    /// # Ok::<(), farside_worlds::WorldError>(())
    /// ```
    ///
    /// # Panics
    /// When one of them is not in the roadmap.
    #[must_use]
    pub fn without(&self, closed: &[VertexId]) -> Roadmap {
        let mut map = self.clone();
        let mut is_closed = vec![false; map.len()];
        for v in closed {
            is_closed[v.0 as usize] = true;
        }
        let is_open = |v: &VertexId| !is_closed[v.0 as usize];
        map.edges.retain(|(u, v)| is_open(u) && is_open(v));
        for (u, list) in map.neighbors.iter_mut().enumerate() {
            list.retain(|v| !is_closed[u] && is_open(v));
        }
        map.distances = Arc::new(Distances::of(&map.neighbors));
        map
    }

    /// Whether a path leads from `u` to `v`.
    pub fn is_reachable(&self, u: VertexId, v: VertexId) -> bool {
        self.distance(u, v) != Roadmap::UNREACHABLE
    }
}
