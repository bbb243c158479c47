//! The sky of Mars: where the Sun stands at a place and time, when it rises and sets, and how much
//! of its power reaches level ground through dust.
//!
//! Time here is seconds since a local solar midnight, on which the season is known. Days are sols
//! of [`SOL_S`]; equation of time, terrain on the horizon and refraction are left out.

use std::f64::consts::{PI, TAU};

use crate::error::SkyError;

/// A Martian solar day \[s\] (M. Allison and M. McEwen, *A post-Pathfinder evaluation of
/// areocentric solar coordinates*, 2000).
pub const SOL_S: f64 = 88_775.244;

/// A Martian year \[sol\]: the same source.
pub const YEAR_SOLS: f64 = 668.5921;

/// How far the equator is inclined to the orbit \[rad\].
const OBLIQUITY_RAD: f64 = 25.19 * PI / 180.0;

/// The eccentricity of the orbit.
const ECCENTRICITY: f64 = 0.0934;

/// The solar longitude at which Mars is closest to the Sun \[rad\].
const PERIHELION_RAD: f64 = 251.0 * PI / 180.0;

/// The Sun's power on a surface that faces it, above the air, at the mean distance \[W/m²\]
/// (J. Appelbaum and D. Flood, *Solar radiation on Mars*, 1990).
const MEAN_IRRADIANCE_W_M2: f64 = 590.0;

/// How much of the light that meets dust is scattered and not absorbed, over the whole spectrum
/// (J. Pollack and others, 1990).
const SCATTERED: f64 = 0.86;

/// How far forward dust scatters: the asymmetry of its phase function (M. Tomasko and others, 1999).
const ASYMMETRY: f64 = 0.63;

/// The sky over a place on Mars.
///
/// ```
/// use farside_worlds::sky::{SOL_S, Sky};
/// // Gusev crater, at the beginning of southern summer, with as much dust as on most days.
/// let sky = Sky::new(-14.6, 270.0, 0.5)?;
/// let noon_s = SOL_S / 2.0;
/// assert!(sky.elevation_deg(noon_s) > 75.0);
/// assert!(sky.power_w_m2(noon_s) > 450.0);
/// assert_eq!(sky.power_w_m2(0.0), 0.0);
/// let [rises_s, sets_s] = sky.daylight_s(3).expect("the Sun rises there");
/// assert!(rises_s > 3.0 * SOL_S && sets_s - rises_s > SOL_S / 2.0);
/// # Ok::<(), farside_worlds::SkyError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    latitude_rad: f64,
    /// The mean anomaly at time 0 \[rad\].
    mean_anomaly_rad: f64,
    optical_depth: f64,
}

impl Sky {
    /// Over a latitude \[deg, -90 to 90, north is positive\], at a season given by the Sun's
    /// longitude at time 0 \[deg, 0 to 360: 0 is the northern spring equinox\], through dust of an
    /// optical depth \[0 to 10; 0.3 to 0.7 on clear days, over 4 in global storms\].
    ///
    /// # Errors
    ///
    /// If one of them is outside its range.
    pub fn new(
        latitude_deg: f64,
        solar_longitude_deg: f64,
        optical_depth: f64,
    ) -> Result<Sky, SkyError> {
        let within = |name, actual: f64, [least, most]: [f64; 2]| {
            if (least..=most).contains(&actual) {
                return Ok(actual);
            }
            Err(SkyError {
                name,
                actual,
                least,
                most,
            })
        };
        let latitude_deg = within("latitude_deg", latitude_deg, [-90.0, 90.0])?;
        let longitude_deg = within("solar_longitude_deg", solar_longitude_deg, [0.0, 360.0])?;
        Ok(Sky {
            latitude_rad: latitude_deg.to_radians(),
            mean_anomaly_rad: mean_anomaly(longitude_deg.to_radians() - PERIHELION_RAD),
            optical_depth: within("optical_depth", optical_depth, [0.0, 10.0])?,
        })
    }

    /// The same sky with another optical depth: dust comes and goes.
    ///
    /// # Errors
    ///
    /// If it is not within 0 and 10.
    pub fn with_dust(self, optical_depth: f64) -> Result<Sky, SkyError> {
        let [least, most] = [0.0, 10.0];
        if !(least..=most).contains(&optical_depth) {
            return Err(SkyError {
                name: "optical_depth",
                actual: optical_depth,
                least,
                most,
            });
        }
        Ok(Sky {
            optical_depth,
            ..self
        })
    }

    /// The Sun's longitude, which is the season \[deg, 0 to 360\].
    pub fn solar_longitude_deg(&self, time_s: f64) -> f64 {
        let longitude = self.true_anomaly_rad(time_s) + PERIHELION_RAD;
        let degrees = longitude.to_degrees();
        degrees - 360.0 * libm::floor(degrees / 360.0)
    }

