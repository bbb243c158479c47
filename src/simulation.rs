//! Assembling a simulation: hosts, actors, links, control events, observers; then running it.

mod assemble;
mod controls;
mod forks;
mod replays;

use std::any::TypeId;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::actor::{Accepts, Actor, Address, Recipient};
use crate::carrier::{AnyCarrier, Carrier, SealedChange};
use crate::charge::ChargeJournal;
use crate::engine::{Factory, Sealed};
use crate::executor::{self, Executor};
use crate::fault::{BuildError, FaultCause, LookupError};
use crate::guard::{dropped, guarded};
use crate::ids::{HostId, LinkId, Owner};
use crate::payload::Message;
use crate::record::{NamedObserver, Observer};
use crate::report::Report;
use crate::ruling::{MessageId, Ruling};
use crate::time::{SimDuration, SimTime};
use crate::topology::{ActorType, FixedMap, KindEntry};

struct HostDecl {
    name: String,
    heavy: bool,
    /// The numbers of its actors.
    actors: Vec<u32>,
}

struct ActorDecl {
    name: String,
    host: HostId,
    /// Its place in [`Simulation::types`].
    actor_type: u32,
    factory: Factory,
}

struct LinkDecl {
    name: String,
    /// `None` for a shared link, which is a process of its own.
    host: Option<HostId>,
    change: KindEntry,
    /// What it says of itself, read once.
    min_delay: SimDuration,
    rate_bit_per_s: Option<u64>,
    /// It panicked when it was asked.
    trouble: Option<Box<FaultCause>>,
    carrier: Box<dyn AnyCarrier>,
}

struct RouteDecl {
    from: HostId,
    /// `None` for every host without a route of its own.
    to: Option<HostId>,
    link: u32,
}

enum Target {
    Actor(u32),
    Link(u32),
}

enum Planned {
    Crash,
    Restart,
    Rebuild(Factory),
    Change(SealedChange),
    Tell(KindEntry, Sealed),
    Stop(String),
}

struct ControlDecl {
    time: SimTime,
    target: Option<Target>,
    what: Planned,
}

/// A simulation under assembly. Mistakes are kept and reported by [`Simulation::run`].
///
/// See the crate's front page for a tutorial.
pub struct Simulation {
    /// What all ids that it gives out say.
    owner: Owner,
    seed: u64,
    tie_seed: Option<u64>,
    hosts: Vec<HostDecl>,
    /// The number of each host, by name.
    host_numbers: FixedMap<String, u32>,
    actors: Vec<ActorDecl>,
    /// The number of each actor, by name; of the first, if several have it by mistake.
    actor_numbers: FixedMap<String, u32>,
    links: Vec<LinkDecl>,
    routes: Vec<RouteDecl>,
    controls: Vec<ControlDecl>,
    types: Vec<ActorType>,
    observers: Vec<NamedObserver>,
    interrupt: Arc<AtomicBool>,
    step_limit: u32,
    digest: bool,
    check_min_delay: bool,
    /// The first mistake that was noticed as it was made.
    mistake: Option<BuildError>,
    rulings: Vec<(MessageId, Ruling)>,
    /// In a replay, which of the actors live, by number.
    live: Option<Vec<bool>>,
    charges: Option<ChargeJournal>,
}

impl Simulation {
    /// An empty simulation with this seed, from which every random stream is derived.
    pub fn new(seed: u64) -> Self {
        Simulation {
            owner: Owner::new(),
            seed,
            tie_seed: None,
            hosts: Vec::new(),
            host_numbers: FixedMap::default(),
            actors: Vec::new(),
            actor_numbers: FixedMap::default(),
            links: Vec::new(),
            routes: Vec::new(),
            controls: Vec::new(),
            types: Vec::new(),
            observers: Vec::new(),
            interrupt: Arc::default(),
            step_limit: 10_000,
            digest: true,
            check_min_delay: true,
            mistake: None,
            rulings: Vec::new(),
            live: None,
            charges: None,
        }
    }

    /// The host called `name`, declared if it is new.
    pub fn host(&mut self, name: &str) -> HostId {
        if let Some(at) = self.host_numbers.get(name) {
            return HostId::new(self.owner, *at);
        }
        let at = self.hosts.len() as u32;
        self.hosts.push(HostDecl {
            name: name.to_owned(),
            heavy: false,
            actors: Vec::new(),
        });
        self.host_numbers.insert(name.to_owned(), at);
        HostId::new(self.owner, at)
    }

