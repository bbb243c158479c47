//! What a table consists of.
//!
//! Cycles read nodes, effects and rows. A node is small, and those that follow each other lie side by
//! side, most often; what a cycle does is an effect, which many nodes share, and what begins or ends
//! is a row, which many effects share: so that what is read again and again stays near.

use std::collections::BTreeMap;

use farside_planning::Ticks;
use farside_planning::model::{PredicateId, RelationshipKind, TimelineId, Value};
use smallvec::SmallVec;

use crate::service::propositional::Propositional;
use crate::service::propositional::state::{Far, reckon};
use crate::service::{Contract, Parameters};

/// No node, effect or place.
pub(super) const NONE: u32 = u32::MAX;

/// From where a register is filled, or a parameter of a token that began or ended.
#[derive(Clone, Debug)]
pub(super) enum Source {
    /// It is the same whenever this is decided.
    Value(Option<Value>),
    /// A register of before.
    Register(u32),
    /// A value that was posted, by its place among all of the cycle.
    Posted(u32),
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

/// A token that begins or ends, or is there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub(super) timeline: u16,
    pub(super) predicate: u16,
    /// How many parameters it has, and how many of them are not the same whenever this is decided.
    pub(super) count: u16,
    pub(super) varying: u16,
    /// Where it begins in [`Table::codes`]: the sources of its parameters, then, in pairs, the
    /// places and the sources of those that vary.
    pub(super) code: u32,
}

/// What a cycle decides. All that it names stands in [`Table::codes`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Effect {
    /// Where that begins, and where its rows do.
    pub(super) code: u32,
    pub(super) rows: u32,
    /// How many registers are filled: each is a pair, the register and its source.
    pub(super) cells: u16,
    /// How many far ends there are that were not before, in pairs, too.
    pub(super) ends: u16,
    /// How many rows there are of what ended, and then of what started.
    pub(super) ended: u16,
    pub(super) started: u16,
    pub(super) decisions: u32,
    pub(super) guards: u32,
    pub(super) backtracks: u32,
}

/// What was posted, and what may be posted next.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// What leads to its first child, which is the one that is asked for most often; 0 without.
    number: u64,
    child: u32,
    /// Where its other children stand.
    others: u32,
    /// What is decided if nothing else is posted; [`NONE`], if it is not known.
    pub(super) effect: u32,
    /// The state after that, and its node.
    pub(super) state: u32,
    pub(super) root: u32,
}

/// The highest bits of a number say what it is.
pub(super) const KIND: u32 = 30;

pub(super) const REST: u32 = (1 << KIND) - 1;

/// Values and times that effects name by their places.
#[derive(Clone, Debug, Default)]
pub(super) struct Names {
    values: Vec<Option<Value>>,
    value_places: BTreeMap<Option<Value>, u32>,
    pub(super) several: Vec<Box<[Far]>>,
    /// Numbers that are made from others.
    computed: Vec<(Computation, Box<[u32]>)>,
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
    /// By timeline: the row of what it says.
    pub(super) lanes: Box<[u32]>,
    /// By cell: its source, which is a value or a register.
    pub(super) cells: Box<[u32]>,
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

/// What was posted in this cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Posted {
    pub(super) what: What,
    /// Of what its first value is a parameter.
    pub(super) predicate: PredicateId,
    /// Where its values stand among all that were posted, and how many there are.
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
///
/// A value's register is that of the first parameter that has it, by timeline and place, whatever the
/// state; an end's that of the first timeline whose token has it. So what goes on stays where it is.
#[derive(Clone, Debug, Default)]
pub(super) struct Registers {
    pub(super) cells: Vec<Option<Value>>,
    /// Values that were posted in this cycle.
    pub(super) posted: Vec<Option<Value>>,
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
    pub(super) predicate: u16,
    /// Whether a status ended it, though it may have to go on for a while.
    pub(super) over: bool,
}

/// The table: what all that use it share, and that grows.
#[derive(Default)]
pub(super) struct Table {
    pub(super) forms: Vec<Form>,
    pub(super) by_key: BTreeMap<Vec<u32>, u32>,
    pub(super) nodes: Vec<Node>,
    /// The children of nodes after their first ones.
    others: Vec<Vec<(u64, u32)>>,
    pub(super) effects: Vec<Effect>,
    effect_places: BTreeMap<Box<[u32]>, u32>,
    pub(super) rows: Vec<Row>,
    /// By row: the values of its parameters, but for those that vary.
    parameters: Vec<Parameters>,
    row_places: BTreeMap<Box<[u32]>, u32>,
    /// What effects and rows consist of.
    pub(super) codes: Vec<u32>,
    pub(super) names: Names,
    /// How many nodes have an effect.
    pub(super) transitions: usize,
    /// How many registers of values there are.
    pub(super) width: usize,
}

impl Table {
    #[inline(always)]
    pub(super) fn child(&self, node: u32, number: u64) -> Option<u32> {
        let node = &self.nodes[node as usize];
        if node.number == number {
            return Some(node.child);
        }
        let others = self.others.get(node.others as usize)?;
        let child = others.iter().find(|child| child.0 == number);
        child.map(|&(_, child)| child)
    }

