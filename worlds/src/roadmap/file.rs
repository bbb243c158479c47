//! The file format of roadmaps, and the ones that are built in. Files are hostile: any text gives
//! a roadmap or an error.
//!
//! ```toml
//! name = "bend"
//! boundary = [0, 2]
//! positions_m = [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0]]
//! heights_m = [0.0, 1.5, 2.0]      # optional
//! edges = [[0, 1], [1, 2]]
//! ```

use std::fmt::Write;

use nalgebra::Point2;
use serde::{Deserialize, Serialize};

use super::Roadmap;
use crate::error::{RoadmapError, WorldError};
use crate::ids::VertexId;

/// The most bytes of a roadmap file that are read.
const MAX_FILE_BYTES: usize = 1 << 20;

const BUILTIN: [(&str, &str); 2] = [
    ("crater-dense", include_str!("../../data/crater-dense.toml")),
    (
        "crater-sparse",
        include_str!("../../data/crater-sparse.toml"),
    ),
];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RoadmapFile {
    name: String,
    boundary: Vec<VertexId>,
    positions_m: Vec<[f64; 2]>,
    heights_m: Option<Vec<f64>>,
    edges: Vec<(VertexId, VertexId)>,
}

/// A roadmap written out, as a scenario has it in `world.roadmap`: the keys of a roadmap file but
/// the name.
///
/// ```
/// use farside_worlds::roadmap::RoadmapTable;
/// let text = "boundary = [0, 2]\npositions_m = [[0, 0], [9, 0], [9, 9]]\n\
///             edges = [[0, 1], [1, 2]]";
/// let table: RoadmapTable = toml::from_str(text)?;
/// let map = table.build("bend")?;
/// assert_eq!((map.name(), map.len(), map.edge_count()), ("bend", 3, 2));
/// assert_eq!(RoadmapTable::from(&map), table);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoadmapTable {
    /// Where rovers enter and leave.
    pub boundary: Vec<VertexId>,
    /// The place of each vertex, x to the east and y to the north \[m\].
    pub positions_m: Vec<[f64; 2]>,
    /// The terrain's height at each vertex \[m\]; without, 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heights_m: Option<Vec<f64>>,
    /// Pairs of vertices.
    pub edges: Vec<(VertexId, VertexId)>,
}

impl RoadmapTable {
    /// The roadmap, under a name.
    ///
    /// # Errors
    /// Those of [`Roadmap::new`] and [`Roadmap::with_heights_m`].
    pub fn build(&self, name: &str) -> Result<Roadmap, RoadmapError> {
        let places = self.positions_m.iter().map(|&[x, y]| Point2::new(x, y));
        let (edges, boundary) = (self.edges.clone(), self.boundary.clone());
        let roadmap = Roadmap::new(name, places.collect(), edges, boundary)?;
        match &self.heights_m {
            Some(heights_m) => roadmap.with_heights_m(heights_m.clone()),
            None => Ok(roadmap),
        }
    }
}

impl From<&Roadmap> for RoadmapTable {
    fn from(map: &Roadmap) -> Self {
        let place = |v| [map.position_m(v).x, map.position_m(v).y];
        let heights_m: Vec<f64> = map.vertices().map(|v| map.height_m(v)).collect();
        RoadmapTable {
            boundary: map.boundary().to_vec(),
            positions_m: map.vertices().map(place).collect(),
            heights_m: heights_m.iter().any(|h| *h != 0.0).then_some(heights_m),
            edges: map.edges().to_vec(),
        }
    }
}

impl Roadmap {
    /// The built-in roadmap of this name: `crater-sparse` (178 vertices, 183 edges) or
    /// `crater-dense` (228 and 239), the sizes of *network-guided*, section 4. The paper's own maps
    /// are not published; these are generated (see [`crate::generate`]).
    ///
    /// ```
    /// use farside_worlds::{Roadmap, WorldError};
    /// assert_eq!(Roadmap::builtin("crater-dense")?.len(), 228);
    /// let error = Roadmap::builtin("crater-dens").unwrap_err();
    /// assert!(matches!(error, WorldError::UnknownRoadmap { nearest: "crater-dense", .. }));
    /// # Ok::<(), WorldError>(())
    /// ```
    ///
    /// # Errors
    /// When there is no such roadmap; the error has the nearest name that there is.
    pub fn builtin(name: &str) -> Result<Roadmap, WorldError> {
        match BUILTIN.iter().find(|(known, _)| *known == name) {
            Some((_, text)) => Roadmap::from_toml(text),
            None => {
                let nearest = Self::builtin_names()
                    .iter()
                    .min_by_key(|known| strsim::damerau_levenshtein(known, name))
                    .expect("some roadmap is built in");
                Err(WorldError::UnknownRoadmap {
                    name: name.to_owned(),
                    nearest,
                })
            }
        }
    }

