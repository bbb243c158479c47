//! Grid maps: reading, writing, and how far it is from cell to cell.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::SQRT_2;
use std::fmt;

use super::error::{GridError, GridProblem};
use super::{Cell, MAX_CELLS, text_of, whole};
use crate::contacts::shown;

const PASSABLE: [u8; 3] = *b".GS";
const WALLS: [u8; 4] = *b"@OTW";

/// A grid of passable cells and walls, as a `.map` file has it.
///
/// `.` and `G` (ground) and `S` (swamp, which may be entered from ground) are passable; `@` and `O`
/// (out of bounds), `T` (trees) and `W` (water, which may not be entered from ground) are walls.
/// The terrain is kept, so that what was read is written again.
///
/// ```
/// use farside_worlds::movingai::{Cell, GridMap};
/// let text = "type octile\nheight 2\nwidth 3\nmap\n.T.\n.GS\n";
/// let map = GridMap::from_movingai(text.as_bytes())?;
/// assert_eq!((map.width(), map.height(), map.passable_cells()), (3, 2, 5));
/// assert!(map.is_passable(Cell { x: 2, y: 1 }) && !map.is_passable(Cell { x: 1, y: 0 }));
/// assert_eq!(map.to_movingai(), text);
/// # Ok::<(), farside_worlds::movingai::GridError>(())
/// ```
#[derive(Clone, PartialEq, Eq)]
pub struct GridMap {
    width: u32,
    height: u32,
    /// Row by row from the top.
    terrain: Vec<u8>,
}

impl GridMap {
    /// Reads a `.map` file: `type octile`, `height` and `width` (in any order), `map`, then as many
    /// rows of as many characters. Blank lines at the end, spaces at the end of a line and carriage
    /// returns are let pass.
    ///
    /// ```
    /// use farside_worlds::movingai::GridMap;
    /// let text = "type octile\nheight 3\nwidth 2\nmap\n..\n";
    /// let error = GridMap::from_movingai(text.as_bytes()).unwrap_err();
    /// let expected = "line 5: the file ends here: expected row 1 of rows 0 to 2 next";
    /// assert_eq!(error.to_string(), expected);
    /// ```
    ///
    /// # Errors
    /// With the line, and the column where one character or number is meant, when the text is no
    /// such file, a side is 0, or the map has more than [`MAX_CELLS`] cells; or when the file has
    /// more than [`super::MAX_FILE_BYTES`].
    pub fn from_movingai(bytes: &[u8]) -> Result<GridMap, GridError> {
        let mut lines = Lines::new(text_of(bytes)?);
        let (width, height) = header(&mut lines)?;
        // The header may promise more than the file holds: what is reserved is bounded by both.
        let cells = width as usize * height as usize;
        let mut terrain = Vec::with_capacity(cells.min(bytes.len()));
        for row in 0..height {
            let expected = || format!("row {row} of rows 0 to {}", height - 1);
            let (line, text) = lines.next(expected)?;
            read_row(&mut terrain, line, row, text.trim_end(), width)?;
        }
        while let Some((line, text)) = lines.more() {
            if !text.trim().is_empty() {
                let (found, expected) = (shown(text), height);
                return Err(GridError::at(
                    line,
                    GridProblem::ExtraRow { found, expected },
                ));
            }
        }
        Ok(GridMap {
            width,
            height,
            terrain,
        })
    }

    /// A map of `.` and `@`.
    pub(super) fn of_walls(width: u32, height: u32, is_wall: &[bool]) -> GridMap {
        let terrain = is_wall
            .iter()
            .map(|wall| if *wall { b'@' } else { b'.' })
            .collect();
        GridMap {
            width,
            height,
            terrain,
        }
    }

    /// The map as a `.map` file, which [`GridMap::from_movingai`] reads back to an equal one.
    pub fn to_movingai(&self) -> String {
        let (height, width) = (self.height, self.width);
        let mut text = format!("type octile\nheight {height}\nwidth {width}\nmap\n");
        for row in self.terrain.chunks_exact(width as usize) {
            text.extend(row.iter().copied().map(char::from));
            text.push('\n');
        }
        text
    }

    /// The number of columns; at least 1.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// The number of rows; at least 1.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The character at a cell; `None` outside the map.
    pub fn terrain(&self, cell: Cell) -> Option<char> {
        let at = self.index(cell)?;
        Some(char::from(self.terrain[at]))
    }

