//! What is said of a link and has no effect: one table of rules over all keys.

use super::{Contacts, LinkParams, QueueLimit, Timeline};

/// What a link is told, with what it takes to judge whether that has any effect.
#[derive(Clone, Copy)]
pub(crate) struct Told<'a> {
    params: &'a LinkParams,
    /// What the link back has, if there is one.
    back: Option<&'a LinkParams>,
    /// Whether other parameters come, or were before.
    changes: bool,
    /// Whether the link is ever closed.
    closes: bool,
}

impl<'a> Told<'a> {
    fn alone(params: &'a LinkParams) -> Self {
        Told {
            params,
            back: None,
            changes: false,
            closes: params.outage || params.contacts.is_some(),
        }
    }

    /// All that a link is told, by the instants from which it holds.
    fn all(timeline: &'a Timeline, back: Option<&'a Timeline>) -> impl Iterator<Item = Told<'a>> {
        let closes = timeline
            .iter()
            .any(|(_, params)| Told::alone(params).closes);
        let changes = timeline.spans.len() > 1;
        timeline.iter().map(move |(from, params)| Told {
            params,
            back: back.map(|back| back.at(from)),
            changes,
            closes,
        })
    }

    fn windows(&self) -> impl Iterator<Item = &'a super::Contact> {
        self.params.contacts.iter().flat_map(Contacts::windows)
    }

    fn own_rate(&self) -> bool {
        self.windows().any(|window| window.rate.is_some())
    }

    fn own_light_time(&self) -> bool {
        self.windows().any(|window| window.owlt.is_some())
    }

    /// Whether transmissions take time.
    fn timed(&self) -> bool {
        self.params.rate.is_some() || self.params.trace.is_some() || self.own_rate()
    }

    /// Whether anything ever waits.
    fn waits(&self) -> bool {
        self.timed() || self.params.store_and_forward || self.params.retries > 0
    }
}

