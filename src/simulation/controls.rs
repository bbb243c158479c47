//! What will happen whatever else does: crashes and restarts, messages from nowhere, changes of links,
//! the end.

use super::{ControlDecl, Planned, Simulation, Target};
use crate::actor::{self, Address};
use crate::carrier::SealedChange;
use crate::fault::{BuildError, LookupError};
use crate::ids::{HostId, LinkId};
use crate::payload::Message;
use crate::time::SimTime;
use crate::topology::KindEntry;

impl Simulation {
    /// Crashes an actor at `time`: its state is gone, its timers are void, and what reaches it is
    /// lost as `crashed` until it is restarted. Durable memory stays.
    pub fn crash_at<A>(&mut self, time: SimTime, actor: Address<A>) {
        self.control_actor(time, actor, Planned::Crash);
    }

    /// Restarts an actor at `time`, crashed or not: a new one is built, in a new incarnation.
    pub fn restart_at<A>(&mut self, time: SimTime, actor: Address<A>) {
        self.control_actor(time, actor, Planned::Restart);
    }

    fn control_actor<A>(&mut self, time: SimTime, actor: Address<A>, what: Planned) {
        if self.owns(actor.owner, "actor", actor.declared) {
            self.control(time, Some(Target::Actor(actor.declared)), what);
        }
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

    fn actors_on(&mut self, host: HostId) -> Vec<u32> {
        match self.owns_host(host) {
            true => self.hosts[host.index()].actors.clone(),
            false => Vec::new(),
        }
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
        if !self.owns(actor.owner(), "actor", actor.declared()) {
            return;
        }
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

    fn target_named(&self, name: &str) -> Result<Target, LookupError> {
        self.declared_named(name).map(Target::Actor)
    }

    /// Changes a link at `time`.
    pub fn change_at<C: Message>(&mut self, time: SimTime, link: LinkId<C>, change: C) {
        let what = Planned::Change(SealedChange::new(change));
        if self.owns(link.owner, "link", link.declared) {
            self.control(time, Some(Target::Link(link.declared)), what);
        }
    }

    /// Stops the run at `time`, before anything that would happen then.
    pub fn stop_at(&mut self, time: SimTime, reason: &str) {
        self.control(time, None, Planned::Stop(reason.to_owned()));
    }

    pub(super) fn control(&mut self, time: SimTime, target: Option<Target>, what: Planned) {
        self.controls.push(ControlDecl { time, target, what });
    }
}
