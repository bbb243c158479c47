//! The hardware as a state machine: what runs, what happens next, what it takes. It reads no clock,
//! sends nothing and knows no simulator; the actor next door gives it the time and takes what comes
//! out. How commands begin is in `begin`, how they end in `end`, what faults do in `broken`,
//! what it tells of itself in `told`.

mod begin;
mod broken;
mod end;
mod told;

use std::sync::Arc;

use farside::random::RandomKey;
use farside::{SimDuration, SimTime};

use super::RoverSpec;
use super::body::{Attitude, Body, Errand, Ground, Pose, Step};
use super::command::{
    Command, CommandEnd, CommandReport, Failure, Part, Reading, RoverCommand, StopCause, View,
};
use super::faults::FaultBegins;
use super::landmarks::Landmarks;
use super::lifts::Lifts;
use super::memory::Memory;
use super::model::InstrumentKind;
use super::power::{CONSUMERS, Consumer, Power};
use super::record::{RoverIncident, RoverPose, RoverResources};

/// The places of parts in [`Hardware::runs`]; instruments follow.
const WHEELS: usize = 0;
const MAST: usize = 1;
const RADIO: usize = 2;
const HEATER: usize = 3;
const BODY: usize = 4;
const FANS: usize = 5;
const FIRST_INSTRUMENT: usize = 6;

/// The names of those parts, as faults give them.
const NAMES: [&str; FIRST_INSTRUMENT] = ["wheels", "mast", "radio", "heater", "body", "fans"];

/// A way that is as good as none \[m\].
const NO_WAY_M: f64 = 1e-9;

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
    /// The wheels are off the rock that this fault had put under them.
    OffRock(u32),
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
    lifts: Lifts,
    /// What the fans were told last.
    fans_on: bool,
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
    /// How many readings were taken: each has a number.
    readings: u32,
}

impl Hardware {
    pub(super) fn new(spec: Arc<RoverSpec>) -> Hardware {
        let model = &spec.config;
        let start = Pose {
            east_m: spec.start.east_m,
            north_m: spec.start.north_m,
            yaw_rad: super::body::wrapped(spec.start.yaw_rad),
        };
        let every = model.record_every;
        Hardware {
            key: RandomKey::new(spec.seed).text("rover").text(&spec.name),
            now: SimTime::ZERO,
            body: Body::new(start),
            memory: Memory::new(model.memory_bytes),
            landmarks: Landmarks::from_orbit(&spec.site.ground, model.known_from_m),
            lifts: Lifts::default(),
            fans_on: false,
            mast_rad: [0.0; 2],
            runs: vec![None; FIRST_INSTRUMENT + model.instruments.len()],
            faults: Vec::new(),
            begun_faults: Vec::new(),
            heard: SimTime::ZERO,
            records: (!every.is_zero()).then_some(SimTime::ZERO),
            level: (SimTime::ZERO, false),
            is_stale: true,
            is_deaf: false,
            readings: 0,
            power: Power::new(model, &spec.site),
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
        if let Some((at, fault)) = self.off_rock() {
            consider(Some(at), Due::OffRock(fault));
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

    /// When the wheels are off the next of the rocks under them, if the present step brings them so far;
    /// and of which fault it is.
    fn off_rock(&self) -> Option<(SimTime, u32)> {
        let (fault, until_m) = self.lifts.next()?;
        let left_m = until_m - self.body.driven_m;
        if left_m <= NO_WAY_M {
            return Some((self.now, fault));
        }
        let run = self.runs[WHEELS].as_ref()?;
        let (Activity::Drive { step, .. }, Some(ends)) = (&run.activity, run.ends) else {
            return None;
        };
        if step.way_m < left_m {
            return None;
        }
        let lasts_ns = ends.since(run.begun).as_nanos() as f64;
        let after_ns = libm::ceil(lasts_ns * (left_m / step.way_m)) as u64;
        let at = run.begun.saturating_add(SimDuration::from_nanos(after_ns));
        Some((at.min(ends), fault))
    }

    fn advance(&mut self, now: SimTime, out: &mut Vec<Output>) {
        self.settle();
        while let Some((at, due)) = self.next_due().filter(|(at, _)| *at <= now) {
            self.pass(at);
            match due {
                Due::Level(true) => self.cross(out),
                Due::Level(false) => self.is_stale = true,
                Due::Step(place) => self.complete(place, out),
                Due::OffRock(fault) => self.leave_rock(fault, out),
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
        self.set_loads();
        self.level = self.power.next_crossing();
    }

    /// Sets what takes power and what heats the bay to what runs.
    fn set_loads(&mut self) {
        let loads_w = self.loads_w();
        self.power.set_loads(loads_w);
        let (fans_run, fault_w) = (self.fans_run(), self.bay_heat_w());
        self.power.bay.set(fans_run, fault_w);
    }

    /// Whether the fans run, whatever they are told.
    fn fans_run(&self) -> bool {
        let has_power = self.runs[BODY].is_none() && !self.power.is_cut_off();
        self.fans_on && has_power && !self.are_fans_failed()
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
        if self.fans_run() {
            loads_w[Consumer::Fans as usize] = model.bay.fan_power_w;
        }
        for (place, run) in self.runs.iter().enumerate() {
            let consumer = match place {
                WHEELS => Consumer::Wheels,
                MAST => Consumer::Mast,
                RADIO => Consumer::Radio,
                HEATER => Consumer::Heater,
                BODY => Consumer::Body,
                FANS => Consumer::Fans,
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
            FANS => Part::Fans,
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

    /// How far the wheels went since the start \[m\].
    fn driven_m(&self) -> f64 {
        self.driving().map_or(self.body.driven_m, |(step, share)| {
            self.body.driven_on_step_m(step, share)
        })
    }

    fn attitude(&self, truth: &Pose) -> Attitude {
        let (ground, wheelbase_m) = (&self.spec.site.ground, self.spec.config.wheelbase_m);
        Attitude::on(ground, truth, wheelbase_m, &self.lifts.sum())
    }

    fn mast_now_rad(&self) -> [f64; 2] {
        match &self.runs[MAST] {
            Some(run) => slewed(&run.activity, run.share(self.now)).unwrap_or(self.mast_rad),
            None => self.mast_rad,
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
