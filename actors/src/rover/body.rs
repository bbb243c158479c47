//! Where a rover is, where it believes to be, and how both change as it drives.
//!
//! The truth slips and strays, the estimate counts turns of wheels. Driving is cut into steps, a turn
//! or a leg of at most the model's `leg`, each in a straight line at constant speed. How it will go
//! is decided at its beginning, with draws by the step's number; it may be broken off at any time.
//! A rover is a point here: what its middle may not be on, blocks it.

use std::f64::consts::{PI, TAU};

use farside::SimDuration;
use farside::random::RandomKey;
use farside_worlds::{Hazard, RockField};
use nalgebra::Point2;

use super::command::Obstacle;
use super::lifts::Lift;
use super::model::RoverModel;

/// The weight of a kilogram on Mars \[N/kg\].
const GRAVITY_N_PER_KG: f64 = 3.71;

/// How far apart the ground ahead is looked at \[m\].
const LOOK_M: f64 = 0.25;

/// The radius within which rocks slow a rover down \[m\].
const COVER_RADIUS_M: f64 = 2.0;

/// How far ahead an unknown obstacle lies, from its edge \[m\].
const SURPRISE_M: f64 = 0.5;

/// A distance that is as good as none \[m\].
const ARRIVED_M: f64 = 1e-3;

/// A difference of headings that needs no turn before a leg \[rad\].
const STRAIGHT_RAD: f64 = 0.005;

/// A place and a heading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pose {
    pub(super) east_m: f64,
    pub(super) north_m: f64,
    /// Counted from east to north \[rad\].
    pub(super) yaw_rad: f64,
}

impl Pose {
    pub(super) fn place_m(&self) -> Point2<f64> {
        Point2::new(self.east_m, self.north_m)
    }

    /// The pose so far ahead \[m\], or behind.
    pub(super) fn ahead(&self, way_m: f64) -> Pose {
        Pose {
            east_m: self.east_m + way_m * libm::cos(self.yaw_rad),
            north_m: self.north_m + way_m * libm::sin(self.yaw_rad),
            ..*self
        }
    }

    fn turned(&self, by_rad: f64) -> Pose {
        Pose {
            yaw_rad: wrapped(self.yaw_rad + by_rad),
            ..*self
        }
    }

    /// Between this pose and another, by a share from 0 to 1.
    fn towards(&self, to: &Pose, share: f64) -> Pose {
        let between = |from: f64, to: f64| from + share * (to - from);
        Pose {
            east_m: between(self.east_m, to.east_m),
            north_m: between(self.north_m, to.north_m),
            yaw_rad: wrapped(self.yaw_rad + share * wrapped(to.yaw_rad - self.yaw_rad)),
        }
    }

    /// A place given ahead and to the left of this pose \[m\].
    pub(super) fn place_at(&self, ahead_m: f64, left_m: f64) -> Point2<f64> {
        let (sine, cosine) = libm::sincos(self.yaw_rad);
        let east_m = self.east_m + ahead_m * cosine - left_m * sine;
        Point2::new(east_m, self.north_m + ahead_m * sine + left_m * cosine)
    }

    /// A place as it lies ahead and to the left of this pose \[m\].
    pub(super) fn to_body(self, place_m: Point2<f64>) -> [f64; 2] {
        let (sine, cosine) = libm::sincos(self.yaw_rad);
        let (east_m, north_m) = (place_m.x - self.east_m, place_m.y - self.north_m);
        [
            east_m * cosine + north_m * sine,
            north_m * cosine - east_m * sine,
        ]
    }
}

/// An angle over -pi to pi.
pub(super) fn wrapped(angle_rad: f64) -> f64 {
    angle_rad - TAU * libm::ceil((angle_rad - PI) / TAU)
}

/// How a rover stands at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Attitude {
    /// The ground below its middle \[m\].
    pub(super) height_m: f64,
    /// Right side down \[rad\].
    pub(super) roll_rad: f64,
    /// Nose up \[rad\].
    pub(super) pitch_rad: f64,
}

