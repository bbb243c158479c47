//! Links from a scenario, by name.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use farside::{HostId, SimDuration, SimTime, Simulation};
use farside_worlds::HeightField;
use farside_worlds::contacts::{CapacityTrace, ContactPlan};
use nalgebra::Point3;

use super::degrades::{SharedTimeline, Worse};
use super::pattern::{Pattern, shape};
use super::processors::Slowdowns;
use super::{Links, Wiring};
use crate::link::{
    Contacts, Degrade, Degraded, Link, LinkChange, LinkConfigError, LinkOverrides, LinkParams,
    LinksConfig, Timeline, Trace, remarks_of_links,
};
use crate::radio::{RadioBuilder, RadioConfig};
use crate::system::settings::Table;
use farside::suggest::{closest, did_you_mean};

/// Builds links by name from [`LinksConfig`] and [`Degrade`]s, and checks that every pattern
/// matches some link.
///
/// ```
/// use farside::Simulation;
/// use farside_actors::link::LinksConfig;
/// use farside_actors::wiring::{LinkBuilder, Wiring};
/// let config: LinksConfig = toml::from_str("'base-rover_*' = { loss = 0.5 }").unwrap();
/// let mut sim = Simulation::new(1);
/// let (base, rover) = (sim.host("base"), sim.host("rover_1"));
/// let mut wiring = Wiring::default();
/// wiring.link((base, "base"), (rover, "rover_1"));
/// let links = LinkBuilder::new(&config, &[])?.build(&mut sim, &wiring)?;
/// assert_eq!(links.nominal("base", "rover_1").unwrap().loss, 0.5);
///
/// let config: LinksConfig = toml::from_str("'base-rovre_*' = { loss = 0.5 }").unwrap();
/// let builder = LinkBuilder::new(&config, &[])?;
/// let error = builder.build(&mut Simulation::new(1), &wiring).unwrap_err().to_string();
/// assert!(error.ends_with("matches no link; did you mean \"base-rover_*\"?"));
/// # Ok::<(), farside_actors::link::LinkConfigError>(())
/// ```
#[derive(Default)]
pub struct LinkBuilder {
    default: LinkParams,
    overrides: Vec<(Pattern, LinkOverrides)>,
    degrades: Vec<Worse>,
    /// When processors are slower.
    slowdowns: Slowdowns,
    names: Vec<String>,
    /// The radios that links may go through.
    radios: Vec<RadioBuilder>,
    /// The hosts that links join.
    hosts: BTreeMap<HostId, String>,
    /// Where hosts stand at first.
    places_m: BTreeMap<String, Point3<f64>>,
    /// How far ahead contacts that repeat are told to the log.
    until: Option<SimDuration>,
    /// The first mistake that a link met.
    mistake: Option<LinkConfigError>,
    /// When which host hears which, where a plan has any say.
    plan: Option<Arc<ContactPlan>>,
    /// What is worse when, as it was given.
    planned: Vec<Degrade>,
    /// What links were given before: most of them share a base and the degradations they meet.
    known: Vec<SharedTimeline>,
    /// What holds instead, from which instant on, in order.
    changed: Vec<(SimDuration, LinkBuilder)>,
}

/// The most patterns, and the most degradations.
const MAX_ENTRIES: usize = 1000;

