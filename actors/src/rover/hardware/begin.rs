//! How a command begins, or why it is refused.

use std::f64::consts::{PI, TAU};

use nalgebra::Point2;

use super::super::command::{Aim, Refusal};
use super::super::instruments::{Eye, Gaze};
use super::super::model::ViewModel;
use super::*;

/// The longest that a rover backs up at once \[m\].
const MAX_BACK_UP_M: f64 = 100.0;

/// The longest sleep and the longest heating \[s\].
const MAX_REST_S: f64 = 1e7;

/// The most that is transmitted at once \[byte\].
const MAX_TRANSMIT_BYTES: u64 = 1_000_000_000_000;

/// What a refusal is blamed on: the part, if the rover has it, and the reason.
type Refused = (Option<Part>, Refusal);

impl Hardware {
    /// Begins a command, any but to stop.
    pub(super) fn begin(
        &mut self,
        id: u32,
        command: Command,
        out: &mut Vec<Output>,
    ) -> Result<(), Refused> {
        match command {
            Command::Drive { east_m, north_m } => {
                let errand = Errand::Drive(Point2::new(east_m, north_m));
                self.begin_errand(id, errand, out)
            }
            Command::Turn { yaw_rad } => self.begin_errand(id, Errand::Turn(yaw_rad), out),
            Command::BackUp { distance_m } => {
                self.begin_errand(id, Errand::BackUp(distance_m), out)
            }
            Command::PanTilt { aim } => self.begin_slew(id, aim, out),
            Command::Image { camera, view } => {
                self.begin_reading(id, &camera, InstrumentKind::Camera, view, out)
            }
            Command::Spectrum { spectrometer, view } => {
                self.begin_reading(id, &spectrometer, InstrumentKind::Spectrometer, view, out)
            }
            Command::Transmit { size_bytes, .. } => self.begin_transmitting(id, size_bytes, out),
            Command::Heat { duration } => self.begin_rest(id, HEATER, duration, out),
            Command::Sleep { duration } => self.begin_rest(id, BODY, duration, out),
            Command::Fans { on } => self.tell_fans(id, on, out),
            // The caller obeys it before anything is asked.
            Command::Stop { .. } => Ok(()),
        }
    }

    /// Refuses whatever it is if the rover is asleep or without power.
    fn check_awake(&self, place: usize) -> Result<(), Refused> {
        let refused = |reason| Err((Some(self.part(place)), reason));
        if self.power.is_cut_off() {
            return refused(Refusal::BrownOut);
        }
        if self.runs[BODY].is_some() {
            return refused(Refusal::Asleep);
        }
        Ok(())
    }

    /// Refuses a value out of its range.
    fn check_range(
        &self,
        place: usize,
        what: &str,
        actual: f64,
        [least, most]: [f64; 2],
    ) -> Result<(), Refused> {
        if (least..=most).contains(&actual) {
            return Ok(());
        }
        let reason = Refusal::OutOfRange {
            what: what.to_owned(),
            actual,
            least,
            most,
        };
        Err((Some(self.part(place)), reason))
    }

    /// Refuses a command that needs parts which are in use.
    fn check_free(&self, place: usize, needs: u64) -> Result<(), Refused> {
        for (used, run) in self.runs.iter().enumerate() {
            if let Some(run) = run.as_ref().filter(|run| run.holds & needs != 0) {
                let reason = Refusal::Busy {
                    part: self.part(used),
                    by: run.id,
                };
                return Err((Some(self.part(place)), reason));
            }
        }
        Ok(())
    }

    /// Refuses a command that takes more energy than there is.
    fn check_energy(&self, place: usize, needed_j: f64) -> Result<(), Refused> {
        let available_j = self.power.available_j();
        if needed_j <= available_j {
            return Ok(());
        }
        let reason = Refusal::NotEnoughEnergy {
            needed_j,
            available_j,
        };
        Err((Some(self.part(place)), reason))
    }

    /// Runs a command of one step. What has no length is done at once.
    fn run(&mut self, place: usize, run: Run, out: &mut Vec<Output>) {
        self.runs[place] = Some(run);
        self.is_stale = true;
        self.record_resources(out);
    }

    /// A command of one step that begins now and takes so long \[s\].
    fn step(&self, id: u32, place: usize, activity: Activity, lasts_s: f64, power_w: f64) -> Run {
        let slower = self.slower(place);
        let lasts = slower.map(|slower| SimDuration::from_secs_f64(lasts_s * slower));
        Run {
            id,
            activity,
            holds: bit(place),
            begun: self.now,
            ends: lasts.map(|lasts| self.now.saturating_add(lasts)),
            slower,
            power_w,
        }
    }

