//! The keys of a scenario's `[world]` table.

use std::fmt;

use farside_actors::system::settings::one_of;
use farside_actors::{settings, units};
use farside_worlds::{
    Endpoints, Ownership, Roadmap, RoadmapError, RoadmapTable, SensorError, SensorNetwork,
};
use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

settings! {
    /// The `[world]` table: where rovers drive, the roadmap and the sensor nodes over it.
    ///
    /// ```
    /// use farside_network::WorldConfig;
    /// let world = WorldConfig::default();
    /// assert_eq!((world.roadmap.name(), world.nodes), ("crater-dense", 28));
    /// ```
    pub struct WorldConfig {
        /// A built-in roadmap's name (`crater-dense`, `crater-sparse`, `rubble-32-32-10`), the path
        /// of a TOML file or of a MovingAI `.map`, or the roadmap itself.
        pub roadmap: RoadmapSource = "crater-dense".into();
        /// How long the side of a cell of a MovingAI map is, in metres.
        pub cell_m as "cell": f64
            [with = "units::length_m"] = 10.0;
        /// A MovingAI `.scen` file with the starts and goals of rovers that stand on the map from
        /// the start and stay at their goals. A built-in map of cells has its own.
        pub tasks: Option<String>
            [skip_serializing_if = "Option::is_none"];
        /// How many sensor nodes.
        pub nodes: u32 = 28,
            1..=10_000;
        /// The radio radius of each, in metres; by default one that nearly every placement can do
        /// with.
        pub radius_m as "radius": Option<f64>
            [with = "units::length_m::option", skip_serializing_if = "Option::is_none"];
        /// How far each node reaches rovers, in metres; by default as far as nodes.
        pub coverage_m as "coverage": Option<f64>
            [with = "units::length_m::option", skip_serializing_if = "Option::is_none"];
        /// What becomes of vertices out of the coverage of their owners. By default there must be
        /// none, and nodes are placed so; else they are placed as if coverage were the radius.
        pub gaps: Gaps
            [skip_serializing_if = "Gaps::is_refuse"],
            one_of(&["refuse", "close", "cross"]);
        /// Which boundary vertices are entries, and which exits.
        pub endpoints: Endpoints;
        /// Who owns which vertices: the `nearest` node, as in the paper; `balanced`, as equally
        /// many for each as radio range allows; or `traffic`, as much traffic for each.
        pub ownership: Ownership;
        /// The seed of the nodes' places; by default the run's seed.
        pub placement_seed: Option<u64>
            [skip_serializing_if = "Option::is_none"];
    }
}

/// What becomes of vertices at which no node reaches a rover.
#[derive(Deserialize, Serialize, Clone, Copy, Debug, PartialEq, Eq, Default)]
#[serde(rename_all = "snake_case")]
pub enum Gaps {
    /// There must be none.
    #[default]
    Refuse,
    /// They are closed: nothing leads there.
    Close,
    /// Rovers cross them out of everybody's hearing (the `complete` policy only).
    Cross,
}

impl Gaps {
    fn is_refuse(&self) -> bool {
        *self == Gaps::Refuse
    }
}

/// Where a roadmap comes from.
///
/// ```
/// use farside_network::WorldConfig;
/// let world: WorldConfig = toml::from_str(
///     "roadmap = { boundary = [0, 1], positions_m = [[0, 0], [9, 0]], edges = [[0, 1]] }",
/// )?;
/// assert_eq!(world.roadmap.name(), "inline");
/// assert_eq!(world.roadmap.table().unwrap()?.len(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Serialize, Clone, Debug, PartialEq)]
#[serde(untagged)]
pub enum RoadmapSource {
    /// A built-in roadmap's name, or the path of a file.
    Named(String),
    /// The roadmap, written out.
    Inline(Box<RoadmapTable>),
}

impl RoadmapSource {
    /// The name or path; `inline` for one that is written out.
    pub fn name(&self) -> &str {
        match self {
            RoadmapSource::Named(name) => name,
            RoadmapSource::Inline(_) => "inline",
        }
    }

    /// The roadmap, if it is written out.
    pub fn table(&self) -> Option<Result<Roadmap, RoadmapError>> {
        match self {
            RoadmapSource::Named(_) => None,
            RoadmapSource::Inline(table) => Some(table.build(self.name())),
        }
    }
}

impl From<&str> for RoadmapSource {
    fn from(name: &str) -> Self {
        RoadmapSource::Named(name.to_owned())
    }
}

impl From<&Roadmap> for RoadmapSource {
    fn from(map: &Roadmap) -> Self {
        RoadmapSource::Inline(Box::new(RoadmapTable::from(map)))
    }
}

// By hand: serde's `untagged` would lose the places of mistakes.
impl<'de> Deserialize<'de> for RoadmapSource {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct NameOrTable;

        impl<'de> Visitor<'de> for NameOrTable {
            type Value = RoadmapSource;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "a built-in roadmap's name, a TOML file, or a table of `boundary`, \
                     `positions_m` and `edges`",
                )
            }

            fn visit_str<E>(self, name: &str) -> Result<RoadmapSource, E> {
                Ok(RoadmapSource::Named(name.to_owned()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<RoadmapSource, A::Error> {
                let table = RoadmapTable::deserialize(MapAccessDeserializer::new(map))?;
                Ok(RoadmapSource::Inline(Box::new(table)))
            }
        }

        from.deserialize_any(NameOrTable)
    }
}

impl WorldConfig {
    /// Places the nodes over `roadmap`, which is the one that [`WorldConfig::roadmap`] names.
    ///
    /// # Errors
    /// When no network with these settings is consistent with the roadmap, or it would have gaps
    /// and may not.
    pub fn place(&self, roadmap: &Roadmap, run_seed: u64) -> Result<SensorNetwork, SensorError> {
        let nodes = self.nodes as usize;
        let default = || SensorNetwork::default_radius_m(roadmap, nodes.max(1));
        let radius_m = self.radius_m.unwrap_or_else(default);
        let seed = self.placement_seed.unwrap_or(run_seed);
        let coverage_m = self.coverage_m.unwrap_or(radius_m);
        match self.gaps {
            Gaps::Refuse => {
                let all = SensorNetwork::place_covering(roadmap, nodes, radius_m, coverage_m, seed);
                Ok(all?.owned_by(roadmap, self.ownership))
            }
            // Who owns what decides where gaps are, and who reaches what decides who may own it.
            Gaps::Close | Gaps::Cross => SensorNetwork::place(roadmap, nodes, radius_m, seed)?
                .with_coverage(roadmap, coverage_m)?
                .owned_by(roadmap, self.ownership)
                .with_coverage(roadmap, coverage_m),
        }
    }
}
