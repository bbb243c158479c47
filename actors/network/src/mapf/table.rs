//! The table of reservations: who is where, and from when to when. Planners that plan one rover
//! after the other ask it what is free.

use farside_worlds::{Roadmap, VertexId};

use super::safe_intervals::{FOREVER, TimedVisit};

/// A reservation of one vertex, for the ticks from `from` to before `until`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stay {
    pub(crate) from: u64,
    pub(crate) until: u64,
    pub(crate) rover: usize,
}

/// The stays at each vertex, earliest first; none overlap.
#[derive(Clone, Debug)]
pub(crate) struct StayTable {
    stays: Vec<Vec<Stay>>,
    ways: Vec<Vec<TimedVisit>>,
}

impl StayTable {
    pub(crate) fn new(roadmap: &Roadmap, rovers: usize) -> StayTable {
        StayTable {
            stays: vec![Vec::new(); roadmap.len()],
            ways: vec![Vec::new(); rovers],
        }
    }

    /// Reserves what a way needs, which must be free.
    pub(crate) fn insert(&mut self, rover: usize, way: Vec<TimedVisit>) {
        for visit in &way {
            let stay = Stay {
                from: visit.start,
                until: visit.end,
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
        self.ways[rover] = way;
    }

    /// Gives up what a rover has reserved.
    pub(crate) fn remove(&mut self, rover: usize) {
        for visit in std::mem::take(&mut self.ways[rover]) {
            self.stays[visit.vertex.0 as usize].retain(|stay| stay.rover != rover);
        }
    }

    /// The stays at a vertex, earliest first.
    pub(crate) fn stays(&self, vertex: VertexId) -> &[Stay] {
        &self.stays[vertex.0 as usize]
    }

    /// The same as (from, until), as searches ask for it.
    pub(crate) fn busy(&self, vertex: VertexId) -> Vec<(u64, u64)> {
        let stays = self.stays(vertex).iter();
        stays.map(|stay| (stay.from, stay.until)).collect()
    }

    /// A rover's way; empty if it has none.
    pub(crate) fn way(&self, rover: usize) -> &[TimedVisit] {
        &self.ways[rover]
    }

    pub(crate) fn into_ways(self) -> Vec<Vec<TimedVisit>> {
        self.ways
    }

    /// Who is at `vertex` at `tick`.
    pub(crate) fn occupant(&self, vertex: VertexId, tick: u64) -> Option<usize> {
        let stays = self.stays(vertex);
        let next = stays.partition_point(|stay| stay.from <= tick);
        let stay = stays[..next].last()?;
        (tick < stay.until).then_some(stay.rover)
    }

    /// From this tick on nobody moves any more.
    pub(crate) fn settled(&self) -> u64 {
        let lasts = self.ways.iter().filter_map(|way| way.last());
        let ends = lasts.map(|visit| match visit.end {
            FOREVER => visit.start + 1,
            end => end,
        });
        ends.max().unwrap_or(0)
    }

    /// Where a rover is at `tick`.
    fn place(&self, rover: usize, tick: u64) -> Option<VertexId> {
        let way = &self.ways[rover];
        let next = way.partition_point(|visit| visit.start <= tick);
        let visit = way[..next].last()?;
        (tick < visit.end).then_some(visit.vertex)
    }

    /// Who leaves `to` at `tick`, if a chain of rovers that follow one another at that instant
    /// leads from there back to `from`. A chain of one is a swap. Rovers can only do so without a
    /// gap between them. Nobody may be at `to` then.
    pub(crate) fn closes_ring(&self, from: VertexId, to: VertexId, tick: u64) -> Option<usize> {
        let last = self.occupant(from, tick)?;
        let ahead = self.occupant(to, tick.checked_sub(1)?)?;
        // Each rover of the chain has left its vertex to the one behind it, so that the chain turns
        // back on itself nowhere but here, and ends.
        let mut rover = ahead;
        while rover != last {
            let at = self.place(rover, tick)?;
            rover = self.occupant(at, tick - 1)?;
        }
        Some(ahead)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mapf::plan::{Trip, visits};
    use crate::mapf::problem::Rules;
    use crate::testing::{grid, v};

    fn trip(entered: u32, vertices: &[u32], rules: Rules) -> Vec<TimedVisit> {
        let vertices = vertices.iter().copied().map(v).collect();
        visits(&Trip { entered, vertices }, rules)
    }

    #[test]
    fn stays_are_found_and_given_up() {
        let mut table = StayTable::new(&grid(3, 2, &[]), 2);
        table.insert(0, trip(0, &[0, 1, 1, 2], Rules::StayAtTarget));
        table.insert(1, trip(0, &[3, 4, 4, 1, 0], Rules::StayAtTarget));
        let at = |table: &StayTable, vertex, tick| table.occupant(v(vertex), tick);
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
        // 0 1 2 3 4 5
        let mut table = StayTable::new(&grid(3, 2, &[]), 4);
        table.insert(0, trip(4, &[0, 1], Rules::DisappearAtTarget));
        table.insert(1, trip(4, &[1, 4], Rules::DisappearAtTarget));
        table.insert(2, trip(4, &[4, 3], Rules::DisappearAtTarget));
        assert_eq!(table.closes_ring(v(3), v(0), 5), Some(0), "it would rotate");
        assert_eq!(table.closes_ring(v(1), v(0), 5), Some(0), "a swap");
        table.remove(2);
        assert_eq!(table.closes_ring(v(3), v(0), 5), None, "4 stays free");
        table.insert(2, trip(5, &[3, 4], Rules::DisappearAtTarget));
        assert_eq!(table.closes_ring(v(3), v(0), 5), None, "out of its queue");
    }
}
