//! Who drives from where to where, drawn at random.

use farside::random::RandomKey;
use farside_worlds::{Roadmap, VertexId};

use crate::config::{TeamConfig, WorldConfig};
use crate::error::NetworkError;

/// An entry and a goal for each rover, at random. Of `world` only the endpoints are read.
///
/// ```
/// use farside_network::{TeamConfig, WorldConfig, missions};
/// use farside_worlds::Roadmap;
/// let map = Roadmap::builtin("crater-dense")?;
/// let missions = missions(&WorldConfig::default(), &map, &TeamConfig::of(25), 1)?;
/// assert!(missions.iter().all(|(entry, goal)| entry != goal));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When the team is empty, or the roadmap's boundary has no two places to drive between.
pub fn missions(
    world: &WorldConfig,
    roadmap: &Roadmap,
    team: &TeamConfig,
    seed: u64,
) -> Result<Vec<(VertexId, VertexId)>, NetworkError> {
    if team.rovers == 0 {
        return Err(NetworkError::NoRovers);
    }
    let (entries, exits) = world.endpoints.split(roadmap);
    // With one entry that is the only exit there is nowhere to go.
    let pairs = entries
        .iter()
        .flat_map(|a| exits.iter().map(move |b| (a, b)));
    let starts: Vec<_> = entries
        .iter()
        .filter(|&&entry| exits.iter().any(|&exit| exit != entry))
        .copied()
        .collect();
    if !pairs.into_iter().any(|(a, b)| a != b) {
        return Err(NetworkError::Endpoints {
            roadmap: roadmap.name().to_owned(),
            entries: entries.len(),
            exits: exits.len(),
        });
    }
    let mission = |rover: u32| {
        let key = RandomKey::new(seed).text("mission");
        let mut draws = key.number(u64::from(rover)).stream();
        let entry = *draws.choose(&starts).expect("there is a pair");
        loop {
            let goal = *draws.choose(&exits).expect("there is a pair");
            if goal != entry {
                return (entry, goal);
            }
        }
    };
    Ok((0..team.rovers).map(mission).collect())
}
