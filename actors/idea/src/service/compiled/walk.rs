//! How a table is walked: from node to node as things are posted, and to the next state.

use farside_planning::Ticks;
use farside_planning::model::{PredicateId, Value};

use super::changes::Recent;
use super::table::{Effect, Held, KIND, NONE, Node, REGISTER, REST};
use super::{CLASS_BITS, Compiled, GOAL, NEAR};
use crate::service::propositional::state::Far;
use crate::service::{Contract, Refusal, check};

impl Compiled {
    /// The number of what is posted, for its node.
    ///
    /// # Errors
    ///
    /// If there is another number of values, or one is not of its type.
    #[inline(always)]
    pub(super) fn number(
        &self,
        kind: u64,
        timeline: usize,
        predicate: PredicateId,
        ends: bool,
        values: &[Option<Value>],
    ) -> Result<u64, Refusal> {
        let is_goal = kind == GOAL;
        let slots = self.slots.given(predicate, is_goal);
        let mut right = values.len() == slots.len();
        let mut mixed = 0;
        for (value, slot) in values.iter().zip(slots) {
            let class = match *value {
                Some(value) => {
                    let class = self.slots.class(slot, value);
                    right &= class > 0;
                    class
                }
                None => 0,
            };
            mixed = mixed * slot.count + u64::from(class);
        }
        if !right {
            self.check_values(is_goal, predicate, values)?;
        }
        let predicate = if is_goal { predicate as u64 } else { 0 };
        Ok(kind << 61
            | (timeline as u64) << 49
            | predicate << 37
            | u64::from(ends) << CLASS_BITS
            | mixed)
    }

    #[cold]
    #[inline(never)]
    fn check_values(
        &self,
        is_goal: bool,
        predicate: PredicateId,
        values: &[Option<Value>],
    ) -> Result<(), Refusal> {
        let what = if is_goal { "inputs" } else { "outputs" };
        check::values(&self.model, predicate, what, values)
    }

    /// What the token of an active contract says, as far as the table knows.
    #[inline(always)]
    pub(super) fn on_table(&self, contract: Contract) -> Result<Option<PredicateId>, Refusal> {
        if self.node.is_none() {
            return Ok(None);
        }
        match self.lanes.get(usize::from(contract.timeline)) {
            Some(lane) if lane.number == contract.number && !lane.over => {
                Ok(Some(usize::from(lane.predicate)))
            }
            _ => Err(check::dead(&self.model, contract)),
        }
    }

    #[inline(always)]
    pub(super) fn child(&self, number: u64) -> Option<u32> {
        self.table.child(self.node?, number)
    }

    /// Far ends that are near now are the first that is posted.
    pub(super) fn come_near(&mut self) {
        let form = &self.table.forms[self.state as usize];
        if form.times.len() > 60 {
            // More than a number can say.
            (self.node, self.near) = (None, Ticks::MAX);
            return;
        }
        let (mut which, mut bit, mut due_now) = (0_u64, 1, false);
        let mut near = Ticks::MAX;
        for time in &form.times {
            let end = self.registers.ends[usize::from(time.end)];
            let due = end.saturating_sub(self.exact);
            if due > self.now {
                near = near.min(due);
            } else {
                due_now = true;
                let mine = time.whose.is_none_or(|(timeline, longest)| {
                    // How a token ends whose time is nearly over depends on whose time it is.
                    let start = self.lanes[usize::from(timeline)].start;
                    start.saturating_add(longest) == end
                });
                which |= if mine { bit } else { 0 };
            }
            bit <<= 1;
        }
        self.near = near;
        if !due_now {
            // What was to come near is no more.
            return;
        }
        let number = NEAR << 61 | which;
        self.node = match (self.child(number), self.node) {
            (Some(child), _) => Some(child),
            (None, Some(node)) => self.add_node(node, number),
            (None, None) => None,
        };
    }

