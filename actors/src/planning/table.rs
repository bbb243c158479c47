//! The table of reservations: who is where, and from when to when. Planners that plan one rover
//! after the other ask it what is free.

use farside_worlds::{Roadmap, VertexId};

use super::plan::{Trip, visits};
use super::problem::Rules;

/// The end of a stay without end.
pub(crate) const FOREVER: u32 = u32::MAX;

/// A reservation of one vertex, for the cycles from `from` to before `until`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stay {
    pub(crate) from: u32,
    pub(crate) until: u32,
    pub(crate) rover: usize,
}

/// The stays at each vertex, earliest first; none overlap.
#[derive(Clone, Debug)]
pub(crate) struct Table {
    stays: Vec<Vec<Stay>>,
    trips: Vec<Option<Trip>>,
    rules: Rules,
}

impl Table {
    pub(crate) fn new(roadmap: &Roadmap, rovers: usize, rules: Rules) -> Table {
        Table {
            stays: vec![Vec::new(); roadmap.len()],
            trips: vec![None; rovers],
            rules,
        }
    }

    /// Reserves what a trip needs, which must be free.
    pub(crate) fn insert(&mut self, rover: usize, trip: Trip) {
        for visit in visits(&trip, self.rules) {
            let stay = Stay {
                from: visit.entered,
                until: visit.left.unwrap_or(FOREVER),
                rover,
            };
            let stays = &mut self.stays[visit.vertex.0 as usize];
            let at = stays.partition_point(|other| other.from < stay.from);
            debug_assert!(at == 0 || stays[at - 1].until <= stay.from, "taken before");
            debug_assert!(
                stays.get(at).is_none_or(|s| stay.until <= s.from),
                "taken later"
            );
            stays.insert(at, stay);
        }
        self.trips[rover] = Some(trip);
    }

    /// Gives up what a rover has reserved.
    pub(crate) fn remove(&mut self, rover: usize) {
        for vertex in self.trips[rover]
            .take()
            .into_iter()
            .flat_map(|t| t.vertices)
        {
            self.stays[vertex.0 as usize].retain(|stay| stay.rover != rover);
        }
    }

    /// The stays at a vertex, earliest first.
    pub(crate) fn stays(&self, vertex: VertexId) -> &[Stay] {
        &self.stays[vertex.0 as usize]
    }

    pub(crate) fn trip(&self, rover: usize) -> Option<&Trip> {
        self.trips[rover].as_ref()
    }

    pub(crate) fn into_trips(self) -> Vec<Option<Trip>> {
        self.trips
    }

    /// The stay that covers a cycle.
    pub(crate) fn stay_at(&self, vertex: VertexId, cycle: u32) -> Option<Stay> {
        let stays = self.stays(vertex);
        let next = stays.partition_point(|stay| stay.from <= cycle);
        let stay = *stays[..next].last()?;
        (cycle < stay.until).then_some(stay)
    }

    /// Who is at `vertex` in `cycle`.
    pub(crate) fn occupant(&self, vertex: VertexId, cycle: u32) -> Option<usize> {
        self.stay_at(vertex, cycle).map(|stay| stay.rover)
    }

    /// From this cycle on nobody moves any more.
    pub(crate) fn settled(&self) -> u32 {
        let ends = self
            .trips
            .iter()
            .flatten()
            .map(|trip| trip.last_cycle() + 1);
        ends.max().unwrap_or(0)
    }

    /// Who keeps a rover at `from` from moving to `to` (not the same), so that it is there in
    /// `cycle`: the one that is there then, or with which it would swap, or the one ahead of it in a
    /// rotation.
    pub(crate) fn bars(&self, from: VertexId, to: VertexId, cycle: u32) -> Option<usize> {
        if let Some(rover) = self.occupant(to, cycle) {
            return Some(rover);
        }
        self.closes_ring(from, to, cycle)
    }

    /// Who leaves `to` for `cycle`, if a chain of rovers that follow one another leads from there
    /// back to `from`. A chain of one is a swap.
    pub(crate) fn closes_ring(&self, from: VertexId, to: VertexId, cycle: u32) -> Option<usize> {
        let last = self.occupant(from, cycle)?;
        let ahead = self.occupant(to, cycle.checked_sub(1)?)?;
        // Each rover of the chain has left its vertex to the one behind it, so that the chain turns
        // back on itself nowhere but here, and ends.
        let mut rover = ahead;
        while rover != last {
            let at = self.trips[rover].as_ref()?.at(cycle)?;
            rover = self.occupant(at, cycle - 1)?;
        }
        Some(ahead)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::testing::{grid, v};

    fn trip(entered: u32, way: &[u32]) -> Trip {
        let vertices = way.iter().copied().map(v).collect();
        Trip { entered, vertices }
    }

    #[test]
    fn stays_are_found_and_given_up() {
        let mut table = Table::new(&grid(3, 2, &[]), 2, Rules::OnMap);
        table.insert(0, trip(0, &[0, 1, 1, 2]));
        table.insert(1, trip(0, &[3, 4, 4, 1, 0]));
        let at = |table: &Table, vertex, cycle| table.occupant(v(vertex), cycle);
        assert_eq!((at(&table, 1, 0), at(&table, 1, 2)), (None, Some(0)));
        assert_eq!((at(&table, 1, 3), at(&table, 1, 4)), (Some(1), None));
        assert_eq!(at(&table, 2, 1_000_000), Some(0), "it stays");
        assert_eq!(table.settled(), 5);
        table.remove(0);
        assert_eq!((at(&table, 1, 2), at(&table, 1, 3)), (None, Some(1)));
        assert_eq!(at(&table, 2, 9), None);
    }

    #[test]
    fn rings_are_seen_whoever_closes_them() {
        // 0 1 2
        // 3 4 5
        let mut table = Table::new(&grid(3, 2, &[]), 4, Rules::Queues);
        table.insert(0, trip(4, &[0, 1]));
        table.insert(1, trip(4, &[1, 4]));
        table.insert(2, trip(4, &[4, 3]));
        assert_eq!(table.bars(v(3), v(0), 5), Some(0), "it would rotate");
        assert_eq!(table.bars(v(2), v(1), 5), Some(0), "it is taken");
        assert_eq!(table.bars(v(1), v(0), 5), Some(0), "a swap");
        table.remove(2);
        assert_eq!(table.bars(v(3), v(0), 5), None, "4 stays free");
        table.insert(2, trip(5, &[3, 4]));
        assert_eq!(table.closes_ring(v(3), v(0), 5), None, "out of its queue");
    }
}
