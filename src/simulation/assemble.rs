//! From declarations to a topology and engines: names are checked and ranked, message types traced,
//! hosts dealt to engines.

use std::any::TypeId;
use std::sync::{Arc, Mutex};

use super::{LinkDecl, Planned, Simulation, Target};
use crate::engine::{Action, ActorCell, CellState, Engine, LinkCell};
use crate::executor::Ready;
use crate::fault::{BuildError, Fault, FaultCause, LookupError, ObserverError};
use crate::guard::guarded;
use crate::ids::{EntityId, HostId, KindIndex};
use crate::random::name_hash;
use crate::record::{NamedObserver, RESERVED, Wants};
use crate::ruling::{MessageId, MessageOf, Ruling, Rulings};
use crate::schedule::{Control, ControlAction, Schedule};
use crate::time::SimTime;
use crate::topology::{
    Entity, EntityRole, FixedMap, Kind, LinkEntry, Links, Location, PlannedAction, PlannedEvent,
    Routes, RunInfo, Topology,
};

/// Which entity each declaration became.
struct Ranked {
    entities: Vec<Entity>,
    actors: Vec<EntityId>,
    links: Vec<EntityId>,
}

/// Message types, in name order, and where to find them.
struct Kinds {
    list: Vec<Arc<Kind>>,
    of_type: FixedMap<TypeId, KindIndex>,
}

/// What observers are told of control events: all but stops, in order.
fn planned(controls: &[Control]) -> Vec<PlannedEvent> {
    let of = |control: &Control| {
        let ControlAction::Entity(entity, action) = &control.what else {
            return None;
        };
        Some(PlannedEvent {
            time: control.time,
            entity: *entity,
            action: match action {
                Action::Crash => PlannedAction::Crash,
                Action::Restart | Action::Rebuild(_) => PlannedAction::Restart,
                Action::Change(_) => PlannedAction::Change,
                Action::Tell(..) => PlannedAction::Tell,
            },
        })
    };
    let mut planned: Vec<PlannedEvent> = controls.iter().filter_map(of).collect();
    // What is declared first goes first at an instant, as in the run.
    planned.sort_by_key(|event| event.time);
    planned
}

impl Simulation {
    /// Checks the declarations and builds the engines: one, or if `split`, one for each heavy
    /// host, one for all light ones and one for shared links.
    /// What users brought in is taken only once nothing can go wrong any more.
    pub(super) fn assemble(&mut self, split: bool) -> Result<Ready, BuildError> {
        if let Some(mistake) = self.mistake.take() {
            return Err(mistake);
        }
        self.check_names()?;
        let ranked = self.rank();
        let kinds = self.trace_kinds()?;
        let routes = self.routes(&ranked)?;
        self.check_tells()?;
        let wants = self.wants()?;
        let controls = self.take_controls(&ranked, &kinds);
        let (engine_of_host, engine_of_shared, engine_count) = self.deal(split);
        let places = self.place(&ranked, &engine_of_host, engine_of_shared, engine_count);
        let look_ahead = self.look_ahead();
        let links = self.link_entries(&ranked, &kinds);
        let mut address_numbers = vec![None; ranked.entities.len()];
        for (declared, entity) in ranked.actors.iter().enumerate() {
            address_numbers[entity.index()] = Some(declared as u32);
        }
        let info = Arc::new(RunInfo {
            seed: self.seed,
            tie_seed: self.tie_seed,
            entities: ranked.entities.clone(),
            kinds: kinds.list,
            look_ahead,
            planned: planned(&controls),
        });
        let rulings = match &self.rulings[..] {
            [] => None,
            declared => Some(resolved(declared, &info)?),
        };
        let host_names = self.process_names();
        let topology = Arc::new(Topology {
            owner: self.owner,
            seed: self.seed,
            name_hashes: ranked
                .entities
                .iter()
                .map(|entity| name_hash(&entity.name))
                .collect(),
            declared: ranked.actors.clone(),
            declared_links: ranked.links.clone(),
            address_numbers,
            actor_types: std::mem::take(&mut self.types),
            type_of_actor: self.actors.iter().map(|actor| actor.actor_type).collect(),
            places,
            has_one_host: host_names.len() == 1,
            host_names,
            routes,
            links,
            kind_of_type: kinds.of_type,
            reasons: Mutex::default(),
            sample_kinds: Mutex::default(),
            step_limit: self.step_limit,
            late_step: self.step_limit.saturating_sub(Topology::TRACED_STEPS),
            digest: self.digest,
            observed: !wants.is_empty() || self.live.is_some(),
            samples: wants.iter().any(|wants| wants.samples) || self.live.is_some(),
            check_min_delay: self.check_min_delay,
            rulings,
            charges: self.charges.clone(),
            info,
        });
        let schedule = Schedule::new(controls, look_ahead);
        let observers = std::mem::take(&mut self.observers);
        let observers = observers.into_iter().zip(wants).collect();
        let interrupt = self.interrupt.clone();
        let (engines, fault) = self.build_engines(&topology, &ranked, engine_count);
        Ok(Ready {
            topology,
            engines,
            schedule,
            observers,
            interrupt,
            fault,
        })
    }