    /// A node that nothing leads to yet.
    pub(super) fn add_root(&mut self) -> u32 {
        self.nodes.push(Node {
            number: 0,
            child: NONE,
            others: NONE,
            effect: NONE,
            state: NONE,
            root: NONE,
        });
        (self.nodes.len() - 1) as u32
    }

    pub(super) fn add_child(&mut self, parent: u32, number: u64) -> u32 {
        let child = self.add_root();
        let node = &mut self.nodes[parent as usize];
        if node.number == 0 {
            (node.number, node.child) = (number, child);
            return child;
        }
        if node.others == NONE {
            node.others = self.others.len() as u32;
            self.others.push(Vec::new());
        }
        self.others[node.others as usize].push((number, child));
        child
    }

    /// The row of a token.
    pub(super) fn row(
        &mut self,
        timeline: usize,
        predicate: PredicateId,
        parameters: impl IntoIterator<Item = Source>,
    ) -> u32 {
        let (timeline, predicate) = (timeline as u16, predicate as u16);
        let names = &mut self.names;
        let mut key = vec![u32::from(timeline) << 16 | u32::from(predicate)];
        key.extend(parameters.into_iter().map(|at| names.source(at)));
        let row = Row {
            timeline,
            predicate,
            count: (key.len() - 1) as u16,
            varying: key[1..].iter().filter(|&&at| at >> KIND != VALUE).count() as u16,
            code: self.codes.len() as u32,
        };
        if let Some(&known) = self.row_places.get(&key[..]) {
            return known;
        }
        self.codes.extend(&key[1..]);
        let varying = { (0..).zip(&key[1..]) }.filter(|at| at.1 >> KIND != VALUE);
        self.codes
            .extend(varying.flat_map(|(place, &source)| [place, source]));
        let constant = |&source: &u32| match source >> KIND {
            VALUE => self.names.constant(source),
            _ => None,
        };
        self.parameters
            .push(key[1..].iter().map(constant).collect());
        self.rows.push(row);
        let place = (self.rows.len() - 1) as u32;
        self.row_places.insert(key.into(), place);
        place
    }

    /// An effect: with what it names.
    pub(super) fn effect(&mut self, effect: Effect, named: &[u32]) -> u32 {
        let pair = |one: u16, other: u16| u32::from(one) << 16 | u32::from(other);
        let mut key = vec![
            pair(effect.cells, effect.ends),
            pair(effect.ended, effect.started),
            effect.decisions,
            effect.guards,
            effect.backtracks,
        ];
        key.extend(named);
        if let Some(&known) = self.effect_places.get(&key[..]) {
            return known;
        }
        let code = self.codes.len() as u32;
        self.codes.extend(named);
        let rows = code + 2 * (u32::from(effect.cells) + u32::from(effect.ends));
        self.effects.push(Effect {
            code,
            rows,
            ..effect
        });
        let place = (self.effects.len() - 1) as u32;
        self.effect_places.insert(key.into(), place);
        place
    }

    /// Which registers an effect fills, and which far ends, with their sources.
    pub(super) fn filled(&self, effect: &Effect) -> [&[u32]; 2] {
        let code = &self.codes[effect.code as usize..];
        let (cells, code) = code.split_at(2 * usize::from(effect.cells));
        [cells, &code[..2 * usize::from(effect.ends)]]
    }

