//! A rover's electricity: solar array, battery and loads; what they turn into heat goes into the bay. It
//! knows no commands.
//!
//! Sunlight is taken at [`NODE_NS`] apart, and straight between; loads are constant between
//! events. So what flows is linear in pieces, every integral is exact, and it does not matter when
//! one looks. What is counted obeys, to rounding,
//! `solar + unsupplied = used + change of charge + lost in charging + not taken`.

use farside::SimTime;
use farside_worlds::Sky;
use farside_worlds::sky::SOL_S;
use serde::{Deserialize, Serialize};

use super::RoverSite;
use super::bay::Bay;
use super::model::RoverModel;

/// The time between two looks at the Sun \[ns\].
const NODE_NS: u64 = 300_000_000_000;

/// How far ahead a crossing is looked for, in nodes: a little more than a sol.
const HORIZON_NODES: u64 = 300;

/// How often an interval is halved to find the time of a crossing: to far below a nanosecond.
const HALVINGS: u32 = 60;

/// What takes power.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Consumer {
    /// The body, awake or asleep.
    Body,
    Wheels,
    Mast,
    Instruments,
    Radio,
    /// The heater, when told, and what keeps the rover warm at night.
    Heater,
    Fans,
    /// A fault.
    Fault,
    /// What links charge the host for sending and receiving.
    Links,
}

/// How many consumers there are.
pub(super) const CONSUMERS: usize = 9;

/// What takes its power outside the bay.
const OUTSIDE: [Consumer; 3] = [Consumer::Wheels, Consumer::Mast, Consumer::Instruments];

/// Where a rover's energy came from and went to, since the start \[J\].
///
/// ```
/// use farside_actors::rover::RoverEnergy;
/// let energy = RoverEnergy { solar_j: 100.0, body_j: 60.0, charge_loss_j: 2.0, stored_j: 538.0,
///     stored_at_start_j: 500.0, ..RoverEnergy::default() };
/// assert_eq!(energy.imbalance_j(), 0.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RoverEnergy {
    /// What the array yielded, or would have, had the battery not been full.
    pub solar_j: f64,
    /// What the body took, awake and asleep.
    pub body_j: f64,
    /// What driving and turning took.
    pub wheels_j: f64,
    /// What the mast took.
    pub mast_j: f64,
    /// What cameras and spectrometers took.
    pub instruments_j: f64,
    /// What transmitting took, by command.
    pub radio_j: f64,
    /// What heating took, by command and at night.
    pub heater_j: f64,
    /// What fans took.
    pub fans_j: f64,
    /// What faults took.
    pub fault_j: f64,
    /// What links charged all actors of the rover's host for sending and receiving.
    pub links_j: f64,
    /// What was lost in charging.
    pub charge_loss_j: f64,
    /// What the array yielded and nobody took, because the battery was full.
    pub not_taken_j: f64,
    /// What was taken and was not there: over 0 only after a fault that the log has.
    pub unsupplied_j: f64,
    /// The battery's charge at the start.
    pub stored_at_start_j: f64,
    /// The battery's charge.
    pub stored_j: f64,
}

impl RoverEnergy {
    /// What all consumers took.
    pub fn used_j(&self) -> f64 {
        self.body_j
            + self.wheels_j
            + self.mast_j
            + self.instruments_j
            + self.radio_j
            + self.heater_j
            + self.fans_j
            + self.fault_j
            + self.links_j
    }

    /// What came in and is not accounted for: 0 but for rounding.
    pub fn imbalance_j(&self) -> f64 {
        let came_j = self.solar_j + self.unsupplied_j + self.stored_at_start_j;
        came_j - self.used_j() - self.charge_loss_j - self.not_taken_j - self.stored_j
    }

    /// All that came in: what [`RoverEnergy::imbalance_j`] is to be measured by.
    pub fn total_j(&self) -> f64 {
        self.solar_j + self.unsupplied_j + self.stored_at_start_j
    }
}

/// What the Sun gives and the night takes, at the nodes.
#[derive(Clone, Debug)]
struct Daylight {
    sky: Sky,
    starts_s: f64,
    /// The array's power for each W/m² of sunlight, without dust \[m²\].
    array_m2: f64,
    /// The logarithm of what a sol's dust leaves of the array's power.
    dust_log: f64,
    night_power_w: f64,
    /// Power of the array, and of what keeps the rover warm \[W\], as far as anybody asked.
    nodes_w: Vec<[f64; 2]>,
}

