//! What is fixed before a run starts: who takes part, which messages they exchange, which link
//! joins which hosts. Shared, read-only, by every engine of the run.

use std::any::{Any, TypeId};
use std::sync::{Arc, Mutex, PoisonError};

use rustc_hash::FxBuildHasher;

use crate::charge::ChargeJournal;
use crate::encoding::{Schema, SchemaError};
use crate::fault::LookupError;
use crate::ids::{EntityId, HostIndex, KindIndex, Owner};
use crate::key::EventKey;
use crate::payload::Message;
use crate::random::name_hash;
use crate::ruling::Rulings;
use crate::time::{SimDuration, SimTime};

/// A hash map that is only ever asked for a key, with a hasher that is the same on every machine.
pub(crate) type FixedMap<K, V> = hashbrown::HashMap<K, V, FxBuildHasher>;

/// A message type of a run: its name and how it is written.
#[derive(Debug)]
pub struct Kind {
    pub(crate) name: String,
    pub(crate) hash: u64,
    pub(crate) schema: Schema,
}

impl Kind {
    pub(crate) fn new(schema: Schema) -> Self {
        let name = schema.name().to_owned();
        Kind {
            hash: name_hash(&name),
            name,
            schema,
        }
    }

    /// The serde name of the message type.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The [`name_hash`] of the name.
    pub fn hash(&self) -> u64 {
        self.hash
    }

    /// How bodies of this kind are encoded.
    pub fn schema(&self) -> &Schema {
        &self.schema
    }
}

/// A message type as it is declared, before it is traced.
pub(crate) struct KindEntry {
    pub(crate) type_id: TypeId,
    pub(crate) type_name: &'static str,
    pub(crate) trace: fn() -> Result<Schema, SchemaError>,
    /// The same, without trying whether values come back.
    pub(crate) trace_untried: fn() -> Result<Schema, SchemaError>,
}

impl KindEntry {
    pub(crate) fn of<M: Message>() -> Self {
        KindEntry {
            type_id: TypeId::of::<M>(),
            type_name: std::any::type_name::<M>(),
            trace: Schema::of::<M>,
            trace_untried: Schema::untried::<M>,
        }
    }
}

/// A message type that an actor accepts.
#[doc(hidden)]
pub struct Accepted {
    pub(crate) kind: KindEntry,
    /// How a message of this type is sealed for the actor: a function whose type only those know
    /// who know the message's.
    pub(crate) seal: Box<dyn Any + Send + Sync>,
    /// How one that a log holds is read and sealed: an `engine::Unseal`.
    pub(crate) unseal: Box<dyn Any + Send + Sync>,
}

impl Accepted {
    pub(crate) fn new<M: Message>(
        seal: Box<dyn Any + Send + Sync>,
        unseal: Box<dyn Any + Send + Sync>,
    ) -> Self {
        let kind = KindEntry::of::<M>();
        Accepted { kind, seal, unseal }
    }
}

/// A Rust type of actors, and what actors of this type accept.
pub(crate) struct ActorType {
    pub(crate) type_id: TypeId,
    pub(crate) name: &'static str,
    pub(crate) accepts: Vec<Accepted>,
}

impl ActorType {
    /// What the type says of messages of this kind, asked of the actor called `actor`.
    ///
    /// # Errors
    /// When the type's `Accepts` does not list the kind.
    pub(crate) fn accepted(&self, kind: &KindEntry, actor: &str) -> Result<&Accepted, LookupError> {
        let found = self
            .accepts
            .iter()
            .find(|accepted| accepted.kind.type_id == kind.type_id);
        found.ok_or_else(|| LookupError::NotAccepted {
            name: actor.to_owned(),
            kind: kind.type_name,
            actual: self.name,
            accepts: self.accepts.iter().map(|a| a.kind.type_name).collect(),
        })
    }
}

/// What an entity is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EntityRole {
    /// `@control`.
    Control,
    /// An actor.
    Actor,
    /// A link.
    Link,
}

/// One entity of a run.
#[derive(Clone, Debug)]
pub struct Entity {
    /// Its name: unique, and what logs call it.
    pub name: String,
    /// What it is.
    pub role: EntityRole,
    /// The host it lives on; a shared link is a host of its own, and `@control` has none.
    pub host: Option<String>,
}