    /// The rows of what ended.
    #[inline]
    pub(super) fn ended(&self, effect: &Effect) -> &[u32] {
        &self.codes[effect.rows as usize..][..usize::from(effect.ended)]
    }

    /// The rows of what started.
    #[inline]
    pub(super) fn started(&self, effect: &Effect) -> &[u32] {
        let first = effect.rows as usize + usize::from(effect.ended);
        &self.codes[first..][..usize::from(effect.started)]
    }

    /// The values of a row's parameters.
    #[inline]
    pub(super) fn parameters(&self, row: u32, registers: &Registers) -> Parameters {
        let mut parameters = Parameters::from_slice(&self.parameters[row as usize]);
        self.update(&mut parameters, row, registers);
        parameters
    }

    /// Gives those of a row's parameters that vary their values.
    #[inline]
    pub(super) fn update(&self, parameters: &mut Parameters, row: u32, registers: &Registers) {
        for pair in self.varying(&self.rows[row as usize]).chunks_exact(2) {
            parameters[pair[0] as usize] = self.names.value(pair[1], registers);
        }
    }

    /// The sources of a row's parameters.
    #[inline]
    pub(super) fn sources(&self, row: &Row) -> &[u32] {
        &self.codes[row.code as usize..][..usize::from(row.count)]
    }

    /// The places and sources of a row's parameters that vary.
    #[inline]
    fn varying(&self, row: &Row) -> &[u32] {
        let first = row.code as usize + usize::from(row.count);
        &self.codes[first..][..2 * usize::from(row.varying)]
    }

    /// How many bytes cycles read, and all that are there.
    pub(super) fn bytes(&self) -> (usize, usize) {
        let others = self.others.iter();
        let others = others.map(|at| size_of_val(at) + at.capacity() * size_of::<(u64, u32)>());
        let read = size_of_val(&*self.nodes)
            + others.sum::<usize>()
            + size_of_val(&*self.effects)
            + size_of_val(&*self.rows)
            + size_of_val(&*self.parameters)
            + size_of_val(&*self.codes)
            + size_of_val(&*self.names.values);
        let forms = { self.forms.iter() }
            .map(|at| size_of::<Form>() + size_of_val(&*at.lanes) + size_of_val(&*at.times));
        let read = read + forms.sum::<usize>();
        let copies = { self.forms.iter() }
            .map(|at| size_of_val(&*at.cells) + size_of_val(&*at.ends) + at.interpreter.bytes());
        let keys = self.by_key.keys().map(|key| 24 + 4 * key.len());
        let places = { self.effect_places.keys().chain(self.row_places.keys()) }
            .map(|key| 20 + 4 * key.len());
        let all = read + copies.sum::<usize>() + keys.sum::<usize>() + places.sum::<usize>();
        (read, all)
    }
}

/// What a source is.
pub(super) const VALUE: u32 = 0;
pub(super) const REGISTER: u32 = 1;
const POSTED: u32 = 2;

impl Names {
    /// What a source gives.
    #[inline]
    pub(super) fn value(&self, source: u32, registers: &Registers) -> Option<Value> {
        let place = (source & REST) as usize;
        match source >> KIND {
            VALUE => self.values[place],
            REGISTER => registers.cells[place],
            POSTED => registers.posted[place],
            _ => self.compute(place, registers),
        }
    }

    /// The value of a source that is one.
    pub(super) fn constant(&self, source: u32) -> Option<Value> {
        self.values[(source & REST) as usize]
    }

    #[inline(never)]
    fn compute(&self, place: usize, registers: &Registers) -> Option<Value> {
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
                VALUE << KIND | place
            }
            Source::Register(place) => REGISTER << KIND | place,
            Source::Posted(place) => POSTED << KIND | place,
            Source::Computed(how, inputs) => {
                let inputs: Box<[u32]> = inputs.into_iter().map(|at| self.source(at)).collect();
                let is = |at: &(Computation, Box<[u32]>)| at.0.0 == how.0 && at.1 == inputs;
                let known = self.computed.iter().position(is);
                let place = known.unwrap_or(self.computed.len());
                if place == self.computed.len() {
                    self.computed.push((how, inputs));
                }
                3 << KIND | place as u32
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