impl LinkBuilder {
    /// A builder for links with these parameters and changes.
    ///
    /// # Errors
    /// When a pattern cannot be read, or a degradation makes no sense by itself.
    pub fn new(links: &LinksConfig, degrades: &[Degrade]) -> Result<Self, LinkConfigError> {
        for (key, actual) in [("links", links.patterns.len()), ("degrade", degrades.len())] {
            // Each is matched with each link's name.
            if actual > MAX_ENTRIES {
                return Err(LinkConfigError::TooMany {
                    key: vec![key.to_owned()],
                    actual,
                    limit: MAX_ENTRIES,
                });
            }
        }
        let mut builder = LinkBuilder {
            default: links.default.clone(),
            ..LinkBuilder::default()
        };
        for (text, over) in &links.patterns {
            let key = vec!["links".to_owned(), text.clone()];
            let pattern = Pattern::new(key, text)?;
            builder.overrides.push((pattern, over.clone()));
        }
        builder.planned = degrades.to_vec();
        for (index, degrade) in degrades.iter().enumerate() {
            let key = |last: &str| vec!["degrade".to_owned(), index.to_string(), last.to_owned()];
            if let Some(until) = degrade.until.filter(|until| *until <= degrade.at) {
                return Err(LinkConfigError::EndsBeforeItBegins {
                    key: key("until"),
                    at: degrade.at.to_string(),
                    until: until.to_string(),
                });
            }
            let (pattern, over) = match &degrade.what {
                Degraded::Links { pattern, over } => (pattern, (**over).clone()),
                Degraded::Processors { pattern, slowdown } => {
                    let pattern = Pattern::new(key("processors"), pattern)?;
                    builder.slowdowns.add(pattern, degrade.clone(), *slowdown);
                    continue;
                }
            };
            if over.radio.is_some() {
                return Err(LinkConfigError::Value {
                    key: key("radio"),
                    message: "a link cannot change its radio during a run".to_owned(),
                });
            }
            if over == LinkOverrides::default() {
                let key = vec!["degrade".to_owned(), index.to_string()];
                return Err(LinkConfigError::ChangesNothing { key });
            }
            builder.degrades.push(Worse {
                number: index,
                pattern: Pattern::new(key("links"), pattern)?,
                when: degrade.clone(),
                over,
            });
        }
        Ok(builder)
    }

    /// From `at` on links and processors are as `changed` says, as if they had been so from the start: base
    /// and degradations. Later than what was changed before. What `changed` knows of radios, plans and places
    /// is not asked.
    ///
    /// ```
    /// use farside::{SimDuration, SimTime, Simulation};
    /// use farside_actors::link::LinksConfig;
    /// use farside_actors::wiring::{LinkBuilder, Wiring};
    /// let builder = |text| LinkBuilder::new(&toml::from_str::<LinksConfig>(text).unwrap(), &[]);
    /// let mut links = builder("default = { loss = 0.1, latency = '5ms' }")?;
    /// links.change_from(SimDuration::from_secs(30), builder("default = { loss = 0.4, latency = '9ms' }")?);
    /// let mut sim = Simulation::new(1);
    /// let (a, b) = (sim.host("a"), sim.host("b"));
    /// let mut wiring = Wiring::default();
    /// wiring.link((a, "a"), (b, "b"));
    /// let links = links.build(&mut sim, &wiring)?;
    /// assert_eq!(sim.slowest_link(), SimDuration::from_millis(5));
    /// assert_eq!(links.nominal("a", "b").unwrap().loss, 0.1);
    /// # Ok::<(), farside_actors::link::LinkConfigError>(())
    /// ```
    pub fn change_from(&mut self, at: SimDuration, changed: LinkBuilder) {
        self.changed.push((at, changed));
    }

    /// What is worse when, in the order of the scenario.
    pub fn degrades(&self) -> &[Degrade] {
        &self.planned
    }

    /// Gives links the contacts of a plan over hosts' names, beneath what `[links]` says of them:
    /// `contacts` there replaces the plan's. A link between hosts that the plan does not both name
    /// is left alone; one between hosts that it names, without a contact, is closed.
    pub fn set_plan(&mut self, plan: Arc<ContactPlan>) {
        for (_, changed) in &mut self.changed {
            changed.plan = Some(plan.clone());
        }
        self.plan = Some(plan);
    }

    /// The contact plan, if there is one.
    pub fn plan(&self) -> Option<&Arc<ContactPlan>> {
        self.plan.as_ref()
    }

