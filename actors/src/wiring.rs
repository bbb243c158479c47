//! Which links and processors a system wants, and what it may know of them once they are declared.

mod build;
mod degrades;
mod pattern;
mod processors;

use std::collections::BTreeMap;
use std::sync::Arc;

use farside::actor::Target;
use farside::{Carrier, HostId, SimDuration, Simulation};
use farside_worlds::HeightField;
use nalgebra::Point3;

pub use build::LinkBuilder;
use processors::Processors;

use crate::link::{LinkConfigError, LinkParams};
use crate::processor::{Processor, ProcessorChange, Speed};

/// The links and processors that a system wants, and where its hosts stand at first. A system lists
/// them all and hands them over in one call, so that whatever it asks of links afterwards is asked
/// of all of them.
///
/// ```
/// use farside::{SimDuration, Simulation};
/// use farside_actors::link::LinksConfig;
/// use farside_actors::wiring::{LinkBuilder, Wiring};
/// let mut sim = Simulation::new(1);
/// let (base, rover) = (sim.host("base"), sim.host("rover"));
/// let mut wiring = Wiring::default();
/// wiring.both_ways((base, "base"), (rover, "rover"));
/// let config: LinksConfig = toml::from_str("default = { latency = '700ms' }")?;
/// let links = LinkBuilder::new(&config, &[])?.build(&mut sim, &wiring)?;
/// assert_eq!(links.slowest(), SimDuration::from_millis(700));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Wiring {
    pub(crate) pairs: Vec<(usize, usize)>,
    pub(crate) hosts: Vec<(HostId, String)>,
    /// By host: its place in `hosts`.
    known: BTreeMap<HostId, usize>,
    pub(crate) places_m: BTreeMap<String, Point3<f64>>,
    pub(crate) terrain: Option<Arc<HeightField>>,
    pub(crate) processors: Vec<(String, String, Speed)>,
}

impl Wiring {
    /// Wants the link `{from}-{to}`.
    pub fn link(&mut self, from: (HostId, &str), to: (HostId, &str)) {
        let (from, to) = (self.host(from), self.host(to));
        self.pairs.push((from, to));
    }

    /// Wants the links `{a}-{b}` and `{b}-{a}`.
    pub fn both_ways(&mut self, a: (HostId, &str), b: (HostId, &str)) {
        self.link(a, b);
        self.link(b, a);
    }

    fn host(&mut self, (host, name): (HostId, &str)) -> usize {
        *self.known.entry(host).or_insert_with(|| {
            self.hosts.push((host, name.to_owned()));
            self.hosts.len() - 1
        })
    }

    /// Says where the host called `name` stands at first, in metres in the world's frame. Radios
    /// ask for it.
    pub fn place(&mut self, name: &str, place_m: Point3<f64>) {
        self.places_m.insert(name.to_owned(), place_m);
    }

    /// Says what ground hosts stand on, and radios look over.
    pub fn terrain(&mut self, terrain: Arc<HeightField>) {
        self.terrain = Some(terrain);
    }

    /// Wants the processor `{host}/{name}`, this fast when nothing slows it down.
    ///
    /// ```
    /// use farside::Simulation;
    /// use farside_actors::processor::Speed;
    /// use farside_actors::wiring::{LinkBuilder, Links, Wiring};
    /// let mut wiring = Wiring::default();
    /// wiring.processor("rover_02", "planner", Speed::PerS(1000));
    /// let links = LinkBuilder::default().build(&mut Simulation::new(1), &wiring)?;
    /// assert!(links.has_processor("rover_02/planner"));
    /// # Ok::<(), farside_actors::link::LinkConfigError>(())
    /// ```
    pub fn processor(&mut self, host: &str, name: &str, speed: Speed) {
        self.processors
            .push((host.to_owned(), name.to_owned(), speed));
    }

    /// The wanted links in order, each from one host and name to another.
    pub fn links(&self) -> impl Iterator<Item = ((HostId, &str), (HostId, &str))> {
        let host = |at: usize| (self.hosts[at].0, self.hosts[at].1.as_str());
        self.pairs
            .iter()
            .map(move |&(from, to)| (host(from), host(to)))
    }

    /// Of each wanted link, which one is the link back; none if none is wanted.
    pub(crate) fn backs(&self) -> Vec<Option<usize>> {
        let pairs = self.pairs.iter().enumerate();
        let mut sorted: Vec<_> = pairs.map(|(at, pair)| (*pair, at)).collect();
        sorted.sort_unstable();
        let back = |&(from, to): &(usize, usize)| {
            let found = sorted.binary_search_by_key(&(to, from), |(pair, _)| *pair);
            found.ok().map(|found| sorted[found].1)
        };
        self.pairs.iter().map(back).collect()
    }
}

/// Declares all links of a wiring. What a system is given that is put together without a scenario.
pub type Wire<'a> = dyn FnMut(&mut Simulation, &Wiring) -> Result<Links, LinkConfigError> + 'a;

/// What is known of the links of a system before the run, by who plans: what they have when nothing
/// degrades them. Links act by the truth, degradations included; so do processors, which are handed
/// over here.
#[derive(Clone, Debug, Default)]
pub struct Links {
    /// By name, the number of a host.
    hosts: BTreeMap<String, usize>,
    nominal: BTreeMap<(usize, usize), Arc<LinkParams>>,
    slowest: SimDuration,
    slowest_rate_bit_per_s: Option<u64>,
    processors: Processors,
    remarks: Vec<String>,
}

