//! The token of a corridor: in which direction it is open, what its keeper hears, and what comes next. Without
//! messages, and without a roadmap.

use farside_worlds::NodeId;

use crate::corridors::Direction;
use crate::messages::CorridorReport;

/// For how many cycles' reports of one member a keeper keeps.
const KEPT: usize = 8;

/// The token's state, told by its epoch alone: 0 closed, 1 open forward, 2 closed, 3 open backward,
/// 4 closed, and so on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Epoch(pub(super) u32);

impl Epoch {
    /// The direction it is open in; none if it is closed.
    pub(super) fn open(self) -> Option<Direction> {
        (self.0 % 2 == 1).then(|| self.flow())
    }

    /// The direction of who is inside: the last that it was open in.
    pub(super) fn flow(self) -> Direction {
        match self.0 % 4 {
            1 | 2 => Direction::Forward,
            _ => Direction::Backward,
        }
    }

    /// The next epoch in which it is open in `direction`. The present one must be closed.
    pub(super) fn opened(self, direction: Direction) -> Epoch {
        Epoch(self.0 + if direction == self.flow() { 3 } else { 1 })
    }
}

/// What the keeper of a corridor knows of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    pub(super) epoch: Epoch,
    /// For how many cycles it has been so.
    pub(super) age: u32,
    /// For how many it stays open at least if both sides want it.
    pub(super) quantum: u32,
    pub(super) inside: u32,
    pub(super) wanted: [bool; 2],
}

/// What the token does next. With both sides waiting it alternates.
pub(super) fn next_epoch(view: &View) -> Epoch {
    let View { epoch, wanted, .. } = *view;
    let wants = |direction: Direction| wanted[direction.index()];
    let (flow, counter) = (epoch.flow(), epoch.flow().other());
    match epoch.open() {
        Some(_) if wants(counter) && (!wants(flow) || view.age >= view.quantum) => {
            Epoch(epoch.0 + 1)
        }
        Some(_) => epoch,
        None if view.inside > 0 => epoch,
        None if wants(counter) => epoch.opened(counter),
        None if wants(flow) => epoch.opened(flow),
        None => epoch,
    }
}

/// The tokens as a node knows them. Durable: a node that forgot a closing would let rovers in.
#[derive(Default)]
pub(super) struct Tokens {
    /// For each corridor of the roadmap the epoch heard last, or, of the keeper, the epoch.
    pub(super) epochs: Vec<Epoch>,
}

impl Tokens {
    pub(super) fn open(&mut self, corridors: usize) -> &mut Tokens {
        self.epochs.resize(corridors, Epoch::default());
        self
    }
}

/// What a node knows of a corridor beside the token. Lost in a crash.
#[derive(Clone, Default)]
pub(in crate::node) struct Watch {
    /// The last cycle in which a rover wanted to go in, by direction.
    pub(super) wanted: [Option<u32>; 2],
    /// There is room for one more, in the cycle told last.
    pub(super) room: bool,
    pub(super) told: u32,
    /// Keeper: since when the epoch is what it is.
    pub(super) since: u32,
    /// Keeper: what members reported, the latest last.
    pub(super) reports: Vec<CorridorReport>,
}

/// All members' reports of one cycle, together.
pub(super) struct Summary {
    pub(super) inside: u32,
    pub(super) wanted: [bool; 2],
    pub(super) room: [Option<u32>; 2],
}

impl Watch {
    pub(super) fn keep(&mut self, report: CorridorReport) {
        let same = |old: &CorridorReport| old.node == report.node;
        let known = |old: &CorridorReport| same(old) && old.cycle == report.cycle;
        if self.reports.iter().any(known) {
            return;
        }
        if self.reports.iter().filter(|old| same(old)).count() >= KEPT {
            let oldest = self
                .reports
                .iter()
                .filter(|old| same(old))
                .map(|r| r.cycle)
                .min();
            self.reports
                .retain(|old| !same(old) || Some(old.cycle) != oldest);
        }
        self.reports.push(report);
    }

