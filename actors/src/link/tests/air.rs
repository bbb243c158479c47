//! What takes time and room: rates, queues, contacts, retries, energy.

use super::*;

#[test]
fn a_saturated_link_waits_as_d_d_1() {
    // 102 + 23 bytes at 100 kbit/s are 10 ms; one comes each 4 ms, so each waits 6 ms longer.
    let link = params("rate = '100kbit/s'\noverhead = '23B'\nlatency = '5ms'");
    let seen = over(1, &each(ms(4), 200, 100), Link::new(link));
    for fate in &seen {
        let parts = fate.parts();
        assert_eq!(parts.serialization, ms(10));
        assert_eq!(parts.queue, ms(6) * fate.ordinal);
        assert_eq!(fate.delay, ms(6) * fate.ordinal + ms(15));
    }
}

#[test]
fn random_arrivals_wait_as_m_d_1() {
    // Mean wait rho S / (2 (1 - rho)).
    let (service_s, load) = (0.01, 0.7);
    let mut stream = farside::random::RandomKey::new(5).stream();
    let mut at_s = 0.0;
    let mut sends = Vec::new();
    for _ in 0..60_000 {
        at_s += stream.exponential(service_s / load);
        let at = SimTime::ZERO + SimDuration::from_secs_f64(at_s);
        sends.push(Send { at, pad: 100 });
    }
    let link = params("rate = '100kbit/s'\noverhead = '23B'");
    let seen = over(2, &sends, Link::new(link));
    let waits = seen.iter().map(|fate| fate.parts().queue.as_secs_f64());
    let mean = waits.sum::<f64>() / seen.len() as f64;
    let expected = load * service_s / (2.0 * (1.0 - load));
    assert!((mean / expected - 1.0).abs() < 0.08, "{mean} {expected}");
}

#[test]
fn a_full_queue_drops_the_last() {
    let sends = [Send {
        at: SimTime::ZERO,
        pad: 100,
    }; 20];
    for (queue, waiting) in [("5", 5), ("'600B'", 4), ("0", 0)] {
        let link = params(&format!(
            "rate = '100kbit/s'\noverhead = '23B'\nqueue = {queue}"
        ));
        let seen = over(3, &sends, Link::new(link));
        let full: Vec<&Fate> = seen
            .iter()
            .filter(|fate| fate.reason == QUEUE_FULL)
            .collect();
        // One on the air beside those that wait, and the late ones are lost at once.
        assert_eq!(full.len(), 20 - 1 - waiting, "{queue}");
        assert!(
            full.iter()
                .all(|fate| fate.delay.is_zero() && fate.ordinal > waiting as u64)
        );
    }
}

#[test]
fn retries_meet_their_closed_forms() {
    let link = params(
        "rate = '100kbit/s'\noverhead = '23B'\nlatency = '20ms'\nloss = 0.4\nretries = 2\n\
         timeout = '80ms'\ntx_power = '2W'",
    );
    let n = 20_000;
    let seen = over(4, &each(SimDuration::from_secs(1), n, 100), Link::new(link));
    for fate in &seen {
        let parts = fate.parts();
        assert_eq!(parts.retries, ms(80) * u64::from(parts.attempts - 1));
        let way = if fate.reason.is_empty() {
            ms(20)
        } else {
            ms(0)
        };
        assert_eq!(fate.delay, parts.retries + ms(10) + way);
        // P 8 L / R for each attempt: 2 W for 10 ms.
        let energy_j = 0.02 * f64::from(parts.attempts);
        assert!((parts.energy_j - energy_j).abs() < 1e-12);
    }
    let n = f64::from(n);
    let lost = lost(&seen).len() as f64 / n;
    assert!((lost - 0.4f64 * 0.4 * 0.4).abs() < 0.006, "{lost}");
    let attempts = seen.iter().map(|fate| f64::from(fate.parts().attempts));
    let mean = attempts.sum::<f64>() / n;
    assert!((mean - (1.0 - 0.064) / 0.6).abs() < 0.02, "{mean}");
}

#[test]
fn who_waits_for_answers_is_slow() {
    // Stop and wait: one message each transmission and two latencies.
    let link = params("rate = '100kbit/s'\noverhead = '23B'\nlatency = '20ms'\nretries = 5");
    let seen = over(
        5,
        &[Send {
            at: SimTime::ZERO,
            pad: 100,
        }; 10],
        Link::new(link),
    );
    for fate in &seen {
        assert_eq!(fate.parts().queue, ms(50) * fate.ordinal);
    }
    // A timeout below that is no use: the answer is on its way.
    let hasty = params("latency = '20ms'\nretries = 1\ntimeout = '1ms'\nloss = 1.0");
    let seen = over(5, &each(ms(100), 3, 0), Link::new(hasty));
    assert!(
        seen.iter()
            .all(|fate| fate.parts().retries == ms(40) && fate.reason == LOSS)
    );
}

