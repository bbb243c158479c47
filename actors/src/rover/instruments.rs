//! What cameras and spectrometers see: one thing in a beam, or rocks all around, with noise.
//!
//! Here the truth is read, and nothing of it leaves but what the noise has been put on. Of classes
//! and mineral fractions this file knows nothing.

use farside::random::{RandomKey, Stream};
use farside_worlds::{Footprint, RockField};
use nalgebra::{Point2, Point3, Vector3};

use super::body::{Attitude, Pose};
use super::command::View;
use super::landmarks::Sighting;
use super::model::{InstrumentKind, InstrumentModel, ViewModel};

/// How high instruments on the body are \[m\], and how far down they look \[rad\].
const BODY_EYE_M: f64 = 0.5;
const BODY_TILT_RAD: f64 = -0.35;

/// How far apart a beam is followed \[m\], and how often the last stretch is halved.
const BEAM_STEP_M: f64 = 0.2;
const HALVINGS: u32 = 30;

/// The standard deviation of a distance, as a share of it.
const RANGE_SIGMA: f64 = 0.01;

/// The share of a beam that a rock must fill for the reading to be of it.
const LEAST_SHARE: f64 = 0.1;

/// The share of a beam's width that a rock must have in a panorama to be seen.
const LEAST_WIDTH: f64 = 0.5;

/// How far over the foot of a rock one looks for it in a panorama \[m\].
const OVER_FOOT_M: f64 = 0.05;

/// Where an instrument is, and the directions of the body that it is on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Eye {
    from_m: Point3<f64>,
    /// Forwards, to the left, and up.
    axes: [Vector3<f64>; 3],
}

impl Eye {
    /// On a body that stands so, at a height \[m\].
    pub(super) fn on(pose: &Pose, attitude: &Attitude, height_m: f64) -> Eye {
        let (sine, cosine) = libm::sincos(pose.yaw_rad);
        let (up, level) = libm::sincos(attitude.pitch_rad);
        let forwards = Vector3::new(cosine * level, sine * level, up);
        let (rise, level) = libm::sincos(attitude.roll_rad);
        let left = Vector3::new(-sine * level, cosine * level, rise);
        let up = forwards.cross(&left).normalize();
        let from_m = Point3::new(pose.east_m, pose.north_m, attitude.height_m + height_m);
        Eye {
            from_m,
            axes: [forwards, up.cross(&forwards), up],
        }
    }

    /// The eye of an instrument: on the mast, or on the body.
    pub(super) fn of(
        instrument: &InstrumentModel,
        pose: &Pose,
        attitude: &Attitude,
        mast_m: f64,
    ) -> Eye {
        let height_m = if instrument.on_mast {
            mast_m
        } else {
            BODY_EYE_M
        };
        Eye::on(pose, attitude, height_m)
    }

    /// Pan and tilt \[rad\] that point at the surface over a place.
    pub(super) fn angles_rad(&self, field: &RockField, place_m: Point2<f64>) -> [f64; 2] {
        let height_m = field.terrain().height_m(place_m.x, place_m.y);
        let way = Point3::new(place_m.x, place_m.y, height_m) - self.from_m;
        let [ahead, left, up] = self.axes.map(|axis| axis.dot(&way));
        let pan_rad = libm::atan2(left, ahead);
        [pan_rad, libm::atan2(up, libm::hypot(ahead, left))]
    }

    /// Where the line of sight meets the surface; none within the range.
    fn meets(&self, field: &RockField, [pan, tilt]: [f64; 2], range_m: f64) -> Option<Point3<f64>> {
        let (sine, cosine) = libm::sincos(pan);
        let (up, level) = libm::sincos(tilt);
        let [ahead, left, above] = self.axes;
        let direction = (ahead * cosine + left * sine) * level + above * up;
        let at = |way_m: f64| self.from_m + direction * way_m;
        let is_below = |way_m: f64| {
            let point = at(way_m);
            point.z <= field.terrain().height_m(point.x, point.y)
        };
        let steps = libm::ceil(range_m / BEAM_STEP_M) as u64;
        let ways_m = (1..=steps).map(|step| (step as f64 * BEAM_STEP_M).min(range_m));
        let mut high_m = ways_m.into_iter().find(|way_m| is_below(*way_m))?;
        let mut low_m = (high_m - BEAM_STEP_M).max(0.0);
        for _ in 0..HALVINGS {
            let middle_m = 0.5 * (low_m + high_m);
            match is_below(middle_m) {
                true => high_m = middle_m,
                false => low_m = middle_m,
            }
        }
        Some(at(high_m))
    }
}

