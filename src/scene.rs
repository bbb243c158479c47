//! What viewers draw of a run: transforms, poses, shapes and log text, told by whoever knows what
//! the records mean.
//!
//! What this is not: a part of the record. It is derived, is never compared, and may be left out;
//! what happened is in the messages. It knows frames, shapes and colours, and no robots.

use std::fmt::Debug;

use crate::record::Record;
use crate::topology::RunInfo;

/// Draws a run: for each committed record, what changes in the picture.
///
/// The log writer of `farside-logs` asks it as it writes, and puts what it draws between the
/// records in order of time, in Foxglove's published schemas. It is shown records of excluded
/// topics too, state samples among them, but not what is under way at the end.
///
/// ```
/// use farside::RunInfo;
/// use farside::record::{Record, RecordClass};
/// use farside::scene::{Drawing, Level, Scene};
///
/// #[derive(Debug)]
/// struct Crashes;
///
/// impl Scene for Crashes {
///     fn record(&mut self, record: &Record<'_>, run: &RunInfo, out: &mut Vec<Drawing>) {
///         if record.class == RecordClass::Crash {
///             out.push(Drawing::Text {
///                 level: Level::Warning,
///                 name: run.name(record.receiver).to_owned(),
///                 message: "crashed".to_owned(),
///             });
///         }
///     }
/// }
/// ```
pub trait Scene: Debug + Send {
    /// What there is before anything happens: maps, masts, names.
    fn begin(&mut self, _run: &RunInfo, _out: &mut Vec<Drawing>) {}

    /// A record was committed: what changes, pushed to `out`, which is empty.
    fn record(&mut self, record: &Record<'_>, run: &RunInfo, out: &mut Vec<Drawing>);
}

/// One thing to draw, from now on. What is drawn at one time goes into as few messages as can be.
#[derive(Clone, Debug, PartialEq)]
pub enum Drawing {
    /// Where the frame `child` is in the frame `parent`: `foxglove.FrameTransforms` on `/tf`.
    Transform {
        /// The frame that it is told in.
        parent: String,
        /// The frame that is placed: `rover_01/base_link`.
        child: String,
        /// Where, and which way it faces.
        pose: Pose,
    },
    /// Where things are, in place of what the topic said before; none, if they are gone:
    /// `foxglove.PosesInFrame`, for viewers that draw no entities.
    Poses {
        /// The topic: `/poses/rover_01`.
        topic: String,
        /// The frame that they are told in.
        frame: String,
        /// The poses.
        poses: Vec<Pose>,
    },
    /// A thing with shapes, in place of what had its `id`: `foxglove.SceneUpdate` on the topic of
    /// its layer. Each message has all that is on its layer then, so that viewers that jump to a
    /// time see all of it.
    Entity {
        /// What it is called as long as it is there. What stands before the last `/` is its layer,
        /// which viewers show or hide: `rovers/rover_01` is drawn on `/scene/rovers`, `mast` on
        /// `/scene`.
        id: String,
        /// The frame that its shapes are placed in; if that moves, they move with it.
        frame: String,
        /// What it looks like.
        shapes: Vec<Shape>,
    },
    /// The entity is gone: a deletion on the topic of its layer.
    Remove {
        /// Which.
        id: String,
    },
    /// A line of log text: `foxglove.Log` on `/log`.
    Text {
        /// How bad it is.
        level: Level,
        /// Who says it, or whom it is about.
        name: String,
        /// The text; viewers are told it with the name before it.
        message: String,
    },
}

/// A place, and which way something faces there, both in a frame with x east, y north and z up.
///
/// ```
/// use farside::scene::{Facing, Pose};
/// let pose = Pose::at([3.0, 4.0, 0.5]);
/// assert_eq!(pose.facing, Facing::Heading([1.0, 0.0]));
/// // Nose up by 90 degrees: a turn about the axis y, against the right hand.
/// let half = 0.5f64.sqrt();
/// let pose = Pose::oriented([3.0, 4.0, 0.5], [0.0, -half, 0.0, half]);
/// assert_ne!(pose.facing, Facing::Heading([1.0, 0.0]));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Where \[m\].
    pub position_m: [f64; 3],
    /// Which way it faces.
    pub facing: Facing,
}

/// Which way something faces: in the plane, or in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Facing {
    /// Upright, in this direction: east and north. Only the direction counts; none is east. A
    /// vector and not an angle, because angles differ by platform in their last digit, and logs
    /// must not.
    Heading([f64; 2]),
    /// Turned by this unit quaternion, x, y, z, w: what is ahead of the thing (its x), to its left
    /// (y) and above it (z), turned by it, is where that is in the frame that the pose is told in.
    /// Another length than 1 is made 1; without a length, as with no number, it is not turned.
    Orientation([f64; 4]),
}

impl Pose {
    /// At a place, facing east.
    pub fn at(position_m: [f64; 3]) -> Pose {
        Pose {
            position_m,
            facing: Facing::Heading([1.0, 0.0]),
        }
    }

    /// At a place, upright, facing in a direction: east and north.
    pub fn heading(position_m: [f64; 3], heading: [f64; 2]) -> Pose {
        Pose {
            position_m,
            facing: Facing::Heading(heading),
        }
    }

    /// At a place, turned by a unit quaternion, x, y, z, w.
    pub fn oriented(position_m: [f64; 3], orientation: [f64; 4]) -> Pose {
        Pose {
            position_m,
            facing: Facing::Orientation(orientation),
        }
    }
}

/// A part of an entity.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// What it is.
    pub form: Form,
    /// Its centre in the entity's frame \[m\].
    pub position_m: [f64; 3],
    /// Red, green, blue and opacity, each from 0 to 1.
    pub colour: [f64; 4],
}

/// What a shape is.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    /// Lines between the first and the second point, the third and the fourth, and so on; or with
    /// indices, between the points that the first and the second index say, and so on.
    Lines {
        /// The ends, relative to the shape's place \[m\].
        points_m: Vec<[f64; 3]>,
        /// Numbers of points, from 0: where many lines meet in few points, less to write. Empty:
        /// the points in their order.
        indices: Vec<u32>,
        /// How thick \[m\].
        thickness_m: f64,
    },
    /// A box with edges along the frame's axes.
    Cube {
        /// Its edges \[m\].
        size_m: [f64; 3],
    },
    /// A ball.
    Sphere {
        /// How wide \[m\].
        diameter_m: f64,
    },
    /// Text that faces who looks at it.
    Label {
        /// The text.
        text: String,
        /// How high a line is \[m\].
        height_m: f64,
    },
}

/// How bad a line of log text is, as `foxglove.Log` numbers it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Level {
    /// As planned.
    Info = 2,
    /// To be looked at.
    Warning = 3,
    /// Must not happen.
    Error = 4,
}
