//! Rovers of IDEA as viewers draw them: ground and rocks, rovers as they stand with roll and pitch, where
//! their mast points, goals in the colours of what became of them, and alarms where they came.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use farside::RunInfo;
use farside::record::{Record, RecordClass};
use farside::scene::{Drawing, Form, Level, Pose, Scene};
use farside_actors::drawing::{self, MAP, base_link, label, layered, poses, shape, text};
use farside_actors::rover::{Aim, Command, FaultBegins, RoverCommand, RoverPose, hardware_name};
use farside_worlds::RockField;

use crate::assemble::{Goals, Names};
use crate::outcomes::{GoalBook, GoalOutcome};
use crate::records::{AgentFaulty, AgentRemark, GoalEnded, GoalGivenUp, TimelineSays};
use crate::relay::RelayStopped;

/// How large rovers are drawn \[m\].
const SCALE_M: f64 = 1.6;
/// How high the mast of a drawn rover is \[m\].
const MAST_M: f64 = 1.0;
/// How long and how wide what the mast's cameras see is drawn \[m\].
const SEES_M: [f64; 3] = [2.0, 0.5, 0.35];

/// Colours: red, green, blue, opacity.
const ROCKS: [f64; 4] = [0.6, 0.6, 0.6, 0.8];
const CAMERA: [f64; 4] = [0.34, 0.71, 0.91, 0.9];
const OPEN: [f64; 4] = [0.0, 0.45, 0.7, 0.8];
const DONE: [f64; 4] = [0.0, 0.62, 0.45, 0.9];
const NOT_DONE: [f64; 4] = [0.84, 0.37, 0.0, 0.9];
const ALARM: [f64; 4] = [0.77, 0.09, 0.11, 0.9];

/// What an actor of the run is, and of which rover.
#[derive(Clone, Copy)]
enum Part {
    Agent { rover: usize, is_system: bool },
    Relay,
    Hardware(usize),
}

/// A rover that is drawn.
struct Drawn {
    names: Names,
    book: GoalBook,
    /// Where it was last \[m\].
    place_m: [f64; 3],
    /// How many alarms it had.
    alarms: u32,
}

/// Draws a run.
pub(crate) struct IdeaScene {
    field: Arc<RockField>,
    rovers: Vec<Drawn>,
    /// By the number of the actor in the run.
    parts: BTreeMap<usize, Part>,
}

impl fmt::Debug for IdeaScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("IdeaScene").finish_non_exhaustive()
    }
}

impl IdeaScene {
    /// A field, and the rovers on it with their goals.
    pub(crate) fn new(field: Arc<RockField>, names: Vec<Names>, goals: &[Goals]) -> IdeaScene {
        let rovers = names.into_iter().zip(goals).map(|(names, goals)| Drawn {
            names,
            book: GoalBook::new(goals.places.clone()),
            place_m: [0.0; 3],
            alarms: 0,
        });
        IdeaScene {
            rovers: rovers.collect(),
            field,
            parts: BTreeMap::new(),
        }
    }

    fn part(&self, name: &str) -> Option<Part> {
        self.rovers.iter().enumerate().find_map(|(rover, one)| {
            let names = &one.names;
            if names.rover == name {
                return Some(Part::Relay);
            }
            if hardware_name(&names.rover) == name {
                return Some(Part::Hardware(rover));
            }
            let layer = names.agents.iter().position(|agent| agent == name)?;
            let is_system = layer + 1 == names.agents.len();
            Some(Part::Agent { rover, is_system })
        })
    }

    fn rocks(&self, out: &mut Vec<Drawing>) {
        let places = self.field.rocks().iter().map(|rock| {
            let (x, y) = (rock.position_m.x, rock.position_m.y);
            [x, y, self.field.ground_m(x, y) + 0.25 * rock.diameter_m]
        });
        let places: Vec<[f64; 3]> = places.collect();
        let shapes = self
            .field
            .rocks()
            .iter()
            .zip(&places)
            .map(|(rock, place_m)| {
                let diameter_m = rock.diameter_m;
                shape(Form::Sphere { diameter_m }, *place_m, ROCKS)
            });
        out.push(Drawing::Entity {
            id: layered("rocks", "all"),
            frame: MAP.to_owned(),
            shapes: shapes.collect(),
        });
        out.push(poses("rocks", places.into_iter().map(Pose::at).collect()));
    }

