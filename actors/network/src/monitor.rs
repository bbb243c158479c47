//! The monitor: watches rovers' true positions from outside, ends the run, and keeps the score. It
//! knows nothing of grants, owners or plans: only what rovers recorded of themselves.
//!
//! **Collision.** As [`Collisions`] has it; in entry queues and beyond goals nothing is claimed.
//!
//! **Deadlock.** As [`waits`](crate::waits) has it: some rover cannot arrive any more, whatever is
//! said, repeated or waited for. A run in which nothing comes of anything for longer than messages
//! take to come through ([`pauses`]) ends as a deadlock if that is proved, and otherwise for want
//! of progress, which proves nothing.

mod pauses;

use std::sync::{Arc, Mutex, PoisonError};

use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{RunInfo, SimTime};
use farside_worlds::{NodeId, VertexId};

use super::config::{Motion, Sabotage};
use super::metrics::{Costs, Deadlock, NetworkMetrics, NoProgress, Outcome};
use super::waits::{Standing, WaitRule, Waits};
use crate::failover::messages::FailedOver;
use crate::ids::RoverId;
use crate::max_plus::loads::Loads;
use crate::max_plus::messages::NodeState;
use crate::safety::messages::RoverState;
use crate::shared::Shared;
use farside_actors::invariants::{Collisions, Place, WaitCycle};
use pauses::{Fixed, Pause, Pauses};

fn wait_rule(site: &Shared) -> WaitRule {
    WaitRule::of(site.config.policy, site.stay_at_target)
}

/// Why a team never arrives.
struct Proof {
    /// Who can never move again, if that is why.
    locked: Vec<u32>,
    sentence: String,
}

/// What the monitor keeps of a rover, beside where it is.
#[derive(Clone, Debug, Default)]
struct Track {
    previous: Option<VertexId>,
    entered: Option<u32>,
    arrived: Option<u32>,
    arrived_at: Option<SimTime>,
    transmit_energy_j: f64,
    /// Moves begun.
    moves: u32,
    backtracks: u32,
    /// Steps that it has completed.
    step: u32,
    /// It is down, and nothing will restart it.
    is_down: bool,
    /// The cycle of its last move.
    moved: Option<u32>,
    /// Edges between where it is, or will be, and its goal.
    remaining: u32,
    /// The same when the team was nearest to its goals.
    remaining_then: u32,
    /// While it stands at its goal: the time step at which it came there, see [`Costs`].
    cost: Option<u32>,
}

#[derive(Debug, Default)]
pub(crate) struct Score {
    tracks: Vec<Track>,
    collisions: Collisions<VertexId>,
    cycle: u32,
    interventions: u32,
    last_intervention: Option<u32>,
    iterations: u64,
    planned_cycles: u64,
    loads: Loads,
    /// When nodes that were given the roadmap knew all of it.
    informed: Vec<SimTime>,
    messages: u64,
    bytes: u64,
    pauses: Pauses,
    /// The least sum of remaining distances so far.
    nearest: u32,
    outcome: Outcome,
    deadlock: Deadlock,
    no_progress: NoProgress,
    no_progress_cycles: u32,
    locked: Vec<u32>,
    deadlock_reason: Option<String>,
    wait_cycles: Vec<WaitCycle<VertexId>>,
    failed_over: Vec<FailedOver>,
    confirmed_deadlocks: u32,
    last_confirmed: Vec<RoverId>,
    ended: bool,
}

pub(crate) struct Monitor {
    site: Arc<Shared>,
    score: Arc<Mutex<Score>>,
    /// Who takes part, to tell rovers' samples by.
    rovers: Vec<Option<RoverId>>,
    fixed: Fixed,
}

