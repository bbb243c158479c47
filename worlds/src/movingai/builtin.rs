//! The map that is built in, with its tasks.

/// A map with tasks that is built in: a field of rubble made by this crate, of the size of the
/// benchmark's `random-32-32-10`. Its first 71 tasks make a well-formed instance; the first
/// 72 do not.
///
/// ```
/// use farside_worlds::movingai::{Builtin, GridMap, GridWorld, TaskList};
/// let file = Builtin::find("rubble-32-32-10").unwrap();
/// let map = GridMap::from_movingai(file.map)?;
/// let tasks = TaskList::from_movingai(file.tasks)?;
/// let world = GridWorld::new(file.map_name, &map, 1.0, tasks.tasks())?;
/// assert_eq!(world.tasks().len(), 200);
/// # Ok::<(), farside_worlds::movingai::GridError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Builtin {
    /// The name that scenarios give.
    pub name: &'static str,
    /// The map's file name, which the tasks give.
    pub map_name: &'static str,
    /// The `.map` file.
    pub map: &'static [u8],
    /// The `.scen` file.
    pub tasks: &'static [u8],
}

const GRIDS: [Builtin; 1] = [Builtin {
    name: "rubble-32-32-10",
    map_name: "rubble-32-32-10.map",
    map: include_bytes!("../../data/movingai/rubble-32-32-10.map"),
    tasks: include_bytes!("../../data/movingai/rubble-32-32-10.scen"),
}];

impl Builtin {
    /// The map called `name`.
    pub fn find(name: &str) -> Option<Builtin> {
        GRIDS.into_iter().find(|file| file.name == name)
    }

    /// The names of all of them, sorted.
    pub fn names() -> impl Iterator<Item = &'static str> {
        GRIDS.into_iter().map(|file| file.name)
    }
}