    /// Keeps the first mistake.
    fn mistaken(&mut self, mistake: BuildError) {
        self.mistake.get_or_insert(mistake);
    }

    /// True if an id is one of this simulation's; else that is a mistake.
    fn owns(&mut self, owner: Owner, what: &'static str, number: u32) -> bool {
        let own = owner == self.owner;
        if !own {
            self.mistaken(BuildError::OtherSimulation { what, number });
        }
        own
    }

    fn owns_host(&mut self, host: HostId) -> bool {
        self.owns(host.owner, "host", host.index)
    }

    /// Declares that handlers on this host take long enough (tens of microseconds) to be worth a
    /// thread. Changes no result.
    pub fn heavy(&mut self, host: HostId) {
        if self.owns_host(host) {
            self.hosts[host.index()].heavy = true;
        }
    }

    /// Declares an actor on `host`, and what it accepts. `build` is called with the actor's name
    /// at the start, and again at each restart.
    pub fn actor<A: Actor>(
        &mut self,
        host: HostId,
        name: &str,
        build: impl Fn(&str) -> A + Send + 'static,
    ) -> Address<A> {
        let declared = self.actors.len() as u32;
        if self.owns_host(host) {
            self.hosts[host.index()].actors.push(declared);
        }
        self.actor_numbers
            .entry(name.to_owned())
            .or_insert(declared);
        let actor_type = self.actor_type::<A>();
        self.actors.push(ActorDecl {
            name: name.to_owned(),
            host,
            actor_type,
            factory: Box::new(move |name| Box::new(build(name))),
        });
        Address::new(self.owner, declared)
    }

    /// The place of an actor's type in the list of types, at its end if the type is new.
    fn actor_type<A: Actor>(&mut self) -> u32 {
        let type_id = TypeId::of::<A>();
        let known = self.types.iter().position(|known| known.type_id == type_id);
        let at = known.unwrap_or_else(|| {
            let mut accepts = Vec::new();
            A::Accepts::list(&mut accepts);
            self.types.push(ActorType {
                type_id,
                name: std::any::type_name::<A>(),
                accepts,
            });
            self.types.len() - 1
        });
        at as u32
    }

    /// Declares a link that carries what `from` sends to `to`, one way.
    pub fn link<C: Carrier>(
        &mut self,
        from: HostId,
        to: HostId,
        name: &str,
        carrier: C,
    ) -> LinkId<C::Change> {
        self.owns_host(to);
        let link = self.declare_link(name, Some(from), carrier);
        self.routes.push(RouteDecl {
            from,
            to: Some(to),
            link: link.declared,
        });
        link
    }

    /// Declares a link that carries whatever `from` sends to hosts it has no other link to.
    pub fn uplink<C: Carrier>(
        &mut self,
        from: HostId,
        name: &str,
        carrier: C,
    ) -> LinkId<C::Change> {
        let link = self.declare_link(name, Some(from), carrier);
        self.routes.push(RouteDecl {
            from,
            to: None,
            link: link.declared,
        });
        link
    }

    /// Declares a link that several hosts send through, a shared medium. [`Simulation::route`]
    /// says which.
    pub fn shared_link<C: Carrier>(&mut self, name: &str, carrier: C) -> LinkId<C::Change> {
        self.declare_link(name, None, carrier)
    }

    /// Lets `link`, a shared one, carry what `from` sends to `to`. That it is not shared is reported
    /// by [`Simulation::run`]: a link that is a host's own decides in that host's events.
    ///
    /// ```
    /// use farside::prelude::*;
    /// let mut sim = Simulation::new(1);
    /// let (a, b, c) = (sim.host("a"), sim.host("b"), sim.host("c"));
    /// let wire = sim.link(a, b, "a-b", FixedDelay::new(SimDuration::from_millis(5)));
    /// sim.route(c, b, wire);
    /// let error = sim.run(Executor::Inline).unwrap_err();
    /// assert_eq!(
    ///     error.to_string(),
    ///     "link a-b is not shared: it cannot carry what host c sends to host b"
    /// );
    /// ```
    pub fn route<C>(&mut self, from: HostId, to: HostId, link: LinkId<C>) {
        let own = [
            self.owns_host(from),
            self.owns_host(to),
            self.owns(link.owner, "link", link.declared),
        ];
        if own.contains(&false) {
            return;
        }
        let decl = &self.links[link.declared as usize];
        if decl.host.is_some() {
            let name = |host: HostId| self.hosts[host.index()].name.clone();
            let (link, from, to) = (decl.name.clone(), name(from), name(to));
            return self.mistaken(BuildError::NotShared { link, from, to });
        }
        self.routes.push(RouteDecl {
            from,
            to: Some(to),
            link: link.declared,
        });
    }

