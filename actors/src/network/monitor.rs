//! The monitor: watches rovers' true positions from outside, ends the run, and keeps the score. It
//! knows nothing of grants, owners or plans: only what rovers recorded of themselves.
//!
//! **Collision.** A rover that stands at a vertex claims it. From the instant at which it sets out
//! along an edge it claims the vertex at the other end and the edge, and no longer the one it leaves:
//! a vertex is one rover wide, an edge much longer. Two rovers with a claim on one vertex, or on one
//! edge in opposite directions, collide. In entry queues and beyond goals nothing is claimed.

use std::sync::{Arc, Mutex, PoisonError};

use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{RunInfo, SimTime};
use farside_worlds::VertexId;

use super::assemble::Site;
use super::messages::{NodeState, RoverId, RoverState};
use super::metrics::{Deadlock, NetworkMetrics};

/// What the monitor keeps of a rover.
#[derive(Clone, Debug, Default)]
struct Track {
    vertex: Option<VertexId>,
    moving_to: Option<VertexId>,
    previous: Option<VertexId>,
    entered: Option<u32>,
    arrived: Option<u32>,
    arrived_at: Option<SimTime>,
    transmit_energy_j: f64,
    /// Moves begun.
    moves: u32,
    backtracks: u32,
    /// Edges between where it is, or will be, and its goal.
    remaining: u32,
}

impl Track {
    /// The vertex that it claims.
    fn claim(&self) -> Option<VertexId> {
        self.moving_to.or(self.vertex)
    }
}

#[derive(Debug, Default)]
pub(crate) struct Score {
    tracks: Vec<Track>,
    cycle: u32,
    collisions: u32,
    interventions: u32,
    last_intervention: Option<u32>,
    iterations: u64,
    planned_cycles: u64,
    messages: u64,
    bytes: u64,
    last_move: u32,
    /// The least sum of remaining distances so far, and when it was reached.
    nearest: (u32, u32),
    deadlock: Deadlock,
    standstill: Option<String>,
    confirmed_deadlocks: u32,
    last_confirmed: Vec<RoverId>,
    ended: bool,
}

pub(crate) struct Monitor {
    site: Arc<Site>,
    score: Arc<Mutex<Score>>,
    /// Who takes part, to tell rovers' samples by.
    rovers: Vec<Option<RoverId>>,
}

impl Monitor {
    /// A monitor, and what it will write the score to.
    pub(crate) fn new(site: Arc<Site>) -> (Monitor, Arc<Mutex<Score>>) {
        let start = |&(entry, goal): &(VertexId, VertexId)| Track {
            remaining: site.roadmap.distance(entry, goal),
            ..Track::default()
        };
        let tracks: Vec<Track> = site.missions.iter().map(start).collect();
        let sum = tracks.iter().map(|t| t.remaining).sum();
        let score = Arc::new(Mutex::new(Score {
            tracks,
            nearest: (sum, 0),
            ..Score::default()
        }));
        let monitor = Monitor {
            site,
            score: score.clone(),
            rovers: Vec::new(),
        };
        (monitor, score)
    }
}