    /// The latest cycle of which all members have reported, all of them knowing this epoch.
    pub(super) fn summary(&self, members: &[NodeId], epoch: Epoch) -> Option<Summary> {
        let of = |cycle| {
            let told = move |r: &&CorridorReport| r.cycle == cycle && r.epoch == epoch.0;
            self.reports.iter().filter(told)
        };
        let complete = |cycle: &u32| {
            let told = |member: &NodeId| of(*cycle).any(|r| r.node == *member);
            members.iter().all(told)
        };
        let cycle = self
            .reports
            .iter()
            .map(|r| r.cycle)
            .filter(complete)
            .max()?;
        let mut sum = Summary {
            inside: 0,
            wanted: [false; 2],
            room: [None; 2],
        };
        for report in of(cycle) {
            sum.inside += report.inside;
            for side in 0..2 {
                sum.wanted[side] |= report.wanted[side];
                sum.room[side] = sum.room[side].or(report.room[side]);
            }
        }
        Some(sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn view(epoch: u32, age: u32, inside: u32, wanted: [bool; 2]) -> View {
        let (epoch, quantum) = (Epoch(epoch), 6);
        View {
            epoch,
            age,
            quantum,
            inside,
            wanted,
        }
    }

    #[test]
    fn both_sides_take_turns() {
        let both = [true, true];
        assert_eq!(
            next_epoch(&view(1, 5, 2, both)),
            Epoch(1),
            "its time is not over"
        );
        assert_eq!(next_epoch(&view(1, 6, 2, both)), Epoch(2));
        assert_eq!(
            next_epoch(&view(2, 0, 1, both)),
            Epoch(2),
            "somebody is inside"
        );
        assert_eq!(next_epoch(&view(2, 3, 0, both)), Epoch(3));
        assert_eq!(next_epoch(&view(4, 0, 0, both)), Epoch(5));
    }

    #[test]
    fn one_side_alone_keeps_the_corridor_until_the_other_wants_it() {
        assert_eq!(next_epoch(&view(1, 99, 3, [true, false])), Epoch(1));
        assert_eq!(next_epoch(&view(1, 1, 3, [false, true])), Epoch(2));
        assert_eq!(
            next_epoch(&view(2, 1, 0, [true, false])),
            Epoch(5),
            "the same again"
        );
        assert_eq!(Epoch(5).open(), Some(Direction::Forward));
    }

    fn report(node: u32, cycle: u32, epoch: u32, inside: u32) -> CorridorReport {
        CorridorReport {
            corridor: 0,
            node: NodeId(node as _),
            cycle,
            epoch,
            inside,
            wanted: [false; 2],
            room: [None; 2],
        }
    }

    #[test]
    fn reports_of_different_cycles_prove_nothing() {
        // A rover goes from node 1's part to node 0's between the two reports.
        let mut watch = Watch::default();
        watch.keep(report(0, 4, 2, 0));
        watch.keep(report(1, 5, 2, 0));
        let members = [NodeId(0), NodeId(1)];
        assert!(watch.summary(&members, Epoch(2)).is_none());
        watch.keep(report(0, 5, 2, 1));
        assert_eq!(watch.summary(&members, Epoch(2)).unwrap().inside, 1);
        assert!(watch.summary(&members, Epoch(3)).is_none(), "another epoch");
    }

    proptest! {
        /// Members with clocks in step and links that delay and lose: never are two directions inside.
        #[test]
        fn a_corridor_never_holds_two_directions(
            draws in prop::collection::vec((any::<u64>(), 0..6u32, 0..6u32), 40..200),
        ) {
            // Three cells, a member each; 0 is the keeper. A rover goes one cell a cycle.
            let members = [0, 1, 2].map(NodeId);
            let mut cells: [Option<Direction>; 3] = [None; 3];
            let mut epochs = [Epoch(0); 3];
            let mut watch = Watch::default();
            let (mut reports, mut tokens) = (Vec::new(), Vec::new());
            for (cycle, (bits, lag, loss)) in (0u32..).zip(draws) {
                let bit = |i: u32| bits >> i & 1 == 1;
                for i in 0..3 {
                    let inside = u32::from(cells[i].is_some());
                    let mut told = report(i as u32, cycle, epochs[i].0, inside);
                    told.wanted = [bit(1), bit(2)];
                    reports.push((cycle + lag * u32::from(bit(3 + i as u32)), told));
                }
                for (due, told) in &reports {
                    let lost = told.node.0 != 0 && (told.cycle + u32::from(told.node.0 as u16)) % 7 < loss;
                    if *due == cycle && !lost {
                        watch.keep(told.clone());
                    }
                }
                if let Some(sum) = watch.summary(&members, epochs[0]) {
                    let (age, inside) = (cycle.saturating_sub(watch.since), sum.inside);
                    let seen = View { epoch: epochs[0], age, quantum: 3, inside, wanted: sum.wanted };
                    let decided = next_epoch(&seen);
                    if decided != epochs[0] {
                        watch.since = cycle;
                    }
                    epochs[0] = decided;
                }
                for i in 1..3u32 {
                    tokens.push((cycle + lag * u32::from(bit(8 + i)), i as usize, epochs[0]));
                }
                for &(due, i, epoch) in &tokens {
                    if due == cycle && !bit(12 + i as u32) {
                        epochs[i] = epochs[i].max(epoch);
                    }
                }
                // Moves: those ahead first, then who is outside.
                let out = |d: Direction| if d == Direction::Forward { 2 } else { 0 };
                for d in [Direction::Forward, Direction::Backward] {
                    let order: [usize; 3] = if d == Direction::Forward { [2, 1, 0] } else { [0, 1, 2] };
                    for (k, &i) in order.iter().enumerate() {
                        if cells[i] == Some(d) && !bit(16 + i as u32) {
                            if i == out(d) {
                                cells[i] = None;
                            } else if cells[order[k - 1]].is_none() {
                                cells[order[k - 1]] = cells[i].take();
                            }
                        }
                    }
                    let gate = 2 - out(d);
                    if bit(1 + d.index() as u32) && epochs[gate].open() == Some(d) && cells[gate].is_none() {
                        cells[gate] = Some(d);
                    }
                }
                let both = [Direction::Forward, Direction::Backward]
                    .iter()
                    .all(|d| cells.contains(&Some(*d)));
                prop_assert!(!both, "cycle {}: {:?}", cycle, cells);
            }
        }
    }
}