/// A key that may have no effect.
pub(crate) struct Rule {
    /// What people are told.
    pub(crate) says: &'static str,
    /// Whether the key is said.
    said: fn(&Told<'_>) -> bool,
    /// Whether it has no effect then.
    idle: fn(&Told<'_>) -> bool,
    /// Whether that is worth a word only if it has no effect on any link, for it is said of all and
    /// meant for some.
    everywhere: bool,
}

/// A rule: what is said, when, and when that has no effect.
const fn rule(
    says: &'static str,
    said: fn(&Told<'_>) -> bool,
    idle: fn(&Told<'_>) -> bool,
) -> Rule {
    Rule {
        says,
        said,
        idle,
        everywhere: false,
    }
}

/// All of them.
pub(crate) const RULES: &[Rule] = &[
    rule(
        "rate has no effect in contacts that have their own",
        |told| told.params.rate.is_some(),
        |told| told.own_rate(),
    ),
    rule(
        "trace has no effect in contacts that have a rate of their own",
        |told| told.params.trace.is_some(),
        |told| told.own_rate(),
    ),
    rule(
        "latency has no effect in contacts that have their own",
        |told| told.params.latency != LinkParams::default().latency,
        |told| told.own_light_time(),
    ),
    rule(
        "rate beside a trace: the trace says when to transmit",
        |told| told.params.rate.is_some(),
        |told| told.params.trace.is_some(),
    ),
    rule(
        "overhead without a rate: a transmission takes no time",
        |told| told.params.overhead > 0,
        |told| {
            let counted = matches!(told.params.queue, Some(QueueLimit::Bytes(_)));
            !told.timed() && told.params.ber == 0.0 && !counted
        },
    ),
    rule(
        "jitter_shape without jitter: nothing scatters",
        |told| told.params.jitter_shape != LinkParams::default().jitter_shape,
        |told| told.params.jitter.is_zero(),
    ),
    rule(
        "jitter_correlation without jitter: there is nothing to correlate",
        |told| told.params.jitter_correlation > 0.0,
        |told| told.params.jitter.is_zero(),
    ),
    rule(
        "min_delay below every delay: it shortens the look-ahead, and nothing else",
        |told| told.params.least_delay.is_some(),
        |told| {
            let free = LinkParams {
                least_delay: None,
                ..told.params.clone()
            };
            told.params.least_delay < Some(free.least_way_of_all())
        },
    ),
    rule(
        "reorder beside fifo: the order is kept",
        |told| told.params.reorder > 0.0,
        |told| told.params.fifo,
    ),
    rule(
        "reorder_by without reorder: nothing is held back",
        |told| told.params.reorder_by.is_some(),
        |told| told.params.reorder == 0.0,
    ),
    Rule {
        says: "fifo where no message can overtake another",
        said: |told| told.params.fifo,
        idle: |told| {
            let params = told.params;
            let scatters = !params.jitter.is_zero() || params.reorder > 0.0;
            let repeats = params.window > 1 && params.retries > 0;
            !scatters && !repeats && !told.changes && !told.own_light_time()
        },
        everywhere: true,
    },
    rule(
        "tx_power without a rate: a transmission takes no time, so no energy",
        |told| told.params.tx_power_w > 0.0,
        |told| !told.timed(),
    ),
    rule(
        "rx_power without a rate: a transmission takes no time, so no energy",
        |told| told.params.rx_power_w > 0.0,
        |told| !told.timed(),
    ),
    rule(
        "queue without a rate: nothing ever waits",
        |told| told.params.queue.is_some(),
        |told| !told.waits(),
    ),
    rule(
        "lifetime without a rate: nothing ever waits",
        |told| told.params.lifetime.is_some(),
        |told| !told.waits(),
    ),
    Rule {
        says: "store_and_forward without contacts or outages: no link is ever closed",
        said: |told| told.params.store_and_forward,
        idle: |told| !told.closes,
        everywhere: true,
    },
    rule(
        "timeout without retries: nobody waits for an answer",
        |told| told.params.timeout.is_some(),
        |told| told.params.retries == 0,
    ),
    rule(
        "timeout below twice the latency: an answer takes longer",
        |told| told.params.timeout.is_some() && told.params.retries > 0,
        |told| told.params.timeout < Some(told.params.latency * 2),
    ),
    rule(
        "window without retries: nothing is acknowledged",
        |told| told.params.window > 1,
        |told| told.params.retries == 0,
    ),
    rule(
        "ack without retries: nothing is acknowledged",
        |told| told.params.ack > 0,
        |told| told.params.retries == 0,
    ),
    rule(
        "ack_loss without retries: nothing is acknowledged",
        |told| told.params.ack_loss.is_some(),
        |told| told.params.retries == 0,
    ),
    rule(
        "ack_rate without ack: an acknowledgement without a size takes no time",
        |told| told.params.ack_rate.is_some(),
        |told| told.params.ack == 0,
    ),
    rule(
        "ack without a rate back: an acknowledgement takes no time",
        |told| told.params.ack > 0 && told.params.retries > 0,
        |told| {
            let back = told.back.unwrap_or(told.params);
            let rated = back.rate.is_some() || Told::alone(back).own_rate();
            told.params.ack_rate.is_none()
                && !rated
                && (told.params.ack_loss.is_some() || back.ber == 0.0)
        },
    ),
    rule(
        "fragment_header without mtu: nothing goes in fragments",
        |told| told.params.fragment_header > 0,
        |told| told.params.mtu.is_none(),
    ),
    rule(
        "window has no effect through a radio: it stops and waits for each answer",
        |told| told.params.window > 1,
        |told| told.params.radio.is_some(),
    ),
    rule(
        "ack, ack_rate and ack_loss have no effect through a radio: answers are free and arrive",
        |told| {
            told.params.ack > 0 || told.params.ack_rate.is_some() || told.params.ack_loss.is_some()
        },
        |told| told.params.radio.is_some(),
    ),
    rule(
        "mtu and fragment_header have no effect through a radio: messages go as a whole",
        |told| told.params.mtu.is_some() || told.params.fragment_header > 0,
        |told| told.params.radio.is_some(),
    ),
];

/// What of all this has no effect, in the order of the rules.
fn remarks<'a>(all: &[Told<'a>]) -> Vec<&'static str> {
    let holds = |rule: &&Rule| {
        let mut said = all.iter().filter(|told| (rule.said)(told));
        match rule.everywhere {
            true => said.clone().count() > 0 && said.all(rule.idle),
            false => said.any(rule.idle),
        }
    };
    let rules = RULES.iter().filter(holds);
    rules.map(|rule| rule.says).collect()
}

/// What several links are told that has no effect: each with what the link back has, if there is
/// one.
pub(crate) fn remarks_of_links<'a>(
    links: impl Iterator<Item = (&'a Timeline, Option<&'a Timeline>)>,
) -> Vec<&'static str> {
    let all: Vec<Told<'a>> = links
        .flat_map(|(timeline, back)| Told::all(timeline, back))
        .collect();
    remarks(&all)
}