    /// The value of a state's source, which is a value or a register.
    pub(super) fn cell(&self, source: u32) -> Option<Value> {
        if source >> KIND != REGISTER {
            return self.table.names.constant(source);
        }
        let place = source & REST;
        if self.pending != NONE {
            let effect = &self.table.effects[self.pending as usize];
            let [cells, _] = self.table.filled(effect);
            let filled = cells.chunks_exact(2).find(|pair| pair[0] == place);
            if let Some(pair) = filled {
                return self.table.names.value(pair[1], &self.registers);
            }
        }
        self.registers.cells[place as usize]
    }

    /// A bound of an end of the state.
    pub(super) fn bound(&self, held: Held<Ticks>) -> Ticks {
        match held {
            Held::Same(Ticks::MAX) => Ticks::MAX,
            Held::Same(ahead) => self.solved.unwrap_or(self.now) + ahead,
            Held::Register(place) => self.registers.ends[usize::from(place)],
        }
    }

    /// What the table says is decided. Its registers are filled with the next cycle, so that until
    /// then what began and ended can be read from those of before.
    #[inline]
    pub(super) fn follow(&mut self, node: Node) {
        let effect = &self.table.effects[node.effect as usize];
        for &row in self.table.started(effect) {
            let row = &self.table.rows[row as usize];
            let lane = &mut self.lanes[usize::from(row.timeline)];
            lane.number += 1;
            lane.before = lane.start;
            lane.start = self.now;
            (lane.predicate, lane.over) = (row.predicate, false);
        }
        self.counters.decisions += u64::from(effect.decisions);
        self.counters.guards += u64::from(effect.guards);
        self.counters.backtracks += u64::from(effect.backtracks);
        self.pending = node.effect;
        self.enter(node.state, node.root);
    }

    /// A state is entered: nothing is posted in it yet.
    #[inline]
    pub(super) fn enter(&mut self, state: u32, node: u32) {
        self.state = state;
        self.node = Some(node);
        self.posted.clear();
        self.solved = Some(self.now);
    }

    /// A new cycle begins: what the last one decided is in the registers then.
    #[inline(always)]
    pub(super) fn settle(&mut self) {
        if self.pending != NONE {
            self.settle_effect();
        }
    }

    #[inline(never)]
    fn settle_effect(&mut self) {
        let effect = self.table.effects[self.pending as usize];
        self.pending = NONE;
        if effect.cells > 0 || effect.ends > 0 {
            self.fill_registers(&effect);
        }
        self.registers.posted.clear();
        if let Recent::Row(_) = self.recent {
            self.recent = Recent::Gone;
        }
    }

    fn fill_registers(&mut self, effect: &Effect) {
        let (names, from) = (&self.table.names, &self.registers);
        let [cells, ends] = self.table.filled(effect);
        // A register may be from another that is filled, too.
        self.spare.cells.clear();
        let values = cells.chunks_exact(2).map(|pair| names.value(pair[1], from));
        self.spare.cells.extend(values);
        self.spare.ends.clear();
        let decided = self.solved.unwrap_or(self.now);
        let far = |at: &Far| match *at {
            Far::Ahead(ticks) => decided + ticks,
            Far::End(end) => from.ends[usize::from(end)],
        };
        for pair in ends.chunks_exact(2) {
            let rest = (pair[1] & REST) as usize;
            let end = match pair[1] >> KIND {
                0 => decided + rest as Ticks,
                1 => from.ends[rest],
                2 => names.several[rest].iter().map(far).min().unwrap_or(decided),
                _ => names.several[rest].iter().map(far).max().unwrap_or(decided),
            };
            self.spare.ends.push(end);
        }
        for (pair, &value) in cells.chunks_exact(2).zip(&self.spare.cells) {
            self.registers.cells[pair[0] as usize] = value;
        }
        for (pair, &end) in ends.chunks_exact(2).zip(&self.spare.ends) {
            self.registers.ends[pair[0] as usize] = end;
            // A far end of the state is far now.
            self.near = self.near.min(end.saturating_sub(self.exact));
        }
    }
}
