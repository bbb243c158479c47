//! Properties of maps and tasks, for random ones and for random bytes.

use std::f64::consts::SQRT_2;

use proptest::prelude::*;

use super::super::*;

fn terrain() -> impl Strategy<Value = char> {
    prop::sample::select(".....GS@@OTW".chars().collect::<Vec<_>>())
}

/// Maps of every terrain, as text.
fn map_text(most: u32) -> impl Strategy<Value = String> {
    (1..=most, 1..=most).prop_flat_map(|(width, height)| {
        let row = prop::collection::vec(terrain(), width as usize)
            .prop_map(|row| row.into_iter().collect::<String>() + "\n");
        prop::collection::vec(row, height as usize).prop_map(move |rows| {
            format!(
                "type octile\nheight {height}\nwidth {width}\nmap\n{}",
                rows.concat()
            )
        })
    })
}

fn grid(most: u32) -> impl Strategy<Value = GridMap> {
    map_text(most).prop_map(|text| GridMap::from_movingai(text.as_bytes()).unwrap())
}

fn task() -> impl Strategy<Value = GridTask> {
    let cell = || (any::<u32>(), any::<u32>()).prop_map(|(x, y)| Cell { x, y });
    let name = "[^\\s\\p{Cc}]{1,8}( [^\\s\\p{Cc}]{1,8})?";
    let length = 0.0..f64::MAX;
    (
        any::<u32>(),
        name,
        any::<(u32, u32)>(),
        cell(),
        cell(),
        length,
    )
        .prop_map(
            |(bucket, map, size, start, goal, optimal_length)| GridTask {
                line: 0,
                bucket,
                map,
                size,
                start,
                goal,
                optimal_length,
            },
        )
}

fn all_cells(map: &GridMap) -> Vec<Cell> {
    let rows = 0..map.height();
    rows.flat_map(|y| (0..map.width()).map(move |x| Cell { x, y }))
        .collect()
}

/// Lengths from one cell to all, by relaxing every pair of cells until nothing changes. A diagonal
/// step needs both cells beside it.
fn relaxed(map: &GridMap, from: Cell, diagonal: bool) -> Vec<f64> {
    let cells = all_cells(map);
    let mut lengths = vec![f64::INFINITY; cells.len()];
    if let Some(at) = cells
        .iter()
        .position(|cell| *cell == from && map.is_passable(from))
    {
        lengths[at] = 0.0;
    }
    let step = |a: Cell, b: Cell| {
        let free = |x, y| map.is_passable(Cell { x, y });
        match (a.x.abs_diff(b.x), a.y.abs_diff(b.y)) {
            _ if !free(b.x, b.y) => None,
            (0, 1) | (1, 0) => Some(1.0),
            (1, 1) if diagonal && free(a.x, b.y) && free(b.x, a.y) => Some(SQRT_2),
            _ => None,
        }
    };
    let mut changed = true;
    while std::mem::take(&mut changed) {
        for (i, &a) in cells
            .iter()
            .enumerate()
            .filter(|(_, a)| map.is_passable(**a))
        {
            for (j, &b) in cells.iter().enumerate() {
                let length = step(a, b).map_or(f64::INFINITY, |step| lengths[i] + step);
                if length < lengths[j] - 1.0e-9 {
                    lengths[j] = length;
                    changed = true;
                }
            }
        }
    }
    lengths
}

/// An error names a line that the file has.
fn check_line(text: &[u8], error: &GridError) {
    assert!(!error.to_string().is_empty());
    let lines = text.iter().filter(|byte| **byte == b'\n').count() + 1;
    let line = error.line();
    assert!(
        line.is_none_or(|line| (1..=lines).contains(&line)),
        "{error}"
    );
}

