//! The hardware as a state machine: what runs, what happens next, what it takes. It reads no clock,
//! sends nothing and knows no simulator; the actor next door gives it the time and takes what comes
//! out. How commands begin is in `begin`, how they end in `end`, what faults do in `broken`.

mod begin;
mod broken;
mod end;

use std::sync::Arc;

use farside::random::RandomKey;
use farside::{SimDuration, SimTime};

use super::RoverSpec;
use super::body::{Attitude, Body, Errand, Ground, Pose, Step};
use super::command::{
    Command, CommandEnd, CommandReport, Failure, Part, PoseEstimate, Reading, RoverCommand,
    RoverState, Running, StopCause, View,
};
use super::faults::FaultBegins;
use super::landmarks::Landmarks;
use super::memory::Memory;
use super::model::InstrumentKind;
use super::power::{CONSUMERS, Consumer, Power};
use super::record::{RoverFigures, RoverIncident, RoverPose, RoverResources};

/// The places of parts in [`Hardware::runs`]; instruments follow.
const WHEELS: usize = 0;
const MAST: usize = 1;
const RADIO: usize = 2;
const HEATER: usize = 3;
const BODY: usize = 4;
const FIRST_INSTRUMENT: usize = 5;

/// The names of those parts, as faults give them.
const NAMES: [&str; FIRST_INSTRUMENT] = ["wheels", "mast", "radio", "heater", "body"];

/// What comes out of the hardware.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Output {
    Report(CommandReport),
    Pose(RoverPose),
    Resources(RoverResources),
    Incident(RoverIncident),
}

/// A command that runs, at its present step.
#[derive(Clone, Debug)]
struct Run {
    id: u32,
    activity: Activity,
    /// The parts that no other command may need meanwhile, a bit for each.
    holds: u64,
    /// When the step began.
    begun: SimTime,
    /// When it ends; none if a fault keeps it from ending.
    ends: Option<SimTime>,
    /// How many times as long as it should it takes; none: for ever.
    slower: Option<f64>,
    power_w: f64,
}

impl Run {
    /// How much of the step is done, from 0 to 1.
    fn share(&self, now: SimTime) -> f64 {
        let Some(ends) = self.ends else { return 0.0 };
        let lasts = ends.since(self.begun).as_nanos();
        match lasts {
            0 => 1.0,
            lasts => (now.since(self.begun).as_nanos() as f64 / lasts as f64).min(1.0),
        }
    }
}

#[derive(Clone, Copy, Debug)]
enum Activity {
    Drive {
        errand: Errand,
        step: Step,
    },
    Slew {
        from_rad: [f64; 2],
        to_rad: [f64; 2],
    },
    Read {
        view: View,
    },
    Transmit {
        size_bytes: u64,
    },
    Heat,
    Sleep,
}

/// What happens at a time that the hardware knows beforehand.
#[derive(Clone, Copy, Debug)]
enum Due {
    /// The battery reaches the level of a brown-out, or of its end; if false, one has to look
    /// further ahead.
    Level(bool),
    /// The step of the command on this part ends.
    Step(usize),
    /// The controller's lease ends.
    Lease,
    /// The state is to be recorded.
    Record,
}

/// The hardware of a rover.
#[derive(Clone, Debug)]
pub(super) struct Hardware {
    spec: Arc<RoverSpec>,
    /// Of all its draws.
    key: RandomKey,
    now: SimTime,
    body: Body,
    power: Power,
    memory: Memory,
    landmarks: Landmarks,
    /// Where the mast points: pan and tilt \[rad\].
    mast_rad: [f64; 2],
    /// By part.
    runs: Vec<Option<Run>>,
    /// Those that last.
    faults: Vec<FaultBegins>,
    /// The numbers of all that ever began.
    begun_faults: Vec<u32>,
    /// When the controller was heard of last.
    heard: SimTime,
    /// When the state is to be recorded next.
    records: Option<SimTime>,
    /// When the battery's level matters next.
    level: (SimTime, bool),
    /// Something changed that the level's time hangs on.
    is_stale: bool,
    /// Its computer is being restarted: commands end with their steps and nobody is told.
    is_deaf: bool,
    figures: RoverFigures,
}

