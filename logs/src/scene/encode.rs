//! Drawings as messages of Foxglove's published schemas, whose field numbers these are.

use farside::scene::{Drawing, Form, Pose, Shape};

use crate::descriptors::SchemaOf;
use crate::wire::{put_bytes, put_number, put_text, put_varint};

/// A published schema.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Published {
    FrameTransforms,
    PosesInFrame,
    SceneUpdate,
    Log,
}

impl Published {
    pub(crate) fn schema(self) -> SchemaOf {
        let (name, data): (_, &[u8]) = match self {
            Published::FrameTransforms => (
                "FrameTransforms",
                include_bytes!("schemas/FrameTransforms.bin"),
            ),
            Published::PosesInFrame => ("PosesInFrame", include_bytes!("schemas/PosesInFrame.bin")),
            Published::SceneUpdate => ("SceneUpdate", include_bytes!("schemas/SceneUpdate.bin")),
            Published::Log => ("Log", include_bytes!("schemas/Log.bin")),
        };
        SchemaOf {
            name: format!("foxglove.{name}"),
            data: data.to_vec(),
        }
    }
}

/// A message of a viewer's topic.
pub(crate) struct Encoded {
    pub(crate) topic: String,
    pub(crate) schema: Published,
    pub(crate) body: Vec<u8>,
}

impl Encoded {
    /// The messages that draw all of this at one time: transforms first, because shapes are placed
    /// in frames.
    pub(crate) fn all(drawings: &[Drawing], time_ns: u64) -> Vec<Encoded> {
        let (mut tf, mut deleted, mut scene) = (Vec::new(), Vec::new(), Vec::new());
        let mut others = Vec::new();
        let stamp = stamp(time_ns);
        for drawing in drawings {
            match drawing {
                Drawing::Transform {
                    parent,
                    child,
                    pose,
                } => put_message(&mut tf, 1, |out| {
                    put_bytes(out, 1, &stamp);
                    put_text(out, 2, parent);
                    put_text(out, 3, child);
                    put_pose_at(out, 4, pose);
                }),
                Drawing::Entity { id, frame, shapes } => put_message(&mut scene, 2, |out| {
                    put_bytes(out, 1, &stamp);
                    put_text(out, 2, frame);
                    put_text(out, 3, id);
                    // Locked to its frame: it is sent once, and moves by its transform.
                    put_number(out, 5, 1);
                    put_shapes(out, shapes);
                }),
                // Type 0: the entity with this id.
                Drawing::Remove { id } => put_message(&mut deleted, 1, |out| {
                    put_bytes(out, 1, &stamp);
                    put_text(out, 3, id);
                }),
                Drawing::Poses {
                    topic,
                    frame,
                    poses,
                } => others.push(Encoded::poses(&stamp, topic, frame, poses)),
                Drawing::Text {
                    level,
                    name,
                    message,
                } => {
                    let mut body = Vec::new();
                    put_bytes(&mut body, 1, &stamp);
                    put_number(&mut body, 2, *level as u64);
                    put_text(&mut body, 3, message);
                    put_text(&mut body, 4, name);
                    others.push(Encoded::new("/log", Published::Log, body));
                }
            }
        }
        deleted.append(&mut scene);
        let tf = Encoded::new("/tf", Published::FrameTransforms, tf);
        let scene = Encoded::new("/scene", Published::SceneUpdate, deleted);
        let mut all: Vec<Encoded> = [tf, scene].into();
        all.retain(|message| !message.body.is_empty());
        all.append(&mut others);
        all
    }

    fn new(topic: &str, schema: Published, body: Vec<u8>) -> Encoded {
        Encoded {
            topic: topic.to_owned(),
            schema,
            body,
        }
    }

    fn poses(stamp: &[u8], topic: &str, frame: &str, poses: &[Pose]) -> Encoded {
        let mut body = Vec::new();
        put_bytes(&mut body, 1, stamp);
        put_text(&mut body, 2, frame);
        for pose in poses {
            put_message(&mut body, 3, |out| put_pose_at(out, 1, pose));
        }
        Encoded::new(topic, Published::PosesInFrame, body)
    }
}

