//! Loss in bursts: a channel that is good or bad, and changes in time.
//!
//! The chain runs in slots of time, not in messages, so that it neither freezes while nobody sends
//! nor hurries when everybody does. Slot `n` has one uniform draw `u(n)`, addressed by (run seed,
//! link, slot), which maps each state to the next. To know the state at `n`, one walks back from
//! `n` until the maps passed leave only one answer, whatever came before (coupling from the past,
//! Propp and Wilson 1996). So the state is a pure function of (run seed, link, slot): it is
//! stationary from the first instant, needs no history, and every message of a slot meets the same.

use farside::{SimDuration, SimTime};
use serde::{Deserialize, Serialize};

use crate::units;

/// Loss in bursts: what a scenario says of it.
///
/// A Gilbert-Elliott channel is good or bad. In each slot it turns bad with probability `p` and
/// good again with `r`; a message is lost with `bad_loss` (netem's `1-h`) in a bad slot and with
/// `good_loss` (`1-k`) in a good one. The mean loss is `(r good_loss + p bad_loss) / (p + r)`, the
/// mean burst `slot / r`.
///
/// | written as | means | defaults |
/// |---|---|---|
/// | `{ loss, length }` | mean loss, and mean burst as a duration | `slot`: a tenth of `length` |
/// | `{ loss, messages, interval }` | mean burst in messages, each `interval` | `slot`: that |
/// | `{ p, r, bad_loss, good_loss }` | the chain itself | `1 - p`, 1 and 0 for the last three |
/// | `{ p13, p31, p32, p23, p14 }` | netem's four states | `p31 = 1 - p13`, `p23 = 1`, else 0 |
///
/// The first two stand for `r = slot / length` and `p = r loss / (1 - loss)`. Of the last two,
/// `slot` is 10 ms unless given; `1-h` and `1-k` are other names of `bad_loss` and `good_loss`. The
/// four states are good (1), good within a burst (2), lost within a burst (3), lost by itself (4).
///
/// Of two mean losses with one burst length the higher loses the same messages and more, as long
/// as `p <= 1 - r`; the first two forms refuse anything else.
///
/// Source: Gilbert 1960, Elliott 1963; the parameters of tc-netem(8), `loss gemodel` and
/// `loss state`, where the chain runs in packets.
///
/// ```
/// use farside_actors::link::Burst;
/// let burst: Burst = toml::from_str("loss = 0.1\nlength = '40ms'")?;
/// assert!((burst.mean_loss() - 0.1).abs() < 1e-12);
/// assert!(toml::from_str::<Burst>("loss = 0.1").is_err());
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub struct Burst {
    written: Written,
    chain: Chain,
}

impl From<Burst> for Written {
    fn from(burst: Burst) -> Self {
        burst.written
    }
}

/// The keys of a burst, as they stand in the scenario.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Written {
    #[serde(
        with = "units::fraction::option",
        skip_serializing_if = "Option::is_none"
    )]
    loss: Option<f64>,
    #[serde(
        with = "units::duration::option",
        skip_serializing_if = "Option::is_none"
    )]
    length: Option<SimDuration>,
    #[serde(skip_serializing_if = "Option::is_none")]
    messages: Option<f64>,
    #[serde(
        with = "units::duration::option",
        skip_serializing_if = "Option::is_none"
    )]
    interval: Option<SimDuration>,
    #[serde(
        with = "units::fraction::option",
        skip_serializing_if = "Option::is_none"
    )]
    p: Option<f64>,
    #[serde(
        with = "units::fraction::option",
        skip_serializing_if = "Option::is_none"
    )]
    r: Option<f64>,
    #[serde(
        alias = "1-h",
        with = "units::fraction::option",
        skip_serializing_if = "Option::is_none"
    )]
    bad_loss: Option<f64>,
    #[serde(
        alias = "1-k",
        with = "units::fraction::option",
        skip_serializing_if = "Option::is_none"
    )]
    good_loss: Option<f64>,
    #[serde(
        with = "units::fraction::option",
        skip_serializing_if = "Option::is_none"
    )]
    p13: Option<f64>,
    #[serde(
        with = "units::fraction::option",
        skip_serializing_if = "Option::is_none"
    )]
    p31: Option<f64>,
    #[serde(
        with = "units::fraction::option",
        skip_serializing_if = "Option::is_none"
    )]
    p32: Option<f64>,
    #[serde(
        with = "units::fraction::option",
        skip_serializing_if = "Option::is_none"
    )]
    p23: Option<f64>,
    #[serde(
        with = "units::fraction::option",
        skip_serializing_if = "Option::is_none"
    )]
    p14: Option<f64>,
    #[serde(
        with = "units::duration::option",
        skip_serializing_if = "Option::is_none"
    )]
    slot: Option<SimDuration>,
}