    /// A goal in the colour of what became of it.
    fn goal(&self, rover: usize, goal: usize) -> Drawing {
        let one = &self.rovers[rover];
        let (place, outcome) = (&one.book.goals()[goal], one.book.outcomes()[goal]);
        let [x, y] = place.place_m;
        let ground_m = self.field.ground_m(x, y);
        let colour = match outcome {
            GoalOutcome::Open => OPEN,
            GoalOutcome::Done => DONE,
            GoalOutcome::Failed | GoalOutcome::GivenUp | GoalOutcome::TakenBack => NOT_DONE,
        };
        let says = format!("{} {}: {}", place.number, place.name, outcome.name());
        Drawing::Entity {
            id: layered("goals", &format!("{}-{}", one.names.rover, place.number)),
            frame: MAP.to_owned(),
            shapes: vec![
                shape(
                    Form::Sphere { diameter_m: 0.4 },
                    [x, y, ground_m + 0.2],
                    colour,
                ),
                label(&says, [x, y, ground_m + 0.7], 0.3),
            ],
        }
    }

    /// The goal of this place has another outcome.
    fn settled(&self, rover: usize, goal: Option<usize>, out: &mut Vec<Drawing>) {
        let Some(goal) = goal else {
            return;
        };
        let one = &self.rovers[rover];
        let outcome = one.book.outcomes()[goal];
        let level = match outcome {
            GoalOutcome::Open | GoalOutcome::Done | GoalOutcome::TakenBack => Level::Info,
            GoalOutcome::Failed | GoalOutcome::GivenUp => Level::Warning,
        };
        let message = format!("{} is {}", one.book.goals()[goal].name, outcome.name());
        out.push(self.goal(rover, goal));
        out.push(text(level, &one.names.rover, &message));
    }

    fn follow(&mut self, rover: usize, pose: &RoverPose, out: &mut Vec<Drawing>) {
        let one = &mut self.rovers[rover];
        one.place_m = [pose.east_m, pose.north_m, pose.height_m];
        out.extend(drawing::follow(&one.names.rover, pose, SCALE_M));
    }

    fn alarm(&mut self, rover: usize, says: &str, out: &mut Vec<Drawing>) {
        let one = &mut self.rovers[rover];
        one.alarms += 1;
        let [x, y, z] = one.place_m;
        let form = Form::Sphere { diameter_m: 0.3 };
        out.push(Drawing::Entity {
            id: layered("alarms", &format!("{}-{}", one.names.rover, one.alarms)),
            frame: MAP.to_owned(),
            shapes: vec![
                shape(form, [x, y, z + 1.2], ALARM),
                label(says, [x, y, z + 1.5], 0.3),
            ],
        });
        out.push(text(Level::Warning, &one.names.rover, says));
    }

    /// What an agent recorded.
    fn agent(
        &mut self,
        (rover, is_system): (usize, bool),
        record: &Record<'_>,
        name: &str,
        out: &mut Vec<Drawing>,
    ) {
        let Some(kind) = record.kind else {
            return;
        };
        match kind.name() {
            "TimelineSays" if is_system => {
                if let Ok(says) = kind.schema().decode::<TimelineSays>(record.body)
                    && says.is_alarm()
                {
                    self.alarm(rover, &says.says, out);
                }
            }
            "GoalEnded" => {
                if let Ok(ended) = kind.schema().decode::<GoalEnded>(record.body) {
                    let goal = self.rovers[rover].book.ended(&ended, is_system);
                    self.settled(rover, goal, out);
                }
            }
            "GoalGivenUp" => {
                if let Ok(given_up) = kind.schema().decode::<GoalGivenUp>(record.body) {
                    let goal = self.rovers[rover].book.given_up(given_up.goal);
                    self.settled(rover, goal, out);
                }
            }
            "AgentFaulty" => {
                if let Ok(faulty) = kind.schema().decode::<AgentFaulty>(record.body) {
                    out.push(text(
                        Level::Error,
                        name,
                        &format!("is faulty: {}", faulty.reason),
                    ));
                }
            }
            "AgentRemark" => {
                if let Ok(remark) = kind.schema().decode::<AgentRemark>(record.body) {
                    out.push(text(Level::Info, name, &remark.text));
                }
            }
            _ => {}
        }
    }

