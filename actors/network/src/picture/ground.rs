//! Where a run of the network-guided system takes place, for pictures.

use std::sync::Arc;

use farside_actors::system::{Setup, SetupError};
use farside_worlds::VertexId;
use farside_worlds::movingai::{Cell, GridMap, GridWorld};

use super::{Site, Surroundings};
use crate::Policy;
use crate::place::Place;
use crate::scenario::NetworkScenario;
use crate::waits::WaitRule;
use crate::world::{crater, grid, in_crater, is_grid};

/// The roadmap, the nodes, the ground and the clock, as they are for a run with these seeds.
pub(super) fn site(scenario: &NetworkScenario, setup: &mut Setup<'_>) -> Result<Site, SetupError> {
    let (world, rovers) = (&scenario.world, scenario.team.rovers);
    let place = Place::of(scenario, setup)?;
    let cycle = place.cycle(scenario, setup)?;
    let stay_at_target = is_grid(world.roadmap.name());
    let ground = if stay_at_target {
        let (map, made) = grid(world, rovers, setup.files)?;
        Surroundings::Walls {
            middles_m: walls(&map, &made, world.cell_m),
            cell_m: world.cell_m,
        }
    } else if in_crater(world) {
        Surroundings::Heights(Arc::new(crater()?.terrain().clone()))
    } else {
        Surroundings::Unknown
    };
    Ok(Site {
        roadmap: world.open_part(&place.roadmap, &place.sensors),
        sensors: place.sensors,
        ground,
        cycle,
        coordinates: scenario.network.policy == Policy::MaxPlus,
        rovers,
        wait_rule: WaitRule::of(scenario.network.policy, stay_at_target),
    })
}

/// The cells that are no vertices: walls, and what walls cut off.
fn walls(map: &GridMap, world: &GridWorld, cell_m: f64) -> Vec<[f64; 2]> {
    // One vertex and its cell tell where all cells are: rows run from north to south.
    let known = world.roadmap().position_m(VertexId(0));
    let Cell { x, y } = world.cell(VertexId(0));
    let middle = |cell: Cell| {
        let east = f64::from(cell.x) - f64::from(x);
        let south = f64::from(cell.y) - f64::from(y);
        [known.x + east * cell_m, known.y - south * cell_m]
    };
    let rows = (0..map.height()).flat_map(|y| (0..map.width()).map(move |x| Cell { x, y }));
    let walls = rows.filter(|cell| world.vertex(*cell).is_none());
    walls.map(middle).collect()
}

#[cfg(test)]
mod tests {
    use farside_worlds::movingai::TaskList;

    use super::*;

    #[test]
    fn walls_fill_the_map_between_the_vertices() {
        let map = GridMap::from_movingai(b"type octile\nheight 2\nwidth 3\nmap\n..@\n.@.\n");
        let map = map.unwrap();
        let tasks = TaskList::from_movingai(b"version 1\n0\tm.map\t3\t2\t0\t0\t0\t1\t1\n").unwrap();
        let world = GridWorld::new("m.map", &map, 10.0, tasks.tasks()).unwrap();
        let mut walls = walls(&map, &world, 10.0);
        let vertices = world.roadmap().vertices();
        walls.extend(
            vertices
                .map(|v| world.roadmap().position_m(v))
                .map(|p| [p.x, p.y]),
        );
        walls.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        let columns = [5.0, 15.0, 25.0];
        let cells: Vec<[f64; 2]> = columns
            .iter()
            .flat_map(|x| [[*x, 5.0], [*x, 15.0]])
            .collect();
        assert_eq!(walls, cells);
    }
}