    fn declare_link<C: Carrier>(
        &mut self,
        name: &str,
        host: Option<HostId>,
        carrier: C,
    ) -> LinkId<C::Change> {
        if let Some(host) = host {
            self.owns_host(host);
        }
        let asked = guarded(|| (carrier.min_delay(), carrier.rate_bit_per_s()));
        let (trouble, (min_delay, rate_bit_per_s)) = match asked {
            Ok(said) => (None, said),
            Err(cause) => (Some(cause), (SimDuration::ZERO, None)),
        };
        self.links.push(LinkDecl {
            name: name.to_owned(),
            host,
            change: KindEntry::of::<C::Change>(),
            min_delay,
            rate_bit_per_s,
            trouble,
            carrier: Box::new(carrier),
        });
        LinkId::new(self.owner, self.links.len() as u32 - 1)
    }

    /// The names of all actors declared so far, in order of declaration.
    pub fn actor_names(&self) -> impl Iterator<Item = &str> {
        self.actors.iter().map(|actor| actor.name.as_str())
    }

    /// The name of the host that an actor declared so far is on.
    ///
    /// ```
    /// use farside::prelude::*;
    /// # struct Idle;
    /// # impl Actor for Idle { type Accepts = (); }
    /// let mut sim = Simulation::new(1);
    /// let host = sim.host("rover_01");
    /// sim.actor(host, "arm_01", |_| Idle);
    /// assert_eq!(sim.host_of_named("arm_01"), Some("rover_01"));
    /// assert_eq!(sim.host_of_named("arm_02"), None);
    /// ```
    pub fn host_of_named(&self, actor: &str) -> Option<&str> {
        let actor = &self.actors[*self.actor_numbers.get(actor)? as usize];
        Some(&self.hosts[actor.host.index()].name)
    }

    /// The names of all hosts declared so far, in order of declaration.
    pub fn host_names(&self) -> impl Iterator<Item = &str> {
        self.hosts.iter().map(|host| host.name.as_str())
    }

    /// The names of all links declared so far, in order of declaration.
    pub fn link_names(&self) -> impl Iterator<Item = &str> {
        self.links.iter().map(|link| link.name.as_str())
    }

    /// The greatest [`Carrier::min_delay`] of all links declared so far, zero if there are none:
    /// what a protocol has to reckon with, as far as links can tell before the start.
    ///
    /// ```
    /// use farside::prelude::*;
    /// let mut sim = Simulation::new(1);
    /// let (a, b) = (sim.host("a"), sim.host("b"));
    /// sim.link(a, b, "a-b", FixedDelay::new(SimDuration::from_millis(5)));
    /// sim.link(b, a, "b-a", FixedDelay::new(SimDuration::from_millis(700)));
    /// assert_eq!(sim.slowest_link(), SimDuration::from_millis(700));
    /// ```
    pub fn slowest_link(&self) -> SimDuration {
        let delays = self.links.iter().map(|link| link.min_delay);
        delays.max().unwrap_or(SimDuration::ZERO)
    }

    /// The least [`Carrier::rate_bit_per_s`] of all links declared so far \[bit/s\]; none if no
    /// link has a rate.
    ///
    /// ```
    /// use farside::prelude::*;
    /// let mut sim = Simulation::new(1);
    /// let (a, b) = (sim.host("a"), sim.host("b"));
    /// sim.link(a, b, "a-b", FixedDelay::new(SimDuration::from_millis(5)));
    /// assert_eq!(sim.slowest_rate_bit_per_s(), None);
    /// ```
    pub fn slowest_rate_bit_per_s(&self) -> Option<u64> {
        let rates = self.links.iter().map(|link| link.rate_bit_per_s);
        rates.flatten().min()
    }