/// Where an instrument looks, and at what.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gaze<'a> {
    pub(super) field: &'a RockField,
    pub(super) pose: Pose,
    pub(super) eye: Eye,
    pub(super) instrument: &'a InstrumentModel,
    /// Where the mast points, pan and tilt \[rad\].
    pub(super) mast_rad: [f64; 2],
    /// What a fault adds to each value.
    pub(super) drift: f64,
}

/// What was measured of one thing.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Measured {
    pub(super) rock: Option<u32>,
    /// Where it lies relative to the rover, as measured.
    pub(super) ahead_m: f64,
    pub(super) left_m: f64,
    pub(super) range_m: f64,
    pub(super) diameter_m: f64,
    pub(super) texture: Vec<f64>,
    pub(super) spectrum: Vec<f64>,
    pub(super) noise: f64,
}

impl Measured {
    /// As something to find one's place by: a rock.
    pub(super) fn sighting(&self) -> Option<Sighting> {
        Some(Sighting {
            rock: self.rock?,
            ahead_m: self.ahead_m,
            left_m: self.left_m,
            sigma_m: range_sigma_m(self.range_m),
        })
    }
}

fn range_sigma_m(range_m: f64) -> f64 {
    RANGE_SIGMA * range_m.abs() + 0.01
}

impl Gaze<'_> {
    /// Where it looks: an instrument on the body to the side that it faces, and down.
    fn angles_rad(&self) -> [f64; 2] {
        match self.instrument.on_mast {
            true => self.mast_rad,
            false => [self.instrument.faces_rad, BODY_TILT_RAD],
        }
    }

    /// Whether a reading of one thing would be of anything.
    pub(super) fn has_target(&self) -> bool {
        let range_m = self.instrument.range_m;
        self.eye
            .meets(self.field, self.angles_rad(), range_m)
            .is_some()
    }

    /// Everything that a reading measures; `number` is that of the first reading.
    pub(super) fn read(
        &self,
        view: View,
        model: &ViewModel,
        key: RandomKey,
        number: u64,
    ) -> Vec<Measured> {
        match view {
            View::Point => self.point(model, key.number(number)).into_iter().collect(),
            View::Panorama => self.panorama(model, key, number),
        }
    }

    fn point(&self, model: &ViewModel, key: RandomKey) -> Option<Measured> {
        let range_m = self.instrument.range_m;
        let met_m = self.eye.meets(self.field, self.angles_rad(), range_m)?;
        let eye_m = self.eye.from_m;
        let footprint = self
            .field
            .footprint(eye_m, met_m.xy(), 0.5 * model.beam_rad);
        let mut rock = None;
        let mut most = LEAST_SHARE;
        for &(number, share) in &footprint.rocks {
            if share > most {
                (rock, most) = (Some(number), share);
            }
        }
        Some(self.measured(rock, met_m, &footprint, model, &mut key.stream()))
    }

    fn panorama(&self, model: &ViewModel, key: RandomKey, number: u64) -> Vec<Measured> {
        let eye_m = self.eye.from_m;
        let here_m = self.pose.place_m();
        let mut all = Vec::new();
        for rock in self.field.near(here_m, self.instrument.range_m) {
            let seen = self.field.rocks()[rock];
            let place_m = seen.position_m;
            let foot_m = self.field.terrain().height_m(place_m.x, place_m.y);
            let top_m = Point3::new(place_m.x, place_m.y, foot_m + OVER_FOOT_M);
            let range_m = (top_m - eye_m).norm();
            let is_wide = seen.diameter_m >= LEAST_WIDTH * model.beam_rad * range_m;
            let is_in_range = range_m <= self.instrument.range_m;
            if !(is_wide && is_in_range && self.field.terrain().line_of_sight(eye_m, top_m)) {
                continue;
            }
            let footprint = self.field.footprint(eye_m, place_m, 0.5 * model.beam_rad);
            let mut draws = key.number(number + all.len() as u64).stream();
            all.push(self.measured(Some(rock), top_m, &footprint, model, &mut draws));
        }
        all
    }

    fn measured(
        &self,
        rock: Option<usize>,
        at_m: Point3<f64>,
        footprint: &Footprint,
        model: &ViewModel,
        draws: &mut Stream,
    ) -> Measured {
        // A rock's place is its centre, not the spot that the beam meets.
        let seen = rock.map(|rock| self.field.rocks()[rock]);
        let place_m = seen.map_or(at_m.xy(), |rock| rock.position_m);
        let range_m = (at_m - self.eye.from_m).norm();
        let far = (range_m / self.instrument.near_m).max(1.0);
        let noise = model.noise * far;
        let sigma_m = range_sigma_m(range_m);
        let [ahead_m, left_m] = self.pose.to_body(place_m);
        let [ahead_m, left_m] = [ahead_m, left_m].map(|way_m| draws.normal(way_m, sigma_m));
        let range_m = draws.normal(range_m, sigma_m).max(0.0);
        let diameter_m = seen.map_or(0.0, |rock| rock.diameter_m);
        let diameter_m = draws.normal(diameter_m, sigma_m * f64::from(u8::from(rock.is_some())));
        let mut noisy = |value: &f64| draws.normal(value + self.drift, noise);
        let (mut texture, mut spectrum) = (Vec::new(), Vec::new());
        match self.instrument.kind {
            InstrumentKind::Camera => {
                let clean = self.field.mixed_texture(footprint);
                texture = clean.iter().map(&mut noisy).collect();
            }
            InstrumentKind::Spectrometer => {
                let mut clean = vec![0.0; self.field.wavelengths_nm().len()];
                self.field.mixed_reflectance(footprint, &mut clean);
                spectrum = clean.iter().map(&mut noisy).collect();
            }
        }
        Measured {
            rock: rock.map(|rock| rock as u32),
            ahead_m,
            left_m,
            range_m,
            diameter_m: diameter_m.max(0.0),
            texture,
            spectrum,
            noise,
        }
    }
}

