//! The draws of a link for a message, addressed once more after the run, by whoever asks what was drawn.

use crate::random::{RandomKey, name_hash};
use crate::ruling::{MessageId, MessageNumber};

/// Addresses what a link drew for a message, in the run with this seed: the same numbers as
/// [`Parcel::random`](super::Parcel::random) and [`Parcel::random_at`](super::Parcel::random_at) gave.
///
/// ```
/// use farside::carrier::DrawsOf;
/// let message = "node_03,rover_07,Grant,12".parse()?;
/// let draws = DrawsOf { seed: 1, link: "node_03-rover_07", message: &message };
/// let (first, again) = (draws.random(1, 0), draws.random(1, 1));
/// assert_ne!(first.uniform(), again.uniform());
/// # Ok::<(), farside::ruling::MessageIdError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct DrawsOf<'a> {
    /// The run's seed.
    pub seed: u64,
    /// The name of the link.
    pub link: &'a str,
    /// The message, and which copy of it. A message that has a key of its own is named by that.
    pub message: &'a MessageId,
}

impl DrawsOf<'_> {
    /// The address of a draw for this attempt of the copy.
    pub fn random(&self, purpose: u64, attempt: u32) -> RandomKey {
        let message = self.message;
        let (identity, turn) = identity(message.number);
        RandomKey::of([
            self.seed,
            identity,
            turn,
            name_hash(self.link),
            purpose,
            name_hash(&message.sender),
            name_hash(&message.receiver),
            name_hash(&message.kind),
            u64::from(attempt) << 32 | u64::from(message.copy),
        ])
    }

    /// The address of a draw of the link itself, whatever message asks.
    pub fn random_at(&self, purpose: u64, number: u64) -> RandomKey {
        at(self.seed, name_hash(self.link), purpose, number)
    }
}

/// What tells the message from others of its flow.
#[inline]
pub(super) fn identity(number: MessageNumber) -> (u64, u64) {
    match number {
        // Keeps a keyed message apart from an unkeyed one with an equal ordinal.
        MessageNumber::Key { key, repeat } => (key.bits(), u64::from(repeat) | 1 << 63),
        MessageNumber::Ordinal(ordinal) => (ordinal, 0),
    }
}

pub(super) fn at(seed: u64, link: u64, purpose: u64, number: u64) -> RandomKey {
    RandomKey::new(seed)
        .number(link)
        .number(purpose)
        .number(number)
}

#[cfg(test)]
mod tests {
    use serde::{Deserialize, Serialize};

    use crate::carrier::{Carrier, DrawsOf, NoChange, Parcel, Verdicts};
    use crate::prelude::*;
    use crate::ruling::MessageId;

    #[derive(Serialize, Deserialize)]
    struct Ping;

    struct Sink;
    impl Actor for Sink {
        type Accepts = (Ping,);
    }
    impl Handler<Ping> for Sink {
        fn handle(&mut self, _: Ping, _: &mut Context<'_, Self>) -> Outcome {
            Ok(())
        }
    }

    /// Sends some with a key, the same twice, and some without.
    struct Source(Address<Sink>);
    impl Actor for Source {
        type Accepts = ();
        fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
            for major in [3, 4, 4, 3] {
                ctx.send_keyed(self.0, MatchKey::new(major, 1), Ping);
            }
            ctx.send(self.0, Ping);
            Ok(())
        }
    }

    /// Compares what it draws with what is drawn again.
    struct Comparing(Vec<&'static str>);
    impl Carrier for Comparing {
        type Change = NoChange;

        fn min_delay(&self) -> SimDuration {
            SimDuration::from_millis(5)
        }

        fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
            let message: MessageId = self.0[parcel.ordinal() as usize].parse().unwrap();
            let again = DrawsOf {
                seed: 9,
                link: "a-b",
                message: &message,
            };
            for (purpose, attempt) in [(1, 0), (1, 2), (7, 0)] {
                let drew = parcel.random(purpose, attempt, 0).uniform();
                assert_eq!(again.random(purpose, attempt).uniform(), drew, "{message}");
            }
            let at = parcel.random_at(5, 17).uniform();
            assert_eq!(again.random_at(5, 17).uniform(), at);
            verdicts.deliver(SimDuration::from_millis(5));
        }

        fn change(&mut self, _: NoChange, _: SimTime) {}
    }

    #[test]
    fn keys_their_repeats_and_ordinals_have_the_same_draws_again() {
        let ids = [
            "source,sink,Ping,3.1",
            "source,sink,Ping,4.1",
            "source,sink,Ping,4.1x1",
            "source,sink,Ping,3.1",
            "source,sink,Ping,4",
        ];
        let mut sim = Simulation::new(9);
        let (a, b) = (sim.host("a"), sim.host("b"));
        let sink = sim.actor(b, "sink", |_| Sink);
        sim.actor(a, "source", move |_| Source(sink));
        sim.link(a, b, "a-b", Comparing(ids.to_vec()));
        let report = sim.run(Executor::Inline).unwrap();
        assert_eq!(
            (report.end.name(), report.counts.delivered),
            ("completed", 5)
        );
    }
}
