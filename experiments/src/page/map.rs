//! What there is to draw a map of: frames that move and entities with shapes, from messages in Foxglove's schemas
//! and the transforms, odometry and poses of ROS, seen from above.
//!
//! Places are in metres, x to the right and y up, rounded to centimetres; angles in thousandths of a radian.

use std::collections::BTreeMap;

use farside_logs::Value;
use serde_json::{Value as Json, json};

/// As many places as are kept of a frame; of more, every second one is dropped.
const PLACES: usize = 8_192;

/// As many bytes of shapes as a page holds.
const SHAPE_BYTES: usize = 12 << 20;

/// A frame in its parent.
#[derive(Debug, Default)]
struct Frame {
    parent: String,
    /// Time in microseconds, x and y in centimetres, and angle.
    places: Vec<[i64; 4]>,
    /// It is where something is, of which nothing else is drawn.
    is_thing: bool,
    /// One in so many places is kept.
    stride: u32,
    seen: u32,
}

/// An entity: from when on it has which shapes; none once it is gone.
#[derive(Debug, Default)]
struct Entity {
    versions: Vec<(u64, Option<usize>)>,
}

impl Entity {
    /// Has these shapes from a time on.
    fn change(&mut self, at_us: u64, shape: Option<usize>) {
        // Of all that was before the time that the page shows, the last.
        if at_us == 0 {
            self.versions.clear();
        }
        self.versions.push((at_us, shape));
    }
}

/// The map of a log.
#[derive(Debug, Default)]
pub(super) struct Map {
    frames: BTreeMap<String, Frame>,
    entities: BTreeMap<String, Entity>,
    /// Shapes as JSON, each once.
    known: BTreeMap<String, usize>,
    shapes: Vec<Json>,
    shape_bytes: usize,
    left_out: u64,
    thinned: bool,
}

/// Which messages a map is made of, by the name of their schema.
pub(super) fn is_drawn(schema: &str) -> bool {
    matches!(
        schema,
        "foxglove.SceneUpdate"
            | "foxglove.FrameTransforms"
            | "foxglove.FrameTransform"
            | "foxglove.PoseInFrame"
            | "tf2_msgs/msg/TFMessage"
            | "tf2_msgs/TFMessage"
            | "nav_msgs/msg/Odometry"
            | "nav_msgs/Odometry"
            | "geometry_msgs/msg/PoseStamped"
            | "geometry_msgs/PoseStamped"
    )
}

fn centimetres(metres: f64) -> i64 {
    libm::round(metres * 100.0).clamp(-1e12, 1e12) as i64
}

fn number(value: &Value<'_>, path: &str) -> f64 {
    value
        .at(path)
        .and_then(|found| found.as_f64())
        .filter(|number| number.is_finite())
        .unwrap_or(0.0)
}

fn text(value: &Value<'_>, path: &str) -> String {
    match value.at(path) {
        Some(Value::Text(text)) => text.into_owned(),
        _ => String::new(),
    }
}

fn elements<'v, 'a>(value: &'v Value<'a>, field: &str) -> &'v [Value<'a>] {
    match value.field(field) {
        Some(Value::List(values)) => values,
        _ => &[],
    }
}

/// How far a quaternion at this path turns about z, in thousandths of a radian.
fn turn(value: &Value<'_>, path: &str) -> i64 {
    let part = |name: &str| number(value, &format!("{path}.{name}"));
    let (x, y, z, w) = (part("x"), part("y"), part("z"), part("w"));
    let angle = libm::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z));
    libm::round(angle * 1_000.0) as i64
}

/// Place and turn at these paths.
fn place(value: &Value<'_>, position: &str, orientation: &str) -> [i64; 3] {
    let at = |name: &str| centimetres(number(value, &format!("{position}.{name}")));
    [at("x"), at("y"), turn(value, orientation)]
}