    /// Reads the traces that parameters name, each once.
    ///
    /// # Errors
    /// When `read` says so; the error has the place of the key.
    pub fn read_traces(
        &mut self,
        mut read: impl FnMut(&str) -> Result<CapacityTrace, String>,
    ) -> Result<(), LinkConfigError> {
        let mut known = BTreeMap::new();
        for (mut key, trace) in self.traces() {
            let Some(name) = trace.name().map(str::to_owned) else {
                continue;
            };
            let capacity = match known.get(&name) {
                Some(known) => Arc::clone(known),
                None => match read(&name) {
                    Ok(capacity) => Arc::new(capacity),
                    Err(message) => {
                        key.push("trace".to_owned());
                        return Err(LinkConfigError::Value { key, message });
                    }
                },
            };
            trace.read(capacity.clone());
            known.insert(name, capacity);
        }
        Ok(())
    }

    /// The radios that links may go through, by name; with a `terrain` to stand on.
    ///
    /// # Errors
    /// When a radio makes no sense.
    pub fn radios(
        &mut self,
        radios: &BTreeMap<String, RadioConfig>,
    ) -> Result<(), LinkConfigError> {
        for (name, config) in radios {
            let wrong = |keys: Vec<String>, message| LinkConfigError::Value {
                key: ["radios".to_owned(), name.clone()]
                    .into_iter()
                    .chain(keys)
                    .collect(),
                message,
            };
            config.check("").map_err(|error| {
                let (key, message) = error.into_parts();
                let (_, below) = key.split_at(1.min(key.len()));
                wrong(below.to_vec(), message)
            })?;
            let together = config.check_together();
            together.map_err(|(key, message)| wrong(vec![key.to_owned()], message))?;
            self.radios.push(RadioBuilder::new(name, config.clone()));
        }
        Ok(())
    }

    /// All traces, with the keys of the tables they are in.
    fn traces(&mut self) -> Vec<(Vec<String>, &mut Trace)> {
        let place = |pattern: &Pattern| match pattern.key.as_slice() {
            // A degradation's pattern is one of its keys.
            [degrade, index, _] => vec![degrade.clone(), index.clone()],
            key => key.to_vec(),
        };
        let mut all = Vec::new();
        if let Some(trace) = &mut self.default.trace {
            all.push((vec!["links".to_owned(), "default".to_owned()], trace));
        }
        for (pattern, over) in &mut self.overrides {
            all.extend(
                over.trace
                    .iter_mut()
                    .flatten()
                    .map(|trace| (place(pattern), trace)),
            );
        }
        for worse in &mut self.degrades {
            let trace = worse.over.trace.iter_mut().flatten();
            all.extend(trace.map(|trace| (place(&worse.pattern), trace)));
        }
        for (_, changed) in &mut self.changed {
            all.extend(changed.traces());
        }
        all
    }

    /// Where the host called `name` stands at first, in metres in the world's frame, unless the
    /// wiring says.
    pub fn place(&mut self, name: &str, place_m: Point3<f64>) {
        self.places_m.insert(name.to_owned(), place_m);
    }

    /// Whether any link can ask where hosts are.
    pub fn has_radios(&self) -> bool {
        !self.radios.is_empty()
    }

    /// When the run ends at the latest: contacts that repeat are told to the log until then.
    pub fn until(&mut self, until: Option<SimDuration>) {
        self.until = until;
    }