impl Attitude {
    /// On the ground below its wheels, whose ends lie half a base from its middle, and on what lifts
    /// them.
    pub(super) fn on(ground: &RockField, pose: &Pose, wheelbase_m: f64, lift: &Lift) -> Attitude {
        let height_m = |ahead_m, left_m| {
            let place_m = pose.place_at(ahead_m, left_m);
            ground.ground_m(place_m.x, place_m.y)
        };
        let half_m = 0.5 * wheelbase_m;
        let rise = |high_m: f64, low_m: f64| libm::atan2(high_m - low_m, wheelbase_m);
        Attitude {
            height_m: height_m(0.0, 0.0),
            roll_rad: rise(
                height_m(0.0, half_m) + lift.left_m,
                height_m(0.0, -half_m) + lift.right_m,
            ),
            pitch_rad: rise(
                height_m(half_m, 0.0) + lift.front_m,
                height_m(-half_m, 0.0) + lift.rear_m,
            ),
        }
    }

    /// How far the body is from level \[rad\].
    pub(super) fn tilt_rad(&self) -> f64 {
        let (roll, pitch) = (libm::tan(self.roll_rad), libm::tan(self.pitch_rad));
        libm::atan(libm::hypot(roll, pitch))
    }
}

/// Something that lies where nobody knew of it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Surprise {
    fault: u32,
    center_m: Point2<f64>,
    radius_m: f64,
}

/// A stretch of driving that is decided: a turn, or a leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Step {
    truth: [Pose; 2],
    estimate: [Pose; 2],
    /// How far the wheels go \[m\]; 0 for a turn.
    pub(super) way_m: f64,
    pub(super) lasts: SimDuration,
    /// What the wheels take \[W\].
    pub(super) power_w: f64,
}

/// What the wheels are to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Errand {
    /// To a place in the estimated frame \[m\].
    Drive(Point2<f64>),
    /// To a heading in the estimated frame \[rad\].
    Turn(f64),
    /// So far back, yet \[m\].
    BackUp(f64),
}

/// What comes next on an errand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Next {
    Step(Step),
    Arrived,
    Blocked(Obstacle),
}

/// What a step is planned with.
pub(super) struct Ground<'a> {
    pub(super) field: &'a RockField,
    pub(super) model: &'a RoverModel,
    /// Of the rover's draws.
    pub(super) key: RandomKey,
    /// Slip beyond what there is anyway: a fault.
    pub(super) more_slip: f64,
    /// How many times as long as it should all takes: a fault.
    pub(super) slower: f64,
}

/// Where a rover is, and where it believes to be.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Body {
    pub(super) truth: Pose,
    pub(super) estimate: Pose,
    /// What it reckons the standard deviation of its estimate to be \[m\].
    pub(super) sigma_m: f64,
    /// How far its wheels went since its heading was last known \[m\].
    since_fix_m: f64,
    /// How far its wheels went in all \[m\].
    pub(super) driven_m: f64,
    /// How many steps were planned: each has its draws.
    steps: u64,
    surprises: Vec<Surprise>,
}

impl Body {
    pub(super) fn new(start: Pose) -> Body {
        Body {
            truth: start,
            estimate: start,
            sigma_m: 0.0,
            since_fix_m: 0.0,
            driven_m: 0.0,
            steps: 0,
            surprises: Vec::new(),
        }
    }

    /// Puts something of this radius in the way of a rover at a pose, for as long as a fault lasts.
    pub(super) fn surprise(&mut self, fault: u32, at: &Pose, radius_m: f64) {
        let center_m = at.ahead(SURPRISE_M + radius_m).place_m();
        self.surprises.push(Surprise {
            fault,
            center_m,
            radius_m,
        });
    }

    /// Takes away what a fault had put there.
    pub(super) fn clear(&mut self, fault: u32) {
        self.surprises.retain(|surprise| surprise.fault != fault);
    }

