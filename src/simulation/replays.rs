//! What a replay takes from a simulation, and charges told to who keeps a journal of them.

use std::sync::Arc;

use super::Simulation;
use crate::carrier::AnyCarrier;
use crate::charge::ChargeJournal;
use crate::engine::{Engine, Factory};
use crate::executor::Ready;
use crate::fault::{BuildError, Fault};
use crate::guard::dropped;
use crate::ids::EntityId;
use crate::key::EventKey;
use crate::topology::Topology;

/// A simulation of which some actors live, and the others and all links are absent.
pub(crate) struct Stage {
    pub(crate) topology: Arc<Topology>,
    pub(crate) engine: Engine,
    /// The constructors that actors have from some control events on, in order.
    pub(crate) rebuilds: Vec<(EventKey, EntityId, Factory)>,
    /// By entity, whether it is an actor that lives.
    pub(crate) live: Vec<bool>,
    /// The constructor of an actor that lives panicked.
    pub(crate) fault: Option<Box<Fault>>,
}

impl Simulation {
    /// Notes from now on what links charge, as it happens.
    ///
    /// ```
    /// use farside::prelude::*;
    /// let mut sim = Simulation::new(1);
    /// let journal = sim.journal_charges();
    /// sim.run(Executor::Inline)?;
    /// assert!(journal.take().is_empty());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn journal_charges(&mut self) -> ChargeJournal {
        self.charges.get_or_insert_default().clone()
    }

    /// Builds the actors that live. Links are those that `carrier` makes; observers, rulings and control
    /// events are no part of it, but for those that exchange constructors.
    pub(crate) fn into_stage(
        mut self,
        live: impl Fn(&str) -> bool,
        carrier: impl Fn() -> Box<dyn AnyCarrier>,
    ) -> Result<Stage, BuildError> {
        let names = self.actors.iter();
        self.live = Some(names.map(|actor| live(&actor.name)).collect());
        self.digest = false;
        self.rulings.clear();
        self.charges = None;
        for observer in std::mem::take(&mut self.observers) {
            // Nobody is to know of a panic in what is not wanted.
            let _ = observer.dismiss();
        }
        for link in &mut self.links {
            let absent = std::mem::replace(&mut link.carrier, carrier());
            let _ = dropped(absent);
        }
        let Ready {
            topology,
            engines,
            schedule,
            fault,
            ..
        } = match self.assemble(false) {
            Ok(ready) => ready,
            Err(error) => {
                self.discard();
                return Err(error);
            }
        };
        let Ok([mut engine]) = <[Engine; 1]>::try_from(engines) else {
            unreachable!("a simulation that is not split has one engine");
        };
        let mut of_entity = vec![false; topology.info.entities.len()];
        let declared = self.live.iter().flatten().zip(&topology.declared);
        for (live, entity) in declared {
            of_entity[entity.index()] = *live;
        }
        engine.parts.encode_only(of_entity.clone().into());
        Ok(Stage {
            rebuilds: schedule.into_rebuilds(&topology),
            live: of_entity,
            topology,
            engine,
            fault,
        })
    }
}