impl Observer for Monitor {
    fn wants(&self) -> Wants {
        Wants {
            samples: true,
            ..Wants::default()
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        let id = |name: &String| self.site.rover_names.iter().position(|n| n == name);
        let rover = |entity: &farside::Entity| id(&entity.name).map(|id| RoverId(id as u32));
        self.rovers = run.entities.iter().map(rover).collect();
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let mut score = self.score.lock().unwrap_or_else(PoisonError::into_inner);
        let cycle = self.site.cycle_at(record.time());
        if cycle > score.cycle {
            score.cycle = cycle;
            if let Some(reason) = score.verdict(&self.site) {
                return Ok(Flow::Stop(reason));
            }
        }
        if record.class.is_fate() && record.link.is_some() && record.copy == 0 {
            score.messages += 1;
            // The digest had it encoded: looking costs nothing.
            score.bytes += record.body.len() as u64;
        }
        if record.class == RecordClass::Sample
            && let Some(kind) = record.kind
        {
            let failed = |error: farside::encoding::DecodeError| ObserverError(error.to_string());
            if let Some(rover) = self.rovers[record.sender.index()] {
                let state: RoverState = kind.schema().decode(record.body).map_err(failed)?;
                return Ok(score.follow(&self.site, rover, &state, record.time()));
            } else if kind.name() == "NodeState" {
                score.count(&kind.schema().decode(record.body).map_err(failed)?);
            }
        }
        Ok(Flow::Continue)
    }
}

impl Score {
    /// A node's cycle.
    fn count(&mut self, state: &NodeState) {
        if state.forced_stops > 0 && self.last_intervention != Some(state.cycle) {
            self.last_intervention = Some(state.cycle);
            self.interventions += 1;
        }
        if state.confirmed_deadlocks > 0 {
            self.confirmed_deadlocks += state.confirmed_deadlocks;
            self.last_confirmed.clone_from(&state.deadlock);
        }
        if state.rovers > 0 {
            self.planned_cycles += 1;
            self.iterations += u64::from(state.iterations);
        }
    }

    /// A rover's change.
    fn follow(&mut self, site: &Site, rover: RoverId, state: &RoverState, now: SimTime) -> Flow {
        let at = rover.0 as usize;
        self.tracks[at].transmit_energy_j = state.transmit_energy_j;
        let (vertex, moving_to) = (state.whereabouts.vertex, state.whereabouts.moving_to);
        let old = self.tracks[at].clone();
        if (old.vertex, old.moving_to) == (vertex, moving_to) {
            return Flow::Continue;
        }
        let cycle = self.cycle;
        let track = &mut self.tracks[at];
        (track.vertex, track.moving_to) = (vertex, moving_to);
        if let Some(to) = moving_to {
            track.moves += 1;
            track.backtracks += u32::from(track.previous == Some(to));
        } else if vertex != old.vertex {
            track.previous = old.vertex;
        }
        if vertex.is_some() && track.entered.is_none() {
            track.entered = Some(cycle);
        }
        if vertex == Some(state.goal) && track.arrived.is_none() {
            track.arrived = Some(cycle);
            track.arrived_at = Some(now);
        }
        if let Some(claim) = track.claim() {
            track.remaining = site.roadmap.distance(claim, state.goal);
        }
        let claim = track.claim();
        self.last_move = cycle;
        let edge = vertex.zip(moving_to);
        if claim != old.claim() || edge.is_some() {
            let clashes = |other: &Track| {
                claim.is_some() && other.claim() == claim
                    || edge.is_some() && other.moving_to.zip(other.vertex) == edge
            };
            let others = self.tracks.iter().enumerate().filter(|&(i, _)| i != at);
            self.collisions += others.filter(|(_, other)| clashes(other)).count() as u32;
        }
        let stays = site.stays;
        let all_gone = |t: &Track| {
            let there = stays && t.remaining == 0 && t.moving_to.is_none();
            t.arrived.is_some() && (t.vertex.is_none() || there)
        };
        if !self.ended && self.tracks.iter().all(all_gone) {
            self.ended = true;
            return Flow::Stop("all rovers have arrived".to_owned());
        }
        Flow::Continue
    }

    /// Looks back when a new cycle begins: why the run should end, if it should.
    fn verdict(&mut self, site: &Site) -> Option<String> {
        let sum: u32 = self.tracks.iter().map(|t| t.remaining).sum();
        if sum < self.nearest.0 {
            self.nearest = (sum, self.cycle);
        }
        if self.ended {
            return None;
        }
        let config = &site.config;
        let still = |since: u32, window| self.cycle.saturating_sub(since) > window;
        let reason = if still(self.last_move, config.passive_window + site.patience) {
            self.deadlock = Deadlock::Passive;
            "passive deadlock"
        } else if still(self.nearest.1, config.active_window + site.patience) {
            self.deadlock = Deadlock::Active;
            "active deadlock"
        } else if self.cycle >= config.cycle_limit {
            "cycle limit"
        } else {
            return None;
        };
        self.ended = true;
        let reason = format!("{reason}: {}", self.remaining(site));
        self.standstill = Some(reason.clone());
        Some(reason)
    }