impl LinkParams {
    /// What is said here and has no effect without something else that is not said.
    ///
    /// ```
    /// use farside_actors::link::LinkParams;
    /// let params: LinkParams = toml::from_str("tx_power = '5W'")?;
    /// let remark = "tx_power without a rate: a transmission takes no time, so no energy";
    /// assert_eq!(params.remarks(), [remark]);
    /// # Ok::<(), toml::de::Error>(())
    /// ```
    pub fn remarks(&self) -> Vec<&'static str> {
        remarks(&[Told::alone(self)])
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::LinkOverrides;
    use super::super::params::KEYS;
    use super::*;

    /// For each rule in turn: parameters that it is about, and others that have an effect with as
    /// little more as possible.
    const CASES: &[(&str, &str)] = &[
        (
            "rate = '1kbit/s'\ncontacts = [{ start = '0s', end = '9s', rate = '2kbit/s' }]",
            "rate = '1kbit/s'\ncontacts = [{ start = '0s', end = '9s' }]",
        ),
        (
            "trace = [1]\ncontacts = [{ start = '0s', end = '9s', rate = '2kbit/s' }]",
            "trace = [1]\ncontacts = [{ start = '0s', end = '9s' }]",
        ),
        (
            "latency = '1s'\ncontacts = [{ start = '0s', end = '9s', owlt = '2s' }]",
            "latency = '1s'\ncontacts = [{ start = '0s', end = '9s' }]",
        ),
        ("rate = '1kbit/s'\ntrace = [1]", "trace = [1]"),
        ("overhead = '9B'", "overhead = '9B'\nrate = '1kbit/s'"),
        (
            "jitter_shape = 'normal'",
            "jitter_shape = 'normal'\njitter = '1ms'",
        ),
        (
            "jitter_correlation = 0.5",
            "jitter_correlation = 0.5\njitter = '1ms'",
        ),
        (
            "min_delay = '1ms'",
            "min_delay = '1ms'\nlatency = '2ms'\njitter = '2ms'",
        ),
        ("reorder = 0.1\nfifo = true", "reorder = 0.1"),
        ("reorder_by = '9ms'", "reorder_by = '9ms'\nreorder = 0.1"),
        ("fifo = true", "in_order = true\njitter = '1ms'"),
        ("tx_power = '1W'", "tx_power = '1W'\nrate = '1kbit/s'"),
        ("rx_power = '1W'", "rx_power = '1W'\ntrace = [1]"),
        ("queue = 9", "queue = 9\nretries = 1"),
        ("lifetime = '9s'", "lifetime = '9s'\nrate = '1kbit/s'"),
        (
            "store_and_forward = true",
            "store_and_forward = true\ncontacts = [{ start = '0s', end = '9s' }]",
        ),
        ("timeout = '9s'", "timeout = '9s'\nretries = 1"),
        (
            "timeout = '9ms'\nretries = 1",
            "timeout = '10ms'\nretries = 1",
        ),
        ("window = 2", "window = 2\nretries = 1"),
        (
            "ack = '9B'\nrate = '1kbit/s'",
            "ack = '9B'\nrate = '1kbit/s'\nretries = 1",
        ),
        ("ack_loss = 0.1", "ack_loss = 0.1\nretries = 1"),
        (
            "ack_rate = '1kbit/s'\nretries = 1",
            "ack_rate = '1kbit/s'\nretries = 1\nack = '9B'",
        ),
        (
            "ack = '9B'\nretries = 1",
            "ack = '9B'\nretries = 1\nack_rate = '1kbit/s'",
        ),
        (
            "fragment_header = '9B'",
            "fragment_header = '9B'\nmtu = '1kB'",
        ),
        (
            "window = 2\nretries = 1\nradio = 'uhf'",
            "window = 2\nretries = 1",
        ),
        (
            "ack_loss = 0.1\nretries = 1\nradio = 'uhf'",
            "ack_loss = 0.1\nretries = 1",
        ),
        ("mtu = '1kB'\nradio = 'uhf'", "mtu = '1kB'"),
    ];

