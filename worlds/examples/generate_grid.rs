//! Writes a random MovingAI map and tasks over it, `NAME.map` and `NAME.scen`, into a folder. The
//! built-in one was made by the line below; a test compares it with the generator.
//!
//! ```text
//! cargo run -p farside-worlds --example generate_grid -- \
//!     worlds/data/movingai rubble-32-32-10 32 32 0.1 200 4
//! ```

use std::error::Error;
use std::path::Path;

use farside_worlds::movingai::{GridMap, GridWorld, TaskList};

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [folder, name, width, height, walls, tasks, seed] = &args[..] else {
        return Err("expected FOLDER NAME WIDTH HEIGHT WALLS TASKS SEED".into());
    };
    let (map_name, seed) = (format!("{name}.map"), seed.parse()?);
    let map = GridMap::random(width.parse()?, height.parse()?, walls.parse()?, seed)?;
    let tasks = TaskList::random(&map_name, &map, tasks.parse()?, seed)?;
    let folder = Path::new(folder);
    std::fs::write(folder.join(&map_name), map.to_movingai())?;
    std::fs::write(folder.join(format!("{name}.scen")), tasks.to_movingai())?;

    // How many of the first tasks make a well-formed instance, on maps that rovers can use.
    let world = GridWorld::new(&map_name, &map, 1.0, tasks.tasks())?;
    let all = world.tasks();
    let well_formed = (0..=all.len())
        .take_while(|&count| farside_worlds::well_formed(world.roadmap(), &all[..count]).is_empty())
        .last();
    println!(
        "{map_name}: {} vertices, {} cells left out; the first {} tasks are well-formed together",
        world.roadmap().len(),
        world.left_out(),
        well_formed.unwrap_or(0)
    );
    Ok(())
}
