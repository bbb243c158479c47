//! What systems draw for viewers with: the frame that all stand in, names of layers and topics, and the
//! ground as a net. What is drawn of a run is for its system to say, in a
//! [`Scene`](farside::scene::Scene).

use farside::scene::{Drawing, Form, Level, Pose, Shape};
use farside_worlds::HeightField;

use crate::rover::RoverPose;

/// The frame of the world: x east, y north, z up \[m\].
pub const MAP: &str = "map";

/// The colour of ground \[red, green, blue, opacity, 0 to 1\].
pub const GROUND: [f64; 4] = [0.6, 0.5, 0.4, 0.35];

/// The colour of rovers.
pub const ROVERS: [f64; 4] = [0.95, 0.55, 0.1, 1.0];

/// The colour of where rovers believe to be.
pub const BELIEVED: [f64; 4] = [0.95, 0.75, 0.4, 0.35];

/// The colour of names.
pub const NAMES: [f64; 4] = [1.0, 1.0, 1.0, 1.0];

/// How many points the ground is drawn by, each way.
pub const GROUND_POINTS: usize = 25;

/// An entity's id on a layer, which viewers show or hide.
///
/// ```
/// assert_eq!(farside_actors::drawing::layered("rovers", "rover_01"), "rovers/rover_01");
/// ```
pub fn layered(layer: &str, name: &str) -> String {
    format!("{layer}/{name}")
}

/// The frame of a rover, as ROS names it.
///
/// ```
/// assert_eq!(farside_actors::drawing::base_link("rover_01"), "rover_01/base_link");
/// ```
pub fn base_link(name: &str) -> String {
    format!("{name}/base_link")
}

/// A shape at a place \[m\] in its entity's frame.
pub fn shape(form: Form, position_m: [f64; 3], colour: [f64; 4]) -> Shape {
    Shape {
        form,
        position_m,
        colour,
    }
}

/// Where things are in the world, on the topic `/poses/{name}`.
pub fn poses(name: &str, poses: Vec<Pose>) -> Drawing {
    Drawing::Poses {
        topic: format!("/poses/{name}"),
        frame: MAP.to_owned(),
        poses,
    }
}

/// A line of log text.
pub fn text(level: Level, name: &str, message: &str) -> Drawing {
    Drawing::Text {
        level,
        name: name.to_owned(),
        message: message.to_owned(),
    }
}

/// A name, in letters of this height \[m\].
pub fn label(name: &str, position_m: [f64; 3], height_m: f64) -> Shape {
    let text = name.to_owned();
    shape(Form::Label { text, height_m }, position_m, NAMES)
}

/// A rover as a box with its name, in its own frame: it is drawn once, and its frame moves. It is half
/// as long as `scale_m`.
pub fn rover(name: &str, scale_m: f64) -> Drawing {
    let size_m = [0.5, 0.35, 0.25].map(|part| part * scale_m);
    let above = |height: f64| [0.0, 0.0, height * scale_m];
    Drawing::Entity {
        id: layered("rovers", name),
        frame: base_link(name),
        shapes: vec![
            shape(Form::Cube { size_m }, above(0.125), ROVERS),
            label(name, above(0.4), 0.5 * scale_m),
        ],
    }
}

/// Where a rover is and how it stands, in truth.
///
/// ```
/// use farside::scene::Facing;
/// use farside_actors::drawing::rover_pose;
/// use farside_actors::rover::RoverPose;
/// // Nose up by 90 degrees: a turn about what is left of it, against the right hand.
/// let up = RoverPose { pitch_rad: std::f64::consts::FRAC_PI_2, ..RoverPose::default() };
/// let Facing::Orientation([x, y, z, w]) = rover_pose(&up).facing else { panic!() };
/// let half = 0.5f64.sqrt();
/// assert!((y + half).abs() < 1e-12 && (w - half).abs() < 1e-12 && x == 0.0 && z == 0.0);
/// ```
pub fn rover_pose(pose: &RoverPose) -> Pose {
    let place_m = [pose.east_m, pose.north_m, pose.height_m];
    // Heading first, then nose up, then right side down, each in what the turns before left.
    Pose::oriented(place_m, turned(pose.yaw_rad, pose.pitch_rad, pose.roll_rad))
}

