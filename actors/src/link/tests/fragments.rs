//! Messages in fragments: over several contacts, each lost and repeated by itself.

use super::*;

/// 8 kbit/s, so that a kilobyte takes a second, in contacts of ten seconds.
const PASSES: &str = "rate = '8kbit/s'\nlatency = '1s'\nstore_and_forward = true\n\
    contacts = { every = '100s', windows = [{ start = '0s', end = '10s' }] }";

/// A probe of so many bytes: its padding's length takes two of them up to 16 kB, and three more.
fn of(bytes: usize) -> Vec<Send> {
    let own = if bytes > 16_000 { 4 } else { 3 };
    let at = SimTime::ZERO;
    vec![Send {
        at,
        pad: bytes - own,
    }]
}

#[test]
fn a_message_that_fits_into_no_contact_goes_over_several() {
    let whole = over(1, &of(20_000), Link::new(params(PASSES)));
    assert_eq!((whole[0].bytes, whole[0].reason), (20_000, NO_CONTACT));
    let seen = over(
        1,
        &of(20_000),
        Link::new(params(&format!("{PASSES}\nmtu = '1kB'"))),
    );
    // Ten in the first contact and ten in the second.
    assert_eq!(
        (seen[0].reason, seen[0].delay),
        ("", SimDuration::from_secs(111))
    );
    let parts = seen[0].parts();
    assert_eq!((parts.fragments, parts.attempts), (20, 20));
    assert_eq!(parts.serialization, SimDuration::from_secs(20));
    assert_eq!(parts.retries, SimDuration::from_secs(90));
    assert!(
        parts.to_string().contains("20 fragments, 20 attempts"),
        "{parts}"
    );
    // With headers of 250 bytes eight fit into a contact.
    let text = format!("{PASSES}\nmtu = '1kB'\noverhead = '150B'\nfragment_header = '100B'");
    let seen = over(1, &of(20_000), Link::new(params(&text)));
    assert_eq!(seen[0].delay, SimDuration::from_secs(200 + 5 + 1));
}

#[test]
fn fragments_take_what_others_leave_of_a_contact() {
    let text = format!("{PASSES}\nmtu = '2kB'");
    let sends = [of(7_000), of(5_000), of(1_000)].concat();
    let seen = over(1, &sends, Link::new(params(&text)));
    // The second goes from 7 s on: 2 kB until 9 s, the rest from 100 s on. The third waits for it.
    let delays: Vec<u64> = seen
        .iter()
        .map(|f| f.delay.as_nanos() / 1_000_000_000)
        .collect();
    assert_eq!(delays, [8, 104, 105]);
    assert_eq!(seen[2].parts().fragments, 0);
}

#[test]
fn each_fragment_is_lost_by_itself() {
    // Of ten fragments, each lost with probability p and sent r times more, all arrive with
    // (1 - p^(r + 1))^10.
    let n = 4_000;
    let send = of(1_000)[0];
    let sends: Vec<Send> = (0..n)
        .map(|i| Send {
            at: SimTime::ZERO + ms(1_000) * i,
            ..send
        })
        .collect();
    for (loss, retries) in [(0.05, 0), (0.3, 1), (0.3, 3)] {
        let text = format!(
            "rate = '80kbit/s'\nlatency = '1ms'\nmtu = '100B'\nloss = {loss}\nretries = {retries}\n\
             window = 4\nack_loss = 0.0\ntx_power = '2W'"
        );
        let seen = over(3, &sends, Link::new(params(&text)));
        let share = arrived(&seen).len() as f64 / n as f64;
        let failed = libm::pow(loss, f64::from(retries) + 1.0);
        let expected = libm::pow(1.0 - failed, 10.0);
        let deviation = (expected * (1.0 - expected) / n as f64).sqrt();
        assert!(
            (share - expected).abs() < 4.0 * deviation,
            "{loss}, {retries}: {share} {expected}"
        );
        let attempts: u32 = arrived(&seen)
            .iter()
            .map(|fate| fate.parts().attempts)
            .sum();
        // What arrived took 1, 2, ... attempts as a geometric distribution that is cut.
        let mean = f64::from(attempts) / arrived(&seen).len() as f64 / 10.0;
        let (mut expected, mut total) = (0.0, 0.0);
        for k in 0..=retries {
            let p = libm::pow(loss, f64::from(k)) * (1.0 - loss);
            (expected, total) = (expected + p * f64::from(k + 1), total + p);
        }
        assert!(
            (mean - expected / total).abs() < 0.02,
            "{mean} {}",
            expected / total
        );
        for fate in &seen {
            let energy_j = 0.02 * f64::from(fate.parts().attempts);
            assert!((fate.parts().energy_j - energy_j).abs() < 1e-9);
            assert_eq!(fate.parts().total(), fate.delay);
        }
    }
}

