//! The network-guided system as viewers draw it: the roadmap in the colours of its nodes, the
//! nodes, rovers that drive, and which of them are coordinated.
//!
//! All of it is told by committed samples: a rover's frame is placed when it sets out and when it
//! arrives, and viewers move it in between. The coordination graph is told as it is when a planning
//! cycle begins, if it is another than in the cycle before.

use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;

use crate::Network;
use crate::safety::messages::RoverState;
use farside::record::{Record, RecordClass};
use farside::scene::{Drawing, Form, Level, Pose, Scene};
use farside::{RunInfo, SimDuration};
use farside_worlds::{NodeId, Roadmap, SensorNetwork, VertexId};

use farside_actors::drawing::{self, MAP, base_link, layered, poses, shape, text};

use crate::picture::colouring;
use crate::picture::coordinated;
use crate::world::crater;

/// What the coordination graph is called.
const COORDINATION: &str = "coordination";
const COORDINATED: [f64; 4] = [0.9, 0.9, 0.9, 0.25];

pub(super) struct NetworkScene {
    roadmap: Arc<Roadmap>,
    sensors: Arc<SensorNetwork>,
    system: Arc<Network>,
    /// The roadmap lies in the built-in crater.
    in_crater: bool,
    /// The shortest edge \[m\]: what is drawn is as large as fits.
    scale_m: f64,
    /// By the number of the actor in the run; none for those that are no rovers.
    rovers: Vec<Option<DrawnRover>>,
    collisions: u32,
    /// Of each node.
    colours: Vec<[f64; 4]>,
    cycle_ns: u64,
    /// The planning cycle.
    cycle: u64,
    /// The vertices that were last told of as held.
    told: Vec<VertexId>,
}

/// A rover as it was last drawn.
#[derive(Clone, Copy)]
struct DrawnRover {
    on_the_map: bool,
    /// The vertex that it stands on, or drives to.
    holds: Option<VertexId>,
    heading: [f64; 2],
}

impl fmt::Debug for NetworkScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "NetworkScene({})", self.roadmap.name())
    }
}

impl NetworkScene {
    pub(super) fn new(
        roadmap: Arc<Roadmap>,
        sensors: Arc<SensorNetwork>,
        cycle: SimDuration,
        system: Arc<Network>,
        in_crater: bool,
    ) -> Self {
        let length = |&(u, v): &(VertexId, VertexId)| {
            let step = roadmap.position_m(v) - roadmap.position_m(u);
            (step.x * step.x + step.y * step.y).sqrt()
        };
        let shortest = roadmap.edges().iter().map(length).reduce(f64::min);
        let colours = colouring::colours(&roadmap, &sensors).into_iter();
        let colours = colours.map(|colour| {
            let [red, green, blue] = colouring::RGB[colour];
            [red, green, blue, 1.0]
        });
        NetworkScene {
            scale_m: shortest.unwrap_or(1.0),
            colours: colours.collect(),
            cycle_ns: cycle.as_nanos().max(1),
            cycle: 0,
            told: Vec::new(),
            roadmap,
            sensors,
            system,
            in_crater,
            rovers: Vec::new(),
            collisions: 0,
        }
    }

    fn place(&self, vertex: VertexId) -> [f64; 3] {
        let position = self.roadmap.position_m(vertex);
        [position.x, position.y, self.roadmap.height_m(vertex)]
    }

    /// The edges in the colours of their ends' owners; what joins two territories is parted in its
    /// middle.
    fn roads(&self) -> Drawing {
        let mut of_nodes = vec![Vec::new(); self.sensors.len()];
        for &(u, v) in self.roadmap.edges() {
            let (from, to) = (self.place(u), self.place(v));
            let (a, b) = (self.sensors.owner(u), self.sensors.owner(v));
            if a == b {
                of_nodes[a.0 as usize].extend([from, to]);
            } else {
                let middle = [0, 1, 2].map(|axis| 0.5 * (from[axis] + to[axis]));
                of_nodes[a.0 as usize].extend([from, middle]);
                of_nodes[b.0 as usize].extend([middle, to]);
            }
        }
        let parts = of_nodes.into_iter().zip(&self.colours);
        let part = |(points_m, colour): (Vec<[f64; 3]>, &[f64; 4])| {
            let lines = Form::Lines {
                points_m,
                indices: Vec::new(),
                thickness_m: 0.06 * self.scale_m,
            };
            shape(lines, [0.0; 3], *colour)
        };
        Drawing::Entity {
            id: layered("map", "roadmap"),
            frame: MAP.to_owned(),
            shapes: parts.map(part).collect(),
        }
    }