/// Red, green, blue from 0 to 255, and opacity from 0 to 100.
fn colour(value: &Value<'_>) -> Json {
    let part = |name: &str, most: f64| {
        libm::round(number(value, &format!("color.{name}")).clamp(0.0, 1.0) * most) as u8
    };
    json!([
        part("r", 255.0),
        part("g", 255.0),
        part("b", 255.0),
        part("a", 100.0)
    ])
}

impl Map {
    /// Adds what a message draws.
    pub(super) fn add(&mut self, schema: &str, topic: &str, value: &Value<'_>, at_ns: u64) {
        match schema {
            "foxglove.SceneUpdate" => self.scene(topic, value, at_ns),
            "foxglove.FrameTransforms" => {
                for transform in elements(value, "transforms") {
                    self.transform(transform, at_ns);
                }
            }
            "foxglove.FrameTransform" => self.transform(value, at_ns),
            "tf2_msgs/msg/TFMessage" | "tf2_msgs/TFMessage" => {
                for one in elements(value, "transforms") {
                    let (parent, child) =
                        (text(one, "header.frame_id"), text(one, "child_frame_id"));
                    let at = place(one, "transform.translation", "transform.rotation");
                    self.moved(&child, parent, at, at_ns, false);
                }
            }
            "nav_msgs/msg/Odometry" | "nav_msgs/Odometry" => {
                let at = place(value, "pose.pose.position", "pose.pose.orientation");
                self.moved(topic, text(value, "header.frame_id"), at, at_ns, true);
            }
            "geometry_msgs/msg/PoseStamped"
            | "geometry_msgs/PoseStamped"
            | "foxglove.PoseInFrame" => {
                let frame = ["header.frame_id", "frame_id"].map(|path| text(value, path));
                let at = place(value, "pose.position", "pose.orientation");
                self.moved(topic, frame.concat(), at, at_ns, true);
            }
            _ => {}
        }
    }

    fn transform(&mut self, transform: &Value<'_>, at_ns: u64) {
        let (parent, child) = (
            text(transform, "parent_frame_id"),
            text(transform, "child_frame_id"),
        );
        let at = place(transform, "translation", "rotation");
        self.moved(&child, parent, at, at_ns, false);
    }

    fn moved(&mut self, child: &str, parent: String, at: [i64; 3], at_ns: u64, is_thing: bool) {
        let frame = self.frames.entry(child.to_owned()).or_default();
        frame.parent = parent;
        frame.is_thing = is_thing;
        frame.stride = frame.stride.max(1);
        frame.seen += 1;
        let last = frame.places.last().map(|[_, at @ ..]| *at);
        if last == Some(at) || !frame.seen.is_multiple_of(frame.stride) {
            return;
        }
        let [x, y, turn] = at;
        let at_us = (at_ns / 1_000) as i64;
        // Of all that was before the time that the page shows, the last.
        if at_us == 0 {
            frame.places.clear();
        }
        frame.places.push([at_us, x, y, turn]);
        if frame.places.len() >= PLACES {
            let mut keep = false;
            frame.places.retain(|_| {
                keep = !keep;
                keep
            });
            frame.stride = frame.stride.saturating_mul(2);
            self.thinned = true;
        }
    }

    fn scene(&mut self, topic: &str, value: &Value<'_>, at_ns: u64) {
        let at_us = at_ns / 1_000;
        let name = |id: &str| format!("{topic}\n{id}");
        for deletion in elements(value, "deletions") {
            let all = match deletion.field("type") {
                Some(Value::Enum { number, .. }) => *number == 1,
                Some(Value::Text(text)) => text == "ALL",
                _ => false,
            };
            let id = name(&text(deletion, "id"));
            let is_its = |key: &String| *key == id || all && key.starts_with(&name(""));
            for (key, entity) in &mut self.entities {
                if is_its(key) && entity.versions.last().is_some_and(|(_, s)| s.is_some()) {
                    entity.change(at_us, None);
                }
            }
        }
        for entity in elements(value, "entities") {
            let id = name(&text(entity, "id"));
            let shape = self.shape(entity);
            let entity = self.entities.entry(id).or_default();
            if let Some(shape) = shape
                && entity.versions.last().map(|(_, last)| *last) != Some(Some(shape))
            {
                entity.change(at_us, Some(shape));
            }
        }
    }