/// The slot of a chain that is given by its probabilities.
const DEFAULT_SLOT: SimDuration = SimDuration::from_millis(10);

/// How many slots the mean burst has where its length is given.
const SLOTS_PER_BURST: u64 = 10;

/// No slower chains: one would walk back for ever.
const LEAST_PROBABILITY: f64 = 1e-6;

/// The most slots one walks back. Chains that would need more are refused, so that none does.
const MAX_WALK: u64 = 1 << 24;

impl TryFrom<Written> for Burst {
    type Error = String;

    fn try_from(written: Written) -> Result<Self, String> {
        let chain = written.chain()?;
        Ok(Burst { written, chain })
    }
}

impl Written {
    fn chain(&self) -> Result<Chain, String> {
        let by_mean = self.loss.is_some();
        let by_chain = [self.p, self.r, self.bad_loss, self.good_loss];
        let by_states = [self.p13, self.p31, self.p32, self.p23, self.p14];
        let by_chain = by_chain.iter().any(Option::is_some);
        let by_states = by_states.iter().any(Option::is_some);
        let lengths = self.length.is_some() || self.messages.is_some() || self.interval.is_some();
        let chain = match (by_mean, by_chain, by_states) {
            (true, false, false) => self.by_mean()?,
            (false, true, false) if !lengths => self.by_chain()?,
            (false, false, true) if !lengths => self.by_states()?,
            _ => {
                return Err(
                    "expected { loss, length }, { loss, messages, interval }, { p, r, bad_loss, \
                     good_loss } or { p13, p31, p32, p23, p14 }"
                        .to_owned(),
                );
            }
        };
        if chain.slot.is_zero() {
            return Err("slot = 0s: expected more than that".to_owned());
        }
        Ok(chain)
    }

    fn by_mean(&self) -> Result<Chain, String> {
        let loss = self.loss.unwrap_or(0.0);
        let (length_ns, slot) = match (self.length, self.messages, self.interval) {
            (Some(length), None, None) => {
                let slot = SimDuration::from_nanos((length.as_nanos() / SLOTS_PER_BURST).max(1));
                (length.as_nanos() as f64, slot)
            }
            (None, Some(messages), Some(interval)) if messages.is_finite() => {
                (messages * interval.as_nanos() as f64, interval)
            }
            _ => {
                return Err(
                    "expected the mean length of a burst beside its mean loss: length = \"40ms\", \
                     or messages = 4 and interval = \"10ms\""
                        .to_owned(),
                );
            }
        };
        let slot = self.slot.unwrap_or(slot);
        let r = slot.as_nanos() as f64 / length_ns;
        if !(LEAST_PROBABILITY..=1.0).contains(&r) {
            return Err(format!(
                "a mean burst of {} in slots of {slot}: expected from 1 to 1000000 slots",
                SimDuration::from_nanos(length_ns as u64)
            ));
        }
        // Some slack, for 0.9 and 0.1 do not add up to 1 exactly.
        if loss + r > 1.0 + 1e-9 {
            return Err(format!(
                "a mean loss of {loss} with bursts of {:.1} slots: expected at most {:.3}, or \
                 shorter slots",
                1.0 / r,
                1.0 - r
            ));
        }
        let p = (r * loss / (1.0 - loss)).min(1.0 - r);
        let p = if loss == 0.0 { 0.0 } else { p };
        Ok(Chain {
            slot,
            kind: ChainKind::Two { p, r },
            loss: [0.0, 1.0, 0.0, 0.0],
        })
    }

