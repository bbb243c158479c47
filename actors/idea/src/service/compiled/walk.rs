//! How a table is walked: from node to node as things are posted, and to the next state.

use farside_planning::Ticks;
use farside_planning::model::{PredicateId, Value};

use super::table::{Held, KIND, REST, Transition, What};
use super::{CLASS_BITS, Compiled, GOAL, NEAR};
use crate::service::propositional::state::Far;
use crate::service::{Contract, Refusal, check};

impl Compiled {
    /// The number of what is posted, for its node.
    ///
    /// # Errors
    ///
    /// If there is another number of values, or one is not of its type.
    #[inline]
    pub(super) fn number(
        &self,
        kind: u64,
        timeline: usize,
        predicate: PredicateId,
        ends: bool,
        values: &[Option<Value>],
    ) -> Result<u64, Refusal> {
        let inputs = self.inputs[predicate];
        let slots = &self.slots[predicate];
        let (what, slots) = match kind {
            GOAL => ("inputs", &slots[..inputs]),
            _ => ("outputs", &slots[inputs..]),
        };
        let mut right = values.len() == slots.len();
        let mut mixed = 0;
        for (value, slot) in values.iter().zip(slots) {
            let class = match *value {
                Some(value) => slot.class(value),
                None => Some(0),
            };
            right &= class.is_some();
            mixed = mixed * slot.count + u64::from(class.unwrap_or(0));
        }
        if !right {
            check::values(&self.model, predicate, what, values)?;
        }
        let predicate = if kind == GOAL { predicate as u64 } else { 0 };
        Ok(kind << 61
            | (timeline as u64) << 49
            | predicate << 37
            | u64::from(ends) << CLASS_BITS
            | mixed)
    }

    /// What the token of an active contract says, as far as the table knows.
    #[inline]
    pub(super) fn on_table(&self, contract: Contract) -> Result<Option<PredicateId>, Refusal> {
        if self.node.is_none() {
            return Ok(None);
        }
        let timeline = usize::from(contract.timeline);
        let lane = self.lanes.get(timeline);
        let form = &self.forms[self.state as usize];
        let ended = |at: &super::Posted| match at.what {
            What::Status(of, ends) => ends && of == contract,
            _ => false,
        };
        if lane.is_none_or(|lane| lane.number != contract.number)
            || form.over[timeline]
            || self.posted.iter().any(ended)
        {
            return Err(check::dead(&self.model, contract));
        }
        Ok(Some(form.lanes[timeline].0))
    }

    #[inline]
    pub(super) fn child(&self, number: u64) -> Option<u32> {
        let node = &self.nodes[self.node? as usize];
        let child = node.children.iter().find(|child| child.0 == number);
        child.map(|&(_, child)| child)
    }

    /// Far ends that are near now are the first that is posted.
    pub(super) fn come_near(&mut self) {
        let form = &self.forms[self.state as usize];
        if form.times.len() > 60 {
            // More than a number can say.
            (self.node, self.near) = (None, Ticks::MAX);
            return;
        }
        let (mut which, mut bit) = (0_u64, 1);
        let mut near = Ticks::MAX;
        for time in &form.times {
            let end = self.registers.ends[usize::from(time.end)];
            let due = end.saturating_sub(self.exact);
            if due > self.now {
                near = near.min(due);
            } else if time.whose.is_none_or(|(timeline, longest)| {
                // How a token ends whose time is nearly over depends on whose time it is.
                let start = self.lanes[usize::from(timeline)].start;
                start.saturating_add(longest) == end
            }) {
                which |= bit;
            }
            bit <<= 1;
        }
        self.near = near;
        let number = NEAR << 61 | which;
        self.node = match (self.child(number), self.node) {
            (Some(child), _) => Some(child),
            (None, Some(node)) => self.add_node(node, number),
            (None, None) => None,
        };
    }

    /// The value of a cell of the state.
    pub(super) fn cell(&self, held: Held<Option<Value>>) -> Option<Value> {
        match held {
            Held::Same(value) => value,
            Held::Register(place) => self.registers.cells[usize::from(place)],
        }
    }

    /// A bound of an end of the state.
    pub(super) fn bound(&self, held: Held<Ticks>) -> Ticks {
        match held {
            Held::Same(Ticks::MAX) => Ticks::MAX,
            Held::Same(ahead) => self.solved.unwrap_or(self.now) + ahead,
            Held::Register(place) => self.registers.ends[usize::from(place)],
        }
    }

    /// What the table says is decided. The registers of before are spare then, until the next cycle.
    pub(super) fn follow(&mut self, at: Transition) {
        let (now, from) = (self.now, &self.registers);
        let code = &self.codes[at.code as usize..];
        let (cells, code) = code.split_at(usize::from(at.cells));
        let (ends, code) = code.split_at(usize::from(at.ends));
        let timelines = &code[..usize::from(at.started)];
        let names = &self.names;
        self.spare.cells.clear();
        for &at in cells {
            self.spare.cells.push(names.value(at, &from.cells));
        }
        self.spare.ends.clear();
        let mut near = Ticks::MAX;
        let far = |at: &Far| match *at {
            Far::Ahead(ticks) => now + ticks,
            Far::End(end) => from.ends[usize::from(end)],
        };
        for &bound in ends {
            let rest = (bound & REST) as usize;
            let end = match bound >> KIND {
                0 => now + rest as Ticks,
                1 => from.ends[rest],
                2 => names.several[rest].iter().map(far).min().unwrap_or(now),
                _ => names.several[rest].iter().map(far).max().unwrap_or(now),
            };
            // A far end of the next state is far now.
            near = near.min(end.saturating_sub(self.exact));
            self.spare.ends.push(end);
        }
        for &timeline in timelines {
            let lane = &mut self.lanes[timeline as usize];
            lane.number += 1;
            lane.before = lane.start;
            lane.start = now;
        }
        self.near = near;
        self.counters.decisions += u64::from(at.decisions);
        self.counters.guards += u64::from(at.guards);
        self.counters.backtracks += u64::from(at.backtracks);
        std::mem::swap(&mut self.registers, &mut self.spare);
        self.enter(at.next);
    }

    /// A state is entered: nothing is posted in it yet.
    pub(super) fn enter(&mut self, state: u32) {
        self.state = state;
        self.node = Some(self.forms[state as usize].node);
        self.posted.clear();
        self.solved = Some(self.now);
    }
}
