//! What lies within the beam of an instrument.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Point2, Point3, Vector3};

use super::RockField;

/// The narrowest and the widest half angle of a beam \[rad\].
const HALF_ANGLE_RAD: [f64; 2] = [1e-6, FRAC_PI_2 - 0.01];

/// What a beam sees: how much of it falls on which rock and on the ground.
#[derive(Clone, Debug, PartialEq)]
pub struct Footprint {
    /// The rocks in it, from the nearest to the farthest, each with its share of the beam; over 0.
    pub rocks: Vec<(usize, f64)>,
    /// The share of the ground, 0 to 1: what the rocks leave.
    pub ground: f64,
}

impl Footprint {
    /// The share of one rock, 0 to 1.
    pub fn share(&self, rock: usize) -> f64 {
        let found = self.rocks.iter().find(|(other, _)| *other == rock);
        found.map_or(0.0, |(_, share)| *share)
    }

    /// The footprint of a cone from one point towards another.
    ///
    /// A rock is taken as a disc of its diameter that faces the beam. Where one rock is before
    /// another, they are taken as independent: a rock of which a nearer one could hide a third loses a
    /// third.
    pub(super) fn of(
        field: &RockField,
        from_m: Point3<f64>,
        to_m: Point3<f64>,
        half_angle_rad: f64,
    ) -> Footprint {
        let way = to_m - from_m;
        let range_m = way.norm();
        let axis = match range_m > 1e-9 {
            true => way / range_m,
            false => -Vector3::z(),
        };
        let [narrowest, widest] = HALF_ANGLE_RAD;
        let half_angle_rad = match half_angle_rad.is_nan() {
            true => narrowest,
            false => half_angle_rad.clamp(narrowest, widest),
        };
        let spread = libm::tan(half_angle_rad);
        let flat_m = way.xy().norm();
        // From the viewer to as far beyond the aim: there the beam's axis is deep in the ground.
        let reach_m = flat_m + 2.0 * range_m * spread + field.largest_m;
        let mut seen: Vec<(f64, usize, f64)> = Vec::new();
        for rock in field.near(to_m.xy(), reach_m) {
            let to_rock = field.rock_center_m(rock) - from_m;
            let along_m = to_rock.dot(&axis);
            if along_m <= 0.0 {
                continue;
            }
            let aside_m = (to_rock - axis * along_m).norm();
            let beam_m = along_m * spread;
            let radius_m = 0.5 * field.rocks()[rock].diameter_m;
            let share = common_area(radius_m, beam_m, aside_m) / (PI * beam_m * beam_m);
            if share > 0.0 {
                seen.push((along_m, rock, share.min(1.0)));
            }
        }
        seen.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut ground = 1.0;
        let mut rocks = Vec::with_capacity(seen.len());
        for (_, rock, share) in seen {
            let visible = share * ground;
            if visible > 0.0 {
                rocks.push((rock, visible));
                ground -= visible;
            }
        }
        Footprint { rocks, ground }
    }
}

impl RockField {
    /// What a beam sees, that is a cone from `from_m` with this half angle \[rad\] around the
    /// direction to `aim_m`: to the rock that lies there, or else to the ground.
    ///
    /// A half angle of nothing, or none that is a number, is taken as a microradian; one of a right
    /// angle as a little less. Hills and boulders are not looked for on the way: see
    /// [`RockField::sees`].
    pub fn footprint(
        &self,
        from_m: Point3<f64>,
        aim_m: Point2<f64>,
        half_angle_rad: f64,
    ) -> Footprint {
        Footprint::of(self, from_m, self.target_m(aim_m), half_angle_rad)
    }

    /// The point that an instrument looks at which is pointed at a place: the middle of the largest
    /// rock there, or else the ground.
    pub fn target_m(&self, aim_m: Point2<f64>) -> Point3<f64> {
        let there = self.near(aim_m, 0.5 * self.largest_m).filter(|&rock| {
            let rock = &self.rocks()[rock];
            (rock.position_m - aim_m).norm() <= 0.5 * rock.diameter_m
        });
        let largest = there.max_by(|&a, &b| {
            let diameter_m = |rock: usize| self.rocks()[rock].diameter_m;
            diameter_m(a).total_cmp(&diameter_m(b))
        });
        match largest {
            Some(rock) => {
                let middle_m = self.rock_center_m(rock);
                Point3::new(aim_m.x, aim_m.y, middle_m.z)
            }
            None => Point3::new(aim_m.x, aim_m.y, self.ground_m(aim_m.x, aim_m.y)),
        }
    }

