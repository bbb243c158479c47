//! Pictures and scenes of whole runs. What is drawn here is left in the folder for tests' files, for who
//! wants to look.

use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::scene::{Drawing, Facing, Level, Scene};
use farside::{Report, RunInfo};
use farside_actors::system::{
    PictureError, PictureRequest, Recorded, Recording, RecordingEnd, Seeds,
};

use crate::mission::K9;
use crate::scenario::Scenario;

/// A record of a run.
struct Kept {
    time_ns: u64,
    class: RecordClass,
    actor: String,
    kind: String,
    body: Vec<u8>,
}

/// A run that is kept in memory.
struct Tape {
    records: Vec<Kept>,
    end_ns: u64,
}

/// Keeps records, and what the system's scene draws of them.
struct Keep {
    run: Option<Arc<RunInfo>>,
    records: Arc<Mutex<Vec<Kept>>>,
    scene: Box<dyn Scene>,
    drawings: Arc<Mutex<Vec<Drawing>>>,
}

impl Observer for Keep {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            samples: true,
            checkpoints: false,
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        let mut out = Vec::new();
        self.scene.begin(run, &mut out);
        self.drawings.lock().unwrap().append(&mut out);
        self.run = Some(run.clone());
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let run = self.run.clone().expect("it has begun");
        let mut out = Vec::new();
        self.scene.record(record, &run, &mut out);
        self.drawings.lock().unwrap().append(&mut out);
        self.records.lock().unwrap().push(Kept {
            time_ns: record.time().since(SimTime::ZERO).as_nanos(),
            class: record.class,
            actor: run.name(record.receiver).to_owned(),
            kind: record.kind.map_or("", |kind| kind.name()).to_owned(),
            body: record.body.to_vec(),
        });
        Ok(Flow::Continue)
    }
}

impl Recording for Tape {
    fn seeds(&self) -> Seeds {
        Seeds { run: 1, problem: 1 }
    }

    fn scenario(&self) -> &str {
        "idea/k9 <&>"
    }

    fn excluded(&self) -> &[String] {
        &[]
    }

