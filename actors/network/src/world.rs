//! Where rovers drive, as scenarios name it: a built-in roadmap, one in a file, a map of cells; and
//! the nodes over it.

use farside_actors::system::{Files, SetupError};
use farside_worlds::movingai::{self, Builtin as BuiltinMap, GridMap, GridWorld, TaskList};
use farside_worlds::{Crater, CraterSettings, Roadmap, SensorError, SensorNetwork, WorldError};

use crate::config::WorldConfig;

/// The most bytes of a roadmap file that are read; the reader itself takes no more than 1 MiB.
const MAX_ROADMAP_BYTES: u64 = 2 << 20;

/// The nodes.
pub(crate) fn place(
    world: &WorldConfig,
    roadmap: &Roadmap,
    seed: u64,
) -> Result<SensorNetwork, SetupError> {
    world.place(roadmap, seed).map_err(|error| {
        let key = match error {
            SensorError::NodeCount { .. } => "world.nodes",
            SensorError::Radius { .. } => "world.radius",
            SensorError::Coverage { .. } => "world.coverage",
            SensorError::NoPlacement {
                radius_m,
                coverage_m,
                ..
            } if coverage_m < radius_m => "world.coverage",
            // Which of the two to change is the user's choice; the message suggests a radius.
            _ if world.radius_m.is_some() => "world.radius",
            _ => "world.nodes",
        };
        SetupError::value(key, error)
    })
}

/// Whether the roadmap lies in the default crater, as the built-in ones do; of others the ground is
/// not known.
pub(crate) fn in_crater(world: &WorldConfig) -> bool {
    Roadmap::builtin_names().contains(&world.roadmap.name())
}

pub(crate) fn crater() -> Result<Crater, SetupError> {
    let crater = Crater::generate(&CraterSettings::default());
    crater.map_err(|error| SetupError::value("world.roadmap", error))
}

/// Whether the roadmap is a map of cells.
pub(crate) fn is_grid(name: &str) -> bool {
    name.ends_with(".map") || BuiltinMap::find(name).is_some()
}

/// Where rovers drive, and what a map of cells adds.
pub(crate) struct RoadmapGround {
    pub(crate) roadmap: Roadmap,
    pub(crate) grid: Option<GridWorld>,
}

/// The built-in roadmap, the one in a file, or the one that the scenario has itself.
pub(crate) fn ground(
    world: &WorldConfig,
    rovers: u32,
    files: &mut Files,
) -> Result<RoadmapGround, SetupError> {
    let name = world.roadmap.name();
    let wrong = |message: String| SetupError::value("world.roadmap", message);
    if is_grid(name) {
        let (_, grid) = grid(world, rovers, files)?;
        let roadmap = grid.roadmap().clone();
        return Ok(RoadmapGround {
            roadmap,
            grid: Some(grid),
        });
    }
    if let Some(tasks) = &world.tasks {
        let message = format!("{tasks:?}: expected none, as the roadmap is not a MovingAI map");
        return Err(SetupError::value("world.tasks", message));
    }
    let plain = |roadmap| RoadmapGround {
        roadmap,
        grid: None,
    };
    if let Some(inline) = world.roadmap.table() {
        return inline.map(plain).map_err(|error| wrong(error.to_string()));
    }
    if !name.ends_with(".toml") {
        return Roadmap::builtin(name)
            .map(plain)
            .map_err(|error| match error {
                WorldError::UnknownRoadmap { .. } => wrong(format!(
                    "{error} (a roadmap of your own is a .toml file, or a MovingAI .map)"
                )),
                other => wrong(other.to_string()),
            });
    }
    let bytes = files.read(name, MAX_ROADMAP_BYTES).map_err(wrong)?;
    let text = String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        wrong(format!(
            "{name}: byte {at} is not UTF-8; expected TOML text"
        ))
    })?;
    let roadmap = Roadmap::from_toml(&text).map_err(|error| wrong(format!("{name}: {error}")))?;
    Ok(plain(roadmap))
}

/// A MovingAI map, and the world that it makes with its tasks.
pub(crate) fn grid(
    world: &WorldConfig,
    rovers: u32,
    files: &mut Files,
) -> Result<(GridMap, GridWorld), SetupError> {
    let name = world.roadmap.name();
    let of_map = |message: String| SetupError::value("world.roadmap", message);
    let of_tasks = |message: String| SetupError::value("world.tasks", message);
    let limit = movingai::MAX_FILE_BYTES as u64;
    let builtin = BuiltinMap::find(name);
    let (map_name, bytes) = match builtin {
        Some(file) => (file.map_name, file.map.to_vec()),
        None => (name, files.read(name, limit).map_err(of_map)?),
    };
    let in_map = |error| of_map(format!("{name}: {error}"));
    let map = GridMap::from_movingai(&bytes).map_err(in_map)?;
    let (tasks_name, bytes) = match (&world.tasks, builtin) {
        (Some(tasks), _) => (tasks.as_str(), files.read(tasks, limit).map_err(of_tasks)?),
        (None, Some(file)) => (name, file.tasks.to_vec()),
        (None, None) => {
            let message = "missing: expected a .scen file with the starts and goals on the map";
            return Err(of_tasks(message.to_owned()));
        }
    };
    let in_tasks = |error| of_tasks(format!("{tasks_name}: {error}"));
    let tasks = TaskList::from_movingai(&bytes).map_err(in_tasks)?;
    let first = tasks.first(rovers as usize).map_err(in_tasks)?;
    let made = GridWorld::new(map_name, &map, world.cell_m, first);
    let made = made.map_err(|error| match error.line() {
        Some(_) => in_tasks(error),
        None => in_map(error),
    })?;
    Ok((map, made))
}