impl Daylight {
    fn node_w(&mut self, node: u64) -> [f64; 2] {
        while self.nodes_w.len() as u64 <= node {
            let at_s = (self.nodes_w.len() as u64 * NODE_NS) as f64 * 1e-9;
            let clean = libm::exp(self.dust_log * at_s / SOL_S);
            let array_w = self.array_m2 * clean * self.sky.power_w_m2(self.starts_s + at_s);
            let night_w = (self.night_power_w - array_w).max(0.0);
            self.nodes_w.push([array_w, night_w]);
        }
        self.nodes_w[node as usize]
    }

    /// Power of the array and for warmth \[W\] at a time.
    fn at_w(&mut self, ns: u64) -> [f64; 2] {
        let (node, rest_ns) = (ns / NODE_NS, ns % NODE_NS);
        let (before, after) = (self.node_w(node), self.node_w(node + 1));
        let share = rest_ns as f64 / NODE_NS as f64;
        [0, 1].map(|kind| before[kind] + share * (after[kind] - before[kind]))
    }
}

/// A stretch of time in which what flows into the battery is linear and of one sign.
#[derive(Clone, Copy)]
struct Flow {
    lasts_s: f64,
    /// At its beginning and at its end \[W, positive charges\].
    net_w: [f64; 2],
}

impl Flow {
    /// What has flowed after a time \[J\].
    fn energy_j(&self, after_s: f64) -> f64 {
        let share = after_s / self.lasts_s;
        let end_w = self.net_w[0] + share * (self.net_w[1] - self.net_w[0]);
        0.5 * (self.net_w[0] + end_w) * after_s
    }

    /// The parts of one sign of a linear flow.
    fn of_one_sign(self) -> [Option<Flow>; 2] {
        let [start_w, end_w] = self.net_w;
        if start_w * end_w >= 0.0 {
            return [Some(self), None];
        }
        let turns_s = self.lasts_s * (start_w / (start_w - end_w));
        let part = |lasts_s, net_w| (lasts_s > 0.0).then_some(Flow { lasts_s, net_w });
        [
            part(turns_s, [start_w, 0.0]),
            part(self.lasts_s - turns_s, [0.0, end_w]),
        ]
    }
}

/// The electricity of a rover.
#[derive(Clone, Debug)]
pub(super) struct Power {
    daylight: Daylight,
    /// What dust of faults leaves of the array's power, 0 to 1.
    clean: f64,
    loads_w: [f64; CONSUMERS],
    /// Whether all loads are cut off: a brown-out.
    is_cut_off: bool,
    now: SimTime,
    stored_j: f64,
    capacity_j: f64,
    charge_efficiency: f64,
    cutoff_j: f64,
    recovery_j: f64,
    used_j: [f64; CONSUMERS],
    energy: RoverEnergy,
    /// What links had charged when one last looked \[J\].
    links_j: f64,
    pub(super) bay: Bay,
}

impl Power {
    pub(super) fn new(model: &RoverModel, site: &RoverSite) -> Power {
        let capacity_j = model.battery_j;
        let stored_j = model.charge * capacity_j;
        Power {
            daylight: Daylight {
                sky: site.sky,
                starts_s: site.starts_s,
                array_m2: model.array_m2 * model.array_efficiency,
                dust_log: libm::log1p(-model.dust_per_sol),
                night_power_w: model.night_power_w,
                nodes_w: Vec::new(),
            },
            clean: 1.0,
            loads_w: [0.0; CONSUMERS],
            is_cut_off: false,
            now: SimTime::ZERO,
            stored_j,
            capacity_j,
            charge_efficiency: model.charge_efficiency,
            cutoff_j: model.cutoff * capacity_j,
            recovery_j: model.recovery * capacity_j,
            used_j: [0.0; CONSUMERS],
            energy: RoverEnergy {
                stored_at_start_j: stored_j,
                ..RoverEnergy::default()
            },
            links_j: 0.0,
            bay: Bay::new(&model.bay, site.starts_s),
        }
    }

    pub(super) fn stored_j(&self) -> f64 {
        self.stored_j
    }

    /// What there is above the level of the brown-out.
    pub(super) fn available_j(&self) -> f64 {
        (self.stored_j - self.cutoff_j).max(0.0)
    }

    pub(super) fn is_cut_off(&self) -> bool {
        self.is_cut_off
    }