    fn for_each(
        &self,
        visit: &mut dyn FnMut(&Recorded<'_>) -> Result<(), PictureError>,
    ) -> Result<RecordingEnd, PictureError> {
        for record in &self.records {
            visit(&Recorded {
                time_ns: record.time_ns,
                class: record.class,
                actor: &record.actor,
                kind: &record.kind,
                body: &record.body,
            })?;
        }
        Ok(RecordingEnd {
            time_ns: Some(self.end_ns),
            detail: String::new(),
        })
    }
}

/// A run of a scenario, and what its scene draws.
fn taped(text: &str) -> (Tape, Vec<Drawing>, Report) {
    let scenario = Scenario::read(text);
    let mut sim = Simulation::new(1);
    let mut assembly = scenario.assemble(1, &mut sim);
    sim.stop_at(SimTime::ZERO + scenario.until, "until");
    let (records, drawings) = (Arc::default(), Arc::default());
    sim.observe(Keep {
        run: None,
        records: Arc::clone(&records),
        scene: assembly.scene.take().expect("it has a scene"),
        drawings: Arc::clone(&drawings),
    });
    let report = sim.run(Executor::Inline).expect("it runs");
    let tape = Tape {
        records: std::mem::take(&mut *records.lock().unwrap()),
        end_ns: report.end_time.since(SimTime::ZERO).as_nanos(),
    };
    let drawings = std::mem::take(&mut *drawings.lock().unwrap());
    (tape, drawings, report)
}

/// A picture's text.
fn drawn(
    text: &str,
    tape: &Tape,
    picture: &str,
    request: &PictureRequest,
) -> Result<String, PictureError> {
    let scenario = Scenario::read(text);
    let mut sim = Simulation::new(1);
    let figure = scenario.set_up(1, &mut sim, |settings, mut setup| {
        settings.draw(picture, tape, request, &mut setup)
    })?;
    Ok(figure.standalone())
}

fn keep(name: &str, svg: &str) {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
    std::fs::write(folder.join(name), svg).expect("it can be written");
}

fn seconds(s: u64) -> Option<SimDuration> {
    Some(SimDuration::from_secs(s))
}

fn count(svg: &str, part: &str) -> usize {
    svg.matches(part).count()
}

#[test]
fn the_timelines_of_an_agent_have_a_lane_each_and_a_line_for_each_alarm() {
    let (tape, _, _) = taped(K9);
    let svg = drawn(K9, &tape, "timelines", &PictureRequest::default()).unwrap();
    keep("timelines-system.svg", &svg);
    assert_eq!(count(&svg, "class=\"lane\""), 14);
    assert_eq!(count(&svg, "class=\"mark-line alarm\" d=\"M") - 1, 2);
    assert_eq!(count(&svg, "class=\"mark-line broken\" d=\"M") - 1, 2);
    assert!(svg.contains("system of idea/k9 &lt;&amp;&gt;") && !svg.contains("<&"));
    // What came of each goal is told, of those that an alarm interrupted too.
    let goals = svg.split("<title>ImageAt(").skip(1);
    let goals: Vec<&str> = goals
        .filter_map(|rest| rest.split("</title>").next())
        .collect();
    assert_eq!(goals.len(), 6);
    assert!(
        goals.iter().all(|goal| goal.ends_with(", then ok")),
        "{goals:?}"
    );
    for cause in ["goal expanded", "next command", "alarm"] {
        assert!(svg.contains(&format!(">{cause}</text>")), "{cause}");
    }
    let again = drawn(K9, &tape, "timelines", &PictureRequest::default()).unwrap();
    assert_eq!(svg, again);
    let part = PictureRequest {
        from: seconds(50),
        at: seconds(110),
        ..PictureRequest::default()
    };
    let svg = drawn(K9, &tape, "timelines", &part).unwrap();
    keep("timelines-alarm.svg", &svg);
    assert_eq!(count(&svg, "class=\"mark-line alarm\" d=\"M") - 1, 1);
    let mission = PictureRequest {
        along: Some("mission".to_owned()),
        ..PictureRequest::default()
    };
    let svg = drawn(K9, &tape, "timelines", &mission).unwrap();
    keep("timelines-mission.svg", &svg);
    assert_eq!(count(&svg, "class=\"lane\""), 3);
    assert!(svg.contains(">goal received</text>") && svg.contains(" x Planning from 0:00 to"));
}

#[test]
fn the_map_has_goals_by_outcome_and_alarms_where_they_came() {
    let (tape, _, _) = taped(K9);
    let svg = drawn(K9, &tape, "map", &PictureRequest::default()).unwrap();
    keep("map.svg", &svg);
    // Each goal is on the ground and in the legend; an alarm and a fault are in the legend besides.
    assert_eq!(count(&svg, "class=\"goal done\""), 12);
    assert_eq!(count(&svg, "class=\"goal open\""), 0);
    assert_eq!(count(&svg, "class=\"alarm-place\""), 3);
    assert_eq!(count(&svg, "class=\"broken-place\""), 3);
    assert!(count(&svg, "class=\"backwards\"") > 2);
    let half = PictureRequest {
        at: seconds(260),
        ..PictureRequest::default()
    };
    let svg = drawn(K9, &tape, "map", &half).unwrap();
    keep("map-half.svg", &svg);
    assert_eq!(count(&svg, "class=\"goal done\""), 4);
    assert_eq!(count(&svg, "class=\"goal open\""), 8);
    assert_eq!(count(&svg, "class=\"alarm-place\""), 2);
}

#[test]
fn what_cannot_be_drawn_is_an_error_that_says_why() {
    let (tape, _, _) = taped(K9);
    let refused = |picture: &str, request: PictureRequest| {
        drawn(K9, &tape, picture, &request).unwrap_err().to_string()
    };
    let along = |name: &str| PictureRequest {
        along: Some(name.to_owned()),
        ..PictureRequest::default()
    };
    let span = |from_s: u64, at_s: u64| PictureRequest {
        from: seconds(from_s),
        at: seconds(at_s),
        ..PictureRequest::default()
    };
    let message = refused("timelines", along("sytem"));
    assert!(
        message.contains("one of mission, system; did you mean"),
        "{message}"
    );
    let message = refused("map", along("k8"));
    assert!(message.contains("expected a rover, one of k9"), "{message}");
    let message = refused("timelines", span(20, 20));
    assert!(
        message.contains("from 20s to 20s: expected a time span"),
        "{message}"
    );
    let message = refused("map", span(0, 100_000));
    assert!(
        message.contains("at 100000s: the run ended at"),
        "{message}"
    );
    let message = refused("maps", PictureRequest::default());
    assert!(message.contains("no picture \"maps\""), "{message}");
    let silent = Tape {
        records: Vec::new(),
        end_ns: 1_000_000_000,
    };
    let message = drawn(K9, &silent, "timelines", &PictureRequest::default()).unwrap_err();
    assert!(
        message.to_string().contains("no cycles of system"),
        "{message}"
    );
}

#[test]
fn an_agent_that_is_faulty_and_the_stop_that_follows_are_marked() {
    // A processor so slow that the system agent is faulty while the rover drives.
    let mut scenario: toml::Table = toml::from_str(K9).expect("it is TOML");
    scenario["until"] = "30min".into();
    let degrade = "processors = \"system/planner\"\nat = \"30s\"\nslowdown = 1000.0";
    let degrade: toml::Table = toml::from_str(degrade).expect("it is TOML");
    scenario.insert(
        "degrade".to_owned(),
        vec![toml::Value::Table(degrade)].into(),
    );
    let text = toml::to_string(&scenario).expect("it was TOML");
    let (tape, _, _) = taped(&text);
    let svg = drawn(&text, &tape, "timelines", &PictureRequest::default()).unwrap();
    keep("timelines-faulty.svg", &svg);
    assert_eq!(count(&svg, "class=\"mark-line faulty\" d=\"M") - 1, 1);
    assert!(count(&svg, "class=\"mark-line stopped\" d=\"M") > 1);
    assert!(svg.contains(">beyond the latency</text>"));
    let svg = drawn(&text, &tape, "map", &PictureRequest::default()).unwrap();
    keep("map-faulty.svg", &svg);
    assert_eq!(count(&svg, "class=\"goal done\""), 0);
}

#[test]
fn goals_that_are_given_up_are_marked() {
    // Two of the six goals need a camera that is out of order.
    let broken =
        "[[rover.fault]]\nat = \"1s\"\nkind = \"instrument-fails\"\npart = \"hawk_eye\"\n\n";
    let text = K9
        .replace(
            "[mission_agent]",
            &format!("{broken}[deliberation]\nattempts = 1\n\n[mission_agent]"),
        )
        .replace("name = \"wall\"", "name = \"w<a&ll\"");
    let (tape, drawings, _) = taped(&text);
    let svg = drawn(&text, &tape, "timelines", &PictureRequest::default()).unwrap();
    keep("timelines-given-up.svg", &svg);
    assert_eq!(count(&svg, "class=\"mark-line given-up\" d=\"M") - 1, 2);
    let svg = drawn(&text, &tape, "map", &PictureRequest::default()).unwrap();
    keep("map-given-up.svg", &svg);
    assert_eq!(count(&svg, "class=\"goal done\""), 8);
    assert_eq!(count(&svg, "class=\"goal given-up\""), 4);
    assert!(svg.contains("w&lt;a&amp;ll: given up at") && !svg.contains("w<a"));
    let told = |drawing: &Drawing| match drawing {
        Drawing::Text { message, .. } => message == "w<a&ll is given up",
        _ => false,
    };
    assert_eq!(drawings.iter().filter(|drawing| told(drawing)).count(), 1);
}

#[test]
fn every_alarm_is_on_the_map_and_over_the_timelines() {
    let text = include_str!("../../scenarios/k9-alarms.toml");
    let (tape, _, _) = taped(text);
    let svg = drawn(text, &tape, "timelines", &PictureRequest::default()).unwrap();
    keep("timelines-alarms.svg", &svg);
    let alarms = count(&svg, "class=\"mark-line alarm\" d=\"M") - 1;
    let svg = drawn(text, &tape, "map", &PictureRequest::default()).unwrap();
    keep("map-alarms.svg", &svg);
    assert!(alarms >= 4, "{alarms}");
    assert_eq!(count(&svg, "class=\"alarm-place\"") - 1, alarms);
}

#[test]
fn an_hour_of_three_rovers_can_be_read() {
    let text = K9.replace(
        "[mission_agent]",
        "[agents]\nrovers = 3\nstop_when_done = false\n\n[mission_agent]",
    );
    let (tape, _, _) = taped(&text);
    let svg = drawn(&text, &tape, "timelines", &PictureRequest::default()).unwrap();
    keep("timelines-hour.svg", &svg);
    assert!(svg.contains("class=\"many"));
    let svg = drawn(&text, &tape, "map", &PictureRequest::default()).unwrap();
    keep("map-three.svg", &svg);
    assert!(count(&svg, "class=\"goal ") >= 36);
}

#[test]
fn viewers_see_how_a_rover_stands_and_what_becomes_of_goals() {
    let (_, drawings, _) = taped(K9);
    // Tilted by a rock: what is above the rover is not above it on the map.
    let tilts = drawings.iter().filter_map(|drawing| match drawing {
        Drawing::Transform { child, pose, .. } if child == "k9/base_link" => match pose.facing {
            Facing::Orientation([x, y, _, _]) => Some(1.0 - 2.0 * (x * x + y * y)),
            Facing::Heading(_) => None,
        },
        _ => None,
    });
    let least = tilts.fold(1.0, f64::min);
    assert!(least < 0.95, "{least}");
    let texts = |level: Level| {
        let of = move |drawing: &&Drawing| matches!(drawing, Drawing::Text { level: it, .. } if *it == level);
        drawings.iter().filter(of).count()
    };
    // Two faults and the alarms they bring; six goals that are done.
    assert_eq!(texts(Level::Warning), 4);
    assert!(texts(Level::Info) >= 6);
    assert_eq!(texts(Level::Error), 0);
    let entities = |layer: &str| {
        let of = move |drawing: &&Drawing| matches!(drawing, Drawing::Entity { id, .. } if id.starts_with(layer));
        drawings.iter().filter(of).count()
    };
    assert_eq!((entities("goals/"), entities("alarms/")), (12, 2));
}
