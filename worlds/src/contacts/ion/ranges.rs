//! ION's ranges: which light time a contact has, and when it changes.

use std::collections::BTreeMap;

use super::super::build::{self, Nodes};
use super::super::error::Faults;
use super::super::{ContactError, ContactProblem};
use super::time::{Clock, Stamp};

/// A range as the file has it, or with its times counted from the plan's beginning.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range<T> {
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) start: T,
    pub(super) stop: T,
    pub(super) owlt_ns: u64,
    pub(super) line: usize,
}

impl Range<Stamp> {
    /// The part of it from the plan's beginning on, if there is one.
    pub(super) fn counted(&self, clock: &Clock) -> Result<Option<Range<u64>>, ContactError> {
        let (start, stop) = (clock.nanos(self.start), clock.nanos(self.stop));
        if start < stop && stop <= 0 {
            return Ok(None);
        }
        // Ranges often begin long before the contacts that need them.
        let begins_before = start < 0 && start < stop;
        let start = match begins_before {
            true => 0,
            false => clock.since_start(self.start, "start time", self.line)?,
        };
        let stop = clock.since_start(self.stop, "stop time", self.line)?;
        build::check_order(self.line, start, stop)?;
        Ok(Some(Range {
            from: self.from,
            to: self.to,
            start,
            stop,
            owlt_ns: self.owlt_ns,
            line: self.line,
        }))
    }
}

/// The ranges of each ordered pair that the file names, in order of time.
pub(super) struct Ranges {
    given: BTreeMap<(u32, u32), Vec<Range<u64>>>,
    /// For each of them, whether it holds for the way back, too.
    implied: BTreeMap<(u32, u32), bool>,
}

impl Ranges {
    pub(super) fn new(ranges: Vec<Range<u64>>, nodes: &Nodes, faults: &mut Faults) -> Self {
        let mut given: BTreeMap<(u32, u32), Vec<Range<u64>>> = BTreeMap::new();
        for range in ranges {
            given.entry((range.from, range.to)).or_default().push(range);
        }
        for ranges in given.values_mut() {
            ranges.sort_by_key(|range| (range.start, range.line));
            let overlap = |two: &&[Range<u64>]| two[1].start < two[0].stop;
            for two in ranges.windows(2).filter(overlap) {
                let problem = ContactProblem::RangeOverlap {
                    from: nodes.name(two[0].from).to_owned(),
                    to: nodes.name(two[0].to).to_owned(),
                    other_line: two[0].line.min(two[1].line),
                };
                faults.push(ContactError::at(two[0].line.max(two[1].line), problem));
            }
        }
        let implied = given
            .keys()
            .map(|&(from, to)| ((from, to), !nodes.is_one_way(from, to)));
        let implied = implied.collect();
        Ranges { given, implied }
    }

    /// Calls `piece(start, stop, owlt_ns)` for each part of a contact with one light time, in
    /// order. Where no range covers it any more, its light time stays: ION asks for it when the
    /// contact begins. Returns where that is for the first time. `None` if no range covers its
    /// beginning, and there is none to take instead.
    pub(super) fn split(
        &self,
        (from, to): (u32, u32),
        (start, stop): (u64, u64),
        instead_ns: Option<u64>,
        mut piece: impl FnMut(u64, u64, u64),
    ) -> Option<Option<u64>> {
        let of = |from, to| self.given.get(&(from, to)).map_or(&[][..], Vec::as_slice);
        let given = of(from, to);
        let back_holds = self.implied.get(&(to, from)).copied().unwrap_or(false);
        let back = if back_holds { of(to, from) } else { &[] };
        let next_of = |ranges: &[Range<u64>], at| {
            let next = ranges.partition_point(|range| range.stop <= at);
            let next = ranges.get(next).copied();
            // The range that covers `at`, or when the next one begins.
            match next {
                Some(range) if range.start <= at => (Some(range), range.stop),
                next => (None, next.map_or(u64::MAX, |range| range.start)),
            }
        };
        let mut at = start;
        let mut left_at = None;
        // Pieces of equal light time are one: the range did not change.
        let mut open: Option<(u64, u64)> = None;
        while at < stop {
            let (own, own_until) = next_of(given, at);
            let (other, other_until) = next_of(back, at);
            let (end, owlt_ns) = match (own, other, open) {
                (Some(range), ..) => (range.stop, range.owlt_ns),
                (None, Some(range), _) => (range.stop.min(own_until), range.owlt_ns),
                // A node needs no range to know how far it is from itself.
                (None, None, _) if from == to => (own_until, 0),
                (None, None, open) => {
                    let owlt_ns = open.map(|(_, owlt_ns)| owlt_ns).or(instead_ns)?;
                    if open.is_some() {
                        left_at = left_at.or(Some(at));
                    }
                    (own_until.min(other_until), owlt_ns)
                }
            };
            match open {
                Some((_, owlt)) if owlt == owlt_ns => {}
                Some((begun, owlt)) => {
                    piece(begun, at, owlt);
                    open = Some((at, owlt_ns));
                }
                None => open = Some((at, owlt_ns)),
            }
            at = end;
        }
        if let Some((begun, owlt)) = open {
            piece(begun, stop, owlt);
        }
        Some(left_at)
    }
}