proptest! {
    #[test]
    fn a_map_reads_back_as_it_was_written(text in map_text(12)) {
        let map = GridMap::from_movingai(text.as_bytes()).unwrap();
        prop_assert_eq!(map.to_movingai(), text);
    }

    #[test]
    fn a_random_map_reads_back(width in 1u32..40, height in 1u32..40, walls in 0.0..=1.0, seed: u64) {
        let map = GridMap::random(width, height, walls, seed).unwrap();
        let again = GridMap::from_movingai(map.to_movingai().as_bytes()).unwrap();
        prop_assert_eq!(&again, &map);
        let expected = (walls * f64::from(width * height)).floor();
        prop_assert_eq!((map.cells() - map.passable_cells()) as f64, expected);
    }

    #[test]
    fn tasks_read_back(tasks in prop::collection::vec(task(), 0..6)) {
        let list = TaskList::of(tasks);
        let again = TaskList::from_movingai(list.to_movingai().as_bytes()).unwrap();
        prop_assert_eq!(again, list);
    }

    /// Roadmaps of one region: its cells, its edges, its distances and its places, held against the
    /// map itself.
    #[test]
    fn a_world_is_its_region(map in grid(7), pick: prop::sample::Index, cell_m in 0.001..100.0) {
        let free: Vec<Cell> =
            all_cells(&map).into_iter().filter(|cell| map.is_passable(*cell)).collect();
        prop_assume!(!free.is_empty());
        let start = *pick.get(&free);
        let list = TaskList::of(vec![GridTask {
            line: 0,
            bucket: 0,
            map: "x.map".to_owned(),
            size: (map.width(), map.height()),
            start,
            goal: start,
            optimal_length: 0.0,
        }]);
        let world = GridWorld::new("x.map", &map, cell_m, list.tasks()).unwrap();
        let roadmap = world.roadmap();
        let from = world.tasks()[0].0;
        let lengths = relaxed(&map, start, false);
        for (cell, length) in all_cells(&map).into_iter().zip(lengths) {
            prop_assert_eq!(world.vertex(cell).is_some(), length.is_finite());
            let Some(vertex) = world.vertex(cell) else { continue };
            prop_assert_eq!(world.cell(vertex), cell);
            prop_assert_eq!(f64::from(roadmap.distance(from, vertex)), length);
            let p = roadmap.position_m(vertex);
            prop_assert_eq!((p.x / cell_m).floor(), f64::from(cell.x));
            prop_assert_eq!((p.y / cell_m).floor(), f64::from(map.height() - 1 - cell.y));
        }
        prop_assert_eq!(roadmap.len() + world.left_out(), free.len());
        for u in roadmap.vertices() {
            for v in roadmap.vertices() {
                let (a, b) = (world.cell(u), world.cell(v));
                let beside = a.x.abs_diff(b.x) + a.y.abs_diff(b.y) == 1;
                prop_assert_eq!(roadmap.are_adjacent(u, v), beside);
            }
        }
        // Without tasks: no region is larger.
        let largest = GridWorld::new("x.map", &map, cell_m, &[]).unwrap();
        prop_assert!(largest.roadmap().len() >= roadmap.len());
    }

    /// Lengths with diagonal steps are those of a slower search, and bound those without.
    #[test]
    fn octile_lengths(map in grid(7), pick: prop::sample::Index) {
        let cells = all_cells(&map);
        let from = *pick.get(&cells);
        let (octile, square) = (relaxed(&map, from, true), relaxed(&map, from, false));
        for ((&to, octile), square) in cells.iter().zip(octile).zip(square) {
            let found = map.octile_length(from, to);
            prop_assert_eq!(found.is_some(), octile.is_finite());
            let Some(found) = found else { continue };
            prop_assert!((found - octile).abs() < 1.0e-6, "{} for {}", found, octile);
            prop_assert!(found <= square + 1.0e-9 && square <= SQRT_2 * found + 1.0e-9);
        }
    }

    #[test]
    fn random_tasks_fit_their_map(seed: u64, walls in 0.0..0.6, count in 0usize..20) {
        let map = GridMap::random(9, 7, walls, seed).unwrap();
        let Ok(tasks) = TaskList::random("a b.map", &map, count, seed) else {
            // Too few cells in the largest region.
            let world = GridWorld::new("a b.map", &map, 1.0, &[]).unwrap();
            prop_assert!(world.roadmap().len() < 2 * count);
            return Ok(());
        };
        let world = GridWorld::new("a b.map", &map, 1.0, tasks.tasks()).unwrap();
        prop_assert_eq!(world.tasks().len(), count);
        let mut ends: Vec<_> = world.tasks().iter().flat_map(|&(a, b)| [a, b]).collect();
        ends.sort_unstable();
        ends.dedup();
        prop_assert_eq!(ends.len(), 2 * count, "no cell is the end of two");
    }

    /// No bytes panic, and neither do files with a few wrong bytes.
    #[test]
    fn any_bytes_give_an_answer(
        bytes in prop::collection::vec(any::<u8>(), 0..200),
        map in map_text(5),
        tasks in prop::collection::vec(task(), 0..4),
        spoil in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        cut: prop::sample::Index,
    ) {
        let spoilt = |text: String| {
            let mut text = text.into_bytes();
            text.truncate(cut.index(2 * text.len()));
            for (at, byte) in &spoil {
                if !text.is_empty() {
                    let at = at.index(text.len());
                    text[at] = *byte;
                }
            }
            text
        };
        let scen = spoilt(TaskList::of(tasks).to_movingai());
        for text in [bytes, spoilt(map), scen] {
            match GridMap::from_movingai(&text) {
                Ok(map) => drop(GridWorld::new("x.map", &map, 1.0, &[])),
                Err(error) => check_line(&text, &error),
            }
            if let Err(error) = TaskList::from_movingai(&text) {
                check_line(&text, &error);
            }
        }
    }
}

/// The published lengths of the built-in tasks, each by the slow search of this file.
#[test]
fn published_lengths_are_octile_and_cut_no_corners() {
    let file = Builtin::find("rubble-32-32-10").unwrap();
    let map = GridMap::from_movingai(file.map).unwrap();
    let tasks = TaskList::from_movingai(file.tasks).unwrap();
    let world = GridWorld::new(file.map_name, &map, 1.0, tasks.tasks()).unwrap();
    let cells = all_cells(&map);
    for task in tasks.first(12).unwrap() {
        let at = cells.iter().position(|cell| *cell == task.goal).unwrap();
        let length = relaxed(&map, task.start, true)[at];
        assert!(
            (length - task.optimal_length).abs() < 1.0e-8,
            "line {}",
            task.line
        );
        assert_eq!(task.bucket, (length / 4.0) as u32);
    }
    for (task, &(start, goal)) in tasks.tasks().iter().zip(world.tasks()) {
        let steps = f64::from(world.roadmap().distance(start, goal));
        assert!(task.optimal_length <= steps + 1.0e-7);
        assert!(steps <= SQRT_2 * task.optimal_length + 1.0e-7);
    }
}
