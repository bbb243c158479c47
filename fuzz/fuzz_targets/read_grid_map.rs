//! Reads any bytes as a grid map. Whatever the bytes, there is an error that names a line of the
//! file, or a map that is written as it was read and makes a roadmap or an error.
#![no_main]

use farside_worlds::movingai::{GridError, GridMap, GridWorld};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    match GridMap::from_movingai(bytes) {
        Ok(map) => {
            let again = GridMap::from_movingai(map.to_movingai().as_bytes());
            assert_eq!(again.as_ref(), Ok(&map));
            match GridWorld::new("x.map", &map, 1.0, &[]) {
                Ok(world) => {
                    assert_eq!(world.roadmap().len() + world.left_out(), map.passable_cells());
                }
                Err(GridError::Roadmap(error)) => panic!("{error}"),
                Err(error) => assert!(!error.to_string().is_empty()),
            }
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            let lines = bytes.iter().filter(|byte| **byte == b'\n').count() + 1;
            assert!(error.line().is_none_or(|line| (1..=lines).contains(&line)), "{error}");
        }
    }
});