/// What observers are told about a run before it starts.
#[derive(Debug)]
pub struct RunInfo {
    /// The run's seed.
    pub seed: u64,
    /// The tie seed, if ties are shuffled.
    pub tie_seed: Option<u64>,
    /// Every entity, in name order: [`EntityId`]s index it.
    pub entities: Vec<Entity>,
    /// The message types that actors accept and links take as changes, in name order.
    pub kinds: Vec<Arc<Kind>>,
    /// The least delay between hosts.
    pub look_ahead: SimDuration,
    /// What is fixed before the run and will happen whatever else does: who crashes and restarts,
    /// which links change, who is told something. In order of time; the run may end before.
    pub planned: Vec<PlannedEvent>,
}

/// An event that is fixed before a run, such as the restart of an actor.
///
/// ```
/// use farside::prelude::*;
/// use farside::PlannedAction;
/// use farside::record::{Flow, Observer, ObserverError, Record};
/// use std::sync::Arc;
///
/// struct Rover;
/// impl Actor for Rover { type Accepts = (); }
///
/// /// Knows at the start when somebody comes back.
/// struct Patient;
/// impl Observer for Patient {
///     fn begin(&mut self, run: &Arc<farside::RunInfo>) -> Result<(), ObserverError> {
///         let [crash, restart] = &run.planned[..] else { panic!("{:?}", run.planned) };
///         assert_eq!((crash.action, crash.time), (PlannedAction::Crash, SimTime::from_secs(2)));
///         let back = (restart.action, restart.time);
///         assert_eq!(back, (PlannedAction::Restart, SimTime::from_secs(9)));
///         assert_eq!(run.name(restart.entity), "rover_01");
///         Ok(())
///     }
///     fn record(&mut self, _: &Record<'_>) -> Result<Flow, ObserverError> {
///         Ok(Flow::Continue)
///     }
/// }
///
/// let mut sim = Simulation::new(1);
/// let host = sim.host("rover_01");
/// sim.actor(host, "rover_01", |_| Rover);
/// sim.restart_named_at(SimTime::from_secs(9), "rover_01")?;
/// sim.crash_named_at(SimTime::from_secs(2), "rover_01")?;
/// sim.observe(Patient);
/// sim.run(Executor::Inline)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlannedEvent {
    /// When it happens.
    pub time: SimTime,
    /// The actor or the link that it happens to.
    pub entity: EntityId,
    /// What it is.
    pub action: PlannedAction,
}

/// What a [`PlannedEvent`] does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlannedAction {
    /// It crashes an actor.
    Crash,
    /// It restarts an actor.
    Restart,
    /// It changes a link.
    Change,
    /// It hands an actor a message.
    Tell,
}

impl RunInfo {
    /// The name of an entity.
    pub fn name(&self, entity: EntityId) -> &str {
        &self.entities[entity.index()].name
    }

    /// The entity with this name.
    pub fn entity(&self, name: &str) -> Option<EntityId> {
        let found = self
            .entities
            .binary_search_by(|e| e.name.as_str().cmp(name));
        found.ok().map(EntityId::from_index)
    }
}

/// The number of a loss reason in [`Topology::reason`]: messages in flight carry two bytes, not a
/// text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Reason(u16);

/// Where an entity's state lives.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Location {
    pub(crate) host: HostIndex,
    /// Which engine runs the host.
    pub(crate) engine: u32,
    /// The place in the engine's list of actors or of links.
    pub(crate) local: u32,
}

/// Which link takes what a host sends to another.
#[derive(Debug)]
pub(crate) struct Routes {
    /// Link to every host that has no link of its own.
    uplink: Option<EntityId>,
    by_host: ByHost,
}

/// Links by receiving host.
#[derive(Debug)]
enum ByHost {
    /// At the host's number.
    Table(Vec<Option<EntityId>>),
    /// In order of the host's number. A table for each of many hosts that reach few others would take
    /// memory with the square of their number.
    Few(Vec<(HostIndex, EntityId)>),
}

impl Routes {
    /// Routes to each host once, in any order.
    pub(crate) fn new(uplink: Option<EntityId>, mut by_host: Vec<(HostIndex, EntityId)>) -> Self {
        /// A table may have so many places for each link, or so many at all.
        const PLACES_A_LINK: usize = 8;
        const PLACES: usize = 64;
        by_host.sort_unstable_by_key(|(host, _)| *host);
        let places = by_host.last().map_or(0, |(host, _)| *host as usize + 1);
        let by_host = if places <= PLACES.max(PLACES_A_LINK * by_host.len()) {
            let mut table = vec![None; places];
            for (host, link) in by_host {
                table[host as usize] = Some(link);
            }
            ByHost::Table(table)
        } else {
            ByHost::Few(by_host)
        };
        Routes { uplink, by_host }
    }

