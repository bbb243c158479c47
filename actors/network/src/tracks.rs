//! Where rovers were, and when: read from the states that they recorded in a log.

use std::collections::BTreeMap;

use farside::encoding::Schema;
use farside::record::RecordClass;
use farside_actors::invariants::Place;
use farside_actors::system::{PictureError, Recording};
use farside_worlds::VertexId;
use thiserror::Error;

use crate::safety::messages::RoverState;
use crate::waits::Standing;

/// A rover's state from a time on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Mark {
    pub(crate) time_ns: u64,
    /// Steps completed; 0 in the entry queue.
    pub(crate) step: u32,
    pub(crate) place: Place<VertexId>,
    pub(crate) entry: VertexId,
    pub(crate) goal: VertexId,
}

/// All rovers' states in a log, in order of time.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tracks {
    rovers: BTreeMap<u32, Vec<Mark>>,
    /// Who was down when.
    pub(crate) outages: Vec<Outage>,
    pub(crate) end_ns: u64,
    /// Why the run ended, as the log has it; nothing if the log is cut.
    pub(crate) end: String,
}

/// An actor that is down, from its crash to its restart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Outage {
    pub(crate) actor: String,
    pub(crate) from_ns: u64,
    /// None if it stayed down.
    pub(crate) to_ns: Option<u64>,
}

/// Why a recorded run tells nothing of where rovers were.
#[derive(Debug, Error)]
pub(crate) enum TracksError {
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] PictureError),
    /// There are no rovers in it.
    #[error(
        "it holds no states of rovers: expected samples of RoverState on /state/**{}",
        excluded_note(.excluded)
    )]
    NoStates { excluded: String },
    /// The rovers' states are none.
    #[error("its states of rovers cannot be used: {0}")]
    States(String),
}

fn excluded_note(excluded: &str) -> String {
    if excluded.is_empty() {
        String::new()
    } else {
        format!("; left out of it were {excluded}")
    }
}

/// A rover at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sighting {
    /// The rover's number, from 0.
    pub(crate) rover: u32,
    pub(crate) entry: VertexId,
    pub(crate) goal: VertexId,
    pub(crate) place: Place<VertexId>,
    /// Whether it has entered the map, and perhaps left it again.
    pub(crate) has_entered: bool,
    /// How much of the edge that it is on lies behind it, from 0 to 1.
    pub(crate) share: f64,
}

impl Sighting {
    /// It is in the queue of its entry.
    pub(crate) fn is_queued(&self) -> bool {
        self.place == Place::Away && !self.has_entered
    }

    /// It has left the map.
    pub(crate) fn is_gone(&self) -> bool {
        self.place == Place::Away && self.has_entered
    }

    /// The rover as the wait-for graph has it.
    pub(crate) fn standing(&self) -> Standing {
        Standing {
            rover: self.rover,
            place: self.place,
            goal: self.goal,
            // A log does not say of who is down whether it comes back.
            is_down: false,
        }
    }
}

impl Tracks {
    /// Reads them from a recorded run.
    pub(crate) fn read(run: &dyn Recording) -> Result<Tracks, TracksError> {
        let unusable = |error: String| TracksError::States(error);
        let schema = Schema::of::<RoverState>().map_err(|error| unusable(error.to_string()))?;
        let mut tracks = Tracks::default();
        let ending = run.for_each(&mut |record| {
            tracks.end_ns = tracks.end_ns.max(record.time_ns);
            match record.class {
                RecordClass::Crash => tracks.outages.push(Outage {
                    actor: record.actor.to_owned(),
                    from_ns: record.time_ns,
                    to_ns: None,
                }),
                RecordClass::Restart => tracks.back(record.actor, record.time_ns),
                _ => {}
            }
            if record.class != RecordClass::Sample || record.kind != "RoverState" {
                return Ok(());
            }
            let state: RoverState = schema
                .decode(record.body)
                .map_err(|error| PictureError::NotDrawn(unusable(error.to_string()).to_string()))?;
            tracks.push(record.time_ns, &state);
            Ok(())
        })?;
        tracks.end_ns = ending.time_ns.unwrap_or(tracks.end_ns);
        tracks.end = ending.detail;
        if tracks.rovers.is_empty() {
            let excluded = run.excluded().join(", ");
            return Err(TracksError::NoStates { excluded });
        }
        Ok(tracks)
    }

    /// An actor restarts.
    fn back(&mut self, actor: &str, time_ns: u64) {
        let down = |outage: &&mut Outage| outage.actor == actor && outage.to_ns.is_none();
        if let Some(outage) = self.outages.iter_mut().rev().find(down) {
            outage.to_ns = Some(time_ns);
        }
    }

    fn push(&mut self, time_ns: u64, state: &RoverState) {
        let whereabouts = &state.whereabouts;
        let mark = Mark {
            time_ns,
            step: whereabouts.step,
            place: whereabouts.place(),
            entry: state.entry,
            goal: state.goal,
        };
        let marks = self.rovers.entry(whereabouts.rover.0).or_default();
        // A restart records the same state again, and is no move.
        let same = |last: &&Mark| last.place == mark.place;
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
            let (here, next) = (mark.place.vertex(), mark.place.claim());
            [here, next, Some(mark.entry), Some(mark.goal)]
                .into_iter()
                .flatten()
                .map(|v| v.0)
                .max()
        };
        let all = self.rovers.values().flatten();
        all.filter_map(of).max().unwrap_or(0)
    }

    /// Where each rover is at a time, in order of their numbers.
    pub(crate) fn at(&self, time_ns: u64) -> Vec<Sighting> {
        let sighting = |(rover, marks): (u32, &[Mark])| {
            let after = marks.partition_point(|mark| mark.time_ns <= time_ns);
            let mark = marks.get(after.checked_sub(1)?)?;
            // Where nothing tells the end of the edge, the rover is drawn in its middle.
            let share = marks.get(after).map_or(0.5, |next| {
                let whole = next.time_ns - mark.time_ns;
                (time_ns - mark.time_ns) as f64 / whole as f64
            });
            Some(Sighting {
                rover,
                entry: mark.entry,
                goal: mark.goal,
                place: mark.place,
                has_entered: mark.step > 0,
                share,
            })
        };
        self.rovers().filter_map(sighting).collect()
    }
}
