//! What a table consists of.

use std::collections::BTreeMap;

use farside_planning::Ticks;
use farside_planning::model::{PredicateId, RelationshipKind, TimelineId, Value};
use smallvec::SmallVec;

use crate::service::Contract;
use crate::service::propositional::Propositional;
use crate::service::propositional::state::{Far, reckon};

/// From where a register is filled, or a parameter of a token that began or ended.
#[derive(Clone, Debug)]
pub(super) enum Source {
    /// It is the same whenever this is decided.
    Value(Option<Value>),
    /// A register of before, or a value that was posted: these stand behind the registers.
    Register(u32),
    /// A number that is made from others.
    Computed(Computation, Vec<Source>),
}

/// How a number is made from others, with the model's function, if it is one.
pub(super) type Computation = (RelationshipKind, Option<fn(&[Value]) -> Option<Value>>);

/// From where a bound of an end is that is far.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Bound {
    Ahead(Ticks),
    Register(u16),
    /// The earliest of some.
    Least(Box<[Far]>),
    /// The latest of some.
    Most(Box<[Far]>),
}

/// A token that begins or ends.
pub(super) struct Change {
    pub(super) timeline: u16,
    pub(super) predicate: PredicateId,
    pub(super) parameters: SmallVec<[Source; 4]>,
}

/// What a cycle decides. All that it names stands in one row of [`Codes`], so that few lines of
/// memory are read: from where each register is filled, then each far end, the timelines on which
/// something began, and what ended and began.
#[derive(Clone, Copy, Debug)]
pub(super) struct Transition {
    pub(super) next: u32,
    /// Where its row begins.
    pub(super) code: u32,
    pub(super) cells: u16,
    pub(super) ends: u16,
    pub(super) ended: u16,
    pub(super) started: u16,
    pub(super) decisions: u32,
    pub(super) guards: u32,
    pub(super) backtracks: u32,
}

/// The rows of all transitions, one after another.
pub(super) type Codes = Vec<u32>;

/// The highest bits of a number say what it is.
pub(super) const KIND: u32 = 30;

pub(super) const REST: u32 = (1 << KIND) - 1;

/// Values and times that transitions name by their places.
#[derive(Clone, Debug, Default)]
pub(super) struct Names {
    pub(super) values: Vec<Option<Value>>,
    pub(super) value_places: BTreeMap<Option<Value>, u32>,
    pub(super) several: Vec<Box<[Far]>>,
    /// Numbers that are made from others.
    pub(super) computed: Vec<(Computation, Box<[u32]>)>,
}

/// What may be posted next.
#[derive(Clone, Debug, Default)]
pub(super) struct Node {
    pub(super) children: SmallVec<[(u64, u32); 1]>,
    pub(super) transition: Option<u32>,
}

/// What a state holds: itself, if it is the same whenever the state is entered, or in a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Held<T> {
    Same(T),
    Register(u16),
}

/// A state's part that is the same whatever its registers hold.
pub(super) struct Form {
    pub(super) node: u32,
    /// By timeline: what it says, and which cells its parameters are.
    pub(super) lanes: Box<[(PredicateId, SmallVec<[u16; 4]>)]>,
    /// By timeline: whether a status ended its token, which goes on.
    pub(super) over: Box<[bool]>,
    pub(super) cells: Box<[Held<Option<Value>>]>,
    /// The earliest and the latest tick of each end: from when the state is entered, or far and in a
    /// register of times.
    pub(super) ends: Box<[[Held<Ticks>; 2]]>,
    /// What is asked of ends that come near.
    pub(super) times: Box<[Time]>,
    /// To be filled from the registers, and run.
    pub(super) interpreter: Box<Propositional>,
}

/// What is asked of an end that was far when the state was entered.
#[derive(Clone, Copy, Debug)]
pub(super) struct Time {
    /// Its register.
    pub(super) end: u16,
    /// Whether it is the time of a timeline's token, which its own rules let last so long at most;
    /// else whether it is near.
    pub(super) whose: Option<(u16, Ticks)>,
}

/// What was posted in this cycle. Its values stand behind the registers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Posted {
    pub(super) what: What,
    /// Of what its first value is a parameter.
    pub(super) predicate: PredicateId,
    /// Where its values stand, and how many there are.
    pub(super) first: u32,
    pub(super) count: u32,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum What {
    /// Whether it ends its token, too.
    Status(Contract, bool),
    Goal(TimelineId),
    Cancel(Contract),
}

/// What differs from one time that a state is entered to another.
#[derive(Clone, Debug, Default)]
pub(super) struct Registers {
    /// Values, and behind them those that were posted.
    pub(super) cells: Vec<Option<Value>>,
    /// Ends that were far when the state was entered.
    pub(super) ends: Vec<Ticks>,
}

/// What is known of a timeline's present token in any state.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lane {
    /// How many tokens had begun before it.
    pub(super) number: u64,
    pub(super) start: Ticks,
    /// When the token before it began.
    pub(super) before: Ticks,
}

impl Names {
    /// What a source gives.
    #[inline]
    pub(super) fn value(&self, source: u32, registers: &[Option<Value>]) -> Option<Value> {
        let place = (source & REST) as usize;
        match source >> KIND {
            0 => self.values[place],
            1 => registers[place],
            _ => self.compute(place, registers),
        }
    }

    #[inline(never)]
    fn compute(&self, place: usize, registers: &[Option<Value>]) -> Option<Value> {
        let ((kind, call), inputs) = &self.computed[place];
        let inputs = inputs.iter().map(|&at| self.value(at, registers));
        let inputs: Option<SmallVec<[Value; 4]>> = inputs.collect();
        match call {
            Some(call) => call(&inputs?),
            None => reckon(*kind, &inputs?),
        }
    }

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
            Source::Register(place) => 1 << KIND | place,
            Source::Computed(how, inputs) => {
                let inputs: Box<[u32]> = inputs.into_iter().map(|at| self.source(at)).collect();
                let is = |at: &(Computation, Box<[u32]>)| at.0.0 == how.0 && at.1 == inputs;
                let known = self.computed.iter().position(is);
                let place = known.unwrap_or(self.computed.len());
                if place == self.computed.len() {
                    self.computed.push((how, inputs));
                }
                2 << KIND | place as u32
            }
        }
    }

    pub(super) fn bound(&mut self, bound: Bound) -> u32 {
        let (kind, all) = match bound {
            Bound::Ahead(ticks) => return ticks as u32,
            Bound::Register(place) => return 1 << KIND | u32::from(place),
            Bound::Least(all) => (2, all),
            Bound::Most(all) => (3, all),
        };
        let known = self.several.iter().position(|at| *at == all);
        let place = known.unwrap_or(self.several.len());
        if place == self.several.len() {
            self.several.push(all);
        }
        kind << KIND | place as u32
    }
}