    #[inline(always)]
    fn to(&self, host: HostIndex) -> Option<EntityId> {
        let own = match &self.by_host {
            ByHost::Table(table) => table.get(host as usize).copied().flatten(),
            ByHost::Few(links) => Routes::among(links, host),
        };
        own.or(self.uplink)
    }

    #[inline(never)]
    fn among(links: &[(HostIndex, EntityId)], host: HostIndex) -> Option<EntityId> {
        let at = links.binary_search_by_key(&host, |(to, _)| *to).ok()?;
        Some(links[at].1)
    }

    /// All its links, some perhaps several times.
    pub(crate) fn links(&self) -> Vec<EntityId> {
        let mut links: Vec<EntityId> = match &self.by_host {
            ByHost::Table(table) => table.iter().flatten().copied().collect(),
            ByHost::Few(links) => links.iter().map(|(_, link)| *link).collect(),
        };
        links.extend(self.uplink);
        links
    }
}

/// A link as the topology knows it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinkEntry {
    pub(crate) min_delay: SimDuration,
    pub(crate) shared: bool,
    pub(crate) change_kind: KindIndex,
}

/// The links of a run, by entity: a message looks for its link several times.
pub(crate) struct Links(Vec<Option<LinkEntry>>);

impl Links {
    /// From entities and their links, in any order.
    pub(crate) fn new(entries: impl Iterator<Item = (EntityId, LinkEntry)>) -> Self {
        let mut links = Vec::new();
        for (entity, entry) in entries {
            if links.len() <= entity.index() {
                links.resize(entity.index() + 1, None);
            }
            links[entity.index()] = Some(entry);
        }
        Links(links)
    }

    /// What is known of the link; none of what is no link.
    #[inline(always)]
    pub(crate) fn get(&self, link: EntityId) -> Option<&LinkEntry> {
        self.0.get(link.index())?.as_ref()
    }

    #[inline(always)]
    pub(crate) fn is_shared(&self, link: EntityId) -> bool {
        self.get(link).is_some_and(|link| link.shared)
    }

    /// All links, in name order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (EntityId, &LinkEntry)> {
        let numbered = self.0.iter().enumerate();
        numbered.filter_map(|(at, link)| Some((EntityId::from_index(at), link.as_ref()?)))
    }
}

/// Everything fixed about a run.
pub(crate) struct Topology {
    pub(crate) owner: Owner,
    pub(crate) seed: u64,
    pub(crate) info: Arc<RunInfo>,
    pub(crate) name_hashes: Vec<u64>,
    /// From the number in an address to the entity.
    pub(crate) declared: Vec<EntityId>,
    /// From the number in a link's id to the entity.
    pub(crate) declared_links: Vec<EntityId>,
    /// From the entity to the number in its address, if it is an actor.
    pub(crate) address_numbers: Vec<Option<u32>>,
    /// The Rust types of actors.
    pub(crate) actor_types: Vec<ActorType>,
    /// From the number in an address to the type of the actor.
    pub(crate) type_of_actor: Vec<u32>,
    pub(crate) places: Vec<Location>,
    pub(crate) host_names: Vec<String>,
    /// All actors live on one host, and there is no shared link.
    pub(crate) has_one_host: bool,
    pub(crate) routes: Vec<Routes>,
    pub(crate) links: Links,
    pub(crate) kind_of_type: FixedMap<TypeId, KindIndex>,
    /// Reasons met so far. Their numbers differ from run to run, and leave the kernel as texts.
    pub(crate) reasons: Mutex<Vec<&'static str>>,
    pub(crate) sample_kinds: Mutex<Vec<(TypeId, Arc<Kind>)>>,
    pub(crate) step_limit: u32,
    /// After this step hops are traced.
    pub(crate) late_step: u32,
    pub(crate) digest: bool,
    /// Someone wants records: without, and without a digest, none are made.
    pub(crate) observed: bool,
    pub(crate) samples: bool,
    /// False only in the test that shows why the check of `min_delay` is there.
    pub(crate) check_min_delay: bool,
    /// What becomes of single messages whatever links decide; none in nearly all runs.
    pub(crate) rulings: Option<Rulings>,
    /// Where charges are noted as they are made; none in nearly all runs.
    pub(crate) charges: Option<ChargeJournal>,
}

