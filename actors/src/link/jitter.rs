//! How delays scatter: shapes, and their correlation from message to message.
//!
//! Every shape is a distribution of a deviation in units of the jitter, drawn by its inverse
//! cumulative distribution, so that correlated jitter has the same marginal as uncorrelated one.

use std::fmt;
use std::sync::Arc;

use farside::SimDuration;
use farside::random::RandomKey;
use serde::de::{Error, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// How delays scatter round the latency.
///
/// | written as | deviation, in units of the jitter | least |
/// |---|---|---|
/// | `"uniform"` | evenly from -1 to 1 | -1 |
/// | `"normal"` | normal, standard deviation 1, cut at 3 to either side | -3 |
/// | `"pareto"` | `(X - 3/2) 2/sqrt(3)`, `P(X > x) = x^-3`: a long tail | -0.577 |
/// | `{ table = [...] }` | see below | the first entry |
///
/// A table is the inverse cumulative distribution at evenly spaced probabilities from 0 to 1,
/// linear between. The pareto shape, of mean 0 and standard deviation 1, is that of netem's
/// `pareto.c` (iproute2: a = 3, less the mean 3/2), scaled so that the jitter is the standard
/// deviation; netem scales by 4/3 and cuts at 4.
///
/// ```
/// use farside_actors::link::JitterShape;
/// assert_eq!(JitterShape::default(), JitterShape::Uniform);
/// let table = JitterShape::table(&[-0.5, 0.0, 2.0]).unwrap();
/// assert_eq!(table.quantile(0.75), 1.0);
/// assert!(JitterShape::table(&[1.0, 0.0]).is_err());
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub enum JitterShape {
    /// Evenly, by at most the jitter to either side.
    #[default]
    Uniform,
    /// Normally, with the jitter as standard deviation, cut at three of them to either side.
    Normal,
    /// With a long tail to the right: see the table above.
    Pareto,
    /// By an inverse cumulative distribution. Build it with [`JitterShape::table`].
    Table(Arc<[f64]>),
}

/// The names of the shapes that need nothing more.
const NAMES: [&str; 3] = ["uniform", "normal", "pareto"];

/// The most entries of a table; netem's have 4096.
const MAX_TABLE: usize = 1 << 16;

/// `2/sqrt(3)`: one over the standard deviation of a Pareto variable with a = 3.
const PARETO_SCALE: f64 = 1.154_700_538_379_251_5;

impl JitterShape {
    /// Where the normal shape is cut, in standard deviations.
    pub const NORMAL_SPREAD: u32 = 3;

    /// A shape by its inverse cumulative distribution, in units of the jitter.
    ///
    /// # Errors
    /// When it has fewer than two entries or too many, or one is not finite or below the one
    /// before.
    pub fn table(entries: &[f64]) -> Result<Self, String> {
        if !(2..=MAX_TABLE).contains(&entries.len()) {
            let found = entries.len();
            return Err(format!(
                "{found} entries: expected from 2 to {MAX_TABLE} for a table"
            ));
        }
        let ascends = entries.windows(2).all(|pair| pair[0] <= pair[1]);
        if !ascends || !entries.iter().all(|entry| entry.is_finite()) {
            return Err("expected numbers of which none is below the one before".to_owned());
        }
        Ok(JitterShape::Table(entries.into()))
    }

    /// The deviation, in units of the jitter, that a fraction `probability` of all delays stay
    /// below.
    pub fn quantile(&self, probability: f64) -> f64 {
        match self {
            JitterShape::Uniform => 2.0 * probability - 1.0,
            JitterShape::Normal => {
                let spread = f64::from(Self::NORMAL_SPREAD);
                normal_quantile(probability).clamp(-spread, spread)
            }
            JitterShape::Pareto => {
                // Below 1 by at least 2^-53, so the root is finite.
                let beyond = (1.0 - probability).max(f64::EPSILON / 2.0);
                (1.0 / libm::cbrt(beyond) - 1.5) * PARETO_SCALE
            }
            JitterShape::Table(entries) => {
                let at = probability.clamp(0.0, 1.0) * (entries.len() - 1) as f64;
                let below = (at as usize).min(entries.len() - 2);
                let part = at - below as f64;
                entries[below] + part * (entries[below + 1] - entries[below])
            }
        }
    }

    /// The least deviation, in units of the jitter.
    pub fn least(&self) -> f64 {
        match self {
            JitterShape::Uniform => -1.0,
            JitterShape::Normal => -f64::from(Self::NORMAL_SPREAD),
            JitterShape::Pareto | JitterShape::Table(_) => self.quantile(0.0),
        }
    }

    /// A deviation drawn at `key`. The uniform and normal shapes draw as they always have: the
    /// numbers are part of every run's identity.
    pub(super) fn draw(&self, key: RandomKey) -> f64 {
        match self {
            JitterShape::Normal => {
                let spread = f64::from(Self::NORMAL_SPREAD);
                key.stream().normal(0.0, 1.0).clamp(-spread, spread)
            }
            _ => self.quantile(key.uniform()),
        }
    }

    /// The deviation that belongs to a standard normal `z`: what maps a Gaussian process to this
    /// marginal.
    pub(super) fn of_normal(&self, z: f64) -> f64 {
        match self {
            JitterShape::Normal => {
                let spread = f64::from(Self::NORMAL_SPREAD);
                z.clamp(-spread, spread)
            }
            _ => self.quantile(normal_cdf(z)),
        }
    }
}

/// A latency with `deviation` jitters added; never negative.
pub(super) fn shifted(latency: SimDuration, jitter: SimDuration, deviation: f64) -> SimDuration {
    let offset = deviation * jitter.as_nanos() as f64;
    let size = SimDuration::from_nanos(offset.abs() as u64);
    if offset < 0.0 {
        latency - size
    } else {
        latency + size
    }
}

/// The next state of a Gaussian AR(1) process of unit variance:
/// `z' = rho z + sqrt(1 - rho^2) e`. netem adds `rho` times the last draw to `1 - rho` times the
/// next instead, which shrinks the variance to `(1 - rho)/(1 + rho)` of what was asked for.
pub(super) fn next_normal(last: Option<f64>, correlation: f64, fresh: f64) -> f64 {
    match last {
        Some(last) => correlation * last + libm::sqrt(1.0 - correlation * correlation) * fresh,
        None => fresh,
    }
}

/// The standard normal distribution.
fn normal_cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2)
}