    /// Begins or ends a brown-out.
    pub(super) fn cut_off(&mut self, cut_off: bool) {
        self.is_cut_off = cut_off;
    }

    pub(super) fn set_loads(&mut self, loads_w: [f64; CONSUMERS]) {
        self.loads_w = loads_w;
    }

    /// What dust leaves of the array's power, 0 to 1.
    pub(super) fn set_clean(&mut self, clean: f64) {
        self.clean = clean;
    }

    /// What the array yields now, and what all consumers take \[W\].
    pub(super) fn now_w(&mut self) -> [f64; 2] {
        let [array_w, night_w] = self.daylight.at_w(self.now.as_nanos());
        let load_w = match self.is_cut_off {
            true => 0.0,
            false => self.loads_w.iter().sum::<f64>() + night_w,
        };
        [array_w * self.clean, load_w]
    }

    /// Where energy came from and went to, until now.
    pub(super) fn energy(&self) -> RoverEnergy {
        let used_j = |consumer: Consumer| self.used_j[consumer as usize];
        RoverEnergy {
            body_j: used_j(Consumer::Body),
            wheels_j: used_j(Consumer::Wheels),
            mast_j: used_j(Consumer::Mast),
            instruments_j: used_j(Consumer::Instruments),
            radio_j: used_j(Consumer::Radio),
            heater_j: used_j(Consumer::Heater),
            fans_j: used_j(Consumer::Fans),
            fault_j: used_j(Consumer::Fault),
            links_j: used_j(Consumer::Links),
            stored_j: self.stored_j,
            ..self.energy
        }
    }

    /// Lets time pass, under the loads as they are.
    pub(super) fn advance(&mut self, to: SimTime) {
        while self.now < to {
            let next = to.min(next_node(self.now));
            self.pass(next);
            self.now = next;
        }
    }

    /// Takes what links have charged since last time; `total_j` is all that they ever charged.
    /// Returns what of it was not there; none if they charged nothing.
    pub(super) fn take_links(&mut self, total_j: f64) -> Option<f64> {
        let taken_j = total_j - self.links_j;
        if taken_j <= 0.0 {
            return None;
        }
        self.links_j = total_j;
        self.used_j[Consumer::Links as usize] += taken_j;
        let before_j = self.energy.unsupplied_j;
        self.discharge(taken_j);
        Some(self.energy.unsupplied_j - before_j)
    }

    /// Counts a stretch within one node's interval.
    fn pass(&mut self, to: SimTime) {
        let lasts_s = to.since(self.now).as_nanos() as f64 * 1e-9;
        let [solar_w, taken_w] = self.ends_w(to);
        self.warm(to, taken_w);
        self.energy.solar_j += 0.5 * (solar_w[0] + solar_w[1]) * lasts_s;
        if !self.is_cut_off {
            for (used_j, load_w) in self.used_j.iter_mut().zip(self.loads_w) {
                *used_j += load_w * lasts_s;
            }
            let constant_w: f64 = self.loads_w.iter().sum();
            let night_w = 0.5 * (taken_w[0] + taken_w[1]) - constant_w;
            self.used_j[Consumer::Heater as usize] += night_w * lasts_s;
        }
        let net_w = [0, 1].map(|end| solar_w[end] - taken_w[end]);
        for flow in (Flow { lasts_s, net_w })
            .of_one_sign()
            .into_iter()
            .flatten()
        {
            let energy_j = flow.energy_j(flow.lasts_s);
            if energy_j >= 0.0 {
                self.charge(energy_j);
            } else {
                self.discharge(-energy_j);
            }
        }
    }

    /// What of the power that is taken now and at a later time \[W\] becomes heat in the bay until
    /// then.
    fn warm(&mut self, to: SimTime, taken_w: [f64; 2]) {
        let outside = OUTSIDE.map(|consumer| self.loads_w[consumer as usize]);
        let inside_w = match self.is_cut_off {
            true => [0.0; 2],
            false => taken_w.map(|taken_w| taken_w - outside.iter().sum::<f64>()),
        };
        let [from_s, to_s] = [self.now, to].map(|at| at.as_nanos() as f64 * 1e-9);
        self.bay.pass(from_s, to_s, inside_w);
    }

