//! What lies between two antennas: distance, terrain, and how much of the signal is left.
//!
//! | quantity | formula | source |
//! |---|---|---|
//! | received power | `P_tx - (L0 + 10 n log10(d / 1 m)) - S - O` in dBm | Rappaport, 4.9 |
//! | shadowing `S` | normal, one draw for each pair and stretch of time | Rappaport, 4.9.2 |
//! | bit error rate | `erfc(sqrt(snr)) / 2`, QPSK | Proakis, 5.2.7 |
//! | message error rate | `1 - (1 - BER)^bits` | independent bit errors |
//!
//! Sources: Rappaport, *Wireless Communications*, 2nd ed. (the log-distance model); Proakis,
//! *Digital Communications*, 4th ed., with the noise in the bit's bandwidth; the defaults are those
//! of Gazebo's RF model.

use std::sync::Arc;

use farside::carrier::Parcel;
use farside::{SimDuration, SimTime};
use farside_worlds::HeightField;
use nalgebra::Point3;

use super::config::{PathLoss, RadioConfig};
use crate::link::Path;

/// The speed of light in vacuum, in metres a second.
pub const LIGHT_M_PER_S: f64 = 299_792_458.0;

/// Why a message is lost whose signal is too weak where it arrives.
pub const RANGE: &str = "range";
/// Why a message is lost when the ground is between the antennas.
pub const OCCLUDED: &str = "occluded";

impl PathLoss {
    /// The power that arrives over `distance_m`, in dBm; `shadowing_db` is what shadows take.
    /// Nearer than a metre is taken as a metre.
    pub fn received_dbm(&self, distance_m: f64, shadowing_db: f64) -> f64 {
        let decades = libm::log10(distance_m.max(1.0));
        self.tx_power_dbm - self.reference_db - 10.0 * self.exponent * decades - shadowing_db
    }

    /// The probability that a message of `bits` arrives damaged beyond use.
    pub fn error_rate(&self, received_dbm: f64, bits: u64) -> f64 {
        let snr = libm::pow(10.0, (received_dbm - self.noise_dbm) / 10.0);
        let bit_error_rate = 0.5 * libm::erfc(libm::sqrt(snr));
        // 1 - (1 - p)^n without losing small p.
        -libm::expm1(bits as f64 * libm::log1p(-bit_error_rate))
    }

    /// What shadows take from a pair of stations at `now`, in dB, the same both ways.
    fn shadowing_db(&self, parcel: &Parcel<'_>, purpose: u64, now: SimTime) -> f64 {
        if self.shadowing_db == 0.0 {
            return 0.0;
        }
        let stretch = now.as_nanos() / self.shadowing_every.as_nanos().max(1);
        let (a, b) = (parcel.sender_host(), parcel.receiver_host());
        let key = parcel.random_at(purpose, stretch);
        let mut draws = key.text(a.min(b)).text(a.max(b)).stream();
        draws.normal(0.0, self.shadowing_db)
    }
}

impl RadioConfig {
    /// What the way from `from_m` to `to_m` does at `now` to the message in hand. `purpose` tells
    /// the draws of shadowing from others of the link.
    pub fn path(
        &self,
        parcel: &Parcel<'_>,
        purpose: u64,
        now: SimTime,
        (from_m, to_m): (Point3<f64>, Point3<f64>),
        terrain: Option<&Arc<HeightField>>,
    ) -> Path {
        let distance_m = nalgebra::distance(&from_m, &to_m);
        let mut path = Path::default();
        if self.light_time {
            path.propagation = SimDuration::from_secs_f64(distance_m / LIGHT_M_PER_S);
        }
        let blocked = |path: Path, reason| Path {
            loss: 1.0,
            reason,
            ..path
        };
        if self.range_m.is_some_and(|range_m| distance_m > range_m) {
            return blocked(path, RANGE);
        }
        let hidden = self.line_of_sight
            && terrain.is_some_and(|terrain| !terrain.line_of_sight(from_m, to_m));
        if hidden && self.occlusion_db.is_none() {
            return blocked(path, OCCLUDED);
        }
        if let Some(loss) = &self.path_loss {
            let behind_db = self.occlusion_db.filter(|_| hidden).unwrap_or(0.0);
            let lost_db = loss.shadowing_db(parcel, purpose, now) + behind_db;
            let received_dbm = loss.received_dbm(distance_m, lost_db);
            path.loss = loss.error_rate(received_dbm, 8 * parcel.size_bytes());
            path.reason = if hidden { OCCLUDED } else { RANGE };
        }
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_rates_match_their_closed_form() {
        let loss = PathLoss::default();
        // At 0 dB of signal over noise, QPSK errs in erfc(1) / 2 = 7.865 % of its bits.
        let one_bit = loss.error_rate(-90.0, 1);
        assert!((one_bit - 0.078_649_603_525_143).abs() < 1e-12);
        let hundred = loss.error_rate(-90.0, 100);
        assert!((hundred - (1.0 - libm::pow(1.0 - one_bit, 100.0))).abs() < 1e-12);
        // A strong signal: rates too small for 1 - (1 - p)^n.
        let strong = loss.error_rate(-78.0, 8);
        assert!(strong > 0.0 && strong < 1e-6, "{strong}");
        assert_eq!(loss.error_rate(-200.0, 800), 1.0);
    }

    #[test]
    fn power_falls_by_the_exponent_for_each_decade() {
        let loss = PathLoss {
            exponent: 3.5,
            ..PathLoss::default()
        };
        let fall = loss.received_dbm(10.0, 0.0) - loss.received_dbm(1000.0, 0.0);
        assert!((fall - 70.0).abs() < 1e-12);
        assert_eq!(loss.received_dbm(0.0, 0.0), loss.received_dbm(1.0, 0.0));
    }
}