    /// The names that [`Roadmap::builtin`] knows, sorted.
    pub fn builtin_names() -> &'static [&'static str] {
        &[BUILTIN[0].0, BUILTIN[1].0]
    }

    /// Reads a roadmap file: `name`, `positions_m` (x and y of each vertex \[m\]), `edges`,
    /// `boundary` and, if there are any, `heights_m`.
    ///
    /// ```
    /// use farside_worlds::Roadmap;
    /// let text = "name = 'pair'\nboundary = [0, 1]\npositions_m = [[0, 0], [5, 0]]\n\
    ///             edges = [[0, 1]]";
    /// let map = Roadmap::from_toml(text)?;
    /// assert_eq!(Roadmap::from_toml(&map.to_toml())?, map);
    /// assert!(Roadmap::from_toml("edges = [[").is_err());
    /// # Ok::<(), farside_worlds::WorldError>(())
    /// ```
    ///
    /// # Errors
    /// When the text is longer than 1 MiB, is no TOML of this shape (the error names the line), or
    /// describes no roadmap (see [`Roadmap::new`]).
    pub fn from_toml(text: &str) -> Result<Roadmap, WorldError> {
        if text.len() > MAX_FILE_BYTES {
            let (limit_bytes, actual_bytes) = (MAX_FILE_BYTES, text.len());
            return Err(WorldError::TooLarge {
                limit_bytes,
                actual_bytes,
            });
        }
        let file: RoadmapFile = toml::from_str(text).map_err(|error| WorldError::Toml {
            message: error.to_string(),
        })?;
        let table = RoadmapTable {
            boundary: file.boundary,
            positions_m: file.positions_m,
            heights_m: file.heights_m,
            edges: file.edges,
        };
        Ok(table.build(&file.name)?)
    }

    /// The roadmap as a file, which [`Roadmap::from_toml`] reads back to an equal one.
    pub fn to_toml(&self) -> String {
        let mut text = format!("name = {}\n", toml::Value::String(self.name().to_owned()));
        let boundary = self.boundary().iter().map(|v| v.0.to_string());
        list(&mut text, "boundary", 16, boundary);
        let positions = self.vertices().map(|v| self.position_m(v));
        list(
            &mut text,
            "positions_m",
            5,
            positions.map(|p| format!("[{:?}, {:?}]", p.x, p.y)),
        );
        let heights = self.vertices().map(|v| format!("{:?}", self.height_m(v)));
        list(&mut text, "heights_m", 10, heights);
        let edges = self
            .edges()
            .iter()
            .map(|(u, v)| format!("[{}, {}]", u.0, v.0));
        list(&mut text, "edges", 8, edges);
        text
    }
}

/// `key = [ ... ]` with so many items on a line.
fn list(text: &mut String, key: &str, per_line: usize, items: impl Iterator<Item = String>) {
    let items: Vec<String> = items.collect();
    writeln!(text, "{key} = [").expect("a String takes any text");
    for line in items.chunks(per_line) {
        writeln!(text, "  {},", line.join(", ")).expect("a String takes any text");
    }
    text.push_str("]\n");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::RoadmapError;

    #[test]
    fn the_built_in_maps_have_the_papers_sizes() {
        let size = |name| {
            let map = Roadmap::builtin(name).unwrap();
            assert_eq!(map.name(), name);
            (map.len(), map.edge_count())
        };
        assert_eq!(size("crater-sparse"), (178, 183));
        assert_eq!(size("crater-dense"), (228, 239));
    }

    #[test]
    fn errors_name_what_is_wrong() {
        let message = |text: &str| Roadmap::from_toml(text).unwrap_err().to_string();
        let unknown = message("nam = 'x'");
        assert!(
            unknown.contains("line 1") && unknown.contains("`name`"),
            "{unknown}"
        );
        let base = "name='x'\nboundary=[0]\nedges=[]\n";
        assert!(message(&format!("{base}positions_m=[[0.0]]")).contains("line 4"));
        let nan = Roadmap::from_toml(&format!("{base}positions_m=[[nan, 0.0]]")).unwrap_err();
        assert!(
            matches!(nan, WorldError::Roadmap(RoadmapError::Position { .. })),
            "{nan}"
        );
        let large = Roadmap::from_toml(&" ".repeat(MAX_FILE_BYTES + 1)).unwrap_err();
        let (limit_bytes, actual_bytes) = (MAX_FILE_BYTES, MAX_FILE_BYTES + 1);
        assert_eq!(
            large,
            WorldError::TooLarge {
                limit_bytes,
                actual_bytes
            }
        );
    }

    #[test]
    fn odd_names_survive() {
        let p = vec![Point2::new(-0.0, 1.0e-9), Point2::new(1.0e6, 0.1 + 0.2)];
        let edges = vec![(VertexId(0), VertexId(1))];
        let map = Roadmap::new("a \"b\"\n\u{1f680}\\", p, edges, vec![VertexId(1)]).unwrap();
        assert_eq!(Roadmap::from_toml(&map.to_toml()).unwrap(), map);
    }

    #[test]
    fn deep_nesting_is_an_error() {
        let deep = format!("edges = {}", "[".repeat(200_000));
        assert!(matches!(
            Roadmap::from_toml(&deep),
            Err(WorldError::Toml { .. })
        ));
    }
}