    fn remarks_on(text: &str) -> Vec<&'static str> {
        let params: LinkParams = toml::from_str(text).unwrap();
        params.remarks()
    }

    #[test]
    fn each_rule_speaks_where_it_holds_and_is_silent_where_it_does_not() {
        assert_eq!(RULES.len(), CASES.len());
        for (rule, (idle, works)) in RULES.iter().zip(CASES) {
            assert!(
                remarks_on(idle).contains(&rule.says),
                "{idle}: {}",
                rule.says
            );
            assert_eq!(remarks_on(works), [""; 0], "{works}");
        }
    }

    #[test]
    fn every_key_has_a_rule_or_always_an_effect() {
        let always = [
            "preset",
            "jitter",
            "loss",
            "burst",
            "duplicate",
            "corrupt",
            "ber",
            "contacts",
            "retries",
            "radio",
            "outage",
        ];
        let mut ruled = BTreeSet::new();
        for (idle, _) in CASES {
            let table: toml::Table = idle.parse().unwrap();
            ruled.extend(table.keys().cloned());
        }
        for key in KEYS {
            let known = ruled.contains(*key) || always.contains(key);
            assert!(
                known,
                "{key}: expected a rule, or a place among those that always matter"
            );
        }
    }

    #[test]
    fn what_is_meant_for_some_is_said_only_if_no_link_heeds_it() {
        let held: LinkParams = toml::from_str("store_and_forward = true").unwrap();
        let out = LinkOverrides {
            outage: Some(true),
            ..LinkOverrides::default()
        };
        let open = Timeline::new(held.clone());
        let closes =
            Timeline::new(held.clone()).then(farside::SimTime::from_secs(9), held.with(&out));
        let said = |links: &[&Timeline]| remarks_of_links(links.iter().map(|link| (*link, None)));
        assert_eq!(said(&[&open, &open]).len(), 1);
        assert_eq!(said(&[&open, &closes]), [""; 0]);
    }

    #[test]
    fn acknowledgements_go_at_the_rate_of_the_link_back() {
        let there = Timeline::new(toml::from_str("ack = '9B'\nretries = 1").unwrap());
        let back = Timeline::new(toml::from_str("rate = '1kbit/s'").unwrap());
        assert_eq!(remarks_of_links([(&there, None)].into_iter()).len(), 1);
        assert_eq!(
            remarks_of_links([(&there, Some(&back))].into_iter()),
            [""; 0]
        );
    }
}
