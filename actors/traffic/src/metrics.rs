//! What came of a run's traffic, in figures.

mod catalogue;

use std::sync::OnceLock;

use farside::SimTime;
use farside_actors::system::{Metric, with_about};
use serde::{Deserialize, Serialize};

/// What runs can be measured by, each with what its field says.
pub(crate) fn all() -> &'static [Metric] {
    static ALL: OnceLock<Vec<Metric>> = OnceLock::new();
    ALL.get_or_init(|| with_about(&catalogue::ALL, TrafficMetrics::about))
}

use super::monitor::{FlowTally, Tally};
use super::route::{Flow, TrafficPlan};

farside_actors::documented! {
    /// What came of all flows. Delays are from a message's source to its destination, over all
    /// hops, of the first copy that arrives.
    ///
    /// ```
    /// use farside_traffic::TrafficMetrics;
    /// let metrics = TrafficMetrics { sent: 4, delivered: 3, ..TrafficMetrics::default() };
    /// assert!(metrics.delays_s.is_empty() && metrics.delay_mean_s.is_none());
    /// ```
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct TrafficMetrics {
        /// How many flows there were.
        pub flows: u64,
        /// Messages sent by their sources.
        pub sent: u64,
        /// Messages that reached their destinations.
        pub delivered: u64,
        /// Messages of which nothing arrived, and nothing was on its way when the run ended.
        pub lost: u64,
        /// Messages of which nothing arrived, but something was on its way.
        pub in_flight: u64,
        /// Delivered among sent; `None` if nothing was sent.
        pub delivery_ratio: Option<f64>,
        /// The mean delay \[s\]; this and the next three are `None` if nothing arrived.
        pub delay_mean_s: Option<f64>,
        /// The delay that half of the messages did not exceed \[s\], of those in `delays_s`.
        pub delay_p50_s: Option<f64>,
        /// The delay that 95 % did not exceed \[s\], of those in `delays_s`.
        pub delay_p95_s: Option<f64>,
        /// The longest delay \[s\].
        pub delay_max_s: Option<f64>,
        /// The mean over flows of the time-average age of information at the receiver \[s\]: the
        /// age at an instant is the time since the freshest message that has arrived was sent
        /// (Kaul, Yates and Gruteser, INFOCOM 2012). Time counts from the flow's first arrival to
        /// the end of the run, or to the last arrival if the flow had stopped by then. `None` if no
        /// flow has had two.
        pub age_of_information_mean_s: Option<f64>,
        /// The greatest age at any receiver in that time \[s\].
        pub age_peak_s: Option<f64>,
        /// The bits of delivered messages over the time from the first flow's start to the end of
        /// the run \[bit/s\].
        pub goodput_bit_per_s: Option<f64>,
        /// Copies that arrived after the first of their message.
        pub duplicates: u64,
        /// Messages that arrived after a later one of their flow.
        pub reordered: u64,
        /// What transmissions took from those who sent, of messages whose fate is known \[J\]; 0
        /// unless links have a `tx_power`.
        pub transmit_energy_j: f64,
        /// The delays \[s\], sorted. Of more than 10,000 a sample in which each is as likely as
        /// any.
        pub delays_s: Vec<f64>,
        /// Each flow by itself.
        #[serde(skip)]
        pub by_flow: Vec<FlowMetrics>,
    }
}

/// What came of one flow; see [`TrafficMetrics`].
///
/// ```
/// use farside_traffic::FlowMetrics;
/// assert_eq!(FlowMetrics::default().delay_mean_s, None);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FlowMetrics {
    /// Its hosts: `rover > relay > earth`.
    pub name: String,
    /// Messages sent.
    pub sent: u64,
    /// Messages that arrived.
    pub delivered: u64,
    /// Messages on their way when the run ended.
    pub in_flight: u64,
    /// The mean delay \[s\].
    pub delay_mean_s: Option<f64>,
    /// The longest delay \[s\].
    pub delay_max_s: Option<f64>,
    /// The time-average age of information \[s\].
    pub age_mean_s: Option<f64>,
    /// The greatest age \[s\].
    pub age_peak_s: Option<f64>,
    /// Copies that arrived after the first.
    pub duplicates: u64,
    /// Messages that arrived after a later one.
    pub reordered: u64,
}