    fn link_entries(&self, ranked: &Ranked, kinds: &Kinds) -> Links {
        let entry = |(link, entity): (&LinkDecl, &EntityId)| {
            let entry = LinkEntry {
                min_delay: link.min_delay,
                shared: link.host.is_none(),
                change_kind: kinds.of_type[&link.change.type_id],
            };
            (*entity, entry)
        };
        Links::new(self.links.iter().zip(&ranked.links).map(entry))
    }

    fn check_names(&self) -> Result<(), BuildError> {
        for host in &self.hosts {
            check_name(&host.name, "")?;
        }
        for actor in &self.actors {
            check_name(&actor.name, "")?;
            let first = actor.name.split('/').next().unwrap_or_default();
            if RESERVED.contains(&first) {
                return Err(BuildError::ReservedName {
                    name: actor.name.clone(),
                    first: first.to_owned(),
                });
            }
        }
        for link in &self.links {
            // A link is named after what it joins: `base-rover_1`.
            check_name(&link.name, "-")?;
        }
        let mut names: Vec<&str> = self
            .actors
            .iter()
            .map(|actor| actor.name.as_str())
            .collect();
        names.extend(self.links.iter().map(|link| link.name.as_str()));
        names.sort_unstable();
        match names.windows(2).find(|pair| pair[0] == pair[1]) {
            Some(pair) => Err(BuildError::DuplicateName {
                name: pair[0].to_owned(),
            }),
            None => Ok(()),
        }
    }

    /// Numbers the entities in name order, so that nothing hangs on the order of declaration.
    fn rank(&self) -> Ranked {
        let host_name = |host: HostId| self.hosts[host.index()].name.clone();
        let mut all: Vec<(Entity, Option<Target>)> = Vec::new();
        let control = Entity {
            name: "@control".to_owned(),
            role: EntityRole::Control,
            host: None,
        };
        all.push((control, None));
        for (at, actor) in self.actors.iter().enumerate() {
            let host = Some(host_name(actor.host));
            let entity = Entity {
                name: actor.name.clone(),
                role: EntityRole::Actor,
                host,
            };
            all.push((entity, Some(Target::Actor(at as u32))));
        }
        for (at, link) in self.links.iter().enumerate() {
            let host = link.host.map_or_else(|| link.name.clone(), host_name);
            let entity = Entity {
                name: link.name.clone(),
                role: EntityRole::Link,
                host: Some(host),
            };
            all.push((entity, Some(Target::Link(at as u32))));
        }
        all.sort_by(|(a, _), (b, _)| a.name.cmp(&b.name));
        let mut actors = vec![EntityId::CONTROL; self.actors.len()];
        let mut links = vec![EntityId::CONTROL; self.links.len()];
        for (index, (_, target)) in all.iter().enumerate() {
            match target {
                Some(Target::Actor(at)) => actors[*at as usize] = EntityId::from_index(index),
                Some(Target::Link(at)) => links[*at as usize] = EntityId::from_index(index),
                None => {}
            }
        }
        Ranked {
            entities: all.into_iter().map(|(entity, _)| entity).collect(),
            actors,
            links,
        }
    }