    /// The number of an entity's shapes; none if there is no room for more.
    fn shape(&mut self, entity: &Value<'_>) -> Option<usize> {
        let mut all = Vec::new();
        for lines in elements(entity, "lines") {
            all.push(self::lines(lines));
        }
        for cube in elements(entity, "cubes") {
            let [x, y, turn] = place(cube, "pose.position", "pose.orientation");
            let [w, h] = ["size.x", "size.y"].map(|path| centimetres(number(cube, path)));
            all.push(json!({ "s": "box", "c": colour(cube), "p": [x, y, turn, w, h] }));
        }
        for round in ["spheres", "cylinders"]
            .into_iter()
            .flat_map(|field| elements(entity, field))
        {
            let [x, y, _] = place(round, "pose.position", "pose.orientation");
            let d = centimetres(number(round, "size.x"));
            all.push(json!({ "s": "disc", "c": colour(round), "p": [x, y, d] }));
        }
        for label in elements(entity, "texts") {
            let [x, y, _] = place(label, "pose.position", "pose.orientation");
            all.push(json!({ "s": "text", "p": [x, y], "t": text(label, "text") }));
        }
        let shape = json!({ "f": text(entity, "frame_id"), "a": all });
        let key = shape.to_string();
        if let Some(known) = self.known.get(&key) {
            return Some(*known);
        }
        if self.shape_bytes + key.len() > SHAPE_BYTES {
            self.left_out += 1;
            return None;
        }
        self.shape_bytes += key.len();
        self.known.insert(key, self.shapes.len());
        self.shapes.push(shape);
        Some(self.shapes.len() - 1)
    }

    /// True if there is nothing that a map could show.
    pub(super) fn is_empty(&self) -> bool {
        self.frames.is_empty() && self.entities.values().all(|e| e.versions.is_empty())
    }

    /// What the page is told of it.
    pub(super) fn told(&self) -> Json {
        let frame = |(name, frame): (&String, &Frame)| {
            // By column, each number since the one before.
            let column = |which: usize| -> Vec<i64> {
                let mut before = 0;
                let differences = frame.places.iter().map(|place| {
                    let since = place[which].wrapping_sub(before);
                    before = place[which];
                    since
                });
                differences.collect()
            };
            json!({
                "name": name, "parent": frame.parent, "thing": frame.is_thing,
                "t": column(0), "x": column(1), "y": column(2), "a": column(3),
            })
        };
        let entity = |(id, entity): (&String, &Entity)| {
            let (topic, id) = id.split_once('\n').unwrap_or(("", id));
            json!({ "topic": topic, "id": id, "v": entity.versions })
        };
        json!({
            "frames": self.frames.iter().map(frame).collect::<Vec<_>>(),
            "entities": self.entities.iter().map(entity).collect::<Vec<_>>(),
            "shapes": self.shapes,
            "left_out": self.left_out,
            "thinned": self.thinned,
        })
    }
}

