//! What a rover's controller and its hardware say to each other: commands, how each ended, and the
//! state on demand. Plain messages; what they do is next door.
//!
//! A part of a rover runs one command at a time ([`Part`]). Every command is answered exactly once,
//! by a [`CommandReport`], when it has ended, or at once if it is refused.
//!
//! Places are in the rover's *estimated* frame: metres to the east and to the north, as odometry
//! and images have it. The truth is in the log and nowhere else. Angles are radians: yaw is counted
//! from east to north, roll is positive with the right side down, pitch with the nose up.

use farside::SimDuration;
use serde::{Deserialize, Serialize};

/// A command to a rover, with a number of the controller's own, by which its report is known.
///
/// ```
/// use farside_actors::rover::{Aim, Command, RoverCommand, View};
/// let rock = Aim::Place { east_m: 4.0, north_m: -2.5 };
/// let look = RoverCommand { id: 1, command: Command::PanTilt { aim: rock } };
/// let spectrometer = "mini_tes".to_owned();
/// let read = RoverCommand { id: 2, command: Command::Spectrum { spectrometer, view: View::Point } };
/// assert_ne!(look, read);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoverCommand {
    /// Told again in the report. The hardware only hands it back: two commands may have one number.
    pub id: u32,
    /// What to do.
    pub command: Command,
}

/// What a rover can do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Command {
    /// Wheels: turn towards a place and drive there in a straight line. It ends where the rover
    /// *believes* to be there.
    Drive {
        /// To the east, in the estimated frame \[m\].
        east_m: f64,
        /// To the north, in the estimated frame \[m\].
        north_m: f64,
    },
    /// Wheels: turn in place to a heading, the shorter way round.
    Turn {
        /// The heading, in the estimated frame \[rad, counted from east to north\].
        yaw_rad: f64,
    },
    /// Wheels: drive straight backwards.
    BackUp {
        /// How far \[m\].
        distance_m: f64,
    },
    /// Ends at once whatever runs on a part, or everything. It is never refused, needs no part, and
    /// is done in the event in which it arrives. Stopping [`Part::Body`] ends a sleep.
    Stop {
        /// The part; none for all of them.
        part: Option<Part>,
    },
    /// Mast: point the instruments that it carries.
    PanTilt {
        /// At what.
        aim: Aim,
    },
    /// A camera, with the mast if it is up there: take an image. The wheels must stand still.
    Image {
        /// The camera's name, as the rover's model has it.
        camera: String,
        /// Of one thing, or of all around.
        view: View,
    },
    /// A spectrometer, with the mast if it is up there: take a spectrum. The wheels must stand
    /// still.
    Spectrum {
        /// The spectrometer's name, as the rover's model has it.
        spectrometer: String,
        /// Of one thing, or of all around.
        view: View,
    },
    /// Radio: keep the transmitter on for as long as this much data takes at its rate, and free as
    /// much memory. What is sent is the controller's own affair: it sends the message itself, and the
    /// link charges what the link's energy keys say, which comes out of the same battery.
    Transmit {
        /// Whom it is for; for the log.
        to: String,
        /// How much \[byte\].
        size_bytes: u64,
    },
    /// Heater: warm the rover for a time, beyond what it does by itself at night.
    Heat {
        /// For how long.
        duration: SimDuration,
    },
    /// Fans: turn on, or off. It is open loop: done at once when the fans are told, and nothing
    /// measures whether they run. They go on until they are told again; while the rover sleeps or lies
    /// in a brown-out they stand still.
    Fans {
        /// Whether they are to run.
        on: bool,
    },
    /// The whole body: switch off all that can be, for a time. No part may be busy. Asleep, a rover
    /// answers questions, and obeys [`Command::Stop`].
    Sleep {
        /// For how long.
        duration: SimDuration,
    },
}

