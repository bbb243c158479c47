//! What can be wrong with a world that a user described, with what was expected and what was found.

use crate::ids::{NodeId, VertexId};

/// Why a world cannot be read or built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WorldError {
    /// No world of this name is built in.
    #[error("there is no roadmap {name:?} built in; did you mean {nearest:?}?")]
    UnknownRoadmap {
        /// The name asked for.
        name: String,
        /// The built-in name closest to it in spelling.
        nearest: &'static str,
    },
    /// A file is larger than any world this reader takes.
    #[error("the file has {actual_bytes} bytes; at most {limit_bytes} are read")]
    TooLarge {
        /// The most bytes that are read.
        limit_bytes: usize,
        /// The file's size.
        actual_bytes: usize,
    },
    /// The text is not TOML of the expected shape; the message names line and column.
    #[error("not a roadmap: {message}")]
    Toml {
        /// What the TOML reader found and expected.
        message: String,
    },
    /// The file is TOML, but what it describes is no roadmap.
    #[error("the file describes no roadmap: {0}")]
    Roadmap(#[from] RoadmapError),
    /// A generator was asked for what cannot be.
    #[error("no such terrain: {0}")]
    Terrain(#[from] TerrainError),
    /// The generator's terrain leaves no room for the roadmap asked for.
    #[error(
        "the terrain has no room for a roadmap of {vertices} vertices and {edges} edges: {reason}"
    )]
    NoRoom {
        /// The vertices asked for.
        vertices: usize,
        /// The edges asked for.
        edges: usize,
        /// What there was no room for.
        reason: &'static str,
    },
}

/// Why terrain cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TerrainError {
    /// The samples do not form a grid.
    #[error(
        "a height field has 2 or more full rows of 2 or more columns; {samples} samples in {columns} columns are none"
    )]
    Shape {
        /// The columns asked for.
        columns: usize,
        /// The samples found.
        samples: usize,
    },
    /// There are more samples than a height field may have.
    #[error("a height field may have {limit} samples; this one has {actual}")]
    TooManySamples {
        /// The most samples.
        limit: usize,
        /// The samples asked for.
        actual: usize,
    },
    /// The resolution is not a positive finite number.
    #[error("the resolution must be a positive number of metres; it is {actual_m}")]
    Resolution {
        /// The resolution found \[m\].
        actual_m: f64,
    },
    /// The origin is not finite.
    #[error("the origin must be finite; it is ({x_m} m, {y_m} m)")]
    Origin {
        /// Its x \[m\].
        x_m: f64,
        /// Its y \[m\].
        y_m: f64,
    },
    /// A height is not finite.
    #[error("the height in column {column}, row {row} must be finite; it is {height_m} m")]
    Height {
        /// The sample's column, from the west.
        column: usize,
        /// The sample's row, from the south.
        row: usize,
        /// The height found \[m\].
        height_m: f64,
    },
    /// A setting of the crater is out of its range.
    #[error("{setting} must be over {above} and at most {limit}; it is {actual}")]
    Setting {
        /// The setting's name, with its unit.
        setting: &'static str,
        /// What it must be over.
        above: f64,
        /// The largest value it may have.
        limit: f64,
        /// The value found.
        actual: f64,
    },
    /// The share of ground covered by rocks is out of range.
    #[error("rocks must cover over 0 and at most 1 of the ground; they are to cover {actual}")]
    RockAbundance {
        /// The share found.
        actual: f64,
    },
    /// The least diameter of the rocks to draw is out of range.
    #[error("the smallest rocks must be of 0.01 m to {limit_m} m; they are of {actual_m} m")]
    RockDiameter {
        /// The diameter found \[m\].
        actual_m: f64,
        /// The largest rock there is \[m\].
        limit_m: f64,
    },
    /// More rocks would be drawn than a field may hold.
    #[error("a rock field may hold {limit} rocks; this one would hold about {expected}")]
    TooManyRocks {
        /// The most rocks.
        limit: f64,
        /// The rocks to be expected.
        expected: f64,
    },
}