    /// The vertices of each node, for viewers that draw no entities: a topic each, because they
    /// colour by topic.
    fn territories(&self) -> impl Iterator<Item = Drawing> {
        self.system
            .node_names()
            .iter()
            .zip(self.sensors.nodes())
            .map(|(name, node)| {
                let owned = self.sensors.owned(node).iter();
                let places = owned.map(|v| Pose::at(self.place(*v))).collect();
                poses(&format!("roadmap/{name}"), places)
            })
    }

    /// The coordination graph (section 3.2) of the cycle that begins, if it is another than before:
    /// lines between all pairs of rovers whose owners are the same node or neighbours.
    fn coordinate(&mut self, out: &mut Vec<Drawing>) {
        if !self.system.coordinates() {
            return;
        }
        let holds = self.rovers.iter().flatten().filter_map(|drawn| drawn.holds);
        let mut held: Vec<VertexId> = holds.collect();
        held.sort_unstable();
        if held == self.told {
            return;
        }
        let mut indices = Vec::new();
        for (i, u) in (0..).zip(&held) {
            let others = (0..).zip(&held).skip(i as usize + 1);
            let joined = others.filter(|(_, v)| coordinated(&self.sensors, *u, **v));
            indices.extend(joined.flat_map(|(j, _)| [i, j]));
        }
        // For viewers that draw no entities: the middle of each line.
        let ends = indices.chunks_exact(2).map(|pair| [pair[0], pair[1]]);
        let middle = |pair: [u32; 2]| {
            let [from, to] = pair.map(|at| self.place(held[at as usize]));
            Pose::at([0, 1, 2].map(|axis| 0.5 * (from[axis] + to[axis])))
        };
        out.push(poses(COORDINATION, ends.map(middle).collect()));
        let id = layered(COORDINATION, "graph");
        out.push(if indices.is_empty() {
            Drawing::Remove { id }
        } else {
            let lines = Form::Lines {
                points_m: held.iter().map(|v| self.place(*v)).collect(),
                indices,
                thickness_m: 0.02 * self.scale_m,
            };
            Drawing::Entity {
                id,
                frame: MAP.to_owned(),
                shapes: vec![shape(lines, [0.0; 3], COORDINATED)],
            }
        });
        self.told = held;
    }

    /// The nodes' places: as high as the nearest vertex, because heights are known at vertices.
    fn posts(&self) -> Vec<[f64; 3]> {
        let post = |node| {
            let at = self.sensors.position_m(node);
            let distance = |v: &VertexId| (self.roadmap.position_m(*v) - at).norm_squared();
            let near = |a: &VertexId, b: &VertexId| distance(a).total_cmp(&distance(b));
            let nearest = self.roadmap.vertices().min_by(near);
            let height_m = nearest.map_or(0.0, |v| self.roadmap.height_m(v));
            [at.x, at.y, height_m]
        };
        self.sensors.nodes().map(post).collect()
    }

    fn node(&self, node: NodeId, name: &str, [x, y, z]: [f64; 3]) -> Drawing {
        let diameter_m = 0.4 * self.scale_m;
        let ball = shape(
            Form::Sphere { diameter_m },
            [x, y, z],
            self.colours[node.0 as usize],
        );
        Drawing::Entity {
            id: layered("nodes", name),
            frame: MAP.to_owned(),
            shapes: vec![
                ball,
                drawing::label(name, [x, y, z + diameter_m], 0.5 * self.scale_m),
            ],
        }
    }