    /// Who is still out, in a sentence.
    fn remaining(&self, site: &Site) -> String {
        let out = |t: &Track| match site.stays {
            true => t.remaining > 0,
            false => t.arrived.is_none() || t.vertex.is_some(),
        };
        let left = self.tracks.iter().filter(|t| out(t)).count();
        let on_the_way = |t: &Track| out(t) && t.vertex.is_some();
        let first = self.tracks.iter().position(on_the_way);
        let first = first.or_else(|| self.tracks.iter().position(out));
        let Some(first) = first else {
            return format!("{left} rovers left");
        };
        let name = &site.rover_names[first];
        match self.tracks[first].vertex {
            Some(v) => format!("{left} rovers left, {name} at vertex {}", v.0),
            None => format!("{left} rovers left, {name} in its queue"),
        }
    }

    pub(crate) fn collisions(&self) -> u32 {
        self.collisions
    }

    pub(crate) fn arrived(&self) -> u32 {
        let arrived = self.tracks.iter().filter(|track| track.arrived.is_some());
        arrived.count() as u32
    }

    pub(crate) fn metrics(&self, site: &Site) -> NetworkMetrics {
        let mut metrics = NetworkMetrics {
            rovers: self.tracks.len() as u32,
            collisions: self.collisions,
            deadlock: self.deadlock,
            interventions: self.interventions,
            cycles: self.cycle + 1,
            confirmed_deadlocks: self.confirmed_deadlocks,
            standstill: self.standstill.clone(),
            plan_expansions: site.schedule.as_ref().map_or(0, |s| s.expansions),
            ..NetworkMetrics::default()
        };
        let arrived_s = |track: &Track| track.arrived_at.map(SimTime::as_secs_f64);
        metrics.arrival_s = self.tracks.iter().map(arrived_s).collect();
        let name = |rover: &RoverId| site.rover_names.get(rover.0 as usize).cloned();
        let ring: Vec<_> = self.last_confirmed.iter().filter_map(name).collect();
        metrics.last_confirmed = (!ring.is_empty()).then(|| ring.join(" > "));
        metrics.completed = metrics.arrival_s.iter().all(Option::is_some);
        metrics.deadlocked = self.deadlock != Deadlock::None;
        let energies_j = self.tracks.iter().map(|track| track.transmit_energy_j);
        metrics.transmit_energy_j = energies_j.sum();
        metrics.intervention_rate = f64::from(self.interventions) / f64::from(metrics.cycles);
        metrics.max_plus_iterations = self.iterations as f64 / self.planned_cycles.max(1) as f64;
        let rover_cycles = f64::from(metrics.rovers) * f64::from(metrics.cycles);
        metrics.messages_per_rover_cycle = self.messages as f64 / rover_cycles;
        metrics.bytes_per_rover_cycle = self.bytes as f64 / rover_cycles;
        for (track, &(entry, goal)) in self.tracks.iter().zip(&site.missions) {
            let (Some(entered), Some(arrived)) = (track.entered, track.arrived) else {
                continue;
            };
            let shortest = f64::from(site.roadmap.distance(entry, goal).max(1));
            // Both the cycle of the entry and that of the arrival were spent on the way.
            let steps = arrived + 1 - entered;
            metrics.arrived += 1;
            metrics.path_ratio += f64::from(steps) / shortest;
            metrics.time_ratio += f64::from(arrived + 1) / shortest;
            metrics.mean_steps += f64::from(steps);
            metrics.total_steps += u64::from(steps);
            metrics.mean_stops += f64::from(steps.saturating_sub(track.moves));
            metrics.mean_backtracks += f64::from(track.backtracks);
        }
        let count = f64::from(metrics.arrived.max(1));
        for mean in [
            &mut metrics.path_ratio,
            &mut metrics.time_ratio,
            &mut metrics.mean_steps,
            &mut metrics.mean_stops,
            &mut metrics.mean_backtracks,
        ] {
            *mean /= count;
        }
        metrics
    }
}