/// Why a graph is no roadmap.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RoadmapError {
    /// It has no vertices.
    #[error("a roadmap needs at least one vertex; this one has none")]
    Empty,
    /// It has more vertices than a roadmap may have.
    #[error("a roadmap may have {limit} vertices; this one has {actual}")]
    TooManyVertices {
        /// The most vertices a roadmap may have.
        limit: usize,
        /// The vertices found.
        actual: usize,
    },
    /// Two vertices may be farther apart than distances can tell.
    #[error(
        "two vertices of a roadmap may be {limit} edges apart; some of this one's may be farther"
    )]
    TooLong {
        /// The largest distance.
        limit: u16,
    },
    /// It has more edges than a planar graph on its vertices can have.
    #[error(
        "a planar graph on {vertices} vertices has at most {limit} edges; this one has {actual}"
    )]
    TooManyEdges {
        /// The vertices found.
        vertices: usize,
        /// The most edges that fit.
        limit: usize,
        /// The edges found.
        actual: usize,
    },
    /// A list beside the vertices has another length than theirs.
    #[error("there are {vertices} vertices and {actual} heights; there must be one for each")]
    HeightCount {
        /// The vertices found.
        vertices: usize,
        /// The heights found.
        actual: usize,
    },
    /// A position or height is not a finite number within the limit.
    #[error("vertex {} lies at ({x_m} m, {y_m} m); coordinates must be within +-{limit_m} m", vertex.0)]
    Position {
        /// The vertex.
        vertex: VertexId,
        /// Its x \[m\].
        x_m: f64,
        /// Its y \[m\].
        y_m: f64,
        /// The largest magnitude of a coordinate \[m\].
        limit_m: f64,
    },
    /// A height is not a finite number within the limit.
    #[error("vertex {} has height {height_m} m; heights must be within +-{limit_m} m", vertex.0)]
    Height {
        /// The vertex.
        vertex: VertexId,
        /// Its height \[m\].
        height_m: f64,
        /// The largest magnitude of a height \[m\].
        limit_m: f64,
    },
    /// Two vertices lie at the same place.
    #[error("vertices {} and {} lie at the same place", first.0, second.0)]
    Coincident {
        /// One of them.
        first: VertexId,
        /// The other.
        second: VertexId,
    },
    /// An edge or the boundary names a vertex that is not there.
    #[error("{place} names vertex {}; the roadmap has vertices 0 to {}", vertex.0, vertices - 1)]
    UnknownVertex {
        /// Where it is named: `edges` or `boundary`.
        place: &'static str,
        /// The vertex named.
        vertex: VertexId,
        /// How many vertices there are.
        vertices: usize,
    },
    /// An edge joins a vertex to itself.
    #[error("an edge joins vertex {} to itself", vertex.0)]
    SelfLoop {
        /// The vertex.
        vertex: VertexId,
    },
    /// An edge is given twice.
    #[error("the edge {} - {} is given twice", edge.0.0, edge.1.0)]
    DuplicateEdge {
        /// The edge.
        edge: (VertexId, VertexId),
    },
    /// Two edges meet elsewhere than at a common end.
    #[error(
        "the edges {} - {} and {} - {} cross; a roadmap must be embedded in the plane",
        first.0.0, first.1.0, second.0.0, second.1.0
    )]
    Crossing {
        /// One of them.
        first: (VertexId, VertexId),
        /// The other.
        second: (VertexId, VertexId),
    },
    /// It falls apart.
    #[error("a roadmap must be connected; vertex {} cannot be reached from vertex 0", unreachable.0)]
    Disconnected {
        /// The lowest vertex that cannot be reached from vertex 0.
        unreachable: VertexId,
    },
    /// It has no boundary, so that no rover could enter or leave.
    #[error("the boundary is empty; at least one vertex must be an entry or exit")]
    EmptyBoundary,
    /// A boundary vertex is given twice.
    #[error("the boundary names vertex {} twice", vertex.0)]
    DuplicateBoundary {
        /// The vertex.
        vertex: VertexId,
    },
}

