//! The monitor: counts what became of each message, from the committed records.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use farside::ids::EntityId;
use farside::random::{RandomKey, Stream};
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass};
use farside::{RunInfo, SimTime};

use super::route::TrafficPlan;
use super::station::SeenNumbers;

/// The most delays that are kept, of all flows together. Beyond, each has the same chance to be
/// among those kept.
pub(super) const MAX_DELAYS: usize = 10_000;

/// What is known of all flows.
pub(super) struct Tally {
    /// By the flow's place in the plan.
    pub(super) flows: Vec<FlowTally>,
    /// Delays from source to destination \[ns\].
    pub(super) delays_ns: Vec<u64>,
    /// How many delays there were, kept or not.
    delays: u64,
    /// What transmissions took from those who sent \[J\].
    pub(super) transmit_energy_j: f64,
    sampler: Stream,
}

/// What is known of one flow.
#[derive(Default)]
pub(super) struct FlowTally {
    pub(super) sent: u64,
    /// Messages that reached their destination.
    pub(super) delivered: u64,
    /// Messages that did not, and of which a copy was on its way when the run ended.
    pub(super) in_flight: u64,
    /// Copies that reached the destination after the first.
    pub(super) duplicates: u64,
    /// Messages whose first copy came after that of a later message.
    pub(super) reordered: u64,
    pub(super) delay_sum_ns: u128,
    pub(super) delay_max_ns: u64,
    pub(super) age: Age,
    arrived: SeenNumbers,
    pending: SeenNumbers,
    /// When each message that reached the first relay was sent, by its number.
    sent_at: Vec<SimTime>,
    /// The highest number that has arrived.
    latest: Option<u32>,
}

/// The age of the freshest message at a receiver, as time goes on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Age {
    /// When the freshest message arrived first, and when it was sent.
    pub(super) fresh: Option<(SimTime, SimTime)>,
    /// The first arrival.
    pub(super) first: SimTime,
    /// Twice the age integrated over time since the first arrival, up to the last fresh one
    /// \[ns^2\].
    pub(super) twice_area: u128,
    /// The greatest age up to the last fresh arrival \[ns\].
    peak_ns: u64,
}

impl Age {
    /// Something that was sent at `sent` arrives.
    pub(super) fn arrival(&mut self, now: SimTime, sent: SimTime) {
        match self.fresh {
            None => self.first = now,
            Some((_, last)) if sent <= last => return,
            Some(_) => *self = self.until(now),
        }
        self.fresh = Some((now, sent));
    }

    /// The same with the time up to `now` counted.
    pub(super) fn until(mut self, now: SimTime) -> Age {
        if let Some((since, sent)) = self.fresh {
            let square = |time: SimTime| u128::from(time.since(sent).as_nanos()).pow(2);
            self.twice_area = self.twice_area.saturating_add(square(now) - square(since));
            // Of several that arrive at once the freshest counts: no age without time.
            if now > since {
                self.peak_ns = self.peak_ns.max(now.since(sent).as_nanos());
            }
            self.fresh = Some((now, sent));
        }
        self
    }

    /// The greatest age up to `end` \[ns\]; `None` if nothing has arrived.
    pub(super) fn peak_ns(self, end: SimTime) -> Option<u64> {
        let (_, sent) = self.fresh?;
        Some(self.peak_ns.max(end.since(sent).as_nanos()))
    }

    /// The mean age up to `end` \[s\]; `None` if no time has passed since the first arrival.
    pub(super) fn mean_s(self, end: SimTime) -> Option<f64> {
        let whole = self.until(end);
        let span = u128::from(end.since(self.first).as_nanos());
        let is_known = self.fresh.is_some() && span > 0;
        is_known.then(|| whole.twice_area as f64 / (2 * span) as f64 / 1e9)
    }
}

/// Where a flow begins and ends, as the kernel knows hosts' actors.
struct Ends {
    flow: usize,
    source: EntityId,
    destination: EntityId,
    has_relays: bool,
}

pub(super) struct Monitor {
    tally: Arc<Mutex<Tally>>,
    /// Names of the first and last station of each flow, and whether there are others; by id.
    paths: BTreeMap<u32, (usize, String, String, bool)>,
    ends: BTreeMap<u32, Ends>,
}

impl Monitor {
    /// A monitor, and what it will write the counts to.
    pub(super) fn new(plan: &TrafficPlan, seed: u64) -> (Monitor, Arc<Mutex<Tally>>) {
        let path = |(index, flow): (usize, &super::Flow)| {
            let names = flow.names();
            let (source, destination) = (names[0].clone(), names[names.len() - 1].clone());
            (flow.id, (index, source, destination, names.len() > 2))
        };
        let tally = Arc::new(Mutex::new(Tally {
            flows: plan.flows.iter().map(|_| FlowTally::default()).collect(),
            delays_ns: Vec::new(),
            delays: 0,
            transmit_energy_j: 0.0,
            sampler: RandomKey::new(seed).text("traffic delays").stream(),
        }));
        let monitor = Monitor {
            tally: tally.clone(),
            paths: plan.flows.iter().enumerate().map(path).collect(),
            ends: BTreeMap::new(),
        };
        (monitor, tally)
    }
}