    /// Declares all links of a wiring, the radios that they go through, and their changes; checks
    /// that every pattern has matched some link.
    ///
    /// # Errors
    /// When one has not (the error has the nearest name), a link names a radio that there is not,
    /// or a radio must know where a host is that has no place; when a trace was not read.
    pub fn build(
        mut self,
        sim: &mut Simulation,
        wiring: &Wiring,
    ) -> Result<Links, LinkConfigError> {
        for (name, place_m) in &wiring.places_m {
            self.places_m.insert(name.clone(), *place_m);
        }
        self.hosts = wiring.hosts.iter().cloned().collect();
        let resolved: Vec<_> = wiring
            .links()
            .map(|((_, from), (_, to))| {
                let resolved = self.resolve(from, to);
                (resolved.timeline.clone(), resolved.base.clone())
            })
            .collect();
        let backs = wiring.backs();
        let back = |at: usize| backs[at].map(|back| &resolved[back].0);
        let names = std::mem::take(&mut self.names);
        for (at, ((from, _), (to, _))) in wiring.links().enumerate() {
            let timeline = resolved[at].0.clone();
            self.connect(sim, (from, to), &names[at], timeline, back(at));
        }
        self.names = names;
        let nominal = resolved.iter().map(|(_, nominal)| nominal.clone());
        let mut links = Links::of(wiring, nominal);
        let changed = self.changed.iter_mut();
        let changed = changed.map(|(at, changed)| (*at, &mut changed.slowdowns));
        links.processors = self.slowdowns.apply(changed, &wiring.processors)?;
        let met = resolved.iter().enumerate();
        let met = met.map(|(at, (timeline, _))| (timeline, back(at)));
        links.remarks = self.remarks(met);
        self.finish(sim, wiring.terrain.as_ref())?;
        links.remarks.extend(links.processors.remarks());
        Ok(links)
    }

    /// Declares the link called `name`, and its changes; `back` is what the link back has, if there
    /// is one. A link through a radio is declared with it, by [`LinkBuilder::finish`].
    fn connect(
        &mut self,
        sim: &mut Simulation,
        (from, to): (HostId, HostId),
        name: &str,
        timeline: Arc<Timeline>,
        back: Option<&Arc<Timeline>>,
    ) {
        let mut changes = Vec::new();
        for (before, (at, params)) in timeline.iter().zip(timeline.iter().skip(1)) {
            changes.push((at, LinkChange::planned(before.1, params)));
        }
        changes.extend(timeline.contact_changes(self.until));
        let Some(wanted) = timeline.at(SimTime::ZERO).radio.clone() else {
            let link = Link::new(timeline);
            let link = match back {
                Some(back) => link.answered_over(back.clone()),
                None => link,
            };
            let id = sim.link(from, to, name, link);
            for (at, change) in changes {
                sim.change_at(at, id, change);
            }
            return;
        };
        match self.radios.iter_mut().find(|radio| radio.name() == wanted) {
            Some(radio) => radio.join(name, (from, to), timeline, changes),
            None => self.no_such_radio(name, &wanted),
        }
    }

