//! The generator of the built-in roadmaps: safe paths through a crater, nearly a tree, with an
//! exact number of vertices and of loops.
//!
//! The paper gives the sizes of its two roadmaps and pictures of them, no more (*network-guided*,
//! section 4). Here places are thrown over safe ground and joined by safe edges; out of this dense
//! graph come a tree that joins gates round the rim, loops, one for each independent cycle, and
//! spurs into the ground between, until the numbers are met. `cargo run -p farside-worlds --example
//! generate_roadmaps` writes the files in `worlds/data/`.

mod ground;
mod network;

use farside::random::RandomKey;
use nalgebra::Point2;

use crate::crater::{Crater, CraterSettings};
use crate::error::WorldError;
use crate::ids::VertexId;
use crate::roadmap::Roadmap;
use ground::SafeGround;
use network::Network;

/// What a generated roadmap is to be like. [`RoadmapSettings::builtin`] has those of the built-in
/// ones.
#[derive(Clone, Debug, PartialEq)]
pub struct RoadmapSettings {
    /// The roadmap's name.
    pub name: String,
    /// The seed of all draws.
    pub seed: u64,
    /// How many vertices it has.
    pub vertices: usize,
    /// How many independent cycles it has: edges - vertices + 1.
    pub cycles: usize,
    /// How many gates it has, where rovers enter and leave.
    pub gates: usize,
    /// The radius of the ring of gates \[m\].
    pub gate_radius_m: f64,
    /// The least distance between two places that may become vertices \[m\].
    pub spacing_m: f64,
    /// How far from hazards paths keep \[m\].
    pub margin_m: f64,
}

impl RoadmapSettings {
    /// The settings of a built-in roadmap.
    ///
    /// ```
    /// use farside_worlds::generate::RoadmapSettings;
    /// let dense = RoadmapSettings::builtin("crater-dense").unwrap();
    /// assert_eq!((dense.vertices, dense.cycles), (228, 12));
    /// assert!(RoadmapSettings::builtin("plain").is_none());
    /// ```
    pub fn builtin(name: &str) -> Option<RoadmapSettings> {
        let (seed, vertices, cycles, gates, spacing_m) = match name {
            "crater-dense" => (2, 228, 12, 28, 14.5),
            "crater-sparse" => (20, 178, 6, 24, 16.5),
            _ => return None,
        };
        Some(RoadmapSettings {
            name: name.to_owned(),
            seed,
            vertices,
            cycles,
            gates,
            gate_radius_m: 222.0,
            spacing_m,
            margin_m: 2.0,
        })
    }
}

/// The roadmap of these settings over a crater: the same for the same settings and crater.
///
/// Its gates are vertices 0, 1, ... anticlockwise from the west; positions and heights are whole
/// centimetres.
///
/// ```
/// use farside_worlds::generate::{RoadmapSettings, generate};
/// use farside_worlds::{Crater, CraterSettings, Roadmap};
/// let crater = Crater::generate(&CraterSettings::default())?;
/// let settings = RoadmapSettings::builtin("crater-sparse").unwrap();
/// assert_eq!(generate(&crater, &settings)?, Roadmap::builtin("crater-sparse")?);
/// # Ok::<(), farside_worlds::WorldError>(())
/// ```
///
/// # Errors
/// When the crater has no room for such a roadmap.
pub fn generate(crater: &Crater, settings: &RoadmapSettings) -> Result<Roadmap, WorldError> {
    let key = RandomKey::new(settings.seed)
        .text("roadmap")
        .text(&settings.name);
    let ground = SafeGround::survey(crater, settings, key.text("ground").stream());
    let mut network = Network::new(&ground, key.text("network").stream());
    let no_room = |reason| WorldError::NoRoom {
        vertices: settings.vertices,
        edges: settings.vertices + settings.cycles - 1,
        reason,
    };
    network.join_gates().map_err(no_room)?;
    for _ in 0..settings.cycles {
        network.add_loop().map_err(no_room)?;
    }
    network.fill(settings.vertices).map_err(no_room)?;
    let (mut positions_m, edges) = network.finish(settings.gates);
    ground::straighten(crater, settings, &mut positions_m, &edges);
    let heights_m = positions_m
        .iter()
        .map(|p| centimetres(crater.terrain().height_m(p.x, p.y)));
    let heights_m = heights_m.collect();
    let gates = (0..settings.gates as u32).map(VertexId).collect();
    let edges = edges
        .iter()
        .map(|&(u, v)| (VertexId(u as u32), VertexId(v as u32)))
        .collect();
    Ok(Roadmap::new(&settings.name, positions_m, edges, gates)?.with_heights_m(heights_m)?)
}

/// The file of a built-in roadmap, generated anew.
///
/// # Errors
/// When there is no such roadmap.
pub fn builtin_file(name: &str) -> Result<String, WorldError> {
    let Some(settings) = RoadmapSettings::builtin(name) else {
        return Roadmap::builtin(name).map(|roadmap| roadmap.to_toml());
    };
    let crater = Crater::generate(&CraterSettings::default())?;
    let roadmap = generate(&crater, &settings)?;
    Ok(format!("{HEADER}{}", roadmap.to_toml()))
}

/// The first lines of a generated file.
const HEADER: &str = "\
# Generated: change the generator, not this file.
# cargo run -p farside-worlds --example generate_roadmaps
";

/// Rounded to whole centimetres, so that files are short and the same everywhere.
fn centimetres(metres: f64) -> f64 {
    libm::round(metres * 100.0) / 100.0
}

fn on_centimetres(p: Point2<f64>) -> Point2<f64> {
    Point2::new(centimetres(p.x), centimetres(p.y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_are_what_the_generator_makes() {
        for name in Roadmap::builtin_names() {
            let path = format!("{}/data/{name}.toml", env!("CARGO_MANIFEST_DIR"));
            let file = std::fs::read_to_string(path).unwrap();
            let anew = builtin_file(name).unwrap();
            assert!(
                anew == file,
                "worlds/data/{name}.toml is not what the generator makes"
            );
        }
    }

    #[test]
    fn built_in_paths_keep_off_hazards() {
        let crater = Crater::generate(&CraterSettings::default()).unwrap();
        for name in Roadmap::builtin_names() {
            let map = Roadmap::builtin(name).unwrap();
            for &(u, v) in map.edges() {
                let (from_m, to_m) = (map.position_m(u), map.position_m(v));
                assert!(
                    crater.is_clear(from_m, to_m, 0.0),
                    "{name}: {} - {}",
                    u.0,
                    v.0
                );
            }
        }
    }

    #[test]
    fn no_room_is_an_error() {
        let crater = Crater::generate(&CraterSettings::default()).unwrap();
        let builtin = RoadmapSettings::builtin("crater-dense").unwrap();
        for settings in [
            RoadmapSettings {
                vertices: 100,
                ..builtin.clone()
            },
            RoadmapSettings {
                vertices: 5000,
                ..builtin.clone()
            },
            RoadmapSettings {
                cycles: 500,
                ..builtin.clone()
            },
            RoadmapSettings {
                margin_m: 40.0,
                ..builtin.clone()
            },
        ] {
            let error = generate(&crater, &settings).unwrap_err();
            assert!(matches!(error, WorldError::NoRoom { .. }), "{error}");
        }
    }
}
