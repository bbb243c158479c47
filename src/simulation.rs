//! Assembling a simulation: hosts, actors, links, control events, observers; then running it.

mod assemble;

use std::any::TypeId;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::actor::boxed::Boxed;
use crate::actor::{self, Accepts, Actor, Address, Recipient};
use crate::carrier::{AnyCarrier, Carrier, SealedChange};
use crate::engine::{Factory, Sealed};
use crate::executor::{self, Executor};
use crate::fault::{BuildError, LookupError};
use crate::ids::{HostId, LinkId};
use crate::payload::Message;
use crate::record::Observer;
use crate::report::Report;
use crate::ruling::{MessageId, Ruling};
use crate::time::{SimDuration, SimTime};
use crate::topology::{ActorType, FixedMap, KindEntry};

struct HostDecl {
    name: String,
    heavy: bool,
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
    seed: u64,
    tie_seed: Option<u64>,
    hosts: Vec<HostDecl>,
    /// The number of each host, by name.
    host_numbers: FixedMap<String, u32>,
    actors: Vec<ActorDecl>,
    links: Vec<LinkDecl>,
    routes: Vec<RouteDecl>,
    controls: Vec<ControlDecl>,
    types: Vec<ActorType>,
    observers: Vec<Box<dyn Observer>>,
    interrupt: Arc<AtomicBool>,
    step_limit: u32,
    digest: bool,
    check_min_delay: bool,
    rulings: Vec<(MessageId, Ruling)>,
}

impl Simulation {
    /// An empty simulation with this seed, from which every random stream is derived.
    pub fn new(seed: u64) -> Self {
        Simulation {
            seed,
            tie_seed: None,
            hosts: Vec::new(),
            host_numbers: FixedMap::default(),
            actors: Vec::new(),
            links: Vec::new(),
            routes: Vec::new(),
            controls: Vec::new(),
            types: Vec::new(),
            observers: Vec::new(),
            interrupt: Arc::default(),
            step_limit: 10_000,
            digest: true,
            check_min_delay: true,
            rulings: Vec::new(),
        }
    }

    /// The host called `name`, declared if it is new.
    pub fn host(&mut self, name: &str) -> HostId {
        if let Some(at) = self.host_numbers.get(name) {
            return HostId(*at);
        }
        let at = self.hosts.len() as u32;
        self.hosts.push(HostDecl {
            name: name.to_owned(),
            heavy: false,
        });
        self.host_numbers.insert(name.to_owned(), at);
        HostId(at)
    }

    /// Declares that handlers on this host take long enough (tens of microseconds) to be worth a
    /// thread. Changes no result.
    pub fn heavy(&mut self, host: HostId) {
        self.hosts[host.0 as usize].heavy = true;
    }