    /// Whether the cell is in the map and no wall.
    pub fn is_passable(&self, cell: Cell) -> bool {
        self.index(cell)
            .is_some_and(|at| PASSABLE.contains(&self.terrain[at]))
    }

    /// How many cells are passable.
    pub fn passable_cells(&self) -> usize {
        let passable = |terrain: &&u8| PASSABLE.contains(terrain);
        self.terrain.iter().filter(passable).count()
    }

    /// How many cells there are; at most [`MAX_CELLS`].
    pub fn cells(&self) -> usize {
        self.terrain.len()
    }

    /// The length of a shortest path in cells, as `.scen` files state it: a step to the side costs
    /// 1 and a diagonal one the root of 2, and no diagonal step cuts a corner: both cells beside it
    /// must be passable. `None` when there is no path.
    ///
    /// Rovers on a [`super::GridWorld`] take no diagonal steps. Their distance is at least this and
    /// at most the root of 2 times this.
    ///
    /// ```
    /// use farside_worlds::movingai::{Cell, GridMap};
    /// let map = GridMap::from_movingai(b"type octile\nheight 2\nwidth 3\nmap\n...\n..@\n")?;
    /// let octile = |x, y| map.octile_length(Cell { x: 0, y: 0 }, Cell { x, y });
    /// assert_eq!(octile(1, 1), Some(std::f64::consts::SQRT_2));
    /// assert_eq!((octile(2, 0), octile(2, 1)), (Some(2.0), None));
    /// # Ok::<(), farside_worlds::movingai::GridError>(())
    /// ```
    pub fn octile_length(&self, from: Cell, to: Cell) -> Option<f64> {
        if !self.is_passable(from) || !self.is_passable(to) {
            return None;
        }
        let mut done = vec![false; self.terrain.len()];
        let mut queue = BinaryHeap::from([Reached(Octile::default(), from)]);
        while let Some(Reached(length, cell)) = queue.pop() {
            let at = self.index(cell).expect("only cells of the map are queued");
            if std::mem::replace(&mut done[at], true) {
                continue;
            }
            if cell == to {
                return Some(length.total());
            }
            for (dx, dy) in [(1, 0), (0, 1), (-1, 0), (0, -1)] {
                let beside = shifted(cell, dx, dy).filter(|beside| self.is_passable(*beside));
                let Some(beside) = beside else { continue };
                queue.push(Reached(length.straight(), beside));
                // The diagonal a quarter turn further, so that each is looked at once.
                let turned = shifted(cell, -dy, dx).filter(|turned| self.is_passable(*turned));
                let corner = turned.and(shifted(beside, -dy, dx));
                if let Some(corner) = corner.filter(|corner| self.is_passable(*corner)) {
                    queue.push(Reached(length.diagonal(), corner));
                }
            }
        }
        None
    }

    /// Where the cell stands in `terrain`.
    pub(super) fn index(&self, cell: Cell) -> Option<usize> {
        let inside = cell.x < self.width && cell.y < self.height;
        inside.then(|| cell.y as usize * self.width as usize + cell.x as usize)
    }

    /// The cell that stands there.
    pub(super) fn cell(&self, index: usize) -> Cell {
        // A map has at most 2^22 cells.
        let index = index as u32;
        Cell {
            x: index % self.width,
            y: index / self.width,
        }
    }

    /// The passable cells beside one: east, south, west, north.
    pub(super) fn beside(&self, cell: Cell) -> impl Iterator<Item = Cell> {
        [(1, 0), (0, 1), (-1, 0), (0, -1)]
            .into_iter()
            .filter_map(move |(dx, dy)| shifted(cell, dx, dy))
            .filter(|cell| self.is_passable(*cell))
    }
}

impl fmt::Debug for GridMap {
    // A million cells help nobody.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GridMap")
            .field("width", &self.width)
            .field("height", &self.height)
            .field("passable_cells", &self.passable_cells())
            .finish()
    }
}

fn shifted(cell: Cell, dx: i32, dy: i32) -> Option<Cell> {
    let x = cell.x.checked_add_signed(dx)?;
    let y = cell.y.checked_add_signed(dy)?;
    Some(Cell { x, y })
}

/// A length of straight and diagonal steps. Counted, not summed, so that equal lengths are equal
/// whatever the order of their steps.
#[derive(Clone, Copy, Default)]
struct Octile {
    straight: u32,
    diagonal: u32,
}

