//! Poses: a scene may draw a heading in the plane or an orientation in space, and the log has both
//! in the form that viewers read.

use farside::RunInfo;
use farside::prelude::*;
use farside::record::Record;
use farside::scene::{Drawing, Pose, Scene};
use farside_logs::{Compression, LogOptions, LogWriter, info};

/// Draws one thing, in one pose, before anything happens.
#[derive(Debug)]
struct Still(Pose);

impl Scene for Still {
    fn begin(&mut self, _: &RunInfo, out: &mut Vec<Drawing>) {
        out.push(Drawing::Poses {
            topic: "/poses/lander".to_owned(),
            frame: "map".to_owned(),
            poses: vec![self.0],
        });
    }

    fn record(&mut self, _: &Record<'_>, _: &RunInfo, _: &mut Vec<Drawing>) {}
}

/// The bytes of a log without compression in which something stands in this pose.
fn logged(pose: Pose) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    let options = LogOptions {
        scene: Some(Box::new(Still(pose))),
        compression: Compression::None,
        ..LogOptions::default()
    };
    let mut sim = Simulation::new(1);
    sim.observe(LogWriter::create(&path, options).expect("a log"));
    sim.run(Executor::Inline).expect("it can start");
    let topics = info(&path).expect("it is a log").topics;
    let poses = topics.iter().find(|topic| topic.topic == "/poses/lander");
    assert_eq!(poses.expect("it is drawn").schema, "foxglove.PosesInFrame");
    std::fs::read(&path).expect("it can be read")
}

/// `foxglove.Quaternion` by protobuf's rules: its parts in order, zeros left out.
fn quaternion(parts: [f64; 4]) -> Vec<u8> {
    let parts = (1u8..).zip(parts).filter(|(_, part)| *part != 0.0);
    parts
        .flat_map(|(field, part)| [&[field << 3 | 1][..], &part.to_le_bytes()].concat())
        .collect()
}

fn holds(log: &[u8], bytes: &[u8]) -> bool {
    log.windows(bytes.len()).any(|window| window == bytes)
}

#[test]
fn an_orientation_is_logged_as_it_is_and_a_heading_as_a_turn_about_the_vertical() {
    let turned = [0.5, -0.5, 0.5, -0.5];
    assert!(holds(
        &logged(Pose::oriented([1.0, 2.0, 3.0], turned)),
        &quaternion(turned)
    ));
    let half = 0.5f64.sqrt();
    let north = logged(Pose::heading([1.0, 2.0, 3.0], [0.0, 7.0]));
    assert!(holds(&north, &quaternion([0.0, 0.0, half, half])));
    // The same turn, said as an orientation, is the same log.
    let said = Pose::oriented([1.0, 2.0, 3.0], [0.0, 0.0, half, half]);
    assert_eq!(logged(said), north);
}
