//! What faults do, and what a rover's computer finds when it starts again.

use super::super::faults::{FaultKind, PlannedFault};
use super::*;

impl Hardware {
    /// A fault begins. Told twice, it begins once.
    pub(in super::super) fn fault_begins(&mut self, fault: FaultBegins, out: &mut Vec<Output>) {
        if self.begun_faults.contains(&fault.number) {
            return;
        }
        self.begun_faults.push(fault.number);
        self.is_stale = true;
        let (kind, number, amount) = (fault.kind, fault.number, fault.amount);
        if kind == FaultKind::RockUnderWheel {
            self.lift(&fault, out);
        }
        self.faults.push(fault);
        match kind {
            FaultKind::BlockedPath => {
                let [truth, _] = self.poses();
                self.body.surprise(number, &truth, amount);
                self.drive_anew(out);
            }
            FaultKind::Slip => self.drive_anew(out),
            FaultKind::InstrumentFails => {
                for place in FIRST_INSTRUMENT..self.runs.len() {
                    if self.is_failed(place) {
                        let reason = Failure::InstrumentFailed;
                        self.break_off(place, CommandEnd::Failed { reason }, out);
                    }
                }
            }
            FaultKind::StuckMast => self.stop_mast(out),
            _ => self.apply_shares(out),
        }
        self.advance(self.now, out);
    }

    /// A fault is over.
    pub(in super::super) fn fault_ends(&mut self, number: u32, out: &mut Vec<Output>) {
        self.is_stale = true;
        self.faults.retain(|fault| fault.number != number);
        self.body.clear(number);
        if self.lifts.clear(number) {
            self.record_pose(out);
        }
        self.apply_shares(out);
        self.advance(self.now, out);
    }

    /// A rock comes under the wheels.
    fn lift(&mut self, fault: &FaultBegins, out: &mut Vec<Output>) {
        let until_m = self.driven_m() + fault.distance_m;
        self.lifts
            .put(fault.number, &fault.part, fault.amount, until_m);
        self.record_pose(out);
    }

    /// Dust and broken memory are as bad as all faults of them together.
    fn apply_shares(&mut self, out: &mut Vec<Output>) {
        let clean = self.of_kind(FaultKind::Dust, BODY).map(|share| 1.0 - share);
        self.power.set_clean(clean.product());
        let broken = self.of_kind(FaultKind::Memory, BODY).sum();
        let bytes = self.memory.set_broken(broken);
        if bytes > 0 {
            out.push(Output::Incident(RoverIncident::DataLost { bytes }));
        }
    }

    /// The mast stops where it is, and so does what turns it.
    fn stop_mast(&mut self, out: &mut Vec<Output>) {
        for place in 0..self.runs.len() {
            let turns = self.runs[place]
                .as_ref()
                .is_some_and(|run| match run.activity {
                    Activity::Slew { .. } => true,
                    Activity::Read { view } => {
                        let instrument = &self.spec.config.instruments[place - FIRST_INSTRUMENT];
                        instrument.on_mast && view == View::Panorama
                    }
                    _ => false,
                });
            if turns {
                let reason = Failure::MastStuck;
                self.break_off(place, CommandEnd::Failed { reason }, out);
            }
        }
    }

    /// The amounts of the faults of a kind that a part has now.
    fn of_kind(&self, kind: FaultKind, place: usize) -> impl Iterator<Item = f64> {
        let name = self.part_name(place);
        let faults = self.faults.iter();
        let is_of_part = move |fault: &&FaultBegins| match kind {
            FaultKind::EndsEarly
            | FaultKind::EndsLate
            | FaultKind::NeverEnds
            | FaultKind::InstrumentFails
            | FaultKind::InstrumentDrifts => fault.part.is_empty() || fault.part == name,
            // Of kinds that are of no part, all are.
            _ => true,
        };
        let of_kind = faults.filter(move |fault| fault.kind == kind);
        of_kind.filter(is_of_part).map(|fault| fault.amount)
    }

    /// How many times as long as it should a command takes that begins now on a part; none: for
    /// ever.
    pub(super) fn slower(&self, place: usize) -> Option<f64> {
        if self.of_kind(FaultKind::NeverEnds, place).next().is_some() {
            return None;
        }
        let early: f64 = self.of_kind(FaultKind::EndsEarly, place).product();
        Some(early * self.of_kind(FaultKind::EndsLate, place).product::<f64>())
    }

    pub(super) fn extra_power_w(&self) -> f64 {
        self.of_kind(FaultKind::ExtraPower, BODY).sum()
    }

    /// Heat in the bay that is not of the rover's electricity \[W\].
    pub(super) fn bay_heat_w(&self) -> f64 {
        self.of_kind(FaultKind::BayHeat, BODY).sum()
    }

    pub(super) fn are_fans_failed(&self) -> bool {
        self.of_kind(FaultKind::FansFail, FANS).next().is_some()
    }

    pub(super) fn pitch_bias_rad(&self) -> f64 {
        self.of_kind(FaultKind::PitchBias, BODY).sum()
    }

    pub(super) fn roll_bias_rad(&self) -> f64 {
        self.of_kind(FaultKind::RollBias, BODY).sum()
    }

    pub(super) fn more_slip(&self) -> f64 {
        self.of_kind(FaultKind::Slip, WHEELS).sum()
    }

    pub(super) fn is_mast_stuck(&self) -> bool {
        self.of_kind(FaultKind::StuckMast, MAST).next().is_some()
    }

    /// Whether the instrument at a place is out of order.
    pub(super) fn is_failed(&self, place: usize) -> bool {
        self.of_kind(FaultKind::InstrumentFails, place)
            .next()
            .is_some()
    }

    /// What the instrument at a place measures too much.
    pub(super) fn drift(&self, place: usize) -> f64 {
        self.of_kind(FaultKind::InstrumentDrifts, place).sum()
    }

    /// The computer starts again. What the hardware did meanwhile comes out now: the step of each
    /// command went on to its end and was the last of it, faults that nobody could be told of came
    /// and went, the battery lived on. Nobody is reported to, because nobody asked.
    pub(in super::super) fn restart(
        &mut self,
        now: SimTime,
        links_j: f64,
        planned: &[PlannedFault],
        out: &mut Vec<Output>,
    ) {
        self.is_deaf = true;
        let mut told: Vec<(SimTime, bool, usize)> = Vec::new();
        for (place, fault) in planned.iter().enumerate() {
            told.push((fault.at, true, place));
            told.extend(fault.ends.map(|ends| (ends, false, place)));
        }
        told.retain(|(at, ..)| *at <= now);
        // Ends before beginnings at one time, as the order of `false` and `true` has it.
        told.sort_unstable();
        for (at, begins, place) in told {
            self.advance(at.max(self.now), out);
            let fault = &planned[place].begins;
            match begins {
                true => self.fault_begins(fault.clone(), out),
                false => self.fault_ends(fault.number, out),
            }
        }
        self.wake(now, links_j, out);
        let by = StopCause::Command;
        self.end_all(|_| true, || CommandEnd::Stopped { by }, out);
        self.is_deaf = false;
        self.heard = now;
        self.advance(now, out);
    }
}
