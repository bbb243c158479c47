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

/// What the brute-force oracle is given: all times in slots of 10 ms, one transmission each.
#[derive(Clone, Debug)]
struct Slotted {
    window: usize,
    latency: usize,
    retries: usize,
    in_order: bool,
    /// When each message is sent.
    sent: Vec<usize>,
    /// In which slots transmissions are lost, and from which on answers.
    bad: Vec<bool>,
    bad_back: Vec<bool>,
}

/// What becomes of a message in it: the slot of its arrival or none, and its transmissions.
#[derive(Clone, Debug, PartialEq)]
struct Became {
    arrives: Option<usize>,
    attempts: usize,
}

fn slotted() -> impl Strategy<Value = Slotted> {
    let luck = || proptest::collection::vec(proptest::bool::weighted(0.3), 200);
    let sent = proptest::collection::vec(0..4usize, 1..40);
    (
        1..9usize,
        0..6usize,
        1..6usize,
        any::<bool>(),
        sent,
        luck(),
        luck(),
    )
        .prop_map(
            |(window, latency, retries, in_order, gaps, bad, bad_back)| {
                let mut at = 0;
                let sent = gaps.into_iter().map(|gap| {
                    at += gap;
                    at
                });
                let sent = sent.collect();
                Slotted {
                    window,
                    latency,
                    retries,
                    in_order,
                    sent,
                    bad,
                    bad_back,
                }
            },
        )
}

impl Slotted {
    /// Goes through all slots, one by one.
    fn oracle(&self) -> Vec<Became> {
        struct Sent {
            attempts: usize,
            arrived: Option<usize>,
            done: Option<usize>,
            due: Option<usize>,
            lost: bool,
        }
        let count = self.sent.len();
        let is_bad = |luck: &[bool], slot: usize| luck.get(slot).copied().unwrap_or(false);
        let mut frames: Vec<Sent> = Vec::new();
        for slot in 0..10_000 {
            let next = frames.len();
            let again = (0..next).filter(|&i| frames[i].due.is_some_and(|due| due <= slot));
            // First due first; of those due at once, the one begun first.
            let again = again.min_by_key(|&i| (frames[i].due, i));
            let base = frames
                .iter()
                .position(|frame| frame.done.is_none_or(|done| done > slot));
            let is_open = next - base.unwrap_or(next) < self.window;
            let at = match again {
                Some(at) => at,
                None if next < count && self.sent[next] <= slot && is_open => {
                    let (attempts, arrived, done, due) = (0, None, None, None);
                    frames.push(Sent {
                        attempts,
                        arrived,
                        done,
                        due,
                        lost: false,
                    });
                    next
                }
                None => continue,
            };
            let frame = &mut frames[at];
            frame.attempts += 1;
            frame.due = None;
            let (arrival, answer) = (slot + 1 + self.latency, slot + 1 + 2 * self.latency);
            let got_through = !is_bad(&self.bad, slot);
            if got_through {
                frame.arrived.get_or_insert(arrival);
            }
            if got_through && !is_bad(&self.bad_back, arrival) {
                frame.done = Some(answer);
            } else if frame.attempts > self.retries {
                frame.done = Some(answer);
                frame.lost = frame.arrived.is_none();
            } else {
                frame.due = Some(answer);
            }
        }
        assert_eq!(frames.len(), count);
        let mut out = 0;
        let became = frames.iter().map(|frame| {
            let Some(arrived) = frame.arrived else {
                out = out.max(frame.done.expect("it is over") + self.latency);
                return Became {
                    arrives: None,
                    attempts: frame.attempts,
                };
            };
            out = out.max(arrived);
            let arrives = if self.in_order { out } else { arrived };
            Became {
                arrives: Some(arrives),
                attempts: frame.attempts,
            }
        });
        became.collect()
    }

    fn luck(&self, base: &LinkParams, bad: &[bool]) -> Timeline {
        let lossy = |is_bad: bool| LinkParams {
            loss: if is_bad { 1.0 } else { 0.0 },
            ..base.clone()
        };
        let mut timeline = Timeline::new(lossy(bad[0]));
        for (slot, pair) in bad.windows(2).enumerate() {
            if pair[0] != pair[1] {
                let from = SimTime::ZERO + ms(10) * (slot as u64 + 1);
                timeline = timeline.then(from, lossy(pair[1]));
            }
        }
        timeline.then(SimTime::ZERO + ms(10) * bad.len() as u64, lossy(false))
    }

    fn link(&self) -> Link {
        let base = LinkParams {
            latency: ms(10) * self.latency as u64,
            rate: Some(80_000),
            retries: self.retries as u32,
            window: self.window as u32,
            // A window of one would be stop and wait, whose answers are never lost.
            mtu: Some(1 << 20),
            fifo: self.in_order,
            tx_power_w: 2.0,
            ..LinkParams::default()
        };
        Link::new(self.luck(&base, &self.bad)).answered_over(self.luck(&base, &self.bad_back))
    }

