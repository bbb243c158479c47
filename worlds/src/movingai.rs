//! MovingAI benchmark files: grid maps (`.map`) and tasks over them (`.scen`), on which published
//! multi-agent path-finding solvers are compared (Sturtevant, *Benchmarks for grid-based
//! pathfinding*, IEEE TCIAIG 4(2), 2012; Stern et al., *Multi-agent pathfinding*, SoCS 2019).
//!
//! - [`GridMap`] reads and writes `.map`, and makes random grids.
//! - [`TaskList`] reads and writes `.scen`, and makes random tasks.
//! - [`GridWorld`] makes a [`crate::Roadmap`] of a map's cells, four neighbours each, and checks
//!   tasks against it.
//!
//! The files are foreign: any bytes give a map, tasks, or an error that names the line, within
//! bounded memory. Reading them from disk is the caller's affair, and so is putting the file's name
//! before an error.
//!
//! ```
//! use farside_worlds::movingai::{GridMap, GridWorld, TaskList};
//! let map = "type octile\nheight 3\nwidth 4\nmap\n....\n.@@.\n....\n";
//! let scen = "version 1\n0\tyard.map\t4\t3\t0\t1\t3\t1\t5.00000000\n";
//!
//! let map = GridMap::from_movingai(map.as_bytes())?;
//! let tasks = TaskList::from_movingai(scen.as_bytes())?;
//! let world = GridWorld::new("yard.map", &map, 2.0, tasks.first(1)?)?;
//!
//! let (start, goal) = world.tasks()[0];
//! assert_eq!(world.roadmap().len(), 10);
//! assert_eq!(world.roadmap().distance(start, goal), 5);
//! assert!(world.blocked().is_empty());
//! # Ok::<(), farside_worlds::movingai::GridError>(())
//! ```

mod builtin;
mod error;
mod map;
mod random;
mod regions;
mod tasks;
mod world;

use std::fmt;

pub use builtin::Builtin;
pub use error::{End, GridError, GridProblem};
pub use map::GridMap;
pub use tasks::{GridTask, TaskList};
pub use world::GridWorld;

/// The most bytes of a `.map` or `.scen` file that are read.
pub const MAX_FILE_BYTES: usize = 16 << 20;

/// The most cells of a map, passable or not.
pub const MAX_CELLS: usize = 1 << 22;

/// The most tasks of a `.scen` file.
pub const MAX_TASKS: usize = 100_000;

/// A cell of a map, counted as the files do: (0, 0) is in the upper left corner, that is in the
/// north-west; x runs to the east and y to the **south**.
///
/// ```
/// use farside_worlds::movingai::Cell;
/// assert_eq!(Cell { x: 3, y: 0 }.to_string(), "(3, 0)");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Cell {
    /// The row, from 0 at the top. First, so that cells are ordered as they stand in the file.
    pub y: u32,
    /// The column, from 0 at the left.
    pub x: u32,
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "({}, {})", self.x, self.y)
    }
}

/// The file as text.
fn text_of(bytes: &[u8]) -> Result<&str, GridError> {
    if bytes.len() > MAX_FILE_BYTES {
        return Err(GridError::TooLarge {
            limit_bytes: MAX_FILE_BYTES,
            actual_bytes: bytes.len(),
        });
    }
    std::str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        let newlines = before.iter().filter(|byte| **byte == b'\n').count();
        GridError::NotText { line: newlines + 1 }
    })
}

/// A whole number in plain digits.
fn whole(text: &str) -> Option<u32> {
    let digits = text.bytes().all(|byte| byte.is_ascii_digit());
    if digits { text.parse().ok() } else { None }
}

#[cfg(test)]
mod tests;
