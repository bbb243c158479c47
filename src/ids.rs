//! How the parts of a run are told apart: hosts, links, entities, kinds, timers, and messages by
//! what their protocol calls them.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::marker::PhantomData;
use std::sync::atomic::{AtomicU32, Ordering};

use serde::{Deserialize, Serialize};

/// Which simulation of this process an id is of. A run's results do not depend on it: it is only ever
/// compared with that of the simulation that is given the id.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Owner(u32);

impl Owner {
    /// One that no other simulation of this process has.
    pub(crate) fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        Owner(NEXT.fetch_add(1, Ordering::Relaxed))
    }
}

/// A host: the actors on it form one logical process and reach each other without a link.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct HostId {
    pub(crate) owner: Owner,
    pub(crate) index: u32,
}

impl HostId {
    pub(crate) fn new(owner: Owner, index: u32) -> Self {
        HostId { owner, index }
    }

    /// The host's number in order of declaration, from 0.
    #[inline]
    pub fn index(self) -> usize {
        self.index as usize
    }
}

// What a program prints, and the order in which it finds things by hash, must not depend on how many
// simulations it had before.
impl fmt::Debug for HostId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "HostId({})", self.index)
    }
}

impl Hash for HostId {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.index.hash(state);
    }
}

/// A link of a simulation that takes changes of type `C`.
pub struct LinkId<C> {
    pub(crate) owner: Owner,
    pub(crate) declared: u32,
    change: PhantomData<fn(C)>,
}

impl<C> LinkId<C> {
    pub(crate) fn new(owner: Owner, declared: u32) -> Self {
        LinkId {
            owner,
            declared,
            change: PhantomData,
        }
    }
}

impl<C> Clone for LinkId<C> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<C> Copy for LinkId<C> {}

/// An actor, a link or `@control`, numbered by its name's place in name order.
///
/// Numbers depend on which names a run declares and on nothing else; a log holds the names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct EntityId(pub(crate) u32);

impl EntityId {
    /// The source of faults, restarts, changes and stops. Sorts before every actor and link.
    pub const CONTROL: EntityId = EntityId(0);

    /// The entity's place in name order.
    #[inline]
    pub fn index(self) -> usize {
        self.0 as usize
    }

    /// The entity at `index`, for tables indexed by [`EntityId::index`].
    pub fn from_index(index: usize) -> Self {
        EntityId(u32::try_from(index).expect("entities are counted in 32 bits"))
    }
}

/// Index of a host.
pub(crate) type HostIndex = u32;
/// Index of a kind in [`RunInfo::kinds`](crate::RunInfo::kinds).
pub(crate) type KindIndex = u32;

/// A protocol's own identity for a message, by which runs are compared and links draw, in place
/// of the ordinal in its flow: the planning cycle and the iteration in it, say.
///
/// ```
/// use farside::MatchKey;
/// let key = MatchKey::new(12, 3);
/// assert_eq!((key.major(), key.minor()), (12, 3));
/// assert_eq!(key.to_string(), "12.3");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MatchKey(u64);

impl MatchKey {
    /// The key of iteration `minor` in cycle `major`.
    pub const fn new(major: u32, minor: u32) -> Self {
        MatchKey((major as u64) << 32 | minor as u64)
    }

    /// The cycle.
    pub const fn major(self) -> u32 {
        (self.0 >> 32) as u32
    }

    /// The iteration.
    pub const fn minor(self) -> u32 {
        self.0 as u32
    }

    /// Both as one number, cycle first.
    #[inline]
    pub const fn bits(self) -> u64 {
        self.0
    }

    /// The key with these [`MatchKey::bits`].
    #[inline]
    pub const fn from_bits(bits: u64) -> Self {
        MatchKey(bits)
    }
}

impl fmt::Display for MatchKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.major(), self.minor())
    }
}

/// A timer that is set, for [`Context::cancel`](crate::Context::cancel).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimerId {
    pub(crate) owner: Owner,
    pub(crate) slot: u32,
    pub(crate) kind: KindIndex,
    /// Tells this timer from a later one in the same slot.
    pub(crate) ordinal: u64,
}