    /// How high the Sun stands \[deg, -90 to 90; below the horizon it is negative\].
    pub fn elevation_deg(&self, time_s: f64) -> f64 {
        libm::asin(self.sine_of_elevation(time_s).clamp(-1.0, 1.0)).to_degrees()
    }

    /// The Sun's power on level ground, direct and from all of the sky \[W/m²\].
    ///
    /// Above the air it follows the distance and the elevation. Through dust it is what the
    /// Eddington two-stream solution lets pass that absorbs nothing (W. Meador and W. Weaver, *Two-stream
    /// approximations to radiative transfer in planetary atmospheres*, 1980, Equation 24 with the
    /// coefficients of Table 1), less what the dust absorbs on the direct way.
    pub fn power_w_m2(&self, time_s: f64) -> f64 {
        let sine = self.sine_of_elevation(time_s);
        if sine <= 0.0 {
            return 0.0;
        }
        self.irradiance_w_m2(time_s) * sine * transmitted(self.optical_depth, sine)
    }

    /// The energy that level ground gets from one time to another \[J/m²\].
    ///
    /// By Simpson's rule, at most a minute a step.
    pub fn energy_j_m2(&self, from_s: f64, to_s: f64) -> f64 {
        let span_s = to_s - from_s;
        if span_s <= 0.0 {
            return 0.0;
        }
        let pairs = libm::ceil(span_s / 120.0).max(1.0);
        let step_s = span_s / (2.0 * pairs);
        let mut sum = self.power_w_m2(from_s) + self.power_w_m2(to_s);
        for place in 1..2 * pairs as u64 {
            let weight = if place % 2 == 1 { 4.0 } else { 2.0 };
            sum += weight * self.power_w_m2(from_s + step_s * place as f64);
        }
        sum * step_s / 3.0
    }

    /// When the Sun rises and sets on a sol, counted from 0 \[s\]; none, if it does not rise. Where
    /// it does not set, from midnight to midnight.
    pub fn daylight_s(&self, sol: u32) -> Option<[f64; 2]> {
        let midnight_s = f64::from(sol) * SOL_S;
        let noon_s = midnight_s + SOL_S / 2.0;
        let declination = self.declination_rad(noon_s);
        let cosine = -libm::tan(self.latitude_rad) * libm::tan(declination);
        if cosine >= 1.0 {
            return None;
        }
        if cosine <= -1.0 {
            return Some([midnight_s, midnight_s + SOL_S]);
        }
        let half_s = libm::acos(cosine) / TAU * SOL_S;
        Some([noon_s - half_s, noon_s + half_s])
    }

    /// The Sun's power on a surface that faces it, above the air \[W/m²\].
    pub fn irradiance_w_m2(&self, time_s: f64) -> f64 {
        let cosine = libm::cos(self.true_anomaly_rad(time_s));
        let nearer = (1.0 + ECCENTRICITY * cosine) / (1.0 - ECCENTRICITY * ECCENTRICITY);
        MEAN_IRRADIANCE_W_M2 * nearer * nearer
    }

    fn sine_of_elevation(&self, time_s: f64) -> f64 {
        let declination = self.declination_rad(time_s);
        let hour_angle = TAU * (time_s / SOL_S - 0.5);
        libm::sin(self.latitude_rad) * libm::sin(declination)
            + libm::cos(self.latitude_rad) * libm::cos(declination) * libm::cos(hour_angle)
    }

    fn declination_rad(&self, time_s: f64) -> f64 {
        let longitude = self.true_anomaly_rad(time_s) + PERIHELION_RAD;
        libm::asin(libm::sin(OBLIQUITY_RAD) * libm::sin(longitude))
    }

    fn true_anomaly_rad(&self, time_s: f64) -> f64 {
        let mean = self.mean_anomaly_rad + TAU * time_s / (YEAR_SOLS * SOL_S);
        // Kepler's equation by Newton's method: at this eccentricity five steps reach all digits.
        let mut eccentric = mean + ECCENTRICITY * libm::sin(mean);
        for _ in 0..5 {
            let misses = eccentric - ECCENTRICITY * libm::sin(eccentric) - mean;
            eccentric -= misses / (1.0 - ECCENTRICITY * libm::cos(eccentric));
        }
        let (sine, cosine) = (libm::sin(eccentric), libm::cos(eccentric));
        let wide = libm::sqrt(1.0 - ECCENTRICITY * ECCENTRICITY) * sine;
        let turned = libm::atan2(wide, cosine - ECCENTRICITY);
        // Of the same turn as the eccentric anomaly.
        turned + TAU * libm::round((eccentric - turned) / TAU)
    }
}

