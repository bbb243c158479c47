//! From a map and tasks to a roadmap with starts and goals.

use std::collections::BTreeMap;

use nalgebra::Point2;

use super::error::{End, GridError, GridProblem};
use super::regions::Regions;
use super::{Cell, GridMap, GridTask};
use crate::ids::VertexId;
use crate::roadmap::{Blocked, MAX_COORDINATE_M, MAX_VERTICES, Roadmap, well_formed};

/// A roadmap made of a map's cells, with tasks over it.
///
/// - There is a vertex for each passable cell of **one** region of the map, at the cell's centre.
///   Vertices are numbered as cells stand in the file: row by row from the north, each from the
///   west.
/// - Edges join cells that share a side. Rovers take no diagonal steps, as is the custom for
///   multi-agent path-finding.
/// - x runs to the east and y to the **north**, from the map's south-western corner: the cell in
///   column `x` and row `y` of a map of `h` rows lies at `((x + 0.5) * cell_m, (h - y - 0.5) *
///   cell_m)`.
/// - The boundary is what a roadmap must have; here rovers start on the map and stay on it. It is
///   the cells that lie furthest to the north, east, south or west of the region.
///
/// ```
/// use farside_worlds::movingai::{Cell, GridMap, GridWorld};
/// // Two regions: the larger one is used where no task says which.
/// let map = GridMap::from_movingai(b"type octile\nheight 2\nwidth 4\nmap\n..@.\n..@.\n")?;
/// let world = GridWorld::new("halves.map", &map, 10.0, &[])?;
/// assert_eq!((world.roadmap().len(), world.left_out()), (4, 2));
/// let south_west = world.vertex(Cell { x: 0, y: 1 }).unwrap();
/// let at = world.roadmap().position_m(south_west);
/// assert_eq!((at.x, at.y), (5.0, 5.0));
/// assert_eq!(world.cell(south_west), Cell { x: 0, y: 1 });
/// assert_eq!(world.vertex(Cell { x: 3, y: 1 }), None);
/// # Ok::<(), farside_worlds::movingai::GridError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct GridWorld {
    roadmap: Roadmap,
    /// Of each vertex, in order.
    cells: Vec<Cell>,
    left_out: usize,
    lines: Vec<GridTask>,
    tasks: Vec<(VertexId, VertexId)>,
}

impl GridWorld {
    /// The world of a map whose file is called `map_name`, with cells of `cell_m` \[m\] a side, and
    /// of `tasks` on it, mostly those of [`super::TaskList::first`]. The roadmap is of the region
    /// that the tasks lie in, without tasks of the largest one, and has the map's name.
    ///
    /// ```
    /// use farside_worlds::movingai::{GridMap, GridWorld, TaskList};
    /// let map = GridMap::from_movingai(b"type octile\nheight 1\nwidth 4\nmap\n..@.\n")?;
    /// let tasks = TaskList::from_movingai(b"version 1\n0\tgap.map\t4\t1\t0\t0\t3\t0\t3\n")?;
    /// let error = GridWorld::new("gap.map", &map, 1.0, tasks.tasks()).unwrap_err();
    /// assert_eq!(
    ///     error.to_string(),
    ///     "line 2: no way leads from the start (0, 0) to the goal (3, 0): expected both in one \
    ///      region of the map; that of the start has 2 cells, that of the goal 1"
    /// );
    /// # Ok::<(), farside_worlds::movingai::GridError>(())
    /// ```
    ///
    /// # Errors
    /// With the line, when a task is for a map of another name (folders before it are ignored) or
    /// size, begins or ends outside the map or in a wall, begins where another begins or ends where
    /// another ends, or lies in two regions or in another than the first task. A task may end where
    /// it begins, or where another begins.
    ///
    /// Without a line, when all is wall, the region has more than [`MAX_VERTICES`] cells, or cells
    /// are not of positive size or reach beyond [`MAX_COORDINATE_M`].
    pub fn new(
        map_name: &str,
        map: &GridMap,
        cell_m: f64,
        tasks: &[GridTask],
    ) -> Result<GridWorld, GridError> {
        check_cell_size(map, cell_m)?;
        check_lines(map_name, map, tasks)?;
        let regions = Regions::of(map);
        let region = match tasks.first() {
            Some(_) => region_of_tasks(map, &regions, tasks)?,
            None => regions
                .largest()
                .ok_or(GridError::NoPassable { cells: map.cells() })?,
        };
        let actual = regions.size(region);
        if actual > MAX_VERTICES {
            let (line, limit) = (tasks.first().map(|task| task.line), MAX_VERTICES);
            return Err(GridError::TooManyVertices {
                line,
                limit,
                actual,
            });
        }
        let cells = regions.cells(map, region);
        let roadmap = roadmap_of(base_name(map_name), map, cell_m, &cells)?;
        let mut world = GridWorld {
            roadmap,
            cells,
            left_out: map.passable_cells() - actual,
            lines: tasks.to_vec(),
            tasks: Vec::new(),
        };
        let vertex = |cell| world.vertex(cell).expect("tasks lie in the region");
        world.tasks = tasks
            .iter()
            .map(|task| (vertex(task.start), vertex(task.goal)))
            .collect();
        Ok(world)
    }

