//! How far it is from vertex to vertex. Small roadmaps have a table of all pairs; of large ones,
//! for which that would take gigabytes, a vertex gets its **field** of distances when it is first
//! asked about: a team asks about its goals, again and again, and about little else.

use std::collections::VecDeque;
use std::fmt;
use std::sync::{Arc, OnceLock, PoisonError, RwLock};

use crate::error::RoadmapError;
use crate::ids::VertexId;

/// The most vertices for which there is a table: two bytes for each pair then take 32 MiB.
const TABLE_VERTICES: usize = 4096;

/// The memory that fields may take \[B\]: those of 1,300 goals on a map of 100,000 cells. Beyond
/// that the oldest is given up for each new one.
const FIELDS_BYTES: usize = 256 << 20;

/// Marks a pair without a way.
pub(super) const NO_WAY: u16 = u16::MAX;

/// The largest distance that two bytes hold beside that.
const FARTHEST: u16 = NO_WAY - 1;

/// Distances in hops over one connected graph. All follow from the graph.
pub(super) enum Distances {
    /// Of all pairs, row by row.
    Table { hops: Vec<u16>, diameter: u32 },
    /// Of the vertices asked about.
    Fields(Fields),
}

/// Fields made on demand.
pub(super) struct Fields {
    known: RwLock<KnownField>,
    /// How many fields are kept.
    most: usize,
    diameter: OnceLock<u32>,
}

#[derive(Default)]
struct KnownField {
    /// By vertex.
    fields: Vec<Option<Arc<[u16]>>>,
    /// The vertices that have one, the oldest first.
    order: VecDeque<VertexId>,
}

impl Distances {
    /// # Errors
    /// When the graph falls apart, or some vertices may be farther apart than can be told.
    pub(super) fn new(neighbors: &[Vec<VertexId>]) -> Result<Distances, RoadmapError> {
        let n = neighbors.len();
        let reached = field(neighbors, VertexId(0));
        if let Some(unreachable) = reached.iter().position(|&hops| hops == NO_WAY) {
            // On so long a line that its far end seems not to be reached, it is not.
            let far = reached.contains(&FARTHEST);
            let unreachable = VertexId(unreachable as u32);
            return Err(match far {
                true => RoadmapError::TooLong { limit: FARTHEST },
                false => RoadmapError::Disconnected { unreachable },
            });
        }
        // Over the first vertex no two are farther apart than twice the farthest from there.
        let farthest = farthest(&reached);
        if n - 1 > usize::from(FARTHEST) && farthest > FARTHEST / 2 {
            return Err(RoadmapError::TooLong { limit: FARTHEST });
        }
        Ok(Distances::of(neighbors))
    }

    /// The same of a graph that may fall apart.
    pub(super) fn of(neighbors: &[Vec<VertexId>]) -> Distances {
        let n = neighbors.len();
        if n > TABLE_VERTICES {
            return Distances::Fields(Fields::new(n, FIELDS_BYTES));
        }
        let mut hops = vec![NO_WAY; n * n];
        let mut queue = VecDeque::new();
        for (source, row) in (0..).map(VertexId).zip(hops.chunks_exact_mut(n)) {
            fill(neighbors, source, row, &mut queue);
        }
        let diameter = u32::from(farthest(&hops));
        Distances::Table { hops, diameter }
    }

    /// Between two vertices.
    pub(super) fn between(&self, neighbors: &[Vec<VertexId>], u: VertexId, v: VertexId) -> u32 {
        match self {
            Distances::Table { hops, .. } => {
                u32::from(hops[u.0 as usize * neighbors.len() + v.0 as usize])
            }
            Distances::Fields(fields) => {
                // The same both ways: a field of either end will do.
                let known = fields.known(v).map(|field| (field, u));
                let known = known.or_else(|| fields.known(u).map(|field| (field, v)));
                let (field, other) = known.unwrap_or_else(|| (fields.of(neighbors, v), u));
                u32::from(field[other.0 as usize])
            }
        }
    }

    /// To one vertex from all others.
    pub(super) fn to(&self, neighbors: &[Vec<VertexId>], v: VertexId) -> DistancesTo<'_> {
        let (n, at) = (neighbors.len(), v.0 as usize);
        DistancesTo(match self {
            Distances::Table { hops, .. } => Row::Table(&hops[at * n..(at + 1) * n]),
            Distances::Fields(fields) => Row::Field(fields.of(neighbors, v)),
        })
    }

    pub(super) fn diameter(&self, neighbors: &[Vec<VertexId>]) -> u32 {
        match self {
            Distances::Table { diameter, .. } => *diameter,
            Distances::Fields(fields) => *fields.diameter.get_or_init(|| diameter(neighbors, ENDS)),
        }
    }
}