impl Hardware {
    pub(super) fn new(spec: Arc<RoverSpec>) -> Hardware {
        let model = &spec.config;
        let start = Pose {
            east_m: spec.start.east_m,
            north_m: spec.start.north_m,
            yaw_rad: super::body::wrapped(spec.start.yaw_rad),
        };
        let power = Power::new(model, &spec.site);
        let every = model.record_every;
        Hardware {
            key: RandomKey::new(spec.seed).text("rover").text(&spec.name),
            now: SimTime::ZERO,
            body: Body::new(start),
            memory: Memory::new(model.memory_bytes),
            landmarks: Landmarks::from_orbit(&spec.site.ground, model.known_from_m),
            mast_rad: [0.0; 2],
            runs: vec![None; FIRST_INSTRUMENT + model.instruments.len()],
            faults: Vec::new(),
            begun_faults: Vec::new(),
            heard: SimTime::ZERO,
            records: (!every.is_zero()).then_some(SimTime::ZERO),
            level: (SimTime::ZERO, false),
            is_stale: true,
            is_deaf: false,
            figures: RoverFigures {
                least_stored_j: power.stored_j(),
                ..RoverFigures::default()
            },
            power,
            spec,
        }
    }

    /// Lets time pass until now, with all that happens meanwhile. `links_j` is all that links ever
    /// charged the host. Whatever comes from outside comes after this.
    pub(super) fn wake(&mut self, now: SimTime, links_j: f64, out: &mut Vec<Output>) {
        self.advance(now, out);
        if let Some(energy_j) = self.power.take_links(links_j) {
            self.is_stale = true;
            if energy_j > 0.0 {
                out.push(Output::Incident(RoverIncident::Unsupplied { energy_j }));
            }
            self.advance(now, out);
        }
    }

    /// A command arrives.
    pub(super) fn command(&mut self, command: RoverCommand, out: &mut Vec<Output>) {
        self.heard = self.now;
        let RoverCommand { id, command } = command;
        if let Command::Stop { part } = command {
            self.stop(id, part, out);
        } else {
            self.figures.commands += 1;
            if let Err((part, reason)) = self.begin(id, command, out) {
                let end = CommandEnd::Refused { reason };
                self.report(id, part, end, Vec::new(), out);
            }
        }
        self.is_stale = true;
        self.advance(self.now, out);
    }

    /// The controller is heard of.
    pub(super) fn hear(&mut self) {
        self.heard = self.now;
    }

    /// When something happens next by itself.
    pub(super) fn next(&mut self) -> Option<SimTime> {
        self.settle();
        self.next_due().map(|(at, _)| at)
    }

    /// The figures so far.
    pub(super) fn figures(&mut self) -> &RoverFigures {
        let energy = self.power.energy();
        let figures = &mut self.figures;
        let imbalance = (energy.imbalance_j() / energy.total_j().max(1.0)).abs();
        figures.imbalance = figures.imbalance.max(imbalance);
        figures.least_stored_j = figures.least_stored_j.min(energy.stored_j);
        figures.energy = energy;
        figures.driven_m = self.body.driven_m;
        figures.position_error_m = self.body.error_m();
        figures.max_position_error_m = figures.max_position_error_m.max(figures.position_error_m);
        figures.memory_used_bytes = self.memory.used_bytes();
        figures.stored_bytes = self.memory.stored_bytes;
        figures.sent_bytes = self.memory.sent_bytes;
        figures.lost_bytes = self.memory.lost_bytes;
        figures
    }

    /// What the rover says of itself.
    pub(super) fn state(&mut self, id: u32) -> RoverState {
        self.settle();
        let [solar_w, load_w] = self.power.now_w();
        let [pan_rad, tilt_rad] = self.mast_now_rad();
        let runs = self.runs.iter().enumerate();
        let running = runs.filter_map(|(place, run)| {
            let (part, id) = (self.part(place), run.as_ref()?.id);
            Some(Running { part, id })
        });
        RoverState {
            id,
            pose: self.pose_estimate(),
            pan_rad,
            tilt_rad,
            battery_j: self.power.stored_j(),
            battery_capacity_j: self.spec.config.battery_j,
            solar_w,
            load_w,
            memory_used_bytes: self.memory.used_bytes(),
            memory_size_bytes: self.memory.capacity_bytes(),
            asleep: self.runs[BODY].is_some(),
            brown_out: self.power.is_cut_off(),
            running: running.collect(),
        }
    }

