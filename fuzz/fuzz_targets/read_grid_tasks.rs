//! Reads any bytes as the tasks of a grid map. Whatever the bytes, there is an error that names a
//! line of the file, or tasks that read back equal; and over a small map these make a world whose
//! blocked tasks can be explained, or an error that names the line of one of them.
#![no_main]

use farside_worlds::movingai::{GridMap, GridTask, GridWorld, TaskList};
use libfuzzer_sys::fuzz_target;

const MAP: &str = "type octile\nheight 3\nwidth 4\nmap\n..@.\n.T@@\n.G@S\n";

fuzz_target!(|bytes: &[u8]| {
    match TaskList::from_movingai(bytes) {
        Ok(list) => {
            let again = TaskList::from_movingai(list.to_movingai().as_bytes());
            let again = again.expect("what was written can be read");
            assert!(again.tasks().iter().map(told).eq(list.tasks().iter().map(told)));
            let map = GridMap::from_movingai(MAP.as_bytes()).expect("the map is one");
            match GridWorld::new("x.map", &map, 1.0, list.tasks()) {
                Ok(world) => {
                    for blocked in world.blocked() {
                        assert!(!world.explain(&blocked).is_empty());
                    }
                }
                Err(error) => {
                    let line = error.line();
                    assert!(list.tasks().iter().any(|task| Some(task.line) == line), "{error}");
                }
            }
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            let lines = bytes.iter().filter(|byte| **byte == b'\n').count() + 1;
            assert!(error.line().is_none_or(|line| (1..=lines).contains(&line)), "{error}");
        }
    }
});

/// All but the line, which blank lines before it change.
fn told(task: &GridTask) -> GridTask {
    GridTask { line: 0, ..task.clone() }
}