    fn begin_errand(
        &mut self,
        id: u32,
        errand: Errand,
        out: &mut Vec<Output>,
    ) -> Result<(), Refused> {
        self.check_awake(WHEELS)?;
        let (model, half_m) = (
            &self.spec.config,
            0.5 * self.spec.site.ground.settings().side_m,
        );
        let way_s = |way_m: f64| way_m / model.speed_m_per_s;
        let lasts_s = match errand {
            Errand::Drive(to_m) => {
                self.check_range(WHEELS, "east_m", to_m.x, [-half_m, half_m])?;
                self.check_range(WHEELS, "north_m", to_m.y, [-half_m, half_m])?;
                let way_m = to_m - self.body.estimate.place_m();
                way_s(libm::hypot(way_m.x, way_m.y))
            }
            Errand::Turn(yaw_rad) => {
                self.check_range(WHEELS, "yaw_rad", yaw_rad, [-TAU, TAU])?;
                0.0
            }
            Errand::BackUp(way_m) => {
                self.check_range(WHEELS, "distance_m", way_m, [0.0, MAX_BACK_UP_M])?;
                way_s(way_m)
            }
        };
        self.check_free(WHEELS, bit(WHEELS))?;
        self.check_energy(WHEELS, lasts_s * model.drive_power_w)?;
        let slower = self.slower(WHEELS);
        self.drive_on(id, errand, slower, out);
        self.record_resources(out);
        Ok(())
    }

    fn begin_slew(&mut self, id: u32, aim: Aim, out: &mut Vec<Output>) -> Result<(), Refused> {
        self.check_awake(MAST)?;
        let model = &self.spec.config;
        let to_rad = match aim {
            Aim::Angles { pan_rad, tilt_rad } => [pan_rad, tilt_rad],
            Aim::Place { east_m, north_m } => {
                let half_m = 0.5 * self.spec.site.ground.settings().side_m;
                self.check_range(MAST, "east_m", east_m, [-half_m, half_m])?;
                self.check_range(MAST, "north_m", north_m, [-half_m, half_m])?;
                self.aim_rad(Point2::new(east_m, north_m))
            }
        };
        self.check_range(MAST, "pan_rad", to_rad[0], [-PI, PI])?;
        let tilts_rad = [-model.tilt_down_rad, model.tilt_up_rad];
        self.check_range(MAST, "tilt_rad", to_rad[1], tilts_rad)?;
        if self.is_mast_stuck() {
            return Err((Some(Part::Mast), Refusal::MastStuck));
        }
        self.check_free(MAST, bit(MAST))?;
        let from_rad = self.mast_rad;
        let way_rad = (to_rad[0] - from_rad[0]).abs();
        let way_rad = way_rad.max((to_rad[1] - from_rad[1]).abs());
        let lasts_s = way_rad / TAU * model.slew_time.as_secs_f64();
        self.check_energy(MAST, lasts_s * model.slew_power_w)?;
        let slew = Activity::Slew { from_rad, to_rad };
        let run = self.step(id, MAST, slew, lasts_s, model.slew_power_w);
        self.run(MAST, run, out);
        Ok(())
    }

    /// Pan and tilt that point at a place of the estimated frame, by dead reckoning.
    fn aim_rad(&self, place_m: Point2<f64>) -> [f64; 2] {
        let [truth, estimate] = self.poses();
        let [ahead_m, left_m] = estimate.to_body(place_m);
        let attitude = self.attitude(&truth);
        let eye = Eye::on(&truth, &attitude, self.spec.config.mast_m);
        eye.angles_rad(&self.spec.site.ground, truth.place_at(ahead_m, left_m))
    }

    /// The place of an instrument and what a view of it takes.
    fn instrument(
        &self,
        name: &str,
        kind: InstrumentKind,
        view: View,
    ) -> Result<(usize, ViewModel), Refused> {
        let instruments = &self.spec.config.instruments;
        let Some(number) = instruments.iter().position(|one| one.name == name) else {
            let names = instruments.iter().map(|one| one.name.as_str());
            let nearest = farside::suggest::nearest(name, names);
            let found = name.to_owned();
            return Err((None, Refusal::NoSuchPart { found, nearest }));
        };
        let (place, instrument) = (FIRST_INSTRUMENT + number, &instruments[number]);
        let model = match view {
            View::Point => &instrument.point,
            View::Panorama => &instrument.panorama,
        };
        match model.clone().filter(|_| instrument.kind == kind) {
            Some(model) => Ok((place, model)),
            None => {
                let part = self.part(place);
                Err((Some(part.clone()), Refusal::Unable { part }))
            }
        }
    }

