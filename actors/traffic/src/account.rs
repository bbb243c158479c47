//! What a host sent and heard in a run, and when nothing came where something was to come: from the log.

use std::collections::{BTreeMap, BTreeSet};

use farside::SimDuration;
use farside::encoding::Schema;
use farside::record::RecordClass;
use farside_actors::system::{Account, Doing, Phase, PictureError, Recording, outages};

use crate::{Datagram, Flow, TrafficConfig, TrafficPlan};

/// After so many periods without a message of a flow its receiver is told to wait.
const PERIODS: u64 = 3;

/// As many flows as are named.
const NAMED: usize = 3;

/// The account of a host up to a time; none if there is no such host.
pub(crate) fn account(
    config: &TrafficConfig,
    actor: &str,
    run: &dyn Recording,
    until_ns: Option<u64>,
) -> Result<Option<Account>, PictureError> {
    let wrong = |what: String| PictureError::NotDrawn(what);
    let plan = TrafficPlan::new(config).map_err(|error| wrong(error.to_string()))?;
    if !plan.hosts.iter().any(|host| host == actor) {
        return Ok(None);
    }
    let schema = Schema::of::<Datagram>().map_err(|error| wrong(error.to_string()))?;
    let mut heard: BTreeMap<u32, Vec<u64>> = BTreeMap::new();
    let mut last_ns = 0;
    let ending = run.for_each(&mut |record| {
        last_ns = last_ns.max(record.time_ns);
        if record.class != RecordClass::Delivered || record.actor != actor {
            return Ok(());
        }
        let datagram: Datagram = schema.decode(record.body).map_err(|error| {
            PictureError::Unreadable(format!("a message to {actor} cannot be read: {error}"))
        })?;
        heard.entry(datagram.flow).or_default().push(record.time_ns);
        Ok(())
    })?;
    let end_ns = ending.time_ns.unwrap_or(last_ns);
    let until_ns = until_ns.map_or(end_ns, |until| until.min(end_ns));
    let host = Host {
        plan: &plan,
        actor,
        heard: &heard,
        until_ns,
    };
    Ok(Some(
        host.account().with_outages(outages(run, actor)?, until_ns),
    ))
}

/// A host, as far as it is told.
struct Host<'p> {
    plan: &'p TrafficPlan,
    actor: &'p str,
    /// When a message of a flow came, by the flow's id.
    heard: &'p BTreeMap<u32, Vec<u64>>,
    until_ns: u64,
}

/// A flow of which nothing comes, from when to when.
struct Silence<'p> {
    flow: &'p Flow,
    from: &'p str,
    span_ns: [u64; 2],
}

impl Host<'_> {
    fn account(&self) -> Account {
        let silences = self.silences();
        let spans = silences.iter().flat_map(|silence| silence.span_ns);
        let own = self.own().flat_map(|flow| [start_ns(flow), stop_ns(flow)]);
        let coming = self
            .coming()
            .flat_map(|(flow, _)| [start_ns(flow), stop_ns(flow)]);
        let mut instants: BTreeSet<u64> = spans.chain(own).chain(coming).collect();
        instants.retain(|time_ns| *time_ns < self.until_ns);
        instants.insert(0);
        let instants: Vec<u64> = instants.into_iter().collect();
        let mut account = Account::default();
        for (at, from_ns) in instants.iter().enumerate() {
            let until_ns = instants.get(at + 1).map_or(self.until_ns, |next| *next);
            account.push(self.phase((*from_ns, until_ns), &silences));
        }
        account
    }

    fn own(&self) -> impl Iterator<Item = &Flow> {
        let flows = self.plan.flows.iter();
        flows.filter(|flow| flow.names().first().is_some_and(|name| name == self.actor))
    }

    /// The flows that come to it or pass it, and from whom they come.
    fn coming(&self) -> impl Iterator<Item = (&Flow, &str)> {
        self.plan.flows.iter().filter_map(|flow| {
            let at = flow.names().iter().position(|name| name == self.actor)?;
            Some((flow, flow.names()[at.checked_sub(1)?].as_str()))
        })
    }

    fn silences(&self) -> Vec<Silence<'_>> {
        let mut silences = Vec::new();
        for (flow, from) in self.coming() {
            let heard = self.heard.get(&flow.id).map_or(&[][..], Vec::as_slice);
            // A message that is on its way when the flow ends may still come.
            let last_ns = heard.last().copied().unwrap_or(0);
            let end_ns = stop_ns(flow).max(last_ns).min(self.until_ns);
            let times = [start_ns(flow)].into_iter().chain(heard.iter().copied());
            let times: Vec<u64> = times
                .filter(|time_ns| *time_ns <= end_ns)
                .chain([end_ns])
                .collect();
            let most_ns = flow.config.period.as_nanos().saturating_mul(PERIODS);
            let gaps = times.windows(2).map(|pair| [pair[0], pair[1]]);
            let long = gaps.filter(|[from_ns, to_ns]| to_ns.saturating_sub(*from_ns) > most_ns);
            silences.extend(long.map(|span_ns| Silence {
                flow,
                from,
                span_ns,
            }));
        }
        silences
    }

    fn phase(&self, (from_ns, until_ns): (u64, u64), silences: &[Silence<'_>]) -> Phase {
        let is_now = |[from, to]: [u64; 2]| from <= from_ns && from_ns < to;
        let silent: Vec<&Silence<'_>> = silences
            .iter()
            .filter(|silence| is_now(silence.span_ns))
            .collect();
        let sends = self
            .own()
            .filter(|flow| is_now([start_ns(flow), stop_ns(flow)]));
        let sends = sends.count();
        let hears = self.coming().filter(|(flow, _)| start_ns(flow) <= from_ns);
        let hears = hears.filter(|(flow, _)| is_now([start_ns(flow), stop_ns(flow)]));
        let hears = hears.count();
        let is_over = self.own().all(|flow| stop_ns(flow) <= from_ns)
            && self.coming().all(|(flow, _)| stop_ns(flow) <= from_ns);
        let mut parts = Vec::new();
        for (count, does) in [(sends, "sends"), (hears, "is sent")] {
            match count {
                0 => {}
                1 => parts.push(format!("{does} 1 flow")),
                count => parts.push(format!("{does} {count} flows")),
            }
        }
        let mut waits_for = BTreeSet::new();
        let doing = match (silent.is_empty(), is_over) {
            (false, _) => Doing::Waiting,
            (true, true) => Doing::Done,
            (true, false) => Doing::Active,
        };
        let named = silent.iter().take(NAMED).map(|silence| {
            let since = SimDuration::from_nanos(silence.span_ns[0]);
            format!("hears nothing of {} since {since}", silence.flow)
        });
        parts.extend(named);
        if silent.len() > NAMED {
            parts.push(format!("nor of {} more", silent.len() - NAMED));
        }
        waits_for.extend(silent.iter().map(|silence| silence.from.to_owned()));
        let text = match (parts.is_empty(), doing) {
            (false, _) => parts.join(", "),
            (true, Doing::Done) => "all its flows are over".to_owned(),
            (true, _) => "has nothing to send and is sent nothing".to_owned(),
        };
        Phase {
            from_ns,
            until_ns,
            doing,
            text,
            waits_for: waits_for.into_iter().collect(),
        }
    }
}

fn start_ns(flow: &Flow) -> u64 {
    flow.config.start.as_nanos()
}

/// When a flow ends; never unless it is said.
fn stop_ns(flow: &Flow) -> u64 {
    flow.config.stop.map_or(u64::MAX, SimDuration::as_nanos)
}