/// What the mast is to point at.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Aim {
    /// Angles relative to the body.
    Angles {
        /// From straight ahead to the left \[rad\].
        pan_rad: f64,
        /// From level upwards \[rad\].
        tilt_rad: f64,
    },
    /// The ground at a place. The rover finds it by dead reckoning: the wronger its estimate of
    /// where it is, the farther it points from what was meant.
    Place {
        /// To the east, in the estimated frame \[m\].
        east_m: f64,
        /// To the north, in the estimated frame \[m\].
        north_m: f64,
    },
}

/// How much a reading covers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum View {
    /// What the mast points at, and what lies beside it in the beam.
    Point,
    /// All around, coarsely.
    Panorama,
}

/// A part of a rover, which runs one command at a time.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Part {
    /// What it drives with.
    Wheels,
    /// What points instruments.
    Mast,
    /// A camera or a spectrometer.
    Instrument {
        /// Its name, as the rover's model has it.
        name: String,
    },
    /// The transmitter.
    Radio,
    /// The heater.
    Heater,
    /// The whole of it, for sleep.
    Body,
    /// What cools the bay.
    Fans,
}

/// Keeps the controller's lease without another word. Every command and every question does, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RenewLease;

/// Asks for the state; answered at once by a [`RoverState`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RoverQuery {
    /// Told again in the answer.
    pub id: u32,
}

/// How a command ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CommandReport {
    /// The command's number.
    pub id: u32,
    /// The part that it was for; none if the rover has no such part, and for [`Command::Stop`] of
    /// everything.
    pub part: Option<Part>,
    /// How it ended.
    pub end: CommandEnd,
    /// What was read; empty but for images and spectra that are done.
    pub readings: Vec<Reading>,
    /// Where the rover believes to be at the end.
    pub pose: PoseEstimate,
}

/// How a command ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum CommandEnd {
    /// As it was meant to.
    Done,
    /// It was told to.
    Stopped {
        /// By whom.
        by: StopCause,
    },
    /// It could not go on.
    Failed {
        /// Why.
        reason: Failure,
    },
    /// It was not begun.
    Refused {
        /// Why.
        reason: Refusal,
    },
}

/// Who stopped a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum StopCause {
    /// A command to stop.
    Command,
    /// The controller was not heard of for longer than its lease.
    Lease,
}

/// Why a command failed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Failure {
    /// The way ahead is blocked. The rover stands in front of it.
    Blocked {
        /// By what.
        by: Obstacle,
    },
    /// The battery was down to the level at which all loads are cut off.
    BrownOut,
    /// The instrument failed.
    InstrumentFailed,
    /// The mast is stuck.
    MastStuck,
    /// The memory could not take what was read.
    MemoryFull,
}

/// What blocks a rover's way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Obstacle {
    /// A boulder.
    Boulder,
    /// A slope beyond what the wheels climb.
    Slope,
    /// Ground on which the rover would tilt beyond its limit.
    Tilt,
    /// The end of the terrain that is known.
    Edge,
    /// Something that was not there before: a fault.
    Fault,
}

/// Why a command was refused.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Refusal {
    /// A part that it needs is in use.
    Busy {
        /// The part.
        part: Part,
        /// The command that runs on it.
        by: u32,
    },
    /// The rover has no such part.
    NoSuchPart {
        /// The name that was given.
        found: String,
        /// The nearest name that there is, if any comes near.
        nearest: Option<String>,
    },
    /// The part cannot do this: a camera takes no spectrum, and this instrument no panorama.
    Unable {
        /// The part.
        part: Part,
    },
    /// A value is out of its range, or no number.
    OutOfRange {
        /// Which value.
        what: String,
        /// What it is.
        actual: f64,
        /// The least that is allowed.
        least: f64,
        /// The most that is allowed.
        most: f64,
    },
    /// Nothing is in view: the mast points at the sky, or past the instrument's range.
    NothingInView,
    /// The memory has too little room for what would be read.
    NotEnoughMemory {
        /// What is needed \[byte\].
        needed_bytes: u64,
        /// What is free \[byte\].
        free_bytes: u64,
    },
    /// The battery has too little charge for what the part itself takes; sunlight is not counted on.
    NotEnoughEnergy {
        /// What is needed \[J\].
        needed_j: f64,
        /// What is there above the level of the brown-out \[J\].
        available_j: f64,
    },
    /// It sleeps.
    Asleep,
    /// It lies in a brown-out until the battery has charge again.
    BrownOut,
    /// The instrument is out of order.
    InstrumentFailed,
    /// The mast is stuck.
    MastStuck,
}