    fn by_chain(&self) -> Result<Chain, String> {
        let p = self.p.ok_or("expected p, the probability to turn bad")?;
        let r = self.r.unwrap_or(1.0 - p);
        let settles = p.min(1.0 - r) + 1.0 - p.max(1.0 - r);
        if settles < LEAST_PROBABILITY {
            return Err(format!(
                "p = {p} and r = {r}: expected a channel that changes by chance: one of them from \
                 {LEAST_PROBABILITY} on, and not both 1"
            ));
        }
        Ok(Chain {
            slot: self.slot.unwrap_or(DEFAULT_SLOT),
            kind: ChainKind::Two { p, r },
            loss: [
                self.good_loss.unwrap_or(0.0),
                self.bad_loss.unwrap_or(1.0),
                0.0,
                0.0,
            ],
        })
    }

    fn by_states(&self) -> Result<Chain, String> {
        let p13 = self.p13.ok_or("expected p13, the probability of a burst")?;
        let p31 = self.p31.unwrap_or(1.0 - p13);
        let (p32, p14) = (self.p32.unwrap_or(0.0), self.p14.unwrap_or(0.0));
        let p23 = self.p23.unwrap_or(1.0);
        if p13 + p14 > 1.0 || p31 + p32 > 1.0 {
            return Err("p13 + p14 and p31 + p32: expected at most 1 each".to_owned());
        }
        let chain = Chain {
            slot: self.slot.unwrap_or(DEFAULT_SLOT),
            kind: ChainKind::Four {
                p13,
                p31,
                p32,
                p23,
                p14,
            },
            loss: [0.0, 0.0, 1.0, 1.0],
        };
        // Whether and how soon the states come together shows best by trying.
        let mut stream = farside::random::RandomKey::new(0).stream();
        let mut maps = IDENTITY;
        for _ in 0..(1.0 / LEAST_PROBABILITY) as u64 {
            maps = composed(maps, chain.map(stream.uniform()));
            if settled(maps).is_some() {
                return Ok(chain);
            }
        }
        Err("expected a channel that leaves every state it can be in".to_owned())
    }
}

impl Burst {
    /// The mean loss, by the closed form.
    ///
    /// With two states it is `(r good_loss + p bad_loss) / (p + r)`; with four, the share of time
    /// in states 3 and 4 by the balance of flows.
    pub fn mean_loss(&self) -> f64 {
        match self.chain.kind {
            ChainKind::Two { p, r } => (r * self.chain.loss[0] + p * self.chain.loss[1]) / (p + r),
            ChainKind::Four {
                p13,
                p31,
                p32,
                p23,
                p14,
            } => {
                // In balance p13 x1 = p31 x3, p32 x3 = p23 x2 and x4 = p14 x1; here x1 = p31.
                let x2 = if p32 == 0.0 { 0.0 } else { p32 * p13 / p23 };
                let lost = p13 + p14 * p31;
                lost / (p31 + x2 + lost)
            }
        }
    }

    /// The length of a slot.
    pub fn slot(&self) -> SimDuration {
        self.chain.slot
    }

    pub(super) fn chain(&self) -> &Chain {
        &self.chain
    }
}

/// A chain of up to four states, numbered from 0: good and bad, or netem's four.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chain {
    slot: SimDuration,
    kind: ChainKind,
    /// What a message is lost with, by state.
    loss: [f64; 4],
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum ChainKind {
    Two {
        p: f64,
        r: f64,
    },
    Four {
        p13: f64,
        p31: f64,
        p32: f64,
        p23: f64,
        p14: f64,
    },
}