/// Lines as pairs of points, in the frame of their entity.
fn lines(lines: &Value<'_>) -> Json {
    let [x0, y0, turn] = place(lines, "pose.position", "pose.orientation");
    let (sin, cos) = libm::sincos(turn as f64 / 1_000.0);
    let points: Vec<[i64; 2]> = elements(lines, "points")
        .iter()
        .map(|point| {
            let (x, y) = (number(point, "x") * 100.0, number(point, "y") * 100.0);
            let whole = |number: f64| libm::round(number).clamp(-1e12, 1e12) as i64;
            [x0 + whole(cos * x - sin * y), y0 + whole(sin * x + cos * y)]
        })
        .collect();
    let indices = lines.field("indices");
    let count = indices.and_then(Value::elements).unwrap_or(0);
    let index = |at: usize| {
        let index = indices.and_then(|list| list.element(at))?.as_f64()?;
        points.get(index as usize).copied()
    };
    let ends: Vec<[i64; 2]> = match count {
        0 => points,
        count => (0..count).filter_map(index).collect(),
    };
    let strip = match lines.field("type") {
        Some(Value::Enum { number, .. }) => *number,
        Some(Value::Text(text)) if text == "LINE_STRIP" => 0,
        Some(Value::Text(text)) if text == "LINE_LOOP" => 1,
        Some(Value::Text(_)) => 2,
        _ => 0,
    };
    let flat: Vec<i64> = ends.into_iter().flatten().collect();
    json!({ "s": "lines", "c": colour(lines), "k": strip, "p": flat })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn object(fields: Vec<(&'static str, Value<'static>)>) -> Value<'static> {
        let fields = fields.into_iter();
        Value::Object(fields.map(|(name, value)| (name.into(), value)).collect())
    }

    fn point(x: f64, y: f64) -> Value<'static> {
        object(vec![("x", Value::Float(x)), ("y", Value::Float(y))])
    }

    fn transform(x: f64) -> Value<'static> {
        object(vec![(
            "transforms",
            Value::List(vec![object(vec![
                ("parent_frame_id", Value::from("map")),
                ("child_frame_id", Value::from("r1/base_link")),
                ("translation", point(x, -1.0)),
                ("rotation", object(vec![("w", Value::Float(1.0))])),
            ])]),
        )])
    }

    #[test]
    fn frames_that_stand_are_told_once_and_bounded_when_they_move() {
        let mut map = Map::default();
        for at in 0..3 {
            map.add("foxglove.FrameTransforms", "/tf", &transform(2.5), at);
        }
        let told = map.told();
        assert_eq!(told["frames"][0]["x"], json!([250]));
        assert_eq!(told["frames"][0]["y"], json!([-100]));
        for at in 0..5 * PLACES as u64 {
            let message = transform(at as f64);
            map.add("foxglove.FrameTransforms", "/tf", &message, at * 1_000);
        }
        assert!(map.frames["r1/base_link"].places.len() < PLACES);
        assert_eq!(map.told()["thinned"], true);
    }

    #[test]
    fn entities_have_versions_and_end_when_they_are_deleted() {
        let entity = |d: f64| {
            object(vec![
                ("id", Value::from("rocks/1")),
                ("frame_id", Value::from("map")),
                (
                    "spheres",
                    Value::List(vec![object(vec![(
                        "size",
                        object(vec![("x", Value::Float(d))]),
                    )])]),
                ),
            ])
        };
        let update = |d: f64| object(vec![("entities", Value::List(vec![entity(d)]))]);
        let mut map = Map::default();
        for (at, d) in [(0, 1.0), (1_000, 1.0), (2_000, 2.0), (3_000, 1.0)] {
            map.add("foxglove.SceneUpdate", "/scene", &update(d), at);
        }
        let gone = object(vec![(
            "deletions",
            Value::List(vec![object(vec![("id", Value::from("rocks/1"))])]),
        )]);
        map.add("foxglove.SceneUpdate", "/scene", &gone, 4_000);
        let told = map.told();
        let versions = json!([[0, 0], [2, 1], [3, 0], [4, null]]);
        assert_eq!(told["entities"][0]["v"], versions);
        assert_eq!(told["shapes"].as_array().unwrap().len(), 2);
    }

    #[test]
    fn what_is_no_number_is_a_place_all_the_same() {
        let mut map = Map::default();
        let message = transform(f64::NAN);
        map.add("foxglove.FrameTransforms", "/tf", &message, 0);
        map.add("foxglove.SceneUpdate", "/s", &Value::Null, 0);
        map.add("tf2_msgs/msg/TFMessage", "/tf", &Value::Int(3), 0);
        assert_eq!(map.told()["frames"][0]["x"], json!([0]));
    }
}