impl Topology {
    /// Of so many of the last hops at an instant that a run allows is kept what they were.
    pub(crate) const TRACED_STEPS: u32 = 8;

    /// True for an event of the last hops that are allowed at an instant, or of one more.
    #[inline(always)]
    pub(crate) fn is_late_step(&self, step: u32) -> bool {
        step > self.late_step
    }

    pub(crate) fn name(&self, entity: EntityId) -> &str {
        self.info.name(entity)
    }

    #[inline(always)]
    pub(crate) fn name_hash(&self, entity: EntityId) -> u64 {
        self.name_hashes[entity.index()]
    }

    pub(crate) fn host_name(&self, entity: EntityId) -> &str {
        &self.host_names[self.places[entity.index()].host as usize]
    }

    #[inline(always)]
    pub(crate) fn place(&self, entity: EntityId) -> Location {
        self.places[entity.index()]
    }

    #[inline(always)]
    pub(crate) fn kind(&self, index: KindIndex) -> &Arc<Kind> {
        &self.info.kinds[index as usize]
    }

    pub(crate) fn link(&self, from: HostIndex, to: HostIndex) -> Option<EntityId> {
        self.routes[from as usize].to(to)
    }

    /// The number in the address of the actor called `name`, and the actor's type.
    pub(crate) fn actor(&self, name: &str) -> Result<(u32, &ActorType), LookupError> {
        let entity = self.info.entity(name);
        let declared = entity.and_then(|entity| self.address_numbers[entity.index()]);
        let declared = declared.ok_or_else(|| {
            let actors = self.declared.iter().map(|actor| self.name(*actor));
            LookupError::unknown(name, actors)
        })?;
        let actor_type = self.type_of_actor[declared as usize] as usize;
        Ok((declared, &self.actor_types[actor_type]))
    }

    /// True if records, and so encoded bodies, are needed at all.
    pub(crate) fn recording(&self) -> bool {
        self.digest || self.observed
    }

    /// Completes a key with the tie hash that this run's tie seed gives it.
    #[inline(always)]
    pub(crate) fn key(&self, time: SimTime, step: u32, source: EntityId, count: u64) -> EventKey {
        let tie = match self.info.tie_seed {
            // `@control` comes first whatever the tie seed.
            Some(seed) if source != EntityId::CONTROL => self.tie(seed, time, step, source),
            _ => 0,
        };
        EventKey {
            time,
            step,
            tie,
            source,
            count,
        }
    }

    #[inline(never)]
    fn tie(&self, seed: u64, time: SimTime, step: u32, source: EntityId) -> u32 {
        let key = crate::random::RandomKey::new(seed)
            .number(time.as_nanos())
            .number(u64::from(step))
            .number(self.name_hash(source));
        // The lowest bit keeps the hash above zero, which is `@control`'s.
        key.hash() as u32 | 1
    }

    /// The number of a loss reason.
    pub(crate) fn intern(&self, reason: &'static str) -> Reason {
        let mut reasons = self.reasons.lock().unwrap_or_else(PoisonError::into_inner);
        let at = reasons
            .iter()
            .position(|known| *known == reason)
            .unwrap_or_else(|| {
                reasons.push(reason);
                reasons.len() - 1
            });
        // Reasons are literals in the source of links: a few.
        Reason(u16::try_from(at + 1).expect("fewer than 65,535 reasons"))
    }

    /// The text of a loss reason; empty for none.
    #[inline]
    pub(crate) fn reason(&self, reason: Reason) -> &'static str {
        let Some(at) = reason.0.checked_sub(1) else {
            return "";
        };
        self.reasons.lock().unwrap_or_else(PoisonError::into_inner)[at as usize]
    }

    /// The kind of a sample type, traced when it is first met.
    pub(crate) fn sample_kind<S: Message>(&self) -> Result<Arc<Kind>, String> {
        let type_id = TypeId::of::<S>();
        let mut kinds = self
            .sample_kinds
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if let Some((_, kind)) = kinds.iter().find(|(known, _)| *known == type_id) {
            return Ok(kind.clone());
        }
        let schema = Schema::of::<S>().map_err(|error| error.to_string())?;
        let kind = Arc::new(Kind::new(schema));
        kinds.push((type_id, kind.clone()));
        Ok(kind)
    }
}