    /// What happened to a rover's hardware.
    fn hardware(&mut self, rover: usize, record: &Record<'_>, out: &mut Vec<Drawing>) {
        let Some(kind) = record.kind else {
            return;
        };
        match (record.class, kind.name()) {
            (RecordClass::Sample, "RoverPose") => {
                if let Ok(pose) = kind.schema().decode(record.body) {
                    self.follow(rover, &pose, out);
                }
            }
            (RecordClass::Told, "FaultBegins") => {
                if let Ok(fault) = kind.schema().decode::<FaultBegins>(record.body) {
                    let message = format!("fault: {} {}", fault.kind.name(), fault.part);
                    let name = &self.rovers[rover].names.rover;
                    out.push(text(Level::Warning, name, message.trim_end()));
                }
            }
            (RecordClass::Delivered, "RoverCommand") => {
                if let Ok(told) = kind.schema().decode::<RoverCommand>(record.body)
                    && let Command::PanTilt { aim } = told.command
                    && let Aim::Angles { pan_rad, tilt_rad } = aim
                {
                    out.push(mast(&self.rovers[rover].names.rover, pan_rad, tilt_rad));
                }
            }
            _ => {}
        }
    }
}

/// The frame of a rover's mast.
fn mast_frame(rover: &str) -> String {
    format!("{rover}/mast")
}

/// Where a rover's mast is told to point \[rad\].
fn mast(rover: &str, pan_rad: f64, tilt_rad: f64) -> Drawing {
    Drawing::Transform {
        parent: base_link(rover),
        child: mast_frame(rover),
        pose: Pose::oriented(
            [0.25 * SCALE_M, 0.0, MAST_M],
            drawing::turned(pan_rad, tilt_rad, 0.0),
        ),
    }
}

/// The mast, and what its cameras see as a pyramid, in the mast's frame.
fn camera(rover: &str) -> Drawing {
    let [ahead, beside, above] = SEES_M;
    let corners = [
        [ahead, beside, above],
        [ahead, -beside, above],
        [ahead, -beside, -above],
        [ahead, beside, -above],
    ];
    let points_m = [[0.0; 3]].into_iter().chain(corners).collect();
    let form = Form::Lines {
        points_m,
        indices: vec![0, 1, 0, 2, 0, 3, 0, 4, 1, 2, 2, 3, 3, 4, 4, 1],
        thickness_m: 0.03,
    };
    Drawing::Entity {
        id: layered("cameras", rover),
        frame: mast_frame(rover),
        shapes: vec![shape(form, [0.0; 3], CAMERA)],
    }
}

impl Scene for IdeaScene {
    fn begin(&mut self, run: &RunInfo, out: &mut Vec<Drawing>) {
        for (number, entity) in run.entities.iter().enumerate() {
            if let Some(part) = self.part(&entity.name) {
                self.parts.insert(number, part);
            }
        }
        out.extend(drawing::net(self.field.terrain(), "field", 0.05));
        self.rocks(out);
        for (rover, one) in self.rovers.iter().enumerate() {
            let name = &one.names.rover;
            out.push(drawing::rover(name, SCALE_M));
            out.push(mast(name, 0.0, 0.0));
            out.push(camera(name));
            out.extend((0..one.book.goals().len()).map(|goal| self.goal(rover, goal)));
        }
    }

    fn record(&mut self, record: &Record<'_>, run: &RunInfo, out: &mut Vec<Drawing>) {
        let name = run.name(record.receiver);
        match record.class {
            RecordClass::Crash => out.push(text(Level::Warning, name, "crashed")),
            RecordClass::Restart => out.push(text(Level::Info, name, "restarted")),
            _ => {}
        }
        match self.parts.get(&record.receiver.index()).copied() {
            Some(Part::Agent { rover, is_system }) if record.class == RecordClass::Sample => {
                self.agent((rover, is_system), record, name, out);
            }
            Some(Part::Relay) if record.class == RecordClass::Sample => {
                let kind = record.kind.filter(|kind| kind.name() == "RelayStopped");
                let stopped = kind.map(|kind| kind.schema().decode::<RelayStopped>(record.body));
                if let Some(Ok(stopped)) = stopped {
                    let message = format!("the relay stops it: {}", stopped.reason);
                    out.push(text(Level::Warning, name, &message));
                }
            }
            Some(Part::Hardware(rover)) => self.hardware(rover, record, out),
            _ => {}
        }
    }
}
