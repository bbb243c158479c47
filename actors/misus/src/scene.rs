//! A team of MISUS as viewers draw it: ground, rocks in the colours of what the team's first rover
//! thinks they are, and rovers where they are and where they believe to be.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use farside::RunInfo;
use farside::record::{Record, RecordClass};
use farside::scene::{Drawing, Form, Level, Pose, Scene};
use farside_actors::drawing::{self, MAP, layered, poses, shape, text};
use farside_actors::rover::{FaultBegins, hardware_name};
use farside_worlds::RockField;

use crate::messages::FieldModel;

/// How large rovers are drawn \[m\].
const SCALE_M: f64 = 3.0;

/// The colours of learnt classes.
const CLASSES: [[f64; 4]; 8] = [
    [0.18, 0.43, 0.71, 1.0],
    [0.84, 0.37, 0.0, 1.0],
    [0.14, 0.54, 0.35, 1.0],
    [0.49, 0.36, 0.71, 1.0],
    [0.69, 0.52, 0.08, 1.0],
    [0.11, 0.56, 0.6, 1.0],
    [0.55, 0.4, 0.28, 1.0],
    [0.71, 0.4, 0.6, 1.0],
];

/// The colour of rocks of which nothing is known.
const UNKNOWN: [f64; 4] = [0.6, 0.6, 0.6, 0.6];

/// Draws a run.
pub(crate) struct MisusScene {
    field: Arc<RockField>,
    rovers: Vec<String>,
    /// What each rock was last drawn as: its class, and the confidence in tenths.
    drawn: Vec<Option<(u32, u8)>>,
    /// By the number of the actor in the run: the rover whose hardware it is.
    hardware: BTreeMap<usize, usize>,
    /// The number of the first scientist in the run.
    scientist: Option<usize>,
}

impl fmt::Debug for MisusScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MisusScene").finish_non_exhaustive()
    }
}

impl MisusScene {
    /// A field, and the rovers on it.
    pub(crate) fn new(field: Arc<RockField>, rovers: Vec<String>) -> MisusScene {
        MisusScene {
            drawn: vec![None; field.rocks().len()],
            field,
            rovers,
            hardware: BTreeMap::new(),
            scientist: None,
        }
    }

    fn rock(&self, rock: usize, colour: [f64; 4]) -> Drawing {
        let one = self.field.rocks()[rock];
        let (x, y) = (one.position_m.x, one.position_m.y);
        let form = Form::Sphere {
            diameter_m: one.diameter_m,
        };
        let place_m = [x, y, self.field.ground_m(x, y) + 0.25 * one.diameter_m];
        Drawing::Entity {
            id: layered("rocks", &format!("{rock}")),
            frame: MAP.to_owned(),
            shapes: vec![shape(form, place_m, colour)],
        }
    }

    /// Rocks whose class or confidence is another than when they were last drawn.
    fn learn(&mut self, model: &FieldModel, out: &mut Vec<Drawing>) {
        for (rock, label) in model.rocks.iter().enumerate() {
            let tenths = (10.0 * label.confidence) as u8;
            if self.drawn[rock] == Some((label.class, tenths)) {
                continue;
            }
            self.drawn[rock] = Some((label.class, tenths));
            let mut colour = CLASSES[label.class as usize % CLASSES.len()];
            colour[3] = f64::from(tenths.max(2)) / 10.0;
            out.push(self.rock(rock, colour));
        }
    }
}

impl Scene for MisusScene {
    fn begin(&mut self, run: &RunInfo, out: &mut Vec<Drawing>) {
        for (number, entity) in run.entities.iter().enumerate() {
            let is_hardware = |name: &String| hardware_name(name) == entity.name;
            if let Some(rover) = self.rovers.iter().position(is_hardware) {
                self.hardware.insert(number, rover);
            }
            if self.rovers.first() == Some(&entity.name) {
                self.scientist = Some(number);
            }
        }
        out.extend(drawing::net(self.field.terrain(), "field", 0.05));
        out.extend((0..self.field.rocks().len()).map(|rock| self.rock(rock, UNKNOWN)));
        let places = self.field.rocks().iter().map(|rock| {
            let (x, y) = (rock.position_m.x, rock.position_m.y);
            Pose::at([x, y, self.field.ground_m(x, y)])
        });
        out.push(poses("rocks", places.collect()));
        out.extend(self.rovers.iter().map(|name| drawing::rover(name, SCALE_M)));
    }

    fn record(&mut self, record: &Record<'_>, run: &RunInfo, out: &mut Vec<Drawing>) {
        let name = run.name(record.receiver);
        match record.class {
            RecordClass::Crash => out.push(text(Level::Warning, name, "crashed")),
            RecordClass::Restart => out.push(text(Level::Info, name, "restarted")),
            _ => {}
        }
        let Some(kind) = record.kind else {
            return;
        };
        let rover = self.hardware.get(&record.receiver.index()).copied();
        match (record.class, rover, kind.name()) {
            (RecordClass::Sample, Some(rover), "RoverPose") => {
                if let Ok(pose) = kind.schema().decode(record.body) {
                    out.extend(drawing::follow(&self.rovers[rover], &pose, SCALE_M));
                }
            }
            (RecordClass::Told, Some(_), "FaultBegins") => {
                if let Ok(fault) = kind.schema().decode::<FaultBegins>(record.body) {
                    let message = format!("fault: {}", fault.kind.name());
                    out.push(text(Level::Warning, name, &message));
                }
            }
            (RecordClass::Sample, None, "FieldModel")
                if self.scientist == Some(record.receiver.index()) =>
            {
                if let Ok(model) = kind.schema().decode(record.body) {
                    self.learn(&model, out);
                }
            }
            _ => {}
        }
    }
}