#[test]
fn what_waits_meets_what_holds_when_it_is_sent() {
    // The first is on the air for 6 minutes, and the second meets the outage that begins at 5.
    let text = "
        links.default = { rate = '1bit/s', latency = '1s' }
        [[degrade]]
        at = '5min'
        until = '7min'
        links = '*'
        outage = true
    ";
    let seen = scenario(
        6,
        &[Send {
            at: SimTime::ZERO,
            pad: 43,
        }; 2],
        &["b"],
        text,
    );
    let minutes = |n: u64| SimDuration::from_secs(60 * n);
    assert_eq!(seen[0].bytes, 45);
    // Its own transmission is cut where the outage begins.
    assert_eq!((seen[0].reason, seen[0].delay), (OUTAGE, minutes(5)));
    assert_eq!((seen[1].reason, seen[1].delay), (OUTAGE, minutes(5)));
    assert_eq!(seen.iter().map(|fate| fate.parts().attempts).max(), Some(1));
    let held = text.replace("latency = '1s'", "latency = '1s', store_and_forward = true");
    let seen = scenario(
        6,
        &[Send {
            at: SimTime::ZERO,
            pad: 43,
        }; 2],
        &["b"],
        &held,
    );
    // It would be cut, so it waits for the end of the outage; the second for the first.
    assert_eq!(seen[0].delay, minutes(13) + SimDuration::from_secs(1));
    assert_eq!(seen[1].delay, minutes(19) + SimDuration::from_secs(1));
}

#[test]
fn what_waits_has_the_parameters_of_its_own_transmission() {
    let text = "
        links.default = { rate = '1bit/s', latency = '1s', loss = 1.0 }
        [[degrade]]
        at = '5min'
        links = '*'
        rate = '2bit/s'
        latency = '7s'
        loss = 0.0
        tx_power = '3W'
    ";
    let seen = scenario(
        15,
        &[Send {
            at: SimTime::ZERO,
            pad: 43,
        }; 2],
        &["b"],
        text,
    );
    let secs = SimDuration::from_secs;
    // The first, 360 bits, goes at 1 bit/s whatever comes; the second finds all changed.
    assert_eq!((seen[0].reason, seen[0].delay), (LOSS, secs(360)));
    let parts = seen[1].parts();
    assert_eq!((seen[1].reason, parts.queue), ("", secs(360)));
    assert_eq!(
        (parts.serialization, parts.propagation),
        (secs(180), secs(7))
    );
    assert_eq!((seen[0].parts().energy_j, parts.energy_j), (0.0, 540.0));
}

#[test]
fn messages_wait_for_the_contact_they_fit_into() {
    let windows = "[{ start = '1s', end = '2s', rate = '800bit/s' }, \
        { start = '5s', end = '9s', rate = '400bit/s', owlt = '300ms' }]";
    let held = format!("contacts = {windows}\nstore_and_forward = true\nlatency = '10ms'");
    // 100 bytes take 1 s in the first window and 2 s in the second.
    let sends = [98, 98, 98, 198, 10].map(|pad| Send {
        at: SimTime::ZERO,
        pad,
    });
    let seen = over(7, &sends, Link::new(params(&held)));
    let by = |n: u64| seen.iter().find(|fate| fate.ordinal == n).unwrap();
    assert_eq!((by(0).reason, by(0).delay), ("", ms(2_010)));
    assert_eq!((by(1).reason, by(1).delay), ("", ms(7_300)));
    assert_eq!((by(2).reason, by(2).delay), ("", ms(9_300)));
    // The next one fits nowhere any more, and is told as soon as it is looked at.
    assert_eq!((by(3).reason, by(3).delay), (NO_CONTACT, ms(9_000)));
    let cut = format!("contacts = {windows}\nlatency = '10ms'");
    let sends = [(0, 10), (1_500, 98), (5_000, 10)].map(|(at, pad)| Send {
        at: SimTime::ZERO + ms(at),
        pad,
    });
    let seen = over(7, &sends, Link::new(params(&cut)));
    assert_eq!((seen[0].reason, seen[0].delay), (NO_CONTACT, ms(0)));
    assert_eq!((seen[1].reason, seen[1].delay), (NO_CONTACT, ms(500)));
    assert_eq!((seen[2].reason, seen[2].parts().propagation), ("", ms(300)));
}

#[test]
fn periodic_contacts_that_nothing_fits_into_end_the_wait() {
    let link = params(
        "rate = '8bit/s'\nstore_and_forward = true\n\
         contacts = { every = '10s', windows = [{ start = '0s', end = '1s' }] }",
    );
    let seen = over(8, &each(ms(10), 2, 100), Link::new(link));
    assert!(seen.iter().all(|fate| fate.reason == NO_CONTACT));
}

#[test]
fn a_trace_delivers_at_its_opportunities() {
    let link = params("trace = [10, 20, 30]\nlatency = '0s'\noverhead = '1398B'");
    // 1500 bytes each: one opportunity each, at 10, 20, 30, 40 ms and so on.
    let seen = over(
        9,
        &[Send {
            at: SimTime::ZERO,
            pad: 100,
        }; 6],
        Link::new(link),
    );
    let at: Vec<u64> = seen
        .iter()
        .map(|fate| fate.delay.as_nanos() / 1_000_000)
        .collect();
    assert_eq!(at, [10, 20, 30, 40, 50, 60]);
}