/// Why a sensor network cannot stand over a roadmap.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SensorError {
    /// It has no nodes, or more than there are vertices to own.
    #[error(
        "a network over {vertices} vertices has 1 to {vertices} nodes; {actual} were asked for"
    )]
    NodeCount {
        /// The vertices of the roadmap.
        vertices: usize,
        /// The nodes asked for.
        actual: usize,
    },
    /// The radio radius is not a positive finite number.
    #[error("the radio radius must be a positive number of metres; it is {actual_m}")]
    Radius {
        /// The radius found \[m\].
        actual_m: f64,
    },
    /// How far nodes reach rovers is not a positive finite number.
    #[error("the coverage must be a positive number of metres; it is {actual_m}")]
    Coverage {
        /// The coverage found \[m\].
        actual_m: f64,
    },
    /// A node's position is not a finite number within the limit.
    #[error("node {} lies at ({x_m} m, {y_m} m); coordinates must be within +-{limit_m} m", node.0)]
    Position {
        /// The node.
        node: NodeId,
        /// Its x \[m\].
        x_m: f64,
        /// Its y \[m\].
        y_m: f64,
        /// The largest magnitude of a coordinate \[m\].
        limit_m: f64,
    },
    /// A node is nearest to no vertex.
    #[error("node {} is the nearest to no vertex; every node must own at least one", node.0)]
    Idle {
        /// The lowest such node.
        node: NodeId,
    },
    /// Vertices are out of radio range of the node that owns them, which is their nearest.
    #[error(
        "with a radius of {radius_m} m no node covers {} vertices: {}", vertices.len(),
        names(vertices)
    )]
    Uncovered {
        /// All such vertices, sorted.
        vertices: Vec<VertexId>,
        /// How far nodes reach: the radio radius, or the coverage \[m\].
        radius_m: f64,
    },
    /// Owners of the ends of an edge are out of each other's radio range, so that no rover could be
    /// handed over along it.
    #[error(
        "with a radius of {radius_m} m the owners of the ends of {} edges are neither the same node \
         nor radio neighbours: {}", edges.len(), list(edges)
    )]
    InconsistentEdges {
        /// All such edges, in the roadmap's order.
        edges: Vec<(VertexId, VertexId)>,
        /// The radio radius \[m\].
        radius_m: f64,
    },
    /// The search for a random placement found none.
    #[error(
        "no placement of {nodes} nodes with a radius of {radius_m} m was found in {attempts} \
         attempts{}; the last one: {last}", advice(*radius_m, *coverage_m, *suggested_m)
    )]
    NoPlacement {
        /// The nodes asked for.
        nodes: usize,
        /// The radio radius \[m\].
        radius_m: f64,
        /// How far they were to reach rovers \[m\].
        coverage_m: f64,
        /// The placements tried.
        attempts: usize,
        /// What was wrong with the last one.
        last: Box<SensorError>,
        /// A radius that usually works \[m\].
        suggested_m: f64,
    },
}

/// `3 - 4, 7 - 9`.
fn list(edges: &[(VertexId, VertexId)]) -> String {
    let texts: Vec<String> = edges
        .iter()
        .map(|(u, v)| format!("{} - {}", u.0, v.0))
        .collect();
    texts.join(", ")
}

/// What to do about a placement that was not found.
fn advice(radius_m: f64, coverage_m: f64, suggested_m: f64) -> String {
    if coverage_m < radius_m {
        " (a coverage nearer to the radius usually does)".to_owned()
    } else if radius_m < suggested_m {
        format!(" (a radius of {suggested_m} m usually does)")
    } else {
        " (fewer nodes usually do)".to_owned()
    }
}

/// `3, 7`.
fn names(vertices: &[VertexId]) -> String {
    let texts: Vec<String> = vertices.iter().map(|v| v.0.to_string()).collect();
    texts.join(", ")
}

/// A figure of the sky that is outside its range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{name} must be within {least} and {most}; it is {actual}")]
pub struct SkyError {
    /// Which figure, with its unit.
    pub name: &'static str,
    /// What it is.
    pub actual: f64,
    /// The least that it can be.
    pub least: f64,
    /// The most that it can be.
    pub most: f64,
}