/// Where a rover believes to be, and how it stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseEstimate {
    /// To the east \[m\].
    pub east_m: f64,
    /// To the north \[m\].
    pub north_m: f64,
    /// The heading as the rover believes it, by its wheels and by landmarks \[rad, counted from east to
    /// north, over -pi to pi\]. What the compass has is in [`RoverState::compass_rad`].
    pub yaw_rad: f64,
    /// As the inertial unit has it, noise and all \[rad, right side down\].
    pub roll_rad: f64,
    /// As the inertial unit has it, noise and all \[rad, nose up\].
    pub pitch_rad: f64,
    /// The standard deviation of the position that the rover itself reckons with \[m\].
    pub position_sigma_m: f64,
}

/// What a rover says of itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoverState {
    /// The question's number.
    pub id: u32,
    /// Where it believes to be.
    pub pose: PoseEstimate,
    /// The heading as the compass has it, noise and all \[rad, counted from east to north, over -pi
    /// to pi\].
    pub compass_rad: f64,
    /// How warm the bay with the electronics is, noise and all \[°C\].
    pub bay_c: f64,
    /// Whether the fans are told to run. Whether they do, nothing measures.
    pub fans_on: bool,
    /// Where the mast points, from straight ahead to the left \[rad\].
    pub pan_rad: f64,
    /// Where the mast points, from level upwards \[rad\].
    pub tilt_rad: f64,
    /// The charge of the battery \[J\].
    pub battery_j: f64,
    /// What the battery holds \[J\].
    pub battery_capacity_j: f64,
    /// What the solar array yields now \[W\].
    pub solar_w: f64,
    /// What all parts take now \[W\].
    pub load_w: f64,
    /// What is in memory \[byte\].
    pub memory_used_bytes: u64,
    /// What memory can hold now \[byte\].
    pub memory_size_bytes: u64,
    /// Whether it sleeps.
    pub asleep: bool,
    /// Whether it lies in a brown-out.
    pub brown_out: bool,
    /// What runs, in the order of parts.
    pub running: Vec<Running>,
}

/// A command that runs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Running {
    /// The part that it runs on.
    pub part: Part,
    /// The command's number.
    pub id: u32,
}

/// What an instrument measured of one thing.
///
/// Which rock it is of is taken for granted, by its number in the field's catalogue: data
/// association is no part of the simulation. What the rock *is* a rover has to find out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// Unlike that of any other reading of any rover: the rover's number times 2^32, plus how many
    /// readings it had taken before.
    pub id: u64,
    /// The instrument's name.
    pub instrument: String,
    /// Of one thing, or from a panorama.
    pub view: View,
    /// The rock, by its number in the field; none for ground without rocks.
    pub rock: Option<u32>,
    /// Where it lies, in the rover's estimated frame, to the east \[m\].
    pub east_m: f64,
    /// Where it lies, in the rover's estimated frame, to the north \[m\].
    pub north_m: f64,
    /// How far it is from the instrument, as measured \[m\].
    pub range_m: f64,
    /// The diameter of the rock, as seen \[m\]; 0 for ground.
    pub diameter_m: f64,
    /// Texture statistics, in the order of `farside_worlds::geology::TEXTURE_NAMES`; empty for a
    /// spectrometer.
    pub texture: Vec<f64>,
    /// Reflectances in the bands of the field; empty for a camera.
    pub spectrum: Vec<f64>,
    /// The standard deviation of the noise in each value, by the instrument's own reckoning.
    pub noise: f64,
}
