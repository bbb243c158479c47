//! What a fork of a run needs: rulings on single messages, and actors that are built otherwise from an instant on.

use super::{ActorDecl, Planned, Simulation, Target};
use crate::fault::BuildError;
use crate::ruling::{MessageId, Ruling};
use crate::time::SimTime;

impl Simulation {
    /// Decides what becomes of a message that goes through a link, whatever the link decides. Of several
    /// rulings on one message, whichever of its names they use, each sees what the one before has left.
    /// What came of them is in
    /// [`Report::rulings`](crate::Report::rulings), in the order in which they were declared.
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

    /// An empty simulation with the same seeds, to declare the same team in with other settings, for
    /// [`Simulation::rebuild_at`].
    #[must_use]
    pub fn twin(&self) -> Simulation {
        let mut twin = Simulation::new(self.seed);
        twin.owner = self.owner;
        twin.tie_seed = self.tie_seed;
        twin
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
    /// fn assemble(sim: &mut Simulation, speed: u32) {
    ///     let host = sim.host("rover_01");
    ///     sim.actor(host, "rover_01", move |_| Rover(speed));
    /// }
    /// let mut sim = Simulation::new(1);
    /// assemble(&mut sim, 1);
    /// let mut faster = sim.twin();
    /// assemble(&mut faster, 5);
    /// let rebuilt = sim.rebuild_at(SimTime::from_secs(9), faster, |name| name.starts_with("rover"));
    /// assert_eq!(rebuilt?, ["rover_01"]);
    /// let report = sim.run(Executor::Inline)?;
    /// assert_eq!((report.end_time.as_nanos(), report.end.detail().as_str()), (9_000_000_000, "rover_01: at speed 5"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// When `other` is no [`Simulation::twin`] of this one, or has not the same hosts, actors and links, in the
    /// same order: addresses that its actors hold would mean others here.
    pub fn rebuild_at(
        &mut self,
        time: SimTime,
        other: Simulation,
        which: impl Fn(&str) -> bool,
    ) -> Result<Vec<String>, BuildError> {
        if other.owner != self.owner {
            let (what, number) = ("actor", 0);
            return Err(BuildError::OtherSimulation { what, number });
        }
        self.check_team(&other)?;
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

    /// Checks that `other` has the same hosts, actors and links, in the same order.
    ///
    /// ```
    /// use farside::prelude::*;
    /// let (mut a, mut b) = (Simulation::new(1), Simulation::new(2));
    /// a.host("rover_01");
    /// b.host("rover_02");
    /// let error = a.check_team(&b).unwrap_err();
    /// assert!(error.to_string().contains("rover_02"));
    /// ```
    ///
    /// # Errors
    /// With the first that they do not have alike.
    pub fn check_team(&self, other: &Simulation) -> Result<(), BuildError> {
        match self.first_difference(other) {
            None => Ok(()),
            Some((own, its)) => Err(BuildError::OtherTeam { own, its }),
        }
    }

    /// The first host, actor or link that the two do not have alike, as either has it.
    fn first_difference(&self, other: &Simulation) -> Option<(String, String)> {
        let hosts =
            |sim: &Simulation| -> Vec<String> { sim.host_names().map(str::to_owned).collect() };
        let links =
            |sim: &Simulation| -> Vec<String> { sim.link_names().map(str::to_owned).collect() };
        let actors = |sim: &Simulation| -> Vec<String> {
            let actor = |actor: &ActorDecl| {
                let host = &sim.hosts[actor.host.index()].name;
                let of = sim.types[actor.actor_type as usize].name;
                format!("{} on {host}, a {of}", actor.name)
            };
            sim.actors.iter().map(actor).collect()
        };
        differs("host", &hosts(self), &hosts(other))
            .or_else(|| differs("actor", &actors(self), &actors(other)))
            .or_else(|| differs("link", &links(self), &links(other)))
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