impl Observer for Monitor {
    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        for (id, (flow, source, destination, has_relays)) in &self.paths {
            let entity = |name: &str| {
                let message = || ObserverError(format!("no station is called {name:?}"));
                run.entity(name).ok_or_else(message)
            };
            let ends = Ends {
                flow: *flow,
                source: entity(source)?,
                destination: entity(destination)?,
                has_relays: *has_relays,
            };
            self.ends.insert(*id, ends);
        }
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        if let (true, Some(key)) = (record.class.is_fate(), record.match_key)
            && let Some(ends) = self.ends.get(&key.major())
        {
            let mut tally = self.tally.lock().unwrap_or_else(PoisonError::into_inner);
            tally.count(ends, key.minor(), record);
        }
        Ok(Flow::Continue)
    }
}

impl Tally {
    fn count(&mut self, ends: &Ends, number: u32, record: &Record<'_>) {
        self.transmit_energy_j += record.carriage.map_or(0.0, |carriage| carriage.energy_j);
        let flow = &mut self.flows[ends.flow];
        let is_first_hop = record.sender == ends.source;
        // Every message has a copy 0, which has one fate on each hop.
        if is_first_hop && record.copy == 0 {
            flow.sent += 1;
        }
        match record.class {
            RecordClass::InFlight => {
                let is_new = !flow.arrived.contains(number) && flow.pending.insert(number);
                flow.in_flight += u64::from(is_new);
            }
            RecordClass::Delivered if record.receiver == ends.destination => {
                if let Some(delay_ns) = flow.arrival(ends, number, record) {
                    self.keep(delay_ns);
                }
            }
            RecordClass::Delivered if is_first_hop && ends.has_relays => {
                let place = number as usize;
                if flow.sent_at.len() <= place {
                    flow.sent_at.resize(place + 1, SimTime::MAX);
                }
                flow.sent_at[place] = record.sent;
            }
            _ => {}
        }
    }

    /// Keeps a delay, or by the same chance for all, does not.
    fn keep(&mut self, delay_ns: u64) {
        self.delays += 1;
        if self.delays_ns.len() < MAX_DELAYS {
            self.delays_ns.push(delay_ns);
            return;
        }
        let place = self.sampler.below(self.delays) as usize;
        if let Some(kept) = self.delays_ns.get_mut(place) {
            *kept = delay_ns;
        }
    }
}

impl FlowTally {
    /// A copy reaches the destination; if it is the first, the message's delay \[ns\].
    fn arrival(&mut self, ends: &Ends, number: u32, record: &Record<'_>) -> Option<u64> {
        if !self.arrived.insert(number) {
            self.duplicates += 1;
            return None;
        }
        let sent = match ends.has_relays {
            true => self.sent_at.get(number as usize).copied(),
            false => None,
        };
        let sent = sent.unwrap_or(record.sent);
        let now = record.time();
        let delay_ns = now.since(sent).as_nanos();
        self.delivered += 1;
        self.delay_sum_ns += u128::from(delay_ns);
        self.delay_max_ns = self.delay_max_ns.max(delay_ns);
        self.reordered += u64::from(self.latest.is_some_and(|latest| number < latest));
        self.latest = self.latest.max(Some(number));
        self.age.arrival(now, sent);
        Some(delay_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn ages_are_those_told_instant_by_instant(
            messages in prop::collection::vec((0u64..60, 0u64..40), 1..12),
            rest in 0u64..20,
        ) {
            // (arrival, sent) of messages that overtake each other, in order of arrival.
            let mut arrivals: Vec<(u64, u64)> =
                messages.iter().map(|(sent, delay)| (sent + delay, *sent)).collect();
            arrivals.sort_unstable();
            let (first, end) = (arrivals[0].0, arrivals[arrivals.len() - 1].0 + rest);
            let mut age = Age::default();
            for (at, sent) in &arrivals {
                age.arrival(SimTime::from_nanos(*at), SimTime::from_nanos(*sent));
            }
            let freshest = |at: u64| {
                let known = arrivals.iter().filter(|(arrival, _)| *arrival <= at);
                known.map(|(_, sent)| *sent).max().unwrap()
            };
            // Over a nanosecond the age grows by one, so its mean is half of one more.
            let twice: u64 = (first..end).map(|at| 2 * (at - freshest(at)) + 1).sum();
            let mean_s = age.mean_s(SimTime::from_nanos(end));
            let told = (end > first).then(|| twice as f64 / (2 * (end - first)) as f64 / 1e9);
            prop_assert_eq!(mean_s, told);
            // The greatest age is reached just before a fresh arrival, or at the end.
            let just_before = (first + 1..=end).map(|at| at - freshest(at - 1));
            let peak = just_before.chain([first - freshest(first)]).max();
            prop_assert_eq!(age.peak_ns(SimTime::from_nanos(end)), peak);
        }
    }
}
