//! What is said of single differences, in a few words: how an actor was reached, what a link decided, and
//! whether that was drawn.

use farside::SimDuration;
use farside::carrier::Carriage;
use farside::record::RecordClass;
use farside::ruling::{MessageId, MessageNumber, RULED};

use crate::log::LoggedRecord;

/// Reasons of losses by chance.
const BY_CHANCE: [&str; 3] = ["loss", "burst", "corrupt"];

/// What both logs have of a difference; and how the logs are called.
pub(super) struct Told<'t> {
    pub(super) both: [Option<&'t LoggedRecord>; 2],
    pub(super) files: [&'t str; 2],
}

impl Told<'_> {
    /// One of the records.
    fn one(&self) -> Option<&LoggedRecord> {
        self.both[0].or(self.both[1])
    }

    /// What the message is called; its topic, if it is an event without a message.
    pub(super) fn name(&self) -> String {
        self.message()
            .or_else(|| self.one().map(|one| one.topic.clone()))
            .unwrap_or_default()
    }

    /// What the message is called; none, if it is none.
    pub(super) fn message(&self) -> Option<String> {
        let one = self.one().filter(|one| one.class.is_fate())?;
        let id = MessageId {
            sender: one.sender.clone(),
            receiver: one.receiver.clone(),
            kind: one.kind.clone(),
            number: MessageNumber::Ordinal(one.ordinal),
            copy: one.copy,
        };
        Some(id.to_string())
    }

    /// In which of the logs it is alone; none, if both have it.
    fn only(&self) -> Option<String> {
        match self.both {
            [Some(_), None] => Some(format!(" in {} only", self.files[0])),
            [None, Some(_)] => Some(format!(" in {} only", self.files[1])),
            _ => None,
        }
    }

    /// How it reached its receiver otherwise.
    pub(super) fn received(&self) -> String {
        let what = match self.one().map(|one| one.class) {
            Some(RecordClass::Start) => "starts",
            Some(RecordClass::Crash) => "crashes",
            Some(RecordClass::Restart) => "restarts",
            Some(RecordClass::Told) => {
                let kind = self.one().map_or("", |one| one.kind.as_str());
                return format!(
                    "is told {kind}{}",
                    self.only().unwrap_or_else(|| " otherwise".to_owned())
                );
            }
            _ => return self.message_received(),
        };
        let how = self.only().unwrap_or_else(|| " otherwise".to_owned());
        format!("{what}{how}")
    }

    fn message_received(&self) -> String {
        let name = self.name();
        let is_delivered = |record: &&LoggedRecord| record.class == RecordClass::Delivered;
        let [a, b] = self.both;
        match (a.filter(is_delivered), b.filter(is_delivered)) {
            (Some(a), Some(b)) => {
                let (x, y) = (a.key.time_ns, b.key.time_ns);
                let by = SimDuration::from_nanos(x.abs_diff(y));
                let when = match x.cmp(&y) {
                    std::cmp::Ordering::Less => format!(", {by} later in {}", self.files[1]),
                    std::cmp::Ordering::Greater => format!(", {by} earlier in {}", self.files[1]),
                    std::cmp::Ordering::Equal => String::new(),
                };
                let says = match a.sent_ns == b.sent_ns && x != y {
                    true => "",
                    false => " otherwise",
                };
                format!("receives {name}{says}{when}")
            }
            (Some(_), None) => self.received_once(0, b),
            (None, Some(_)) => self.received_once(1, a),
            // Where it arrived it is on a topic that is not compared.
            (None, None) if a.is_some() => self.received_once(1, a),
            (None, None) => self.received_once(0, b),
        }
    }

    /// Received in one log; what became of it in the other.
    fn received_once(&self, side: usize, other: Option<&LoggedRecord>) -> String {
        let name = self.name();
        match other {
            None => format!("receives {name} in {} only", self.files[side]),
            Some(other) => format!(
                "receives {name} in {} only, {} in {}",
                self.files[side],
                fate(other),
                self.files[1 - side]
            ),
        }
    }

    /// How an actor does something otherwise.
    pub(super) fn done(&self) -> String {
        let how = self.only();
        let one = self.one();
        match one.map(|one| (one.class, one.kind.as_str())) {
            Some((RecordClass::Timer, kind)) => {
                let how = how.unwrap_or_else(|| " at another time".to_owned());
                format!("its timer {kind} fires{how}")
            }
            Some((RecordClass::Change, _)) => {
                let link = one.map_or("", |one| one.receiver.as_str());
                format!("changes {link}{}", how.unwrap_or_default())
            }
            _ => format!(
                "sends {}{}",
                self.name(),
                how.unwrap_or_else(|| " otherwise".to_owned())
            ),
        }
    }

    /// What became of a message in both logs.
    pub(super) fn fates(&self) -> String {
        let [a, b] = self
            .both
            .map(|record| record.map_or("on a topic that is not compared".to_owned(), fate));
        match (a == b, self.both) {
            (true, [Some(x), Some(y)]) => {
                let at = |record: &LoggedRecord| {
                    SimDuration::from_nanos(record.key.time_ns.saturating_sub(record.sent_ns))
                };
                format!("{a} after {} | {}", at(x), at(y))
            }
            _ => format!("{a} | {b}"),
        }
    }

    /// Why it was lost in one of them, or in both.
    fn lost_for(&self) -> Option<&str> {
        let both = self.both.into_iter().flatten();
        let mut reasons = both.map(|one| one.reason.as_str());
        reasons.find(|reason| !reason.is_empty())
    }

    /// Why it was lost, if that was by chance.
    pub(super) fn by_chance(&self) -> Option<String> {
        let is_ruled = self
            .both
            .into_iter()
            .flatten()
            .any(|one| one.reason == RULED);
        let lost = self
            .lost_for()
            .filter(|lost| BY_CHANCE.contains(lost) && !is_ruled);
        lost.map(str::to_owned)
    }

    /// What is known of the draw behind what a link decided.
    pub(super) fn draw(&self) -> String {
        if self
            .both
            .into_iter()
            .flatten()
            .any(|one| one.reason == RULED)
        {
            return "none: it is ruled by the scenario".to_owned();
        }
        match (self.by_chance(), self.lost_for()) {
            (Some(reason), _) => format!("of {reason}, whose number is not in the log"),
            (None, Some(reason)) => format!("none: lost for {reason}"),
            (None, None) => self.parts(),
        }
    }

    /// What chance added to a delay, which is in the log, and the other parts that differ.
    fn parts(&self) -> String {
        let carriage = |record: Option<&LoggedRecord>| record.and_then(|one| one.carriage);
        let [Some(a), Some(b)] = self.both.map(carriage) else {
            return "not in the log: the link does not say how it carried it".to_owned();
        };
        let time = |part: &dyn Fn(&Carriage) -> SimDuration| {
            [part(&a), part(&b)].map(|time| time.to_string())
        };
        let jitter = [&a, &b].map(|carriage| {
            let size = SimDuration::from_nanos(carriage.jitter_ns.unsigned_abs());
            let sign = if carriage.jitter_ns < 0 { "-" } else { "" };
            format!("{sign}{size}")
        });
        let drawn = match jitter[0] == jitter[1] {
            true => "the same in both".to_owned(),
            false => format!("jitter {} | {}", jitter[0], jitter[1]),
        };
        let parts = [
            ("queue", time(&|carriage| carriage.queue)),
            ("serialization", time(&|carriage| carriage.serialization)),
            ("propagation", time(&|carriage| carriage.propagation)),
            ("retries", time(&|carriage| carriage.retries)),
            ("attempts", [a.attempts.to_string(), b.attempts.to_string()]),
        ];
        let differing = parts.into_iter().filter(|(_, [a, b])| a != b);
        let texts: Vec<String> = differing
            .map(|(part, [a, b])| format!("{part} {a} | {b}"))
            .collect();
        match texts.is_empty() {
            true => drawn,
            false => format!("{drawn}; what differs is {}", texts.join(", ")),
        }
    }

    /// Whether it waited longer in one, or found a queue full: what the link had carried before decided.
    pub(super) fn is_by_traffic(&self) -> bool {
        let reasons = self
            .both
            .into_iter()
            .flatten()
            .map(|one| one.reason.as_str());
        let is_full = |reason: &str| matches!(reason, "queue_full" | "collision" | "expired");
        let mut queues = self
            .both
            .into_iter()
            .flatten()
            .filter_map(|one| Some(one.carriage?.queue));
        let waits = match (queues.next(), queues.next()) {
            (Some(a), Some(b)) => a != b,
            _ => false,
        };
        waits || reasons.into_iter().any(is_full)
    }
}

fn fate(record: &LoggedRecord) -> String {
    match (record.class, record.reason.as_str()) {
        (class, "") => class.name().to_owned(),
        (class, reason) => format!("{} for {reason}", class.name()),
    }
}