    /// The roadmap.
    pub fn roadmap(&self) -> &Roadmap {
        &self.roadmap
    }

    /// Start and goal of each task, in order.
    pub fn tasks(&self) -> &[(VertexId, VertexId)] {
        &self.tasks
    }

    /// The same tasks as their file has them: with lines, cells and published lengths.
    pub fn lines(&self) -> &[GridTask] {
        &self.lines
    }

    /// The cell of a vertex.
    ///
    /// # Panics
    /// When `v` is not in the roadmap: a bug in the caller.
    pub fn cell(&self, v: VertexId) -> Cell {
        self.cells[v.0 as usize]
    }

    /// The vertex of a cell; `None` for walls, for what is outside the map and for cells of other
    /// regions.
    pub fn vertex(&self, cell: Cell) -> Option<VertexId> {
        // Cells are ordered as vertices are numbered.
        let at = self.cells.binary_search(&cell).ok()?;
        Some(VertexId(at as u32))
    }

    /// How many passable cells of the map are no vertices, because they lie in other regions.
    pub fn left_out(&self) -> usize {
        self.left_out
    }

    /// The tasks that keep this from being a well-formed instance, none if it is one: see
    /// [`well_formed`].
    pub fn blocked(&self) -> Vec<Blocked> {
        well_formed(&self.roadmap, &self.tasks)
    }

    /// A blocked task in words, by line and cells.
    ///
    /// ```
    /// use farside_worlds::movingai::{GridMap, GridWorld, TaskList};
    /// let map = GridMap::from_movingai(b"type octile\nheight 1\nwidth 3\nmap\n...\n")?;
    /// let scen = "version 1\n0\ta.map\t3\t1\t0\t0\t2\t0\t2\n0\ta.map\t3\t1\t1\t0\t1\t0\t0\n";
    /// let tasks = TaskList::from_movingai(scen.as_bytes())?;
    /// let world = GridWorld::new("a.map", &map, 1.0, tasks.tasks())?;
    /// assert_eq!(
    ///     world.explain(&world.blocked()[0]),
    ///     "line 2: every way from (0, 0) to (2, 0) leads over the start or goal of another \
    ///      task; the best over (1, 0) of line 3"
    /// );
    /// # Ok::<(), farside_worlds::movingai::GridError>(())
    /// ```
    ///
    /// # Panics
    /// When it is not of this world: a bug in the caller.
    pub fn explain(&self, blocked: &Blocked) -> String {
        let task = &self.lines[blocked.task];
        let met = blocked.over.iter().map(|&(vertex, other)| {
            let (cell, line) = (self.cell(vertex), self.lines[other].line);
            format!("{cell} of line {line}")
        });
        let met: Vec<String> = met.collect();
        format!(
            "line {}: every way from {} to {} leads over the start or goal of another task; the \
             best over {}",
            task.line,
            task.start,
            task.goal,
            met.join(", ")
        )
    }
}

fn check_cell_size(map: &GridMap, cell_m: f64) -> Result<(), GridError> {
    let most_m = MAX_COORDINATE_M / f64::from(map.width().max(map.height()));
    // Below a millimetre, centres of cells far from the corner would no longer be told apart well.
    if (0.001..=most_m).contains(&cell_m) {
        return Ok(());
    }
    Err(GridError::Setting {
        setting: "the size of a cell",
        expected: format!("from 0.001 m to {most_m} m on this map"),
        found: format!("{cell_m} m"),
    })
}