    /// The next step of an errand.
    pub(super) fn next(&mut self, errand: Errand, on: &Ground<'_>) -> Next {
        match errand {
            Errand::Turn(yaw_rad) => {
                let by_rad = wrapped(yaw_rad - self.estimate.yaw_rad);
                match by_rad == 0.0 {
                    true => Next::Arrived,
                    false => Next::Step(self.turn(by_rad, on)),
                }
            }
            Errand::BackUp(left_m) if left_m < ARRIVED_M => Next::Arrived,
            Errand::BackUp(left_m) => self.leg(-left_m.min(on.model.leg_m), on),
            Errand::Drive(to_m) => {
                let way_m = to_m - self.estimate.place_m();
                let distance_m = libm::hypot(way_m.x, way_m.y);
                if distance_m < ARRIVED_M {
                    return Next::Arrived;
                }
                let bearing_rad = libm::atan2(way_m.y, way_m.x);
                let by_rad = wrapped(bearing_rad - self.estimate.yaw_rad);
                match by_rad.abs() > STRAIGHT_RAD {
                    true => Next::Step(self.turn(by_rad, on)),
                    false => self.leg(distance_m.min(on.model.leg_m), on),
                }
            }
        }
    }

    fn draws(&mut self, on: &Ground<'_>) -> farside::random::Stream {
        self.steps += 1;
        on.key.text("odometry").number(self.steps).stream()
    }

    /// A turn in place. The wheels know what they did but for the drift of the heading.
    fn turn(&mut self, by_rad: f64, on: &Ground<'_>) -> Step {
        let strays_rad = self.draws(on).normal(0.0, on.model.yaw_sigma_rad);
        let lasts_s = by_rad.abs() / TAU * on.model.turn_time.as_secs_f64() * on.slower;
        Step {
            truth: [self.truth, self.truth.turned(by_rad + strays_rad)],
            estimate: [self.estimate, self.estimate.turned(by_rad)],
            way_m: 0.0,
            lasts: SimDuration::from_secs_f64(lasts_s),
            power_w: on.model.drive_power_w,
        }
    }

    /// A leg, forwards or backwards, as far as nothing is in the way.
    fn leg(&mut self, way_m: f64, on: &Ground<'_>) -> Next {
        let model = on.model;
        let start = self.truth;
        let steepness = libm::tan(on.field.slope_rad(start.east_m, start.north_m));
        let mut draws = self.draws(on);
        let slip = model.slip + model.slip_on_slope * steepness * steepness + on.more_slip;
        let slip = (slip + draws.normal(0.0, model.slip_sigma)).clamp(-0.5, 0.99);
        let strays_rad = draws.normal(0.0, model.yaw_sigma_rad * libm::sqrt(way_m.abs()));
        // Half of the drift at the beginning: the leg is the chord of a slight bend.
        let along = start.turned(0.5 * strays_rad);
        let looks = libm::ceil(way_m.abs() / LOOK_M).max(1.0);
        let mut free = 0.0;
        let mut obstacle = None;
        while free < looks && obstacle.is_none() {
            let share = (free + 1.0) / looks;
            obstacle = self.obstacle(&along.ahead(share * way_m * (1.0 - slip)), on);
            free += f64::from(u8::from(obstacle.is_none()));
        }
        if let (Some(obstacle), true) = (obstacle, free == 0.0) {
            return Next::Blocked(obstacle);
        }
        let share = free / looks;
        let gone_m = share * way_m * (1.0 - slip);
        let end = along.ahead(gone_m).turned(0.5 * strays_rad * share);
        let way_m = share * way_m;
        Next::Step(self.timed(end, way_m, on))
    }

    /// How long a leg takes, and how much power.
    fn timed(&self, end: Pose, way_m: f64, on: &Ground<'_>) -> Step {
        let (model, start) = (on.model, self.truth);
        let height_m = |pose: &Pose| on.field.ground_m(pose.east_m, pose.north_m);
        let gone_m = libm::hypot(end.east_m - start.east_m, end.north_m - start.north_m);
        let rise_m = height_m(&end) - height_m(&start);
        // A leg that slips through all of its way climbs nothing.
        let grade = if gone_m > 0.0 { rise_m / gone_m } else { 0.0 };
        let cover = on.field.rock_cover(start.place_m(), COVER_RADIUS_M);
        let slower = 1.0 + model.rock_slowdown * cover + model.slope_slowdown * grade.abs();
        let lasts_s = way_m.abs() / model.speed_m_per_s * slower * on.slower;
        let climb_w =
            model.mass_kg * GRAVITY_N_PER_KG * rise_m.max(0.0) / (lasts_s * model.climb_efficiency);
        Step {
            truth: [start, end],
            estimate: [self.estimate, self.estimate.ahead(way_m)],
            way_m: way_m.abs(),
            lasts: SimDuration::from_secs_f64(lasts_s),
            power_w: model.drive_power_w + climb_w,
        }
    }

