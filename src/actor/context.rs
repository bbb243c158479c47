//! All that an actor can reach: the present instant, its random streams, other actors, timers, its
//! durable memory, the log, and the end of the run. No wall clock, no environment, no I/O.

use std::any::TypeId;
use std::marker::PhantomData;

use super::address::{Address, Recipient, Target, seal_change};
use super::{Actor, Handler};
use crate::engine::{CellState, Core, Outbound, Parts};
use crate::fault::{FaultCause, LookupError};
use crate::ids::{EntityId, LinkId, MatchKey, TimerId};
use crate::payload::Message;
use crate::random::{RandomKey, Stream};
use crate::time::{SimDuration, SimTime};
use crate::topology::Topology;

/// A handler's way to the world, at one instant of virtual time.
pub struct Context<'a, A> {
    parts: &'a mut Parts,
    state: &'a mut CellState,
    actor: PhantomData<fn() -> A>,
}

impl<'a, A: Actor> Context<'a, A> {
    pub(crate) fn new(core: &'a mut Core<'_>) -> Self {
        Context {
            parts: &mut *core.parts,
            state: &mut *core.state,
            actor: PhantomData,
        }
    }

    fn me(&self) -> EntityId {
        self.state.entity
    }

    /// The present instant.
    pub fn now(&self) -> SimTime {
        self.parts.key().time
    }

    /// This actor's name.
    pub fn name(&self) -> &str {
        self.parts.topology.name(self.me())
    }

    /// This actor's own address.
    pub fn address(&self) -> Address<A> {
        Address::new(self.parts.topology.owner, self.state.declared)
    }

    /// How often this actor was restarted; 0 in its first life.
    pub fn incarnation(&self) -> u32 {
        self.state.incarnation
    }

    /// The address of the actor called `name`.
    ///
    /// # Errors
    /// When no actor has that name, or it is not a `B`.
    pub fn lookup<B: Actor>(&self, name: &str) -> Result<Address<B>, LookupError> {
        let (declared, actor_type) = self.parts.topology.actor(name)?;
        if actor_type.type_id != TypeId::of::<B>() {
            return Err(LookupError::WrongType {
                name: name.to_owned(),
                expected: std::any::type_name::<B>(),
                actual: actor_type.name,
            });
        }
        Ok(Address::new(self.parts.topology.owner, declared))
    }

    /// The actor called `name`, whatever its type, as one that accepts `M`: so a planner of one's
    /// own takes the place of another under the same name.
    ///
    /// ```
    /// use farside::prelude::*;
    /// use serde::{Deserialize, Serialize};
    ///
    /// #[derive(Serialize, Deserialize)]
    /// struct Goal { east_m: f64, north_m: f64 }
    ///
    /// /// Takes goals. The rover below knows nothing else of it.
    /// struct MyPlanner;
    /// impl Actor for MyPlanner { type Accepts = (Goal,); }
    /// impl Handler<Goal> for MyPlanner {
    ///     fn handle(&mut self, goal: Goal, ctx: &mut Context<'_, Self>) -> Outcome {
    ///         assert_eq!((goal.east_m, goal.north_m), (3.0, 4.0));
    ///         ctx.stop("planned");
    ///         Ok(())
    ///     }
    /// }
    ///
    /// struct Rover;
    /// impl Actor for Rover {
    ///     type Accepts = ();
    ///     fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
    ///         let planner = ctx.recipient::<Goal>("planner")?;
    ///         ctx.send(planner, Goal { east_m: 3.0, north_m: 4.0 });
    ///         Ok(())
    ///     }
    /// }
    ///
    /// let mut sim = Simulation::new(1);
    /// let host = sim.host("rover_01");
    /// sim.actor(host, "planner", |_| MyPlanner);
    /// sim.actor(host, "rover", |_| Rover);
    /// assert_eq!(sim.run(Executor::Inline).unwrap().end.name(), "stopped");
    /// ```
    ///
    /// # Errors
    /// When no actor has that name, or its `Accepts` does not list `M`; the error names what it
    /// lists.
    pub fn recipient<M: Message>(&self, name: &str) -> Result<Recipient<M>, LookupError> {
        let (declared, actor_type) = self.parts.topology.actor(name)?;
        Recipient::of(self.parts.topology.owner, declared, actor_type, name)
    }

