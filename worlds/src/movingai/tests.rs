//! What maps and tasks come to, every mistake by its line, and properties against slow and simple
//! reckonings of the same.

mod properties;

use super::*;
use crate::ids::VertexId;
use crate::roadmap::MAX_VERTICES;
use crate::{RoadmapError, SensorNetwork};

const HEADER: &str = "type octile\nheight 2\nwidth 3\nmap\n";

fn map(text: &str) -> GridMap {
    GridMap::from_movingai(text.as_bytes()).unwrap()
}

fn map_error(text: &str) -> String {
    GridMap::from_movingai(text.as_bytes())
        .unwrap_err()
        .to_string()
}

fn tasks(text: &str) -> TaskList {
    TaskList::from_movingai(text.as_bytes()).unwrap()
}

fn tasks_error(text: &str) -> String {
    TaskList::from_movingai(text.as_bytes())
        .unwrap_err()
        .to_string()
}

/// Two regions: of five cells in the west, and of one in the south-east.
fn parted() -> GridMap {
    map("type octile\nheight 3\nwidth 4\nmap\n..@.\n.T@@\n.G@S\n")
}

/// The world of tasks `start-x start-y goal-x goal-y` on `map`.
fn world(map: &GridMap, ends: &[[u32; 4]]) -> Result<GridWorld, GridError> {
    let mut text = "version 1\n".to_owned();
    for [a, b, c, d] in ends {
        let (width, height) = (map.width(), map.height());
        text += &format!("0 x.map {width} {height} {a} {b} {c} {d} 0\n");
    }
    GridWorld::new("x.map", map, 1.0, tasks(&text).tasks())
}

fn world_error(map: &GridMap, ends: &[[u32; 4]]) -> String {
    world(map, ends).unwrap_err().to_string()
}

#[test]
fn what_is_let_pass_in_maps() {
    let plain = map(&format!("{HEADER}.G.\nS@T\n"));
    let odd = "type  octile \r\nwidth 3\r\nheight 2\r\nmap\r\n.G.  \r\nS@T\r\n\r\n \n";
    assert_eq!(map(odd), plain);
    assert_eq!(map(&format!("{HEADER}.G.\nS@T")), plain);
    assert_eq!(plain.terrain(Cell { x: 2, y: 1 }), Some('T'));
    assert_eq!(plain.terrain(Cell { x: 3, y: 1 }), None);
    assert_eq!(plain.passable_cells(), 4);
}

