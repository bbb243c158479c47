//! What is drawn again from a log beside what the link drew.

use std::collections::BTreeMap;

use farside::carrier::{Carrier, DrawsOf, Parcel, Verdicts};
use farside::ruling::{MessageId, MessageNumber};

use super::*;
use crate::link::stage::Purpose;

/// What was drawn: by ordinal, copy, attempt and purpose.
type Seen = Arc<Mutex<BTreeMap<(u64, u32, u32, u64), f64>>>;

/// A link that notes the draws of all that it carries.
struct Noting {
    link: Link,
    seen: Seen,
}

impl Carrier for Noting {
    type Change = LinkChange;

    fn min_delay(&self) -> SimDuration {
        self.link.min_delay()
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        let mut seen = self.seen.lock().unwrap();
        for purpose in [
            Purpose::Loss,
            Purpose::Burst,
            Purpose::Corrupt,
            Purpose::BitErrors,
        ] {
            let purpose = purpose as u64;
            for (copy, attempt) in
                (0..2).flat_map(|copy| (0..4).map(move |attempt| (copy, attempt)))
            {
                let drew = parcel.random(purpose, attempt, copy).uniform();
                seen.insert((parcel.ordinal(), copy, attempt, purpose), drew);
            }
        }
        drop(seen);
        self.link.carry(parcel, verdicts);
    }

    fn change(&mut self, change: LinkChange, now: SimTime) {
        self.link.change(change, now);
    }
}

fn chance() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), 0.05..0.6f64]
}

fn params() -> impl Strategy<Value = LinkParams> {
    let burst = prop_oneof![
        Just(None),
        (0.05..0.5f64, 5..60u64).prop_map(|(loss, length)| {
            let text = format!("loss = {loss:?}\nlength = '{length}ms'");
            Some(toml::from_str(&text).unwrap())
        }),
        (0.05..0.9f64, 0.1..0.9f64).prop_map(|(p, bad)| {
            let text = format!("p = {p:?}\nr = 0.3\n1-h = {bad:?}\n1-k = 0.1");
            Some(toml::from_str(&text).unwrap())
        }),
    ];
    let rate = prop_oneof![Just(None), (20_000..400_000u64).prop_map(Some)];
    let chances = (
        chance(),
        chance(),
        chance(),
        prop_oneof![Just(0.0), Just(1e-3)],
    );
    (chances, burst, rate, 0..3u32).prop_map(
        |((loss, corrupt, duplicate, ber), burst, rate, retries)| LinkParams {
            loss,
            corrupt,
            duplicate,
            ber,
            burst,
            rate,
            retries,
            overhead: 7,
            ..LinkParams::default()
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// Whatever the parameters, and when they change: the number is the one that the link drew, below the
    /// probability if that is why the message was lost, and above it if the message arrived.
    #[test]
    fn what_is_drawn_again_is_what_was_drawn(
        seed in any::<u64>(),
        before in params(),
        after in params(),
        pad in 0..40usize,
    ) {
        let change = SimTime::ZERO + SimDuration::from_millis(300);
        let timeline = Timeline::new(before).then(change, after);
        let seen = Seen::default();
        let sends = each(SimDuration::from_millis(9), 60, pad);
        let fates = run(seed, &sends, &["b"], |sim, a, hosts| {
            let link = Noting { link: Link::new(timeline.clone()), seen: seen.clone() };
            sim.link(a, hosts[0], "a-b", link);
        });
        let seen = seen.lock().unwrap();
        for fate in &fates {
            let message = MessageId {
                sender: "source".to_owned(),
                receiver: "sink_b".to_owned(),
                kind: "Probe".to_owned(),
                number: MessageNumber::Ordinal(fate.ordinal),
                copy: fate.copy,
            };
            let of = Transmitted {
                draws: DrawsOf { seed, link: "a-b", message: &message },
                sent: fate.sent,
                carriage: fate.carriage,
                bytes: fate.bytes,
            };
            for (reason, purposes) in [
                (LOSS, &[Purpose::Loss][..]),
                (BURST, &[Purpose::Burst]),
                (CORRUPT, &[Purpose::Corrupt, Purpose::BitErrors]),
            ] {
                let drawn = timeline.redrawn(reason, &of).unwrap();
                let known = |purpose: &Purpose| {
                    seen[&(fate.ordinal, fate.copy, drawn.attempt - 1, *purpose as u64)]
                };
                prop_assert!(purposes.iter().any(|purpose| known(purpose) == drawn.drew));
                if fate.reason == reason {
                    prop_assert!(drawn.is_lost(), "{reason} {drawn:?} {fate:?}");
                } else if fate.reason.is_empty() {
                    prop_assert!(!drawn.is_lost(), "{reason} {drawn:?} {fate:?}");
                }
            }
        }
    }
}

#[test]
fn where_it_cannot_be_known_the_reason_is_told() {
    let message: MessageId = "a,b,Probe,0".parse().unwrap();
    let of = Transmitted {
        draws: DrawsOf {
            seed: 1,
            link: "a-b",
            message: &message,
        },
        sent: SimTime::ZERO,
        carriage: None,
        bytes: 10,
    };
    for (text, part) in [
        ("mtu = '100B'", "followed through windows"),
        ("radio = 'uhf'", "a radio"),
        (
            "retries = 2\ncontacts = [{ start = '0s', end = '1s' }]",
            "closed link",
        ),
    ] {
        let timeline = Timeline::new(toml::from_str::<LinkParams>(text).unwrap());
        let error = timeline.redrawn(LOSS, &of).unwrap_err();
        assert!(error.contains(part), "{text}: {error}");
    }
    let plain = Timeline::new(LinkParams::default());
    let never = Transmitted {
        carriage: Some(Carriage::default()),
        ..of
    };
    assert!(
        plain
            .redrawn(LOSS, &never)
            .unwrap_err()
            .contains("never on the air")
    );
    assert!(
        plain
            .redrawn("outage", &of)
            .unwrap_err()
            .contains("nothing is drawn")
    );
}
