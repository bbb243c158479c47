//! Which boundary vertices are entries and which are exits.

use serde::{Deserialize, Serialize};

use super::Roadmap;
use crate::ids::VertexId;

/// How the boundary is divided into entries and exits. The paper places "constraints on the
/// selection of these points so that vehicle interactions are likely" (*network-guided*,
/// section 4) and does not state them.
///
/// ```
/// use farside_worlds::{Endpoints, Roadmap};
/// let map = Roadmap::builtin("crater-dense")?;
/// let (entries, exits) = Endpoints::Alternating.split(&map);
/// assert!(entries.iter().all(|entry| !exits.contains(entry)));
/// assert_eq!(entries.len() + exits.len(), map.boundary().len());
/// # Ok::<(), farside_worlds::WorldError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Endpoints {
    /// Entry, exit, entry, exit, ... round the rim: disjoint, and every rover meets others.
    #[default]
    Alternating,
    /// Every boundary vertex is both. Rovers that leave meet rovers that enter.
    AnyToAny,
    /// The western half of the boundary vertices are entries, the eastern half exits.
    WestToEast,
}

impl Endpoints {
    /// The entries and the exits, each in the boundary's order round the rim. A boundary of one
    /// vertex has no exit, unless it is both.
    pub fn split(&self, roadmap: &Roadmap) -> (Vec<VertexId>, Vec<VertexId>) {
        let boundary = roadmap.boundary();
        match self {
            Endpoints::Alternating => (
                boundary.iter().copied().step_by(2).collect(),
                boundary.iter().copied().skip(1).step_by(2).collect(),
            ),
            Endpoints::AnyToAny => (boundary.to_vec(), boundary.to_vec()),
            Endpoints::WestToEast => {
                let x_m = |v: VertexId| roadmap.position_m(v).x;
                let mut by_x = boundary.to_vec();
                by_x.sort_by(|&a, &b| x_m(a).total_cmp(&x_m(b)).then(a.cmp(&b)));
                let west = &by_x[..boundary.len().div_ceil(2)];
                boundary.iter().copied().partition(|v| west.contains(v))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_and_exits_alternate() {
        for name in Roadmap::builtin_names() {
            let map = Roadmap::builtin(name).unwrap();
            let (entries, exits) = Endpoints::default().split(&map);
            let zipped: Vec<VertexId> = entries
                .iter()
                .zip(&exits)
                .flat_map(|(&a, &b)| [a, b])
                .collect();
            assert_eq!(zipped, map.boundary()[..zipped.len()]);
            assert!(entries.len() - exits.len() <= 1);
        }
    }

    #[test]
    fn west_lies_west_of_east() {
        let map = Roadmap::builtin("crater-sparse").unwrap();
        let (west, east) = Endpoints::WestToEast.split(&map);
        let x_m = |v: &VertexId| map.position_m(*v).x;
        assert!(west.iter().all(|w| east.iter().all(|e| x_m(w) <= x_m(e))));
        assert_eq!(west.len() + east.len(), map.boundary().len());
    }

    #[test]
    fn any_to_any_is_the_whole_boundary_twice() {
        let map = Roadmap::builtin("crater-sparse").unwrap();
        let (entries, exits) = Endpoints::AnyToAny.split(&map);
        assert_eq!((&entries[..], &exits[..]), (map.boundary(), map.boundary()));
    }
}