    fn sends(&self) -> Vec<Send> {
        let at = |slot: &usize| SimTime::ZERO + ms(10) * *slot as u64;
        self.sent
            .iter()
            .map(|slot| Send {
                at: at(slot),
                pad: 98,
            })
            .collect()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn selective_repeat_is_what_an_oracle_says_slot_by_slot(case in slotted()) {
        let expected = case.oracle();
        let seen = over(7, &case.sends(), case.link());
        for (ordinal, expected) in expected.iter().enumerate() {
            let own: Vec<&Fate> = seen.iter().filter(|f| f.ordinal == ordinal as u64).collect();
            let arrived: Vec<usize> = own
                .iter()
                .filter(|fate| fate.reason.is_empty())
                .map(|f| ((f.sent + f.delay).as_nanos() / 10_000_000) as usize)
                .collect();
            let attempts = own.iter().map(|fate| fate.parts().attempts as usize).sum();
            // Never twice, whatever becomes of answers.
            prop_assert!(arrived.len() <= 1, "{:?}", own);
            let became = Became { arrives: arrived.first().copied(), attempts };
            prop_assert_eq!(&became, expected, "message {}: {:?}", ordinal, own);
            let lost = own.iter().filter(|fate| fate.reason == LOSS).count();
            prop_assert_eq!(lost, usize::from(expected.arrives.is_none()));
            let kept = own.iter().filter(|fate| fate.reason == DUPLICATE).count();
            prop_assert_eq!(own.len(), 1 + kept);
            for fate in own {
                prop_assert_eq!(fate.parts().total(), fate.delay);
                // 2 W for 10 ms.
                let energy_j = 0.02 * f64::from(fate.parts().attempts);
                prop_assert!((fate.parts().energy_j - energy_j).abs() < 1e-12);
            }
        }
        if case.in_order {
            prop_assert!(self::arrived(&seen).is_sorted_by_key(|fate| fate.ordinal));
        }
    }
}

/// Sends a number of messages at once, and reads its bill at the end.
struct Payer {
    sink: Address<Receiver>,
    count: usize,
    bill: Arc<Mutex<[f64; 2]>>,
}

impl Actor for Payer {
    type Accepts = (Tick,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        for _ in 0..self.count {
            ctx.send(self.sink, Probe { pad: vec![0; 98] });
        }
        ctx.timer(SimDuration::from_secs(10_000), Tick);
        Ok(())
    }
}

impl Handler<Tick> for Payer {
    fn handle(&mut self, _tick: Tick, ctx: &mut Context<'_, Self>) -> Outcome {
        self.bill.lock().unwrap()[0] = ctx.transmit_energy_j();
        Ok(())
    }
}

/// Reads its host's bill at the end.
struct Receiver(Arc<Mutex<[f64; 2]>>);

impl Actor for Receiver {
    type Accepts = (Probe, Tick);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_secs(10_000), Tick);
        Ok(())
    }
}

