//! Reading logs record by record.

use farside::record::RecordClass;
use farside_logs::{Log, LoggedRecord};
use prost_reflect::DynamicMessage;

use crate::common::{Odometry, Plan, logged};

#[test]
fn every_record_is_read_back() {
    let (_folder, path, report) = logged(&Plan::default());
    let log = Log::open(&path).unwrap();
    assert_eq!(log.scenario(), Some("rovers = 3\n"));
    assert_eq!(
        (log.seed(), log.scenario_name()),
        (7, "tests/base_and_rovers")
    );
    assert_eq!(log.attachments().len(), 2);
    let records: Vec<LoggedRecord> = log.records().unwrap().map(Result::unwrap).collect();
    let count = |class| records.iter().filter(|r| r.class == class).count() as u64;
    assert_eq!(count(RecordClass::Delivered), report.counts.delivered);
    assert_eq!(count(RecordClass::Lost), report.counts.lost);
    assert_eq!(
        (count(RecordClass::Crash), count(RecordClass::Restart)),
        (1, 1)
    );
    assert_eq!(
        (count(RecordClass::Change), count(RecordClass::Stop)),
        (1, 1)
    );
    assert!(count(RecordClass::Sample) > 0 && count(RecordClass::Timer) > 0);
    let stop = records
        .iter()
        .find(|r| r.class == RecordClass::Stop)
        .unwrap();
    assert_eq!(
        (stop.note.as_str(), stop.sender.as_str()),
        ("enough cycles", "base")
    );
    let sample = records
        .iter()
        .find(|r| r.class == RecordClass::Sample)
        .unwrap();
    assert!(sample.sender.starts_with("rover_") && sample.kind == "Pose");
    for record in records.iter().filter(|r| r.class == RecordClass::Lost) {
        assert!(record.topic.starts_with("/lost/") && !record.reason.is_empty());
    }
}

#[test]
fn how_a_message_was_carried_is_read_back() {
    let (_folder, path, _) = logged(&Plan::default());
    let mut records = Log::open(&path).unwrap().records().unwrap();
    let mut seen = 0;
    while let Some((record, _)) = records.next_ref().unwrap() {
        if let Some(carriage) = record.carriage {
            let delay_ns = record.key.time_ns - record.sent_ns;
            assert_eq!(carriage.total().as_nanos(), delay_ns);
            assert_eq!((carriage.attempts, carriage.energy_j), (1, 0.125));
            seen += 1;
        }
    }
    assert!(seen > 0);
}

#[test]
fn other_programs_read_how_a_message_was_carried() {
    let (_folder, path, _) = logged(&Plan::default());
    let bytes = std::fs::read(&path).unwrap();
    let mut seen = 0;
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        if schema.name != "farside.record.Odometry" {
            continue;
        }
        let pool = prost_reflect::DescriptorPool::decode(&schema.data[..]).unwrap();
        let descriptor = pool.get_message_by_name(&schema.name).unwrap();
        let envelope = DynamicMessage::decode(descriptor, &message.data[..]).unwrap();
        let parts = envelope.get_field_by_name("carriage").unwrap();
        let field = |name| {
            parts
                .as_message()?
                .get_field_by_name(name)
                .map(|v| v.into_owned())
        };
        if field("attempts").and_then(|v| v.as_u32()) == Some(1) {
            let delay_ns = message.log_time - message.publish_time;
            assert_eq!(
                field("jitter_ns").unwrap().as_i64(),
                Some(-(delay_ns as i64))
            );
            assert_eq!(
                field("propagation_ns").unwrap().as_u64(),
                Some(2 * delay_ns)
            );
            assert_eq!(field("energy_j").unwrap().as_f64(), Some(0.125));
            seen += 1;
        }
    }
    assert!(seen > 0);
}

#[test]
fn bodies_decode_field_by_field_and_back_to_their_types() {
    let (_folder, path, _) = logged(&Plan::default());
    let schema = farside::encoding::Schema::of::<Odometry>().unwrap();
    let mut records = Log::open(&path).unwrap().records().unwrap();
    let mut seen = 0;
    while let Some((record, channel)) = records.next_ref().unwrap() {
        if record.kind != "Odometry" {
            continue;
        }
        let typed: Odometry = schema.decode(record.body).unwrap();
        let schema_of = channel.schema.as_ref().unwrap();
        assert_eq!(schema_of.name, "farside.record.Odometry");
        let pool = prost_reflect::DescriptorPool::decode(&schema_of.data[..]).unwrap();
        let descriptor = pool.get_message_by_name(&schema_of.name).unwrap();
        let body = descriptor.get_field_by_name("body").unwrap();
        let prost_reflect::Kind::Message(body) = body.kind() else {
            panic!("no message")
        };
        let dynamic = DynamicMessage::decode(body, record.body).unwrap();
        let distance = dynamic.get_field_by_name("distance_m").unwrap().as_f64();
        assert_eq!(distance, Some(typed.distance_m));
        seen += 1;
    }
    assert!(seen > 10);
}

#[test]
fn times_in_the_file_never_decrease() {
    let (_folder, path, _) = logged(&Plan::default());
    let bytes = std::fs::read(&path).unwrap();
    let times: Vec<u64> = mcap::MessageStream::new(&bytes)
        .unwrap()
        .map(|m| m.unwrap().log_time)
        .collect();
    assert!(times.windows(2).all(|two| two[0] <= two[1]));
}