/// Where each state goes.
type Map = [u8; 4];

const IDENTITY: Map = [0, 1, 2, 3];

/// First `earlier`, then `later`.
fn composed(later: Map, earlier: Map) -> Map {
    earlier.map(|state| later[usize::from(state)])
}

/// The only state a map leads to, if there is one.
fn settled(map: Map) -> Option<u8> {
    map.iter().all(|state| *state == map[0]).then_some(map[0])
}

/// The last state found: walks stop there.
#[derive(Clone, Copy, Debug)]
pub(super) struct KnownState {
    slot: i64,
    state: u8,
}

impl Chain {
    /// What a slot's draw makes of each state. The lossy states lie below, so that a draw that is
    /// bad for one chain is bad for every worse one.
    fn map(&self, u: f64) -> Map {
        match self.kind {
            ChainKind::Two { p, r } => {
                let (good, bad) = (u8::from(u < p), u8::from(u < 1.0 - r));
                [good, bad, good, bad]
            }
            ChainKind::Four {
                p13,
                p31,
                p32,
                p23,
                p14,
            } => {
                let one = match u {
                    u if u < p13 => 2,
                    u if u < p13 + p14 => 3,
                    _ => 0,
                };
                let two = if u < p23 { 2 } else { 1 };
                let three = match u {
                    u if u < 1.0 - p31 - p32 => 2,
                    u if u < 1.0 - p31 => 1,
                    _ => 0,
                };
                [one, two, three, 0]
            }
        }
    }

    /// The probability that a message sent at `at` is lost. `draw` gives a slot's uniform draw.
    pub(super) fn loss_at(
        &self,
        at: SimTime,
        known: &mut Option<KnownState>,
        draw: impl Fn(u64) -> f64,
    ) -> f64 {
        let slot = (at.as_nanos() / self.slot.as_nanos()) as i64;
        let state = self.state_at(slot, *known, draw);
        *known = Some(KnownState { slot, state });
        self.loss[usize::from(state)]
    }

    fn state_at(&self, slot: i64, known: Option<KnownState>, draw: impl Fn(u64) -> f64) -> u8 {
        let mut maps = IDENTITY;
        let mut at = slot;
        for _ in 0..MAX_WALK {
            if let Some(known) = known.filter(|known| known.slot == at) {
                return maps[usize::from(known.state)];
            }
            // Slots before the start are as good as others: the channel was there before.
            maps = composed(maps, self.map(draw(at as u64)));
            if let Some(state) = settled(maps) {
                return state;
            }
            at = at.wrapping_sub(1);
        }
        maps[0]
    }
}

#[cfg(test)]
mod tests {
    use farside::random::RandomKey;

    use super::*;

    fn burst(text: &str) -> Burst {
        toml::from_str(text).unwrap()
    }

    /// The state of each of `n` slots.
    fn walk(burst: &Burst, seed: u64, n: i64) -> Vec<u8> {
        let draw = |slot: u64| RandomKey::new(seed).number(slot).uniform();
        let mut known = None;
        let each = |slot: i64| {
            let state = burst.chain.state_at(slot, known, draw);
            known = Some(KnownState { slot, state });
            state
        };
        (0..n).map(each).collect()
    }

    /// The share of bad slots, and the mean length of a bad stretch.
    fn shape(states: &[u8]) -> (f64, f64) {
        let bad = states.iter().filter(|state| **state == 1).count() as f64;
        let ends = states
            .windows(2)
            .filter(|pair| pair[0] == 1 && pair[1] == 0);
        (bad / states.len() as f64, bad / ends.count() as f64)
    }

