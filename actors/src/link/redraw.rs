//! What a link drew for a message, drawn once more from the run's seed: for who asks why a message was lost.

use farside::SimTime;
use farside::carrier::{Carriage, DrawsOf};

use super::stage::Purpose;
use super::timeline::Timeline;
use super::{BURST, CORRUPT, LOSS, LinkParams, packet_error_rate};

/// A message as a log has it.
#[derive(Clone, Copy, Debug)]
pub struct Transmitted<'a> {
    /// Who it is, on which link, in a run with which seed.
    pub draws: DrawsOf<'a>,
    /// When it was sent.
    pub sent: SimTime,
    /// How the link says that it carried it.
    pub carriage: Option<Carriage>,
    /// The size of the encoded message in bytes.
    pub bytes: u64,
}

/// A draw, and below what it loses a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drawn {
    /// The number that was drawn, from 0 to 1.
    pub drew: f64,
    /// The probability of the loss: the message is lost if `drew` is below.
    pub lost_below: f64,
    /// Which transmission it was, from 1.
    pub attempt: u32,
}

impl Drawn {
    /// Whether the message was lost by it.
    pub fn is_lost(&self) -> bool {
        self.drew < self.lost_below
    }
}

impl Timeline {
    /// What was drawn of a message that a link with these parameters carried, for the question that loses it for
    /// this reason: by its last transmission.
    ///
    /// ```
    /// use farside::SimTime;
    /// use farside::carrier::DrawsOf;
    /// use farside_actors::link::{LinkParams, Timeline, Transmitted};
    /// let timeline = Timeline::new(LinkParams { loss: 0.3, ..LinkParams::default() });
    /// let message = "a,b,Grant,12".parse().unwrap();
    /// let of = Transmitted {
    ///     draws: DrawsOf { seed: 7, link: "a-b", message: &message },
    ///     sent: SimTime::ZERO,
    ///     carriage: None,
    ///     bytes: 10,
    /// };
    /// let drawn = timeline.redrawn("loss", &of).unwrap();
    /// assert_eq!((drawn.lost_below, drawn.is_lost()), (0.3, drawn.drew < 0.3));
    /// assert!(timeline.redrawn("outage", &of).is_err());
    /// ```
    ///
    /// # Errors
    /// Why that cannot be known.
    pub fn redrawn(&self, reason: &str, of: &Transmitted<'_>) -> Result<Drawn, &'static str> {
        let carriage = of.carriage.unwrap_or(Carriage {
            attempts: 1,
            ..Carriage::default()
        });
        let start = of.sent + carriage.queue + carriage.retries;
        let params = self.at(start);
        if params.radio.is_some() {
            return Err(
                "a radio sends when it finds the channel free, and the log does not say when that was",
            );
        }
        if self.is_followed() {
            return Err(
                "it is followed through windows, answers or fragments, each with draws of its own",
            );
        }
        let closes = |params: &LinkParams| params.outage || params.contacts.is_some();
        if params.retries > 0 && self.iter().any(|(_, params)| closes(params)) {
            return Err("transmissions that met a closed link are not counted in the log");
        }
        let attempt = carriage.attempts.checked_sub(1);
        let attempt = attempt.ok_or("it was never on the air")?;
        let drew = |purpose: Purpose| of.draws.random(purpose as u64, attempt).uniform();
        let (drew, lost_below) = match reason {
            LOSS => (drew(Purpose::Loss), params.loss),
            BURST => (drew(Purpose::Burst), self.burst_loss(start, of)),
            CORRUPT => corrupted(params, of.bytes, drew),
            _ => return Err("nothing is drawn for that"),
        };
        Ok(Drawn {
            drew,
            lost_below,
            attempt: attempt + 1,
        })
    }

    /// What a burst loses with at this instant.
    fn burst_loss(&self, at: SimTime, of: &Transmitted<'_>) -> f64 {
        let slot = |slot| {
            let key = of.draws.random_at(Purpose::BurstSlot as u64, slot);
            key.uniform()
        };
        let burst = self.at(at).burst.as_ref();
        burst.map_or(0.0, |burst| burst.chain().loss_at(at, &mut None, slot))
    }
}

/// Of the two draws that make a message corrupt the one that did, or the nearer one.
fn corrupted(params: &LinkParams, bytes: u64, drew: impl Fn(Purpose) -> f64) -> (f64, f64) {
    let wrong = match params.ber {
        0.0 => 0.0,
        ber => packet_error_rate(ber, bytes.saturating_add(params.overhead)),
    };
    let by_message = (drew(Purpose::Corrupt), params.corrupt);
    let by_bit = (drew(Purpose::BitErrors), wrong);
    match by_message.0 < by_message.1 || wrong == 0.0 {
        true => by_message,
        false => by_bit,
    }
}
