//! How long nothing has come of a run, and what is still to come of it: for the monitor to tell a
//! pause from an end.
//!
//! A pause says little where messages get lost: at 60 % loss a message and its answer get through
//! together once in six times, so that what takes a team one cycle over good links takes it six.
//! So a pause counts only as far as messages came through in it: with the square of the share that
//! was delivered, because whoever waits, waits for an answer to what was sent; but with a hundredth
//! at least, so that a team that hears nothing at all comes to an end too. And cycles do not count
//! as long as something is fixed that may change the team's case: the restart of somebody who is
//! down, a link that changes, a processor that does.

use std::collections::{BTreeMap, BTreeSet};

use farside::record::{Record, RecordClass};
use farside::{EntityId, PlannedAction, RunInfo, SimTime};

/// The least share of messages that counts as delivered, as one in so many.
const ONE_IN: u128 = 10;

/// The cycles since something came of the run.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pause {
    /// The cycle in which something last did.
    since: u32,
    /// Whole cycles after that, without those that do not count; and what became of messages.
    cycles: u64,
    delivered: u64,
    lost: u64,
}

impl Pause {
    /// Something comes of the run in `cycle`.
    pub(super) fn ends(&mut self, cycle: u32) {
        *self = Pause {
            since: cycle,
            ..Pause::default()
        };
    }

    pub(super) fn since(&self) -> u32 {
        self.since
    }

    /// Whether it is as long as `cycles` cycles in which all messages come through.
    pub(super) fn is_as_long_as(&self, cycles: u32) -> bool {
        // With nothing lost, or nothing sent, there is nothing to wait for.
        if self.lost == 0 {
            return self.cycles >= u64::from(cycles);
        }
        let sent = u128::from(self.delivered + self.lost) * ONE_IN;
        let delivered = (u128::from(self.delivered) * ONE_IN).max(sent / ONE_IN);
        u128::from(self.cycles) * delivered * delivered >= u128::from(cycles) * sent * sent
    }

    /// The cycles from `first` to the one before `now` are over; messages are of the first.
    fn count(&mut self, (first, now): (u32, u32), (delivered, lost): (u64, u64)) {
        let begins = first.max(self.since + 1);
        self.cycles += u64::from(now.saturating_sub(begins));
        if first > self.since {
            self.delivered += delivered;
            self.lost += lost;
        }
    }
}

/// Both pauses that end a run, and what came through in the cycle under way.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pauses {
    /// Since a rover last moved or entered.
    pub(super) standing: Pause,
    /// Since the sum of what is left to drive was last less than ever before.
    pub(super) no_nearer: Pause,
    delivered: u64,
    lost: u64,
}

impl Pauses {
    /// A message over a link has met its fate.
    pub(super) fn fate(&mut self, class: RecordClass) {
        match class {
            RecordClass::Delivered => self.delivered += 1,
            RecordClass::Lost => self.lost += 1,
            _ => {}
        }
    }

    /// All cycles from `first` to the one before `now` are over. They do not count if something
    /// that is fixed is still to come.
    pub(super) fn count(&mut self, first: u32, now: u32, is_pending: bool) {
        let fates = (self.delivered, self.lost);
        (self.delivered, self.lost) = (0, 0);
        if !is_pending {
            self.standing.count((first, now), fates);
            self.no_nearer.count((first, now), fates);
        }
    }
}

/// What is fixed before the run and may change a team's case, and who is down.
#[derive(Clone, Debug, Default)]
pub(super) struct Fixed {
    /// The last change of a link or a processor.
    last_change: Option<SimTime>,
    /// When each that crashes is restarted, ascending.
    restarts: BTreeMap<EntityId, Vec<SimTime>>,
    down: BTreeSet<EntityId>,
}

impl Fixed {
    pub(super) fn of(run: &RunInfo) -> Fixed {
        let mut fixed = Fixed::default();
        for event in &run.planned {
            match event.action {
                PlannedAction::Crash => {}
                PlannedAction::Restart => {
                    let restarts = fixed.restarts.entry(event.entity).or_default();
                    restarts.push(event.time);
                }
                PlannedAction::Change | PlannedAction::Tell => fixed.last_change = Some(event.time),
            }
        }
        fixed
    }

    pub(super) fn note(&mut self, record: &Record<'_>) {
        match record.class {
            RecordClass::Crash => _ = self.down.insert(record.receiver),
            RecordClass::Restart => _ = self.down.remove(&record.receiver),
            _ => {}
        }
    }

    /// Whether something is still to come that may change the team's case.
    pub(super) fn is_pending(&self, now: SimTime) -> bool {
        let changes = self.last_change.is_some_and(|last| last >= now);
        changes || self.down.iter().any(|entity| self.comes_back(*entity, now))
    }

    /// Whether it is down, and nothing will restart it.
    pub(super) fn is_down_for_good(&self, entity: EntityId, now: SimTime) -> bool {
        self.down.contains(&entity) && !self.comes_back(entity, now)
    }

    fn comes_back(&self, entity: EntityId, now: SimTime) -> bool {
        let last = self.restarts.get(&entity).and_then(|all| all.last());
        last.is_some_and(|last| *last >= now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After how many quiet cycles a window of 20 is over, with so many messages of ten delivered.
    fn ends_after(delivered: u32) -> u32 {
        let mut pauses = Pauses::default();
        for cycle in 1.. {
            for message in 0..10 {
                let comes_through = message < delivered;
                pauses.fate(match comes_through {
                    true => RecordClass::Delivered,
                    false => RecordClass::Lost,
                });
            }
            pauses.count(cycle, cycle + 1, false);
            if pauses.standing.is_as_long_as(20) {
                return cycle;
            }
        }
        unreachable!("each cycle counts")
    }

    #[test]
    fn a_pause_counts_as_far_as_messages_came_through() {
        assert_eq!(ends_after(10), 20);
        assert_eq!(ends_after(5), 80);
        assert_eq!(ends_after(4), 125);
        assert_eq!(ends_after(0), 2000, "a hundredth at least");
    }

    /// Where few messages are sent, many cycles are without a loss: these alone prove nothing.
    #[test]
    fn a_pause_counts_as_a_whole_not_cycle_by_cycle() {
        let mut pauses = Pauses::default();
        for cycle in 1..=80 {
            pauses.fate(match cycle % 2 {
                0 => RecordClass::Delivered,
                _ => RecordClass::Lost,
            });
            pauses.count(cycle, cycle + 1, false);
            assert_eq!(pauses.standing.is_as_long_as(20), cycle == 80, "{cycle}");
        }
    }

    #[test]
    fn a_cycle_without_messages_counts_as_a_whole_and_one_before_a_restart_not_at_all() {
        let mut pauses = Pauses::default();
        pauses.count(1, 11, false);
        assert!(pauses.standing.is_as_long_as(10) && !pauses.standing.is_as_long_as(11));
        pauses.count(11, 31, true);
        assert!(!pauses.standing.is_as_long_as(11));
        pauses.standing.ends(40);
        pauses.count(31, 42, false);
        assert!(pauses.standing.is_as_long_as(1) && !pauses.standing.is_as_long_as(2));
        assert!(pauses.no_nearer.is_as_long_as(21), "that one went on");
    }
}