#[test]
fn each_mistake_in_a_map_has_its_line() {
    let cases = [
        (
            "",
            "line 1: the file ends here: expected `type octile` next",
        ),
        (
            "type tile\n",
            "line 1: \"type tile\": expected `type octile`",
        ),
        (
            "type octile\n",
            "line 1: the file ends here: expected `height` and a number next",
        ),
        (
            "type octile\nheight 2\nheight 2\n",
            "line 3: \"height 2\": expected `width` and a number",
        ),
        (
            "type octile\nmap\n..\n",
            "line 2: \"map\": expected `height` and a number",
        ),
        (
            "type octile\nheight 0\nwidth 3\nmap\n",
            "line 2, column 8: height \"0\": expected a whole number from 1 on",
        ),
        (
            "type octile\nheight 2\nwidth -3\nmap\n",
            "line 3, column 7: width \"-3\": expected a whole number from 1 on",
        ),
        (
            "type octile\nheight\nwidth 3\nmap\n",
            "line 2, column 8: height \"\": expected a whole number from 1 on",
        ),
        (
            "type octile\nheight 4294967295\nwidth 4294967295\nmap\n",
            "line 3: a map of 4294967295 times 4294967295 cells; at most 4194304 cells are read",
        ),
        (
            "type octile\nheight 2\nwidth 3\n...\n...\n",
            "line 4: \"...\": expected `map`, and then the rows",
        ),
        (
            HEADER,
            "line 4: the file ends here: expected row 0 of rows 0 to 1 next",
        ),
        (
            "type octile\nheight 2\nwidth 3\nmap\n...\n",
            "line 5: the file ends here: expected row 1 of rows 0 to 1 next",
        ),
        (
            "type octile\nheight 2\nwidth 3\nmap\n...\n..\n",
            "line 6: row 1 has 2 cells: expected 3, the width of the map",
        ),
        (
            "type octile\nheight 2\nwidth 3\nmap\n....\n...\n",
            "line 5: row 0 has 4 cells: expected 3, the width of the map",
        ),
        (
            "type octile\nheight 2\nwidth 3\nmap\n...\n...\n\n...\n",
            "line 8: \"...\" after the last row: expected 2 rows, the height of the map",
        ),
        (
            "type octile\nheight 2\nwidth 3\nmap\n.\u{e9}.\n...\n",
            "line 5, column 2: '\u{e9}' is no terrain: expected one of `.`, `G`, `S` (passable), \
             `@`, `O`, `T`, `W` (not)",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(map_error(text), expected);
    }
    let bytes = [HEADER.as_bytes(), b"...\n\xff..\n"].concat();
    let error = GridMap::from_movingai(&bytes).unwrap_err();
    assert_eq!(error, GridError::NotText { line: 6 });
    let large = GridMap::from_movingai(&vec![b'.'; MAX_FILE_BYTES + 1]).unwrap_err();
    assert!(matches!(large, GridError::TooLarge { .. }), "{large}");
}

#[test]
fn what_is_let_pass_in_tasks() {
    let plain = tasks("version 1\n7\ta.map\t3\t2\t0\t1\t2\t0\t2.5\n");
    let odd = tasks("version 1.0\r\n 7  a.map 3 2\u{2003}0 1 2 0 2.5 \r\n\r\n");
    assert_eq!(odd, plain);
    // With tabs, a name may have blanks.
    let named = tasks("version 1\n7\tmaps/a b.map \t3\t2\t0\t1\t2\t0\t2.5\t\n");
    assert_eq!(named.tasks()[0].map, "maps/a b.map");
    assert_eq!(tasks("version 1\n").tasks(), []);
}

#[test]
fn each_mistake_in_a_task_has_its_line() {
    let form = "bucket map width height start-x start-y goal-x goal-y optimal-length, with tabs \
                between";
    let cases = [
        (
            "",
            "line 1: the file ends here: expected `version 1` next".to_owned(),
        ),
        (
            "version 2\n",
            "line 1: \"version 2\": expected `version 1`".to_owned(),
        ),
        (
            "0\ta.map\t3\t2\t0\t0\t1\t1\t1\n",
            "line 1: \"0\\ta.map\\t3\\t2\\t0\\t0\\t1\\t1\\t1\": expected `version 1`".to_owned(),
        ),
        (
            "version 1\n\n0\ta.map\t3\t2\t0\t0\t1\t1\n",
            format!("line 3: the optimal length is missing: expected `{form}`"),
        ),
        (
            "version 1\n0 a.map 3\u{2003}\n",
            format!("line 2: the map height is missing: expected `{form}`"),
        ),
        (
            "version 1\n0\ta.map\t3\t2\t0\t0\t1\t1\t1\t9\n",
            format!("line 2, column 23: \"9\" is one field too many: expected `{form}`"),
        ),
        (
            "version 1\n0\t\t3\t2\t0\t0\t1\t1\t1\n",
            "line 2, column 3: map \"\": expected a file name".to_owned(),
        ),
        (
            "version 1\n0 \u{e9}.map 3 2 +1 0 1 1 1\n",
            "line 2, column 13: start x \"+1\": expected a whole number from 0 to \
             4294967295"
                .to_owned(),
        ),
        (
            "version 1\n0\ta.map\t3\t2\t0\t0\t1\t4294967296\t1\n",
            "line 2, column 19: goal y \"4294967296\": expected a whole number from 0 to \
             4294967295"
                .to_owned(),
        ),
        (
            "version 1\n0\ta.map\t3\t2\t0\t0\t1\t1\tnan\n",
            "line 2, column 21: optimal length \"nan\": expected a number of \
             cells, 0 or more"
                .to_owned(),
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(tasks_error(text), expected);
    }
    let many = format!("version 1\n{}", "0 a 1 1 0 0 0 0 0\n".repeat(MAX_TASKS + 1));
    let limit = GridProblem::TooManyTasks { limit: MAX_TASKS };
    let error = TaskList::from_movingai(many.as_bytes()).unwrap_err();
    assert_eq!(error, GridError::at(MAX_TASKS + 2, limit));
    let short = tasks("version 1\n").first(1).unwrap_err().to_string();
    assert_eq!(
        short,
        "1 tasks are needed, one for each rover; the file has 0"
    );
}

#[test]
fn each_task_that_disagrees_with_the_map_has_its_line() {
    let map = parted();
    let cases: [(&[[u32; 4]], &str); 8] = [
        (
            &[[0, 0, 1, 0], [4, 0, 0, 1]],
            "line 3: the start (4, 0) is outside the map: expected x from 0 to 3 and y from 0 to 2",
        ),
        (
            &[[0, 0, 0, 3]],
            "line 2: the goal (0, 3) is outside the map: expected x from 0 to 3 and y from 0 to 2",
        ),
        (
            &[[1, 1, 0, 0]],
            "line 2: the start (1, 1) is in a wall, 'T': expected a passable cell",
        ),
        (
            &[[0, 0, 2, 0]],
            "line 2: the goal (2, 0) is in a wall, '@': expected a passable cell",
        ),
        (
            &[[0, 0, 1, 0], [0, 1, 0, 2], [0, 0, 0, 1]],
            "line 4: the start (0, 0) is that of line 2, too: expected each start once",
        ),
        (
            &[[0, 0, 1, 0], [0, 1, 1, 0]],
            "line 3: the goal (1, 0) is that of line 2, too: expected each goal once",
        ),
        (
            &[[0, 0, 1, 0], [0, 2, 3, 2]],
            "line 3: no way leads from the start (0, 2) to the goal (3, 2): expected both in one \
             region of the map; that of the start has 5 cells, that of the goal 1",
        ),
        (
            &[[0, 0, 1, 0], [3, 2, 3, 2]],
            "line 3: no way leads from the start (3, 2) to (0, 0), the start of line 2: expected \
             all tasks in one region of the map, because a roadmap is connected",
        ),
    ];
    for (ends, expected) in cases {
        assert_eq!(world_error(&map, ends), expected);
    }
    let error = |line: &str| {
        let tasks = tasks(&format!("version 1\n{line}\n"));
        let error = GridWorld::new("maps/x.map", &map, 1.0, tasks.tasks()).unwrap_err();
        assert_eq!(error.line(), Some(2));
        error.to_string()
    };
    assert_eq!(
        error("0 maps/y.map 4 3 0 0 1 0 1"),
        "line 2: the task is for map \"maps/y.map\": expected \"x.map\", the map it is used with"
    );
    assert_eq!(
        error("0 other/x.map 3 4 0 0 1 0 1"),
        "line 2: the task is for a map of 3 times 4: expected 4 times 3, the size of the map"
    );
}

#[test]
fn a_task_may_end_where_it_or_another_begins() {
    let world = world(&parted(), &[[0, 0, 0, 0], [1, 0, 0, 1], [0, 1, 1, 0]]).unwrap();
    let (start, goal) = world.tasks()[0];
    assert_eq!(start, goal);
    assert_eq!(world.lines()[2].line, 4);
    let blocked: Vec<usize> = world.blocked().iter().map(|b| b.task).collect();
    assert_eq!(blocked, [1, 2]);
}

#[test]
fn tasks_choose_the_region() {
    let map = parted();
    let largest = world(&map, &[]).unwrap();
    assert_eq!((largest.roadmap().len(), largest.left_out()), (5, 2));
    let east = world(&map, &[[3, 2, 3, 2]]).unwrap();
    assert_eq!((east.roadmap().len(), east.left_out()), (1, 6));
    assert_eq!(east.vertex(Cell { x: 0, y: 0 }), None);
    let boundary: Vec<Cell> = largest
        .roadmap()
        .boundary()
        .iter()
        .map(|&v| largest.cell(v))
        .collect();
    assert_eq!(
        boundary.len(),
        5,
        "each cell lies in an outermost row or column"
    );
    assert_eq!(largest.roadmap().name(), "x.map");
}

#[test]
fn north_is_up() {
    let map = map("type octile\nheight 2\nwidth 3\nmap\n...\n.@@\n");
    let world = GridWorld::new("x.map", &map, 10.0, &[]).unwrap();
    let at = |x, y| {
        let vertex = world.vertex(Cell { x, y }).unwrap();
        let p = world.roadmap().position_m(vertex);
        (vertex.0, p.x, p.y)
    };
    assert_eq!(at(0, 0), (0, 5.0, 15.0));
    assert_eq!(at(2, 0), (2, 25.0, 15.0));
    assert_eq!(at(0, 1), (3, 5.0, 5.0));
}

#[test]
fn what_makes_no_roadmap() {
    let walls = map(&format!("{HEADER}@@@\nTWO\n"));
    let error = world(&walls, &[]).unwrap_err();
    assert_eq!(error, GridError::NoPassable { cells: 6 });
    let open = GridMap::random(512, 257, 0.0, 0).unwrap();
    assert_eq!(
        world_error(&open, &[]),
        "the map's largest region has 131584 passable cells; a roadmap may have 131072 vertices"
    );
    assert_eq!(
        world_error(&open, &[[0, 0, 9, 9]]),
        "the region of line 2's task has 131584 passable cells; a roadmap may have 131072 vertices"
    );
    for cell_m in [0.0, -1.0, f64::NAN, f64::INFINITY, 3.4e5] {
        let error = GridWorld::new("x.map", &map(&format!("{HEADER}...\n...\n")), cell_m, &[]);
        assert!(matches!(error, Err(GridError::Setting { .. })), "{cell_m}");
    }
}

#[test]
fn the_largest_roadmap_is_a_full_grid_of_512_by_256() {
    let open = GridMap::random(512, 256, 0.0, 0).unwrap();
    let world = world(&open, &[]).unwrap();
    let roadmap = world.roadmap();
    assert_eq!(
        (roadmap.len(), roadmap.edge_count()),
        (MAX_VERTICES, 511 * 256 + 512 * 255)
    );
    assert_eq!(roadmap.diameter(), 511 + 255);
    assert_eq!(roadmap.boundary().len(), 2 * (511 + 255));
    let one_more = (0..=MAX_VERTICES)
        .map(|x| nalgebra::Point2::new(x as f64, 0.0))
        .collect();
    let error = crate::Roadmap::new("long", one_more, vec![], vec![VertexId(0)]).unwrap_err();
    assert!(matches!(
        error,
        RoadmapError::TooManyVertices {
            limit: 131_072,
            actual: 131_073
        }
    ));
}

#[test]
fn the_built_in_files_are_the_generators() {
    let file = Builtin::find("rubble-32-32-10").unwrap();
    let map = GridMap::from_movingai(file.map).unwrap();
    assert_eq!(map, GridMap::random(32, 32, 0.1, 4).unwrap());
    let tasks = TaskList::from_movingai(file.tasks).unwrap();
    assert_eq!(
        tasks,
        TaskList::random(file.map_name, &map, 200, 4).unwrap()
    );
    let fewer = TaskList::random(file.map_name, &map, 5, 4).unwrap();
    assert_eq!(fewer.tasks(), tasks.first(5).unwrap());
    let world = GridWorld::new(file.map_name, &map, 1.0, tasks.tasks()).unwrap();
    assert_eq!((world.roadmap().len(), world.left_out()), (921, 1));
    // As the documentation of `Builtin` says.
    let blocked = |count| crate::well_formed(world.roadmap(), &world.tasks()[..count]).len();
    assert_eq!(blocked(71), 0);
    assert!(blocked(72) > 0);
}

/// Every seed finds a placement at the default radius, and [`SensorNetwork`] accepts only
/// placements where owners of both ends of every edge are the same or radio neighbours.
#[test]
fn networks_can_be_placed_over_grids() {
    let rubble = GridMap::from_movingai(Builtin::find("rubble-32-32-10").unwrap().map).unwrap();
    for (map, cell_m) in [
        (rubble, 1.0),
        (GridMap::random(32, 32, 0.2, 1).unwrap(), 10.0),
        (GridMap::random(32, 32, 0.0, 1).unwrap(), 0.1),
        (GridMap::random(48, 12, 0.15, 2).unwrap(), 2.0),
    ] {
        let world = GridWorld::new("x.map", &map, cell_m, &[]).unwrap();
        let roadmap = world.roadmap();
        for nodes in [1, 4, 16, 28] {
            let radius_m = SensorNetwork::default_radius_m(roadmap, nodes);
            for seed in 0..20 {
                let network = SensorNetwork::place(roadmap, nodes, radius_m, seed)
                    .unwrap_or_else(|error| panic!("{map:?}, {nodes} nodes, seed {seed}: {error}"));
                for &(u, v) in roadmap.edges() {
                    let (a, b) = (network.owner(u), network.owner(v));
                    assert!(a == b || network.are_neighbors(a, b));
                }
            }
        }
    }
}