/// Checks what can be told from each line and the map, and that ends are distinct.
fn check_lines(map_name: &str, map: &GridMap, tasks: &[GridTask]) -> Result<(), GridError> {
    let expected_name = base_name(map_name);
    let expected = (map.width(), map.height());
    let (mut starts, mut goals) = (BTreeMap::new(), BTreeMap::new());
    for task in tasks {
        let at = |problem| Err(GridError::at(task.line, problem));
        if base_name(&task.map) != expected_name {
            let found = crate::contacts::shown(&task.map);
            let expected = expected_name.to_owned();
            return at(GridProblem::MapName { found, expected });
        }
        if task.size != expected {
            let found = task.size;
            return at(GridProblem::Size { found, expected });
        }
        for (end, cell) in [(End::Start, task.start), (End::Goal, task.goal)] {
            let Some(terrain) = map.terrain(cell) else {
                let (width, height) = expected;
                return at(GridProblem::Outside {
                    end,
                    cell,
                    width,
                    height,
                });
            };
            if !map.is_passable(cell) {
                return at(GridProblem::Wall { end, cell, terrain });
            }
            let taken = match end {
                End::Start => &mut starts,
                End::Goal => &mut goals,
            };
            if let Some(other_line) = taken.insert(cell, task.line) {
                return at(GridProblem::Duplicate {
                    end,
                    cell,
                    other_line,
                });
            }
        }
    }
    Ok(())
}

/// The one region of all tasks, of which there is at least one and all begin and end on passable
/// cells.
fn region_of_tasks(map: &GridMap, regions: &Regions, tasks: &[GridTask]) -> Result<u32, GridError> {
    let region = |cell| {
        let region = regions.region(map, cell);
        region.expect("a passable cell has a region")
    };
    let first = &tasks[0];
    for task in tasks {
        let (start, goal) = (task.start, task.goal);
        let (from, to) = (region(start), region(goal));
        if from != to {
            let (start_cells, goal_cells) = (regions.size(from), regions.size(to));
            let problem = GridProblem::Apart {
                start,
                goal,
                start_cells,
                goal_cells,
            };
            return Err(GridError::at(task.line, problem));
        }
        if from != region(first.start) {
            let problem = GridProblem::OtherRegion {
                start,
                other_line: first.line,
                other_start: first.start,
            };
            return Err(GridError::at(task.line, problem));
        }
    }
    Ok(region(first.start))
}

/// The roadmap of these cells, which are sorted and make one region.
fn roadmap_of(
    name: &str,
    map: &GridMap,
    cell_m: f64,
    cells: &[Cell],
) -> Result<Roadmap, GridError> {
    let centre = |cell: &Cell| {
        let south = map.height() - cell.y;
        Point2::new(
            (f64::from(cell.x) + 0.5) * cell_m,
            (f64::from(south) - 0.5) * cell_m,
        )
    };
    let vertex = |cell: &Cell| {
        let at = cells.binary_search(cell).ok()?;
        Some(VertexId(at as u32))
    };
    let mut edges = Vec::with_capacity(2 * cells.len());
    for (cell, here) in cells.iter().zip((0..).map(VertexId)) {
        for (dx, dy) in [(1, 0), (0, 1)] {
            let (x, y) = (cell.x + dx, cell.y + dy);
            edges.extend(vertex(&Cell { x, y }).map(|there| (here, there)));
        }
    }
    let range = |of: fn(&Cell) -> u32| {
        let all = cells.iter().map(of);
        (all.clone().min(), all.max())
    };
    let (west, east) = range(|cell| cell.x);
    let (north, south) = range(|cell| cell.y);
    let outermost = |cell: &Cell| {
        let (x, y) = (Some(cell.x), Some(cell.y));
        x == west || x == east || y == north || y == south
    };
    let boundary = cells
        .iter()
        .zip((0..).map(VertexId))
        .filter(|(cell, _)| outermost(cell))
        .map(|(_, vertex)| vertex)
        .collect();
    let positions_m = cells.iter().map(centre).collect();
    Ok(Roadmap::on_lattice(name, positions_m, edges, boundary)?)
}

/// What comes after the last folder.
fn base_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}