    #[test]
    fn the_share_and_length_of_bursts_meet_their_closed_forms() {
        let (share, length) = shape(&walk(&burst("loss = 0.2\nlength = '100ms'"), 1, 200_000));
        assert!((share - 0.2).abs() < 0.01, "{share}");
        assert!((length - 10.0).abs() < 0.5, "{length}");
        let (share, length) = shape(&walk(&burst("p = 0.05\nr = 0.25"), 2, 200_000));
        assert!((share - 1.0 / 6.0).abs() < 0.01, "{share}");
        assert!((length - 4.0).abs() < 0.15, "{length}");
        let text = "loss = 0.3\nmessages = 3\ninterval = '100ms'";
        let (share, length) = shape(&walk(&burst(text), 3, 200_000));
        assert!((share - 0.3).abs() < 0.01 && (length - 3.0).abs() < 0.1);
        assert_eq!(burst(text).slot(), SimDuration::from_millis(100));
    }

    #[test]
    fn four_states_meet_their_balance() {
        let burst = burst("p13 = 0.02\np31 = 0.1\np32 = 0.3\np23 = 0.4\np14 = 0.01");
        let states = walk(&burst, 4, 400_000);
        let lost = states.iter().filter(|state| **state >= 2).count() as f64;
        let share = lost / states.len() as f64;
        assert!((share - burst.mean_loss()).abs() < 0.01, "{share}");
    }

    #[test]
    fn a_state_needs_no_history() {
        for text in [
            "p = 0.05\nr = 0.25",
            "p = 0.9\nr = 0.8",
            "p13 = 0.1\np31 = 0.2\np32 = 0.2",
        ] {
            let burst = burst(text);
            let draw = |slot: u64| RandomKey::new(5).number(slot).uniform();
            let cached = walk(&burst, 5, 2_000);
            for (slot, state) in cached.iter().enumerate() {
                assert_eq!(
                    burst.chain.state_at(slot as i64, None, draw),
                    *state,
                    "{text}"
                );
            }
        }
    }

    #[test]
    fn it_is_as_bad_at_the_start_as_later() {
        let burst = burst("loss = 0.3\nlength = '1s'");
        let first = |seed| walk(&burst, seed, 1)[0];
        let bad = (0..10_000).filter(|seed| first(*seed) == 1).count();
        assert!((2_850..3_150).contains(&bad), "{bad}");
    }

    #[test]
    fn a_higher_mean_loss_is_bad_in_the_same_slots_and_more() {
        let at = |loss: f64| {
            walk(
                &burst(&format!("loss = {loss}\nlength = '50ms'")),
                6,
                20_000,
            )
        };
        for pair in [0.0, 0.01, 0.1, 0.4, 0.8, 0.9].windows(2) {
            let both = at(pair[0]).into_iter().zip(at(pair[1]));
            assert!(both.into_iter().all(|(low, high)| low <= high));
        }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        for (text, part) in [
            ("loss = 0.95\nlength = '40ms'", "expected at most 0.900"),
            ("loss = 0.1", "expected the mean length"),
            ("loss = 0.1\np = 0.1", "expected { loss, length }"),
            ("p = 1\nr = 1", "changes by chance"),
            ("p = 0\nr = 0", "changes by chance"),
            ("p13 = 0.9\np14 = 0.9", "at most 1 each"),
            ("p13 = 0\np31 = 0", "leaves every state"),
            ("loss = 0.1\nlength = '1ns'\nslot = '1h'", "slots"),
            ("p = 0.1\nslot = '0s'", "more than that"),
            ("", "expected { loss, length }"),
        ] {
            let error = toml::from_str::<Burst>(text).unwrap_err().to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    #[test]
    fn it_prints_back_to_itself() {
        for text in [
            "loss = 0.1\nlength = '40ms'",
            "p = 0.1\n1-h = '90%'",
            "p13 = 0.1\np31 = 0.5",
        ] {
            let once = burst(text);
            assert_eq!(burst(&toml::to_string(&once).unwrap()), once);
        }
    }
}
