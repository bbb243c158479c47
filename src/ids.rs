//! How the parts of a run are told apart: hosts, links, entities, kinds, timers, and messages by
//! what their protocol calls them.

use std::fmt;
use std::marker::PhantomData;

use serde::{Deserialize, Serialize};

/// A host: the actors on it form one logical process and reach each other without a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct HostId(pub(crate) u32);

impl HostId {
    /// The host's number in order of declaration, from 0.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A link of a simulation that takes changes of type `C`.
pub struct LinkId<C> {
    pub(crate) declared: u32,
    change: PhantomData<fn(C)>,
}

impl<C> LinkId<C> {
    pub(crate) fn new(declared: u32) -> Self {
        LinkId {
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
    pub const fn bits(self) -> u64 {
        self.0
    }

    /// The key with these [`MatchKey::bits`].
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
    pub(crate) slot: u32,
    pub(crate) kind: KindIndex,
    /// Tells this timer from a later one in the same slot.
    pub(crate) ordinal: u64,
}