    /// The actor of this name, whatever its type, as one that accepts `M`. In a handler, ask
    /// [`Context::recipient`](crate::Context::recipient).
    ///
    /// # Errors
    /// When no actor declared so far has the name, or its `Accepts` does not list `M`.
    pub fn recipient<M: Message>(&self, name: &str) -> Result<Recipient<M>, LookupError> {
        let declared = self.declared_named(name)?;
        let actor_type = self.actors[declared as usize].actor_type as usize;
        Recipient::of(self.owner, declared, &self.types[actor_type], name)
    }

    fn declared_named(&self, name: &str) -> Result<u32, LookupError> {
        let at = self.actor_numbers.get(name).copied();
        at.ok_or_else(|| LookupError::unknown(name, self.actor_names()))
    }

    /// Adds an observer. Observers are told the same things in the same order, first added first.
    pub fn observe<O: Observer + 'static>(&mut self, observer: O) {
        self.observers.push(NamedObserver {
            name: std::any::type_name::<O>(),
            observer: Box::new(observer),
        });
    }

    /// Shuffles the order of sources at equal (time, step), to show whether a result hangs on it.
    pub fn tie_seed(&mut self, tie_seed: Option<u64>) {
        self.tie_seed = tie_seed;
    }

    /// The most zero-delay hops at one instant, 10,000 unless set; more is a fault that names them.
    pub fn step_limit(&mut self, limit: u32) {
        self.step_limit = limit;
    }

    /// Switches the digest off, for benchmarks: a run without one cannot be verified.
    pub fn without_digest(&mut self) {
        self.digest = false;
    }

    /// Lets links undercut their `min_delay` unchecked. There to show what the check is for.
    #[doc(hidden)]
    pub fn without_min_delay_check(&mut self) {
        self.check_min_delay = false;
    }

    /// The flag that ends the run after the event in hand when it is raised, as Ctrl-C does.
    pub fn interrupt(&self) -> Arc<AtomicBool> {
        self.interrupt.clone()
    }

    /// The executor that pays: kameo on `threads` threads if there are several and at least two
    /// hosts were declared heavy ([`Simulation::heavy`]), so that there is work to be done side by
    /// side; else inline. It hangs on what was declared and on nothing measured, and the result is
    /// the same on either.
    ///
    /// ```
    /// use farside::prelude::*;
    /// let mut sim = Simulation::new(1);
    /// let (a, b) = (sim.host("rover_01"), sim.host("rover_02"));
    /// sim.heavy(a);
    /// assert_eq!(sim.executor_that_pays(4), Executor::Inline);
    /// sim.heavy(b);
    /// assert_eq!(sim.executor_that_pays(4), Executor::Kameo { threads: 4 });
    /// assert_eq!(sim.executor_that_pays(1), Executor::Inline);
    /// ```
    pub fn executor_that_pays(&self, threads: usize) -> Executor {
        let heavy = self.hosts.iter().filter(|host| host.heavy).count();
        if heavy >= 2 && threads >= 2 {
            Executor::Kameo { threads }
        } else {
            Executor::Inline
        }
    }

    /// Runs to the end.
    ///
    /// # Errors
    /// When the simulation cannot start. What goes wrong later is in [`Report::end`].
    pub fn run(mut self, executor: Executor) -> Result<Report, BuildError> {
        let split = matches!(executor, Executor::Kameo { .. });
        match self.assemble(split) {
            Ok(ready) => executor::run(ready, executor),
            Err(error) => {
                self.discard();
                Err(error)
            }
        }
    }

    /// Drops what users brought into a simulation that cannot start. That some of it panics then is of
    /// no interest any more.
    fn discard(self) {
        let actors = self.actors.into_iter().map(|actor| dropped(actor.factory));
        let links = self.links.into_iter().map(|link| dropped(link.carrier));
        let controls = self
            .controls
            .into_iter()
            .map(|control| dropped(control.what));
        let observers = self.observers.into_iter().map(|o| dropped(o.observer));
        let all = actors.chain(links).chain(controls).chain(observers);
        all.for_each(drop);
    }

    /// The least delay that any link declares, zero if there are none: how far hosts may run ahead
    /// of each other, and how long a stop takes to reach them all.
    fn look_ahead(&self) -> SimDuration {
        let delays = self.links.iter().map(|link| link.min_delay);
        delays.min().unwrap_or(SimDuration::ZERO)
    }
}