    /// Declares an actor on `host`, and what it accepts. `build` is called with the actor's name
    /// at the start, and again at each restart.
    pub fn actor<A: Actor>(
        &mut self,
        host: HostId,
        name: &str,
        build: impl Fn(&str) -> A + Send + 'static,
    ) -> Address<A> {
        let actor_type = self.actor_type::<A>();
        self.actors.push(ActorDecl {
            name: name.to_owned(),
            host,
            actor_type,
            factory: Box::new(move |name| Boxed::boxed(build(name))),
        });
        Address::new(self.actors.len() as u32 - 1)
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

    /// Lets `link`, a shared one, carry what `from` sends to `to`.
    pub fn route<C>(&mut self, from: HostId, to: HostId, link: LinkId<C>) {
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
        self.links.push(LinkDecl {
            name: name.to_owned(),
            host,
            change: KindEntry::of::<C::Change>(),
            carrier: Box::new(carrier),
        });
        LinkId::new(self.links.len() as u32 - 1)
    }

    /// Crashes an actor at `time`: its state is gone, its timers are void, and what reaches it is
    /// lost as `crashed` until it is restarted. Durable memory stays.
    pub fn crash_at<A>(&mut self, time: SimTime, actor: Address<A>) {
        self.control(time, Some(Target::Actor(actor.declared)), Planned::Crash);
    }

    /// Restarts an actor at `time`, crashed or not: a new one is built, in a new incarnation.
    pub fn restart_at<A>(&mut self, time: SimTime, actor: Address<A>) {
        self.control(time, Some(Target::Actor(actor.declared)), Planned::Restart);
    }

    /// Crashes all actors declared so far on `host`, at one instant, in order of declaration. What
    /// they keep durably stays, and so does what links have charged the host.
    ///
    /// ```
    /// use farside::prelude::*;
    /// # struct Idle;
    /// # impl Actor for Idle { type Accepts = (); }
    /// let mut sim = Simulation::new(1);
    /// let rover = sim.host("rover_01");
    /// sim.actor(rover, "rover_01/planner", |_| Idle);
    /// sim.actor(rover, "rover_01/battery", |_| Idle);
    /// sim.crash_host_at(SimTime::from_secs(60), rover);
    /// sim.restart_host_at(SimTime::from_secs(90), rover);
    /// let report = sim.run(Executor::Inline).unwrap();
    /// // Two starts, two crashes, two restarts.
    /// assert_eq!(report.counts.events, 6);
    /// ```
    pub fn crash_host_at(&mut self, time: SimTime, host: HostId) {
        for actor in self.actors_on(host) {
            self.control(time, Some(Target::Actor(actor)), Planned::Crash);
        }
    }

    /// Restarts all actors declared so far on `host`, at one instant, in order of declaration.
    pub fn restart_host_at(&mut self, time: SimTime, host: HostId) {
        for actor in self.actors_on(host) {
            self.control(time, Some(Target::Actor(actor)), Planned::Restart);
        }
    }

    fn actors_on(&self, host: HostId) -> Vec<u32> {
        let actors = (0..).zip(&self.actors);
        let here = actors.filter(|(_, actor)| actor.host == host);
        here.map(|(declared, _)| declared).collect()
    }

    /// The names of all actors declared so far, in order of declaration.
    pub fn actor_names(&self) -> impl Iterator<Item = &str> {
        self.actors.iter().map(|actor| actor.name.as_str())
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
        let delays = self.links.iter().map(|link| link.carrier.min_delay());
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
        let rates = self.links.iter().map(|link| link.carrier.rate_bit_per_s());
        rates.flatten().min()
    }

    /// [`Simulation::crash_at`] for the actor of this name, as scenarios give it.
    ///
    /// # Errors
    /// When no actor declared so far has the name.
    pub fn crash_named_at(&mut self, time: SimTime, actor: &str) -> Result<(), LookupError> {
        let target = self.target_named(actor)?;
        self.control(time, Some(target), Planned::Crash);
        Ok(())
    }

    /// [`Simulation::restart_at`] for the actor of this name.
    ///
    /// # Errors
    /// When no actor declared so far has the name.
    pub fn restart_named_at(&mut self, time: SimTime, actor: &str) -> Result<(), LookupError> {
        let target = self.target_named(actor)?;
        self.control(time, Some(target), Planned::Restart);
        Ok(())
    }

    /// From `time` on the actors whose names `which` picks are built as `other` builds them: those that have
    /// not crashed are restarted then, in a new incarnation, and keep what is durable. A fork of a run changes
    /// the settings of actors so. Returns their names.
    ///
    /// ```
    /// use farside::prelude::*;
    /// struct Rover(u32);
    /// impl Actor for Rover {
    ///     type Accepts = ();
    ///     fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
    ///         match self.0 {
    ///             1 => Ok(()),
    ///             speed => Ok(ctx.stop(format!("at speed {speed}"))),
    ///         }
    ///     }
    /// }
    /// let assemble = |speed| {
    ///     let mut sim = Simulation::new(1);
    ///     let host = sim.host("rover_01");
    ///     sim.actor(host, "rover_01", move |_| Rover(speed));
    ///     sim
    /// };
    /// let mut sim = assemble(1);
    /// let rebuilt = sim.rebuild_at(SimTime::from_secs(9), assemble(5), |name| name.starts_with("rover"));
    /// assert_eq!(rebuilt?, ["rover_01"]);
    /// let report = sim.run(Executor::Inline)?;
    /// assert_eq!((report.end_time.as_nanos(), report.end.detail().as_str()), (9_000_000_000, "rover_01: at speed 5"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// When `other` has not the same hosts, actors and links, in the same order: addresses that its actors
    /// hold would mean others here.
    pub fn rebuild_at(
        &mut self,
        time: SimTime,
        other: Simulation,
        which: impl Fn(&str) -> bool,
    ) -> Result<Vec<String>, BuildError> {
        if let Some((own, its)) = self.first_difference(&other) {
            return Err(BuildError::OtherTeam { own, its });
        }
        let mut rebuilt = Vec::new();
        for (declared, actor) in (0..).zip(other.actors) {
            if which(&actor.name) {
                let target = Some(Target::Actor(declared));
                self.control(time, target, Planned::Rebuild(actor.factory));
                rebuilt.push(actor.name);
            }
        }
        Ok(rebuilt)
    }

    /// The first host, actor or link that the two do not have alike, as either has it.
    fn first_difference(&self, other: &Simulation) -> Option<(String, String)> {
        let hosts =
            |sim: &Simulation| -> Vec<String> { sim.host_names().map(str::to_owned).collect() };
        let links =
            |sim: &Simulation| -> Vec<String> { sim.link_names().map(str::to_owned).collect() };
        let actors = |sim: &Simulation| -> Vec<String> {
            let actor = |actor: &ActorDecl| {
                let host = &sim.hosts[actor.host.0 as usize].name;
                let of = sim.types[actor.actor_type as usize].name;
                format!("{} on {host}, a {of}", actor.name)
            };
            sim.actors.iter().map(actor).collect()
        };
        differs("host", &hosts(self), &hosts(other))
            .or_else(|| differs("actor", &actors(self), &actors(other)))
            .or_else(|| differs("link", &links(self), &links(other)))
    }

    /// Tells an actor something at `time`: a goal that arrives at noon, a fault to inject. The
    /// message is handled before anything else that happens at its instant; at time zero, before
    /// the actor's `started`. A crashed actor is told in vain, and the log says that it was told.
    ///
    /// ```
    /// use farside::prelude::*;
    /// use serde::{Deserialize, Serialize};
    ///
    /// #[derive(Serialize, Deserialize)]
    /// struct Goal { crater: u32 }
    ///
    /// struct Rover;
    /// impl Actor for Rover { type Accepts = (Goal,); }
    /// impl Handler<Goal> for Rover {
    ///     fn handle(&mut self, goal: Goal, ctx: &mut Context<'_, Self>) -> Outcome {
    ///         ctx.stop(format!("crater {} at {}", goal.crater, ctx.now()));
    ///         Ok(())
    ///     }
    /// }
    ///
    /// let mut sim = Simulation::new(1);
    /// let host = sim.host("rover_01");
    /// let rover = sim.actor(host, "rover_01", |_| Rover);
    /// sim.tell_at(SimTime::from_secs(43_200), rover, Goal { crater: 7 });
    /// let report = sim.run(Executor::Inline).unwrap();
    /// assert_eq!(report.end.detail(), "rover_01: crater 7 at 43200s");
    /// ```
    pub fn tell_at<M: Message>(&mut self, time: SimTime, actor: impl actor::Target<M>, message: M) {
        let target = Some(Target::Actor(actor.declared()));
        let what = Planned::Tell(KindEntry::of::<M>(), actor.seal(message));
        self.control(time, target, what);
    }

    /// [`Simulation::tell_at`] for the actor of this name, as scenarios give it.
    ///
    /// ```
    /// use farside::prelude::*;
    /// # struct Rover;
    /// # impl Actor for Rover { type Accepts = (); }
    /// #[derive(serde::Serialize, serde::Deserialize)]
    /// struct Goal;
    /// let mut sim = Simulation::new(1);
    /// let host = sim.host("rover_01");
    /// sim.actor(host, "rover_01", |_| Rover);
    /// let error = sim.tell_named_at(SimTime::ZERO, "rover_10", Goal).unwrap_err();
    /// assert_eq!(
    ///     error.to_string(),
    ///     "no actor is called \"rover_10\"; did you mean \"rover_01\"?"
    /// );
    /// let error = sim.tell_named_at(SimTime::ZERO, "rover_01", Goal).unwrap_err();
    /// assert!(error.to_string().ends_with("Goal; it accepts no messages"));
    /// ```
    ///
    /// # Errors
    /// When no actor declared so far has the name, with the nearest that one has; or when it does
    /// not accept messages of this type, with those that it accepts.
    pub fn tell_named_at<M: Message>(
        &mut self,
        time: SimTime,
        actor: &str,
        message: M,
    ) -> Result<(), BuildError> {
        let recipient = self.recipient::<M>(actor)?;
        self.tell_at(time, recipient, message);
        Ok(())
    }

    /// What actors are to be told, in order of declaration: when, who, and the message's type as
    /// Rust names it.
    ///
    /// ```
    /// use farside::prelude::*;
    /// # struct Rover;
    /// # impl Actor for Rover { type Accepts = (Goal,); }
    /// # impl Handler<Goal> for Rover {
    /// #     fn handle(&mut self, _: Goal, _: &mut Context<'_, Self>) -> Outcome { Ok(()) }
    /// # }
    /// #[derive(serde::Serialize, serde::Deserialize)]
    /// struct Goal;
    /// let mut sim = Simulation::new(1);
    /// let host = sim.host("rover_01");
    /// let rover = sim.actor(host, "rover_01", |_| Rover);
    /// sim.tell_at(SimTime::from_secs(60), rover, Goal);
    /// let (at, actor, kind) = sim.tells().next().unwrap();
    /// assert_eq!((at, actor), (SimTime::from_secs(60), "rover_01"));
    /// assert!(kind.ends_with("Goal"));
    /// ```
    pub fn tells(&self) -> impl Iterator<Item = (SimTime, &str, &'static str)> {
        self.controls.iter().filter_map(|control| {
            let (Some(Target::Actor(actor)), Planned::Tell(kind, _)) =
                (&control.target, &control.what)
            else {
                return None;
            };
            let name = &self.actors[*actor as usize].name;
            Some((control.time, name.as_str(), kind.type_name))
        })
    }

    /// The actor of this name, whatever its type, as one that accepts `M`. In a handler, ask
    /// [`Context::recipient`](crate::Context::recipient).
    ///
    /// # Errors
    /// When no actor declared so far has the name, or its `Accepts` does not list `M`.
    pub fn recipient<M: Message>(&self, name: &str) -> Result<Recipient<M>, LookupError> {
        let declared = self.declared_named(name)?;
        let actor_type = self.actors[declared as usize].actor_type as usize;
        Recipient::of(declared, &self.types[actor_type], name)
    }

    fn target_named(&self, name: &str) -> Result<Target, LookupError> {
        self.declared_named(name).map(Target::Actor)
    }

    fn declared_named(&self, name: &str) -> Result<u32, LookupError> {
        let at = self.actor_names().position(|known| known == name);
        let at = at.ok_or_else(|| LookupError::unknown(name, self.actor_names()))?;
        Ok(at as u32)
    }

    /// Changes a link at `time`.
    pub fn change_at<C: Message>(&mut self, time: SimTime, link: LinkId<C>, change: C) {
        let what = Planned::Change(SealedChange::new(change));
        self.control(time, Some(Target::Link(link.declared)), what);
    }

    /// Decides what becomes of a message that goes through a link, whatever the link decides. Of several
    /// rulings on one message each sees what the one before has left. What came of them is in
    /// [`Report::rulings`], in the order in which they were declared.
    ///
    /// ```
    /// use farside::prelude::*;
    /// use farside::ruling::{Ruling, RulingEnd};
    /// use serde::{Deserialize, Serialize};
    ///
    /// #[derive(Serialize, Deserialize)]
    /// struct Ping;
    /// struct Sink;
    /// impl Actor for Sink { type Accepts = (Ping,); }
    /// impl Handler<Ping> for Sink {
    ///     fn handle(&mut self, _: Ping, _: &mut Context<'_, Self>) -> Outcome { Ok(()) }
    /// }
    /// struct Source(Address<Sink>);
    /// impl Actor for Source {
    ///     type Accepts = ();
    ///     fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
    ///         for _ in 0..3 { ctx.send(self.0, Ping); }
    ///         Ok(())
    ///     }
    /// }
    /// let mut sim = Simulation::new(1);
    /// let (a, b) = (sim.host("a"), sim.host("b"));
    /// let sink = sim.actor(b, "sink", |_| Sink);
    /// sim.actor(a, "source", move |_| Source(sink));
    /// sim.link(a, b, "a-b", FixedDelay::new(SimDuration::from_millis(5)));
    /// sim.rule("source,sink,Ping,1".parse()?, Ruling::Lose);
    /// let report = sim.run(Executor::Inline)?;
    /// assert_eq!((report.counts.delivered, report.counts.lost_by_reason["ruled"]), (2, 1));
    /// assert_eq!(report.rulings, [RulingEnd::Applied]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn rule(&mut self, message: MessageId, ruling: Ruling) {
        self.rulings.push((message, ruling));
    }