    /// The next thing that happens by itself. Of those at one time the first of this order.
    fn next_due(&self) -> Option<(SimTime, Due)> {
        let (at, is_crossed) = self.level;
        let mut next = (at, Due::Level(is_crossed));
        let mut consider = |at: Option<SimTime>, due: Due| {
            if let Some(at) = at.filter(|at| *at < next.0) {
                next = (at, due);
            }
        };
        for (place, run) in self.runs.iter().enumerate() {
            consider(run.as_ref().and_then(|run| run.ends), Due::Step(place));
        }
        consider(self.lease_end(), Due::Lease);
        consider(self.records, Due::Record);
        (next.0 < SimTime::MAX).then_some(next)
    }

    /// When the lease ends; none while nothing runs that it holds.
    fn lease_end(&self) -> Option<SimTime> {
        let lease = self.spec.config.lease;
        let runs = self.runs.iter().enumerate();
        let mut held = runs.filter(|(place, run)| run.is_some() && is_leased(*place));
        (!lease.is_zero() && held.next().is_some()).then(|| self.heard.saturating_add(lease))
    }

    fn advance(&mut self, now: SimTime, out: &mut Vec<Output>) {
        self.settle();
        while let Some((at, due)) = self.next_due().filter(|(at, _)| *at <= now) {
            self.pass(at);
            match due {
                Due::Level(true) => self.cross(out),
                Due::Level(false) => self.is_stale = true,
                Due::Step(place) => self.complete(place, out),
                Due::Lease => self.end_lease(out),
                Due::Record => {
                    self.records = Some(at.saturating_add(self.spec.config.record_every));
                    self.record_pose(out);
                    self.record_resources(out);
                }
            }
            self.settle();
        }
        self.pass(now);
    }

    fn pass(&mut self, to: SimTime) {
        self.power.advance(to);
        self.now = self.now.max(to);
    }

    /// Sets the loads to what runs, and finds when the battery's level matters next.
    fn settle(&mut self) {
        if !self.is_stale {
            return;
        }
        self.is_stale = false;
        let loads_w = self.loads_w();
        self.power.set_loads(loads_w);
        self.level = self.power.next_crossing();
    }

    fn loads_w(&self) -> [f64; CONSUMERS] {
        let model = &self.spec.config;
        let mut loads_w = [0.0; CONSUMERS];
        let asleep = self.runs[BODY].is_some();
        loads_w[Consumer::Body as usize] = match asleep {
            true => model.sleep_power_w,
            false => model.awake_power_w,
        };
        loads_w[Consumer::Fault as usize] = self.extra_power_w();
        for (place, run) in self.runs.iter().enumerate() {
            let consumer = match place {
                WHEELS => Consumer::Wheels,
                MAST => Consumer::Mast,
                RADIO => Consumer::Radio,
                HEATER => Consumer::Heater,
                BODY => Consumer::Body,
                _ => Consumer::Instruments,
            };
            loads_w[consumer as usize] += run.as_ref().map_or(0.0, |run| run.power_w);
        }
        loads_w
    }

    /// The part at a place.
    fn part(&self, place: usize) -> Part {
        match place {
            WHEELS => Part::Wheels,
            MAST => Part::Mast,
            RADIO => Part::Radio,
            HEATER => Part::Heater,
            BODY => Part::Body,
            instrument => Part::Instrument {
                name: self.spec.config.instruments[instrument - FIRST_INSTRUMENT]
                    .name
                    .clone(),
            },
        }
    }

    /// The name of the part at a place, as faults give it.
    fn part_name(&self, place: usize) -> &str {
        let instruments = || {
            let instrument = &self.spec.config.instruments[place - FIRST_INSTRUMENT];
            instrument.name.as_str()
        };
        NAMES.get(place).copied().unwrap_or_else(instruments)
    }

    /// Where it is and where it believes to be.
    fn poses(&self) -> [Pose; 2] {
        match self.driving() {
            Some((step, share)) => self.body.on_step(step, share),
            None => [self.body.truth, self.body.estimate],
        }
    }