/// A turn by angles \[rad\] as a unit quaternion, x, y, z, w: to the left, then nose up, then right side
/// down.
pub fn turned(left_rad: f64, up_rad: f64, down_right_rad: f64) -> [f64; 4] {
    let half = |angle_rad: f64| (libm::sin(0.5 * angle_rad), libm::cos(0.5 * angle_rad));
    let ((sz, cz), (sy, cy), (sx, cx)) = (half(left_rad), half(-up_rad), half(down_right_rad));
    [
        sx * cy * cz - cx * sy * sz,
        cx * sy * cz + sx * cy * sz,
        cx * cy * sz - sx * sy * cz,
        cx * cy * cz + sx * sy * sz,
    ]
}

/// A rover where it is, with roll and pitch, and a faint box where it believes to be; it is half as long
/// as `scale_m`.
pub fn follow(name: &str, pose: &RoverPose, scale_m: f64) -> [Drawing; 3] {
    let here = rover_pose(pose);
    let believed_m = [pose.estimated_east_m, pose.estimated_north_m, pose.height_m];
    let size_m = [0.5, 0.35, 0.25].map(|part| part * scale_m);
    [
        Drawing::Transform {
            parent: MAP.to_owned(),
            child: base_link(name),
            pose: here,
        },
        poses(name, vec![here]),
        Drawing::Entity {
            id: layered("believed", name),
            frame: MAP.to_owned(),
            shapes: vec![shape(Form::Cube { size_m }, believed_m, BELIEVED)],
        },
    ]
}

/// The ground as a net on the layer `map`; for viewers that draw no entities, its knots as poses. Both
/// are called `name`.
///
/// ```
/// use farside_actors::drawing::net;
/// use farside_worlds::HeightField;
/// use nalgebra::Point2;
/// let level = HeightField::new(Point2::origin(), 1.0, 100, vec![0.0; 10_000])?;
/// assert_eq!(net(&level, "crater", 0.1).len(), 2);
/// # Ok::<(), farside_worlds::TerrainError>(())
/// ```
pub fn net(terrain: &HeightField, name: &str, thickness_m: f64) -> [Drawing; 2] {
    let last = GROUND_POINTS - 1;
    let sample = |at: usize, of: usize| at * (of - 1) / last;
    let knot = |row: usize, column: usize| {
        let (column, row) = (
            sample(column, terrain.columns()),
            sample(row, terrain.rows()),
        );
        let at = terrain.sample_position_m(column, row);
        let height_m = terrain.heights_m()[row * terrain.columns() + column];
        [at.x, at.y, height_m]
    };
    let rows = 0..GROUND_POINTS;
    let all = rows.flat_map(|row| (0..GROUND_POINTS).map(move |column| (row, column)));
    let points_m: Vec<[f64; 3]> = all.clone().map(|(row, column)| knot(row, column)).collect();
    let number = |row: usize, column: usize| (row * GROUND_POINTS + column) as u32;
    let mut indices = Vec::new();
    for (row, column) in all {
        if column < last {
            indices.extend([number(row, column), number(row, column + 1)]);
        }
        if row < last {
            indices.extend([number(row, column), number(row + 1, column)]);
        }
    }
    let knots = points_m.iter().copied().map(Pose::at).collect();
    let lines = Form::Lines {
        points_m,
        indices,
        thickness_m,
    };
    let net = Drawing::Entity {
        id: layered("map", name),
        frame: MAP.to_owned(),
        shapes: vec![shape(lines, [0.0; 3], GROUND)],
    };
    [net, poses(name, knots)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a turn makes of a vector.
    fn apply([x, y, z, w]: [f64; 4], v: [f64; 3]) -> [f64; 3] {
        let turn = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
        (turn * nalgebra::Vector3::from(v)).into()
    }

    fn is_near(a: [f64; 3], b: [f64; 3]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12)
    }

    #[test]
    fn a_rover_turns_left_then_nose_up_then_right_side_down() {
        use libm::{cos, sin};
        let (left, up, down) = (0.7, 0.3, 0.2);
        let turn = turned(left, up, down);
        // What is ahead rises with the pitch, whatever the roll.
        let ahead = [cos(up) * cos(left), cos(up) * sin(left), sin(up)];
        assert!(is_near(apply(turn, [1.0, 0.0, 0.0]), ahead));
        // Its left side rises with the roll: by its sine, as far as it does not pitch.
        let [_, _, rises] = apply(turn, [0.0, 1.0, 0.0]);
        assert!(f64::abs(rises - sin(down) * cos(up)) < 1e-12, "{rises}");
        let level = turned(left, 0.0, 0.0);
        let beside = [-sin(left), cos(left), 0.0];
        assert!(is_near(apply(level, [0.0, 1.0, 0.0]), beside));
    }
}