impl Fields {
    fn new(vertices: usize, bytes: usize) -> Fields {
        let fields = vec![None; vertices];
        Fields {
            known: RwLock::new(KnownField {
                fields,
                order: VecDeque::new(),
            }),
            // Two: whoever goes from one to the other asks about both.
            most: (bytes / (2 * vertices)).max(2),
            diameter: OnceLock::new(),
        }
    }

    fn known(&self, v: VertexId) -> Option<Arc<[u16]>> {
        let known = self.known.read().unwrap_or_else(PoisonError::into_inner);
        known.fields[v.0 as usize].clone()
    }

    fn of(&self, neighbors: &[Vec<VertexId>], v: VertexId) -> Arc<[u16]> {
        if let Some(field) = self.known(v) {
            return field;
        }
        // Others may go on meanwhile; if two make the same, one is kept.
        let new: Arc<[u16]> = field(neighbors, v).into();
        let mut known = self.known.write().unwrap_or_else(PoisonError::into_inner);
        let known = &mut *known;
        if let Some(field) = &known.fields[v.0 as usize] {
            return field.clone();
        }
        if known.order.len() >= self.most
            && let Some(oldest) = known.order.pop_front()
        {
            known.fields[oldest.0 as usize] = None;
        }
        known.order.push_back(v);
        known.fields[v.0 as usize] = Some(new.clone());
        new
    }
}

// Equal graphs have equal distances, whoever has asked for which.
impl PartialEq for Distances {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for Distances {
    // Millions of distances help nobody.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Distances")
    }
}

/// The distances to one vertex: what searches towards a goal look up for every vertex they meet.
///
/// ```
/// use farside_worlds::{Roadmap, VertexId};
/// let map = Roadmap::builtin("crater-dense")?;
/// let left = map.distances_to(VertexId(7));
/// assert!(map.vertices().all(|v| left.from(v) == map.distance(v, VertexId(7))));
/// # Ok::<(), farside_worlds::WorldError>(())
/// ```
#[derive(Clone, Debug)]
pub struct DistancesTo<'a>(Row<'a>);

#[derive(Clone, Debug)]
enum Row<'a> {
    Table(&'a [u16]),
    Field(Arc<[u16]>),
}

impl DistancesTo<'_> {
    /// The fewest edges from `v`.
    ///
    /// # Panics
    /// When `v` is not in the roadmap: a bug in the caller.
    #[inline]
    pub fn from(&self, v: VertexId) -> u32 {
        let row = match &self.0 {
            Row::Table(row) => row,
            Row::Field(field) => &**field,
        };
        u32::from(row[v.0 as usize])
    }
}

/// Hops from `source` to all vertices; [`NO_WAY`] for those that cannot be reached or are too far.
fn field(neighbors: &[Vec<VertexId>], source: VertexId) -> Vec<u16> {
    let mut row = vec![NO_WAY; neighbors.len()];
    fill(neighbors, source, &mut row, &mut VecDeque::new());
    row
}

/// Fills a row of [`NO_WAY`] by a breadth-first search.
fn fill(
    neighbors: &[Vec<VertexId>],
    source: VertexId,
    row: &mut [u16],
    queue: &mut VecDeque<VertexId>,
) {
    row[source.0 as usize] = 0;
    queue.push_back(source);
    while let Some(u) = queue.pop_front() {
        let hops = row[u.0 as usize];
        if hops == FARTHEST {
            continue;
        }
        for &v in &neighbors[u.0 as usize] {
            if row[v.0 as usize] == NO_WAY {
                row[v.0 as usize] = hops + 1;
                queue.push_back(v);
            }
        }
    }
}

/// The largest distance of those that there are.
fn farthest(hops: &[u16]) -> u16 {
    let reached = hops.iter().copied().filter(|&hop| hop != NO_WAY);
    reached.max().unwrap_or(0)
}

/// How many far ends the middle is sought between.
const ENDS: usize = 8;

/// The largest distance of two vertices between which a way leads.
fn diameter(neighbors: &[Vec<VertexId>], ends: usize) -> u32 {
    let mut seen = vec![false; neighbors.len()];
    let mut longest = 0;
    for first in 0..neighbors.len() {
        if seen[first] || neighbors[first].is_empty() {
            continue;
        }
        let first = VertexId(first as u32);
        for (seen, hops) in seen.iter_mut().zip(field(neighbors, first)) {
            *seen |= hops != NO_WAY;
        }
        longest = longest.max(diameter_around(neighbors, first, ends));
    }
    u32::from(longest)
}