    /// The step of driving under way, and how much of it is done.
    fn driving(&self) -> Option<(&Step, f64)> {
        let run = self.runs[WHEELS].as_ref()?;
        match &run.activity {
            Activity::Drive { step, .. } => Some((step, run.share(self.now))),
            _ => None,
        }
    }

    fn position_sigma_m(&self) -> f64 {
        let model = &self.spec.config;
        self.driving().map_or(self.body.sigma_m, |(step, share)| {
            self.body.sigma_on_step_m(step, share, model)
        })
    }

    fn attitude(&self, truth: &Pose) -> Attitude {
        Attitude::on(&self.spec.site.ground, truth, self.spec.config.wheelbase_m)
    }

    fn mast_now_rad(&self) -> [f64; 2] {
        match &self.runs[MAST] {
            Some(run) => slewed(&run.activity, run.share(self.now)).unwrap_or(self.mast_rad),
            None => self.mast_rad,
        }
    }

    /// Where it believes to be. The inertial unit is as wrong whoever asks, and how often.
    fn pose_estimate(&self) -> PoseEstimate {
        let [truth, estimate] = self.poses();
        let attitude = self.attitude(&truth);
        let key = self.key.text("imu").number(self.now.as_nanos());
        let (mut draws, sigma_rad) = (key.stream(), self.spec.config.imu_sigma_rad);
        PoseEstimate {
            east_m: estimate.east_m,
            north_m: estimate.north_m,
            yaw_rad: estimate.yaw_rad,
            roll_rad: draws.normal(attitude.roll_rad, sigma_rad),
            pitch_rad: draws.normal(attitude.pitch_rad, sigma_rad),
            position_sigma_m: self.position_sigma_m(),
        }
    }

    fn report(
        &mut self,
        id: u32,
        part: Option<Part>,
        end: CommandEnd,
        readings: Vec<Reading>,
        out: &mut Vec<Output>,
    ) {
        match &end {
            CommandEnd::Done => self.figures.done += 1,
            CommandEnd::Stopped { .. } => self.figures.stopped += 1,
            CommandEnd::Failed { .. } => self.figures.failed += 1,
            CommandEnd::Refused { .. } => self.figures.refused += 1,
        }
        if self.is_deaf {
            return;
        }
        let pose = self.pose_estimate();
        out.push(Output::Report(CommandReport {
            id,
            part,
            end,
            readings,
            pose,
        }));
    }

    fn record_pose(&self, out: &mut Vec<Output>) {
        let [truth, estimate] = self.poses();
        let attitude = self.attitude(&truth);
        out.push(Output::Pose(RoverPose {
            east_m: truth.east_m,
            north_m: truth.north_m,
            height_m: attitude.height_m,
            yaw_rad: truth.yaw_rad,
            roll_rad: attitude.roll_rad,
            pitch_rad: attitude.pitch_rad,
            estimated_east_m: estimate.east_m,
            estimated_north_m: estimate.north_m,
            estimated_yaw_rad: estimate.yaw_rad,
            position_sigma_m: self.position_sigma_m(),
        }));
    }

    fn record_resources(&mut self, out: &mut Vec<Output>) {
        let loads_w = self.loads_w();
        self.power.set_loads(loads_w);
        let [solar_w, load_w] = self.power.now_w();
        out.push(Output::Resources(RoverResources {
            solar_w,
            load_w,
            battery_capacity_j: self.spec.config.battery_j,
            memory_used_bytes: self.memory.used_bytes(),
            memory_size_bytes: self.memory.capacity_bytes(),
            asleep: self.runs[BODY].is_some(),
            brown_out: self.power.is_cut_off(),
            energy: self.power.energy(),
        }));
    }
}

/// The bit of the part at a place, in [`Run::holds`].
fn bit(place: usize) -> u64 {
    1 << place
}

/// Whether a command on this part ends with the controller's lease: all but sleep and heat, which
/// are safe.
fn is_leased(place: usize) -> bool {
    !matches!(place, BODY | HEATER)
}

/// Where a slewing mast points, a share of the way done.
fn slewed(activity: &Activity, share: f64) -> Option<[f64; 2]> {
    match activity {
        Activity::Slew { from_rad, to_rad } => {
            Some([0, 1].map(|axis| from_rad[axis] + share * (to_rad[axis] - from_rad[axis])))
        }
        _ => None,
    }
}
