//! Random maps and tasks, as the benchmark's `random` maps are made: so many cells are walls,
//! wherever they fall.

use farside::random::{RandomKey, Stream};

use super::error::GridError;
use super::regions::Regions;
use super::{Cell, GridMap, GridTask, MAX_CELLS, MAX_TASKS, TaskList};

impl GridMap {
    /// A map of which a share of the cells, rounded down to a whole number of them, are walls. The
    /// same seed gives the same map.
    ///
    /// ```
    /// use farside_worlds::movingai::GridMap;
    /// let map = GridMap::random(32, 32, 0.1, 1)?;
    /// assert_eq!(map.passable_cells(), 1024 - 102);
    /// assert!(GridMap::random(32, 32, 1.5, 1).is_err());
    /// # Ok::<(), farside_worlds::movingai::GridError>(())
    /// ```
    ///
    /// # Errors
    /// When a side is 0, there are more than [`MAX_CELLS`] cells, or the share is not from 0 to 1.
    pub fn random(width: u32, height: u32, walls: f64, seed: u64) -> Result<GridMap, GridError> {
        let cells = u64::from(width) * u64::from(height);
        if cells == 0 || cells > MAX_CELLS as u64 {
            return Err(GridError::Setting {
                setting: "the size of a map",
                expected: format!("from 1 to {MAX_CELLS} cells"),
                found: format!("{width} times {height} cells"),
            });
        }
        if !(0.0..=1.0).contains(&walls) {
            return Err(GridError::Setting {
                setting: "the share of walls",
                expected: "from 0 to 1".to_owned(),
                found: walls.to_string(),
            });
        }
        let count = (walls * cells as f64) as usize;
        let mut is_wall = vec![false; cells as usize];
        is_wall[..count].fill(true);
        RandomKey::new(seed)
            .text("grid_map")
            .stream()
            .shuffle(&mut is_wall);
        Ok(GridMap::of_walls(width, height, &is_wall))
    }
}

impl TaskList {
    /// So many random tasks in the largest region of a map whose file is called `map_name`. No cell
    /// is the start or goal of two, as in the benchmark's own files. The same seed gives the same
    /// tasks, and fewer tasks are the first of more.
    ///
    /// ```
    /// use farside_worlds::movingai::{GridMap, GridWorld, TaskList};
    /// let map = GridMap::random(16, 16, 0.2, 7)?;
    /// let tasks = TaskList::random("rubble.map", &map, 20, 7)?;
    /// let world = GridWorld::new("rubble.map", &map, 1.0, tasks.first(20)?)?;
    /// assert_eq!(world.tasks().len(), 20);
    /// # Ok::<(), farside_worlds::movingai::GridError>(())
    /// ```
    ///
    /// # Errors
    /// When there are more than [`MAX_TASKS`] tasks or more than half the region's cells, or the
    /// name is empty or has white space other than single blanks in it.
    pub fn random(
        map_name: &str,
        map: &GridMap,
        count: usize,
        seed: u64,
    ) -> Result<TaskList, GridError> {
        if map_name.is_empty() || !map_name.split(' ').all(is_word) {
            return Err(GridError::Setting {
                setting: "the name of a map",
                expected: "words with single blanks between them".to_owned(),
                found: format!("{map_name:?}"),
            });
        }
        let regions = Regions::of(map);
        let largest = regions.largest();
        let cells = largest.map_or_else(Vec::new, |region| regions.cells(map, region));
        let most = (cells.len() / 2).min(MAX_TASKS);
        if count > most {
            return Err(GridError::Setting {
                setting: "the number of tasks",
                expected: format!("from 0 to {most} on this map"),
                found: count.to_string(),
            });
        }
        let mut stream = RandomKey::new(seed).text("grid_tasks").stream();
        let ends = drawn(cells, 2 * count, &mut stream);
        let task = |ends: &[Cell]| {
            let (start, goal) = (ends[0], ends[1]);
            let length = map.octile_length(start, goal);
            let length = length.expect("a region's cells can be reached from each other");
            GridTask {
                line: 0,
                bucket: (length / 4.0) as u32,
                map: map_name.to_owned(),
                size: (map.width(), map.height()),
                start,
                goal,
                // The published files have eight decimals.
                optimal_length: libm::round(length * 1.0e8) / 1.0e8,
            }
        };
        Ok(TaskList::of(ends.chunks_exact(2).map(task).collect()))
    }
}

fn is_word(word: &str) -> bool {
    !word.is_empty() && !word.contains(|c: char| c.is_whitespace() || c.is_control())
}

/// The first `count` items of a random order.
fn drawn<T>(mut items: Vec<T>, count: usize, stream: &mut Stream) -> Vec<T> {
    for at in 0..count {
        let left = (items.len() - at) as u64;
        items.swap(at, at + stream.below(left) as usize);
    }
    items.truncate(count);
    items
}
