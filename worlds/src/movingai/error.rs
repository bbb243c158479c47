//! What can be wrong with a grid map or its tasks, and on which line.

use std::fmt;

use super::Cell;
use crate::contacts::Position;
use crate::error::RoadmapError;

/// Why a MovingAI file cannot be read, or a map and its tasks make no world.
///
/// ```
/// use farside_worlds::movingai::GridMap;
/// let text = "type octile\nheight 2\nwidth 3\nmap\n...\n..x\n";
/// let error = GridMap::from_movingai(text.as_bytes()).unwrap_err();
/// assert_eq!(
///     error.to_string(),
///     "line 6, column 3: 'x' is no terrain: expected one of `.`, `G`, `S` (passable), `@`, `O`, \
///      `T`, `W` (not)"
/// );
/// assert_eq!(error.line(), Some(6));
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GridError {
    /// The file is larger than any that is read.
    #[error("the file has {actual_bytes} bytes; at most {limit_bytes} are read")]
    TooLarge {
        /// The most bytes that are read.
        limit_bytes: usize,
        /// The file's size.
        actual_bytes: usize,
    },
    /// The file is no text.
    #[error("line {line}: not text: a byte is not UTF-8")]
    NotText {
        /// The line, from 1.
        line: usize,
    },
    /// Something at one place is wrong.
    #[error("{at}: {problem}")]
    At {
        /// Where.
        at: Position,
        /// What.
        problem: GridProblem,
    },
    /// There are fewer tasks than were asked for.
    #[error("{wanted} tasks are needed, one for each rover; the file has {found}")]
    TooFewTasks {
        /// The tasks asked for.
        wanted: usize,
        /// The tasks found.
        found: usize,
    },
    /// Every cell of the map is a wall.
    #[error("no cell of the map is passable; all {cells} are walls")]
    NoPassable {
        /// How many cells there are.
        cells: usize,
    },
    /// The region that is used has more cells than a roadmap may have vertices.
    #[error(
        "{} has {actual} passable cells; a roadmap may have {limit} vertices", region(*line)
    )]
    TooManyVertices {
        /// The line of the first task, whose region it is; `None` for the largest region.
        line: Option<usize>,
        /// The most vertices of a roadmap.
        limit: usize,
        /// The region's cells.
        actual: usize,
    },
    /// What was asked for is out of its range.
    #[error("{setting} must be {expected}; it is {found}")]
    Setting {
        /// What was asked for, with its unit.
        setting: &'static str,
        /// Its range.
        expected: String,
        /// What it is.
        found: String,
    },
    /// The grid is no roadmap. No map that can be read is known to lead here.
    #[error("the grid makes no roadmap: {0}")]
    Roadmap(#[from] RoadmapError),
}

impl GridError {
    /// The line that is wrong, from 1, if it is one.
    pub fn line(&self) -> Option<usize> {
        match self {
            GridError::NotText { line } => Some(*line),
            GridError::At { at, .. } => Some(at.line),
            GridError::TooManyVertices { line, .. } => *line,
            _ => None,
        }
    }

    pub(super) fn at(line: usize, problem: GridProblem) -> Self {
        let at = Position { line, column: None };
        GridError::At { at, problem }
    }

    pub(super) fn at_column(line: usize, column: usize, problem: GridProblem) -> Self {
        let column = Some(column);
        let at = Position { line, column };
        GridError::At { at, problem }
    }
}

/// Which end of a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Where its rover stands at first.
    Start,
    /// Where its rover stays.
    Goal,
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            End::Start => "start",
            End::Goal => "goal",
        })
    }
}