#[test]
fn a_fraction_is_held_back_and_overtaken() {
    let link = params("latency = '20ms'\nreorder = 0.25\nreorder_by = '35ms'");
    let seen = over(10, &each(ms(10), 20_000, 0), Link::new(link));
    let late: Vec<&Fate> = seen.iter().filter(|fate| fate.delay == ms(55)).collect();
    assert!(
        seen.iter()
            .all(|fate| [ms(20), ms(55)].contains(&fate.delay))
    );
    let share = late.len() as f64 / 20_000.0;
    assert!((share - 0.25).abs() < 0.01, "{share}");
}

#[test]
fn order_is_kept_where_it_is_asked_for() {
    let unordered = "latency = '50ms'\njitter = '40ms'\nreorder = 0.1\nduplicate = 0.1\nloss = 0.1";
    let falls = |text: &str| {
        let seen = over(11, &each(ms(5), 2_000, 0), Link::new(params(text)));
        let arrived = arrived(&seen);
        arrived
            .windows(2)
            .filter(|pair| pair[0].ordinal > pair[1].ordinal)
            .count()
    };
    assert!(falls(unordered) > 100);
    assert_eq!(falls(&format!("{unordered}\nfifo = true")), 0);
}

#[test]
fn correlated_jitter_keeps_its_marginal() {
    // Of a Gaussian copula with correlation rho, uniform marginals correlate by 6/pi asin(rho/2).
    let rho: f64 = 0.8;
    let link = params("latency = '50ms'\njitter = '30ms'\njitter_correlation = 0.8");
    let n = 40_000;
    let seen = over(12, &each(SimDuration::from_secs(1), n, 0), Link::new(link));
    let x: Vec<f64> = seen
        .iter()
        .map(|f| f.parts().jitter_ns as f64 / 30e6)
        .collect();
    let mean_of =
        |f: &dyn Fn(usize) -> f64| (1..x.len()).map(f).sum::<f64>() / (x.len() - 1) as f64;
    assert!(mean_of(&|i| x[i]).abs() < 0.03);
    let variance = mean_of(&|i| x[i] * x[i]);
    assert!((variance - 1.0 / 3.0).abs() < 0.01, "{variance}");
    let correlation = mean_of(&|i| x[i] * x[i - 1]) / variance;
    let expected = 6.0 / std::f64::consts::PI * libm::asin(rho / 2.0);
    assert!(
        (correlation - expected).abs() < 0.02,
        "{correlation} {expected}"
    );
}

#[test]
fn tables_and_tails_stay_in_their_bounds() {
    let table =
        params("latency = '50ms'\njitter = '10ms'\njitter_shape = { table = [-0.5, 0, 3] }");
    assert_eq!(table.min_delay(), ms(45));
    let seen = over(13, &each(ms(10), 5_000, 0), Link::new(table));
    assert!(
        seen.iter()
            .all(|fate| (ms(45)..=ms(80)).contains(&fate.delay))
    );
    let median = seen.iter().filter(|fate| fate.delay < ms(50)).count();
    assert!((2_350..2_650).contains(&median), "{median}");
    let pareto = params("latency = '50ms'\njitter = '10ms'\njitter_shape = 'pareto'");
    let seen = over(14, &each(ms(10), 5_000, 0), Link::new(pareto));
    let least = seen.iter().map(|fate| fate.delay).min().unwrap();
    assert!(least >= SimDuration::from_secs_f64(0.050 - 0.01 / 3f64.sqrt()) && least < ms(45));
    assert!(seen.iter().any(|fate| fate.delay > ms(90)));
}

#[test]
fn a_message_that_waits_for_longer_than_its_lifetime_expires() {
    let text = "contacts = [{ start = '10s', end = '20s' }]\nstore_and_forward = true\n\
                lifetime = '5s'\nlatency = '1s'";
    let second = SimDuration::from_secs(1);
    let seen = over(6, &each(second, 12, 0), Link::new(params(text)));
    for fate in &seen {
        let (reason, delay) = match fate.ordinal {
            0..=5 => (EXPIRED, 5),
            ordinal => ("", 1 + 10u64.saturating_sub(ordinal)),
        };
        assert_eq!(
            (fate.reason, fate.delay),
            (reason, second * delay),
            "{fate:?}"
        );
    }
    // Who has expired leaves its place in the queue.
    let seen = over(
        6,
        &each(second, 9, 0),
        Link::new(params(&format!("{text}\nqueue = 3"))),
    );
    let full: Vec<u64> = seen
        .iter()
        .filter(|f| f.reason == QUEUE_FULL)
        .map(|f| f.ordinal)
        .collect();
    assert_eq!(full, [3, 4, 8]);
    // Retries end with it: the first answer would be there after 2 s, the second after 4 s.
    let lossy = params("latency = '1s'\nloss = 1.0\nretries = 9\nlifetime = '5s'");
    let seen = over(6, &each(second, 1, 0), Link::new(lossy));
    assert_eq!((seen[0].reason, seen[0].delay), (EXPIRED, second * 5));
    assert_eq!(seen[0].parts().attempts, 3);
}