    /// A rover's sample: where it is now, and which way it faces.
    fn follow(
        &self,
        name: &str,
        drawn: &mut DrawnRover,
        state: &RoverState,
        out: &mut Vec<Drawing>,
    ) {
        let whereabouts = &state.whereabouts;
        drawn.holds = whereabouts.place().claim();
        let Some(vertex) = whereabouts.vertex else {
            if drawn.on_the_map {
                drawn.on_the_map = false;
                out.push(Drawing::Remove {
                    id: layered("rovers", name),
                });
                out.push(poses(name, Vec::new()));
                out.push(text(Level::Info, name, "arrived and left"));
            }
            return;
        };
        let position_m = self.place(vertex);
        if let Some(to) = whereabouts.moving_to {
            let [x, y, _] = self.place(to);
            drawn.heading = [x - position_m[0], y - position_m[1]];
        }
        let pose = Pose::heading(position_m, drawn.heading);
        out.push(Drawing::Transform {
            parent: MAP.to_owned(),
            child: base_link(name),
            pose,
        });
        if !drawn.on_the_map {
            drawn.on_the_map = true;
            out.push(drawing::rover(name, self.scale_m));
        }
        out.push(poses(name, vec![pose]));
    }

    /// The monitor sees each sample before it is logged, and counts.
    fn tell_collisions(&mut self, name: &str, out: &mut Vec<Drawing>) {
        let collisions = self.system.collisions();
        if collisions > self.collisions {
            let message = "collision: it is where another rover is, or is bound to be";
            out.push(text(Level::Error, name, message));
        }
        self.collisions = collisions;
    }
}

impl Scene for NetworkScene {
    fn begin(&mut self, run: &RunInfo, out: &mut Vec<Drawing>) {
        let names: BTreeSet<&String> = self.system.rover_names().iter().collect();
        let drawn = |entity: &farside::Entity| {
            names.contains(&entity.name).then_some(DrawnRover {
                on_the_map: false,
                holds: None,
                heading: [1.0, 0.0],
            })
        };
        self.rovers = run.entities.iter().map(drawn).collect();
        if let Some(crater) = self.in_crater.then(crater).and_then(Result::ok) {
            out.extend(drawing::net(
                crater.terrain(),
                "crater",
                0.02 * self.scale_m,
            ));
        }
        out.push(self.roads());
        let posts = self.posts();
        out.extend(self.territories());
        let nodes = self.system.node_names().iter().zip(&posts);
        let nodes = self.sensors.nodes().zip(nodes);
        out.extend(nodes.map(|(node, (name, post))| self.node(node, name, *post)));
        out.push(poses("nodes", posts.into_iter().map(Pose::at).collect()));
    }