impl TrafficMetrics {
    pub(super) fn new(plan: &TrafficPlan, tally: &Tally, end: SimTime) -> Self {
        let flows = plan.flows.iter().zip(&tally.flows);
        let by_flow: Vec<FlowMetrics> = flows
            .clone()
            .map(|(flow, tally)| FlowMetrics::new(flow, tally, end))
            .collect();
        let sum = |of: fn(&FlowMetrics) -> u64| by_flow.iter().map(of).sum::<u64>();
        let (sent, delivered) = (sum(|flow| flow.sent), sum(|flow| flow.delivered));
        let in_flight = sum(|flow| flow.in_flight);
        let delay_sum_ns = tally.flows.iter().map(|flow| flow.delay_sum_ns).sum();
        let ages: Vec<f64> = by_flow.iter().filter_map(|flow| flow.age_mean_s).collect();
        let mut delays_ns = tally.delays_ns.clone();
        delays_ns.sort_unstable();
        let bytes: u128 = flows
            .map(|(flow, tally)| u128::from(tally.delivered) * u128::from(flow.config.size_bytes))
            .sum();
        let start = plan.flows.iter().map(|flow| flow.config.start).min();
        let span = end.since(SimTime::ZERO + start.unwrap_or_default());
        let greatest = |of: fn(&FlowMetrics) -> Option<f64>| {
            by_flow.iter().filter_map(of).max_by(f64::total_cmp)
        };
        TrafficMetrics {
            flows: by_flow.len() as u64,
            sent,
            delivered,
            lost: sent - delivered - in_flight,
            in_flight,
            delivery_ratio: (sent > 0).then(|| delivered as f64 / sent as f64),
            delay_mean_s: mean_s(delay_sum_ns, delivered),
            delay_p50_s: quantile_s(&delays_ns, 50),
            delay_p95_s: quantile_s(&delays_ns, 95),
            delay_max_s: greatest(|flow| flow.delay_max_s),
            age_of_information_mean_s: (!ages.is_empty())
                .then(|| ages.iter().sum::<f64>() / ages.len() as f64),
            age_peak_s: greatest(|flow| flow.age_peak_s),
            goodput_bit_per_s: (!span.is_zero()).then(|| bytes as f64 * 8.0 / span.as_secs_f64()),
            duplicates: sum(|flow| flow.duplicates),
            reordered: sum(|flow| flow.reordered),
            transmit_energy_j: tally.transmit_energy_j,
            delays_s: delays_ns.iter().map(|ns| seconds(*ns)).collect(),
            by_flow,
        }
    }
}

impl FlowMetrics {
    fn new(flow: &Flow, tally: &FlowTally, end: SimTime) -> Self {
        let stop = flow.config.stop.map(|stop| SimTime::ZERO + stop);
        // Nobody waits for a flow that is over: its age would only tell how long the run went on.
        let is_over = stop.is_some_and(|stop| stop <= end);
        let until = match tally.age.fresh {
            Some((last, _)) if is_over => last,
            _ => end,
        };
        FlowMetrics {
            name: flow.to_string(),
            sent: tally.sent,
            delivered: tally.delivered,
            in_flight: tally.in_flight,
            delay_mean_s: mean_s(tally.delay_sum_ns, tally.delivered),
            delay_max_s: (tally.delivered > 0).then(|| seconds(tally.delay_max_ns)),
            age_mean_s: tally.age.mean_s(until),
            age_peak_s: tally.age.peak_ns(until).map(seconds),
            duplicates: tally.duplicates,
            reordered: tally.reordered,
        }
    }
}

fn seconds(nanos: u64) -> f64 {
    nanos as f64 / 1e9
}

fn mean_s(sum_ns: u128, count: u64) -> Option<f64> {
    (count > 0).then(|| sum_ns as f64 / count as f64 / 1e9)
}

/// The least value that so many percent do not exceed.
fn quantile_s(sorted_ns: &[u64], percent: usize) -> Option<f64> {
    let rank = (sorted_ns.len() * percent).div_ceil(100);
    sorted_ns.get(rank.checked_sub(1)?).map(|ns| seconds(*ns))
}