/// A `google.protobuf.Timestamp`.
fn stamp(time_ns: u64) -> Vec<u8> {
    let mut out = Vec::new();
    put_number(&mut out, 1, time_ns / 1_000_000_000);
    put_number(&mut out, 2, time_ns % 1_000_000_000);
    out
}

fn put_message(out: &mut Vec<u8>, field: u32, write: impl FnOnce(&mut Vec<u8>)) {
    let mut body = Vec::new();
    write(&mut body);
    put_bytes(out, field, &body);
}

/// A double; zero is left out, as proto3 has it.
fn put_double(out: &mut Vec<u8>, field: u32, value: f64) {
    if value.to_bits() != 0 {
        put_varint(out, u64::from(field) << 3 | 1);
        out.extend_from_slice(&value.to_le_bytes());
    }
}

/// A vector, point, quaternion or colour: doubles from field 1 on.
fn put_doubles(out: &mut Vec<u8>, field: u32, values: &[f64]) {
    put_message(out, field, |out| {
        for (number, value) in (1..).zip(values) {
            put_double(out, number, *value);
        }
    });
}

/// Position and orientation, as the two fields from `field` on.
fn put_pose_at(out: &mut Vec<u8>, field: u32, pose: &Pose) {
    put_doubles(out, field, &pose.position_m);
    put_doubles(out, field + 1, &orientation(pose.heading));
}

/// The quaternion that turns east to `heading`, from the half-angle formulas: square roots are exact
/// on every platform, sines are not.
fn orientation([east, north]: [f64; 2]) -> [f64; 4] {
    let length = (east * east + north * north).sqrt();
    if !(length > 0.0 && length.is_finite()) {
        return [0.0, 0.0, 0.0, 1.0];
    }
    let cos = (east / length).clamp(-1.0, 1.0);
    let half_sin = ((1.0 - cos) / 2.0).sqrt();
    let half_cos = ((1.0 + cos) / 2.0).sqrt();
    [
        0.0,
        0.0,
        if north < 0.0 { -half_sin } else { half_sin },
        half_cos,
    ]
}

/// The shapes of an entity, each kind in its field.
fn put_shapes(out: &mut Vec<u8>, shapes: &[Shape]) {
    for shape in shapes {
        let pose = Pose::at(shape.position_m);
        let place = |out: &mut Vec<u8>, field| {
            put_message(out, field, |out| put_pose_at(out, 1, &pose));
        };
        match &shape.form {
            Form::Cube { size_m } => put_message(out, 8, |out| {
                place(out, 1);
                put_doubles(out, 2, size_m);
                put_doubles(out, 3, &shape.colour);
            }),
            Form::Sphere { diameter_m } => put_message(out, 9, |out| {
                place(out, 1);
                put_doubles(out, 2, &[*diameter_m; 3]);
                put_doubles(out, 3, &shape.colour);
            }),
            Form::Lines {
                points_m,
                indices,
                thickness_m,
            } => put_message(out, 11, |out| {
                // Type 2: a list of separate lines.
                put_number(out, 1, 2);
                place(out, 2);
                put_double(out, 3, *thickness_m);
                for point in points_m {
                    put_doubles(out, 5, point);
                }
                put_doubles(out, 6, &shape.colour);
                if !indices.is_empty() {
                    let packed: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
                    put_bytes(out, 8, &packed);
                }
            }),
            Form::Label { text, height_m } => put_message(out, 13, |out| {
                place(out, 1);
                put_number(out, 2, 1);
                put_double(out, 3, *height_m);
                put_doubles(out, 5, &shape.colour);
                put_text(out, 6, text);
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_become_turns_about_the_vertical() {
        let half = 0.5f64.sqrt();
        for (heading, turn) in [
            ([2.0, 0.0], [0.0, 1.0]),
            ([0.0, 3.0], [half, half]),
            ([0.0, -3.0], [-half, half]),
            ([-1.0, 0.0], [1.0, 0.0]),
            ([0.0, 0.0], [0.0, 1.0]),
            ([f64::NAN, 0.0], [0.0, 1.0]),
        ] {
            assert_eq!(orientation(heading)[2..], turn, "{heading:?}");
        }
    }
}