impl Links {
    /// Declares each link of a wiring with the carrier that `carrier` makes for it, from the names
    /// of its ends, for simulations without a scenario. Parameters are then not known.
    ///
    /// ```
    /// use farside::{FixedDelay, SimDuration, Simulation};
    /// use farside_actors::wiring::{Links, Wiring};
    /// let mut sim = Simulation::new(1);
    /// let (a, b) = (sim.host("a"), sim.host("b"));
    /// let mut wiring = Wiring::default();
    /// wiring.link((a, "a"), (b, "b"));
    /// let delay = SimDuration::from_millis(5);
    /// let links = Links::carried(&mut sim, &wiring, |_, _| FixedDelay::new(delay));
    /// assert_eq!((links.slowest(), links.nominal("a", "b")), (delay, None));
    /// ```
    pub fn carried<C: Carrier>(
        sim: &mut Simulation,
        wiring: &Wiring,
        mut carrier: impl FnMut(&str, &str) -> C,
    ) -> Links {
        let mut links = Links {
            processors: Processors::healthy(&wiring.processors),
            ..Links::default()
        };
        for ((a, from), (b, to)) in wiring.links() {
            let carrier = carrier(from, to);
            links.reckon(carrier.min_delay(), carrier.rate_bit_per_s());
            sim.link(a, b, &format!("{from}-{to}"), carrier);
        }
        links
    }

    fn reckon(&mut self, min_delay: SimDuration, rate_bit_per_s: Option<u64>) {
        self.slowest = self.slowest.max(min_delay);
        let rates = [self.slowest_rate_bit_per_s, rate_bit_per_s];
        self.slowest_rate_bit_per_s = rates.into_iter().flatten().min();
    }

    /// What is known of the links of a wiring, from what each has.
    fn of(wiring: &Wiring, nominal: impl Iterator<Item = Arc<LinkParams>>) -> Links {
        let hosts = wiring.hosts.iter().enumerate();
        let mut links = Links {
            hosts: hosts.map(|(at, (_, name))| (name.clone(), at)).collect(),
            ..Links::default()
        };
        let mut all = Vec::with_capacity(wiring.pairs.len());
        for (pair, nominal) in wiring.pairs.iter().zip(nominal) {
            links.reckon(nominal.min_delay(), nominal.fastest_bit_per_s());
            all.push((*pair, nominal));
        }
        links.nominal = all.into_iter().collect();
        links
    }

    /// What links and processors are told that has no effect, for people.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Whether the wiring wanted the processor of this name, `{host}/{processor}`.
    pub fn has_processor(&self, name: &str) -> bool {
        self.processors.get(name).is_some()
    }

    /// Hands over a processor that the wiring wanted, by its name `{host}/{processor}`: `declare`
    /// declares the actor that has it. When the processor becomes slower or faster this actor is
    /// told, and with it the log.
    ///
    /// ```
    /// use farside::prelude::*;
    /// use farside_actors::processor::{Processor, ProcessorChange, Speed};
    /// use farside_actors::wiring::{LinkBuilder, Wiring};
    /// struct Planner(Processor);
    /// impl Actor for Planner { type Accepts = (ProcessorChange,); }
    /// impl Handler<ProcessorChange> for Planner {
    ///     fn handle(&mut self, _: ProcessorChange, _: &mut Context<'_, Self>) -> Outcome {
    ///         Ok(())
    ///     }
    /// }
    /// let mut sim = Simulation::new(1);
    /// let host = sim.host("rover_02");
    /// let mut wiring = Wiring::default();
    /// wiring.processor("rover_02", "planner", Speed::PerS(1000));
    /// let links = LinkBuilder::default().build(&mut sim, &wiring)?;
    /// links.processor(&mut sim, "rover_02/planner", |sim, processor| {
    ///     sim.actor(host, "rover_02", move |_| Planner(processor.clone()))
    /// });
    /// # Ok::<(), farside_actors::link::LinkConfigError>(())
    /// ```
    ///
    /// # Panics
    /// When the wiring did not want it.
    pub fn processor<T: Target<ProcessorChange> + Copy>(
        &self,
        sim: &mut Simulation,
        name: &str,
        declare: impl FnOnce(&mut Simulation, Processor) -> T,
    ) -> T {
        let processor = self.processors.get(name);
        let processor = processor.unwrap_or_else(|| panic!("the wiring wants no {name}"));
        let actor = declare(sim, processor.clone());
        for (at, slowdown) in processor.slowdowns() {
            let change = ProcessorChange {
                processor: name.to_owned(),
                slowdown: slowdown.factor(),
            };
            sim.tell_at(at, actor, change);
        }
        actor
    }

    /// What the link from one host to another has without degradations; none if there is no such
    /// link. Its contacts are included: those of `[links]`, or else of the scenario's contact plan.
    ///
    /// Planners plan by this, and links act by the truth: a degradation is for the planner to find
    /// out. What is nominal does not change during a run.
    pub fn nominal(&self, from: &str, to: &str) -> Option<&LinkParams> {
        let pair = (*self.hosts.get(from)?, *self.hosts.get(to)?);
        self.nominal.get(&pair).map(Arc::as_ref)
    }

    /// The least time that a message takes over the slowest of the links, those through radios
    /// included; zero if there are none.
    pub fn slowest(&self) -> SimDuration {
        self.slowest
    }

    /// The lowest rate of a link at its fastest \[bit/s\]; none if no link has a rate.
    pub fn slowest_rate_bit_per_s(&self) -> Option<u64> {
        self.slowest_rate_bit_per_s
    }
}
