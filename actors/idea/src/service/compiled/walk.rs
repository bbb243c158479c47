//! How a table is walked: from node to node as things are posted, and to the next state.

use farside_planning::Ticks;
use farside_planning::model::{PredicateId, Value};

use super::key::is_far;
use super::table::{KIND, REST};
use super::{CLASS_BITS, Compiled, GOAL, NEAR};
use crate::service::propositional::state::Far;
use crate::service::{Contract, Ended, Refusal, Started, check};

impl Compiled {
    /// The number of what is posted, for its node.
    pub(super) fn number(
        &self,
        kind: u64,
        timeline: usize,
        predicate: PredicateId,
        ends: bool,
        (first, values): (usize, &[Option<Value>]),
    ) -> u64 {
        let parameters = &self.model.predicates[predicate].parameters[first..];
        let mut mixed = 0;
        for (value, parameter) in values.iter().zip(parameters) {
            let classes = &self.classes[parameter.of];
            let count = self.counts[parameter.of] + 1;
            let class = value.map_or(0, |value| 1 + u64::from(classes.of(value)));
            mixed = mixed * count + class;
        }
        let predicate = if kind == GOAL { predicate as u64 } else { 0 };
        kind << 61
            | (timeline as u64) << 49
            | predicate << 37
            | u64::from(ends) << CLASS_BITS
            | mixed
    }

    /// What the token of an active contract says, as far as the table knows.
    pub(super) fn on_table(&self, contract: Contract) -> Result<Option<PredicateId>, Refusal> {
        if self.node.is_none() {
            return Ok(None);
        }
        let timeline = usize::from(contract.timeline);
        if self.numbers.get(timeline) != Some(&contract.number) || self.ends[timeline] {
            return Err(check::dead(&self.model, contract));
        }
        Ok(Some(self.forms[self.state as usize].lanes[timeline].0))
    }

    pub(super) fn child(&self, number: u64) -> Option<u32> {
        let node = &self.nodes[self.node? as usize];
        let child = node.children.iter().find(|child| child.0 == number);
        child.map(|&(_, child)| child)
    }

    /// Far ends that are near now are the first that is posted.
    pub(super) fn come_near(&mut self) {
        let far = &self.forms[self.state as usize].far;
        let (mut which, mut near, mut bit) = (0_u64, Ticks::MAX, 0);
        for &end in far {
            let bounds = self.registers.ends[usize::from(end)];
            for bound in [bounds.0, bounds.1] {
                let was = is_far(bound, self.now - 1, self.exact);
                if was && !is_far(bound, self.now, self.exact) {
                    which |= 1 << bit;
                }
                bit += 1;
            }
            near = near.min(comes_near(bounds, self.now, self.exact));
        }
        // How a token ends whose time is nearly over depends on whose time it is.
        for (timeline, &(end, longest)) in self.forms[self.state as usize].lasts.iter().enumerate()
        {
            let (_, max) = self.registers.ends[usize::from(end)];
            if self.starts[timeline].saturating_add(longest) == max {
                which |= 1 << bit;
            }
            bit += 1;
        }
        if bit > 60 {
            self.node = None;
        }
        self.near = near;
        let number = NEAR << 61 | which;
        self.node = match (self.child(number), self.node) {
            (Some(child), _) => Some(child),
            (None, Some(node)) => self.add_node(node, number),
            (None, None) => None,
        };
    }

    /// What the table says is decided.
    pub(super) fn follow(&mut self, transition: u32) {
        let at = &self.transitions[transition as usize];
        let (now, from, names) = (self.now, &self.registers, &self.names);
        let posted = &self.posted;
        let value = |source: &u32| {
            let rest = source & REST;
            match source >> KIND {
                0 => names.values[rest as usize],
                1 => from.cells[rest as usize],
                _ => posted[(rest >> 8) as usize].values()[(rest & 0xff) as usize],
            }
        };
        let end = |at: &Far, max: bool| match *at {
            Far::Ahead(ticks) => now + ticks,
            Far::End(end) if max => from.ends[usize::from(end)].1,
            Far::End(end) => from.ends[usize::from(end)].0,
        };
        let bound = |bound: u32, max: bool| match bound >> KIND {
            0 => now + Ticks::from(bound & REST),
            1 => end(&Far::End((bound & REST) as u16), max),
            2 => Ticks::MAX,
            _ => {
                let all = &names.several[(bound & REST) as usize];
                let all = all.iter().map(|at| end(at, max));
                { if max { all.min() } else { all.max() } }.unwrap_or(now)
            }
        };
        let (counts, code) = at.code.split_at(4);
        let (cells, code) = code.split_at(counts[0] as usize);
        let (ends, mut code) = code.split_at(2 * counts[1] as usize);
        for change in 0..counts[2] + counts[3] {
            let (timeline, predicate) = ((code[0] >> 16) as u16, (code[0] & 0xffff) as usize);
            let (parameters, rest) = code[2..].split_at(code[1] as usize);
            code = rest;
            let lane = usize::from(timeline);
            let parameters = parameters.iter().map(value).collect();
            if change < counts[2] {
                let number = self.numbers[lane];
                self.ended.push(Ended {
                    contract: Contract { timeline, number },
                    predicate,
                    start: self.starts[lane],
                    finish: now,
                    parameters,
                });
                continue;
            }
            self.numbers[lane] += 1;
            self.starts[lane] = now;
            let number = self.numbers[lane];
            self.started.push(Started {
                contract: Contract { timeline, number },
                predicate,
                parameters,
            });
        }
        self.spare.cells.clear();
        self.spare.cells.extend(cells.iter().map(value));
        self.spare.ends.clear();
        let mut near = Ticks::MAX;
        for pair in ends.chunks_exact(2) {
            let bounds = (bound(pair[0], false), bound(pair[1], true));
            near = near.min(comes_near(bounds, now, self.exact));
            self.spare.ends.push(bounds);
        }
        self.near = near;
        self.counters.decisions += u64::from(at.decisions);
        self.counters.guards += u64::from(at.guards);
        self.counters.backtracks += u64::from(at.backtracks);
        self.state = at.next;
        std::mem::swap(&mut self.registers, &mut self.spare);
        self.settle_state();
    }

    /// A state is entered: nothing is posted in it yet.
    pub(super) fn settle_state(&mut self) {
        let form = &self.forms[self.state as usize];
        self.node = Some(form.node);
        self.ends.copy_from_slice(&form.ends);
        self.posted.clear();
        self.solved = Some(self.now);
    }
}

/// From which tick on a bound of an end is near that is far now.
pub(super) fn comes_near((min, max): (Ticks, Ticks), now: Ticks, exact: Ticks) -> Ticks {
    let far = [min, max].into_iter().filter(|&at| is_far(at, now, exact));
    far.map(|at| at - exact).min().unwrap_or(Ticks::MAX)
}
