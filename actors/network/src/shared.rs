//! What nodes and rovers know without being told.

use std::sync::Arc;

use farside::prelude::*;
use farside_worlds::{NodeId, Roadmap, SensorNetwork, VertexId};
use nalgebra::Point3;

use crate::baseline::Schedule;
use crate::config::{Motion, NetworkConfig};
use crate::gaps::Refused;
use crate::ids::RoverId;
use crate::max_plus::payoff::Payoffs;
use crate::motion::EdgeTimes;
use crate::timing::Timing;

/// What all nodes and rovers of a run know from the start, and what does not change.
pub(crate) struct Shared {
    /// What rovers may use of it.
    pub(crate) roadmap: Arc<Roadmap>,
    pub(crate) sensors: Arc<SensorNetwork>,
    pub(crate) config: NetworkConfig,
    /// A cycle, or what the longest edge takes in continuous motion, if that is more.
    pub(crate) longest_step: SimDuration,
    pub(crate) timing: Timing,
    /// Cycles that may pass without progress because messages take so long: a way is reserved in
    /// some tens of messages one after the other.
    pub(crate) patience: u32,
    /// Who gives the roadmap to all others.
    pub(crate) roadmap_from: Option<NodeId>,
    pub(crate) payoffs: Payoffs,
    pub(crate) node_names: Vec<String>,
    pub(crate) rover_names: Vec<String>,
    /// Which rovers there are at all; the others have names and missions, and no actors.
    pub(crate) takes_part: Vec<bool>,
    /// Each rover's entry, or where it stands at first, and its goal.
    pub(crate) missions: Vec<(VertexId, VertexId)>,
    /// Rovers stand on the map from the start, and stay at their goals; there are no queues.
    pub(crate) stay_at_target: bool,
    /// They do, and each of them has a path round all others' starts and goals.
    pub(crate) is_well_formed: bool,
    /// Each node's backup list, with `network.failover_after`; else empty.
    pub(crate) backup_lists: Vec<Vec<NodeId>>,
    /// The plan of a policy that plans ahead.
    pub(crate) schedule: Option<Schedule>,
    /// Who waits at each entry, in order.
    pub(crate) queues: Vec<(VertexId, Vec<RoverId>)>,
    /// Who never enters, ascending.
    pub(crate) refused: Vec<Refused>,
}

impl Shared {
    /// The planning cycle at `now`, from 0. Nodes' clocks are synchronous.
    pub(crate) fn cycle_at(&self, now: SimTime) -> u32 {
        u32::try_from(now.as_nanos() / self.timing.cycle.as_nanos()).unwrap_or(u32::MAX)
    }

    /// The rovers that there are, each with its entry, or where it stands at first, and its goal.
    pub(crate) fn team(&self) -> impl Iterator<Item = (RoverId, (VertexId, VertexId))> + '_ {
        let all = (0..).map(RoverId).zip(self.missions.iter().copied());
        all.filter(|(rover, _)| self.takes_part[rover.0 as usize])
    }

    /// Who stands where at the start.
    pub(crate) fn standing(&self) -> impl Iterator<Item = (RoverId, VertexId)> + '_ {
        self.team()
            .filter(|_| self.stay_at_target)
            .map(|(id, (start, _))| (id, start))
    }

    /// Who waits at `entry`, in order.
    pub(crate) fn queue(&self, entry: VertexId) -> &[RoverId] {
        let at = self.queues.binary_search_by_key(&entry, |queue| queue.0);
        at.map_or(&[], |at| &self.queues[at].1)
    }

    /// Whether a rover is to drive: it takes part, and has a way.
    pub(crate) fn is_to_drive(&self, rover: RoverId) -> bool {
        let has_no_way = self.refused.binary_search_by_key(&rover, |r| r.rover);
        self.takes_part[rover.0 as usize] && has_no_way.is_err()
    }

    /// Where a vertex is, on the ground, in the world's frame [m].
    pub(crate) fn place_m(&self, vertex: VertexId) -> Point3<f64> {
        let at = self.roadmap.position_m(vertex);
        Point3::new(at.x, at.y, self.roadmap.height_m(vertex))
    }

    /// How edges are driven along.
    pub(crate) fn edge_times(&self) -> EdgeTimes<'_> {
        EdgeTimes {
            roadmap: &self.roadmap,
            config: &self.config,
        }
    }

    /// From setting out along an edge to being ready to set out again, as plans reckon.
    pub(crate) fn planned_step(&self, u: VertexId, v: VertexId) -> SimDuration {
        match self.config.motion {
            Motion::Cycles => self.timing.cycle,
            Motion::Continuous => self.edge_times().planned(u, v),
        }
    }

    /// When a planning cycle begins.
    pub(crate) fn cycle_start(&self, cycle: u32) -> SimTime {
        SimTime::ZERO + self.timing.cycle * u64::from(cycle)
    }

    /// From `now` to the start of the next cycle; never zero.
    pub(crate) fn until_next_cycle(&self, now: SimTime) -> SimDuration {
        let cycle = self.timing.cycle.as_nanos();
        SimDuration::from_nanos(cycle - now.as_nanos() % cycle)
    }
}
