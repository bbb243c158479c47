//! When a run must pause: control events fixed beforehand, and requests to stop.

use crate::engine::{Action, Factory, Remains};
use crate::guard::dropped;
use crate::ids::EntityId;
use crate::key::{Bound, EventKey};
use crate::time::{SimDuration, SimTime};
use crate::topology::Topology;

/// A control event.
pub(crate) struct Control {
    pub(crate) time: SimTime,
    /// Its place among the control events, in order of declaration.
    pub(crate) count: u64,
    pub(crate) what: ControlAction,
}

/// What a control event does.
pub(crate) enum ControlAction {
    Entity(EntityId, Action),
    Stop(String),
}

/// What the run must do when it reaches the next bound.
pub(crate) enum Due {
    /// Commit a stop.
    Stop {
        key: EventKey,
        by: EntityId,
        reason: String,
    },
    /// Apply this control event.
    Control(EventKey, EntityId, Action),
}

/// When a stop takes effect that was asked for in the event `key`.
pub(crate) fn stop_of(key: EventKey, look_ahead: SimDuration) -> Bound {
    if look_ahead.is_zero() {
        return Bound {
            time: key.time,
            step: key.step + 1,
        };
    }
    Bound::at(key.time + look_ahead).min(Bound {
        time: SimTime::from_nanos(SimTime::MAX.as_nanos() - 1),
        step: u32::MAX,
    })
}

/// Control events to come, and the earliest stop asked for.
pub(crate) struct Schedule {
    /// Latest first.
    controls: Vec<Control>,
    stop: Option<(Bound, EntityId, String)>,
    next_count: u64,
    look_ahead: SimDuration,
}

impl Schedule {
    pub(crate) fn new(mut controls: Vec<Control>, look_ahead: SimDuration) -> Self {
        let next_count = controls.len() as u64;
        controls.sort_by_key(|control| (control.time, control.count));
        controls.reverse();
        Schedule {
            controls,
            stop: None,
            next_count,
            look_ahead,
        }
    }

    /// Takes a request made in the event `key`: it takes effect one look-ahead later, so that
    /// hosts that run ahead in parallel have not passed it. Where that would be past the clock, it is
    /// after all that happens on it: whoever asks for a stop is heard.
    pub(crate) fn ask_stop(&mut self, key: EventKey, by: EntityId, reason: String) {
        let at = stop_of(key, self.look_ahead);
        if self
            .stop
            .as_ref()
            .is_none_or(|(earliest, ..)| at < *earliest)
        {
            self.stop = Some((at, by, reason));
        }
    }

    /// Nothing at or after this may be handled before [`Schedule::take_due`]. The last instant of
    /// the clock is never reached: what would be later has its time too, and must not happen early.
    pub(crate) fn bound(&self) -> Bound {
        let control = self
            .controls
            .last()
            .map_or(Bound::at(SimTime::MAX), |next| Bound::at(next.time));
        self.stop
            .as_ref()
            .map_or(control, |(stop, ..)| control.min(*stop))
    }

    /// True if all that could still happen in a run without events is that it is stopped by the
    /// clock.
    pub(crate) fn only_stops_left(&self) -> bool {
        let mut controls = self.controls.iter();
        self.stop.is_none() && controls.all(|next| matches!(next.what, ControlAction::Stop(_)))
    }

    /// What is due at [`Schedule::bound`]. A control event goes before a stop asked for at the
    /// same instant, as it would in key order.
    pub(crate) fn take_due(&mut self, topology: &Topology) -> Option<Due> {
        let bound = self.bound();
        if bound >= Bound::at(SimTime::MAX) {
            return None;
        }
        if self
            .controls
            .last()
            .is_some_and(|next| Bound::at(next.time) == bound)
        {
            let Control { time, count, what } = self.controls.pop()?;
            let key = topology.key(time, 0, EntityId::CONTROL, count);
            return Some(match what {
                ControlAction::Entity(entity, action) => Due::Control(key, entity, action),
                ControlAction::Stop(reason) => Due::Stop {
                    key,
                    by: EntityId::CONTROL,
                    reason,
                },
            });
        }
        let (at, by, reason) = self.stop.take()?;
        let key = topology.key(at.time, at.step, EntityId::CONTROL, self.next_count);
        Some(Due::Stop { key, by, reason })
    }

    /// The constructors that actors have from some control events on, in order; the rest is dropped.
    pub(crate) fn into_rebuilds(
        mut self,
        topology: &Topology,
    ) -> Vec<(EventKey, EntityId, Factory)> {
        let mut rebuilds = Vec::new();
        while let Some(Control { time, count, what }) = self.controls.pop() {
            let key = topology.key(time, 0, EntityId::CONTROL, count);
            match what {
                ControlAction::Entity(entity, Action::Rebuild(factory)) => {
                    rebuilds.push((key, entity, factory));
                }
                // Nobody is to know of a panic in what is not wanted.
                other => drop(dropped(other)),
            }
        }
        rebuilds
    }

    /// Drops what was never due.
    pub(crate) fn dissolve(self, topology: &Topology, remains: &mut Remains) {
        for control in self.controls {
            if let ControlAction::Entity(entity, action) = control.what {
                remains.drop_of(topology, entity, action);
            }
        }
    }
}