impl Monitor {
    /// A monitor, and what it will write the score to.
    pub(crate) fn new(site: Arc<Shared>) -> (Monitor, Arc<Mutex<Score>>) {
        let start = |(rover, &(entry, goal)): (RoverId, &(VertexId, VertexId))| {
            let remaining = match site.is_to_drive(rover) {
                true => site.roadmap.distance(entry, goal),
                false => 0,
            };
            Track {
                remaining,
                remaining_then: remaining,
                ..Track::default()
            }
        };
        let tracks: Vec<Track> = (0..).map(RoverId).zip(&site.missions).map(start).collect();
        let sum = tracks.iter().map(|t| t.remaining).sum();
        let mut collisions = Collisions::new();
        for name in &site.rover_names {
            collisions.add(name);
        }
        let score = Arc::new(Mutex::new(Score {
            tracks,
            collisions,
            nearest: sum,
            ..Score::default()
        }));
        let monitor = Monitor {
            site,
            score: score.clone(),
            rovers: Vec::new(),
            fixed: Fixed::default(),
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
        self.fixed = Fixed::of(run);
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let mut score = self.score.lock().unwrap_or_else(PoisonError::into_inner);
        let cycle = self.site.cycle_at(record.time());
        // What is on its way at the end is recorded with the time that it would have come at.
        if cycle > score.cycle && record.class != RecordClass::InFlight {
            let is_pending = self.fixed.is_pending(record.time());
            let over = std::mem::replace(&mut score.cycle, cycle);
            score.pauses.count(over, cycle, is_pending);
            if let Some(reason) = score.verdict(&self.site) {
                return Ok(Flow::Stop(reason));
            }
        }
        if matches!(record.class, RecordClass::Crash | RecordClass::Restart) {
            self.fixed.note(record);
            if let Some(rover) = self.rovers[record.receiver.index()] {
                let track = &mut score.tracks[rover.0 as usize];
                track.is_down = self.fixed.is_down_for_good(record.receiver, record.time());
            }
        }
        if record.class.is_fate() && record.link.is_some() && record.copy == 0 {
            score.pauses.fate(record.class);
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
                let state = kind.schema().decode(record.body).map_err(failed)?;
                score.loads.add(record.sender.index(), &state);
                score.count(&state);
            } else if kind.name() == "RoadmapKnown" {
                score.informed.push(record.time());
            } else if kind.name() == "FailedOver" {
                let taken = kind.schema().decode(record.body).map_err(failed)?;
                score.failed_over.push(taken);
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
    fn follow(&mut self, site: &Shared, rover: RoverId, state: &RoverState, now: SimTime) -> Flow {
        let at = rover.0 as usize;
        self.tracks[at].transmit_energy_j = state.transmit_energy_j;
        self.tracks[at].step = state.whereabouts.step;
        let old = self.collisions.place(at);
        let place = state.whereabouts.place();
        if place == old {
            return Flow::Continue;
        }
        self.collisions.update(now, at, place);
        let cycle = self.cycle;
        let track = &mut self.tracks[at];
        let vertex = place.vertex();
        if let Place::Between(_, to) = place {
            track.moves += 1;
            track.backtracks += u32::from(track.previous == Some(to));
        } else if vertex != old.vertex() {
            track.previous = old.vertex();
        }
        if vertex.is_some() && track.entered.is_none() {
            track.entered = Some(cycle);
        }
        if vertex == Some(state.goal) && track.arrived.is_none() {
            track.arrived = Some(cycle);
            track.arrived_at = Some(now);
        } else if site.stay_at_target && track.cost.is_some() {
            // It makes way for another, and has to come back.
            (track.arrived, track.arrived_at) = (None, None);
        }
        track.cost = match place {
            Place::At(here) if here == state.goal => {
                let step = site.timing.cycle.as_nanos();
                let steps = (now.as_nanos() + step / 2) / step;
                Some(track.moves.max(u32::try_from(steps).unwrap_or(u32::MAX)))
            }
            _ => None,
        };
        if let Some(claim) = place.claim() {
            track.remaining = site.roadmap.distance(claim, state.goal);
        }
        track.moved = Some(cycle);
        self.pauses.standing.ends(cycle);
        let gone = |rover: usize| !self.is_out(site, rover);
        if !self.ended && (0..self.tracks.len()).all(gone) {
            self.ended = true;
            self.outcome = Outcome::Arrived;
            let all = match site.refused.is_empty() {
                true => "all rovers have arrived",
                false => "all rovers that have a way have arrived",
            };
            return Flow::Stop(all.to_owned());
        }
        Flow::Continue
    }

    /// Looks back when a new cycle begins: why the run should end, if it should.
    fn verdict(&mut self, site: &Shared) -> Option<String> {
        let sum: u32 = self.tracks.iter().map(|t| t.remaining).sum();
        if sum < self.nearest {
            self.nearest = sum;
            self.pauses.no_nearer.ends(self.cycle);
            for track in &mut self.tracks {
                track.remaining_then = track.remaining;
            }
        }
        if self.ended {
            return None;
        }
        let (config, pauses) = (&site.config, &self.pauses);
        let too_long = |pause: Pause, window| pause.is_as_long_as(window + site.patience);
        let (pause, no_progress) = if too_long(pauses.standing, config.deadlock_window) {
            (pauses.standing, NoProgress::Standing)
        } else if too_long(pauses.no_nearer, config.livelock_window) {
            (pauses.no_nearer, NoProgress::Moving)
        } else if self.cycle >= config.cycle_limit {
            (pauses.no_nearer, NoProgress::None)
        } else {
            return None;
        };
        self.ended = true;
        let proof = self.proof(site);
        let cycles = self.cycle - pause.since();
        let (outcome, what) = match (&proof, no_progress) {
            (Some(_), _) => (Outcome::Deadlock, "deadlock".to_owned()),
            (None, NoProgress::None) => (Outcome::CycleLimit, "cycle limit".to_owned()),
            (None, _) => {
                let what = format!("no progress within {cycles} cycles");
                (Outcome::NoProgress, what)
            }
        };
        self.outcome = outcome;
        match outcome {
            Outcome::Deadlock => self.deadlock = Deadlock::Passive,
            Outcome::NoProgress => {
                (self.no_progress, self.no_progress_cycles) = (no_progress, cycles);
            }
            _ => {}
        }
        // Why the run stopped is part of its digest, and stays as short as it was.
        let reason = format!("{what}: {}", self.remaining(site));
        if outcome != Outcome::CycleLimit {
            self.wait_cycles = self.circles(site);
        }
        if let Some(proof) = &proof {
            self.locked.clone_from(&proof.locked);
        }
        self.deadlock_reason = Some(format!("{reason}{}", self.why(proof)));
        Some(reason)
    }

    /// Why some rover that is still out can never arrive, whatever is said, repeated or waited for;
    /// none if that is not certain. See [`waits`](crate::waits) for the argument.
    fn proof(&self, site: &Shared) -> Option<Proof> {
        if site.config.sabotage != Sabotage::None {
            // The argument rests on the safety protocol.
            return None;
        }
        let is_out =
            |rover: &usize| self.tracks[*rover].arrived.is_none() && self.is_out(site, *rover);
        let out: Vec<usize> = (0..self.tracks.len()).filter(is_out).collect();
        let name = |rover: usize| &site.rover_names[rover];
        let of = |sentence: String| Proof {
            locked: Vec::new(),
            sentence,
        };
        if let Some(&down) = out.iter().find(|rover| self.tracks[**rover].is_down) {
            return Some(of(format!("{} is down for good", name(down))));
        }
        let waits = Waits::of(&site.roadmap, wait_rule(site), &self.standing(site));
        let is_locked = |rover: &&usize| waits.locked.contains(&(**rover as u32));
        if let Some(&first) = out.iter().find(is_locked) {
            let (locked, first) = (waits.locked.into_iter().collect::<Vec<u32>>(), name(first));
            let count = locked.len();
            let sentence =
                format!("{count} rovers can never move again, the first of them {first}");
            return Some(Proof { locked, sentence });
        }
        let schedule = site.schedule.as_ref()?;
        let has_driven = |rover: &&usize| {
            let mut visits = schedule.visits.iter();
            let mine = visits.find(|(id, _)| id.0 as usize == **rover);
            let visits = mine.map_or(0, |(_, visits)| visits.len());
            // Where rovers leave, one that has driven its way has arrived.
            visits == 0 || site.stay_at_target && self.tracks[**rover].step as usize >= visits
        };
        let done = *out.iter().find(has_driven)?;
        Some(of(format!("{} has no planned way", name(done))))
    }

    /// Whether the rover has still to leave the roadmap, or to come to stand at its goal.
    fn is_out(&self, site: &Shared, rover: usize) -> bool {
        if !site.is_to_drive(RoverId(rover as u32)) {
            return false;
        }
        let (track, place) = (&self.tracks[rover], self.collisions.place(rover));
        match site.stay_at_target {
            true => track.remaining > 0 || !matches!(place, Place::At(_)),
            false => track.arrived.is_none() || place != Place::Away,
        }
    }

    /// Who is still out, in a sentence.
    fn remaining(&self, site: &Shared) -> String {
        let out = |rover: &usize| self.is_out(site, *rover);
        let out: Vec<usize> = (0..self.tracks.len()).filter(out).collect();
        let left = out.len();
        let place = |rover: usize| self.collisions.place(rover).vertex();
        let on_the_way = out.iter().find(|&&rover| place(rover).is_some());
        let Some(&first) = on_the_way.or(out.first()) else {
            return format!("{left} rovers left");
        };
        let name = &site.rover_names[first];
        match place(first) {
            Some(v) => format!("{left} rovers left, {name} at vertex {}", v.0),
            None => format!("{left} rovers left, {name} in its queue"),
        }
    }

    /// All rovers as the wait-for graph has them.
    fn standing(&self, site: &Shared) -> Vec<Standing> {
        let standing = |(rover, &(_, goal)): (u32, &(VertexId, VertexId))| Standing {
            rover,
            place: self.collisions.place(rover as usize),
            goal,
            is_down: self.tracks[rover as usize].is_down,
        };
        (0..).zip(&site.missions).map(standing).collect()
    }

    /// The circles of rovers that wait for each other.
    fn circles(&self, site: &Shared) -> Vec<WaitCycle<VertexId>> {
        let rovers = self.standing(site);
        let name = |rover: u32| site.rover_names[rover as usize].clone();
        Waits::of(&site.roadmap, wait_rule(site), &rovers).named(name, &rovers)
    }

    /// What holds the team up, as far as can be seen from outside; the end of a sentence.
    fn why(&self, proof: Option<Proof>) -> String {
        if let Some(shortest) = self.wait_cycles.first() {
            return format!("; {shortest}");
        }
        if let Some(proof) = proof {
            return format!("; {}", proof.sentence);
        }
        if self.no_progress != NoProgress::Moving {
            return String::new();
        }
        let since = self.pauses.no_nearer.since();
        let moved = |track: &&Track| track.moved.is_some_and(|cycle| cycle > since);
        let no_nearer = |track: &&Track| track.remaining >= track.remaining_then;
        let tracks = self.tracks.iter().filter(moved).filter(no_nearer);
        let (vain, cycles) = (tracks.count(), self.cycle - since);
        format!("; in {cycles} cycles {vain} rovers moved without coming nearer to their goals")
    }

    pub(crate) fn collisions(&self) -> u32 {
        u32::try_from(self.collisions.count()).unwrap_or(u32::MAX)
    }

    pub(crate) fn arrived(&self) -> u32 {
        let arrived = self.tracks.iter().filter(|track| track.arrived.is_some());
        arrived.count() as u32
    }

    pub(crate) fn metrics(&self, site: &Shared) -> NetworkMetrics {
        let rover_name = |rover: &u32| site.rover_names[*rover as usize].clone();
        let mut metrics = NetworkMetrics {
            rovers: site.team().count() as u32,
            collisions: self.collisions(),
            collided: self.collisions.named().to_vec(),
            wait_cycles: self.wait_cycles.clone(),
            outcome: self.outcome,
            deadlock: self.deadlock,
            locked_rovers: self.locked.iter().map(rover_name).collect(),
            no_progress: self.no_progress,
            no_progress_cycles: self.no_progress_cycles,
            stuck: self.deadlock != Deadlock::None || self.no_progress != NoProgress::None,
            interventions: self.interventions,
            cycles: self.cycle + 1,
            confirmed_deadlocks: self.confirmed_deadlocks,
            deadlock_reason: self.deadlock_reason.clone(),
            plan_expansions: site.schedule.as_ref().map_or(0, |s| s.expansions),
            ..NetworkMetrics::default()
        };
        // One has always known it.
        if site.roadmap_from.is_some() && self.informed.len() + 1 >= site.sensors.len() {
            let last = self.informed.iter().max().copied().unwrap_or(SimTime::ZERO);
            metrics.roadmap_known_s = Some(last.as_secs_f64());
        }
        let name = |id: NodeId| site.node_names[id.0 as usize].as_str();
        let sentence = |t: &FailedOver| {
            let (region, backup) = (name(t.region), name(t.backup));
            format!("{region} by {backup} in cycle {}", t.cycle)
        };
        metrics.refused = site.refused.len() as u32;
        let refused = site.refused.iter();
        metrics.refused_missions = refused.map(|r| r.sentence(&site.rover_names)).collect();
        metrics.failovers = self.failed_over.len() as u32;
        metrics.failed_over = self.failed_over.iter().map(sentence).collect();
        let track = |rover: RoverId| &self.tracks[rover.0 as usize];
        let arrived_s = |(rover, _)| track(rover).arrived_at.map(SimTime::as_secs_f64);
        metrics.arrival_s = site.team().map(arrived_s).collect();
        let name = |rover: &RoverId| site.rover_names.get(rover.0 as usize).cloned();
        let ring: Vec<_> = self.last_confirmed.iter().filter_map(name).collect();
        metrics.last_confirmed = (!ring.is_empty()).then(|| ring.join(" > "));
        metrics.completed = metrics.arrival_s.iter().all(Option::is_some);
        metrics.deadlocked = self.deadlock != Deadlock::None;
        let energies_j = self.tracks.iter().map(|track| track.transmit_energy_j);
        metrics.transmit_energy_j = energies_j.sum();
        metrics.intervention_rate = f64::from(self.interventions) / f64::from(metrics.cycles);
        metrics.max_plus_iterations = self.iterations as f64 / self.planned_cycles.max(1) as f64;
        self.loads.write(site.sensors.len(), &mut metrics);
        let rover_cycles = f64::from(metrics.rovers) * f64::from(metrics.cycles);
        metrics.messages_per_rover_cycle = self.messages as f64 / rover_cycles;
        metrics.bytes_per_rover_cycle = self.bytes as f64 / rover_cycles;
        let rovers = site.team();
        let cost = |(rover, (start, goal)): (RoverId, (VertexId, VertexId))| {
            (track(rover).cost, site.roadmap.distance(start, goal))
        };
        metrics.costs = site
            .stay_at_target
            .then(|| Costs::new(&rovers.map(cost).collect::<Vec<_>>()));
        self.measure_paths(site, &mut metrics);
        metrics
    }

    /// The paths of the rovers that arrived, in the mean.
    fn measure_paths(&self, site: &Shared, metrics: &mut NetworkMetrics) {
        for (track, &(entry, goal)) in self.tracks.iter().zip(&site.missions) {
            let (Some(entered), Some(arrived)) = (track.entered, track.arrived) else {
                continue;
            };
            let shortest = f64::from(site.roadmap.distance(entry, goal).max(1));
            // Both the cycle of the entry and that of the arrival were spent on the way.
            let steps = arrived + 1 - entered;
            metrics.arrived += 1;
            metrics.path_ratio += f64::from(steps) / shortest;
            metrics.time_ratio += match (site.config.motion, track.arrived_at) {
                (Motion::Continuous, Some(at)) if entry != goal => {
                    at.as_secs_f64() / site.edge_times().alone(entry, goal).as_secs_f64()
                }
                _ => f64::from(arrived + 1) / shortest,
            };
            metrics.mean_steps += f64::from(steps);
            metrics.total_steps += u64::from(steps);
            metrics.mean_queued += f64::from(entered);
            metrics.mean_stops += f64::from(steps.saturating_sub(track.moves));
            metrics.mean_backtracks += f64::from(track.backtracks);
        }
        let count = f64::from(metrics.arrived.max(1));
        for mean in [
            &mut metrics.path_ratio,
            &mut metrics.time_ratio,
            &mut metrics.mean_steps,
            &mut metrics.mean_queued,
            &mut metrics.mean_stops,
            &mut metrics.mean_backtracks,
        ] {
            *mean /= count;
        }
    }
}