    /// What the array yields and what is taken \[W\], each now and at a later time within the same
    /// node's interval.
    fn ends_w(&mut self, to: SimTime) -> [[f64; 2]; 2] {
        let ends = [self.now, to].map(|at| self.daylight.at_w(at.as_nanos()));
        let constant_w: f64 = self.loads_w.iter().sum();
        let taken_w = |night_w: f64| match self.is_cut_off {
            true => 0.0,
            false => constant_w + night_w,
        };
        [
            ends.map(|[array_w, _]| array_w * self.clean),
            ends.map(|[_, night_w]| taken_w(night_w)),
        ]
    }

    fn charge(&mut self, energy_j: f64) {
        let room_j = self.capacity_j - self.stored_j;
        let gained_j = energy_j * self.charge_efficiency;
        if gained_j <= room_j {
            self.stored_j += gained_j;
            self.energy.charge_loss_j += energy_j - gained_j;
            return;
        }
        let taken_j = room_j / self.charge_efficiency;
        self.stored_j = self.capacity_j;
        self.energy.charge_loss_j += taken_j - room_j;
        self.energy.not_taken_j += energy_j - taken_j;
    }

    fn discharge(&mut self, energy_j: f64) {
        let left_j = self.stored_j - energy_j;
        self.stored_j = left_j.max(0.0);
        self.energy.unsupplied_j += (-left_j).max(0.0);
    }

    /// When the battery comes to the level at which something happens, if all stays as it is: that of
    /// the brown-out, or in one, that of its end. If that is not within a sol, when to look again,
    /// and false.
    pub(super) fn next_crossing(&mut self) -> (SimTime, bool) {
        let (level_j, sign) = match self.is_cut_off {
            false => (self.cutoff_j, -1.0),
            true => (self.recovery_j, 1.0),
        };
        let mut ahead = self.clone_without_nodes();
        std::mem::swap(&mut ahead.daylight, &mut self.daylight);
        let found = ahead.find(level_j, sign);
        std::mem::swap(&mut ahead.daylight, &mut self.daylight);
        found
    }

    /// A copy to look ahead with, which is to borrow the nodes.
    fn clone_without_nodes(&self) -> Power {
        let daylight = Daylight {
            nodes_w: Vec::new(),
            ..self.daylight
        };
        Power { daylight, ..*self }
    }

    /// Goes ahead until the charge reaches a level: falling, if the sign is negative.
    fn find(&mut self, level_j: f64, sign: f64) -> (SimTime, bool) {
        if sign * (self.stored_j - level_j) >= 0.0 {
            return (self.now, true);
        }
        for _ in 0..HORIZON_NODES {
            let next = next_node(self.now);
            if next == SimTime::MAX {
                break;
            }
            let lasts_s = next.since(self.now).as_nanos() as f64 * 1e-9;
            let [solar_w, taken_w] = self.ends_w(next);
            let net_w = [0, 1].map(|end| solar_w[end] - taken_w[end]);
            let mut passed_s = 0.0;
            for flow in (Flow { lasts_s, net_w })
                .of_one_sign()
                .into_iter()
                .flatten()
            {
                if let Some(after_s) = self.reaches(flow, level_j, sign) {
                    let after_ns = libm::ceil((passed_s + after_s) * 1e9) as u64;
                    let at = SimTime::from_nanos(self.now.as_nanos() + after_ns.max(1));
                    return (at.min(next), true);
                }
                let energy_j = flow.energy_j(flow.lasts_s);
                match energy_j >= 0.0 {
                    true => self.charge(energy_j),
                    false => self.discharge(-energy_j),
                }
                passed_s += flow.lasts_s;
            }
            self.now = next;
        }
        (self.now, false)
    }

    /// When in a flow of one sign the charge reaches a level \[s\].
    fn reaches(&self, flow: Flow, level_j: f64, sign: f64) -> Option<f64> {
        let part = if sign > 0.0 {
            self.charge_efficiency
        } else {
            1.0
        };
        let needed_j = (level_j - self.stored_j).abs();
        let flowed_j = |after_s: f64| sign * part * flow.energy_j(after_s);
        if flowed_j(flow.lasts_s) < needed_j {
            return None;
        }
        let (mut low_s, mut high_s) = (0.0, flow.lasts_s);
        for _ in 0..HALVINGS {
            let middle_s = 0.5 * (low_s + high_s);
            match flowed_j(middle_s) < needed_j {
                true => low_s = middle_s,
                false => high_s = middle_s,
            }
        }
        Some(high_s)
    }
}

/// The next node after a time.
fn next_node(now: SimTime) -> SimTime {
    let node = now.as_nanos() / NODE_NS + 1;
    SimTime::from_nanos(node.saturating_mul(NODE_NS))
}
