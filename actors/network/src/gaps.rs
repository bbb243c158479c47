//! Gaps in the coverage of the roadmap: vertices at which no node reaches a rover.
//! *Network-guided*, section 5, asks "what should be the network's behavior if there are gaps in
//! the coverage of the workspace". Here it closes them or lets rovers cross them, as
//! [`Gaps`](crate::Gaps) says.
//!
//! **Closed**, a vertex has no edges left, so that no path, route or reservation leads there,
//! whatever the policy.
//!
//! **Crossed**, a gap is driven through in one go: a *crossing* leads from a covered vertex through
//! uncovered ones to the next covered one. From when it has said that it sets out until it has come
//! out a rover neither speaks nor listens: what is sent to it meanwhile is as good as lost, also
//! where links know of no distance. So it sets out only when it holds the grants for all vertices
//! of the crossing, the covered one beyond included, and then needs to hear nothing. The crossing's
//! owners learn of it when it has come out, each from the next one's owner. Why no rover waits for
//! ever before a gap: [`reservation`](super::reservation).
//!
//! A rover whose entry or goal lies in a gap, or that has no way to its goal where gaps are closed,
//! is refused: it never enters.

use std::sync::Arc;

use farside_worlds::{Roadmap, SensorNetwork, VertexId};

use super::config::{Gaps, Policy, WorldConfig};
use super::safety::RoverMemory;
use crate::error::NetworkError;
use crate::ids::RoverId;

impl Gaps {
    /// Whether a world with these gaps can be.
    ///
    /// # Errors
    /// When it has some and may not, or another policy than `complete` is to cross them.
    pub(super) fn check(self, sensors: &SensorNetwork, policy: Policy) -> Result<(), NetworkError> {
        match self {
            Gaps::Refuse if !sensors.gaps().is_empty() => Err(NetworkError::Uncovered {
                vertices: sensors.gaps().to_vec(),
            }),
            Gaps::Cross if policy != Policy::Complete => Err(NetworkError::CannotCross),
            _ => Ok(()),
        }
    }
}

impl WorldConfig {
    /// The roadmap that rovers may use: with `gaps = "close"` the one without the vertices that
    /// `sensors` does not cover, else all of it.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use farside_network::{Gaps, WorldConfig};
    /// use farside_worlds::Roadmap;
    /// let coverage_m = Some(60.0);
    /// let world = WorldConfig { gaps: Gaps::Close, coverage_m, ..WorldConfig::default() };
    /// let map = Arc::new(Roadmap::builtin(world.roadmap.name())?);
    /// let sensors = world.place(&map, 1)?;
    /// let open = world.open_part(&map, &sensors);
    /// assert!(!sensors.gaps().is_empty());
    /// assert!(sensors.gaps().iter().all(|&gap| open.neighbors(gap).is_empty()));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn open_part(&self, roadmap: &Arc<Roadmap>, sensors: &SensorNetwork) -> Arc<Roadmap> {
        match self.gaps {
            Gaps::Close if !sensors.gaps().is_empty() => Arc::new(roadmap.without(sensors.gaps())),
            _ => roadmap.clone(),
        }
    }
}

/// A rover that never enters, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Refused {
    pub(crate) rover: RoverId,
    why: Why,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Why {
    /// Nobody hears it at its entry, or at its goal.
    Uncovered(&'static str, VertexId),
    /// No way leads there.
    CutOff(VertexId, VertexId),
}

impl Refused {
    /// In a sentence.
    pub(crate) fn sentence(&self, rover_names: &[String]) -> String {
        let name = &rover_names[self.rover.0 as usize];
        match self.why {
            Why::Uncovered(what, v) => format!("{name} has its {what} at vertex {v}, in a gap"),
            Why::CutOff(from, to) => {
                format!("{name} has no way from vertex {from} to {to} without gaps")
            }
        }
    }
}

/// The rovers that have no way, in order, of those that take part. `roadmap` is the part that they
/// may use.
pub(super) fn refused(
    roadmap: &Roadmap,
    sensors: &SensorNetwork,
    missions: &[(VertexId, VertexId)],
    takes_part: &[bool],
) -> Vec<Refused> {
    let why = |entry, goal| {
        if !sensors.covers(entry) {
            Some(Why::Uncovered("entry", entry))
        } else if !sensors.covers(goal) {
            Some(Why::Uncovered("goal", goal))
        } else {
            let cut_off = !roadmap.is_reachable(entry, goal);
            cut_off.then_some(Why::CutOff(entry, goal))
        }
    };
    let all = (0..).map(RoverId).zip(missions);
    let team = all.filter(|(rover, _)| takes_part[rover.0 as usize]);
    let refusals = team.filter_map(|(rover, &(entry, goal))| {
        let why = why(entry, goal)?;
        Some(Refused { rover, why })
    });
    refusals.collect()
}

/// Checks that some rover of so many has a way, or, where rovers stand on the map from the start, that all do.
///
/// # Errors
/// When that is not so; it names them.
pub(super) fn check_refused(
    refused: &[Refused],
    rover_names: &[String],
    rovers: usize,
    stay_at_target: bool,
) -> Result<(), NetworkError> {
    let too_many = if stay_at_target { 1 } else { rovers };
    if refused.len() < too_many {
        return Ok(());
    }
    let all = refused.iter().map(|refused| refused.sentence(rover_names));
    Err(NetworkError::Refused { all: all.collect() })
}

impl RoverMemory {
    /// Whether the rover is out of everybody's hearing: in a gap, on its way into one or out of it.
    pub(super) fn is_in_gap(&self, sensors: &SensorNetwork) -> bool {
        let ends = [self.vertex, self.moving_to];
        ends.into_iter().flatten().any(|v| !sensors.covers(v))
    }
}