    /// What links, radios and degradations are told that has no effect. Of each link: what it has,
    /// and what the link back has.
    fn remarks<'a>(
        &self,
        links: impl Iterator<Item = (&'a Arc<Timeline>, Option<&'a Arc<Timeline>>)>,
    ) -> Vec<String> {
        // Most links are alike.
        let mut seen = BTreeSet::new();
        let links = links
            .filter(|(timeline, back)| seen.insert((Arc::as_ptr(timeline), back.map(Arc::as_ptr))));
        let links = links.map(|(timeline, back)| (timeline.as_ref(), back.map(Arc::as_ref)));
        let mut remarks = remarks_of_links(links);
        remarks.sort_unstable();
        let remarks = remarks.into_iter().map(|remark| format!("links: {remark}"));
        let radios = self.radios.iter().flat_map(RadioBuilder::remarks);
        let degrades = super::degrades::without_effect(&self.degrades, &self.known);
        remarks.chain(radios).chain(degrades).collect()
    }

    fn no_such_radio(&mut self, link: &str, wanted: &str) {
        let names = || self.radios.iter().map(RadioBuilder::name);
        let hint = match closest(wanted, names()) {
            None => format!("; there is no [radios.{wanted}]"),
            nearest => did_you_mean(nearest),
        };
        let setter = self
            .overrides
            .iter()
            .rev()
            .find(|(pattern, over)| over.radio.is_some() && pattern.names.matches(link));
        let place = setter.map_or("default", |(pattern, _)| pattern.text.as_str());
        let key = ["links", place, "radio"].map(str::to_owned).to_vec();
        self.mistake.get_or_insert(LinkConfigError::Value {
            key,
            message: format!("{wanted:?}: expected the name of one of [radios]{hint}"),
        });
    }

    /// What the link from one host to another has when, as it will be built: for who asks of a run what its links
    /// had.
    ///
    /// ```
    /// use farside::SimTime;
    /// use farside_actors::link::LinksConfig;
    /// use farside_actors::wiring::LinkBuilder;
    /// let config: LinksConfig = toml::from_str("'base-rover_*' = { loss = 0.5 }").unwrap();
    /// let timeline = LinkBuilder::new(&config, &[])?.between("base", "rover_1");
    /// assert_eq!(timeline.at(SimTime::ZERO).loss, 0.5);
    /// # Ok::<(), farside_actors::link::LinkConfigError>(())
    /// ```
    pub fn between(&mut self, from: &str, to: &str) -> Arc<Timeline> {
        self.resolve(from, to).timeline.clone()
    }

    /// What the link `{from}-{to}` has, and when.
    fn resolve(&mut self, from: &str, to: &str) -> &SharedTimeline {
        let name = format!("{from}-{to}");
        let (base, degrades) = self.params(from, to, &name);
        let changed = self.changed.iter_mut();
        let changed = changed.map(|(_, changed)| changed.params(from, to, &name));
        let changed: Vec<_> = changed.collect();
        if changed.iter().any(|(later, _)| later.radio != base.radio) {
            self.mistake.get_or_insert(LinkConfigError::Value {
                key: vec!["fork".to_owned()],
                message: format!("link {name}: a link cannot change its radio during a run"),
            });
        }
        self.names.push(name);
        self.timeline(base, degrades, changed)
    }

    /// What the link called `name` has, and by number what it meets of what is worse.
    fn params(&mut self, from: &str, to: &str, name: &str) -> (LinkParams, Vec<usize>) {
        let mut base = self.default.clone();
        if base.contacts.is_none() {
            let windows = self
                .plan
                .as_ref()
                .and_then(|plan| plan.windows_between(from, to));
            base.contacts = windows.map(Contacts::of_plan);
        }
        for (pattern, over) in &mut self.overrides {
            if pattern.matches(name) {
                base = base.with(over);
            }
        }
        let mut degrades = Vec::new();
        for (index, worse) in self.degrades.iter_mut().enumerate() {
            if worse.pattern.matches(name) {
                degrades.push(index);
            }
        }
        (base, degrades)
    }

    /// What such a link has from each instant on at which a degradation begins or ends, or all changes.
    fn timeline(
        &mut self,
        base: LinkParams,
        degrades: Vec<usize>,
        changed: Vec<(LinkParams, Vec<usize>)>,
    ) -> &SharedTimeline {
        let same = |known: &SharedTimeline| {
            known.degrades == degrades && *known.base == base && known.changed == changed
        };
        if let Some(at) = self.known.iter().position(same) {
            return &self.known[at];
        }
        let mut timeline = Timeline::new(base.clone());
        for (at, params) in self.spans(&base, &degrades) {
            timeline = timeline.then(SimTime::ZERO + at, params);
        }
        for ((from, builder), (base, degrades)) in self.changed.iter().zip(&changed) {
            let spans = builder.spans(base, degrades);
            let (before, after): (Vec<_>, Vec<_>) =
                spans.into_iter().partition(|(at, _)| at <= from);
            let first = before.into_iter().next_back();
            let first = first.map_or_else(|| base.clone(), |(_, params)| params);
            for (at, params) in [(*from, first)].into_iter().chain(after) {
                if *timeline.at(SimTime::ZERO + at) != params {
                    timeline = timeline.then(SimTime::ZERO + at, params);
                } else {
                    timeline = timeline.cut_off(SimTime::ZERO + at);
                }
            }
        }
        let at = self.known.len();
        self.known.push(SharedTimeline {
            base: Arc::new(base),
            degrades,
            changed,
            timeline: Arc::new(timeline),
        });
        &self.known[at]
    }

    /// What a link has from each instant on at which a degradation that it meets begins or ends.
    fn spans(&self, base: &LinkParams, degrades: &[usize]) -> Vec<(SimDuration, LinkParams)> {
        let mine = degrades.iter().map(|&index| &self.degrades[index]);
        let mine: Vec<&Worse> = mine.collect();
        let params_at = |at: SimDuration| {
            let active = mine.iter().filter(|worse| worse.when.is_active(at));
            active.fold(base.clone(), |params, worse| params.with(&worse.over))
        };
        let instants = Degrade::instants(mine.iter().map(|worse| &worse.when));
        instants.into_iter().map(|at| (at, params_at(at))).collect()
    }

    /// Declares the radios with the links through them, and checks that every pattern has matched
    /// some link.
    fn finish(
        &mut self,
        sim: &mut Simulation,
        terrain: Option<&Arc<HeightField>>,
    ) -> Result<(), LinkConfigError> {
        if let Some(mistake) = self.mistake.take() {
            return Err(mistake);
        }
        for radio in std::mem::take(&mut self.radios) {
            let key = vec!["radios".to_owned(), radio.name().to_owned()];
            let terrain = terrain.cloned();
            let declared = radio.declare(sim, &self.hosts, &self.places_m, terrain);
            declared.map_err(|message| LinkConfigError::Value { key, message })?;
        }
        let unread = |(_, trace): &(Vec<String>, &mut Trace)| trace.capacity().is_none();
        if let Some((mut key, trace)) = self.traces().into_iter().find(unread) {
            key.push("trace".to_owned());
            let message = format!("{:?} was not read", trace.name().unwrap_or_default());
            return Err(LinkConfigError::Value { key, message });
        }
        for number in 0..self.changed.len() {
            let unused = self.changed[number].1.unused();
            if let Some(unused) = unused {
                let nearest = self.nearest(unused);
                let message = LinkConfigError::NoSuchLink {
                    key: unused.key.clone(),
                    pattern: unused.text.clone(),
                    nearest,
                };
                let message = format!("{}: {message}", unused.key.join("."));
                let key = ["fork".to_owned(), number.to_string(), "set".to_owned()];
                return Err(LinkConfigError::Value {
                    key: key.to_vec(),
                    message,
                });
            }
        }
        match self.unused() {
            None => Ok(()),
            Some(unused) => Err(LinkConfigError::NoSuchLink {
                key: unused.key.clone(),
                pattern: unused.text.clone(),
                nearest: self.nearest(unused),
            }),
        }
    }
}

impl LinkBuilder {
    /// A pattern that has matched no link.
    fn unused(&self) -> Option<&Pattern> {
        let overrides = self.overrides.iter().map(|(pattern, _)| pattern);
        let degrades = self.degrades.iter().map(|worse| &worse.pattern);
        overrides.chain(degrades).find(|pattern| !pattern.used)
    }

    /// The link name, or the pattern that names with other numbers share, closest to a pattern; in
    /// `[links]` it may also have been meant for `default`.
    fn nearest(&self, pattern: &Pattern) -> Option<String> {
        let mut candidates: BTreeSet<String> = self.names.iter().map(|name| shape(name)).collect();
        candidates.extend(self.names.iter().cloned());
        // Link names are long and `default` is short, so that anything short is nearer to it: only
        // a slip of the keys counts.
        let slip = strsim::damerau_levenshtein("default", &pattern.text) <= SLIP;
        if pattern.key[0] == "links" && slip {
            candidates.insert("default".to_owned());
        }
        let candidates = candidates.iter().map(String::as_str);
        closest(&pattern.text, candidates).map(str::to_owned)
    }
}

/// How many letters a mistyped word may be off.
const SLIP: usize = 3;