impl Octile {
    fn straight(self) -> Self {
        let straight = self.straight + 1;
        Octile { straight, ..self }
    }

    fn diagonal(self) -> Self {
        let diagonal = self.diagonal + 1;
        Octile { diagonal, ..self }
    }

    fn total(self) -> f64 {
        f64::from(self.straight) + f64::from(self.diagonal) * SQRT_2
    }
}

/// A cell that can be reached, the nearest first in a heap.
struct Reached(Octile, Cell);

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        let lengths = other.0.total().total_cmp(&self.0.total());
        lengths.then(other.1.cmp(&self.1))
    }
}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Reached {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Reached {}

/// The lines of a file, numbered from 1.
pub(super) struct Lines<'a> {
    lines: std::str::Lines<'a>,
    number: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        let lines = text.lines();
        Lines { lines, number: 0 }
    }

    /// The next line, if there is one.
    pub(super) fn more(&mut self) -> Option<(usize, &'a str)> {
        let line = self.lines.next()?;
        self.number += 1;
        Some((self.number, line))
    }

    /// The next line, which there must be.
    pub(super) fn next(
        &mut self,
        expected: impl FnOnce() -> String,
    ) -> Result<(usize, &'a str), GridError> {
        let last = self.number.max(1);
        self.more().ok_or_else(|| {
            let expected = expected();
            GridError::at(last, GridProblem::Ends { expected })
        })
    }
}

/// Width and height.
fn header(lines: &mut Lines<'_>) -> Result<(u32, u32), GridError> {
    exactly(lines, "type octile", "`type octile`")?;
    let (mut width, mut height) = (None, None);
    let mut last = 0;
    while width.is_none() || height.is_none() {
        let expected = match (width, height) {
            (None, None) => "`height` and a number",
            (None, _) => "`width` and a number",
            (_, _) => "`height` and a number",
        };
        let (line, text) = lines.next(|| expected.to_owned())?;
        let (key, value) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        let (field, side) = match key {
            "width" if width.is_none() => ("width", &mut width),
            "height" if height.is_none() => ("height", &mut height),
            _ => {
                let found = shown(text);
                return Err(GridError::at(line, GridProblem::Header { found, expected }));
            }
        };
        let column = key.chars().count() + 2;
        *side = Some(side_length(line, column, field, value.trim())?);
        last = line;
    }
    let (width, height) = (width.unwrap_or(0), height.unwrap_or(0));
    // Sides are below 2^32, so this fits 64 bits.
    if u64::from(width) * u64::from(height) > MAX_CELLS as u64 {
        let problem = GridProblem::TooManyCells {
            width,
            height,
            limit: MAX_CELLS,
        };
        return Err(GridError::at(last, problem));
    }
    exactly(lines, "map", "`map`, and then the rows")?;
    Ok((width, height))
}

/// A line that must consist of these words.
fn exactly(
    lines: &mut Lines<'_>,
    words: &'static str,
    expected: &'static str,
) -> Result<(), GridError> {
    let (line, text) = lines.next(|| expected.to_owned())?;
    if text.split_whitespace().eq(words.split_whitespace()) {
        return Ok(());
    }
    let found = shown(text);
    Err(GridError::at(line, GridProblem::Header { found, expected }))
}

fn side_length(
    line: usize,
    column: usize,
    field: &'static str,
    text: &str,
) -> Result<u32, GridError> {
    match whole(text) {
        Some(side) if side > 0 => Ok(side),
        _ => {
            let found = shown(text);
            let expected = "a whole number from 1 on";
            let problem = GridProblem::Field {
                field,
                found,
                expected,
            };
            Err(GridError::at_column(line, column, problem))
        }
    }
}

fn read_row(
    terrain: &mut Vec<u8>,
    line: usize,
    row: u32,
    text: &str,
    width: u32,
) -> Result<(), GridError> {
    // The length first: a file of another shape is told as such, not as bad terrain.
    let found = text.chars().count();
    if found != width as usize {
        let expected = width;
        let problem = GridProblem::RowLength {
            row,
            found,
            expected,
        };
        return Err(GridError::at(line, problem));
    }
    for (at, found) in text.chars().enumerate() {
        match u8::try_from(found) {
            Ok(byte) if PASSABLE.contains(&byte) || WALLS.contains(&byte) => terrain.push(byte),
            _ => {
                let problem = GridProblem::Terrain { found };
                return Err(GridError::at_column(line, at + 1, problem));
            }
        }
    }
    Ok(())
}