/// The mean anomaly at a true anomaly \[rad\].
fn mean_anomaly(true_anomaly_rad: f64) -> f64 {
    let narrow = libm::sqrt((1.0 - ECCENTRICITY) / (1.0 + ECCENTRICITY));
    let eccentric = 2.0
        * libm::atan2(
            narrow * libm::sin(true_anomaly_rad / 2.0),
            libm::cos(true_anomaly_rad / 2.0),
        );
    eccentric - ECCENTRICITY * libm::sin(eccentric)
}

/// Which share of the light gets through dust, with the Sun at an elevation of this sine.
fn transmitted(optical_depth: f64, sine: f64) -> f64 {
    let passes = libm::exp(-optical_depth / sine);
    let first = 3.0 * (1.0 - ASYMMETRY) / 4.0;
    let third = (2.0 - 3.0 * ASYMMETRY * sine) / 4.0;
    let reflected = (first * optical_depth + (third - first * sine) * (1.0 - passes))
        / (1.0 + first * optical_depth);
    // The path through the dust, which near the horizon is long: scattered light takes a shorter one.
    let path = optical_depth / sine.max(0.2);
    (1.0 - reflected.clamp(0.0, 1.0)) * libm::exp(-(1.0 - SCATTERED) * path)
}

/// A time of each sol: from a second of the sol to another, or over midnight.
///
/// ```
/// use farside_worlds::sky::{SOL_S, SolWindow};
/// let pass = SolWindow::new(80_000.0, 1_000.0)?;
/// assert!(pass.contains(SOL_S) && !pass.contains(40_000.0));
/// assert_eq!(pass.next_opening_s(100.0), 80_000.0);
/// assert_eq!(pass.next_closing_s(80_000.0), SOL_S + 1_000.0);
/// # Ok::<(), farside_worlds::SkyError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolWindow {
    opens_s: f64,
    closes_s: f64,
}

impl SolWindow {
    /// From a second of the sol to a second of the sol, which is not in it; if the end is not after
    /// the start, over midnight.
    ///
    /// # Errors
    ///
    /// If one of them is not a second of a sol.
    pub fn new(opens_s: f64, closes_s: f64) -> Result<SolWindow, SkyError> {
        for (name, actual) in [("opens_s", opens_s), ("closes_s", closes_s)] {
            if !(0.0..=SOL_S).contains(&actual) {
                return Err(SkyError {
                    name,
                    actual,
                    least: 0.0,
                    most: SOL_S,
                });
            }
        }
        Ok(SolWindow { opens_s, closes_s })
    }

    /// Whether a time is in it.
    pub fn contains(&self, time_s: f64) -> bool {
        let of_sol_s = second_of_sol(time_s);
        if self.opens_s < self.closes_s {
            self.opens_s <= of_sol_s && of_sol_s < self.closes_s
        } else {
            self.opens_s <= of_sol_s || of_sol_s < self.closes_s
        }
    }

    /// When it opens next, at or after a time \[s\].
    pub fn next_opening_s(&self, time_s: f64) -> f64 {
        let waits_s = self.opens_s - second_of_sol(time_s);
        if waits_s >= 0.0 {
            time_s + waits_s
        } else {
            time_s + waits_s + SOL_S
        }
    }

    /// When it closes next, after a time \[s\]: if it is open then, when this opening ends.
    pub fn next_closing_s(&self, time_s: f64) -> f64 {
        let waits_s = self.closes_s - second_of_sol(time_s);
        if waits_s > 0.0 {
            time_s + waits_s
        } else {
            time_s + waits_s + SOL_S
        }
    }
}

