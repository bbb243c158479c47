//! Drawings as messages of Foxglove's published schemas: the fields of them that are ever filled.

use std::collections::BTreeMap;

use prost::Message;
use prost::encoding::{WireType, encode_key, encode_varint};
use prost_types::Timestamp;

use crate::descriptors::SchemaOf;
use farside::scene::{self, Drawing, Facing, Form, Shape};

/// A published schema.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Published {
    FrameTransforms,
    PosesInFrame,
    SceneUpdate,
    Log,
}

impl Published {
    pub(super) fn schema(self) -> SchemaOf {
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
pub(super) struct Encoded {
    pub(super) topic: String,
    pub(super) schema: Published,
    pub(super) body: Vec<u8>,
}

/// What is drawn now, by layer: a viewer that jumps to a time is shown each topic's last message
/// before it, and no other, so each message has the whole layer.
#[derive(Debug, Default)]
pub(super) struct Layers {
    layers: BTreeMap<String, Layer>,
}

#[derive(Debug, Default)]
struct Layer {
    /// Each entity as its bytes, by its id.
    entities: BTreeMap<String, Vec<u8>>,
    /// Gone since the last message.
    deletions: Vec<SceneEntityDeletion>,
    /// Whether it is another than the last message told.
    changed: bool,
}

impl Layers {
    /// The layer of an entity, which its id names.
    fn of(&mut self, id: &str) -> &mut Layer {
        let name = id.rsplit_once('/').map_or("", |(layer, _)| layer);
        if !self.layers.contains_key(name) {
            self.layers.insert(name.to_owned(), Layer::default());
        }
        let layer = self.layers.get_mut(name).expect("it is there by now");
        layer.changed = true;
        layer
    }

    /// A message for each layer that changed.
    fn told(&mut self) -> impl Iterator<Item = Encoded> {
        let changed = self.layers.iter_mut().filter(|(_, layer)| layer.changed);
        changed.map(|(name, layer)| {
            layer.changed = false;
            let deletions = std::mem::take(&mut layer.deletions);
            let update = SceneUpdate {
                deletions,
                entities: Vec::new(),
            };
            let mut body = update.encode_to_vec();
            for entity in layer.entities.values() {
                encode_key(ENTITIES, WireType::LengthDelimited, &mut body);
                encode_varint(entity.len() as u64, &mut body);
                body.extend_from_slice(entity);
            }
            Encoded {
                topic: if name.is_empty() {
                    "/scene".to_owned()
                } else {
                    format!("/scene/{name}")
                },
                schema: Published::SceneUpdate,
                body,
            }
        })
    }

    /// The messages that draw all of this at one time: transforms first, because shapes are placed
    /// in frames.
    pub(super) fn draw(&mut self, drawings: &[Drawing], time_ns: u64) -> Vec<Encoded> {
        let mut tf = FrameTransforms::default();
        let mut others = Vec::new();
        let timestamp = Some(stamp(time_ns));
        for drawing in drawings {
            match drawing {
                Drawing::Transform {
                    parent,
                    child,
                    pose,
                } => tf.transforms.push(FrameTransform {
                    timestamp,
                    parent_frame_id: parent.clone(),
                    child_frame_id: child.clone(),
                    translation: Some(pose.position_m.into()),
                    rotation: Some(pose.facing.into()),
                }),
                Drawing::Entity { id, frame, shapes } => {
                    let mut entity = SceneEntity::of(shapes);
                    entity.timestamp = timestamp;
                    entity.frame_id.clone_from(frame);
                    entity.id.clone_from(id);
                    let layer = self.of(id);
                    layer.entities.insert(id.clone(), entity.encode_to_vec());
                }
                Drawing::Remove { id } => {
                    let layer = self.of(id);
                    layer.entities.remove(id);
                    layer.deletions.push(SceneEntityDeletion {
                        timestamp,
                        id: id.clone(),
                    });
                }
                Drawing::Poses {
                    topic,
                    frame,
                    poses,
                } => {
                    let poses = PosesInFrame {
                        timestamp,
                        frame_id: frame.clone(),
                        poses: poses.iter().map(Pose::from).collect(),
                    };
                    others.push(Encoded::new(topic, Published::PosesInFrame, &poses));
                }
                Drawing::Text {
                    level,
                    name,
                    message,
                } => {
                    let line = Log {
                        timestamp,
                        level: *level as i32,
                        // Viewers that know no name, as Rerun, show the text alone.
                        message: format!("{name}: {message}"),
                        name: name.clone(),
                    };
                    others.push(Encoded::new("/log", Published::Log, &line));
                }
            }
        }
        let tf = Encoded::new("/tf", Published::FrameTransforms, &tf);
        let mut all: Vec<Encoded> = [tf].into();
        all.retain(|message| !message.body.is_empty());
        all.extend(self.told());
        all.append(&mut others);
        all
    }
}

impl Encoded {
    fn new(topic: &str, schema: Published, message: &impl Message) -> Encoded {
        Encoded {
            topic: topic.to_owned(),
            schema,
            body: message.encode_to_vec(),
        }
    }
}

fn stamp(time_ns: u64) -> Timestamp {
    // Seconds of 64 bits of nanoseconds have 35 bits, the rest 30.
    Timestamp {
        seconds: (time_ns / 1_000_000_000) as i64,
        nanos: (time_ns % 1_000_000_000) as i32,
    }
}

impl From<Facing> for Quaternion {
    fn from(facing: Facing) -> Quaternion {
        match facing {
            Facing::Heading(heading) => orientation(heading),
            Facing::Orientation(turn) => unit(turn),
        }
    }
}

/// The quaternion at length 1; no turn, if it has no length.
fn unit(turn: [f64; 4]) -> Quaternion {
    // Divided by the largest part first, so that squares neither overflow nor vanish.
    let largest = turn
        .iter()
        .fold(0.0, |largest: f64, part| largest.max(part.abs()));
    let scaled = turn.map(|part| part / largest);
    let length = scaled.iter().map(|part| part * part).sum::<f64>().sqrt();
    if !(length.is_finite() && largest > 0.0) {
        return orientation([1.0, 0.0]);
    }
    let squares: f64 = turn.iter().map(|part| part * part).sum();
    // What has length 1 but for rounding is written as it is.
    let [x, y, z, w] = match (squares - 1.0).abs() < 1e-9 {
        true => turn,
        false => scaled.map(|part| part / length),
    };
    Quaternion { x, y, z, w }
}

/// The quaternion that turns east to `heading`, from the half-angle formulas: square roots are
/// exact on every platform, sines are not.
fn orientation([east, north]: [f64; 2]) -> Quaternion {
    let length = (east * east + north * north).sqrt();
    let (z, w) = if length > 0.0 && length.is_finite() {
        let cos = (east / length).clamp(-1.0, 1.0);
        let half_sin = ((1.0 - cos) / 2.0).sqrt();
        let half_cos = ((1.0 + cos) / 2.0).sqrt();
        (if north < 0.0 { -half_sin } else { half_sin }, half_cos)
    } else {
        (0.0, 1.0)
    };
    Quaternion {
        x: 0.0,
        y: 0.0,
        z,
        w,
    }
}

impl SceneEntity {
    /// The shapes, each kind in its field. Locked to its frame: it is sent once, and moves by its
    /// transform.
    fn of(shapes: &[Shape]) -> SceneEntity {
        let mut entity = SceneEntity {
            frame_locked: true,
            ..SceneEntity::default()
        };
        for shape in shapes {
            let pose = Some(Pose::from(&scene::Pose::at(shape.position_m)));
            let color = Some(Color::from(shape.colour));
            match &shape.form {
                Form::Cube { size_m } => entity.cubes.push(Solid {
                    pose,
                    size: Some((*size_m).into()),
                    color,
                }),
                Form::Sphere { diameter_m } => entity.spheres.push(Solid {
                    pose,
                    size: Some([*diameter_m; 3].into()),
                    color,
                }),
                Form::Lines {
                    points_m,
                    indices,
                    thickness_m,
                } => entity.lines.push(LinePrimitive {
                    kind: LINE_LIST,
                    pose,
                    thickness: *thickness_m,
                    points: points_m.iter().map(|point| (*point).into()).collect(),
                    color,
                    indices: indices.clone(),
                }),
                Form::Label { text, height_m } => entity.texts.push(TextPrimitive {
                    pose,
                    billboard: true,
                    font_size: *height_m,
                    color,
                    text: text.clone(),
                }),
            }
        }
        entity
    }
}

impl From<&scene::Pose> for Pose {
    fn from(pose: &scene::Pose) -> Pose {
        Pose {
            position: Some(pose.position_m.into()),
            orientation: Some(pose.facing.into()),
        }
    }
}

impl From<[f64; 3]> for Vector3 {
    fn from([x, y, z]: [f64; 3]) -> Vector3 {
        Vector3 { x, y, z }
    }
}

impl From<[f64; 4]> for Color {
    fn from([r, g, b, a]: [f64; 4]) -> Color {
        Color { r, g, b, a }
    }
}

/// `foxglove.LinePrimitive.Type`: separate lines.
const LINE_LIST: i32 = 2;

#[derive(Clone, PartialEq, Message)]
struct FrameTransforms {
    #[prost(message, repeated, tag = "1")]
    transforms: Vec<FrameTransform>,
}

#[derive(Clone, PartialEq, Message)]
struct FrameTransform {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    parent_frame_id: String,
    #[prost(string, tag = "3")]
    child_frame_id: String,
    #[prost(message, optional, tag = "4")]
    translation: Option<Vector3>,
    #[prost(message, optional, tag = "5")]
    rotation: Option<Quaternion>,
}

#[derive(Clone, PartialEq, Message)]
struct PosesInFrame {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    frame_id: String,
    #[prost(message, repeated, tag = "3")]
    poses: Vec<Pose>,
}

#[derive(Clone, PartialEq, Message)]
struct Log {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<Timestamp>,
    #[prost(int32, tag = "2")]
    level: i32,
    #[prost(string, tag = "3")]
    message: String,
    #[prost(string, tag = "4")]
    name: String,
}

/// The field of `foxglove.SceneUpdate` that has the entities.
const ENTITIES: u32 = 2;

#[derive(Clone, PartialEq, Message)]
struct SceneUpdate {
    #[prost(message, repeated, tag = "1")]
    deletions: Vec<SceneEntityDeletion>,
    #[prost(message, repeated, tag = "2")]
    entities: Vec<SceneEntity>,
}

/// Its type, which is left out, is 0: the entity with this id.
#[derive(Clone, PartialEq, Message)]
struct SceneEntityDeletion {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<Timestamp>,
    #[prost(string, tag = "3")]
    id: String,
}

#[derive(Clone, PartialEq, Message)]
struct SceneEntity {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    frame_id: String,
    #[prost(string, tag = "3")]
    id: String,
    #[prost(bool, tag = "5")]
    frame_locked: bool,
    #[prost(message, repeated, tag = "8")]
    cubes: Vec<Solid>,
    #[prost(message, repeated, tag = "9")]
    spheres: Vec<Solid>,
    #[prost(message, repeated, tag = "11")]
    lines: Vec<LinePrimitive>,
    #[prost(message, repeated, tag = "13")]
    texts: Vec<TextPrimitive>,
}

/// `CubePrimitive` and `SpherePrimitive`, which have the same fields.
#[derive(Clone, PartialEq, Message)]
struct Solid {
    #[prost(message, optional, tag = "1")]
    pose: Option<Pose>,
    #[prost(message, optional, tag = "2")]
    size: Option<Vector3>,
    #[prost(message, optional, tag = "3")]
    color: Option<Color>,
}

#[derive(Clone, PartialEq, Message)]
struct LinePrimitive {
    #[prost(int32, tag = "1")]
    kind: i32,
    #[prost(message, optional, tag = "2")]
    pose: Option<Pose>,
    #[prost(double, tag = "3")]
    thickness: f64,
    #[prost(message, repeated, tag = "5")]
    points: Vec<Vector3>,
    #[prost(message, optional, tag = "6")]
    color: Option<Color>,
    #[prost(fixed32, repeated, tag = "8")]
    indices: Vec<u32>,
}

#[derive(Clone, PartialEq, Message)]
struct TextPrimitive {
    #[prost(message, optional, tag = "1")]
    pose: Option<Pose>,
    #[prost(bool, tag = "2")]
    billboard: bool,
    #[prost(double, tag = "3")]
    font_size: f64,
    #[prost(message, optional, tag = "5")]
    color: Option<Color>,
    #[prost(string, tag = "6")]
    text: String,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct Pose {
    #[prost(message, optional, tag = "1")]
    position: Option<Vector3>,
    #[prost(message, optional, tag = "2")]
    orientation: Option<Quaternion>,
}

/// `Vector3` and `Point3`.
#[derive(Clone, Copy, PartialEq, Message)]
struct Vector3 {
    #[prost(double, tag = "1")]
    x: f64,
    #[prost(double, tag = "2")]
    y: f64,
    #[prost(double, tag = "3")]
    z: f64,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct Quaternion {
    #[prost(double, tag = "1")]
    x: f64,
    #[prost(double, tag = "2")]
    y: f64,
    #[prost(double, tag = "3")]
    z: f64,
    #[prost(double, tag = "4")]
    w: f64,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct Color {
    #[prost(double, tag = "1")]
    r: f64,
    #[prost(double, tag = "2")]
    g: f64,
    #[prost(double, tag = "3")]
    b: f64,
    #[prost(double, tag = "4")]
    a: f64,
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// A viewer that jumps to a time is shown the last message of each topic before it.
    #[test]
    fn the_last_message_of_a_layer_has_all_of_it() {
        let entity = |id: &str, height_m: f64| Drawing::Entity {
            id: id.to_owned(),
            frame: "map".to_owned(),
            shapes: vec![Shape {
                form: Form::Cube {
                    size_m: [1.0, 1.0, height_m],
                },
                position_m: [0.0; 3],
                colour: [1.0; 4],
            }],
        };
        let gone = |id: &str| Drawing::Remove { id: id.to_owned() };
        let steps = [
            vec![entity("mast", 1.0), entity("rovers/a", 1.0)],
            vec![entity("rovers/b", 1.0)],
            vec![entity("rovers/a", 2.0), gone("mast")],
            vec![gone("rovers/a"), entity("deep/er/c", 1.0)],
        ];
        let mut layers = Layers::default();
        let mut last = BTreeMap::new();
        let shown: Vec<String> = (0..)
            .zip(&steps)
            .map(|(time_ns, step)| {
                for message in layers.draw(step, time_ns) {
                    assert_eq!(message.schema, Published::SceneUpdate);
                    let update = SceneUpdate::decode(&*message.body).unwrap();
                    last.insert(message.topic, update);
                }
                let one = |(topic, update): (&String, &SceneUpdate)| {
                    let height = |entity: &SceneEntity| entity.cubes[0].size.unwrap().z;
                    let all = update
                        .entities
                        .iter()
                        .map(|one| format!("{} {}", one.id, height(one)));
                    let all: Vec<String> = all.collect();
                    let gone: Vec<&str> = update.deletions.iter().map(|one| &*one.id).collect();
                    format!("{topic}: {} - {}", all.join(", "), gone.join(", "))
                };
                last.iter().map(one).collect::<Vec<_>>().join("; ")
            })
            .collect();
        assert_eq!(
            shown,
            [
                "/scene: mast 1 - ; /scene/rovers: rovers/a 1 - ",
                "/scene: mast 1 - ; /scene/rovers: rovers/a 1, rovers/b 1 - ",
                "/scene:  - mast; /scene/rovers: rovers/a 2, rovers/b 1 - ",
                "/scene:  - mast; /scene/deep/er: deep/er/c 1 - ; /scene/rovers: rovers/b 1 - rovers/a",
            ]
        );
        assert!(layers.draw(&[], 9).is_empty());
    }

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
            let found = orientation(heading);
            assert_eq!([found.z, found.w], turn, "{heading:?}");
        }
    }

    #[test]
    fn a_heading_is_written_as_it_was_before_there_were_orientations() {
        // By protobuf's encoding: two messages of three and of two doubles, zeros left out.
        let double = |field: u8, value: f64| [&[field << 3 | 1][..], &value.to_le_bytes()].concat();
        let inner =
            |field: u8, bytes: Vec<u8>| [&[field << 3 | 2, bytes.len() as u8][..], &bytes].concat();
        let half = 0.5f64.sqrt();
        let place = [double(1, 3.0), double(2, 4.0), double(3, 0.5)].concat();
        let turn = [double(3, -half), double(4, half)].concat();
        let south = scene::Pose::heading([3.0, 4.0, 0.5], [0.0, -1.0]);
        let found = Pose::from(&south).encode_to_vec();
        assert_eq!(found, [inner(1, place), inner(2, turn)].concat());
    }

    #[test]
    fn orientations_are_written_at_length_one() {
        let half = 0.5f64.sqrt();
        let none = [0.0, 0.0, 0.0, 1.0];
        for (turn, expected) in [
            ([0.0, -half, 0.0, half], [0.0, -half, 0.0, half]),
            ([0.5, 0.5, -0.5, 0.5], [0.5, 0.5, -0.5, 0.5]),
            ([0.0, 3.0, 0.0, 4.0], [0.0, 0.6, 0.0, 0.8]),
            ([1e300, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]),
            ([0.0, 0.0, 1e-300, 0.0], [0.0, 0.0, 1.0, 0.0]),
            ([0.0; 4], none),
            ([f64::NAN, 0.0, 0.0, 1.0], none),
            ([f64::INFINITY, 0.0, 0.0, 1.0], none),
        ] {
            let found = Quaternion::from(Facing::Orientation(turn));
            let found = [found.x, found.y, found.z, found.w];
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-15, "{turn:?}: {found}");
            }
        }
    }

    /// Every form and drawing, decoded by the published schemas: every field that is filled is one
    /// that they have, under the number and type that they give it.
    #[test]
    fn the_published_schemas_know_every_field() {
        let form = |form| Shape {
            form,
            position_m: [1.0, 2.0, 3.0],
            colour: [0.1, 0.2, 0.3, 0.4],
        };
        let shapes = vec![
            form(Form::Cube { size_m: [4.0; 3] }),
            form(Form::Sphere { diameter_m: 5.0 }),
            form(Form::Label {
                text: "six".to_owned(),
                height_m: 6.0,
            }),
            form(Form::Lines {
                points_m: vec![[7.0; 3]; 2],
                indices: vec![0, 1, 1, 0],
                thickness_m: 8.0,
            }),
        ];
        let pose = scene::Pose::heading([9.0; 3], [0.0, -1.0]);
        let text = |text: &str| text.to_owned();
        let drawings = [
            Drawing::Entity {
                id: text("id"),
                frame: text("map"),
                shapes,
            },
            Drawing::Remove { id: text("old") },
            Drawing::Transform {
                parent: text("map"),
                child: text("rover"),
                pose,
            },
            Drawing::Poses {
                topic: text("/poses/rover"),
                frame: text("map"),
                poses: vec![pose],
            },
            Drawing::Text {
                level: scene::Level::Error,
                name: text("monitor"),
                message: text("hit"),
            },
        ];
        let all = Layers::default().draw(&drawings, 1_500_000_000);
        let topics: Vec<&str> = all.iter().map(|encoded| &*encoded.topic).collect();
        assert_eq!(topics, ["/tf", "/scene", "/poses/rover", "/log"]);
        let time = "1970-01-01T00:00:01.500Z";
        let half = 0.5f64.sqrt();
        let (place, turn) = (
            json!({"x": 9.0, "y": 9.0, "z": 9.0}),
            json!({"z": -half, "w": half}),
        );
        let (same, colour) = (
            |v: f64| json!({"x": v, "y": v, "z": v}),
            json!({"r": 0.1, "g": 0.2, "b": 0.3, "a": 0.4}),
        );
        let at = json!({"position": {"x": 1.0, "y": 2.0, "z": 3.0}, "orientation": {"w": 1.0}});
        let solid = |size: f64| json!([{"pose": at, "size": same(size), "color": colour}]);
        let expected = [
            json!({"transforms": [{"timestamp": time, "parentFrameId": "map",
                "childFrameId": "rover", "translation": place, "rotation": turn}]}),
            json!({
                "deletions": [{"timestamp": time, "id": "old"}],
                "entities": [{"timestamp": time, "frameId": "map", "id": "id", "frameLocked": true,
                    "cubes": solid(4.0), "spheres": solid(5.0),
                    "lines": [{"type": "LINE_LIST", "pose": at, "thickness": 8.0,
                        "points": [same(7.0), same(7.0)], "color": colour,
                        "indices": [0, 1, 1, 0]}],
                    "texts": [{"pose": at, "billboard": true, "fontSize": 6.0, "color": colour,
                        "text": "six"}]}],
            }),
            json!({"timestamp": time, "frameId": "map",
                "poses": [{"position": place, "orientation": turn}]}),
            json!({"timestamp": time, "level": "ERROR", "message": "monitor: hit",
                "name": "monitor"}),
        ];
        for (encoded, expected) in all.iter().zip(expected) {
            assert_eq!(decoded(encoded), expected, "{}", encoded.topic);
        }
    }

    /// The message in protobuf's JSON, by its published schema alone.
    fn decoded(encoded: &Encoded) -> serde_json::Value {
        let schema = encoded.schema.schema();
        let pool = prost_reflect::DescriptorPool::decode(schema.data.as_slice()).unwrap();
        let descriptor = pool.get_message_by_name(&schema.name).unwrap();
        let message = prost_reflect::DynamicMessage::decode(descriptor, encoded.body.as_slice());
        serde_json::to_value(message.unwrap()).unwrap()
    }
}
