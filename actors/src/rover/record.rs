//! What a rover's hardware leaves to logs, pictures and metrics: samples of its state.
//! Nothing here reaches the controller.

use serde::{Deserialize, Serialize};

use super::power::RoverEnergy;

/// A sample: where a rover is, and where it believes to be. Recorded at the start, at the end of
/// each step of driving, when an image corrects the estimate, when a rock comes under its wheels or is
/// left behind, and every `record_every`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RoverPose {
    /// In truth, to the east \[m\].
    pub east_m: f64,
    /// In truth, to the north \[m\].
    pub north_m: f64,
    /// In truth, how high the ground is \[m\].
    pub height_m: f64,
    /// In truth \[rad, counted from east to north\].
    pub yaw_rad: f64,
    /// In truth \[rad, right side down\].
    pub roll_rad: f64,
    /// In truth \[rad, nose up\].
    pub pitch_rad: f64,
    /// As estimated, to the east \[m\].
    pub estimated_east_m: f64,
    /// As estimated, to the north \[m\].
    pub estimated_north_m: f64,
    /// As estimated \[rad\].
    pub estimated_yaw_rad: f64,
    /// The standard deviation that the rover reckons with \[m\].
    pub position_sigma_m: f64,
    /// How far the wheels went since the start, forwards and backwards \[m\].
    pub driven_m: f64,
}

/// A sample: what a rover has left, and what it lives on. Recorded when commands begin and end and
/// every `record_every`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RoverResources {
    /// What the array yields \[W\].
    pub solar_w: f64,
    /// What all consumers take \[W\].
    pub load_w: f64,
    /// What the battery holds at most \[J\].
    pub battery_capacity_j: f64,
    /// What is in memory \[byte\].
    pub memory_used_bytes: u64,
    /// What memory can hold \[byte\].
    pub memory_size_bytes: u64,
    /// All that was ever read \[byte\].
    pub stored_bytes: u64,
    /// All that was transmitted of it \[byte\].
    pub sent_bytes: u64,
    /// All that was lost of it \[byte\].
    pub lost_bytes: u64,
    /// In truth, how warm the bay with the electronics is \[°C\].
    pub bay_c: f64,
    /// In truth, whether the fans run.
    pub fans_run: bool,
    /// Whether it sleeps.
    pub asleep: bool,
    /// Whether it lies in a brown-out.
    pub brown_out: bool,
    /// Where energy came from and went to; the battery's charge is among it.
    pub energy: RoverEnergy,
}

/// A sample: something happened to a rover that nobody had told it to do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum RoverIncident {
    /// The battery is down: all loads are cut off.
    BrownOut {
        /// The commands that it ended.
        ended: Vec<u32>,
    },
    /// The battery has charge again.
    Recovered,
    /// Links took more than the battery had.
    Unsupplied {
        /// How much was not there \[J\].
        energy_j: f64,
    },
    /// The controller was not heard of for too long.
    LeaseEnded {
        /// The commands that it ended.
        ended: Vec<u32>,
    },
    /// Memory that is out of order, or full, lost data.
    DataLost {
        /// How much \[byte\].
        bytes: u64,
    },
    /// An image placed the rover among rocks that it knows.
    Placed {
        /// How far the estimate moved \[m\].
        moved_m: f64,
    },
    /// The wheels have left the rock behind that tilted the rover.
    OffRock {
        /// The fault that had put it there, by its number.
        fault: u32,
        /// How far the wheels went since the start, forwards and backwards \[m\].
        driven_m: f64,
    },
}