    fn record(&mut self, record: &Record<'_>, run: &RunInfo, out: &mut Vec<Drawing>) {
        let cycle = record.time().as_nanos() / self.cycle_ns;
        if cycle > self.cycle {
            self.cycle = cycle;
            self.coordinate(out);
        }
        let name = run.name(record.receiver);
        match record.class {
            RecordClass::Crash => out.push(text(Level::Warning, name, "crashed")),
            RecordClass::Restart => out.push(text(Level::Info, name, "restarted")),
            // Deadlocks are told here: the monitor stops the run for them, and says so.
            RecordClass::Stop => {
                let reason = String::from_utf8_lossy(record.body);
                out.push(text(Level::Info, name, &format!("stopped: {reason}")));
            }
            RecordClass::Sample => {
                let at = record.sender.index();
                let name = run.name(record.sender);
                let drawn = self.rovers.get(at).copied().flatten();
                if let Some(mut drawn) = drawn
                    && let Some(kind) = record.kind
                    && let Ok(state) = kind.schema().decode(record.body)
                {
                    self.follow(name, &mut drawn, &state, out);
                    self.rovers[at] = Some(drawn);
                    self.tell_collisions(name, out);
                }
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use crate::testing::assembled;
    use crate::{NetworkConfig, Sabotage, TeamConfig, WorldConfig};
    use farside::prelude::*;
    use farside::record::{Flow, Observer, ObserverError};

    use super::*;

    /// Shows the scene what a log writer would.
    struct Show(NetworkScene, Option<Arc<RunInfo>>, Arc<Mutex<Vec<Drawing>>>);

    impl Observer for Show {
        fn wants(&self) -> farside::record::Wants {
            farside::record::Wants {
                bodies: true,
                samples: true,
                checkpoints: false,
            }
        }

        fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
            self.0.begin(run, &mut self.2.lock().unwrap());
            self.1 = Some(run.clone());
            Ok(())
        }

        fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
            let run = self.1.as_ref().unwrap();
            self.0.record(record, run, &mut self.2.lock().unwrap());
            Ok(Flow::Continue)
        }
    }

    /// What is drawn of a small team, and how many collisions there were.
    fn drawn(rovers: u32, sabotage: Sabotage) -> (Vec<Drawing>, u32) {
        let world = WorldConfig::default();
        let roadmap = Arc::new(Roadmap::builtin(world.roadmap.name()).unwrap());
        let sensors = Arc::new(world.place(&roadmap, 1).unwrap());
        let network = NetworkConfig {
            sabotage,
            ..NetworkConfig::default()
        };
        let team = TeamConfig::of(rovers);
        let (map, posts) = (roadmap.clone(), sensors.clone());
        let (mut sim, system) = assembled(1, &world, map, posts, &team, &network);
        let system = Arc::new(system);
        let drawings = Arc::new(Mutex::new(Vec::new()));
        let scene = NetworkScene::new(roadmap, sensors, system.cycle(), system.clone(), true);
        sim.observe(Show(scene, None, drawings.clone()));
        sim.stop_at(SimTime::ZERO + SimDuration::from_secs(120), "enough");
        sim.run(Executor::Inline).unwrap();
        let drawings = drawings.lock().unwrap().clone();
        (drawings, system.collisions())
    }

    fn count(drawings: &[Drawing], counted: impl Fn(&Drawing) -> bool) -> usize {
        drawings.iter().filter(|drawing| counted(drawing)).count()
    }

    #[test]
    fn the_ground_and_who_is_coordinated_are_drawn_without_entities_too() {
        let (drawings, _) = drawn(20, Sabotage::None);
        let points = |name: &str| {
            let of = |d: &Drawing| match d {
                Drawing::Poses { topic, poses, .. } if topic.ends_with(name) => Some(poses.clone()),
                _ => None,
            };
            drawings.iter().filter_map(of).collect::<Vec<_>>()
        };
        let ground = crater().unwrap();
        let knots = points("/crater");
        assert_eq!(
            (knots.len(), knots[0].len()),
            (1, drawing::GROUND_POINTS * drawing::GROUND_POINTS)
        );
        for knot in &knots[0] {
            let [x, y, z] = knot.position_m;
            assert!((ground.terrain().height_m(x, y) - z).abs() < 1e-9);
        }
        assert!(
            points("/coordination")
                .iter()
                .any(|middles| !middles.is_empty())
        );
    }

    #[test]
    fn each_rover_is_drawn_once_and_removed_once() {
        let (drawings, _) = drawn(3, Sabotage::None);
        let rover = |id: &str| id.starts_with("rovers/rover_");
        let come = count(
            &drawings,
            |d| matches!(d, Drawing::Entity { id, .. } if rover(id)),
        );
        let gone = count(
            &drawings,
            |d| matches!(d, Drawing::Remove { id } if rover(id)),
        );
        assert_eq!((come, gone), (3, 3));
        let entity = |d: &Drawing| match d {
            Drawing::Entity { id, .. } => Some(id.clone()),
            _ => None,
        };
        let first: Vec<String> = drawings.iter().filter_map(entity).take(2).collect();
        assert_eq!(first, ["map/crater", "map/roadmap"]);
        let moves = count(&drawings, |d| matches!(d, Drawing::Transform { .. }));
        assert!(moves > 6, "{moves}");
    }

    #[test]
    fn collisions_are_told() {
        let told = |d: &Drawing| {
            matches!(
                d,
                Drawing::Text {
                    level: Level::Error,
                    ..
                }
            )
        };
        assert_eq!(count(&drawn(3, Sabotage::None).0, told), 0);
        let (drawings, collisions) = drawn(30, Sabotage::MoveUnbidden(0.5));
        let texts = count(&drawings, told);
        assert!(
            collisions > 0 && texts > 0 && texts <= collisions as usize,
            "{texts} texts of {collisions} collisions"
        );
    }
}
