//! How a command ends: it is done, is stopped or fails; and what it leaves.

use super::super::body::Next;
use super::super::instruments::Measured;
use super::super::landmarks::Sighting;
use super::*;

impl Hardware {
    /// Stops what runs on a part, or everything, at once.
    pub(super) fn stop(&mut self, id: u32, part: Option<Part>, out: &mut Vec<Output>) {
        let place = match &part {
            None => None,
            Some(part) => match (0..self.runs.len()).find(|place| self.part(*place) == *part) {
                Some(place) => Some(place),
                None => {
                    let found = match part {
                        Part::Instrument { name } => name.clone(),
                        other => format!("{other:?}"),
                    };
                    let names = (0..self.runs.len()).map(|place| self.part_name(place));
                    let nearest = farside::suggest::nearest(&found, names);
                    let reason = super::super::command::Refusal::NoSuchPart { found, nearest };
                    self.report(id, None, CommandEnd::Refused { reason }, Vec::new(), out);
                    return;
                }
            },
        };
        let by = StopCause::Command;
        self.end_all(
            |at| place.is_none_or(|place| place == at),
            || CommandEnd::Stopped { by },
            out,
        );
        self.report(id, part, CommandEnd::Done, Vec::new(), out);
    }

    /// Ends all commands on parts of a kind. Returns their numbers.
    pub(super) fn end_all(
        &mut self,
        which: impl Fn(usize) -> bool,
        end: impl Fn() -> CommandEnd,
        out: &mut Vec<Output>,
    ) -> Vec<u32> {
        let mut ended = Vec::new();
        for place in 0..self.runs.len() {
            if which(place)
                && let Some(id) = self.break_off(place, end(), out)
            {
                ended.push(id);
            }
        }
        ended
    }

    /// Ends the command on a part where it stands, and reports how.
    pub(super) fn break_off(
        &mut self,
        place: usize,
        end: CommandEnd,
        out: &mut Vec<Output>,
    ) -> Option<u32> {
        let run = self.runs[place].take()?;
        self.is_stale = true;
        let share = run.share(self.now);
        match &run.activity {
            Activity::Drive { step, .. } => {
                self.body.take(step, share, &self.spec.config);
                self.record_pose(out);
            }
            Activity::Slew { .. } => {
                self.mast_rad = slewed(&run.activity, share).unwrap_or(self.mast_rad);
            }
            Activity::Transmit { size_bytes } => {
                self.memory.send((*size_bytes as f64 * share) as u64);
            }
            Activity::Read { .. } | Activity::Heat | Activity::Sleep => {}
        }
        let part = Some(self.part(place));
        self.report(run.id, part, end, Vec::new(), out);
        self.record_resources(out);
        Some(run.id)
    }

    /// The controller has been silent for too long.
    pub(super) fn end_lease(&mut self, out: &mut Vec<Output>) {
        let by = StopCause::Lease;
        let ended = self.end_all(is_leased, || CommandEnd::Stopped { by }, out);
        out.push(Output::Incident(RoverIncident::LeaseEnded { ended }));
    }

    /// The wheels are off the rock that a fault had put under them.
    pub(super) fn leave_rock(&mut self, fault: u32, out: &mut Vec<Output>) {
        self.lifts.clear(fault);
        let driven_m = self.driven_m();
        out.push(Output::Incident(RoverIncident::OffRock { fault, driven_m }));
        self.record_pose(out);
    }

    /// The battery comes to the level of a brown-out, or of its end.
    pub(super) fn cross(&mut self, out: &mut Vec<Output>) {
        self.is_stale = true;
        if self.power.is_cut_off() {
            self.power.cut_off(false);
            out.push(Output::Incident(RoverIncident::Recovered));
        } else {
            let reason = || CommandEnd::Failed {
                reason: Failure::BrownOut,
            };
            let ended = self.end_all(|_| true, reason, out);
            self.power.cut_off(true);
            out.push(Output::Incident(RoverIncident::BrownOut { ended }));
        }
        self.record_resources(out);
    }

    /// The step of the command on a part comes to its end.
    pub(super) fn complete(&mut self, place: usize, out: &mut Vec<Output>) {
        let Some(run) = self.runs[place].take() else {
            return;
        };
        self.is_stale = true;
        let mut readings = Vec::new();
        let mut end = CommandEnd::Done;
        match &run.activity {
            Activity::Drive { errand, step } => {
                self.body.take(step, 1.0, &self.spec.config);
                self.record_pose(out);
                if !self.is_deaf {
                    let errand = Body::left(*errand, step, 1.0);
                    self.drive_on(run.id, errand, run.slower, out);
                    return;
                }
            }
            Activity::Slew { to_rad, .. } => self.mast_rad = *to_rad,
            Activity::Transmit { size_bytes } => self.memory.send(*size_bytes),
            Activity::Read { view } => match self.read(place, *view, out) {
                Ok(read) => readings = read,
                Err(reason) => end = CommandEnd::Failed { reason },
            },
            Activity::Heat | Activity::Sleep => {}
        }
        self.report(run.id, Some(self.part(place)), end, readings, out);
        self.record_resources(out);
    }

