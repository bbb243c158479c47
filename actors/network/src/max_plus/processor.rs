//! How fast a sensor node computes.

use std::fmt;
use std::str::FromStr;

use farside::SimDuration;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use farside_actors::units::{UnitError, parse_rate, print_rate};

/// The speed of a node's processor, in pairs of candidate paths that it looks at in a second of
/// virtual time. A pair is looked at once when its payoff is made (section 3.4 of the paper: do
/// the paths collide?), and once for each max-plus vector that it has part in, in each iteration.
///
/// Work is counted, never measured: what a run computes does not depend on the machine that it runs
/// on, and short cuts that this program takes do not count.
///
/// ```
/// use farside::SimDuration;
/// use farside_network::Processor;
/// let processor: Processor = "2M/s".parse()?;
/// assert_eq!(processor, Processor::PairsPerS(2_000_000));
/// assert_eq!(processor.time_for(3), SimDuration::from_nanos(1500));
/// assert!("unlimited".parse::<Processor>()?.time_for(3).is_zero());
/// assert!("2 cores".parse::<Processor>().is_err());
/// # Ok::<(), farside_actors::units::UnitError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Processor {
    /// Whatever is to be computed takes no time.
    #[default]
    Unlimited,
    /// Pairs of candidate paths in a second.
    PairsPerS(u64),
}

impl Processor {
    /// The speed at which the paper's Table 1 comes out well; `"paper"` in a scenario. Fitted to it by
    /// eye, on the dense roadmap with perfect links and few seeds: at 300k/s it fits less well, at
    /// 500k/s about as well, and at 800k/s nothing deadlocks at 28 nodes. The paper gave each node a core of 2.6 GHz and does not say what its program did with it.
    pub const PAPER: Processor = Processor::PairsPerS(400_000);

    /// How many pairs it can look at in `time`; none if it can look at any number.
    pub fn pairs_in(self, time: SimDuration) -> Option<u64> {
        let Processor::PairsPerS(speed) = self else {
            return None;
        };
        let pairs = u128::from(time.as_nanos()) * u128::from(speed.max(1)) / 1_000_000_000;
        Some(u64::try_from(pairs).unwrap_or(u64::MAX))
    }

    /// How long `pairs` take, rounded up to nanoseconds. A speed of 0 counts as 1.
    pub fn time_for(self, pairs: u64) -> SimDuration {
        match self {
            Processor::Unlimited => SimDuration::ZERO,
            Processor::PairsPerS(speed) => {
                let ns = (u128::from(pairs) * 1_000_000_000).div_ceil(u128::from(speed.max(1)));
                // A century will do for what never ends.
                SimDuration::from_nanos(u64::try_from(ns).unwrap_or(u64::MAX).min(1 << 61))
            }
        }
    }
}

impl FromStr for Processor {
    type Err = UnitError;

    fn from_str(text: &str) -> Result<Self, UnitError> {
        match text.trim() {
            "unlimited" => Ok(Processor::Unlimited),
            "paper" => Ok(Processor::PAPER),
            rate => parse_rate(rate).map(Processor::PairsPerS),
        }
    }
}

impl fmt::Display for Processor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Processor::Unlimited => f.write_str("unlimited"),
            Processor::PairsPerS(speed) => f.write_str(&print_rate(*speed)),
        }
    }
}

impl Serialize for Processor {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Processor {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let text = String::deserialize(from)?;
        text.parse().map_err(D::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_longest_time_is_a_time() {
        let slow = Processor::PairsPerS(1).time_for(u64::MAX);
        assert_eq!(slow.as_nanos(), 1 << 61);
        assert_eq!(
            Processor::PairsPerS(0).time_for(2),
            SimDuration::from_secs(2)
        );
    }

    proptest! {
        #[test]
        fn time_grows_with_work_and_is_never_too_short(
            speed in 1..u64::from(u32::MAX), pairs in 0..u64::from(u32::MAX),
        ) {
            let processor = Processor::PairsPerS(speed);
            let time = processor.time_for(pairs);
            let done = u128::from(time.as_nanos()) * u128::from(speed);
            let asked = u128::from(pairs) * 1_000_000_000;
            prop_assert!(done >= asked && done < asked + u128::from(speed));
            prop_assert!(processor.time_for(pairs + 1) >= time);
            prop_assert!(processor.pairs_in(time).unwrap() >= pairs);
            if pairs > 0 {
                let less = SimDuration::from_nanos(time.as_nanos() - 1);
                prop_assert!(processor.pairs_in(less).unwrap() < pairs);
            }
        }

        #[test]
        fn what_is_printed_parses_back(speed: u64) {
            let processor = Processor::PairsPerS(speed);
            prop_assert_eq!(processor.to_string().parse::<Processor>(), Ok(processor));
        }
    }
}