/// The time since midnight \[s\].
fn second_of_sol(time_s: f64) -> f64 {
    time_s - SOL_S * libm::floor(time_s / SOL_S)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn sky(latitude_deg: f64, longitude_deg: f64, optical_depth: f64) -> Sky {
        Sky::new(latitude_deg, longitude_deg, optical_depth).expect("within its ranges")
    }

    /// The lengths of the seasons, as almanacs have them \[sol\].
    #[test]
    fn seasons_have_their_lengths() {
        let start = sky(0.0, 0.0, 0.0);
        let mut sol = 0;
        for (until_deg, sols) in [
            (90.0, 193.3),
            (180.0, 178.6),
            (270.0, 142.7),
            (359.4, 153.0),
        ] {
            let first = sol;
            while start.solar_longitude_deg(f64::from(sol) * SOL_S) < until_deg {
                sol += 1;
            }
            let length = f64::from(sol - first);
            assert!((length - sols).abs() < 2.0, "until {until_deg}: {length}");
        }
    }

    /// Mars gets 718 W/m² when it is nearest, and 493 W/m² when it is farthest: Appelbaum and Flood.
    #[test]
    fn irradiance_follows_the_distance() {
        let nearest = sky(0.0, 251.0, 0.0).irradiance_w_m2(0.0);
        let farthest = sky(0.0, 71.0, 0.0).irradiance_w_m2(0.0);
        assert!((nearest - 718.0).abs() < 3.0, "{nearest}");
        assert!((farthest - 493.0).abs() < 3.0, "{farthest}");
    }

    #[test]
    fn the_sun_does_not_rise_in_a_polar_winter() {
        let winter = sky(80.0, 270.0, 0.5);
        assert_eq!(winter.daylight_s(0), None);
        assert_eq!(winter.energy_j_m2(0.0, SOL_S), 0.0);
        let summer = sky(80.0, 90.0, 0.5);
        assert_eq!(summer.daylight_s(1), Some([SOL_S, 2.0 * SOL_S]));
        assert!(summer.elevation_deg(0.0) > 0.0);
    }

    #[test]
    fn ranges_are_named() {
        let error = Sky::new(91.0, 0.0, 0.5).expect_err("beyond the pole");
        assert!(error.to_string().contains("latitude_deg"), "{error}");
        let nothing = Sky::new(0.0, f64::NAN, 0.5).expect_err("not a number");
        assert!(
            nothing.to_string().contains("solar_longitude_deg"),
            "{nothing}"
        );
        assert!(SolWindow::new(-1.0, 5.0).is_err());
    }

    proptest! {
        /// Power is there exactly while the Sun is up, never above what comes from the Sun, and
        /// less through more dust.
        #[test]
        fn power_is_bounded(
            latitude in -89.0..89.0f64,
            longitude in 0.0..360.0f64,
            dust in 0.0..8.0f64,
            time_s in 0.0..700.0 * SOL_S,
        ) {
            let one = sky(latitude, longitude, dust);
            let (power, up) = (one.power_w_m2(time_s), one.elevation_deg(time_s));
            prop_assert_eq!(power > 0.0, up > 0.0);
            let sine = libm::sin(up.to_radians()).max(0.0);
            prop_assert!(power <= one.irradiance_w_m2(time_s) * sine + 1e-9);
            let more = one.with_dust(dust + 0.5).expect("within its range");
            prop_assert!(more.power_w_m2(time_s) <= power);
        }

        /// The Sun stands on the horizon where it rises and sets: but for the little that the
        /// season changes from noon to then.
        #[test]
        fn daylight_begins_and_ends_at_the_horizon(
            latitude in -60.0..60.0f64,
            longitude in 0.0..360.0f64,
            sol in 0..1_000u32,
        ) {
            let one = sky(latitude, longitude, 0.5);
            let [rises_s, sets_s] = one.daylight_s(sol).expect("it rises there on each sol");
            prop_assert!(one.elevation_deg(rises_s).abs() < 0.3);
            prop_assert!(one.elevation_deg(sets_s).abs() < 0.3);
            prop_assert!(rises_s >= f64::from(sol) * SOL_S && sets_s <= f64::from(sol + 1) * SOL_S);
        }

        /// Energies add up.
        #[test]
        fn energy_is_additive(
            longitude in 0.0..360.0f64,
            from_s in 0.0..SOL_S,
            first_s in 0.0..SOL_S,
            second_s in 0.0..SOL_S,
        ) {
            let one = sky(-14.6, longitude, 0.7);
            let middle_s = from_s + first_s;
            let parts = one.energy_j_m2(from_s, middle_s)
                + one.energy_j_m2(middle_s, middle_s + second_s);
            let whole = one.energy_j_m2(from_s, middle_s + second_s);
            prop_assert!((parts - whole).abs() <= 2e-4 * whole.max(1e5), "{parts} {whole}");
        }

        /// A window is open at its next opening, and not before; and until its next closing, and not after.
        #[test]
        fn windows_repeat_by_the_sol(
            opens_s in 0.0..SOL_S,
            closes_s in 0.0..SOL_S,
            time_s in 0.0..30.0 * SOL_S,
            share in 0.0..1.0f64,
        ) {
            prop_assume!((opens_s - closes_s).abs() > 1.0);
            let window = SolWindow::new(opens_s, closes_s).expect("seconds of a sol");
            let next_s = window.next_opening_s(time_s);
            prop_assert!(window.contains(next_s + 1e-3));
            prop_assert!((0.0..=SOL_S).contains(&(next_s - time_s)));
            let between_s = time_s + share * (next_s - time_s) - 1e-3;
            if !window.contains(time_s) && between_s > time_s {
                prop_assert!(!window.contains(between_s));
            }
            let ends_s = window.next_closing_s(time_s);
            prop_assert!((0.0..=SOL_S).contains(&(ends_s - time_s)));
            prop_assert!(window.contains(ends_s - 1e-3) && !window.contains(ends_s + 1e-3));
            let inside_s = time_s + share * (ends_s - time_s) - 1e-3;
            if window.contains(time_s) && inside_s > time_s {
                prop_assert!(window.contains(inside_s));
            }
        }
    }
}