impl Handler<Probe> for Receiver {
    fn handle(&mut self, _probe: Probe, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

impl Handler<Tick> for Receiver {
    fn handle(&mut self, _tick: Tick, ctx: &mut Context<'_, Self>) -> Outcome {
        self.0.lock().unwrap()[1] = ctx.host_receive_energy_j();
        Ok(())
    }
}

/// What both ends pay for so many messages, and what the run came to.
fn bill(
    count: usize,
    link: Link,
    executor: Executor,
    stops: Option<SimDuration>,
) -> ([f64; 2], Vec<Fate>, farside::Report) {
    let mut sim = Simulation::new(3);
    let (a, b) = (sim.host("a"), sim.host("b"));
    sim.heavy(a);
    sim.heavy(b);
    let bill = Arc::new(Mutex::new([0.0; 2]));
    let (payer, receiver) = (bill.clone(), bill.clone());
    let sink = sim.actor(b, "sink", move |_| Receiver(receiver.clone()));
    sim.actor(a, "source", move |_| Payer {
        sink,
        count,
        bill: payer.clone(),
    });
    sim.link(a, b, "a-b", link);
    let seen = Arc::new(Mutex::new(Vec::new()));
    sim.observe(Fates(seen.clone()));
    if let Some(stops) = stops {
        sim.stop_at(SimTime::ZERO + stops, "enough");
    }
    let report = sim.run(executor).unwrap();
    assert_ne!(report.end.name(), "fault", "{}", report.end.detail());
    let bill = *bill.lock().unwrap();
    (
        bill,
        Arc::into_inner(seen).unwrap().into_inner().unwrap(),
        report,
    )
}

#[test]
fn energy_is_that_of_all_attempts_and_all_answers() {
    // 10 ms for a message and 4 ms for an answer; every message arrives, three answers in ten do
    // not.
    let text = format!(
        "{LINK}\nwindow = 20\nack = '40B'\nack_loss = 0.3\ntx_power = '2W'\nrx_power = '0.5W'"
    );
    let count = 2_000;
    let (paid, seen, _) = bill(count, Link::new(params(&text)), Executor::Inline, None);
    assert_eq!(arrived(&seen).len(), count);
    let attempts: u32 = seen.iter().map(|fate| fate.parts().attempts).sum();
    let attempts = f64::from(attempts);
    let expected = count as f64 / 0.7;
    assert!(
        (attempts / expected - 1.0).abs() < 0.03,
        "{attempts} {expected}"
    );
    let told: f64 = seen.iter().map(|fate| fate.parts().energy_j).sum();
    let sender_j = attempts * 2.0 * 0.010 + count as f64 * 0.5 * 0.004;
    let receiver_j = attempts * (0.5 * 0.010 + 2.0 * 0.004);
    assert!((paid[0] - sender_j).abs() < 1e-6, "{paid:?} {sender_j}");
    assert!((told - sender_j).abs() < 1e-6, "{told} {sender_j}");
    assert!((paid[1] - receiver_j).abs() < 1e-6, "{paid:?} {receiver_j}");
}

#[test]
fn the_kernel_counts_every_copy_once_in_every_executor() {
    let text = format!(
        "{LINK}\nwindow = 20\nack = '40B'\nloss = 0.2\nduplicate = 0.1\n\
         in_order = true\nmtu = '30B'"
    );
    let run = |executor, stops| bill(500, Link::new(params(&text)), executor, stops);
    for stops in [None, Some(ms(4_000))] {
        let (paid, seen, report) = run(Executor::Inline, stops);
        let counts = &report.counts;
        assert_eq!(counts.sent, 500);
        let copies = counts.sent + counts.duplicated;
        assert_eq!(copies, counts.delivered + counts.lost + counts.in_flight);
        assert_eq!(counts.lost, counts.lost_by_reason[DUPLICATE]);
        assert_eq!(counts.in_flight > 0, stops.is_some());
        assert_eq!(seen.len() as u64, counts.delivered + counts.lost);
        let (same_paid, same_seen, same) = run(Executor::Kameo { threads: 2 }, stops);
        assert_eq!(
            (report.digest, paid, seen),
            (same.digest, same_paid, same_seen)
        );
    }
}

#[test]
fn nothing_arrives_sooner_than_a_link_can_tell() {
    // The first is lost at once and would be repeated in ten seconds, when its lifetime is over;
    // those behind it are there, and wait for it. That it is given up, nobody learns faster than
    // in the time of an empty message: 10 ms on the air and 1 ms on the way.
    let text = "
        [links.default]
        rate = '80kbit/s'
        overhead = '100B'
        latency = '1ms'
        retries = 9
        timeout = '10s'
        lifetime = '1s'
        window = 9
        in_order = true
        ack_loss = 0.0
        [[degrade]]
        at = '0s'
        until = '1ms'
        links = '*'
        loss = 1.0
    ";
    let seen = scenario(1, &at_once(5), &["b"], text);
    assert_eq!(
        (seen[0].ordinal, seen[0].reason, seen[0].delay),
        (0, EXPIRED, ms(1_000))
    );
    assert!(
        seen[1..]
            .iter()
            .all(|fate| (fate.reason, fate.delay) == ("", ms(1_011)))
    );
    assert!(seen.is_sorted_by_key(|fate| fate.ordinal));
}

/// Counts hand-overs: the looks at messages that are followed.
struct HandOvers(Arc<Mutex<u64>>);

impl Observer for HandOvers {
    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        *self.0.lock().unwrap() += u64::from(record.class == RecordClass::HandOver);
        Ok(Flow::Continue)
    }
}

#[test]
fn a_message_costs_the_same_however_many_wait() {
    let texts = [
        "window = 7",
        "window = 1\nmtu = '30B'",
        "window = 7\nmtu = '30B'\nloss = 0.3\nin_order = true",
        "window = 7\nstore_and_forward = true\n\
         contacts = { every = '10s', windows = [{ start = '5s', end = '6s' }] }",
    ];
    for text in texts {
        for count in [200, 8_000] {
            let looks = Arc::new(Mutex::new(0));
            let seen = run(1, &at_once(count), &["b"], |sim, a, hosts| {
                sim.link(
                    a,
                    hosts[0],
                    "a-b",
                    Link::new(params(&format!("{LINK}\n{text}"))),
                );
                sim.observe(HandOvers(looks.clone()));
            });
            assert_eq!(arrived(&seen).len(), count);
            let attempts: u32 = seen.iter().map(|fate| fate.parts().attempts).sum();
            let looks = *looks.lock().unwrap();
            let most = 3 * u64::from(attempts) + 2 * count as u64;
            assert!(
                looks <= most,
                "{text}, {count}: {looks} looks, {attempts} attempts"
            );
        }
    }
}

#[test]
fn what_cannot_be_is_refused() {
    for (text, expected) in [
        (
            "window = 0",
            "0: expected 1 to 16777216; 1 is stop and wait",
        ),
        ("mtu = '0B'", "0B: expected more than that"),
        (
            "fifo = true\nin_order = true",
            "are names of one key, `fifo`",
        ),
    ] {
        let error = toml::from_str::<LinkParams>(text).unwrap_err().to_string();
        assert!(error.contains(expected), "{text}: {error}");
    }
}
