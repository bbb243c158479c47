//! Acknowledgements: when they are back, and whether they get there.
//!
//! The link back is another host's, so that answers do not wait for its messages, nor those for
//! answers; they wait for each other. What it is like at each instant is known from its timeline.

use std::sync::Arc;

use farside::carrier::Parcel;
use farside::{SimDuration, SimTime};

use super::super::burst::KnownState;
use super::super::stage::{Draws, Purpose};
use super::super::transmit::{Attempt, Transmitter};
use super::super::{LinkParams, Timeline, packet_error_rate, transmission_time};

/// The receiver's side of the way back.
#[derive(Clone, Debug, Default)]
pub(super) struct Acks {
    /// What the link back has; none if it is as this one.
    back: Option<Arc<Timeline>>,
    /// When the last answer has left.
    free: SimTime,
    /// Where the walk through the burst chain may stop, and for which span that holds.
    known: Option<(usize, KnownState)>,
}

/// What becomes of the answer to a transmission.
#[derive(Clone, Copy, Debug)]
pub(super) struct Answer {
    /// When the sender has it, if it ever does.
    pub(super) at: Option<SimTime>,
    /// When the sender stops waiting for it.
    pub(super) given_up: SimTime,
    /// How long anything is on its way to the receiver.
    pub(super) way: SimDuration,
    /// What it takes from the sender, who receives it \[J\].
    pub(super) energy_j: f64,
    /// What it takes from the receiver, who sends it \[J\].
    pub(super) receive_j: f64,
}

impl Acks {
    pub(super) fn new(back: Option<Arc<Timeline>>) -> Self {
        Acks {
            back,
            ..Acks::default()
        }
    }

    /// The answer to a transmission.
    pub(super) fn answer(
        &mut self,
        tx: &Transmitter,
        parcel: &Parcel<'_>,
        draws: Draws,
        attempt: &Attempt,
    ) -> Answer {
        let own = tx.timeline().at(attempt.start);
        let back = self.back.clone();
        let back = back.as_deref().unwrap_or_else(|| tx.timeline());
        let leaves = attempt.at.max(self.free);
        let airtime = airtime(own, back, leaves);
        let timer = attempt.start + own.timeout.unwrap_or_default();
        let mut answer = Answer {
            at: None,
            given_up: timer.max(attempt.answered() + airtime),
            way: attempt.way(),
            energy_j: 0.0,
            receive_j: 0.0,
        };
        if attempt.failed.is_some() {
            return answer;
        }
        let back_power = back.at(leaves);
        let air_s = airtime.as_secs_f64();
        if own.ack_loss.is_none() && back.closed(leaves).is_some() {
            return answer;
        }
        answer.receive_j = back_power.tx_power_w * air_s;
        self.free = leaves + airtime;
        if self.is_lost(own, back, (parcel, draws), leaves) {
            return answer;
        }
        answer.energy_j = back_power.rx_power_w * air_s;
        answer.at = Some(self.free + attempt.way());
        answer
    }

    /// Whether an answer that leaves now is lost.
    fn is_lost(
        &mut self,
        own: &LinkParams,
        back: &Timeline,
        (parcel, draws): (&Parcel<'_>, Draws),
        leaves: SimTime,
    ) -> bool {
        if let Some(loss) = own.ack_loss {
            return draws.happens(parcel, Purpose::Ack, loss);
        }
        let index = back.index(leaves);
        let params = &back.spans[index].params;
        let cut = back.cut(leaves, leaves + airtime(own, back, leaves));
        if cut.is_some() || draws.happens(parcel, Purpose::Ack, params.loss) {
            return true;
        }
        if let Some(burst) = &params.burst {
            let known = self.known.filter(|(span, _)| *span == index);
            let mut known = known.map(|(_, known)| known);
            let slot = |slot| {
                parcel
                    .random_at(Purpose::AckBurstSlot as u64, slot)
                    .uniform()
            };
            let loss = burst.chain().loss_at(leaves, &mut known, slot);
            self.known = known.map(|known| (index, known));
            if draws.happens(parcel, Purpose::AckBurst, loss) {
                return true;
            }
        }
        let wrong = match params.ber {
            0.0 => params.corrupt,
            ber => packet_error_rate(ber, own.ack).max(params.corrupt),
        };
        draws.happens(parcel, Purpose::AckBitErrors, wrong)
    }
}

/// How long an answer is on the air if it leaves then.
fn airtime(own: &LinkParams, back: &Timeline, leaves: SimTime) -> SimDuration {
    let window = back.window(leaves).and_then(|window| window.rate);
    let rate = own.ack_rate.or(window).or(back.at(leaves).rate);
    rate.filter(|_| own.ack > 0)
        .map_or(SimDuration::ZERO, |rate| transmission_time(own.ack, rate))
}