    /// Sends `message`, within the host at once, to another host through the link between them.
    ///
    /// That the link may lose it is no error here. That there is no link ends the run.
    pub fn send<M: Message>(&mut self, target: impl Target<M>, message: M) {
        self.dispatch(target, message, None, SimDuration::ZERO);
    }

    /// Sends `message` with an identity of the protocol's own (a cycle, an iteration), by which
    /// runs are compared and links draw, where the message's ordinal would not be stable.
    pub fn send_keyed<M: Message>(&mut self, target: impl Target<M>, key: MatchKey, message: M) {
        self.dispatch(target, message, Some(key), SimDuration::ZERO);
    }

    /// Sends `message` to an actor of the same host, to arrive after `delay`.
    pub fn send_after<M: Message>(
        &mut self,
        target: impl Target<M>,
        delay: SimDuration,
        message: M,
    ) {
        self.dispatch(target, message, None, delay);
    }

    /// Sets a timer: `message` comes back to this actor after `delay`, unless cancelled first. A
    /// restart voids it.
    pub fn timer<M: Message>(&mut self, delay: SimDuration, message: M) -> TimerId
    where
        A: Handler<M>,
    {
        let Some(kind) = self.parts.kind_of(TypeId::of::<M>()) else {
            let me = self.me();
            self.parts.not_listed(me, std::any::type_name::<M>());
            return TimerId {
                owner: self.parts.topology.owner,
                slot: u32::MAX,
                kind: 0,
                ordinal: u64::MAX,
            };
        };
        let letter = self.address().seal(message);
        self.parts
            .set_timer(self.state, self.me(), kind, letter, delay)
    }

    /// Cancels a timer. False if it has fired or was cancelled before.
    pub fn cancel(&mut self, timer: TimerId) -> bool {
        if timer.owner != self.parts.topology.owner {
            self.of_another_simulation("timer", timer.slot);
            return false;
        }
        self.parts.cancel_timer(self.me(), timer)
    }

    /// The links that carry what this host sends and take changes of type `C`, in name order: those
    /// that [`Context::tell_link`] may be called with.
    pub fn links<C: Message>(&self) -> Vec<LinkId<C>> {
        let topology = &self.parts.topology;
        let host = topology.place(self.me()).host;
        let Some(kind) = topology.kind_of_type.get(&TypeId::of::<C>()) else {
            return Vec::new();
        };
        let routes = &topology.routes[host as usize];
        let mut links = routes.links();
        links.retain(|link| {
            let entry = topology.links.get(*link);
            entry.is_some_and(|link| link.change_kind == *kind)
        });
        links.sort_unstable();
        links.dedup();
        let id = |link: EntityId| {
            let declared = topology
                .declared_links
                .iter()
                .position(|known| *known == link);
            declared.map(|declared| LinkId::new(topology.owner, declared as u32))
        };
        links.into_iter().filter_map(id).collect()
    }

    /// Tells a link something: new parameters, or where this host is. The link must be one of this
    /// host's own, or a shared one; it hears of it in the next step of this instant.
    pub fn tell_link<C: Message>(&mut self, link: LinkId<C>, change: C) {
        if link.owner != self.parts.topology.owner {
            return self.of_another_simulation("link", link.declared);
        }
        let link = self.parts.topology.declared_links[link.declared as usize];
        let letter = seal_change(change);
        self.parts.ask_change(self.state, self.me(), link, letter);
    }

