//! Where a run takes place, and who drives: what the system is put together from, for runs and for
//! pictures alike.

use std::sync::Arc;

use farside::SimDuration;
use farside_actors::system::{Setup, SetupError};
use farside_worlds::movingai::GridWorld;
use farside_worlds::{HeightField, Roadmap, SensorNetwork};

use crate::assemble::{Missions, Parts, declare};
use crate::error::blame;
use crate::missions::missions;
use crate::scenario::NetworkScenario;
use crate::world::{RoadmapGround, crater, ground, in_crater, place};

/// Where a run takes place, and who drives, before anything is declared.
pub(crate) struct Place {
    pub(crate) roadmap: Arc<Roadmap>,
    pub(crate) sensors: Arc<SensorNetwork>,
    pub(crate) grid: Option<GridWorld>,
    pub(crate) missions: Missions,
    terrain: Option<Arc<HeightField>>,
}

impl Place {
    pub(crate) fn of(
        scenario: &NetworkScenario,
        setup: &mut Setup<'_>,
    ) -> Result<Self, SetupError> {
        let world = &scenario.world;
        let RoadmapGround { roadmap, grid } = ground(world, scenario.team.rovers, setup.files)?;
        let roadmap = Arc::new(roadmap);
        let sensors = Arc::new(place(world, &roadmap, setup.problem_seed)?);
        let missions = match &grid {
            Some(grid) => Missions::Standing(grid.tasks().to_vec()),
            None => {
                let drawn = missions(world, &roadmap, &scenario.team, setup.problem_seed);
                Missions::Queued(drawn.map_err(blame)?)
            }
        };
        let terrain = match setup.has_radios() && in_crater(world) {
            true => Some(Arc::new(crater()?.terrain().clone())),
            false => None,
        };
        Ok(Place {
            roadmap,
            sensors,
            grid,
            missions,
            terrain,
        })
    }

    pub(crate) fn parts<'a>(&self, scenario: &'a NetworkScenario) -> Parts<'a> {
        Parts {
            world: &scenario.world,
            roadmap: self.roadmap.clone(),
            sensors: self.sensors.clone(),
            config: &scenario.network,
            terrain: self.terrain.clone(),
            only: &scenario.team.only,
        }
    }

    /// How long a cycle of a run here is. `"auto"` depends on the links, so they are declared.
    pub(crate) fn cycle(
        &self,
        scenario: &NetworkScenario,
        setup: &mut Setup<'_>,
    ) -> Result<SimDuration, SetupError> {
        let parts = self.parts(scenario);
        let declared = setup.wired(|sim, wire| declare(sim, &parts, &self.missions, wire));
        Ok(declared.map_err(blame)?.timing.cycle)
    }
}
