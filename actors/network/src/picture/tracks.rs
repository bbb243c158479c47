//! Where rovers were, and when: read from the states that they recorded in a log.

use std::collections::BTreeMap;

use farside::encoding::Schema;
use farside::record::RecordClass;
use farside_actors::system::{PictureError as Failure, Recording};
use farside_worlds::VertexId;

use super::PictureError;
use crate::messages::RoverState;

/// A rover's state from a time on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Mark {
    pub(crate) time_ns: u64,
    /// Steps completed; 0 in the entry queue.
    pub(crate) step: u32,
    pub(crate) vertex: Option<VertexId>,
    pub(crate) moving_to: Option<VertexId>,
    pub(crate) entry: VertexId,
    pub(crate) goal: VertexId,
}

/// All rovers' states in a log, in order of time.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tracks {
    rovers: BTreeMap<u32, Vec<Mark>>,
    pub(crate) end_ns: u64,
    /// Why the run ended, as the log has it; nothing if the log is cut.
    pub(crate) end: String,
}

/// A rover at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Seen {
    /// The rover's number, from 0.
    pub(crate) rover: u32,
    pub(crate) entry: VertexId,
    pub(crate) goal: VertexId,
    pub(crate) place: Place,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Place {
    /// In the queue of its entry.
    Queue,
    At(VertexId),
    /// On an edge, and how much of it lies behind, from 0 to 1.
    Between(VertexId, VertexId, f64),
    /// It has left the map.
    Gone,
}

impl Seen {
    /// The vertex that it holds: the one it stands on, or drives to.
    pub(crate) fn holds(&self) -> Option<VertexId> {
        match self.place {
            Place::At(v) | Place::Between(_, v, _) => Some(v),
            Place::Queue | Place::Gone => None,
        }
    }
}

impl Tracks {
    /// Reads them from a recorded run.
    pub(crate) fn read(run: &dyn Recording) -> Result<Tracks, PictureError> {
        let schema =
            Schema::of::<RoverState>().map_err(|error| PictureError::States(error.to_string()))?;
        let mut tracks = Tracks::default();
        let ending = run.for_each(&mut |record| {
            tracks.end_ns = tracks.end_ns.max(record.time_ns);
            if record.class != RecordClass::Sample || record.kind != "RoverState" {
                return Ok(());
            }
            let state: RoverState = schema
                .decode(record.body)
                .map_err(|error| Failure::from(PictureError::States(error.to_string())))?;
            tracks.push(record.time_ns, &state);
            Ok(())
        })?;
        tracks.end_ns = ending.time_ns.unwrap_or(tracks.end_ns);
        tracks.end = ending.detail;
        if tracks.rovers.is_empty() {
            let excluded = run.excluded().join(", ");
            return Err(PictureError::NoStates { excluded });
        }
        Ok(tracks)
    }

    fn push(&mut self, time_ns: u64, state: &RoverState) {
        let whereabouts = &state.whereabouts;
        let mark = Mark {
            time_ns,
            step: whereabouts.step,
            vertex: whereabouts.vertex,
            moving_to: whereabouts.moving_to,
            entry: state.entry,
            goal: state.goal,
        };
        let marks = self.rovers.entry(whereabouts.rover.0).or_default();
        // A restart records the same state again, and is no move.
        let same = |last: &&Mark| (last.vertex, last.moving_to) == (mark.vertex, mark.moving_to);
        if marks.last().filter(same).is_none() {
            marks.push(mark);
        }
    }

    /// The rovers by number, each with its states.
    pub(crate) fn rovers(&self) -> impl Iterator<Item = (u32, &[Mark])> {
        self.rovers
            .iter()
            .map(|(rover, marks)| (*rover, &marks[..]))
    }

    /// The highest vertex number in it.
    pub(crate) fn highest_vertex(&self) -> u32 {
        let of = |mark: &Mark| {
            let places = [
                mark.vertex,
                mark.moving_to,
                Some(mark.entry),
                Some(mark.goal),
            ];
            places.into_iter().flatten().map(|v| v.0).max()
        };
        let all = self.rovers.values().flatten();
        all.filter_map(of).max().unwrap_or(0)
    }

    /// Where each rover is at a time, in order of their numbers.
    pub(crate) fn at(&self, time_ns: u64) -> Vec<Seen> {
        let seen = |(rover, marks): (u32, &[Mark])| {
            let after = marks.partition_point(|mark| mark.time_ns <= time_ns);
            let mark = marks.get(after.checked_sub(1)?)?;
            let place = match (mark.vertex, mark.moving_to) {
                (Some(from), Some(to)) => {
                    // Where nothing tells the end of the edge, the rover is drawn in its middle.
                    let share = marks.get(after).map_or(0.5, |next| {
                        let whole = next.time_ns - mark.time_ns;
                        (time_ns - mark.time_ns) as f64 / whole as f64
                    });
                    Place::Between(from, to, share)
                }
                (Some(at), None) => Place::At(at),
                (None, _) if mark.step == 0 => Place::Queue,
                (None, _) => Place::Gone,
            };
            Some(Seen {
                rover,
                entry: mark.entry,
                goal: mark.goal,
                place,
            })
        };
        self.rovers().filter_map(seen).collect()
    }
}