/// The largest distance in the part of a graph that `first` is in, by searches from the rim
/// inwards: two vertices that are both nearer to the middle than some depth are less than twice
/// that depth apart (Crescenzi et al., *On computing the diameter of real-world undirected graphs*,
/// TCS 514, 2013). The middle is sought between so many ends; the fewer, the more searches.
fn diameter_around(neighbors: &[Vec<VertexId>], first: VertexId, ends: usize) -> u16 {
    // The middle is the vertex least far from some ends, each of which is the farthest from the
    // middle of those before it.
    let n = neighbors.len();
    let mut middle = first;
    let mut least_far = vec![0; n];
    let mut longest = 0;
    for _ in 0..ends {
        let row = field(neighbors, middle);
        let reached = (0..).zip(&row).filter(|(_, hops)| **hops != NO_WAY);
        let end = reached.max_by_key(|&(at, hops)| (*hops, at));
        let end = VertexId(end.map_or(0, |(at, _)| at));
        let row = field(neighbors, end);
        for (far, hops) in least_far.iter_mut().zip(&row) {
            *far = (*far).max(*hops);
        }
        longest = longest.max(farthest(&row));
        let nearest = (0..).zip(&least_far).min_by_key(|&(at, far)| (*far, at));
        middle = VertexId(nearest.map_or(0, |(at, _)| at));
    }
    let depth = field(neighbors, middle);
    let mut inwards: Vec<usize> = (0..n).filter(|&v| depth[v] != NO_WAY).collect();
    inwards.sort_by_key(|&v| (NO_WAY - depth[v], v));
    for v in inwards {
        if u32::from(longest) >= 2 * u32::from(depth[v]) {
            break;
        }
        let row = field(neighbors, VertexId(v as u32));
        longest = longest.max(farthest(&row));
    }
    longest
}

#[cfg(test)]
mod tests {
    use farside::random::RandomKey;

    use super::*;

    /// A grid of so many columns with walls, of which one region is kept.
    fn graph(width: usize, height: usize, walls: f64, seed: u64) -> Vec<Vec<VertexId>> {
        let map = crate::movingai::GridMap::random(width as u32, height as u32, walls, seed);
        let world = crate::movingai::GridWorld::new("x.map", &map.unwrap(), 1.0, &[]).unwrap();
        let roadmap = world.roadmap();
        let all = roadmap.vertices();
        all.map(|v| roadmap.neighbors(v).to_vec()).collect()
    }

    fn fields_of(graph: &[Vec<VertexId>], most: usize) -> Distances {
        Distances::Fields(Fields::new(graph.len(), most * 2 * graph.len()))
    }

    #[test]
    fn fields_say_what_the_table_says() {
        for seed in 0..20 {
            let graph = graph(3 + seed as usize, 11, 0.25, seed);
            let table = Distances::new(&graph).unwrap();
            assert!(matches!(table, Distances::Table { .. }));
            // So few that they are given up again and again.
            let fields = fields_of(&graph, 3);
            assert_eq!(
                table.diameter(&graph),
                fields.diameter(&graph),
                "seed {seed}"
            );
            for ends in [0, 1, ENDS] {
                let found = diameter(&graph, ends);
                assert_eq!(found, table.diameter(&graph), "seed {seed}, {ends} ends");
            }
            let mut draws = RandomKey::new(seed).stream();
            let mut draw = || VertexId(draws.below(graph.len() as u64) as u32);
            for _ in 0..400 {
                let (u, v) = (draw(), draw());
                let expected = table.between(&graph, u, v);
                assert_eq!(fields.between(&graph, u, v), expected);
                assert_eq!(fields.to(&graph, v).from(u), expected);
                assert_eq!(table.to(&graph, v).from(u), expected);
            }
        }
    }

    #[test]
    fn no_more_fields_are_kept_than_there_is_room_for() {
        let graph = graph(9, 9, 0.0, 1);
        let distances = fields_of(&graph, 4);
        let Distances::Fields(fields) = &distances else {
            unreachable!("as made");
        };
        for v in (0..81).map(VertexId) {
            distances.between(&graph, VertexId(40), v);
            let known = fields.known.read().unwrap();
            let kept = known.fields.iter().flatten().count();
            assert!(kept <= 4 && kept == known.order.len(), "{kept}");
        }
    }

    fn line(vertices: usize) -> Vec<Vec<VertexId>> {
        let beside = |at: usize| {
            let before = at.checked_sub(1);
            let after = Some(at + 1).filter(|&next| next < vertices);
            let both = before.into_iter().chain(after);
            both.map(|v| VertexId(v as u32)).collect()
        };
        (0..vertices).map(beside).collect()
    }

    #[test]
    fn a_line_may_be_as_long_as_distances_can_tell() {
        let graph = line(65_535);
        let distances = Distances::new(&graph).unwrap();
        assert_eq!(distances.diameter(&graph), 65_534);
        let ends = (VertexId(65_534), VertexId(0));
        assert_eq!(distances.between(&graph, ends.0, ends.1), 65_534);
        let too_long = Err(RoadmapError::TooLong { limit: 65_534 });
        for more in [65_536, 70_000] {
            assert_eq!(Distances::new(&line(more)).map(|_| ()), too_long);
        }
    }
}
