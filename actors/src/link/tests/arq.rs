//! Selective repeat: windows, acknowledgements that take time and get lost, the order of arrival.

use super::*;

/// A link whose messages of 98 bytes of padding, 100 in all, take 10 ms, with 45 ms each way.
const LINK: &str = "rate = '80kbit/s'\nlatency = '45ms'\nretries = 1000";

/// So many messages of 100 bytes, all at the start.
fn at_once(count: usize) -> Vec<Send> {
    let at = SimTime::ZERO;
    vec![Send { at, pad: 98 }; count]
}

fn last_arrival(fates: &[Fate]) -> SimDuration {
    let arrivals = arrived(fates).into_iter();
    arrivals
        .map(|fate| fate.sent.since(SimTime::ZERO) + fate.delay)
        .max()
        .unwrap()
}

#[test]
fn a_window_carries_what_its_closed_form_says() {
    // T = 10 ms, an answer is there 100 ms after the start: W messages each 100 ms, or one each T.
    let count = 1000;
    for (window, ack, round_ms) in [
        (1, 0, 100),
        (2, 0, 100),
        (5, 0, 100),
        (5, 50, 105),
        (12, 0, 100),
    ] {
        let text = format!("{LINK}\nwindow = {window}\nack = '{ack}B'\nack_rate = '80kbit/s'");
        let seen = over(1, &at_once(count), Link::new(params(&text)));
        assert_eq!(arrived(&seen).len(), count);
        let n = count as u64 - 1;
        let start = match window * 10 <= round_ms {
            true => ms(round_ms) * (n / window) + ms(10) * (n % window),
            false => ms(10) * n,
        };
        assert_eq!(last_arrival(&seen), start + ms(55), "{window} {ack}");
    }
}

#[test]
fn answers_wait_for_each_other() {
    // Each answer takes 30 ms, three times as long as a message: they are what limits the link.
    let text = format!("{LINK}\nwindow = 50\nack = '300B'");
    let count = 500;
    let seen = over(1, &at_once(count), Link::new(params(&text)));
    // The first 50 at once, and then one for each answer.
    let start = ms(55 + 30 + 45) + ms(30) * (count as u64 - 51);
    assert_eq!(last_arrival(&seen), start + ms(55));
}
