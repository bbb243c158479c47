//! What problems are drawn from: the keys of the generator.

use farside::SimDuration;
use farside_actors::system::settings::{in_unit, over};
use farside_actors::{settings, units};

const MINUTE_S: u64 = 60;

settings! {
    /// The `[problem]` table: what a problem is drawn from (the paper's section 5.1, Tables 1 and 2;
    /// what the paper leaves open is chosen so that most problems are too large to be completed, as
    /// they are there).
    pub struct ProblemConfig {
        /// How many rovers there are.
        pub rovers: u32 = 3, 1..=50;
        /// How many sols they have.
        pub sols: u32 = 2, 1..=100;
        /// The least number of rocks; each has three goals.
        pub rocks_least: u32 = 10, 1..=300;
        /// The greatest number of rocks.
        pub rocks_most: u32 = 30, 1..=300;
        /// The least side of the square terrain.
        pub side_least_m as "side_least": f64 [with = "units::length_m"] = 40.0,
            in_unit("m", 20.0..=100_000.0);
        /// The greatest side of the square terrain.
        pub side_most_m as "side_most": f64 [with = "units::length_m"] = 100.0,
            in_unit("m", 20.0..=100_000.0);
        /// How far from the middle rovers start, at the most.
        pub start_within_m as "start_within": f64 [with = "units::length_m"] = 5.0,
            in_unit("m", 0.0..=10.0);
        /// How fast rovers drive.
        pub speed_m_per_s as "speed": f64 [with = "units::speed_m_per_s"] = 0.01,
            in_unit("m/s", 0.001..=100.0);
        /// The power that driving takes.
        pub drive_power_w as "drive_power": f64 [with = "units::power_w"] = 100.0,
            in_unit("W", 0.0..=10_000.0);
        /// How long a rover can be active in a sol.
        pub sol_length as "sol": SimDuration [with = "units::duration"]
            = SimDuration::from_secs(300 * MINUTE_S), over(SimDuration::ZERO);
        /// The energy that a rover has in a sol; what is left is lost.
        pub energy_j as "energy": f64 [with = "units::energy_j"] = 300.0 * 3600.0,
            in_unit("J", 0.0..=1e9);
        /// How much a rover can store.
        pub memory_bits as "memory": u64 [with = "units::data_size_bits"] = 160_000_000,
            in_unit("bit", 0..=1_000_000_000_000);
        /// How long the daily communication takes.
        pub communication: SimDuration [with = "units::duration"]
            = SimDuration::from_secs(10 * MINUTE_S), over(SimDuration::ZERO);
        /// In how long a time before the end of the sol the communication has to be made.
        pub communication_window: SimDuration [with = "units::duration"]
            = SimDuration::from_secs(10 * MINUTE_S), over(SimDuration::ZERO);
        /// The power that the communication takes.
        pub communication_power_w as "communication_power": f64 [with = "units::power_w"] = 0.0,
            in_unit("W", 0.0..=10_000.0);
        /// How much the communication sends home at the most.
        pub communication_bits as "communication_size": u64 [with = "units::data_size_bits"] = 60_000_000,
            in_unit("bit", 0..=1_000_000_000_000);
        /// A rock's value is a whole number from 1 to this.
        pub value_most: u32 = 14, 1..=1_000_000;
        /// What a long-range image (A) is worth beyond the rock's value.
        pub reward_a: f64 = 11.0, -1e6..=1e6;
        /// What a close-up image (B) is worth beyond the rock's value.
        pub reward_b: f64 = 6.0, -1e6..=1e6;
        /// What a spectrometer's reading (C) is worth beyond the rock's value.
        pub reward_c: f64 = 1.0, -1e6..=1e6;
        /// The factor of A and B: what both are worth together is this times the sum of their rewards.
        pub factor_ab: f64 = 1.75, -100.0..=100.0;
        /// The factor of A and C.
        pub factor_ac: f64 = 2.25, -100.0..=100.0;
        /// The other factor of A and C.
        pub factor_ac_else: f64 = 1.25, -100.0..=100.0;
        /// How often A and C have the first of their factors.
        pub factor_ac_share: f64 [with = "units::fraction"] = 0.9;
        /// The factor of B and C.
        pub factor_bc: f64 = 1.25, -100.0..=100.0;
        /// How often each combination is left out.
        pub combination_dropped: f64 [with = "units::fraction"] = 0.5;
        /// From how far a long-range image is taken.
        pub stand_off_m as "stand_off": f64 [with = "units::length_m"] = 8.0,
            in_unit("m", 0.0..=10.0);
        /// How long A takes.
        pub duration_a: SimDuration [with = "units::duration"]
            = SimDuration::from_secs(20 * MINUTE_S), over(SimDuration::ZERO);
        /// How long B takes.
        pub duration_b: SimDuration [with = "units::duration"]
            = SimDuration::from_secs(45 * MINUTE_S), over(SimDuration::ZERO);
        /// How long C takes.
        pub duration_c: SimDuration [with = "units::duration"]
            = SimDuration::from_secs(180 * MINUTE_S), over(SimDuration::ZERO);
        /// The power that A takes.
        pub power_a_w as "power_a": f64 [with = "units::power_w"] = 40.0, in_unit("W", 0.0..=10_000.0);
        /// The power that B takes.
        pub power_b_w as "power_b": f64 [with = "units::power_w"] = 45.0, in_unit("W", 0.0..=10_000.0);
        /// The power that C takes.
        pub power_c_w as "power_c": f64 [with = "units::power_w"] = 30.0, in_unit("W", 0.0..=10_000.0);
        /// What A adds to memory.
        pub memory_a_bits as "memory_a": u64 [with = "units::data_size_bits"] = 30_000_000,
            in_unit("bit", 0..=1_000_000_000_000);
        /// What B adds to memory.
        pub memory_b_bits as "memory_b": u64 [with = "units::data_size_bits"] = 20_000_000,
            in_unit("bit", 0..=1_000_000_000_000);
        /// What C adds to memory.
        pub memory_c_bits as "memory_c": u64 [with = "units::data_size_bits"] = 5_000_000,
            in_unit("bit", 0..=1_000_000_000_000);
        /// How often a close-up image needs two rovers at one time (images in stereo; not in the paper).
        pub joint_share as "joint": f64 [with = "units::fraction"] = 0.0;
        /// What a goal that needs two rovers is worth, by how much it would be with one.
        pub joint_factor: f64 = 3.0, 0.0..=100.0;
        /// A CSV file with what plans are worth at the most, by the problem's digest, as the oracle
        /// `misus_bound.py --table` writes it; the bounds that are built in unless given.
        pub bounds: String [skip_serializing_if = "String::is_empty"];
    }
}
