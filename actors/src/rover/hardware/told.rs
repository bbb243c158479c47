//! What the hardware tells of itself: to the controller what sensors have, to the log the truth.

use farside::random::Stream;

use super::super::command::{PoseEstimate, RoverState, Running};
use super::*;

impl Hardware {
    /// What the rover says of itself.
    pub(in super::super) fn state(&mut self, id: u32) -> RoverState {
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
            compass_rad: self.compass_rad(),
            bay_c: self.measured_bay_c(),
            fans_on: self.fans_on,
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

    /// Where it believes to be, and how it stands as the inertial unit has it.
    pub(super) fn pose_estimate(&self) -> PoseEstimate {
        let [truth, estimate] = self.poses();
        let attitude = self.attitude(&truth);
        let (mut draws, sigma_rad) = (self.sensor("imu"), self.spec.config.imu_sigma_rad);
        PoseEstimate {
            east_m: estimate.east_m,
            north_m: estimate.north_m,
            yaw_rad: estimate.yaw_rad,
            roll_rad: draws.normal(attitude.roll_rad + self.roll_bias_rad(), sigma_rad),
            pitch_rad: draws.normal(attitude.pitch_rad + self.pitch_bias_rad(), sigma_rad),
            position_sigma_m: self.position_sigma_m(),
        }
    }

    /// The draws of a sensor: as wrong whoever asks, and how often.
    fn sensor(&self, name: &str) -> Stream {
        self.key.text(name).number(self.now.as_nanos()).stream()
    }

    /// The heading as the compass has it.
    fn compass_rad(&self) -> f64 {
        let [truth, _] = self.poses();
        let sigma_rad = self.spec.config.compass_sigma_rad;
        super::super::body::wrapped(self.sensor("compass").normal(truth.yaw_rad, sigma_rad))
    }

    /// How warm the bay is, as measured.
    fn measured_bay_c(&self) -> f64 {
        let sigma_k = self.spec.config.bay.sigma_k;
        self.sensor("bay").normal(self.power.bay.bay_c(), sigma_k)
    }

    pub(super) fn record_pose(&self, out: &mut Vec<Output>) {
        out.push(Output::Pose(self.pose()));
    }

    pub(super) fn record_resources(&mut self, out: &mut Vec<Output>) {
        let resources = self.resources();
        out.push(Output::Resources(resources));
    }

    /// Where it is and where it believes to be, for the log.
    pub(in super::super) fn pose(&self) -> RoverPose {
        let [truth, estimate] = self.poses();
        let attitude = self.attitude(&truth);
        RoverPose {
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
            driven_m: self.driven_m(),
        }
    }

    /// What it has, for the log.
    pub(in super::super) fn resources(&mut self) -> RoverResources {
        self.set_loads();
        let [solar_w, load_w] = self.power.now_w();
        RoverResources {
            solar_w,
            load_w,
            battery_capacity_j: self.spec.config.battery_j,
            memory_used_bytes: self.memory.used_bytes(),
            memory_size_bytes: self.memory.capacity_bytes(),
            stored_bytes: self.memory.stored_bytes,
            sent_bytes: self.memory.sent_bytes,
            lost_bytes: self.memory.lost_bytes,
            bay_c: self.power.bay.bay_c(),
            fans_run: self.power.bay.fans_run(),
            asleep: self.runs[BODY].is_some(),
            brown_out: self.power.is_cut_off(),
            energy: self.power.energy(),
        }
    }
}