    /// Begins the next step of an errand, or ends it.
    pub(super) fn drive_on(
        &mut self,
        id: u32,
        errand: Errand,
        slower: Option<f64>,
        out: &mut Vec<Output>,
    ) {
        self.is_stale = true;
        let spec = self.spec.clone();
        let on = Ground {
            field: &spec.site.ground,
            model: &spec.config,
            key: self.key,
            more_slip: self.more_slip(),
            slower: slower.unwrap_or(1.0),
        };
        let end = match self.body.next(errand, &on) {
            Next::Step(step) => {
                let ends = slower.map(|_| self.now.saturating_add(step.lasts));
                self.runs[WHEELS] = Some(Run {
                    id,
                    activity: Activity::Drive { errand, step },
                    holds: bit(WHEELS),
                    begun: self.now,
                    ends,
                    slower,
                    power_w: step.power_w,
                });
                return;
            }
            Next::Arrived => CommandEnd::Done,
            Next::Blocked(by) => CommandEnd::Failed {
                reason: Failure::Blocked { by },
            },
        };
        self.report(id, Some(Part::Wheels), end, Vec::new(), out);
        self.record_resources(out);
    }

    /// Breaks off the present step of driving and plans on from there: something has changed.
    pub(super) fn drive_anew(&mut self, out: &mut Vec<Output>) {
        let Some(run) = self.runs[WHEELS].take() else {
            return;
        };
        if let Activity::Drive { errand, step } = &run.activity {
            let share = run.share(self.now);
            self.body.take(step, share, &self.spec.config);
            self.record_pose(out);
            let errand = Body::left(*errand, step, share);
            self.drive_on(run.id, errand, run.slower, out);
        }
    }

    /// Takes a reading that is done, and finds the rover's place by it if it is an image.
    fn read(
        &mut self,
        place: usize,
        view: View,
        out: &mut Vec<Output>,
    ) -> Result<Vec<Reading>, Failure> {
        let model = self.view_model(place, view);
        if !self.memory.store(model.size_bytes) {
            let bytes = model.size_bytes;
            out.push(Output::Incident(RoverIncident::DataLost { bytes }));
            return Err(Failure::MemoryFull);
        }
        let number = u64::from(self.readings);
        let key = self.key.text("reading");
        let measured = self.gaze(place).read(view, &model, key, number);
        self.readings += measured.len() as u32;
        let instrument = &self.spec.config.instruments[place - FIRST_INSTRUMENT];
        let (name, kind) = (instrument.name.clone(), instrument.kind);
        if kind == InstrumentKind::Camera {
            self.find_place(&measured, out);
        }
        let estimate = self.body.estimate;
        let first = u64::from(self.spec.number) << 32 | number;
        let reading = |(id, one): (u64, Measured)| {
            let at_m = estimate.place_at(one.ahead_m, one.left_m);
            Reading {
                id,
                instrument: name.clone(),
                view,
                rock: one.rock,
                east_m: at_m.x,
                north_m: at_m.y,
                range_m: one.range_m,
                diameter_m: one.diameter_m,
                texture: one.texture,
                spectrum: one.spectrum,
                noise: one.noise,
            }
        };
        Ok((first..).zip(measured).map(reading).collect())
    }

    /// Places the rover among rocks that it knows, if that is better than what it believes, and
    /// remembers those that it did not know.
    fn find_place(&mut self, measured: &[Measured], out: &mut Vec<Output>) {
        let sightings: Vec<Sighting> = measured.iter().filter_map(Measured::sighting).collect();
        let found = self.landmarks.place(&sightings);
        if let Some((pose, sigma_m)) = found.filter(|(_, sigma_m)| *sigma_m < self.body.sigma_m) {
            let way_m = pose.place_m() - self.body.estimate.place_m();
            let moved_m = libm::hypot(way_m.x, way_m.y);
            self.body.fix(pose, sigma_m);
            out.push(Output::Incident(RoverIncident::Placed { moved_m }));
            self.record_pose(out);
        }
        let (estimate, sigma_m) = (self.body.estimate, self.body.sigma_m);
        self.landmarks.remember(&sightings, &estimate, sigma_m);
    }
}