    /// What links have charged this actor so far for transmitting what it sent, in joules. It
    /// outlives a crash, as spent energy does.
    pub fn transmit_energy_j(&self) -> f64 {
        self.parts.energy_read.set(true);
        self.state.rest.charged_j
    }

    /// What links have charged all actors of this host so far for transmitting, in joules: so that
    /// the actor that keeps the battery sees what the planner beside it sent. It outlives crashes.
    ///
    /// A link of this host's own charges as the message is sent; a shared link, one
    /// [`Carrier::min_delay`](crate::Carrier::min_delay) after each transmission.
    ///
    /// ```
    /// use farside::prelude::*;
    /// use farside::carrier::{Carriage, NoChange};
    /// use farside::{Carrier, Parcel, Verdicts};
    /// # use serde::{Deserialize, Serialize};
    ///
    /// /// Takes 2 J from the sender, and 0.5 J from the receiver.
    /// struct Radio;
    /// impl Carrier for Radio {
    ///     type Change = NoChange;
    ///     fn min_delay(&self) -> SimDuration { SimDuration::from_millis(10) }
    ///     fn carry(&mut self, _parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
    ///         let carriage = Carriage {
    ///             propagation: self.min_delay(),
    ///             attempts: 1,
    ///             energy_j: 2.0,
    ///             receive_j: 0.5,
    ///             ..Carriage::default()
    ///         };
    ///         verdicts.deliver_as(self.min_delay(), carriage);
    ///         verdicts.charge(2.0);
    ///     }
    ///     fn change(&mut self, _change: NoChange, _now: SimTime) {}
    /// }
    /// # #[derive(Serialize, Deserialize)] struct Plan;
    /// # #[derive(Serialize, Deserialize)] struct Minute;
    ///
    /// struct Planner;
    /// impl Actor for Planner {
    ///     type Accepts = ();
    ///     fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
    ///         let base = ctx.recipient::<Plan>("base")?;
    ///         ctx.send(base, Plan);
    ///         Ok(())
    ///     }
    /// }
    ///
    /// struct Battery;
    /// impl Actor for Battery {
    ///     type Accepts = (Minute,);
    ///     fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
    ///         ctx.timer(SimDuration::from_secs(60), Minute);
    ///         Ok(())
    ///     }
    /// }
    /// impl Handler<Minute> for Battery {
    ///     fn handle(&mut self, _: Minute, ctx: &mut Context<'_, Self>) -> Outcome {
    ///         // The planner sent it, from this host.
    ///         assert_eq!((ctx.transmit_energy_j(), ctx.host_transmit_energy_j()), (0.0, 2.0));
    ///         Ok(())
    ///     }
    /// }
    ///
    /// struct Base;
    /// impl Actor for Base { type Accepts = (Plan,); }
    /// impl Handler<Plan> for Base {
    ///     fn handle(&mut self, _: Plan, ctx: &mut Context<'_, Self>) -> Outcome {
    ///         assert_eq!(ctx.host_receive_energy_j(), 0.5);
    ///         Ok(())
    ///     }
    /// }
    ///
    /// let mut sim = Simulation::new(1);
    /// let (rover, base) = (sim.host("rover_01"), sim.host("base"));
    /// sim.actor(rover, "rover_01/planner", |_| Planner);
    /// sim.actor(rover, "rover_01/battery", |_| Battery);
    /// sim.actor(base, "base", |_| Base);
    /// sim.link(rover, base, "rover_01-base", Radio);
    /// assert_eq!(sim.run(Executor::Inline).unwrap().end.name(), "completed");
    /// ```
    pub fn host_transmit_energy_j(&self) -> f64 {
        let host = self.parts.topology.place(self.me()).host;
        self.parts.energy_so_far(host).transmit_j
    }