/// What is wrong at one place of a file. Texts from the file are cut to 40 characters.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GridProblem {
    /// The file ends too soon.
    #[error("the file ends here: expected {expected} next")]
    Ends {
        /// What is missing.
        expected: String,
    },
    /// A line of the header is another than it must be.
    #[error("{found:?}: expected {expected}")]
    Header {
        /// The line.
        found: String,
        /// What it should be.
        expected: &'static str,
    },
    /// The map is larger than any that is read.
    #[error("a map of {width} times {height} cells; at most {limit} cells are read")]
    TooManyCells {
        /// Its width.
        width: u32,
        /// Its height.
        height: u32,
        /// The most cells there may be.
        limit: usize,
    },
    /// A row is longer or shorter than the map is wide.
    #[error("row {row} has {found} cells: expected {expected}, the width of the map")]
    RowLength {
        /// The row, from 0 as tasks count.
        row: u32,
        /// How many cells it has.
        found: usize,
        /// How many it should have.
        expected: u32,
    },
    /// There is more in the file than the map has rows.
    #[error("{found:?} after the last row: expected {expected} rows, the height of the map")]
    ExtraRow {
        /// The line.
        found: String,
        /// The rows that there should be.
        expected: u32,
    },
    /// A character that stands for no terrain.
    #[error(
        "{found:?} is no terrain: expected one of `.`, `G`, `S` (passable), `@`, `O`, \
         `T`, `W` (not)"
    )]
    Terrain {
        /// The character.
        found: char,
    },
    /// A field is missing at the end of a line.
    #[error("the {field} is missing: expected `{form}`")]
    MissingField {
        /// What is missing.
        field: &'static str,
        /// The whole line as it should be.
        form: &'static str,
    },
    /// There is more on the line than its form has.
    #[error("{found:?} is one field too many: expected `{form}`")]
    ExtraField {
        /// The first field too many.
        found: String,
        /// The whole line as it should be.
        form: &'static str,
    },
    /// A field's value cannot be.
    #[error("{field} {found:?}: expected {expected}")]
    Field {
        /// Which field.
        field: &'static str,
        /// Its value.
        found: String,
        /// What it should be.
        expected: &'static str,
    },
    /// More tasks than anyone means.
    #[error("more than {limit} tasks; that is the most that is read")]
    TooManyTasks {
        /// The most there may be.
        limit: usize,
    },
    /// A task is for another map.
    #[error("the task is for map {found:?}: expected {expected:?}, the map it is used with")]
    MapName {
        /// The map that the line names.
        found: String,
        /// The map's file name.
        expected: String,
    },
    /// A task is for a map of another size.
    #[error("the task is for a map of {} times {}: expected {} times {}, the size of the map",
        found.0, found.1, expected.0, expected.1)]
    Size {
        /// Width and height that the line names.
        found: (u32, u32),
        /// Width and height of the map.
        expected: (u32, u32),
    },
    /// A task begins or ends outside the map.
    #[error("the {end} {cell} is outside the map: expected x from 0 to {} and y from 0 to {}",
        width - 1, height - 1)]
    Outside {
        /// Which end.
        end: End,
        /// Its cell.
        cell: Cell,
        /// The map's width.
        width: u32,
        /// The map's height.
        height: u32,
    },
    /// A task begins or ends in a wall.
    #[error("the {end} {cell} is in a wall, {terrain:?}: expected a passable cell")]
    Wall {
        /// Which end.
        end: End,
        /// Its cell.
        cell: Cell,
        /// What is there.
        terrain: char,
    },
    /// Two rovers would start, or stay, at one cell.
    #[error("the {end} {cell} is that of line {other_line}, too: expected each {end} once")]
    Duplicate {
        /// Which end.
        end: End,
        /// The cell.
        cell: Cell,
        /// The line of the other task.
        other_line: usize,
    },
    /// No way leads from a task's start to its goal.
    #[error(
        "no way leads from the start {start} to the goal {goal}: expected both in one region of \
         the map; that of the start has {start_cells} cells, that of the goal {goal_cells}"
    )]
    Apart {
        /// The start.
        start: Cell,
        /// The goal.
        goal: Cell,
        /// The passable cells that can be reached from the start, itself included.
        start_cells: usize,
        /// The same for the goal.
        goal_cells: usize,
    },
    /// A task lies in another region than the first one.
    #[error(
        "no way leads from the start {start} to {other_start}, the start of line {other_line}: \
         expected all tasks in one region of the map, because a roadmap is connected"
    )]
    OtherRegion {
        /// The start.
        start: Cell,
        /// The line of the first task.
        other_line: usize,
        /// Its start.
        other_start: Cell,
    },
}

fn region(line: Option<usize>) -> String {
    match line {
        Some(line) => format!("the region of line {line}'s task"),
        None => "the map's largest region".to_owned(),
    }
}