    fn begin_reading(
        &mut self,
        id: u32,
        name: &str,
        kind: InstrumentKind,
        view: View,
        out: &mut Vec<Output>,
    ) -> Result<(), Refused> {
        let (place, model) = self.instrument(name, kind, view)?;
        self.check_awake(place)?;
        let refused = |reason| Err((Some(self.part(place)), reason));
        if self.is_failed(place) {
            return refused(Refusal::InstrumentFailed);
        }
        let on_mast = self.spec.config.instruments[place - FIRST_INSTRUMENT].on_mast;
        if on_mast && view == View::Panorama && self.is_mast_stuck() {
            return refused(Refusal::MastStuck);
        }
        let mast = if on_mast { bit(MAST) } else { 0 };
        // All readings need the wheels to stand: one at a time, so that no two fill one memory.
        let holds = bit(place) | bit(WHEELS) | mast;
        self.check_free(place, holds)?;
        let free_bytes = self.memory.free_bytes();
        if model.size_bytes > free_bytes {
            return refused(Refusal::NotEnoughMemory {
                needed_bytes: model.size_bytes,
                free_bytes,
            });
        }
        let lasts_s = model.duration.as_secs_f64();
        self.check_energy(place, lasts_s * model.power_w)?;
        if view == View::Point && !self.gaze(place).has_target() {
            return refused(Refusal::NothingInView);
        }
        let read = Activity::Read { view };
        let run = self.step(id, place, read, lasts_s, model.power_w);
        self.run(place, Run { holds, ..run }, out);
        Ok(())
    }

    /// What a view of the instrument at a place takes; nothing, if it has no such view.
    pub(super) fn view_model(&self, place: usize, view: View) -> ViewModel {
        let instrument = &self.spec.config.instruments[place - FIRST_INSTRUMENT];
        let model = match view {
            View::Point => &instrument.point,
            View::Panorama => &instrument.panorama,
        };
        model.clone().unwrap_or_default()
    }

    /// What the instrument at a place looks at.
    pub(super) fn gaze(&self, place: usize) -> Gaze<'_> {
        let instrument = &self.spec.config.instruments[place - FIRST_INSTRUMENT];
        let [pose, _] = self.poses();
        let mast_m = self.spec.config.mast_m;
        Gaze {
            field: &self.spec.site.ground,
            pose,
            eye: Eye::of(instrument, &pose, &self.attitude(&pose), mast_m),
            instrument,
            mast_rad: self.mast_now_rad(),
            drift: self.drift(place),
        }
    }

    fn begin_transmitting(
        &mut self,
        id: u32,
        size_bytes: u64,
        out: &mut Vec<Output>,
    ) -> Result<(), Refused> {
        self.check_awake(RADIO)?;
        let most = MAX_TRANSMIT_BYTES as f64;
        self.check_range(RADIO, "size_bytes", size_bytes as f64, [1.0, most])?;
        self.check_free(RADIO, bit(RADIO))?;
        let model = &self.spec.config;
        let lasts_s = size_bytes as f64 * 8.0 / model.radio_bit_per_s as f64;
        self.check_energy(RADIO, lasts_s * model.radio_power_w)?;
        let transmit = Activity::Transmit { size_bytes };
        let run = self.step(id, RADIO, transmit, lasts_s, model.radio_power_w);
        self.run(RADIO, run, out);
        Ok(())
    }

    /// Tells the fans to run or not, and is done.
    fn tell_fans(&mut self, id: u32, on: bool, out: &mut Vec<Output>) -> Result<(), Refused> {
        if self.spec.config.bay.fan_conductance_w_per_k == 0.0 {
            let (found, nearest) = (NAMES[FANS].to_owned(), None);
            return Err((None, Refusal::NoSuchPart { found, nearest }));
        }
        self.check_awake(FANS)?;
        self.fans_on = on;
        self.is_stale = true;
        self.report(id, Some(Part::Fans), CommandEnd::Done, Vec::new(), out);
        self.record_resources(out);
        Ok(())
    }

    fn begin_rest(
        &mut self,
        id: u32,
        place: usize,
        duration: SimDuration,
        out: &mut Vec<Output>,
    ) -> Result<(), Refused> {
        self.check_awake(place)?;
        let lasts_s = duration.as_secs_f64();
        self.check_range(place, "duration", lasts_s, [1e-9, MAX_REST_S])?;
        let (activity, needs, power_w) = match place {
            BODY => (Activity::Sleep, u64::MAX, 0.0),
            _ => (Activity::Heat, bit(place), self.spec.config.heater_power_w),
        };
        self.check_free(place, needs)?;
        self.check_energy(place, lasts_s * power_w)?;
        let run = self.step(id, place, activity, lasts_s, power_w);
        self.run(place, run, out);
        Ok(())
    }
}