#[test]
fn a_megabyte_at_a_hundredth_loss_arrives() {
    let text =
        "rate = '8Mbit/s'\nlatency = '10ms'\nmtu = '1kB'\nloss = 0.01\nretries = 5\nwindow = 64";
    let bytes = 1_000_000;
    let sends = [Send {
        at: SimTime::ZERO,
        pad: bytes - 4,
    }];
    let seen = over(4, &sends, Link::new(params(text)));
    let parts = seen[0].parts();
    assert_eq!(
        (seen[0].reason, seen[0].bytes, parts.fragments),
        ("", 1_000_000, 1000)
    );
    // One in a hundred is sent again, and again once in a while: its answer was lost.
    assert!((1010..1045).contains(&parts.attempts), "{parts}");
    let over_air = seen[0].delay - ms(1010);
    assert!(over_air < ms(70), "{over_air}");
}

#[test]
fn bit_errors_meet_the_size_of_a_fragment() {
    let n = 20_000;
    let text =
        "rate = '8Mbit/s'\nmtu = '500B'\nfragment_header = '20B'\noverhead = '30B'\nber = 1e-5";
    let sends: Vec<Send> = (0..n)
        .map(|i| Send {
            at: SimTime::ZERO + ms(10) * i,
            ..of(1_000)[0]
        })
        .collect();
    let seen = over(5, &sends, Link::new(params(text)));
    let share = arrived(&seen).len() as f64 / n as f64;
    let expected = libm::pow(1.0 - 1e-5, 8.0 * 2.0 * 550.0);
    assert!((share - expected).abs() < 0.008, "{share} {expected}");
}

#[test]
fn a_lifetime_is_that_of_the_whole() {
    let text = format!("{PASSES}\nmtu = '1kB'\nlifetime = '50s'");
    let sends = [of(20_000), of(5_000)].concat();
    let seen = over(6, &sends, Link::new(params(&text)));
    let second = SimDuration::from_secs(1);
    assert!(
        seen.iter()
            .all(|f| (f.reason, f.delay) == (EXPIRED, second * 50)),
        "{seen:?}"
    );
    let attempts = |ordinal| {
        seen.iter()
            .find(|f| f.ordinal == ordinal)
            .unwrap()
            .parts()
            .attempts
    };
    assert_eq!((attempts(0), attempts(1)), (10, 0));
    // Where no fragment begins later than that, it is none of its business.
    let seen = over(
        6,
        &of(9_000),
        Link::new(params(&text.replace("50s", "8500ms"))),
    );
    assert_eq!((seen[0].reason, seen[0].delay), ("", second * 10));
}

#[test]
fn who_is_not_answered_sends_all_fragments_and_who_is_stops() {
    // In the second of ten everything is lost.
    let text = |retries| {
        format!(
            "[links.default]\nrate = '8kbit/s'\nlatency = '1s'\nmtu = '1kB'\nretries = {retries}\n\
             [[degrade]]\nat = '1s'\nuntil = '2s'\nlinks = '*'\nloss = 1.0"
        )
    };
    let seen = scenario(7, &of(10_000), &["b"], &text(0));
    assert_eq!((seen[0].reason, seen[0].parts().attempts), (LOSS, 10));
    // It is the last that shows.
    assert_eq!(seen[0].delay, SimDuration::from_secs(11));
    // Who finds the link out goes through what is left at once.
    let out = text(0).replace("loss = 1.0", "outage = true");
    let seen = scenario(7, &of(10_000), &["b"], &out);
    assert_eq!((seen[0].reason, seen[0].parts().attempts), (OUTAGE, 1));
    let seen = scenario(
        7,
        &of(10_000),
        &["b"],
        &text(1).replace("until = '2s'\n", ""),
    );
    assert_eq!((seen[0].reason, seen[0].parts().fragments), (LOSS, 10));
    assert!(seen[0].parts().attempts <= 4, "{:?}", seen[0]);
}
