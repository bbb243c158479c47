//! What viewers draw: in published schemas, in order, and no part of any comparison.

use std::path::Path;

use farside::RunInfo;
use farside::record::{Record, RecordClass};
use farside::scene::{Drawing, Form, Level, Pose, Scene, Shape};
use farside_logs::{DiffOptions, LogOptions, TopicInfo, Verifier, VerifyOutcome, diff, info};

use crate::common::{Plan, log_to, logged, options, run_with};

const EPOCH_NS: u64 = 1_900_000_000_000_000_000;

/// Draws a mast, rovers at each sample, and crashes.
#[derive(Debug)]
struct Masts;

impl Scene for Masts {
    fn begin(&mut self, run: &RunInfo, out: &mut Vec<Drawing>) {
        let shape = |form| Shape {
            form,
            position_m: [0.0, 0.0, 2.0],
            colour: [1.0, 0.5, 0.0, 1.0],
        };
        let points_m = vec![[0.0, 0.0, -2.0], [0.0; 3]];
        out.push(Drawing::Entity {
            id: "mast".to_owned(),
            frame: "map".to_owned(),
            shapes: vec![
                shape(Form::Lines {
                    points_m,
                    indices: Vec::new(),
                    thickness_m: 0.1,
                }),
                shape(Form::Sphere { diameter_m: 0.5 }),
                shape(Form::Label {
                    text: format!("seed {}", run.seed),
                    height_m: 0.3,
                }),
            ],
        });
    }

    fn record(&mut self, record: &Record<'_>, run: &RunInfo, out: &mut Vec<Drawing>) {
        let name = run.name(record.sender).to_owned();
        assert!(record.class != RecordClass::InFlight);
        match record.class {
            RecordClass::Sample => {
                let pose = Pose::heading([record.time().as_secs_f64(), 0.0, 0.0], [0.0, 1.0]);
                out.push(Drawing::Transform {
                    parent: "map".to_owned(),
                    child: format!("{name}/base_link"),
                    pose,
                });
                out.push(Drawing::Poses {
                    topic: format!("/poses/{name}"),
                    frame: "map".to_owned(),
                    poses: vec![pose],
                });
            }
            RecordClass::Crash => {
                out.push(Drawing::Remove { id: name.clone() });
                out.push(Drawing::Text {
                    level: Level::Warning,
                    name,
                    message: "crashed".to_owned(),
                });
            }
            _ => {}
        }
    }
}

fn drawn() -> LogOptions {
    LogOptions {
        scene: Some(Box::new(Masts)),
        ..options()
    }
}

fn viewed(path: &Path) -> Vec<TopicInfo> {
    let topics = info(path).unwrap().topics.into_iter();
    topics.filter(|topic| topic.role == "viewer").collect()
}

#[test]
fn drawings_are_topics_of_published_schemas() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    log_to(&path, &Plan::default(), drawn());
    let topics = viewed(&path);
    let named: Vec<_> = topics.iter().map(|t| (&*t.topic, &*t.schema)).collect();
    let poses = "foxglove.PosesInFrame";
    let expected = [
        ("/log", "foxglove.Log"),
        ("/poses/rover_1", poses),
        ("/poses/rover_2", poses),
        ("/poses/rover_3", poses),
        ("/scene", "foxglove.SceneUpdate"),
        ("/tf", "foxglove.FrameTransforms"),
    ];
    assert_eq!(named, expected);
    // The mast, and the one that is gone.
    assert_eq!((topics[0].messages, topics[4].messages), (1, 2));
    let samples = topics[1..4].iter().map(|t| t.messages).sum::<u64>();
    assert_eq!(topics[5].messages, samples);
    assert!(topics.iter().all(|topic| topic.encoding == "protobuf"));
}

#[test]
fn a_log_with_drawings_is_the_same_as_one_without() {
    let (_folder, plain, report) = logged(&Plan::default());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let seen = log_to(&path, &Plan::default(), drawn());
    assert_eq!(seen.digest, report.digest);
    let verifier = Verifier::open(&path).unwrap();
    let handle = verifier.handle();
    run_with(&Plan::default(), verifier);
    assert!(matches!(
        handle.outcome().unwrap(),
        VerifyOutcome::Same { .. }
    ));
    let difference = diff(&plain, &path, &DiffOptions::default()).unwrap();
    assert!(difference.identical, "{difference}");
    assert!(viewed(&plain).is_empty());
}

#[test]
fn drawings_are_in_order_shifted_by_the_epoch_and_excluded_like_any_topic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let options = LogOptions {
        epoch_ns: EPOCH_NS,
        exclude: vec!["/poses/*".to_owned(), "/state/**".to_owned()],
        ..drawn()
    };
    log_to(&path, &Plan::default(), options);
    let names: Vec<_> = viewed(&path).into_iter().map(|t| t.topic).collect();
    assert_eq!(names, ["/log", "/scene", "/tf"]);
    let mut times = Vec::new();
    let mut first_transform = None;
    let bytes = std::fs::read(&path).unwrap();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        times.push(message.log_time);
        if message.channel.topic == "/tf" {
            let at = (message.log_time, message.data.into_owned());
            first_transform.get_or_insert(at);
        }
    }
    assert_eq!(times[0], EPOCH_NS);
    assert!(times.is_sorted());
    // The stamp within says the same as the message's own time.
    let (time, body) = first_transform.unwrap();
    let pool = published_pool(&bytes);
    let transforms = pool.get_message_by_name("foxglove.FrameTransforms");
    let decoded = prost_reflect::DynamicMessage::decode(transforms.unwrap(), &*body).unwrap();
    let all = decoded.get_field_by_name("transforms").unwrap();
    let transform = all.as_list().unwrap()[0].as_message().unwrap();
    let stamp = transform.get_field_by_name("timestamp").unwrap();
    let stamp = stamp.as_message().unwrap();
    let seconds = stamp.get_field_by_name("seconds").unwrap().as_i64();
    assert_eq!(seconds, Some((time / 1_000_000_000) as i64));
    let child = transform.get_field_by_name("child_frame_id").unwrap();
    assert!(child.as_str().unwrap().ends_with("/base_link"));
}

/// What the log says of `/tf`.
fn published_pool(bytes: &[u8]) -> prost_reflect::DescriptorPool {
    let summary = mcap::Summary::read(bytes).unwrap().unwrap();
    let transforms =
        |schema: &&std::sync::Arc<mcap::Schema<'static>>| schema.name == "foxglove.FrameTransforms";
    let schema = summary.schemas.values().find(transforms).unwrap();
    prost_reflect::DescriptorPool::decode(&*schema.data).unwrap()
}