    /// What receiving has taken from this host so far, in joules: [`Carriage::receive_j`] of all
    /// that arrived for its actors, charged when it arrives, crashed or not. It outlives crashes.
    ///
    /// [`Carriage::receive_j`]: crate::Carriage::receive_j
    pub fn host_receive_energy_j(&self) -> f64 {
        let host = self.parts.topology.place(self.me()).host;
        self.parts.energy_so_far(host).receive_j
    }

    /// This actor's random stream for `purpose`, derived from (run seed, actor, purpose,
    /// incarnation). It goes on where it was left.
    pub fn random(&mut self, purpose: &'static str) -> &mut Stream {
        let (topology, me) = (&self.parts.topology, self.me());
        let incarnation = u64::from(self.state.incarnation);
        self.state.stream(purpose, || {
            draws(topology, me, purpose, incarnation).stream()
        })
    }

    /// The address of draws by `key` (a cycle, a sample's number), the same whatever was drawn
    /// before.
    pub fn random_at(&self, purpose: &str, key: u64) -> RandomKey {
        draws(&self.parts.topology, self.me(), purpose, key)
    }

    /// Durable memory: a value of type `D` that outlives a crash, made by `Default` when first
    /// asked for. One for each type.
    pub fn durable<D: Default + Send + 'static>(&mut self) -> &mut D {
        let durable = &mut self.state.rest.durable;
        let at = match durable.iter().position(|value| value.is::<D>()) {
            Some(at) => at,
            None => {
                durable.push(Box::new(D::default()));
                durable.len() - 1
            }
        };
        durable[at].downcast_mut().expect("found by its type")
    }

    /// True if someone watches state samples; for skipping work that only [`Context::sample`]
    /// needs.
    pub fn samples_wanted(&self) -> bool {
        self.parts.topology.samples
    }

    /// Records a sample of this actor's state, for logs, monitors and viewers. Samples are no part
    /// of the digest, and cost next to nothing if nobody watches.
    ///
    /// Logs know a sample by the serde name of its type. A second type of the same name is a fault,
    /// [`FaultCause::SampleNames`], watched or not.
    pub fn sample<S: Message>(&mut self, sample: &S) {
        let at = self.parts.sample_type::<S>(self.me());
        if self.samples_wanted() {
            self.parts.add_sample(self.me(), at, sample);
        }
    }

    /// Asks for the run to stop, for `reason`, one look-ahead from now.
    pub fn stop(&mut self, reason: impl Into<String>) {
        if self.parts.stop.is_none() {
            self.parts.stop = Some((self.parts.key(), self.me(), reason.into()));
        }
    }

    fn dispatch<M: Message>(
        &mut self,
        target: impl Target<M>,
        message: M,
        match_key: Option<MatchKey>,
        delay: SimDuration,
    ) {
        if target.owner() != self.parts.topology.owner {
            return self.of_another_simulation("actor", target.declared());
        }
        let Some(kind) = self.parts.kind_of(TypeId::of::<M>()) else {
            let receiver = self.parts.topology.declared[target.declared() as usize];
            let kind = std::any::type_name::<M>();
            return self.parts.not_listed(receiver, kind);
        };
        let (me, declared) = (self.me(), target.declared());
        let outbound = |letter| Outbound {
            declared,
            kind,
            letter,
            match_key,
            delay,
        };
        // Sealed on each way by itself: a letter is built where it waits.
        if self.parts.goes_by_outbox(me, declared) {
            let outbound = outbound(target.seal(message));
            return self.parts.send_by_outbox(self.state, me, outbound);
        }
        let outbound = outbound(target.seal(message));
        self.parts.send(self.state, me, outbound);
    }

    #[cold]
    fn of_another_simulation(&mut self, what: &'static str, number: u32) {
        self.parts
            .raise(FaultCause::OtherSimulation { what, number });
    }
}

/// The address of draws by an actor.
fn draws(topology: &Topology, me: EntityId, purpose: &str, key: u64) -> RandomKey {
    RandomKey::new(topology.seed)
        .number(topology.name_hash(me))
        .text(purpose)
        .number(key)
}