/// Its inverse, by bisection: only tests and plots ask, so it is short rather than fast.
fn normal_quantile(probability: f64) -> f64 {
    let (mut low, mut high) = (-9.0, 9.0);
    for _ in 0..64 {
        let middle = 0.5 * (low + high);
        if normal_cdf(middle) < probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

impl Serialize for JitterShape {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            JitterShape::Uniform => to.serialize_str(NAMES[0]),
            JitterShape::Normal => to.serialize_str(NAMES[1]),
            JitterShape::Pareto => to.serialize_str(NAMES[2]),
            JitterShape::Table(entries) => {
                let mut map = to.serialize_map(Some(1))?;
                map.serialize_entry("table", &entries[..])?;
                map.end()
            }
        }
    }
}

impl<'de> Deserialize<'de> for JitterShape {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Shape;

        impl<'de> Visitor<'de> for Shape {
            type Value = JitterShape;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("\"uniform\", \"normal\", \"pareto\" or { table = [...] }")
            }

            fn visit_str<E: Error>(self, name: &str) -> Result<JitterShape, E> {
                match name {
                    "uniform" => Ok(JitterShape::Uniform),
                    "normal" => Ok(JitterShape::Normal),
                    "pareto" => Ok(JitterShape::Pareto),
                    _ => Err(E::unknown_variant(name, &NAMES)),
                }
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<JitterShape, A::Error> {
                #[derive(Deserialize)]
                #[serde(rename_all = "snake_case")]
                enum Key {
                    Table,
                }
                let Some(Key::Table) = map.next_key()? else {
                    return Err(A::Error::missing_field("table"));
                };
                let entries: Vec<f64> = map.next_value()?;
                if map.next_key::<Key>()?.is_some() {
                    return Err(A::Error::duplicate_field("table"));
                }
                JitterShape::table(&entries).map_err(A::Error::custom)
            }
        }

        from.deserialize_any(Shape)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moments(shape: &JitterShape, n: u32) -> (f64, f64) {
        let at = |i: u32| shape.quantile((f64::from(i) + 0.5) / f64::from(n));
        let mean = (0..n).map(at).sum::<f64>() / f64::from(n);
        let square = (0..n).map(at).map(|x| x * x).sum::<f64>() / f64::from(n);
        (mean, square - mean * mean)
    }

    #[test]
    fn shapes_have_the_moments_they_state() {
        let (mean, variance) = moments(&JitterShape::Uniform, 10_000);
        assert!(mean.abs() < 1e-9 && (variance - 1.0 / 3.0).abs() < 1e-4);
        let (mean, variance) = moments(&JitterShape::Normal, 10_000);
        // Cutting at three standard deviations takes 0.5 % of the variance.
        assert!(
            mean.abs() < 1e-9 && (variance - 0.995).abs() < 0.002,
            "{variance}"
        );
        let (mean, variance) = moments(&JitterShape::Pareto, 1_000_000);
        // The tail holds much of the variance, and a grid misses its end.
        assert!(
            mean.abs() < 1e-3 && (variance - 1.0).abs() < 0.05,
            "{mean} {variance}"
        );
    }

    #[test]
    fn the_pareto_tail_is_the_cube_it_states() {
        // P(X > x) = x^-3, so x = 2 is the quantile of 7/8.
        let expected = (2.0 - 1.5) * 2.0 / libm::sqrt(3.0);
        assert!((JitterShape::Pareto.quantile(0.875) - expected).abs() < 1e-12);
        assert!((JitterShape::Pareto.least() + 1.0 / libm::sqrt(3.0)).abs() < 1e-12);
        assert!(JitterShape::Pareto.quantile(1.0).is_finite());
    }

    #[test]
    fn an_autoregressive_chain_keeps_its_variance() {
        let mut stream = RandomKey::new(3).stream();
        let (mut last, mut square, mut lagged) = (None, 0.0, 0.0);
        let n = 100_000;
        for _ in 0..n {
            let z = next_normal(last, 0.8, stream.normal(0.0, 1.0));
            square += z * z;
            lagged += last.unwrap_or(0.0) * z;
            last = Some(z);
        }
        let n = f64::from(n);
        assert!((square / n - 1.0).abs() < 0.03, "{}", square / n);
        assert!((lagged / n - 0.8).abs() < 0.03, "{}", lagged / n);
    }
}
