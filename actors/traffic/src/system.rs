//! Open-loop traffic, as scenarios see it: `[traffic]`.

use farside::{Report, SimDuration};
use farside_actors::system::settings::Table;
use farside_actors::system::{
    Account, Assembly, Builtin, Entries, Invariant, Metric, PictureError, Recording, Removable,
    Results, Section, Settings, Setup, SetupError, System,
};
use serde::{Deserialize, Serialize};

use crate::account;
use crate::{FlowConfig, TrafficConfig, TrafficError, TrafficMetrics, assemble, builtin, metrics};

/// The most flows that the summary shows one by one.
const MAX_SHOWN: usize = 12;

/// Open-loop traffic.
pub struct TrafficSystem;

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct TrafficScenario {
    traffic: TrafficConfig,
}

impl System for TrafficSystem {
    fn name(&self) -> &str {
        "traffic"
    }

    fn about(&self) -> &str {
        "hosts send messages on a schedule, to see what links make of them"
    }

    fn sections(&self) -> Vec<Section> {
        TrafficConfig::sections("traffic")
    }

    fn metrics(&self) -> &[Metric] {
        metrics::all()
    }

    fn invariants(&self) -> &[Invariant] {
        &INVARIANTS
    }

    fn scenarios(&self) -> &[Builtin] {
        &builtin::SCENARIOS
    }

    fn parse(
        &self,
        sections: toml::Deserializer<'_>,
    ) -> Result<Box<dyn Settings>, toml::de::Error> {
        Ok(Box::new(TrafficScenario::deserialize(sections)?))
    }
}

/// What should not happen.
const INVARIANTS: [Invariant; 3] = [
    Invariant::new("duplicate", "duplicates>0", "a message arrived twice").lasting(),
    Invariant::new("loss", "delivered<sent", "not all messages have arrived"),
    Invariant::new(
        "reordering",
        "reordered>0",
        "a message arrived after a later one",
    )
    .lasting(),
];

impl Settings for TrafficScenario {
    fn resolved(&self) -> Result<toml::Table, toml::ser::Error> {
        toml::Table::try_from(self)
    }

    fn check(&self) -> Result<(), SetupError> {
        Ok(self.traffic.check_all()?)
    }

    fn removable(&self) -> Vec<Removable> {
        let groups = 0..self.traffic.groups.len();
        let members = groups.map(|group| {
            let key = format!("traffic.groups.{group}.count");
            Removable::new("members of groups", key, Entries::Counted)
        });
        let listed = |what, key: &str| Removable::new(what, key, Entries::Listed);
        let rest = [
            listed("flows", "traffic.flow"),
            listed("groups", "traffic.groups"),
            listed("hosts", "traffic.hosts"),
        ];
        members.chain(rest).collect()
    }

    fn account(
        &self,
        actor: &str,
        run: &dyn Recording,
        until_ns: Option<u64>,
        _setup: &mut Setup<'_>,
    ) -> Result<Option<Account>, PictureError> {
        account::account(&self.traffic, actor, run, until_ns)
    }

    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError> {
        let mut flows = self.traffic.flows.iter();
        let endless = flows.position(|flow| flow.stop.is_none());
        if let (Some(index), None) = (endless, setup.until) {
            let message = "neither stop nor the scenario's until is given: it would never end";
            return Err(SetupError::value(&format!("traffic.flow.{index}"), message));
        }
        for (index, flow) in self.traffic.flows.iter().enumerate() {
            check_period(index, flow, setup.until)?;
        }
        let seed = setup.run_seed;
        let traffic = setup.wired(|sim, wire| assemble(sim, &self.traffic, seed, wire))?;
        let assembly =
            Assembly::new(move |report: &Report| results(&traffic.metrics(report.end_time)));
        let flows = self.traffic.flows.iter().enumerate();
        Ok(flows.fold(assembly, |assembly, (index, flow)| {
            assembly.with_planned(format!("traffic.flow.{index}"), flow.start)
        }))
    }
}

/// The most messages that a flow may be planned to send between two hosts.
const MAX_MESSAGES: f64 = 1e8;

/// Refuses a flow that would fill the memory before it ends.
fn check_period(
    index: usize,
    flow: &FlowConfig,
    until: Option<SimDuration>,
) -> Result<(), SetupError> {
    let end = flow.stop.into_iter().chain(until).min();
    let lasts = end.map_or(SimDuration::ZERO, |end| end.saturating_sub(flow.start));
    let burst = f64::from(flow.burst.unwrap_or(1));
    let period = flow.period;
    let messages = burst * lasts.as_secs_f64() / period.as_secs_f64();
    // A period of 0 is refused with the rest of the flow.
    if !period.is_zero() && messages > MAX_MESSAGES {
        let key = format!("traffic.flow.{index}.period");
        let message = format!(
            "{period}: expected at most {MAX_MESSAGES:.0} messages, and these are {messages:.0} in \
             {lasts}"
        );
        return Err(SetupError::value(&key, message));
    }
    Ok(())
}

impl From<TrafficError> for SetupError {
    fn from(error: TrafficError) -> Self {
        match error {
            TrafficError::Links(error) => error.into(),
            TrafficError::Value { key, message } => {
                SetupError::value(&format!("traffic.{key}"), message)
            }
        }
    }
}

fn results(metrics: &TrafficMetrics) -> Results {
    let mut results = Results::of(metrics);
    let mut line = |label: &str, text: String| {
        results.summary.push((label.to_owned(), text));
    };
    let (sent, delivered) = (metrics.sent, metrics.delivered);
    line("messages delivered", format!("{delivered} of {sent}"));
    line("delay, mean", seconds(metrics.delay_mean_s));
    line("delay, 95 %", seconds(metrics.delay_p95_s));
    line("delay, longest", seconds(metrics.delay_max_s));
    let age = [metrics.age_of_information_mean_s, metrics.age_peak_s];
    line("age, mean", seconds(age[0]));
    line("age, greatest", seconds(age[1]));
    if let Some(goodput) = metrics.goodput_bit_per_s {
        line("goodput", format!("{goodput:.0} bit/s"));
    }
    line("duplicates", metrics.duplicates.to_string());
    line("reordered", metrics.reordered.to_string());
    for flow in metrics.by_flow.iter().take(MAX_SHOWN) {
        let (delay, age) = (seconds(flow.delay_mean_s), seconds(flow.age_mean_s));
        let text = format!(
            "{} of {}, delay {delay}, age {age}",
            flow.delivered, flow.sent
        );
        line(&flow.name, text);
    }
    let rest = metrics.by_flow.len().saturating_sub(MAX_SHOWN);
    if rest > 0 {
        line("and", format!("{rest} more flows"));
    }
    results
}

fn seconds(seconds: Option<f64>) -> String {
    seconds.map_or_else(|| "-".to_owned(), |seconds| format!("{seconds:.3} s"))
}