    fn trace_kinds(&self) -> Result<Kinds, BuildError> {
        let mut traced: Vec<(TypeId, &'static str, Arc<Kind>)> = Vec::new();
        let accepted = self.types.iter().flat_map(|known| &known.accepts);
        let accepted = accepted.map(|accepted| &accepted.kind);
        for entry in accepted.chain(self.links.iter().map(|link| &link.change)) {
            if traced.iter().any(|(known, ..)| *known == entry.type_id) {
                continue;
            }
            // It is the type's own `Deserialize` that shows what is in it.
            // A part of a run that was, and of types that were tried as it started. Whoever has changed
            // them since hears of it at the next run.
            let trace = match self.live {
                None => entry.trace,
                Some(_) => entry.trace_untried,
            };
            let schema = match guarded(trace) {
                Ok(traced) => traced.map_err(|error| error.to_string()),
                Err(cause) => Err(cause.to_string()),
            };
            let schema = schema.map_err(|error| BuildError::Schema {
                name: entry.type_name.to_owned(),
                error,
            })?;
            traced.push((entry.type_id, entry.type_name, Arc::new(Kind::new(schema))));
        }
        traced.sort_by(|(_, _, a), (_, _, b)| a.name().cmp(b.name()));
        if let Some(pair) = traced
            .windows(2)
            .find(|pair| pair[0].2.name() == pair[1].2.name())
        {
            return Err(BuildError::DuplicateKind {
                name: pair[0].2.name().to_owned(),
                first: pair[0].1.to_owned(),
                second: pair[1].1.to_owned(),
            });
        }
        let of_type = traced
            .iter()
            .enumerate()
            .map(|(at, (id, ..))| (*id, at as KindIndex))
            .collect();
        Ok(Kinds {
            list: traced.into_iter().map(|(_, _, kind)| kind).collect(),
            of_type,
        })
    }

    /// Deals hosts to engines. Returns the engine of each host, that of shared links, and how
    /// many there are.
    fn deal(&self, split: bool) -> (Vec<u32>, u32, u32) {
        let heavy = self.hosts.iter().filter(|host| host.heavy).count();
        if !split || heavy == 0 {
            return (vec![0; self.hosts.len()], 0, 1);
        }
        let mut count = 0;
        let mut next = || {
            count += 1;
            count - 1
        };
        let light = if heavy < self.hosts.len() { next() } else { 0 };
        let of_host = self
            .hosts
            .iter()
            .map(|host| if host.heavy { next() } else { light })
            .collect();
        let shared = if self.links.iter().any(|link| link.host.is_none()) {
            next()
        } else {
            0
        };
        (of_host, shared, count)
    }

    /// The names of hosts, then of shared links, each of which is a host of its own.
    fn process_names(&self) -> Vec<String> {
        let shared = self.links.iter().filter(|link| link.host.is_none());
        let hosts = self.hosts.iter().map(|host| host.name.clone());
        hosts.chain(shared.map(|link| link.name.clone())).collect()
    }

    fn place(
        &self,
        ranked: &Ranked,
        engine_of_host: &[u32],
        engine_of_shared: u32,
        engine_count: u32,
    ) -> Vec<Location> {
        let nowhere = Location {
            host: u32::MAX,
            engine: u32::MAX,
            local: u32::MAX,
        };
        let mut places = vec![nowhere; ranked.entities.len()];
        let mut actors_on = vec![0; engine_count as usize];
        let mut links_on = vec![0; engine_count as usize];
        let mut deal = |counts: &mut Vec<u32>, entity: EntityId, host: u32, engine: u32| {
            let local = &mut counts[engine as usize];
            places[entity.index()] = Location {
                host,
                engine,
                local: *local,
            };
            *local += 1;
        };
        for (actor, entity) in self.actors.iter().zip(&ranked.actors) {
            deal(
                &mut actors_on,
                *entity,
                actor.host.index,
                engine_of_host[actor.host.index()],
            );
        }
        let mut shared_host = self.hosts.len() as u32;
        for (link, entity) in self.links.iter().zip(&ranked.links) {
            match link.host {
                Some(host) => deal(
                    &mut links_on,
                    *entity,
                    host.index,
                    engine_of_host[host.index()],
                ),
                None => {
                    deal(&mut links_on, *entity, shared_host, engine_of_shared);
                    shared_host += 1;
                }
            }
        }
        places
    }

    fn routes(&self, ranked: &Ranked) -> Result<Vec<Routes>, BuildError> {
        let mut known: FixedMap<(HostId, Option<HostId>), EntityId> = FixedMap::default();
        let mut uplinks = vec![None; self.hosts.len()];
        let mut by_host = vec![Vec::new(); self.hosts.len()];
        for route in &self.routes {
            let link = ranked.links[route.link as usize];
            if let Some(other) = known.insert((route.from, route.to), link) {
                let name = |host: HostId| self.hosts[host.index()].name.clone();
                return Err(BuildError::DuplicateRoute {
                    from: name(route.from),
                    to: route.to.map_or_else(|| "*".to_owned(), name),
                    first: ranked.entities[other.index()].name.clone(),
                    second: ranked.entities[link.index()].name.clone(),
                });
            }
            let from = route.from.index();
            match route.to {
                None => uplinks[from] = Some(link),
                Some(to) => by_host[from].push((to.index, link)),
            }
        }
        let routes = uplinks.into_iter().zip(by_host);
        Ok(routes
            .map(|(up, by_host)| Routes::new(up, by_host))
            .collect())
    }

    /// What observers want to be shown, asked once.
    fn wants(&self) -> Result<Vec<Wants>, ObserverError> {
        let wants = self.observers.iter().map(NamedObserver::wants);
        wants.collect()
    }

    /// Whoever handles a type may have left it out of `Accepts`.
    fn check_tells(&self) -> Result<(), BuildError> {
        for control in &self.controls {
            if let (Some(Target::Actor(at)), Planned::Tell(kind, _)) =
                (&control.target, &control.what)
            {
                let actor = &self.actors[*at as usize];
                self.types[actor.actor_type as usize].accepted(kind, &actor.name)?;
            }
        }
        Ok(())
    }

    fn take_controls(&mut self, ranked: &Ranked, kinds: &Kinds) -> Vec<Control> {
        let mut controls = std::mem::take(&mut self.controls);
        // Numbered in order of time, so that what is planned for later has no part in the keys of what
        // comes before: a fork of a run is that run up to where it begins.
        controls.sort_by_key(|control| control.time);
        let controls = controls.into_iter().enumerate();
        let control = |(count, decl): (usize, super::ControlDecl)| {
            let entity = match decl.target {
                Some(Target::Actor(at)) => ranked.actors[at as usize],
                Some(Target::Link(at)) => ranked.links[at as usize],
                None => EntityId::CONTROL,
            };
            let what = match decl.what {
                Planned::Crash => ControlAction::Entity(entity, Action::Crash),
                Planned::Restart => ControlAction::Entity(entity, Action::Restart),
                Planned::Rebuild(factory) => {
                    ControlAction::Entity(entity, Action::Rebuild(factory))
                }
                Planned::Change(change) => ControlAction::Entity(entity, Action::Change(change)),
                Planned::Tell(kind, letter) => {
                    let kind = kinds.of_type[&kind.type_id];
                    ControlAction::Entity(entity, Action::Tell(kind, letter))
                }
                Planned::Stop(reason) => ControlAction::Stop(reason),
            };
            Control {
                time: decl.time,
                count: count as u64,
                what,
            }
        };
        controls.map(control).collect()
    }

    /// Builds the actors, in order of declaration, up to the first whose constructor panics; none if
    /// a link did when it was asked about itself.
    fn build_engines(
        &mut self,
        topology: &Arc<Topology>,
        ranked: &Ranked,
        count: u32,
    ) -> (Vec<Engine>, Option<Box<Fault>>) {
        let fault_of = |entity: EntityId, cause: FaultCause| {
            Box::new(Fault {
                key: topology.key(SimTime::ZERO, 0, entity, 0),
                time: SimTime::ZERO,
                actor: topology.name(entity).to_owned(),
                message: None,
                cause,
            })
        };
        let asked = self.links.iter_mut().zip(&ranked.links);
        let mut troubles = asked.filter_map(|(link, entity)| Some((*entity, link.trouble.take()?)));
        let mut fault = troubles.next().map(|(link, cause)| fault_of(link, *cause));
        let mut actors: Vec<Vec<ActorCell>> = (0..count).map(|_| Vec::new()).collect();
        let mut links: Vec<Vec<LinkCell>> = (0..count).map(|_| Vec::new()).collect();
        let declared = std::mem::take(&mut self.actors);
        for (declared, (actor, entity)) in declared.into_iter().zip(&ranked.actors).enumerate() {
            let is_live = self.live.as_ref().is_none_or(|live| live[declared]);
            let built = match fault {
                _ if !is_live => Err(()),
                None => guarded(|| (actor.factory)(&actor.name))
                    .map_err(|cause| fault = Some(fault_of(*entity, *cause))),
                Some(_) => Err(()),
            };
            let cell = ActorCell {
                actor: built.ok(),
                state: CellState::new(*entity, declared as u32, actor.factory),
            };
            actors[topology.place(*entity).engine as usize].push(cell);
        }
        let declared = std::mem::take(&mut self.links);
        for (LinkDecl { carrier, .. }, entity) in declared.into_iter().zip(&ranked.links) {
            links[topology.place(*entity).engine as usize].push(LinkCell::new(carrier));
        }
        let lists = actors.into_iter().zip(links).enumerate();
        let engines = lists.map(|(at, (a, l))| Engine::new(topology.clone(), at as u32, a, l));
        (engines.collect(), fault)
    }
}

/// Names become topics and frames, as in ROS: `snake_case` segments joined by `/`.
fn check_name(name: &str, extra: &str) -> Result<(), BuildError> {
    let fits =
        |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || extra.contains(c);
    let good = name
        .split('/')
        .all(|segment| !segment.is_empty() && segment.chars().all(fits));
    if good {
        Ok(())
    } else {
        Err(BuildError::BadName {
            name: name.to_owned(),
        })
    }
}

/// The rulings of a run, what they name resolved.
fn resolved(declared: &[(MessageId, Ruling)], info: &RunInfo) -> Result<Rulings, LookupError> {
    let mut rulings = Rulings::default();
    for (id, ruling) in declared {
        let message = MessageOf {
            sender: actor(info, &id.sender)?,
            receiver: actor(info, &id.receiver)?,
            kind: kind(info, &id.kind)?,
            number: id.number,
        };
        rulings.add(message, id.copy, *ruling);
    }
    Ok(rulings)
}

fn actor(info: &RunInfo, name: &str) -> Result<EntityId, LookupError> {
    let entity = info.entity(name);
    let is_actor = |entity: &EntityId| info.entities[entity.index()].role == EntityRole::Actor;
    entity.filter(is_actor).ok_or_else(|| {
        let actors = info.entities.iter();
        let actors = actors.filter(|entity| entity.role == EntityRole::Actor);
        LookupError::unknown(name, actors.map(|entity| entity.name.as_str()))
    })
}

fn kind(info: &RunInfo, name: &str) -> Result<KindIndex, LookupError> {
    let names = || info.kinds.iter().map(|kind| kind.name());
    let found = names().position(|known| known == name);
    found
        .map(|at| at as KindIndex)
        .ok_or_else(|| LookupError::unknown_kind(name, names()))
}
