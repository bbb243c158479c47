//! What a table consists of.

use std::collections::BTreeMap;

use farside_planning::Ticks;
use farside_planning::model::{PredicateId, TimelineId, Value};
use smallvec::SmallVec;

use crate::service::Contract;
use crate::service::propositional::Propositional;
use crate::service::propositional::state::Far;

/// From where a register is filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    Value(Option<Value>),
    Cell(u16),
    Posted(u16, u16),
}

/// From where a bound of an end is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Bound {
    Never,
    Ahead(Ticks),
    End(u16),
    /// The latest of some for an earliest end, the earliest for a latest.
    Several(Box<[Far]>),
}

/// A token that begins or ends.
pub(super) struct Change {
    pub(super) timeline: u16,
    pub(super) predicate: PredicateId,
    pub(super) parameters: SmallVec<[Source; 4]>,
}

/// What a cycle decides. All of it stands in one row of numbers, so that few lines of memory are
/// read: how many cells, ends and tokens there are, from where each is filled, and tokens with what
/// they say.
#[derive(Clone, Debug)]
pub(super) struct Transition {
    pub(super) next: u32,
    pub(super) code: Box<[u32]>,
    pub(super) decisions: u32,
    pub(super) guards: u32,
    pub(super) backtracks: u32,
}

/// The highest bits of a number say what it is.
pub(super) const KIND: u32 = 30;

pub(super) const REST: u32 = (1 << KIND) - 1;

/// Values and times that transitions name by their places.
#[derive(Clone, Debug, Default)]
pub(super) struct Names {
    pub(super) values: Vec<Option<Value>>,
    pub(super) value_places: BTreeMap<Option<Value>, u32>,
    pub(super) several: Vec<Box<[Far]>>,
}

/// What may be posted next.
#[derive(Clone, Debug, Default)]
pub(super) struct Node {
    pub(super) children: SmallVec<[(u64, u32); 1]>,
    pub(super) transition: Option<u32>,
}

/// A state's part that is the same whatever its registers hold.
pub(super) struct Form {
    pub(super) node: u32,
    pub(super) lanes: Box<[(PredicateId, SmallVec<[u16; 4]>)]>,
    pub(super) ends: Box<[bool]>,
    /// The ends of which a bound is far.
    pub(super) far: SmallVec<[u16; 8]>,
    /// By timeline: its token's end, and how long its own rules let it last at most.
    pub(super) lasts: Box<[(u16, Ticks)]>,
    /// To be filled from the registers, and run.
    pub(super) interpreter: Box<Propositional>,
}

/// What was posted in this cycle.
#[derive(Clone, Debug)]
pub(super) enum Posted {
    Status(Contract, SmallVec<[Option<Value>; 4]>, bool),
    Goal(TimelineId, PredicateId, SmallVec<[Option<Value>; 4]>),
    Cancel(Contract),
}

/// The registers of a state.
#[derive(Clone, Debug, Default)]
pub(super) struct Registers {
    pub(super) cells: Vec<Option<Value>>,
    /// The earliest and the latest tick of each end.
    pub(super) ends: Vec<(Ticks, Ticks)>,
}

impl Names {
    pub(super) fn source(&mut self, source: Source) -> u32 {
        match source {
            Source::Value(value) => {
                let next = self.values.len() as u32;
                let place = *self.value_places.entry(value).or_insert(next);
                if place == next {
                    self.values.push(value);
                }
                place
            }
            Source::Cell(cell) => 1 << KIND | u32::from(cell),
            Source::Posted(which, place) => 2 << KIND | u32::from(which) << 8 | u32::from(place),
        }
    }

    pub(super) fn bound(&mut self, bound: Bound) -> u32 {
        match bound {
            Bound::Never => 2 << KIND,
            Bound::Ahead(ticks) => ticks as u32,
            Bound::End(end) => 1 << KIND | u32::from(end),
            Bound::Several(all) => {
                let known = self.several.iter().position(|at| *at == all);
                let place = known.unwrap_or(self.several.len());
                if place == self.several.len() {
                    self.several.push(all);
                }
                3 << KIND | place as u32
            }
        }
    }
}

impl Posted {
    pub(super) fn values(&self) -> &[Option<Value>] {
        match self {
            Posted::Status(_, values, _) | Posted::Goal(_, _, values) => values,
            Posted::Cancel(_) => &[],
        }
    }
}