#[cfg(test)]
mod tests {
    use farside_worlds::RockFieldSettings;
    use farside_worlds::rock_field::FieldRocks;
    use proptest::prelude::*;

    use super::super::lifts::Lift;
    use super::*;

    fn hills() -> RockField {
        let settings = RockFieldSettings {
            hills: 5,
            hill_height_m: 8.0,
            rocks: FieldRocks::Exactly(1),
            ..RockFieldSettings::default()
        };
        RockField::generate(&settings).expect("within its ranges")
    }

    #[test]
    fn roll_is_right_side_down_and_pitch_nose_up() {
        let field = hills();
        let mut steepest = 0.0f64;
        for place in 0..200 {
            let (east_m, north_m) = (
                f64::from(place % 20) * 4.0 - 38.0,
                f64::from(place / 20) * 7.0 - 32.0,
            );
            let rise = field.ground().gradient(east_m, north_m);
            let pose = Pose {
                east_m,
                north_m,
                yaw_rad: 0.0,
            };
            let attitude = Attitude::on(&field, &pose, 1.0, &Lift::default());
            // Facing east, north is to the left.
            assert!((attitude.pitch_rad - libm::atan(rise.x)).abs() < 0.05);
            assert!((attitude.roll_rad - libm::atan(rise.y)).abs() < 0.05);
            steepest = steepest.max(attitude.tilt_rad());
            let back = Pose {
                yaw_rad: std::f64::consts::PI,
                ..pose
            };
            let turned = Attitude::on(&field, &back, 1.0, &Lift::default());
            assert!((turned.roll_rad + attitude.roll_rad).abs() < 1e-9);
            assert!((turned.pitch_rad + attitude.pitch_rad).abs() < 1e-9);
        }
        assert!(steepest > 0.15, "{steepest}");
    }

    proptest! {
        /// The line of sight meets the ground where the mast was pointed, if nothing is between.
        #[test]
        fn the_mast_points_where_it_is_pointed(
            east_m in -35.0..35.0f64,
            north_m in -35.0..35.0f64,
            yaw_rad in -3.1..3.1f64,
            bearing_rad in -3.1..3.1f64,
            range_m in 1.0..14.0f64,
        ) {
            let field = hills();
            let pose = Pose { east_m, north_m, yaw_rad };
            let eye = Eye::on(&pose, &Attitude::on(&field, &pose, 1.4, &Lift::default()), 1.5);
            let place_m = Pose { yaw_rad: bearing_rad, ..pose }.ahead(range_m).place_m();
            let aims_m = field.terrain().antenna_m(place_m.x, place_m.y, 0.0);
            let above_m = aims_m + (eye.from_m - aims_m) * 0.02;
            prop_assume!(field.terrain().line_of_sight(eye.from_m, above_m));
            let way_m = (eye.from_m - aims_m).norm();
            // Behind a crest a line may touch the ground and go on over it: that is not in view.
            let is_facing = [0.05, 0.15, 0.25, 0.35].into_iter().all(|beyond_m| {
                let behind_m = aims_m + (aims_m - eye.from_m) * (beyond_m / way_m);
                behind_m.z < field.terrain().height_m(behind_m.x, behind_m.y)
            });
            prop_assume!(is_facing);
            let angles_rad = eye.angles_rad(&field, place_m);
            let met_m = eye.meets(&field, angles_rad, 40.0).expect("it is on the ground");
            let off_m = (met_m - aims_m).norm();
            prop_assert!(off_m < 0.02 * way_m + 0.25, "{off_m} at {way_m}");
        }
    }
}
