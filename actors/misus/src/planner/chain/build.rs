//! Changes of a chain, and its times and sums worked out anew after each.

use super::{Chain, Insertion, Node, Sum, Violation, Visit};
use crate::planner::instance::Instance;

impl Chain {
    /// Puts a task in, in a sol before the node of a number.
    ///
    /// # Panics
    /// When the number is not in the sol, nor the first after it: a bug in the caller.
    pub fn insert(&mut self, instance: &Instance, visit: Visit, sol: usize, index: usize) {
        let range = self.sol(sol);
        assert!(
            range.start <= index && index <= range.end,
            "outside the sol"
        );
        self.put(visit, sol, index);
        self.rebuild(instance);
    }

    /// Puts a task in where a test has found a place for it.
    pub fn accept(&mut self, instance: &Instance, visit: Visit, found: &Insertion) {
        self.insert(instance, visit, found.sol, found.index);
    }

    /// Takes a node out.
    ///
    /// # Panics
    /// When there is no node of this number: a bug in the caller.
    pub fn remove(&mut self, instance: &Instance, index: usize) -> Visit {
        let node = self.nodes.remove(index);
        for first in &mut self.firsts[node.sol + 1..] {
            *first -= 1;
        }
        self.rebuild(instance);
        node.visit
    }

    /// Takes out all tasks that `keep` does not keep.
    pub fn retain(&mut self, instance: &Instance, mut keep: impl FnMut(usize) -> bool) {
        self.nodes.retain(|node| keep(node.visit.task));
        for sol in 0..self.sums.len() {
            self.firsts[sol + 1] = self.nodes.partition_point(|node| node.sol <= sol);
        }
        self.rebuild(instance);
    }

    /// Turns the order of the nodes of one sol from `first` to `last` round, if nothing comes before what it
    /// requires then; says whether it did.
    ///
    /// # Panics
    /// When both are not in one sol: a bug in the caller.
    pub fn reverse(&mut self, instance: &Instance, first: usize, last: usize) -> bool {
        let nodes = &self.nodes[first..=last];
        assert_eq!(nodes[0].sol, nodes[last - first].sol, "one sol");
        let goals = || nodes.iter().map(|node| node.visit.task);
        let ordered = goals().filter(|task| *task < instance.goals()).any(|goal| {
            let requires = instance.requires(goal);
            !requires.is_empty() && goals().any(|other| requires.contains(&other))
        });
        if ordered {
            return false;
        }
        self.nodes[first..=last].reverse();
        self.rebuild(instance);
        true
    }

    /// Puts a node in without working anything out.
    pub(super) fn put(&mut self, visit: Visit, sol: usize, index: usize) {
        let node = Node {
            visit,
            sol,
            place: 0,
            drive_ms: 0,
            start_ms: 0,
            end_ms: 0,
            stored_bits: 0,
            used_uj: 0,
            late_ms: 0,
            over_bits: 0,
            latest_ms: 0,
            stuck_ms: 0,
            room_bits: 0,
            later_over_bits: 0,
        };
        self.nodes.insert(index, node);
        for first in &mut self.firsts[sol + 1..] {
            *first += 1;
        }
    }

    pub(super) fn rebuild(&mut self, instance: &Instance) {
        self.forward(instance);
        self.backward(instance);
        let vehicle = &instance.vehicles()[self.rover];
        self.violation = Violation {
            bits: self.nodes.last().map_or(0, |node| node.over_bits),
            ..Violation::default()
        };
        for (sum, sol) in self.sums.iter().zip(&vehicle.sols) {
            self.violation.late_ms += sum.late_ms;
            self.violation.energy_uj += (sum.energy_uj - sol.energy_uj).max(0);
        }
    }

    /// Earliest times, and what is used by then.
    fn forward(&mut self, instance: &Instance) {
        let vehicle = &instance.vehicles()[self.rover];
        self.sums.fill(Sum::default());
        self.drive_ms = 0;
        let (mut place, mut stored_bits) = (vehicle.start, vehicle.stored_bits);
        let (mut over_bits, mut ready_ms, mut sol) = (0, vehicle.sols[0].opens_ms, 0);
        for node in &mut self.nodes {
            let task = instance.task(node.visit.task);
            if node.sol != sol {
                sol = node.sol;
                ready_ms = vehicle.sols[sol].opens_ms;
            }
            let sum = &mut self.sums[sol];
            node.place = task.place.unwrap_or(place);
            node.drive_ms = instance.drive_ms(self.rover, place, node.place);
            node.start_ms = (ready_ms + node.drive_ms).max(node.visit.opens_ms);
            node.end_ms = node.start_ms + task.duration_ms;
            let closes_ms = node.visit.closes_ms.min(vehicle.sols[sol].closes_ms);
            sum.late_ms = sum.late_ms.max(node.end_ms - closes_ms);
            sum.energy_uj += task.energy_uj + node.drive_ms * vehicle.drive_mw;
            stored_bits += task.adds_bits;
            over_bits = over_bits.max(stored_bits - vehicle.memory_bits);
            stored_bits -= task.sends_bits.min(stored_bits);
            node.late_ms = sum.late_ms;
            node.used_uj = sum.energy_uj;
            node.stored_bits = stored_bits;
            node.over_bits = over_bits;
            self.drive_ms += node.drive_ms;
            (place, ready_ms) = (node.place, node.end_ms);
        }
    }

    /// Latest times, and what is left from then on.
    fn backward(&mut self, instance: &Instance) {
        let vehicle = &instance.vehicles()[self.rover];
        let (mut sol, mut latest_end_ms, mut stuck_ms) = (usize::MAX, i64::MAX, 0);
        let (mut room_bits, mut later_over_bits) = (i64::MAX, 0);
        for index in (0..self.nodes.len()).rev() {
            let stored_before = match index.checked_sub(1) {
                Some(before) => self.nodes[before].stored_bits,
                None => vehicle.stored_bits,
            };
            let node = &mut self.nodes[index];
            let task = instance.task(node.visit.task);
            if node.sol != sol {
                (sol, latest_end_ms, stuck_ms) = (node.sol, i64::MAX, 0);
            }
            let closes_ms = node.visit.closes_ms.min(vehicle.sols[sol].closes_ms);
            node.latest_ms = closes_ms.min(latest_end_ms) - task.duration_ms;
            node.stuck_ms = stuck_ms;
            stuck_ms = stuck_ms.max(node.visit.opens_ms - node.latest_ms);
            latest_end_ms = node.latest_ms - node.drive_ms;
            let full = stored_before + task.adds_bits;
            // What could be sent and is not is room for more.
            room_bits = room_bits.saturating_add((task.sends_bits - full).max(0));
            room_bits = room_bits.min(vehicle.memory_bits - full);
            later_over_bits = later_over_bits.max(full - vehicle.memory_bits);
            (node.room_bits, node.later_over_bits) = (room_bits, later_over_bits);
        }
    }
}