    /// The middle of a rock \[m\]: it is half as high as it is wide.
    ///
    /// # Panics
    /// When there is no such rock.
    pub fn rock_center_m(&self, rock: usize) -> Point3<f64> {
        let rock = &self.rocks()[rock];
        let (x_m, y_m) = (rock.position_m.x, rock.position_m.y);
        Point3::new(x_m, y_m, self.ground_m(x_m, y_m) + 0.25 * rock.diameter_m)
    }

    /// Whether neither hills nor boulders stand between a point \[m\] and the near side of a rock.
    ///
    /// # Panics
    /// When there is no such rock.
    pub fn sees(&self, from_m: Point3<f64>, rock: usize) -> bool {
        let center_m = self.rock_center_m(rock);
        let back = from_m.xy() - center_m.xy();
        // A boulder is part of the terrain: look at a point before it, beyond the reach of the samples
        // that it has raised.
        let before_m = 0.5 * self.rocks()[rock].diameter_m + 1.5 * self.terrain().resolution_m();
        if back.norm() <= before_m {
            return true;
        }
        let place_m = center_m.xy() + back * (before_m / back.norm());
        let height_m = center_m
            .z
            .max(self.terrain().height_m(place_m.x, place_m.y));
        let target_m = Point3::new(place_m.x, place_m.y, height_m);
        self.terrain().line_of_sight(from_m, target_m)
    }

    /// Writes the reflectance that a beam sees in each band, rocks and ground mixed by area, without
    /// noise.
    ///
    /// # Panics
    /// When `out` has not one entry for each band.
    pub fn mixed_reflectance(&self, footprint: &Footprint, out: &mut [f64]) {
        assert_eq!(
            out.len(),
            self.wavelengths_nm().len(),
            "one entry for each band"
        );
        for (mixed, ground) in out.iter_mut().zip(self.ground_reflectance()) {
            *mixed = footprint.ground * ground;
        }
        for &(rock, share) in &footprint.rocks {
            for (mixed, value) in out.iter_mut().zip(self.reflectance(rock)) {
                *mixed += share * value;
            }
        }
    }

    /// The statistics of texture that a beam sees, mixed by area, without noise.
    pub fn mixed_texture(&self, footprint: &Footprint) -> [f64; crate::geology::TEXTURE] {
        let mut mixed = self.ground_texture().map(|value| footprint.ground * value);
        for &(rock, share) in &footprint.rocks {
            for (mixed, value) in mixed.iter_mut().zip(self.texture(rock)) {
                *mixed += share * value;
            }
        }
        mixed
    }

    /// The share of the ground within a radius \[m, over 0\] of a place that is under the field's
    /// rocks, 0 to 1. Rocks smaller than the field's smallest are not counted.
    pub fn rock_cover(&self, center_m: Point2<f64>, radius_m: f64) -> f64 {
        let covered_m2: f64 = self
            .near(center_m, radius_m + 0.5 * self.largest_m)
            .map(|rock| {
                let rock = &self.rocks()[rock];
                let away_m = (rock.position_m - center_m).norm();
                common_area(0.5 * rock.diameter_m, radius_m, away_m)
            })
            .sum();
        let share = covered_m2 / (PI * radius_m * radius_m);
        // Where nothing was asked for, there is nothing under rocks.
        if share.is_nan() { 0.0 } else { share.min(1.0) }
    }
}

/// The area that two circles have in common, from their radii and the distance of their centres.
fn common_area(a: f64, b: f64, apart: f64) -> f64 {
    let small = a.min(b);
    if apart >= a + b {
        return 0.0;
    }
    if apart <= (a - b).abs() {
        return PI * small * small;
    }
    let wedge = |radius: f64, other: f64| {
        let cosine = (apart * apart + radius * radius - other * other) / (2.0 * apart * radius);
        radius * radius * libm::acos(cosine.clamp(-1.0, 1.0))
    };
    let kite = (a + b - apart) * (apart + a - b) * (apart - a + b) * (a + b + apart);
    (wedge(a, b) + wedge(b, a) - 0.5 * libm::sqrt(kite.max(0.0))).clamp(0.0, PI * small * small)
}