    /// What keeps the rover from a pose. Where it is in trouble already it may leave: what troubles
    /// it there does not count.
    fn obstacle(&self, at: &Pose, on: &Ground<'_>) -> Option<Obstacle> {
        let found = self.obstacle_at(at, on)?;
        (self.obstacle_at(&self.truth, on) != Some(found)).then_some(found)
    }

    fn obstacle_at(&self, at: &Pose, on: &Ground<'_>) -> Option<Obstacle> {
        let (place_m, half_m) = (at.place_m(), 0.5 * on.field.settings().side_m);
        if !(place_m.x.abs() <= half_m && place_m.y.abs() <= half_m) {
            return Some(Obstacle::Edge);
        }
        if on.field.hazard(place_m.x, place_m.y) == Hazard::Boulder {
            return Some(Obstacle::Boulder);
        }
        if on.field.slope_rad(place_m.x, place_m.y) > on.model.slope_limit_rad {
            return Some(Obstacle::Slope);
        }
        // Of the ground: what lies under a wheel now does not lie there.
        let attitude = Attitude::on(on.field, at, on.model.wheelbase_m, &Lift::default());
        if attitude.tilt_rad() > on.model.tilt_limit_rad {
            return Some(Obstacle::Tilt);
        }
        let mut surprises = self.surprises.iter();
        let is_in = |surprise: &Surprise| {
            let way_m = place_m - surprise.center_m;
            libm::hypot(way_m.x, way_m.y) < surprise.radius_m
        };
        surprises.any(is_in).then_some(Obstacle::Fault)
    }

    /// The poses on a step, a share of it done.
    pub(super) fn on_step(&self, step: &Step, share: f64) -> [Pose; 2] {
        [step.truth, step.estimate].map(|[from, to]| from.towards(&to, share))
    }

    /// How far the wheels have gone on a step, a share of it done, since the start \[m\].
    pub(super) fn driven_on_step_m(&self, step: &Step, share: f64) -> f64 {
        self.driven_m + share * step.way_m
    }

    /// What the rover reckons the standard deviation of its place to be on a step, a share of it
    /// done \[m\]: slip counts in full, for it errs to one side, and drift by the way since the last
    /// fix.
    pub(super) fn sigma_on_step_m(&self, step: &Step, share: f64, model: &RoverModel) -> f64 {
        let way_m = share * step.way_m;
        let drift_rad = model.yaw_sigma_rad * libm::sqrt(self.since_fix_m + way_m);
        self.sigma_m + way_m * (model.slip + model.slip_sigma + drift_rad)
    }

    /// Does a share of a step: all of it at its end, less if it is broken off.
    pub(super) fn take(&mut self, step: &Step, share: f64, model: &RoverModel) {
        self.sigma_m = self.sigma_on_step_m(step, share, model);
        [self.truth, self.estimate] = self.on_step(step, share);
        self.since_fix_m += share * step.way_m;
        self.driven_m = self.driven_on_step_m(step, share);
    }

    /// What is left of an errand once a share of a step is done.
    pub(super) fn left(errand: Errand, step: &Step, share: f64) -> Errand {
        match errand {
            Errand::BackUp(left_m) => Errand::BackUp((left_m - share * step.way_m).max(0.0)),
            other => other,
        }
    }

    /// Knows where it is, by landmarks.
    pub(super) fn fix(&mut self, estimate: Pose, sigma_m: f64) {
        self.estimate = estimate;
        self.sigma_m = sigma_m;
        self.since_fix_m = 0.0;
    }
}