    /// Stops the run at `time`, before anything that would happen then.
    pub fn stop_at(&mut self, time: SimTime, reason: &str) {
        self.control(time, None, Planned::Stop(reason.to_owned()));
    }

    fn control(&mut self, time: SimTime, target: Option<Target>, what: Planned) {
        self.controls.push(ControlDecl { time, target, what });
    }

    /// Adds an observer. Observers are told the same things in the same order, first added first.
    pub fn observe(&mut self, observer: impl Observer + 'static) {
        self.observers.push(Box::new(observer));
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
    pub fn run(self, executor: Executor) -> Result<Report, BuildError> {
        let split = matches!(executor, Executor::Kameo { .. });
        executor::run(self.assemble(split)?, executor)
    }

    /// The least delay that any link declares, zero if there are none: how far hosts may run ahead
    /// of each other, and how long a stop takes to reach them all.
    fn look_ahead(&self) -> SimDuration {
        let delays = self.links.iter().map(|link| link.carrier.min_delay());
        delays.min().unwrap_or(SimDuration::ZERO)
    }
}

/// Where two lists of names first differ, and what either has there.
fn differs(what: &str, own: &[String], its: &[String]) -> Option<(String, String)> {
    let shorter = own.len().min(its.len());
    let at = own.iter().zip(its).position(|(own, its)| own != its);
    let at = at.or((own.len() != its.len()).then_some(shorter))?;
    let named = |names: &[String]| match names.get(at) {
        Some(name) => format!("{what} {name}"),
        None => format!("no further {what}"),
    };
    Some((named(own), named(its)))
}
