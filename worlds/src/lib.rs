//! Terrain, rock fields, roadmaps, sensor networks and contact plans for Farside.
//!
//! A world is what rovers drive on and what radio nodes stand in: it holds no time, sends no
//! message and writes no log. The network-guided system needs two things of it, a [`Roadmap`] and
//! a [`SensorNetwork`] over it. Both lie in a generated [`Crater`], whose [`HeightField`] tells a
//! radio link what the ground hides. Rovers that drive freely and look at rocks do so in a
//! [`RockField`]: rocks of classes that [`geology`] knows, laid out by a [`Story`], with [`spectra`]
//! that are mixed from minerals or measured ([`SpectralLibrary`]). [`sky`] says where the Sun stands
//! over Mars. [`contacts`] reads when which node hears which, as ION, HDTN and mahimahi write it down;
//! [`movingai`] reads grid maps and tasks of path-finding benchmarks.
//!
//! ```
//! use farside_worlds::{Roadmap, SensorNetwork};
//! let roadmap = Roadmap::builtin("crater-dense")?;
//! let radius_m = SensorNetwork::default_radius_m(&roadmap, 28);
//! let network = SensorNetwork::place(&roadmap, 28, radius_m, 1)?;
//! for &(u, v) in roadmap.edges() {
//!     let (a, b) = (network.owner(u), network.owner(v));
//!     assert!(a == b || network.are_neighbors(a, b));
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod contacts;
pub mod crater;
pub mod decimal;
pub mod error;
pub mod generate;
pub mod geology;
pub mod ids;
pub mod movingai;
pub mod roadmap;
pub mod rock_field;
pub mod rocks;
pub mod sensors;
pub mod sky;
pub mod spectra;
pub mod terrain;

pub use contacts::{CapacityTrace, ContactError, ContactFormat, ContactPlan, ContactWindow};
pub use crater::{Crater, CraterSettings, Hazard};
pub use error::{RoadmapError, SensorError, SkyError, TerrainError, WorldError};
pub use geology::{GeologyError, RockClass, Story, StoryKind, TEXTURE, TEXTURE_NAMES};
pub use ids::{NodeId, VertexId};
pub use movingai::{GridError, GridMap, GridTask, GridWorld, TaskList};
pub use roadmap::{Blocked, DistancesTo, Endpoints, Roadmap, RoadmapTable, well_formed};
pub use rock_field::{
    FieldClasses, FieldRock, FieldRocks, FieldSpectra, FieldTruth, Footprint, RockField,
    RockFieldSettings, RockTruth,
};
pub use rocks::{Rock, RockAbundance};
pub use sensors::{Ownership, SensorNetwork};
pub use sky::{Sky, SolWindow};
pub use spectra::{LibraryError, SpectralLibrary};
pub use terrain::HeightField;
